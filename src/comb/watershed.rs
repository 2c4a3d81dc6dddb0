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
/// Radius of a marker that a person has set: most of a cell, whatever fills it.
const MARKER_BY_HAND: f64 = 0.4;
/// A cell ends this far from its marker, in pitches: corners of a regular cell are at 0.58.
pub(crate) const REACH: f64 = 0.95;
/// Longest edge of a tile in pixels, without its margin: such a tile stays in a processor's cache.
const TILE: usize = 448;
/// Overlap of tiles, in pitches: the reach of a cell and the radius of a marker.
const MARGIN: f64 = 1.3;
/// A pixel that nothing has flooded yet, and one that nothing can flood.
const DRY: u16 = u16::MAX - 1;
const BARRIER: u16 = u16::MAX;

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
    #[inline]
    pub(crate) fn holds(&self, point: DVec2) -> bool {
        point.x >= 0.0 && point.y >= 0.0 && point.x < self.width as f64 && point.y < self.height as f64
    }

    /// The cell that owns the pixel at a point, if any.
    #[inline]
    pub(crate) fn at_point(&self, point: DVec2) -> Option<usize> {
        if !self.holds(point) {
            return None;
        }
        let label = self.at(pixel(point.x, self.width), pixel(point.y, self.height));
        (label != Self::NONE).then_some(label as usize)
    }

    /// Gives every pixel of cell `i` to cell `into[i]`, or to none.
    pub(crate) fn relabel(&mut self, into: &[Option<usize>]) {
        let into: Vec<u32> = into.iter().map(|i| i.map_or(Self::NONE, crate::index::checked_u32)).collect();
        self.labels.par_chunks_mut(self.width.max(1)).for_each(|row| {
            row.iter_mut()
                .for_each(|label| *label = into.get(*label as usize).copied().unwrap_or(Self::NONE));
        });
    }

    /// The labels of a row.
    pub(crate) fn row(&self, y: usize) -> &[u32] {
        &self.labels[y * self.width..(y + 1) * self.width]
    }

    /// The label of a pixel.
    pub(crate) fn at(&self, x: usize, y: usize) -> u32 {
        self.labels[y * self.width + x]
    }
}

/// Where a flood begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Marker {
    /// Centre of a disc.
    pub(crate) centre: DVec2,
    /// Local pitch.
    pub(crate) pitch: f64,
    /// Whether a person has set it.
    pub(crate) by_hand: bool,
}

impl Marker {
    fn radius(&self) -> f64 {
        self.pitch * if self.by_hand { MARKER_BY_HAND } else { MARKER_RADIUS }
    }
}

/// Floods `relief` from discs around the markers; where `hidden` holds, nothing floods.
pub(crate) fn flood(relief: &Plane, markers: &[Marker], hidden: Option<&[bool]>) -> Segmentation {
    let (width, height) = (relief.width(), relief.height());
    let mut labels = vec![Segmentation::NONE; width * height];
    let pitches = || markers.iter().map(|marker| marker.pitch);
    let margin = pixels(MARGIN * pitches().fold(0.0, f64::max));
    let ground = Ground { relief, markers, hidden, pitch: median(pitches()).max(1.0) };
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
    markers: &'a [Marker],
    hidden: Option<&'a [bool]>,
    pitch: f64,
}

/// A marker that reaches into a tile, in pixels of the tile with its frame.
struct Source {
    label: u32,
    centre: DVec2,
    squared_reach: f64,
}

/// A pixel of a tile with its frame: column and row.
type Pixel = [u16; 2];

impl Ground<'_> {
    /// Labels of a tile's pixels with a frame of one pixel around them; hidden pixels and the frame are
    /// [`Segmentation::NONE`].
    fn flood(&self, tile: &Tile) -> Vec<u32> {
        let stride = tile.columns.len() + 2;
        let levels = terrain::levels(self.relief, tile, self.pitch);
        let mut owners = self.dry(tile);
        let mut buckets: Vec<Vec<Pixel>> = vec![Vec::new(); LEVELS];
        let sources = self.mark(tile, &mut owners, &mut buckets[0]);
        for level in 0..LEVELS {
            let mut next = 0;
            while let Some(&[x, y]) = buckets[level].get(next) {
                next += 1;
                let owner = owners[usize::from(y) * stride + usize::from(x)];
                let source = &sources[usize::from(owner)];
                for [x, y] in [[x, y - 1], [x - 1, y], [x + 1, y], [x, y + 1]] {
                    let beside = usize::from(y) * stride + usize::from(x);
                    if owners[beside] != DRY {
                        continue;
                    }
                    let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    if place.distance_squared(source.centre) < source.squared_reach {
                        owners[beside] = owner;
                        buckets[usize::from(levels[beside]).max(level)].push([x, y]);
                    }
                }
            }
            buckets[level] = Vec::new();
        }
        let label = |owner: &u16| sources.get(usize::from(*owner)).map_or(Segmentation::NONE, |s| s.label);
        owners.iter().map(label).collect()
    }

    /// A tile that nothing has flooded yet, in a frame that nothing can flood.
    fn dry(&self, tile: &Tile) -> Vec<u16> {
        let stride = tile.columns.len() + 2;
        let mut owners = vec![BARRIER; stride * (tile.rows.len() + 2)];
        for (y, row) in tile.rows.clone().zip(owners.chunks_mut(stride).skip(1)) {
            for (x, owner) in tile.columns.clone().zip(&mut row[1..]) {
                if !self.hidden.is_some_and(|h| h[y * self.relief.width() + x]) {
                    *owner = DRY;
                }
            }
        }
        owners
    }

    /// Gives the discs of the markers that reach into a tile to them, and lists the discs' pixels.
    fn mark(&self, tile: &Tile, owners: &mut [u16], wet: &mut Vec<Pixel>) -> Vec<Source> {
        let (width, height) = (tile.columns.len(), tile.rows.len());
        let corner = DVec2::new(tile.columns.start as f64, tile.rows.start as f64);
        let limit = DVec2::new(width as f64, height as f64);
        let mut sources = Vec::new();
        for (label, marker) in self.markers.iter().enumerate() {
            let (at, radius) = (marker.centre - corner, marker.radius());
            if at.cmplt(DVec2::splat(-radius)).any() || at.cmpgt(limit + radius).any() {
                continue;
            }
            let owner = u16::try_from(sources.len()).unwrap_or(BARRIER);
            let label = crate::index::checked_u32(label);
            sources.push(Source { label, centre: at + 1.0, squared_reach: (REACH * marker.pitch).powi(2) });
            for index in disc(at, radius, width, height) {
                let (x, y) = (index % width + 1, index / width + 1);
                let place = y * (width + 2) + x;
                if owners[place] == DRY {
                    owners[place] = owner;
                    wet.extend(u16::try_from(x).ok().zip(u16::try_from(y).ok()).map(|(x, y)| [x, y]));
                }
            }
        }
        sources
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
