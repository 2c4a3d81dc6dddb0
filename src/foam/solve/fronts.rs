//! LDLᵀ by fronts: the columns of a supernode are eliminated in a dense matrix of their own, and what that leaves of the rows
//! below is added to the front of the next supernode up the tree (I. Duff and J. Reid, ACM Trans. Math. Softw. 9 (1983) 302).
//!
//! Order, tree and blocks are those of faer's symbolic analysis. Subtrees are eliminated in parallel, then the large fronts
//! above them with their updates in panels; sums have one order for any number of threads.

use faer::prelude::{Reborrow, ReborrowMut};
use faer::{
    MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::ldlt::factor::{cholesky_in_place, cholesky_in_place_scratch},
        matmul::matmul,
        triangular_solve::solve_unit_lower_triangular_in_place,
    },
    sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky,
};
use rayon::prelude::*;
use std::ops::Range;

use crate::index::checked_u32;

/// A pivot is zero or no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ZeroPivot;

/// The part of all work that a subtree may have that is eliminated by one thread.
const SHARE: f64 = 1.0 / 12.0;
/// Work, in multiplications, below which threads only wait for each other.
const LITTLE: f64 = 2e6;
/// Columns of an update that are computed at a time.
const PANEL: usize = 96;
/// Multiplications of an update below which plain loops are faster than dense kernels.
const SMALL: usize = 6000;

/// The tree of fronts and where a matrix's entries go.
#[derive(Debug)]
pub(super) struct Fronts {
    /// The supernode to which each passes its update; itself for a root.
    parents: Vec<u32>,
    /// Where the rows below each supernode stand in its parent's front, in the order of the symbolic analysis.
    places_above: Vec<u32>,
    /// Where each entry of the matrix is put among the factor's values.
    targets: Vec<u32>,
    /// Subtrees that are eliminated in parallel, and the supernodes above them.
    subtrees: Vec<Range<usize>>,
    top: Vec<usize>,
}

/// The shape of one supernode's front.
#[derive(Clone, Copy)]
struct Front {
    at: usize,
    columns: usize,
    rows: usize,
}

impl Front {
    fn new(symbolic: &SymbolicSupernodalCholesky<usize>, at: usize) -> Self {
        let columns = symbolic.supernode_end()[at] - symbolic.supernode_begin()[at];
        Self { at, columns, rows: columns + symbolic.supernode(at).pattern().len() }
    }

    fn below(self) -> usize {
        self.rows - self.columns
    }
}

/// What a supernode leaves of the rows below it: the lower triangle, by columns.
struct Update {
    from: usize,
    values: Vec<f64>,
}

impl Fronts {
    /// For a matrix with entries at `(row, column)`, whose unknown `i` comes at `rank[i]`; `None` if the analysis is not
    /// ordered subtree by subtree.
    pub(super) fn new(
        symbolic: &SymbolicSupernodalCholesky<usize>,
        rank: &[usize],
        entries: impl Iterator<Item = (usize, usize)>,
    ) -> Option<Self> {
        let count = symbolic.n_supernodes();
        let mut owner = vec![0; symbolic.nrows()];
        for at in 0..count {
            owner[symbolic.supernode_begin()[at]..symbolic.supernode_end()[at]].fill(at);
        }
        let place_in = |at: usize, row: usize| -> Option<usize> {
            let (start, end) = (symbolic.supernode_begin()[at], symbolic.supernode_end()[at]);
            if row < end {
                return row.checked_sub(start);
            }
            symbolic.supernode(at).pattern().binary_search(&row).ok().map(|below| end - start + below)
        };
        let (mut parents, mut places_above) = (Vec::with_capacity(count), Vec::new());
        for at in 0..count {
            let below = symbolic.supernode(at).pattern();
            let parent = below.first().map_or(at, |&row| owner[row]);
            parents.push(checked_u32(parent));
            for &row in below {
                places_above.push(checked_u32(place_in(parent, row)?));
            }
        }
        let mut targets = Vec::new();
        for (row, column) in entries {
            let (low, high) = (rank[row].min(rank[column]), rank[row].max(rank[column]));
            let at = owner[low];
            let front = Front::new(symbolic, at);
            let within = (low - symbolic.supernode_begin()[at]) * front.rows + place_in(at, high)?;
            targets.push(checked_u32(symbolic.col_ptr_for_val()[at] + within));
        }
        let mut fronts = Self { parents, places_above, targets, subtrees: Vec::new(), top: Vec::new() };
        fronts.divide(symbolic)?;
        Some(fronts)
    }

