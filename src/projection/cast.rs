//! Where a ray first meets a wall.

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
    /// Steps are at least this long.
    least_step: f64,
}

/// Points per axis when the steepest gradient is sought.
const SAMPLES: u32 = 16;

/// The steepest gradient met is taken this much steeper, for those between the samples.
const SAFETY: f64 = 1.3;

impl Caster {
    /// The wall within an extent. The lower wall of a gap is seen from above its level, the upper one from below.
    #[must_use]
    pub fn new(wall: Wall, side: WallSide, extent: Extent) -> Self {
        let size = extent.high - extent.low;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SAMPLES);
        let mut steepest = 0.0_f64;
        for i in 0..SAMPLES {
            for j in 0..SAMPLES {
                for k in 0..SAMPLES {
                    let point = extent.low + size * DVec3::new(at(i), at(j), at(k));
                    let gradient = wall.field.gradient(point).length();
                    steepest = steepest.max(if gradient.is_finite() { gradient } else { 0.0 });
                }
            }
        }
        let least_step = 2e-4 * size.max_element();
        Self { wall, extent, above: side == WallSide::Lower, steepest: SAFETY * steepest, least_step }
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
        let value = |t: f64| self.wall.value(from + t * along);
        let mut t = near;
        let mut before = value(t);
        if (before > 0.0) != self.above {
            return None;
        }
        while t < far {
            let next = (t + (before.abs() / self.steepest).max(self.least_step)).min(far);
            let after = value(next);
            if (before > 0.0) != (after > 0.0) {
                return Some(from + along * bisect(value, t, next, before));
            }
            if next >= far {
                return None;
            }
            (t, before) = (next, after);
        }
        None
    }
}

/// The root between `low` and `high`, to rounding.
fn bisect(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64, at_low: f64) -> f64 {
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if (value(middle) > 0.0) == (at_low > 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Sphere;
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
}
