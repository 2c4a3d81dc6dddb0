//! A foam relaxed: from a start or a checkpoint to its folder.

use super::{
    CliError,
    foam_figures::{AnnealingFigures, Figures, table},
    foam_free::{self, Origin},
    foam_run,
    foam_settings::FoamSettings,
    interrupt,
};
use crate::{
    evolver::write::foam_datafile,
    foam::{
        audit::audit,
        checkpoint::{Checkpoint, StepRecord},
        energy::energy,
        flat_hexagonal_energy,
        network::Network,
        pattern::{PatternPlace, pattern_of_state},
        relax::{self, AnnealSettings, Annealed, Progress, RelaxSettings, Relaxed, State, Stop},
        seeds::{SeedSettings, Seeds},
        setup::FoamSpace,
        volume::{Reference, volumes},
    },
    report::{
        foam_chart, foam_export, foam_files,
        foam_picture::FoamScene,
        foam_surface::{CellFigures, pieces},
        folder::{OutputFolder, write_whole},
    },
    surface::{Gap, WallSide},
    tessellation::CellPattern,
};
use anyhow::anyhow;
use indicatif::ProgressBar;
use std::{
    fs, io,
    io::Write,
    ops::ControlFlow,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

pub(super) use super::foam_figures::in_words;

/// The name of the checkpoint in the folder of results.
const CHECKPOINT: &str = "checkpoint.json";

/// The time from one checkpoint to the next: short against the work that would be lost, long against writing one.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(20);

/// The relative difference of two measures of the gap's volume that is no error of theirs.
const HOLE: f64 = 1e-5;

/// What is relaxed, and where it came from.
pub(super) struct Job {
    pub(super) space: FoamSpace,
    pub(super) seeds: SeedSettings,
    pub(super) relax: RelaxSettings,
    pub(super) psi6: f64,
}

/// A foam as far as it came.
pub(super) struct Made {
    pub(super) relaxed: Relaxed,
    pub(super) record: Vec<StepRecord>,
    pub(super) figures: Figures,
    pub(super) pattern: CellPattern,
    pub(super) cells: CellFigures,
}

/// A checkpoint from a file, checked.
pub(super) fn read_checkpoint(path: &Path) -> Result<Box<Checkpoint>, CliError> {
    let file = match path {
        folder if folder.is_dir() => folder.join(CHECKPOINT),
        file if file.exists() => file.to_path_buf(),
        stem => stem.with_extension("json"),
    };
    let named = |error: anyhow::Error| CliError::mistake(error.context(format!("{}", file.display())));
    let bytes = fs::read(&file).map_err(|error| named(anyhow!("cannot be read: {error}")))?;
    Ok(Box::new(Checkpoint::read(&bytes).map_err(|error| named(error.into()))?))
}

/// Seeds, partition, relaxation, files.
pub(super) fn run(
    settings: &FoamSettings,
    gap: &Gap,
    bar: &ProgressBar,
    mut folder: OutputFolder,
) -> Result<(), CliError> {
    let began = Instant::now();
    let start = foam_run::started(settings, gap, bar)?;
    let until_partition = began.elapsed().as_secs_f64();
    let job = Job::new(settings, start.seeds.psi6);
    let mut keeper = Keeper::new(&job, bar, Some(folder.target().join(CHECKPOINT)), Vec::new());
    let relaxed = keeper.relax(Begin::Network { network: start.network, part: start.part }, gap)?;
    let until_relaxed = began.elapsed().as_secs_f64();
    if goes_on(&relaxed) {
        let gap_volume = (start.part >= 1.0).then(|| start.partition.volume());
        let (seeds, network) = (Some(&start.seeds), &relaxed.state);
        let origin = Origin { job: &job, settings, seeds, gap, gap_volume, network };
        let seconds = vec![
            ("seeds and partition", until_partition),
            ("films from wall to wall", until_relaxed - until_partition),
        ];
        let checkpoint = folder.target().join(CHECKPOINT);
        foam_free::run(&origin, keeper.record, seconds, bar, folder)?;
        return remove(&checkpoint);
    }
    let (relaxed, annealing) = annealed(&job, gap, relaxed, settings.anneal, bar)?;
    let made = Made::new(&job, gap, relaxed, keeper.record)?.finished(&job, settings, gap, annealing)?;
    if start.part >= 1.0 {
        made.fills(start.partition.volume())?;
    }
    let seconds = vec![
        ("seeds and partition", until_partition),
        ("relaxation", until_relaxed - until_partition),
        ("annealing and figures", began.elapsed().as_secs_f64() - until_relaxed),
    ];
    write_all(&mut folder, &job, settings, gap, &made, Some(&start.seeds), seconds)?;
    bar.finish_and_clear();
    end(folder, &job, &made)
}

/// Goes on from a checkpoint.
pub(super) fn resume(checkpoint: Checkpoint, mut settings: FoamSettings) -> Result<(), CliError> {
    let mut folder = OutputFolder::begin(&settings.output)?;
    let Checkpoint { space, seeds, relax, psi6, record, state, .. } = checkpoint;
    let job = Job { space, seeds, relax, psi6 };
    settings.space = space;
    settings.seeds = seeds;
    settings.relax = job.relax.clone();
    let gap = space.gap().map_err(CliError::mistake)?;
    interrupt::listen();
    let bar = super::progress::steps(1000);
    let began = Instant::now();
    let mut keeper = Keeper::new(&job, &bar, Some(folder.target().join(CHECKPOINT)), record);
    let relaxed = keeper.relax(Begin::State(state), &gap)?;
    if goes_on(&relaxed) {
        let (settings, gap, network) = (&settings, &gap, &relaxed.state);
        let origin = Origin { job: &job, settings, seeds: None, gap, gap_volume: None, network };
        let seconds = vec![("films from wall to wall, resumed", began.elapsed().as_secs_f64())];
        let checkpoint = folder.target().join(CHECKPOINT);
        foam_free::run(&origin, keeper.record, seconds, &bar, folder)?;
        return remove(&checkpoint);
    }
    let (relaxed, annealing) = annealed(&job, &gap, relaxed, settings.anneal, &bar)?;
    let made = Made::new(&job, &gap, relaxed, keeper.record)?.finished(&job, &settings, &gap, annealing)?;
    let seconds = vec![("relaxation, resumed", began.elapsed().as_secs_f64())];
    write_all(&mut folder, &job, &settings, &gap, &made, None, seconds)?;
    bar.finish_and_clear();
    end(folder, &job, &made)
}

/// Whether a foam that ended where a film vanishes on one wall goes on with free topology.
fn goes_on(relaxed: &Relaxed) -> bool {
    matches!(relaxed.stop, Stop::TooWide { .. })
}

impl Job {
    pub(super) fn new(settings: &FoamSettings, psi6: f64) -> Self {
        Self { space: settings.space, seeds: settings.seeds, relax: settings.relax.clone(), psi6 }
    }
}

/// Where a relaxation begins.
pub(super) enum Begin {
    /// In this part of the gap.
    Network {
        network: Network,
        part: f64,
    },
    State(State),
}

/// Watches a relaxation: progress bar, record, checkpoints, Ctrl-C.
pub(super) struct Keeper<'a> {
    job: &'a Job,
    bar: &'a ProgressBar,
    checkpoint: Option<PathBuf>,
    pub(super) record: Vec<StepRecord>,
    saved: Instant,
    failed: Option<CliError>,
}

