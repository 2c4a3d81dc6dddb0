//! The overlay: the photograph with what was read from it.
//!
//! Complete cells are outlined in the colour of their number of sides; those that are not hexagons filled, with their number;
//! 5–7 pairs joined; cut cells outlined in grey; uncertain ones in white and hatched; hidden ones crossed. The legend stands
//! below.

mod strokes;

use super::{
    comb::status_name,
    figure::{Anchor, Drawing, FigureError},
    palette::{Colour, GREY, INK, of_sides},
};
use crate::{
    comb::{Comb, Photo},
    tessellation::{Cell, CellId, CellStatus, Defects, defects},
};
use glam::DVec2;
use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::png};
use rayon::prelude::*;
use strokes::{Ink, Sheet};

/// Pixels per cell in the overlay: a larger photograph is reduced to it, so that the file stays small enough to be opened.
const OVERLAY_PITCH: f64 = 48.0;
/// Rows that are drawn as one task.
const BAND: usize = 256;
/// Height of a legend of one row, and what each further one adds.
const LEGEND: f64 = 34.0;
const LEGEND_ROW: f64 = 24.0;
/// Left of the legend.
const LEGEND_MARGIN: f64 = 8.0;

/// The overlay as a PNG file.
///
/// # Errors
/// The legend cannot be drawn or the file not be encoded.
pub(super) fn draw(comb: &Comb, photo: &Photo) -> Result<Vec<u8>, FigureError> {
    let scale = scale(comb);
    let [width, height] = [comb.width, comb.height].map(|length| to_u32(length as f64 * scale).max(1));
    let mut bytes = photo.scaled(width, height).into_raw();
    let defects = defects(&comb.pattern);
    let row = 3 * width as usize;
    let paint = || {
        bytes.par_chunks_mut(BAND * row).enumerate().for_each(|(band, rows)| {
            let sheet = Sheet::new(rows, width as usize);
            Overlay { comb, scale, sheet, top: (band * BAND) as f64 }.draw(&defects);
        });
    };
    let (legend, ()) = rayon::join(|| legend(f64::from(width)), paint);
    let legend = legend?;
    bytes.extend_from_slice(legend.as_raw());
    let mut file = Vec::new();
    let encoder =
        png::PngEncoder::new_with_quality(&mut file, png::CompressionType::Fast, png::FilterType::Sub);
    encoder.write_image(&bytes, width, height + legend.height(), ExtendedColorType::Rgb8)?;
    Ok(file)
}

/// Pixels of the overlay per pixel of the photograph.
pub(super) fn scale(comb: &Comb) -> f64 {
    (OVERLAY_PITCH / comb.pitch).min(1.0)
}

/// A band of the overlay.
struct Overlay<'a> {
    comb: &'a Comb,
    scale: f64,
    sheet: Sheet<'a>,
    /// First row of the band in the overlay.
    top: f64,
}

