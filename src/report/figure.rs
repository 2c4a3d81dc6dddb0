//! A figure in SVG, and the same rasterised.
//!
//! Charts come from `plotters`' SVG backend, pictures are embedded; `resvg` turns both into PNG with a font of our own, so
//! that a figure looks the same on every machine.

use crate::report::{folder::OutputError, folder::OutputFolder, palette::Colour};
use image::{ImageEncoder, RgbImage};
use resvg::{tiny_skia, usvg};
use std::{
    fmt::Write as _,
    io::{self, Write as _},
    sync::{Arc, LazyLock},
};

/// The font family that every figure names; readers without it fall back to their sans-serif.
pub const FONT: &str = "Ubuntu, sans-serif";

static FONTS: LazyLock<Arc<usvg::fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
    fonts.load_font_data(epaint_default_fonts::HACK_REGULAR.to_vec());
    let family = fonts.faces().next().and_then(|face| face.families.first().map(|f| f.0.clone()));
    fonts.set_sans_serif_family(family.unwrap_or_default());
    Arc::new(fonts)
});

/// A drawing that could not be rasterised.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The SVG text is not well-formed.
    #[error("the figure is no valid SVG: {0}")]
    Svg(#[from] usvg::Error),
    /// The size is zero or too large for a picture.
    #[error("a picture of {width} × {height} pixels cannot be made")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The PNG encoder failed.
    #[error("the picture could not be encoded: {0}")]
    Encode(#[from] image::ImageError),
    /// The file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// A drawing in SVG.
#[derive(Clone, Debug)]
pub struct Figure {
    svg: String,
}

impl Figure {
    /// From a whole SVG document, such as `plotters` makes.
    #[must_use]
    pub fn from_svg(svg: String) -> Self {
        Self { svg }
    }

    /// The SVG document.
    #[must_use]
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// The figure as a picture, `scale` pixels to one unit of the drawing.
    ///
    /// # Errors
    /// [`FigureError`] if the SVG is not valid or the size is none.
    pub fn raster(&self, scale: f32) -> Result<RgbImage, FigureError> {
        let options =
            usvg::Options { fontdb: FONTS.clone(), font_family: FONT.to_owned(), ..usvg::Options::default() };
        let tree = usvg::Tree::from_str(&self.svg, &options)?;
        let size = tree.size().to_int_size().scale_by(scale);
        let (width, height) = size.map_or((0, 0), |s| (s.width(), s.height()));
        let mut pixmap = tiny_skia::Pixmap::new(width, height).ok_or(FigureError::Size { width, height })?;
        pixmap.fill(tiny_skia::Color::WHITE);
        resvg::render(&tree, tiny_skia::Transform::from_scale(scale, scale), &mut pixmap.as_mut());
        // White lies behind everything, so the alpha channel says nothing.
        let rgb = pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        RgbImage::from_raw(width, height, rgb).ok_or(FigureError::Size { width, height })
    }

    /// Writes `name.svg` and `name.png` into a folder.
    ///
    /// # Errors
    /// [`FigureError`] if the picture cannot be made or written.
    pub fn write(&self, folder: &mut OutputFolder, name: &str, scale: f32) -> Result<(), FigureError> {
        folder.write_bytes(format!("{name}.svg"), self.svg.as_bytes())?;
        self.write_png(folder, name, scale)
    }

    /// Writes `name.png` alone, for figures that are mostly a picture.
    ///
    /// # Errors
    /// [`FigureError`] if the picture cannot be made or written.
    pub fn write_png(&self, folder: &mut OutputFolder, name: &str, scale: f32) -> Result<(), FigureError> {
        let bytes = png(&self.raster(scale)?)?;
        Ok(folder.write_bytes(format!("{name}.png"), &bytes)?)
    }
}

/// A picture as a PNG file.
///
/// # Errors
/// [`FigureError::Encode`] if the encoder fails.
pub fn png(picture: &RgbImage) -> Result<Vec<u8>, FigureError> {
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes).write_image(
        picture.as_raw(),
        picture.width(),
        picture.height(),
        image::ExtendedColorType::Rgb8,
    )?;
    Ok(bytes)
}

/// An SVG document under construction. Lengths are in the drawing's units, y points down.
#[derive(Debug)]
pub struct Drawing {
    body: String,
    width: f64,
    height: f64,
}

/// Where a text stands relative to its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The text begins there.
    Start,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    End,
}

impl Drawing {
    /// An empty white sheet.
    #[must_use]
    pub fn new(width: f64, height: f64) -> Self {
        let mut drawing = Self { body: String::new(), width, height };
        drawing.rectangle([0.0, 0.0], [width, height], Colour([255; 3]));
        drawing
    }

    /// A filled rectangle from its upper left corner.
    pub fn rectangle(&mut self, at: [f64; 2], size: [f64; 2], fill: Colour) {
        self.push(format_args!(
            r#"<rect x="{:.3}" y="{:.3}" width="{:.3}" height="{:.3}" fill="{}"/>"#,
            at[0],
            at[1],
            size[0],
            size[1],
            fill.hex()
        ));
    }

