//! What the segmentation says of each cell and of each wall between two cells.

use super::{
    plane::{Plane, pixel},
    watershed::{self, Segmentation},
};
use glam::DVec2;
use rayon::prelude::*;
use std::{collections::BTreeMap, ops::Range};

/// Radius of a cell's inner part, in pitches.
const INNER: f64 = 0.28;

/// A cell's part of the raster.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// Pixels.
    pub(crate) area: f64,
    /// Centre of mass; the marker of a cell without pixels.
    pub(crate) centroid: DVec2,
    /// Mean relief of the inner part.
    pub(crate) inside: f64,
    /// Whether it meets the border of the raster.
    pub(crate) on_border: bool,
    /// Whether it meets pixels of no cell.
    pub(crate) on_nothing: bool,
    /// The columns and rows that hold it.
    frame: [Range<usize>; 2],
}

/// A wall between two cells, as the segmentation has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    /// Extent across the line of the two centres, in pixels.
    pub(crate) length: f64,
    /// Mean relief along it.
    pub(crate) height: f64,
}

/// Area, centre and border contact of all cells; cell `i` is marked by `markers[i]` and reaches no farther from it than
/// `reaches[i]` pixels.
pub(crate) fn regions(
    segmentation: &Segmentation,
    relief: &Plane,
    markers: &[DVec2],
    pitches: &[f64],
    reaches: &[f64],
) -> Vec<Region> {
    let one = |cell: usize| {
        let mut region = region(segmentation, cell, markers[cell], reaches[cell]);
        let disc = watershed::disc(markers[cell], INNER * pitches[cell], relief.width(), relief.height());
        let label = crate::index::checked_u32(cell);
        let (sum, count) = disc
            .filter(|i| segmentation.labels[*i] == label)
            .fold((0.0, 0.0), |(s, n), i| (s + f64::from(relief.data()[i]), n + 1.0));
        region.inside = sum / f64::max(count, 1.0);
        region
    };
    (0..markers.len()).into_par_iter().map(one).collect()
}

fn region(segmentation: &Segmentation, cell: usize, marker: DVec2, reach: f64) -> Region {
    let (width, height) = (segmentation.width, segmentation.height);
    let around = |at: f64, size: usize| pixel(at - reach - 1.0, size)..pixel(at + reach + 1.0, size) + 1;
    let label = crate::index::checked_u32(cell);
    let (mut area, mut sum, mut on_nothing) = (0_usize, [0_usize; 2], false);
    let (mut across, mut down) = (width..0, height..0);
    let columns = around(marker.x, width);
    for y in around(marker.y, height) {
        let mut count = 0;
        for x in segmentation.places(label, y, columns.clone()) {
            count += 1;
            sum[0] += x;
            across = across.start.min(x)..across.end.max(x + 1);
            on_nothing = on_nothing
                || beside(x, y, width, height).any(|(u, v)| segmentation.at(u, v) == Segmentation::NONE);
        }
        if count > 0 {
            area += count;
            sum[1] += count * y;
            down = down.start.min(y)..y + 1;
        }
    }
    let centroid = DVec2::new(sum[0] as f64, sum[1] as f64) / area as f64 + 0.5;
    let on_border = across.start == 0 || down.start == 0 || across.end == width || down.end == height;
    Region {
        area: area as f64,
        centroid: if area > 0 { centroid } else { marker },
        inside: 0.0,
        on_border,
        on_nothing,
        frame: [across, down],
    }
}

/// The pixels beside a pixel that exist.
fn beside(x: usize, y: usize, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    let up = (y > 0).then(|| (x, y - 1));
    let left = (x > 0).then(|| (x - 1, y));
    let right = (x + 1 < width).then_some((x + 1, y));
    let down = (y + 1 < height).then_some((x, y + 1));
    [up, left, right, down].into_iter().flatten()
}

/// All walls between two cells (lower index first).
pub(crate) fn walls(
    segmentation: &Segmentation,
    relief: &Plane,
    regions: &[Region],
) -> BTreeMap<(usize, usize), Wall> {
    (0..regions.len())
        .into_par_iter()
        .flat_map_iter(|cell| walls_of(segmentation, relief, regions, cell))
        .collect::<Vec<_>>()
        .into_iter()
        .collect()
}

/// A wall while its pixel edges are gathered.
struct Gathered {
    other: usize,
    across: DVec2,
    low: f64,
    high: f64,
    height: f64,
    count: f64,
}

/// The walls of a cell with those of higher index.
fn walls_of(
    segmentation: &Segmentation,
    relief: &Plane,
    regions: &[Region],
    cell: usize,
) -> impl Iterator<Item = ((usize, usize), Wall)> {
    let (width, height) = (segmentation.width, segmentation.height);
    let label = crate::index::checked_u32(cell);
    let mut gathered: Vec<Gathered> = Vec::new();
    let [columns, rows] = regions[cell].frame.clone();
    for y in rows {
        for x in segmentation.places(label, y, columns.clone()) {
            for (u, v) in beside(x, y, width, height) {
                let other = segmentation.at(u, v);
                if other <= label || other == Segmentation::NONE {
                    continue;
                }
                let other = other as usize;
                let place = gathered.iter().position(|g| g.other == other).unwrap_or_else(|| {
                    let across =
                        (regions[other].centroid - regions[cell].centroid).perp().normalize_or_zero();
                    let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
                    gathered.push(Gathered { other, across, low, high, height: 0.0, count: 0.0 });
                    gathered.len() - 1
                });
                let wall = &mut gathered[place];
                let along = wall.across.dot(DVec2::new((x + u) as f64 + 1.0, (y + v) as f64 + 1.0) / 2.0);
                wall.low = wall.low.min(along);
                wall.high = wall.high.max(along);
                wall.height += f64::from(relief.at(x, y).max(relief.at(u, v)));
                wall.count += 1.0;
            }
        }
    }
    gathered
        .into_iter()
        .map(move |g| ((cell, g.other), Wall { length: g.high - g.low, height: g.height / g.count }))
}
