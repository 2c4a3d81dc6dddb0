//! Marker-controlled watershed: every pixel goes to the cell whose marker's flood reaches it first, walls being high.
//!
//! After Meyer's flooding: pixels are visited in order of the height at which the flood reaches them, first come first
//! served among equals, so that a flat top is shared in the middle. Heights are quantised, which makes the queue a row of
//! buckets. The raster is flooded in tiles that overlap by more than a cell's reach; their number follows from the raster
//! alone, so that the result is the same for any number of threads.

use super::{
    kinds::median,
    plane::{Plane, pixel, pixels},
    terrain::{self, LEVELS, Tile},
};
use glam::DVec2;
use rayon::prelude::*;
use std::ops::Range;

/// Radius of a marker, in pitches: inside any cell, and wide enough to cover a glint at its centre.
const MARKER_RADIUS: f64 = 0.16;
/// A cell ends this far from its marker, in pitches: corners of a regular cell are at 0.58.
pub(crate) const REACH: f64 = 0.95;
/// Longest edge of a tile in pixels, without its margin.
const TILE: usize = 1536;
/// Overlap of tiles, in pitches: the reach of a cell and of the neighbours that it competes with.
const MARGIN: f64 = 2.0;
/// A pixel that nothing has flooded yet.
const DRY: u32 = Segmentation::NONE - 1;

/// Which cell each pixel belongs to.
#[derive(Clone, Debug)]
pub(crate) struct Segmentation {
    /// Width in pixels.
    pub(crate) width: usize,
    /// Height in pixels.
    pub(crate) height: usize,
    /// Index of the marker, or [`Segmentation::NONE`].
    pub(crate) labels: Vec<u32>,
}

impl Segmentation {
    /// The label of pixels that belong to no cell.
    pub(crate) const NONE: u32 = u32::MAX;

    /// Whether a point lies on the raster.
    pub(crate) fn holds(&self, point: DVec2) -> bool {
        let size = DVec2::new(self.width as f64, self.height as f64);
        point.cmpge(DVec2::ZERO).all() && point.cmplt(size).all()
    }

    /// The cell that owns the pixel at a point, if any.
    pub(crate) fn at_point(&self, point: DVec2) -> Option<usize> {
        if !self.holds(point) {
            return None;
        }
        let label = self.at(pixel(point.x, self.width), pixel(point.y, self.height));
        (label != Self::NONE).then_some(label as usize)
    }

    /// Gives every pixel of cell `i` to cell `into[i]`.
    pub(crate) fn relabel(&mut self, into: &[usize]) {
        for label in self.labels.iter_mut().filter(|l| **l != Self::NONE) {
            *label = crate::index::checked_u32(into[*label as usize]);
        }
    }

    /// The label of a pixel.
    pub(crate) fn at(&self, x: usize, y: usize) -> u32 {
        self.labels[y * self.width + x]
    }
}

/// Floods `relief` from discs around the markers; `pitches` are the local pitches of the markers;
/// where `hidden` holds, nothing floods.
pub(crate) fn flood(
    relief: &Plane,
    markers: &[DVec2],
    pitches: &[f64],
    hidden: Option<&[bool]>,
) -> Segmentation {
    let (width, height) = (relief.width(), relief.height());
    let mut labels = vec![Segmentation::NONE; width * height];
    let margin = pixels(MARGIN * pitches.iter().copied().fold(0.0, f64::max));
    let ground = Ground { relief, markers, pitches, hidden, pitch: median(pitches.iter().copied()).max(1.0) };
    let (columns, rows) = (cores(width), cores(height));
    let mut rest = labels.as_mut_slice();
    let mut bands = Vec::with_capacity(rows.len());
    for rows in rows {
        let (band, after) = rest.split_at_mut(rows.len() * width);
        bands.push((rows, band));
        rest = after;
    }
    bands.into_par_iter().for_each(|(rows, band)| {
        let floods: Vec<(Range<usize>, Tile, Vec<u32>)> = columns
            .clone()
            .into_par_iter()
            .map(|core| {
                let tile =
                    Tile { columns: widened(&core, margin, width), rows: widened(&rows, margin, height) };
                let labels = ground.flood(&tile);
                (core, tile, labels)
            })
            .collect();
        for (core, tile, labels) in floods {
            for y in rows.clone() {
                let from = (y - tile.rows.start + 1) * (tile.columns.len() + 2) + core.start
                    - tile.columns.start
                    + 1;
                let to = (y - rows.start) * width;
                band[to + core.start..to + core.end].copy_from_slice(&labels[from..from + core.len()]);
            }
        }
    });
    Segmentation { width, height, labels }
}

