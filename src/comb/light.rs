//! Light and wall colour: one raster in which walls are bright, whatever the photograph's light and colours.

use super::{
    pitch::Polarity,
    plane::{Plane, narrow, pixel},
    raster::Raster,
    smooth::Smooth,
};
use faer::{Col, Mat, Side, prelude::Solve};
use glam::DVec2;

/// Width over which the light is levelled, in pitches.
const LIGHT_REACH: f64 = 1.2;
/// Cut of the first levelling, so that one glint does not set the contrast of its surroundings.
const DETAIL: f32 = 2.0;
/// Walls are at about +1 after levelling; anything brighter is a glint and is cut.
pub(crate) const GLINT: f32 = 1.6;
/// Variance of what is flat.
const FLAT: f32 = 1e-6;
/// Weight of the prior (grey walls) in the wall colour, as a share of the colours' variance.
const COLOUR_RIDGE: f64 = 0.05;

/// Number of colour features: red, green, blue, the least and the greatest of them.
const FEATURES: usize = 5;

/// What the wall colour is learned from.
fn features([r, g, b]: [f32; 3]) -> [f32; FEATURES] {
    [r, g, b, r.min(g).min(b), r.max(g).max(b)]
}

/// A linear measure of a pixel's colour that is greatest for walls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallColour {
    weights: [f32; FEATURES],
}

impl WallColour {
    /// Plain brightness, or darkness.
    pub(crate) fn brightness(polarity: Polarity) -> Self {
        let w = polarity.wall_sign() / 3.0;
        Self { weights: [w, w, w, 0.0, 0.0] }
    }

    /// Fisher's discriminant between the colours at points on walls and at points in cells.
    ///
    /// The least and the greatest channel are features beside the three channels, since pale wax against amber pollen and
    /// against a blue base differ in the least one. `None` where the points do not tell.
    pub(crate) fn learned(raster: &Raster<'_>, walls: &[DVec2], cells: &[DVec2]) -> Option<Self> {
        if walls.len() < 12 || cells.len() < 12 {
            return None;
        }
        let (wall, wall_scatter) = moments(raster, walls);
        let (cell, cell_scatter) = moments(raster, cells);
        let mut matrix = [[0.0; FEATURES]; FEATURES];
        let mut difference = [0.0; FEATURES];
        for i in 0..FEATURES {
            difference[i] = wall[i] - cell[i];
            for j in 0..FEATURES {
                matrix[i][j] = wall_scatter[i][j] + cell_scatter[i][j];
            }
        }
        let trace: f64 = (0..FEATURES).map(|i| matrix[i][i]).sum::<f64>() / FEATURES as f64;
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] += COLOUR_RIDGE * trace + 1e-9;
        }
        let matrix = Mat::from_fn(FEATURES, FEATURES, |i, j| matrix[i][j]);
        let right = Col::from_fn(FEATURES, |i| difference[i]);
        let solution = matrix.llt(Side::Lower).ok()?.solve(&right);
        let weights: [f64; FEATURES] = std::array::from_fn(|i| solution[i]);
        let scale: f64 = weights.iter().map(|w| w.abs()).sum();
        (scale > 0.0).then(|| Self { weights: weights.map(|w| narrow(w / scale)) })
    }

    /// The measure of a colour.
    pub(crate) fn of(&self, colour: [f32; 3]) -> f32 {
        features(colour).iter().zip(&self.weights).map(|(f, w)| f * w).sum()
    }
}

/// Levels the light: minus the local mean, over the local standard deviation, glints cut; twice.
pub(crate) fn levelled(wallness: &Plane, pitch: f64) -> Plane {
    let (width, height, reach) = (wallness.width(), wallness.height(), LIGHT_REACH * pitch);
    let first = Light::of([width, height], reach, |y, row| row.copy_from_slice(wallness.row(y)));
    let once = |y: usize, row: &mut [f32]| {
        row.copy_from_slice(wallness.row(y));
        first.level(y, row, DETAIL);
    };
    let second = Light::of([width, height], reach, once);
    let mut levelled = Plane::new(width, height, 0.0);
    levelled.fill_rows(|y, row| {
        once(y, row);
        second.level(y, row, GLINT);
    });
    levelled
}

/// The light around each pixel.
struct Light {
    mean: Smooth,
    /// One over the root mean square of what differs from the mean, so that a slope of the light does not count.
    gain: Smooth,
}

impl Light {
    /// The light within about `reach` pixels in a raster whose rows are given by `fill`.
    fn of([width, height]: [usize; 2], reach: f64, fill: impl Fn(usize, &mut [f32]) + Sync) -> Self {
        let mean = Smooth::mean(width, height, reach, &fill);
        let power = Smooth::mean(width, height, reach, |y, row| {
            fill(y, row);
            mean.with_row(y, row, |v, mean| (v - mean) * (v - mean));
        });
        Self { mean, gain: power.map(|power| (power + FLAT).sqrt().recip()) }
    }

    /// Levels a row; what then exceeds `limit` is cut.
    fn level(&self, y: usize, row: &mut [f32], limit: f32) {
        self.mean.with_row(y, row, |v, mean| v - mean);
        self.gain.with_row(y, row, |v, gain| (v * gain).clamp(-limit, limit));
    }
}

type Moments = ([f64; FEATURES], [[f64; FEATURES]; FEATURES]);

fn moments(raster: &Raster<'_>, points: &[DVec2]) -> Moments {
    let at = |p: &DVec2| {
        features(raster.colour(pixel(p.x, raster.width()), pixel(p.y, raster.height()))).map(f64::from)
    };
    let seen: Vec<[f64; FEATURES]> = points.iter().map(at).collect();
    let count = points.len() as f64;
    let mut mean = [0.0; FEATURES];
    for features in &seen {
        mean.iter_mut().zip(features).for_each(|(m, f)| *m += f / count);
    }
    let mut scatter = [[0.0; FEATURES]; FEATURES];
    for features in &seen {
        for i in 0..FEATURES {
            for j in 0..FEATURES {
                scatter[i][j] += (features[i] - mean[i]) * (features[j] - mean[j]) / count;
            }
        }
    }
    (mean, scatter)
}
