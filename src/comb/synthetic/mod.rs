//! Synthetic photographs of comb, with exact truth.
//!
//! **Enters** an arrangement of cells, random or from a [`CellPattern`], and a difficulty. **Leaves** a picture that looks
//! like comb and the [`Truth`]: what is drawn, not what was intended. The sides of a cell are those of its Voronoi cell as
//! seen in the picture.
//!
//! | step | file |
//! |---|---|
//! | where the cells are; their Voronoi polygons and sides | `arrangement.rs` |
//! | what is in them and what hides them; what can be seen | `contents.rs` |
//! | tilt and curvature of the comb before the camera | `camera.rs` |
//! | wax, bottoms, light, glints, noise | `paint.rs` |
//!
//! Not promised: light is painted, not traced; bees are blobs.
//!
//! [`CellPattern`]: crate::tessellation::CellPattern

mod arrangement;
mod camera;
mod contents;
mod paint;

use super::score::Truth;
use image::RgbImage;

pub use arrangement::{Arrangement, ArrangementError};

/// The look of the comb.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// Fresh pale wax over dark, deep cells.
    #[default]
    Wax,
    /// Old brown comb, dim.
    Brood,
    /// Pale wax over a coloured printed base that shows through the cells.
    Base,
    /// Bright cells between dark walls.
    Bright,
}

/// What makes a photograph hard to read; each from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difficulty {
    /// Standard deviation of the noise, in grey values of 0 to 1.
    pub noise: f64,
    /// Width of the blur in pixels.
    pub blur: f64,
    /// Tilt of the comb against the camera in degrees.
    pub tilt: f64,
    /// How much of the contrast between walls and cells is lost, 0 to 1.
    pub fading: f64,
    /// Unevenness of the light: how many times the darkest place is darker than the brightest, less one.
    pub shade: f64,
    /// Share of the cells with pollen, larvae or glints.
    pub contents: f64,
    /// Share of the cells that are capped.
    pub capped: f64,
    /// Bees per hundred cells.
    pub bees: f64,
}

impl Difficulty {
    /// One dial for all: 0 is a clean drawing, 0.5 a fair photograph, 1 a bad one.
    #[must_use]
    pub fn dial(value: f64) -> Self {
        Self {
            noise: 0.06 * value,
            blur: 0.4 + 1.2 * value,
            tilt: 30.0 * value,
            fading: 0.6 * value,
            shade: 2.0 * value,
            contents: 0.5 * value,
            capped: 0.04 * value,
            bees: 0.4 * value,
        }
    }
}

/// A photograph to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels from cell to cell in the middle of the picture.
    pub pitch: f64,
    /// The look.
    pub style: Style,
    /// The difficulty.
    pub difficulty: Difficulty,
    /// Whether the comb has a torn edge on one side.
    pub torn_edge: bool,
    /// Every random choice follows from it.
    pub seed: u64,
}

/// Draws a photograph of the arrangement, and says what is in it. The result depends on nothing but the arguments.
#[must_use]
pub fn render(arrangement: &Arrangement, settings: &RenderSettings) -> (RgbImage, Truth) {
    let view = camera::Camera::new(settings);
    let cells = arrangement.cells();
    let contents = contents::Contents::choose(&cells, settings, &view);
    let picture = paint::paint(&cells, &contents, settings, &view);
    (picture, contents.truth(&cells, settings, &view))
}
