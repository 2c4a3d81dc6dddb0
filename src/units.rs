//! Lengths that carry their unit where they enter and leave the crate.
//!
//! Everything inside computes with plain `f64` in units of the surface (of the period `L` where there is one). At the
//! borders a length says what it is: [`Mm`] for what is printed or built, [`LevelOffset`] for a difference of the level
//! function `Φ`, which is a length only on a signed distance.

use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// A length in millimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Mm(pub f64);

impl Mm {
    /// This length in units of `period` (both in mm).
    #[must_use]
    pub fn in_units_of(self, period: Self) -> f64 {
        self.0 / period.0
    }

    /// The length of `value` times `period`.
    #[must_use]
    pub fn from_units(value: f64, period: Self) -> Self {
        Self(value * period.0)
    }
}

impl fmt::Display for Mm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match f.precision() {
            Some(digits) => write!(f, "{:.digits$} mm", self.0),
            None => write!(f, "{} mm", self.0),
        }
    }
}

/// A text that is no length in millimetres.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is no length in millimetres: write a number, with or without 'mm' behind it, as in 5.3mm")]
pub struct ParseMmError {
    text: String,
}

impl FromStr for Mm {
    type Err = ParseMmError;

    /// Reads `5.3`, `5.3mm` or `5.3 mm`. Infinite and undefined numbers are refused.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let number = text.trim();
        let number = number.strip_suffix("mm").unwrap_or(number).trim();
        match number.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Self(value)),
            _ => Err(ParseMmError { text: text.to_owned() }),
        }
    }
}

/// An offset of the level function `Φ`: the walls of a level-set gap are `Φ = ±δ`.
///
/// It has the unit of `Φ`: none for the triply periodic surfaces, a length for signed distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct LevelOffset(pub f64);

impl fmt::Display for LevelOffset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match f.precision() {
            Some(digits) => write!(f, "{:.digits$}", self.0),
            None => write!(f, "{}", self.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_are_read_with_and_without_their_unit() {
        for text in ["5.3", "5.3mm", " 5.3 mm "] {
            assert_eq!(text.parse::<Mm>(), Ok(Mm(5.3)));
        }
        for text in ["", "mm", "5.3cm", "NaN", "inf", "5,3"] {
            assert!(text.parse::<Mm>().is_err(), "{text}");
        }
    }

    #[test]
    fn units_of_the_period_and_back_is_the_identity() {
        let period = Mm(200.0);
        assert_eq!(Mm::from_units(Mm(32.0).in_units_of(period), period), Mm(32.0));
    }
}
