//! Charts of a comparison, in a style fit for print: one idea each, axes with units, the numbers as tables beside them.

use super::{
    figure::{FONT, Figure},
    palette::{BLUE, Colour, GREY, INK, ORANGE, VERMILION},
};
use crate::compare::{Comparison, Estimate, Group};
use plotters::prelude::*;
use std::ops::Range;

/// A chart that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the chart could not be drawn: {0}")]
pub struct ChartError(String);

fn failed(error: impl std::fmt::Display) -> ChartError {
    ChartError(error.to_string())
}

/// The size of a chart in its units.
const SIZE: (u32, u32) = (720, 460);

/// The colour of the comb and of the foam in every chart.
pub(super) const COLOURS: [Colour; 2] = [ORANGE, BLUE];

/// Colours of curves that are neither.
const CURVES: [Colour; 2] = [BLUE, VERMILION];

fn rgb(colour: Colour) -> RGBColor {
    let [r, g, b] = colour.0;
    RGBColor(r, g, b)
}

type Sheet<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Chart<'a> = ChartContext<
    'a,
    SVGBackend<'a>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// What stands at the axes.
struct Axes {
    title: &'static str,
    x: (&'static str, Range<f64>),
    y: (&'static str, Range<f64>),
    /// Digits of the labels along x and y.
    digits: (usize, usize),
    /// About how many labels along x.
    labels: usize,
}

/// A chart with its axes; `content` draws into it.
fn chart(
    axes: &Axes,
    content: impl FnOnce(&mut Chart<'_>) -> Result<(), ChartError>,
) -> Result<Figure, ChartError> {
    let mut svg = String::new();
    {
        let sheet: Sheet<'_> = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        sheet.fill(&WHITE).map_err(failed)?;
        let text = |size: u32| (FONT, size).into_font().color(&rgb(INK));
        let mut chart = ChartBuilder::on(&sheet)
            .caption(axes.title, text(21))
            .margin(14)
            .x_label_area_size(50)
            .y_label_area_size(70)
            .build_cartesian_2d(axes.x.1.clone(), axes.y.1.clone())
            .map_err(failed)?;
        let (digits_x, digits_y) = axes.digits;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_desc(axes.x.0)
            .y_desc(axes.y.0)
            .x_labels(axes.labels)
            .axis_desc_style(text(16))
            .label_style(text(15))
            .x_label_formatter(&|value| format!("{value:.digits_x$}"))
            .y_label_formatter(&|value| format!("{value:.digits_y$}"))
            .bold_line_style(rgb(INK).mix(0.12))
            .light_line_style(WHITE)
            .draw()
            .map_err(failed)?;
        content(&mut chart)?;
        sheet.present().map_err(failed)?;
    }
    Ok(Figure::from_svg(svg))
}

/// The names of what was drawn, in a corner.
fn legend(chart: &mut Chart<'_>, corner: SeriesLabelPosition) -> Result<(), ChartError> {
    chart
        .configure_series_labels()
        .position(corner)
        .label_font((FONT, 15).into_font().color(&rgb(INK)))
        .border_style(rgb(INK).mix(0.3))
        .background_style(WHITE.mix(0.85))
        .draw()
        .map_err(failed)
}

/// An error bar, where there is an interval.
fn error_bar(chart: &mut Chart<'_>, x: f64, estimate: &Estimate) -> Result<(), ChartError> {
    if let Some([low, high]) = estimate.interval {
        let style = rgb(INK).stroke_width(2);
        let cap = |y: f64| PathElement::new(vec![(x - 0.04, y), (x + 0.04, y)], style);
        let bar = PathElement::new(vec![(x, low), (x, high)], style);
        chart.draw_series([bar, cap(low), cap(high)]).map_err(failed)?;
    }
    Ok(())
}

/// p(n): the share of cells with n sides, comb beside foam, with 95 % intervals.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn sides(comparison: &Comparison) -> Result<Figure, ChartError> {
    let classes = &comparison.sides.classes;
    let ends = |at: Option<&crate::compare::SideClass>| at.map_or(6.0, |class| class.sides as f64);
    let reach = |e: &Estimate| e.interval.map_or(e.value, |[_, high]| high.max(e.value));
    let top = classes.iter().flat_map(|class| class.share.iter().map(reach)).fold(0.1, f64::max);
    let axes = Axes {
        title: "Numbers of sides",
        x: ("sides n", ends(classes.first()) - 0.7..ends(classes.last()) + 0.7),
        y: ("share of complete cells p(n)", 0.0..1.12 * top),
        digits: (0, 1),
        labels: classes.len() + 2,
    };
    chart(&axes, |chart| {
        for (at, group) in [&comparison.comb, &comparison.foam].into_iter().enumerate() {
            let colour = rgb(COLOURS[at]);
            let offset = if at == 0 { -0.34 } else { 0.02 };
            let bars = classes.iter().map(|class| {
                let left = class.sides as f64 + offset;
                Rectangle::new([(left, 0.0), (left + 0.32, class.share[at].value)], colour.filled())
            });
            chart
                .draw_series(bars)
                .map_err(failed)?
                .label(format!("{}, {} cells", group.kind, group.cells))
                .legend(move |(x, y)| Rectangle::new([(x, y - 6), (x + 18, y + 6)], colour.filled()));
            for class in classes {
                error_bar(chart, class.sides as f64 + offset + 0.16, &class.share[at])?;
            }
        }
        legend(chart, SeriesLabelPosition::UpperRight)
    })
}

/// Points with their line for comb and foam: `points` gives the places of a group, `line` what a fit says at x.
struct Points {
    points: [Vec<(f64, f64)>; 2],
    fits: [Option<Vec<(f64, f64)>>; 2],
}

/// Points of both groups and the lines of their fits.
fn points(axes: &Axes, series: &Points, labels: [String; 2]) -> Result<Figure, ChartError> {
    chart(axes, |chart| {
        for (at, label) in labels.into_iter().enumerate() {
            let colour = rgb(COLOURS[at]);
            let circles = series.points[at].iter().map(|place| Circle::new(*place, 5, colour.filled()));
            chart
                .draw_series(circles)
                .map_err(failed)?
                .label(label)
                .legend(move |(x, y)| Circle::new((x + 10, y), 5, colour.filled()));
            if let Some(line) = &series.fits[at] {
                chart
                    .draw_series(LineSeries::new(line.iter().copied(), colour.stroke_width(2)))
                    .map_err(failed)?;
            }
        }
        legend(chart, SeriesLabelPosition::UpperRight)
    })
}

/// The range of values with room on both sides.
fn range(values: impl Iterator<Item = f64>, least: f64) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let room = (0.12 * (high - low)).max(0.5 * (least - (high - low))).max(1e-9);
    low - room..high + room
}

/// All points of both groups.
fn ranges(series: &Points, least: (f64, f64)) -> (Range<f64>, Range<f64>) {
    let all = || series.points.iter().flatten();
    (range(all().map(|p| p.0), least.0), range(all().map(|p| p.1), least.1))
}

fn groups(comparison: &Comparison) -> [&Group; 2] {
    [&comparison.comb, &comparison.foam]
}

/// Places of a chart, in the axes' units.
type Line = Vec<(f64, f64)>;

/// Aboav–Weaire: n·m(n) against n, with the fitted law of each group's first pattern.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn aboav_weaire(comparison: &Comparison) -> Result<Figure, ChartError> {
    let of = |group: &Group| -> (Line, Option<Line>) {
        let mut places = Vec::new();
        let mut line = None;
        for pattern in &group.patterns {
            let law = &pattern.statistics.aboav_weaire;
            let place = |p: &crate::tessellation::NeighbourMean| {
                (f64::from(p.sides), f64::from(p.sides) * p.mean_sides_of_neighbours)
            };
            places.extend(law.points.iter().map(place));
            let sides = &pattern.statistics.sides;
            if let (Some(a), Some(mean), Some(second)) = (law.a, sides.mean_sides, sides.second_moment)
                && line.is_none()
            {
                line = Some([4.0, 8.0].map(|n| (n, (mean - a) * n + a * mean + second)).to_vec());
            }
        }
        (places, line)
    };
    let [(comb, comb_fit), (foam, foam_fit)] = groups(comparison).map(of);
    let series = Points { points: [comb, foam], fits: [comb_fit, foam_fit] };
    let (x, y) = ranges(&series, (3.0, 10.0));
    let axes = Axes {
        title: "Aboav–Weaire: sides of the neighbours",
        x: ("sides n", x),
        y: ("n · m(n)", y),
        digits: (0, 0),
        labels: 6,
    };
    points(
        &axes,
        &series,
        labels(comparison, |group| {
            let a = group.patterns.first().and_then(|p| p.statistics.aboav_weaire.a);
            a.map_or_else(String::new, |a| format!(", a = {a:.2}"))
        }),
    )
}

