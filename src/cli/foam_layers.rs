//! `combwright foam --layers 2`: a sheet of cells on each wall.

use super::{
    CliError,
    foam_figures::{extrapolation, no_extrapolation, uneven},
    foam_run::{Line, by_sides, finished, watched},
    foam_settings::FoamSettings,
    interrupt, progress,
};
use crate::{
    foam::{
        free::{self, FreeFoam, FreeSettings, corner_angles, relaxed, tetrahedral_angle},
        layers::{
            Arrangement, Companions, Compared, LayerFigures, NoLayers, charged, companions, divided,
            layer_figures, plane_end, sheets,
        },
        relax::{Ending, Extrapolated},
        seeds::SeedError,
        setup::FoamSpace,
    },
    report::{folder::OutputFolder, layers as report, layers_defects},
};
use anyhow::anyhow;
use serde::Serialize;
use std::time::Instant;

/// How the cells of two layers are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum PatternName {
    /// As bees build between plane walls: three rhombi at an end
    Rhombic,
    /// As Fejes Tóth found: two hexagons and two rhombi at an end
    Toth,
    /// Annealed on both sides, each for itself
    Annealed,
}

impl From<PatternName> for Arrangement {
    fn from(name: PatternName) -> Self {
        match name {
            PatternName::Rhombic => Self::Rhombic,
            PatternName::Toth => Self::Toth,
            PatternName::Annealed => Self::Annealed,
        }
    }
}

/// The name and version of `summary.json`.
const SCHEMA: &str = "combwright.layers-summary/3";

/// Steps of the progress bar.
const BAR: u64 = 1000;
/// What a foam takes on two cores, by the cells on each wall: settling and Newton steps grow in proportion.
const SECONDS_PER_CELL: f64 = 0.4;

/// The figures of a two-layer foam.
#[derive(Serialize)]
struct Summary<'a> {
    schema: &'static str,
    version: &'static str,
    space: FoamSpace,
    pattern: Arrangement,
    cells_on_each_wall: usize,
    seed: u64,
    first_energy: f64,
    energy: f64,
    /// Whether the foam is in balance on evenly spread nodes.
    nodes_even: bool,
    /// The energy on elements of half the size, and without a mesh.
    extrapolated: Option<Extrapolated>,
    /// The least energy of ends with plane films, by formula, over one cell's opening.
    plane_end: Option<f64>,
    ended: String,
    steps: usize,
    force: f64,
    unstable: usize,
    /// Changes of topology on the way.
    flips: usize,
    vanishing_borders: usize,
    /// Cells that were squeezed off their own wall.
    cells_off_their_wall: usize,
    volume_spread: f64,
    corner_angle_mean_deg: f64,
    corner_angle_worst_deg: f64,
    layers: &'a [LayerFigures; 2],
    /// How the defects of the layers sit to each other.
    defects: &'a Companions,
    seconds: f64,
}

