//! T1 and T2: the only places where neighbours change.

use super::{CellId, CellRing, EdgeId, HalfEdgeId, Network, NetworkDefect, RingCorner, VertexId};
use crate::index::{Id, IndexVec};
use glam::{DVec3, IVec3};

/// Why a T1 is refused. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FlipRefusal {
    /// A cell beside the edge would be left with two sides.
    #[error("cell {0} beside the edge has only three sides")]
    Triangle(CellId),
    /// The cells at the ends touch already.
    #[error("cells {0} and {1} at the ends touch already")]
    TouchAlready(CellId, CellId),
    /// The same cell lies at both ends: it would touch itself.
    #[error("cell {0} lies at both ends and would touch itself")]
    SameCell(CellId),
    /// The film ends at planes on both sides: the outside would touch itself.
    #[error("both ends of the film lie on planes that cut the foam off")]
    Outside,
}

/// Why a T2 is refused. Nothing has changed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RemoveRefusal {
    /// Only triangles vanish: other cells lose sides by T1 first.
    #[error("cell {cell} has {sides} sides; only a triangle can vanish")]
    NotTriangle {
        /// The cell.
        cell: CellId,
        /// Its sides.
        sides: usize,
    },
    /// What would be left is no network.
    #[error("without cell {cell} the rest is no network: {defects:?}")]
    Defects {
        /// The cell.
        cell: CellId,
        /// What would be wrong.
        defects: Vec<NetworkDefect>,
    },
}

/// A network after a T2, with what became of the old cells and vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Removed {
    /// What is left.
    pub network: Network,
    /// The new id of each old cell; `None` for the one that vanished.
    pub cells: IndexVec<CellId, Option<CellId>>,
    /// The new id of each old vertex; the triangle's three share one.
    pub vertices: IndexVec<VertexId, VertexId>,
}

impl Network {
    /// Whether [`Network::flip`] would do the T1.
    ///
    /// # Errors
    /// [`FlipRefusal`] with the cells in the way.
    pub fn can_flip(&self, edge: EdgeId) -> Result<(), FlipRefusal> {
        let [h, t] = edge.half_edges();
        for side in [h, t] {
            if self.sides(self.cell(side)) <= 3 {
                return Err(FlipRefusal::Triangle(self.cell(side)));
            }
        }
        let (at_origin, at_target) = self.end_sides(edge);
        let (c, d) = (self.cell(at_origin), self.cell(at_target));
        if c == d {
            return Err(FlipRefusal::SameCell(c));
        }
        match (self.is_outside(c), self.is_outside(d)) {
            (false, false) => {}
            (true, true) => return Err(FlipRefusal::Outside),
            // A cell may end at the rim twice, at two planes with another cell in the corner between them.
            _ => return Ok(()),
        }
        let between = self.target_shift(h) + self.cell_shift(at_target) - self.cell_shift(at_origin);
        let touch =
            self.ring(c).any(|side| self.neighbour(side) == d && self.neighbour_shift(side) == between);
        if touch { Err(FlipRefusal::TouchAlready(c, d)) } else { Ok(()) }
    }

    /// The T1: the two cells beside the edge part, the two at its ends meet.
    ///
    /// The edge keeps its id. Its origin is afterwards the corner of the cell that was on the left of its first half-edge,
    /// its target the corner of the other. The vertices are not moved.
    ///
    /// # Errors
    /// As [`Network::can_flip`]; nothing has changed then.
    pub fn flip(&mut self, edge: EdgeId) -> Result<(), FlipRefusal> {
        self.can_flip(edge)?;
        let [h, t] = edge.half_edges();
        let (u, v) = (self.origin(h), self.origin(t));
        let (a, b) = (self.cell(h), self.cell(t));
        let (after_h, before_h) = (self.next(h), self.previous(h));
        let (after_t, before_t) = (self.next(t), self.previous(t));
        let (c_out, d_out) = (before_h.twin(), before_t.twin());
        let (c_in, d_in) = (after_t.twin(), after_h.twin());
        let across = self.target_shift(h);

        self.move_origin(after_h, u, across);
        self.move_origin(after_t, v, -across);
        // The image of c seen from v, and of d seen from u.
        let (c, c_shift) = (self.cell(c_out), self.cell_shift(c_out) - across);
        let (d, d_shift) = (self.cell(d_out), self.cell_shift(d_out) + across);
        self.link(before_h, after_h);
        self.link(before_t, after_t);
        self.link(c_in, t);
        self.link(t, c_out);
        self.link(d_in, h);
        self.link(h, d_out);
        (self.half_edges[h].cell, self.half_edges[h].cell_shift) = (d, d_shift);
        (self.half_edges[t].cell, self.half_edges[t].cell_shift) = (c, c_shift);
        self.cells[a].side = after_h;
        self.cells[b].side = after_t;
        self.vertices[u].out = h;
        self.vertices[v].out = t;
        Ok(())
    }

