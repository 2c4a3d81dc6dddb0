//! A network extruded from wall to wall: one film for each edge, one column of nodes (a Plateau border) for each vertex.
//!
//! A film is a strip of `along × through` biquadratic elements; its nodes form a grid of `2·along + 1` columns of
//! `2·through + 1`. The numbers of the nodes follow from the ids of vertices and edges and do not change in a T1. An edge of
//! the rim, where a plane cuts the gap off, has nodes but no film: they draw the line in which its cell ends (`rim.rs`).

use super::{
    Complex, Element, Film, Motion, Node, NodeId, NodeImage, Places, Region, RegionId, RegionImage,
    RegionKind, Shape, WallId,
};
use crate::{
    foam::network::{CellId, EdgeId, HalfEdgeId, Network, VertexId},
    index::{Id, IndexVec},
    surface::{Gap, Wall},
};
use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, LazyLock};

/// How finely films are meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Strips {
    /// Elements along an edge.
    pub along: usize,
    /// Elements from wall to wall.
    pub through: usize,
}

/// `count` as a number.
pub(super) fn real(count: usize) -> f64 {
    f64::from(crate::index::checked_u32(count))
}

impl Strips {
    /// Nodes along an edge, both ends included.
    #[must_use]
    pub fn columns(self) -> usize {
        2 * self.along + 1
    }

    /// Nodes from wall to wall.
    #[must_use]
    pub fn rows(self) -> usize {
        2 * self.through + 1
    }

    /// The node of a border, `row` 0 on the lower wall.
    #[must_use]
    pub fn border_node(self, vertex: VertexId, row: usize) -> NodeId {
        NodeId::from_index(vertex.index() * self.rows() + row)
    }

    /// A node of a film, in the frame of the origin of its edge's first half-edge; `column` 0 is that origin's border.
    #[must_use]
    pub fn film_node(self, network: &Network, edge: EdgeId, column: usize, row: usize) -> NodeImage {
        let side = edge.half_edges()[0];
        if column == 0 {
            return NodeImage { node: self.border_node(network.origin(side), row), shift: IVec3::ZERO };
        }
        if column + 1 == self.columns() {
            let node = self.border_node(network.target(side), row);
            return NodeImage { node, shift: network.target_shift(side) };
        }
        let inner = edge.index() * (self.columns() - 2) + column - 1;
        let index = (network.vertices().len() + inner) * self.rows() + row;
        NodeImage { node: NodeId::from_index(index), shift: IVec3::ZERO }
    }

    /// The complex of a network: films in the order of their edges, regions in that of their cells; first the walls of the
    /// gap, then the planes that cut it off.
    #[must_use]
    pub fn complex(self, network: &Network, gap: &Gap) -> Complex {
        let mut walls: IndexVec<WallId, _> = gap.walls().to_vec().into();
        for &plane in network.planes() {
            walls.push(Wall { field: Arc::new(plane), level: 0.0 });
        }
        let regions = network
            .cells()
            .map(|cell| Region { kind: RegionKind::Cell, anchor: network.centre(cell) })
            .collect();
        let mut nodes = IndexVec::new();
        for vertex in network.vertices() {
            let plane = network.plane_of(vertex).map(|place| WallId::from_index(gap.walls().len() + place));
            for row in 0..self.rows() {
                let walls = self.walls_of(row).into_iter().chain(plane).collect();
                nodes.push(Node { walls, motion: self.border_motion(vertex, row) });
            }
        }
        for edge in network.edges() {
            let is_rim = network.is_rim(edge);
            for column in 1..self.columns() - 1 {
                for row in 0..self.rows() {
                    nodes.push(if is_rim {
                        Node { walls: Vec::new(), motion: self.rim_motion(network, edge, column, row) }
                    } else {
                        let motion = self.inner_motion(network, edge, column, row);
                        Node { walls: self.walls_of(row), motion }
                    });
                }
            }
        }
        let films = network.films().map(|edge| self.film(network, edge)).collect();
        Complex { period: network.period(), walls, regions, nodes, films }
    }