/// Makes a foam of two layers and writes its folder.
pub(super) fn run(settings: &FoamSettings, pattern: PatternName, fine: bool) -> Result<(), CliError> {
    let began = Instant::now();
    let mut folder = OutputFolder::begin(&settings.output)?;
    let gap = settings.space.gap().map_err(CliError::mistake)?;
    let domain = settings.space.domain().map_err(CliError::mistake)?;
    let (arrangement, cells) = (Arrangement::from(pattern), settings.seeds.count);
    interrupt::listen();
    let bar = progress::steps(BAR);
    let minutes = (as_f64(cells) * SECONDS_PER_CELL / 60.0).ceil();
    let stage = format!("layers settle; all takes about {minutes} min");
    let sheets = sheets(&settings.space, &gap, arrangement, cells, settings.seeds.seed, &mut |share| {
        watched(&bar, &stage, share)
    });
    let sheets = sheets.map_err(failed)?;
    let division = divided(&gap, &domain, &sheets).map_err(failed)?;
    // The same number of elements on each half side; the default is the coarsest.
    let fineness = if fine { settings.relax.strips.along } else { 1 };
    let tolerance = settings.relax.tolerance.max(1e-10);
    let how = FreeSettings {
        fineness,
        tolerance,
        // An arrangement that has a name stays what it is.
        changes_topology: arrangement == Arrangement::Annealed,
        ..FreeSettings::new(sheets.spacing)
    };
    let mut steps = 0;
    let layers = relaxed(division, &gap, &how, &mut |told| {
        steps += 1;
        bar.set_message(format!("Newton step {steps}, force {:.1e}", told.residuals.force));
        interrupt::flow()
    });
    let layers = layers.map_err(CliError::failure)?;
    let is_balanced = layers.descended.ending == Ending::Converged;
    let extrapolated = match settings.extrapolate && is_balanced {
        true => Some(
            free::extrapolate(&layers, &gap, &how, &mut |told| {
                bar.set_message(format!("finer films, force {:.1e}", told.residuals.force));
                interrupt::flow()
            })
            .map_err(CliError::failure)?,
        ),
        false => None,
    };
    bar.finish_and_clear();
    let figures = layer_figures(&layers.division);
    let sides = [&figures[0].sides[..], &figures[1].sides].concat();
    let defects = companions(&layers.division, &gap, &sides, sheets.spacing, settings.seeds.seed);
    let title = format!("{}, {cells} cells on each wall, {}", settings.space, arrangement.name());
    report::write_cells(&mut folder, &layers, &figures)?;
    report::picture(&layers, &figures, &gap, &title)?.write_png(&mut folder, "layers", 1.0)?;
    if defects.defects.iter().sum::<usize>() > 0 {
        let on_surface = charged(&layers.division, &gap, &sides);
        layers_defects::picture(&on_surface, &gap, sheets.spacing, &title)?.write_png(
            &mut folder,
            "defects",
            1.0,
        )?;
        let chart = layers_defects::chart(&defects, &title).map_err(CliError::failure)?;
        chart.write(&mut folder, "chance", 1.0)?;
    }
    let angles = angles(&layers);
    let summary = Summary {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        space: settings.space,
        pattern: arrangement,
        cells_on_each_wall: cells,
        seed: settings.seeds.seed,
        first_energy: layers.first_energy,
        energy: layers.energy,
        nodes_even: layers.is_even,
        extrapolated: extrapolated.flatten(),
        plane_end: plane_end(arrangement).map(|end| end.area),
        ended: ended(&layers),
        steps: layers.descended.steps,
        force: layers.descended.residuals.force,
        unstable: layers.descended.unstable,
        flips: layers.flips,
        vanishing_borders: layers.vanishing.len(),
        cells_off_their_wall: layers.leaving.len(),
        volume_spread: layers.volume_spread(),
        corner_angle_mean_deg: angles[0],
        corner_angle_worst_deg: angles[1],
        layers: &figures,
        defects: &defects,
        seconds: began.elapsed().as_secs_f64(),
    };
    folder.write_json("summary.json", &summary)?;
    let mut lines = table(&summary, &layers);
    lines.extend(accuracy(&layers, extrapolated));
    lines.extend(in_layers(&figures, &defects));
    lines.push(("time", format!("{:.1} s", summary.seconds)));
    let ended = summary.ended.clone();
    finished(folder, lines)?;
    // An arrangement that has a name may be no foam; cells that were sown at random are to become one.
    if is_balanced || arrangement != Arrangement::Annealed {
        return Ok(());
    }
    Err(CliError::failure(anyhow!("the two layers are in no balance: {ended}")))
}

/// What the mesh has to do with the energy.
fn accuracy(layers: &FreeFoam, extrapolated: Option<Option<Extrapolated>>) -> Vec<Line> {
    let is_uneven = layers.descended.ending == Ending::Converged && !layers.is_even;
    let mut lines: Vec<Line> = is_uneven.then(uneven).into_iter().collect();
    match extrapolated {
        None => {}
        Some(None) => lines.push(no_extrapolation()),
        Some(Some(found)) => lines.extend(extrapolation(&found)),
    }
    lines
}

/// The cells of both layers, and how their defects sit to each other.
fn in_layers(figures: &[LayerFigures; 2], defects: &Companions) -> Vec<Line> {
    let mut lines = vec![("lower layer", in_words(&figures[0])), ("upper layer", in_words(&figures[1]))];
    if defects.defects.iter().all(|&count| count > 0) {
        lines.extend(in_figures(defects));
    }
    lines
}

fn as_f64(count: usize) -> f64 {
    f64::from(crate::index::checked_u32(count))
}

