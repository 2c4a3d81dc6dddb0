//! Steps down the gradient with volumes held: Surface Evolver's `g` with its optimising scale, conjugate gradients included.
//!
//! The force is minus the energy's gradient, within the constraints, less the multiples of the functionals' gradients that
//! keep them to first order. Each trial moves by the force, returns to the constraints and restores the functionals along
//! their gradients; the scale is found by doubling or halving and a parabola through three trials.

use super::{
    freedom::State,
    gradient::{Gradients, Slots},
    problem::{FunctionalId, Measured, Problem, Values},
};
use crate::{
    evolver::{error::EvolverError, surface::VertexId},
    foam::solve::symmetric::{SymmetricFactor, SymmetricPattern},
    index::{Id, IndexVec, checked_u32},
};
use glam::DVec3;
use std::sync::Arc;

/// The scale of `g`, and the memory of conjugate gradients.
#[derive(Clone, Debug)]
pub(crate) struct Descent {
    /// The present step.
    pub(crate) scale: f64,
    /// The largest.
    pub(crate) limit: f64,
    /// Whether it is not to be optimised.
    pub(crate) fixed: bool,
    /// Whether directions are conjugate.
    pub(crate) conjugate: bool,
    memory: Option<Memory>,
}

#[derive(Clone, Debug)]
struct Memory {
    force: IndexVec<VertexId, DVec3>,
    direction: IndexVec<VertexId, DVec3>,
    norm: f64,
}

impl Default for Descent {
    fn default() -> Self {
        Self { scale: 0.1, limit: 1.0, fixed: false, conjugate: false, memory: None }
    }
}

/// What a step came to.
#[derive(Clone, Debug)]
pub(crate) struct Descended {
    pub(crate) values: Values,
    pub(crate) scale: f64,
    /// The multipliers of the functionals: pressures.
    pub(crate) multipliers: IndexVec<FunctionalId, f64>,
    /// Whether nothing lowered the energy.
    pub(crate) stuck: bool,
    /// The energy without a step, the functionals restored.
    pub(crate) base: f64,
}

/// The sum of the functionals' errors at which restoring stops: Surface Evolver's, so that both stop at the same place. It
/// is absolute for volumes and relative to the absolute shares for quantities, and for volumes once they count as quantities.
const TARGET_TOLERANCE: f64 = 1e-4;
/// Restoring steps before giving up.
const RESTORATIONS: usize = 10;
/// Halvings of the scale before giving up.
const HALVINGS: usize = 20;

/// Functionals' gradients within the constraints, and what solves for combinations of them.
pub(crate) struct Restoring {
    velocities: Slots,
    held: Vec<FunctionalId>,
    row: IndexVec<FunctionalId, Option<u32>>,
    products: Products,
}

/// The products of the functionals' gradients, ready to solve for combinations.
enum Products {
    /// Of none or one functional.
    Single(f64),
    Many(SymmetricFactor),
}

fn singular(error: crate::foam::solve::FactorError) -> EvolverError {
    EvolverError::Numerical(format!("the fixed volumes and quantities cannot be held: {error}"))
}

impl Products {
    /// From entries of the lower triangle, which may repeat.
    fn new(size: usize, mut entries: Vec<(u32, u32)>, mut values: Vec<f64>) -> Result<Self, EvolverError> {
        if size <= 1 {
            return Ok(Self::Single(values.iter().sum()));
        }
        let mut diagonal = vec![0.0; size];
        for (&(row, column), value) in entries.iter().zip(&values) {
            if row == column {
                diagonal[row as usize] += value;
            }
        }
        // A volume that nothing can change, or that follows from others, must not make the matrix singular.
        let most = diagonal.iter().fold(f64::MIN_POSITIVE, |most, &value| most.max(value));
        for at in 0..checked_u32(size) {
            entries.push((at, at));
            values.push(STIFFENING * most);
        }
        let pattern = Arc::new(SymmetricPattern::new(size, entries).map_err(singular)?);
        pattern.factor(&values).map(Self::Many).map_err(singular)
    }
}

impl Restoring {
    /// From the gradients of the functionals.
    ///
    /// # Errors
    /// [`EvolverError::Numerical`] if they depend on each other.
    pub(crate) fn new(problem: &Problem, state: &State, slots: &Slots) -> Result<Self, EvolverError> {
        let held = problem.held();
        let mut row = IndexVec::from_elem(None, problem.functionals().len());
        for (at, &id) in held.iter().enumerate() {
            row[id] = Some(checked_u32(at));
        }
        let mut velocities = slots.clone();
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for vertex in problem.holds.ids() {
            let range = velocities.range(vertex.index());
            for slot in range {
                velocities.values[slot] = problem.projected(state, vertex, slots.values[slot]);
            }
            let on_boundary = problem.moves_on_boundary(vertex);
            for ((a, raw), (_, own)) in slots.at(vertex).zip(velocities.at(vertex)) {
                // On a boundary both must be velocities of parameters.
                let gradient = if on_boundary { own } else { raw };
                for (b, velocity) in velocities.at(vertex) {
                    if let (Some(r), Some(c)) = (row[a], row[b])
                        && r >= c
                    {
                        entries.push((r, c));
                        values.push(gradient.dot(velocity));
                    }
                }
            }
        }
        let products = Products::new(held.len(), entries, values)?;
        Ok(Self { velocities, held, row, products })
    }

