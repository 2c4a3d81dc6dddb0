//! Periods along the axes.

use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

/// The periods of a function along the three axes, `None` where it has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Period(pub [Option<f64>; 3]);

impl Period {
    /// No period at all.
    pub const NONE: Self = Self([None; 3]);

    /// The same period along all axes.
    #[must_use]
    pub const fn cubic(length: f64) -> Self {
        Self([Some(length); 3])
    }

    /// The vector of `shift` periods; axes without a period give 0.
    #[must_use]
    pub fn translation(&self, shift: IVec3) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| self.0[axis].unwrap_or(0.0) * f64::from(shift[axis])))
    }

    /// The shift that brings `p` nearest to the origin: `p - translation(nearest_shift(p))` lies within half a period.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "coordinates are a few periods, far below 2^31")]
    pub fn nearest_shift(&self, p: DVec3) -> IVec3 {
        IVec3::from_array(std::array::from_fn(|axis| match self.0[axis] {
            Some(length) => (p[axis] / length).round() as i32,
            None => 0,
        }))
    }

    /// The shortest of all images of the difference vector `d`.
    #[must_use]
    pub fn nearest_image(&self, d: DVec3) -> DVec3 {
        d - self.translation(self.nearest_shift(d))
    }

    /// `p` moved by whole periods into `[low, low + period)` along each periodic axis.
    #[must_use]
    pub fn wrap(&self, p: DVec3, low: DVec3) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| match self.0[axis] {
            // rem_euclid can round up to the period itself for tiny negative arguments.
            Some(length) => match low[axis] + (p[axis] - low[axis]).rem_euclid(length) {
                wrapped if wrapped < low[axis] + length => wrapped,
                _ => low[axis],
            },
            None => p[axis],
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_moves_by_whole_periods_into_the_cell() {
        let period = Period([Some(2.0), None, Some(0.5)]);
        for p in [DVec3::new(-3.1, 7.0, 0.5), DVec3::new(-1e-18, -9.0, -1e-18), DVec3::splat(1.99)] {
            let q = period.wrap(p, DVec3::ZERO);
            assert!((0.0..2.0).contains(&q.x) && (0.0..0.5).contains(&q.z), "{q}");
            assert_eq!(q.y.to_bits(), p.y.to_bits());
            assert!(period.nearest_image(q - p).length() < 1e-12);
        }
    }

    #[test]
    fn the_nearest_image_is_no_longer_than_half_a_period_along_each_axis() {
        let period = Period::cubic(3.0);
        let d = period.nearest_image(DVec3::new(100.4, -7.7, 1.6));
        assert!(d.abs().max_element() <= 1.5, "{d}");
    }
}
