//! Bond-orientational order.

use crate::foam::{convert::as_f64, domain::Image, ground::Ground, spatial::Bins};
use glam::{DVec2, DVec3};

/// Neighbours are the seeds within this many local spacings: between the first shell (1) and the second (√3).
const FIRST_SHELL: f64 = 1.4;

/// The mean of |ψ6| = |⟨exp 6iθ⟩| over all seeds, θ being the directions to the neighbours in the tangent plane.
///
/// 1 for the hexagonal lattice, about 0.35 for random points.
pub(super) fn psi6(ground: &Ground, points: &[DVec3]) -> f64 {
    let count = as_f64(points.len());
    let radius = |point| FIRST_SHELL * ground.spacing(count, point);
    let bins = Bins::new(&ground.domain, FIRST_SHELL * ground.mean_spacing(count), points);
    let total: f64 = points
        .iter()
        .enumerate()
        .map(|(index, &point)| {
            let (u, v) = ground.normal(point).any_orthonormal_pair();
            let (mut sum, mut neighbours) = (DVec2::ZERO, 0.0);
            bins.for_each_near(point, radius(point), |other, image, place| {
                if other != index || image != Image::IDENTITY {
                    let bond = place - point;
                    let angle = 6.0 * bond.dot(v).atan2(bond.dot(u));
                    sum += DVec2::from_angle(angle);
                    neighbours += 1.0;
                }
            });
            if neighbours > 0.0 { sum.length() / neighbours } else { 0.0 }
        })
        .sum();
    total / count
}
