//! A sparse symmetric, possibly indefinite matrix from any list of entries, factored as LDLᵀ with a fill-reducing order; its
//! inertia is read from the signs of D.
//!
//! For systems that are not made of films; a complex has its own layout (`layout.rs`).

use super::sparse::FactorError;
use faer::{
    Conj, MatMut, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    sparse::{
        Argsort, Pair, SparseColMat, SymbolicSparseColMat,
        linalg::cholesky::{
            CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
            factorize_symbolic_cholesky, supernodal::SupernodalLdltRef,
        },
    },
};

/// The places of the entries of a matrix and the order in which it is factored.
#[derive(Debug)]
pub(crate) struct SymmetricPattern {
    pattern: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    cholesky: SymbolicCholesky<usize>,
    size: usize,
}

/// A factored matrix.
#[derive(Debug)]
pub(crate) struct SymmetricFactor<'a> {
    pattern: &'a SymmetricPattern,
    matrix: SparseColMat<usize, f64>,
    values: Vec<f64>,
    /// The number of negative pivots.
    pub(crate) negative: usize,
}

/// Steps of iterative refinement: each gains the digits that pivoting would have saved.
const REFINEMENTS: usize = 3;

/// What is taken off a zero diagonal, as a part of the largest entry: refinement restores ten digits at a step.
const SOFTENING: f64 = 1e-10;

/// From this size on the factorization is worth more than one thread.
const PARALLEL: usize = 20_000;

impl SymmetricPattern {
    /// The pattern of a matrix of `size` rows with entries at `(row, column)`, `row ≥ column`; repeated places are summed.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub(crate) fn new(size: usize, entries: &[(u32, u32)]) -> Result<Self, FactorError> {
        let memory = FactorError::Memory { unknowns: size };
        let pairs: Vec<Pair<usize, usize>> =
            entries.iter().map(|&(row, column)| Pair::new(row as usize, column as usize)).collect();
        let (pattern, order) =
            SymbolicSparseColMat::try_new_from_indices(size, size, &pairs).map_err(|_| memory)?;
        let cholesky = factorize_symbolic_cholesky(
            pattern.as_ref(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| memory)?;
        Ok(Self { pattern, order, cholesky, size })
    }

    /// Factors the matrix with these values, in the order of the entries of the pattern.
    ///
    /// # Errors
    /// [`FactorError`] if a pivot vanishes or memory is short.
    pub(crate) fn factor(&self, entries: &[f64]) -> Result<SymmetricFactor<'_>, FactorError> {
        let memory = FactorError::Memory { unknowns: self.size };
        let matrix =
            SparseColMat::new_from_argsort(self.pattern.clone(), &self.order, entries).map_err(|_| memory)?;
        let parallel = if self.size >= PARALLEL { Par::rayon(0) } else { Par::Seq };
        let mut values = vec![0.0; self.cholesky.len_val()];
        let scratch = self.cholesky.factorize_numeric_ldlt_scratch::<f64>(parallel, Default::default());
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| memory)?;
        let mut factor = |matrix: &SparseColMat<usize, f64>| {
            self.cholesky
                .factorize_numeric_ldlt(
                    &mut values,
                    matrix.as_ref(),
                    Side::Lower,
                    Default::default(),
                    parallel,
                    MemStack::new(&mut buffer),
                    Default::default(),
                )
                .map(|_| ())
        };
        factor(&matrix)
            .or_else(|_| factor(&softened(&matrix)))
            .map_err(|_| FactorError::Singular { unknowns: self.size })?;
        let negative = self.negative_pivots(&values);
        Ok(SymmetricFactor { pattern: self, matrix, values, negative })
    }

    fn negative_pivots(&self, values: &[f64]) -> usize {
        match self.cholesky.raw() {
            SymbolicCholeskyRaw::Simplicial(simplicial) => {
                // The diagonal comes first in every column.
                let starts = simplicial.col_ptr();
                (0..simplicial.nrows()).filter(|&column| values[starts[column]] < 0.0).count()
            }
            SymbolicCholeskyRaw::Supernodal(supernodal) => {
                let factor = SupernodalLdltRef::new(supernodal, values);
                (0..supernodal.n_supernodes())
                    .map(|node| {
                        let block = factor.supernode(node).val();
                        (0..block.ncols()).filter(|&i| block[(i, i)] < 0.0).count()
                    })
                    .sum()
            }
        }
    }
}

/// For a matrix whose order puts a zero diagonal first, as those of multipliers are: a small part of the largest entry is
/// taken off each. Refinement takes the true matrix.
fn softened(matrix: &SparseColMat<usize, f64>) -> SparseColMat<usize, f64> {
    let largest = matrix.val().iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let mut softened = matrix.clone();
    let zeros: Vec<usize> = (0..matrix.ncols())
        .flat_map(|column| matrix.col_ptr()[column]..matrix.col_ptr()[column + 1])
        .zip(matrix.triplet_iter())
        .filter(|(_, entry)| entry.row == entry.col && entry.val.abs() <= 0.0)
        .map(|(at, _)| at)
        .collect();
    for at in zeros {
        softened.val_mut()[at] -= SOFTENING * largest;
    }
    softened
}

impl SymmetricFactor<'_> {
    /// The solution for one right side; not finite numbers where the matrix is as good as singular.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub(crate) fn solve(&self, rhs: &[f64]) -> Result<Vec<f64>, FactorError> {
        let size = rhs.len();
        let factor = LdltRef::new(&self.pattern.cholesky, &self.values);
        let scratch = self.pattern.cholesky.solve_in_place_scratch::<f64>(1, Par::Seq);
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::Memory { unknowns: size })?;
        let mut solution = vec![0.0; size];
        let mut residual = rhs.to_vec();
        let mut left = f64::INFINITY;
        for _ in 0..=REFINEMENTS {
            let mut correction = residual.clone();
            factor.solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(&mut correction, size, 1),
                Par::Seq,
                MemStack::new(&mut buffer),
            );
            let candidate: Vec<f64> = solution.iter().zip(&correction).map(|(s, c)| s + c).collect();
            let next = self.residual(rhs, &candidate);
            let length = next.iter().map(|x| x * x).sum::<f64>();
            if length.is_nan() || length >= left {
                break;
            }
            (solution, residual, left) = (candidate, next, length);
        }
        Ok(solution)
    }

    /// What is left of `rhs` when the matrix times `x` is taken away.
    pub(crate) fn residual(&self, rhs: &[f64], x: &[f64]) -> Vec<f64> {
        let mut residual = rhs.to_vec();
        for entry in self.matrix.triplet_iter() {
            residual[entry.row] -= entry.val * x[entry.col];
            if entry.row != entry.col {
                residual[entry.col] -= entry.val * x[entry.row];
            }
        }
        residual
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_indefinite_system_is_solved_and_its_inertia_counted() {
        // [[2, 1, 1], [1, 3, 0], [1, 0, 0]]: a saddle with one negative pivot.
        let entries = [(0, 0), (1, 0), (2, 0), (1, 1), (2, 2)];
        let pattern = SymmetricPattern::new(3, &entries).unwrap();
        let factor = pattern.factor(&[2.0, 1.0, 1.0, 3.0, 0.0]).unwrap();
        assert_eq!(factor.negative, 1);
        let x = factor.solve(&[4.0, 4.0, 1.0]).unwrap();
        // x = (1, 1, 1): checked by hand.
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-14), "{x:?}");
    }
}
