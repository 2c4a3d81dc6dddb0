//! From a network to the relaxed foam.
//!
//! Newton steps on a coarse mesh, damped so that no film turns over, with T1s wherever a film has shrunk; then the final mesh
//! and Newton steps to the end. Between steps nodes are spread evenly along the films and the wall patches integrated anew.
//! How it ended is data ([`Stop`]); a run that cannot go on gives back the last good state.
//!
//! | step | file |
//! |---|---|
//! | the whole run | this page |
//! | what a run is in the middle of, as data | `state.rs` |
//! | least energy of any film complex, topology fixed | `descend.rs` |
//! | walls far apart: relaxed in a narrow gap that is widened | `widen.rs` |
//! | disturbed and relaxed again, keeping what is lower | `anneal.rs` |
//! | the energy without the error of the mesh | `extrapolate.rs` |

mod anneal;
mod descend;
mod extrapolate;
mod state;
mod widen;

pub use anneal::{AnnealSettings, Annealed, anneal};
pub use descend::{Descended, Descent, DescentSettings, DescentStep, Ending};
pub use extrapolate::{Extrapolated, extrapolate};
pub use state::{STATE_SCHEMA, State};
pub use widen::Pinch;

use super::{
    complex::{NoExtrusion, Strips},
    network::{CellId, EdgeId, Network, VertexId},
    solve::{FactorError, Residuals},
    topology,
};
use crate::{index::IndexVec, surface::Gap};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, ops::ControlFlow};

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
    let shares = shares(&network, settings.shares.as_deref())?;
    resume(first_state(network, gap, shares)?, gap, settings, progress)
}

/// The coarse films of a network, from wall to wall; in the midst of the gap where its walls are too steep to start from.
fn first_state(network: Network, gap: &Gap, shares: IndexVec<CellId, f64>) -> Result<State, NoExtrusion> {
    match laid(network.clone(), gap, shares.clone()) {
        Ok(state) if !widen::is_steep(&state) => Ok(state),
        _ => {
            let narrow = laid(network, &gap.narrowed(widen::FIRST_PART), shares)?;
            Ok(State { part: widen::FIRST_PART, ..narrow })
        }
    }
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
    // The coarse mesh need not converge further than T1s can still happen.
    let stop = run.newton(COARSE_TOLERANCE, progress)?;
    let stop = match stop {
        Some(stop) => stop,
        None => run.finish(progress)?,
    };
    Ok(run.ended(stop))
}

/// The lowest eigenvalue of the Hessian at constant volumes of a foam in balance; see [`super::solve::Mode`].
///
/// # Errors
/// [`FactorError`] if the system cannot be factored.
pub fn lowest_eigenvalue(state: &State, gap: &Gap) -> Result<f64, FactorError> {
    Ok(state.descent(gap)?.lowest_mode()?.eigenvalue)
}

/// The residual at which the mesh is refined: T1s have ended there, and two more steps would converge the coarse mesh.
const COARSE_TOLERANCE: f64 = 1e-4;
/// The residual between two spreadings of the nodes: the next one disturbs the balance by more.
const SPREAD_TOLERANCE: f64 = 1e-5;
/// Spreading nodes and converging again, at most so often: each time the nodes move a tenth as far.
const SPREADINGS: usize = 5;
/// Nodes that move less than this part of the cell width need not be spread again.
const EVEN_ENOUGH: f64 = 1e-6;

/// Steps shorter than this part of Newton's leave uneven nodes behind, which stop later ones.
const DAMPED: f64 = 0.9;

/// Steps after the last T1 in which uneven nodes are spread after damped steps; what has not settled by then, spreading
/// alone will not settle.
const SPREAD_FOR: usize = 30;

/// A film's end that has slid round a corner by this part of the cell width changes its plane at once; less may be the way
/// of one step.
const SLID: f64 = 0.02;
/// How often films turn round corners before that no longer counts as progress.
const MOST_TURNS: usize = 30;

/// How often crumpled films are laid anew before a run counts as stalled.
const MOST_LAID_ANEW: usize = 3;

struct Run<'a> {
    gap: &'a Gap,
    settings: &'a RelaxSettings,
    state: State,
    descent: Descent,
    residuals: Residuals,
    unstable: usize,
    laid_anew: usize,
    turned: usize,
    refined: bool,
}

/// Why Newton steps were halted.
enum Halt {
    Flip,
    Turn,
    Spread,
    Interrupt,
}

impl<'a> Run<'a> {
    fn new(state: State, gap: &'a Gap, settings: &'a RelaxSettings) -> Result<Self, RelaxError> {
        let descent = state.descent(gap)?;
        let residuals = Residuals { force: f64::INFINITY, volume: f64::INFINITY };
        Ok(Self {
            gap,
            settings,
            state,
            descent,
            residuals,
            unstable: 0,
            laid_anew: 0,
            turned: 0,
            refined: false,
        })
    }

    fn ended(mut self, stop: Stop) -> Relaxed {
        self.state.lay_rim(self.gap);
        Relaxed { state: self.state, stop, residuals: self.residuals, unstable: self.unstable }
    }

