//! What thin gaps say: the first terms of the energy of a round bubble in the height of the gap and its own radius.
//!
//! With `ρ² = V/(πd)`: between parallel walls at distance `d` (mean curvature `H` and Gaussian curvature `K` of the middle
//! surface)
//!
//! `E/√(4πVd) = 1 − KV/(8πd) − Kd²/24 + (H² − K)d²/48 − d⁴/(240ρ²)·[H² + 4.5(H² − K)]`,
//!
//! and between level sets, whose gap to first order is `h = 2δ/|∇Φ|`,
//!
//! `E/√(4πVh) = 1 − Kρ²/8 + (3/16) ρ² ∇²h/h − ρ²|∇h|²/(6h²)`.
//!
//! The last term is for a bubble that is held where `h` has a slope `g = ∇h/h`: its balanced centre (`balance.rs`) lies at
//! the place when the circle is shifted by `−gρ²/3`, where the gap is lower by `g²ρ²/3`, and `E ~ √h`.

use super::{Chart, NoBubble};
use crate::surface::GapKind;
use serde::Serialize;
use std::f64::consts::PI;

/// What the formulas need of a place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ThinGap {
    /// The mean curvature of the middle surface.
    pub mean_curvature: f64,
    /// Its Gaussian curvature.
    pub gauss_curvature: f64,
    /// The gap: the distance of parallel walls, `2δ/|∇Φ|` of level sets.
    pub height: f64,
    /// `∇²h/h` over the surface; zero between parallel walls.
    pub height_bend: f64,
    /// `|∇h|/h` over the surface; zero between parallel walls.
    pub height_slope: f64,
    parallel: bool,
}

/// Differences of the height are taken over this part of the least radius of curvature or, on a plane, of the gap.
const DIFFERENCE: f64 = 1e-3;

impl ThinGap {
    /// At the place of a chart.
    ///
    /// # Errors
    /// [`NoBubble::Wide`] where the surface is lost.
    pub fn at(chart: &Chart<'_>) -> Result<Self, NoBubble> {
        let gap = chart.gap();
        let middle = gap.middle();
        let curvature = middle.curvature(chart.place());
        let [lower, upper] = gap.walls();
        let step = upper.level - lower.level;
        let parallel = gap.kind() == GapKind::Parallel || lower.field.is_distance();
        let mut thin = Self {
            mean_curvature: curvature.mean,
            gauss_curvature: curvature.gauss,
            height: if parallel { step } else { step / middle.gradient(chart.place()).length() },
            height_bend: 0.0,
            height_slope: 0.0,
            parallel,
        };
        if !parallel {
            let height = |x: f64, y: f64| Ok(step / middle.gradient(chart.point(x, y)?).length());
            let d = DIFFERENCE / curvature.largest().max(1.0 / (100.0 * thin.height));
            let (east, west, north, south) =
                (height(d, 0.0)?, height(-d, 0.0)?, height(0.0, d)?, height(0.0, -d)?);
            thin.height_bend = (east + west + north + south - 4.0 * thin.height) / (d * d * thin.height);
            thin.height_slope = (east - west).hypot(north - south) / (2.0 * d * thin.height);
        }
        Ok(thin)
    }

    /// The energy of a bubble of this volume in a flat gap of the local height, `√(4πVd)`.
    #[must_use]
    pub fn flat_energy(&self, volume: f64) -> f64 {
        (4.0 * PI * volume * self.height).sqrt()
    }

    /// The energy of a bubble of this volume by the formula that fits the walls.
    #[must_use]
    pub fn energy(&self, volume: f64) -> f64 {
        let (h, k, d) = (self.mean_curvature, self.gauss_curvature, self.height);
        let rho2 = volume / (PI * d);
        let excess = if self.parallel {
            let bend = h * h - k;
            -k * rho2 / 8.0 - k * d * d / 24.0 + bend * d * d / 48.0
                - d.powi(4) / (240.0 * rho2) * (h * h + 4.5 * bend)
        } else {
            rho2 * (-k / 8.0 + 3.0 / 16.0 * self.height_bend - self.height_slope.powi(2) / 6.0)
        };
        self.flat_energy(volume) * (1.0 + excess)
    }
}
