//! Intervals from resampled units.
//!
//! Units are drawn with replacement, as many as there are. From few units the percentiles are too narrow by the factor that
//! parts Student's quantile from the normal one and by √(k/(k − 1)); the percentiles are taken further out to make up for it
//! (T. Hesterberg, Am. Stat. 69, 2015: the expanded percentile interval).

use super::{
    quantile::{normal_cdf, student_975},
    tally::Tally,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Sums of resampled units.
pub(super) fn resampled(units: &[Tally], draws: usize, seed: u64, stream: u64) -> Vec<Tally> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    let mut draw = || Tally::sum((0..units.len()).map(|_| &units[random.random_range(0..units.len())]));
    (0..draws).map(|_| draw()).collect()
}

/// The 95 % interval of values that come from resampling `units` units; `None` with fewer than two, or without values.
pub(super) fn interval(mut values: Vec<f64>, units: usize) -> Option<[f64; 2]> {
    if units < 2 || values.is_empty() {
        return None;
    }
    let freedom = units as f64 - 1.0;
    let tail = normal_cdf(-student_975(freedom.max(3.0)) * (units as f64 / freedom).sqrt());
    values.sort_by(f64::total_cmp);
    Some([quantile(&values, tail), quantile(&values, 1.0 - tail)])
}

/// The quantile of sorted values, between neighbours in proportion.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let below = (0..sorted.len() - 1).rev().find(|&i| i as f64 <= at).unwrap_or(0);
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (at - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_ramp() {
        let ramp: Vec<f64> = (0..=100).map(f64::from).collect();
        assert!((quantile(&ramp, 0.025) - 2.5).abs() < 1e-12);
        assert!((quantile(&ramp, 1.0) - 100.0).abs() < 1e-12);
        assert!((quantile(&[3.0], 0.5) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn intervals_cover_the_truth_nineteen_times_in_twenty() {
        // The share of fives in 8 units of 20 independent cells of which a fifth are fives.
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let runs = 400;
        let covered = (0..runs).filter(|run| {
            let unit = |random: &mut ChaCha8Rng| {
                let mut tally = Tally::default();
                for _ in 0..20 {
                    tally.by_sides[if random.random_range(0..5) == 0 { 5 } else { 6 }] += 1.0;
                }
                tally
            };
            let units: Vec<Tally> = (0..8).map(|_| unit(&mut random)).collect();
            let values = resampled(&units, 400, *run, 0).iter().filter_map(|t| t.share(5)).collect();
            interval(values, 8).is_some_and(|[low, high]| (low..=high).contains(&0.2))
        });
        // Three standard deviations of a binomial of 400 about 0.95, and what the bootstrap lacks of it.
        let share = covered.count() as f64 / runs as f64;
        assert!((0.905..=0.985).contains(&share), "{share}");
    }
}
