//! Many foams of one kind with different seeds: the best, and how energies and defects are distributed.

use super::{
    CliError,
    foam_figures::{AnnealingFigures, in_words},
    foam_relax::{Begin, Job, Keeper, Made, annealed, write_all},
    foam_run::{self, Line},
    foam_settings::FoamSettings,
    interrupt, progress,
};
use crate::{
    foam::{relax::Stop, seeds::Seeds, start::start_in_part},
    report::{foam_chart, folder::OutputFolder},
    surface::Gap,
};
use anyhow::anyhow;
use indicatif::ProgressBar;
use rayon::prelude::*;
use serde::Serialize;
use std::{
    cmp::Reverse,
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
    time::Instant,
};

/// One run, as a row of `runs.csv`.
#[derive(Clone, Debug, Serialize)]
struct Row {
    seed: u64,
    energy: Option<f64>,
    converged: bool,
    /// Side counts in words.
    sides: String,
    t1_count: Option<usize>,
    newton_steps: Option<usize>,
    residual: Option<f64>,
    seconds: f64,
    ended: String,
}

/// The foam of least energy so far.
struct Best {
    seed: u64,
    job: Job,
    seeds: Seeds,
    made: Made,
    annealing: Option<AnnealingFigures>,
}

/// What one run gave.
type MadeRun = (Job, Seeds, Made, Option<AnnealingFigures>);

/// Makes all foams, writes their distribution and all files of the best.
pub(super) fn run(settings: &FoamSettings) -> Result<(), CliError> {
    let mut folder = OutputFolder::begin(&settings.output)?;
    let gap = settings.space.gap().map_err(CliError::mistake)?;
    interrupt::listen();
    let began = Instant::now();
    let bar = progress::steps(settings.runs);
    let best = Mutex::new(None);
    let first = settings.seeds.seed;
    let rows: Vec<Row> = (0..settings.runs)
        .into_par_iter()
        .filter(|_| interrupt::flow().is_continue())
        .map(|run| {
            let row = one(&settings.with_seed(first.wrapping_add(run)), &gap, &best);
            bar.inc(1);
            row
        })
        .collect();
    bar.finish_and_clear();
    let best = best.into_inner().unwrap_or_else(PoisonError::into_inner);
    write_rows(&mut folder, &rows)?;
    let energies: Vec<f64> = rows.iter().filter(|row| row.converged).filter_map(|row| row.energy).collect();
    let Some(Best { seed, job, seeds, made, annealing }) = best else {
        folder.commit()?;
        let first = rows.first().map_or("interrupted before the first ended", |row| &row.ended);
        return Err(CliError::failure(anyhow!("none of {} runs converged; the first: {first}", rows.len())));
    };
    let made = made.finished(&job, settings, &gap, annealing)?;
    let chart = foam_chart::energies(&energies).map_err(CliError::failure)?;
    folder.write_bytes("runs.svg", chart.svg().as_bytes())?;
    let seconds = vec![("all runs", began.elapsed().as_secs_f64())];
    write_all(&mut folder, &job, &settings.with_seed(seed), &gap, &made, Some(&seeds), seconds)?;
    let mut lines = vec![
        ("space", job.space.to_string()),
        ("runs", format!("{} of {} converged", energies.len(), rows.len())),
        ("best energy", format!("{:.10} (seed {seed})", made.figures.energy)),
        ("best cells by sides", foam_run::by_sides(&made.figures.side_counts)),
    ];
    lines.extend(distribution(&rows));
    lines.extend(made.figures.extra_lines());
    lines.push(("time", format!("{:.1} s", began.elapsed().as_secs_f64())));
    foam_run::finished(folder, lines)
}

/// Energies that differ by less than this part are of the same foam: the residual's square, and the mesh's nodes.
const SAME_ENERGY: f64 = 1e-8;

/// Numbers of sides named before the rest is only counted.
const NAMED: usize = 4;

