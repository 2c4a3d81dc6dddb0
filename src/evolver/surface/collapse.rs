//! Removal of short edges and of the facets that vanish with them.

use super::{EdgeId, FacetId, Surface, VertexId};
use crate::{evolver::datafile::Representation, index::Id};
use glam::IVec3;
use std::collections::BTreeMap;

impl Surface {
    /// Collapses an edge: its head becomes its tail, and facets that lose an edge vanish. The new id of each old edge, `None`
    /// for those that vanished; no list where the ends may not be one, or an edge would become a loop.
    pub(crate) fn collapse(&mut self, id: EdgeId) -> Option<Vec<Option<EdgeId>>> {
        let neighbours = self.neighbours();
        let edge = self.edges[id].clone();
        let [tail, head] = edge.ends;
        if tail == head || edge.common.fixed {
            return None;
        }
        let kept = self.survivor(tail, head)?;
        let lost = if kept == tail { head } else { tail };
        // What hung on the lost vertex now hangs on the kept one, over the collapsed edge's wrap.
        let shift = if kept == tail { edge.wrap } else { -edge.wrap };
        let vanishing: Vec<(FacetId, usize)> = if self.representation == Representation::Soapfilm {
            neighbours.facets[id].clone()
        } else {
            Vec::new()
        };
        let replaced = self.merged_sides(&vanishing, id)?;
        for &other in &neighbours.edges[lost] {
            if other != id {
                self.reattach(other, lost, kept, shift);
            }
        }
        if self.representation == Representation::String {
            for &(facet, _) in &neighbours.facets[id] {
                self.facets[facet].edges.retain(|directed| directed.edge != id);
            }
        } else {
            self.merge_sides(&replaced);
        }
        self.gone.edges.push(id);
        self.gone.vertices.push(lost);
        self.gone.facets.extend(vanishing.iter().map(|&(facet, _)| facet));
        self.gone.edges.sort_unstable();
        self.gone.edges.dedup();
        self.gone.facets.sort_unstable();
        self.gone.facets.dedup();
        let gone = self.gone.edges.clone();
        let edges = self.pack();
        let still = |(old, new): (usize, EdgeId)| {
            gone.binary_search(&EdgeId::from_index(old)).is_err().then_some(new)
        };
        Some(edges.into_iter().enumerate().map(still).collect())
    }

    /// Which end of an edge stays: the fixed one, or that on more constraints.
    fn survivor(&self, tail: VertexId, head: VertexId) -> Option<VertexId> {
        let (a, b) = (&self.vertices[tail].common, &self.vertices[head].common);
        let within = |x: &super::Common, y: &super::Common| {
            x.constraints.iter().all(|c| y.constraints.contains(c))
                && (x.boundary.is_none() || x.boundary == y.boundary)
        };
        match (a.fixed, b.fixed) {
            (true, true) => None,
            (true, false) => within(b, a).then_some(tail),
            (false, true) => within(a, b).then_some(head),
            _ if within(b, a) => Some(tail),
            _ if within(a, b) => Some(head),
            _ => None,
        }
    }

    pub(super) fn reattach(&mut self, id: EdgeId, lost: VertexId, kept: VertexId, shift: IVec3) {
        let edge = &mut self.edges[id];
        let periods = self.periods;
        if edge.ends[0] == lost {
            edge.ends[0] = kept;
            // The tail moved back by the shift: the head and the middle are seen from there.
            edge.wrap += shift;
            if let (Some(middle), Some(periods)) = (edge.middle, periods) {
                self.vertices[middle].position += periods * shift.as_dvec3();
            }
        }
        let edge = &mut self.edges[id];
        if edge.ends[1] == lost {
            edge.ends[1] = kept;
            edge.wrap -= shift;
        }
    }

    /// Which edge takes the place of which, and whether turned, when the two other edges of each vanishing facet become one.
    /// `None` if that would make a facet with one edge twice.
    fn merged_sides(
        &self,
        vanishing: &[(FacetId, usize)],
        collapsed: EdgeId,
    ) -> Option<BTreeMap<EdgeId, (EdgeId, bool)>> {
        let mut replaced: BTreeMap<EdgeId, (EdgeId, bool)> = BTreeMap::new();
        for &(facet, at) in vanishing {
            let edges = &self.facets[facet].edges;
            let (b, c) = (edges[(at + 1) % 3], edges[(at + 2) % 3]);
            if b.edge == c.edge || b.edge == collapsed || c.edge == collapsed {
                return None;
            }
            // b leads from the kept vertex to R, c back: c turned is the same line as b.
            let keep_c = self.edges[c.edge].common.constraints.len()
                > self.edges[b.edge].common.constraints.len()
                || self.edges[c.edge].common.fixed;
            let (from, to) = if keep_c { (b, c) } else { (c, b) };
            let turned = from.reversed == to.reversed;
            replaced.insert(from.edge, (to.edge, turned));
        }
        // A chain of replacements must come to an end.
        let ends = replaced.keys().all(|&edge| resolved(edge, &replaced).is_some());
        ends.then_some(replaced)
    }

    fn merge_sides(&mut self, replaced: &BTreeMap<EdgeId, (EdgeId, bool)>) {
        for facet in self.facets.as_mut_slice() {
            for directed in &mut facet.edges {
                if let Some((edge, turned)) = resolved(directed.edge, replaced) {
                    directed.edge = edge;
                    directed.reversed ^= turned;
                }
            }
        }
        self.gone.edges.extend(replaced.keys().copied());
    }
}

/// The edge that takes the place of one in the end, and whether turned; `None` if there is no end.
fn resolved(edge: EdgeId, replaced: &BTreeMap<EdgeId, (EdgeId, bool)>) -> Option<(EdgeId, bool)> {
    let (mut edge, mut turned) = (edge, false);
    for _ in 0..replaced.len() + 1 {
        let Some(&(next, turn)) = replaced.get(&edge) else { return Some((edge, turned)) };
        edge = next;
        turned ^= turn;
    }
    None
}
