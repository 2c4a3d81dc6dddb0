//! The picture and the table of a foam of two layers.

use super::{
    figure::{Anchor, Drawing, Figure, FigureError},
    folder::{OutputError, OutputFolder},
    palette::{Colour, INK, of_sides},
    render::{Camera, Canvas},
};
use crate::{
    foam::{
        complex::{Film, RegionImage},
        free::FreeFoam,
        layers::LayerFigures,
    },
    index::Id,
    surface::Gap,
};
use glam::DVec3;
use serde::Serialize;

/// One row of `cells.csv`.
#[derive(Serialize)]
struct CellRow {
    id: usize,
    layer: &'static str,
    x: f64,
    y: f64,
    z: f64,
    sides: usize,
    end_films: usize,
    volume: f64,
    pressure: f64,
}

/// Writes `cells.csv`: seeds, sides on the wall, films at the end, volume, pressure less the mean.
///
/// # Errors
/// [`OutputError`] if it cannot be written.
pub fn write_cells(
    folder: &mut OutputFolder,
    layers: &FreeFoam,
    figures: &[LayerFigures; 2],
) -> Result<(), OutputError> {
    let lower = layers.division.lower();
    let count = f64::from(crate::index::checked_u32(layers.pressures.len()));
    let mean = layers.pressures.iter().sum::<f64>() / count;
    folder.write("cells.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        for (id, (&volume, &pressure)) in layers.volumes.iter().zip(layers.pressures.iter()).enumerate() {
            let (layer, name, at) =
                if id < lower { (&figures[0], "lower", id) } else { (&figures[1], "upper", id - lower) };
            let [x, y, z] = layers.division.seeds[id].to_array();
            let (sides, end_films) = (layer.sides[at], layer.ends[at]);
            table.serialize(CellRow {
                id,
                layer: name,
                x,
                y,
                z,
                sides,
                end_films,
                volume,
                pressure: pressure - mean,
            })?;
        }
        table.flush()
    })
}

/// The size of the sheet, in its units; a unit is a pixel at scale 1.
const SHEET: [u32; 2] = [1600, 900];
/// Space for the titles and for the legend.
const HEAD: u32 = 90;
const FOOT: u32 = 60;
/// Walls between cells of a layer, in the colour of wax.
const SIDE: Colour = Colour([0xd8, 0xc6, 0x9a]);

/// Both layers as one looks into their cells, the walls left out: the films at a cell's end in the colour of its number of
/// sides.
///
/// # Errors
/// [`FigureError`] if the picture cannot be encoded.
pub fn picture(
    layers: &FreeFoam,
    figures: &[LayerFigures; 2],
    gap: &Gap,
    title: &str,
) -> Result<Figure, FigureError> {
    let [sheet_width, sheet_height] = SHEET.map(f64::from);
    let mut sheet = Drawing::new(sheet_width, sheet_height);
    sheet.text([0.5 * sheet_width, 36.0], 22.0, Anchor::Middle, INK, title);
    for (layer, name) in ["lower layer", "upper layer"].into_iter().enumerate() {
        let left = 0.5 * sheet_width * f64::from(u32::from(layer == 1));
        let (width, height) = (SHEET[0] / 2, SHEET[1] - HEAD - FOOT);
        let canvas = panel(layers, &figures[layer], layer, gap, [width, height]);
        sheet.text([left + 0.25 * sheet_width, 70.0], 18.0, Anchor::Middle, INK, name);
        let size = [f64::from(width), f64::from(height)];
        sheet.picture([left, f64::from(HEAD)], size, &canvas.finish())?;
        legend(&mut sheet, &figures[layer], left);
    }
    Ok(sheet.finish())
}

/// The eye: above a layer of a plane, else where one sees most of the surface.
fn towards_eye(gap: &Gap, layer: usize) -> DVec3 {
    match (gap.middle().name(), layer) {
        ("plane", 0) => DVec3::new(0.15, -0.35, -1.0),
        ("plane", _) => DVec3::new(0.15, -0.35, 1.0),
        ("torus", _) => DVec3::new(0.0, -1.0, 0.9),
        _ => DVec3::new(0.55, -1.0, 0.45),
    }
}

fn panel(layers: &FreeFoam, figures: &LayerFigures, layer: usize, gap: &Gap, size: [u32; 2]) -> Canvas {
    let lower = layers.division.lower();
    let is_here = |side: RegionImage| (side.region.index() < lower) == (layer == 0);
    let mut triangles: Vec<([DVec3; 3], Colour)> = Vec::new();
    for film in &layers.films.complex.films {
        let sides = [film.back, film.front];
        let drawn = sides.into_iter().filter(|&side| is_here(side));
        let is_side = sides.into_iter().all(is_here);
        for (at, side) in drawn.enumerate() {
            // A film between two images of the period stands at both.
            if at == 1 && film.back.shift == film.front.shift {
                continue;
            }
            let cell = side.region.index() - if layer == 0 { 0 } else { lower };
            let colour =
                if is_side { SIDE } else { of_sides(crate::index::checked_u32(figures.sides[cell])) };
            let back = layers.films.complex.period.translation(side.shift);
            triangles.extend(facets(layers, film).map(|corners| (corners.map(|p| p - back), colour)));
        }
    }
    let points = triangles.iter().flat_map(|(corners, _)| *corners);
    let up = if gap.middle().name() == "plane" { DVec3::Y } else { DVec3::Z };
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let camera = Camera::fit(points, towards_eye(gap, layer), up, aspect);
    let mut canvas = Canvas::new(size[0], size[1], camera);
    for (corners, colour) in triangles {
        canvas.flat(corners, colour);
    }
    canvas
}

/// A film's elements as triangles between their nodes.
fn facets<'a>(layers: &'a FreeFoam, film: &'a Film) -> impl Iterator<Item = [DVec3; 3]> + 'a {
    film.elements.iter().flat_map(move |element| {
        let place = move |at: usize| layers.place(element.nodes[at]);
        element.shape.triangles().iter().map(move |corners| corners.map(place))
    })
}

fn legend(sheet: &mut Drawing, figures: &LayerFigures, left: f64) {
    let seen: Vec<(u32, usize)> = (0..)
        .zip(&figures.side_counts)
        .filter(|(_, count)| **count > 0)
        .map(|(n, &count)| (n, count))
        .collect();
    let width = 150.0;
    let entries = f64::from(crate::index::checked_u32(seen.len()));
    let mut x = left + 0.25 * f64::from(SHEET[0]) - 0.5 * entries * width;
    for (sides, count) in seen {
        let y = f64::from(SHEET[1] - 42);
        sheet.rectangle([x, y], [22.0, 22.0], INK);
        sheet.rectangle([x + 1.0, y + 1.0], [20.0, 20.0], of_sides(sides));
        sheet.text([x + 30.0, y + 17.0], 16.0, Anchor::Start, INK, &format!("{sides} sides: {count}"));
        x += width;
    }
}
