//! The pitch of the comb, found from the photograph: the scale at which most of it looks like a hexagonal lattice.
//!
//! For each of a series of scales the photograph is brought to [`LEVEL_PITCH`] pixels per supposed pitch, band-passed, and
//! its extrema are compared with a hexagonal neighbourhood. The score of a scale is the share of the photograph that such
//! neighbourhoods cover. Dark cells show as minima and bright cells as maxima; the walls' corners are extrema of the other
//! sign, but form a honeycomb lattice (three neighbours), which does not score.

use super::{
    lattice::hexagonal_neighbourhoods,
    peaks::{self, Peak},
    photo::Part,
    plane::{Plane, pixels},
    raster::Pyramid,
};
use glam::DVec2;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Pixels per pitch at which a scale is tried. Below 8 the walls are lost, above 12 it only costs time.
const LEVEL_PITCH: f64 = 8.0;
/// Ratio of one scale to the next: the band-pass accepts a lattice within 25 % of its own.
const LEVEL_RATIO: f64 = 1.26;
/// Smallest and largest pitch that are tried, in pixels of the photograph.
const PITCHES: (f64, f64) = (7.0, 700.0);
/// Pixels looked at per scale; a larger photograph is sampled by tiles.
const LEVEL_AREA: f64 = 4.0e5;
/// Edge of a tile in pixels of the level.
const TILE: f64 = 200.0;

/// Bright spots in the middle of dark cells make, with the walls' corners, a finer lattice of √3 times less pitch. So a lattice
/// coarser by about this factor is preferred if it covers this share of what the finer one does. A comb read at its right
/// pitch shows nothing regular at such scales; at much coarser ones whole pieces of comb may stand in a hexagon.
const COARSER: RangeInclusive<f64> = 1.5..=2.2;
const SUPERLATTICE: f64 = 0.5;
/// A scale at which fewer cells than this sit in a hexagon of neighbours is only taken if no scale has more: any seven dark
/// things may happen to stand like that, and at a coarse scale they cover much of the photograph.
const FEW: usize = 3;

/// Whether cells are darker or brighter than their walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Polarity {
    /// Dark cells between bright walls.
    DarkCells,
    /// Bright cells between dark walls.
    BrightCells,
}

impl Polarity {
    /// +1 where bright means wall, −1 where dark means wall.
    #[must_use]
    pub(crate) const fn wall_sign(self) -> f32 {
        match self {
            Self::DarkCells => 1.0,
            Self::BrightCells => -1.0,
        }
    }
}

/// What the search over scales found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PitchEstimate {
    /// Median distance between neighbouring cells, in pixels of the photograph.
    pub(crate) pitch: f64,
    /// Whether cells are dark or bright.
    pub(crate) polarity: Polarity,
    /// Share of the photograph that looks like comb at this scale, 0..=1.
    pub(crate) coverage: f64,
    /// Whether more than a few cells look so.
    several: bool,
}

/// Finds the pitch at which the photograph looks most like comb; `None` where nothing can be tried.
#[must_use]
pub(crate) fn find(pyramid: &Pyramid<'_>, hint: Option<f64>) -> Option<PitchEstimate> {
    let levels = levels(pyramid.part(), hint);
    let tried: Vec<PitchEstimate> =
        levels.into_par_iter().flat_map_iter(|pitch| at_level(pyramid, pitch)).collect();
    let greatest = |among: &mut dyn Iterator<Item = &PitchEstimate>| {
        among.copied().max_by(|a, b| a.several.cmp(&b.several).then(a.coverage.total_cmp(&b.coverage)))
    };
    let best = greatest(&mut tried.iter())?;
    let coarser = greatest(&mut tried.iter().filter(|t| COARSER.contains(&(t.pitch / best.pitch))));
    let preferred =
        |c: &PitchEstimate| c.several >= best.several && c.coverage > SUPERLATTICE * best.coverage;
    Some(coarser.filter(preferred).unwrap_or(best))
}

fn levels(part: Part, hint: Option<f64>) -> Vec<f64> {
    let largest = part.width.min(part.height) as f64 / 2.5;
    let (from, to) = hint.map_or(PITCHES, |h| (h * 0.9, h * 1.12));
    let mut pitches = Vec::new();
    let mut pitch = from;
    while pitch <= to.min(largest) {
        pitches.push(pitch);
        pitch *= if hint.is_some() { 1.1 } else { LEVEL_RATIO };
    }
    pitches
}

fn at_level(pyramid: &Pyramid<'_>, pitch: f64) -> [PitchEstimate; 2] {
    let scale = LEVEL_PITCH / pitch;
    let mut found = [Vec::new(), Vec::new()];
    let mut area = 0.0;
    for tile in tiles(pyramid.part(), scale) {
        let size = |length: usize| pixels(length as f64 * scale).max(4);
        let grey = pyramid.rough(tile, size(tile.width), size(tile.height)).grey();
        area += (grey.width() * grey.height()) as f64;
        let bright = peaks::band_pass(&grey, LEVEL_PITCH);
        found[0].extend(neighbour_distances(&bright.map(|v| -v)));
        found[1].extend(neighbour_distances(&bright));
    }
    let estimate = |polarity, mut distances: Vec<f64>| {
        distances.sort_by(f64::total_cmp);
        let covered: f64 = distances.iter().map(|d| d * d * 0.75_f64.sqrt()).sum();
        let median = distances.get(distances.len() / 2).copied().unwrap_or(LEVEL_PITCH);
        let several = distances.len() >= FEW;
        PitchEstimate { pitch: median / scale, polarity, coverage: covered / area.max(1.0), several }
    };
    let [dark, bright] = found;
    [estimate(Polarity::DarkCells, dark), estimate(Polarity::BrightCells, bright)]
}

/// Mean neighbour distance of every maximum that sits in a hexagonal neighbourhood.
fn neighbour_distances(response: &Plane) -> Vec<f64> {
    let found: Vec<Peak> = peaks::maxima(response, 0.4);
    let points: Vec<DVec2> = found.iter().map(|p| p.position).collect();
    hexagonal_neighbourhoods(&points, LEVEL_PITCH).iter().flatten().map(|n| n.distance).collect()
}

/// Tiles spread evenly over `part`, together no more than [`LEVEL_AREA`] at this scale.
fn tiles(part: Part, scale: f64) -> Vec<Part> {
    let area = (part.width * part.height) as f64 * scale * scale;
    if area <= LEVEL_AREA {
        return vec![part];
    }
    let edge = pixels(TILE / scale);
    let per_axis = (LEVEL_AREA / (TILE * TILE)).sqrt();
    let count = |length: usize| pixels(per_axis).min(length / edge).max(1);
    let (columns, rows) = (count(part.width), count(part.height));
    let start =
        |k: usize, count: usize, length: usize| (length.saturating_sub(edge)) * (2 * k + 1) / (2 * count);
    (0..rows)
        .flat_map(|r| (0..columns).map(move |c| (c, r)))
        .map(|(c, r)| Part {
            left: part.left + start(c, columns, part.width),
            top: part.top + start(r, rows, part.height),
            width: edge.min(part.width),
            height: edge.min(part.height),
        })
        .collect()
}
