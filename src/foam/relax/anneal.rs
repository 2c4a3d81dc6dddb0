//! A settled foam disturbed again and again, keeping what is lower.
//!
//! Two disturbances take turns. **T1s** on one to three random edges move dislocations by a step. **Shaking** moves every
//! cell's centre at random along the middle surface by up to half a cell width and partitions the gap anew, which can make
//! and unmake defects. Each is relaxed on the coarse mesh; a foam of lower energy replaces the one that was disturbed (a
//! descent at temperature 0 over the local minima: basin hopping as in D. Wales and J. Doye, J. Phys. Chem. A 101, 1997).
//! The lowest of all is relaxed to the end on the final mesh.

use super::{Progress, RelaxError, RelaxSettings, Relaxed, Run, State, Stop, laid, resume};
use crate::{
    foam::{
        domain::Domain,
        energy::energy,
        network::{EdgeId, Network},
        partition::Partition,
        topology,
    },
    index::{Id, IndexVec},
    surface::Gap,
};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// How a foam is annealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnnealSettings {
    /// Disturbances.
    pub cycles: usize,
    /// Where the random numbers start.
    pub seed: u64,
}

/// An annealed foam.
#[derive(Clone, Debug)]
pub struct Annealed {
    /// The lowest foam found, relaxed to the end.
    pub relaxed: Relaxed,
    /// The energy before.
    pub before: f64,
    /// The energy now; never higher.
    pub after: f64,
    /// How many disturbances settled.
    pub settled: usize,
    /// How many of them lowered the energy.
    pub kept: usize,
}

/// The most random T1s of one disturbance: more of them leave nothing of the foam that was good already.
const MOST_FLIPS: usize = 3;

/// The farthest that shaking moves a centre, in cell widths. Beyond a half it is a new foam, below a tenth the same one.
const SHAKES: std::ops::Range<f64> = 0.1..0.5;

/// Energies of coarse meshes that differ by less than this part are of the same foam: where their nodes lie along the films
/// is not the same.
const SAME: f64 = 1e-6;

/// Energies at the end that differ by less than this part are of the same foam.
const SAME_AT_END: f64 = 1e-9;

/// Newton steps of one disturbance; what has not settled by then is given up.
const CYCLE_STEPS: usize = 60;

/// Disturbs a settled foam `settings.cycles` times and keeps the lowest.
///
/// The same foam and seed give the same result for any number of threads.
///
/// # Errors
/// [`RelaxError`] as for the relaxation itself.
pub fn anneal(
    relaxed: Relaxed,
    gap: &Gap,
    domain: &Domain,
    relax: &RelaxSettings,
    settings: AnnealSettings,
    progress: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Result<Annealed, RelaxError> {
    let before = energy_of(&relaxed.state, gap);
    let mut annealing = Annealing { gap, domain, relax, random: ChaCha8Rng::seed_from_u64(settings.seed) };
    let mut best = laid(relaxed.state.network.clone(), gap, relaxed.state.shares.clone())?;
    let Some(mut lowest) = annealing.settle(&mut best) else {
        return Ok(Annealed { relaxed, before, after: before, settled: 0, kept: 0 });
    };
    let (mut settled, mut kept) = (0, 0);
    for cycle in 0..settings.cycles {
        if progress(cycle).is_break() {
            break;
        }
        let disturbed = if cycle % 2 == 0 { annealing.flipped(&best) } else { annealing.shaken(&best) };
        let Some(mut trial) = disturbed else { continue };
        let Some(energy) = annealing.settle(&mut trial) else { continue };
        settled += 1;
        if energy < lowest * (1.0 - SAME) {
            kept += 1;
            (best, lowest) = (trial, energy);
        }
    }
    let mut annealed = Annealed { relaxed, before, after: before, settled, kept };
    if kept > 0 {
        // Steps and T1s of the disturbances are counted by cycles, not here.
        (best.steps, best.flips) = (0, annealed.relaxed.state.flips);
        let end = resume(best, gap, relax, &mut |_| ControlFlow::Continue(()))?;
        let after = energy_of(&end.state, gap);
        if matches!(end.stop, Stop::Converged { .. }) && after < before * (1.0 - SAME_AT_END) {
            (annealed.relaxed, annealed.after) = (end, after);
        } else {
            annealed.kept = 0;
        }
    }
    Ok(annealed)
}

fn energy_of(state: &State, gap: &Gap) -> f64 {
    energy(&state.strips.complex(&state.network, gap), &state.places)
}

struct Annealing<'a> {
    gap: &'a Gap,
    domain: &'a Domain,
    relax: &'a RelaxSettings,
    random: ChaCha8Rng,
}

impl Annealing<'_> {
    /// Relaxes on the coarse mesh; gives the energy if that settles.
    fn settle(&self, state: &mut State) -> Option<f64> {
        state.steps = 0;
        let settings = RelaxSettings { step_limit: CYCLE_STEPS, ..self.relax.clone() };
        let mut run = Run::new(state.clone(), self.gap, &settings).ok()?;
        let watch: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()> = &mut |_| ControlFlow::Continue(());
        if run.coarsely(watch).ok()?.is_some() {
            return None;
        }
        run.state.follow_films();
        *state = run.state;
        Some(energy_of(state, self.gap))
    }

    /// The foam after some random T1s; `None` if none of them can be.
    fn flipped(&mut self, state: &State) -> Option<State> {
        let mut state = state.clone();
        state.flips_of_edge = IndexVec::from_elem(0, state.network.edges().len());
        let count = self.random.random_range(1..=MOST_FLIPS);
        let mut done = false;
        for _ in 0..count {
            let edge = EdgeId::from_index(self.random.random_range(0..state.network.edges().len()));
            done |= topology::flip(&mut state, self.gap, edge);
        }
        done.then_some(state)
    }

    /// The foam of the cells' centres after random moves; `None` if these have no sound partition.
    fn shaken(&mut self, state: &State) -> Option<State> {
        let reach = self.random.random_range(SHAKES) * state.cell_width();
        let network = &state.network;
        let centres: Vec<DVec3> = network
            .cells()
            .map(|cell| {
                let mut along = || self.random.random_range(-1.0..1.0);
                let moved = network.centre(cell) + reach * DVec3::new(along(), along(), along());
                let place = self.gap.middle().project(moved, 0.0).ok()?;
                Some(self.domain.reflected_inside(self.domain.wrap(place).0))
            })
            .collect::<Option<_>>()?;
        let network: Network = Partition::new(self.gap, self.domain, &centres).ok()?.network().ok()?;
        laid(network, self.gap, state.shares.clone()).ok()
    }
}
