//! Charts of a foam's making.

use super::{
    figure::{FONT, Figure},
    palette::{BLUE, Colour, INK, ORANGE},
};
use crate::foam::seeds::TracePoint;
use plotters::{chart::DualCoordChartContext, coord::ranged1d::Ranged, prelude::*};

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
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let sweeps = trace.last().map_or(1.0, |record| as_f64(record.sweep));
        let most = trace.iter().map(|record| record.energy).fold(f64::MIN_POSITIVE, f64::max);
        let mut chart = ChartBuilder::on(&root)
            .caption("Annealing of the seeds", (FONT, 22).into_font().color(&rgb(INK)))
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(74)
            .right_y_label_area_size(64)
            .build_cartesian_2d(0.0..sweeps, 0.0..1.05 * most)
            .map_err(failed)?
            .set_secondary_coord(0.0..sweeps, 0.0..1.0);
        style(&mut chart)?;
        let energy = trace.iter().map(|record| (as_f64(record.sweep), record.energy));
        chart
            .draw_series(LineSeries::new(energy, rgb(BLUE).stroke_width(2)))
            .map_err(failed)?
            .label("energy")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 24, y)], rgb(BLUE).stroke_width(2)));
        let order = trace.iter().map(|record| (as_f64(record.sweep), record.psi6));
        chart
            .draw_secondary_series(LineSeries::new(order, rgb(ORANGE).stroke_width(2)))
            .map_err(failed)?
            .label("order |ψ6|")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 24, y)], rgb(ORANGE).stroke_width(2)));
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font((FONT, 15).into_font().color(&rgb(INK)))
            .border_style(rgb(INK).mix(0.3))
            .background_style(WHITE.mix(0.8))
            .draw()
            .map_err(failed)?;
        root.present().map_err(failed)?;
    }
    Ok(Figure::from_svg(svg))
}

type Annealing<'a, 'b, X, Y> = DualCoordChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<X, Y>,
    Cartesian2d<X, plotters::coord::types::RangedCoordf64>,
>;

/// Axis titles and tick labels.
fn style<X, Y>(chart: &mut Annealing<'_, '_, X, Y>) -> Result<(), ChartError>
where
    X: Ranged<ValueType = f64> + plotters::coord::ranged1d::ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + plotters::coord::ranged1d::ValueFormatter<f64>,
{
    let text = || (FONT, 15).into_font().color(&rgb(INK));
    chart
        .configure_mesh()
        .x_desc("sweeps")
        .y_desc("energy of all seeds / d²")
        .axis_desc_style(text())
        .label_style(text())
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|value| format!("{value:.1}"))
        .light_line_style(WHITE)
        .draw()
        .map_err(failed)?;
    chart
        .configure_secondary_axes()
        .y_desc("bond-orientational order |ψ6|")
        .axis_desc_style(text())
        .label_style(text())
        .draw()
        .map_err(failed)
}

#[expect(clippy::cast_precision_loss, reason = "sweeps lie far below 2^53")]
const fn as_f64(count: usize) -> f64 {
    count as f64
}
