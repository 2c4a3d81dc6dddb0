//! Blobs of about one cell's size: a band-pass at the pitch, and its local maxima.

use super::{
    plane::{Plane, narrow},
    smooth::Smooth,
};
use glam::DVec2;
use rayon::prelude::*;

/// Widths of the band-pass in pitches. Its response is greatest for a lattice of exactly the pitch and half of that for
/// one a third larger or smaller.
const CENTRE: f64 = 0.18;
const SURROUND: f64 = 0.36;
/// Width over which the response is measured against its own strength, in pitches.
const REACH: f64 = 1.5;
/// Contrast (in grey values of 0..=1) below which a response counts as noise.
const NOISE_FLOOR: f64 = 0.004;

/// A local maximum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Peak {
    /// Where, in pixels of the raster, to a fraction of a pixel.
    pub(crate) position: DVec2,
    /// Height: about 1 for a typical cell of its surroundings.
    pub(crate) strength: f64,
    /// Whether it stands out as an open cell among caps does.
    pub(crate) clear: bool,
}

/// Response to bright blobs of one cell's size, divided by its own root mean square around.
#[must_use]
pub(crate) fn band_pass(grey: &Plane, pitch: f64) -> Plane {
    let mut response = difference(grey, pitch);
    let square = |y: usize, row: &mut [f32]| {
        row.iter_mut().zip(response.row(y)).for_each(|(v, s)| *v = s * s);
    };
    let power = Smooth::mean(grey.width(), grey.height(), REACH * pitch, square);
    let floor = narrow(NOISE_FLOOR * NOISE_FLOOR);
    response.fill_rows(|y, row| power.with_row(y, row, |v, power| v / (power + floor).sqrt()));
    response
}

/// Difference of two Gaussian means: bright blobs of one cell's size.
#[must_use]
pub(crate) fn difference(grey: &Plane, pitch: f64) -> Plane {
    grey.blurred(CENTRE * pitch).zip(&grey.blurred(SURROUND * pitch), |a, b| a - b)
}

/// All maxima of at least `threshold` that are greatest among their eight neighbours; border pixels count.
#[must_use]
pub(crate) fn maxima(response: &Plane, threshold: f32) -> Vec<Peak> {
    let in_row = |y: usize| {
        let row = response.row(y).iter().enumerate().filter(|(_, value)| **value >= threshold);
        let greatest = row.filter(|(x, _)| is_greatest(response, *x, y));
        greatest
            .map(|(x, value)| Peak {
                position: refined(response, x, y),
                strength: f64::from(*value),
                clear: false,
            })
            .collect::<Vec<Peak>>()
    };
    (0..response.height()).into_par_iter().with_min_len(32).flat_map_iter(in_row).collect()
}

fn is_greatest(response: &Plane, x: usize, y: usize) -> bool {
    let value = response.at(x, y);
    (y.saturating_sub(1)..=(y + 1).min(response.height() - 1)).all(|v| {
        (x.saturating_sub(1)..=(x + 1).min(response.width() - 1)).all(|u| {
            let other = response.at(u, v);
            (u, v) == (x, y) || value > other || (value >= other && (v, u) > (y, x))
        })
    })
}

/// Vertex of the parabola through three values along each axis.
fn refined(response: &Plane, x: usize, y: usize) -> DVec2 {
    let at = |x: usize, y: usize| f64::from(response.at(x, y));
    let shift = |before: f64, here: f64, after: f64| {
        let curvature = before - 2.0 * here + after;
        if curvature < 0.0 { (0.5 * (before - after) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
    };
    let dx =
        if x > 0 && x + 1 < response.width() { shift(at(x - 1, y), at(x, y), at(x + 1, y)) } else { 0.0 };
    let dy =
        if y > 0 && y + 1 < response.height() { shift(at(x, y - 1), at(x, y), at(x, y + 1)) } else { 0.0 };
    DVec2::new(x as f64 + 0.5 + dx, y as f64 + 0.5 + dy)
}

/// Of peaks closer together than `distance`, keeps the stronger.
#[must_use]
pub(crate) fn thinned(mut peaks: Vec<Peak>, distance: impl Fn(DVec2) -> f64, reach: f64) -> Vec<Peak> {
    peaks.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    let mut grid = super::grid::Grid::new(reach);
    let mut kept: Vec<Peak> = Vec::new();
    for peak in peaks {
        let limit = distance(peak.position);
        if grid.within(peak.position, limit).next().is_none() {
            grid.insert(peak.position, kept.len());
            kept.push(peak);
        }
    }
    kept
}
