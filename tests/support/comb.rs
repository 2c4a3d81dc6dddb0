//! What the tests of the comb room share: drawn photographs and their reading.

use combwright::{
    comb::{
        self, Comb, Photo, Truth,
        synthetic::{Arrangement, Difficulty, RenderSettings, Style, render},
    },
    tessellation::CellId,
};
use glam::DVec2;
use image::DynamicImage;
use std::error::Error;

pub(crate) type TestResult = Result<(), Box<dyn Error>>;

/// A picture of 900 x 700 pixels.
pub(crate) fn settings(pitch: u32, difficulty: f64, style: Style) -> RenderSettings {
    RenderSettings {
        width: 900,
        height: 700,
        pitch: f64::from(pitch),
        style,
        difficulty: Difficulty::dial(difficulty),
        torn_edge: false,
        seed: 7,
    }
}

/// A random comb, drawn, and its truth.
pub(crate) fn drawn(disorder: f64, settings: &RenderSettings) -> (Photo, Truth) {
    let extent = [settings.width, settings.height].map(|length| f64::from(length) / settings.pitch);
    let (picture, truth) =
        render(&Arrangement::random(extent[0], extent[1], disorder, settings.seed), settings);
    (Photo::from_picture(DynamicImage::ImageRgb8(picture)), truth)
}

/// The table of a reading.
pub(crate) fn table(comb: &Comb) -> Result<Vec<comb::CellRow>, Box<dyn Error>> {
    let mut bytes = Vec::new();
    comb::write_cells(comb, &mut bytes)?;
    Ok(comb::read_cells(bytes.as_slice())?)
}

/// The cell nearest to a point.
pub(crate) fn near(comb: &Comb, at: DVec2) -> Option<CellId> {
    let distance = |id: &CellId| comb.pattern.cells[*id].position.truncate().distance(at);
    comb.pattern.cells.ids().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Runs the program.
pub(crate) fn combwright(arguments: &[&str]) -> Result<std::process::Output, std::io::Error> {
    std::process::Command::new(env!("CARGO_BIN_EXE_combwright")).args(arguments).output()
}
