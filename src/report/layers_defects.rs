//! The defects of both layers on the middle surface, and what chance would make of them.

use super::{
    figure::{Anchor, Drawing, FONT, Figure, FigureError},
    legend::series_legend,
    palette::{BLUE, Colour, INK, SKY, VERMILION, of_sides},
    render::{Camera, Canvas, Corner},
};
use crate::{
    foam::layers::{Chance, Charged, Companions, Compared},
    mesh::{Grid, march},
    surface::{Gap, LevelSet},
};
use glam::DVec3;
use plotters::{coord::Shift, prelude::*};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// The size of the sheet, in its units; a unit is a pixel at scale 1.
const SHEET: [u32; 2] = [1800, 1020];
/// Space for the titles and for the legend.
const HEAD: u32 = 96;
const FOOT: u32 = 70;
/// Triangles along the longest axis of the surface.
const CELLS: f64 = 400.0;
/// Two cells are parted by a dark seam where their middles are as far as this, in spacings.
const SEAM: f64 = 0.045;
/// The radius of a ball that stands for a defect of the other layer, in spacings.
const BALL: f64 = 0.17;

/// Both layers on the middle surface: its parts coloured by the sides of the cell that lies over them in the one layer, the
/// defects of the other layer as balls; and the other way round.
///
/// # Errors
/// [`FigureError`] if the picture cannot be encoded.
pub fn picture(layers: &[Charged; 2], gap: &Gap, spacing: f64, title: &str) -> Result<Figure, FigureError> {
    let [sheet_width, sheet_height] = SHEET.map(f64::from);
    let mut sheet = Drawing::new(sheet_width, sheet_height);
    sheet.text([0.5 * sheet_width, 38.0], 22.0, Anchor::Middle, INK, title);
    let surface = gap.middle().as_ref();
    let triangles = triangles(surface);
    let (width, height) = (SHEET[0] / 2, SHEET[1] - HEAD - FOOT);
    let captions =
        ["cells of the lower layer, defects of the upper", "cells of the upper layer, defects of the lower"];
    for (here, caption) in captions.into_iter().enumerate() {
        let left = 0.5 * sheet_width * f64::from(u32::from(here == 1));
        let balls: Vec<(DVec3, f64)> = layers[1 - here].defects().collect();
        let of_balls = balls.iter().flat_map(|(place, _)| ball(*place, BALL * spacing)).flatten();
        let points = triangles.iter().flatten().copied().chain(of_balls.map(|corner| corner.position));
        let aspect = f64::from(width) / f64::from(height);
        let (eye, up) = towards_eye(surface);
        let mut canvas = Canvas::new(width, height, Camera::fit(points, eye, up, aspect));
        paint(&mut canvas, &triangles, &layers[here], surface, spacing);
        for (place, charge) in balls {
            for corners in ball(place, BALL * spacing) {
                canvas.triangle(corners, of_charge(charge), 1.0);
            }
        }
        sheet.text([left + 0.25 * sheet_width, 76.0], 18.0, Anchor::Middle, INK, caption);
        let size = [f64::from(width), f64::from(height)];
        sheet.picture([left, f64::from(HEAD)], size, &canvas.finish())?;
    }
    legend(&mut sheet, layers);
    Ok(sheet.finish())
}

/// From the surface to the eye, and up.
fn towards_eye(surface: &dyn LevelSet) -> (DVec3, DVec3) {
    match surface.name() {
        "plane" => (DVec3::Z, DVec3::Y),
        "torus" => (DVec3::new(0.0, -1.0, 0.9), DVec3::Z),
        _ => (DVec3::new(0.55, -1.0, 0.45), DVec3::Z),
    }
}

fn triangles(surface: &dyn LevelSet) -> Vec<[DVec3; 3]> {
    let (low, high) = surface.domain();
    let extent = high - low;
    let spacing = extent.max_element() / CELLS;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the constant above")]
    let cells = extent.to_array().map(|length| (length / spacing).ceil().max(1.0) as usize);
    march(surface, 0.0, &Grid { low, high, cells })
        .map(|mesh| mesh.triangle_corners().collect())
        .unwrap_or_default()
}

/// Colours the surface by the nearest cell.
fn paint(
    canvas: &mut Canvas,
    triangles: &[[DVec3; 3]],
    layer: &Charged,
    surface: &dyn LevelSet,
    spacing: f64,
) {
    let period = surface.period();
    let colours: Vec<Colour> = triangles
        .par_iter()
        .map(|corners| {
            let middle = corners.iter().sum::<DVec3>() / 3.0;
            let (mut first, mut second) = ((f64::INFINITY, 0.0), f64::INFINITY);
            for (&place, &charge) in layer.places.iter().zip(&layer.charges) {
                let distance = period.nearest_image(middle - place).length();
                if distance < first.0 {
                    (second, first) = (first.0, (distance, charge));
                } else {
                    second = second.min(distance);
                }
            }
            if second - first.0 < SEAM * spacing { INK.mix(of_sides(6), 0.35) } else { of_charge(first.1) }
        })
        .collect();
    for (corners, colour) in triangles.iter().zip(colours) {
        let corners = corners.map(|position| Corner { position, normal: surface.normal(position) });
        canvas.triangle(corners, colour, 1.0);
    }
}

/// The colour of a cell of charge 6 − n.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small whole number, clamped")]
fn of_charge(charge: f64) -> Colour {
    of_sides((6.0 - charge).round().clamp(0.0, 99.0) as u32)
}

