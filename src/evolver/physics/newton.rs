//! Newton steps on the Lagrangian with the functionals held, and what its matrix tells of stability.
//!
//! Unknowns are the vertices' directions of motion (`freedom.rs`), normals of the films unless all are asked for, then the
//! multipliers. The matrix is factored by the foam's sparse solver; at a minimum it has one negative pivot for each held
//! functional and no more.

use super::{
    descend::Restoring,
    freedom::{State, normals},
    gradient::{Slots, Weights},
    problem::{FunctionalId, Problem, Values},
};
use crate::{
    evolver::{
        error::EvolverError,
        surface::{Neighbours, Surface, VertexId},
    },
    foam::solve::symmetric::{SymmetricFactor, SymmetricPattern},
    index::{Id, IndexVec, checked_u32},
};
use faer::Mat;
use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The matrix of a Newton step at one state.
pub(crate) struct Newton {
    pattern: SymmetricPattern,
    entries: Vec<(u32, u32)>,
    values: Vec<f64>,
    /// The directions of each vertex, and its first unknown.
    directions: IndexVec<VertexId, Own>,
    held: Vec<FunctionalId>,
    /// The gradient of the Lagrangian by unknown.
    gradient: Vec<f64>,
    /// How many unknowns are directions.
    freedoms: usize,
    /// The entries of the diagonal.
    diagonal: Vec<usize>,
}

/// The directions of a vertex and the first of its unknowns.
#[derive(Clone, Copy)]
struct Own {
    first: u32,
    count: u8,
    basis: [DVec3; 3],
}

impl Own {
    fn directions(&self) -> &[DVec3] {
        &self.basis[..usize::from(self.count)]
    }
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

fn failed(error: crate::foam::solve::FactorError) -> EvolverError {
    EvolverError::Numerical(format!("the Hessian cannot be factored: {error}"))
}

impl Newton {
    /// Assembles the matrix. `normal` restricts vertices to the normals of the films.
    pub(crate) fn new(
        problem: &Problem,
        surface: &Surface,
        neighbours: &Neighbours,
        state: &State,
        multipliers: &IndexVec<FunctionalId, f64>,
        normal: bool,
    ) -> Result<Self, EvolverError> {
        let along = if normal { Some(normals(surface, neighbours)) } else { None };
        let plane = surface.dimension == 2;
        let mut freedoms = 0;
        let used = used_vertices(surface);
        let directions: IndexVec<VertexId, Own> = problem
            .holds
            .ids()
            .map(|vertex| {
                let along = along.as_ref().and_then(|along| along[vertex].as_deref());
                let own = if used[vertex.index()] {
                    problem.directions(state, vertex, along, plane)
                } else {
                    Vec::new()
                };
                let mut basis = [DVec3::ZERO; 3];
                basis[..own.len()].copy_from_slice(&own);
                freedoms += own.len();
                let first = checked_u32(freedoms - own.len());
                Own { first, count: u8::try_from(own.len()).unwrap_or(3), basis }
            })
            .collect();
        let mut newton = Self {
            pattern: SymmetricPattern::new(0, &[]).map_err(failed)?,
            entries: Vec::new(),
            values: Vec::new(),
            directions,
            held: problem.held(),
            gradient: vec![0.0; freedoms],
            freedoms,
            diagonal: Vec::new(),
        };
        newton.assemble(problem, state, multipliers);
        newton.constrain(problem, state);
        newton.pattern =
            SymmetricPattern::new(newton.freedoms + newton.held.len(), &newton.entries).map_err(failed)?;
        Ok(newton)
    }

    fn push(&mut self, row: usize, column: usize, value: f64) {
        self.entries.push((checked_u32(row.max(column)), checked_u32(row.min(column))));
        self.values.push(value);
    }

    fn assemble(&mut self, problem: &Problem, state: &State, multipliers: &IndexVec<FunctionalId, f64>) {
        let weights = Weights::lagrangian(problem, multipliers);
        let mut forces: IndexVec<VertexId, DVec3> = IndexVec::from_elem(DVec3::ZERO, problem.holds.len());
        for local in problem.locals(&state.places, &weights) {
            for (i, &a) in local.nodes[..local.count].iter().enumerate() {
                let a = VertexId::from_index(a as usize);
                forces[a] += local.gradient[i];
                for j in 0..local.count {
                    self.scatter(&local, i, j);
                }
            }
        }
        for (vertex, &force) in forces.enumerated() {
            let own = self.directions[vertex];
            let first = own.first as usize;
            if own.count == 0 {
                continue;
            }
            let bend = problem.bend(state, vertex, force, own.directions());
            for (s, &u) in own.directions().iter().enumerate() {
                self.gradient[first + s] += force.dot(u);
                for t in 0..=s {
                    self.push(first + s, first + t, bend.col(t)[s]);
                }
            }
        }
    }

