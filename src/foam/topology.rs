//! T1s by geometry: when a film has shrunk, its network edge flips and the films round it are extruded anew.
//!
//! An edge flips when it is shorter than a part of the cell width. Each flip of an edge lowers the part for that edge, and
//! the new edge is laid longer than the threshold: so no edge flips back and forth for ever.
//!
//! At a plane that cuts the gap off the same T1 takes a film off the plane or lays a cell against it: an edge of the rim
//! (`network/rim.rs`) becomes a film or a film one of the rim. A film that slides round a corner between two planes changes
//! from one to the other.

use super::{
    network::{EdgeId, HalfEdgeId, Network, VertexId},
    relax::State,
};
use crate::{
    index::IndexVec,
    surface::{CutPlane, Gap, LevelSet},
};
use glam::DVec3;

/// By how much each flip of an edge lowers its threshold.
const WEARINESS: f64 = 0.6;

/// The new edge's length in units of the cell width. Shorter ones are pulled apart in more steps, longer ones disturb the
/// neighbours more.
const NEW_LENGTH: f64 = 0.12;

/// The most of its shortest neighbour's length that a new edge may have: longer ones would cross others.
const ROOM: f64 = 0.5;

/// The distance between the ends of every edge.
#[must_use]
pub fn edge_lengths(state: &State) -> IndexVec<EdgeId, f64> {
    state
        .network
        .edges()
        .map(|edge| {
            let (start, end) = state.chord(edge);
            start.distance(end)
        })
        .collect()
}

/// The edges that may flip, are shorter than `part` of the cell width and were longer `before`; the shortest first. Short edges
/// that grow are left alone: a rough start has many.
#[must_use]
pub fn vanishing_edges(state: &State, before: &IndexVec<EdgeId, f64>, part: f64) -> Vec<EdgeId> {
    let width = state.cell_width();
    let mut short: Vec<(f64, EdgeId)> = edge_lengths(state)
        .enumerated()
        .filter_map(|(edge, &length)| {
            let weary = WEARINESS.powi(i32::try_from(state.flips_of_edge[edge]).unwrap_or(i32::MAX));
            let relative = length / (width * part * weary);
            (relative < 1.0 && length < before[edge] && state.network.can_flip(edge).is_ok())
                .then_some((relative, edge))
        })
        .collect();
    short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    short.into_iter().map(|(_, edge)| edge).collect()
}

/// The two ends of an edge and their four other neighbours.
#[must_use]
pub fn round(network: &Network, edge: EdgeId) -> Vec<VertexId> {
    let ends = edge.half_edges().map(|side| network.origin(side));
    let mut round: Vec<VertexId> = ends
        .iter()
        .flat_map(|&end| network.outgoing(end).map(|side| network.target(side)))
        .chain(ends)
        .collect();
    round.sort_unstable();
    round.dedup();
    round
}

/// Passes that draw vertices apart, and how far each goes towards the mean of the neighbours: a tangle of a few vertices
/// opens, and the rest of the foam keeps its shape.
const PASSES: usize = 4;
const PART: f64 = 0.5;

/// Moves every vertex towards the mean of its neighbours, along the middle surface.
pub fn draw_apart(network: &mut Network, gap: &Gap) {
    for _ in 0..PASSES {
        let moved: Vec<(VertexId, DVec3)> = network
            .vertices()
            .map(|vertex| {
                let here = network.position(vertex);
                let pull: DVec3 = network.outgoing(vertex).map(|side| network.edge_vector(side) / 3.0).sum();
                let level = gap.middle().value(here);
                let there = gap.middle().project(here + PART * pull, level).unwrap_or(here);
                let plane = network.plane_of(vertex).map(|place| network.planes()[place]);
                (vertex, plane.map_or(there, |plane| plane.nearest_to(there)))
            })
            .collect();
        for (vertex, place) in moved {
            network.set_position(vertex, place);
        }
    }
}

/// Does the T1 of an edge: flips the network, turns the edge across the middle surface and lays the five
/// films that meet it anew. Gives whether it was done; otherwise only the edge's threshold has changed.
pub fn flip(state: &mut State, gap: &Gap, edge: EdgeId) -> bool {
    let before = state.clone();
    state.follow_films();
    if flip_in_place(state, gap, edge).is_some() {
        return true;
    }
    *state = before;
    state.flips_of_edge[edge] += 1;
    false
}

/// The length of an edge after its flip: what the neighbours leave room for.
fn new_length(state: &State, edge: EdgeId) -> f64 {
    let network = &state.network;
    let length = |edge| {
        let (start, end) = state.chord(edge);
        start.distance(end)
    };
    let shortest = edge
        .half_edges()
        .iter()
        .flat_map(|&side| network.outgoing(network.origin(side)))
        .map(HalfEdgeId::edge)
        .filter(|&other| other != edge)
        .map(length)
        .fold(f64::INFINITY, f64::min);
    (ROOM * shortest).min(NEW_LENGTH * state.cell_width()).max(length(edge))
}

