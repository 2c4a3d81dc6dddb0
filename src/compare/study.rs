//! The comparison, step by step.

use super::{
    COMPARISON_SCHEMA, CompareError, Comparison, Estimate, Figure, FigureTest, Group, LeftOut,
    PatternFigures, Sample, Settings, SideClass, SidesTest, Units,
    bootstrap::{interval, resampled},
    links::Links,
    patches::{Divided, LEAST_PATTERNS, divide},
    permutation::{Statistic, permute},
    tally::{CLASSES, Tally},
    verdict,
};
use crate::tessellation::{Surroundings, pattern_statistics};

/// Random streams of one seed: permutations draw from stream 0.
const STREAMS: [u64; 2] = [1, 2];

/// Expected cells below which numbers of sides are taken together in the chi-square distance.
const LEAST_EXPECTED: f64 = 5.0;

/// Compares patterns of comb with patterns of foam. The result depends on nothing but the arguments.
///
/// # Errors
/// [`CompareError`] where there is nothing to compare.
pub fn compare(comb: &[Sample], foam: &[Sample], settings: &Settings) -> Result<Comparison, CompareError> {
    check(comb, foam, settings)?;
    let divided = divide(comb, foam, settings.units);
    let sums = [Tally::sum(&divided.comb), Tally::sum(&divided.foam)];
    let study = Study { settings, sums, resamples: resamples(&divided, settings), divided: &divided };
    let figures: Vec<Figure> = Figure::ALL
        .into_iter()
        .filter(|figure| sums.iter().all(|sum| figure.of(sum).is_some()))
        .filter(|figure| *figure != Figure::ChargeOverCurvature || has_curvature(comb, foam))
        .collect();
    let (sides, tests) = study.tests(&figures);
    let links = divided.links.widening(|cell| f64::from(u8::from(cell.class == 6)));
    let groups = [group("comb", comb, &divided.comb, links), group("foam", foam, &divided.foam, links)];
    let verdict = verdict::verdict(&groups, divided.units, &sides);
    let [comb_group, foam_group] = groups;
    Ok(Comparison {
        schema: COMPARISON_SCHEMA,
        settings: Settings { units: divided.units, ..*settings },
        notes: notes(comb, foam, divided.units),
        left_out: left_out(comb, foam, &figures),
        comb: comb_group,
        foam: foam_group,
        sides,
        figures: tests,
        verdict,
    })
}

fn check(comb: &[Sample], foam: &[Sample], settings: &Settings) -> Result<(), CompareError> {
    for (kind, samples) in [("comb", comb), ("foam", foam)] {
        if samples.is_empty() {
            return Err(CompareError::NoPattern(kind));
        }
        if let Some(empty) = samples.iter().find(|sample| sample.pattern.cells.is_empty()) {
            return Err(CompareError::Empty { name: empty.name.clone() });
        }
        if samples.iter().all(|sample| sample.pattern.complete().next().is_none()) {
            let cells = samples.iter().map(|sample| sample.pattern.cells.len()).sum();
            return Err(CompareError::NothingComplete { kind, cells });
        }
    }
    let few = comb.len().min(foam.len()) < LEAST_PATTERNS;
    if settings.units == Units::Patterns && few {
        let (comb, foam) = (comb.len(), foam.len());
        return Err(CompareError::FewPatterns { least: LEAST_PATTERNS, comb, foam });
    }
    for (what, value) in [("permutations", settings.permutations), ("resamples", settings.resamples)] {
        if value < 99 {
            return Err(CompareError::TooFewDraws { what, value, least: 99 });
        }
    }
    Ok(())
}

fn has_curvature(comb: &[Sample], foam: &[Sample]) -> bool {
    let known = |sample: &Sample| sample.pattern.complete().any(|(_, cell)| cell.gauss_curvature.is_some());
    comb.iter().any(known) && foam.iter().any(known)
}

/// Sums of resampled units: comb, foam.
fn resamples(divided: &Divided, settings: &Settings) -> [Vec<Tally>; 2] {
    let [comb, foam] = STREAMS;
    [
        resampled(&divided.comb, settings.resamples, settings.seed, comb),
        resampled(&divided.foam, settings.resamples, settings.seed, foam),
    ]
}

struct Study<'a> {
    settings: &'a Settings,
    divided: &'a Divided,
    sums: [Tally; 2],
    resamples: [Vec<Tally>; 2],
}

