//! Projection onto a level set, and the nearest point of it.

use super::LevelSet;
use glam::{DVec2, DVec3};

/// A point could not be brought onto a level set.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no point of {surface} at level {level} was found from {point} (the level does not exist there, or the point lies on the surface's skeleton)"
)]
pub struct NoFoot {
    /// The level set's name.
    pub surface: &'static str,
    /// The level asked for.
    pub level: f64,
    /// Where the search began.
    pub point: DVec3,
}

/// Steps before a search is given up: Newton steps settle in under ten from any sensible start.
const STEP_LIMIT: usize = 60;

/// Halvings of a step before it is given up: 2⁻³⁰ of a step no longer moves a point.
const HALVING_LIMIT: usize = 30;

/// Stiffness of the distance below which a direction counts as flat: its Newton step would leave the neighbourhood.
const LEAST_STIFFNESS: f64 = 1e-3;

/// A push off a saddle, as a part of the distance: large enough to leave it in a few steps.
const SADDLE_PUSH: f64 = 0.02;

/// A creeping step at a focal point that is accepted, as a part of the distance: the distance is then good to 1e-4 of it
/// at worst.
const FOCAL_STEP: f64 = 1e-2;

/// The longest step of a projection, as a part of the domain's least extent: half a chamber.
const LONGEST_STEP: f64 = 0.125;

/// How far aside a search starts anew where the gradient vanishes, as a part of the domain: within the chamber still.
const OFF_CENTRE: f64 = 0.05;

/// Newton steps along the gradient, halved where they do not reduce `|Φ - level|`.
pub(super) fn project<S: LevelSet + ?Sized>(surface: &S, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
    let failed = || NoFoot { surface: surface.name(), level, point: p };
    let (low, high) = surface.domain();
    let longest = LONGEST_STEP * (high - low).min_element();
    let mut q = p;
    let (value, mut gradient) = surface.value_and_gradient(q);
    let mut residual = value - level;
    for _ in 0..STEP_LIMIT {
        let slope2 = gradient.length_squared();
        // A step below the rounding of the coordinates cannot improve the point.
        let floor = 4.0 * f64::EPSILON * (q.abs().max_element() + f64::MIN_POSITIVE) * slope2.sqrt();
        if residual.abs() <= floor {
            return Ok(q);
        }
        if slope2 <= 0.0 || !slope2.is_finite() {
            return Err(failed());
        }
        // Where the gradient nearly vanishes the full step would leave the neighbourhood.
        let full = (-residual / slope2 * gradient).clamp_length_max(longest);
        match halved_until(|factor| {
            let candidate = q + factor * full;
            let (value, gradient) = surface.value_and_gradient(candidate);
            ((value - level).abs() < residual.abs()).then_some((candidate, value - level, gradient))
        }) {
            Some(better) => (q, residual, gradient) = better,
            // No step reduces the residual any more: it is rounding, or the search is stuck.
            None if residual.abs() <= 1e3 * floor => return Ok(q),
            None => return Err(failed()),
        }
    }
    Err(failed())
}

/// Riemannian Newton steps on `½|q - p|²` over the level set, each followed by [`project`] as the retraction; a gradient
/// step where the reduced Hessian is not positive.
pub(super) fn nearest_from<S: LevelSet + ?Sized>(
    surface: &S,
    p: DVec3,
    level: f64,
    start: DVec3,
) -> Result<DVec3, NoFoot> {
    // Where the gradient vanishes, as in the middle of a chamber or on the axis of a neck, no direction leads to the
    // surface; places a little off do.
    let (low, high) = surface.domain();
    let aside = OFF_CENTRE * (high - low).min_element();
    let others = DVec3::AXES.into_iter().flat_map(|axis| [start + aside * axis, start - aside * axis]);
    std::iter::once(start)
        .chain(others)
        .find_map(|place| descend(surface, p, level, surface.project(place, level).ok()?))
        .ok_or(NoFoot { surface: surface.name(), level, point: p })
}

