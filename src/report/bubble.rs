//! The landscape of a bubble's energy: table, charts, and the surface coloured by it.

use super::{
    figure::{Anchor, Drawing, FONT, Figure, FigureError},
    folder::{OutputError, OutputFolder},
    legend::series_legend,
    palette::{BLUE, Colour, INK, VERMILION, viridis},
    render::{Camera, Canvas, Corner},
};
use crate::{
    foam::bubble::{Sample, Scattered},
    mesh::{Grid, march},
    surface::LevelSet,
};
use glam::DVec3;
use plotters::{coord::Shift, prelude::*};
use rayon::prelude::*;

/// Writes `landscape.csv`: a row for each place.
///
/// # Errors
/// [`OutputError`] if it cannot be written.
pub fn write_table(folder: &mut OutputFolder, samples: &[Sample]) -> Result<(), OutputError> {
    folder.write("landscape.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        table.write_record([
            "along",
            "x",
            "y",
            "z",
            "gauss_curvature",
            "mean_curvature",
            "gap",
            "energy",
            "energy_error",
            "pressure",
            "force_x",
            "force_y",
            "force_z",
            "thin_gap_energy",
            "difference_over_energy",
            "status",
        ])?;
        for sample in samples {
            table.write_record(row(sample))?;
        }
        table.flush()
    })
}

fn row(sample: &Sample) -> Vec<String> {
    let number = |value: f64| if value.is_nan() { String::new() } else { value.to_string() };
    let (place, thin) = (sample.place, &sample.thin);
    let mut row = vec![
        number(sample.along),
        number(place.x),
        number(place.y),
        number(place.z),
        number(thin.gauss_curvature),
        number(thin.mean_curvature),
        number(thin.height),
    ];
    match &sample.bubble {
        Ok(bubble) => {
            let formula = thin.energy(bubble.volume);
            row.extend([bubble.energy, bubble.energy_error, bubble.pressure].map(number));
            row.extend(bubble.force.to_array().map(number));
            row.extend([formula, (bubble.energy - formula) / bubble.energy].map(number));
            row.push("equilibrium".to_owned());
        }
        Err(error) => {
            row.extend(std::iter::repeat_n(String::new(), 8));
            row.push(error.to_string());
        }
    }
    row
}

/// A chart that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the landscape could not be drawn: {0}")]
pub struct ChartError(String);

fn failed(error: impl std::fmt::Display) -> ChartError {
    ChartError(error.to_string())
}

/// One sample in a chart: abscissa, energy, energy by the formula.
type Point = (f64, f64, f64);

/// Energy against the way along a route, if there is one, and against the Gaussian curvature; the thin-gap formula beside
/// it.
///
/// # Errors
/// [`ChartError`] if nothing can be drawn, as without any bubble.
pub fn chart(samples: &[Sample], title: &str) -> Result<Figure, ChartError> {
    let points = |abscissa: &dyn Fn(&Sample) -> f64| -> Vec<Point> {
        let drawn = samples.iter().filter_map(|sample| {
            let bubble = sample.bubble.as_ref().ok()?;
            Some((abscissa(sample), bubble.energy, sample.thin.energy(bubble.volume)))
        });
        drawn.collect()
    };
    let along = points(&|sample| sample.along);
    let curvature = points(&|sample| sample.thin.gauss_curvature);
    if along.is_empty() {
        return Err(ChartError("no bubble was in equilibrium".to_owned()));
    }
    let is_route = along.iter().all(|point| point.0.is_finite());
    let mut svg = String::new();
    {
        let size = (if is_route { 1300 } else { 800 }, 560);
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let caption = (FONT, 22).into_font().color(&rgb(INK));
        let root = root.titled(title, caption).map_err(failed)?;
        if is_route {
            let (left, right) = root.split_horizontally(650);
            panel(&left, "way along the surface / L", &along, true)?;
            panel(&right, "Gaussian curvature × L²", &curvature, false)?;
        } else {
            panel(&root, "Gaussian curvature × L²", &curvature, false)?;
        }
        root.present().map_err(failed)?;
    }
    Ok(Figure::from_svg(svg))
}