/// A length in parts of nearly the same size, none longer than [`TILE`].
fn cores(length: usize) -> Vec<Range<usize>> {
    let count = length.div_ceil(TILE).max(1);
    (0..count).map(|k| k * length / count..(k + 1) * length / count).collect()
}

fn widened(range: &Range<usize>, margin: usize, size: usize) -> Range<usize> {
    range.start.saturating_sub(margin)..(range.end + margin).min(size)
}

struct Ground<'a> {
    relief: &'a Plane,
    markers: &'a [DVec2],
    pitches: &'a [f64],
    hidden: Option<&'a [bool]>,
    pitch: f64,
}

impl Ground<'_> {
    /// Labels of a tile's pixels with a frame of one pixel around them, hidden pixels and frame as [`Segmentation::NONE`].
    fn flood(&self, tile: &Tile) -> Vec<u32> {
        let levels = terrain::levels(self.relief, tile, self.pitch);
        let (width, stride) = (tile.columns.len(), tile.columns.len() + 2);
        let mut labels = self.dry(tile);
        let corner = DVec2::new(tile.columns.start as f64, tile.rows.start as f64) - 1.0;
        let mut buckets: Vec<Vec<usize>> = vec![Vec::new(); LEVELS];
        self.mark(tile, corner, &mut labels, &mut buckets[0]);
        for level in 0..LEVELS {
            let mut next = 0;
            while let Some(&index) = buckets[level].get(next) {
                next += 1;
                let label = labels[index];
                let (centre, pitch) = (self.markers[label as usize] - corner, self.pitches[label as usize]);
                let reach = REACH * pitch;
                for beside in [index - stride, index - 1, index + 1, index + stride] {
                    if labels[beside] != DRY {
                        continue;
                    }
                    let (x, y) = (beside % stride, beside / stride);
                    let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    if place.distance_squared(centre) < reach * reach {
                        labels[beside] = label;
                        let height = usize::from(levels[(y - 1) * width + x - 1]);
                        buckets[height.max(level)].push(beside);
                    }
                }
            }
            buckets[level] = Vec::new();
        }
        labels.iter_mut().filter(|l| **l == DRY).for_each(|l| *l = Segmentation::NONE);
        labels
    }

    /// A tile that nothing has flooded yet.
    fn dry(&self, tile: &Tile) -> Vec<u32> {
        let stride = tile.columns.len() + 2;
        let mut labels = vec![Segmentation::NONE; stride * (tile.rows.len() + 2)];
        for (y, row) in tile.rows.clone().zip(labels.chunks_mut(stride).skip(1)) {
            for (x, label) in tile.columns.clone().zip(&mut row[1..]) {
                if !self.hidden.is_some_and(|h| h[y * self.relief.width() + x]) {
                    *label = DRY;
                }
            }
        }
        labels
    }

    /// Labels the markers' discs within a tile and lists their pixels.
    fn mark(&self, tile: &Tile, corner: DVec2, labels: &mut [u32], wet: &mut Vec<usize>) {
        let (width, height) = (tile.columns.len(), tile.rows.len());
        let limit = DVec2::new(width as f64, height as f64);
        for (label, (centre, pitch)) in self.markers.iter().zip(self.pitches).enumerate() {
            let at = *centre - corner - 1.0;
            let radius = MARKER_RADIUS * pitch;
            if at.cmplt(DVec2::splat(-radius)).any() || at.cmpgt(limit + radius).any() {
                continue;
            }
            for index in disc(at, radius, width, height) {
                let index = (index / width + 1) * (width + 2) + index % width + 1;
                if labels[index] == DRY {
                    labels[index] = crate::index::checked_u32(label);
                    wet.push(index);
                }
            }
        }
    }
}

/// Pixels within `radius` of `centre`; of a centre outside the raster, those that are inside.
pub(crate) fn disc(centre: DVec2, radius: f64, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let rows = pixel(centre.y - radius, height)..=pixel(centre.y + radius, height);
    rows.flat_map(move |y| {
        (pixel(centre.x - radius, width)..=pixel(centre.x + radius, width)).filter_map(move |x| {
            let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            (place.distance_squared(centre) <= radius * radius).then_some(y * width + x)
        })
    })
}
