//! `combwright foam bubble`: one bubble between two walls.

use super::{
    CliError,
    foam::SpaceArguments,
    foam_run::{Line, finished, print_lines},
    foam_settings::{Faults, space, unused},
};
use crate::{
    foam::{
        bubble::{
            Bubble, Chart, Landing, Meshes, NoBubble, Sample, ThinGap, cluster, flat_perimeter, held,
            landing, patch, route, scan, scan_route, settled, shape_modes, usual_route,
        },
        relax::{Descended, Ending},
        setup::FoamSpace,
    },
    report::{bubble as report, bubble_cluster as cluster_report, folder::OutputFolder},
    surface::Gap,
};
use glam::DVec3;
use serde::Serialize;
use std::path::PathBuf;

/// One bubble between two walls: its energy at a place, where it slides, the landscape of its energy
///
/// A bubble that touches both walls, its centre held at a place of the middle surface. The force that holds it there, and
/// whether the place is a minimum, are reported; with --free it slides to where it is stable. Lengths are in units of the
/// surface, energies in units of tension times length².
#[derive(Debug, clap::Args)]
#[command(
    next_help_heading = "Bubble",
    after_help = "Examples:
  combwright foam bubble --surface sphere --radii 20,20.5 --volume 0.5
  combwright foam bubble --surface torus --ring 5 --tube 0.9,1.0 --volume 0.005 --at 4.05,0,0 --free
  combwright foam bubble --surface torus --ring 5 --tube 0.9,1.0 --volume 0.005 --scan 64 -o out
  combwright foam bubble --volume 0.01 --at 0.25,0.25,0.25
  combwright foam bubble --volume 0.002 --patch 64 -o out
  combwright foam bubble --surface plane --periods 4,4 --height 0.2 --volume 0.02 --count 2
  combwright foam bubble --volume 0.002 --count 3 --at 0.25,0.25,0.25 -o out"
)]
pub(super) struct BubbleArguments {
    #[command(flatten)]
    pub(super) space: SpaceArguments,
    /// The volume of the bubble
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub(super) volume: f64,
    /// The place of its centre, on the middle surface [default: where the scan of the surface would begin]
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_negative_numbers = true)]
    pub(super) at: Option<Vec<f64>>,
    /// Let the bubble slide to where it is stable
    #[arg(long, conflicts_with_all = ["scan", "patch"])]
    pub(super) free: bool,
    /// Hold it at COUNT places along a route: round the tube, from a flat point to a neck, or from --at to --to
    #[arg(long, value_name = "COUNT", conflicts_with = "patch")]
    pub(super) scan: Option<usize>,
    /// The end of the route
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        allow_negative_numbers = true,
        requires = "scan",
        requires = "at"
    )]
    pub(super) to: Option<Vec<f64>>,
    /// Hold it at COUNT places spread over the part of the surface that its symmetries repeat
    #[arg(long, value_name = "COUNT")]
    pub(super) patch: Option<usize>,
    /// So many bubbles of this volume that touch each other, free to slide and turn
    #[arg(long, value_name = "1|2|3", default_value_t = 1, conflicts_with_all = ["free", "scan", "patch"])]
    pub(super) count: usize,
    /// The folder for table, charts and pictures [default for --scan and --patch: bubble-out]
    #[arg(short = 'o', long, value_name = "FOLDER", help_heading = "Run")]
    pub(super) output: Option<PathBuf>,
}

/// The most places of a landscape.
const MOST_PLACES: usize = 10_000;

/// The name and version of `bubble.json`.
const SCHEMA: &str = "combwright.bubble/1";

/// The figures of a bubble.
#[derive(Serialize)]
struct Summary {
    schema: &'static str,
    space: FoamSpace,
    place: DVec3,
    volume: f64,
    energy: f64,
    energy_error: f64,
    pressure: f64,
    force: DVec3,
    thin_gap: ThinGap,
    thin_gap_energy: f64,
    landing: Landing,
    unstable_shapes: usize,
    shape_modes: Vec<f64>,
}

