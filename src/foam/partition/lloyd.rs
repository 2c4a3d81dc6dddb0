//! Lloyd's algorithm on the middle surface (S. Lloyd, IEEE Trans. Inf. Theory 28, 1982).

use super::{Partition, PartitionCell};
use crate::surface::Gap;
use glam::DVec3;

impl Partition {
    /// The seeds moved to the centroids of their cells' sections, weighted by the local gap to first order, and projected
    /// onto the middle surface.
    #[must_use]
    pub fn centred_seeds(&self, gap: &Gap) -> Vec<DVec3> {
        let surface = gap.middle();
        self.cells
            .iter()
            .map(|cell| {
                let centre = centroid(cell, |point| 1.0 / surface.gradient(point).length());
                let moved = surface.project(centre, 0.0).unwrap_or(cell.seed);
                let (inside, _) = self.domain.wrap(moved);
                if self.domain.is_inside_walls(inside) { inside } else { cell.seed }
            })
            .collect()
    }
}

/// The weighted centroid of the triangles between the seed and the sides of the section.
fn centroid(cell: &PartitionCell, weight: impl Fn(DVec3) -> f64) -> DVec3 {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for section in &cell.sections {
        for (side, next) in section.iter().zip(section.iter().cycle().skip(1)) {
            let (a, b) = (side.start - cell.seed, next.start - cell.seed);
            let middle = (a + b) / 3.0;
            let mass = 0.5 * a.cross(b).length() * weight(cell.seed + middle);
            sum += mass * middle;
            total += mass;
        }
    }
    if total > 0.0 { cell.seed + sum / total } else { cell.seed }
}
