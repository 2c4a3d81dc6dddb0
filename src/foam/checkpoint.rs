//! A relaxation on disk, to go on from after a stop.

use super::{
    relax::{RelaxSettings, STATE_SCHEMA, State},
    seeds::SeedSettings,
    setup::FoamSpace,
};
use serde::{Deserialize, Serialize};

/// The name and version of a checkpoint's JSON form.
pub const CHECKPOINT_SCHEMA: &str = "combwright.foam-checkpoint/1";

/// One Newton step, as it is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Steps taken, this one included.
    pub step: usize,
    /// The energy after it.
    pub energy: f64,
    /// The largest force before it, in units of tension × cell width.
    pub force: f64,
    /// The largest error of a volume before it, relative to the mean cell volume.
    pub volume: f64,
    /// The part of the full step that was taken.
    pub fraction: f64,
    /// Directions of negative curvature before it.
    pub unstable: usize,
    /// T1s so far.
    pub flips: usize,
}

/// All that a relaxation needs to go on, and what was recorded of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    schema: String,
    /// Where the foam is.
    pub space: FoamSpace,
    /// How its seeds were made.
    pub seeds: SeedSettings,
    /// How it is relaxed.
    pub relax: RelaxSettings,
    /// The order of its seeds.
    pub psi6: f64,
    /// The steps so far.
    pub record: Vec<StepRecord>,
    /// The last good state.
    pub state: State,
}

/// Only what tells the version.
#[derive(Deserialize)]
struct Header {
    schema: String,
}

/// Why a checkpoint cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CheckpointError {
    /// The file ends too early.
    #[error(
        "the checkpoint is cut short: it ends in line {line}, column {column}; use an earlier one, or start anew"
    )]
    CutShort {
        /// The last line.
        line: usize,
        /// The last column.
        column: usize,
    },
    /// Another version of this program wrote it, or it is no checkpoint.
    #[error("the file's schema is '{found}', but this version of combwright goes on from '{expected}' only")]
    Version {
        /// What the file says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// It is no JSON, or not of this form.
    #[error("the file is no checkpoint of a foam: {0}")]
    Malformed(String),
    /// Its numbers contradict each other.
    #[error("the checkpoint is damaged: {0}")]
    Damaged(String),
}

impl Checkpoint {
    /// A checkpoint of a relaxation.
    #[must_use]
    pub fn new(
        space: FoamSpace,
        seeds: SeedSettings,
        relax: RelaxSettings,
        psi6: f64,
        record: Vec<StepRecord>,
        state: State,
    ) -> Self {
        Self { schema: CHECKPOINT_SCHEMA.to_owned(), space, seeds, relax, psi6, record, state }
    }

    /// Reads a checkpoint and checks it.
    ///
    /// # Errors
    /// [`CheckpointError`].
    pub fn read(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let header: Header = serde_json::from_slice(bytes).map_err(|error| unreadable(&error))?;
        if header.schema != CHECKPOINT_SCHEMA {
            return Err(CheckpointError::Version { found: header.schema, expected: CHECKPOINT_SCHEMA });
        }
        let checkpoint: Self = serde_json::from_slice(bytes).map_err(|error| unreadable(&error))?;
        checkpoint.check()?;
        Ok(checkpoint)
    }

    fn check(&self) -> Result<(), CheckpointError> {
        let State { schema, network, strips, places, pressures, shares, .. } = &self.state;
        if schema != STATE_SCHEMA {
            return Err(CheckpointError::Version { found: schema.clone(), expected: STATE_SCHEMA });
        }
        if let Some(defect) = network.defects().first() {
            return Err(CheckpointError::Damaged(defect.to_string()));
        }
        let (columns, rows) = (strips.columns(), strips.rows());
        let nodes = rows * (network.vertices().len() + network.edges().len() * columns.saturating_sub(2));
        let cells = network.cells().len();
        for (what, found, expected) in [
            ("places of nodes", places.len(), nodes),
            ("pressures", pressures.len(), cells),
            ("volume shares", shares.len(), cells),
            ("flips of edges", self.state.flips_of_edge.len(), network.edges().len()),
        ] {
            if found != expected {
                return Err(CheckpointError::Damaged(format!("{found} {what} where {expected} belong")));
            }
        }
        let part = self.state.part;
        if !(part > 0.0 && part <= 1.0) {
            return Err(CheckpointError::Damaged(format!(
                "the part {part} of the gap is not between 0 and 1"
            )));
        }
        let finite = places.iter().all(|place| place.is_finite()) && pressures.iter().all(|p| p.is_finite());
        if finite { Ok(()) } else { Err(CheckpointError::Damaged("a number in it is not finite".to_owned())) }
    }
}