    /// The T2: a triangle shrinks to a vertex at its centre.
    ///
    /// # Errors
    /// [`RemoveRefusal`] if the cell is no triangle or the rest would break a law.
    pub fn remove(&self, cell: CellId) -> Result<Removed, RemoveRefusal> {
        let sides: Vec<HalfEdgeId> = self.ring(cell).collect();
        let &[first, second, third] = &sides[..] else {
            return Err(RemoveRefusal::NotTriangle { cell, sides: sides.len() });
        };
        let corners = [first, second, third].map(|side| (self.origin(side), -self.cell_shift(side)));
        let kept = corners[0];
        let centre = self.outline(cell).iter().sum::<DVec3>() / 3.0 - self.period.translation(kept.1);

        let mut vertices = IndexVec::new();
        let mut new_vertex: IndexVec<VertexId, VertexId> = IndexVec::from_elem(kept.0, self.vertices.len());
        for vertex in self.vertices() {
            if vertex == kept.0 {
                new_vertex[vertex] = vertices.push(centre);
            } else if !corners.iter().any(|&(corner, _)| corner == vertex) {
                new_vertex[vertex] = vertices.push(self.position(vertex));
            }
        }
        for (corner, _) in corners {
            new_vertex[corner] = new_vertex[kept.0];
        }
        let mut next_cell = 0;
        let new_cell: IndexVec<CellId, Option<CellId>> = self
            .cells
            .ids()
            .map(|id| {
                (id != cell).then(|| {
                    next_cell += 1;
                    CellId::from_index(next_cell - 1)
                })
            })
            .collect();
        // All three corners become the first: an image of another corner is an image of the first, so much further.
        let shift_of = |vertex: VertexId| {
            corners.iter().find(|&&(corner, _)| corner == vertex).map_or(IVec3::ZERO, |&(_, s)| kept.1 - s)
        };
        let rings = self.rings();
        let cells = rings
            .enumerated()
            .filter(|&(id, _)| id != cell)
            .map(|(_, ring)| CellRing {
                centre: ring.centre,
                corners: ring
                    .corners
                    .iter()
                    .filter_map(|corner| {
                        Some(RingCorner {
                            vertex: new_vertex[corner.vertex],
                            shift: corner.shift + shift_of(corner.vertex),
                            // The side towards the vanished cell goes; its end stands for both.
                            neighbour: new_cell[corner.neighbour]?,
                        })
                    })
                    .collect(),
            })
            .collect();
        let network = Self::new(self.period, self.euler_characteristic, &vertices, &cells)
            .and_then(|network| network.with_rim(self.rim.planes.clone(), self.rim.outside))
            .map_err(|defects| RemoveRefusal::Defects { cell, defects })?;
        Ok(Removed { network, cells: new_cell, vertices: new_vertex })
    }

    /// The half-edges of the cells at the two ends of an edge, each starting there: at its origin and at its target.
    pub(crate) fn end_sides(&self, edge: EdgeId) -> (HalfEdgeId, HalfEdgeId) {
        let [h, t] = edge.half_edges();
        (self.previous(h).twin(), self.previous(t).twin())
    }

    fn link(&mut self, side: HalfEdgeId, next: HalfEdgeId) {
        self.half_edges[side].next = next;
        self.half_edges[next].previous = side;
    }

    /// Lets `side` start at `origin`, whose stored place sees the old origin's `offset` periods away.
    fn move_origin(&mut self, side: HalfEdgeId, origin: VertexId, offset: IVec3) {
        let here = &mut self.half_edges[side];
        here.origin = origin;
        here.target_shift += offset;
        here.cell_shift += offset;
        let back = -here.target_shift;
        self.half_edges[side.twin()].target_shift = back;
    }
}
