//! The torus, as the level set of its signed distance.

use super::{LevelSet, NoFoot, Period};
use glam::{DMat3, DVec3};

/// `Φ = √((√(x² + y²) − ring)² + z²) − tube`: tori about the z axis with one centre circle.
///
/// Not smooth on the centre circle and on the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    /// The radius of the centre circle.
    pub ring: f64,
    /// The radius of the tube of `Φ = 0`.
    pub tube: f64,
}

impl Torus {
    /// The cylinder radius of `p`, its distance from the centre circle, and the unit vectors outward from the axis and from
    /// the centre circle.
    fn frame(&self, p: DVec3) -> (f64, f64, DVec3, DVec3) {
        let rho = p.x.hypot(p.y);
        let radial = DVec3::new(p.x / rho, p.y / rho, 0.0);
        let from_circle = (rho - self.ring) * radial + p.z * DVec3::Z;
        let s = from_circle.length();
        (rho, s, radial, from_circle / s)
    }
}

impl LevelSet for Torus {
    fn name(&self) -> &'static str {
        "torus"
    }

    fn value(&self, p: DVec3) -> f64 {
        (p.x.hypot(p.y) - self.ring).hypot(p.z) - self.tube
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.frame(p).3
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        // A signed distance bends along its principal directions only: round the tube with 1/s, and round the axis with
        // (outward part of the normal)/(cylinder radius).
        let (rho, s, radial, normal) = self.frame(p);
        let round_axis = DVec3::Z.cross(radial);
        let round_tube = round_axis.cross(normal);
        outer(round_tube) * (1.0 / s) + outer(round_axis) * (normal.dot(radial) / rho)
    }

    fn period(&self) -> Period {
        Period::NONE
    }

    fn domain(&self) -> (DVec3, DVec3) {
        let half = DVec3::new(self.ring + 2.0 * self.tube, self.ring + 2.0 * self.tube, 2.0 * self.tube);
        (-half, half)
    }

    fn level_limits(&self) -> (f64, f64) {
        (-self.tube, self.ring - self.tube)
    }

    fn euler_characteristic(&self) -> i32 {
        0
    }

    fn is_distance(&self) -> bool {
        true
    }

    fn nearest_from(&self, p: DVec3, level: f64, _start: DVec3) -> Result<DVec3, NoFoot> {
        self.project(p, level)
    }
}

/// `v vᵀ`.
fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v.x * v, v.y * v, v.z * v)
}
