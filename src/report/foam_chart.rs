//! Charts of a foam's making.

use super::{
    figure::{FONT, Figure},
    legend::series_legend,
    palette::{BLUE, Colour, INK, ORANGE},
};
use crate::foam::{checkpoint::StepRecord, seeds::TracePoint};
use plotters::{
    coord::ranged1d::{AsRangedCoord, ValueFormatter},
    prelude::*,
};
use std::ops::Range;

/// A chart that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the chart could not be drawn: {0}")]
pub struct ChartError(String);

/// The size of a chart in its units.
const SIZE: (u32, u32) = (900, 520);

fn rgb(colour: Colour) -> RGBColor {
    let [r, g, b] = colour.0;
    RGBColor(r, g, b)
}

fn failed(error: impl std::fmt::Display) -> ChartError {
    ChartError(error.to_string())
}

/// The annealing: overlap energy and bond-orientational order against sweeps.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn, as for an empty record.
pub fn annealing(trace: &[TracePoint]) -> Result<Figure, ChartError> {
    let sweeps = |record: &TracePoint| as_f64(record.sweep);
    let most = trace.iter().map(|record| record.energy).fold(f64::MIN_POSITIVE, f64::max);
    let chart = TwoLines {
        title: "Annealing of the seeds",
        across: ("sweeps", 0.0..trace.last().map_or(1.0, sweeps)),
        left: Line {
            axis: "energy of all seeds / d²",
            label: "energy",
            points: trace.iter().map(|record| (sweeps(record), record.energy)).collect(),
            tick: |value| format!("{value:.1}"),
        },
        left_range: 0.0..1.05 * most,
        right: Line {
            axis: "bond-orientational order |ψ6|",
            label: "order |ψ6|",
            points: trace.iter().map(|record| (sweeps(record), record.psi6)).collect(),
            tick: |value| format!("{value:.1}"),
        },
    };
    chart.drawn(0.0..1.0)
}

/// The relaxation: energy and residual against Newton steps.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn.
pub fn relaxation(record: &[StepRecord]) -> Result<Figure, ChartError> {
    let (first, last) = (record.first().map_or(0, |r| r.step), record.last().map_or(1, |r| r.step));
    let energies = || record.iter().map(|r| r.energy);
    let (low, high) = (energies().fold(f64::INFINITY, f64::min), energies().fold(f64::MIN, f64::max));
    let room = (0.05 * (high - low)).max(1e-6 * high.abs());
    let force = |r: &StepRecord| r.force.clamp(1e-16, 1e3);
    let chart = TwoLines {
        title: "Relaxation of the films",
        across: ("Newton steps", as_f64(first)..as_f64(last.max(first + 1))),
        left: Line {
            axis: "energy / (tension L²)",
            label: "energy",
            points: record.iter().map(|r| (as_f64(r.step), r.energy)).collect(),
            tick: |value| format!("{value:.5}"),
        },
        left_range: low - room..high + room,
        right: Line {
            axis: "largest force / (tension × cell width)",
            label: "largest force",
            points: record.iter().map(|r| (as_f64(r.step), force(r))).collect(),
            tick: |value| format!("{value:.0e}"),
        },
    };
    chart.drawn((1e-15..1e1).log_scale())
}

