//! Where a foam lives: how space ends along each axis, and the images that this gives every seed.
//!
//! A periodic axis repeats every seed. A frictionless wall meets films at a right angle, so it acts as a mirror: every
//! seed has a mirror image behind it, and the two walls of an axis together repeat with twice their distance. Both are
//! therefore groups of [`Image`]s: an optional reflection at the low end, then a whole number of translations.

use super::convert::whole;
use crate::surface::{CutPlane, LevelSet, Period};
use glam::{BVec3, DVec3, IVec3};
use serde::{Deserialize, Serialize};

/// How space ends along one axis. Lengths are in units of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// It does not: the gap itself is bounded, and lies between these two coordinates.
    Open {
        /// No part of the gap lies below.
        low: f64,
        /// No part of the gap lies above.
        high: f64,
    },
    /// What leaves at `low + length` comes in at `low`.
    Periodic {
        /// The start of the primary interval.
        low: f64,
        /// The period.
        length: f64,
    },
    /// A frictionless plane wall at either end.
    Walls {
        /// The lower wall.
        low: f64,
        /// The upper wall.
        high: f64,
    },
}

impl Axis {
    /// The lower end of the primary interval.
    #[must_use]
    pub const fn low(self) -> f64 {
        match self {
            Self::Open { low, .. } | Self::Periodic { low, .. } | Self::Walls { low, .. } => low,
        }
    }

    /// The length of the primary interval.
    #[must_use]
    pub const fn length(self) -> f64 {
        match self {
            Self::Open { low, high } | Self::Walls { low, high } => high - low,
            Self::Periodic { length, .. } => length,
        }
    }

    /// The translation after which the images repeat, if they do.
    #[must_use]
    pub const fn repeat(self) -> Option<f64> {
        match self {
            Self::Open { .. } => None,
            Self::Periodic { length, .. } => Some(length),
            Self::Walls { low, high } => Some(2.0 * (high - low)),
        }
    }
}

/// One image of the primary box: a reflection at the low ends of some axes, then `shift` translations along each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Image {
    /// The translations, in units of [`Axis::repeat`].
    pub shift: [i32; 3],
    /// Whether the axis is reflected at its low end first.
    pub mirrored: [bool; 3],
}

impl Image {
    /// The primary box itself.
    pub const IDENTITY: Self = Self { shift: [0; 3], mirrored: [false; 3] };

    /// The pure translation by `shift`.
    #[must_use]
    pub const fn translation(shift: [i32; 3]) -> Self {
        Self { shift, mirrored: [false; 3] }
    }

    /// The translations as a vector.
    #[must_use]
    pub const fn shift(self) -> IVec3 {
        IVec3::from_array(self.shift)
    }

    /// Whether any axis is reflected.
    #[must_use]
    pub fn is_mirrored(self) -> bool {
        BVec3::from_array(self.mirrored).any()
    }

    /// The image that undoes this one.
    #[must_use]
    pub fn inverse(self) -> Self {
        let mut shift = self.shift;
        for (steps, mirrored) in shift.iter_mut().zip(self.mirrored) {
            // A reflection followed by a translation is its own inverse.
            if !mirrored {
                *steps = -*steps;
            }
        }
        Self { shift, mirrored: self.mirrored }
    }

    /// `self` after `first`.
    #[must_use]
    pub fn after(self, first: Self) -> Self {
        let mut result = self;
        for axis in 0..3 {
            let turn = if self.mirrored[axis] { -1 } else { 1 };
            result.shift[axis] = self.shift[axis] + turn * first.shift[axis];
            result.mirrored[axis] = self.mirrored[axis] != first.mirrored[axis];
        }
        result
    }
}

/// How space ends along the three axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Domain {
    /// The x, y and z axes.
    pub axes: [Axis; 3],
}

impl Domain {
    /// One period of a surface along its periodic axes, and all of it along the others.
    #[must_use]
    pub fn of_surface(surface: &dyn LevelSet) -> Self {
        let (low, high) = surface.domain();
        let Period(periods) = surface.period();
        let axis = |index: usize| match periods[index] {
            Some(length) => Axis::Periodic { low: low[index], length },
            None => Axis::Open { low: low[index], high: high[index] },
        };
        Self { axes: std::array::from_fn(axis) }
    }

    /// The lattice of the periodic axes.
    #[must_use]
    pub fn period(&self) -> Period {
        Period(self.axes.map(|axis| match axis {
            Axis::Periodic { length, .. } => Some(length),
            Axis::Open { .. } | Axis::Walls { .. } => None,
        }))
    }

    /// The lowest corner of the primary box.
    #[must_use]
    pub fn low(&self) -> DVec3 {
        DVec3::from_array(self.axes.map(Axis::low))
    }

    /// The edges of the primary box.
    #[must_use]
    pub fn extent(&self) -> DVec3 {
        DVec3::from_array(self.axes.map(Axis::length))
    }

    /// Where `image` takes `point`.
    #[must_use]
    pub fn apply(&self, image: Image, point: DVec3) -> DVec3 {
        let mut result = point;
        for (index, axis) in self.axes.iter().enumerate() {
            if image.mirrored[index] {
                result[index] = 2.0 * axis.low() - result[index];
            }
        }
        result + self.translation(image)
    }

