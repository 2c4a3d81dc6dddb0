//! Colours that colour-blind readers tell apart.
//!
//! Categories: the palette of M. Okabe and K. Ito, "Color Universal Design" (2008). Continuous quantities: a fit to
//! viridis, which is even in lightness (S. van der Walt and N. Smith, 2015).

/// An opaque colour, sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Colour(pub [u8; 3]);

impl Colour {
    /// As `#rrggbb`.
    #[must_use]
    pub fn hex(self) -> String {
        let [r, g, b] = self.0;
        format!("#{r:02x}{g:02x}{b:02x}")
    }

    /// This colour and `other`, mixed in the ratio `1 − t` to `t`.
    #[must_use]
    pub fn mix(self, other: Self, t: f64) -> Self {
        Self(std::array::from_fn(|i| to_byte((1.0 - t) * f64::from(self.0[i]) + t * f64::from(other.0[i]))))
    }
}

/// The nearest byte.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the byte range")]
fn to_byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Ink for text and outlines.
pub const INK: Colour = Colour([0x22, 0x22, 0x22]);
/// Okabe and Ito's orange.
pub const ORANGE: Colour = Colour([0xe6, 0x9f, 0x00]);
/// Okabe and Ito's sky blue.
pub const SKY: Colour = Colour([0x56, 0xb4, 0xe9]);
/// Okabe and Ito's bluish green.
pub const GREEN: Colour = Colour([0x00, 0x9e, 0x73]);
/// Okabe and Ito's yellow.
pub const YELLOW: Colour = Colour([0xf0, 0xe4, 0x42]);
/// Okabe and Ito's blue.
pub const BLUE: Colour = Colour([0x00, 0x72, 0xb2]);
/// Okabe and Ito's vermilion.
pub const VERMILION: Colour = Colour([0xd5, 0x5e, 0x00]);
/// Okabe and Ito's reddish purple.
pub const PURPLE: Colour = Colour([0xcc, 0x79, 0xa7]);
/// A grey for what does not count.
pub const GREY: Colour = Colour([0x9a, 0x9a, 0x9a]);
/// The pale wax of a hexagon, which is the background of every pattern.
pub const WAX: Colour = Colour([0xf3, 0xea, 0xd3]);

/// The colour of a cell with this many sides, the same in every picture: pale hexagons, warm below six, cold above.
#[must_use]
pub const fn of_sides(sides: u32) -> Colour {
    match sides {
        0..=3 => PURPLE,
        4 => VERMILION,
        5 => ORANGE,
        6 => WAX,
        7 => BLUE,
        8 => GREEN,
        _ => INK,
    }
}

/// Viridis at `t` between 0 and 1 (values outside are clamped; not a number is grey).
#[must_use]
pub fn viridis(t: f64) -> Colour {
    if t.is_nan() {
        return GREY;
    }
    const STOPS: [Colour; 6] = [
        Colour([0x44, 0x01, 0x54]),
        Colour([0x41, 0x44, 0x87]),
        Colour([0x2a, 0x78, 0x8e]),
        Colour([0x22, 0xa8, 0x84]),
        Colour([0x7a, 0xd1, 0x51]),
        Colour([0xfd, 0xe7, 0x25]),
    ];
    let scaled = t.clamp(0.0, 1.0) * 5.0;
    let stop = (0..4).rev().find(|&i| scaled >= f64::from(i)).unwrap_or(0);
    let index = usize::from(u8::try_from(stop).unwrap_or(0));
    STOPS[index].mix(STOPS[index + 1], scaled - f64::from(stop))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viridis_runs_from_dark_to_bright() {
        let lightness = |c: Colour| c.0.iter().map(|&b| u32::from(b)).sum::<u32>();
        let row: Vec<u32> = (0..=20).map(|i| lightness(viridis(f64::from(i) / 20.0))).collect();
        assert!(row.windows(2).all(|w| w[0] <= w[1]), "{row:?}");
        assert_eq!(viridis(f64::NAN), GREY);
        assert_eq!((viridis(-1.0), viridis(2.0)), (viridis(0.0), viridis(1.0)));
    }

    #[test]
    fn fives_sixes_and_sevens_look_different() {
        let mut seen: Vec<Colour> = (3..=8).map(of_sides).collect();
        seen.dedup();
        assert_eq!(seen.len(), 6);
    }
}
