//! The descent of any film complex to least energy at given volumes; who touches whom stays as it is.
//!
//! Newton steps on the constrained system, made global: a step goes downhill on the constraints (the Hessian is stiffened
//! until its inertia says so), is short enough that no element turns over and no edge shrinks away, and must lower a merit,
//! the augmented Lagrangian at the step's new pressures; where no part of it does, the next one is stiffened further. Near
//! the end full steps are taken without a look at the merit, whose changes drown in rounding there. A balance that is no
//! minimum is left along its lowest mode.

use crate::{
    foam::{
        complex::{Complex, Places, RegionId, RegionKind},
        energy::{self, energy},
        solve::{Demand, FactorError, Mode, Residuals, Step, System},
        volume::{Reference, volumes},
    },
    index::IndexVec,
};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// When a descent ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescentSettings {
    /// The size of a cell: the unit of the steps' lengths and of the residuals.
    pub length: f64,
    /// Ends when the largest force on a freedom is below this, in units of tension × `length`.
    pub tolerance: f64,
    /// The largest volume error allowed at the end, relative to the mean volume of the cells.
    pub volume_tolerance: f64,
    /// The most Newton steps.
    pub step_limit: usize,
}

impl DescentSettings {
    /// The residuals in units of the tolerances: balance is where it is 1 or less.
    fn size(&self, residuals: &Residuals) -> f64 {
        (residuals.force / self.tolerance).max(residuals.volume / self.volume_tolerance)
    }
}

/// How a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Forces and volumes are below their tolerances, and no direction of negative curvature is left.
    Converged,
    /// The step limit was reached.
    StepLimit,
    /// Steps no longer help.
    Stalled,
    /// The observer asked to stop.
    Halted,
}

/// What is told after each step.
#[derive(Clone, Copy, Debug)]
pub struct DescentStep<'a> {
    /// The descent after the step, good to go on from.
    pub descent: &'a Descent,
    /// The residuals before the step: force in units of tension × length, volume relative to the mean volume.
    pub residuals: Residuals,
    /// The part of the full Newton step that was taken.
    pub fraction: f64,
    /// Directions of negative curvature before the step.
    pub unstable: usize,
}

/// How a descent ended and how far from balance it was then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descended {
    /// How.
    pub ending: Ending,
    /// Newton steps taken.
    pub steps: usize,
    /// The residuals at the end, as in [`DescentStep`].
    pub residuals: Residuals,
    /// Directions of negative curvature at the end: 0 at a minimum. Where the last step was full and so short that they cannot
    /// have changed, those before it.
    pub unstable: usize,
}

/// A film complex on its way to balance.
#[derive(Debug)]
pub struct Descent {
    complex: Complex,
    wanted: IndexVec<RegionId, f64>,
    places: Places,
    pressures: IndexVec<RegionId, f64>,
    reference: Reference,
    system: System,
    targets: IndexVec<RegionId, f64>,
    /// The least stiffening of the next step.
    damping: f64,
}

/// What a merit is made of.
struct Measured {
    volumes: IndexVec<RegionId, f64>,
    energy: f64,
}

