//! The demo's foams: one, or several where one has few cells.

use super::{
    CliError,
    foam_relax::{self, Begin, Job, Keeper, Made},
    foam_run,
    foam_settings::{FoamSettings, Stage},
};
use crate::{
    compare::Sample,
    foam::{
        relax::{RelaxSettings, Stop},
        seeds::SeedSettings,
        setup::FoamSpace,
    },
    report::folder::OutputFolder,
    surface::Gap,
};
use anyhow::anyhow;
use indicatif::ProgressBar;
use std::path::PathBuf;

/// Foams are made until they have this many cells, the comb's patches then having enough to be compared with.
const CELLS: usize = 256;
/// Seeds that may give a foam that does not settle.
const SPARE: u64 = 3;

/// The foams of the demo.
pub(super) struct Foams {
    /// The first one, which the page shows.
    pub(super) job: Job,
    /// What came of it.
    pub(super) made: Made,
    /// All of them, by name.
    pub(super) samples: Vec<Sample>,
    /// Seeds whose foam did not settle.
    pub(super) unsettled: usize,
}

/// Makes foams of `cells` cells from `seed` on, and writes them.
pub(super) fn make(
    space: FoamSpace,
    cells: usize,
    seed: u64,
    gap: &Gap,
    folder: &mut OutputFolder,
    bar: &ProgressBar,
) -> Result<Foams, CliError> {
    let wanted = CELLS.div_ceil(cells);
    let mut first = None;
    let (mut samples, mut unsettled) = (Vec::new(), 0);
    for step in 0..wanted as u64 + SPARE {
        let settings = settings(space, SeedSettings::new(cells, seed.wrapping_add(step)));
        let start = foam_run::started(&settings, gap, bar)?;
        let job = Job::new(&settings, start.seeds.psi6);
        let mut keeper = Keeper::new(&job, bar, None, Vec::new());
        let relaxed = keeper.relax(Begin::Network { network: start.network, part: start.part }, gap)?;
        let made = Made::new(&job, gap, relaxed, keeper.record)?;
        if !matches!(made.figures.ended, Stop::Converged { .. }) {
            unsettled += 1;
            continue;
        }
        let name = if first.is_none() { "foam".to_owned() } else { format!("foam-{}", samples.len() + 1) };
        folder.enter(&name);
        samples.push(Sample { name, pattern: made.pattern.clone() });
        if first.is_none() {
            foam_relax::write_all(folder, &job, &settings, gap, &made, Some(&start.seeds), Vec::new())?;
            first = Some((job, made));
        } else {
            folder.write_json("pattern.json", &made.pattern)?;
        }
        if samples.len() == wanted {
            break;
        }
    }
    let Some((job, made)) = first else {
        return Err(CliError::failure(anyhow!(
            "none of the foams from seeds {seed} to {} has settled; try another --seed or --cells",
            seed.wrapping_add(wanted as u64 + SPARE - 1)
        )));
    };
    Ok(Foams { job, made, samples, unsettled })
}

fn settings(space: FoamSpace, seeds: SeedSettings) -> FoamSettings {
    FoamSettings {
        space,
        seeds,
        relax: RelaxSettings::default(),
        last_stage: Stage::Foam,
        runs: 1,
        anneal: 0,
        extrapolate: false,
        jobs: None,
        write_fe: None,
        output: PathBuf::new(),
    }
}

impl Foams {
    /// A line on what was made.
    pub(super) fn in_words(&self) -> String {
        let sides = foam_run::by_sides(&self.made.figures.side_counts);
        let mut said = format!(
            "{} cells ({sides}), {}",
            self.made.figures.cells,
            foam_relax::in_words(self.made.figures.ended)
        );
        if self.samples.len() > 1 {
            said = format!("{} foams; the first: {said}", self.samples.len());
        }
        if self.unsettled > 0 {
            said = format!("{said}; {} did not settle and are left out", self.unsettled);
        }
        said
    }
}
