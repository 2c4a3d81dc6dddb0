//! Lines and areas on a picture.
//!
//! A stroke covers a pixel as far as the pixel's middle lies within half the stroke's width of the line; along the rim it fades
//! over one pixel. Ends and corners are round. That is all an overlay needs, and costs a tenth of filling general paths.

use crate::report::palette::Colour;
use glam::{DVec2, Vec2};
use std::ops::Range;

/// A colour laid along a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ink {
    pub(super) colour: Colour,
    /// In pixels.
    pub(super) width: f64,
    /// 0..=1
    pub(super) opacity: f64,
}

/// A picture to be drawn on: red, green and blue in turn, row by row.
pub(super) struct Sheet<'a> {
    pixels: &'a mut [u8],
    width: usize,
    /// Squared distances to the line that is drawn.
    squares: Vec<f32>,
    /// The middles of a row's pixels.
    middles: Vec<f32>,
}

impl<'a> Sheet<'a> {
    /// A picture of rows of `width` pixels.
    pub(super) fn new(pixels: &'a mut [u8], width: usize) -> Self {
        let middles = (0..width).map(|x| single(x as f64 + 0.5)).collect();
        Self { pixels, width, squares: Vec::new(), middles }
    }

    /// Its number of rows.
    pub(super) const fn height(&self) -> usize {
        self.pixels.len() / (3 * self.width)
    }

    /// Draws the line through the points, which are pixels of the picture, in one ink over the other.
    pub(super) fn stroke(&mut self, points: &[DVec2], closed: bool, inks: &[Ink]) {
        let reach = inks.iter().fold(0.0, |most: f64, ink| most.max(ink.width)) / 2.0 + 1.0;
        let [columns, rows] = self.around(points, reach);
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let mut squares = std::mem::take(&mut self.squares);
        squares.clear();
        squares.resize(columns.len() * rows.len(), f32::INFINITY);
        let last = points.len() - usize::from(!closed);
        for (index, from) in points.iter().enumerate().take(last) {
            let to = points[(index + 1) % points.len()];
            let [near, beside] = self.around(&[*from, to], reach);
            let segment = Segment::new(*from, to);
            for y in beside {
                let first = (y - rows.start) * columns.len();
                let row = &mut squares[first + near.start - columns.start..first + near.end - columns.start];
                segment.lower(row, &self.middles[near.clone()], y);
            }
        }
        for (y, squares) in rows.zip(squares.chunks_exact(columns.len())) {
            let first = 3 * (y * self.width + columns.start);
            let pixels = self.pixels[first..first + 3 * columns.len()].chunks_exact_mut(3);
            for (pixel, square) in pixels.zip(squares).filter(|(_, square)| **square < single(reach * reach))
            {
                let distance = square.sqrt();
                for ink in inks {
                    let cover = (single(0.5 + ink.width / 2.0) - distance).clamp(0.0, 1.0);
                    blend(pixel, ink.colour, cover * single(ink.opacity));
                }
            }
        }
        self.squares = squares;
    }

    /// Lays a colour over the pixels whose middle lies within the polygon.
    pub(super) fn fill(&mut self, polygon: &[DVec2], colour: Colour, opacity: f64) {
        let [columns, rows] = self.around(polygon, 0.0);
        for y in rows {
            let middle = y as f64 + 0.5;
            let mut crossings: Vec<f64> = polygon
                .iter()
                .zip(polygon.iter().cycle().skip(1))
                .filter(|(a, b)| (a.y > middle) != (b.y > middle))
                .map(|(a, b)| a.x + (b.x - a.x) * (middle - a.y) / (b.y - a.y))
                .collect();
            crossings.sort_by(f64::total_cmp);
            for x in columns.clone() {
                let place = x as f64 + 0.5;
                if crossings.iter().filter(|crossing| **crossing < place).count() % 2 == 1 {
                    let first = 3 * (y * self.width + x);
                    blend(&mut self.pixels[first..first + 3], colour, single(opacity));
                }
            }
        }
    }