/// The longest step of a node, in units of the cell size: beyond it films turn over before Newton's model holds.
const LONGEST_STEP: f64 = 0.25;
/// The part of an element's edge that one step may take away.
const LARGEST_SHRINKING: f64 = 0.6;
/// By what factor one step may change a volume: films between a swelling and a shrinking cell turn over beyond it.
const MOST_GROWTH: f64 = 1.5;
/// The wall patches are integrated anew after moves of this part of the cell size: strips are thin below it.
const REBASE_AFTER: f64 = 0.1;
/// The penalty on volume errors, in units of the tension over cell size and cell volume. A cell's own stiffness against a
/// change of volume is about 1 in these units.
const PENALTY: f64 = 10.0;
/// Residuals below which full Newton steps are taken without a look at the merit.
const TRUSTED: f64 = 1e-3;
/// Volume errors above which pressures are those that balance the forces, not those that bring the volumes.
const FAR: f64 = 0.02;
/// Steps without progress before a descent counts as stalled.
const IDLE_STEPS: usize = 25;
/// A fall of the energy that counts as progress, relative.
const FALL: f64 = 1e-6;
/// Halvings of a step before it is stiffened instead.
const HALVINGS: usize = 8;
/// The first stiffening after a step that did not help, in units of the tension, and its growth.
const FIRST_DAMPING: f64 = 1e-2;
const DAMPING_GROWTH: f64 = 10.0;
/// At this stiffening a step is no longer a step.
const MOST_DAMPING: f64 = 1e4;
/// How far a saddle is left along its lowest mode, in units of the cell size: far enough that the energy falls by more than
/// rounding, near enough that the mode still is one.
const PUSH: f64 = 0.02;
/// Saddles that one descent leaves: one that comes back each time has a mode that the mesh makes up.
const MOST_PUSHES: usize = 10;