    /// Adds an element's block between its nodes `i` and `j`.
    fn scatter(&mut self, local: &super::gradient::Local, i: usize, j: usize) {
        let (a, b) = (local.nodes[i] as usize, local.nodes[j] as usize);
        // Pairs of different vertices are met twice: the lower one is taken. One vertex twice in an element, as over a
        // torus, counts in both orders.
        let twice = a == b && i != j;
        if b > a || (twice && j > i) {
            return;
        }
        let (of_a, of_b) =
            (self.directions[VertexId::from_index(a)], self.directions[VertexId::from_index(b)]);
        let hessian = local.hessian.as_mat();
        let block = DMat3::from_cols_array_2d(&std::array::from_fn(|c| {
            std::array::from_fn(|r| hessian[(3 * i + r, 3 * j + c)])
        }));
        for (s, &u) in of_a.directions().iter().enumerate() {
            for (t, &w) in of_b.directions().iter().enumerate() {
                let (row, column) = (of_a.first as usize + s, of_b.first as usize + t);
                if a == b && row < column {
                    continue;
                }
                let both = if twice { w.dot(block * u) } else { 0.0 };
                self.push(row, column, u.dot(block * w) + both);
            }
        }
    }

    /// The gradients of the held functionals, and the diagonal, which every row needs.
    fn constrain(&mut self, problem: &Problem, state: &State) {
        let slots: Slots = problem.gradients(&state.places, problem.slots()).functionals;
        let row_of: std::collections::BTreeMap<FunctionalId, usize> =
            self.held.iter().enumerate().map(|(at, &id)| (id, self.freedoms + at)).collect();
        for vertex in problem.holds.ids() {
            let own = self.directions[vertex];
            for (id, gradient) in slots.at(vertex) {
                let Some(&row) = row_of.get(&id) else { continue };
                for (s, &u) in own.directions().iter().enumerate() {
                    self.push(row, own.first as usize + s, -gradient.dot(u));
                }
            }
        }
        for at in 0..self.freedoms + self.held.len() {
            self.diagonal.push(self.entries.len());
            self.push(at, at, 0.0);
        }
    }

    /// Factors the matrix less `shift` times the identity on the directions.
    fn factor(&self, shift: f64) -> Result<SymmetricFactor<'_>, EvolverError> {
        let mut values = self.values.clone();
        for &at in &self.diagonal[..self.freedoms] {
            values[at] -= shift;
        }
        self.pattern.factor(&values).map_err(failed)
    }

    /// How many eigenvalues of the Hessian on the constraints lie below `value`.
    pub(crate) fn below(&self, value: f64) -> Result<usize, EvolverError> {
        Ok(self.factor(value)?.negative.saturating_sub(self.held.len()))
    }

