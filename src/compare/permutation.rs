//! Units dealt out anew to two groups.

use super::tally::Tally;
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

/// All divisions are tried where there are no more than this.
const EXHAUSTIBLE: u64 = 20_000;

/// What a run over the divisions found.
pub(super) struct Permuted {
    /// For each statistic, the share of divisions that are at least as extreme as the one observed, which counts itself.
    pub(super) p: Vec<f64>,
    /// The mean of each statistic over the divisions.
    pub(super) mean: Vec<f64>,
    /// How many divisions there were.
    pub(super) divisions: usize,
    /// Whether these were all.
    pub(super) exhaustive: bool,
}

/// Compares the statistics of the division given, the first `first` units against the rest, with those of all divisions into
/// groups of the same sizes, or of `draws` random ones. Larger is more extreme; a statistic that is none counts as extreme.
pub(super) fn permute(
    units: &[Tally],
    first: usize,
    draws: usize,
    seed: u64,
    statistics: impl Fn(&Tally, &Tally) -> Vec<Option<f64>>,
) -> Permuted {
    let total = Tally::sum(units);
    let evaluate = |chosen: &[usize]| {
        let one = Tally::sum(chosen.iter().map(|unit| &units[*unit]));
        statistics(&one, &total.minus(&one))
    };
    let observed = evaluate(&(0..first).collect::<Vec<_>>());
    let mut count = Counter::new(&observed);
    let exhaustive = binomial(units.len(), first) <= EXHAUSTIBLE;
    if exhaustive {
        let mut chosen: Vec<usize> = (0..first).collect();
        loop {
            count.add(&evaluate(&chosen));
            if !next_combination(&mut chosen, units.len()) {
                break;
            }
        }
    } else {
        count.add(&observed);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut order: Vec<usize> = (0..units.len()).collect();
        for _ in 0..draws {
            let (chosen, _) = order.partial_shuffle(&mut random, first);
            count.add(&evaluate(chosen));
        }
    }
    count.finish(exhaustive)
}

struct Counter<'a> {
    observed: &'a [Option<f64>],
    extreme: Vec<usize>,
    sums: Vec<f64>,
    divisions: usize,
}

impl<'a> Counter<'a> {
    fn new(observed: &'a [Option<f64>]) -> Self {
        Self { observed, extreme: vec![0; observed.len()], sums: vec![0.0; observed.len()], divisions: 0 }
    }

    fn add(&mut self, values: &[Option<f64>]) {
        self.divisions += 1;
        for (at, (value, observed)) in values.iter().zip(self.observed).enumerate() {
            // Sums in another order differ in their last digits.
            let reached = match (value, observed) {
                (Some(value), Some(observed)) => *value >= observed - 1e-9 * (1.0 + observed.abs()),
                _ => true,
            };
            self.extreme[at] += usize::from(reached);
            self.sums[at] += value.unwrap_or(0.0);
        }
    }

    fn finish(self, exhaustive: bool) -> Permuted {
        let share = |count: usize| count as f64 / self.divisions as f64;
        Permuted {
            p: self.extreme.iter().map(|count| share(*count)).collect(),
            mean: self.sums.iter().map(|sum| sum / self.divisions as f64).collect(),
            divisions: self.divisions,
            exhaustive,
        }
    }
}

/// How many ways there are to choose `k` of `n`; the largest number where it does not fit.
fn binomial(n: usize, k: usize) -> u64 {
    let mut value: u64 = 1;
    for step in 0..k.min(n - k) as u64 {
        let Some(product) = value.checked_mul(n as u64 - step) else { return u64::MAX };
        value = product / (step + 1);
    }
    value
}

/// The next choice in lexicographic order; `false` after the last.
fn next_combination(chosen: &mut [usize], of: usize) -> bool {
    let count = chosen.len();
    let Some(at) = (0..count).rev().find(|&at| chosen[at] < of - count + at) else { return false };
    chosen[at] += 1;
    for later in at + 1..count {
        chosen[later] = chosen[later - 1] + 1;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(counts: &[(f64, f64)]) -> Vec<Tally> {
        let unit = |(five, six): &(f64, f64)| {
            let mut tally = Tally::default();
            tally.by_sides[5] = *five;
            tally.by_sides[6] = *six;
            tally
        };
        counts.iter().map(unit).collect()
    }

    fn difference(one: &Tally, two: &Tally) -> Vec<Option<f64>> {
        vec![one.share(5).zip(two.share(5)).map(|(a, b)| (a - b).abs())]
    }

    #[test]
    fn every_division_is_met_once() {
        assert_eq!(binomial(8, 4), 70);
        assert_eq!(binomial(200, 100), u64::MAX);
        let mut chosen = vec![0, 1, 2, 3];
        let mut seen = vec![chosen.clone()];
        while next_combination(&mut chosen, 8) {
            seen.push(chosen.clone());
        }
        assert_eq!(seen.len(), 70);
        assert!(seen.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn a_complete_separation_is_as_rare_as_it_can_be() {
        let apart = units(&[
            (9.0, 1.0),
            (8.0, 2.0),
            (9.0, 1.0),
            (8.0, 2.0),
            (1.0, 9.0),
            (0.0, 10.0),
            (1.0, 9.0),
            (0.0, 10.0),
        ]);
        let found = permute(&apart, 4, 100, 1, difference);
        assert!(found.exhaustive);
        assert!((found.p[0] - 2.0 / 70.0).abs() < 1e-12, "{:?}", found.p);
    }

    #[test]
    fn equal_units_are_never_extreme() {
        let alike = units(&[(3.0, 7.0); 40]);
        let found = permute(&alike, 20, 99, 1, difference);
        assert!(!found.exhaustive);
        assert_eq!((found.p[0].to_bits(), found.divisions), (1.0_f64.to_bits(), 100));
    }
}
