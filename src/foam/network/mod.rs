//! Who touches whom: the cells of a one-layer foam as a half-edge graph on the middle surface.
//!
//! Every side of a cell is one half-edge; its twin is the same side seen from the neighbour. In a periodic foam a vertex or
//! a cell is stored once, and each half-edge says by whole periods (its *shifts*) which image it means, so that a loop is
//! unwrapped by adding vectors and never by guessing the nearest image. The network knows no geometry beyond the places of
//! its vertices and the centres of its cells; films are made from it by extrusion (`complex`).
//!
//! The laws are one file each in `laws/`; [`Network::new`] and [`Network::defects`] report every violation with its data.
//! T1 and T2 are in `flip.rs`, the only place where neighbours change. Where planes cut the surface off, `rim.rs` closes the
//! network by the outside.

mod build;
mod flip;
mod laws;
mod rim;

pub use build::{CellRing, RingCorner};
pub use flip::{FlipRefusal, RemoveRefusal, Removed};
pub use laws::NetworkDefect;

use crate::{
    index::{Id, IndexVec},
    surface::Period,
};
use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

crate::define_id!(
    /// A cell of a [`Network`].
    CellId
);
crate::define_id!(
    /// A vertex of a [`Network`]: where three cells meet on the middle surface.
    VertexId
);
crate::define_id!(
    /// An edge of a [`Network`]: where two cells touch. Its half-edges are [`EdgeId::half_edges`].
    EdgeId
);
crate::define_id!(
    /// One side of a cell: an edge of a [`Network`] seen from the cell on its left.
    HalfEdgeId
);

impl HalfEdgeId {
    /// The same edge seen from the other side.
    #[must_use]
    pub fn twin(self) -> Self {
        Self::from_index(self.index() ^ 1)
    }

    /// The edge that this is one side of.
    #[must_use]
    pub fn edge(self) -> EdgeId {
        EdgeId::from_index(self.index() / 2)
    }
}

impl EdgeId {
    /// Its two half-edges, twins of each other.
    #[must_use]
    pub fn half_edges(self) -> [HalfEdgeId; 2] {
        [HalfEdgeId::from_index(2 * self.index()), HalfEdgeId::from_index(2 * self.index() + 1)]
    }
}

/// A vertex: its place, unwrapped, and one half-edge that starts there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Vertex {
    position: DVec3,
    out: HalfEdgeId,
}

/// A cell: its centre, unwrapped, and one of its sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Cell {
    centre: DVec3,
    side: HalfEdgeId,
}

/// A half-edge. Shifts are in whole periods, relative to the origin vertex at its stored place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct HalfEdge {
    origin: VertexId,
    /// Which image of the target vertex is meant.
    target_shift: IVec3,
    next: HalfEdgeId,
    previous: HalfEdgeId,
    cell: CellId,
    /// Which image of the cell on the left is meant.
    cell_shift: IVec3,
}

/// The half-edge graph of the cells on a closed middle surface, on one period of a periodic one, or on a piece that planes cut
/// off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Network {
    period: Period,
    euler_characteristic: i32,
    vertices: IndexVec<VertexId, Vertex>,
    cells: IndexVec<CellId, Cell>,
    half_edges: IndexVec<HalfEdgeId, HalfEdge>,
    #[serde(default)]
    rim: rim::Rim,
}

impl Network {
    /// The lattice.
    #[must_use]
    pub fn period(&self) -> Period {
        self.period
    }

    /// The Euler characteristic χ of the surface (of one period of it); of a piece, with the outside that closes it.
    #[must_use]
    pub fn euler_characteristic(&self) -> i32 {
        self.euler_characteristic
    }

    /// All cells, without the outside.
    pub fn cells(&self) -> impl ExactSizeIterator<Item = CellId> + DoubleEndedIterator + use<> {
        (0..self.cells.len().saturating_sub(self.rim.outside)).map(CellId::from_index)
    }

