//! Where a ray first meets a wall.
//!
//! Along a ray the level function f falls no faster than its steepest gradient allows, and bends no more than its strongest
//! second derivative M: f(t + s) ≥ f + f′s − ½Ms². The ray goes on by as much as is safe by either bound. The first is the better
//! one far from the wall; the second converges like Newton's method, also where the ray grazes the wall.

use crate::surface::{Wall, WallSide};
use glam::DVec3;

/// The box that holds the piece of wall at hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// The lower corner.
    pub low: DVec3,
    /// The upper corner.
    pub high: DVec3,
}

impl Extent {
    /// The part of a ray inside, as distances from its start.
    fn clip(&self, from: DVec3, along: DVec3) -> Option<(f64, f64)> {
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (a, b) =
                ((self.low[axis] - from[axis]) / along[axis], (self.high[axis] - from[axis]) / along[axis]);
            // A ray along the face gives 0/0, which min and max pass over.
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near < far).then_some((near, far))
    }
}

/// A wall made ready for many rays.
#[derive(Clone, Debug)]
pub struct Caster {
    wall: Wall,
    extent: Extent,
    /// Whether the level function is above the wall's level on the side that is seen.
    above: bool,
    /// No gradient is longer than this within the extent.
    steepest: f64,
    /// No second derivative along a line is larger than this within the extent.
    strongest_bend: f64,
    /// Steps are at least this long.
    least_step: f64,
}

/// Points per axis when the steepest gradient and the strongest bend are sought.
const SAMPLES: u32 = 16;

/// Those met are taken this much larger, for what lies between the samples.
const SAFETY: f64 = 1.3;

impl Caster {
    /// The wall within an extent. The lower wall of a gap is seen from above its level, the upper one from below.
    #[must_use]
    pub fn new(wall: Wall, side: WallSide, extent: Extent) -> Self {
        let size = extent.high - extent.low;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SAMPLES);
        let (mut steepest, mut strongest_bend) = (0.0_f64, 0.0_f64);
        let known = |value: f64| if value.is_finite() { value } else { 0.0 };
        for i in 0..SAMPLES {
            for j in 0..SAMPLES {
                for k in 0..SAMPLES {
                    let point = extent.low + size * DVec3::new(at(i), at(j), at(k));
                    steepest = steepest.max(known(wall.field.gradient(point).length()));
                    // The Frobenius norm is no smaller than the largest eigenvalue.
                    let bends = wall.field.hessian(point).to_cols_array().map(|h| h * h);
                    strongest_bend = strongest_bend.max(known(bends.iter().sum::<f64>().sqrt()));
                }
            }
        }
        let least_step = 2e-4 * size.max_element();
        Self {
            wall,
            extent,
            above: side == WallSide::Lower,
            steepest: SAFETY * steepest,
            strongest_bend: SAFETY * strongest_bend,
            least_step,
        }
    }

    /// How far a ray may go on without crossing the wall, where the level function has this value over the wall's and changes
    /// by `slope` per length of ray.
    fn safe_step(&self, value: f64, slope: f64) -> f64 {
        let (towards, bend) = (-slope * value.signum(), self.strongest_bend);
        // The positive root of |f| − towards s − ½ M s², without cancellation.
        let root = (towards * towards + 2.0 * bend * value.abs()).sqrt();
        let bent = if towards > 0.0 { 2.0 * value.abs() / (root + towards) } else { (root - towards) / bend };
        let bent = if bent.is_finite() { bent } else { 0.0 };
        (value.abs() / self.steepest).max(bent).max(self.least_step)
    }

    /// The wall.
    #[must_use]
    pub fn wall(&self) -> &Wall {
        &self.wall
    }

    /// The first point of the wall on a ray, within the extent. None where the ray enters the extent behind the wall, as
    /// through the cut end of a neck.
    #[must_use]
    pub fn first_hit(&self, from: DVec3, along: DVec3) -> Option<DVec3> {
        let (near, far) = self.extent.clip(from, along)?;
        let along_ray = |t: f64| {
            let (value, gradient) = self.wall.field.value_and_gradient(from + t * along);
            (value - self.wall.level, gradient.dot(along))
        };
        let mut t = near;
        let (mut before, mut slope) = along_ray(t);
        if (before > 0.0) != self.above {
            return None;
        }
        while t < far {
            let next = (t + self.safe_step(before, slope)).min(far);
            let (after, next_slope) = along_ray(next);
            if (before > 0.0) != (after > 0.0) {
                let t = root(|t| self.wall.value(from + t * along), [t, next], [before, after]);
                return Some(from + t * along);
            }
            if next >= far {
                return None;
            }
            (t, before, slope) = (next, after, next_slope);
        }
        None
    }
}

