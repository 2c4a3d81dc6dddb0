//! The laws of a network, one file each. Every check returns all violations with their data.

pub(super) mod contact;
pub(super) mod euler;
pub(super) mod pairing;
pub(super) mod rim;
pub(super) mod ring;
pub(super) mod valence;

use super::{CellId, HalfEdgeId, VertexId};
use glam::IVec3;

/// A way in which lists or a file are no network.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NetworkDefect {
    /// A cell with fewer than two corners (fewer than three, unless two vertices make up the whole foam).
    #[error(
        "cell {cell} has {corners} corners; at least {least} are needed (too few cells for the surface, or a cell in several pieces)"
    )]
    FewCorners {
        /// The cell.
        cell: CellId,
        /// Its corners.
        corners: usize,
        /// How many it must have.
        least: usize,
    },
    /// A cell that passes the same image of a vertex twice.
    #[error("cell {cell} passes vertex {vertex} twice: it pinches itself")]
    Pinched {
        /// The cell.
        cell: CellId,
        /// The vertex.
        vertex: VertexId,
    },
    /// A corner or neighbour that does not exist.
    #[error("cell {cell} names {what} {number}, but there are only {count}")]
    NoSuch {
        /// The cell.
        cell: CellId,
        /// `vertex` or `cell`.
        what: &'static str,
        /// What it names.
        number: usize,
        /// How many there are.
        count: usize,
    },
    /// A coordinate that is not finite.
    #[error("{what} {number} lies at {position}, which is not a place")]
    Place {
        /// `vertex` or `cell`.
        what: &'static str,
        /// Which.
        number: usize,
        /// Its coordinates.
        position: glam::DVec3,
    },
    /// The same side listed twice.
    #[error("the side from {from} to {to} of cell {cell} is listed twice")]
    SideTwice {
        /// The cell.
        cell: CellId,
        /// Its start.
        from: VertexId,
        /// Its end.
        to: VertexId,
    },
    /// A side that the neighbour does not have.
    #[error(
        "cell {cell} has a side from {from} to {to} with {neighbour} behind it, but {neighbour} has no such side"
    )]
    Unpaired {
        /// The cell.
        cell: CellId,
        /// The neighbour that it names.
        neighbour: CellId,
        /// The side's start.
        from: VertexId,
        /// The side's end.
        to: VertexId,
    },
    /// A half-edge whose links contradict its twin's or its neighbours'.
    #[error("half-edge {side}: {what}")]
    Links {
        /// The half-edge.
        side: HalfEdgeId,
        /// What does not hold.
        what: &'static str,
    },
    /// A vertex where not three sides meet.
    #[error("{valence} edges meet at vertex {vertex}, not 3")]
    Valence {
        /// The vertex.
        vertex: VertexId,
        /// How many.
        valence: usize,
    },
    /// Numbers that contradict the Euler characteristic: the cells are no decomposition of the surface.
    #[error(
        "{cells} cells, {edges} edges and {vertices} vertices do not fit a surface with Euler characteristic {expected}: {cells} − {edges} + {vertices} = {found}"
    )]
    Euler {
        /// F.
        cells: usize,
        /// E.
        edges: usize,
        /// V.
        vertices: usize,
        /// χ of the surface.
        expected: i32,
        /// F − E + V.
        found: i64,
    },
    /// A part that is not connected with the rest.
    #[error("only {reached} of {cells} cells are connected with the first")]
    Apart {
        /// How many are reached from the first cell.
        reached: usize,
        /// How many there are.
        cells: usize,
    },
    /// A cell that touches itself, directly or round the period.
    #[error("cell {cell} touches itself {shift} periods away: too few cells for the period")]
    TouchesItself {
        /// The cell.
        cell: CellId,
        /// The image that it touches.
        shift: IVec3,
    },
    /// An outside that is none.
    #[error("the network's rim is damaged: {what}")]
    Rim {
        /// What does not hold.
        what: &'static str,
    },
}
