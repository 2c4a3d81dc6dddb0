//! The lines in which a plane cuts a mesh.

use super::{TriMesh, VertexId};
use crate::index::Id;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// A plane that cuts, with axes in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// The origin of its coordinates.
    pub origin: DVec3,
    /// The unit vector of its first coordinate.
    pub right: DVec3,
    /// The unit vector of its second coordinate, at right angles to the first.
    pub up: DVec3,
}

impl CutPlane {
    /// The height of `p` over the plane.
    fn height(&self, p: DVec3) -> f64 {
        (p - self.origin).dot(self.right.cross(self.up))
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new((p - self.origin).dot(self.right), (p - self.origin).dot(self.up))
    }
}

/// A line of a section.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionLine {
    /// Its points, in the plane's coordinates.
    pub points: Vec<DVec2>,
    /// Whether the last point joins the first.
    pub closed: bool,
}

/// The lines in which a plane cuts a mesh; closed ones for a closed mesh.
///
/// Vertices on the plane count as above it, so a plane through vertices gives no double points, but may give segments
/// without length.
#[must_use]
pub fn section(mesh: &TriMesh, plane: &CutPlane) -> Vec<SectionLine> {
    let heights: Vec<f64> = mesh.positions.iter().map(|&p| plane.height(p)).collect();
    // Each crossing is named by its edge; each triangle leads from one crossing to the next.
    let mut next: BTreeMap<(VertexId, VertexId), (VertexId, VertexId)> = BTreeMap::new();
    for &triangle in &mesh.triangles {
        let above = triangle.map(|v| heights[v.index()] >= 0.0);
        let crossing = |from: bool| {
            (0..3).find(|&i| above[i] == from && above[(i + 1) % 3] != from).map(|i| {
                let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
                (a.min(b), a.max(b))
            })
        };
        if let (Some(down), Some(up)) = (crossing(true), crossing(false)) {
            next.insert(down, up);
        }
    }
    let place = |(a, b): (VertexId, VertexId)| {
        let (from, to) = (heights[a.index()], heights[b.index()]);
        plane.flat(mesh.positions[a].lerp(mesh.positions[b], from / (from - to)))
    };
    let reached: std::collections::BTreeSet<_> = next.values().copied().collect();
    let starts: Vec<_> = next.keys().copied().filter(|edge| !reached.contains(edge)).collect();
    let mut lines = Vec::new();
    let mut follow = |first, closed, next: &mut BTreeMap<_, _>| {
        let mut points = vec![place(first)];
        let mut edge = first;
        while let Some(to) = next.remove(&edge) {
            edge = to;
            if edge != first {
                points.push(place(edge));
            }
        }
        lines.push(SectionLine { points, closed });
    };
    for start in starts {
        follow(start, false, &mut next);
    }
    while let Some((&first, _)) = next.first_key_value() {
        follow(first, true, &mut next);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{mesh::Grid, mesh::march, surface::Torus};

    #[test]
    fn a_torus_is_cut_in_two_circles_of_its_tube() {
        let torus = Torus { ring: 2.0, tube: 0.5 };
        let grid = Grid { low: DVec3::splat(-2.7), high: DVec3::splat(2.7), cells: [60; 3] };
        let Ok(mesh) = march(&torus, 0.0, &grid) else { panic!("not meshed") };
        let plane = CutPlane { origin: 0.001 * DVec3::Y, right: DVec3::X, up: DVec3::Z };
        let lines = section(&mesh, &plane);
        assert_eq!(lines.len(), 2);
        for line in lines {
            assert!(line.closed && line.points.len() > 20);
            // On chords of the tube: at most the sagitta of a grid diagonal inside.
            assert!(line.points.iter().all(|p| ((p.x.abs() - 2.0).hypot(p.y) - 0.5).abs() < 0.01));
        }
    }
}
