//! What the photograph shows of each cell: rays from its centre to its wall.

use super::{
    ellipse::{half_width, narrowness, unit},
    grid::Grid,
    kinds::median,
    plane::Plane,
    watershed::Segmentation,
};
use glam::{DMat2, DVec2};
use rayon::prelude::*;

/// Rays per cell.
pub(crate) const RAYS: usize = 36;
/// A ray's wall is looked for this far before and behind the region's edge, in pitches.
const WALL_WINDOW: f64 = 0.1;
/// A wall that is highest this near to the photograph's border, in pixels of the raster, may be higher beyond it.
const LAST_PIXELS: f64 = 1.0;
/// A ray meets a wall if the relief rises by at least this from the cell's inside; a typical wall rises by 1.5 to 2.
const WALL_RISE: f64 = 0.55;

/// Cells this near (in pitches), whose outlines are seen, tell how obliquely a cell is seen.
const AROUND: f64 = 1.3;
const LEAST_CLOSURE: f64 = 0.85;

/// What the rays of one cell say.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    /// Distance from the centre to the region's edge along each ray, in pixels of the raster.
    pub(crate) radii: [f64; RAYS],
    /// Share of rays that end within the photograph, or meet the wall before they leave it.
    pub(crate) visible: f64,
    /// Share of all rays along which the wall is highest at the photograph's border, so that only its inner half can be seen.
    pub(crate) at_border: f64,
    /// Share of the rays that are visible that meet a wall.
    pub(crate) closure: f64,
    /// Mean rise of the levelled relief from the inside to the wall.
    pub(crate) rise: f64,
    /// The same of the wall colour before the light was levelled, where the relief is highest.
    pub(crate) contrast: f64,
    /// Share of the middle that is clearly lower than the wall.
    pub(crate) openness: f64,
    /// Standard deviation of the distances to the rim over their mean, each in units of what a circle's would be
    /// there: about 0.06 for a hexagonal opening, however obliquely it is seen.
    pub(crate) unevenness: f64,
    /// The same of the distances to the region's edge.
    pub(crate) raggedness: f64,
    /// The matrix of the squares of the half axes of the ellipse that has the outline's second moments, in pixels of the raster.
    pub(crate) ellipse: DMat2,
    /// What circles look like here, as such a matrix of determinant 1: the mean shape of the cells around.
    pub(crate) view: DMat2,
    /// Distance to the rim along the rays that have one.
    rims: Vec<(usize, f64)>,
}

impl Evidence {
    /// Measures how regular the outlines are where circles look like `view`.
    fn look(&mut self, view: DMat2) {
        self.view = view;
        let widths: [f64; RAYS] = std::array::from_fn(|ray| half_width(view, direction(ray)));
        self.unevenness = spread(self.rims.iter().map(|(ray, length)| length / widths[*ray]));
        self.raggedness = spread(self.radii.iter().zip(widths).map(|(length, width)| length / width));
    }

    /// How much longer than wide cells around are: 1 if they are seen from above, the secant of the angle if they are seen
    /// obliquely.
    pub(crate) fn narrowness(&self) -> f64 {
        narrowness(self.view)
    }
}

/// The rasters that the rays look at.
pub(crate) struct Rasters<'a> {
    /// Levelled, slightly smoothed.
    pub(crate) relief: &'a Plane,
    /// Wall colour as it is.
    pub(crate) wallness: &'a Plane,
    /// Who owns each pixel.
    pub(crate) segmentation: &'a Segmentation,
}

/// Direction of a ray.
pub(crate) fn direction(ray: usize) -> DVec2 {
    DVec2::from_angle(ray as f64 / RAYS as f64 * std::f64::consts::TAU)
}

/// Evidence of every cell.
pub(crate) fn gather(
    rasters: &Rasters<'_>,
    centres: &[DVec2],
    insides: &[f64],
    pitches: &[f64],
) -> Vec<Evidence> {
    let count = centres.len();
    let alone = |cell| of_cell(rasters, cell, centres[cell], insides[cell], pitches[cell]);
    let mut all: Vec<Evidence> = (0..count).into_par_iter().map(alone).collect();
    let grid = Grid::of(centres, median(pitches.iter().copied()).max(1.0));
    let view = |cell: usize| {
        let near = grid.within(centres[cell], AROUND * pitches[cell]).map(|(other, _)| &all[other]);
        let shapes =
            near.filter(|e| e.visible >= 1.0 && e.closure >= LEAST_CLOSURE).filter_map(|e| unit(e.ellipse));
        unit(shapes.sum::<DMat2>()).unwrap_or(DMat2::IDENTITY)
    };
    let views: Vec<DMat2> = (0..count).into_par_iter().map(view).collect();
    for (evidence, view) in all.iter_mut().zip(views) {
        evidence.look(view);
    }
    all
}