    fn walls_of(self, row: usize) -> Vec<WallId> {
        match row {
            0 => vec![WallId::from_index(0)],
            row if row + 1 == self.rows() => vec![WallId::from_index(1)],
            _ => Vec::new(),
        }
    }

    fn border_motion(self, vertex: VertexId, row: usize) -> Motion {
        let last = self.rows() - 1;
        if row == 0 || row == last {
            return Motion::Free;
        }
        let part = real(row) / real(last);
        Motion::Border(vec![
            (self.border_node(vertex, 0), 1.0 - part),
            (self.border_node(vertex, last), part),
        ])
    }

    /// Inner nodes keep their place between the borders and between the walls (a Coons patch of the motions at the film's
    /// four sides). Following the borders alone, a film that slides along a curved wall would leave its own middle behind.
    fn inner_motion(self, network: &Network, edge: EdgeId, column: usize, row: usize) -> Motion {
        let node = |column, row| self.film_node(network, edge, column, row).node;
        Motion::Inner(coons([column, self.columns() - 1], [row, self.rows() - 1], node))
    }

    fn film(self, network: &Network, edge: EdgeId) -> Film {
        let [left, right] = edge.half_edges();
        // Along × up points to the right of the edge as seen from the upper wall.
        let back = RegionImage { region: region_of(network.cell(left)), shift: network.cell_shift(left) };
        let front = RegionImage {
            region: region_of(network.cell(right)),
            shift: network.cell_shift(right) + network.target_shift(left),
        };
        let mut elements = Vec::with_capacity(self.along * self.through);
        for j in 0..self.through {
            for i in 0..self.along {
                let nodes =
                    (0..9).map(|at| self.film_node(network, edge, 2 * i + at % 3, 2 * j + at / 3)).collect();
                elements.push(Element { shape: Shape::Quad9, nodes });
            }
        }
        Film { front, back, tension: 1.0, elements }
    }

    /// First places for all nodes: straight columns along the gradient through the vertices, films through the middles of
    /// the edges.
    ///
    /// # Errors
    /// The edge or vertex whose foot on a wall was not found.
    pub fn first_places(self, network: &Network, gap: &Gap) -> Result<Places, NoExtrusion> {
        let count = self.rows() * (network.vertices().len() + network.edges().len() * (self.columns() - 2));
        let mut places = Places::from_elem(DVec3::ZERO, count);
        for vertex in network.vertices() {
            self.lay_column(network, gap, vertex, &mut places)?;
        }
        for edge in network.edges() {
            self.lay_film(network, gap, edge, &mut places)?;
        }
        Ok(places)
    }

    /// Lays the column of a vertex from wall to wall through the vertex.
    ///
    /// # Errors
    /// As [`Strips::first_places`].
    pub fn lay_column(
        self,
        network: &Network,
        gap: &Gap,
        vertex: VertexId,
        places: &mut Places,
    ) -> Result<(), NoExtrusion> {
        let column = self.straight_column(gap, network.position(vertex))?;
        let plane = network.plane_of(vertex).map(|place| network.planes()[place]);
        for (row, place) in column.into_iter().enumerate() {
            places[self.border_node(vertex, row)] = plane.map_or(place, |plane| plane.nearest_to(place));
        }
        Ok(())
    }

    /// Lays the inner nodes of a film, or of a line of the rim, afresh between its two columns.
    ///
    /// # Errors
    /// As [`Strips::first_places`].
    pub fn lay_film(
        self,
        network: &Network,
        gap: &Gap,
        edge: EdgeId,
        places: &mut Places,
    ) -> Result<(), NoExtrusion> {
        if network.is_rim(edge) {
            return self.lay_rim(network, gap, edge, places);
        }
        let last = self.columns() - 1;
        let side = edge.half_edges()[0];
        let far = network.period().translation(network.target_shift(side));
        let middle_row = self.rows() / 2;
        let start = places[self.border_node(network.origin(side), middle_row)];
        let end = places[self.border_node(network.target(side), middle_row)] + far;
        let middle = middle_of(network, gap, side, start, end)?;
        let lift = middle - 0.5 * (start + end);
        for column in 1..last {
            let part = real(column) / real(last);
            let bend = 4.0 * part * (1.0 - part) * lift;
            let through: Vec<DVec3> = (0..self.rows())
                .map(|row| {
                    let a = places[self.border_node(network.origin(side), row)];
                    let b = places[self.border_node(network.target(side), row)] + far;
                    a.lerp(b, part) + bend
                })
                .collect();
            let foot =
                |wall: usize, p: DVec3| gap.walls()[wall].project(p).map_err(|_| NoExtrusion { place: p });
            let low = foot(0, through[0])?;
            let high = foot(1, through[self.rows() - 1])?;
            for row in 0..self.rows() {
                let image = self.film_node(network, edge, column, row);
                places[image.node] = low.lerp(high, real(row) / real(self.rows() - 1));
            }
        }
        Ok(())
    }

