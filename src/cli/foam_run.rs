//! One foam, from settings to its folder.

use super::{
    CliError, foam_relax,
    foam_settings::{FoamSettings, Stage},
    interrupt, progress,
};
use crate::{
    foam::{
        pattern::{PatternPlace, pattern_of_partition},
        seeds::{SeedError, Seeds, sow},
        start::{Start, StartError, start, start_in_part},
    },
    report::{foam_chart, foam_files, foam_picture::FoamScene, folder::OutputFolder},
    surface::{Gap, WallSide},
    tessellation::CellPattern,
};
use anyhow::anyhow;
use indicatif::ProgressBar;
use serde::Serialize;
use std::{
    fmt::Write as _,
    io::{self, Write as _},
    ops::ControlFlow,
    time::Instant,
};

/// The name and version of a foam's `summary.json` and `run.json`.
pub(super) const SUMMARY_SCHEMA: &str = "combwright.foam-summary/1";
const RUN_SCHEMA: &str = "combwright.foam-run/1";

/// Steps of the progress bar per stage.
const BAR: u64 = 1000;

/// How a foam came about: written to `run.json`.
#[derive(Serialize)]
struct RunRecord<'a> {
    schema: &'static str,
    version: &'static str,
    settings: &'a FoamSettings,
    seconds: Vec<(&'static str, f64)>,
    ended: String,
}

/// The figures of a foam: `summary.json`.
#[derive(Serialize)]
struct Summary {
    schema: &'static str,
    cells: usize,
    space: String,
    gap_volume: f64,
    /// The standard deviation of the cells' volumes over their mean.
    volume_spread: f64,
    /// How many cells have 0, 1, 2 … sides.
    side_counts: Vec<usize>,
    /// Σ (6 − n).
    charge: i64,
    psi6: f64,
    /// Cells with other neighbours on one wall than on the other.
    twisted_cells: usize,
    /// Draws of seeds that gave no sound partition.
    rejected_draws: usize,
}

/// Makes one foam and writes its folder.
pub(super) fn run(settings: &FoamSettings) -> Result<(), CliError> {
    let mut folder = OutputFolder::begin(&settings.output)?;
    let gap = settings.space.gap().map_err(CliError::mistake)?;
    interrupt::listen();
    let bar = progress::steps(BAR);
    let ended = match settings.last_stage {
        Stage::Seeds => seeds_only(settings, &gap, &bar, &mut folder),
        Stage::Partition => partition(settings, &gap, &bar, &mut folder),
        Stage::Foam => {
            return foam_relax::run(settings, &gap, &bar, folder);
        }
    };
    bar.finish_and_clear();
    finished(folder, ended?)
}

/// Moves the files into place and prints the table.
pub(super) fn finished(folder: OutputFolder, lines: Vec<Line>) -> Result<(), CliError> {
    let target = folder.target().display().to_string();
    folder.commit()?;
    print_lines(lines.into_iter().chain([("written to", target)]))
}

/// Prints names and values in two columns.
pub(super) fn print_lines(lines: impl IntoIterator<Item = Line>) -> Result<(), CliError> {
    let mut text = String::new();
    for (name, value) in lines {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<24}{value}");
    }
    match io::stdout().write_all(text.as_bytes()) {
        // Whoever reads may stop reading: the files are written.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::failure(error)),
        _ => Ok(()),
    }
}

/// A line of the table on stdout.
pub(super) type Line = (&'static str, String);

fn seeds_only(
    settings: &FoamSettings,
    gap: &Gap,
    bar: &ProgressBar,
    folder: &mut OutputFolder,
) -> Result<Vec<Line>, CliError> {
    let domain = settings.space.domain().map_err(CliError::mistake)?;
    let began = Instant::now();
    let seeds = sow(gap, &domain, &settings.seeds, 0, &mut |share| watched(bar, "annealing seeds", share))
        .map_err(|error| seeds_failed(StartError::Seeds(error)))?;
    let seconds = began.elapsed().as_secs_f64();
    write_seeds(folder, &seeds)?;
    write_run(folder, settings, vec![("seeds", seconds)], "stopped after the seeds, as asked")?;
    Ok(vec![
        ("space", settings.space.to_string()),
        ("seeds", seeds.points.len().to_string()),
        ("order |ψ6|", format!("{:.4}", seeds.psi6)),
        ("time", format!("{seconds:.2} s")),
    ])
}

/// Seeds and partition with the progress bar; in a deep gap those of its midst, unless the partition itself is wanted.
pub(super) fn started(settings: &FoamSettings, gap: &Gap, bar: &ProgressBar) -> Result<Start, CliError> {
    let domain = settings.space.domain().map_err(CliError::mistake)?;
    let start = if settings.last_stage == Stage::Partition { start } else { start_in_part };
    start(gap, &domain, &settings.seeds, &mut |share| watched(bar, "annealing seeds", share))
        .map_err(seeds_failed)
}

/// Shows how far a stage has come and asks whether it shall go on.
pub(super) fn watched(bar: &ProgressBar, stage: &str, share: f64) -> ControlFlow<()> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of the bar's length"
    )]
    bar.set_position((share * 1000.0) as u64);
    bar.set_message(stage.to_owned());
    interrupt::flow()
}