/// Runs the command.
pub(super) fn run(arguments: &BubbleArguments) -> Result<(), CliError> {
    let (space, gap) = walls(arguments).map_err(CliError::mistake)?;
    let at = arguments.at.as_deref().map(|at| point("--at", at)).transpose()?;
    match (arguments.scan, arguments.patch) {
        (Some(count), _) => {
            let to = arguments.to.as_deref().map(|to| point("--to", to)).transpose()?;
            let count = places("--scan", count)?;
            let places = match (at, to) {
                (Some(from), Some(to)) => route(&gap, from, to, count),
                _ => usual_route(&space, &gap, count),
            };
            let places = places.map_err(CliError::mistake)?;
            let samples = scan_route(&gap, arguments.volume, &places, &Meshes::medium());
            landscape(arguments, &space, &gap, samples.map_err(CliError::mistake)?)
        }
        (None, Some(count)) => {
            let places = patch(&space, &gap, places("--patch", count)?);
            let samples = scan(&gap, arguments.volume, &places, &Meshes::medium());
            landscape(arguments, &space, &gap, samples.map_err(CliError::mistake)?)
        }
        (None, None) if arguments.count == 1 => one(arguments, &space, &gap, at),
        (None, None) => touching(arguments, &space, &gap, at),
    }
}

fn walls(arguments: &BubbleArguments) -> Result<(FoamSpace, Gap), Faults> {
    let mut faults = unused(&arguments.space);
    let space = space(&arguments.space, &mut faults);
    let gap = space.gap();
    if let (Err(error), true) = (&gap, faults.is_empty()) {
        faults.push(error.to_string());
    }
    match gap {
        Ok(gap) if faults.is_empty() => Ok((space, gap)),
        _ => Err(Faults(faults)),
    }
}

fn point(option: &str, numbers: &[f64]) -> Result<DVec3, CliError> {
    match *numbers {
        [x, y, z] if numbers.iter().all(|number| number.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err(CliError::mistake(anyhow::anyhow!("{option} takes three numbers, as in 0.25,0.25,0.25"))),
    }
}

fn places(option: &str, count: usize) -> Result<usize, CliError> {
    if (2..=MOST_PLACES).contains(&count) {
        Ok(count)
    } else {
        Err(CliError::mistake(anyhow::anyhow!(
            "{option} {count} must lie between 2 and {MOST_PLACES} places"
        )))
    }
}

/// What went wrong is the user's to mend: another volume or place.
fn no_bubble(error: NoBubble) -> CliError {
    match error {
        NoBubble::Restless { .. } => CliError::failure(error),
        _ => CliError::mistake(error),
    }
}

/// Where a bubble is put when nothing is said.
fn first_place(space: &FoamSpace, gap: &Gap) -> DVec3 {
    patch(space, gap, 1).first().copied().unwrap_or_default()
}

/// The name and version of `cluster.json`.
const CLUSTER_SCHEMA: &str = "combwright.cluster/1";

/// The figures of a pair or a triple.
#[derive(Serialize)]
struct ClusterSummary<'a> {
    schema: &'static str,
    space: FoamSpace,
    bubbles: usize,
    volume: f64,
    energy: f64,
    energy_error: f64,
    flat_energy: f64,
    pressures: &'a [f64],
    centre: DVec3,
    border_angle_error_deg: f64,
    ended: String,
    unstable: usize,
}

