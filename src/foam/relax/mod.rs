//! From a network to the relaxed foam.
//!
//! Newton steps on a coarse mesh, damped so that no film turns over, with T1s wherever a film has shrunk; then the final mesh
//! and Newton steps to the end. Between steps nodes are spread evenly along the films and the wall patches integrated anew.
//! How it ended is data ([`Stop`]); a run that cannot go on gives back the last good state.

mod state;

pub(crate) use state::Derived;
pub use state::{STATE_SCHEMA, State};

use super::{
    complex::{NoExtrusion, Places, Strips},
    energy::energy,
    network::{CellId, Network},
    solve::{FactorError, Residuals, Step},
    topology,
};
use crate::{index::IndexVec, surface::Gap};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// What can be set about a relaxation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RelaxSettings {
    /// The mesh of the result.
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
            tolerance: 1e-11,
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
    let coarse = Strips { along: 2, through: 1 };
    let state = State::new(network, gap, coarse, shares)?;
    resume(state, gap, settings, progress)
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
    let mut run = Run::new(state, gap, settings)?;
    // The coarse mesh need not converge further than T1s can still happen.
    let stop = run.newton(COARSE_TOLERANCE, progress)?;
    let stop = match stop {
        Some(stop) => stop,
        None => run.finish(progress)?,
    };
    Ok(Relaxed { state: run.state, stop, residuals: run.residuals, unstable: run.unstable })
}

/// The residual at which the mesh is refined: T1s have ended there, and two more steps would converge the coarse mesh.
const COARSE_TOLERANCE: f64 = 1e-4;
/// The longest step of a node, in units of the cell width: beyond it films turn over before Newton's model holds.
const LONGEST_STEP: f64 = 0.2;
/// The part of an edge that one step may take away.
const LARGEST_SHRINKING: f64 = 0.6;
/// The wall patches are integrated anew after moves of this part of the cell width: strips are thin below it.
const REBASE_AFTER: f64 = 0.1;
/// Spreading nodes and converging again, at most so often: each time the nodes move a tenth as far.
const SPREADINGS: usize = 4;
/// Nodes that move less than this part of the cell width need not be spread again.
const EVEN_ENOUGH: f64 = 1e-6;

struct Run<'a> {
    gap: &'a Gap,
    settings: &'a RelaxSettings,
    state: State,
    derived: Derived,
    residuals: Residuals,
    unstable: usize,
    width: f64,
}

impl<'a> Run<'a> {
    fn new(state: State, gap: &'a Gap, settings: &'a RelaxSettings) -> Result<Self, RelaxError> {
        let derived = state.derive(gap)?;
        let width = state.cell_width();
        let residuals = Residuals { force: f64::INFINITY, volume: f64::INFINITY };
        Ok(Self { gap, settings, state, derived, residuals, unstable: 0, width })
    }

    fn rederive(&mut self) -> Result<(), RelaxError> {
        self.derived = self.state.derive(self.gap)?;
        self.width = self.state.cell_width();
        Ok(())
    }

