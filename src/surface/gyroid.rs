//! The nodal gyroid.

use super::{LevelSet, Period};
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// `Φ = sin X cos Y + sin Y cos Z + sin Z cos X` with `X = 2πx/L` …: the nodal gyroid, period `L`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyroid {
    /// The period `L` of the cubic cell.
    pub period: f64,
}

impl Gyroid {
    /// Sines and cosines of the three phases, and the wave number.
    fn waves(&self, p: DVec3) -> ([f64; 3], [f64; 3], f64) {
        let k = TAU / self.period;
        let phases = (k * p).to_array();
        (phases.map(f64::sin), phases.map(f64::cos), k)
    }
}

impl LevelSet for Gyroid {
    fn name(&self) -> &'static str {
        "gyroid"
    }

    fn value(&self, p: DVec3) -> f64 {
        let (s, c, _) = self.waves(p);
        s[0] * c[1] + s[1] * c[2] + s[2] * c[0]
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let (s, c, k) = self.waves(p);
        k * DVec3::new(c[0] * c[1] - s[2] * s[0], c[1] * c[2] - s[0] * s[1], c[2] * c[0] - s[1] * s[2])
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        let (s, c, k) = self.waves(p);
        let (xx, yy, zz) = (s[0] * c[1] + s[2] * c[0], s[1] * c[2] + s[0] * c[1], s[2] * c[0] + s[1] * c[2]);
        let (xy, yz, zx) = (c[0] * s[1], c[1] * s[2], c[2] * s[0]);
        -k * k * DMat3::from_cols(DVec3::new(xx, xy, zx), DVec3::new(xy, yy, yz), DVec3::new(zx, yz, zz))
    }

    fn period(&self) -> Period {
        Period::cubic(self.period)
    }

    fn domain(&self) -> (DVec3, DVec3) {
        (DVec3::ZERO, DVec3::splat(self.period))
    }

    fn level_limits(&self) -> (f64, f64) {
        (-std::f64::consts::SQRT_2, std::f64::consts::SQRT_2)
    }

    fn euler_characteristic(&self) -> i32 {
        -8
    }
}