    /// The translation part of `image` as a vector.
    #[must_use]
    pub fn translation(&self, image: Image) -> DVec3 {
        let mut offset = DVec3::ZERO;
        for (index, axis) in self.axes.iter().enumerate() {
            offset[index] = f64::from(image.shift[index]) * axis.repeat().unwrap_or(0.0);
        }
        offset
    }

    /// `point` moved into the primary box along the periodic axes, and the translations that take it back.
    #[must_use]
    pub fn wrap(&self, point: DVec3) -> (DVec3, Image) {
        let mut result = point;
        let mut image = Image::IDENTITY;
        for (index, axis) in self.axes.iter().enumerate() {
            if let Axis::Periodic { low, length } = *axis {
                let steps = ((point[index] - low) / length).floor();
                result[index] -= steps * length;
                // Rounding may land exactly on the upper end.
                let over = result[index] >= low + length;
                if over {
                    result[index] = low;
                }
                image.shift[index] = whole(steps) + i32::from(over);
            }
        }
        (result, image)
    }

    /// Whether `point` lies between the plane walls, where there are some.
    #[must_use]
    pub fn is_inside_walls(&self, point: DVec3) -> bool {
        self.axes.iter().enumerate().all(|(index, axis)| match *axis {
            Axis::Walls { low, high } => (low..=high).contains(&point[index]),
            Axis::Open { .. } | Axis::Periodic { .. } => true,
        })
    }

    /// The plane wall at one end of an axis.
    #[must_use]
    pub fn cut_plane(&self, axis: u8, high: bool) -> CutPlane {
        let end = self.axes[usize::from(axis)];
        let at = if high { end.low() + end.length() } else { end.low() };
        CutPlane { axis, at, keeps_above: !high }
    }

    /// All plane walls.
    #[must_use]
    pub fn cut_planes(&self) -> Vec<CutPlane> {
        let walled = (0_u8..).zip(&self.axes).filter(|(_, axis)| matches!(axis, Axis::Walls { .. }));
        walled.flat_map(|(axis, _)| [false, true].map(|high| self.cut_plane(axis, high))).collect()
    }

    /// `point` reflected at the plane walls until it lies between them.
    #[must_use]
    pub fn reflected_inside(&self, mut point: DVec3) -> DVec3 {
        for (index, axis) in self.axes.iter().enumerate() {
            if let Axis::Walls { low, high } = *axis {
                let turn = 2.0 * (high - low);
                let along = (point[index] - low).rem_euclid(turn);
                point[index] = low + along.min(turn - along);
            }
        }
        point
    }

    /// How many periods of a surface the primary box holds: a whole number where it is periodic, halves between mirror planes.
    #[must_use]
    pub fn periods_of(&self, surface: &dyn LevelSet) -> f64 {
        let Period(periods) = surface.period();
        let along =
            |(axis, period): (&Axis, Option<f64>)| period.map_or(1.0, |period| axis.length() / period);
        self.axes.iter().zip(periods).map(along).product()
    }

    /// Whether any axis ends in plane walls.
    #[must_use]
    pub fn has_walls(&self) -> bool {
        self.axes.iter().any(|axis| matches!(axis, Axis::Walls { .. }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mixed() -> Domain {
        Domain {
            axes: [
                Axis::Periodic { low: 0.0, length: 1.5 },
                Axis::Walls { low: -0.25, high: 0.75 },
                Axis::Open { low: -1.0, high: 1.0 },
            ],
        }
    }

    #[test]
    fn images_form_a_group() {
        let domain = mixed();
        let point = DVec3::new(0.3, 0.1, -0.4);
        let images = [
            Image::IDENTITY,
            Image::translation([2, -1, 0]),
            Image { shift: [-1, 3, 0], mirrored: [false, true, false] },
        ];
        for a in images {
            assert_eq!(a.inverse().after(a), Image::IDENTITY);
            for b in images {
                let two_steps = domain.apply(a, domain.apply(b, point));
                // Two roundings of numbers below 10.
                assert!(domain.apply(a.after(b), point).distance(two_steps) < 1e-14);
            }
        }
    }

    #[test]
    fn wrapping_is_undone_by_its_image() {
        let domain = mixed();
        for x in [-3.1, -1.5, -1e-18, 0.0, 1.499, 1.5, 7.0] {
            let point = DVec3::new(x, 0.2, 0.3);
            let (inside, image) = domain.wrap(point);
            assert!((0.0..1.5).contains(&inside.x), "{inside}");
            assert!(domain.apply(image, inside).distance(point) < 1e-14);
        }
    }

    #[test]
    fn what_is_reflected_lies_inside() {
        let domain = mixed();
        for (y, inside) in [(0.3, 0.3), (-0.35, -0.15), (0.8, 0.7), (1.85, -0.15), (-1.3, 0.7)] {
            let point = domain.reflected_inside(DVec3::new(9.0, y, 0.0));
            assert!((point.y - inside).abs() < 1e-14 && point.x > 8.0, "{y}: {point}");
        }
    }

    #[test]
    fn a_mirror_fixes_its_plane() {
        let domain = mixed();
        let low = Image { shift: [0; 3], mirrored: [false, true, false] };
        let high = Image { shift: [0, 1, 0], mirrored: [false, true, false] };
        assert!((domain.apply(low, DVec3::new(0.0, -0.25, 0.0)).y + 0.25).abs() < 1e-15);
        assert!((domain.apply(high, DVec3::new(0.0, 0.75, 0.0)).y - 0.75).abs() < 1e-15);
    }
}
