//! `combwright foam`: the ideal foam between two walls.

use super::{
    CliError, foam_batch, foam_bubble, foam_layers, foam_relax, foam_run, foam_settings::FoamSettings,
};
use crate::units::Mm;
use std::path::PathBuf;

/// The surface between the walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum SurfaceName {
    /// Schwarz' P (nodal), triply periodic
    SchwarzP,
    /// Schoen's gyroid (nodal), triply periodic
    Gyroid,
    /// Schwarz' D (nodal), triply periodic
    Diamond,
    /// Two concentric spheres
    Sphere,
    /// Two tori of one centre circle
    Torus,
    /// Two parallel planes, periodic
    Plane,
}

/// How densely seeds are put on the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum DensityName {
    /// In proportion to the local gap: cells of equal volume to first order
    Gap,
    /// As many on every unit of area, as in the paper
    Uniform,
}

/// How a foam ends at open faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum OpenFacesName {
    /// At frictionless plane walls, which films meet at a right angle
    Walls,
    /// It goes on periodically; at walls where two faces are no whole periods apart, as at the cut through a half cell
    Periodic,
}

/// A step after which to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum StageName {
    /// Seeds on the middle surface
    Seeds,
    /// Voronoi cells clipped by the walls
    Partition,
}

/// The walls.
#[derive(Debug, clap::Args)]
pub(super) struct SpaceArguments {
    /// The surface half-way between the walls
    #[arg(long, value_enum, default_value = "schwarz-p", help_heading = "Space")]
    pub(super) surface: SurfaceName,
    /// The period L of a triply periodic surface [default: 1]
    #[arg(long, value_name = "L", allow_negative_numbers = true, help_heading = "Space")]
    pub(super) period: Option<f64>,
    /// Level-set walls at Φ = ±δ [default: 0.2]
    #[arg(
        long,
        value_name = "δ",
        allow_negative_numbers = true,
        conflicts_with = "parallel",
        help_heading = "Space"
    )]
    pub(super) delta: Option<f64>,
    /// Parallel walls instead: true offsets, this far apart
    #[arg(long, value_name = "GAP", allow_negative_numbers = true, help_heading = "Space")]
    pub(super) parallel: Option<f64>,
    /// The radii of the two spheres
    #[arg(
        long,
        value_name = "R1,R2",
        value_delimiter = ',',
        allow_negative_numbers = true,
        help_heading = "Space"
    )]
    pub(super) radii: Option<Vec<f64>>,
    /// The radii of the two tubes of the tori
    #[arg(
        long,
        value_name = "R1,R2",
        value_delimiter = ',',
        allow_negative_numbers = true,
        help_heading = "Space"
    )]
    pub(super) tube: Option<Vec<f64>>,
    /// The radius of the tori's centre circle
    #[arg(long, value_name = "R", allow_negative_numbers = true, help_heading = "Space")]
    pub(super) ring: Option<f64>,
    /// The periods of the planes along x and y
    #[arg(
        long,
        value_name = "X,Y",
        value_delimiter = ',',
        allow_negative_numbers = true,
        help_heading = "Space"
    )]
    pub(super) periods: Option<Vec<f64>>,
    /// The distance of the planes
    #[arg(long, value_name = "H", allow_negative_numbers = true, help_heading = "Space")]
    pub(super) height: Option<f64>,
}

/// The ideal foam between two walls: seeds, the partition of the gap into cells, and films relaxed to least area.
///
/// Without options: one period of Schwarz' P surface between the walls Φ = ±0.2, 64 cells, seed 1. Lengths are in units of
/// the surface (of the period L where there is one).
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  combwright foam --cells 256 --seed 7 -o out
  combwright foam --surface sphere --radii 1.0,1.05 --cells 32
  combwright foam --surface torus --tube 0.9,1.0 --ring 5
  combwright foam --surface plane --periods 8,8 --height 0.5
  combwright foam --recipe enclosures/large-250/recipe.toml --cell-width 20mm
  combwright foam --recipe enclosures/test-print/recipe.toml --cells 48 --open-faces periodic
  combwright foam --surface plane --periods 8,8 --height 0.5 --open-faces walls
  combwright foam --stop-after partition --density uniform
  combwright foam --cells 32 --runs 100 -j 2
  combwright foam --cells 32 --anneal 200
  combwright foam --surface sphere --radii 0.9995,1.0005 --cells 20 --anneal 100 --extrapolate
  combwright foam --layers 2 --surface plane --periods 8,9.2376 --height 2.3 --cells 64 --pattern toth
  combwright foam --resume out/checkpoint -o out"
)]
pub(super) struct FoamArguments {
    #[command(subcommand)]
    pub(super) part: Option<FoamPart>,

    #[command(flatten)]
    pub(super) space: SpaceArguments,

    /// The gap of an enclosure's recipe (TOML), as much of it as is printed (for two layers: one period); lengths are then in mm
    #[arg(long, value_name = "FILE", conflicts_with_all = ["surface", "period", "delta", "parallel"], help_heading = "Space")]
    pub(super) recipe: Option<PathBuf>,

    /// How the foam ends at open faces: of a recipe's enclosure [default: walls], of one cell of Schwarz' P, or of planes
    /// [default: periodic]
    #[arg(long, value_enum, help_heading = "Space")]
    pub(super) open_faces: Option<OpenFacesName>,

