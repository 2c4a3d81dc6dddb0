//! `combwright comb render`: a synthetic photograph with its exact truth.

use super::CliError;
use crate::{
    comb::synthetic::{self, Arrangement, Difficulty, RenderSettings, Style},
    report::{figure::png, folder::OutputFolder},
    tessellation::CellPattern,
};
use anyhow::{Context, anyhow};
use std::{fs, path::PathBuf};

/// The largest picture that is drawn, in pixels.
const MAX_PIXELS: f64 = 100.0e6;

/// What was typed after `comb render`.
#[derive(Debug, clap::Args)]
pub(super) struct RenderArguments {
    /// Draw the cells of this pattern.json instead of a random comb
    #[arg(long, value_name = "FILE")]
    pattern: Option<PathBuf>,
    /// The look of the comb
    #[arg(long, value_enum, default_value_t = StyleName::Wax)]
    style: StyleName,
    /// About how many cells a random comb has in the picture
    #[arg(long, default_value_t = 400)]
    cells: u32,
    /// Pixels from cell to cell
    #[arg(long, default_value_t = 40.0)]
    pitch: f64,
    /// How disordered a random comb is, 0 to 1
    #[arg(long, default_value_t = 0.5)]
    disorder: f64,
    /// One dial for all that makes it hard to read: 0 clean, 0.5 fair, 1 bad
    #[arg(long, default_value_t = 0.5)]
    difficulty: f64,
    /// Standard deviation of the noise (grey values of 0 to 1) instead of the dial's
    #[arg(long)]
    noise: Option<f64>,
    /// Tilt in degrees instead of the dial's
    #[arg(long)]
    tilt: Option<f64>,
    /// Share of the contrast that is lost, 0 to 1, instead of the dial's
    #[arg(long)]
    fading: Option<f64>,
    /// Tear off one side of the comb
    #[arg(long)]
    torn: bool,
    /// Every random choice follows from it
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The folder for photo.png and truth.csv
    #[arg(short, long, value_name = "FOLDER", default_value = "synth")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum StyleName {
    /// Pale wax, dark cells
    Wax,
    /// Old brown comb
    Brood,
    /// Pale wax over a blue base
    Base,
    /// Bright cells, dark walls
    Bright,
}

pub(super) fn run(arguments: &RenderArguments) -> Result<(), CliError> {
    validate(arguments)?;
    let side = (f64::from(arguments.cells) * 0.75_f64.sqrt()).sqrt();
    let (arrangement, extent) = match &arguments.pattern {
        Some(path) => {
            let arrangement = from_file(path)?;
            let extent = arrangement.extent();
            (arrangement, [extent.x, extent.y])
        }
        None => {
            let size = [side * 1.15, side / 1.15];
            (Arrangement::random(size[0], size[1], arguments.disorder, arguments.seed), size)
        }
    };
    let [width, height] = extent.map(|e| (e * arguments.pitch).max(8.0));
    if width * height > MAX_PIXELS {
        return Err(CliError::mistake(anyhow!(
            "the picture would have {width:.0} x {height:.0} px; take fewer cells or a smaller --pitch"
        )));
    }
    let mut difficulty = Difficulty::dial(arguments.difficulty);
    difficulty.noise = arguments.noise.unwrap_or(difficulty.noise);
    difficulty.tilt = arguments.tilt.unwrap_or(difficulty.tilt);
    difficulty.fading = arguments.fading.unwrap_or(difficulty.fading);
    let settings = RenderSettings {
        width: whole(width),
        height: whole(height),
        pitch: arguments.pitch,
        style: arguments.style.into(),
        difficulty,
        torn_edge: arguments.torn,
        seed: arguments.seed,
    };
    let (picture, truth) = synthetic::render(&arrangement, &settings);
    let mut folder = OutputFolder::begin(&arguments.output)?;
    folder.write_bytes("photo.png", &png(&picture)?)?;
    let mut table = Vec::new();
    truth.write(&mut table).map_err(CliError::failure)?;
    folder.write_bytes("truth.csv", &table)?;
    folder.write_json(
        "run.json",
        &serde_json::json!({
            "schema": "combwright.run/1",
            "version": env!("CARGO_PKG_VERSION"),
            "settings": format!("{settings:?}"),
            "disorder": arguments.disorder,
            "pattern": arguments.pattern,
        }),
    )?;
    folder.commit()?;
    let complete = truth.cells.iter().filter(|c| c.complete == 1).count();
    println!(
        "{} x {} px, {} cells, {complete} of them complete: {}",
        settings.width,
        settings.height,
        truth.cells.len(),
        arguments.output.join("photo.png").display()
    );
    Ok(())
}

fn validate(arguments: &RenderArguments) -> Result<(), CliError> {
    let ranges = [
        ("--pitch", Some(arguments.pitch), 4.0, 400.0),
        ("--disorder", Some(arguments.disorder), 0.0, 1.0),
        ("--difficulty", Some(arguments.difficulty), 0.0, 1.0),
        ("--noise", arguments.noise, 0.0, 1.0),
        ("--tilt", arguments.tilt, 0.0, 60.0),
        ("--fading", arguments.fading, 0.0, 1.0),
        ("--cells", Some(f64::from(arguments.cells)), 7.0, 1.0e6),
    ];
    let wrong: Vec<String> = ranges
        .iter()
        .filter_map(|(name, value, low, high)| {
            value
                .filter(|v| !(*low..=*high).contains(v))
                .map(|v| format!("{name} {v} is not between {low} and {high}"))
        })
        .collect();
    if wrong.is_empty() { Ok(()) } else { Err(CliError::mistake(anyhow!(wrong.join("; ")))) }
}

fn from_file(path: &PathBuf) -> Result<Arrangement, CliError> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()));
    let pattern: CellPattern = serde_json::from_str(&text.map_err(CliError::mistake)?)
        .with_context(|| format!("{} is no pattern", path.display()))
        .map_err(CliError::mistake)?;
    if let Some(defect) = pattern.defects().first() {
        return Err(CliError::mistake(anyhow!("{}: {defect}", path.display())));
    }
    Arrangement::from_pattern(&pattern).map_err(CliError::mistake)
}

impl From<StyleName> for Style {
    fn from(name: StyleName) -> Self {
        match name {
            StyleName::Wax => Self::Wax,
            StyleName::Brood => Self::Brood,
            StyleName::Base => Self::Base,
            StyleName::Bright => Self::Bright,
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked against the largest picture"
)]
fn whole(length: f64) -> u32 {
    length.round() as u32
}