    /// Finds the subtrees that one thread does at a time.
    fn divide(&mut self, symbolic: &SymbolicSupernodalCholesky<usize>) -> Option<()> {
        let count = self.parents.len();
        let own = |at: usize| {
            let Front { columns, rows, .. } = Front::new(symbolic, at);
            #[expect(clippy::cast_precision_loss, reason = "a measure of work")]
            let (columns, rows) = (columns as f64, rows as f64);
            columns * rows * rows
        };
        let mut work: Vec<f64> = (0..count).map(own).collect();
        let mut first: Vec<usize> = Vec::with_capacity(count);
        let mut open: Vec<usize> = Vec::new();
        for at in 0..count {
            let mut start = at;
            // The subtrees below come right before their root.
            while let Some(&child) = open.last().filter(|&&child| self.parents[child] as usize == at) {
                open.pop();
                work[at] += work[child];
                start = first[child];
            }
            first.push(start);
            if self.parents[at] as usize != at {
                open.push(at);
            }
        }
        if !open.is_empty() {
            return None;
        }
        let total: f64 = (0..count).filter(|&at| self.parents[at] as usize == at).map(|at| work[at]).sum();
        let small = |at: usize| total > LITTLE && work[at] <= SHARE * total;
        for (at, &start) in first.iter().enumerate() {
            let parent = self.parents[at] as usize;
            if !small(at) {
                self.top.push(at);
            } else if parent == at || !small(parent) {
                self.subtrees.push(start..at + 1);
            }
        }
        Some(())
    }

    /// Factors the matrix with these entries, in the order in which they were given; `values` are overwritten.
    pub(super) fn factor(
        &self,
        symbolic: &SymbolicSupernodalCholesky<usize>,
        matrix: &[f64],
        values: &mut [f64],
    ) -> Result<(), ZeroPivot> {
        values.fill(0.0);
        for (&target, value) in self.targets.iter().zip(matrix) {
            values[target as usize] += value;
        }
        let starts = symbolic.col_ptr_for_val();
        let mut tasks = Vec::with_capacity(self.subtrees.len());
        let (mut rest, mut taken) = (&mut *values, 0);
        for subtree in &self.subtrees {
            let (_, from) = rest.split_at_mut(starts[subtree.start] - taken);
            let (own, after) = from.split_at_mut(starts[subtree.end] - starts[subtree.start]);
            (rest, taken) = (after, starts[subtree.end]);
            tasks.push((subtree.clone(), own));
        }
        let done: Vec<Result<Vec<Update>, ZeroPivot>> =
            tasks.into_par_iter().map(|(subtree, own)| self.subtree(symbolic, subtree, own)).collect();
        let mut waiting: Vec<Vec<Update>> = Vec::new();
        waiting.resize_with(self.parents.len(), Vec::new);
        for updates in done {
            for update in updates? {
                waiting[self.parents[update.from] as usize].push(update);
            }
        }
        for &at in &self.top {
            let children = std::mem::take(&mut waiting[at]);
            let block = &mut values[starts[at]..starts[at + 1]];
            let update = self.eliminate(symbolic, at, block, children, true)?;
            waiting[self.parents[at] as usize].push(update);
        }
        Ok(())
    }