/// A pair or a triple.
fn touching(
    arguments: &BubbleArguments,
    space: &FoamSpace,
    gap: &Gap,
    at: Option<DVec3>,
) -> Result<(), CliError> {
    let at = at.unwrap_or_else(|| first_place(space, gap));
    let (count, volume) = (arguments.count, arguments.volume);
    // More than three are refused by the library; a vast count makes no vast list.
    let cluster = cluster(gap, &vec![volume; count.min(MOST_PLACES)], at).map_err(no_bubble)?;
    let centre = cluster.centre();
    let height = Chart::new(gap, centre).and_then(|chart| chart.height()).map_err(no_bubble)?;
    let flat = flat_perimeter(count).unwrap_or(f64::NAN) * (volume * height).sqrt();
    let Descended { ending, steps, residuals, unstable } = cluster.descended;
    let ended = match ending {
        Ending::Converged => format!("converged in {steps} Newton steps"),
        _ => format!("stopped after {steps} Newton steps"),
    };
    let pressures = cluster.pressures.iter().map(|p| format!("{p:.9}")).collect::<Vec<_>>().join(", ");
    let angle = cluster.border_angle_error().to_degrees();
    let lines = vec![
        ("space", space.to_string()),
        ("bubbles", format!("{count} of volume {volume}")),
        ("centre", coordinates(centre)),
        ("energy", format!("{:.12} ± {:.0e}", cluster.energy, cluster.energy_error)),
        ("between plane walls", format!("{flat:.12} at the gap {height:.6} of the centre")),
        ("pressures", pressures),
        ("borders off 120°", format!("{angle:.4}° at most, on the finest mesh")),
        ("ended", format!("{ended}, largest force {:.1e}", residuals.force)),
        ("falling directions", unstable.to_string()),
    ];
    let Some(output) = &arguments.output else { return print_lines(lines) };
    let mut folder = OutputFolder::begin(output)?;
    let summary = ClusterSummary {
        schema: CLUSTER_SCHEMA,
        space: *space,
        bubbles: count,
        volume,
        energy: cluster.energy,
        energy_error: cluster.energy_error,
        flat_energy: flat,
        pressures: &cluster.pressures,
        centre,
        border_angle_error_deg: angle,
        ended,
        unstable,
    };
    folder.write_json("cluster.json", &summary)?;
    let title = format!("{space}: {count} bubbles of volume {volume}");
    cluster_report::picture(&cluster, gap, &title)?.write_png(&mut folder, "cluster", 1.0)?;
    finished(folder, lines)
}

fn one(arguments: &BubbleArguments, space: &FoamSpace, gap: &Gap, at: Option<DVec3>) -> Result<(), CliError> {
    let at = at.unwrap_or_else(|| first_place(space, gap));
    let meshes = Meshes::fine();
    let (bubble, landing, mut lines) = if arguments.free {
        let end = settled(gap, arguments.volume, at, &meshes).map_err(no_bubble)?;
        let start = end.way.first().map_or(at, |first| first.0);
        let lines = vec![("started at", coordinates(start)), ("steps", (end.way.len() - 1).to_string())];
        (end.bubble, end.landing, lines)
    } else {
        let bubble = held(gap, arguments.volume, at, &meshes).map_err(no_bubble)?;
        (bubble, landing(gap, arguments.volume, at).map_err(no_bubble)?, Vec::new())
    };
    let chart = Chart::new(gap, bubble.place).map_err(no_bubble)?;
    let thin = ThinGap::at(&chart).map_err(no_bubble)?;
    lines.insert(0, ("space", space.to_string()));
    let modes = shape_modes(gap, bubble.volume, bubble.place).map_err(no_bubble)?;
    lines.extend(figures(&bubble, &landing, &thin, &modes));
    let Some(output) = &arguments.output else { return print_lines(lines) };
    let mut folder = OutputFolder::begin(output)?;
    let summary = Summary {
        schema: SCHEMA,
        space: *space,
        place: bubble.place,
        volume: bubble.volume,
        energy: bubble.energy,
        energy_error: bubble.energy_error,
        pressure: bubble.pressure,
        force: bubble.force,
        thin_gap_energy: thin.energy(bubble.volume),
        thin_gap: thin,
        landing,
        unstable_shapes: bubble.unstable_shapes,
        shape_modes: modes,
    };
    folder.write_json("bubble.json", &summary)?;
    finished(folder, lines)
}

fn coordinates(p: DVec3) -> String {
    format!("{:.6}, {:.6}, {:.6}", p.x, p.y, p.z)
}

fn figures(bubble: &Bubble, landing: &Landing, thin: &ThinGap, modes: &[f64]) -> Vec<Line> {
    let formula = thin.energy(bubble.volume);
    let modes = modes.iter().map(|value| format!("{value:.4}")).collect::<Vec<_>>().join(", ");
    vec![
        ("centre", coordinates(bubble.place)),
        ("curvature K, H", format!("{:.6}, {:.6}", thin.gauss_curvature, thin.mean_curvature)),
        ("gap there", format!("{:.6}", thin.height)),
        ("volume", bubble.volume.to_string()),
        ("energy", format!("{:.12} ± {:.0e}", bubble.energy, bubble.energy_error)),
        ("pressure", format!("{:.10} ± {:.0e}", bubble.pressure, bubble.pressure_error)),
        ("force of the walls", format!("{:.6e}", bubble.force.length())),
        ("thin-gap formula", format!("{formula:.12}, {:+.2e} of E", formula / bubble.energy - 1.0)),
        (
            "energy over the surface",
            format!("curvatures {:.6e}, {:.6e}", landing.curvatures[0], landing.curvatures[1]),
        ),
        ("lowest shape modes", modes),
        ("the place is", verdict(bubble, landing, thin.height)),
    ]
}