impl<'a> Keeper<'a> {
    pub(super) fn new(
        job: &'a Job,
        bar: &'a ProgressBar,
        checkpoint: Option<PathBuf>,
        record: Vec<StepRecord>,
    ) -> Self {
        Self { job, bar, checkpoint, record, saved: Instant::now(), failed: None }
    }

    /// Relaxes; a checkpoint that cannot be written ends it.
    pub(super) fn relax(&mut self, begin: Begin, gap: &Gap) -> Result<Relaxed, CliError> {
        let settings = &self.job.relax;
        let relaxed = match begin {
            Begin::Network { network, part } => {
                relax::relax_widening(network, part, gap, settings, &mut |progress| self.watch(progress))
            }
            Begin::State(state) => relax::resume(state, gap, settings, &mut |progress| self.watch(progress)),
        };
        match self.failed.take() {
            Some(error) => Err(error),
            None => relaxed.map_err(CliError::failure),
        }
    }

    fn watch(&mut self, progress: &Progress<'_>) -> ControlFlow<()> {
        self.record.push(StepRecord {
            step: progress.state.steps,
            energy: progress.energy,
            force: progress.residuals.force,
            volume: progress.residuals.volume,
            fraction: progress.fraction,
            unstable: progress.unstable,
            flips: progress.state.flips,
        });
        self.bar.set_message(format!(
            "relaxing: step {}, energy {:.8}, force {:.1e}, {} T1s",
            progress.state.steps, progress.energy, progress.residuals.force, progress.state.flips
        ));
        let flow = interrupt::flow();
        let due = flow.is_break() || self.saved.elapsed() > CHECKPOINT_INTERVAL;
        if due && let Some(path) = &self.checkpoint {
            self.saved = Instant::now();
            if let Err(error) = save(path, self.job, &self.record, progress.state) {
                self.failed = Some(error);
                return ControlFlow::Break(());
            }
        }
        flow
    }
}

