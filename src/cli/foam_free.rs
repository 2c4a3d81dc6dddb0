//! A one-layer foam in a gap so wide that cells have other neighbours on one wall than on the other: from where the network
//! of films from wall to wall ends to the folder.

use super::{
    CliError,
    foam_figures::{extrapolation, no_extrapolation, uneven},
    foam_relax::{Job, no_pattern},
    foam_run::{self, Line, by_sides},
    foam_settings::FoamSettings,
    interrupt,
};
use crate::{
    evolver::write::foam_datafile,
    foam::{
        checkpoint::StepRecord,
        flat_hexagonal_energy,
        free::{self, FreeFoam, FreeSettings, Obstacle, Widened, corner_angles, tetrahedral_angle},
        pattern::pattern_of_free,
        relax::{Extrapolated, State},
        seeds::Seeds,
    },
    report::{
        foam_chart, foam_export, foam_files,
        foam_picture::FoamScene,
        foam_surface::{CellFigures, free_pieces},
        folder::OutputFolder,
    },
    surface::{Gap, WallSide},
    tessellation::{Cell, CellPattern},
};
use anyhow::anyhow;
use indicatif::ProgressBar;
use serde::Serialize;

/// The name and version of `summary.json`.
const SCHEMA: &str = "combwright.free-foam-summary/1";

/// The figures of a foam of free topology.
#[derive(Serialize)]
struct Figures {
    schema: &'static str,
    cells: usize,
    space: String,
    /// Films' area times their tension, 1.
    energy: f64,
    /// That of the flat hexagonal foam of the same cells.
    flat_hexagonal_energy: f64,
    energy_over_flat: f64,
    /// How many cells have 0, 1, 2 … sides on the lower and on the upper wall.
    side_counts: [Vec<usize>; 2],
    /// How many cells end at planes that cut the gap off.
    cut_cells: usize,
    /// How many of them end there on the lower and on the upper wall; they have no number of sides on that wall.
    cut_patches: [usize; 2],
    /// Σ (6 − n) on each wall over the cells that are not cut there.
    charge: [i64; 2],
    /// Cells that touch other cells on one wall than on the other.
    twisted_cells: usize,
    /// Cells that do not touch the lower and the upper wall.
    cells_off_walls: [usize; 2],
    /// Corners inside the gap, where four borders meet.
    inner_corners: usize,
    films: usize,
    gap_volume: f64,
    /// The largest relative deviation of a cell's volume from its target.
    volume_error: f64,
    /// Pressures relative to their mean.
    pressure_min: f64,
    pressure_max: f64,
    /// T1s at all heights, while all films reached from wall to wall.
    t1_count: usize,
    /// Changes of topology after that, such as T1s on one wall.
    free_changes: usize,
    newton_steps: usize,
    /// The largest force left, in units of tension × cell spacing.
    residual: f64,
    /// Directions of negative curvature: 0 at a minimum.
    unstable_directions: usize,
    /// The lowest eigenvalue of the Hessian at constant volumes.
    lowest_eigenvalue: Option<f64>,
    /// Of the corners' angles from the tetrahedral angle; none without corners inside the gap.
    corner_angle_mean_deg: Option<f64>,
    corner_angle_worst_deg: Option<f64>,
    /// The part of the gap in which all films still reached from wall to wall.
    network_part: f64,
    /// The part that was filled.
    part: f64,
    psi6_of_seeds: f64,
    /// Whether the foam is in balance on evenly spread nodes.
    nodes_even: bool,
    /// The energy on elements of half the size, and without a mesh.
    extrapolated: Option<Extrapolated>,
    ended: String,
}

/// Where a foam of free topology comes from.
pub(super) struct Origin<'a> {
    pub(super) job: &'a Job,
    pub(super) settings: &'a FoamSettings,
    pub(super) seeds: Option<&'a Seeds>,
    /// The whole gap.
    pub(super) gap: &'a Gap,
    /// The volume of the gap as the partition measured it.
    pub(super) gap_volume: Option<f64>,
    /// The foam of films from wall to wall, in the widest part of the gap that it reached.
    pub(super) network: &'a State,
}

/// The relative difference of two measures of the gap's volume that is no error of theirs.
const HOLE: f64 = 1e-4;

