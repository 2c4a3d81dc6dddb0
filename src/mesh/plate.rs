//! A flat plate with pockets and through-holes, from its outlines.
//!
//! All outlines are triangulated together (constrained Delaunay, crate `spade`), each triangle is top, pocket floor or hole,
//! and faces and walls follow from that; every level uses the same triangulation, so that no edge is left open.

use super::{ClosedMesh, MeshDefects, TriMesh, VertexId};
use glam::{DVec2, DVec3};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::BTreeMap;

/// A closed outline in the plane; the last point joins the first.
pub type Ring = Vec<DVec2>;

/// A recess in the top face.
#[derive(Clone, Debug, PartialEq)]
pub struct Pocket {
    /// Its outlines: a ring within a ring is an island.
    pub rings: Vec<Ring>,
    /// How deep it is; less than the plate is thick.
    pub depth: f64,
}

/// A plate lying on `z = 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Plate {
    /// The outer edge.
    pub outline: Ring,
    /// The thickness.
    pub thickness: f64,
    /// Recesses in the top.
    pub pockets: Vec<Pocket>,
    /// Holes right through.
    pub holes: Vec<Ring>,
}

/// Why a plate cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlateError {
    /// Two outlines cross.
    #[error("two outlines of the plate cross near x = {0:.2}, y = {1:.2}")]
    Crossing(f64, f64),
    /// A coordinate that cannot be triangulated.
    #[error("an outline of the plate has an unusable coordinate: {0}")]
    Coordinate(String),
    /// The result does not bound a solid.
    #[error(transparent)]
    Open(#[from] MeshDefects),
}

/// The height of the upper face over a triangle of the plan; `None` in a hole or outside.
type Height = Option<f64>;

impl Plate {
    /// The solid.
    ///
    /// # Errors
    /// [`PlateError`] if outlines cross.
    pub fn solid(&self) -> Result<ClosedMesh, PlateError> {
        let plan = self.triangulate()?;
        let heights: BTreeMap<_, Height> = plan
            .inner_faces()
            .map(|face| {
                let [x, y] = [face.center().x, face.center().y];
                (face.fix(), self.height_at(DVec2::new(x, y)))
            })
            .collect();
        let mut solid = Levels::default();
        for face in plan.inner_faces() {
            if let Some(top) = heights[&face.fix()] {
                let [a, b, c] = face.positions().map(|p| DVec2::new(p.x, p.y));
                solid.triangle([(a, top), (b, top), (c, top)]);
                solid.triangle([(a, 0.0), (c, 0.0), (b, 0.0)]);
            }
        }
        for edge in plan.directed_edges() {
            let height = |face: Option<_>| face.and_then(|f| heights.get(&f).copied().flatten());
            let here = height(edge.face().as_inner().map(|f| f.fix()));
            let there = height(edge.rev().face().as_inner().map(|f| f.fix()));
            let [from, to] = edge.positions().map(|p| DVec2::new(p.x, p.y));
            match (here, there) {
                (Some(top), None) => solid.wall(from, to, 0.0, top),
                (Some(top), Some(low)) if top > low => solid.wall(from, to, low, top),
                _ => {}
            }
        }
        Ok(ClosedMesh::new(solid.mesh)?)
    }

    fn rings(&self) -> impl Iterator<Item = &Ring> {
        let pockets = self.pockets.iter().flat_map(|pocket| &pocket.rings);
        std::iter::once(&self.outline).chain(pockets).chain(&self.holes)
    }

    fn triangulate(&self) -> Result<ConstrainedDelaunayTriangulation<Point2<f64>>, PlateError> {
        let (mut points, mut edges) = (Vec::new(), Vec::new());
        for ring in self.rings() {
            let first = points.len();
            points.extend(ring.iter().map(|p| Point2::new(p.x, p.y)));
            edges.extend((0..ring.len()).map(|i| [first + i, first + (i + 1) % ring.len()]));
        }
        let mut crossing = None;
        let places = points.clone();
        let plan = ConstrainedDelaunayTriangulation::try_bulk_load_cdt(points, edges, |[a, _]| {
            crossing.get_or_insert(a);
        })
        .map_err(|e| PlateError::Coordinate(e.to_string()))?;
        match crossing.and_then(|at| places.get(at)) {
            Some(p) => Err(PlateError::Crossing(p.x, p.y)),
            None => Ok(plan),
        }
    }

    fn height_at(&self, p: DVec2) -> Height {
        if !inside(std::slice::from_ref(&self.outline), p)
            || self.holes.iter().any(|h| inside(std::slice::from_ref(h), p))
        {
            return None;
        }
        let depth = self.pockets.iter().filter(|pocket| inside(&pocket.rings, p)).map(|pocket| pocket.depth);
        Some(self.thickness - depth.fold(0.0, f64::max))
    }
}

/// Whether `p` lies inside an odd number of the rings.
#[must_use]
pub fn inside(rings: &[Ring], p: DVec2) -> bool {
    let crossings = |ring: &Ring| {
        (0..ring.len())
            .filter(|&i| {
                let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
                (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
            })
            .count()
    };
    rings.iter().map(crossings).sum::<usize>() % 2 == 1
}

/// A mesh whose vertices are shared by place and height.
#[derive(Default)]
struct Levels {
    mesh: TriMesh,
    known: BTreeMap<[u64; 3], VertexId>,
}

impl Levels {
    fn vertex(&mut self, at: DVec2, height: f64) -> VertexId {
        // Adding zero gives −0 and 0 the same bits.
        let key = [at.x + 0.0, at.y + 0.0, height + 0.0].map(f64::to_bits);
        let positions = &mut self.mesh.positions;
        *self.known.entry(key).or_insert_with(|| positions.push(DVec3::new(at.x, at.y, height)))
    }

    fn triangle(&mut self, corners: [(DVec2, f64); 3]) {
        let triangle = corners.map(|(at, height)| self.vertex(at, height));
        self.mesh.triangles.push(triangle);
    }

    /// A wall from `low` to `high` whose outside lies to the right of `from → to`.
    fn wall(&mut self, from: DVec2, to: DVec2, low: f64, high: f64) {
        self.triangle([(from, low), (to, low), (to, high)]);
        self.triangle([(from, low), (to, high), (from, high)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{euler_number, measure};

    fn square(low: f64, high: f64) -> Ring {
        [(low, low), (high, low), (high, high), (low, high)].map(|(x, y)| DVec2::new(x, y)).to_vec()
    }

    #[test]
    fn pockets_and_holes_take_their_volume_and_each_hole_adds_a_handle() -> Result<(), PlateError> {
        let plate = Plate {
            outline: square(0.0, 10.0),
            thickness: 3.0,
            pockets: vec![Pocket { rings: vec![square(1.0, 5.0), square(2.0, 4.0)], depth: 1.0 }],
            holes: vec![square(6.0, 8.0), square(2.5, 3.5)],
        };
        let solid = plate.solid()?;
        let volume = 300.0 - (16.0 - 4.0) - 3.0 * (4.0 + 1.0);
        assert!((measure::volume(solid.mesh()) - volume).abs() < 1e-12);
        // Genus 2: χ = 2 − 2·2.
        assert_eq!(euler_number(solid.mesh()), -2);
        Ok(())
    }

    #[test]
    fn crossing_outlines_are_refused() {
        let plate = Plate {
            outline: square(0.0, 10.0),
            thickness: 3.0,
            pockets: vec![],
            holes: vec![square(2.0, 5.0), square(4.0, 7.0)],
        };
        assert!(matches!(plate.solid(), Err(PlateError::Crossing(..))));
    }
}
