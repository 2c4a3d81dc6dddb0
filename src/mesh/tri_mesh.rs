//! Triangle meshes, and those that are proved closed.

use super::{MeshDefect, check};
use crate::index::{Id, IndexVec};
use glam::DVec3;

crate::define_id!(
    /// A vertex of a [`TriMesh`].
    VertexId
);

/// Vertices and triangles. Seen from outside, the corners of a triangle run counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Places of the vertices.
    pub positions: IndexVec<VertexId, DVec3>,
    /// Corners of the triangles.
    pub triangles: Vec<[VertexId; 3]>,
}

impl TriMesh {
    /// The places of a triangle's corners.
    #[must_use]
    pub fn corners(&self, triangle: [VertexId; 3]) -> [DVec3; 3] {
        triangle.map(|vertex| self.positions[vertex])
    }

    /// All triangles as places.
    pub fn triangle_corners(&self) -> impl ExactSizeIterator<Item = [DVec3; 3]> + Clone {
        self.triangles.iter().map(|&triangle| self.corners(triangle))
    }

    /// Adds the vertices and triangles of another mesh.
    pub fn append(&mut self, other: &Self) {
        let offset = self.positions.len();
        for &position in &other.positions {
            self.positions.push(position);
        }
        let moved = |vertex: VertexId| VertexId::from_index(vertex.index() + offset);
        self.triangles.extend(other.triangles.iter().map(|triangle| triangle.map(moved)));
    }

    /// The lower and upper corner of the box round all vertices; an empty mesh gives infinities.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.positions.iter().fold(none, |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// A mesh with every vertex moved.
    #[must_use]
    pub fn map(mut self, place: impl Fn(DVec3) -> DVec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = place(*p));
        self
    }
}

/// A mesh that was proved to bound solids: every edge joins two triangles that agree on the outside, every vertex has one
/// fan, and no triangle is degenerate or doubled.
///
/// Only [`ClosedMesh::new`] makes one, or a construction from a checked sheet ([`super::Sheet::thicken`]).
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedMesh(TriMesh);

impl ClosedMesh {
    /// Proves that `mesh` is closed.
    ///
    /// # Errors
    /// Every [`MeshDefect`] found.
    pub fn new(mesh: TriMesh) -> Result<Self, MeshDefects> {
        let (defects, _) = check::inspect(&mesh);
        if defects.is_empty() { Ok(Self(mesh)) } else { Err(MeshDefects(defects)) }
    }

    /// A mesh that is closed by construction from checked parts.
    pub(super) fn by_construction(mesh: TriMesh) -> Self {
        Self(mesh)
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &TriMesh {
        &self.0
    }

    /// The same solid, scaled by `factor` and then moved.
    ///
    /// # Panics
    /// If `factor` is not positive: the solid would be turned inside out.
    #[must_use]
    pub fn scaled_and_moved(self, factor: f64, by: DVec3) -> Self {
        assert!(factor > 0.0, "a solid is scaled by a positive factor");
        // Adding zero turns −0 into 0: STL readers tell the two apart.
        Self(self.0.map(|p| p * factor + by + DVec3::ZERO))
    }
}

/// Everything that keeps a mesh from being closed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the mesh does not bound a solid: {} defects, the first: {}", .0.len(), .0.first().map_or_else(String::new, ToString::to_string))]
pub struct MeshDefects(pub Vec<MeshDefect>);