    /// The number of cells [default: 64, or as many as --cell-width says]
    #[arg(short = 'n', long, value_name = "N", allow_negative_numbers = true, help_heading = "Cells")]
    pub(super) cells: Option<usize>,
    /// The width of a hexagonal cell between opposite sides, on the middle surface of the recipe: 5.3mm for worker bees
    #[arg(long, value_name = "MM", requires = "recipe", conflicts_with = "cells", help_heading = "Cells")]
    pub(super) cell_width: Option<Mm>,
    /// Where the random numbers start
    #[arg(long, value_name = "S", default_value_t = 1, help_heading = "Cells")]
    pub(super) seed: u64,
    /// How densely seeds are put on the surface
    #[arg(long, value_enum, default_value = "gap", help_heading = "Cells")]
    pub(super) density: DensityName,
    /// Attempts per seed in the annealing [default: 4000]
    #[arg(long, value_name = "COUNT", help_heading = "Cells")]
    pub(super) sweeps: Option<usize>,
    /// The range d of the overlap energy, over the spacing of a hexagonal lattice [default: 1.15]
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true, help_heading = "Cells")]
    pub(super) disc: Option<f64>,
    /// The temperature at the start of the annealing, in units of d² [default: 0.01]
    #[arg(long, value_name = "T", allow_negative_numbers = true, help_heading = "Cells")]
    pub(super) hot: Option<f64>,
    /// The temperature at its end, in units of d² [default: 0.0001]
    #[arg(long, value_name = "T", allow_negative_numbers = true, help_heading = "Cells")]
    pub(super) cold: Option<f64>,
    /// Lloyd steps after the annealing and the polish, at most 1000
    #[arg(long, value_name = "COUNT", default_value_t = 0, help_heading = "Cells")]
    pub(super) lloyd: usize,

    /// Layers of cells: 1, or 2 as in natural comb, with --cells on each wall
    #[arg(long, value_name = "1|2", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2), conflicts_with_all = ["resume", "runs", "stop_after", "anneal"], help_heading = "Layers")]
    pub(super) layers: u8,
    /// How the cells of two layers are arranged [default: annealed]
    #[arg(long, value_enum, help_heading = "Layers")]
    pub(super) pattern: Option<foam_layers::PatternName>,

    /// Quadratic elements along each film and from wall to wall [default: 2,2]
    #[arg(long, value_name = "M,K", value_delimiter = ',', help_heading = "Relaxation")]
    pub(super) elements: Option<Vec<usize>>,
    /// The largest force at the end, in units of tension × cell width [default: 1e-10]
    #[arg(long, value_name = "FORCE", allow_negative_numbers = true, help_heading = "Relaxation")]
    pub(super) tolerance: Option<f64>,
    /// Disturb the settled foam so many times, by random T1s and by shaking, and keep what is lower
    #[arg(long, value_name = "CYCLES", default_value_t = 0, help_heading = "Relaxation")]
    pub(super) anneal: usize,
    /// Also relax on elements of half the size, and print the energy that a mesh without end would have
    #[arg(long, help_heading = "Relaxation")]
    pub(super) extrapolate: bool,
    /// Go on from a checkpoint that an earlier run left in its folder
    #[arg(long, value_name = "FILE", conflicts_with_all = RESUME_CONFLICTS, help_heading = "Relaxation")]
    pub(super) resume: Option<PathBuf>,

    /// Stop after this step
    #[arg(long, value_enum, help_heading = "Run")]
    pub(super) stop_after: Option<StageName>,
    /// Make K foams with the seeds S, S+1, … and keep the best
    #[arg(long, value_name = "K", default_value_t = 1, help_heading = "Run")]
    pub(super) runs: u64,
    /// Threads; the results do not depend on it [default: all]
    #[arg(short = 'j', long, value_name = "J", help_heading = "Run")]
    pub(super) jobs: Option<usize>,
    /// Write the relaxed foam into the folder as a datafile of Surface Evolver, under this name, as in foam.fe
    #[arg(long, value_name = "NAME", help_heading = "Run")]
    pub(super) write_fe: Option<String>,
    /// The folder for the results
    #[arg(short = 'o', long, value_name = "FOLDER", default_value = "foam-out", help_heading = "Run")]
    pub(super) output: PathBuf,
}

/// Foams of a few cells.
#[derive(Debug, clap::Subcommand)]
pub(super) enum FoamPart {
    Bubble(Box<foam_bubble::BubbleArguments>),
}

/// What a checkpoint already says.
const RESUME_CONFLICTS: &[&str] = &[
    "surface",
    "period",
    "delta",
    "parallel",
    "radii",
    "tube",
    "ring",
    "periods",
    "height",
    "cells",
    "seed",
    "density",
    "sweeps",
    "disc",
    "hot",
    "cold",
    "lloyd",
    "recipe",
    "open_faces",
    "cell_width",
    "elements",
    "tolerance",
    "stop_after",
    "runs",
];

/// Runs the command.
pub(super) fn foam(arguments: &FoamArguments) -> Result<(), CliError> {
    if let Some(FoamPart::Bubble(bubble)) = &arguments.part {
        return foam_bubble::run(bubble);
    }
    let settings = FoamSettings::from_arguments(arguments).map_err(CliError::mistake)?;
    let resumed = arguments.resume.as_deref().map(foam_relax::read_checkpoint).transpose()?;
    let mut threads = rayon::ThreadPoolBuilder::new();
    if let Some(jobs) = settings.jobs {
        threads = threads.num_threads(jobs);
    }
    let threads = threads.build().map_err(CliError::failure)?;
    threads.install(|| match resumed {
        Some(checkpoint) => foam_relax::resume(*checkpoint, settings),
        None if arguments.layers == 2 => {
            let pattern = arguments.pattern.unwrap_or(foam_layers::PatternName::Annealed);
            foam_layers::run(&settings, pattern, arguments.elements.is_some())
        }
        None if settings.runs > 1 => foam_batch::run(&settings),
        None => foam_run::run(&settings),
    })
}
