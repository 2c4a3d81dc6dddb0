//! The rim: where planes cut the middle surface off, and the outside beyond them.
//!
//! A network with a rim is closed by faces without volume, the *outside*: one for each closed line in which the planes cut
//! the middle surface. So every law of a closed network holds, a T1 at a plane is a T1 like any other, and three edges meet
//! where a film ends on a plane: the film's and two of the rim. Rim edges carry no film.

use super::{CellId, EdgeId, HalfEdgeId, Network, NetworkDefect, VertexId, laws};
use crate::{index::Id, surface::CutPlane, surface::LevelSet};
use serde::{Deserialize, Serialize};

/// The planes that cut a network off, and how many of its last faces are the outside.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Rim {
    pub(super) planes: Vec<CutPlane>,
    pub(super) outside: usize,
}

impl Network {
    /// The same network, cut off by `planes`: its last `outside` cells are the outside beyond them.
    ///
    /// # Errors
    /// Every [`NetworkDefect`] found, if the outside touches itself or has no planes.
    pub fn with_rim(mut self, planes: Vec<CutPlane>, outside: usize) -> Result<Self, Vec<NetworkDefect>> {
        self.rim = Rim { planes, outside };
        let defects = laws::rim::check(&self);
        if defects.is_empty() { Ok(self) } else { Err(defects) }
    }

    /// The planes that cut it off.
    #[must_use]
    pub fn planes(&self) -> &[CutPlane] {
        &self.rim.planes
    }

    /// Whether what [`Network::cell`] or [`Network::neighbour`] gave is the outside and no cell.
    #[must_use]
    pub fn is_outside(&self, cell: CellId) -> bool {
        cell.index() >= self.cells().len()
    }

    /// Whether an edge lies on the rim: there is no film between a cell and the outside.
    #[must_use]
    pub fn is_rim(&self, edge: EdgeId) -> bool {
        edge.half_edges().iter().any(|&side| self.is_outside(self.cell(side)))
    }

    /// The edges that carry films.
    pub fn films(&self) -> impl Iterator<Item = EdgeId> + '_ {
        self.edges().filter(|&edge| !self.is_rim(edge))
    }

    /// The edges of the rim.
    pub fn rim(&self) -> impl Iterator<Item = EdgeId> + '_ {
        self.edges().filter(|&edge| self.is_rim(edge))
    }

    /// Whether a cell ends at a plane.
    #[must_use]
    pub fn is_cut(&self, cell: CellId) -> bool {
        self.ring(cell).any(|side| self.is_outside(self.neighbour(side)))
    }

    /// The place in [`Network::planes`] of the plane on which a film ends at `vertex`; none inside the foam.
    #[must_use]
    pub fn plane_of(&self, vertex: VertexId) -> Option<usize> {
        let ends = self.outgoing(vertex).any(|side| self.is_outside(self.cell(side)));
        let distance = |plane: &CutPlane| plane.value(self.position(vertex)).abs();
        let planes = self.rim.planes.iter().enumerate().filter(|_| ends);
        planes.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).map(|(place, _)| place)
    }

    /// Whether a cell ends at two planes that face each other. Its volume has no origin that lies on both.
    #[must_use]
    pub fn spans(&self, cell: CellId) -> bool {
        let at =
            |side: HalfEdgeId| [self.origin(side), self.target(side)].map(|vertex| self.plane_of(vertex));
        let rim = self.ring(cell).filter(|&side| self.is_outside(self.neighbour(side)));
        let touched: Vec<usize> = rim.flat_map(at).flatten().collect();
        let facing = |a: usize, b: usize| a != b && self.rim.planes[a].axis == self.rim.planes[b].axis;
        touched.iter().any(|&a| touched.iter().any(|&b| facing(a, b)))
    }
}