    /// Newton steps with T1s until the residual is below `tolerance`; `None` then, otherwise why it stopped.
    fn newton(
        &mut self,
        tolerance: f64,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Option<Stop>, RelaxError> {
        let mut patience = self.state.steps + SPREAD_FOR;
        loop {
            let settings = DescentSettings {
                length: self.state.cell_width(),
                tolerance,
                volume_tolerance: tolerance.max(self.settings.volume_tolerance),
                step_limit: self.settings.step_limit.saturating_sub(self.state.steps),
            };
            let flip_below = self.settings.flip_below;
            let Self { state, descent, .. } = self;
            let mut lengths = topology::edge_lengths(state);
            let mut halt = None;
            let mut vanishing = Vec::new();
            let descended = descent.descend(&settings, &mut |told| {
                state.follow(told.descent);
                let told = Progress {
                    state,
                    energy: told.descent.energy(),
                    residuals: told.residuals,
                    fraction: told.fraction,
                    unstable: told.unstable,
                };
                if progress(&told).is_break() {
                    halt = Some(Halt::Interrupt);
                } else {
                    let before = std::mem::replace(&mut lengths, topology::edge_lengths(state));
                    vanishing = topology::vanishing_edges(state, &before, flip_below);
                    halt = if !vanishing.is_empty() {
                        Some(Halt::Flip)
                    } else if topology::slid_round(state, SLID * settings.length).is_some() {
                        Some(Halt::Turn)
                    } else {
                        (told.fraction < DAMPED && state.steps < patience).then_some(Halt::Spread)
                    };
                }
                if halt.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            let steps = self.state.steps;
            let Ok(descended) = descended else {
                if self.lay_anew()? {
                    continue;
                }
                return Ok(Some(Stop::Stalled { steps, residual: self.residuals.force }));
            };
            (self.residuals, self.unstable) = (descended.residuals, descended.unstable);
            let residual = self.residuals.force;
            match (descended.ending, halt) {
                (Ending::Converged, _) if self.turn_corners()? => patience = steps + SPREAD_FOR,
                (Ending::Converged, _) => return Ok(None),
                (Ending::StepLimit, _) => return Ok(Some(Stop::StepLimit { residual })),
                (Ending::Stalled, _) if self.lay_anew()? => patience = steps + SPREAD_FOR,
                (Ending::Stalled, _) => return Ok(Some(Stop::Stalled { steps, residual })),
                (Ending::Halted, Some(Halt::Flip)) => {
                    self.flip(&vanishing)?;
                    patience = steps + SPREAD_FOR;
                }
                (Ending::Halted, Some(Halt::Turn)) if self.turn_corners()? => patience = steps + SPREAD_FOR,
                (Ending::Halted, Some(Halt::Turn)) => return Ok(Some(Stop::Stalled { steps, residual })),
                (Ending::Halted, Some(Halt::Spread)) => {
                    self.spread();
                }
                (Ending::Halted, _) => return Ok(Some(Stop::Interrupted { steps })),
            }
        }
    }

    /// Flips edges that do not touch each other, in order.
    fn flip(&mut self, vanishing: &[EdgeId]) -> Result<(), RelaxError> {
        let mut touched: BTreeSet<VertexId> = BTreeSet::new();
        for &edge in vanishing {
            let round = topology::round(&self.state.network, edge);
            if round.iter().all(|vertex| !touched.contains(vertex)) {
                topology::flip(&mut self.state, self.gap, edge);
                touched.extend(round);
            }
        }
        self.descent = self.state.descent(self.gap)?;
        Ok(())
    }

    /// Lets films that have slid round a corner between two planes end on the other one. Gives whether there were any.
    fn turn_corners(&mut self) -> Result<bool, RelaxError> {
        let mut turned = false;
        while self.turned < MOST_TURNS
            && let Some((vertex, plane)) = topology::slid_round(&self.state, 0.0)
        {
            self.turned += 1;
            turned |= topology::turn_corner(&mut self.state, self.gap, vertex, plane);
        }
        if turned {
            self.descent = self.state.descent(self.gap)?;
        }
        Ok(turned)
    }

    /// Films that crumpled on the way from a rough start are laid anew between vertices that were drawn apart; who touches
    /// whom stays. Gives whether that was done: only on the coarse mesh, and not often.
    fn lay_anew(&mut self) -> Result<bool, RelaxError> {
        if self.laid_anew == MOST_LAID_ANEW || self.refined {
            return Ok(false);
        }
        self.laid_anew += 1;
        let state = &mut self.state;
        state.follow_films();
        topology::draw_apart(&mut state.network, self.gap);
        state.places = state.strips.first_places(&state.network, self.gap)?;
        state.pressures.iter_mut().for_each(|pressure| *pressure = 0.0);
        self.descent = state.descent(self.gap)?;
        Ok(true)
    }

    /// Spreads the nodes evenly along the films. Gives the largest move.
    fn spread(&mut self) -> f64 {
        let mut places = self.state.places.clone();
        let moved = self.state.strips.spread_evenly(&self.state.network, &mut places);
        if self.descent.complex().retract(&mut places).is_ok() {
            self.state.places.clone_from(&places);
            self.descent.set_places(places);
        }
        moved
    }

    /// The final mesh: refined, spread evenly, converged.
    fn finish(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Stop, RelaxError> {
        self.refined = true;
        let Strips { along, through } = self.settings.strips;
        let strips = Strips { along: along.max(self.state.strips.along), through };
        if self.state.strips != strips {
            self.state.refine(strips);
            self.descent = self.state.descent(self.gap)?;
        }
        let mut last = false;
        for round in 1..=SPREADINGS {
            let moved = self.spread();
            last |= moved <= EVEN_ENOUGH * self.state.cell_width() || round == SPREADINGS;
            if last {
                self.descent.integrate_walls();
            }
            let tolerance = if last { self.settings.tolerance } else { SPREAD_TOLERANCE };
            if let Some(stop) = self.newton(tolerance, progress)? {
                return Ok(stop);
            }
            if last {
                break;
            }
        }
        self.state.follow_films();
        Ok(Stop::Converged { steps: self.state.steps })
    }
}

#[cfg(test)]
mod cut_tests;
#[cfg(test)]
mod tests;