/// Two lines over one axis, each with a scale of its own.
struct TwoLines {
    title: &'static str,
    across: (&'static str, Range<f64>),
    left: Line,
    left_range: Range<f64>,
    right: Line,
}

struct Line {
    axis: &'static str,
    label: &'static str,
    points: Vec<(f64, f64)>,
    tick: fn(&f64) -> String,
}

impl TwoLines {
    fn drawn<R>(&self, right_range: R) -> Result<Figure, ChartError>
    where
        R: AsRangedCoord<Value = f64>,
        R::CoordDescType: ValueFormatter<f64>,
    {
        let mut svg = String::new();
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let (across, steps) = &self.across;
        let mut chart = ChartBuilder::on(&root)
            .caption(self.title, (FONT, 22).into_font().color(&rgb(INK)))
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(84)
            .right_y_label_area_size(74)
            .build_cartesian_2d(steps.clone(), self.left_range.clone())
            .map_err(failed)?
            .set_secondary_coord(steps.clone(), right_range);
        let text = || (FONT, 15).into_font().color(&rgb(INK));
        chart
            .configure_mesh()
            .x_desc(*across)
            .y_desc(self.left.axis)
            .axis_desc_style(text())
            .label_style(text())
            .x_label_formatter(&|value| format!("{value:.0}"))
            .y_label_formatter(&self.left.tick)
            .light_line_style(WHITE)
            .draw()
            .map_err(failed)?;
        chart
            .configure_secondary_axes()
            .y_desc(self.right.axis)
            .y_label_formatter(&self.right.tick)
            .axis_desc_style(text())
            .label_style(text())
            .draw()
            .map_err(failed)?;
        let sample =
            |colour| move |(x, y)| PathElement::new([(x, y), (x + 24, y)], rgb(colour).stroke_width(2));
        let line = |line: &Line, colour| LineSeries::new(line.points.clone(), rgb(colour).stroke_width(2));
        chart
            .draw_series(line(&self.left, BLUE))
            .map_err(failed)?
            .label(self.left.label)
            .legend(sample(BLUE));
        chart
            .draw_secondary_series(line(&self.right, ORANGE))
            .map_err(failed)?
            .label(self.right.label)
            .legend(sample(ORANGE));
        series_legend(&mut chart, SeriesLabelPosition::UpperRight).map_err(failed)?;
        root.present().map_err(failed)?;
        drop((chart, root));
        Ok(Figure::from_svg(svg))
    }
}

/// How the energies of many runs are distributed: a histogram.
///
/// # Errors
/// [`ChartError`] if the chart cannot be drawn, as without any energy.
pub fn energies(energies: &[f64]) -> Result<Figure, ChartError> {
    let low = energies.iter().copied().fold(f64::INFINITY, f64::min);
    let high = energies.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !(low.is_finite() && high.is_finite()) {
        return Err(ChartError("there are no energies".to_owned()));
    }
    let width = ((high - low) / f64::from(BINS)).max(1e-9 * high.abs());
    let counts: Vec<usize> = (0..BINS)
        .map(|bin| {
            let (from, to) = (low + f64::from(bin) * width, low + f64::from(bin + 1) * width);
            let last = bin + 1 == BINS;
            energies.iter().filter(|&&energy| energy >= from && (energy < to || last)).count()
        })
        .collect();
    let most = as_f64(counts.iter().copied().max().unwrap_or(1));
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let text = || (FONT, 15).into_font().color(&rgb(INK));
        let end = low + f64::from(BINS) * width;
        let mut chart = ChartBuilder::on(&root)
            .caption(format!("Energies of {} foams", energies.len()), (FONT, 22).into_font().color(&rgb(INK)))
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(60)
            .build_cartesian_2d(low - width..end + width, 0.0..1.1 * most)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_desc("energy / (tension L²)")
            .y_desc("foams")
            .axis_desc_style(text())
            .label_style(text())
            .x_labels(6)
            .x_label_formatter(&|value| format!("{value:.5}"))
            .y_label_formatter(&|value| format!("{value:.0}"))
            .light_line_style(WHITE)
            .draw()
            .map_err(failed)?;
        let bars = (0..BINS).zip(&counts).map(|(bin, &count)| {
            let from = low + f64::from(bin) * width;
            Rectangle::new([(from, 0.0), (from + width, as_f64(count))], rgb(BLUE).filled())
        });
        chart.draw_series(bars).map_err(failed)?;
        root.present().map_err(failed)?;
    }
    Ok(Figure::from_svg(svg))
}

/// Bars of the histogram.
const BINS: u32 = 24;

#[expect(clippy::cast_precision_loss, reason = "sweeps lie far below 2^53")]
const fn as_f64(count: usize) -> f64 {
    count as f64
}
