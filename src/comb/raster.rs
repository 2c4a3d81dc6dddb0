//! Parts of a photograph at other scales.
//!
//! A pyramid holds the part in the photograph's own resolution, halved, halved again, and so on; a raster is resampled from
//! a level that has at least two pixels, or one, per pixel wanted, so that a small raster costs little whatever the
//! photograph's size.

use super::{
    photo::{Part, Photo, Samples},
    plane::{Plane, narrow, pixel},
};
use image::RgbImage;
use rayon::prelude::*;
use std::borrow::Cow;

/// Halvings that are kept: the coarsest level has a pixel per 32 x 32 of the photograph.
const HALVINGS: usize = 5;

/// A part of a photograph at its own resolution and at halves of it.
#[derive(Clone, Debug)]
pub(crate) struct Pyramid<'a> {
    part: Part,
    levels: Vec<Level<'a>>,
}

#[derive(Clone, Debug)]
struct Level<'a> {
    photo: Cow<'a, Photo>,
    /// Corner of the part in this level's picture.
    corner: [f64; 2],
    /// Pixels of the photograph per pixel of this level.
    unit: f64,
}

impl<'a> Pyramid<'a> {
    /// The levels of `part`, which lies within the photograph.
    pub(crate) fn of(photo: &'a Photo, part: Part) -> Self {
        let corner = [part.left as f64, part.top as f64];
        let mut levels = vec![Level { photo: Cow::Borrowed(photo), corner, unit: 1.0 }];
        let mut frame = part;
        while levels.len() <= HALVINGS && frame.width > 1 && frame.height > 1 {
            let finer = &levels[levels.len() - 1];
            let (photo, unit) = (finer.photo.halved(frame), finer.unit * 2.0);
            frame = Part { left: 0, top: 0, width: photo.width(), height: photo.height() };
            levels.push(Level { photo: Cow::Owned(photo), corner: [0.0; 2], unit });
        }
        Self { part, levels }
    }

    /// The part that the pyramid is of.
    pub(crate) const fn part(&self) -> Part {
        self.part
    }

    /// `frame`, which lies within the part, as a raster of `width` x `height`: means over the area of each pixel when
    /// shrinking, bilinear when enlarging.
    pub(crate) fn raster(&self, frame: Part, width: usize, height: usize) -> Raster<'_> {
        self.sampled(frame, width, height, 2.0)
    }

    /// The same from a level that has at least one pixel per pixel wanted: quicker and slightly blurred.
    pub(crate) fn rough(&self, frame: Part, width: usize, height: usize) -> Raster<'_> {
        self.sampled(frame, width, height, 1.0)
    }

    /// A raster from the coarsest level that has at least `density` pixels per pixel wanted along each axis.
    fn sampled(&self, frame: Part, width: usize, height: usize, density: f64) -> Raster<'_> {
        let step = (frame.width as f64 / width as f64).min(frame.height as f64 / height as f64);
        let fine = self.levels.iter().rev().find(|level| level.unit * density <= step);
        let level = fine.unwrap_or(&self.levels[0]);
        let axis = |side: usize, first: usize, start: usize, length: usize, out: usize, size: usize| {
            let from = level.corner[side] + (first - start) as f64 / level.unit;
            Spans::new(from, length as f64 / level.unit, out, size)
        };
        let photo = &*level.photo;
        let columns = axis(0, frame.left, self.part.left, frame.width, width, photo.width());
        let rows = axis(1, frame.top, self.part.top, frame.height, height, photo.height());
        Raster { photo, columns, rows }
    }
}

/// A frame of a photograph at some scale; nothing is computed until it is asked for.
#[derive(Clone, Debug)]
pub(crate) struct Raster<'a> {
    photo: &'a Photo,
    columns: Spans,
    rows: Spans,
}

