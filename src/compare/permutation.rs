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

/// A statistic of two groups as it is, and as it would be if units kept all their links.
pub(super) struct Statistic {
    pub(super) plain: Option<f64>,
    pub(super) linked: Option<f64>,
}

/// Compares the statistics of the first `first` units against the rest with those of all divisions into groups of the same
/// sizes, or of `draws` random ones and the one observed. Larger is more extreme; a statistic that is none counts as extreme.
/// A division with just the value observed counts as well, whatever its links make of it.
pub(super) fn permute(
    units: &[Tally],
    first: usize,
    draws: usize,
    seed: u64,
    statistics: impl Fn(&Tally, &Tally) -> Vec<Statistic>,
) -> Permuted {
    let total = Tally::sum(units);
    let evaluate = |chosen: &[usize]| {
        let one = Tally::sum(chosen.iter().map(|unit| &units[*unit]));
        statistics(&one, &total.minus(&one))
    };
    let mut chosen: Vec<usize> = (0..first).collect();
    let observed = evaluate(&chosen);
    let mut count = Counter::new(&observed);
    let exhaustive = binomial(units.len(), first) <= EXHAUSTIBLE;
    if exhaustive {
        while next_combination(&mut chosen, units.len()) {
            count.add(&evaluate(&chosen));
        }
    } else {
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
    observed: &'a [Statistic],
    extreme: Vec<usize>,
    sums: Vec<f64>,
    divisions: usize,
}

impl<'a> Counter<'a> {
    /// The division observed is the first and as extreme as itself.
    fn new(observed: &'a [Statistic]) -> Self {
        let sums = observed.iter().map(|statistic| statistic.linked.unwrap_or(0.0)).collect();
        Self { observed, extreme: vec![1; observed.len()], sums, divisions: 1 }
    }

    fn add(&mut self, values: &[Statistic]) {
        self.divisions += 1;
        for (at, (value, observed)) in values.iter().zip(self.observed).enumerate() {
            let reached = match (value.plain, value.linked, observed.plain) {
                // Sums in another order differ in their last digits.
                (Some(plain), Some(linked), Some(observed)) => {
                    let least = 1e-9 * (1.0 + observed.abs());
                    linked >= observed - least || (plain - observed).abs() <= least
                }
                _ => true,
            };
            self.extreme[at] += usize::from(reached);
            self.sums[at] += value.linked.unwrap_or(0.0);
        }
    }

    fn finish(self, exhaustive: bool) -> Permuted {
        let divisions = self.divisions as f64;
        Permuted {
            p: self.extreme.iter().map(|count| *count as f64 / divisions).collect(),
            mean: self.sums.iter().map(|sum| sum / divisions).collect(),
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

    fn difference(one: &Tally, two: &Tally) -> Vec<Statistic> {
        let value = one.share(5).zip(two.share(5)).map(|(a, b)| (a - b).abs());
        vec![Statistic { plain: value, linked: value }]
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
