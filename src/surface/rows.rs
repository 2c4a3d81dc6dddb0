//! A level function sampled on a rectilinear grid.

use super::LevelSet;
use glam::DVec3;

/// A level function on the nodes of a rectilinear grid.
pub trait GridSampler: Sync {
    /// `Φ` at node `(i, j, k)`.
    fn at(&self, i: usize, j: usize, k: usize) -> f64;

    /// Whether `Φ > level`, as 1 or 0, at the nodes `(0…, j, k)` of one row along x.
    fn row_above(&self, j: usize, k: usize, level: f64, above: &mut [u8]);
}

/// Samples any level set by evaluating it at every node.
pub(super) struct Evaluated<'a, S: ?Sized> {
    pub(super) surface: &'a S,
    pub(super) axes: [&'a [f64]; 3],
}

impl<S: LevelSet + ?Sized> GridSampler for Evaluated<'_, S> {
    fn at(&self, i: usize, j: usize, k: usize) -> f64 {
        self.surface.value(DVec3::new(self.axes[0][i], self.axes[1][j], self.axes[2][k]))
    }

    fn row_above(&self, j: usize, k: usize, level: f64, above: &mut [u8]) {
        for (i, flag) in above.iter_mut().enumerate() {
            *flag = u8::from(self.at(i, j, k) > level);
        }
    }
}

/// Samples a sum `f(x) + g(y) + h(z)` from three tables: two additions a node.
pub(super) struct Separable {
    tables: [Vec<f64>; 3],
    /// The least and the greatest entry along x.
    range: [f64; 2],
}

impl Separable {
    pub(super) fn new(tables: [Vec<f64>; 3]) -> Self {
        let range = tables[0]
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)]);
        Self { tables, range }
    }
}

impl GridSampler for Separable {
    fn at(&self, i: usize, j: usize, k: usize) -> f64 {
        self.tables[0][i] + (self.tables[1][j] + self.tables[2][k])
    }

    fn row_above(&self, j: usize, k: usize, level: f64, above: &mut [u8]) {
        let rest = self.tables[1][j] + self.tables[2][k];
        // Many rows lie on one side as a whole; sums round the same way for every entry, so the ends speak for all.
        if self.range[0] + rest > level || self.range[1] + rest <= level {
            above.fill(u8::from(self.range[0] + rest > level));
            return;
        }
        for (flag, first) in above.iter_mut().zip(&self.tables[0]) {
            *flag = u8::from(first + rest > level);
        }
    }
}
