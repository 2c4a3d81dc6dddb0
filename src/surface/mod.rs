//! Level sets and the gap between two walls.
//!
//! **Enters** nothing but numbers. **Leaves**: surfaces as level sets `Φ = level` of smooth functions, and [`Gap`], two
//! walls of one level set, which is the only thing that the enclosure and the foam share.
//!
//! | step | file |
//! |---|---|
//! | what a level set can tell: value, gradient, Hessian, curvature, nearest point | this page |
//! | periods, wrapping | `period.rs` |
//! | curvature of a level set from its derivatives | `curvature.rs` |
//! | projection along the gradient, nearest point by Riemannian Newton steps | `nearest.rs` |
//! | the surfaces | `sphere.rs`, `torus.rs`, `plane.rs`, `schwarz_p.rs`, `gyroid.rs`, `diamond.rs` |
//! | planes that cut a gap off | `cut_plane.rs` |
//! | samples on a grid, from tables where `Φ` is a sum over the axes | `rows.rs` |
//! | the signed distance of a surface as a level set of its own: true offsets | `offset.rs` |
//! | points with area weights on a level set: integrals and extremes | `sample.rs` |
//! | two walls, a named gap, the local gap, how far an offset reaches | `gap.rs`, `gap_error.rs` |
//!
//! Not promised: [`LevelSet::nearest`] finds the nearest point of the sheet that it starts on; where several sheets come
//! equally close, [`Gap`] starts from many places and takes the least.
//!
//! Sources: R. Goldman, "Curvature formulas for implicit curves and surfaces", CAGD 22 (2005); P.-A. Absil, R. Mahony and
//! R. Sepulchre, "Optimization algorithms on matrix manifolds" (2008), for Newton steps with a retraction.

mod curvature;
mod cut_plane;
mod diamond;
mod gap;
mod gap_error;
mod gyroid;
mod nearest;
mod offset;
mod period;
mod plane;
mod rows;
mod sample;
mod schwarz_p;
mod sphere;
mod torus;

pub use curvature::Curvature;
pub use cut_plane::CutPlane;
pub use diamond::Diamond;
pub use gap::{Gap, GapKind, GapRange, NamedGap, Wall, WallSide};
pub use gap_error::GapError;
pub use gyroid::Gyroid;
pub use nearest::NoFoot;
pub use offset::{SignedDistance, reach};
pub use period::Period;
pub use plane::Plane;
pub use rows::GridSampler;
pub use sample::{SurfacePoint, SurfaceSamples};
pub use schwarz_p::SchwarzP;
pub use sphere::Sphere;
pub use torus::Torus;

use glam::{DMat3, DVec3};
use std::fmt;

/// Value, gradient and Hessian of a level function at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// `Φ`.
    pub value: f64,
    /// `∇Φ`.
    pub gradient: DVec3,
    /// The matrix of second derivatives.
    pub hessian: DMat3,
}

/// A smooth function `Φ` of space whose level sets are surfaces.
///
/// Lengths are in the surface's own units. The unit normal is `n = ∇Φ / |∇Φ|`; a sphere's points outward, and its mean
/// curvature is positive.
pub trait LevelSet: fmt::Debug + Send + Sync {
    /// The name used in files and on the command line, such as `schwarz-p`.
    fn name(&self) -> &'static str;

    /// `Φ(p)`.
    fn value(&self, p: DVec3) -> f64;

    /// `∇Φ(p)`.
    fn gradient(&self, p: DVec3) -> DVec3;

    /// The matrix of second derivatives of `Φ` at `p`.
    fn hessian(&self, p: DVec3) -> DMat3;

    /// `Φ` and `∇Φ` at once.
    fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value(p), self.gradient(p))
    }

    /// Value, gradient and Hessian at once; cheaper than one by one where they share a search.
    fn jet(&self, p: DVec3) -> Jet {
        Jet { value: self.value(p), gradient: self.gradient(p), hessian: self.hessian(p) }
    }

    /// The translations that leave `Φ` unchanged: none, or along the axes.
    fn period(&self) -> Period;

    /// A box `(lower corner, upper corner)` that holds one period of every level set in use; along an axis without a period
    /// it holds the whole surface `Φ = 0` with room for the walls.
    fn domain(&self) -> (DVec3, DVec3);

    /// The Euler characteristic of `Φ = 0`, one period of it where it is periodic.
    fn euler_characteristic(&self) -> i32;

    /// The open interval of levels whose surfaces have the topology of `Φ = 0`: it ends at critical values of `Φ`.
    fn level_limits(&self) -> (f64, f64);

    /// Whether `Φ` is the signed distance from `Φ = 0`, so that its level sets are offsets of each other.
    fn is_distance(&self) -> bool {
        false
    }

    /// Whether this is a plane that cuts a gap off, see [`CutPlane`]: what lies on it belongs to no wall of the gap.
    fn cuts_off(&self) -> bool {
        false
    }

    /// The unit normal `∇Φ / |∇Φ|` at `p`; undefined (not a number) where the gradient vanishes.
    fn normal(&self, p: DVec3) -> DVec3 {
        let gradient = self.gradient(p);
        gradient / gradient.length()
    }

    /// Mean and Gaussian curvature at `p` of the level set that passes through `p`.
    fn curvature(&self, p: DVec3) -> Curvature {
        Curvature::of_level_set(self.gradient(p), &self.hessian(p))
    }

    /// `Φ` on the nodes of the grid with these coordinates along x, y and z.
    fn sampler<'a>(&'a self, axes: [&'a [f64]; 3]) -> Box<dyn GridSampler + 'a> {
        Box::new(rows::Evaluated { surface: self, axes })
    }

    /// The place on the segment from `a` to `b` where `Φ = level`, if the ends lie on opposite sides of it.
    fn crossing(&self, a: DVec3, b: DVec3, level: f64) -> DVec3 {
        nearest::crossing(self, a, b, level)
    }

    /// A point of `Φ = level` near `p`, reached along the gradient.
    ///
    /// It is not the nearest point, but depends on `p` smoothly and costs a few evaluations.
    ///
    /// # Errors
    /// [`NoFoot`] if the steps do not settle, as where the gradient vanishes or the level does not exist.
    fn project(&self, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
        nearest::project(self, p, level)
    }

    /// The point of `Φ = level` that is nearest to `p`, on the sheet that `p` projects to.
    ///
    /// # Errors
    /// [`NoFoot`] if `p` cannot be projected or the search does not settle.
    fn nearest(&self, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
        self.nearest_from(p, level, p)
    }

    /// As [`LevelSet::nearest`], from a place `start` near the expected foot.
    ///
    /// # Errors
    /// [`NoFoot`] if `start` cannot be projected or the search does not settle.
    fn nearest_from(&self, p: DVec3, level: f64, start: DVec3) -> Result<DVec3, NoFoot> {
        nearest::nearest_from(self, p, level, start)
    }
}

#[cfg(test)]
mod conformance;
