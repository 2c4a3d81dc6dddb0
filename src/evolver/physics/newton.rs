//! Newton steps on the Lagrangian with the functionals held, and what its matrix tells of stability.
//!
//! Unknowns are the vertices' directions of motion (`freedom.rs`), normals of the films unless all are asked for, then the
//! multipliers. The matrix (`assemble.rs`) is factored by the foam's sparse solver; at a minimum it has one negative pivot
//! for each held functional and no more.

use super::{
    assemble::{Assembled, Own, Start},
    descend::Restoring,
    freedom::State,
    problem::{FunctionalId, Problem, Values},
};
use crate::{
    evolver::{error::EvolverError, surface::VertexId},
    foam::solve::symmetric::{SymmetricFactor, SymmetricPattern},
    index::IndexVec,
};
use glam::DVec3;
use std::sync::Arc;

/// The matrix of a Newton step at one state.
pub(crate) struct Newton {
    pattern: Arc<SymmetricPattern>,
    values: Vec<f64>,
    /// The directions of each vertex, and its first unknown.
    pub(super) directions: IndexVec<VertexId, Own>,
    pub(super) held: Vec<FunctionalId>,
    /// The gradient of the Lagrangian by unknown.
    gradient: Vec<f64>,
    /// How many unknowns are directions.
    pub(super) freedoms: usize,
    /// How many unknowns there are.
    pub(super) size: usize,
    /// The entries of the diagonal of the directions.
    diagonal: std::ops::Range<usize>,
}

/// A Newton step.
#[derive(Clone, Debug)]
pub(crate) struct NewtonStep {
    /// The velocity of each vertex: a displacement, or a change of boundary parameters.
    pub(crate) velocity: IndexVec<VertexId, DVec3>,
    /// The changes of the multipliers.
    pub(crate) multipliers: IndexVec<FunctionalId, f64>,
    /// Directions of negative curvature.
    pub(crate) unstable: usize,
}

pub(super) fn failed(error: crate::foam::solve::FactorError) -> EvolverError {
    EvolverError::Numerical(format!("the Hessian cannot be factored: {error}"))
}

impl Newton {
    /// Assembles the matrix. `pattern` keeps the order in which it is factored for the next one with the same entries.
    pub(crate) fn new(
        start: &Start<'_>,
        pattern: &mut Option<Arc<SymmetricPattern>>,
    ) -> Result<Self, EvolverError> {
        let Assembled { directions, held, size, entries, values, gradient, diagonal } = Assembled::new(start);
        let freedoms = gradient.len();
        let known = pattern.take().filter(|known| known.fits(size, &entries));
        let order = match known {
            Some(known) => known,
            None => Arc::new(SymmetricPattern::new(size, entries).map_err(failed)?),
        };
        *pattern = Some(Arc::clone(&order));
        Ok(Self { pattern: order, values, directions, held, gradient, freedoms, size, diagonal })
    }

    /// Factors the matrix less `shift` times the identity on the directions.
    pub(super) fn factor(&self, shift: f64) -> Result<SymmetricFactor, EvolverError> {
        if shift.abs() <= 0.0 {
            return self.pattern.factor(&self.values).map_err(failed);
        }
        let mut values = self.values.clone();
        for value in &mut values[self.diagonal.clone()] {
            *value -= shift;
        }
        self.pattern.factor(&values).map_err(failed)
    }

    /// How many eigenvalues of the Hessian on the constraints lie below `value`.
    pub(crate) fn below(&self, value: f64) -> Result<usize, EvolverError> {
        Ok(self.factor(value)?.negative.saturating_sub(self.size - self.freedoms))
    }

    /// The step to the stationary point of the quadratic model.
    pub(crate) fn step(&self, problem: &Problem, values: &Values) -> Result<NewtonStep, EvolverError> {
        let factor = self.factor(0.0)?;
        let mut rhs: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        rhs.extend(self.held.iter().map(|&id| {
            let target = problem.functionals()[id].target.unwrap_or(0.0);
            values.functionals[id] - target
        }));
        rhs.resize(self.size, 0.0);
        let solution = factor.solve(&rhs).map_err(failed)?;
        if !solution.iter().all(|x| x.is_finite()) {
            return Err(EvolverError::Numerical("the Hessian is singular; take g steps first".to_owned()));
        }
        let mut multipliers = IndexVec::from_elem(0.0, problem.functionals().len());
        for (&id, change) in self.held.iter().zip(&solution[self.freedoms..]) {
            multipliers[id] = *change;
        }
        Ok(NewtonStep {
            velocity: self.velocity(&solution),
            multipliers,
            unstable: factor.negative.saturating_sub(self.size - self.freedoms),
        })
    }

    pub(super) fn velocity(&self, solution: &[f64]) -> IndexVec<VertexId, DVec3> {
        self.directions
            .iter()
            .map(|own| {
                own.along.as_slice().iter().zip(&solution[own.first as usize..]).map(|(&u, x)| *x * u).sum()
            })
            .collect()
    }

    /// The largest force on a direction.
    pub(crate) fn residual(&self) -> f64 {
        self.gradient.iter().fold(0.0, |most: f64, g| most.max(g.abs()))
    }
}

impl Problem {
    /// The state after `scale` times a step, back on the constraints and with the functionals restored.
    pub(crate) fn stepped(
        &self,
        state: &State,
        velocity: &IndexVec<VertexId, DVec3>,
        scale: f64,
    ) -> Result<(State, Values), EvolverError> {
        let mut moved = state.clone();
        for vertex in self.holds.ids() {
            self.push(&mut moved, vertex, velocity[vertex], scale);
            self.settle(&mut moved, vertex, false);
        }
        let slots = self.functional_gradients(&moved.places);
        let restoring = Restoring::new(self, &moved, &slots)?;
        let values = restoring.restore(self, &mut moved)?;
        Ok((moved, values))
    }

    /// The multipliers that leave the least force, by the gradients alone.
    pub(crate) fn estimated_multipliers(
        &self,
        state: &State,
    ) -> Result<IndexVec<FunctionalId, f64>, EvolverError> {
        let gradients = self.gradients(&state.places, self.slots());
        let restoring = Restoring::new(self, state, &gradients.functionals)?;
        Ok(self.force(state, &gradients, &restoring)?.1)
    }
}
