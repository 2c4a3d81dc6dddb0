//! Points where more than four lines of films meet are replaced by a small polyhedron that is open on one side.
//!
//! The films at the vertex are cut off in the middles of its edges, where they meet a surface round it in a graph. The faces of
//! that graph become films, all but the largest, so that what was apart stays apart.

use super::{BodyId, Directed, EdgeId, Facet, FacetId, Neighbours, Surface, VertexId, pop_film::is_free};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// The part of an edge that is cut off: as Surface Evolver.
const CUT: f64 = 0.5;
/// Lines of films that meet at a point of a foam at rest: J. Taylor, Annals of Mathematics 103 (1976) 489.
const LINES: usize = 4;

/// A film's way from one edge of the vertex to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Arc {
    facet: FacetId,
    from: EdgeId,
    to: EdgeId,
}

/// A face of the graph round a vertex: its arcs, counter-clockwise from outside, and the body there.
struct Cell {
    arcs: Vec<Arc>,
    body: Option<BodyId>,
}

impl Surface {
    /// Opens a vertex where more than four lines of films meet. False where there is nothing to do, something holds the vertex,
    /// or its films form two cones.
    pub(crate) fn pop_point(&mut self, id: VertexId, around: &Neighbours) -> bool {
        let edges = &around.edges[id];
        let valence = |edge: EdgeId| around.facets[edge].len();
        let lines = edges.iter().filter(|&&edge| valence(edge) == 3).count();
        let sound = edges.iter().all(|&edge| {
            let ends = self.edges[edge].ends;
            (2..=3).contains(&valence(edge)) && ends[0] != ends[1]
        });
        if lines <= LINES || !sound || !is_free(&self.vertices[id].common) {
            return false;
        }
        let Some(mut cells) = self.cells_round(id, around) else { return false };
        let corners: BTreeMap<EdgeId, DVec3> =
            edges.iter().map(|&edge| (edge, self.cut_place(id, edge))).collect();
        let Some(largest) = (0..cells.len())
            .max_by(|&a, &b| cell_area(&cells[a], &corners).total_cmp(&cell_area(&cells[b], &corners)))
        else {
            return false;
        };
        let inner = cells.swap_remove(largest).body;
        self.open(id, around, &corners, &cells, inner);
        true
    }

    /// An edge at a vertex, away from it.
    fn outward(&self, vertex: VertexId, edge: EdgeId) -> Directed {
        Directed { edge, reversed: self.edges[edge].ends[0] != vertex }
    }

    fn cut_place(&self, vertex: VertexId, edge: EdgeId) -> DVec3 {
        self.vertices[vertex].position + CUT * self.side(self.outward(vertex, edge))
    }

    /// The faces of the graph in which films meet a sphere round a vertex; `None` where that graph is not connected.
    fn cells_round(&self, id: VertexId, around: &Neighbours) -> Option<Vec<Cell>> {
        let rounds: BTreeMap<EdgeId, Vec<Arc>> =
            around.edges[id].iter().map(|&edge| (edge, self.arcs_round(id, edge, around))).collect();
        let mut left: Vec<Arc> = rounds.values().flatten().copied().collect();
        let total = left.len();
        left.sort_unstable();
        let mut cells = Vec::new();
        while let Some(&start) = left.first() {
            let mut arcs = Vec::new();
            let mut arc = start;
            loop {
                let at = left.binary_search(&arc).ok()?;
                left.remove(at);
                arcs.push(arc);
                // The next one clockwise after the way back keeps the cell on the left.
                let round = rounds.get(&arc.to)?;
                let back = round.iter().position(|other| other.facet == arc.facet)?;
                arc = round[(back + round.len() - 1) % round.len()];
                if arc == start {
                    break;
                }
            }
            cells.push(Cell { body: self.body_beside(id, start), arcs });
        }
        // Euler's formula of a connected graph on the sphere.
        (rounds.len() + cells.len() == total / 2 + 2).then_some(cells)
    }

    /// The films at one edge of a vertex, counter-clockwise as seen from outside.
    fn arcs_round(&self, vertex: VertexId, edge: EdgeId, around: &Neighbours) -> Vec<Arc> {
        let axis = self.side(self.outward(vertex, edge)).normalize_or_zero();
        let (u, v) = axis.any_orthonormal_pair();
        let mut arcs: Vec<(f64, Arc)> = around.facets[edge]
            .iter()
            .filter_map(|&(facet, at)| {
                let edges = self.facets[facet].edges.iter().map(|directed| directed.edge);
                let to = edges.filter(|&e| e != edge).find(|&e| self.edges[e].ends.contains(&vertex))?;
                let sides = &self.facets[facet].edges;
                let inward = self.area_vector(facet).cross(self.side(sides[at]));
                Some((inward.dot(v).atan2(inward.dot(u)), Arc { facet, from: edge, to }))
            })
            .collect();
        arcs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        arcs.into_iter().map(|(_, arc)| arc).collect()
    }

