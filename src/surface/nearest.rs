//! Projection onto a level set, and the nearest point of it.

use super::LevelSet;
use glam::{DMat3, DVec2, DVec3};

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

/// The first step of Newton's method for a foot, as a part of the domain: the gap's half of a chamber.
const LONGEST_SEARCH: f64 = 0.25;

/// Steps of Newton's method for a foot: each at most [`CONTRACTION`] of the one before, and soon the square of it.
const CONTRACTIONS: usize = 16;

/// How much shorter each of them must be.
const CONTRACTION: f64 = 0.7;

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

/// The foot of `p`: by Newton's method where it contracts from the start, as it does near the surface; else by
/// Riemannian Newton steps on `½|q - p|²` over the level set, each followed by [`project`] as the retraction, with a gradient
/// step where the reduced Hessian is not positive.
pub(super) fn nearest_from<S: LevelSet + ?Sized>(
    surface: &S,
    p: DVec3,
    level: f64,
    start: DVec3,
) -> Result<DVec3, NoFoot> {
    if let Some(foot) = contracted(surface, p, level, start) {
        return Ok(foot);
    }
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

/// Newton's method on `q - p + λ∇Φ(q) = 0`, `Φ(q) = level` from `start`, if its steps become shorter and shorter and
/// the end is a strict minimum of the distance; `None` otherwise.
fn contracted<S: LevelSet + ?Sized>(surface: &S, p: DVec3, level: f64, start: DVec3) -> Option<DVec3> {
    let (low, high) = surface.domain();
    let mut allowed = LONGEST_SEARCH * (high - low).min_element();
    let mut q = start;
    let mut jet = surface.jet(q);
    let mut lambda = (p - q).dot(jet.gradient) / jet.gradient.length_squared();
    for _ in 0..CONTRACTIONS {
        let inverse = (DMat3::IDENTITY + lambda * jet.hessian).inverse();
        let residual = q - p + lambda * jet.gradient;
        let (towards, along) = (inverse * residual, inverse * jet.gradient);
        let change = (jet.value - level - jet.gradient.dot(towards)) / jet.gradient.dot(along);
        let step = -towards - change * along;
        let length = step.length();
        // Not a number, too, where the matrix is singular.
        if length.is_nan() || length > allowed {
            return None;
        }
        q += step;
        let finest = 4.0 * f64::EPSILON * q.abs().max_element().max(p.abs().max_element());
        if length <= finest {
            let low = TangentHessian::new(p - q, jet.gradient, &jet.hessian).eigenvalues()[0];
            return (low > LEAST_STIFFNESS).then_some(q);
        }
        // A last step may be rounding.
        allowed = (CONTRACTION * length).max(16.0 * finest);
        lambda += change;
        jet = surface.jet(q);
    }
    None
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

/// The Hessian of `½|q - p|²` on a level set at `q`: the identity plus height times the shape operator.
struct TangentHessian {
    /// Unit vectors of the tangent plane.
    basis: [DVec3; 2],
    /// Its entries `a`, `b`, `c`: `uu`, `uv`, `vv`.
    entries: [f64; 3],
}

impl TangentHessian {
    /// From `p - q` and the derivatives of the level set at `q`.
    fn new(offset: DVec3, gradient: DVec3, hessian: &DMat3) -> Self {
        let slope = gradient.length();
        let normal = gradient / slope;
        let (u, v) = normal.any_orthonormal_pair();
        let height = offset.dot(normal) / slope;
        let (hu, hv) = (*hessian * u, *hessian * v);
        let entries = [1.0 + height * hu.dot(u), height * hu.dot(v), 1.0 + height * hv.dot(v)];
        Self { basis: [u, v], entries }
    }

    /// The lower and the higher one.
    fn eigenvalues(&self) -> [f64; 2] {
        let [a, b, c] = self.entries;
        let (half_trace, spread) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
        [half_trace - spread, half_trace + spread]
    }

    /// The axis of the lower one, in the basis.
    fn low_axis(&self) -> DVec2 {
        let [a, b, c] = self.entries;
        DVec2::from_angle(0.5 * (-2.0 * b).atan2(c - a))
    }
}

/// The step in the tangent plane at `q` towards the foot of `p`: Newton's, with the absolute values of the reduced Hessian's
/// eigenvalues, and a push down the other side where `q` is a saddle of the distance.
fn tangent_newton_step<S: LevelSet + ?Sized>(surface: &S, p: DVec3, q: DVec3) -> DVec3 {
    let hessian = TangentHessian::new(p - q, surface.gradient(q), &surface.hessian(q));
    let [u, v] = hessian.basis;
    let residual = DVec2::new((p - q).dot(u), (p - q).dot(v));
    let ([low, high], low_axis) = (hessian.eigenvalues(), hessian.low_axis());
    let along = |axis: DVec2, value: f64| residual.dot(axis) / value.abs().max(LEAST_STIFFNESS) * axis;
    let mut step = along(low_axis, low) + along(low_axis.perp(), high);
    if low < -LEAST_STIFFNESS && step.length() <= SADDLE_PUSH * (p - q).length() {
        step += SADDLE_PUSH * (p - q).length() * low_axis;
    }
    step.x * u + step.y * v
}

/// The crossing of `surface = level` between two points on opposite sides: Newton's method along the line, and the middle of
/// what is left where that would leave it.
pub(super) fn crossing<S: LevelSet + ?Sized>(surface: &S, a: DVec3, b: DVec3, level: f64) -> DVec3 {
    let value = |t: f64| surface.value(a.lerp(b, t)) - level;
    let (mut low, mut high) = (0.0, 1.0);
    let (at_low, at_high) = (value(low), value(high));
    let mut t = at_low / (at_low - at_high);
    for _ in 0..STEP_LIMIT {
        let place = a.lerp(b, t);
        let (value, gradient) = surface.value_and_gradient(place);
        let here = value - level;
        if here.abs() < 1e-14 || high - low < 1e-15 {
            return place;
        }
        if (here < 0.0) == (at_low < 0.0) {
            low = t;
        } else {
            high = t;
        }
        let next = t - here / gradient.dot(b - a);
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        if (next - t).abs() <= f64::EPSILON {
            return place;
        }
        t = next;
    }
    a.lerp(b, t)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SchwarzP, offset::reach};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_quick_search_and_the_safe_one_find_the_same_foot() {
        let surface = SchwarzP { period: 1.0 };
        let reach = reach(&surface, 0.0);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut near, mut quick) = (0, 0);
        for _ in 0..4000 {
            let p = DVec3::from_array(std::array::from_fn(|_| random.random::<f64>()));
            let safe = surface.project(p, 0.0).ok().and_then(|start| descend(&surface, p, 0.0, start));
            let found = contracted(&surface, p, 0.0, p);
            if let (Some(safe), Some(found)) = (safe, found) {
                // Both settle to rounding where the distance is stiff; it is stiffer than a twentieth here.
                let apart = if p.distance(safe) < 0.95 * reach { safe.distance(found) } else { 0.0 };
                assert!(apart < 1e-13, "{p}: {safe} {found}");
                // Further away a chamber's middle has several feet; the quick search takes no longer way.
                assert!(p.distance(found) < p.distance(safe) + 1e-12, "{p}: {safe} {found}");
            }
            if safe.is_some_and(|safe| p.distance(safe) < 0.9 * reach) {
                near += 1;
                quick += usize::from(found.is_some());
            }
        }
        assert!(near > 1000 && quick * 100 > 98 * near, "{quick} of {near}");
    }

    #[test]
    fn crossings_lie_on_the_level() {
        let surface = SchwarzP { period: 1.0 };
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut crossings = 0;
        for _ in 0..2000 {
            let [a, b] = [(); 2].map(|()| DVec3::from_array(std::array::from_fn(|_| random.random::<f64>())));
            let level = 2.0 * random.random::<f64>() - 1.0;
            if (surface.value(a) - level) * (surface.value(b) - level) >= 0.0 {
                continue;
            }
            crossings += 1;
            let found = crossing(&surface, a, b, level);
            let along = (found - a).dot(b - a) / (b - a).length_squared();
            assert!((0.0..=1.0).contains(&along) && found.distance(a.lerp(b, along)) < 1e-14);
            // The value's rounding, and the place's times the steepest slope 2π√3.
            assert!((surface.value(found) - level).abs() < 1e-14 + 22.0 * f64::EPSILON, "{a} {b} {level}");
        }
        assert!(crossings > 500, "{crossings}");
    }
}