fn seeds_failed(error: StartError) -> CliError {
    match error {
        StartError::Seeds(SeedError::Interrupted { .. }) => {
            CliError::failure(anyhow!("{error}; nothing was written, since seeds are quick to make again"))
        }
        StartError::Seeds(_) => CliError::mistake(error),
        StartError::Unsound { .. } => {
            CliError::mistake(anyhow!("{error}. Ask for another number of cells or a narrower gap"))
        }
    }
}

fn partition(
    settings: &FoamSettings,
    gap: &Gap,
    bar: &ProgressBar,
    folder: &mut OutputFolder,
) -> Result<Vec<Line>, CliError> {
    let began = Instant::now();
    let start = started(settings, gap, bar)?;
    let seconds = began.elapsed().as_secs_f64();
    bar.set_message("writing");
    let pattern = write_patterns(folder, &start, gap)?;
    let volumes: Vec<f64> = start.partition.cells().iter().map(|cell| cell.volume).collect();
    foam_files::write_cells(folder, &pattern, &volumes, None)?;
    foam_files::write_partition(folder, &start.partition, gap)?;
    write_seeds(folder, &start.seeds)?;
    let title = format!("{}, N = {}: Voronoi partition", settings.space, settings.seeds.count);
    FoamScene::of_partition(&start.partition, gap, title).draw()?.write_png(folder, "foam", 1.0)?;
    let summary = summary(settings, &start, &pattern, &volumes);
    folder.write_json("summary.json", &summary)?;
    write_run(folder, settings, vec![("seeds and partition", seconds)], "stopped after the partition")?;
    Ok(table(&summary, seconds))
}

fn summary(settings: &FoamSettings, start: &Start, pattern: &CellPattern, volumes: &[f64]) -> Summary {
    let total = start.partition.volume();
    #[expect(clippy::cast_precision_loss, reason = "counts of cells lie far below 2^53")]
    let mean = total / volumes.len() as f64;
    let squares: f64 = volumes.iter().map(|volume| (volume / mean - 1.0).powi(2)).sum();
    Summary {
        schema: SUMMARY_SCHEMA,
        cells: volumes.len(),
        space: settings.space.to_string(),
        gap_volume: total,
        volume_spread: (squares * mean / total).sqrt(),
        side_counts: pattern.side_counts(),
        charge: pattern.charge(),
        psi6: start.seeds.psi6,
        twisted_cells: start.partition.cells().iter().filter(|cell| cell.is_twisted()).count(),
        rejected_draws: start.rejected.len(),
    }
}

fn table(summary: &Summary, seconds: f64) -> Vec<Line> {
    vec![
        ("space", summary.space.clone()),
        ("cells", summary.cells.to_string()),
        ("cells by sides", by_sides(&summary.side_counts)),
        ("charge Σ(6−n)", summary.charge.to_string()),
        ("volume of the gap", format!("{:.12}", summary.gap_volume)),
        ("spread of volumes", format!("{:.2} %", 100.0 * summary.volume_spread)),
        ("cells twisted", summary.twisted_cells.to_string()),
        ("draws rejected", summary.rejected_draws.to_string()),
        ("time", format!("{seconds:.2} s")),
    ]
}

/// Side counts in words: `5: 2, 6: 36`.
pub(super) fn by_sides(counts: &[usize]) -> String {
    let seen = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    seen.map(|(sides, count)| format!("{sides}: {count}")).collect::<Vec<_>>().join(", ")
}

/// Writes the patterns of the middle surface and of both walls; gives the first.
fn write_patterns(folder: &mut OutputFolder, start: &Start, gap: &Gap) -> Result<CellPattern, CliError> {
    let pattern = |place| {
        pattern_of_partition(&start.partition, gap, place).map_err(|defects| {
            CliError::failure(anyhow!(
                "the partition gave no pattern: {} defects, such as {:?}",
                defects.len(),
                defects.first()
            ))
        })
    };
    let middle = pattern(PatternPlace::Middle)?;
    folder.write_json("pattern.json", &middle)?;
    folder.write_json("pattern-lower-wall.json", &pattern(PatternPlace::Wall(WallSide::Lower))?)?;
    folder.write_json("pattern-upper-wall.json", &pattern(PatternPlace::Wall(WallSide::Upper))?)?;
    Ok(middle)
}

pub(super) fn write_seeds(folder: &mut OutputFolder, seeds: &Seeds) -> Result<(), CliError> {
    foam_files::write_seeds(folder, seeds)?;
    if !seeds.trace.is_empty() {
        let chart = foam_chart::annealing(&seeds.trace).map_err(CliError::failure)?;
        folder.write_bytes("anneal.svg", chart.svg().as_bytes())?;
    }
    Ok(())
}

pub(super) fn write_run(
    folder: &mut OutputFolder,
    settings: &FoamSettings,
    seconds: Vec<(&'static str, f64)>,
    ended: &str,
) -> Result<(), CliError> {
    let record = RunRecord {
        schema: RUN_SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        settings,
        seconds,
        ended: ended.to_owned(),
    };
    Ok(folder.write_json("run.json", &record)?)
}
