//! What the finished meshes measure.

use super::{Enclosure, PrintPart};
use crate::mesh::{Bvh, TriMesh, euler_number, measure, self_intersections};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

/// Least, mean and largest of a quantity, in mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// The mean over the samples.
    pub mean: f64,
    /// The largest.
    pub max: f64,
}

/// The gap at one place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GapSample {
    /// The place on the outer shell's front, in mm, in the frame of the shells.
    pub position: DVec3,
    /// The distance to the inner shell's front, in mm.
    pub gap: f64,
}

/// What was measured on one part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartInspection {
    /// The part's name.
    pub name: &'static str,
    /// The number of triangles.
    pub triangles: usize,
    /// Every edge joins two triangles, every vertex one fan: proved when the mesh was made.
    pub closed: bool,
    /// Neighbouring triangles agree on the outside, and the volume is positive.
    pub oriented: bool,
    /// The number of connected pieces.
    pub components: usize,
    /// The number of handles.
    pub genus: i64,
    /// The number of handles that it must have.
    pub expected_genus: i64,
    /// Pairs of triangles that cross.
    pub self_intersections: usize,
    /// Volume in cm³.
    pub volume_cm3: f64,
    /// Area in cm².
    pub area_cm2: f64,
    /// Mass in g if printed solid.
    pub mass_g: f64,
    /// Extent along x, y and z in mm.
    pub size_mm: [f64; 3],
    /// Whether it fits the printer's bed, turned by 90° if need be.
    pub fits_bed: bool,
    /// Area that overhangs by more than 45° as printed, in cm².
    pub overhang_45_cm2: f64,
    /// The thinnest feature in mm: of a shell its wall, of the base the floor under a groove.
    pub thinnest_mm: f64,
}

/// What was measured on an enclosure: the content of `check.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// The form of this page.
    pub schema: &'static str,
    /// The recipe's name.
    pub name: String,
    /// Whether everything that was promised holds; warnings do not count against it.
    pub sound: bool,
    /// The gap between the fronts, measured on the meshes.
    pub gap_mm: Spread,
    /// The inner shell's wall, measured on its mesh.
    pub inner_wall_mm: Spread,
    /// The outer shell's wall, measured on its mesh.
    pub outer_wall_mm: Spread,
    /// The parts.
    pub parts: Vec<PartInspection>,
    /// What the designer should know before printing.
    pub warnings: Vec<String>,
}

/// Places at which the gap is sampled.
const GAP_SAMPLES: usize = 10_000;

/// Places at which a wall is sampled.
const WALL_SAMPLES: usize = 5_000;

/// Below this a wall is hard to print: two lines of a common nozzle.
const THIN_WALL_MM: f64 = 0.8;

/// Gaps that hold two worker cells and a bee.
const GAP_FOR_TWO_CELLS_MM: [f64; 2] = [27.0, 38.0];

/// A share of overhanging area above which supports are worth a word.
const OVERHANG_SHARE: f64 = 0.03;

impl Inspection {
    /// Measures an enclosure; also gives the gap's samples.
    #[must_use]
    pub fn new(enclosure: &Enclosure) -> (Self, Vec<GapSample>) {
        let [inner, outer] = &enclosure.fronts;
        let samples = gap_samples(outer, inner);
        let gap_mm = spread(samples.iter().map(|s| s.gap));
        let walls = [0, 1].map(|i| wall_spread(&enclosure.fronts[i], &enclosure.backs[i]));
        let thinnest = |part: &PrintPart| match part.name {
            "inner-shell" => walls[0].min,
            "outer-shell" => walls[1].min,
            _ => enclosure.design.recipe.base.thickness - enclosure.design.recipe.base.groove,
        };
        let parts: Vec<PartInspection> =
            enclosure.parts.iter().map(|part| inspect_part(part, enclosure, thinnest(part))).collect();
        let sound = parts.iter().all(|part| {
            part.oriented
                && part.components == 1
                && part.genus == part.expected_genus
                && part.self_intersections == 0
        });
        let inspection = Self {
            schema: "combwright.check/1",
            name: enclosure.design.recipe.name.clone(),
            sound,
            gap_mm,
            inner_wall_mm: walls[0],
            outer_wall_mm: walls[1],
            warnings: warnings(enclosure, &parts, gap_mm, walls),
            parts,
        };
        (inspection, samples)
    }
}

/// Vertices of `mesh` that are used, thinned to about `count`.
fn thinned(mesh: &TriMesh, count: usize) -> Vec<DVec3> {
    let step = mesh.positions.len().div_ceil(count).max(1);
    mesh.positions.iter().copied().step_by(step).collect()
}

fn gap_samples(from: &TriMesh, to: &TriMesh) -> Vec<GapSample> {
    let tree = Bvh::new(to);
    let distance = |p: DVec3| tree.closest(p).map_or(f64::NAN, |closest| closest.distance);
    thinned(from, GAP_SAMPLES)
        .into_par_iter()
        .map(|position| GapSample { position, gap: distance(position) })
        .collect()
}