impl Descent {
    /// Starts at `places` with the given `pressures`; these are the Lagrange multipliers' first guess for cells and the true
    /// pressures of open regions.
    ///
    /// `wanted` are the volumes of the cells. Where a part of the foam is closed by walls on all sides, these fix the sum of
    /// its volumes, and `wanted` are the cells' shares of it. The entries of open regions are not used.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub fn new(
        complex: Complex,
        wanted: IndexVec<RegionId, f64>,
        places: Places,
        pressures: IndexVec<RegionId, f64>,
    ) -> Result<Self, FactorError> {
        let reference = Reference::new(&complex, &places);
        Self::with_reference(complex, wanted, places, pressures, reference)
    }

    /// As [`Descent::new`], but with the volumes that wall patches hold only roughly known until
    /// [`Descent::integrate_walls`]; see [`Reference::rough`].
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub fn rough(
        complex: Complex,
        wanted: IndexVec<RegionId, f64>,
        places: Places,
        pressures: IndexVec<RegionId, f64>,
    ) -> Result<Self, FactorError> {
        let reference = Reference::rough(&complex, &places);
        Self::with_reference(complex, wanted, places, pressures, reference)
    }

    fn with_reference(
        complex: Complex,
        wanted: IndexVec<RegionId, f64>,
        places: Places,
        pressures: IndexVec<RegionId, f64>,
        reference: Reference,
    ) -> Result<Self, FactorError> {
        let system = System::new(&complex, &places)?;
        let targets = wanted.clone();
        let mut descent =
            Self { complex, wanted, places, pressures, reference, system, targets, damping: 0.0 };
        descent.targets = descent.fitted_targets(&descent.volumes());
        Ok(descent)
    }

    /// The complex.
    #[must_use]
    pub fn complex(&self) -> &Complex {
        &self.complex
    }

    /// Where the nodes are.
    #[must_use]
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// The pressures, in units of tension over length; in a part that walls close on all sides up to a common constant.
    #[must_use]
    pub fn pressures(&self) -> &IndexVec<RegionId, f64> {
        &self.pressures
    }

    /// The volumes that the cells shall have.
    #[must_use]
    pub fn targets(&self) -> &IndexVec<RegionId, f64> {
        &self.targets
    }

    /// The volumes of all regions now; of an open one what the films take from it, negative.
    #[must_use]
    pub fn volumes(&self) -> IndexVec<RegionId, f64> {
        volumes(&self.complex, &self.places, &self.reference)
    }

    /// The energy now: tension times area.
    #[must_use]
    pub fn energy(&self) -> f64 {
        energy(&self.complex, &self.places)
    }

    /// Goes on from other places of the same nodes, such as evenly spread ones.
    pub fn set_places(&mut self, places: Places) {
        self.places = places;
        self.rebase();
    }

    /// Integrates all wall patches where the films are now: small errors of the strips that were added since vanish.
    pub fn integrate_walls(&mut self) {
        self.reference = Reference::new(&self.complex, &self.places);
        self.targets = self.fitted_targets(&self.volumes());
        self.system.reframe(&self.complex, &self.places);
    }

    /// The softest way in which the films can move at constant volumes.
    ///
    /// # Errors
    /// [`FactorError`] as for a step.
    pub fn lowest_mode(&self) -> Result<Mode, FactorError> {
        self.system.lowest_mode(&self.complex, &self.places, &self.reference, &self.pressures)
    }

    /// Newton steps until `settings` are met.
    ///
    /// # Errors
    /// [`FactorError`] if Newton's system cannot be solved; the places are the last good ones then.
    pub fn descend(
        &mut self,
        settings: &DescentSettings,
        observer: &mut dyn FnMut(&DescentStep<'_>) -> ControlFlow<()>,
    ) -> Result<Descended, FactorError> {
        let mut best = f64::INFINITY;
        let mut lowest = f64::INFINITY;
        let mut idle = 0;
        let mut pushes = 0;
        let mut steps = 0;
        let mut measured = self.measured(&self.places);
        let mut may_have_ended = false;
        loop {
            let now = &measured.volumes;
            let aims = self.aims(now);
            let excess = now.iter().zip(&aims).map(|(now, aim)| now - aim).collect();
            let volume = self.volume_residual(now);
            if may_have_ended {
                let residuals = self.residuals(&excess, volume, settings.length);
                if settings.size(&residuals) <= 1.0 {
                    return Ok(Descended { ending: Ending::Converged, steps, residuals, unstable: 0 });
                }
            }
            let step = self.step(&excess, volume > FAR)?;
            let residuals = Residuals { force: step.residuals.force / settings.length, volume };
            let unstable = step.unstable;
            let ended = |ending| Ok(Descended { ending, steps, residuals, unstable });
            let size = settings.size(&residuals);
            if size <= 1.0 && unstable == 0 {
                if self.damping <= 0.0 {
                    return ended(Ending::Converged);
                }
                // Whether this is a minimum is seen on the Hessian as it is.
                self.damping = 0.0;
                continue;
            }
            if steps >= settings.step_limit {
                return ended(Ending::StepLimit);
            }
            let here = measured.energy;
            idle = if size < 0.9 * best || here < lowest - FALL * here.abs() { 0 } else { idle + 1 };
            (best, lowest) = (best.min(size), lowest.min(here));
            if idle > IDLE_STEPS {
                return ended(Ending::Stalled);
            }
            let was_damped = self.damping > 0.0;
            let (fraction, taken) = if size <= 1.0 {
                pushes += 1;
                if pushes > MOST_PUSHES {
                    return ended(Ending::Stalled);
                }
                (best, lowest) = (f64::INFINITY, f64::INFINITY);
                (self.leave_saddle(settings.length)?, None)
            } else {
                self.take(&step, &aims, &residuals, &measured, settings.length)
            };
            measured = taken.unwrap_or_else(|| self.measured(&self.places));
            steps += 1;
            // A full step from so near leaves forces of the order of their square, and no new direction of falling energy.
            may_have_ended = fraction >= 1.0
                && unstable == 0
                && !was_damped
                && residuals.force.max(residuals.volume) < TRUSTED
                && residuals.force.powi(2) <= settings.tolerance;
            if observer(&DescentStep { descent: self, residuals, fraction, unstable }).is_break() {
                return Ok(Descended { ending: Ending::Halted, steps, residuals, unstable });
            }
        }
    }

    fn measured(&self, places: &Places) -> Measured {
        let volumes = volumes(&self.complex, places, &self.reference);
        Measured { energy: energy(&self.complex, places), volumes }
    }

    fn step(&self, excess: &IndexVec<RegionId, f64>, balances: bool) -> Result<Step, FactorError> {
        let Self { complex, places, reference, pressures, .. } = self;
        let demand = Demand { excess, damping: self.damping, balances };
        self.system.step_by(complex, places, reference, pressures, &demand)
    }

    /// How far from balance it is, without a step; `volume` is known.
    fn residuals(&self, excess: &IndexVec<RegionId, f64>, volume: f64, length: f64) -> Residuals {
        let Self { complex, places, reference, pressures, .. } = self;
        let found = self.system.residuals(complex, places, reference, pressures, excess);
        Residuals { force: found.force / length, volume }
    }

    /// The volumes that the next step aims at: the targets, or as far towards them as films bear in one step.
    fn aims(&self, now: &IndexVec<RegionId, f64>) -> IndexVec<RegionId, f64> {
        let mut aims = self.targets.clone();
        for (id, region) in self.complex.regions.enumerated() {
            if region.kind == RegionKind::Cell && now[id] > 0.0 {
                aims[id] = aims[id].clamp(now[id] / MOST_GROWTH, now[id] * MOST_GROWTH);
            }
        }
        self.fit(&mut aims, now);
        aims
    }

    /// The largest volume error, relative to the mean volume.
    fn volume_residual(&self, now: &IndexVec<RegionId, f64>) -> f64 {
        let worst = self
            .complex
            .regions
            .enumerated()
            .filter(|(_, region)| region.kind == RegionKind::Cell)
            .map(|(id, _)| (now[id] - self.targets[id]).abs())
            .fold(0.0, |a: f64, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) });
        worst / self.mean_target()
    }

    fn mean_target(&self) -> f64 {
        let (sum, count) = self
            .complex
            .regions
            .enumerated()
            .filter(|(_, region)| region.kind == RegionKind::Cell)
            .fold((0.0, 0.0), |(sum, count), (id, _)| (sum + self.targets[id], count + 1.0));
        if count > 0.0 { sum / count } else { 1.0 }
    }

    /// Takes as much of a step as the elements bear and the merit allows. Gives the fraction taken: 0 if there is none, and the
    /// next step is stiffer then; and what was measured there on the way.
    fn take(
        &mut self,
        step: &Step,
        aims: &IndexVec<RegionId, f64>,
        residuals: &Residuals,
        here: &Measured,
        length: f64,
    ) -> (f64, Option<Measured>) {
        let longest = self.longest_fraction(&step.displacements, length);
        let near = residuals.force < TRUSTED
            && residuals.volume < TRUSTED
            && step.unstable == 0
            && self.damping < MOST_DAMPING;
        let start = self.merit(step, aims, here, length);
        let mut fraction = longest;
        for _ in 0..HALVINGS {
            let moved = self.system.moved(&self.complex, &self.places, step, fraction);
            if let Some(places) = moved.filter(|places| self.keeps_elements(places))
                && let there = self.measured(&places)
                && (near || self.merit(step, aims, &there, length) <= start)
            {
                self.places = places;
                let changes = if residuals.volume > FAR { &step.balance } else { &step.direction.pressures };
                for (id, change) in changes.enumerated() {
                    self.pressures[id] += *change;
                }
                let is_far = self.moved_since_reference() > REBASE_AFTER * length;
                if is_far {
                    self.rebase();
                }
                let eased = self.damping / DAMPING_GROWTH;
                self.damping = if eased < FIRST_DAMPING { 0.0 } else { eased };
                return (fraction, (!is_far).then_some(there));
            }
            fraction *= 0.5;
        }
        self.damping = (self.damping * DAMPING_GROWTH).clamp(FIRST_DAMPING, MOST_DAMPING);
        (0.0, None)
    }

    /// The augmented Lagrangian at the step's new pressures: a Newton step goes downhill on it if the penalty is stiff.
    fn merit(&self, step: &Step, aims: &IndexVec<RegionId, f64>, at: &Measured, length: f64) -> f64 {
        let stiffness = PENALTY / (length * self.mean_target());
        let work: f64 = at
            .volumes
            .enumerated()
            .map(|(id, &volume)| {
                let pressure = self.pressures[id] + step.direction.pressures[id];
                match self.complex.regions[id].kind {
                    RegionKind::Open => -pressure * volume,
                    RegionKind::Cell => {
                        let missing = volume - aims[id];
                        (0.5 * stiffness * missing - pressure) * missing
                    }
                }
            })
            .sum();
        at.energy + work
    }

    fn longest_fraction(&self, displacements: &Places, length: f64) -> f64 {
        let longest = displacements.iter().map(|d| d.length()).fold(0.0, f64::max);
        let mut fraction = (LONGEST_STEP * length / longest).min(1.0);
        for element in self.complex.films.iter().flat_map(|film| &film.elements) {
            for edge in element.shape.edges() {
                let [start, end] = [edge[0], edge[edge.len() - 1]].map(|at| element.nodes[at]);
                let chord = self.complex.place(&self.places, end) - self.complex.place(&self.places, start);
                let change = displacements[end.node] - displacements[start.node];
                let shrinking = -change.dot(chord) / chord.length_squared();
                if shrinking * fraction > LARGEST_SHRINKING {
                    fraction = LARGEST_SHRINKING / shrinking;
                }
            }
        }
        fraction
    }

    /// Whether `places` fold no element that is not folded already: its normals stay within a right angle of their mean.
    fn keeps_elements(&self, places: &Places) -> bool {
        let folded = |element: &crate::foam::complex::Element, places: &Places| {
            let mut nodes = [DVec3::ZERO; crate::foam::complex::MOST_NODES];
            for (node, &image) in nodes.iter_mut().zip(&element.nodes) {
                *node = self.complex.place(places, image);
            }
            energy::is_folded(element.shape, &nodes[..element.nodes.len()])
        };
        self.complex.films.as_slice().par_iter().all(|film| {
            film.elements.iter().all(|element| !folded(element, places) || folded(element, &self.places))
        })
    }

    fn moved_since_reference(&self) -> f64 {
        let old = self.reference.places();
        self.places.iter().zip(old).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    }

    /// Integrates the wall patches anew and takes new frames.
    fn rebase(&mut self) {
        let (reference, volumes) = self.reference.moved(&self.complex, &self.places);
        self.reference = reference;
        self.targets = self.fitted_targets(&volumes);
        self.system.reframe(&self.complex, &self.places);
    }

    /// The wanted volumes; in closed parts brought to the sum that the walls hold.
    fn fitted_targets(&self, now: &IndexVec<RegionId, f64>) -> IndexVec<RegionId, f64> {
        let mut targets = self.wanted.clone();
        self.fit(&mut targets, now);
        targets
    }

    /// Brings the volumes of closed parts to the sum that they have now.
    fn fit(&self, volumes: &mut IndexVec<RegionId, f64>, now: &IndexVec<RegionId, f64>) {
        for part in self.system.closed_parts() {
            let total: f64 = part.iter().map(|&id| now[id]).sum();
            let sum: f64 = part.iter().map(|&id| volumes[id]).sum();
            for &id in part {
                volumes[id] *= total / sum;
            }
        }
    }

    /// Leaves a balance that is no minimum along its lowest mode, to the side where the energy falls faster. Gives 1.
    fn leave_saddle(&mut self, length: f64) -> Result<f64, FactorError> {
        let mode = self.lowest_mode()?;
        let step = self.system.along(&self.complex, &self.places, mode.direction);
        let longest = step.displacements.iter().map(|d| d.length()).fold(0.0, f64::max);
        let push = PUSH * length / longest;
        let best = [push, -push]
            .into_iter()
            .filter_map(|push| self.system.moved(&self.complex, &self.places, &step, push))
            .filter(|places| self.keeps_elements(places))
            .map(|places| (self.merit(&step, &self.targets, &self.measured(&places), length), places))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, places)) = best {
            self.set_places(places);
        }
        Ok(1.0)
    }
}
