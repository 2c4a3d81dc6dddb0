//! Photographs' patterns onto the enclosure's wall: recipe and camera from the command line.

use super::CliError;
use crate::{
    compare::Sample,
    enclosure::{Design, Recipe},
    projection::{Camera, Caster, Extent, Mark, PoseError, map_pattern, pose},
    surface::WallSide,
};
use anyhow::{Context, anyhow};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// A view that needs no marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum ViewName {
    /// Straight down from far above, the middle of the photograph over the middle of the enclosure
    Top,
}

/// The wall that the comb stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum WallName {
    /// The front of the inner shell
    Inner,
    /// The front of the outer shell
    Outer,
}

/// What says where the comb's cells lie.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Geometry of the comb")]
pub(super) struct WallArguments {
    /// The recipe of the enclosure that the comb stands in: with a camera, cells are mapped onto its wall
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    /// Marked points, one table for each pattern of comb, with the columns x_px, y_px, x_mm, y_mm, z_mm: at least four points of
    /// the shell as it stands on the printer's bed, its corner at the origin
    #[arg(long, num_args = 1.., value_name = "CSV", requires = "recipe", conflicts_with = "view")]
    marks: Vec<PathBuf>,
    /// The focal length in pixels, if it is known; else the marks tell it
    #[arg(long, value_name = "PIXELS", requires = "marks")]
    focal: Option<f64>,
    /// A view that needs no marks
    #[arg(long, value_enum, requires_all = ["recipe", "mm_per_px"])]
    view: Option<ViewName>,
    /// The size of a pixel, for --view
    #[arg(long, value_name = "MM", requires = "view")]
    mm_per_px: Option<f64>,
    /// The wall that the comb stands on
    #[arg(long, value_enum, default_value = "inner", requires = "recipe")]
    wall: WallName,
}

/// How a photograph was mapped: for `run.json`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct MappedPhoto {
    name: String,
    camera: Camera,
    error_px: Option<f64>,
    mapped: usize,
    missed: usize,
}

/// The columns of a photograph's `summary.json` that are needed.
#[derive(Deserialize)]
struct PhotoSize {
    width_px: f64,
    height_px: f64,
}

/// Maps the comb's patterns, if a recipe is given. `paths` are the files of the patterns.
pub(super) fn map_all(
    arguments: &WallArguments,
    samples: &mut [Sample],
    paths: &[PathBuf],
) -> Result<Vec<MappedPhoto>, CliError> {
    let Some(recipe) = &arguments.recipe else { return Ok(Vec::new()) };
    if arguments.view.is_none() && arguments.marks.len() != samples.len() {
        return Err(CliError::mistake(anyhow!(
            "{} patterns of comb and {} tables of marks are given: each pattern needs its own --marks, in the same order, or \
             --view top",
            samples.len(),
            arguments.marks.len()
        )));
    }
    let wall = OnWall::new(recipe, arguments.wall)?;
    let mut mapped = Vec::new();
    for (index, (sample, path)) in samples.iter_mut().zip(paths).enumerate() {
        let size = photo_size(path)?;
        let (camera, error_px) = match arguments.marks.get(index) {
            Some(marks) => from_marks(marks, size, arguments.focal)?,
            None => (wall.seen_from_above(arguments.mm_per_px, size)?, None),
        };
        let found = map_pattern(&sample.pattern, &wall.moved(&camera), &wall.caster, "mm")
            .with_context(|| path.display().to_string())
            .map_err(CliError::mistake)?;
        mapped.push(MappedPhoto {
            name: sample.name.clone(),
            camera,
            error_px,
            mapped: found.pattern.cells.len(),
            missed: found.missed,
        });
        sample.pattern = found.pattern;
    }
    Ok(mapped)
}

/// The wall of a recipe in mm, and where the printed shell's frame lies in that of the surface.
struct OnWall {
    caster: Caster,
    /// From the printed shell's frame to the surface's.
    moved: DVec3,
    extent: Extent,
}

impl OnWall {
    fn new(path: &Path, wall: WallName) -> Result<Self, CliError> {
        let shown = path.display().to_string();
        let text = fs::read_to_string(path)
            .with_context(|| format!("cannot read the recipe {shown}"))
            .map_err(CliError::mistake)?;
        let recipe = Recipe::parse(&text).with_context(|| shown.clone()).map_err(CliError::mistake)?;
        let design = Design::new(&recipe).with_context(|| shown.clone()).map_err(CliError::mistake)?;
        let period = design.period.0;
        let gap = super::foam_settings::space_of(&design).gap().map_err(CliError::mistake)?;
        let side = if wall == WallName::Inner { WallSide::Lower } else { WallSide::Upper };
        let extent = Extent { low: period * design.region.low(), high: period * design.region.high() };
        let depth = if recipe.base.include { recipe.base.groove } else { 0.0 };
        let caster = Caster::new(gap.wall(side).clone(), side, extent);
        Ok(Self { caster, moved: extent.low - depth * DVec3::Z, extent })
    }

    /// A camera of the printed shell's frame in the surface's.
    fn moved(&self, camera: &Camera) -> Camera {
        Camera { centre: camera.centre + self.moved, ..*camera }
    }

    fn seen_from_above(&self, mm_per_px: Option<f64>, size: DVec2) -> Result<Camera, CliError> {
        let scale = mm_per_px.filter(|scale| *scale > 0.0 && scale.is_finite()).ok_or_else(|| {
            CliError::mistake(anyhow!("--mm-per-px must be a positive number, as in --mm-per-px 0.06"))
        })?;
        let middle = 0.5 * (self.extent.low + self.extent.high) - self.moved;
        Ok(Camera::top(middle, 1.0 / scale, size))
    }
}

/// The size of the photograph, which `combwright comb` has written beside the pattern.
fn photo_size(pattern: &Path) -> Result<DVec2, CliError> {
    let folder = if pattern.is_dir() { pattern } else { pattern.parent().unwrap_or(pattern) };
    let file = folder.join("summary.json");
    let missing = || {
        format!(
            "{} is needed for the photograph's width and height; combwright comb writes it beside pattern.json",
            file.display()
        )
    };
    let text = fs::read_to_string(&file).with_context(missing).map_err(CliError::mistake)?;
    let size: PhotoSize = serde_json::from_str(&text).with_context(missing).map_err(CliError::mistake)?;
    Ok(DVec2::new(size.width_px, size.height_px))
}

fn from_marks(path: &Path, size: DVec2, focal: Option<f64>) -> Result<(Camera, Option<f64>), CliError> {
    let shown = path.display().to_string();
    let mut reader = csv::Reader::from_path(path)
        .with_context(|| format!("cannot read the marks {shown}"))
        .map_err(CliError::mistake)?;
    let marks: Vec<Mark> = reader
        .deserialize()
        .collect::<Result<Vec<Mark>, csv::Error>>()
        .with_context(|| format!("{shown}: a table of marks has the columns x_px,y_px,x_mm,y_mm,z_mm"))
        .map_err(CliError::mistake)?;
    let named = |error: PoseError| CliError::mistake(anyhow!("{shown}: {error}"));
    let found = pose(&marks, size, focal).map_err(named)?;
    if let Some(rival) = found.rival_error_px {
        eprintln!(
            "note: {shown}: another pose fits nearly as well ({rival:.1} px against {:.1} px); mark one more point",
            found.error_px
        );
    }
    Ok((found.camera, Some(found.error_px)))
}