impl Raster<'_> {
    /// Width in pixels.
    pub(crate) const fn width(&self) -> usize {
        self.columns.len()
    }

    /// Height in pixels.
    pub(crate) const fn height(&self) -> usize {
        self.rows.len()
    }

    /// The value of every pixel's colour: red, green and blue in 0..=1 as stored (not linearised).
    pub(crate) fn plane(&self, value: impl Fn([f32; 3]) -> f32 + Sync) -> Plane {
        let mut plane = Plane::new(self.width(), self.height(), 0.0);
        plane.fill_rows_with(Row::default, |space, y, out| {
            out.iter_mut().zip(self.row(y, space)).for_each(|(v, colour)| *v = value(*colour));
        });
        plane
    }

    /// The picture in 8 bits, row by row.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = vec![0; 3 * self.width() * self.height()];
        let rows = bytes.par_chunks_mut((3 * self.width()).max(1)).enumerate();
        rows.for_each_init(Row::default, |space, (y, out)| {
            for (pixel, colour) in out.chunks_exact_mut(3).zip(self.row(y, space)) {
                pixel.iter_mut().zip(colour).for_each(|(v, c)| *v = byte(*c));
            }
        });
        bytes
    }

    /// The colours of a row, in the working space given.
    fn row<'a>(&self, y: usize, space: &'a mut Row) -> &'a [[f32; 3]] {
        let range = self.columns.range();
        let Row { sums, colours } = space;
        sums.clear();
        sums.resize(range.len(), [0.0; 3]);
        for (row, weight) in self.rows.of(y) {
            match self.photo.row(row, range.clone()) {
                Samples::Eight(row) => add(sums, row, weight / f32::from(u8::MAX)),
                Samples::Sixteen(row) => add(sums, row, weight / f32::from(u16::MAX)),
            }
        }
        // In the photograph's own resolution every column is one of the photograph's.
        if self.columns.weights.len() == sums.len() && sums.len() == self.width() {
            return sums;
        }
        colours.clear();
        colours.extend((0..self.width()).map(|x| {
            let mut colour = [0.0; 3];
            for (column, weight) in self.columns.of(x) {
                colour.iter_mut().zip(sums[column - range.start]).for_each(|(c, s)| *c += weight * s);
            }
            colour
        }));
        colours
    }

    /// The mean of the three channels.
    pub(crate) fn grey(&self) -> Plane {
        self.plane(|[r, g, b]| (r + g + b) / 3.0)
    }

    /// The colour of one pixel.
    pub(crate) fn colour(&self, x: usize, y: usize) -> [f32; 3] {
        let mut colour = [0.0; 3];
        for (row, down) in self.rows.of(y) {
            for (column, across) in self.columns.of(x) {
                let weight = down * across;
                let sample: [f32; 3] = match self.photo.row(row, column..column + 1) {
                    Samples::Eight(s) => std::array::from_fn(|c| f32::from(s[c]) / f32::from(u8::MAX)),
                    Samples::Sixteen(s) => std::array::from_fn(|c| f32::from(s[c]) / f32::from(u16::MAX)),
                };
                colour.iter_mut().zip(sample).for_each(|(c, s)| *c += weight * s);
            }
        }
        colour
    }
}

impl Photo {
    /// The photograph as 8-bit colours at another size, to be drawn on.
    #[must_use]
    pub fn scaled(&self, width: u32, height: u32) -> RgbImage {
        let whole = Part { left: 0, top: 0, width: self.width(), height: self.height() };
        if (width as usize, height as usize) == (whole.width, whole.height) {
            return self.to_rgb8();
        }
        let pyramid = Pyramid::of(self, whole);
        let bytes = pyramid.raster(whole, width as usize, height as usize).bytes();
        RgbImage::from_raw(width, height, bytes).unwrap_or_default()
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
fn byte(value: f32) -> u8 {
    (value * 255.0 + 0.5).clamp(0.0, 255.0) as u8
}

fn add<T: Copy + Into<f32>>(sums: &mut [[f32; 3]], row: &[T], weight: f32) {
    let sums = sums.as_flattened_mut().iter_mut();
    sums.zip(row).for_each(|(sum, value)| *sum += weight * (*value).into());
}

/// Working space for a row.
#[derive(Default)]
struct Row {
    /// Sums over the photograph's rows, in its columns.
    sums: Vec<[f32; 3]>,
    colours: Vec<[f32; 3]>,
}

/// Which source pixels, with which weights, make each output pixel along one axis.
#[derive(Clone, Debug)]
struct Spans {
    /// For each output pixel the first source pixel, and where its weights start.
    starts: Vec<(usize, usize)>,
    weights: Vec<f32>,
    end: usize,
}

impl Spans {
    /// `out` pixels over `length` source pixels from `from`, of a row of `size`.
    fn new(from: f64, length: f64, out: usize, size: usize) -> Self {
        let step = length / out.max(1) as f64;
        let limit = (from + length).min(size as f64);
        let mut spans = Self { starts: Vec::with_capacity(out + 1), weights: Vec::new(), end: 0 };
        for place in 0..out {
            let (low, high) = if step >= 1.0 {
                (from + place as f64 * step, (from + (place + 1) as f64 * step).min(limit))
            } else {
                let centre = from + (place as f64 + 0.5) * step;
                ((centre - 0.5).clamp(from, limit - 1.0), (centre + 0.5).clamp(from + 1.0, limit))
            };
            let (first, last) = (pixel(low, size), pixel(high.ceil() - 1.0, size));
            spans.starts.push((first, spans.weights.len()));
            let overlap = |k: usize| (high.min(k as f64 + 1.0) - low.max(k as f64)).max(0.0);
            let total: f64 = (first..=last).map(overlap).sum::<f64>().max(1e-9);
            spans.weights.extend((first..=last).map(|k| narrow(overlap(k) / total)));
            spans.end = spans.end.max(last + 1);
        }
        spans.starts.push((spans.end, spans.weights.len()));
        spans
    }

    const fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// All source pixels that are used.
    fn range(&self) -> std::ops::Range<usize> {
        self.starts[0].0.min(self.end)..self.end
    }

    fn of(&self, place: usize) -> impl Iterator<Item = (usize, f32)> {
        let (first, weights) = self.starts[place];
        let weights = &self.weights[weights..self.starts[place + 1].1];
        weights.iter().enumerate().map(move |(k, w)| (first + k, *w))
    }
}