fn save(path: &Path, job: &Job, record: &[StepRecord], state: &State) -> Result<(), CliError> {
    if let Some(parent) = path.parent() {
        let failed = |error| crate::report::folder::OutputError::new("make the folder", parent, error);
        fs::create_dir_all(parent).map_err(failed)?;
    }
    let Job { space, seeds, relax, psi6 } = job;
    let checkpoint = Checkpoint::new(*space, *seeds, relax.clone(), *psi6, record.to_vec(), state.clone());
    let write = |writer: &mut io::BufWriter<&mut fs::File>| {
        serde_json::to_writer(&mut *writer, &checkpoint)?;
        writer.write_all(b"\n")
    };
    Ok(write_whole(path, write)?)
}

/// A settled foam disturbed `cycles` times; another one as it is.
pub(super) fn annealed(
    job: &Job,
    gap: &Gap,
    relaxed: Relaxed,
    cycles: usize,
    bar: &ProgressBar,
) -> Result<(Relaxed, Option<AnnealingFigures>), CliError> {
    if cycles == 0 || !matches!(relaxed.stop, Stop::Converged { .. }) {
        return Ok((relaxed, None));
    }
    let domain = job.space.domain().map_err(CliError::mistake)?;
    let settings = AnnealSettings { cycles, seed: job.seeds.seed };
    let told = &mut |cycle| {
        bar.set_message(format!("annealing: disturbance {} of {cycles}", cycle + 1));
        interrupt::flow()
    };
    let annealed = relax::anneal(relaxed, gap, &domain, &job.relax, settings, told);
    let Annealed { relaxed, before, settled, kept, .. } = annealed.map_err(CliError::failure)?;
    Ok((relaxed, Some(AnnealingFigures { cycles, settled, kept, energy_before: before })))
}