    /// Eliminates a subtree; what its root leaves, if it has a parent.
    fn subtree(
        &self,
        symbolic: &SymbolicSupernodalCholesky<usize>,
        subtree: Range<usize>,
        values: &mut [f64],
    ) -> Result<Vec<Update>, ZeroPivot> {
        let starts = symbolic.col_ptr_for_val();
        let first = starts[subtree.start];
        let mut open: Vec<Update> = Vec::new();
        for at in subtree {
            let is_child = |update: &Update| self.parents[update.from] as usize == at;
            let children = open.iter().rev().take_while(|update| is_child(update)).count();
            let children = open.split_off(open.len() - children);
            let block = &mut values[starts[at] - first..starts[at + 1] - first];
            let update = self.eliminate(symbolic, at, block, children, false)?;
            if self.parents[at] as usize != at {
                open.push(update);
            }
        }
        Ok(open)
    }

    /// Eliminates the columns of one supernode.
    fn eliminate(
        &self,
        symbolic: &SymbolicSupernodalCholesky<usize>,
        at: usize,
        block: &mut [f64],
        children: Vec<Update>,
        parallel: bool,
    ) -> Result<Update, ZeroPivot> {
        let front = Front::new(symbolic, at);
        let mut values = vec![0.0; front.below() * front.below()];
        for child in children {
            let rows =
                symbolic.col_ptr_for_row_idx()[child.from]..symbolic.col_ptr_for_row_idx()[child.from + 1];
            add(&child.values, &self.places_above[rows], front, block, &mut values);
        }
        if front.columns * front.rows * front.rows <= SMALL {
            eliminate_by_columns(front, block, &mut values)?;
        } else {
            eliminate_dense(front, block, &mut values, parallel)?;
        }
        Ok(Update { from: front.at, values })
    }
}

/// Adds a child's update to a front.
fn add(update: &[f64], places: &[u32], front: Front, block: &mut [f64], values: &mut [f64]) {
    let (count, below) = (places.len(), front.below());
    for (j, &column) in places.iter().enumerate() {
        let (column, from) = (column as usize, &update[j * count + j..(j + 1) * count]);
        if column < front.columns {
            let to = &mut block[column * front.rows..(column + 1) * front.rows];
            places[j..].iter().zip(from).for_each(|(&row, value)| to[row as usize] += value);
        } else {
            let column = column - front.columns;
            let to = &mut values[column * below..(column + 1) * below];
            places[j..].iter().zip(from).for_each(|(&row, value)| to[row as usize - front.columns] += value);
        }
    }
}

fn is_pivot(value: f64) -> bool {
    value.is_finite() && value.abs() > 0.0
}

/// By plain loops, for small fronts.
fn eliminate_by_columns(front: Front, block: &mut [f64], values: &mut [f64]) -> Result<(), ZeroPivot> {
    let Front { columns, rows, .. } = front;
    let below = front.below();
    for k in 0..columns {
        let (left, right) = block.split_at_mut((k + 1) * rows);
        let column = &mut left[k * rows..];
        let pivot = column[k];
        if !is_pivot(pivot) {
            return Err(ZeroPivot);
        }
        for j in k + 1..columns {
            let factor = column[j] / pivot;
            let to = &mut right[(j - k - 1) * rows + j..(j - k) * rows];
            to.iter_mut().zip(&column[j..]).for_each(|(to, l)| *to -= factor * l);
        }
        for j in 0..below {
            let factor = column[columns + j] / pivot;
            let to = &mut values[j * below + j..(j + 1) * below];
            to.iter_mut().zip(&column[columns + j..]).for_each(|(to, l)| *to -= factor * l);
        }
        column[k + 1..].iter_mut().for_each(|l| *l /= pivot);
    }
    Ok(())
}