fn flip_in_place(state: &mut State, gap: &Gap, edge: EdgeId) -> Option<()> {
    let (start, end) = state.chord(edge);
    let length = new_length(state, edge);
    let [first, second] = edge.half_edges().map(|side| end_plane(&state.network, state.network.origin(side)));
    let plane = first.or(second);
    state.network.flip(edge).ok()?;
    let [u, v] = edge.half_edges().map(|side| state.network.origin(side));
    // On a plane it lies where the old edge ended.
    let middle = match (first, second) {
        (None, Some(_)) => end,
        (Some(_), None) => start,
        (None, None) => 0.5 * (start + end),
        (Some(plane), Some(_)) => plane.nearest_to(0.5 * (start + end)),
    };
    let far = state.network.period().translation(state.network.target_shift(edge.half_edges()[0]));
    let [to_u, to_v] = match plane {
        None => {
            let left = across(&state.network, gap, edge, middle);
            [0.5 * length * left, -0.5 * length * left]
        }
        Some(plane) => along_or_off(&state.network, gap, edge, plane, middle).map(|way| length * way),
    };
    for (vertex, place) in [(u, middle + to_u), (v, middle + to_v - far)] {
        let ends = end_plane(&state.network, vertex).and(plane);
        state.network.set_position(vertex, ends.map_or(place, |plane| plane.nearest_to(place)));
    }
    let cells =
        [u, v].map(|w| state.network.outgoing(w).map(|side| state.network.cell(side)).collect::<Vec<_>>());
    if cells.iter().flatten().any(|&cell| !state.network.is_outside(cell) && state.network.spans(cell)) {
        return None;
    }
    lay_round(state, gap, &[u, v])?;
    state.flips += 1;
    state.flips_of_edge[edge] += 1;
    Some(())
}

/// The plane on which a film ends at `vertex`.
fn end_plane(network: &Network, vertex: VertexId) -> Option<CutPlane> {
    network.plane_of(vertex).map(|place| network.planes()[place])
}

/// The direction from the middle of a flipped edge to its origin: across the middle surface from the neighbours of the one
/// new corner to those of the other, since the old edge is too short to say where to turn.
fn across(network: &Network, gap: &Gap, edge: EdgeId, middle: DVec3) -> DVec3 {
    let side = edge.half_edges()[0];
    let far = network.period().translation(network.target_shift(side));
    let neighbours = |vertex: VertexId, frame: DVec3| -> DVec3 {
        let others = network.outgoing(vertex).filter(|&side| side.edge() != edge);
        others.map(|side| 0.5 * (network.position(vertex) + network.edge_vector(side) + frame)).sum()
    };
    let across = neighbours(network.origin(side), DVec3::ZERO) - neighbours(network.target(side), far);
    let up = gap.middle().normal(middle);
    (across - across.dot(up) * up).normalize_or(up.any_orthonormal_vector())
}

/// From where an edge that was flipped at `plane` met it to its origin and to its target, in lengths of the edge: along the
/// plane to both sides if it lies on the rim now, and off the plane with one end if it is a film.
fn along_or_off(network: &Network, gap: &Gap, edge: EdgeId, plane: CutPlane, at: DVec3) -> [DVec3; 2] {
    let up = gap.middle().normal(at);
    if network.is_rim(edge) {
        let way = across(network, gap, edge, at);
        let along = up.cross(plane.inward()).normalize_or(up.any_orthonormal_vector());
        let along = if along.dot(way) < 0.0 { -along } else { along };
        return [0.5 * along, -0.5 * along];
    }
    let off = (plane.inward() - plane.inward().dot(up) * up).normalize_or(plane.inward());
    edge.half_edges().map(|side| {
        let ends_here = network.plane_of(network.origin(side)).is_some();
        if ends_here { DVec3::ZERO } else { off }
    })
}

/// Lays the columns of some vertices anew, and all films that meet them.
fn lay_round(state: &mut State, gap: &Gap, vertices: &[VertexId]) -> Option<()> {
    for &vertex in vertices {
        state.strips.lay_column(&state.network, gap, vertex, &mut state.places).ok()?;
    }
    let edges = vertices.iter().flat_map(|&vertex| state.network.outgoing(vertex).map(HalfEdgeId::edge));
    for edge in edges.collect::<Vec<EdgeId>>() {
        state.strips.lay_film(&state.network, gap, edge, &mut state.places).ok()?;
    }
    Some(())
}

/// A film's end that has slid round a corner: it lies beyond another plane than its own by more than `margin`. Gives its
/// vertex and that plane's place in [`Network::planes`].
#[must_use]
pub fn slid_round(state: &State, margin: f64) -> Option<(VertexId, usize)> {
    let network = &state.network;
    let mut ends = network.rim().flat_map(|edge| edge.half_edges().map(|side| network.origin(side)));
    ends.find_map(|vertex| {
        let own = network.plane_of(vertex);
        let place = state.places[state.middle_node(vertex)];
        let beyond =
            |&(other, plane): &(usize, &CutPlane)| own != Some(other) && plane.value(place) < -margin;
        network.planes().iter().enumerate().find(beyond).map(|(other, _)| (vertex, other))
    })
}

/// Lets the film that ends at `vertex` end on another plane, round the corner, and lays it anew. Gives whether that was done.
pub fn turn_corner(state: &mut State, gap: &Gap, vertex: VertexId, other: usize) -> bool {
    let before = state.clone();
    state.follow_films();
    let done = turn_in_place(state, gap, vertex, other).is_some();
    if !done {
        *state = before;
    }
    done
}

fn turn_in_place(state: &mut State, gap: &Gap, vertex: VertexId, other: usize) -> Option<()> {
    let (own, next) = (end_plane(&state.network, vertex)?, state.network.planes()[other]);
    let here = state.network.position(vertex);
    let beside = next.nearest_to(here) + NEW_LENGTH * state.cell_width() * own.inward();
    let place = gap.middle().project(beside, gap.middle().value(here)).ok()?;
    state.network.set_position(vertex, next.nearest_to(place));
    lay_round(state, gap, &[vertex])
}
