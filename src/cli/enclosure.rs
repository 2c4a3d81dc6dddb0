//! `combwright enclosure`: from a recipe to files that print.

use super::{CliError, progress};
use crate::{
    enclosure::{BuildError, DEFAULT_RECIPE, Design, Enclosure, Fault, GapShape, Inspection, Part, Recipe},
    mesh,
    report::{
        enclosure as pages,
        enclosure_drawing::base_figure,
        enclosure_section::section_figure,
        folder::{OutputFolder, write_whole},
    },
    surface::NamedGap,
};
use anyhow::anyhow;
use clap::ValueEnum;
use glam::DVec3;
use serde_json::json;
use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

/// Two shells with a gap for bees between them, and a base that holds them, as parts that print.
///
/// Without a recipe the embedded default is built: L = 200 mm, half a cell of the P-surface, parallel walls, a gap of 32 mm
/// (two cells of 11.5 mm and 9 mm for the bees). Options override the recipe's lines.
#[derive(Debug, clap::Args)]
pub(super) struct EnclosureArguments {
    /// A recipe (TOML); see --init
    recipe: Option<PathBuf>,
    /// The folder for the results
    #[arg(short, long, value_name = "FOLDER", default_value = "enclosure-out")]
    output: PathBuf,
    /// Write a commented recipe to edit, and do nothing else
    #[arg(long, value_name = "FILE", conflicts_with_all = ["recipe", "period", "gap"])]
    init: Option<PathBuf>,
    /// Period L of the surface, in mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    period: Option<f64>,
    /// Gap between the shells, in mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "delta")]
    gap: Option<f64>,
    /// Which gap is meant, where it varies over the surface
    #[arg(long, value_name = "WHICH")]
    gap_is: Option<GapIs>,
    /// Walls at true offsets (the same gap everywhere) or at levels of the surface's function
    #[arg(long)]
    shape: Option<Shape>,
    /// Walls at Φ = ±δ, instead of a gap in mm
    #[arg(long, value_name = "δ", allow_negative_numbers = true)]
    delta: Option<f64>,
    /// Thickness of the shells, in mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    wall: Option<f64>,
    /// Grid cells per period
    #[arg(long, value_name = "N")]
    cells: Option<u32>,
    /// Which part of the surface
    #[arg(long, value_enum)]
    part: Option<PartName>,
    /// Cells along x, y and z, in steps of 0.5 (implies --part block)
    #[arg(long, value_name = "NX,NY,NZ", value_parser = triple)]
    block: Option<Triple>,
    /// The printer's bed, in mm
    #[arg(long, value_name = "X,Y,Z", value_parser = triple)]
    bed: Option<Triple>,
    /// Shells alone, without a base
    #[arg(long)]
    no_base: bool,
    /// Further files of each part
    #[arg(long, value_enum, value_delimiter = ',', value_name = "FORMAT,…")]
    format: Vec<Format>,
}

/// Three numbers with commas between them.
#[derive(Clone, Copy, Debug)]
struct Triple([f64; 3]);

