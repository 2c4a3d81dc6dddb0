//! The legend of a chart: the names of what was drawn, in a corner.

use super::{
    figure::FONT,
    palette::{Colour, INK},
};
use plotters::{chart::ChartContext, coord::CoordTranslate, drawing::DrawingAreaErrorKind, prelude::*};

/// Draws the labels of all series of a chart in a faint box.
///
/// # Errors
/// Those of the drawing.
pub(super) fn series_legend<'a, B: DrawingBackend + 'a, C: CoordTranslate>(
    chart: &mut ChartContext<'a, B, C>,
    corner: SeriesLabelPosition,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let Colour([r, g, b]) = INK;
    let ink = RGBColor(r, g, b);
    chart
        .configure_series_labels()
        .position(corner)
        .label_font((FONT, 15).into_font().color(&ink))
        .border_style(ink.mix(0.3))
        .background_style(WHITE.mix(0.8))
        .draw()
}
