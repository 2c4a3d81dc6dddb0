//! `combwright foam`: the ideal foam between two walls.

use super::{CliError, foam_batch, foam_run, foam_settings::FoamSettings};
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

/// A step after which to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum StageName {
    /// Seeds on the middle surface
    Seeds,
    /// Voronoi cells clipped by the walls
    Partition,
}

/// Seeds of a one-layer foam between two walls, and the partition of the gap into their cells.
///
/// Without options: one period of Schwarz' P surface between the walls Φ = ±0.2, 64 cells, seed 1. Lengths are in units of
/// the surface (of the period L where there is one).
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  combwright foam --cells 256 --seed 7 -o out
  combwright foam --surface sphere --radii 1.0,1.05 --cells 32
  combwright foam --surface torus --tube 0.9,1.0 --ring 5
  combwright foam --surface plane --periods 8,8 --height 0.5
  combwright foam --stop-after partition --density uniform
  combwright foam --cells 32 --runs 100 -j 2")]
pub(super) struct FoamArguments {
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

    /// The number of cells
    #[arg(
        short = 'n',
        long,
        value_name = "N",
        default_value_t = 64,
        allow_negative_numbers = true,
        help_heading = "Cells"
    )]
    pub(super) cells: usize,
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
    /// Lloyd steps after the annealing and the polish
    #[arg(long, value_name = "COUNT", default_value_t = 0, help_heading = "Cells")]
    pub(super) lloyd: usize,

    /// Stop after this step
    #[arg(long, value_enum, help_heading = "Run")]
    pub(super) stop_after: Option<StageName>,
    /// Make K foams with the seeds S, S+1, … and keep the best
    #[arg(long, value_name = "K", default_value_t = 1, help_heading = "Run")]
    pub(super) runs: u64,
    /// Threads; the results do not depend on it [default: all]
    #[arg(short = 'j', long, value_name = "J", help_heading = "Run")]
    pub(super) jobs: Option<usize>,
    /// The folder for the results
    #[arg(short = 'o', long, value_name = "FOLDER", default_value = "foam-out", help_heading = "Run")]
    pub(super) output: PathBuf,
}

/// Runs the command.
pub(super) fn foam(arguments: &FoamArguments) -> Result<(), CliError> {
    let settings = FoamSettings::from_arguments(arguments).map_err(CliError::mistake)?;
    let mut threads = rayon::ThreadPoolBuilder::new();
    if let Some(jobs) = settings.jobs {
        threads = threads.num_threads(jobs);
    }
    let threads = threads.build().map_err(CliError::failure)?;
    threads.install(|| if settings.runs > 1 { foam_batch::run(&settings) } else { foam_run::run(&settings) })
}
