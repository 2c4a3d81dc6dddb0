//! Reading a photograph.

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
    Sixteen(Image<u16>),
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

    /// Columns of a row, as stored.
    pub(crate) fn row(&self, y: usize, columns: std::ops::Range<usize>) -> Samples<'_> {
        let start = y * self.width();
        let range = 3 * (start + columns.start)..3 * (start + columns.end);
        match &self.pixels {
            Pixels::Eight(image) => Samples::Eight(&image.as_raw()[range]),
            Pixels::Sixteen(image) => Samples::Sixteen(&image.as_raw()[range]),
        }
    }

    /// A part at half its size: the mean of each two by two pixels, rounded; an odd last row or column counts twice.
    pub(crate) fn halved(&self, part: Part) -> Self {
        let pixels = match &self.pixels {
            Pixels::Eight(image) => Pixels::Eight(halved(image, part)),
            Pixels::Sixteen(image) => Pixels::Sixteen(halved(image, part)),
        };
        Self { pixels }
    }
}

/// Red, green and blue in turn.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Samples<'a> {
    /// Of 8 bits.
    Eight(&'a [u8]),
    /// Of 16 bits.
    Sixteen(&'a [u16]),
}

type Image<T> = ImageBuffer<Rgb<T>, Vec<T>>;

fn halved<T>(image: &Image<T>, part: Part) -> Image<T>
where
    T: image::Primitive + Into<u32> + TryFrom<u32> + Send + Sync,
    Rgb<T>: image::Pixel<Subpixel = T>,
{
    let [width, height] = [part.width, part.height].map(|length| length.div_ceil(2));
    let mut data = vec![T::DEFAULT_MIN_VALUE; 3 * width * height];
    let stride = 3 * image.width() as usize;
    data.par_chunks_mut((3 * width).max(1)).enumerate().for_each(|(y, out)| {
        let source = |offset: usize| {
            let row = part.top + (2 * y + offset).min(part.height - 1);
            &image.as_raw()[row * stride + 3 * part.left..row * stride + 3 * (part.left + part.width)]
        };
        let (upper, lower) = (source(0), source(1));
        for (x, pixel) in out.chunks_exact_mut(3).enumerate() {
            let (one, two) = (6 * x, 3 * (2 * x + 1).min(part.width - 1));
            for (c, value) in pixel.iter_mut().enumerate() {
                let four = [upper[one + c], upper[two + c], lower[one + c], lower[two + c]];
                let sum: u32 = four.into_iter().map(Into::into).sum();
                *value = T::try_from((sum + 2) / 4).unwrap_or(T::DEFAULT_MAX_VALUE);
            }
        }
    });
    let [width, height] = [width, height].map(|length| u32::try_from(length).unwrap_or(u32::MAX));
    ImageBuffer::from_raw(width, height, data).unwrap_or_default()
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