impl Study<'_> {
    /// The test of the sides and those of single figures, all from the same permutations.
    fn tests(&self, figures: &[Figure]) -> (SidesTest, Vec<FigureTest>) {
        let units: Vec<Tally> = self.divided.comb.iter().chain(&self.divided.foam).copied().collect();
        let bins = bins(&self.sums);
        let shuffled = Widening::of(&self.divided.links, &bins, figures);
        let plain = Widening::none(&bins, figures);
        let Settings { permutations, seed, .. } = *self.settings;
        let permuted = permute(&units, self.divided.comb.len(), permutations, seed, |one, two| {
            let of = |widening| statistics(&bins, figures, widening, one, two);
            let pairs = of(&plain).into_iter().zip(of(&shuffled));
            pairs.map(|(plain, linked)| Statistic { plain, linked }).collect()
        });
        let [comb, foam] = &self.sums;
        let chi_square = chi_square(&bins, &plain.bins, comb, foam);
        let sides = SidesTest {
            classes: self.classes(&shuffled),
            chi_square,
            p: permuted.p[0],
            permutations: permuted.divisions,
            exhaustive: permuted.exhaustive,
            total_variation: total_variation(&plain.classes, comb, foam),
            total_variation_by_chance: permuted.mean[1],
            cohens_w: (chi_square / (comb.cells() + foam.cells())).sqrt(),
        };
        (sides, self.figure_tests(figures, &permuted.p[2..], &shuffled))
    }

    /// Each number of sides that occurs.
    fn classes(&self, widening: &Widening) -> Vec<SideClass> {
        let occurs = |class: &usize| self.sums.iter().any(|sum| sum.by_sides[*class] > 0.0);
        let class = |sides: usize| {
            let (share, difference) = self.estimates(widening.classes[sides], |tally| tally.share(sides));
            SideClass { sides, cells: self.sums.map(|sum| whole(sum.by_sides[sides])), share, difference }
        };
        (0..CLASSES).filter(occurs).map(class).collect()
    }

    fn figure_tests(&self, figures: &[Figure], p: &[f64], widening: &Widening) -> Vec<FigureTest> {
        let corrected = holm(p);
        let test = |(at, figure): (usize, &Figure)| {
            let (value, difference) = self.estimates(widening.figures[at], |tally| figure.of(tally));
            FigureTest { figure: *figure, value, difference, p: p[at], p_holm: corrected[at] }
        };
        figures.iter().enumerate().map(test).collect()
    }

    /// A figure in comb and foam, and its difference, with intervals that are widened by a factor.
    fn estimates(&self, widening: f64, figure: impl Fn(&Tally) -> Option<f64>) -> ([Estimate; 2], Estimate) {
        let counts = [self.divided.comb.len(), self.divided.foam.len()];
        let value = self.sums.each_ref().map(|sum| figure(sum).unwrap_or(f64::NAN));
        let estimate = |value: f64, resampled: Vec<f64>, units: usize| Estimate {
            value,
            interval: interval(resampled, units).map(|ends| ends.map(|end| value + widening * (end - value))),
        };
        let one = |at: usize| {
            estimate(value[at], self.resamples[at].iter().filter_map(&figure).collect(), counts[at])
        };
        let [comb, foam] = &self.resamples;
        let differences = comb.iter().zip(foam).filter_map(|(a, b)| Some(figure(a)? - figure(b)?));
        let difference = estimate(value[0] - value[1], differences.collect(), counts[0].min(counts[1]));
        ([one(0), one(1)], difference)
    }
}

/// By which factors the differences of shuffled units are widened for the links that units lose.
struct Widening {
    bins: Vec<f64>,
    classes: [f64; CLASSES],
    figures: Vec<f64>,
}

impl Widening {
    fn of(links: &Links, bins: &[Vec<usize>], figures: &[Figure]) -> Self {
        let within =
            |classes: &[usize]| links.widening(|cell| f64::from(u8::from(classes.contains(&cell.class))));
        Self {
            bins: bins.iter().map(|bin| within(bin)).collect(),
            classes: std::array::from_fn(|class| within(&[class])),
            figures: figures.iter().map(|figure| figure.widening(links)).collect(),
        }
    }

    fn none(bins: &[Vec<usize>], figures: &[Figure]) -> Self {
        Self { bins: vec![1.0; bins.len()], classes: [1.0; CLASSES], figures: vec![1.0; figures.len()] }
    }
}

/// What is compared between two groups: the chi-square distance, the total variation, and the size of each figure's
/// difference.
fn statistics(
    bins: &[Vec<usize>],
    figures: &[Figure],
    widening: &Widening,
    one: &Tally,
    two: &Tally,
) -> Vec<Option<f64>> {
    let mut values = vec![
        Some(chi_square(bins, &widening.bins, one, two)),
        Some(total_variation(&widening.classes, one, two)),
    ];
    let differences = figures.iter().zip(&widening.figures).map(|(figure, widening)| {
        let (a, b) = figure.of(one).zip(figure.of(two))?;
        Some((a - b).abs() * widening)
    });
    values.extend(differences);
    values
}

