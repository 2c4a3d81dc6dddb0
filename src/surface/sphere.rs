//! The sphere, as the level set of its signed distance.

use super::{Curvature, LevelSet, NoFoot, Period};
use glam::{DMat3, DVec3};

/// `Φ = |x| − radius`: concentric spheres. Not smooth at the centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The radius of `Φ = 0`.
    pub radius: f64,
}

impl LevelSet for Sphere {
    fn name(&self) -> &'static str {
        "sphere"
    }

    fn value(&self, p: DVec3) -> f64 {
        p.length() - self.radius
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        p / p.length()
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        let n = p / p.length();
        (DMat3::IDENTITY - DMat3::from_cols(n.x * n, n.y * n, n.z * n)) * (1.0 / p.length())
    }

    fn period(&self) -> Period {
        Period::NONE
    }

    fn domain(&self) -> (DVec3, DVec3) {
        (DVec3::splat(-2.0 * self.radius), DVec3::splat(2.0 * self.radius))
    }

    fn level_limits(&self) -> (f64, f64) {
        (-self.radius, f64::INFINITY)
    }

    fn euler_characteristic(&self) -> i32 {
        2
    }

    fn is_distance(&self) -> bool {
        true
    }

    fn curvature(&self, p: DVec3) -> Curvature {
        let r = p.length();
        Curvature { mean: 1.0 / r, gauss: 1.0 / (r * r) }
    }

    fn nearest_from(&self, p: DVec3, level: f64, _start: DVec3) -> Result<DVec3, NoFoot> {
        self.project(p, level)
    }
}
