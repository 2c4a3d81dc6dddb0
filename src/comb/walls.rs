//! What the segmentation says of each cell and of each wall between two cells.

use super::{plane::Plane, watershed::Segmentation};
use glam::DVec2;
use std::collections::BTreeMap;

/// A cell's part of the raster.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Region {
    /// Pixels.
    pub(crate) area: f64,
    /// Centre of mass.
    pub(crate) centroid: DVec2,
    /// Mean relief of the inner part.
    pub(crate) inside: f64,
    /// Pixel edges that lie on the border of the raster.
    pub(crate) on_border: usize,
    /// Pixel edges towards pixels of no cell.
    pub(crate) on_nothing: usize,
    /// All pixel edges of the outline.
    pub(crate) outline: usize,
}

/// A wall between two cells, as the segmentation has it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    /// Extent across the line of the two centres, in pixels.
    pub(crate) length: f64,
    /// Mean relief along it.
    pub(crate) height: f64,
}

/// Area, centre and border contact of all cells.
pub(crate) fn regions(
    segmentation: &Segmentation,
    relief: &Plane,
    markers: &[DVec2],
    pitches: &[f64],
) -> Vec<Region> {
    let mut regions = vec![Region::default(); markers.len()];
    let mut inner = vec![(0.0, 0.0); markers.len()];
    let (width, height) = (segmentation.width, segmentation.height);
    for y in 0..height {
        for x in 0..width {
            let label = segmentation.at(x, y);
            if label == Segmentation::NONE {
                continue;
            }
            let index = label as usize;
            let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let region = &mut regions[index];
            region.area += 1.0;
            region.centroid += place;
            if place.distance(markers[index]) < 0.28 * pitches[index] {
                inner[index].0 += f64::from(relief.at(x, y));
                inner[index].1 += 1.0;
            }
            let border = usize::from(x == 0)
                + usize::from(y == 0)
                + usize::from(x + 1 == width)
                + usize::from(y + 1 == height);
            region.on_border += border;
            region.outline += border;
            let mut towards = |other: u32| {
                if other != label {
                    region.outline += 1;
                    region.on_nothing += usize::from(other == Segmentation::NONE);
                }
            };
            if x > 0 {
                towards(segmentation.at(x - 1, y));
            }
            if y > 0 {
                towards(segmentation.at(x, y - 1));
            }
            if x + 1 < width {
                towards(segmentation.at(x + 1, y));
            }
            if y + 1 < height {
                towards(segmentation.at(x, y + 1));
            }
        }
    }
    for (index, region) in regions.iter_mut().enumerate() {
        region.centroid = if region.area > 0.0 { region.centroid / region.area } else { markers[index] };
        region.inside = inner[index].0 / f64::max(inner[index].1, 1.0);
    }
    regions
}

/// All walls between two cells (lower index first).
pub(crate) fn walls(
    segmentation: &Segmentation,
    relief: &Plane,
    regions: &[Region],
) -> BTreeMap<(usize, usize), Wall> {
    struct Sums {
        low: f64,
        high: f64,
        height: f64,
        count: usize,
    }
    let mut sums: BTreeMap<(usize, usize), Sums> = BTreeMap::new();
    let (width, height) = (segmentation.width, segmentation.height);
    for y in 0..height {
        for x in 0..width {
            let label = segmentation.at(x, y);
            for (u, v) in [(x + 1, y), (x, y + 1)] {
                if u >= width || v >= height {
                    continue;
                }
                let other = segmentation.at(u, v);
                if label == other || label == Segmentation::NONE || other == Segmentation::NONE {
                    continue;
                }
                let (a, b) = (label.min(other) as usize, label.max(other) as usize);
                let place = DVec2::new((x + u) as f64 + 1.0, (y + v) as f64 + 1.0) / 2.0;
                let across = (regions[b].centroid - regions[a].centroid).perp().normalize_or_zero();
                let along = across.dot(place);
                let entry =
                    sums.entry((a, b)).or_insert(Sums { low: along, high: along, height: 0.0, count: 0 });
                entry.low = entry.low.min(along);
                entry.high = entry.high.max(along);
                entry.height += f64::from(relief.at(x, y).max(relief.at(u, v)));
                entry.count += 1;
            }
        }
    }
    sums.into_iter()
        .map(|(pair, s)| (pair, Wall { length: s.high - s.low, height: s.height / s.count as f64 }))
        .collect()
}
