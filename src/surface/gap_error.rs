//! Why a gap cannot be had.

use super::NamedGap;

/// A gap that cannot be had between two walls of a level set. Lengths are in the surface's own units.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GapError {
    /// A width, level or margin that is not a positive, finite number.
    #[error("the {what} is {value}; it must be a positive, finite number")]
    NotPositive {
        /// Which number.
        what: &'static str,
        /// What it was.
        value: f64,
    },
    /// A level at or beyond a critical value of the level function, where its surface changes shape or is gone.
    #[error(
        "a wall at level {level} of {surface} is out of range: between {low} and {high} the walls have the topology of the middle surface"
    )]
    Level {
        /// The surface.
        surface: &'static str,
        /// The level asked for.
        level: f64,
        /// The levels must lie above this.
        low: f64,
        /// The levels must lie below this.
        high: f64,
    },
    /// The lower wall is not below the upper one.
    #[error(
        "the lower wall is at level {lower} and the upper one at {upper}; the lower must be below the upper"
    )]
    Order {
        /// The level of the lower wall.
        lower: f64,
        /// The level of the upper wall.
        upper: f64,
    },
    /// No level offset gives the gap.
    #[error(
        "no level-set walls of {surface} have a {named} gap of {width:.6}: the largest is {largest:.6}, where the walls change their topology"
    )]
    Unreachable {
        /// The surface.
        surface: &'static str,
        /// Which gap was named.
        named: NamedGap,
        /// The width asked for.
        width: f64,
        /// The largest width that can be had.
        largest: f64,
    },
    /// The offset would fold.
    #[error(
        "parallel walls of {surface} fold: half the gap ({half:.6}) and what lies behind it ({margin:.6}) reach {beyond:.6}, but the least radius of curvature of the middle surface is {reach:.6}; the largest parallel gap is {largest:.6}",
        half = width / 2.0,
        beyond = width / 2.0 + margin,
        largest = (2.0 * (reach - margin)).max(0.0)
    )]
    Folds {
        /// The surface.
        surface: &'static str,
        /// The width of the gap asked for.
        width: f64,
        /// What must fit within the reach behind each side of the gap, such as the wall's thickness.
        margin: f64,
        /// The least radius of curvature of the middle surface.
        reach: f64,
    },
}

impl GapError {
    /// The same error with its lengths multiplied by `factor`, for messages in another unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Unreachable { surface, named, width, largest } => {
                Self::Unreachable { surface, named, width: width * factor, largest: largest * factor }
            }
            Self::Folds { surface, width, margin, reach } => {
                Self::Folds { surface, width: width * factor, margin: margin * factor, reach: reach * factor }
            }
            other => other,
        }
    }
}
