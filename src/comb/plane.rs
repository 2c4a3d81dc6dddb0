//! A raster of `f32` and the few filters that the reading needs.
//!
//! Every filter treats what lies outside the raster as unknown, not as dark: a mean near the border is the mean of the
//! pixels that are there. Sums run in a fixed order within fixed bands, so that results do not depend on the number of
//! threads.

use rayon::prelude::*;

/// Rows that one task smooths; fixed, so that sums are the same for any number of threads.
const BAND: usize = 96;

/// Rows that are not worth sharing among threads.
const ROWS_PER_TASK: usize = 16;

/// A raster of `f32`, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plane {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Plane {
    /// A raster of one value.
    #[must_use]
    pub(crate) fn new(width: usize, height: usize, value: f32) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// A raster whose value at (x, y) is `value(x, y)`.
    #[must_use]
    pub(crate) fn from_fn(width: usize, height: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        let mut plane = Self::new(width, height, 0.0);
        plane.fill_rows(|y, row| {
            for (x, v) in row.iter_mut().enumerate() {
                *v = value(x, y);
            }
        });
        plane
    }

    /// Width in pixels.
    #[must_use]
    pub(crate) const fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    #[must_use]
    pub(crate) const fn height(&self) -> usize {
        self.height
    }

    /// The values, row by row.
    #[must_use]
    pub(crate) fn data(&self) -> &[f32] {
        &self.data
    }

    /// The value at (x, y).
    ///
    /// # Panics
    /// If the pixel is outside.
    #[must_use]
    pub(crate) fn at(&self, x: usize, y: usize) -> f32 {
        self.data[y * self.width + x]
    }

    /// The value at a point, bilinear between pixel centres (pixel (0, 0) covers 0 ≤ x, y < 1), clamped at the border.
    #[must_use]
    #[inline]
    pub(crate) fn sample(&self, x: f64, y: f64) -> f32 {
        let (x0, x1, fx) = bracket(x - 0.5, self.width);
        let (y0, y1, fy) = bracket(y - 0.5, self.height);
        let (upper, lower) = (self.row(y0), self.row(y1));
        let top = upper[x0] + (upper[x1] - upper[x0]) * fx;
        let bottom = lower[x0] + (lower[x1] - lower[x0]) * fx;
        top + (bottom - top) * fy
    }

    /// A raster of `f(value)`.
    #[must_use]
    pub(crate) fn map(&self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        let mut out = Self::new(self.width, self.height, 0.0);
        out.fill_rows(|y, row| row.iter_mut().zip(self.row(y)).for_each(|(v, s)| *v = f(*s)));
        out
    }

    /// A raster of `f(value, other value)`.
    ///
    /// # Panics
    /// If the sizes differ.
    #[must_use]
    pub(crate) fn zip(&self, other: &Self, f: impl Fn(f32, f32) -> f32 + Sync) -> Self {
        assert!(self.width == other.width && self.height == other.height, "planes of different size");
        let mut out = Self::new(self.width, self.height, 0.0);
        out.fill_rows(|y, row| {
            for ((v, a), b) in row.iter_mut().zip(self.row(y)).zip(other.row(y)) {
                *v = f(*a, *b);
            }
        });
        out
    }

    /// The values of a row.
    #[must_use]
    pub(crate) fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.width..(y + 1) * self.width]
    }

    /// Gaussian mean of standard deviation `sigma` pixels, over the pixels that exist.
    ///
    /// Narrow ones are summed directly; wide ones are three running means (within 3 % of the Gaussian), whose cost does
    /// not depend on `sigma`.
    #[must_use]
    pub(crate) fn blurred(&self, sigma: f64) -> Self {
        if sigma < 0.3 {
            return self.clone();
        }
        if sigma <= 2.5 {
            let half = gaussian(sigma);
            return self.by_bands(half.len() - 1, |band| band.convolved_rows(&half).convolved_columns(&half));
        }
        let radii = box_radii(sigma);
        self.by_bands(radii.iter().sum(), |mut band| {
            for radius in radii {
                band = band.box_rows(radius).box_columns(radius);
            }
            band
        })
    }

    /// What `filter`, which reaches over `reach` rows, makes of the raster, band by band.
    fn by_bands(&self, reach: usize, filter: impl Fn(Self) -> Self + Sync) -> Self {
        let (width, height) = (self.width.max(1), self.height);
        let mut out = Self::new(self.width, height, 0.0);
        out.data.par_chunks_mut(BAND * width).enumerate().for_each(|(band, rows)| {
            let first = band * BAND;
            let above = first.saturating_sub(reach);
            let below = (first + rows.len() / width + reach).min(height);
            let part =
                Self { width, height: below - above, data: self.data[above * width..below * width].to_vec() };
            let start = (first - above) * width;
            rows.copy_from_slice(&filter(part).data[start..start + rows.len()]);
        });
        out
    }

    /// Calls `fill` with the number and the values of every row.
    pub(crate) fn fill_rows(&mut self, fill: impl Fn(usize, &mut [f32]) + Sync) {
        self.fill_rows_with(|| (), |(), y, row| fill(y, row));
    }

    /// The same with working space that `space` makes and that rows may share one after the other.
    pub(crate) fn fill_rows_with<T>(
        &mut self,
        space: impl Fn() -> T + Sync + Send,
        fill: impl Fn(&mut T, usize, &mut [f32]) + Sync,
    ) {
        let width = self.width.max(1);
        let rows = self.data.par_chunks_mut(width).with_min_len(ROWS_PER_TASK).enumerate();
        rows.for_each_init(space, |space, (y, row)| fill(space, y, row));
    }

    /// Means along rows with a symmetric kernel given from its centre outward.
    fn convolved_rows(&self, half: &[f32]) -> Self {
        let (width, reach) = (self.width, half.len() - 1);
        let inner = reach..width.saturating_sub(reach).max(reach);
        let mut out = Self::new(width, self.height, 0.0);
        for (row, source) in self.pairs(&mut out.data) {
            for (x, v) in row.iter_mut().enumerate().filter(|(x, _)| !inner.contains(x)) {
                *v = border_mean(half, x, width, |k| source[k]);
            }
            // One weight after the other, over the whole row, which a processor does several pixels at a time.
            let Some(row) = row.get_mut(inner.clone()).filter(|row| !row.is_empty()) else { continue };
            let shifted = |by: usize| &source[by..by + inner.len()];
            for (v, s) in row.iter_mut().zip(shifted(reach)) {
                *v = half[0] * s;
            }
            for (k, weight) in half.iter().enumerate().skip(1) {
                for ((v, a), b) in row.iter_mut().zip(shifted(reach - k)).zip(shifted(reach + k)) {
                    *v += weight * (a + b);
                }
            }
        }
        out
    }

    /// The same along columns.
    fn convolved_columns(&self, half: &[f32]) -> Self {
        let (width, height, reach) = (self.width, self.height, half.len() - 1);
        let mut out = Self::new(width, height, 0.0);
        for (y, row) in out.data.chunks_exact_mut(width).enumerate() {
            let first = y.saturating_sub(reach);
            let last = (y + reach).min(height - 1);
            let total: f32 = (first..=last).map(|k| half[k.abs_diff(y)]).sum();
            for k in first..=last {
                let weight = half[k.abs_diff(y)] / total;
                for (v, s) in row.iter_mut().zip(self.row(k)) {
                    *v += weight * s;
                }
            }
        }
        out
    }

    /// Rows of another raster of this size, each with the one of this.
    fn pairs<'a>(&'a self, other: &'a mut [f32]) -> impl Iterator<Item = (&'a mut [f32], &'a [f32])> {
        other.chunks_exact_mut(self.width).zip(self.data.chunks_exact(self.width))
    }

    /// Means along rows over `radius` pixels to both sides.
    fn box_rows(&self, radius: usize) -> Self {
        let width = self.width;
        let mut out = Self::new(width, self.height, 0.0);
        // Columns around which nothing is missing.
        let inner = radius.min(width)..width.saturating_sub(radius).max(radius.min(width));
        let share = (2.0 * radius as f64 + 1.0).recip();
        // Sums of all pixels before each.
        let mut sums = vec![0.0; width + 1];
        for (row, source) in self.pairs(&mut out.data) {
            let mut sum = 0.0;
            for (after, v) in sums[1..].iter_mut().zip(source) {
                sum += f64::from(*v);
                *after = sum;
            }
            for (x, v) in row.iter_mut().enumerate().filter(|(x, _)| !inner.contains(x)) {
                let (first, end) = (x.saturating_sub(radius), (x + radius + 1).min(width));
                *v = narrow((sums[end] - sums[first]) / (end - first) as f64);
            }
            let ends = sums.iter().skip(2 * radius + 1);
            for ((v, first), end) in row[inner.clone()].iter_mut().zip(&sums).zip(ends) {
                *v = narrow((end - first) * share);
            }
        }
        out
    }

    /// The same along columns.
    fn box_columns(&self, radius: usize) -> Self {
        let (width, height) = (self.width, self.height);
        let mut out = Self::new(width, height, 0.0);
        let mut sums = vec![0.0; width];
        let change = |sums: &mut [f64], y: usize, sign: f64| {
            sums.iter_mut().zip(self.row(y)).for_each(|(sum, v)| *sum += sign * f64::from(*v));
        };
        (0..radius.min(height)).for_each(|y| change(&mut sums, y, 1.0));
        for (y, row) in out.data.chunks_exact_mut(width).enumerate() {
            if y + radius < height {
                change(&mut sums, y + radius, 1.0);
            }
            if y > radius {
                change(&mut sums, y - radius - 1, -1.0);
            }
            let count = (y + radius).min(height - 1) - y.saturating_sub(radius) + 1;
            let share = (count as f64).recip();
            row.iter_mut().zip(&sums).for_each(|(v, sum)| *v = narrow(sum * share));
        }
        out
    }
}