/// How energies and defects are distributed, and why runs failed.
fn distribution(rows: &[Row]) -> Vec<Line> {
    let mut energies: Vec<f64> =
        rows.iter().filter(|row| row.converged).filter_map(|row| row.energy).collect();
    energies.sort_by(f64::total_cmp);
    let mut lines = Vec::new();
    if let (Some(&least), Some(&most)) = (energies.first(), energies.last()) {
        let count = energies.len();
        let at = |share: usize| energies[(share * (count - 1) + 2) / 4];
        let mean = energies.iter().sum::<f64>() / f64::from(crate::index::checked_u32(count));
        let lowest = energies.iter().filter(|&&energy| energy < least * (1.0 + SAME_ENERGY)).count();
        let quartiles = format!("{:.8}, {:.8}, {:.8}", at(1), at(2), at(3));
        lines.push(("mean energy", format!("{mean:.10}")));
        lines.push(("quartiles", quartiles));
        lines.push(("highest energy", format!("{most:.10}")));
        lines.push(("runs at the lowest", lowest.to_string()));
    }
    let sides = counted(rows.iter().filter(|row| row.converged).map(|row| row.sides.as_str()));
    for (sides, count) in sides.iter().take(NAMED) {
        lines.push(("cells by sides", format!("{sides}: {count} runs")));
    }
    if sides.len() > NAMED {
        lines.push(("cells by sides", format!("{} other ways", sides.len() - NAMED)));
    }
    for row in rows.iter().filter(|row| !row.converged) {
        lines.push(("failed", format!("seed {}: {}", row.seed, row.ended)));
    }
    lines
}

/// How often each text occurs, the commonest first.
fn counted<'a>(texts: impl Iterator<Item = &'a str>) -> Vec<(&'a str, usize)> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for text in texts {
        *counts.entry(text).or_default() += 1;
    }
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|&(_, count)| Reverse(count));
    counts
}

/// One run; keeps it if it is the best.
fn one(settings: &FoamSettings, gap: &Gap, best: &Mutex<Option<Best>>) -> Row {
    let began = Instant::now();
    let seed = settings.seeds.seed;
    let made = make(settings, gap);
    let seconds = began.elapsed().as_secs_f64();
    let (job, seeds, made, annealing) = match made {
        Ok(made) => made,
        Err(error) => return Row::failed(seed, seconds, &error),
    };
    let figures = &made.figures;
    let converged = matches!(figures.ended, Stop::Converged { .. });
    let row = Row {
        seed,
        // A foam in a part of the gap is another one.
        energy: (made.relaxed.state.part >= 1.0).then_some(figures.energy),
        converged,
        sides: foam_run::by_sides(&figures.side_counts),
        t1_count: Some(figures.t1_count),
        newton_steps: Some(figures.newton_steps),
        residual: Some(figures.residual),
        seconds,
        ended: in_words(figures.ended),
    };
    if converged {
        let mut best = best.lock().unwrap_or_else(PoisonError::into_inner);
        // Equal energies are told apart by the seed, so that the order in which runs end does not matter.
        let better = best.as_ref().is_none_or(|best| {
            let (old, new) = (best.made.figures.energy, figures.energy);
            new.total_cmp(&old).then(seed.cmp(&best.seed)).is_lt()
        });
        if better {
            *best = Some(Best { seed, job, seeds, made, annealing });
        }
    }
    row
}

fn make(settings: &FoamSettings, gap: &Gap) -> Result<MadeRun, CliError> {
    let domain = settings.space.domain().map_err(CliError::mistake)?;
    let start = start_in_part(gap, &domain, &settings.seeds, &mut |_| interrupt::flow())
        .map_err(CliError::failure)?;
    let job = Job::new(settings, start.seeds.psi6);
    let hidden = ProgressBar::hidden();
    let mut keeper = Keeper::new(&job, &hidden, None, Vec::new());
    let relaxed = keeper.relax(Begin::Network { network: start.network, part: start.part }, gap)?;
    let (relaxed, annealing) = annealed(&job, gap, relaxed, settings.anneal, &hidden)?;
    let made = Made::new(&job, gap, relaxed, keeper.record)?;
    Ok((job, start.seeds, made, annealing))
}

impl Row {
    fn failed(seed: u64, seconds: f64, error: &CliError) -> Self {
        Self {
            seed,
            energy: None,
            converged: false,
            sides: String::new(),
            t1_count: None,
            newton_steps: None,
            residual: None,
            seconds,
            ended: error.to_string(),
        }
    }
}

fn write_rows(folder: &mut OutputFolder, rows: &[Row]) -> Result<(), CliError> {
    Ok(folder.write("runs.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        for row in rows {
            table.serialize(row)?;
        }
        table.flush()
    })?)
}