/// Goes on from where the network ended, writes the folder and prints the table.
pub(super) fn run(
    origin: &Origin<'_>,
    mut record: Vec<StepRecord>,
    seconds: Vec<(&'static str, f64)>,
    bar: &ProgressBar,
    mut folder: OutputFolder,
) -> Result<(), CliError> {
    let began = std::time::Instant::now();
    let state = origin.network;
    let strips = origin.job.relax.strips;
    let how = FreeSettings {
        fineness: strips.along.max(strips.through).div_ceil(2),
        tolerance: origin.job.relax.tolerance.max(1e-10),
        ..FreeSettings::of(state)
    };
    let widened = free::widened(state, origin.gap, &how, &mut |told| {
        record.push(StepRecord {
            step: record.last().map_or(0, |last| last.step) + 1,
            energy: told.step.descent.energy(),
            force: told.step.residuals.force,
            volume: told.step.residuals.volume,
            fraction: told.step.fraction,
            unstable: told.step.unstable,
            flips: state.flips + told.flips,
        });
        bar.set_message(format!(
            "one wall at a time: {:.1} % of the gap, force {:.1e}, {} changes",
            100.0 * told.part,
            told.step.residuals.force,
            told.flips
        ));
        interrupt::flow()
    });
    let widened = widened.map_err(CliError::failure)?;
    let extrapolated = match &widened.obstacle {
        None if origin.settings.extrapolate => Some(
            free::extrapolate(&widened.foam, origin.gap, &how, &mut |told| {
                bar.set_message(format!("finer films, force {:.1e}", told.residuals.force));
                interrupt::flow()
            })
            .map_err(CliError::failure)?,
        ),
        _ => None,
    };
    let until = began.elapsed().as_secs_f64();
    let lines = write(&mut folder, origin, &widened, extrapolated, &record)?;
    let ended = ended(&widened);
    let seconds =
        [seconds, vec![("free topology", until), ("figures", began.elapsed().as_secs_f64() - until)]]
            .concat();
    foam_run::write_run(&mut folder, origin.settings, seconds, &ended)?;
    bar.finish_and_clear();
    foam_run::finished(folder, lines)?;
    match widened.obstacle {
        None => Ok(()),
        Some(_) => {
            let space = origin.job.space.narrowed(widened.part);
            Err(CliError::failure(anyhow!("{ended}. The folder holds the foam of {space}")))
        }
    }
}

/// Writes all files of the foam but `run.json`; gives the table.
fn write(
    folder: &mut OutputFolder,
    origin: &Origin<'_>,
    widened: &Widened,
    extrapolated: Option<Option<Extrapolated>>,
    record: &[StepRecord],
) -> Result<Vec<Line>, CliError> {
    let foam = &widened.foam;
    let (space, gap) = (origin.job.space.narrowed(widened.part), &origin.gap.narrowed(widened.part));
    let patterns =
        [WallSide::Lower, WallSide::Upper].map(|wall| pattern_of_free(foam, gap, wall).map_err(no_pattern));
    let [lower, upper] = patterns;
    let patterns = [lower?, upper?];
    for (name, pattern) in ["pattern-lower-wall.json", "pattern-upper-wall.json"].into_iter().zip(&patterns) {
        folder.write_json(name, pattern)?;
    }
    let cells = cells(foam, gap, &patterns[0]);
    let figures =
        Figures { extrapolated: extrapolated.flatten(), ..figures(origin, widened, &patterns, &cells)? };
    foam_files::write_free_cells(folder, foam, &patterns, &cells)?;
    let surface = free_pieces(foam, gap);
    folder.write("films.vtp", |writer| foam_export::write_vtp(writer, &surface, &cells))?;
    folder.write("films.glb", |writer| foam_export::write_glb(writer, &surface, &cells))?;
    let title = format!("{space}, N = {}: relaxed foam, sides on the lower wall", figures.cells);
    FoamScene::of_foam(&surface, &cells, gap, title).draw()?.write_png(folder, "foam", 1.0)?;
    let chart = foam_chart::relaxation(record).map_err(CliError::failure)?;
    folder.write_bytes("energy.svg", chart.svg().as_bytes())?;
    foam_files::write_steps(folder, record)?;
    if let Some(seeds) = origin.seeds {
        foam_run::write_seeds(folder, seeds)?;
    }
    if let Some(name) = &origin.settings.write_fe {
        let title = format!("{space}, N = {}, by combwright {}", figures.cells, env!("CARGO_PKG_VERSION"));
        let text = foam_datafile(&space, &foam.films.complex, foam.places(), &title);
        folder.write_bytes(name.as_str(), text.map_err(CliError::mistake)?.as_bytes())?;
    }
    folder.write_json("summary.json", &figures)?;
    let finer = match extrapolated {
        None => Vec::new(),
        Some(None) => vec![no_extrapolation()],
        Some(Some(found)) => extrapolation(&found).to_vec(),
    };
    let is_interrupted = widened.obstacle == Some(Obstacle::Interrupted);
    let uneven = (!figures.nodes_even && !is_interrupted).then(uneven);
    Ok([table(&figures), uneven.into_iter().collect(), finer].concat())
}

/// What is known of the cells; their sides are those on the lower wall.
fn cells(foam: &FreeFoam, gap: &Gap, lower: &CellPattern) -> CellFigures {
    let mean = foam.pressures.iter().sum::<f64>() / real(foam.pressures.len());
    let curvature = |&seed| gap.middle().curvature(gap.middle().project(seed, 0.0).unwrap_or(seed)).gauss;
    CellFigures {
        sides: lower.cells.iter().map(|cell| cell.sides.unwrap_or(0)).collect(),
        volumes: foam.volumes.iter().copied().collect(),
        pressures: foam.pressures.iter().map(|pressure| pressure - mean).collect(),
        gauss_curvature: foam.division.seeds.iter().map(curvature).collect(),
    }
}

fn figures(
    origin: &Origin<'_>,
    widened: &Widened,
    patterns: &[CellPattern; 2],
    cells: &CellFigures,
) -> Result<Figures, CliError> {
    let Widened { foam, part, steps, flips, .. } = widened;
    let (space, gap) = (origin.job.space.narrowed(*part), &origin.gap.narrowed(*part));
    let total: f64 = cells.volumes.iter().sum();
    if let Some(expected) = origin.gap_volume.filter(|_| *part >= 1.0)
        && (total / expected - 1.0).abs() > HOLE
    {
        return Err(CliError::failure(anyhow!(
            "the cells fill {:.3e} of the gap's volume too much: films cross. Ask for more cells or another seed",
            total / expected - 1.0
        )));
    }
    let domain = space.domain().map_err(CliError::mistake)?;
    let flat = flat_hexagonal_energy(gap, &domain, cells.volumes.len());
    let off: Vec<f64> =
        corner_angles(foam).iter().map(|angle| (angle - tetrahedral_angle()).to_degrees()).collect();
    let wanted: f64 = foam.division.volumes.iter().sum();
    let error = |(volume, share): (&f64, &f64)| (volume * wanted / (share * total) - 1.0).abs();
    Ok(Figures {
        schema: SCHEMA,
        cells: cells.volumes.len(),
        space: space.to_string(),
        energy: foam.energy,
        flat_hexagonal_energy: flat,
        energy_over_flat: foam.energy / flat,
        side_counts: patterns.each_ref().map(CellPattern::side_counts),
        cut_cells: foam.division.cut().into_iter().filter(|&cut| cut).count(),
        cut_patches: patterns.each_ref().map(cut_patches),
        charge: patterns.each_ref().map(CellPattern::charge),
        twisted_cells: foam.twisted_cells(),
        cells_off_walls: [0, 1]
            .map(|wall: usize| foam.division.touches().iter().filter(|touched| !touched[wall]).count()),
        inner_corners: foam.division.inner_corners(),
        films: foam.division.polygons.len(),
        gap_volume: total,
        volume_error: cells.volumes.iter().zip(&foam.division.volumes).map(error).fold(0.0, f64::max),
        pressure_min: cells.pressures.iter().copied().fold(f64::INFINITY, f64::min),
        pressure_max: cells.pressures.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        t1_count: origin.network.flips,
        free_changes: *flips,
        newton_steps: origin.network.steps + steps,
        residual: foam.descended.residuals.force,
        unstable_directions: foam.descended.unstable,
        lowest_eigenvalue: foam.lowest_eigenvalue().ok(),
        corner_angle_mean_deg: (!off.is_empty()).then(|| off.iter().sum::<f64>() / real(off.len())),
        corner_angle_worst_deg: off.iter().map(|x| x.abs()).max_by(f64::total_cmp),
        network_part: origin.network.part,
        part: *part,
        psi6_of_seeds: origin.job.psi6,
        nodes_even: foam.is_even,
        extrapolated: None,
        ended: ended(widened),
    })
}

/// How many cells end at planes on a wall.
fn cut_patches(pattern: &CellPattern) -> usize {
    let ends_there = |cell: &&Cell| cell.walls.iter().any(|wall| wall.neighbour.is_none());
    pattern.cells.iter().filter(ends_there).count()
}

/// How the widening ended, for people.
fn ended(widened: &Widened) -> String {
    let Some(obstacle) = &widened.obstacle else {
        return format!("converged in {} steps of free topology", widened.steps);
    };
    let at = |place: glam::DVec3| format!("near ({:.3}, {:.3}, {:.3})", place.x, place.y, place.z);
    let why = match *obstacle {
        Obstacle::Interrupted => return format!("interrupted after {} steps", widened.steps),
        Obstacle::Law(law) => format!("beyond, {law}"),
        Obstacle::Border { cells: [a, b], length, place } => format!(
            "beyond, a border of cells {a} and {b} vanishes {}, {length:.3} cell widths long, and no change of neighbours there leads to a balance",
            at(place)
        ),
        Obstacle::Slid { cells: [a, b], place } => format!(
            "beyond, the film between cells {a} and {b} slides round a corner between two open faces, {}",
            at(place)
        ),
        Obstacle::Uneven if widened.part >= 1.0 => {
            return "in balance on unevenly spread nodes only, which may be one of the mesh; ask for finer --elements"
                .to_owned();
        }
        Obstacle::Uneven => {
            "beyond, films are in balance on unevenly spread nodes only: ask for finer --elements".to_owned()
        }
        Obstacle::Unsettled { force } => format!("beyond, films come to no balance (force {force:.1e})"),
    };
    format!(
        "no foam of one layer in so wide a gap: walls {:.1} % as far from the middle surface are the widest reached; {why}",
        100.0 * widened.part
    )
}

fn table(figures: &Figures) -> Vec<Line> {
    let angles = match (figures.corner_angle_mean_deg, figures.corner_angle_worst_deg) {
        (Some(mean), Some(worst)) => format!("{mean:+.3}° in the mean, {worst:.2}° at most"),
        _ => "-".to_owned(),
    };
    let [lower, upper] = [0, 1].map(|wall| {
        let complete = by_sides(&figures.side_counts[wall]);
        let cut = match figures.cut_patches[wall] {
            0 => String::new(),
            cells => format!("cut: {cells}"),
        };
        let parts = [complete, cut].into_iter().filter(|part| !part.is_empty());
        parts.collect::<Vec<_>>().join(", ")
    });
    vec![
        ("space", figures.space.clone()),
        ("cells", figures.cells.to_string()),
        ("ended", figures.ended.clone()),
        ("energy", format!("{:.10}", figures.energy)),
        ("over flat foam", format!("{:.6}", figures.energy_over_flat)),
        ("sides on lower wall", format!("{lower}; charge {}", figures.charge[0])),
        ("sides on upper wall", format!("{upper}; charge {}", figures.charge[1])),
        (
            "other neighbours",
            format!(
                "{} cells on one wall than on the other ({} and {} without the lower and the upper one), {} corners inside the gap; films from wall to wall up to {:.0} % of it",
                figures.twisted_cells,
                figures.cells_off_walls[0],
                figures.cells_off_walls[1],
                figures.inner_corners,
                100.0 * figures.network_part
            ),
        ),
        ("corners off 109.47°", angles),
        ("pressures", format!("{:.4} to {:.4}, mean 0", figures.pressure_min, figures.pressure_max)),
        ("volume of the gap", format!("{:.12}", figures.gap_volume)),
        ("volume error", format!("{:.1e}", figures.volume_error)),
        (
            "changes of topology",
            format!("{} T1s at all heights, {} others", figures.t1_count, figures.free_changes),
        ),
        ("residual", format!("{:.1e}", figures.residual)),
        ("unstable directions", figures.unstable_directions.to_string()),
        (
            "lowest eigenvalue",
            figures.lowest_eigenvalue.map_or("-".to_owned(), |value| format!("{value:.2e}")),
        ),
    ]
}

fn real(count: usize) -> f64 {
    f64::from(crate::index::checked_u32(count))
}
