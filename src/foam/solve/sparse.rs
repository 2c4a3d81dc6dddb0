//! The sparse symmetric system: factored as LDLᵀ, solved with iterative refinement, its inertia read from the signs of D.

use super::layout::Layout;
use faer::{
    Conj, MatMut, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    sparse::{
        SparseColMat,
        linalg::cholesky::{
            CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
            factorize_symbolic_cholesky,
        },
    },
};

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
pub(super) struct Symbolic(SymbolicCholesky<usize>);

impl Symbolic {
    pub(super) fn new(layout: &Layout) -> Result<Self, FactorError> {
        factorize_symbolic_cholesky(
            layout.pattern.as_ref(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map(Self)
        .map_err(|_| FactorError::Memory { unknowns: layout.unknowns })
    }
}

/// A factored matrix.
pub(super) struct Factored<'a> {
    symbolic: &'a Symbolic,
    matrix: SparseColMat<usize, f64>,
    /// What was taken off the diagonal for the factorization alone.
    softening: &'a [f64],
    values: Vec<f64>,
    /// The number of negative pivots.
    pub(super) negative: usize,
}

/// The most steps of iterative refinement: each gains the digits that pivoting would have saved, five or more of them.
const REFINEMENTS: usize = 8;
/// The residual, relative to the load, above which a solution counts as none: the matrix is singular to working precision.
const SOLVED: f64 = 1e-6;

impl<'a> Factored<'a> {
    /// Factors the matrix with `entries`, less `softening` on its diagonal. A pressure has no diagonal of its own, and without
    /// pivoting one that is eliminated early would be divided by nearly nothing: a little of the right sign keeps the factors
    /// bounded (the matrix is then quasi-definite: R. J. Vanderbei, SIAM J. Optim. 5 (1995)), and the refinement of each
    /// solution by the true matrix takes it out again.
    pub(super) fn new(
        layout: &Layout,
        symbolic: &'a Symbolic,
        mut entries: Vec<f64>,
        softening: &'a [f64],
    ) -> Result<Self, FactorError> {
        let unknowns = layout.unknowns;
        let memory = |_| FactorError::Memory { unknowns };
        // The diagonal comes last.
        let diagonal = entries.len() - unknowns;
        entries[diagonal..].iter_mut().zip(softening).for_each(|(entry, off)| *entry -= off);
        let matrix = SparseColMat::new_from_argsort(layout.pattern.clone(), &layout.order, &entries)
            .map_err(memory)?;
        let Symbolic(cholesky) = symbolic;
        let mut values = vec![0.0; cholesky.len_val()];
        let scratch = cholesky.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::Memory { unknowns })?;
        cholesky
            .factorize_numeric_ldlt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut buffer),
                Default::default(),
            )
            .map_err(|_| FactorError::Singular { unknowns })?;
        let negative = negative_pivots(cholesky, &values);
        Ok(Self { symbolic, matrix, softening, values, negative })
    }

    /// The solution.
    ///
    /// # Errors
    /// [`FactorError::Singular`] if refinement does not settle.
    pub(super) fn solve(&self, rhs: &[f64]) -> Result<Vec<f64>, FactorError> {
        let unknowns = rhs.len();
        let Symbolic(cholesky) = self.symbolic;
        let factor = LdltRef::new(cholesky, &self.values);
        let scratch = cholesky.solve_in_place_scratch::<f64>(1, Par::Seq);
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::Memory { unknowns })?;
        let mut solution = vec![0.0; unknowns];
        let mut residual = rhs.to_vec();
        let load = largest(rhs);
        let mut left = f64::INFINITY;
        for _ in 0..=REFINEMENTS {
            let mut correction = residual.clone();
            factor.solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(&mut correction, unknowns, 1),
                Par::Seq,
                MemStack::new(&mut buffer),
            );
            let candidate: Vec<f64> = solution.iter().zip(&correction).map(|(s, c)| s + c).collect();
            let next = self.residual(rhs, &candidate);
            let size = largest(&next);
            if size.is_nan() || size >= 0.5 * left {
                break;
            }
            (solution, residual, left) = (candidate, next, size);
        }
        if left <= SOLVED * load { Ok(solution) } else { Err(FactorError::Singular { unknowns }) }
    }

    fn residual(&self, rhs: &[f64], x: &[f64]) -> Vec<f64> {
        let mut residual: Vec<f64> =
            rhs.iter().zip(self.softening).zip(x).map(|((load, off), x)| load - off * x).collect();
        for triplet in self.matrix.triplet_iter() {
            residual[triplet.row] -= triplet.val * x[triplet.col];
            if triplet.row != triplet.col {
                residual[triplet.col] -= triplet.val * x[triplet.row];
            }
        }
        residual
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, value| if value.is_nan() { f64::NAN } else { most.max(value.abs()) })
}

fn negative_pivots(cholesky: &SymbolicCholesky<usize>, values: &[f64]) -> usize {
    match cholesky.raw() {
        SymbolicCholeskyRaw::Simplicial(simplicial) => {
            // The diagonal comes first in every column.
            let starts = simplicial.col_ptr();
            (0..simplicial.nrows()).filter(|&column| values[starts[column]] < 0.0).count()
        }
        SymbolicCholeskyRaw::Supernodal(supernodal) => {
            let factor =
                faer::sparse::linalg::cholesky::supernodal::SupernodalLdltRef::new(supernodal, values);
            (0..supernodal.n_supernodes())
                .map(|node| {
                    let block = factor.supernode(node).val();
                    (0..block.ncols()).filter(|&i| block[(i, i)] < 0.0).count()
                })
                .sum()
        }
    }
}