/// By dense kernels, for large fronts.
fn eliminate_dense(
    front: Front,
    block: &mut [f64],
    values: &mut [f64],
    parallel: bool,
) -> Result<(), ZeroPivot> {
    let Front { columns, rows, .. } = front;
    let below = front.below();
    let (mut own, mut under) =
        MatMut::from_column_major_slice_mut(block, rows, columns).split_at_row_mut(columns);
    let mut scratch = MemBuffer::new(cholesky_in_place_scratch::<f64>(columns, Par::Seq, Default::default()));
    cholesky_in_place(
        own.rb_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut scratch),
        Default::default(),
    )
    .map_err(|_| ZeroPivot)?;
    if !(0..columns).all(|k| is_pivot(own[(k, k)])) {
        return Err(ZeroPivot);
    }
    if below == 0 {
        return Ok(());
    }
    solve_unit_lower_triangular_in_place(own.rb(), under.rb_mut().transpose_mut(), Par::Seq);
    // The rows below, times the pivots and without them.
    let mut weighted = vec![0.0; below * columns];
    for (k, weighted) in weighted.chunks_exact_mut(below).enumerate() {
        let pivot = own[(k, k)];
        for (i, weighted) in weighted.iter_mut().enumerate() {
            *weighted = under[(i, k)];
            under[(i, k)] /= pivot;
        }
    }
    let (under, weighted) = (under.rb(), MatRef::from_column_major_slice(&weighted, below, columns));
    let panel = |(number, panel): (usize, &mut [f64])| {
        let (first, width) = (number * PANEL, panel.len() / below);
        let to = MatMut::from_column_major_slice_mut(panel, below, width).subrows_mut(first, below - first);
        let (left, right) = (under.subrows(first, below - first), weighted.subrows(first, width).transpose());
        matmul(to, faer::Accum::Add, left, right, -1.0, Par::Seq);
    };
    if parallel {
        values.par_chunks_mut(PANEL * below).enumerate().for_each(panel);
    } else {
        values.chunks_mut(PANEL * below).enumerate().for_each(panel);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::symmetric::SymmetricPattern;
    use std::sync::Arc;

    /// The five-point matrix of a square grid with one row that borders on all: indefinite, with one negative pivot.
    fn bordered_grid(side: u32) -> (usize, Vec<(u32, u32)>, Vec<f64>) {
        let count = side * side;
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        let mut push = |row: u32, column: u32, value: f64| {
            entries.push((row.max(column), row.min(column)));
            values.push(value);
        };
        for node in 0..count {
            let (x, y) = (node % side, node / side);
            push(node, node, 4.0 + 0.01 * f64::from(node % 7));
            if x + 1 < side {
                push(node + 1, node, -1.0);
            }
            if y + 1 < side {
                push(node + side, node, -1.0);
            }
            push(count, node, 0.1 + 0.01 * f64::from(node % 5));
        }
        push(count, count, 0.0);
        (count as usize + 1, entries, values)
    }

    #[test]
    fn solutions_inertia_and_bytes_do_not_depend_on_the_number_of_threads() {
        let (size, entries, values) = bordered_grid(160);
        let rhs: Vec<f64> =
            (0..size).map(|at| f64::from(u8::try_from(at * 37 % 101).unwrap()) - 50.0).collect();
        let solved = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let pattern = Arc::new(SymmetricPattern::new(size, entries.clone()).unwrap());
                // The second time in memory that the first has used.
                drop(pattern.factor(&values).unwrap());
                let factor = pattern.factor(&values).unwrap();
                (factor.negative, factor.solve(&rhs).unwrap())
            })
        };
        let (one, two) = (solved(1), solved(3));
        assert_eq!(one, two);
        assert_eq!(one.0, 1);
        let mut left = rhs.clone();
        for (&(row, column), value) in entries.iter().zip(&values) {
            let (row, column) = (row as usize, column as usize);
            left[row] -= value * one.1[column];
            if row != column {
                left[column] -= value * one.1[row];
            }
        }
        // The sum over the border's 25600 entries rounds to some 1e-13 of the right side, which is as large as 50.
        assert!(
            left.iter().all(|left| left.abs() < 1e-9),
            "{:e}",
            left.iter().fold(0.0, |m: f64, l| m.max(l.abs()))
        );
    }
}
