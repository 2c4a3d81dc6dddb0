//! A photograph with what was read from it, small enough for a page.

use super::{comb_overlay, figure::FigureError, page::PagePhoto};
use crate::comb::{Comb, Photo};
use image::codecs::jpeg::JpegEncoder;

/// JPEG quality: digits and hairlines stay legible.
const QUALITY: u8 = 82;

/// The overlay of a reading as a picture of the page.
///
/// # Errors
/// [`FigureError`] if it cannot be drawn or encoded.
pub fn page_photo(comb: &Comb, photo: &Photo, caption: String) -> Result<PagePhoto, FigureError> {
    let overlay = image::load_from_memory(&comb_overlay::draw(comb, photo)?)?.into_rgb8();
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY).encode_image(&overlay)?;
    Ok(PagePhoto { caption, jpeg, size: [overlay.width(), overlay.height()] })
}
