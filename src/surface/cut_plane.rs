//! A plane that cuts a gap off.

use super::{Curvature, LevelSet, NoFoot, Period};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// A plane across one of the axes that cuts a gap off, as the open face of an enclosure does: a frictionless wall.
///
/// `Φ` is the distance from it, positive on the side that is kept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutPlane {
    /// The axis that it is perpendicular to, 0 to 2.
    pub axis: u8,
    /// Where it crosses the axis.
    pub at: f64,
    /// Whether what lies above it is kept, or what lies below.
    pub keeps_above: bool,
}

impl CutPlane {
    /// The point of the plane that is nearest to `p`.
    #[must_use]
    pub fn nearest_to(&self, mut p: DVec3) -> DVec3 {
        p[usize::from(self.axis)] = self.at;
        p
    }

    /// The unit normal, into what is kept.
    #[must_use]
    pub fn inward(&self) -> DVec3 {
        let axis = DVec3::AXES[usize::from(self.axis)];
        if self.keeps_above { axis } else { -axis }
    }
}

impl LevelSet for CutPlane {
    fn name(&self) -> &'static str {
        "cut plane"
    }

    fn value(&self, p: DVec3) -> f64 {
        let above = p[usize::from(self.axis)] - self.at;
        if self.keeps_above { above } else { -above }
    }

    fn gradient(&self, _p: DVec3) -> DVec3 {
        self.inward()
    }

    fn hessian(&self, _p: DVec3) -> DMat3 {
        DMat3::ZERO
    }

    fn period(&self) -> Period {
        Period([None; 3])
    }

    fn domain(&self) -> (DVec3, DVec3) {
        let middle = self.nearest_to(DVec3::ZERO);
        (middle - 1.0, middle + 1.0)
    }

    fn level_limits(&self) -> (f64, f64) {
        (f64::NEG_INFINITY, f64::INFINITY)
    }

    // As ∫ K dA / 2π says, and as for a plane with periods: the plane has no end to be counted.
    fn euler_characteristic(&self) -> i32 {
        0
    }

    fn is_distance(&self) -> bool {
        true
    }

    fn cuts_off(&self) -> bool {
        true
    }

    fn curvature(&self, _p: DVec3) -> Curvature {
        Curvature { mean: 0.0, gauss: 0.0 }
    }

    fn project(&self, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
        Ok(self.nearest_to(p) + level * self.inward())
    }

    fn nearest_from(&self, p: DVec3, level: f64, _start: DVec3) -> Result<DVec3, NoFoot> {
        self.project(p, level)
    }
}
