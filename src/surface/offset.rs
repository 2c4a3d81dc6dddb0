//! True offsets: the signed distance from a surface, as a level set of its own.

use super::{Curvature, Jet, LevelSet, NoFoot, Period, SurfaceSamples};
use glam::{DMat2, DMat3, DVec2, DVec3};
use std::sync::Arc;

/// `Φ(p) = ±|p − foot(p)|`, the signed distance from the zero level of `base`, positive where `base` is.
///
/// Its level sets are the true offsets (parallel surfaces) of the base. Smooth within [`reach`] of it.
#[derive(Clone, Debug)]
pub struct SignedDistance {
    base: Arc<dyn LevelSet>,
}

impl SignedDistance {
    /// The signed distance from `base = 0`.
    #[must_use]
    pub fn new(base: Arc<dyn LevelSet>) -> Self {
        Self { base }
    }

    /// The surface that the distance is measured from.
    #[must_use]
    pub fn base(&self) -> &Arc<dyn LevelSet> {
        &self.base
    }

    /// The foot of `p` on the base, or an undefined point (not a number) where there is none.
    fn foot(&self, p: DVec3) -> DVec3 {
        self.base.nearest(p, 0.0).unwrap_or(DVec3::NAN)
    }

    /// The signed distance of `p` from its foot.
    fn signed(&self, p: DVec3, foot: DVec3) -> f64 {
        (p - foot).dot(self.base.normal(foot))
    }

    /// The second derivatives at signed distance `d` from `foot`: the base's principal curvatures `κ` become
    /// `κ/(1 + dκ)`, along the same directions.
    fn hessian_at(&self, foot: DVec3, d: f64) -> DMat3 {
        let gradient = self.base.gradient(foot);
        let slope = gradient.length();
        let (u, v) = (gradient / slope).any_orthonormal_pair();
        let hessian = self.base.hessian(foot);
        let (hu, hv) = (hessian * u / slope, hessian * v / slope);
        let shape = DMat2::from_cols(DVec2::new(hu.dot(u), hu.dot(v)), DVec2::new(hv.dot(u), hv.dot(v)));
        let moved = shape * (DMat2::IDENTITY + d * shape).inverse();
        let (cu, cv) = (moved.x_axis.x * u + moved.x_axis.y * v, moved.y_axis.x * u + moved.y_axis.y * v);
        DMat3::from_cols(u.x * cu + v.x * cv, u.y * cu + v.y * cv, u.z * cu + v.z * cv)
    }
}

impl LevelSet for SignedDistance {
    fn name(&self) -> &'static str {
        self.base.name()
    }

    fn value(&self, p: DVec3) -> f64 {
        self.signed(p, self.foot(p))
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.base.normal(self.foot(p))
    }

    // One search for the foot instead of two.
    fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let foot = self.foot(p);
        (self.signed(p, foot), self.base.normal(foot))
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        self.jet(p).hessian
    }

    fn jet(&self, p: DVec3) -> Jet {
        let foot = self.foot(p);
        let value = self.signed(p, foot);
        Jet { value, gradient: self.base.normal(foot), hessian: self.hessian_at(foot, value) }
    }

    fn curvature(&self, p: DVec3) -> Curvature {
        let foot = self.foot(p);
        let d = self.signed(p, foot);
        let [a, b] = self.base.curvature(foot).principal().map(|kappa| kappa / (1.0 + d * kappa));
        Curvature { mean: 0.5 * (a + b), gauss: a * b }
    }

    fn period(&self) -> Period {
        self.base.period()
    }

    fn domain(&self) -> (DVec3, DVec3) {
        self.base.domain()
    }

    fn level_limits(&self) -> (f64, f64) {
        let reach = reach(self.base.as_ref(), 0.0);
        (-reach, reach)
    }

    fn euler_characteristic(&self) -> i32 {
        self.base.euler_characteristic()
    }

    fn is_distance(&self) -> bool {
        true
    }

    fn project(&self, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
        let foot = self.base.nearest(p, 0.0)?;
        Ok(foot + level * self.base.normal(foot))
    }

    fn nearest_from(&self, p: DVec3, level: f64, _start: DVec3) -> Result<DVec3, NoFoot> {
        self.project(p, level)
    }
}

/// Lines per axis for the search of the most curved place: fine enough to start in its basin.
const REACH_LINES: usize = 24;

/// How far `surface = level` can be offset to both sides before an offset folds: the least radius of curvature on it.
///
/// `f64::INFINITY` for a plane. Found by sampling and a compass search from the most curved sample, to about 1e-9
/// relative. (An offset can also meet a far part of the surface before it folds; the finished mesh is tested for that.)
#[must_use]
pub fn reach(surface: &dyn LevelSet, level: f64) -> f64 {
    let samples = SurfaceSamples::new(surface, level, REACH_LINES);
    let (_, most) = samples.maximise(surface, |p| surface.curvature(p).largest());
    if most > 0.0 { 1.0 / most } else { f64::INFINITY }
}
