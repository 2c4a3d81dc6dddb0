//! The nodal diamond surface.

use super::{LevelSet, Period};
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// `Φ = cos X cos Y cos Z − sin X sin Y sin Z` with `X = 2πx/L` …: Schwarz's D-surface, nodal, period `L`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diamond {
    /// The period `L` of the cubic cell.
    pub period: f64,
}

impl Diamond {
    /// Sines and cosines of the three phases, and the wave number.
    fn waves(&self, p: DVec3) -> ([f64; 3], [f64; 3], f64) {
        let k = TAU / self.period;
        let phases = (k * p).to_array();
        (phases.map(f64::sin), phases.map(f64::cos), k)
    }
}

impl LevelSet for Diamond {
    fn name(&self) -> &'static str {
        "diamond"
    }

    fn value(&self, p: DVec3) -> f64 {
        let (s, c, _) = self.waves(p);
        c[0] * c[1] * c[2] - s[0] * s[1] * s[2]
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let (s, c, k) = self.waves(p);
        -k * DVec3::new(
            s[0] * c[1] * c[2] + c[0] * s[1] * s[2],
            c[0] * s[1] * c[2] + s[0] * c[1] * s[2],
            c[0] * c[1] * s[2] + s[0] * s[1] * c[2],
        )
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        let (s, c, k) = self.waves(p);
        let diagonal = s[0] * s[1] * s[2] - c[0] * c[1] * c[2];
        let xy = s[0] * s[1] * c[2] - c[0] * c[1] * s[2];
        let yz = c[0] * s[1] * s[2] - s[0] * c[1] * c[2];
        let zx = s[0] * c[1] * s[2] - c[0] * s[1] * c[2];
        k * k
            * DMat3::from_cols(
                DVec3::new(diagonal, xy, zx),
                DVec3::new(xy, diagonal, yz),
                DVec3::new(zx, yz, diagonal),
            )
    }

    fn period(&self) -> Period {
        Period::cubic(self.period)
    }

    fn domain(&self) -> (DVec3, DVec3) {
        (DVec3::ZERO, DVec3::splat(self.period))
    }

    fn level_limits(&self) -> (f64, f64) {
        (-std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2)
    }

    fn euler_characteristic(&self) -> i32 {
        -16
    }
}
