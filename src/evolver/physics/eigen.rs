//! Eigenvalues of the Hessian on the constraints.

use super::newton::{Newton, failed};
use crate::{
    evolver::{error::EvolverError, surface::VertexId},
    foam::solve::symmetric::SymmetricFactor,
    index::IndexVec,
};
use faer::Mat;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

impl Newton {
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
                rhs.resize(self.size, 0.0);
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
    fn rotate(&self, plain: &SymmetricFactor, basis: &mut Vec<Vec<f64>>) -> Result<Vec<f64>, EvolverError> {
        let size = basis.len();
        let images: Vec<Vec<f64>> = basis
            .iter()
            .map(|vector| {
                let mut padded = vector.clone();
                padded.resize(self.size, 0.0);
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
