//! The heights that the watershed floods, of one tile of the raster at a time.
//!
//! Below the walls' level the height is the relief; on walls it is the distance from the openings, so that thick wax is
//! shared in the middle. The distance is exact (Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions",
//! Theory of Computing 8, 2012, in its two steps: down the columns, then along the rows, where only a row's own run of wall
//! counts, since whatever lies beyond the run is farther than its end).

use super::{
    light::GLINT,
    plane::{Plane, narrow, pixel},
};
use std::ops::Range;

/// Heights that are told apart.
pub(crate) const LEVELS: usize = 512;
/// Relief above which a pixel is wall, between the cells' inside (about −0.7) and the walls' crest (about +1.2).
const WALL_LEVEL: f32 = 0.4;
/// Height per pitch of distance from the openings.
const WALL_SLOPE: f64 = 10.0;
/// Farther than this from any opening, in pitches, all is equally high.
const FARTHEST: f64 = 0.6;

/// A rectangle of a raster.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    /// Its columns.
    pub(crate) columns: Range<usize>,
    /// Its rows.
    pub(crate) rows: Range<usize>,
}

/// Heights of a tile with a frame of one pixel around it, row by row, as levels in `0..LEVELS`; `pitch` in pixels.
pub(crate) fn levels(relief: &Plane, tile: &Tile, pitch: f64) -> Vec<u16> {
    let width = tile.columns.len();
    let farthest = pixel((FARTHEST * pitch).ceil(), usize::from(u16::MAX));
    let down = down_columns(relief, tile, u16::try_from(farthest).unwrap_or(u16::MAX));
    let slope = narrow(WALL_SLOPE / pitch);
    let highest = WALL_LEVEL + slope * narrow(farthest as f64);
    let unit = narrow((LEVELS - 1) as f64) / (highest + GLINT);
    let level = |height: f32| quantised((height + GLINT) * unit);
    let mut levels = vec![0; (width + 2) * (tile.rows.len() + 2)];
    let inner = levels.chunks_mut(width + 2).skip(1).map(|row| &mut row[1..=width]);
    for (y, (out, down)) in tile.rows.clone().zip(inner.zip(down.chunks(width))) {
        let row = &relief.row(y)[tile.columns.clone()];
        for (v, r) in out.iter_mut().zip(row) {
            *v = level(*r);
        }
        let mut x = 0;
        while x < width {
            let end = down[x..].iter().position(|d| *d == 0).map_or(width, |run| x + run);
            for (place, v) in (x..end).zip(&mut out[x..end]) {
                let squared = nearest(down, x..end, place, farthest);
                *v = level(WALL_LEVEL + slope * narrow(f64::from(squared).sqrt()));
            }
            x = end + 1;
        }
    }
    levels
}

/// Squared distance to the nearest opening, from a place in the run of wall `run` of a row.
fn nearest(down: &[u16], run: Range<usize>, place: usize, farthest: usize) -> u32 {
    let square = |length: usize| u32::try_from(length * length).unwrap_or(u32::MAX);
    let to_left = if run.start > 0 { place + 1 - run.start } else { farthest };
    let to_right = if run.end < down.len() { run.end - place } else { farthest };
    let reach = to_left.min(to_right).min(farthest);
    let mut least = square(reach);
    let first = (place + 1).saturating_sub(reach).max(run.start);
    let last = (place + reach).min(run.end);
    for (other, distance) in (first..last).zip(&down[first..last]) {
        least = least.min(square(usize::from(*distance)) + square(place.abs_diff(other)));
    }
    least
}

/// Distance of every pixel to the nearest opening in its column, no farther than `farthest`; 0 in openings.
fn down_columns(relief: &Plane, tile: &Tile, farthest: u16) -> Vec<u16> {
    let width = tile.columns.len();
    let mut distances = vec![farthest; width * tile.rows.len()];
    let mut above = vec![farthest; width];
    for (y, row) in tile.rows.clone().zip(distances.chunks_mut(width)) {
        let heights = &relief.row(y)[tile.columns.clone()];
        for ((d, above), height) in row.iter_mut().zip(&mut above).zip(heights) {
            *d = if *height < WALL_LEVEL { 0 } else { (*above + 1).min(farthest) };
            *above = *d;
        }
    }
    let mut below = vec![farthest; width];
    for row in distances.chunks_mut(width).rev() {
        for (d, below) in row.iter_mut().zip(&mut below) {
            *d = (*d).min(*below + 1);
            *below = *d;
        }
    }
    distances
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
fn quantised(height: f32) -> u16 {
    height.clamp(0.0, 511.0) as u16
}
