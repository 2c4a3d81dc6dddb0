//! Reading a photograph.

use image::{DynamicImage, ImageBuffer, ImageDecoder, ImageFormat, ImageReader, Limits, Rgb, RgbImage};
use rayon::prelude::*;
use std::{
    fs,
    path::{Path, PathBuf},
};

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
    /// The file ends before the picture does.
    #[error("{path} is cut short: the picture's end is missing; copy the file again")]
    CutShort {
        /// The file.
        path: PathBuf,
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
        // The decoder fills what is missing of a JPEG with grey, and says nothing.
        if reader.format() == Some(ImageFormat::Jpeg) && !jpeg_ends(&fs::read(path).map_err(open)?) {
            return Err(PhotoError::CutShort { path: path.to_owned() });
        }
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

/// Whether a JPEG holds the end of its picture. Segments, which may hold smaller pictures, are skipped up to the first scan, after
/// which a marker of the end can be nothing else (ITU-T T.81, annex B).
fn jpeg_ends(bytes: &[u8]) -> bool {
    const SCAN: u8 = 0xda;
    const END: [u8; 2] = [0xff, 0xd9];
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        // Fill bytes may stand before a marker.
        if marker == 0xff {
            at += 1;
            continue;
        }
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
        if marker == SCAN {
            return bytes.get(at..).is_some_and(|scan| scan.windows(2).any(|pair| pair == END));
        }
    }
    // What breaks off before the first scan is refused by the decoder.
    true
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;

    #[test]
    fn a_jpeg_that_is_cut_short_is_refused() -> Result<(), Box<dyn Error>> {
        let home = tempfile::tempdir()?;
        let path = home.path().join("photo.jpg");
        let picture =
            RgbImage::from_fn(
                160,
                120,
                |x, y| Rgb([x, y, x ^ y].map(|v| u8::try_from(v % 256).unwrap_or(0))),
            );
        picture.save(&path)?;
        let whole = fs::read(&path)?;
        // A smaller picture in a segment, as cameras put it there, ends before the picture does.
        let thumbnail = [&[0xff, 0xe1, 0, 8, 0xff, 0xd8, 0xff, 0xd9, 0, 0][..], &whole[2..]].concat();
        let with_thumbnail = [&whole[..2], &thumbnail].concat();
        for bytes in [whole, with_thumbnail] {
            fs::write(&path, &bytes)?;
            assert_eq!(Photo::open(&path)?.width(), 160);
            fs::write(&path, &bytes[..bytes.len() * 2 / 3])?;
            assert!(matches!(Photo::open(&path), Err(PhotoError::CutShort { .. })));
        }
        Ok(())
    }
}