    pub(super) fn straight_column(self, gap: &Gap, p: DVec3) -> Result<Vec<DVec3>, NoExtrusion> {
        let foot = |wall: usize| gap.walls()[wall].project(p).map_err(|_| NoExtrusion { place: p });
        let (low, high) = (foot(0)?, foot(1)?);
        let last = real(self.rows() - 1);
        Ok((0..self.rows()).map(|row| low.lerp(high, real(row) / last)).collect())
    }

    /// The places on a finer mesh of the same films, by the shape functions of the coarser one; wall nodes must be brought
    /// onto their walls afterwards.
    #[must_use]
    pub fn refined(self, network: &Network, places: &Places, finer: Self) -> Places {
        let count = finer.rows() * (network.vertices().len() + network.edges().len() * (finer.columns() - 2));
        let mut fine = Places::from_elem(DVec3::ZERO, count);
        let translation = |shift| network.period().translation(shift);
        for edge in network.edges() {
            for column in 0..finer.columns() {
                for row in 0..finer.rows() {
                    let (i, u) = locate(column, finer.columns() - 1, self.along);
                    let (j, v) = locate(row, finer.rows() - 1, self.through);
                    let shape = Shape::Quad9.at(u, v, 1.0);
                    let place: DVec3 = (0..9)
                        .map(|at| {
                            let image = self.film_node(network, edge, 2 * i + at % 3, 2 * j + at / 3);
                            shape.value[at] * (places[image.node] + translation(image.shift))
                        })
                        .sum();
                    let image = finer.film_node(network, edge, column, row);
                    fine[image.node] = place - translation(image.shift);
                }
            }
        }
        fine
    }

    /// Moves the inner nodes along their films so that they are evenly spaced, by arc length along the edges and through the
    /// gap; wall nodes must be brought onto their walls afterwards. Gives the largest move.
    pub fn spread_evenly(self, network: &Network, places: &mut Places) -> f64 {
        let mut largest: f64 = 0.0;
        for vertex in network.vertices() {
            let ids: Vec<NodeImage> = (0..self.rows())
                .map(|row| NodeImage { node: self.border_node(vertex, row), shift: IVec3::ZERO })
                .collect();
            largest = largest.max(spread_curve(network, places, &ids));
        }
        for edge in network.films() {
            for row in 0..self.rows() {
                let ids: Vec<NodeImage> =
                    (0..self.columns()).map(|column| self.film_node(network, edge, column, row)).collect();
                largest = largest.max(spread_curve(network, places, &ids));
            }
            for column in 1..self.columns() - 1 {
                let ids: Vec<NodeImage> =
                    (0..self.rows()).map(|row| self.film_node(network, edge, column, row)).collect();
                largest = largest.max(spread_curve(network, places, &ids));
            }
        }
        largest
    }
}

/// A foot on a wall was not found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the films cannot be extruded: no foot on a wall was found from {place}; is the gap too wide for one layer there?"
)]
pub struct NoExtrusion {
    /// From where.
    pub place: DVec3,
}

fn region_of(cell: CellId) -> RegionId {
    RegionId::from_index(cell.index())
}

/// The element and the place in it of grid line `at` of `last`, on a grid of `elements` quadratic elements.
fn locate(at: usize, last: usize, elements: usize) -> (usize, f64) {
    let scaled = at * elements;
    let element = (scaled / last).min(elements - 1);
    (element, real(scaled - element * last) / real(last))
}

