//! Reading a photograph and bringing it to another scale.

use super::plane::{Plane, narrow, pixel};
use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageReader, Limits, Rgb, RgbImage};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// The largest photograph that is read, in pixels.
pub const MAX_PIXELS: u64 = 100_000_000;

/// Why a photograph, or a file that goes with it, cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PhotoError {
    /// The file cannot be opened.
    #[error("cannot open {path}: {source}; check the path and the permissions")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not a picture of a known format, or is damaged.
    #[error("cannot read {path} as a picture: {source}; JPEG, PNG, TIFF and WebP of 8 or 16 bits are read")]
    Decode {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        source: image::ImageError,
    },
    /// The picture is larger than is read.
    #[error("{path} is {width} x {height} px, more than the {} million that are read; scale it down", MAX_PIXELS / 1_000_000)]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
}

/// A photograph in memory, upright as its EXIF orientation says.
#[derive(Clone, Debug)]
pub struct Photo {
    pixels: Pixels,
}

#[derive(Clone, Debug)]
enum Pixels {
    Eight(RgbImage),
    Sixteen(ImageBuffer<Rgb<u16>, Vec<u16>>),
}

/// Red, green and blue in 0..=1 as stored (not linearised), at some scale of the photograph.
#[derive(Clone, Debug)]
pub(crate) struct Colours {
    /// The three channels.
    pub(crate) channels: [Plane; 3],
}

impl Photo {
    /// Reads a photograph: JPEG, PNG, TIFF or WebP, 8 or 16 bits, grey or colour, turned upright by its EXIF orientation.
    ///
    /// # Errors
    /// The file cannot be opened, is not such a picture, is cut short, or is larger than [`MAX_PIXELS`].
    pub fn open(path: &Path) -> Result<Self, PhotoError> {
        let open = |source| PhotoError::Open { path: path.to_owned(), source };
        let decode = |source| PhotoError::Decode { path: path.to_owned(), source };
        let mut reader = ImageReader::open(path).map_err(open)?.with_guessed_format().map_err(open)?;
        let mut limits = Limits::default();
        limits.max_alloc = Some(MAX_PIXELS * 16);
        reader.limits(limits);
        let mut decoder = reader.into_decoder().map_err(decode)?;
        let (width, height) = decoder.dimensions();
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(PhotoError::TooLarge { path: path.to_owned(), width, height });
        }
        let orientation = decoder.orientation().map_err(decode)?;
        let mut picture = DynamicImage::from_decoder(decoder).map_err(decode)?;
        picture.apply_orientation(orientation);
        Ok(Self::from_picture(picture))
    }

    /// A photograph from a picture in memory; transparency is dropped.
    #[must_use]
    pub fn from_picture(picture: DynamicImage) -> Self {
        let pixels = match picture {
            DynamicImage::ImageRgb8(_)
            | DynamicImage::ImageRgba8(_)
            | DynamicImage::ImageLuma8(_)
            | DynamicImage::ImageLumaA8(_) => Pixels::Eight(picture.into_rgb8()),
            _ => Pixels::Sixteen(picture.into_rgb16()),
        };
        Self { pixels }
    }

    /// Width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.size().0
    }

    /// Height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.size().1
    }

    fn size(&self) -> (usize, usize) {
        let (width, height) = match &self.pixels {
            Pixels::Eight(image) => image.dimensions(),
            Pixels::Sixteen(image) => image.dimensions(),
        };
        (width as usize, height as usize)
    }

    /// The photograph as 8-bit colours, to be drawn on.
    #[must_use]
    pub fn to_rgb8(&self) -> RgbImage {
        match &self.pixels {
            Pixels::Eight(image) => image.clone(),
            Pixels::Sixteen(image) => DynamicImage::ImageRgb16(image.clone()).into_rgb8(),
        }
    }

    /// The part that starts at (`left`, `top`), of `width` x `height` pixels of the photograph, as a raster of
    /// `out_width` x `out_height`: means over the area of each pixel when shrinking, bilinear when enlarging.
    #[must_use]
    pub(crate) fn resampled(&self, part: Part, out_width: usize, out_height: usize) -> Colours {
        let mut interleaved = vec![[0.0_f32; 3]; out_width * out_height];
        let spans = Spans::new(part.left, part.width, out_width, self.width());
        let rows = Spans::new(part.top, part.height, out_height, self.height());
        interleaved.par_chunks_mut(out_width.max(1)).enumerate().for_each_init(
            || vec![[0.0_f32; 3]; self.width()],
            |sums, (y, out)| {
                sums.fill([0.0; 3]);
                for (source, weight) in rows.of(y) {
                    self.add_row(source, weight, &mut sums[part.left..part.left + part.width], part.left);
                }
                for (x, pixel) in out.iter_mut().enumerate() {
                    for (source, weight) in spans.of(x) {
                        for (p, s) in pixel.iter_mut().zip(sums[source]) {
                            *p += weight * s;
                        }
                    }
                }
            },
        );
        let channel =
            |c: usize| Plane::from_fn(out_width, out_height, |x, y| interleaved[y * out_width + x][c]);
        Colours { channels: [channel(0), channel(1), channel(2)] }
    }

    fn add_row(&self, y: usize, weight: f32, sums: &mut [[f32; 3]], left: usize) {
        let range = (y * self.width() + left) * 3..(y * self.width() + left + sums.len()) * 3;
        match &self.pixels {
            Pixels::Eight(image) => add(sums, &image.as_raw()[range], weight / f32::from(u8::MAX)),
            Pixels::Sixteen(image) => add(sums, &image.as_raw()[range], weight / f32::from(u16::MAX)),
        }
    }
}

/// A rectangle of a photograph, in its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

fn add<T: Copy + Into<f32>>(sums: &mut [[f32; 3]], row: &[T], weight: f32) {
    for (sum, source) in sums.iter_mut().zip(row.chunks_exact(3)) {
        for (s, v) in sum.iter_mut().zip(source) {
            *s += weight * (*v).into();
        }
    }
}

/// Which source pixels, with which weights, make each output pixel along one axis.
struct Spans {
    first: usize,
    step: f64,
    end: usize,
}

impl Spans {
    fn new(first: usize, length: usize, out: usize, size: usize) -> Self {
        Self { first, step: length as f64 / out.max(1) as f64, end: (first + length).min(size) }
    }

    fn of(&self, out: usize) -> impl Iterator<Item = (usize, f32)> + use<> {
        let (low, high) = if self.step >= 1.0 {
            (out as f64 * self.step, (out + 1) as f64 * self.step)
        } else {
            let centre = (out as f64 + 0.5) * self.step;
            let limit = (self.end - self.first) as f64;
            ((centre - 0.5).clamp(0.0, limit - 1.0), (centre + 0.5).clamp(1.0, limit))
        };
        let (first, end, total) = (self.first, self.end, high - low);
        let last = pixel(high.ceil() - 1.0, end - first);
        (pixel(low, end - first)..=last).filter_map(move |k| {
            let overlap = high.min(k as f64 + 1.0) - low.max(k as f64);
            (overlap > 0.0).then(|| (first + k, narrow(overlap / total)))
        })
    }
}
