//! The free bubble: where on the surface it comes to rest.
//!
//! The energy of the held bubble is a function of two coordinates on the surface. Its gradient is known from the
//! multipliers; differences of the gradient give its Hessian. Steps are Newton's where the landscape is convex, down the
//! modes of negative curvature where it is not, and never longer than a part of the bubble's radius. A bubble is stable if
//! no deformation with its centre held (`Bubble::unstable_shapes`) and no motion of its centre lowers the energy: together
//! the signs of the whole second variation, by the rule for Schur complements.

use super::{
    Bubble, Chart, Meshes, NoBubble,
    held::{chart_at, coarse_equilibrium, first_radius, held},
};
use crate::surface::Gap;
use glam::{DMat2, DVec2, DVec3};
use serde::Serialize;

/// Differences of the force are taken over this part of the radius.
const DIFFERENCE: f64 = 0.02;
/// The longest step, in radii.
const LONGEST: f64 = 0.35;
/// Steps before giving up: a walk across a period of the P-surface takes about twenty.
const STEPS: usize = 200;
/// A force below this part of the tension times the radius is none: the coarse mesh errs by as much.
const STILL: f64 = 1e-9;
/// Curvatures of the landscape below this part of the tension are a rigid motion's.
const FLAT: f64 = 1e-7;

/// The energy of a held bubble near a place, to second order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Landing {
    /// The place.
    pub place: DVec3,
    /// The curvatures of the energy over the surface there, the lower first, in units of tension.
    pub curvatures: [f64; 2],
    /// How many of them are negative.
    pub falling: usize,
    /// How many vanish: the bubble slides there at no cost, as by a rotation that leaves the walls as they are.
    pub rigid: usize,
    /// The force of the walls on the bubble there, on the coarse mesh.
    pub force: f64,
}

/// The end of a free bubble's way.
#[derive(Clone, Debug)]
pub struct Settled {
    /// The bubble at its end.
    pub bubble: Bubble,
    /// The landscape there.
    pub landing: Landing,
    /// Places on the way, the start first, with the energy on the coarse mesh.
    pub way: Vec<(DVec3, f64)>,
}

impl Settled {
    /// Whether the end is a minimum, up to rigid motions.
    #[must_use]
    pub fn is_minimum(&self) -> bool {
        self.landing.falling == 0 && self.bubble.unstable_shapes == 0
    }
}

/// Energy, gradient and Hessian over the surface at a place.
struct Local {
    energy: f64,
    slope: DVec2,
    hessian: DMat2,
    radius: f64,
}

fn local(chart: &Chart<'_>, volume: f64) -> Result<Local, NoBubble> {
    let radius = first_radius(chart, volume)?;
    let here = coarse_equilibrium(chart, volume)?;
    let step = DIFFERENCE * radius;
    let mut columns = [DVec2::ZERO; 2];
    for (column, &axis) in columns.iter_mut().zip(&chart.axes()) {
        for sign in [1.0, -1.0] {
            let beside = Chart::with_axis(chart.gap(), chart.place() + sign * step * axis, chart.axes()[0])?;
            let slope = coarse_equilibrium(&beside, volume)?.slope;
            let force = slope[0] * beside.axes()[0] + slope[1] * beside.axes()[1];
            *column += sign * DVec2::from(chart.axes().map(|e| force.dot(e))) / (2.0 * step);
        }
    }
    let raw = DMat2::from_cols(columns[0], columns[1]);
    let hessian = (raw + raw.transpose()) * 0.5;
    Ok(Local { energy: here.energy, slope: here.slope.into(), hessian, radius })
}

/// Eigenvalues and eigenvectors of a symmetric matrix, the lower first.
fn principal(m: DMat2) -> [(f64, DVec2); 2] {
    let (a, b, c) = (m.x_axis.x, m.x_axis.y, m.y_axis.y);
    let angle = 0.5 * (2.0 * b).atan2(a - c);
    let high = DVec2::from_angle(angle);
    let low = high.perp();
    [(low.dot(m * low), low), (high.dot(m * high), high)]
}

/// The landscape near a place of the middle surface.
///
/// # Errors
/// As [`held`].
pub fn landing(gap: &Gap, volume: f64, place: DVec3) -> Result<Landing, NoBubble> {
    let chart = chart_at(gap, volume, place)?;
    Ok(landing_of(&chart, &local(&chart, volume)?))
}

fn landing_of(chart: &Chart<'_>, local: &Local) -> Landing {
    let modes = principal(local.hessian);
    Landing {
        place: chart.place(),
        curvatures: modes.map(|(value, _)| value),
        falling: modes.iter().filter(|(value, _)| *value < -FLAT).count(),
        rigid: modes.iter().filter(|(value, _)| value.abs() <= FLAT).count(),
        force: local.slope.length(),
    }
}

/// A free bubble of this volume, started at `place`.
///
/// # Errors
/// As [`held`]; [`NoBubble::Restless`] if it does not come to rest.
pub fn settled(gap: &Gap, volume: f64, place: DVec3, meshes: &Meshes) -> Result<Settled, NoBubble> {
    let mut chart = chart_at(gap, volume, place)?;
    let mut way = Vec::new();
    for _ in 0..STEPS {
        let here = local(&chart, volume)?;
        way.push((chart.place(), here.energy));
        let step = downhill(&here);
        if step.length() <= 1e-9 * here.radius {
            let bubble = held(gap, volume, chart.place(), meshes)?;
            return Ok(Settled { landing: landing_of(&chart, &here), bubble, way });
        }
        let (target, _) = chart.walk(step.y.atan2(step.x), step.length())?;
        chart = Chart::with_axis(gap, target, chart.axes()[0])?;
    }
    Err(NoBubble::Restless { place: chart.place(), steps: STEPS })
}

/// The step from a place: none at a minimum.
fn downhill(here: &Local) -> DVec2 {
    let mut step = DVec2::ZERO;
    let longest = LONGEST * here.radius;
    for (value, mode) in principal(here.hessian) {
        let slope = here.slope.dot(mode);
        let still = slope.abs() <= STILL * here.radius;
        if value.abs() <= FLAT && slope.abs() <= FLAT * here.radius {
            continue;
        }
        if value < -FLAT {
            // At a saddle either way is down: take one.
            step += mode * if slope > 0.0 { -longest } else { longest };
        } else if !still {
            step -= mode * (slope / value.max(FLAT)).clamp(-longest, longest);
        }
    }
    step.clamp_length_max(longest)
}