/// `value` in single precision, which is enough for grey values.
#[expect(clippy::cast_possible_truncation, reason = "grey values need no more than 24 bits")]
#[must_use]
pub(crate) const fn narrow(value: f64) -> f32 {
    value as f32
}

/// The pixel that holds a coordinate, clamped to `0..size`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the raster before the cast"
)]
#[must_use]
#[inline]
pub(crate) fn pixel(coordinate: f64, size: usize) -> usize {
    coordinate.clamp(0.0, size.saturating_sub(1) as f64) as usize
}

/// A non-negative length as a number of pixels, rounded.
#[must_use]
pub(crate) fn pixels(length: f64) -> usize {
    pixel(length.round(), usize::MAX >> 12)
}

/// The pixels whose middles lie before and after a coordinate, and the share of the second.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the raster before the cast; a signed number of 32 bits is what a processor makes quickest"
)]
#[inline]
fn bracket(x: f64, size: usize) -> (usize, usize, f32) {
    let clamped = x.clamp(0.0, size.saturating_sub(1) as f64);
    let low = clamped as i32;
    let share = narrow(clamped - f64::from(low));
    (low as usize, (low as usize + 1).min(size - 1), share)
}

fn border_mean(half: &[f32], x: usize, size: usize, value: impl Fn(usize) -> f32) -> f32 {
    let reach = half.len() - 1;
    let (mut sum, mut total) = (0.0, 0.0);
    for k in x.saturating_sub(reach)..=(x + reach).min(size - 1) {
        sum += half[k.abs_diff(x)] * value(k);
        total += half[k.abs_diff(x)];
    }
    sum / total
}

/// Half of a Gaussian kernel, from its centre outward to 3 σ, of total 1.
fn gaussian(sigma: f64) -> Vec<f32> {
    let reach = pixels((3.0 * sigma).ceil());
    let weights: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.iter().map(|w| narrow(w / total)).collect()
}

/// Radii of three running means whose variances add up to σ² as nearly as whole numbers allow.
fn box_radii(sigma: f64) -> [usize; 3] {
    let variance = |radius: f64| ((2.0 * radius + 1.0).powi(2) - 1.0) / 12.0;
    let mut radii = [0; 3];
    let mut left = sigma * sigma;
    for (done, radius) in radii.iter_mut().enumerate() {
        let share = left / (3 - done) as f64;
        let ideal = ((12.0 * share + 1.0).max(1.0).sqrt() - 1.0) / 2.0;
        *radius = pixels(ideal);
        left -= variance(*radius as f64);
    }
    radii
}