/// The middle of an edge on the middle surface. A long arc's chord may run far from the surface; then the middle between the
/// two cells beside it is the better guess.
fn middle_of(
    network: &Network,
    gap: &Gap,
    side: HalfEdgeId,
    start: DVec3,
    end: DVec3,
) -> Result<DVec3, NoExtrusion> {
    let surface = gap.middle();
    let chord = 0.5 * (start + end);
    let turned = surface.normal(start).dot(surface.normal(end)) < 0.0;
    let guess = if turned {
        let frame = |side: HalfEdgeId| network.period().translation(network.cell_shift(side));
        let far = network.period().translation(network.target_shift(side));
        0.5 * (network.centre(network.cell(side))
            + frame(side)
            + network.centre(network.neighbour(side))
            + frame(side.twin())
            + far)
    } else {
        chord
    };
    let level = 0.5 * (surface.value(start) + surface.value(end));
    surface.project(guess, level).map_err(|_| NoExtrusion { place: guess })
}

/// Gauss points for the length of a quadratic piece, good to 1e-8 of it: places of nodes along a film need no more.
static ARC_RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| super::shape::gauss(4));

/// Spaces the inner nodes of a chain of quadratic pieces evenly along it. Gives the largest move.
fn spread_curve(network: &Network, places: &mut Places, ids: &[NodeImage]) -> f64 {
    let translation = |image: &NodeImage| network.period().translation(image.shift);
    let points: Vec<DVec3> = ids.iter().map(|image| places[image.node] + translation(image)).collect();
    let pieces = points.len() / 2;
    let piece_length = |piece: usize, to: f64| -> f64 {
        let p = &points[2 * piece..2 * piece + 3];
        ARC_RULE
            .iter()
            .map(|&(t, weight)| {
                let (_, d) = super::shape::quadratic(t * to);
                to * weight * (d[0] * p[0] + d[1] * p[1] + d[2] * p[2]).length()
            })
            .sum()
    };
    let lengths: Vec<f64> = (0..pieces).map(|piece| piece_length(piece, 1.0)).collect();
    let total: f64 = lengths.iter().sum();
    let mut largest: f64 = 0.0;
    for at in 1..points.len() - 1 {
        let mut wanted = total * real(at) / real(points.len() - 1);
        let mut piece = 0;
        while piece + 1 < pieces && wanted > lengths[piece] {
            wanted -= lengths[piece];
            piece += 1;
        }
        let p = &points[2 * piece..2 * piece + 3];
        let mut t = wanted / lengths[piece];
        for _ in 0..20 {
            let (_, d) = super::shape::quadratic(t);
            let speed = (d[0] * p[0] + d[1] * p[1] + d[2] * p[2]).length();
            let step = (piece_length(piece, t) - wanted) / speed;
            t -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        if !t.is_finite() {
            continue;
        }
        let (n, _) = super::shape::quadratic(t);
        let place = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
        largest = largest.max(place.distance(points[at]));
        places[ids[at].node] = place - translation(&ids[at]);
    }
    largest
}

/// The masters of an inner node of a strip, by its column and row and the last of each: the two borders, and inside the film
/// its edges on the walls, too, as a Coons patch.
pub(in crate::foam) fn coons(
    [column, last]: [usize; 2],
    [row, top]: [usize; 2],
    node: impl Fn(usize, usize) -> NodeId,
) -> Vec<(NodeId, f64)> {
    let (u, v) = (real(column) / real(last), real(row) / real(top));
    let mut masters = vec![(node(0, row), 1.0 - u), (node(last, row), u)];
    if row != 0 && row != top {
        masters.extend([
            (node(column, 0), 1.0 - v),
            (node(column, top), v),
            (node(0, 0), -(1.0 - u) * (1.0 - v)),
            (node(last, 0), -u * (1.0 - v)),
            (node(0, top), -(1.0 - u) * v),
            (node(last, top), -u * v),
        ]);
    }
    masters
}