/// The root between two places where the function has different signs, by false position as M. Dowell and P. Jarratt have it
/// (BIT 11, 1971): an end that stays put counts half, so that both close in.
fn root(
    value: impl Fn(f64) -> f64,
    [mut low, mut high]: [f64; 2],
    [mut at_low, mut at_high]: [f64; 2],
) -> f64 {
    let tolerance = 1e-14 * low.abs().max(high.abs());
    let mut middle = 0.5 * (low + high);
    for _ in 0..60 {
        let before = middle;
        middle = (low * at_high - high * at_low) / (at_high - at_low);
        let here = value(middle);
        if here == 0.0 || (middle - before).abs() <= tolerance {
            break;
        }
        if (here > 0.0) == (at_high > 0.0) {
            (high, at_high) = (middle, here);
            at_low *= 0.5;
        } else {
            (low, at_low) = (high, at_high);
            (high, at_high) = (middle, here);
        }
    }
    middle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SchwarzP, Sphere};
    use std::sync::Arc;

    #[test]
    fn a_sphere_is_met_on_its_near_side() {
        let wall = Wall { field: Arc::new(Sphere { radius: 2.0 }), level: 0.0 };
        let caster =
            Caster::new(wall, WallSide::Lower, Extent { low: DVec3::splat(-3.0), high: DVec3::splat(3.0) });
        let hit = caster.first_hit(DVec3::new(0.5, 0.0, 50.0), DVec3::NEG_Z);
        assert!(hit.is_some_and(|p| p.distance(DVec3::new(0.5, 0.0, 3.75_f64.sqrt())) < 1e-9), "{hit:?}");
        assert_eq!(caster.first_hit(DVec3::new(2.5, 0.0, 50.0), DVec3::NEG_Z), None);
        assert_eq!(caster.first_hit(DVec3::new(9.0, 0.0, 50.0), DVec3::NEG_Z), None);
    }

    #[test]
    fn the_first_of_several_hits_on_a_periodic_wall_is_found() {
        let wall = Wall { field: Arc::new(SchwarzP { period: 1.0 }), level: -0.2 };
        let extent = Extent { low: DVec3::ZERO, high: DVec3::splat(2.0) };
        let caster = Caster::new(wall.clone(), WallSide::Lower, extent);
        let eye = DVec3::new(9.0, 8.0, 7.0);
        let mut hits = 0;
        for k in 0..400_u32 {
            let [u, v] = [k % 20, k / 20].map(|n| 0.1 * f64::from(n) + 0.05);
            let along = (DVec3::new(u, v, 2.0 - 0.5 * (u + v)) - eye).normalize();
            // The same ray in steps a hundred times finer than any fold of the wall.
            let Some((near, far)) = extent.clip(eye, along) else { continue };
            let at = |n: u32| near + (far - near) * f64::from(n) / 4000.0;
            let below = |t: f64| wall.value(eye + t * along) <= 0.0;
            let crossed = (0..=4000).find(|n| below(at(*n)));
            match (crossed, caster.first_hit(eye, along)) {
                (Some(n), Some(hit)) if n > 0 => {
                    let distance = hit.distance(eye);
                    assert!((at(n - 1) - 1e-9..=at(n) + 1e-9).contains(&distance), "ray {k}: {distance}");
                    hits += 1;
                }
                (Some(0) | None, found) => assert_eq!(found, None, "ray {k}"),
                (crossed, found) => panic!("ray {k}: {crossed:?}, {found:?}"),
            }
        }
        assert!(hits > 100, "{hits}");
    }
}
