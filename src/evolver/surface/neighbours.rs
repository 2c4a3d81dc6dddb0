//! Who borders on whom.

use super::{EdgeId, FacetId, Surface, VertexId};
use crate::index::{Id, IndexVec};

/// The facets at each edge and the edges at each vertex.
#[derive(Debug)]
pub(crate) struct Neighbours {
    /// The facets at each edge, each with the place of the edge in it.
    pub(crate) facets: IndexVec<EdgeId, Vec<(FacetId, usize)>>,
    /// The edges at each vertex; a loop edge comes twice.
    pub(crate) edges: IndexVec<VertexId, Vec<EdgeId>>,
    /// What each vertex lies on.
    pub(crate) kinds: IndexVec<VertexId, Kind>,
}

/// What a vertex lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// No film.
    Bare,
    /// A film or its rim.
    Film,
    /// A line at which three or more films meet, or the end of such lines.
    Line,
}

impl Neighbours {
    pub(crate) fn new(surface: &Surface) -> Self {
        let mut facets: IndexVec<EdgeId, Vec<(FacetId, usize)>> =
            IndexVec::from_elem(Vec::new(), surface.edges.len());
        for (id, facet) in surface.facets.enumerated() {
            for (at, directed) in facet.edges.iter().enumerate() {
                facets[directed.edge].push((id, at));
            }
        }
        let mut edges: IndexVec<VertexId, Vec<EdgeId>> =
            IndexVec::from_elem(Vec::new(), surface.vertices.len());
        for (id, edge) in surface.edges.enumerated() {
            for end in edge.ends {
                edges[end].push(id);
            }
        }
        let mut kinds = IndexVec::from_elem(Kind::Bare, surface.vertices.len());
        for (id, edge) in surface.edges.enumerated() {
            let kind = match facets[id].len() {
                0 => continue,
                1 | 2 => Kind::Film,
                _ => Kind::Line,
            };
            for vertex in edge.ends.into_iter().chain(edge.middle) {
                if kinds[vertex] != Kind::Line {
                    kinds[vertex] = kind;
                }
            }
        }
        Self { facets, edges, kinds }
    }

    /// The facets at a vertex, each once, in order.
    pub(crate) fn facets_at(&self, vertex: VertexId) -> Vec<FacetId> {
        let mut found: Vec<FacetId> = self.edges[vertex]
            .iter()
            .flat_map(|&edge| self.facets[edge].iter().map(|&(facet, _)| facet))
            .collect();
        found.sort_by_key(|id| id.index());
        found.dedup();
        found
    }
}