fn rgb(colour: Colour) -> RGBColor {
    let [r, g, b] = colour.0;
    RGBColor(r, g, b)
}

fn bounds(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let room = (0.06 * (high - low)).max(1e-9 * high.abs()).max(1e-12);
    low - room..high + room
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    abscissa: &str,
    points: &[Point],
    joined: bool,
) -> Result<(), ChartError> {
    let across = bounds(points.iter().map(|point| point.0));
    let drawn = bounds(points.iter().flat_map(|point| [point.1, point.2]));
    let up = drawn.start..drawn.end + LEGEND * (drawn.end - drawn.start);
    let digits = digits_of(up.end - up.start);
    let wide = digits_of(across.end - across.start);
    let text = || (FONT, 15).into_font().color(&rgb(INK));
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(100)
        .build_cartesian_2d(across, up)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc(abscissa)
        .y_desc("energy / (tension L²)")
        .axis_desc_style(text())
        .label_style(text())
        .x_labels(7)
        .y_labels(7)
        .x_label_formatter(&|&value| rounded(value, wide))
        .y_label_formatter(&|&value| rounded(value, digits))
        .light_line_style(WHITE)
        .draw()
        .map_err(failed)?;
    let formula = rgb(VERMILION);
    if joined {
        let line = LineSeries::new(points.iter().map(|p| (p.0, p.2)), formula.stroke_width(2));
        let drawn = chart.draw_series(line).map_err(failed)?;
        drawn
            .label("thin-gap formula")
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], formula.stroke_width(2)));
    } else {
        let crosses = points.iter().map(|p| Cross::new((p.0, p.2), 4, formula.stroke_width(2)));
        let drawn = chart.draw_series(crosses).map_err(failed)?;
        drawn
            .label("thin-gap formula")
            .legend(move |(x, y)| Cross::new((x + 10, y), 4, formula.stroke_width(2)));
    }
    let dots = points.iter().map(|p| Circle::new((p.0, p.1), 4, rgb(BLUE).filled()));
    let drawn = chart.draw_series(dots).map_err(failed)?;
    drawn.label("bubble").legend(|(x, y)| Circle::new((x + 10, y), 4, rgb(BLUE).filled()));
    series_legend(&mut chart, SeriesLabelPosition::UpperMiddle).map_err(failed)
}

/// Room above the points for the legend, as a part of their range.
const LEGEND: f64 = 0.2;

/// A tick's label; a zero that rounding has made negative is a zero.
fn rounded(value: f64, digits: usize) -> String {
    let label = format!("{value:.digits$}");
    if label.trim_start_matches(['-', '0', '.']).is_empty() { label.replace('-', "") } else { label }
}

/// Decimals that tell a fiftieth of a range.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a dozen")]
fn digits_of(range: f64) -> usize {
    (1.0 - (range / 5.0).log10().floor()).clamp(0.0, 12.0) as usize
}

/// The size of the sheet, in its units; a unit is a pixel at scale 1.
const SHEET: [u32; 2] = [1100, 900];
/// Space for the title.
const HEAD: u32 = 60;
/// Space for the colour bar.
const BAR: u32 = 150;
/// Cells of the mesh that is drawn, along the longest axis.
const CELLS: f64 = 128.0;

