//! Quantiles of the normal and of Student's distribution.

/// The normal quantile of 0.975.
pub(super) const NORMAL_975: f64 = 1.959_963_984_540_054;

/// The normal quantile of 0.8.
pub(super) const NORMAL_800: f64 = 0.841_621_233_572_914_2;

/// The normal quantile of 0.9995: two-sided p = 0.001.
pub(super) const NORMAL_9995: f64 = 3.290_526_731_491_926;

/// Student's quantile of 0.975 with `freedom` degrees, good to 1 % from 3 degrees on (M. Abramowitz and I. Stegun, "Handbook
/// of Mathematical Functions", 1964, 26.7.5).
pub(super) fn student_975(freedom: f64) -> f64 {
    let z = NORMAL_975;
    let [z3, z5, z7] = [z.powi(3), z.powi(5), z.powi(7)];
    z + (z3 + z) / (4.0 * freedom)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * freedom.powi(2))
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * freedom.powi(3))
}

/// Φ(x), the normal distribution, to 1.5e-7 (the same, 7.1.26).
pub(super) fn normal_cdf(x: f64) -> f64 {
    let y = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * y);
    let series = [0.254_829_592, -0.284_496_736, 1.421_413_741, -1.453_152_027, 1.061_405_429];
    let tail = series.iter().rev().fold(0.0, |sum, c| (sum + c) * t) * (-y * y).exp();
    if x < 0.0 { 0.5 * tail } else { 1.0 - 0.5 * tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_tables() {
        for (freedom, value) in [(3.0, 3.1824), (5.0, 2.5706), (10.0, 2.2281), (30.0, 2.0423)] {
            assert!((student_975(freedom) / value - 1.0).abs() < 0.01, "{freedom}");
        }
        for (x, value) in [(NORMAL_975, 0.975), (NORMAL_800, 0.8), (NORMAL_9995, 0.9995), (-1.0, 0.158_655_3)]
        {
            assert!((normal_cdf(x) - value).abs() < 2e-7, "{x}");
        }
    }
}
