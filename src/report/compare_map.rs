//! A map of hexatic order: each complete cell as a disc, coloured by |ψ6|, with the direction of its neighbours.

use super::{
    figure::{Anchor, Drawing, Figure},
    palette::{Colour, GREY, INK, viridis},
};
use crate::{
    compare::Sample,
    tessellation::{CellStatus, hexatic},
};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Width of the map in its units.
const WIDTH: f64 = 900.0;
/// Space for the title above, the colour bar to the right, and a margin.
const HEAD: f64 = 44.0;
const BAR: f64 = 110.0;
const MARGIN: f64 = 14.0;

/// The map of a flat pattern; `None` for one on a curved surface, where directions cannot be compared.
#[must_use]
pub fn hexatic_map(sample: &Sample) -> Option<Figure> {
    let pattern = &sample.pattern;
    if pattern.cells.iter().any(|cell| cell.normal.cross(DVec3::Z).length() > 1e-9) {
        return None;
    }
    let places = || pattern.cells.iter().map(|cell| cell.position.truncate());
    let low = places().reduce(DVec2::min)?;
    let size = places().reduce(DVec2::max)? - low;
    let scale = (WIDTH - BAR - 2.0 * MARGIN) / size.max_element().max(1e-12);
    let height = (size.y * scale + HEAD + 2.0 * MARGIN).max(320.0);
    let mut drawing = Drawing::new(WIDTH, height);
    let title = format!("Hexatic order of {}", sample.name);
    drawing.text([MARGIN, 30.0], 20.0, Anchor::Start, INK, &title);
    // Photographs have y downward, as drawings do; everything else upward.
    let down = pattern.unit == "px";
    let at = |p: DVec2| {
        let from_low = (p - low) * scale;
        let y = if down { from_low.y } else { size.y * scale - from_low.y };
        DVec2::new(MARGIN + from_low.x, HEAD + MARGIN + y)
    };
    for (id, cell) in pattern.cells.enumerated() {
        let centre = at(cell.position.truncate());
        let radius = (cell.area.max(0.0) / 3.6).sqrt() * scale;
        let order = hexatic(pattern, id).filter(|_| cell.status == CellStatus::Complete);
        let fill = order.map_or(GREY.mix(Colour([255; 3]), 0.7), |psi| viridis(psi.length()));
        drawing.area(&[disc(centre, radius)], fill, false);
        if let Some(psi) = order {
            let angle = psi.to_angle() / 6.0;
            let step = DVec2::from_angle(if down { angle } else { -angle }) * 0.7 * radius;
            let ink = if psi.length() > 0.6 { INK } else { Colour([255; 3]) };
            drawing.line(&[(centre - step).to_array(), (centre + step).to_array()], ink, 1.2);
        }
    }
    drawing.colour_bar([WIDTH - BAR + 24.0, HEAD + 40.0], 200.0, [0.0, 1.0], "|ψ6|", viridis);
    Some(drawing.finish())
}

fn disc(centre: DVec2, radius: f64) -> Vec<[f64; 2]> {
    let corner = |i: u32| centre + radius * DVec2::from_angle(TAU * f64::from(i) / 24.0);
    (0..24).map(|i| corner(i).to_array()).collect()
}
