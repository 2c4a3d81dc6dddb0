//! A one-layer foam taken over from its network: each border from wall to wall gives a corner on either wall, each film a
//! quadrilateral between two borders and its edges on the walls.

use super::{
    Division, FreeFilms, Side,
    division::{Corner, CornerImage, Polygon, Stacking},
    films::films_refined,
    finer::{laid_within, piece},
};
use crate::{
    foam::{
        complex::{NodeImage, quadratic},
        network::{EdgeId, VertexId},
        relax::State,
    },
    index::Id,
    surface::{Gap, WallSide},
};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// The cells of a network's foam in `gap`, the part that it fills, and their films with `fineness` elements on each half side,
/// at least one, where the network's lie.
pub(super) fn taken_over(state: &State, gap: &Gap, fineness: usize) -> (Division, FreeFilms) {
    let (network, strips) = (&state.network, state.strips);
    let last = strips.rows() - 1;
    let corners = network.vertices().flat_map(|vertex| {
        [(0, WallSide::Lower), (last, WallSide::Upper)].map(|(row, wall)| Corner {
            place: state.places[strips.border_node(vertex, row)],
            wall: Some(wall),
            plane: network.plane_of(vertex),
        })
    });
    let polygons = network.films().map(|edge| polygon(state, edge)).collect();
    let mut division = Division {
        seeds: network.cells().map(|cell| network.centre(cell)).collect(),
        stacking: Stacking::One,
        volumes: state.shares.iter().copied().collect(),
        period: network.period(),
        planes: network.planes().to_vec(),
        euler: 0,
        corners: corners.collect(),
        polygons,
    };
    division.euler = division.euler_of(WallSide::Lower);
    let mut films = films_refined(&division, gap, fineness, &lines(state, gap));
    let edges: Vec<EdgeId> = network.films().collect();
    laid_within(&mut films, fineness, |film, quad, u, v| on_strip(state, edges[film.index()], quad, u, v));
    (division, films)
}

/// The place on a network's film in its polygon's quadrilateral at a corner, in the frame of the cell on its left.
fn on_strip(state: &State, edge: EdgeId, quad: usize, u: f64, v: f64) -> DVec3 {
    let (network, strips) = (&state.network, state.strips);
    // Corners go along the lower wall and back along the upper one.
    let (along, through) = match quad {
        0 => (0.5 * u, 0.5 * v),
        1 => (1.0 - 0.5 * v, 0.5 * u),
        2 => (1.0 - 0.5 * u, 1.0 - 0.5 * v),
        _ => (0.5 * v, 1.0 - 0.5 * u),
    };
    let ((i, u), (j, v)) = (piece(along, strips.along), piece(through, strips.through));
    let ((columns, _), (rows, _)) = (quadratic(u), quadratic(v));
    let back = network.cell_shift(edge.half_edges()[0]);
    let place = |column: usize, row: usize| {
        let image = strips.film_node(network, edge, 2 * i + column, 2 * j + row);
        state.places[image.node] + network.period().translation(image.shift - back)
    };
    let weighted = |at: usize| columns[at % 3] * rows[at / 3] * place(at % 3, at / 3);
    (0..9).map(weighted).sum()
}

fn corner(vertex: VertexId, wall: WallSide) -> usize {
    2 * vertex.index() + wall as usize
}

/// The quadrilateral of a film, in the frame of the cell on its left.
fn polygon(state: &State, edge: EdgeId) -> Polygon {
    let network = &state.network;
    let [left, right] = edge.half_edges();
    let back = network.cell_shift(left);
    let image = |vertex, wall, shift: IVec3| CornerImage {
        corner: corner(vertex, wall),
        shift: (shift - back).to_array(),
    };
    let ends = [(network.origin(left), IVec3::ZERO), (network.target(left), network.target_shift(left))];
    let [low, high] = WallSide::BOTH.map(|wall| ends.map(|(vertex, shift)| image(vertex, wall, shift)));
    Polygon {
        cell: network.cell(left).index(),
        neighbour: network.cell(right).index(),
        shift: network.cell_shift(right) + network.target_shift(left) - back,
        corners: vec![low[0], low[1], high[1], high[0]],
    }
}

/// The network's borders and its films' edges on the walls, as lines that other films can be laid along.
fn lines(state: &State, gap: &Gap) -> FreeFilms {
    let (network, strips) = (&state.network, state.strips);
    let last = strips.rows() - 1;
    let border = |vertex| {
        let nodes =
            (0..=last).map(|row| NodeImage { node: strips.border_node(vertex, row), shift: IVec3::ZERO });
        ((corner(vertex, WallSide::Lower), corner(vertex, WallSide::Upper), [0; 3]), nodes.collect())
    };
    let borders: BTreeMap<Side, Vec<NodeImage>> = network.vertices().map(border).collect();
    let mut wall_edges = BTreeMap::new();
    for edge in network.films() {
        let side = edge.half_edges()[0];
        let (from, to, shift) = (network.origin(side), network.target(side), network.target_shift(side));
        for (row, wall) in [(0, WallSide::Lower), (last, WallSide::Upper)] {
            let nodes =
                (0..strips.columns()).map(|column| strips.film_node(network, edge, column, row)).collect();
            let (key, nodes) = keyed((corner(from, wall), corner(to, wall), shift.to_array()), nodes);
            wall_edges.insert(key, nodes);
        }
    }
    FreeFilms::of_lines(strips.complex(network, gap), state.places.clone(), borders, wall_edges)
}

/// A line from the corner of lower number to that of higher number, in the frame of the first.
fn keyed((from, to, shift): Side, mut nodes: Vec<NodeImage>) -> (Side, Vec<NodeImage>) {
    if (from, [0; 3]) <= (to, shift) {
        return ((from, to, shift), nodes);
    }
    let back = -IVec3::from_array(shift);
    nodes.reverse();
    nodes.iter_mut().for_each(|image| image.shift += back);
    ((to, from, back.to_array()), nodes)
}