impl Made {
    /// The figures of a foam. One in a part of the gap is described in the space that it fills.
    pub(super) fn new(
        job: &Job,
        gap: &Gap,
        relaxed: Relaxed,
        record: Vec<StepRecord>,
    ) -> Result<Self, CliError> {
        let state = &relaxed.state;
        let (space, gap) = (job.space.narrowed(state.part), &gap.narrowed(state.part));
        let complex = state.strips.complex(&state.network, gap);
        let reference = Reference::new(&complex, &state.places);
        let volumes = volumes(&complex, &state.places, &reference).into_vec();
        let pattern = pattern_of_state(state, gap, PatternPlace::Middle).map_err(no_pattern)?;
        let mean = state.pressures.iter().sum::<f64>() / real(state.pressures.len());
        let cells = CellFigures {
            sides: pattern.cells.iter().map(|cell| cell.sides.unwrap_or(0)).collect(),
            pressures: state.pressures.iter().map(|pressure| pressure - mean).collect(),
            gauss_curvature: pattern
                .cells
                .iter()
                .map(|cell| cell.gauss_curvature.unwrap_or(f64::NAN))
                .collect(),
            volumes,
        };
        let total: f64 = cells.volumes.iter().sum();
        let energy = energy(&complex, &state.places);
        let domain = space.domain().map_err(CliError::mistake)?;
        let flat = flat_hexagonal_energy(gap, &domain, cells.volumes.len());
        let error = |(volume, share): (&f64, &f64)| (volume / (share * total) - 1.0).abs();
        let figures = Figures {
            schema: foam_run::SUMMARY_SCHEMA,
            cells: cells.volumes.len(),
            space: space.to_string(),
            energy,
            flat_hexagonal_energy: flat,
            energy_over_flat: energy / flat,
            side_counts: pattern.side_counts(),
            cut_cells: cells.sides.iter().filter(|&&sides| sides == 0).count(),
            charge: pattern.charge(),
            gap_volume: total,
            volume_error: cells.volumes.iter().zip(&state.shares).map(error).fold(0.0, f64::max),
            pressure_min: cells.pressures.iter().copied().fold(f64::INFINITY, f64::min),
            pressure_max: cells.pressures.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            t1_count: state.flips,
            newton_steps: state.steps,
            residual: relaxed.residuals.force,
            unstable_directions: relaxed.unstable,
            lowest_eigenvalue: None,
            audit: audit(state, gap),
            psi6_of_seeds: job.psi6,
            annealing: None,
            extrapolated: None,
            ended: relaxed.stop,
        };
        Ok(Self { relaxed, record, figures, pattern, cells })
    }
}

impl Made {
    /// Whether the cells fill the whole gap, whose volume the partition measured on its own: cells that were lost at a corner
    /// or between two planes would leave a hole, which no residual shows.
    fn fills(&self, gap_volume: f64) -> Result<(), CliError> {
        let missing = self.figures.gap_volume / gap_volume - 1.0;
        if self.relaxed.state.part < 1.0 || missing.abs() < HOLE {
            return Ok(());
        }
        Err(CliError::failure(anyhow!(
            "the cells fill {:.3e} of the gap's volume too much: a film has left the box at a corner, with too few cells for these faces. Ask for more cells or another seed",
            missing
        )))
    }

    /// With what takes some more time: a settled foam's lowest eigenvalue, and its energy without a mesh if asked for.
    pub(super) fn finished(
        mut self,
        job: &Job,
        settings: &FoamSettings,
        gap: &Gap,
        annealing: Option<AnnealingFigures>,
    ) -> Result<Self, CliError> {
        self.figures.annealing = annealing;
        if matches!(self.figures.ended, Stop::Converged { .. }) {
            let state = &self.relaxed.state;
            self.figures.lowest_eigenvalue = relax::lowest_eigenvalue(state, gap).ok();
            if settings.extrapolate {
                self.figures.extrapolated = relax::extrapolate(state, gap, &job.relax, &mut interrupt::flow)
                    .map_err(CliError::failure)?;
            }
        }
        Ok(self)
    }
}

pub(super) fn no_pattern(defects: Vec<crate::tessellation::PatternDefect>) -> CliError {
    let first = defects.first().map(ToString::to_string).unwrap_or_default();
    CliError::failure(anyhow!("the foam gave no pattern: {} defects, such as: {first}", defects.len()))
}