/// Numbers of sides taken together from both ends, until each class of the pooled cells is expected often enough in the
/// smaller group. Hexagons stay by themselves; where fewer or more than six sides are too rare, all that are no hexagons are
/// one class. The classes follow from the pooled counts alone, so that all divisions are judged by the same ones.
fn bins(sums: &[Tally; 2]) -> Vec<Vec<usize>> {
    let pooled = sums[0].plus(&sums[1]);
    let smaller = sums[0].cells().min(sums[1].cells()) / pooled.cells();
    let rare = |bin: &[usize]| {
        bin.iter().map(|class| pooled.by_sides[*class]).sum::<f64>() * smaller < LEAST_EXPECTED
    };
    let [mut fewer, mut more] = [(0..6).collect::<Vec<usize>>(), (7..CLASSES).rev().collect()]
        .map(|outermost_first| gathered(outermost_first, &rare));
    if fewer.iter().chain(&more).any(|bin| rare(bin)) {
        let others = fewer.drain(..).chain(more.drain(..)).flatten().collect();
        fewer.push(others);
    }
    fewer.push(vec![6]);
    fewer.extend(more);
    fewer
}

/// Classes put together in their order until none is rare but perhaps the only one.
fn gathered(classes: Vec<usize>, rare: &impl Fn(&[usize]) -> bool) -> Vec<Vec<usize>> {
    let mut bins: Vec<Vec<usize>> = Vec::new();
    for class in classes {
        match bins.last_mut() {
            Some(last) if rare(last) => last.push(class),
            _ => bins.push(vec![class]),
        }
    }
    if let Some(last) = bins.pop_if(|last| rare(last)) {
        match bins.last_mut() {
            Some(before) => before.extend(last),
            None => bins.push(last),
        }
    }
    bins
}

/// The chi-square distance of two distributions over bins, the difference in each widened by a factor.
fn chi_square(bins: &[Vec<usize>], widening: &[f64], one: &Tally, two: &Tally) -> f64 {
    let [first, second] = [one.cells(), two.cells()];
    let total = first + second;
    let term = |(bin, widening): (&Vec<usize>, &f64)| {
        let count = |tally: &Tally| bin.iter().map(|class| tally.by_sides[*class]).sum::<f64>();
        let [a, b] = [count(one), count(two)];
        let pooled = (a + b) / total;
        if pooled > 0.0 {
            widening.powi(2)
                * ((a - first * pooled).powi(2) / (first * pooled)
                    + (b - second * pooled).powi(2) / (second * pooled))
        } else {
            0.0
        }
    };
    bins.iter().zip(widening).map(term).sum()
}

fn total_variation(widening: &[f64; CLASSES], one: &Tally, two: &Tally) -> f64 {
    let share = |tally: &Tally, class| tally.share(class).unwrap_or(0.0);
    0.5 * (0..CLASSES)
        .map(|class| widening[class] * (share(one, class) - share(two, class)).abs())
        .sum::<f64>()
}

/// Holm's correction: the least p times the number of tests, the next times one less, and so on, never descending.
fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut corrected = vec![0.0; p.len()];
    let mut least = 0.0_f64;
    for (rank, at) in order.into_iter().enumerate() {
        least = least.max((p[at] * (p.len() - rank) as f64).min(1.0));
        corrected[at] = least;
    }
    corrected
}

/// `links` is the factor by which differences of hexagons widen with the links between units.
fn group(kind: &'static str, samples: &[Sample], units: &[Tally], links: f64) -> Group {
    let cells = Tally::sum(units).cells();
    Group {
        kind,
        patterns: samples
            .iter()
            .map(|sample| PatternFigures {
                name: sample.name.clone(),
                unit: sample.pattern.unit.clone(),
                statistics: pattern_statistics(&sample.pattern),
            })
            .collect(),
        cells: whole(cells),
        units: units.len(),
        cells_per_unit: cells / units.len() as f64,
        design_effect: design_effect(units).map(|effect| effect * links * links),
    }
}

/// The variance of the share of hexagons between units, times the cells in a unit, over p(1 − p).
fn design_effect(units: &[Tally]) -> Option<f64> {
    let sum = Tally::sum(units);
    let share = sum.share(6)?;
    let binomial = share * (1.0 - share);
    let count = units.len() as f64;
    // Each unit's hexagons against those expected of its cells.
    let squares: f64 = units.iter().map(|unit| (unit.by_sides[6] - share * unit.cells()).powi(2)).sum();
    let per_cell = squares / (count - 1.0) / (sum.cells() / count);
    (units.len() > 1 && binomial > 0.0).then(|| per_cell / binomial)
}

