//! Light and wall colour: one raster in which walls are bright, whatever the photograph's light and colours.

use super::{photo::Colours, pitch::Polarity, plane::Plane};
use faer::{Col, Mat, Side, prelude::Solve};
use glam::DVec2;

/// Width over which the light is levelled, in pitches.
const LIGHT_REACH: f64 = 1.2;
/// Walls are at about +1 after levelling; anything brighter is a glint and is cut.
const GLINT: f32 = 1.6;
/// Weight of the prior (grey walls) in the wall colour, as a share of the colours' variance.
const COLOUR_RIDGE: f64 = 0.05;

/// Number of colour features: red, green, blue, the least and the greatest of them.
const FEATURES: usize = 5;

impl Colours {
    /// Mean of the three channels.
    #[must_use]
    pub(crate) fn grey(&self) -> Plane {
        let [r, g, b] = &self.channels;
        Plane::from_fn(r.width(), r.height(), |x, y| (r.at(x, y) + g.at(x, y) + b.at(x, y)) / 3.0)
    }

    fn features(&self, x: usize, y: usize) -> [f32; FEATURES] {
        let [r, g, b] = [0, 1, 2].map(|c| self.channels[c].at(x, y));
        [r, g, b, r.min(g).min(b), r.max(g).max(b)]
    }
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
    pub(crate) fn learned(colours: &Colours, walls: &[DVec2], cells: &[DVec2]) -> Option<Self> {
        if walls.len() < 12 || cells.len() < 12 {
            return None;
        }
        let (wall, wall_scatter) = moments(colours, walls);
        let (cell, cell_scatter) = moments(colours, cells);
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
        (scale > 0.0).then(|| Self { weights: weights.map(|w| super::plane::narrow(w / scale)) })
    }

    /// The measure of every pixel.
    pub(crate) fn of(&self, colours: &Colours) -> Plane {
        let red = &colours.channels[0];
        Plane::from_fn(red.width(), red.height(), |x, y| {
            colours.features(x, y).iter().zip(&self.weights).map(|(f, w)| f * w).sum()
        })
    }
}

/// Levels the light: minus the local mean, over the local root mean square, glints cut.
pub(crate) fn levelled(wallness: &Plane, pitch: f64) -> Plane {
    let reach = LIGHT_REACH * pitch;
    let once = level(wallness, reach);
    level(&once, reach).map(|v| v.clamp(-GLINT, GLINT))
}

fn level(grey: &Plane, reach: f64) -> Plane {
    let detail = grey.zip(&grey.blurred(reach), |v, m| v - m);
    let power = detail.map(|v| v * v).blurred(reach);
    detail.zip(&power, |v, p| (v / (p + 1e-6).sqrt()).clamp(-2.0, 2.0))
}

type Moments = ([f64; FEATURES], [[f64; FEATURES]; FEATURES]);

fn moments(colours: &Colours, points: &[DVec2]) -> Moments {
    let red = &colours.channels[0];
    let at = |p: &DVec2| {
        colours
            .features(super::plane::pixel(p.x, red.width()), super::plane::pixel(p.y, red.height()))
            .map(f64::from)
    };
    let count = points.len() as f64;
    let mut mean = [0.0; FEATURES];
    for features in points.iter().map(at) {
        mean.iter_mut().zip(features).for_each(|(m, f)| *m += f / count);
    }
    let mut scatter = [[0.0; FEATURES]; FEATURES];
    for features in points.iter().map(at) {
        for i in 0..FEATURES {
            for j in 0..FEATURES {
                scatter[i][j] += (features[i] - mean[i]) * (features[j] - mean[j]) / count;
            }
        }
    }
    (mean, scatter)
}
