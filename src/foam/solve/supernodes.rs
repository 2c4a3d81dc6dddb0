//! Solving with a factor of supernodes: blocks of columns with the same rows below them.
//!
//! Loops over columns, since a single right side gives dense kernels too little to do.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

/// A block of columns, `rows` values each, that starts at the unknown `start`.
struct Block<'a> {
    start: usize,
    columns: usize,
    rows: usize,
    values: &'a [f64],
    /// The unknowns of the rows below the columns' own.
    below: &'a [usize],
}

impl Block<'_> {
    fn column(&self, at: usize) -> &[f64] {
        &self.values[at * self.rows..(at + 1) * self.rows]
    }
}

fn block<'a>(symbolic: &'a SymbolicSupernodalCholesky<usize>, values: &'a [f64], at: usize) -> Block<'a> {
    let node = symbolic.supernode(at);
    let (start, below) = (node.start(), node.pattern());
    let columns = symbolic.supernode_end()[at] - start;
    let places = symbolic.col_ptr_for_val()[at]..symbolic.col_ptr_for_val()[at + 1];
    Block { start, columns, rows: columns + below.len(), values: &values[places], below }
}

/// Solves `L D Lᵀ x = b` in place, in the order of the factor; `values` are those of its blocks, with `D` on the diagonal.
pub(super) fn solve(symbolic: &SymbolicSupernodalCholesky<usize>, values: &[f64], x: &mut [f64]) {
    let mut sums: Vec<f64> = Vec::new();
    for at in 0..symbolic.n_supernodes() {
        let block = block(symbolic, values, at);
        sums.clear();
        sums.resize(block.below.len(), 0.0);
        for j in 0..block.columns {
            let (own, below) = block.column(j).split_at(block.columns);
            let here = &mut x[block.start..block.start + block.columns];
            let value = here[j];
            here[j + 1..].iter_mut().zip(&own[j + 1..]).for_each(|(x, l)| *x -= l * value);
            sums.iter_mut().zip(below).for_each(|(sum, l)| *sum += l * value);
        }
        block.below.iter().zip(&sums).for_each(|(&row, sum)| x[row] -= sum);
    }
    for at in (0..symbolic.n_supernodes()).rev() {
        let block = block(symbolic, values, at);
        sums.clear();
        sums.extend(block.below.iter().map(|&row| x[row]));
        for j in (0..block.columns).rev() {
            let (own, below) = block.column(j).split_at(block.columns);
            let here = &mut x[block.start..block.start + block.columns];
            let among = dot(&own[j + 1..], &here[j + 1..]);
            here[j] = here[j] / own[j] - among - dot(below, &sums);
        }
    }
}

/// The sum of products, in running sums of fixed places, which the compiler makes vectors of.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut lanes = [0.0; LANES];
    let (mut a, mut b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    for (a, b) in a.by_ref().zip(b.by_ref()) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += a * b;
        }
    }
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f64>() + rest
}