    /// The body on the left of an arc, seen from outside.
    fn body_beside(&self, vertex: VertexId, arc: Arc) -> Option<BodyId> {
        let facet = &self.facets[arc.facet];
        let first = self.outward(vertex, arc.from);
        // A facet that leaves the vertex along the arc's first edge has its normal to the left.
        facet.bodies[usize::from(facet.edges.contains(&first))]
    }

    /// Cuts the films off and puts the cells in.
    fn open(
        &mut self,
        id: VertexId,
        around: &Neighbours,
        corners: &BTreeMap<EdgeId, DVec3>,
        cells: &[Cell],
        inner: Option<BodyId>,
    ) {
        let mut new: BTreeMap<EdgeId, VertexId> = BTreeMap::new();
        for (&edge, &place) in corners {
            let vertex = self.free_vertex(place, false);
            self.reattach(edge, id, vertex, IVec3::ZERO);
            new.insert(edge, vertex);
        }
        let mut sides: BTreeMap<FacetId, EdgeId> = BTreeMap::new();
        for facet in around.facets_at(id) {
            if let Some(side) = self.cut_off(facet, &new) {
                sides.insert(facet, side);
            }
        }
        for cell in cells {
            self.close_cell(cell, (&new, &sides), inner);
        }
        self.gone.vertices.push(id);
        self.pack();
    }

    /// Makes two triangles of what is left of one whose corner was cut off; the new edge between its cut edges.
    fn cut_off(&mut self, id: FacetId, new: &BTreeMap<EdgeId, VertexId>) -> Option<EdgeId> {
        let facet = self.facets[id].clone();
        let is_new = |directed: Directed| new.contains_key(&directed.edge);
        // The edge that leads away from the cut corner, and the one that comes back to it.
        let at = (0..3).find(|&at| {
            let out = facet.edges[at];
            new.get(&out.edge) == Some(&self.tail(out)) && is_new(facet.edges[(at + 2) % 3])
        })?;
        let (out, far, back) = (facet.edges[at], facet.edges[(at + 1) % 3], facet.edges[(at + 2) % 3]);
        let (start, end) = (self.tail(out), self.head(back));
        let across = self.wrap(out) + self.wrap(far);
        let side = self.free_edge([end, start], IVec3::ZERO, 0.0);
        let diagonal = self.free_edge([start, self.head(far)], across, 0.0);
        let diagonal = Directed { edge: diagonal, reversed: false };
        self.facets[id].edges = vec![out, far, diagonal.turned()];
        let side_out = Directed { edge: side, reversed: false };
        self.facets.push(Facet { edges: vec![diagonal, back, side_out], ..facet });
        Some(side)
    }

    /// A film in a cell: one triangle, or a fan round its middle.
    fn close_cell(
        &mut self,
        cell: &Cell,
        (new, sides): (&BTreeMap<EdgeId, VertexId>, &BTreeMap<FacetId, EdgeId>),
        inner: Option<BodyId>,
    ) {
        let Some(first) = cell.arcs.first() else { return };
        let like = self.free_facet(first.facet, [inner, cell.body]);
        let edges: Vec<Directed> = cell
            .arcs
            .iter()
            .filter_map(|arc| {
                let edge = *sides.get(&arc.facet)?;
                Some(Directed { edge, reversed: new.get(&arc.from) != Some(&self.edges[edge].ends[0]) })
            })
            .collect();
        if edges.len() == 3 {
            self.facets.push(Facet { edges, ..like });
            return;
        }
        let corners: Vec<VertexId> = edges.iter().map(|&edge| self.tail(edge)).collect();
        #[expect(clippy::cast_precision_loss, reason = "a cell has few corners")]
        let count = corners.len() as f64;
        let place = corners.iter().map(|&corner| self.vertices[corner].position).sum::<DVec3>() / count;
        let middle = self.free_vertex(place, false);
        let spokes: Vec<EdgeId> =
            corners.iter().map(|&corner| self.free_edge([middle, corner], IVec3::ZERO, 0.0)).collect();
        for (at, &edge) in edges.iter().enumerate() {
            let back = Directed { edge: spokes[(at + 1) % spokes.len()], reversed: true };
            let out = Directed { edge: spokes[at], reversed: false };
            self.facets.push(Facet { edges: vec![edge, back, out], ..like.clone() });
        }
    }
}

/// The area of a cell's fan of triangles round the mean of its corners.
fn cell_area(cell: &Cell, corners: &BTreeMap<EdgeId, DVec3>) -> f64 {
    let places: Vec<DVec3> = cell.arcs.iter().filter_map(|arc| corners.get(&arc.from)).copied().collect();
    #[expect(clippy::cast_precision_loss, reason = "a cell has few corners")]
    let middle = places.iter().sum::<DVec3>() / places.len().max(1) as f64;
    let next = places.iter().cycle().skip(1);
    places.iter().zip(next).map(|(a, b)| 0.5 * (*a - middle).cross(*b - middle).length()).sum()
}
