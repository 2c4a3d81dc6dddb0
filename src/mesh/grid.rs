//! The box of cubes that is marched over.

use glam::DVec3;

/// A box divided into equal cells along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The lower corner.
    pub low: DVec3,
    /// The upper corner.
    pub high: DVec3,
    /// Cells along x, y and z; at least one each.
    pub cells: [usize; 3],
}

impl Grid {
    /// The coordinates of the nodes along each axis. The ends are exact.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "node numbers are far below 2^52")]
    pub fn axes(&self) -> [Vec<f64>; 3] {
        std::array::from_fn(|axis| {
            let n = self.cells[axis];
            let at = |i: usize| match i {
                i if i == n => self.high[axis],
                i => self.low[axis] + (self.high[axis] - self.low[axis]) * (i as f64 / n as f64),
            };
            (0..=n).map(at).collect()
        })
    }

    /// The longest side of a cell.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "cell numbers are far below 2^52")]
    pub fn spacing(&self) -> f64 {
        (0..3).map(|axis| (self.high[axis] - self.low[axis]) / self.cells[axis] as f64).fold(0.0, f64::max)
    }

    /// About how many bytes [`super::march`] holds at its peak: planes of signs and vertex numbers, and the mesh of a surface that
    /// fills the box like one sheet per `period`.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    pub fn memory_estimate(&self, period: f64) -> f64 {
        let [nx, ny, nz] = self.cells.map(|n| n as f64);
        let planes = (nx + 1.0) * (ny + 1.0) * PLANE_BYTES * rayon::current_num_threads() as f64;
        let sheets = (self.high - self.low) / period;
        // A surface of area 2.4 per period crosses about 1.6 edges for each cell face that it fills; each vertex comes with
        // two triangles.
        let vertices = 2.4 * 1.6 * nx * ny * nz * (sheets.max_element() / nx.max(ny).max(nz));
        planes + vertices * (24.0 + 2.0 * 12.0)
    }
}

/// Bytes held per node of a plane while marching: two planes of signs and three kinds of numbers each.
const PLANE_BYTES: f64 = 2.0 * (1.0 + 3.0 * 4.0) + 4.0;
