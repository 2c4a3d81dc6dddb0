//! The base's drawing: plan with dimensions, and how a shell stands in its groove.

use crate::{
    enclosure::Recipe,
    mesh::plate::{Plate, Ring},
    report::{
        figure::{Anchor, Drawing, Figure},
        palette::{Colour, GREY, INK, ORANGE, WAX},
    },
};
use glam::DVec2;

/// The plan's frame: its upper left corner and the longest side of the plate in it.
const PLAN: [f64; 3] = [110.0, 90.0, 620.0];

/// The detail's place, and pixels per mm in it.
const DETAIL: [f64; 2] = [860.0, 560.0];
const DETAIL_SCALE: f64 = 26.0;

/// Plan and detail of a base.
#[must_use]
pub fn base_figure(recipe: &Recipe, plate: &Plate) -> Figure {
    let mut drawing = Drawing::new(1300.0, 800.0);
    drawing.text(
        [PLAN[0], 44.0],
        24.0,
        Anchor::Start,
        INK,
        &format!("{}: base (lengths in mm)", recipe.name),
    );
    plan(&mut drawing, recipe, plate);
    detail(&mut drawing, recipe);
    drawing.finish()
}

fn bounds(ring: &Ring) -> (DVec2, DVec2) {
    ring.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
}

/// The plate from above, with its overall dimensions and the holes' diameters.
fn plan(drawing: &mut Drawing, recipe: &Recipe, plate: &Plate) {
    let (low, high) = bounds(&plate.outline);
    let size = high - low;
    let scale = PLAN[2] / size.max_element();
    let to_sheet = |p: &DVec2| [PLAN[0] + scale * (p.x - low.x), PLAN[1] + scale * (high.y - p.y)];
    let ring = |ring: &Ring| -> Vec<[f64; 2]> { ring.iter().map(to_sheet).collect() };
    let mut solid = vec![ring(&plate.outline)];
    solid.extend(plate.holes.iter().map(ring));
    drawing.area(&solid, WAX, false);
    for pocket in &plate.pockets {
        drawing.area(&pocket.rings.iter().map(ring).collect::<Vec<_>>(), GREY, false);
    }
    let lines = std::iter::once(&plate.outline)
        .chain(plate.pockets.iter().flat_map(|p| &p.rings))
        .chain(&plate.holes);
    for line in lines.map(ring) {
        drawing.line(&[&line[..], &line[..1]].concat(), INK, 1.0);
    }
    let (bottom, right) = (to_sheet(&DVec2::new(0.0, low.y))[1] + 26.0, PLAN[0] + scale * size.x);
    dimension(drawing, [PLAN[0], bottom], [right, bottom], &format!("{:.1}", size.x));
    dimension(
        drawing,
        [PLAN[0] - 26.0, to_sheet(&low)[1]],
        [PLAN[0] - 26.0, PLAN[1]],
        &format!("{:.1}", size.y),
    );
    let base = &recipe.base;
    let mut notes = vec![format!("{} entrances Ø {}, through", base.entrances, base.entrance_diameter)];
    if base.screws > 0 {
        notes.push(format!("{} screw holes Ø {}, through", base.screws, base.screw_diameter));
    }
    if plate.holes.len() > (base.entrances + base.screws) as usize
        && let Some(window) = plate.holes.last()
    {
        let (a, b) = bounds(window);
        notes.push(format!("window Ø {:.1}", (b - a).y));
    }
    notes.push("grooves (grey): inner shell and outer shell".to_owned());
    for (row, note) in [0.0, 1.0, 2.0, 3.0].into_iter().zip(&notes) {
        drawing.text([DETAIL[0] - 30.0, 110.0 + 26.0 * row], 17.0, Anchor::Start, INK, note);
    }
}

/// A foot in its groove, cut across.
fn detail(drawing: &mut Drawing, recipe: &Recipe) {
    let (base, wall) = (&recipe.base, recipe.wall.thickness);
    // Thick walls are drawn smaller, so that the detail keeps its place.
    let scale = DETAIL_SCALE * (2.0 / wall).min(6.0 / base.thickness).min(1.4);
    let to_sheet = |x: f64, y: f64| [DETAIL[0] + 140.0 + scale * x, DETAIL[1] - scale * y];
    let polygon = |points: &[(f64, f64)]| points.iter().map(|&(x, y)| to_sheet(x, y)).collect::<Vec<_>>();
    let (half, groove) = (0.5 * wall, 0.5 * wall + base.clearance);
    let (side, floor, below) = (3.2 * wall, -base.groove, -base.thickness);
    let plate = polygon(&[
        (-side, 0.0),
        (-groove, 0.0),
        (-groove, floor),
        (groove, floor),
        (groove, 0.0),
        (side, 0.0),
        (side, below),
        (-side, below),
    ]);
    let foot = polygon(&[(-half, 5.0 * wall), (-half, floor), (half, floor), (half, 5.0 * wall)]);
    for (shape, colour) in [(&plate, WAX), (&foot, ORANGE)] {
        drawing.area(std::slice::from_ref(shape), colour, false);
        drawing.line(&[&shape[..], &shape[..1]].concat(), INK, 1.2);
    }
    let title = to_sheet(0.0, 5.0 * wall + 30.0 / scale);
    drawing.text(title, 17.0, Anchor::Middle, INK, "a shell's foot in its groove, cut across");
    let top = 5.0 * wall - 0.7 * wall;
    dimension(drawing, to_sheet(-half, top), to_sheet(half, top), &format!("wall {wall}"));
    let left = -side - 18.0 / scale;
    dimension(drawing, to_sheet(left, floor), to_sheet(left, 0.0), &format!("groove {}", base.groove));
    let right = side + 18.0 / scale;
    dimension(drawing, to_sheet(right, below), to_sheet(right, 0.0), &format!("plate {}", base.thickness));
    let note = to_sheet(0.0, below - 34.0 / scale);
    let text =
        format!("clearance {} on each side; the plate's upper face is the mirror plane", base.clearance);
    drawing.text(note, 15.0, Anchor::Middle, INK, &text);
}

/// A dimension line with its number: above a level line, to the left of an upright one.
fn dimension(drawing: &mut Drawing, from: [f64; 2], to: [f64; 2], label: &str) {
    const LINE: Colour = Colour([0x55, 0x55, 0x55]);
    let level = (from[1] - to[1]).abs() < 1.0;
    drawing.line(&[from, to], LINE, 1.0);
    for [x, y] in [from, to] {
        let tick = if level { [[x, y - 5.0], [x, y + 5.0]] } else { [[x - 5.0, y], [x + 5.0, y]] };
        drawing.line(&tick, LINE, 1.0);
    }
    let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
    if level {
        drawing.text([middle[0], from[1].max(to[1]) + 20.0], 16.0, Anchor::Middle, INK, label);
    } else if from[0] < DETAIL[0] + 140.0 {
        drawing.text([middle[0] - 8.0, middle[1] + 5.0], 16.0, Anchor::End, INK, label);
    } else {
        drawing.text([middle[0] + 8.0, middle[1] + 5.0], 16.0, Anchor::Start, INK, label);
    }
}
