//! The system's matrix: factored as LDLᵀ, solved with iterative refinement.

use super::{
    layout::Layout,
    symmetric::{SymmetricFactor, SymmetricPattern},
};
use std::sync::Arc;

/// A failed factorization.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// There is not enough memory.
    #[error("not enough memory to factor a system of {unknowns} unknowns")]
    Memory {
        /// The size of the system.
        unknowns: usize,
    },
    /// A pivot vanished.
    #[error("Newton's matrix of {unknowns} unknowns is singular")]
    Singular {
        /// The size of the system.
        unknowns: usize,
    },
}

/// The fill-reducing order of a pattern: computed once for a topology.
#[derive(Debug)]
pub(super) struct Symbolic(Arc<SymmetricPattern>);

impl Symbolic {
    pub(super) fn new(layout: &Layout) -> Result<Self, FactorError> {
        SymmetricPattern::new(layout.unknowns, layout.entries()).map(|pattern| Self(Arc::new(pattern)))
    }
}

/// A factored matrix.
pub(super) struct Factored<'a> {
    factor: SymmetricFactor,
    /// What was taken off the diagonal for the factorization alone.
    softening: &'a [f64],
    /// The number of negative pivots.
    pub(super) negative: usize,
}

/// The most steps of iterative refinement: each gains the digits that pivoting would have saved, five or more of them.
const REFINEMENTS: usize = 8;
/// A residual, relative to the load, at which a solution is good enough: what Newton's next step or the next inverse
/// iteration finds left is smaller by as much.
const REFINED: f64 = 1e-11;
/// The residual, relative to the load, above which a solution counts as none: the matrix is singular to working precision.
const SOLVED: f64 = 1e-6;

impl<'a> Factored<'a> {
    /// Factors the matrix with `entries`, less `softening` on its diagonal. A pressure has no diagonal of its own, and without
    /// pivoting one that is eliminated early would be divided by nearly nothing: a little of the right sign keeps the factors
    /// bounded (the matrix is then quasi-definite: R. J. Vanderbei, SIAM J. Optim. 5 (1995)), and the refinement of each
    /// solution by the true matrix takes it out again.
    pub(super) fn new(
        symbolic: &Symbolic,
        mut entries: Vec<f64>,
        softening: &'a [f64],
    ) -> Result<Self, FactorError> {
        // The diagonal comes last.
        let diagonal = entries.len() - softening.len();
        entries[diagonal..].iter_mut().zip(softening).for_each(|(entry, off)| *entry -= off);
        let factor = symbolic.0.factor(&entries)?;
        Ok(Self { negative: factor.negative, factor, softening })
    }

    /// The solution.
    ///
    /// # Errors
    /// [`FactorError::Singular`] if refinement does not settle.
    pub(super) fn solve(&self, rhs: &[f64]) -> Result<Vec<f64>, FactorError> {
        let unknowns = rhs.len();
        let mut solution = vec![0.0; unknowns];
        let mut residual = rhs.to_vec();
        let load = largest(rhs);
        let mut left = f64::INFINITY;
        for _ in 0..=REFINEMENTS {
            let correction = self.factor.correction(&residual)?;
            let candidate: Vec<f64> = solution.iter().zip(&correction).map(|(s, c)| s + c).collect();
            let next = self.residual(rhs, &candidate);
            let size = largest(&next);
            if size.is_nan() || size >= 0.5 * left {
                break;
            }
            (solution, residual, left) = (candidate, next, size);
            if left <= REFINED * load {
                break;
            }
        }
        if left <= SOLVED * load { Ok(solution) } else { Err(FactorError::Singular { unknowns }) }
    }

    /// What is left of `rhs` when the true matrix times `x` is taken away.
    fn residual(&self, rhs: &[f64], x: &[f64]) -> Vec<f64> {
        let mut residual = self.factor.residual(rhs, x);
        residual.iter_mut().zip(self.softening).zip(x).for_each(|((left, off), x)| *left -= off * x);
        residual
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, value| if value.is_nan() { f64::NAN } else { most.max(value.abs()) })
}