/// The middle surface coloured by the energy of a bubble held there.
///
/// # Errors
/// [`FigureError`] if the picture cannot be encoded.
pub fn picture(
    surface: &dyn LevelSet,
    energy: &(impl Fn(DVec3) -> f64 + Sync),
    range: [f64; 2],
    title: &str,
) -> Result<Figure, FigureError> {
    let (low, high) = surface.domain();
    let extent = high - low;
    let spacing = extent.max_element() / CELLS;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the constant above")]
    let cells = extent.to_array().map(|length| (length / spacing).ceil().max(1.0) as usize);
    // A node that cannot be projected would leave a hole; smooth surfaces have none.
    let triangles: Vec<[DVec3; 3]> = march(surface, 0.0, &Grid { low, high, cells })
        .map(|mesh| mesh.triangle_corners().collect())
        .unwrap_or_default();
    let colours: Vec<Colour> = triangles
        .par_iter()
        .map(|corners| {
            let middle = corners.iter().sum::<DVec3>() / 3.0;
            viridis((energy(middle) - range[0]) / (range[1] - range[0]))
        })
        .collect();
    let (width, height) = (SHEET[0] - BAR, SHEET[1] - HEAD);
    let towards_eye =
        if surface.name() == "torus" { DVec3::new(0.0, -1.0, 0.9) } else { DVec3::new(0.55, -1.0, 0.45) };
    let points = triangles.iter().flatten().copied();
    let camera = Camera::fit(points, towards_eye, DVec3::Z, f64::from(width) / f64::from(height));
    let mut canvas = Canvas::new(width, height, camera);
    for (corners, colour) in triangles.iter().zip(colours) {
        let corners = corners.map(|position| Corner { position, normal: surface.normal(position) });
        canvas.triangle(corners, colour, 1.0);
    }
    let [sheet_width, sheet_height] = SHEET.map(f64::from);
    let mut sheet = Drawing::new(sheet_width, sheet_height);
    sheet.text([sheet_width / 2.0, 36.0], 22.0, Anchor::Middle, INK, title);
    sheet.picture([0.0, f64::from(HEAD)], [f64::from(width), f64::from(height)], &canvas.finish())?;
    bar(&mut sheet, range);
    Ok(sheet.finish())
}

/// The colour bar with as many digits as the range needs.
fn bar(sheet: &mut Drawing, range: [f64; 2]) {
    const STEPS: u32 = 64;
    let (x, top, height) = (f64::from(SHEET[0] - BAR) + 10.0, 260.0, 420.0);
    let step = height / f64::from(STEPS);
    for i in 0..STEPS {
        let t = (f64::from(i) + 0.5) / f64::from(STEPS);
        sheet.rectangle([x, top + height - f64::from(i + 1) * step], [18.0, step + 0.4], viridis(t));
    }
    let digits = digits_of(range[1] - range[0]);
    for tick in 0..=4 {
        let t = f64::from(tick) / 4.0;
        let y = top + height * (1.0 - t);
        sheet.line(&[[x + 18.0, y], [x + 23.0, y]], INK, 1.0);
        let label = format!("{:.digits$}", range[0] + t * (range[1] - range[0]));
        sheet.text([x + 28.0, y + 5.0], 15.0, Anchor::Start, INK, &label);
    }
    sheet.text([x, top - 40.0], 15.0, Anchor::Start, INK, "energy of a bubble");
    sheet.text([x, top - 20.0], 15.0, Anchor::Start, INK, "held there");
}

/// The landscape over a triply periodic surface or a torus, from samples; nothing where it is the same everywhere.
///
/// # Errors
/// [`FigureError`] if the picture cannot be encoded.
pub fn map(surface: &dyn LevelSet, samples: &[Sample], title: &str) -> Result<Option<Figure>, FigureError> {
    let known: Vec<(DVec3, f64)> =
        samples.iter().filter_map(|s| Some((s.place, s.bubble.as_ref().ok()?.energy))).collect();
    let energies = || known.iter().map(|known| known.1);
    let range = [energies().fold(f64::INFINITY, f64::min), energies().fold(f64::NEG_INFINITY, f64::max)];
    let is_torus = surface.name() == "torus";
    let is_mapped = is_torus || surface.period().0.iter().all(Option::is_some);
    if !is_mapped || range[1] <= range[0] {
        return Ok(None);
    }
    // A torus is the same round its axis and on both sides of its plane.
    let folded = |p: DVec3| if is_torus { DVec3::new(p.x.hypot(p.y), 0.0, p.z.abs()) } else { p };
    let known: Vec<(DVec3, f64)> = known.into_iter().map(|(place, energy)| (folded(place), energy)).collect();
    let scattered = Scattered::new(surface, &known);
    picture(surface, &|p| scattered.at(folded(p)), range, title).map(Some)
}