    /// Newton steps with T1s until the residual is below `tolerance`; `None` then, otherwise why it stopped.
    fn newton(
        &mut self,
        tolerance: f64,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Option<Stop>, RelaxError> {
        let volume_tolerance = tolerance.max(self.settings.volume_tolerance);
        let mut best = f64::INFINITY;
        let mut idle = 0;
        loop {
            let step = self.derived.system.step(
                &self.derived.complex,
                &self.state.places,
                &self.derived.reference,
                &self.state.pressures,
                &self.derived.targets,
            )?;
            self.note(&step);
            let size = (self.residuals.force / tolerance).max(self.residuals.volume / volume_tolerance);
            if size <= 1.0 && step.unstable == 0 {
                return Ok(None);
            }
            if self.state.steps >= self.settings.step_limit {
                return Ok(Some(Stop::StepLimit { residual: self.residuals.force }));
            }
            idle = if size < 0.9 * best { 0 } else { idle + 1 };
            best = best.min(size);
            if idle > IDLE_STEPS {
                let (steps, residual) = (self.state.steps, self.residuals.force);
                return Ok(Some(Stop::Stalled { steps, residual }));
            }
            let fraction = self.take(&step)?;
            self.state.steps += 1;
            let told = Progress {
                state: &self.state,
                energy: energy(&self.derived.complex, &self.state.places),
                residuals: self.residuals,
                fraction,
                unstable: self.unstable,
            };
            if progress(&told).is_break() {
                return Ok(Some(Stop::Interrupted { steps: self.state.steps }));
            }
            if self.flip_short()? || fraction <= 0.0 {
                best = f64::INFINITY;
            }
        }
    }

    fn note(&mut self, step: &Step) {
        let mean: f64 = self.derived.targets.iter().sum::<f64>() / real(self.derived.targets.len());
        self.residuals =
            Residuals { force: step.residuals.force / self.width, volume: step.residuals.volume / mean };
        self.unstable = step.unstable;
    }

    /// Takes as much of a step as the films bear and the merit allows. Gives the fraction taken.
    fn take(&mut self, step: &Step) -> Result<f64, RelaxError> {
        let mut fraction = self.longest_fraction(&step.displacements);
        let near = self.residuals.force < TRUSTED && self.residuals.volume < TRUSTED && step.unstable == 0;
        let start = self.merit(step, &self.state.places);
        for halving in 0..HALVINGS {
            let complex = &self.derived.complex;
            if let Some(places) = self.derived.system.moved(complex, &self.state.places, step, fraction)
                && (near || halving + 1 == HALVINGS || self.merit(step, &places) <= start)
            {
                self.state.places = places;
                for (id, change) in step.direction.pressures.enumerated() {
                    self.state.pressures[id] += *change;
                }
                if self.moved_since_reference() > REBASE_AFTER * self.width {
                    self.rebase();
                }
                return Ok(fraction);
            }
            fraction *= 0.5;
        }
        Ok(0.0)
    }

    /// The augmented Lagrangian at the step's new pressures: a Newton step goes downhill on it if the penalty is stiff.
    fn merit(&self, step: &Step, places: &Places) -> f64 {
        let derived = &self.derived;
        let now = super::volume::volumes(&derived.complex, places, &derived.reference);
        let mean: f64 = derived.targets.iter().sum::<f64>() / real(derived.targets.len());
        let stiffness = PENALTY / (self.width * mean);
        let work: f64 = now
            .enumerated()
            .map(|(id, volume)| {
                let missing = volume - derived.targets[id];
                let pressure = self.state.pressures[id] + step.direction.pressures[id];
                (0.5 * stiffness * missing - pressure) * missing
            })
            .sum();
        energy(&derived.complex, places) + work
    }

    fn longest_fraction(&self, displacements: &Places) -> f64 {
        let longest = displacements.iter().map(|d| d.length()).fold(0.0, f64::max);
        let mut fraction = (LONGEST_STEP * self.width / longest).min(1.0);
        for edge in self.state.network.edges() {
            let (start, end) = self.state.chord(edge);
            let side = edge.half_edges()[0];
            let middle = |vertex| displacements[self.state.middle_node(vertex)];
            let change = middle(self.state.network.target(side)) - middle(self.state.network.origin(side));
            let chord = end - start;
            let shrinking = -change.dot(chord) / chord.length_squared();
            if shrinking * fraction > LARGEST_SHRINKING {
                fraction = LARGEST_SHRINKING / shrinking;
            }
        }
        fraction
    }

    fn moved_since_reference(&self) -> f64 {
        let old = self.derived.reference.places();
        self.state.places.iter().zip(old).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    }

    /// Integrates the wall patches anew and takes new frames.
    fn rebase(&mut self) {
        let derived = &mut self.derived;
        derived.reference = super::volume::Reference::new(&derived.complex, &self.state.places);
        derived.targets = self.state.targets(&derived.complex, &derived.reference);
        derived.system.reframe(&derived.complex, &self.state.places);
    }

    /// Flips the edges that are short enough. Gives whether any did.
    fn flip_short(&mut self) -> Result<bool, RelaxError> {
        let mut any = false;
        for edge in topology::short_edges(&self.state, self.settings.flip_below) {
            // An earlier flip may have lengthened it.
            let still = topology::short_edges(&self.state, self.settings.flip_below).contains(&edge);
            any |= still && topology::flip(&mut self.state, self.gap, edge).is_ok();
        }
        if any {
            self.rederive()?;
        }
        Ok(any)
    }

    /// The final mesh: refined, spread evenly, converged.
    fn finish(
        &mut self,
        progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Stop, RelaxError> {
        if self.state.strips != self.settings.strips {
            self.state.refine(self.settings.strips);
            let complex = self.state.strips.complex(&self.state.network, self.gap);
            if complex.retract(&mut self.state.places).is_err() {
                return Ok(Stop::Stalled { steps: self.state.steps, residual: self.residuals.force });
            }
        }
        for _ in 0..SPREADINGS {
            let moved = self.state.strips.spread_evenly(&self.state.network, &mut self.state.places);
            let complex = self.state.strips.complex(&self.state.network, self.gap);
            if complex.retract(&mut self.state.places).is_err() {
                return Ok(Stop::Stalled { steps: self.state.steps, residual: self.residuals.force });
            }
            self.rederive()?;
            if let Some(stop) = self.newton(self.settings.tolerance, progress)? {
                return Ok(stop);
            }
            if moved <= EVEN_ENOUGH * self.width {
                break;
            }
        }
        // The wall patches once more at the very places of the result, and a step or two for what that changed.
        self.rebase();
        if let Some(stop) = self.newton(self.settings.tolerance, progress)? {
            return Ok(stop);
        }
        self.state.follow_films();
        Ok(Stop::Converged { steps: self.state.steps })
    }
}

/// The penalty on volume errors, in units of the tension over cell width and cell volume. A cell's own stiffness against a
/// change of volume is about 1 in these units.
const PENALTY: f64 = 10.0;
/// Residuals below which full Newton steps are taken without a look at the merit, whose changes drown in rounding later.
const TRUSTED: f64 = 1e-3;
/// Steps without progress before a run counts as stalled.
const IDLE_STEPS: usize = 25;
/// Halvings of a step whose wall nodes find no wall.
const HALVINGS: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        foam::network::tests::hexagons,
        surface::{LevelSet, Plane},
    };
    use glam::DVec3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::sync::Arc;