fn triple(text: &str) -> Result<Triple, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let numbers = numbers.map_err(|error| error.to_string())?;
    <[f64; 3]>::try_from(numbers)
        .map(Triple)
        .map_err(|given| format!("three numbers are needed, as in 1,1,0.5; these are {}", given.len()))
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GapIs {
    Min,
    Mean,
    Max,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Shape {
    Parallel,
    LevelSet,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PartName {
    Half,
    Whole,
    Octant,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Ply,
    Obj,
    Glb,
}

/// Runs the command.
pub(super) fn run(arguments: &EnclosureArguments) -> Result<(), CliError> {
    if let Some(path) = &arguments.init {
        return init(path);
    }
    let (mut recipe, source) = read_recipe(arguments.recipe.as_deref())?;
    override_recipe(&mut recipe, arguments);
    let told = |fault: &Fault| tell(fault, &source);
    let design = Design::new(&recipe).map_err(|faults| {
        CliError::mistake(anyhow!(faults.0.iter().map(told).collect::<Vec<_>>().join("\n       ")))
    })?;
    let mut folder = OutputFolder::begin(&arguments.output)?;
    super::interrupt::remove_on_interrupt(folder.staging());
    let mut stages = progress::Stages::new(5);
    stages.begin("meshing");
    let enclosure = Enclosure::build(design).map_err(|error| match error {
        BuildError::Recipe(fault) => CliError::mistake(anyhow!(told(&fault))),
        other => CliError::failure(other),
    })?;
    stages.begin("inspecting");
    let (inspection, samples) = Inspection::new(&enclosure);
    stages.begin("writing parts");
    write_parts(&mut folder, &enclosure, &arguments.format)?;
    stages.begin("drawing");
    pages::preview(&enclosure, &inspection)?.write_png(&mut folder, "preview", 1.0)?;
    section_figure(&enclosure, &inspection).write_png(&mut folder, "section", 1.0)?;
    if let Some(plate) = &enclosure.plate {
        base_figure(&enclosure.design.recipe, plate).write(&mut folder, "base", 1.0)?;
    }
    stages.begin("writing tables");
    pages::write_gap(&mut folder, &samples)?;
    folder.write_json("check.json", &inspection)?;
    let seconds = stages.finish();
    folder.write_json(
        "run.json",
        &json!({
            "schema": "combwright.run/1",
            "command": "enclosure",
            "version": env!("CARGO_PKG_VERSION"),
            "settings": recipe,
            "seconds": seconds,
            "ended": if inspection.sound { "sound" } else { "not sound" },
        }),
    )?;
    let files = folder.commit()?;
    print!("{}", pages::table(&inspection));
    println!(
        "{} files in {} after {:.1} s",
        files.len(),
        arguments.output.display(),
        seconds.values().sum::<f64>()
    );
    if inspection.sound {
        Ok(())
    } else {
        Err(CliError::failure(anyhow!(
            "the parts are not sound: see {}",
            arguments.output.join("check.json").display()
        )))
    }
}

/// Where a recipe came from, for messages.
struct Source {
    name: String,
    text: String,
}

/// A fault with the line of the recipe that it is in, if it is in the file.
fn tell(fault: &Fault, source: &Source) -> String {
    match Recipe::line_of(&source.text, fault.field) {
        Some(line) if !source.name.is_empty() => format!("{}, line {line}: {fault}", source.name),
        _ => fault.to_string(),
    }
}

fn init(path: &Path) -> Result<(), CliError> {
    if path.exists() {
        return Err(CliError::mistake(anyhow!("{} exists already; it was left as it is", path.display())));
    }
    write_whole(path, |writer| writer.write_all(DEFAULT_RECIPE.as_bytes()))?;
    println!("wrote {}; build it with: combwright enclosure {}", path.display(), path.display());
    Ok(())
}

fn read_recipe(path: Option<&Path>) -> Result<(Recipe, Source), CliError> {
    let source = match path {
        None => Source { name: String::new(), text: DEFAULT_RECIPE.to_owned() },
        Some(path) => Source {
            name: path.display().to_string(),
            text: fs::read_to_string(path).map_err(|error| {
                CliError::mistake(anyhow!("cannot read the recipe {}: {error}", path.display()))
            })?,
        },
    };
    let recipe = Recipe::parse(&source.text)
        .map_err(|error| CliError::mistake(anyhow!("{}, {error}", source.name)))?;
    Ok((recipe, source))
}

/// Options override lines of the recipe; a gap given one way replaces one given another way.
fn override_recipe(recipe: &mut Recipe, arguments: &EnclosureArguments) {
    let set = |to: &mut f64, from: Option<f64>| *to = from.unwrap_or(*to);
    set(&mut recipe.cell.period, arguments.period);
    set(&mut recipe.wall.thickness, arguments.wall);
    recipe.mesh.samples = arguments.cells.unwrap_or(recipe.mesh.samples);
    let gap = &mut recipe.gap;
    if arguments.gap.is_some() || arguments.delta.is_some() {
        (gap.cell_depth, gap.bee_space) = (None, None);
        (gap.width, gap.delta) = (arguments.gap, arguments.delta);
    }
    if arguments.delta.is_some() {
        (gap.shape, gap.is) = (GapShape::LevelSet, None);
    }
    if let Some(shape) = arguments.shape {
        gap.shape = match shape {
            Shape::Parallel => GapShape::Parallel,
            Shape::LevelSet => GapShape::LevelSet,
        };
    }
    if let Some(is) = arguments.gap_is {
        gap.is = Some(match is {
            GapIs::Min => NamedGap::Min,
            GapIs::Mean => NamedGap::Mean,
            GapIs::Max => NamedGap::Max,
        });
    }
    if let Some(part) = arguments.part {
        recipe.cell.block = None;
        recipe.cell.part = match part {
            PartName::Half => Part::Half,
            PartName::Whole => Part::Whole,
            PartName::Octant => Part::Octant,
        };
    }
    if let Some(Triple(block)) = arguments.block {
        (recipe.cell.part, recipe.cell.block) = (Part::Block, Some(block));
    }
    recipe.print.bed = arguments.bed.map_or(recipe.print.bed, |Triple(bed)| bed);
    recipe.base.include &= !arguments.no_base;
}

/// One STL for each part, one 3MF with all of them beside each other, and what else was asked for.
fn write_parts(folder: &mut OutputFolder, enclosure: &Enclosure, formats: &[Format]) -> Result<(), CliError> {
    let wanted = |format| formats.contains(&format);
    let placed = |places: Vec<DVec3>| -> Vec<mesh::Part<'_>> {
        enclosure
            .parts
            .iter()
            .zip(places)
            .map(|(part, placement)| mesh::Part { name: part.name, mesh: &part.solid, placement })
            .collect()
    };
    for part in &enclosure.parts {
        folder.write(format!("{}.stl", part.name), |w| {
            mesh::write_stl(&part.solid, w).map_err(io::Error::other)
        })?;
        if wanted(Format::Ply) {
            folder.write(format!("{}.ply", part.name), |w| {
                mesh::write_ply(&part.solid, w).map_err(io::Error::other)
            })?;
        }
    }
    let apart = placed(enclosure.beside_each_other());
    folder.write("enclosure.3mf", |w| mesh::write_3mf(&apart, w).map_err(io::Error::other))?;
    if wanted(Format::Obj) {
        folder.write("enclosure.obj", |w| mesh::write_obj(&apart, w).map_err(io::Error::other))?;
    }
    if wanted(Format::Glb) {
        let together = placed(enclosure.parts.iter().map(|part| enclosure.assembled(part)).collect());
        folder.write("enclosure.glb", |w| mesh::write_glb(&together, w).map_err(io::Error::other))?;
    }
    Ok(())
}