    /// The combination whose motion changes the functionals by `wanted`.
    fn combination(&self, wanted: &[f64]) -> Result<Vec<f64>, EvolverError> {
        match &self.products {
            Products::Single(product) => Ok(wanted.iter().map(|wanted| wanted / product).collect()),
            Products::Many(factor) => factor.solve(wanted).map_err(singular),
        }
    }

    /// What is missing from the targets, and the sum of the errors in units of the tolerance.
    fn missing(&self, problem: &Problem, values: &Values) -> (Vec<f64>, f64) {
        let mut error = 0.0;
        let missing = self
            .held
            .iter()
            .map(|&id| {
                let target = problem.functionals()[id].target.unwrap_or(0.0);
                let missing = target - values.functionals[id];
                let magnitude = values.magnitudes[id];
                let is_quantity = matches!(problem.functionals()[id].measured, Measured::Quantity(_));
                let unit = if (problem.relative || is_quantity) && magnitude > 0.0 { magnitude } else { 1.0 };
                error += missing.abs() / (TARGET_TOLERANCE * unit);
                missing
            })
            .collect();
        (missing, error)
    }

    fn push(&self, problem: &Problem, state: &mut State, factors: &[f64], scale: f64) {
        for vertex in problem.holds.ids() {
            let mut velocity = DVec3::ZERO;
            for (id, own) in self.velocities.at(vertex) {
                if let Some(row) = self.row[id] {
                    velocity += factors[row as usize] * own;
                }
            }
            if velocity != DVec3::ZERO {
                problem.push(state, vertex, velocity, scale);
            }
            problem.settle(state, vertex, false);
        }
    }

    /// Restores the functionals to their targets along their gradients; the values afterwards.
    pub(crate) fn restore(&self, problem: &Problem, state: &mut State) -> Result<Values, EvolverError> {
        let mut values = problem.values(&state.places);
        if self.held.is_empty() {
            return Ok(values);
        }
        let (mut missing, mut error) = self.missing(problem, &values);
        let mut fresh: Option<Self> = None;
        for step in 0..RESTORATIONS {
            if error <= 0.0 || error.is_nan() {
                break;
            }
            let basis = fresh.as_ref().unwrap_or(self);
            let factors = basis.combination(&missing)?;
            basis.push(problem, state, &factors, 1.0);
            values = problem.values(&state.places);
            let before = error;
            (missing, error) = self.missing(problem, &values);
            if error <= 1.0 {
                break;
            }
            if error > 0.5 * before && step + 1 < RESTORATIONS {
                // No good progress: the gradients are old.
                let slots = problem.functional_gradients(&state.places);
                fresh = Some(Self::new(problem, state, &slots)?);
            }
        }
        Ok(values)
    }
}

/// The force on each vertex, and the multiplier of each functional.
type Forces = (IndexVec<VertexId, DVec3>, IndexVec<FunctionalId, f64>);

/// What is added to the diagonal of the functionals' products, relative to the largest.
const STIFFENING: f64 = 1e-13;

impl Problem {
    pub(super) fn moves_on_boundary(&self, vertex: VertexId) -> bool {
        matches!(self.holds[vertex], super::freedom::Hold::Boundary(_))
    }

    /// The force within the constraints and the multipliers of the functionals.
    pub(crate) fn force(
        &self,
        state: &State,
        gradients: &Gradients,
        restoring: &Restoring,
    ) -> Result<Forces, EvolverError> {
        let mut force: IndexVec<VertexId, DVec3> =
            self.holds.ids().map(|vertex| self.projected(state, vertex, -gradients.energy[vertex])).collect();
        let mut load = vec![0.0; restoring.held.len()];
        for vertex in self.holds.ids() {
            for (id, gradient) in restoring.velocities.at(vertex) {
                if let Some(row) = restoring.row[id] {
                    load[row as usize] += force[vertex].dot(gradient);
                }
            }
        }
        let factors = restoring.combination(&load)?;
        for vertex in self.holds.ids() {
            for (id, velocity) in restoring.velocities.at(vertex) {
                if let Some(row) = restoring.row[id] {
                    force[vertex] -= factors[row as usize] * velocity;
                }
            }
        }
        let mut multipliers = IndexVec::from_elem(0.0, self.functionals().len());
        for (&id, factor) in restoring.held.iter().zip(factors) {
            multipliers[id] = -factor;
        }
        Ok((force, multipliers))
    }