fn labels(comparison: &Comparison, more: impl Fn(&Group) -> String) -> [String; 2] {
    groups(comparison).map(|group| format!("{}{}", group.kind, more(group)))
}

/// Lewis: the mean area of cells with n sides, relative to that of all.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn lewis(comparison: &Comparison) -> Result<Figure, ChartError> {
    let of = |group: &Group| -> Vec<(f64, f64)> {
        let points = group.patterns.iter().flat_map(|pattern| &pattern.statistics.lewis.points);
        points.map(|p| (f64::from(p.sides), p.relative_area)).collect()
    };
    let fit = |group: &Group| {
        let pattern = &group.patterns.first()?.statistics;
        let (slope, mean) = (pattern.lewis.slope?, pattern.sides.mean_sides?);
        Some([4.5, 7.5].map(|n| (n, 1.0 + slope * (n - mean))).to_vec())
    };
    let series = Points { points: groups(comparison).map(of), fits: groups(comparison).map(fit) };
    let (x, y) = ranges(&series, (3.0, 0.4));
    let axes = Axes {
        title: "Lewis: size against sides",
        x: ("sides n", x),
        y: ("mean area ⟨A⟩ₙ / ⟨A⟩", y),
        digits: (0, 1),
        labels: 6,
    };
    points(
        &axes,
        &series,
        labels(comparison, |group| {
            let slope = group.patterns.first().and_then(|p| p.statistics.lewis.slope);
            slope.map_or_else(String::new, |slope| format!(", λ = {slope:+.3}"))
        }),
    )
}

