//! From a network to the relaxed foam.
//!
//! Newton steps on a coarse mesh, damped so that no film turns over, with T1s wherever a film has shrunk; then the final mesh
//! and Newton steps to the end. Between steps nodes are spread evenly along the films and the wall patches integrated anew.
//! How it ended is data ([`Stop`]); a run that cannot go on gives back the last good state.
//!
//! | step | file |
//! |---|---|
//! | the first network, settings and results | this page |
//! | the run of Newton steps, and what is done between them | `run.rs` |
//! | what a run is in the middle of, as data | `state.rs` |
//! | least energy of any film complex, topology fixed | `descend.rs` |
//! | walls far apart: relaxed in a narrow gap that is widened | `widen.rs` |
//! | disturbed and relaxed again, keeping what is lower | `anneal.rs` |
//! | the energy without the error of the mesh | `extrapolate.rs` |

mod anneal;
mod descend;
mod extrapolate;
mod run;
mod state;
mod widen;

pub use anneal::{AnnealSettings, Annealed, anneal};
pub use descend::{Descended, Descent, DescentSettings, DescentStep, Ending};
pub use extrapolate::{Extrapolated, extrapolate};
pub use state::{STATE_SCHEMA, State};
pub use widen::Pinch;

use super::{
    complex::{NoExtrusion, Strips},
    network::{CellId, Network},
    solve::{FactorError, Residuals},
};
use crate::{index::IndexVec, surface::Gap};
use run::Run;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// What can be set about a relaxation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelaxSettings {
    /// The mesh of the result; films that turn far with the walls get more elements along.
    pub strips: Strips,
    /// Ends when the largest force on a freedom is below this, in units of tension × cell width.
    pub tolerance: f64,
    /// The largest volume error allowed at the end, relative to the mean cell volume.
    pub volume_tolerance: f64,
    /// The most Newton steps.
    pub step_limit: usize,
    /// A film flips when its edge is shorter than this part of the cell width. Above 0.1 sound short edges flip; below 0.02
    /// Newton steps on the sliver are slow.
    pub flip_below: f64,
    /// Each cell's share of the gap's volume; equal ones if none are given.
    pub shares: Option<Vec<f64>>,
}

impl Default for RelaxSettings {
    fn default() -> Self {
        Self {
            strips: Strips { along: 2, through: 2 },
            tolerance: 1e-10,
            volume_tolerance: 1e-11,
            step_limit: 400,
            flip_below: 0.05,
            shares: None,
        }
    }
}

/// How a relaxation ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "stop")]
pub enum Stop {
    /// Residual and volumes are below their tolerances.
    Converged {
        /// Newton steps taken.
        steps: usize,
    },
    /// The step limit was reached.
    StepLimit {
        /// The residual then.
        residual: f64,
    },
    /// Steps no longer reduce the residual.
    Stalled {
        /// Newton steps taken.
        steps: usize,
        /// The residual then.
        residual: f64,
    },
    /// The caller asked to stop.
    Interrupted {
        /// Newton steps taken.
        steps: usize,
    },
    /// The gap is too wide for one layer of these cells; the state is the foam in the part of it that was reached.
    TooWide {
        /// Newton steps taken.
        steps: usize,
        /// The part, as in [`State::part`].
        part: f64,
        /// The film that has all but vanished on one wall there; none if something else is in the way.
        pinch: Option<Pinch>,
    },
}

/// What is told after each Newton step.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// The state after the step, good to go on from.
    pub state: &'a State,
    /// Its energy.
    pub energy: f64,
    /// The residuals before the step, force in units of tension × cell width, volume relative to the mean cell volume.
    pub residuals: Residuals,
    /// The part of the full Newton step that was taken.
    pub fraction: f64,
    /// Directions of negative curvature before the step.
    pub unstable: usize,
}

/// A relaxed foam, or how far it came.
#[derive(Clone, Debug)]
pub struct Relaxed {
    /// The last good state.
    pub state: State,
    /// How it ended.
    pub stop: Stop,
    /// The residuals, as in [`Progress`].
    pub residuals: Residuals,
    /// Directions of negative curvature at the end: 0 at a minimum.
    pub unstable: usize,
}

/// A relaxation that could not even start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RelaxError {
    /// No films.
    #[error(transparent)]
    NoExtrusion(#[from] NoExtrusion),
    /// No memory, or a hopeless start.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// Shares that are not one positive number per cell.
    #[error(
        "{given} volume shares were given for {cells} cells, the smallest {least}: one positive number per cell is needed"
    )]
    Shares {
        /// How many were given.
        given: usize,
        /// How many cells there are.
        cells: usize,
        /// The smallest.
        least: f64,
    },
}

/// Relaxes the foam that `network` starts in `gap`.
///
/// # Errors
/// [`RelaxError`] if it cannot start; how a started one ended is in [`Relaxed::stop`].
pub fn relax(
    network: Network,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    relax_widening(network, 1.0, gap, settings, progress)
}