    /// One step down.
    ///
    /// # Errors
    /// [`EvolverError::Numerical`] if the energy is no number.
    pub(crate) fn descend(
        &self,
        state: &mut State,
        descent: &mut Descent,
        slots: Slots,
    ) -> Result<(Descended, Slots), EvolverError> {
        let gradients = self.gradients(&state.places, slots);
        if self.walls.iter().any(|wall| wall.side != crate::evolver::datafile::Side::On) {
            let downhill = gradients.energy.iter().map(|g| -*g).collect();
            self.release(state, &downhill);
        }
        let restoring = Restoring::new(self, state, &gradients.functionals)?;
        let (force, multipliers) = self.force(state, &gradients, &restoring)?;
        let direction = descent.direction(force);
        let trial = Trial { problem: self, state, direction: &direction, restoring: &restoring };
        let (mut scale, mut stuck, mut base) = (descent.scale, false, f64::INFINITY);
        let (moved, values) = if descent.fixed {
            trial.at(scale, true)?
        } else {
            let found = trial.optimum(descent)?;
            (scale, stuck, base) = (found.scale, found.stuck, found.energy);
            let best = trial.at(scale, true)?;
            if best.1.energy > found.energy {
                // The parabola missed: the scale that is known to lower the energy.
                scale = found.lowering;
                trial.at(scale, true)?
            } else {
                best
            }
        };
        if !values.energy.is_finite() {
            let message = "the step gives no finite energy; the surface stays where it was".to_owned();
            return Err(EvolverError::Numerical(message));
        }
        *state = moved;
        descent.scale = scale;
        Ok((Descended { values, scale, multipliers, stuck, base }, gradients.functionals))
    }
}

impl Descent {
    /// Forgets earlier directions.
    pub(crate) fn restart(&mut self) {
        self.memory = None;
    }

    /// The direction of this step: the force, or one conjugate to those before (Polak and Ribière).
    fn direction(&mut self, force: IndexVec<VertexId, DVec3>) -> IndexVec<VertexId, DVec3> {
        if !self.conjugate {
            return force;
        }
        let dot = |a: &IndexVec<VertexId, DVec3>, b: &IndexVec<VertexId, DVec3>| -> f64 {
            a.iter().zip(b.iter()).map(|(a, b)| a.dot(*b)).sum()
        };
        let norm = dot(&force, &force);
        let direction = match &self.memory {
            Some(memory) if memory.force.len() == force.len() && memory.norm > 0.0 => {
                let gamma = ((norm - dot(&force, &memory.force)) / memory.norm).max(0.0);
                force.iter().zip(memory.direction.iter()).map(|(f, d)| *f + gamma * *d).collect()
            }
            _ => force.clone(),
        };
        self.memory = Some(Memory { force, direction: direction.clone(), norm });
        direction
    }
}

/// Trials along one direction.
struct Trial<'a> {
    problem: &'a Problem,
    state: &'a State,
    direction: &'a IndexVec<VertexId, DVec3>,
    restoring: &'a Restoring,
}

impl Trial<'_> {
    fn at(&self, scale: f64, last: bool) -> Result<(State, Values), EvolverError> {
        let mut state = self.state.clone();
        for vertex in self.problem.holds.ids() {
            self.problem.push(&mut state, vertex, self.direction[vertex], scale);
            self.problem.settle(&mut state, vertex, last);
        }
        let values = self.restoring.restore(self.problem, &mut state)?;
        Ok((state, values))
    }

    fn energy(&self, scale: f64) -> Result<f64, EvolverError> {
        let energy = self.at(scale, false)?.1.energy;
        Ok(if energy.is_finite() { energy } else { f64::MAX })
    }

    /// The scale of least energy by three trials and a parabola.
    fn optimum(&self, descent: &Descent) -> Result<Optimum, EvolverError> {
        let limit = descent.limit;
        let mut scale = descent.scale.min(limit);
        if scale <= 0.0 {
            scale = 1e-6 * limit;
        }
        let (mut first, mut e_first) = (scale, self.energy(scale)?);
        let e_zero = self.energy(0.0)?;
        let (mut second, mut e_second) = (first, e_first);
        if e_first < e_zero {
            loop {
                scale *= 2.0;
                (second, e_second) = (scale, self.energy(scale)?);
                if e_second > e_first {
                    scale *= 0.5;
                    break;
                }
                (first, e_first) = (second, e_second);
                if scale >= limit {
                    break;
                }
            }
        } else {
            let mut tries = 0;
            while e_first >= e_zero {
                tries += 1;
                if tries > HALVINGS || scale < 1e-12 * limit {
                    return Ok(Optimum { scale: 0.0, stuck: true, energy: e_zero, lowering: 0.0 });
                }
                (second, e_second) = (first, e_first);
                scale *= 0.5;
                (first, e_first) = (scale, self.energy(scale)?);
            }
        }
        if scale <= limit {
            let denominator = e_zero * (first - second) + e_first * second - e_second * first;
            let numerator = (e_zero - e_second) * first * first + (e_first - e_zero) * second * second;
            let parabola = 0.5 * numerator / denominator;
            scale = if parabola.is_finite() { parabola.max(0.0) } else { first };
        }
        Ok(Optimum { scale: scale.min(limit), stuck: false, energy: e_zero, lowering: first })
    }
}

/// What trials along a direction have found.
struct Optimum {
    scale: f64,
    /// Whether no scale lowers the energy.
    stuck: bool,
    /// The energy without a step.
    energy: f64,
    /// A scale that lowers it.
    lowering: f64,
}
