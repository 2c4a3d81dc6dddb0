//! Richardson extrapolation over meshes.

use faer::{Mat, prelude::Solve};

/// The limit of `values[k]` at element sizes `sizes[k] → 0`, where the error is a series in even powers of the size from the
/// fourth on, as that of biquadratic films is: one power for each mesh beyond the first.
#[must_use]
pub fn limit(sizes: &[f64], values: &[f64]) -> f64 {
    let n = values.len();
    let Some(&largest) = sizes.first() else { return f64::NAN };
    let power = |i: usize, j: i32| if j == 0 { 1.0 } else { (sizes[i] / largest).powi(2 * j + 2) };
    let exponents: Vec<i32> = (0..).take(n).collect();
    let matrix = Mat::from_fn(n, n, |i, j| power(i, exponents[j]));
    let mut x = Mat::from_fn(n, 1, |i, _| values[i]);
    matrix.partial_piv_lu().solve_in_place(x.as_mut());
    x[(0, 0)]
}

/// The limit, and how far the limit without the coarsest mesh lies from it: a bound on the error in practice.
#[must_use]
pub fn limit_with_error(sizes: &[f64], values: &[f64]) -> (f64, f64) {
    let all = limit(sizes, values);
    let fewer = if values.len() > 1 { limit(&sizes[1..], &values[1..]) } else { f64::NAN };
    (all, (all - fewer).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_from_the_fourth_power_on_is_removed() {
        let sizes = [0.25, 0.2, 0.125];
        let values = sizes.map(|h: f64| 2.0 - 3.0 * h.powi(4) + 7.0 * h.powi(6));
        assert!((limit(&sizes, &values) - 2.0).abs() < 1e-14);
        let (value, error) = limit_with_error(&sizes, &values);
        assert!((value - 2.0).abs() < error);
    }
}