/// A ball as triangles between circles of latitude.
fn ball(centre: DVec3, radius: f64) -> impl Iterator<Item = [Corner; 3]> {
    const ROUND: u32 = 20;
    const ROWS: u32 = 10;
    let corner = move |row: u32, column: u32| {
        let (latitude, longitude) =
            (PI * f64::from(row) / f64::from(ROWS), TAU * f64::from(column) / f64::from(ROUND));
        let normal =
            DVec3::new(latitude.sin() * longitude.cos(), latitude.sin() * longitude.sin(), latitude.cos());
        Corner { position: centre + radius * normal, normal }
    };
    (0..ROWS).flat_map(move |row| {
        (0..ROUND).flat_map(move |column| {
            let [a, b] = [corner(row, column), corner(row, column + 1)];
            let [c, d] = [corner(row + 1, column), corner(row + 1, column + 1)];
            [[a, c, d], [a, d, b]]
        })
    })
}

fn legend(sheet: &mut Drawing, layers: &[Charged; 2]) {
    let mut charges: Vec<f64> = layers.iter().flat_map(|layer| layer.charges.iter().copied()).collect();
    charges.sort_by(|a, b| b.total_cmp(a));
    charges.dedup();
    let width = 240.0;
    let kinds = f64::from(crate::index::checked_u32(charges.len()));
    let mut x = 0.5 * (f64::from(SHEET[0]) - kinds * width);
    for charge in charges {
        let count = |layer: &Charged| layer.charges.iter().filter(|q| (**q - charge).abs() < 0.5).count();
        let y = f64::from(SHEET[1]) - 46.0;
        sheet.rectangle([x, y], [24.0, 24.0], INK);
        sheet.rectangle([x + 1.0, y + 1.0], [22.0, 22.0], of_charge(charge));
        let label = format!("{} sides: {} + {}", 6.0 - charge, count(&layers[0]), count(&layers[1]));
        sheet.text([x + 34.0, y + 18.0], 18.0, Anchor::Start, INK, &label);
        x += width;
    }
}

/// A chart that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the chart of chance could not be drawn: {0}")]
pub struct ChartError(String);

fn failed(error: impl std::fmt::Display) -> ChartError {
    ChartError(error.to_string())
}

/// What is found beside what chance makes of it: the correlation of charges and the distance of nearest defects.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn chart(companions: &Companions, title: &str) -> Result<Figure, ChartError> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (1300, 520)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let root = root.titled(title, (FONT, 22).into_font().color(&rgb(INK))).map_err(failed)?;
        let (left, right) = root.split_horizontally(650);
        panel(&left, "correlation of charges over each other", &companions.correlation)?;
        panel(&right, "nearest defect of the other layer / spacing", &companions.nearest)?;
        root.present().map_err(failed)?;
    }
    Ok(Figure::from_svg(svg))
}

fn rgb(colour: Colour) -> RGBColor {
    let [r, g, b] = colour.0;
    RGBColor(r, g, b)
}

/// Bars of a histogram.
const BINS: u32 = 30;

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    name: &str,
    compared: &Compared,
) -> Result<(), ChartError> {
    let all = || compared.dealt.trials.iter().chain(&compared.moved.trials).copied().chain([compared.found]);
    let finite = || all().filter(|value| value.is_finite());
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    if low >= high || !(low.is_finite() && high.is_finite()) {
        let style = (FONT, 18).into_font().color(&rgb(INK));
        return area
            .draw(&Text::new(format!("{name}: no defects to compare"), (60, 220), style))
            .map_err(failed);
    }
    let width = (high - low) / f64::from(BINS);
    let text = || (FONT, 15).into_font().color(&rgb(INK));
    let bars = [(&compared.dealt, SKY), (&compared.moved, BLUE)]
        .map(|(chance, colour)| (shares(chance, low, width), colour));
    let most = bars.iter().flat_map(|(shares, _)| shares.iter().copied()).fold(0.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(64)
        .build_cartesian_2d(low - width..high + width, 0.0..1.35 * most)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_desc(name)
        .y_desc("share of the trials")
        .axis_desc_style(text())
        .label_style(text())
        .x_label_formatter(&|value| format!("{value:.2}"))
        .y_label_formatter(&|value| format!("{value:.2}"))
        .light_line_style(WHITE)
        .draw()
        .map_err(failed)?;
    for ((shares, colour), label) in bars.into_iter().zip(["charges dealt anew", "layer moved"]) {
        let steps = (0..).zip(shares).flat_map(|(bin, share)| {
            let from = low + f64::from(bin) * width;
            [(from, share), (from + width, share)]
        });
        let style = rgb(colour).stroke_width(2);
        let drawn = chart.draw_series(AreaSeries::new(steps, 0.0, rgb(colour).mix(0.3)).border_style(style));
        drawn.map_err(failed)?.label(label).legend(move |(x, y)| {
            Rectangle::new([(x, y - 5), (x + 20, y + 5)], rgb(colour).mix(0.6).filled())
        });
    }
    let found = [(compared.found, 0.0), (compared.found, 1.1 * most)];
    let style = rgb(VERMILION).stroke_width(3);
    let drawn = chart.draw_series(LineSeries::new(found, style)).map_err(failed)?;
    drawn.label("found").legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], style));
    series_legend(&mut chart, SeriesLabelPosition::UpperRight).map_err(failed)
}

/// The share of the trials in each bar.
fn shares(chance: &Chance, low: f64, width: f64) -> Vec<f64> {
    let mut counts = vec![0.0; BINS as usize];
    for trial in &chance.trials {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a bar's number, clamped"
        )]
        let bin = ((trial - low) / width).clamp(0.0, f64::from(BINS - 1)) as usize;
        counts[bin] += 1.0 / f64::from(crate::index::checked_u32(chance.trials.len()));
    }
    counts
}