/// Relaxes the foam that `network` starts in a `part` of `gap`, and widens that to the whole of it: for a network that is
/// sound only between nearer walls. Where a foam that starts in the whole of it comes to no balance, as deep cells do, it starts
/// between nearer walls as well.
///
/// # Errors
/// As [`relax`].
pub fn relax_widening(
    network: Network,
    part: f64,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    let shares = shares(&network, settings.shares.as_deref())?;
    let first = first_state(network.clone(), part, gap, shares.clone())?;
    let is_whole = first.part >= 1.0;
    let relaxed = resume(first, gap, settings, progress)?;
    if !(is_whole && matches!(relaxed.stop, Stop::Stalled { .. })) {
        return Ok(relaxed);
    }
    let widened = widen::widen(narrow_state(network, part, gap, shares)?, gap, settings, progress)?;
    let is_better = !matches!(widened.stop, Stop::Stalled { .. } | Stop::StepLimit { .. });
    Ok(if is_better { widened } else { relaxed })
}

/// The coarse films of a network, from wall to wall of a part of the gap; of a smaller one in its midst where its walls are too
/// steep to start from.
fn first_state(
    network: Network,
    part: f64,
    gap: &Gap,
    shares: IndexVec<CellId, f64>,
) -> Result<State, NoExtrusion> {
    match laid(network.clone(), &gap.narrowed(part), shares.clone()) {
        Ok(state) if !widen::is_steep(&state) => Ok(State { part, ..state }),
        _ => narrow_state(network, part, gap, shares),
    }
}

/// The coarse films of a network in the midst of a part of the gap.
fn narrow_state(
    network: Network,
    part: f64,
    gap: &Gap,
    shares: IndexVec<CellId, f64>,
) -> Result<State, NoExtrusion> {
    let part = widen::FIRST_PART * part;
    let narrow = laid(network, &gap.narrowed(part), shares)?;
    Ok(State { part, ..narrow })
}

fn laid(network: Network, gap: &Gap, shares: IndexVec<CellId, f64>) -> Result<State, NoExtrusion> {
    let coarse = Strips { along: LEAST_ALONG, through: 1 };
    let state = State::new(network, gap, coarse, shares)?;
    let along = elements_along(&state, gap);
    if along > coarse.along {
        State::new(state.network, gap, Strips { along, ..coarse }, state.shares)
    } else {
        Ok(state)
    }
}

/// The least number of elements along a film: with one, T1s happen on films that are only bent.
const LEAST_ALONG: usize = 2;
/// The most elements along a film of the coarse mesh: half a great circle needs no more.
const MOST_ALONG: usize = 8;
/// The angle that one element may turn with the walls, in radians: at 1.5 a film leaves the gap between its nodes.
const MOST_TURN: f64 = 0.9;

/// How many elements along each film follow the walls.
fn elements_along(state: &State, gap: &Gap) -> usize {
    let network = &state.network;
    let turn = network.films().map(|edge| {
        let side = edge.half_edges()[0];
        let mut line = state.side_line(side, state.rows() / 2);
        line.extend(state.side_line(network.next(side), state.rows() / 2).first());
        let length: f64 = line.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
        length * gap.middle().curvature(line[line.len() / 2]).largest()
    });
    let most = turn.filter(|turn| turn.is_finite()).fold(0.0, f64::max) / MOST_TURN;
    (LEAST_ALONG..MOST_ALONG).find(|&along| real(along) >= most).unwrap_or(MOST_ALONG)
}

fn shares(network: &Network, given: Option<&[f64]>) -> Result<IndexVec<CellId, f64>, RelaxError> {
    let cells = network.cells().len();
    let Some(given) = given else {
        return Ok(IndexVec::from_elem(1.0 / real(cells), cells));
    };
    let least = given
        .iter()
        .copied()
        .fold(f64::INFINITY, |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.min(b) });
    if given.len() != cells || least.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return Err(RelaxError::Shares { given: given.len(), cells, least });
    }
    let total: f64 = given.iter().sum();
    Ok(given.iter().map(|share| share / total).collect::<Vec<_>>().into())
}

fn real(count: usize) -> f64 {
    f64::from(crate::index::checked_u32(count))
}

/// Goes on from a state.
///
/// # Errors
/// As [`relax`].
pub fn resume(
    state: State,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    if state.part < 1.0 {
        widen::widen(state, gap, settings, progress)
    } else {
        go_on(state, gap, settings, progress)
    }
}

/// Goes on from a state that fills all of `gap`.
fn go_on(
    state: State,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    let mut run = Run::new(state, gap, settings)?;
    let stop = run.through(progress)?;
    Ok(run.ended(stop))
}

/// The lowest eigenvalue of the Hessian at constant volumes of a foam in balance; see [`super::solve::Mode`].
///
/// # Errors
/// [`FactorError`] if the system cannot be factored.
pub fn lowest_eigenvalue(state: &State, gap: &Gap) -> Result<f64, FactorError> {
    Ok(state.descent(gap)?.lowest_mode()?.eigenvalue)
}

#[cfg(test)]
mod cut_tests;
#[cfg(test)]
mod tests;