    /// A line of text.
    pub fn text(&mut self, at: [f64; 2], size: f64, anchor: Anchor, colour: Colour, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        self.push(format_args!(
            r#"<text x="{:.2}" y="{:.2}" font-family="{FONT}" font-size="{size}" text-anchor="{anchor}" fill="{}">{text}</text>"#,
            at[0],
            at[1],
            colour.hex()
        ));
    }

    /// A line through points, not filled.
    pub fn line(&mut self, points: &[[f64; 2]], colour: Colour, width: f64) {
        let path = path_of(points);
        self.push(format_args!(
            r#"<path d="{path}" fill="none" stroke="{}" stroke-width="{width}" stroke-linejoin="round" stroke-linecap="round"/>"#,
            colour.hex()
        ));
    }

    /// A filled area bounded by closed rings (even-odd: a ring within a ring is a hole), with a hairline of its own colour
    /// where `seam` is set, so that neighbours leave no gap.
    pub fn area(&mut self, rings: &[Vec<[f64; 2]>], fill: Colour, seam: bool) {
        let path: String = rings.iter().map(|ring| path_of(ring) + "Z").collect();
        let stroke =
            if seam { format!(r#" stroke="{}" stroke-width="0.3""#, fill.hex()) } else { String::new() };
        self.push(format_args!(r#"<path d="{path}" fill="{}" fill-rule="evenodd"{stroke}/>"#, fill.hex()));
    }

    /// A picture, scaled into the rectangle.
    ///
    /// # Errors
    /// [`FigureError::Encode`] if it cannot be encoded.
    pub fn picture(&mut self, at: [f64; 2], size: [f64; 2], picture: &RgbImage) -> Result<(), FigureError> {
        let data = base64(&png(picture)?);
        self.push(format_args!(
            r#"<image x="{}" y="{}" width="{}" height="{}" href="data:image/png;base64,{data}"/>"#,
            at[0], at[1], size[0], size[1]
        ));
        Ok(())
    }

    /// A vertical colour bar from `low` to `high` with its title.
    pub fn colour_bar(
        &mut self,
        at: [f64; 2],
        height: f64,
        range: [f64; 2],
        title: &str,
        colour: impl Fn(f64) -> Colour,
    ) {
        const STEPS: u32 = 64;
        let step = height / f64::from(STEPS);
        for i in 0..STEPS {
            let t = (f64::from(i) + 0.5) / f64::from(STEPS);
            let y = at[1] + height - f64::from(i + 1) * step;
            self.rectangle([at[0], y], [16.0, step + 0.4], colour(t));
        }
        for tick in 0..=4 {
            let t = f64::from(tick) / 4.0;
            let y = at[1] + height * (1.0 - t);
            self.line(&[[at[0] + 16.0, y], [at[0] + 20.0, y]], crate::report::palette::INK, 1.0);
            let value = range[0] + t * (range[1] - range[0]);
            let label = format!("{value:.2}");
            self.text([at[0] + 24.0, y + 4.0], 12.0, Anchor::Start, crate::report::palette::INK, &label);
        }
        self.text([at[0], at[1] - 10.0], 13.0, Anchor::Start, crate::report::palette::INK, title);
    }

    /// The finished figure.
    #[must_use]
    pub fn finish(self) -> Figure {
        let (w, h) = (self.width, self.height);
        Figure::from_svg(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\">\n{}</svg>\n",
            self.body
        ))
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = writeln!(self.body, "{element}");
    }
}

fn path_of(points: &[[f64; 2]]) -> String {
    let mut path = String::new();
    for (i, [x, y]) in points.iter().enumerate() {
        let _ = write!(path, "{}{x:.3} {y:.3}", if i == 0 { 'M' } else { 'L' });
    }
    path
}

/// Base 64, as data addresses need it.
fn base64(bytes: &[u8]) -> String {
    let mut encoder = base64::write::EncoderStringWriter::new(&base64::engine::general_purpose::STANDARD);
    // Writing to a string does not fail.
    let _: io::Result<()> = encoder.write_all(bytes);
    encoder.into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::palette::{BLUE, INK};

    #[test]
    fn text_and_areas_leave_ink_on_the_sheet() -> Result<(), FigureError> {
        let mut drawing = Drawing::new(120.0, 40.0);
        drawing.text([4.0, 20.0], 14.0, Anchor::Start, INK, "gap 32 mm < Φ & δ");
        drawing.area(&[vec![[90.0, 5.0], [115.0, 5.0], [115.0, 35.0]]], BLUE, false);
        let picture = drawing.finish().raster(2.0)?;
        assert_eq!(picture.dimensions(), (240, 80));
        let dark = picture.enumerate_pixels().filter(|(x, _, p)| *x < 170 && p.0[0] < 128).count();
        assert!(dark > 100, "the font is missing: {dark} dark pixels");
        assert!(picture.pixels().any(|p| p.0 == BLUE.0));
        Ok(())
    }
}