/// Correlation of the sides of cells r walls apart.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn correlations(comparison: &Comparison) -> Result<Figure, ChartError> {
    let of = |group: &Group| -> Vec<(f64, f64)> {
        let points = group.patterns.iter().flat_map(|pattern| &pattern.statistics.correlations);
        points.map(|p| (p.distance as f64, p.correlation)).collect()
    };
    let zero = || Some(vec![(0.5, 0.0), (5.5, 0.0)]);
    let series = Points { points: groups(comparison).map(of), fits: [zero(), None] };
    let y = range(series.points.iter().flatten().map(|p| p.1).chain([0.0]), 0.4);
    let axes = Axes {
        title: "Correlation of sides",
        x: ("distance r (walls)", 0.5..5.5),
        y: ("C(r) = ⟨δn δn′⟩ / μ₂", y),
        digits: (0, 2),
        labels: 6,
    };
    points(&axes, &series, labels(comparison, |_| String::new()))
}

/// Groups of touching defects: the share of groups with at least so many cells.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn chains(comparison: &Comparison) -> Result<Figure, ChartError> {
    let sizes = |group: &Group| -> Vec<usize> {
        group.patterns.iter().flat_map(|p| p.statistics.chains.iter().map(|chain| chain.0)).collect()
    };
    let all = groups(comparison).map(sizes);
    let longest = all.iter().flatten().copied().max().unwrap_or(1);
    let axes = Axes {
        title: "Chains of touching defects",
        x: ("cells in a chain, at least", 0.5..longest as f64 + 1.5),
        y: ("share of chains", 0.0..1.08),
        digits: (0, 1),
        labels: 10,
    };
    chart(&axes, |chart| {
        for ((at, sizes), group) in all.iter().enumerate().zip(groups(comparison)) {
            let colour = rgb(COLOURS[at]);
            let share =
                |size: usize| sizes.iter().filter(|s| **s >= size).count() as f64 / sizes.len().max(1) as f64;
            // A staircase: the share stays until the next size.
            let steps = (1..=longest + 1).flat_map(|size| {
                let at = size as f64;
                [(at - 0.5, share(size)), (at + 0.5, share(size))]
            });
            let steps: Vec<(f64, f64)> = if sizes.is_empty() { Vec::new() } else { steps.collect() };
            chart
                .draw_series(LineSeries::new(steps, colour.stroke_width(3)))
                .map_err(failed)?
                .label(format!("{}, {} chains", group.kind, sizes.len()))
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(3)));
        }
        legend(chart, SeriesLabelPosition::UpperRight)
    })
}

