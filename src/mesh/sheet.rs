//! An open sheet, proved to be a manifold, and the solid between two moved copies of it.
//!
//! A wall made of two copies of one sheet keeps its thickness on any grid: nothing is sampled that could be missed. The
//! copies share the sheet's triangles, the strip between them closes the border, and so the solid is closed because the
//! sheet was checked.

use super::{
    ClosedMesh, MeshDefect, MeshDefects, TriMesh, VertexId,
    check::{self, BorderEdge},
};
use crate::index::{Id, IndexVec};
use glam::DVec3;
use rayon::prelude::*;

/// A triangle mesh whose every edge has one or two triangles and whose every vertex has one fan.
#[derive(Clone, Debug)]
pub struct Sheet {
    mesh: TriMesh,
    border: Vec<BorderEdge>,
}

/// Legs below a cut plane: the border on the plane `z = height` is carried straight down by `depth`.
///
/// Where walls meet the plane at right angles, as on a mirror plane, the legs continue them smoothly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Legs {
    /// The plane's height.
    pub height: f64,
    /// How far the legs reach below it; more than 0.
    pub depth: f64,
}

impl Sheet {
    /// Proves that `mesh` is a manifold, with or without a border.
    ///
    /// # Errors
    /// Every [`MeshDefect`] found.
    pub fn new(mesh: TriMesh) -> Result<Self, MeshDefects> {
        let (defects, border) = check::inspect_open(&mesh);
        if defects.is_empty() { Ok(Self { mesh, border }) } else { Err(MeshDefects(defects)) }
    }

    /// The mesh.
    #[must_use]
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The border's directed edges, as their triangles have them.
    pub fn border(&self) -> impl ExactSizeIterator<Item = (VertexId, VertexId)> + '_ {
        self.border.iter().map(|edge| (edge.from, edge.to))
    }

    /// The solid between two copies of the sheet: `lower` behind its triangles, `upper` before them, with the border closed
    /// by strips.
    ///
    /// That the copies do not cross is not checked here; [`super::self_intersections`] does.
    ///
    /// # Errors
    /// [`MeshDefects`] if a copy has degenerate triangles.
    ///
    /// # Panics
    /// If a copy has another number of vertices than the sheet.
    pub fn thicken(
        &self,
        lower: IndexVec<VertexId, DVec3>,
        upper: IndexVec<VertexId, DVec3>,
        legs: Option<Legs>,
    ) -> Result<ClosedMesh, MeshDefects> {
        let count = self.mesh.positions.len();
        assert!(lower.len() == count && upper.len() == count, "one place for each vertex");
        let mut solid = TriMesh { positions: lower, triangles: Vec::new() };
        solid.triangles.reserve_exact(2 * (self.mesh.triangles.len() + 4 * self.border.len()));
        solid.positions.extend(upper);
        let raised = |v: VertexId| VertexId::from_index(v.index() + count);
        solid.triangles.extend(self.mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]));
        solid.triangles.extend(self.mesh.triangles.iter().map(|t| t.map(raised)));
        let mut strips = Strips { solid: &mut solid, count, legs, feet: std::collections::BTreeMap::new() };
        for edge in &self.border {
            strips.close(*edge);
        }
        strips.close_leg_ends(&self.border);
        let corners = |&triangle: &[VertexId; 3]| solid.corners(triangle);
        let degenerate: Vec<MeshDefect> = solid
            .triangles
            .par_iter()
            .enumerate()
            .filter(|(_, triangle)| check::has_no_area(corners(triangle)))
            .map(|(index, _)| MeshDefect::Degenerate(index))
            .collect();
        if degenerate.is_empty() {
            Ok(ClosedMesh::by_construction(solid))
        } else {
            Err(MeshDefects(degenerate))
        }
    }
}

/// The strips between the borders of two copies.
struct Strips<'a> {
    solid: &'a mut TriMesh,
    count: usize,
    legs: Option<Legs>,
    /// For each border vertex on the legs' plane, the vertices below its lower and its upper copy.
    feet: std::collections::BTreeMap<VertexId, [VertexId; 2]>,
}

impl Strips<'_> {
    fn upper(&self, v: VertexId) -> VertexId {
        VertexId::from_index(v.index() + self.count)
    }

    fn on_legs(&self, v: VertexId) -> bool {
        self.legs.is_some_and(|legs| self.solid.positions[v].z.to_bits() == legs.height.to_bits())
    }

    fn is_leg(&self, edge: BorderEdge) -> bool {
        self.on_legs(edge.from) && self.on_legs(edge.to)
    }

    /// The vertices below the two copies of `v`, made when first needed.
    fn feet(&mut self, v: VertexId) -> [VertexId; 2] {
        let depth = self.legs.map_or(0.0, |legs| legs.depth);
        let above = [v, self.upper(v)];
        let solid = &mut *self.solid;
        *self.feet.entry(v).or_insert_with(|| {
            above.map(|copy| {
                let place = solid.positions[copy] - depth * DVec3::Z;
                solid.positions.push(place)
            })
        })
    }

    fn quad(&mut self, [a, b, c, d]: [VertexId; 4]) {
        self.solid.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// The strip along one border edge: straight across, or down one side of the leg, under it and up the other.
    fn close(&mut self, edge: BorderEdge) {
        let BorderEdge { from: a, to: b } = edge;
        let (upper_a, upper_b) = (self.upper(a), self.upper(b));
        if self.is_leg(edge) {
            let ([low_a, high_a], [low_b, high_b]) = (self.feet(a), self.feet(b));
            self.quad([upper_a, high_a, high_b, upper_b]);
            self.quad([high_a, low_a, low_b, high_b]);
            self.quad([low_a, a, b, low_b]);
        } else {
            self.quad([upper_a, a, b, upper_b]);
        }
    }

    /// The ends of the legs, where the border leaves their plane.
    fn close_leg_ends(&mut self, border: &[BorderEdge]) {
        let legs: Vec<BorderEdge> = border.iter().copied().filter(|&edge| self.is_leg(edge)).collect();
        let starts: std::collections::BTreeSet<_> = legs.iter().map(|edge| edge.from).collect();
        let ends: std::collections::BTreeSet<_> = legs.iter().map(|edge| edge.to).collect();
        for &v in ends.difference(&starts) {
            let [low, high] = self.feet(v);
            self.quad([self.upper(v), high, low, v]);
        }
        for &v in starts.difference(&ends) {
            let [low, high] = self.feet(v);
            self.quad([high, self.upper(v), v, low]);
        }
    }
}