/// What kind of place it is.
fn verdict(bubble: &Bubble, landing: &Landing, height: f64) -> String {
    let rigid = match landing.rigid {
        0 => "",
        1 => ", free to slide along one direction",
        _ => ", free to slide everywhere",
    };
    // The force on the coarse mesh beside the curvature of the landscape: an offset far below the size of the bubble.
    let still =
        landing.force <= 1e-6 * bubble.energy.max(bubble.pressure * bubble.volume) / bubble.volume.cbrt();
    if !still {
        return "no equilibrium: the walls push".to_owned();
    }
    let kind = match landing.falling {
        0 if bubble.unstable_shapes == 0 => "a minimum".to_owned(),
        0 => "no minimum".to_owned(),
        count => format!("a saddle or a maximum: {}", falling(count)),
    };
    let shape = match bubble.unstable_shapes {
        0 => String::new(),
        count if is_slender(bubble, height) => format!(
            "; its shape has {}: the gap is wider than half its girth, and it would pinch off (Plateau, Rayleigh)",
            falling(count)
        ),
        count => format!("; its shape has {} with the centre held", falling(count)),
    };
    kind + rigid + &shape
}

fn falling(count: usize) -> String {
    if count == 1 { "1 falling direction".to_owned() } else { format!("{count} falling directions") }
}

/// Whether a cylinder of this volume in a gap of that height is longer than half its girth, from where on it is unstable between
/// walls on which its ends slide (J. Plateau, 1873; Lord Rayleigh, 1878).
fn is_slender(bubble: &Bubble, height: f64) -> bool {
    let radius = (bubble.volume / (std::f64::consts::PI * height)).sqrt();
    height > std::f64::consts::PI * radius
}

fn landscape(
    arguments: &BubbleArguments,
    space: &FoamSpace,
    gap: &Gap,
    samples: Vec<Sample>,
) -> Result<(), CliError> {
    let output = arguments.output.clone().unwrap_or_else(|| PathBuf::from("bubble-out"));
    let mut folder = OutputFolder::begin(output)?;
    let known: Vec<(&Sample, &Bubble)> =
        samples.iter().filter_map(|sample| Some((sample, sample.bubble.as_ref().ok()?))).collect();
    let order = |a: &&(&Sample, &Bubble), b: &&(&Sample, &Bubble)| a.1.energy.total_cmp(&b.1.energy);
    let (Some(low), Some(high)) = (known.iter().min_by(order), known.iter().max_by(order)) else {
        let error = samples.into_iter().find_map(|sample| sample.bubble.err());
        return Err(
            error.map_or_else(|| CliError::failure(anyhow::anyhow!("there are no places")), no_bubble)
        );
    };
    let title = format!("{space}: a bubble of volume {}", arguments.volume);
    report::write_table(&mut folder, &samples)?;
    report::chart(&samples, &title).map_err(CliError::failure)?.write(&mut folder, "landscape", 1.0)?;
    if let Some(map) = report::map(gap.middle().as_ref(), &samples, &title)? {
        map.write_png(&mut folder, "surface", 1.0)?;
    }
    let off = |(sample, bubble): &(&Sample, &Bubble)| {
        (sample.thin.energy(bubble.volume) / bubble.energy - 1.0).abs()
    };
    let worst = known.iter().map(off).fold(0.0, f64::max);
    let end = |(sample, bubble): &(&Sample, &Bubble)| {
        format!(
            "{:.12} at {} (K = {:.4})",
            bubble.energy,
            coordinates(sample.place),
            sample.thin.gauss_curvature
        )
    };
    let lines = vec![
        ("space", space.to_string()),
        ("places", format!("{}, {} without equilibrium", samples.len(), samples.len() - known.len())),
        ("least energy", end(low)),
        ("largest energy", end(high)),
        ("thin-gap formula", format!("off by at most {worst:.2e} of E")),
    ];
    finished(folder, lines)
}
