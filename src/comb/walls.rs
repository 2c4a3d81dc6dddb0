//! What the segmentation says of each cell and of each wall between two cells.
//!
//! One pass over the raster in bands of rows gathers the cells' parts, a second one the walls between them. The number of
//! bands is fixed and their sums are added in order, so that results do not depend on the number of threads.

use super::{
    plane::Plane,
    watershed::{self, Segmentation},
};
use glam::DVec2;
use rayon::prelude::*;
use std::{collections::BTreeMap, ops::Range};

/// Radius of a cell's inner part, in pitches.
const INNER: f64 = 0.28;
/// Bands of rows that are gathered by themselves.
const BANDS: usize = 16;

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
}

/// A wall between two cells, as the segmentation has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    /// Extent across the line of the two centres, in pixels.
    pub(crate) length: f64,
    /// Mean relief along it.
    pub(crate) height: f64,
}

/// Area, centre and border contact of all cells; cell `i` is marked by `markers[i]`.
pub(crate) fn regions(
    segmentation: &Segmentation,
    relief: &Plane,
    markers: &[DVec2],
    pitches: &[f64],
) -> Vec<Region> {
    let parts: Vec<Vec<Part>> = bands(segmentation.height)
        .into_par_iter()
        .map(|rows| parts_in(segmentation, rows, markers.len()))
        .collect();
    let one = |cell: usize| {
        let mut whole = Part::default();
        parts.iter().for_each(|band| whole.add(&band[cell]));
        let label = crate::index::checked_u32(cell);
        let disc = watershed::disc(markers[cell], INNER * pitches[cell], relief.width(), relief.height());
        let (sum, count) = disc
            .filter(|i| segmentation.labels[*i] == label)
            .fold((0.0, 0.0), |(s, n), i| (s + f64::from(relief.data()[i]), n + 1.0));
        let mean = DVec2::new(whole.sum[0] as f64, whole.sum[1] as f64) / whole.area as f64;
        Region {
            area: whole.area as f64,
            centroid: if whole.area > 0 { mean + 0.5 } else { markers[cell] },
            inside: sum / f64::max(count, 1.0),
            on_border: whole.on_border,
            on_nothing: whole.on_nothing,
        }
    };
    (0..markers.len()).into_par_iter().map(one).collect()
}

/// What a band holds of a cell.
#[derive(Clone, Copy, Default)]
struct Part {
    area: usize,
    /// Sums of the pixels' columns and rows.
    sum: [usize; 2],
    on_border: bool,
    on_nothing: bool,
}

impl Part {
    const fn add(&mut self, other: &Self) {
        self.area += other.area;
        self.sum[0] += other.sum[0];
        self.sum[1] += other.sum[1];
        self.on_border |= other.on_border;
        self.on_nothing |= other.on_nothing;
    }
}

/// The rows of a raster in bands.
fn bands(height: usize) -> Vec<Range<usize>> {
    (0..BANDS).map(|k| k * height / BANDS..(k + 1) * height / BANDS).collect()
}

/// The parts of all cells in a band.
fn parts_in(segmentation: &Segmentation, rows: Range<usize>, count: usize) -> Vec<Part> {
    let mut parts = vec![Part::default(); count];
    let (last_column, last_row) = (segmentation.width - 1, segmentation.height - 1);
    for y in rows {
        let mut start = 0;
        for run in segmentation.row(y).chunk_by(|a, b| a == b) {
            let end = start + run.len();
            if let Some(part) = parts.get_mut(run[0] as usize) {
                part.area += run.len();
                // The sum of the whole numbers from the run's first column to its last.
                part.sum[0] += run.len() * (start + end - 1) / 2;
                part.sum[1] += run.len() * y;
                part.on_border |= start == 0 || end > last_column || y == 0 || y == last_row;
            } else {
                beside(segmentation, y, start..end, |cell| {
                    if let Some(part) = parts.get_mut(cell as usize) {
                        part.on_nothing = true;
                    }
                });
            }
            start = end;
        }
    }
    parts
}

