//! Cuts through both shells, with the local gap in colour and a scale bar.

use super::enclosure::CUT;
use crate::{
    enclosure::{Enclosure, Inspection},
    mesh::{Bvh, CutPlane, SectionLine, section},
    report::{
        figure::{Anchor, Drawing, Figure},
        palette::{INK, viridis},
    },
};
use glam::{DVec2, DVec3};

/// The size of the drawing, and the widths of its frames: one above the other.
const SHEET: [f64; 2] = [1300.0, 1160.0];
const FRAME_WIDTH: f64 = 1060.0;
const FRAME_HEIGHT: f64 = 430.0;
const LEFT: f64 = 60.0;

/// Planes lie this much beside the mirror planes, in mm, so that they pass through no row of vertices.
const BESIDE_MM: f64 = 0.013;

/// The colour bar spans at least this, in mm, so that a uniform gap has one colour.
const LEAST_SPAN_MM: f64 = 1.0;

/// Vertical cuts through the enclosure, along x through its middle and from corner to corner: plastic grey, the gap coloured
/// by its local width.
#[must_use]
pub fn section_figure(enclosure: &Enclosure, inspection: &Inspection) -> Figure {
    let mut drawing = Drawing::new(SHEET[0], SHEET[1]);
    let title =
        format!("{}: gap {:.2} to {:.2} mm", inspection.name, inspection.gap_mm.min, inspection.gap_mm.max);
    drawing.text([LEFT, 50.0], 24.0, Anchor::Start, INK, &title);
    let range = colour_range(inspection);
    let cuts = cuts(enclosure);
    let widest = cuts.iter().map(|cut| cut.width).fold(0.0, f64::max);
    let height = total_height(enclosure);
    let scale = (FRAME_WIDTH / widest).min(FRAME_HEIGHT / height);
    for (cut, row) in cuts.iter().zip([0.0, 1.0]) {
        let floor = 90.0 + (row + 1.0) * (FRAME_HEIGHT + 55.0) - 45.0;
        let middle = LEFT + 0.5 * FRAME_WIDTH;
        let to_sheet = move |p: DVec2| [middle + scale * p.x, floor - scale * p.y];
        draw_gap(&mut drawing, enclosure, &cut.plane, to_sheet, range);
        draw_parts(&mut drawing, enclosure, &cut.plane, to_sheet);
        drawing.text([middle, floor + 26.0], 18.0, Anchor::Middle, INK, cut.name);
    }
    scale_bar(&mut drawing, scale, widest);
    drawing.colour_bar([1180.0, 160.0], 480.0, range, "gap, mm", viridis);
    drawing.finish()
}

/// One cut: its coordinates have their origin in the middle of the base's lower face.
struct Cut {
    name: &'static str,
    plane: CutPlane,
    width: f64,
}

/// The cut along x, and where the enclosure is square the one from corner to corner, on which the feet stand.
fn cuts(enclosure: &Enclosure) -> Vec<Cut> {
    let size = enclosure.design.region.size() * enclosure.design.period.0;
    let base = &enclosure.design.recipe.base;
    let margin = if base.include { base.margin } else { 0.0 };
    let cut = |name, right: DVec3, width| {
        let aside = BESIDE_MM * right.cross(DVec3::Z);
        let origin = DVec3::new(0.5 * size.x, 0.5 * size.y, 0.0) + aside;
        Cut { name, plane: CutPlane { origin, right, up: DVec3::Z }, width }
    };
    let mut cuts = vec![cut("cut along x, through the middle", DVec3::X, size.x + 2.0 * margin)];
    if (size.x - size.y).abs() < 1e-9 * size.x {
        let diagonal = DVec3::new(1.0, 1.0, 0.0).normalize();
        let width = std::f64::consts::SQRT_2 * (size.x + 2.0 * margin);
        cuts.push(cut("cut from corner to corner, through the feet", diagonal, width));
    }
    cuts
}