    /// Columns and rows within `reach` of the points.
    fn around(&self, points: &[DVec2], reach: f64) -> [Range<usize>; 2] {
        let low = points.iter().fold(DVec2::INFINITY, |low, p| low.min(*p)) - reach;
        let high = points.iter().fold(DVec2::NEG_INFINITY, |high, p| high.max(*p)) + reach;
        let range = |low: f64, high: f64, size: usize| whole(low.floor(), size)..whole(high.ceil(), size);
        [range(low.x, high.x, self.width), range(low.y, high.y, self.height())]
    }
}

/// A piece of a line.
struct Segment {
    from: Vec2,
    along: Vec2,
    /// One over the squared length; 0 of a point.
    inverse: f32,
}

impl Segment {
    fn new(from: DVec2, to: DVec2) -> Self {
        let (from, along) = (from.as_vec2(), (to - from).as_vec2());
        let squared = along.length_squared();
        Self { from, along, inverse: if squared > 0.0 { squared.recip() } else { 0.0 } }
    }

    /// Lowers the squared distances of pixels of row `y`, in the columns given, to that from this piece.
    fn lower(&self, squares: &mut [f32], columns: &[f32], y: usize) {
        let down = single(y as f64 + 0.5) - self.from.y;
        let across = down * self.along.y;
        for (square, column) in squares.iter_mut().zip(columns) {
            let x = column - self.from.x;
            let t = ((x * self.along.x + across) * self.inverse).clamp(0.0, 1.0);
            let (dx, dy) = (x - t * self.along.x, down - t * self.along.y);
            *square = square.min(dx * dx + dy * dy);
        }
    }
}

fn blend(pixel: &mut [u8], colour: Colour, share: f32) {
    for (value, target) in pixel.iter_mut().zip(colour.0) {
        let old = f32::from(*value);
        *value = byte(old + (f32::from(target) - old) * share);
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two bytes")]
fn byte(value: f32) -> u8 {
    (value + 0.5) as u8
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
fn whole(value: f64, size: usize) -> usize {
    value.clamp(0.0, size as f64) as usize
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "distances on a picture need no more than single precision"
)]
const fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLACK: Colour = Colour([0; 3]);

    fn darkness(pixels: &[u8]) -> f64 {
        pixels.iter().step_by(3).map(|v| f64::from(255 - v) / 255.0).sum()
    }

    #[test]
    fn a_stroke_covers_its_area() {
        // A capsule: what a line of width w and length l covers is w l + π w² / 4, whatever its direction.
        for angle in [0.0, 0.3, 0.8, 1.5] {
            let mut pixels = vec![255; 3 * 60 * 60];
            let (centre, arm) = (DVec2::new(30.2, 29.7), DVec2::from_angle(angle) * 15.0);
            let ink = Ink { colour: BLACK, width: 5.0, opacity: 1.0 };
            Sheet::new(&mut pixels, 60).stroke(&[centre - arm, centre + arm], false, &[ink]);
            let expected = 5.0 * 30.0 + std::f64::consts::PI * 25.0 / 4.0;
            // The ramp over a pixel is exact along a straight rim; round ends and 8 bits leave less than a percent.
            assert!((darkness(&pixels) / expected - 1.0).abs() < 0.01, "{angle}: {}", darkness(&pixels));
        }
    }

    #[test]
    fn a_filled_polygon_covers_its_area_and_nothing_is_drawn_outside() {
        let mut pixels = vec![255; 3 * 40 * 40];
        let mut sheet = Sheet::new(&mut pixels, 40);
        let square = [(5.0, 6.0), (25.0, 6.0), (25.0, 16.0), (5.0, 16.0)].map(|(x, y)| DVec2::new(x, y));
        sheet.fill(&square, BLACK, 1.0);
        let ink = Ink { colour: BLACK, width: 4.0, opacity: 1.0 };
        sheet.stroke(&square.map(|p| p + 300.0), true, &[ink]);
        sheet.fill(&square.map(|p| p - 300.0), BLACK, 1.0);
        assert!((darkness(&pixels) - 200.0).abs() < 1e-9);
    }
}
