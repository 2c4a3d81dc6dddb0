//! The survey: where the cells are and what tells walls from cells, from blobs of one cell's size.
//!
//! Blobs need few pixels, so they are looked for at [`SURVEY_PITCH`] pixels per pitch; only the relief that the watershed
//! floods is made at working scale.

use super::{
    kinds::median,
    lattice::{self, Layers, PitchField, Site, hexagonal_neighbourhoods},
    light::{WallColour, levelled},
    peaks::{self, Peak},
    pitch::Polarity,
    plane::{Plane, pixels},
    raster::{Pyramid, Raster},
    smooth,
    triangulation::Delaunay,
};
use glam::DVec2;
use rayon::prelude::*;

/// Pixels per pitch at which blobs are looked for, as nearly as whole blocks of working pixels allow.
const SURVEY_PITCH: f64 = 15.0;
/// Brightness below which differences are noise, when contrast is taken as a ratio.
const DARKEST: f32 = 0.02;
/// Least contrast of a blob as a share of the regular ones' median.
const LEAST_RATIO: f64 = 0.3;
/// The same and the least strength of a blob that is a cell wherever it lies.
const CLEAR_RATIO: f64 = 0.8;
const CLEAR_STRENGTH: f64 = 1.6;
/// Least strength of a blob, and of one that a lattice may grow from.
const LEAST_STRENGTH: f32 = 0.15;
const SEED_STRENGTH: f64 = 0.4;

/// Light levelled, blobs found, lattice grown; in pixels of the working raster.
pub(crate) struct Survey {
    /// Wall colour as it is.
    pub(crate) wallness: Plane,
    /// The same with the light levelled.
    pub(crate) relief: Plane,
    /// The cells.
    pub(crate) sites: Vec<Site>,
    /// Local pitch.
    pub(crate) field: PitchField,
}

/// Surveys the photograph at `scale` working pixels per pixel, where the pitch is `pitch` working pixels.
pub(crate) fn survey(pyramid: &Pyramid<'_>, polarity: Polarity, scale: f64, pitch: f64) -> Survey {
    let part = pyramid.part();
    let size = |length: usize| pixels(length as f64 * scale).max(1);
    let raster = pyramid.raster(part, size(part.width), size(part.height));
    let block = pixels(pitch / SURVEY_PITCH).max(1);
    let coarse = |length: usize| length.div_ceil(block);
    let grey = pyramid.raster(part, coarse(raster.width()), coarse(raster.height())).grey();
    let blobs = Blobs::new(&grey, polarity.wall_sign(), pitch / block as f64);
    let colour = blobs.learned_colour(&raster, block).unwrap_or(WallColour::brightness(polarity));
    let wallness = raster.plane(|c| colour.of(c));
    let relief = levelled(&wallness, pitch);
    let fill = |y: usize, row: &mut [f32]| row.copy_from_slice(relief.row(y));
    let small = smooth::reduced(relief.width(), relief.height(), block, fill);
    let extent = DVec2::new(relief.width() as f64, relief.height() as f64);
    let (sites, field) = blobs.sites(&small, extent / block as f64, Layers::Inferred);
    let unit = block as f64;
    let mut sites: Vec<Site> = sites.into_iter().map(|s| Site { position: s.position * unit, ..s }).collect();
    // As one reads: what lies together is then looked at together.
    sites.sort_by(|a, b| {
        let row = |site: &Site| (site.position.y / pitch).floor();
        row(a).total_cmp(&row(b)).then(a.position.x.total_cmp(&b.position.x))
    });
    Survey { wallness, relief, sites, field: field.scaled(unit) }
}

/// What finds blobs in a small raster, whichever measure of wall that shows.
struct Blobs {
    /// Contrast of the photograph's brightness as a ratio.
    ratio: Plane,
    /// Brightness, or darkness where walls are dark, with the light levelled.
    relief: Plane,
    pitch: f64,
}

