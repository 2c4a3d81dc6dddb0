//! A sparse symmetric, possibly indefinite matrix from any list of entries, factored as LDLᵀ with a fill-reducing order; its
//! inertia is read from the signs of D.
//!
//! For systems that are not made of films, too; a complex has its own layout (`layout.rs`) and refinement (`sparse.rs`).

use super::{fronts::Fronts, sparse::FactorError, supernodes};
use crate::index::checked_u32;
use faer::{
    Conj, MatMut, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    sparse::{
        SparseColMatRef, SymbolicSparseColMat,
        linalg::SupernodalThreshold,
        linalg::cholesky::{
            CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
            factorize_symbolic_cholesky, supernodal::SupernodalLdltRef,
        },
    },
};
use std::sync::{Arc, Mutex};

/// The places of the entries of a matrix and the order in which it is factored.
#[derive(Debug)]
pub(crate) struct SymmetricPattern {
    entries: Vec<(u32, u32)>,
    /// Where each entry is summed.
    places: Vec<u32>,
    pattern: SymbolicSparseColMat<usize>,
    cholesky: SymbolicCholesky<usize>,
    fronts: Option<Fronts>,
    /// The values of a factor that is no longer in use: memory that is already at hand.
    spare: Mutex<Vec<f64>>,
    size: usize,
}

/// A factored matrix.
#[derive(Debug)]
pub(crate) struct SymmetricFactor {
    pattern: Arc<SymmetricPattern>,
    matrix: Vec<f64>,
    values: Vec<f64>,
    /// The number of negative pivots.
    pub(crate) negative: usize,
}

/// Steps of iterative refinement: each gains the digits that pivoting would have saved.
const REFINEMENTS: usize = 3;

/// The residual, relative to the right side, at which a solution is good enough: Newton's next step takes out the rest.
const REFINED: f64 = 1e-12;

/// What a step of refinement may leave of a residual for another one to be worth its time.
const WORTH: f64 = 0.1;

/// What is taken off a zero diagonal, as a part of the largest entry: refinement restores ten digits at a step.
const SOFTENING: f64 = 1e-10;

/// From this size on fronts of several columns are faster than single columns.
const FRONTS: usize = 2000;

