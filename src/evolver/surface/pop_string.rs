//! Strings that exchange neighbours: T1s of edges between two triple points, and vertices where more than three strings meet.

use super::{Common, Directed, Edge, EdgeId, Neighbours, Surface, VertexId};
use crate::{
    evolver::{datafile::Model, language::expression::ElementKind},
    index::Id,
};
use glam::{DVec3, IVec3};

/// How far a popped vertex is pulled off, as a part of the shorter of the two strings that it takes along: as Surface Evolver.
const PULL: f64 = 0.1;

impl Surface {
    /// T1 of an edge between two triple points: the facets beside it part, those at its ends become neighbours. The edge turns
    /// by a right angle about its middle. False where the topology, something fixed or a constraint forbids it.
    pub(crate) fn t1(&mut self, id: EdgeId, around: &Neighbours) -> bool {
        let Some([stays, moves, returns, leaves]) = self.strings_at(id, around) else { return false };
        let edge = self.edges[id].clone();
        let ([tail, head], wrap) = (edge.ends, edge.wrap);
        let along = self.side(Directed { edge: id, reversed: false });
        let middle = self.vertices[tail].position + 0.5 * along;
        // The tail goes to the side of the facet on the left, the head to the other.
        let across = self.side(stays.turned()) + along + self.side(moves)
            - (along + self.side(returns.turned()) + self.side(leaves));
        let unit = along.normalize_or_zero();
        let Some(across) = (across - across.dot(unit) * unit).try_normalize() else { return false };
        let half = 0.5 * along.length() * across;
        self.reattach(moves.edge, head, tail, wrap);
        self.reattach(leaves.edge, tail, head, -wrap);
        self.vertices[tail].position = middle + half;
        self.vertices[head].position = middle - half - self.translation(wrap);
        for directed in [stays, moves, returns, leaves] {
            self.straighten(directed.edge);
        }
        self.straighten(id);
        for &(facet, at) in around.facets[id].iter() {
            self.facets[facet].edges.remove(at);
        }
        self.close_loops(id, &[stays.edge, moves.edge, returns.edge, leaves.edge], around);
        true
    }

    /// The strings next to an edge that a T1 can turn: those by which the facet on its left comes to the tail and goes on from
    /// the head, and those by which the facet on its right comes to the head and goes on from the tail.
    fn strings_at(&self, id: EdgeId, around: &Neighbours) -> Option<[Directed; 4]> {
        let edge = &self.edges[id];
        let [tail, head] = edge.ends;
        let free = |vertex: VertexId| {
            let common = &self.vertices[vertex].common;
            !common.fixed && common.constraints.is_empty() && common.boundary.is_none()
        };
        let triple = |vertex: VertexId| around.edges[vertex].len() == 3;
        if edge.common.fixed || tail == head || ![tail, head].into_iter().all(|v| free(v) && triple(v)) {
            return None;
        }
        let [one, other] = around.facets[id][..] else { return None };
        let reversed = |(facet, at): (super::FacetId, usize)| self.facets[facet].edges[at].reversed;
        let (left, right) = match (reversed(one), reversed(other)) {
            (false, true) => (one, other),
            (true, false) => (other, one),
            _ => return None,
        };
        let beside = |(facet, at): (super::FacetId, usize)| {
            let edges = &self.facets[facet].edges;
            (edges[(at + edges.len() - 1) % edges.len()], edges[(at + 1) % edges.len()])
        };
        let long = |(facet, _): (super::FacetId, usize)| self.facets[facet].edges.len() > 2;
        let ((stays, moves), (returns, leaves)) = (beside(left), beside(right));
        let mut names = [stays.edge, moves.edge, returns.edge, leaves.edge, id];
        names.sort_unstable();
        let distinct = names.windows(2).all(|pair| pair[0] != pair[1]);
        let joined = self.head(stays) == tail && self.tail(moves) == head && self.tail(leaves) == tail;
        (left.0 != right.0 && long(left) && long(right) && distinct && joined)
            .then_some([stays, moves, returns, leaves])
    }

    /// Puts the middle of a bent string onto its chord.
    fn straighten(&mut self, id: EdgeId) {
        let whole = Directed { edge: id, reversed: false };
        if let Some(middle) = self.edges[id].middle {
            self.vertices[middle].position =
                self.vertices[self.tail(whole)].position + 0.5 * self.side(whole);
        }
    }