    /// The step to the stationary point of the quadratic model.
    pub(crate) fn step(&self, problem: &Problem, values: &Values) -> Result<NewtonStep, EvolverError> {
        let factor = self.factor(0.0)?;
        let mut rhs: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        rhs.extend(self.held.iter().map(|&id| {
            let target = problem.functionals()[id].target.unwrap_or(0.0);
            values.functionals[id] - target
        }));
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
            unstable: factor.negative.saturating_sub(self.held.len()),
        })
    }

    fn velocity(&self, solution: &[f64]) -> IndexVec<VertexId, DVec3> {
        self.directions
            .iter()
            .map(|own| {
                own.directions().iter().enumerate().map(|(s, &u)| solution[own.first as usize + s] * u).sum()
            })
            .collect()
    }

    /// The largest force on a direction.
    pub(crate) fn residual(&self) -> f64 {
        self.gradient.iter().fold(0.0, |most: f64, g| most.max(g.abs()))
    }

    /// The eigenvalues nearest to `shift` on the constraints, and the eigenvector of the lowest, by inverse iteration on a
    /// subspace from a fixed seed.
    pub(crate) fn eigenvalues(
        &self,
        shift: f64,
        count: usize,
    ) -> Result<(Vec<f64>, IndexVec<VertexId, DVec3>), EvolverError> {
        let count = count.clamp(1, self.freedoms.saturating_sub(self.held.len()).max(1));
        let width = (count + GUARD).min(self.freedoms);
        let factor = self.factor(shift)?;
        let plain = self.factor(0.0)?;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut basis: Vec<Vec<f64>> = (0..width)
            .map(|_| (0..self.freedoms).map(|_| random.random_range(-1.0..1.0)).collect())
            .collect();
        let mut found = vec![0.0; width];
        for _ in 0..ITERATIONS {
            for vector in &mut basis {
                let mut rhs = vector.clone();
                rhs.resize(self.freedoms + self.held.len(), 0.0);
                *vector = factor.solve(&rhs).map_err(failed)?;
                vector.truncate(self.freedoms);
            }
            orthonormalise(&mut basis);
            let before = found.clone();
            found = self.rotate(&plain, &mut basis)?;
            let change =
                found.iter().zip(&before).take(count).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let size = found.iter().take(count).fold(0.0, |most: f64, x| most.max(x.abs()));
            if change <= 1e-12 * size {
                break;
            }
        }
        let mut order: Vec<usize> = (0..basis.len()).collect();
        order.sort_by(|&a, &b| (found[a] - shift).abs().total_cmp(&(found[b] - shift).abs()));
        order.truncate(count);
        order.sort_by(|&a, &b| found[a].total_cmp(&found[b]));
        let lowest = order.first().map_or_else(Vec::new, |&at| basis[at].clone());
        let vector = if lowest.is_empty() {
            IndexVec::from_elem(DVec3::ZERO, self.directions.len())
        } else {
            self.velocity(&lowest)
        };
        Ok((order.into_iter().map(|at| found[at]).collect(), vector))
    }

    /// Rotates an orthonormal basis to the eigenvectors of the Hessian within it.
    fn rotate(
        &self,
        plain: &SymmetricFactor<'_>,
        basis: &mut Vec<Vec<f64>>,
    ) -> Result<Vec<f64>, EvolverError> {
        let size = basis.len();
        let images: Vec<Vec<f64>> = basis
            .iter()
            .map(|vector| {
                let mut padded = vector.clone();
                padded.resize(self.freedoms + self.held.len(), 0.0);
                let zero = vec![0.0; padded.len()];
                let mut image: Vec<f64> = plain.residual(&zero, &padded).iter().map(|x| -x).collect();
                image.truncate(self.freedoms);
                image
            })
            .collect();
        let small = Mat::from_fn(size, size, |i, j| dot(&basis[i], &images[j]));
        let eigen = small
            .self_adjoint_eigen(faer::Side::Lower)
            .map_err(|_| EvolverError::Numerical("the eigenvalues do not settle".to_owned()))?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let rotated = (0..size)
            .map(|k| {
                let mut out = vec![0.0; self.freedoms];
                for (i, vector) in basis.iter().enumerate() {
                    let factor = vectors[(i, k)];
                    for (o, v) in out.iter_mut().zip(vector) {
                        *o += factor * v;
                    }
                }
                out
            })
            .collect();
        *basis = rotated;
        Ok((0..size).map(|k| values[k]).collect())
    }
}

/// More vectors than eigenvalues are asked for make the iteration settle faster.
const GUARD: usize = 4;
/// Iterations of the subspace: each gains a digit where eigenvalues lie apart.
const ITERATIONS: usize = 60;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn orthonormalise(basis: &mut Vec<Vec<f64>>) {
    let mut done: Vec<Vec<f64>> = Vec::with_capacity(basis.len());
    for vector in basis.drain(..) {
        let mut rest = vector;
        for _ in 0..2 {
            for other in &done {
                let along = dot(&rest, other);
                rest.iter_mut().zip(other).for_each(|(r, o)| *r -= along * o);
            }
        }
        let length = dot(&rest, &rest).sqrt();
        if length > 0.0 && length.is_finite() {
            rest.iter_mut().for_each(|r| *r /= length);
            done.push(rest);
        }
    }
    *basis = done;
}

fn used_vertices(surface: &Surface) -> Vec<bool> {
    let mut used = vec![false; surface.vertices.len()];
    for edge in &surface.edges {
        for vertex in edge.ends.into_iter().chain(edge.middle) {
            used[vertex.index()] = true;
        }
    }
    used
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
        let slots = self.gradients(&moved.places, self.slots()).functionals;
        let restoring = Restoring::new(self, &moved, &slots);
        let values = restoring.restore(self, &mut moved)?;
        Ok((moved, values))
    }

    /// The multipliers that leave the least force, by the gradients alone.
    pub(crate) fn estimated_multipliers(
        &self,
        state: &State,
    ) -> Result<IndexVec<FunctionalId, f64>, EvolverError> {
        let gradients = self.gradients(&state.places, self.slots());
        let restoring = Restoring::new(self, state, &gradients.functionals);
        Ok(self.force(state, &gradients, &restoring)?.1)
    }
}