fn left_out(comb: &[Sample], foam: &[Sample], figures: &[Figure]) -> Vec<LeftOut> {
    let missing = |figure: &&Figure| !figures.contains(figure);
    Figure::ALL
        .iter()
        .filter(missing)
        .map(|figure| {
            let without_surface = |samples: &[Sample]| {
                samples.iter().all(|sample| sample.pattern.cells.iter().all(|c| c.gauss_curvature.is_none()))
            };
            let why = match figure {
                Figure::ChargeOverCurvature if without_surface(comb) => {
                    "the comb's cells lie on no known surface: a photograph alone has no curvature; give the enclosure's \
                     recipe and the camera"
                }
                Figure::ChargeOverCurvature if without_surface(foam) => {
                    "the foam's cells lie on no known surface"
                }
                Figure::ChargeOverCurvature => "the surface is flat: there is no curvature to follow",
                Figure::ChainLength => "comb or foam has no defects",
                _ => "there are no cells",
            };
            LeftOut { what: figure.label().to_owned(), why: why.to_owned() }
        })
        .collect()
}

fn notes(comb: &[Sample], foam: &[Sample], units: Units) -> Vec<String> {
    let mut notes = Vec::new();
    for (kind, samples) in [("comb", comb), ("foam", foam)] {
        if units == Units::Patches && samples.len() > 1 {
            notes.push(format!(
                "patches of {} patterns of {kind} are shuffled together: what these patterns differ by among themselves is \
                 not counted; give at least {LEAST_PATTERNS} patterns of each kind to shuffle whole patterns",
                samples.len()
            ));
        }
        for sample in samples {
            if let Surroundings::Closed { euler_characteristic } = sample.pattern.surroundings
                && euler_characteristic != 0
            {
                let excess = -6.0 * f64::from(euler_characteristic) / sample.pattern.cells.len() as f64;
                notes.push(format!(
                    "{}: the surface fixes the mean number of sides of its {} cells at 6{excess:+.4}; comb of another cell \
                     size on this surface has another mean, whoever builds",
                    sample.name,
                    sample.pattern.cells.len()
                ));
            }
        }
    }
    let uncertain = |s: &Sample| pattern_statistics(&s.pattern).sides.uncertain;
    let doubtful: usize = comb.iter().map(uncertain).sum();
    if doubtful > 0 {
        notes.push(format!(
            "{doubtful} cells of the comb are uncertain and left out; if they are mostly of one kind, the shares are biased"
        ));
    }
    notes
}

/// A count, which is a whole number in a float.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts are whole and small")]
fn whole(count: f64) -> usize {
    count.round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holm_keeps_the_order_and_never_falls() {
        let corrected = holm(&[0.04, 0.01, 0.03]);
        for (found, expected) in corrected.iter().zip([0.06, 0.03, 0.06]) {
            assert!((found - expected).abs() < 1e-12, "{corrected:?}");
        }
    }

    #[test]
    fn chi_square_of_a_known_table() {
        // 10 and 20 of 40, 30 and 20 of 40: all expected 15 and 25, so 4 terms of 25/15 and 25/25.
        let tally = |five: f64, six: f64| {
            let mut tally = Tally::default();
            (tally.by_sides[5], tally.by_sides[6]) = (five, six);
            tally
        };
        let (one, two) = (tally(10.0, 30.0), tally(20.0, 20.0));
        let bins = bins(&[one, two]);
        assert_eq!(bins.len(), 2);
        assert!((chi_square(&bins, &[1.0; 2], &one, &two) - (50.0 / 15.0 + 2.0)).abs() < 1e-12);
        assert!((total_variation(&[1.0; CLASSES], &one, &two) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn cells_in_pairs_have_a_design_effect_of_two() {
        // Units of 10 cells with 0, 2 or 4 defects: always pairs. Var = 8/3 per unit (n − 1), p(1 − p) = 0.16.
        let unit = |odd: f64| {
            let mut tally = Tally::default();
            (tally.by_sides[5], tally.by_sides[6]) = (odd, 10.0 - odd);
            tally
        };
        let units = [0.0, 2.0, 4.0, 2.0].map(unit);
        assert!(design_effect(&units).is_some_and(|d| (d - 8.0 / 3.0 / 10.0 / 0.16).abs() < 1e-12));
    }
}