    const HEIGHT: f64 = 0.5;

    fn crooked_hexagons() -> (Network, Gap) {
        let mut network = hexagons(4, 4);
        let [Some(x), Some(y), None] = network.period().0 else { panic!("a flat torus") };
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut noise = || random.random_range(-0.1..0.1);
        for vertex in network.vertices() {
            let place = network.position(vertex) + DVec3::new(noise(), noise(), 0.0);
            network.set_position(vertex, place);
        }
        let plane: Arc<dyn LevelSet> = Arc::new(Plane { periods: [x, y] });
        (network, Gap::between(plane, [-0.5 * HEIGHT, 0.5 * HEIGHT]).unwrap())
    }

    #[test]
    fn crooked_hexagons_become_the_hexagonal_foam() {
        let (network, gap) = crooked_hexagons();
        let mut last = 0.0;
        let relaxed = relax(network, &gap, &RelaxSettings::default(), &mut |told| {
            last = told.energy;
            ControlFlow::Continue(())
        })
        .unwrap();
        assert!(matches!(relaxed.stop, Stop::Converged { .. }), "{:?}", relaxed.stop);
        assert_eq!(relaxed.unstable, 0);
        // Films are flat: the energy of cells of area 1 is exact, h √(2√3) each.
        let exact = 16.0 * HEIGHT * (2.0 * 3.0_f64.sqrt()).sqrt();
        assert!((last - exact).abs() < 1e-12 * exact, "{last} {exact}");
    }

    #[test]
    fn a_state_read_back_goes_on_to_the_same_foam() {
        let (network, gap) = crooked_hexagons();
        let settings = RelaxSettings::default();
        let mut saved = None;
        let stopped = relax(network, &gap, &settings, &mut |told| {
            saved = Some(serde_json::to_string(told.state).unwrap());
            ControlFlow::Break(())
        })
        .unwrap();
        assert_eq!(stopped.stop, Stop::Interrupted { steps: 1 });
        let read: State = serde_json::from_str(&saved.unwrap()).unwrap();
        let go_on = |state| resume(state, &gap, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let (a, b) = (go_on(stopped.state), go_on(read));
        assert!(matches!(a.stop, Stop::Converged { .. }));
        assert_eq!(a.state.places, b.state.places);
    }

    #[test]
    fn shares_must_be_one_positive_number_for_each_cell() {
        let (network, gap) = crooked_hexagons();
        for shares in [vec![1.0; 3], vec![0.0; 16], vec![f64::NAN; 16]] {
            let settings = RelaxSettings { shares: Some(shares), ..RelaxSettings::default() };
            let refused = relax(network.clone(), &gap, &settings, &mut |_| ControlFlow::Continue(()));
            assert!(matches!(refused, Err(RelaxError::Shares { .. })));
        }
    }
}
