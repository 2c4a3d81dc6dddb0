//! The plane, with or without periods in it.

use super::{Curvature, LevelSet, NoFoot, Period};
use glam::{DMat3, DVec3};

/// `Φ = z`: planes at any height, repeated along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The periods along x and y.
    pub periods: [f64; 2],
}

impl LevelSet for Plane {
    fn name(&self) -> &'static str {
        "plane"
    }

    fn value(&self, p: DVec3) -> f64 {
        p.z
    }

    fn gradient(&self, _p: DVec3) -> DVec3 {
        DVec3::Z
    }

    fn hessian(&self, _p: DVec3) -> DMat3 {
        DMat3::ZERO
    }

    fn period(&self) -> Period {
        Period([Some(self.periods[0]), Some(self.periods[1]), None])
    }

    fn domain(&self) -> (DVec3, DVec3) {
        let [x, y] = self.periods;
        let height = x.max(y);
        (DVec3::new(0.0, 0.0, -height), DVec3::new(x, y, height))
    }

    fn level_limits(&self) -> (f64, f64) {
        (f64::NEG_INFINITY, f64::INFINITY)
    }

    fn euler_characteristic(&self) -> i32 {
        0
    }

    fn is_distance(&self) -> bool {
        true
    }

    fn curvature(&self, _p: DVec3) -> Curvature {
        Curvature { mean: 0.0, gauss: 0.0 }
    }

    fn project(&self, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
        Ok(DVec3::new(p.x, p.y, level))
    }

    fn nearest_from(&self, p: DVec3, level: f64, _start: DVec3) -> Result<DVec3, NoFoot> {
        self.project(p, level)
    }
}