impl Blobs {
    fn new(grey: &Plane, wall_sign: f32, pitch: f64) -> Self {
        Self {
            ratio: peaks::difference(&grey.map(|v| -wall_sign * (v + DARKEST).ln()), pitch),
            relief: levelled(&grey.map(|v| wall_sign * v), pitch),
            pitch,
        }
    }

    /// The places of the lattice in a raster of levelled wall colour, whose extent is that of whole pixels only.
    fn sites(&self, relief: &Plane, extent: DVec2, layers: Layers) -> (Vec<Site>, PitchField) {
        let pitch = self.pitch;
        let response = peaks::band_pass(&relief.map(|v| -v), pitch);
        let maxima = peaks::maxima(&response, LEAST_STRENGTH);
        let found = self.judged(peaks::thinned(maxima, |_| 0.5 * pitch, pitch));
        let points: Vec<DVec2> = found.iter().map(|p| p.position).collect();
        let regular = hexagonal_neighbourhoods(&points, pitch);
        let measured: Vec<(DVec2, f64)> =
            regular.iter().zip(&found).filter_map(|(n, p)| n.map(|n| (p.position, n.distance))).collect();
        let field = PitchField::new(extent, pitch, &measured);
        let is_seed = |p: &Peak| p.strength > SEED_STRENGTH;
        let seeds: Vec<bool> = regular.iter().zip(&found).map(|(n, p)| n.is_some() && is_seed(p)).collect();
        (lattice::grow(&found, &field, &seeds, extent, layers), field)
    }

    /// Drops blobs whose contrast, as a ratio of brightness, is far below that of the regular ones: levelling the light
    /// also levels up the texture of caps and of the ground. Those of at least the contrast of regular ones are clear.
    fn judged(&self, found: Vec<Peak>) -> Vec<Peak> {
        let contrast = |p: &Peak| f64::from(self.ratio.sample(p.position.x, p.position.y));
        let points: Vec<DVec2> = found.iter().map(|p| p.position).collect();
        let regular = hexagonal_neighbourhoods(&points, self.pitch);
        let typical =
            median(found.iter().zip(&regular).filter(|(_, n)| n.is_some()).map(|(p, _)| contrast(p)));
        let is_clear = |p: &Peak| p.strength > CLEAR_STRENGTH && contrast(p) > CLEAR_RATIO * typical;
        let kept = found.into_iter().filter(|p| contrast(p) > LEAST_RATIO * typical);
        kept.map(|p| Peak { clear: is_clear(&p), ..p }).collect()
    }

    /// The wall colour, from the highest points between neighbouring cells against the cells' middles; `raster` has
    /// `block` pixels for each of the small one.
    fn learned_colour(&self, raster: &Raster<'_>, block: usize) -> Option<WallColour> {
        let extent = DVec2::new(self.relief.width() as f64, self.relief.height() as f64);
        let (sites, _) = self.sites(&self.relief, extent, Layers::Seen);
        let seen: Vec<DVec2> = sites.iter().map(|s| s.position).collect();
        let height = |p: &DVec2| self.relief.sample(p.x, p.y);
        let crest = |a: DVec2, b: DVec2| {
            (0..9)
                .map(|k| a.lerp(b, 0.3 + 0.05 * f64::from(k)))
                .max_by(|p, q| height(p).total_cmp(&height(q)))
        };
        let walls: Vec<DVec2> = Delaunay::of(&seen)
            .unsorted_edges()
            .map(|edge| (seen[edge.ends.0], seen[edge.ends.1]))
            .filter(|(a, b)| a.distance(*b) < 1.3 * self.pitch)
            .filter_map(|(a, b)| crest(a, b))
            .collect();
        let enlarged = |points: &[DVec2]| points.iter().map(|p| *p * block as f64).collect::<Vec<DVec2>>();
        WallColour::learned(raster, &enlarged(&walls), &enlarged(&seen))
    }
}