/// The descent from a point `q` of the level set to the foot of `p`; `None` if it does not settle.
fn descend<S: LevelSet + ?Sized>(surface: &S, p: DVec3, level: f64, mut q: DVec3) -> Option<DVec3> {
    let mut distance2 = q.distance_squared(p);
    for _ in 0..STEP_LIMIT {
        let step = tangent_newton_step(surface, p, q);
        let scale = distance2.sqrt().max(p.abs().max_element()).max(q.abs().max_element());
        if step.length() <= 4.0 * f64::EPSILON * scale {
            return Some(q);
        }
        match halved_until(|factor| {
            let candidate = surface.project(q + factor * step, level).ok()?;
            let d2 = candidate.distance_squared(p);
            (d2 < distance2).then_some((candidate, d2))
        }) {
            Some((candidate, d2)) => (q, distance2) = (candidate, d2),
            // The distance is flat to rounding; one full step still improves the foot.
            None if step.length() <= 1e-6 * scale => {
                return Some(surface.project(q + step, level).unwrap_or(q));
            }
            None => break,
        }
    }
    // At a focal point the distance is flat to fourth order and the steps only creep; the distance itself is good by then.
    (tangent_newton_step(surface, p, q).length() <= FOCAL_STEP * distance2.sqrt()).then_some(q)
}

/// The step in the tangent plane at `q` towards the foot of `p`: Newton's, with the absolute values of the reduced Hessian's
/// eigenvalues, and a push down the other side where `q` is a saddle of the distance.
fn tangent_newton_step<S: LevelSet + ?Sized>(surface: &S, p: DVec3, q: DVec3) -> DVec3 {
    let gradient = surface.gradient(q);
    let slope = gradient.length();
    let normal = gradient / slope;
    let (u, v) = normal.any_orthonormal_pair();
    let residual = DVec2::new((p - q).dot(u), (p - q).dot(v));
    // The Hessian of ½|q - p|² on the surface: identity plus height times the shape operator.
    let height = (p - q).dot(normal) / slope;
    let hessian = surface.hessian(q);
    let (hu, hv) = (hessian * u, hessian * v);
    let (a, b, c) = (1.0 + height * hu.dot(u), height * hu.dot(v), 1.0 + height * hv.dot(v));
    let half_trace = 0.5 * (a + c);
    let spread = (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let low_axis = DVec2::from_angle(0.5 * (-2.0 * b).atan2(c - a));
    let (low, high) = (half_trace - spread, half_trace + spread);
    let along = |axis: DVec2, value: f64| residual.dot(axis) / value.abs().max(LEAST_STIFFNESS) * axis;
    let mut step = along(low_axis, low) + along(low_axis.perp(), high);
    if low < -LEAST_STIFFNESS && step.length() <= SADDLE_PUSH * (p - q).length() {
        step += SADDLE_PUSH * (p - q).length() * low_axis;
    }
    step.x * u + step.y * v
}

/// The crossing of `surface = level` between two points on opposite sides, by the Illinois form of the regula falsi.
pub(super) fn crossing<S: LevelSet + ?Sized>(surface: &S, a: DVec3, b: DVec3, level: f64) -> DVec3 {
    let value = |t: f64| surface.value(a.lerp(b, t)) - level;
    let (mut low, mut high) = (0.0, 1.0);
    let (mut at_low, mut at_high) = (value(low), value(high));
    let mut last_side = 0;
    for _ in 0..STEP_LIMIT {
        let t = (low * at_high - high * at_low) / (at_high - at_low);
        let here = value(t);
        if here.abs() < 1e-14 || high - low < 1e-15 {
            return a.lerp(b, t);
        }
        if (here < 0.0) == (at_low < 0.0) {
            (low, at_low) = (t, here);
            at_high *= if last_side == -1 { 0.5 } else { 1.0 };
            last_side = -1;
        } else {
            (high, at_high) = (t, here);
            at_low *= if last_side == 1 { 0.5 } else { 1.0 };
            last_side = 1;
        }
    }
    a.lerp(b, 0.5 * (low + high))
}

/// Tries factors 1, ½, ¼ … until `attempt` succeeds.
fn halved_until<T>(attempt: impl Fn(f64) -> Option<T>) -> Option<T> {
    let mut factor = 1.0;
    for _ in 0..HALVING_LIMIT {
        if let Some(found) = attempt(factor) {
            return Some(found);
        }
        factor *= 0.5;
    }
    None
}