/// Calls `meet` with the label of every pixel that touches a run of pixels of a row.
fn beside(segmentation: &Segmentation, y: usize, run: Range<usize>, mut meet: impl FnMut(u32)) {
    let above = y.checked_sub(1).into_iter();
    for row in above.chain((y + 1 < segmentation.height).then_some(y + 1)) {
        segmentation.row(row)[run.clone()].iter().for_each(|label| meet(*label));
    }
    let row = segmentation.row(y);
    row[..run.start].last().into_iter().chain(row.get(run.end)).for_each(|label| meet(*label));
}

/// Calls `meet` with every two pixels beside one another that differ, the first one in the rows given.
fn for_meetings(
    segmentation: &Segmentation,
    rows: Range<usize>,
    mut meet: impl FnMut([usize; 2], [usize; 2]),
) {
    for y in rows {
        let row = segmentation.row(y);
        for (x, pair) in row.windows(2).enumerate() {
            if pair[0] != pair[1] {
                meet([x, y], [x + 1, y]);
            }
        }
        if y + 1 < segmentation.height {
            for (x, (here, below)) in row.iter().zip(segmentation.row(y + 1)).enumerate() {
                if here != below {
                    meet([x, y], [x, y + 1]);
                }
            }
        }
    }
}

/// All walls between two cells (lower index first).
pub(crate) fn walls(
    segmentation: &Segmentation,
    relief: &Plane,
    regions: &[Region],
) -> BTreeMap<(usize, usize), Wall> {
    let bands: Vec<Vec<Vec<Gathered>>> = bands(segmentation.height)
        .into_par_iter()
        .map(|rows| walls_in(segmentation, relief, regions, rows))
        .collect();
    let mut all = Vec::new();
    for cell in 0..regions.len() {
        let mut whole: Vec<Gathered> = Vec::new();
        for part in bands.iter().flat_map(|band| &band[cell]) {
            match whole.iter_mut().find(|wall| wall.other == part.other) {
                Some(wall) => wall.add(part),
                None => whole.push(*part),
            }
        }
        all.extend(
            whole
                .iter()
                .map(|g| ((cell, g.other), Wall { length: g.high - g.low, height: g.height / g.count })),
        );
    }
    all.into_iter().collect()
}

/// A wall while its pixel edges are gathered.
#[derive(Clone, Copy)]
struct Gathered {
    other: usize,
    /// Across the line of the two centres.
    across: DVec2,
    low: f64,
    high: f64,
    height: f64,
    count: f64,
}

impl Gathered {
    fn new(cell: usize, other: usize, regions: &[Region]) -> Self {
        let across = (regions[other].centroid - regions[cell].centroid).perp().normalize_or_zero();
        Self { other, across, low: f64::INFINITY, high: f64::NEG_INFINITY, height: 0.0, count: 0.0 }
    }

    fn add(&mut self, part: &Self) {
        self.low = self.low.min(part.low);
        self.high = self.high.max(part.high);
        self.height += part.height;
        self.count += part.count;
    }
}

/// What a band holds of the walls of each cell with those of higher index.
fn walls_in(
    segmentation: &Segmentation,
    relief: &Plane,
    regions: &[Region],
    rows: Range<usize>,
) -> Vec<Vec<Gathered>> {
    let mut gathered: Vec<Vec<Gathered>> = vec![Vec::new(); regions.len()];
    for_meetings(segmentation, rows, |[x, y], [u, v]| {
        let labels = [segmentation.at(x, y), segmentation.at(u, v)];
        if labels.contains(&Segmentation::NONE) {
            return;
        }
        let [one, other] = labels.map(|label| label as usize);
        let (cell, other) = (one.min(other), one.max(other));
        let walls = &mut gathered[cell];
        let place = walls.iter().position(|wall| wall.other == other).unwrap_or_else(|| {
            walls.push(Gathered::new(cell, other, regions));
            walls.len() - 1
        });
        let wall = &mut walls[place];
        let along = wall.across.dot(DVec2::new((x + u) as f64 + 1.0, (y + v) as f64 + 1.0) / 2.0);
        wall.low = wall.low.min(along);
        wall.high = wall.high.max(along);
        wall.height += f64::from(relief.at(x, y).max(relief.at(u, v)));
        wall.count += 1.0;
    });
    gathered
}
