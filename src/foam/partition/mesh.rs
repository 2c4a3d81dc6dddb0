//! A cell as a closed surface of polygons, for export.

use super::{Beyond, PartitionCell};
use crate::surface::Gap;
use glam::DVec3;
use serde::Serialize;
use std::collections::BTreeMap;

/// Rings of points between the middle of a wall's patch and its edge.
const RINGS: u32 = 4;

/// A closed surface of polygons, all counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellMesh {
    /// The corners.
    pub vertices: Vec<DVec3>,
    /// Loops of corners, each with what lies behind it. A film is one plane polygon; a patch on a wall is many triangles and
    /// quadrilaterals with corners on the wall.
    pub loops: Vec<(Beyond, Vec<usize>)>,
}

impl PartitionCell {
    /// The cell as a closed surface of polygons.
    #[must_use]
    pub fn mesh(&self, gap: &Gap) -> CellMesh {
        let mut mesh = Meshing { vertices: Vec::new(), known: BTreeMap::new(), loops: Vec::new() };
        for face in &self.faces {
            match face.beyond {
                Beyond::Wall(side) => {
                    let wall = gap.wall(side);
                    mesh.add_patch(face.beyond, &face.outline, |point| wall.project(point).unwrap_or(point));
                }
                Beyond::Cell(..) | Beyond::Plane { .. } => {
                    let corners = face.outline.iter().map(|&point| mesh.vertex(point)).collect();
                    mesh.loops.push((face.beyond, corners));
                }
            }
        }
        CellMesh { vertices: mesh.vertices, loops: mesh.loops }
    }
}

struct Meshing {
    vertices: Vec<DVec3>,
    /// By the bits of the coordinates: faces that meet share their points exactly.
    known: BTreeMap<[u64; 3], usize>,
    loops: Vec<(Beyond, Vec<usize>)>,
}

impl Meshing {
    fn vertex(&mut self, point: DVec3) -> usize {
        *self.known.entry(point.to_array().map(f64::to_bits)).or_insert_with(|| {
            self.vertices.push(point);
            self.vertices.len() - 1
        })
    }

    /// Rings of quadrilaterals round a fan of triangles, all corners on the wall.
    fn add_patch(&mut self, beyond: Beyond, outline: &[DVec3], onto_wall: impl Fn(DVec3) -> DVec3) {
        let count = outline.len();
        let mean = outline.iter().sum::<DVec3>() / crate::foam::convert::as_f64(count);
        let middle = onto_wall(mean);
        let mut outer: Vec<usize> = outline.iter().map(|&point| self.vertex(point)).collect();
        for ring in (1..RINGS).rev() {
            let share = f64::from(ring) / f64::from(RINGS);
            let inner: Vec<usize> =
                outline.iter().map(|&point| self.vertex(onto_wall(middle.lerp(point, share)))).collect();
            for index in 0..count {
                let next = (index + 1) % count;
                self.loops.push((beyond, vec![outer[index], outer[next], inner[next], inner[index]]));
            }
            outer = inner;
        }
        let centre = self.vertex(middle);
        for index in 0..count {
            self.loops.push((beyond, vec![outer[index], outer[(index + 1) % count], centre]));
        }
    }
}