fn failed(error: NoLayers) -> CliError {
    match error {
        NoLayers::Sown(SeedError::Interrupted { .. }) | NoLayers::Lost { .. } => {
            CliError::failure(anyhow!("{error}"))
        }
        _ => CliError::mistake(error),
    }
}

/// Mean and largest distance of the corners' angles from the tetrahedral angle, in degrees.
fn angles(layers: &FreeFoam) -> [f64; 2] {
    let angles = corner_angles(layers);
    let off = |angle: &f64| (angle - tetrahedral_angle()).to_degrees();
    let worst = angles.iter().map(|angle| off(angle).abs()).fold(0.0, f64::max);
    [angles.iter().map(off).sum::<f64>() / as_f64(angles.len().max(1)), worst]
}

fn ended(layers: &FreeFoam) -> String {
    let descended = &layers.descended;
    let vanishing = layers.vanishing.len();
    match descended.ending {
        Ending::Converged => format!("converged in {} Newton steps", descended.steps),
        Ending::StepLimit => {
            format!("step limit of {} reached, {vanishing} borders vanishing", descended.steps)
        }
        Ending::Stalled => format!("stalled after {} steps, {vanishing} borders vanishing", descended.steps),
        Ending::Halted if !layers.leaving.is_empty() => format!(
            "stopped after {} steps: the pressure in {} squeezes {} off its wall, so that there is no foam nearby with all cells on their walls; cells less deep keep them (fewer cells, or a narrower gap)",
            descended.steps,
            cells_of(layers.leaving.len()),
            if layers.leaving.len() == 1 { "it" } else { "each" },
        ),
        Ending::Halted => format!(
            "stopped after {} steps: {vanishing} borders vanish, where the foam would change its topology",
            descended.steps
        ),
    }
}

fn cells_of(count: usize) -> String {
    if count == 1 { "a cell".to_owned() } else { format!("{count} cells") }
}

fn table(summary: &Summary<'_>, layers: &FreeFoam) -> Vec<Line> {
    let mut lines = vec![
        ("space", summary.space.to_string()),
        ("cells on each wall", summary.cells_on_each_wall.to_string()),
        ("arrangement", summary.pattern.name().to_owned()),
        ("films", layers.films.complex.films.len().to_string()),
        ("energy, plane films", format!("{:.9}", summary.first_energy)),
        ("energy, curved films", format!("{:.9}", summary.energy)),
    ];
    if let Some(area) = summary.plane_end {
        lines.push(("plane ends by formula", format!("{area:.6} of an opening, flat ends 1")));
    }
    lines.extend([
        ("ended", summary.ended.clone()),
        ("changes of topology", summary.flips.to_string()),
        ("largest force", format!("{:.1e}", summary.force)),
        ("falling directions", summary.unstable.to_string()),
        ("spread of volumes", format!("{:.1e}", summary.volume_spread)),
        (
            "corners off 109.47°",
            format!(
                "{:.4}° in the mean, {:.2}° at most",
                summary.corner_angle_mean_deg, summary.corner_angle_worst_deg
            ),
        ),
    ]);
    lines
}

fn in_words(figures: &LayerFigures) -> String {
    format!("sides {}; end films {}", by_sides(&figures.side_counts), by_sides(&figures.end_counts))
}

fn in_contact(correlation: f64) -> String {
    if correlation.is_finite() {
        format!("correlation {correlation:+.3}")
    } else {
        "no correlation".to_owned()
    }
}

/// How the layers' defects sit to each other.
fn in_figures(defects: &Companions) -> Vec<Line> {
    let chance = |compared: &Compared| {
        let Compared { found, dealt, moved } = compared;
        format!(
            "{found:.3}; dealt anew {:.3} ± {:.3} (p = {:.3}), moved {:.3} ± {:.3} (p = {:.3})",
            dealt.mean, dealt.deviation, dealt.p, moved.mean, moved.deviation, moved.p
        )
    };
    vec![
        (
            "defects",
            format!("{} in the lower layer, {} in the upper", defects.defects[0], defects.defects[1]),
        ),
        ("charges that touch", in_contact(defects.contact_correlation)),
        ("charges over each other", chance(&defects.correlation)),
        ("nearest defect opposite", chance(&defects.nearest)),
    ]
}