    /// Puts an edge into the loops of all facets that its ends have torn: where one of `torn` follows another but does not
    /// start where that one ends.
    fn close_loops(&mut self, id: EdgeId, torn: &[EdgeId], around: &Neighbours) {
        let mut facets: Vec<_> = torn
            .iter()
            .filter(|edge| edge.index() < around.facets.len())
            .flat_map(|&edge| around.facets[edge].iter().map(|&(facet, _)| facet))
            .collect();
        facets.sort_unstable();
        facets.dedup();
        let ends = self.edges[id].ends;
        for facet in facets {
            let edges = self.facets[facet].edges.clone();
            let mut closed = Vec::with_capacity(edges.len() + 2);
            for (at, &directed) in edges.iter().enumerate() {
                closed.push(directed);
                let next = edges[(at + 1) % edges.len()];
                let gap = [self.head(directed), self.tail(next)];
                if torn.contains(&directed.edge) && torn.contains(&next.edge) {
                    if gap == ends {
                        closed.push(Directed { edge: id, reversed: false });
                    } else if gap == [ends[1], ends[0]] {
                        closed.push(Directed { edge: id, reversed: true });
                    }
                }
            }
            self.facets[facet].edges = closed;
        }
    }

    /// Takes the two strings with the smallest angle between them off a vertex where more than three meet, to a new vertex
    /// that a new string joins to it. False where there is nothing to do or the vertex may not move.
    pub(crate) fn pop_string(&mut self, id: VertexId, around: &Neighbours) -> bool {
        let common = &self.vertices[id].common;
        let edges = &around.edges[id];
        if edges.len() < 4 || common.fixed || !common.constraints.is_empty() || common.boundary.is_some() {
            return false;
        }
        // The first and then the others from the last: the order in which Surface Evolver keeps them decides between equals.
        let order = std::iter::once(&edges[0]).chain(edges[1..].iter().rev());
        let sides: Vec<(Directed, DVec3)> = order
            .map(|&edge| {
                let out = Directed { edge, reversed: self.edges[edge].ends[0] != id };
                (out, self.side(out))
            })
            .collect();
        if edges.iter().any(|&edge| self.edges[edge].ends == [id, id]) {
            return false;
        }
        let mut best: Option<(f64, usize, usize)> = None;
        for one in 0..sides.len() {
            for other in one + 1..sides.len() {
                let cosine = sides[one].1.normalize_or_zero().dot(sides[other].1.normalize_or_zero());
                if best.is_none_or(|(most, ..)| cosine > most) {
                    best = Some((cosine, one, other));
                }
            }
        }
        let Some((_, one, other)) = best else { return false };
        let pair = [sides[one], sides[other]];
        let way: DVec3 = pair.iter().map(|(_, side)| side.normalize_or_zero()).sum();
        let step = PULL * pair[0].1.length().min(pair[1].1.length()) * way.normalize_or_zero();
        self.pull_off(id, pair.map(|(out, _)| out.edge), step, around);
        true
    }

    /// Gives two of a vertex's strings a vertex of their own, a step away.
    fn pull_off(&mut self, id: VertexId, pair: [EdgeId; 2], step: DVec3, around: &Neighbours) {
        let place = self.vertices[id].position + step;
        let vertex = self.free_vertex(place, false);
        for edge in pair {
            self.reattach(edge, id, vertex, IVec3::ZERO);
            self.straighten(edge);
        }
        let tension = self.edges[pair[0]].tension;
        let new = self.free_edge([id, vertex], IVec3::ZERO, tension);
        self.close_loops(new, &around.edges[id].clone(), around);
    }

    /// A vertex that nothing holds.
    pub(super) fn free_vertex(&mut self, place: DVec3, middle: bool) -> VertexId {
        let extra = vec![0.0; self.extra_length(ElementKind::Vertex)];
        let common = Common { extra, ..Common::default() };
        self.vertices.push(super::Vertex {
            position: place,
            parameters: [0.0; 2],
            middle,
            hit: Vec::new(),
            common,
        })
    }

    /// A straight edge that nothing holds.
    pub(super) fn free_edge(&mut self, ends: [VertexId; 2], wrap: IVec3, tension: f64) -> EdgeId {
        let extra = vec![0.0; self.extra_length(ElementKind::Edge)];
        let common = Common { extra, ..Common::default() };
        let id = self.edges.push(Edge {
            ends,
            middle: None,
            wrap,
            tension,
            no_refine: false,
            noncontent: false,
            common,
        });
        if self.model == Model::Quadratic {
            let place =
                self.vertices[ends[0]].position + 0.5 * self.side(Directed { edge: id, reversed: false });
            self.edges[id].middle = Some(self.free_vertex(place, true));
        }
        id
    }
}
