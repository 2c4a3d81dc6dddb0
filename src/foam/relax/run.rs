//! The run of one relaxation: Newton steps, and what is done to network and mesh between them.

use super::{
    Descended, Descent, DescentSettings, Ending, Progress, RelaxError, RelaxSettings, Relaxed, State, Stop,
};
use crate::{
    foam::{
        complex::Strips,
        network::{EdgeId, VertexId},
        solve::{FactorError, Residuals},
        topology,
    },
    surface::Gap,
};
use std::{collections::BTreeSet, ops::ControlFlow};

/// The residual at which the mesh is refined: T1s have ended there, and two more steps would converge the coarse mesh.
const COARSE_TOLERANCE: f64 = 1e-4;
/// The residual between two spreadings of the nodes: the next one disturbs the balance by more.
const SPREAD_TOLERANCE: f64 = 1e-5;
/// Spreading nodes and converging again, at most so often: each time the nodes move a tenth as far.
const SPREADINGS: usize = 5;
/// Passes of each: along rows and columns in turn they, too, even out by a factor of some ten.
const PASSES: usize = 6;
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

/// A relaxation on its way.
pub(super) struct Run<'a> {
    gap: &'a Gap,
    settings: &'a RelaxSettings,
    /// Where it is.
    pub(super) state: State,
    descent: Descent,
    residuals: Residuals,
    unstable: usize,
    laid_anew: usize,
    turned: usize,
    refined: bool,
}

/// Why Newton steps were halted.
enum Halt {
    /// These edges vanish.
    Flip(Vec<EdgeId>),
    /// A film's end has slid round a corner.
    Turn,
    /// A damped step left uneven nodes behind.
    Spread,
    /// The caller asked for it.
    Interrupt,
}

impl<'a> Run<'a> {
    /// Starts at a state.
    pub(super) fn new(state: State, gap: &'a Gap, settings: &'a RelaxSettings) -> Result<Self, RelaxError> {
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

    /// What is given to the caller.
    pub(super) fn ended(mut self, stop: Stop) -> Relaxed {
        self.state.lay_rim(self.gap);
        Relaxed { state: self.state, stop, residuals: self.residuals, unstable: self.unstable }
    }

    /// From the first network to balance on the final mesh. Gives why it ended.
    pub(super) fn through(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Stop, RelaxError> {
        match self.coarsely(progress)? {
            Some(stop) => Ok(stop),
            None => self.finish(progress),
        }
    }

    /// Until T1s have ended: the coarse mesh need not converge further. `None` then, otherwise why it stopped.
    pub(super) fn coarsely(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Option<Stop>, RelaxError> {
        self.newton(COARSE_TOLERANCE, progress)
    }

    /// Newton steps with T1s until the residual is below `tolerance`; `None` then, otherwise why it stopped.
    fn newton(
        &mut self,
        tolerance: f64,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Option<Stop>, RelaxError> {
        let mut patience = self.state.steps + SPREAD_FOR;
        loop {
            let (descended, halt) = self.descend(tolerance, patience, progress);
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
                (Ending::Halted, Some(Halt::Flip(vanishing))) => {
                    self.flip(&vanishing)?;
                    patience = steps + SPREAD_FOR;
                }
                (Ending::Halted, Some(Halt::Turn)) if self.turn_corners()? => patience = steps + SPREAD_FOR,
                (Ending::Halted, Some(Halt::Turn)) => return Ok(Some(Stop::Stalled { steps, residual })),
                (Ending::Halted, Some(Halt::Spread)) => {
                    self.spread(1);
                }
                (Ending::Halted, _) => return Ok(Some(Stop::Interrupted { steps })),
            }
        }
    }

    /// Newton steps until something is to be done between them. Steps up to `patience` are halted where they were damped.
    fn descend(
        &mut self,
        tolerance: f64,
        patience: usize,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> (Result<Descended, FactorError>, Option<Halt>) {
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
        let descended = descent.descend(&settings, &mut |told| {
            state.follow(told.descent);
            let told = Progress {
                state,
                energy: told.descent.energy(),
                residuals: told.residuals,
                fraction: told.fraction,
                unstable: told.unstable,
            };
            halt = if progress(&told).is_break() {
                Some(Halt::Interrupt)
            } else {
                let before = std::mem::replace(&mut lengths, topology::edge_lengths(state));
                let vanishing = topology::vanishing_edges(state, &before, flip_below);
                if !vanishing.is_empty() {
                    Some(Halt::Flip(vanishing))
                } else if topology::slid_round(state, SLID * settings.length).is_some() {
                    Some(Halt::Turn)
                } else {
                    (told.fraction < DAMPED && state.steps < patience).then_some(Halt::Spread)
                }
            };
            if halt.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        (descended, halt)
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

    /// Spreads the nodes evenly along the films, in at most so many passes. Gives the largest move of the first.
    fn spread(&mut self, passes: usize) -> f64 {
        let mut places = self.state.places.clone();
        let mut spread = || self.state.strips.spread_evenly(&self.state.network, &mut places);
        let moved = spread();
        let even = EVEN_ENOUGH * self.state.cell_width();
        let _ = (1..passes).find(|_| spread() <= even);
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
            let moved = self.spread(PASSES);
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
