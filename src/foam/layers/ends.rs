//! The ends of hexagonal cells with plane films, between plane walls: what bees build and what Fejes Tóth found.
//!
//! Hexagons of side `s`, an upper layer shifted against the lower. With corners of the middle network at heights `±h` and 0:
//!
//! * **rhombic** (the upper axes over every second corner): each end is three rhombi with diagonals `√3 s` and `√(s² + 4h²)`,
//!   and the six side films of a cell lose `3hs/2` in all. Per pair of a lower and an upper cell the ends and the lost sides
//!   make `(3√3/2) s √(s² + 4h²) − 3hs`, least at `h = s/√8` with `(3/√2) s²`;
//! * **Tóth** (the upper axes over the middles of sides): two hexagons of slope `4h/√3 s` and two rhombi of slope `4h/s`,
//!   over areas `5√3/8 s²` and `√3/8 s²`; sides lose `4hs`:
//!   `(5√3/4) s² √(1 + 16h²/3s²) + (√3/4) s² √(1 + 16h²/s²) − 4hs`. At `h = s/4` the hexagons meet at 120°, and the end
//!   saves 0.345 % of a cell's opening against the rhombic one: Fejes Tóth's figure. The least is a little higher up, at
//!   `h = 0.2792 s`, and saves 0.50 %.

use super::Arrangement;

/// An end with plane films; lengths in units of the hexagon's side.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PlaneEnd {
    /// The height of the middle network's corners above and below the mean.
    pub height: f64,
    /// The area of the middle films less what the side films lose, for one lower and one upper cell, over the opening of a
    /// cell. Flat ends have 1.
    pub area: f64,
}

/// The area of a hexagon of side 1.
const OPENING: f64 = 2.598_076_211_353_316;

/// The end of an arrangement at a height.
fn area(arrangement: Arrangement, h: f64) -> f64 {
    let root3 = 3.0_f64.sqrt();
    let area = match arrangement {
        Arrangement::Toth => {
            1.25 * root3 * (1.0 + 16.0 * h * h / 3.0).sqrt() + 0.25 * root3 * (1.0 + 16.0 * h * h).sqrt()
                - 4.0 * h
        }
        Arrangement::Rhombic | Arrangement::Annealed => 1.5 * root3 * (1.0 + 4.0 * h * h).sqrt() - 3.0 * h,
    };
    area / OPENING
}

/// The end of least area with plane films; `None` for an arrangement without a name.
#[must_use]
pub fn plane_end(arrangement: Arrangement) -> Option<PlaneEnd> {
    if arrangement == Arrangement::Annealed {
        return None;
    }
    // The area is convex in the height: golden sections halve the bracket until rounding.
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..90 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if area(arrangement, a) < area(arrangement, b) {
            high = b;
        } else {
            low = a;
        }
    }
    let height = 0.5 * (low + high);
    Some(PlaneEnd { height, area: area(arrangement, height) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bees_end_is_the_rhombic_dodecahedrons() {
        let end = plane_end(Arrangement::Rhombic).unwrap();
        // Golden sections find a flat minimum to the root of rounding.
        assert!((end.height - 8.0_f64.sqrt().recip()).abs() < 1e-7, "{}", end.height);
        assert!((end.area * OPENING - 3.0 / 2.0_f64.sqrt()).abs() < 1e-14, "{}", end.area);
        assert!((OPENING - 1.5 * 3.0_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn toths_end_saves_what_he_said() {
        let bees = plane_end(Arrangement::Rhombic).unwrap().area;
        let at_120_degrees = area(Arrangement::Toth, 0.25);
        assert!(((bees - at_120_degrees) * 100.0 - 0.345).abs() < 1e-3, "{}", bees - at_120_degrees);
        let best = plane_end(Arrangement::Toth).unwrap();
        assert!(best.area < at_120_degrees && ((bees - best.area) * 100.0 - 0.50).abs() < 5e-3, "{best:?}");
    }
}