impl SymmetricPattern {
    /// The pattern of a matrix of `size` rows with entries at `(row, column)`, `row ≥ column`; repeated places are summed.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub(crate) fn new(size: usize, entries: Vec<(u32, u32)>) -> Result<Self, FactorError> {
        let memory = FactorError::Memory { unknowns: size };
        let (starts, rows, places) = by_columns(size, &entries);
        let pattern = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        let mut parameters = CholeskySymbolicParams::default();
        if size >= FRONTS {
            parameters.supernodal_flop_ratio_threshold = SupernodalThreshold::FORCE_SUPERNODAL;
        }
        let cholesky =
            factorize_symbolic_cholesky(pattern.as_ref(), Side::Lower, SymmetricOrdering::Amd, parameters)
                .map_err(|_| memory)?;
        let mut new =
            Self { entries, places, pattern, cholesky, fronts: None, spare: Mutex::default(), size };
        if let (SymbolicCholeskyRaw::Supernodal(blocks), Some(order)) =
            (new.cholesky.raw(), new.cholesky.perm())
        {
            let columns = (0..size).flat_map(|column| new.column(column).map(move |(_, row)| (row, column)));
            new.fronts = Fronts::new(blocks, order.arrays().1, columns);
        }
        Ok(new)
    }

    /// Whether this is the pattern of these entries.
    pub(crate) fn fits(&self, size: usize, entries: &[(u32, u32)]) -> bool {
        self.size == size && self.entries == entries
    }

    /// Factors the matrix with these values, in the order of the entries of the pattern.
    ///
    /// # Errors
    /// [`FactorError`] if a pivot vanishes or memory is short.
    pub(crate) fn factor(self: &Arc<Self>, entries: &[f64]) -> Result<SymmetricFactor, FactorError> {
        let singular = FactorError::Singular { unknowns: self.size };
        let mut matrix = vec![0.0; self.pattern.row_idx().len()];
        for (&place, value) in self.places.iter().zip(entries) {
            matrix[place as usize] += value;
        }
        let mut values = self.spare.lock().map(|mut spare| std::mem::take(&mut *spare)).unwrap_or_default();
        values.resize(self.cholesky.len_val(), 0.0);
        let mut factor = |matrix: &[f64]| match (&self.fronts, self.cholesky.raw()) {
            (Some(fronts), SymbolicCholeskyRaw::Supernodal(blocks)) => {
                fronts.factor(blocks, matrix, &mut values).map_err(|_| singular)
            }
            _ => self.factor_by_columns(matrix, &mut values),
        };
        factor(&matrix)
            .or_else(|error| if error == singular { factor(&self.softened(&matrix)) } else { Err(error) })?;
        let negative = self.negative_pivots(&values);
        Ok(SymmetricFactor { pattern: Arc::clone(self), matrix, values, negative })
    }

    fn factor_by_columns(&self, matrix: &[f64], values: &mut [f64]) -> Result<(), FactorError> {
        let scratch = self.cholesky.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let mut buffer =
            MemBuffer::try_new(scratch).map_err(|_| FactorError::Memory { unknowns: self.size })?;
        self.cholesky
            .factorize_numeric_ldlt(
                values,
                SparseColMatRef::new(self.pattern.as_ref(), matrix),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut buffer),
                Default::default(),
            )
            .map(|_| ())
            .map_err(|_| FactorError::Singular { unknowns: self.size })
    }

    /// The places of a column's entries, and their rows; the diagonal comes first where there is one.
    fn column(&self, column: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let range = self.pattern.col_ptr()[column]..self.pattern.col_ptr()[column + 1];
        range.clone().zip(self.pattern.row_idx()[range].iter().copied())
    }

    /// For a matrix whose order puts a zero diagonal first, as those of multipliers are: a small part of the largest entry
    /// is taken off each. Refinement takes the true matrix.
    fn softened(&self, matrix: &[f64]) -> Vec<f64> {
        let largest = matrix.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let mut softened = matrix.to_vec();
        for column in 0..self.size {
            for (place, row) in self.column(column) {
                if row == column && matrix[place].abs() <= 0.0 {
                    softened[place] -= SOFTENING * largest;
                }
            }
        }
        softened
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

/// Starts of the columns, rows in them in order, and where each entry goes.
fn by_columns(size: usize, entries: &[(u32, u32)]) -> (Vec<usize>, Vec<usize>, Vec<u32>) {
    let mut ends = vec![0; size + 1];
    for &(_, column) in entries {
        ends[column as usize + 1] += 1;
    }
    for column in 0..size {
        ends[column + 1] += ends[column];
    }
    let mut sorted = vec![(0, 0); entries.len()];
    let mut next = ends.clone();
    for (at, &(row, column)) in entries.iter().enumerate() {
        let place = &mut next[column as usize];
        sorted[*place] = (row, at);
        *place += 1;
    }
    let (mut starts, mut rows) = (Vec::with_capacity(size + 1), Vec::with_capacity(entries.len()));
    let mut places = vec![0; entries.len()];
    starts.push(0);
    for column in 0..size {
        let own = &mut sorted[ends[column]..ends[column + 1]];
        own.sort_unstable();
        let mut last = None;
        for &(row, at) in own.iter() {
            if last != Some(row) {
                rows.push(row as usize);
                last = Some(row);
            }
            places[at] = checked_u32(rows.len() - 1);
        }
        starts.push(rows.len());
    }
    (starts, rows, places)
}

impl Drop for SymmetricFactor {
    fn drop(&mut self) {
        if let Ok(mut spare) = self.pattern.spare.lock() {
            *spare = std::mem::take(&mut self.values);
        }
    }
}

impl SymmetricFactor {
    /// The solution for one right side; not finite numbers where the matrix is as good as singular.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub(crate) fn solve(&self, rhs: &[f64]) -> Result<Vec<f64>, FactorError> {
        let size = rhs.len();
        let mut solution = vec![0.0; size];
        let mut residual = rhs.to_vec();
        let mut left = f64::INFINITY;
        let enough = REFINED * REFINED * rhs.iter().map(|x| x * x).sum::<f64>();
        for _ in 0..=REFINEMENTS {
            let correction = self.correction(&residual)?;
            let candidate: Vec<f64> = solution.iter().zip(&correction).map(|(s, c)| s + c).collect();
            let next = self.residual(rhs, &candidate);
            let length = next.iter().map(|x| x * x).sum::<f64>();
            if length.is_nan() || length >= left {
                break;
            }
            let worth = length.sqrt() <= WORTH * left.sqrt();
            (solution, residual, left) = (candidate, next, length);
            if left <= enough || !worth {
                break;
            }
        }
        Ok(solution)
    }

    /// The solution to the digits that the factor has.
    pub(super) fn correction(&self, residual: &[f64]) -> Result<Vec<f64>, FactorError> {
        let size = residual.len();
        let cholesky = &self.pattern.cholesky;
        if let (SymbolicCholeskyRaw::Supernodal(blocks), Some(order)) = (cholesky.raw(), cholesky.perm()) {
            let (forward, back) = order.arrays();
            let mut ordered: Vec<f64> = forward.iter().map(|&at| residual[at]).collect();
            supernodes::solve(blocks, &self.values, &mut ordered);
            return Ok(back.iter().map(|&at| ordered[at]).collect());
        }
        let scratch = cholesky.solve_in_place_scratch::<f64>(1, Par::Seq);
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::Memory { unknowns: size })?;
        let mut correction = residual.to_vec();
        LdltRef::new(cholesky, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut correction, size, 1),
            Par::Seq,
            MemStack::new(&mut buffer),
        );
        Ok(correction)
    }

    /// What is left of `rhs` when the matrix times `x` is taken away.
    pub(crate) fn residual(&self, rhs: &[f64], x: &[f64]) -> Vec<f64> {
        let mut residual = rhs.to_vec();
        for column in 0..self.pattern.size {
            for (place, row) in self.pattern.column(column) {
                let value = self.matrix[place];
                residual[row] -= value * x[column];
                if row != column {
                    residual[column] -= value * x[row];
                }
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
        let entries = vec![(0, 0), (1, 0), (2, 0), (1, 1), (2, 2), (0, 0)];
        let pattern = Arc::new(SymmetricPattern::new(3, entries).unwrap());
        // The first entry in two parts.
        let factor = pattern.factor(&[1.5, 1.0, 1.0, 3.0, 0.0, 0.5]).unwrap();
        assert_eq!(factor.negative, 1);
        let x = factor.solve(&[4.0, 4.0, 1.0]).unwrap();
        // x = (1, 1, 1): checked by hand.
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-14), "{x:?}");
    }
}