fn unreadable(error: &serde_json::Error) -> CheckpointError {
    if error.is_eof() {
        CheckpointError::CutShort { line: error.line(), column: error.column() }
    } else {
        CheckpointError::Malformed(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        foam::{
            relax::{Relaxed, Stop, relax, resume},
            start::start,
        },
        surface::Gap,
    };
    use std::{error::Error, ops::ControlFlow};

    const SPACE: FoamSpace = FoamSpace::Sphere { radii: [1.0, 1.1] };

    fn go_on(state: State, gap: &Gap) -> Result<Relaxed, Box<dyn Error>> {
        Ok(resume(state, gap, &RelaxSettings::default(), &mut |_| ControlFlow::Continue(()))?)
    }

    /// A relaxation of fourteen cells that was stopped after its first step.
    fn stopped() -> Result<(Gap, Checkpoint), Box<dyn Error>> {
        let (gap, domain) = (SPACE.gap()?, SPACE.domain()?);
        let mut seeds = SeedSettings::new(14, 1);
        seeds.anneal.sweeps = 100;
        let start = start(&gap, &domain, &seeds, &mut |_| ControlFlow::Continue(()))?;
        let network = start.network;
        let settings = RelaxSettings::default();
        let relaxed = relax(network, &gap, &settings, &mut |progress| {
            if progress.state.steps < 1 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        })?;
        assert_eq!(relaxed.stop, Stop::Interrupted { steps: 1 });
        Ok((gap, Checkpoint::new(SPACE, seeds, settings, 1.0, Vec::new(), relaxed.state)))
    }

    #[test]
    fn a_file_and_back_goes_on_to_the_same_bytes() -> Result<(), Box<dyn Error>> {
        let (gap, checkpoint) = stopped()?;
        let read = Checkpoint::read(&serde_json::to_vec(&checkpoint)?)?;
        assert_eq!(read, checkpoint);
        let (direct, from_file) = (go_on(checkpoint.state, &gap)?, go_on(read.state, &gap)?);
        assert!(matches!(direct.stop, Stop::Converged { .. }), "{:?}", direct.stop);
        assert_eq!(direct.state, from_file.state);
        Ok(())
    }

    #[test]
    fn what_cannot_be_gone_on_from_is_refused() -> Result<(), Box<dyn Error>> {
        let (_, checkpoint) = stopped()?;
        let text = serde_json::to_string(&checkpoint)?;
        let cut = Checkpoint::read(&text.as_bytes()[..text.len() / 2]);
        assert!(matches!(cut, Err(CheckpointError::CutShort { .. })), "{cut:?}");
        let other = Checkpoint::read(text.replace("foam-checkpoint/1", "foam-checkpoint/9").as_bytes());
        assert!(matches!(other, Err(CheckpointError::Version { .. })), "{other:?}");
        for text in ["[1, 2]", "{\"schema\": 3}", "soap"] {
            let none = Checkpoint::read(text.as_bytes());
            assert!(matches!(none, Err(CheckpointError::Malformed(_))), "{none:?}");
        }
        let mut short = checkpoint;
        let mut places = short.state.places.into_vec();
        places.pop();
        short.state.places = places.into();
        let damaged = Checkpoint::read(&serde_json::to_vec(&short)?);
        assert!(matches!(damaged, Err(CheckpointError::Damaged(_))), "{damaged:?}");
        Ok(())
    }
}