fn wall_spread(front: &TriMesh, back: &TriMesh) -> Spread {
    let tree = Bvh::new(back);
    let places = thinned(front, WALL_SAMPLES);
    let distances: Vec<f64> =
        places.into_par_iter().map(|p| tree.closest(p).map_or(f64::NAN, |c| c.distance)).collect();
    spread(distances.into_iter())
}

#[expect(clippy::cast_precision_loss, reason = "a few thousand samples")]
fn spread(values: impl Iterator<Item = f64> + Clone) -> Spread {
    let count = values.clone().count() as f64;
    Spread {
        min: values.clone().fold(f64::INFINITY, f64::min),
        mean: values.clone().sum::<f64>() / count,
        max: values.fold(f64::NEG_INFINITY, f64::max),
    }
}

fn inspect_part(part: &PrintPart, enclosure: &Enclosure, thinnest_mm: f64) -> PartInspection {
    let mesh = part.solid.mesh();
    let (low, high) = mesh.bounds();
    let size = high - low;
    let volume_cm3 = measure::volume(mesh) / 1e3;
    let components = measure::components(mesh).len();
    let print = &enclosure.design.recipe.print;
    PartInspection {
        name: part.name,
        triangles: mesh.triangles.len(),
        closed: true,
        oriented: volume_cm3 > 0.0,
        components,
        // χ = 2(pieces) − 2(handles).
        genus: i64::try_from(components).unwrap_or(i64::MAX) - euler_number(mesh) / 2,
        expected_genus: part.expected_genus,
        self_intersections: self_intersections(mesh).len(),
        volume_cm3,
        area_cm2: measure::area(mesh) / 1e2,
        mass_g: volume_cm3 * print.density,
        size_mm: size.to_array(),
        fits_bed: fits(size, print.bed),
        overhang_45_cm2: measure::overhang_area(mesh, 45.0) / 1e2,
        thinnest_mm,
    }
}

/// Whether a part fits, turned about the vertical by 90° if need be. Rounding in the last digits does not count.
fn fits(size: DVec3, bed: [f64; 3]) -> bool {
    let within = |a: f64, b: f64| a <= b + 1e-6;
    within(size.z, bed[2])
        && ((within(size.x, bed[0]) && within(size.y, bed[1]))
            || (within(size.x, bed[1]) && within(size.y, bed[0])))
}

/// The largest period with which all parts would fit.
fn fitting_period(enclosure: &Enclosure) -> f64 {
    let design = &enclosure.design;
    let base = &design.recipe.base;
    let (margin, legs) = if base.include { (2.0 * base.margin, base.groove) } else { (0.0, 0.0) };
    let cells = design.region.size();
    let bed = design.recipe.print.bed;
    let longest = |bx: f64, by: f64| {
        ((bx - margin) / cells.x).min((by - margin) / cells.y).min((bed[2] - legs) / cells.z).max(0.0)
    };
    longest(bed[0], bed[1]).max(longest(bed[1], bed[0]))
}

fn warnings(enclosure: &Enclosure, parts: &[PartInspection], gap: Spread, walls: [Spread; 2]) -> Vec<String> {
    let mut said = Vec::new();
    for part in parts {
        if part.self_intersections > 0 {
            said.push(format!(
                "{}: {} pairs of triangles cross; use more samples or a smaller gap",
                part.name, part.self_intersections
            ));
        }
        if part.overhang_45_cm2 > OVERHANG_SHARE * part.area_cm2 {
            said.push(format!(
                "{}: {:.0} % of its surface overhangs by more than 45°; print it with supports",
                part.name,
                100.0 * part.overhang_45_cm2 / part.area_cm2
            ));
        }
    }
    let outside: Vec<&str> = parts.iter().filter(|part| !part.fits_bed).map(|part| part.name).collect();
    if !outside.is_empty() {
        let [x, y, z] = enclosure.design.recipe.print.bed;
        said.push(format!(
            "{} will not fit a bed of {x} × {y} × {z} mm; the largest period that fits is {:.1} mm, or print octants (part = \"octant\")",
            outside.join(", "),
            (fitting_period(enclosure) * 10.0).floor() / 10.0
        ));
    }
    let thin = walls[0].min.min(walls[1].min);
    if thin < THIN_WALL_MM {
        said.push(format!("the walls are {thin:.2} mm thin; below {THIN_WALL_MM} mm they are hard to print"));
    }
    let [least, most] = GAP_FOR_TWO_CELLS_MM;
    if gap.min < least || gap.max > most {
        said.push(format!(
            "the gap is {:.1} to {:.1} mm; two worker cells and a bee fit in {least} to {most} mm",
            gap.min, gap.max
        ));
    }
    said
}