impl Overlay<'_> {
    fn draw(mut self, defects: &Defects) {
        let comb = self.comb;
        let near: Vec<(CellId, &Cell)> =
            comb.pattern.cells.enumerated().filter(|(_, cell)| self.meets(cell.position.y)).collect();
        for (id, cell) in &near {
            if comb.details[*id].seen {
                self.cell(*id, cell);
            } else {
                self.dot(cell);
            }
        }
        for pair in &defects.pairs {
            self.pair([pair.few, pair.many].map(|id| comb.pattern.cells[id].position.truncate()));
        }
        for (_, cell) in near {
            if cell.status == CellStatus::Complete
                && let Some(sides) = cell.sides.filter(|n| *n != 6)
            {
                self.digit(cell.position.truncate(), sides);
            }
        }
    }

    /// Whether a cell at this height of the photograph may be drawn in the band.
    fn meets(&self, y: f64) -> bool {
        let reach = 2.0 * self.comb.pitch * self.scale;
        let from = y * self.scale - self.top;
        from > -reach && from < self.sheet.height() as f64 + reach
    }

    fn pair(&mut self, ends: [DVec2; 2]) {
        if ends.iter().any(|end| self.meets(end.y)) {
            self.stroke(&ends, false, &[(Colour([255; 3]), 0.11, 1.0), (INK, 0.06, 1.0)]);
        }
    }

    fn cell(&mut self, id: CellId, cell: &Cell) {
        let outline = &self.comb.details[id].outline;
        let centre = cell.position.truncate();
        let inner: Vec<DVec2> = outline.iter().map(|p| centre + (*p - centre) * 0.93).collect();
        let colour = match (cell.status, cell.sides) {
            (CellStatus::Complete, Some(sides)) => of_sides(sides),
            (CellStatus::Uncertain, _) => Colour([255; 3]),
            _ => GREY,
        };
        if cell.status == CellStatus::Complete && cell.sides != Some(6) {
            let polygon = self.placed(&inner);
            self.sheet.fill(&polygon, colour, 0.45);
        }
        if cell.status == CellStatus::Uncertain {
            for line in hatching(&inner, 0.16 * self.comb.pitch) {
                self.stroke(&line, false, &[(Colour([255; 3]), 0.03, 0.9)]);
            }
        }
        // A dark rim sets the outline off from pale wax.
        let width = if cell.status == CellStatus::Cut { 0.03 } else { 0.05 };
        self.stroke(&inner, true, &[(INK, width + 0.03, 0.6), (colour, width, 0.95)]);
    }

    fn dot(&mut self, cell: &Cell) {
        let at = cell.position.truncate();
        let arm = DVec2::splat(0.08 * self.comb.pitch);
        for step in [arm, DVec2::new(arm.x, -arm.y)] {
            self.stroke(&[at - step, at + step], false, &[(GREY, 0.04, 0.9)]);
        }
    }

    /// A digit in seven strokes, legible at any size of cell.
    fn digit(&mut self, centre: DVec2, digit: u32) {
        let unit = 0.11 * self.comb.pitch;
        let at = |(x, y): (f64, f64)| centre + DVec2::new(x, y) * unit;
        for stroke in strokes(digit) {
            let points: Vec<DVec2> = stroke.iter().map(|p| at(*p)).collect();
            self.stroke(&points, false, &[(INK, 0.11, 0.9), (Colour([255; 3]), 0.05, 1.0)]);
        }
    }

    /// Points of the photograph in pixels of the band.
    fn placed(&self, points: &[DVec2]) -> Vec<DVec2> {
        points.iter().map(|p| *p * self.scale - DVec2::new(0.0, self.top)).collect()
    }

    /// Strokes a line in inks of colour, width in pitches, and opacity.
    fn stroke(&mut self, points: &[DVec2], closed: bool, inks: &[(Colour, f64, f64)]) {
        let placed = self.placed(points);
        let unit = self.comb.pitch * self.scale;
        let inks = inks.iter().map(|(colour, width, opacity)| Ink {
            colour: *colour,
            width: (width * unit).max(1.0),
            opacity: *opacity,
        });
        self.sheet.stroke(&placed, closed, &inks.collect::<Vec<Ink>>());
    }
}

/// Lines at 45° across a polygon.
fn hatching(polygon: &[DVec2], spacing: f64) -> Vec<[DVec2; 2]> {
    let along = DVec2::new(1.0, -1.0).normalize();
    let across = along.perp();
    let offsets = || polygon.iter().map(|p| p.dot(across));
    let (low, high) = (offsets().fold(f64::INFINITY, f64::min), offsets().fold(f64::NEG_INFINITY, f64::max));
    let mut lines = Vec::new();
    let mut offset = (low / spacing).ceil() * spacing;
    while offset < high && spacing > 0.0 {
        let mut crossings: Vec<f64> = polygon
            .iter()
            .zip(polygon.iter().cycle().skip(1))
            .filter(|(a, b)| (a.dot(across) > offset) != (b.dot(across) > offset))
            .map(|(a, b)| {
                let t = (offset - a.dot(across)) / (b.dot(across) - a.dot(across));
                a.lerp(*b, t).dot(along)
            })
            .collect();
        crossings.sort_by(f64::total_cmp);
        lines.extend(crossings.chunks_exact(2).map(|c| [c[0], c[1]].map(|t| along * t + across * offset)));
        offset += spacing;
    }
    lines
}