fn of_cell(rasters: &Rasters<'_>, cell: usize, centre: DVec2, inside: f64, pitch: f64) -> Evidence {
    let mut radii = [0.0; RAYS];
    let mut rims = Vec::with_capacity(RAYS);
    let (mut closed, mut rise, mut contrast, mut at_border) = (0.0, 0.0, 0.0, 0.0);
    let window = WALL_WINDOW * pitch;
    let middle_raw = middle(rasters.wallness, centre, pitch);
    for (ray, reached) in radii.iter_mut().enumerate() {
        let step = direction(ray);
        let radius = reach(rasters.segmentation, cell, centre, step, pitch);
        *reached = radius;
        let (height, crest) = highest(rasters.relief, centre, step, [radius - window, radius + window]);
        let height = height - inside;
        if !rasters.segmentation.holds(centre + step * (radius + 1.0)) {
            at_border += f64::from(u8::from(rises_to(rasters.relief, centre, step, radius, pitch)));
            if height < WALL_RISE {
                continue;
            }
        }
        rise += height;
        let crest = centre + step * crest;
        contrast += f64::from(rasters.wallness.sample(crest.x, crest.y)) - middle_raw;
        closed += f64::from(u8::from(height > WALL_RISE));
        rims.push((ray, rim(rasters.relief, centre, step, radius, inside + 0.5 * height)));
    }
    let rays = (rims.len() as f64).max(1.0);
    let (closed, rise, contrast) = (closed / rays, rise / rays, contrast / rays);
    Evidence {
        radii,
        visible: rims.len() as f64 / RAYS as f64,
        at_border: at_border / RAYS as f64,
        closure: closed,
        rise,
        contrast,
        openness: openness(rasters.relief, centre, pitch, inside + 0.5 * rise),
        ellipse: ellipse(&radii),
        rims,
        view: DMat2::IDENTITY,
        unevenness: 0.0,
        raggedness: 0.0,
    }
}

/// The ellipse with the second moments of the outline, as the matrix of its half axes' squares.
fn ellipse(radii: &[f64; RAYS]) -> DMat2 {
    let (mut area, mut moments) = (0.0, DMat2::ZERO);
    for (ray, radius) in radii.iter().enumerate() {
        let step = direction(ray);
        area += radius.powi(2) / 2.0;
        moments += DMat2::from_cols(step * step.x, step * step.y) * (radius.powi(4) / 4.0);
    }
    // An ellipse's second moments over its area are a quarter of its half axes' squares.
    moments * (4.0 / f64::max(area, f64::MIN_POSITIVE))
}

/// Standard deviation over mean.
fn spread(lengths: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = (lengths.clone().count() as f64).max(1.0);
    let mean = lengths.clone().sum::<f64>() / count;
    let variance = lengths.map(|r| (r - mean) * (r - mean)).sum::<f64>() / count;
    variance.sqrt() / mean.max(1e-9)
}

/// Mean over the middle of the cell.
fn middle(plane: &Plane, centre: DVec2, pitch: f64) -> f64 {
    let pixels = super::watershed::disc(centre, 0.28 * pitch, plane.width(), plane.height());
    let (sum, count) = pixels.fold((0.0, 0.0), |(s, n), i| (s + f64::from(plane.data()[i]), n + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Share of the middle below `level`.
fn openness(plane: &Plane, centre: DVec2, pitch: f64, level: f64) -> f64 {
    let pixels = super::watershed::disc(centre, 0.3 * pitch, plane.width(), plane.height());
    let (low, count) = pixels.fold((0.0, 0.0), |(low, n), i| {
        (low + f64::from(u8::from(f64::from(plane.data()[i]) < level)), n + 1.0)
    });
    if count > 0.0 { low / count } else { 0.0 }
}

/// How far the cell reaches along a ray.
fn reach(segmentation: &Segmentation, cell: usize, centre: DVec2, step: DVec2, pitch: f64) -> f64 {
    let mut radius = 0.0;
    while radius < 1.2 * pitch {
        if segmentation.at_point(centre + step * (radius + 0.5)) != Some(cell) {
            break;
        }
        radius += 0.5;
    }
    radius
}

/// The greatest value between two distances along a ray, and its distance.
fn highest(plane: &Plane, centre: DVec2, step: DVec2, [from, to]: [f64; 2]) -> (f64, f64) {
    let mut best = (f64::NEG_INFINITY, from);
    let mut radius = from.max(0.0);
    while radius <= to {
        let place = centre + step * radius;
        let value = f64::from(plane.sample(place.x, place.y));
        if value > best.0 {
            best = (value, radius);
        }
        radius += 0.75;
    }
    best
}

/// Whether the relief is highest, in the outer half of a ray, within the last pixels.
fn rises_to(plane: &Plane, centre: DVec2, step: DVec2, radius: f64, pitch: f64) -> bool {
    let end = radius - LAST_PIXELS;
    highest(plane, centre, step, [end, radius]).0 > highest(plane, centre, step, [0.25 * pitch, end]).0
}

/// Where the relief last rises above `level` on the way out: the rim of the opening.
fn rim(plane: &Plane, centre: DVec2, step: DVec2, radius: f64, level: f64) -> f64 {
    let mut distance = radius;
    while distance > 0.5 {
        let place = centre + step * distance;
        if f64::from(plane.sample(place.x, place.y)) < level {
            break;
        }
        distance -= 0.5;
    }
    distance
}
