//! Means over wide surroundings, kept at a fraction of the resolution since they vary slowly.

use super::plane::{Plane, narrow, pixel, pixels};

/// Pixels of the coarse raster per standard deviation: the mean between them is a straight line within a percent.
const PER_SIGMA: f64 = 5.0;

/// What varies slowly over a raster.
#[derive(Clone, Debug)]
pub(crate) struct Smooth {
    coarse: Plane,
    /// Rows and columns of the raster that a coarse pixel covers.
    block: usize,
    /// For each column of the raster the coarse pixel to its left and the share of the one to its right.
    columns: Vec<(usize, f32)>,
}

impl Smooth {
    /// The Gaussian mean, with standard deviation `sigma` pixels, of a raster whose rows are given by `fill`.
    pub(crate) fn mean(
        width: usize,
        height: usize,
        sigma: f64,
        fill: impl Fn(usize, &mut [f32]) + Sync,
    ) -> Self {
        let block = pixels((sigma / PER_SIGMA).floor()).max(1);
        let coarse = reduced(width, height, block, fill).blurred(sigma / block as f64);
        let columns = (0..width).map(|x| between(x, block, coarse.width())).collect();
        Self { coarse, block, columns }
    }

    /// What `f` makes of the means.
    pub(crate) fn map(self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        Self { coarse: self.coarse.map(f), ..self }
    }

    /// Gives every value of a row of the raster to `change` with the mean around it, and takes what that makes of it.
    pub(crate) fn with_row(&self, y: usize, row: &mut [f32], change: impl Fn(f32, f32) -> f32) {
        let (above, share) = between(y, self.block, self.coarse.height());
        let below = self.coarse.row((above + 1).min(self.coarse.height() - 1));
        let mut means: Vec<f32> =
            self.coarse.row(above).iter().zip(below).map(|(a, b)| a + share * (b - a)).collect();
        means.extend(means.last().copied());
        for (v, (left, share)) in row.iter_mut().zip(&self.columns) {
            let (a, b) = (means[*left], means[left + 1]);
            *v = change(*v, a + share * (b - a));
        }
    }
}

/// Means over blocks of `block` x `block` pixels; those at the right and lower border are of the pixels that exist.
pub(crate) fn reduced(
    width: usize,
    height: usize,
    block: usize,
    fill: impl Fn(usize, &mut [f32]) + Sync,
) -> Plane {
    let mut coarse = Plane::new(width.div_ceil(block), height.div_ceil(block), 0.0);
    coarse.fill_rows_with(
        || [vec![0.0; width], vec![0.0; width]],
        |[sums, row], y, out| {
            let rows = y * block..((y + 1) * block).min(height);
            let count = rows.len();
            sums.fill(0.0);
            for source in rows {
                fill(source, row);
                sums.iter_mut().zip(&*row).for_each(|(s, v)| *s += v);
            }
            for (v, sums) in out.iter_mut().zip(sums.chunks(block)) {
                *v = sums.iter().sum::<f32>() / narrow((sums.len() * count) as f64);
            }
        },
    );
    coarse
}

/// The coarse pixel before a fine one, and the share of the next.
fn between(fine: usize, block: usize, coarse: usize) -> (usize, f32) {
    let place = ((fine as f64 + 0.5) / block as f64 - 0.5).clamp(0.0, (coarse - 1) as f64);
    let before = pixel(place, coarse);
    (before, narrow(place - before as f64))
}