/// The strokes of a digit in a box of 2 x 4 units about the origin.
fn strokes(digit: u32) -> Vec<Vec<(f64, f64)>> {
    let (l, r, t, m, b) = (-1.0, 1.0, -2.0, 0.0, 2.0);
    match digit {
        3 => vec![vec![(l, t), (r, t), (r, b), (l, b)], vec![(l, m), (r, m)]],
        4 => vec![vec![(l, t), (l, m), (r, m)], vec![(r, t), (r, b)]],
        5 => vec![vec![(r, t), (l, t), (l, m), (r, m), (r, b), (l, b)]],
        7 => vec![vec![(l, t), (r, t), (0.0, b)]],
        8 => vec![vec![(l, t), (r, t), (r, b), (l, b), (l, t)], vec![(l, m), (r, m)]],
        9 => vec![vec![(r, m), (l, m), (l, t), (r, t), (r, b), (l, b)]],
        _ => vec![vec![(l, m), (r, m)], vec![(0.0, -1.0), (0.0, 1.0)]],
    }
}

/// What the legend explains.
#[derive(Clone, Copy)]
enum Entry {
    Sides(u32),
    Cut,
    Uncertain,
    Hidden,
    Pair,
}

impl Entry {
    const ALL: [Self; 9] = [
        Self::Sides(4),
        Self::Sides(5),
        Self::Sides(6),
        Self::Sides(7),
        Self::Sides(8),
        Self::Cut,
        Self::Uncertain,
        Self::Hidden,
        Self::Pair,
    ];

    fn text(self) -> String {
        match self {
            Self::Sides(8) => "8 sides".to_owned(),
            Self::Sides(sides) => sides.to_string(),
            Self::Cut => status_name(CellStatus::Cut).to_owned(),
            Self::Uncertain => status_name(CellStatus::Uncertain).to_owned(),
            Self::Hidden => "hidden, inferred".to_owned(),
            Self::Pair => "5-7 pair".to_owned(),
        }
    }

    /// Draws the swatch, 16 wide, with its upper left corner 10 above the text's line.
    fn swatch(self, drawing: &mut Drawing, [x, y]: [f64; 2]) {
        let at = |points: &[[f64; 2]]| points.iter().map(|p| [x + p[0], y + p[1]]).collect::<Vec<_>>();
        let mut line = |points: &[[f64; 2]], colour, width| drawing.line(&at(points), colour, width);
        let frame = [[0.0, 10.0], [16.0, 10.0], [16.0, 25.0], [0.0, 25.0], [0.0, 10.0]];
        match self {
            Self::Sides(_) | Self::Cut => {
                let colour = if let Self::Sides(sides) = self { of_sides(sides) } else { GREY };
                line(&frame, INK, 3.6);
                line(&frame, colour, 2.4);
            }
            Self::Uncertain => {
                line(&frame, INK, 2.4);
                for k in [0.0, 5.0, 10.0] {
                    line(&[[1.0 + k, 24.0], [6.0 + k, 11.0]], INK, 1.2);
                }
            }
            Self::Hidden => {
                line(&[[4.0, 13.0], [12.0, 21.0]], GREY, 2.0);
                line(&[[4.0, 21.0], [12.0, 13.0]], GREY, 2.0);
            }
            Self::Pair => line(&[[0.0, 17.0], [16.0, 17.0]], INK, 3.0),
        }
    }
}

/// The legend in as many rows as the width asks for.
fn legend(width: f64) -> Result<RgbImage, FigureError> {
    let size = if width < 900.0 { 10.0 } else { 13.0 };
    let [mut x, mut y] = [LEGEND_MARGIN, 0.0];
    let mut places = Vec::new();
    for entry in Entry::ALL {
        let length = 30.0 + size * 0.56 * entry.text().len() as f64;
        if x + length > width && x > LEGEND_MARGIN {
            (x, y) = (LEGEND_MARGIN, y + LEGEND_ROW);
        }
        places.push((entry, [x, y]));
        x += length;
    }
    let mut drawing = Drawing::new(width, y + LEGEND);
    for (entry, [x, y]) in places {
        entry.swatch(&mut drawing, [x, y]);
        drawing.text([x + 22.0, y + 22.0], size, Anchor::Start, INK, &entry.text());
    }
    drawing.finish().raster(1.0)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "rounded and clamped before the cast"
)]
fn to_u32(value: f64) -> u32 {
    value.round().clamp(0.0, f64::from(u32::MAX)) as u32
}