fn real(count: usize) -> f64 {
    f64::from(crate::index::checked_u32(count))
}

/// Writes every file of a foam.
pub(super) fn write_all(
    folder: &mut OutputFolder,
    job: &Job,
    settings: &FoamSettings,
    gap: &Gap,
    made: &Made,
    seeds: Option<&Seeds>,
    seconds: Vec<(&'static str, f64)>,
) -> Result<(), CliError> {
    let state = &made.relaxed.state;
    let (space, gap) = (job.space.narrowed(state.part), &gap.narrowed(state.part));
    folder.write_json("pattern.json", &made.pattern)?;
    for (name, wall) in
        [("pattern-lower-wall.json", WallSide::Lower), ("pattern-upper-wall.json", WallSide::Upper)]
    {
        let pattern = pattern_of_state(state, gap, PatternPlace::Wall(wall)).map_err(no_pattern)?;
        folder.write_json(name, &pattern)?;
    }
    foam_files::write_cells(folder, &made.pattern, &made.cells.volumes, Some(&made.cells.pressures))?;
    let surface = pieces(state, gap);
    folder.write("films.vtp", |writer| foam_export::write_vtp(writer, &surface, &made.cells))?;
    folder.write("films.glb", |writer| foam_export::write_glb(writer, &surface, &made.cells))?;
    let title = format!("{space}, N = {}: relaxed foam", made.figures.cells);
    FoamScene::of_foam(&surface, &made.cells, gap, title).draw()?.write_png(folder, "foam", 1.0)?;
    if !made.record.is_empty() {
        let chart = foam_chart::relaxation(&made.record).map_err(CliError::failure)?;
        folder.write_bytes("energy.svg", chart.svg().as_bytes())?;
        foam_files::write_steps(folder, &made.record)?;
    }
    if let Some(seeds) = seeds {
        foam_run::write_seeds(folder, seeds)?;
    }
    if let Some(name) = &settings.write_fe {
        let complex = state.strips.complex(&state.network, gap);
        let title =
            format!("{space}, N = {}, by combwright {}", made.figures.cells, env!("CARGO_PKG_VERSION"));
        let text = foam_datafile(&space, &complex, &state.places, &title).map_err(CliError::mistake)?;
        folder.write_bytes(name.as_str(), text.as_bytes())?;
    }
    folder.write_json("summary.json", &made.figures)?;
    foam_run::write_run(folder, settings, seconds, &in_words(made.figures.ended))
}

/// Removes a checkpoint of a run that has come to its end.
fn remove(checkpoint: &Path) -> Result<(), CliError> {
    match fs::remove_file(checkpoint) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(CliError::failure(error)),
        _ => Ok(()),
    }
}

/// Moves the files into place, prints the table, and tells a foam that is not converged from one that is.
fn end(folder: OutputFolder, job: &Job, made: &Made) -> Result<(), CliError> {
    let checkpoint = folder.target().join(CHECKPOINT);
    match made.figures.ended {
        Stop::Converged { .. } => {
            foam_run::finished(folder, table(&made.figures))?;
            remove(&checkpoint)
        }
        stop @ Stop::TooWide { .. } => {
            let space = &made.figures.space;
            let said = format!("{}. The folder holds the foam of {space}", in_words(stop));
            foam_run::finished(folder, table(&made.figures))?;
            remove(&checkpoint)?;
            Err(CliError::failure(anyhow!("{said}. Ask for a narrower gap, or for it as it is there")))
        }
        stop => {
            save(&checkpoint, job, &made.record, &made.relaxed.state)?;
            foam_run::finished(folder, table(&made.figures))?;
            let resume = format!("go on with: combwright foam --resume {}", checkpoint.display());
            Err(CliError::failure(anyhow!("the foam is {}; {resume}", in_words(stop))))
        }
    }
}
