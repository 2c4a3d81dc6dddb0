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
        Self { facets, edges }
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