/// Charge against integrated curvature: all regions of one radius, with the line on which charge is curvature. `None` where
/// neither comb nor foam has curvature.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn curvature(comparison: &Comparison) -> Result<Option<Figure>, ChartError> {
    let of = |group: &Group| -> Vec<(f64, f64)> {
        let regions = group.patterns.iter().filter_map(|p| p.statistics.curvature.as_ref());
        regions.flatten().flat_map(|r| r.regions.iter().map(|[k, q]| (*k, *q))).collect()
    };
    let series = Points { points: groups(comparison).map(of), fits: [None, None] };
    if series.points.iter().all(Vec::is_empty) {
        return Ok(None);
    }
    let (x, y) = ranges(&series, (1.0, 2.0));
    let diagonal = [(x.start, x.start), (x.end, x.end)];
    let axes = Axes {
        title: "Charge against curvature, regions of growing size",
        x: ("∫K dA", x),
        y: ("Σ(6 − n) · π/3", y),
        digits: (1, 1),
        labels: 8,
    };
    let labels = labels(comparison, |_| String::new());
    let figure = chart(&axes, |chart| {
        for (at, label) in labels.into_iter().enumerate().rev() {
            let colour = rgb(COLOURS[at]);
            // Thousands of regions: a crowd shows as a darker place.
            let dots =
                series.points[at].iter().map(|place| Circle::new(*place, 3, colour.mix(0.25).filled()));
            chart
                .draw_series(dots)
                .map_err(failed)?
                .label(label)
                .legend(move |(x, y)| Circle::new((x + 10, y), 5, colour.filled()));
        }
        chart
            .draw_series(LineSeries::new(diagonal, rgb(INK).stroke_width(1)))
            .map_err(failed)?
            .label("charge = curvature")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 20, y)], rgb(INK).stroke_width(1)));
        legend(chart, SeriesLabelPosition::UpperLeft)
    })?;
    Ok(Some(figure))
}

/// A number of cells if it is 1, 2 or 5 of a power of ten: others would crowd a logarithmic axis.
fn round_number(value: f64) -> String {
    let text = format!("{value:.0}");
    let first = text.trim_end_matches('0');
    if ["1", "2", "5"].contains(&first) { text } else { String::new() }
}

/// Power against the number of cells, on a logarithmic scale: the share of pairs that were found different.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn power_chart(curves: &[(&str, Vec<(f64, f64)>)]) -> Result<Figure, ChartError> {
    let places = || curves.iter().flat_map(|(_, points)| points.iter().map(|p| p.0));
    let (low, high) = (places().fold(f64::INFINITY, f64::min), places().fold(1.0, f64::max));
    let mut svg = String::new();
    {
        let sheet = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        sheet.fill(&WHITE).map_err(failed)?;
        let text = |size: u32| (FONT, size).into_font().color(&rgb(INK));
        let mut chart = ChartBuilder::on(&sheet)
            .caption("Finding 80 % hexagons against 85 %", text(21))
            .margin(14)
            .x_label_area_size(50)
            .y_label_area_size(70)
            .build_cartesian_2d((0.9 * low..1.1 * high).log_scale(), 0.0..1.02)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .x_desc("complete cells of comb, and of foam")
            .y_desc("share of pairs found different")
            .axis_desc_style(text(16))
            .label_style(text(15))
            .x_label_formatter(&|value| round_number(*value))
            .y_label_formatter(&|value| format!("{value:.1}"))
            .bold_line_style(rgb(INK).mix(0.12))
            .light_line_style(WHITE)
            .draw()
            .map_err(failed)?;
        for ((name, points), colour) in curves.iter().zip(CURVES) {
            let colour = rgb(colour);
            chart
                .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)).point_size(4))
                .map_err(failed)?
                .label(*name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(3)));
        }
        for (level, name) in [(0.05, "5 %: nothing to find"), (0.8, "four times in five")] {
            let style = rgb(GREY).stroke_width(1);
            chart
                .draw_series(DashedLineSeries::new([(0.9 * low, level), (1.1 * high, level)], 6, 5, style))
                .map_err(failed)?
                .label(name)
                .legend(|(x, y)| PathElement::new([(x, y), (x + 20, y)], rgb(GREY).stroke_width(1)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .label_font(text(15))
            .border_style(rgb(INK).mix(0.3))
            .background_style(WHITE.mix(0.85))
            .draw()
            .map_err(failed)?;
        sheet.present().map_err(failed)?;
    }
    Ok(Figure::from_svg(svg))
}