/// From the base's lower face to the top, in mm.
fn total_height(enclosure: &Enclosure) -> f64 {
    enclosure
        .parts
        .iter()
        .map(|part| part.solid.mesh().bounds().1.z + enclosure.assembled(part).z)
        .fold(0.0, f64::max)
}

/// The cut plastic of all parts, put together.
fn draw_parts(
    drawing: &mut Drawing,
    enclosure: &Enclosure,
    plane: &CutPlane,
    to_sheet: impl Fn(DVec2) -> [f64; 2],
) {
    for part in &enclosure.parts {
        let lift = DVec2::new(0.0, enclosure.assembled(part).z);
        let rings: Vec<Vec<[f64; 2]>> = section(part.solid.mesh(), plane)
            .iter()
            .map(|line| line.points.iter().map(|&p| to_sheet(p + lift)).collect())
            .collect();
        drawing.area(&rings, CUT, false);
        for ring in &rings {
            drawing.line(&[&ring[..], &ring[..1]].concat(), INK, 0.8);
        }
    }
}

/// The ends of the colour bar.
fn colour_range(inspection: &Inspection) -> [f64; 2] {
    let (low, high) = (inspection.gap_mm.min, inspection.gap_mm.max);
    let missing = (LEAST_SPAN_MM - (high - low)).max(0.0);
    [low - 0.5 * missing, high + 0.5 * missing]
}

/// Fills the gap with strips from each point of one front to the nearest point of the other, both ways, so that nothing is
/// left white where one of them bends.
fn draw_gap(
    drawing: &mut Drawing,
    enclosure: &Enclosure,
    plane: &CutPlane,
    to_sheet: impl Fn(DVec2) -> [f64; 2],
    range: [f64; 2],
) {
    let lift = DVec2::new(0.0, enclosure.parts.first().map_or(0.0, |part| enclosure.assembled(part).z));
    let fronts = enclosure.fronts.each_ref().map(|mesh| section(mesh, plane));
    let trees = enclosure.fronts.each_ref().map(Bvh::new);
    for (from, to) in [(1, 0), (0, 1)] {
        // The width is the nearest distance in space, which need not lie in the plane.
        let width = |p: DVec2| {
            trees[to]
                .closest(plane.origin + p.x * plane.right + p.y * plane.up)
                .map_or(f64::NAN, |c| c.distance)
        };
        for line in &fronts[from] {
            let feet: Vec<DVec2> = line.points.iter().map(|&p| nearest(&fronts[to], p)).collect();
            for (points, feet) in line.points.windows(2).zip(feet.windows(2)) {
                let quad = [points[0], points[1], feet[1], feet[0]].map(|p| to_sheet(p + lift)).to_vec();
                let colour =
                    viridis((width(points[0].midpoint(points[1])) - range[0]) / (range[1] - range[0]));
                drawing.area(&[quad], colour, true);
            }
        }
    }
}

/// The nearest point of some lines.
fn nearest(lines: &[SectionLine], p: DVec2) -> DVec2 {
    lines
        .iter()
        .flat_map(|line| line.points.windows(2))
        .map(|ends| {
            let (a, along) = (ends[0], ends[1] - ends[0]);
            let t = (p - a).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
            a + t.clamp(0.0, 1.0) * along
        })
        .min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)))
        .unwrap_or(p)
}

/// A bar of a round length, about a quarter of the width.
fn scale_bar(drawing: &mut Drawing, unit: f64, width_mm: f64) {
    let target = 0.25 * width_mm;
    let decade = 10_f64.powf(target.log10().floor());
    let length = [5.0, 2.0, 1.0].into_iter().map(|m| m * decade).find(|&l| l <= target).unwrap_or(decade);
    let (x, y) = (LEFT, SHEET[1] - 50.0);
    drawing.line(&[[x, y], [x + unit * length, y]], INK, 4.0);
    drawing.text([x + 0.5 * unit * length, y + 26.0], 18.0, Anchor::Middle, INK, &format!("{length} mm"));
}