    /// All vertices.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = VertexId> + DoubleEndedIterator + use<> {
        self.vertices.ids()
    }

    /// All edges.
    pub fn edges(&self) -> impl ExactSizeIterator<Item = EdgeId> + DoubleEndedIterator + use<> {
        (0..self.half_edges.len() / 2).map(EdgeId::from_index)
    }

    /// The place of a vertex, unwrapped.
    #[must_use]
    pub fn position(&self, vertex: VertexId) -> DVec3 {
        self.vertices[vertex].position
    }

    /// Moves a vertex. Moving it to another image of itself would break the shifts: stay near.
    pub fn set_position(&mut self, vertex: VertexId, position: DVec3) {
        self.vertices[vertex].position = position;
    }

    /// The centre of a cell, unwrapped; a place inside it, such as its seed.
    #[must_use]
    pub fn centre(&self, cell: CellId) -> DVec3 {
        self.cells[cell].centre
    }

    /// Moves the centre of a cell. Moving it to another image of itself would break the shifts: stay near.
    pub fn set_centre(&mut self, cell: CellId, centre: DVec3) {
        self.cells[cell].centre = centre;
    }

    /// The vertex where a half-edge starts.
    #[must_use]
    pub fn origin(&self, side: HalfEdgeId) -> VertexId {
        self.half_edges[side].origin
    }

    /// The vertex where a half-edge ends.
    #[must_use]
    pub fn target(&self, side: HalfEdgeId) -> VertexId {
        self.half_edges[side.twin()].origin
    }

    /// The image of the target, in periods, when the origin is at its stored place.
    #[must_use]
    pub fn target_shift(&self, side: HalfEdgeId) -> IVec3 {
        self.half_edges[side].target_shift
    }

    /// The cell on the left, or the outside.
    #[must_use]
    pub fn cell(&self, side: HalfEdgeId) -> CellId {
        self.half_edges[side].cell
    }

    /// The image of the cell on the left, in periods, when the origin is at its stored place.
    #[must_use]
    pub fn cell_shift(&self, side: HalfEdgeId) -> IVec3 {
        self.half_edges[side].cell_shift
    }

    /// The next side of the same cell, counter-clockwise.
    #[must_use]
    pub fn next(&self, side: HalfEdgeId) -> HalfEdgeId {
        self.half_edges[side].next
    }

    /// The previous side of the same cell.
    #[must_use]
    pub fn previous(&self, side: HalfEdgeId) -> HalfEdgeId {
        self.half_edges[side].previous
    }

    /// The cell across a side, or the outside.
    #[must_use]
    pub fn neighbour(&self, side: HalfEdgeId) -> CellId {
        self.cell(side.twin())
    }

    /// Where the neighbour across `side` lies: how many periods its image that is touched is away from its stored place,
    /// when the cell on the left is at its stored place.
    #[must_use]
    pub fn neighbour_shift(&self, side: HalfEdgeId) -> IVec3 {
        let here = &self.half_edges[side];
        here.target_shift + self.half_edges[side.twin()].cell_shift - here.cell_shift
    }

    /// The three half-edges that start at a vertex, counter-clockwise.
    pub fn outgoing(&self, vertex: VertexId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        let first = self.vertices[vertex].out;
        let mut here = Some(first);
        std::iter::from_fn(move || {
            let side = here?;
            let following = self.previous(side).twin();
            here = (following != first).then_some(following);
            Some(side)
        })
    }

    /// The sides of a cell, counter-clockwise as seen from the upper wall.
    pub fn ring(&self, cell: CellId) -> impl Iterator<Item = HalfEdgeId> + '_ {
        let first = self.cells[cell].side;
        let mut here = Some(first);
        std::iter::from_fn(move || {
            let side = here?;
            let following = self.next(side);
            here = (following != first).then_some(following);
            Some(side)
        })
    }

    /// The number of sides of a cell.
    #[must_use]
    pub fn sides(&self, cell: CellId) -> usize {
        self.ring(cell).count()
    }

    /// The vertices of a cell round its stored centre, unwrapped, counter-clockwise as seen from the upper wall.
    #[must_use]
    pub fn outline(&self, cell: CellId) -> Vec<DVec3> {
        self.ring(cell)
            .map(|side| self.position(self.origin(side)) - self.period.translation(self.cell_shift(side)))
            .collect()
    }

    /// From the origin of a half-edge to its target.
    #[must_use]
    pub fn edge_vector(&self, side: HalfEdgeId) -> DVec3 {
        self.position(self.target(side)) + self.period.translation(self.target_shift(side))
            - self.position(self.origin(side))
    }

    /// The cells as rings, the outside last, in the form that [`Network::new`] takes.
    #[must_use]
    pub fn rings(&self) -> IndexVec<CellId, CellRing> {
        self.cells
            .enumerated()
            .map(|(id, cell)| CellRing {
                centre: cell.centre,
                corners: self
                    .ring(id)
                    .map(|side| RingCorner {
                        vertex: self.origin(side),
                        shift: -self.cell_shift(side),
                        neighbour: self.neighbour(side),
                    })
                    .collect(),
            })
            .collect()
    }
}

#[cfg(test)]
pub(crate) mod tests;
