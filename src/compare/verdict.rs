//! What a comparison means, in words.

use super::{
    Group, LEVEL, SideClass, SidesTest, Units,
    quantile::{NORMAL_800, NORMAL_975, NORMAL_9995},
};
use serde::{Deserialize, Serialize};

/// Fewest units of each kind for a verdict: 4 and 4 can be divided in 35 ways, which allows p < 0.05.
pub(super) const LEAST_UNITS: usize = 4;

/// Fewest complete cells of each kind: half a dozen of the smallest patches.
pub(super) const LEAST_CELLS: usize = 48;

/// The difference in the share of hexagons that a study should be able to see.
const WORTH_SEEING: f64 = 0.05;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Finding {
    /// Too few complete cells to say anything.
    TooFewCells,
    /// The numbers of sides do not differ by more than chance would make them.
    NoDifference,
    /// They differ.
    Different,
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// What was found.
    pub finding: Finding,
    /// The answer in a few sentences.
    pub sentence: String,
    /// Complete cells of each kind with which a difference of 5 points in the share of hexagons is found four times in five.
    pub cells_for_five_points: Option<usize>,
    /// Those with which the difference found would reach p < 0.001 four times in five; none without a difference.
    pub cells_to_be_surer: Option<usize>,
}

/// Judges the test of the sides.
pub(super) fn verdict(groups: &[Group; 2], units: Units, sides: &SidesTest) -> Verdict {
    let found = hexagons(sides);
    let five = cells_needed(groups, found.share, WORTH_SEEING, NORMAL_975);
    let lacking = groups.iter().any(|group| group.cells < LEAST_CELLS || group.units < LEAST_UNITS);
    let finding = if lacking {
        Finding::TooFewCells
    } else if sides.p <= LEVEL {
        Finding::Different
    } else {
        Finding::NoDifference
    };
    let surer = (finding == Finding::Different)
        .then(|| cells_needed(groups, found.share, found.difference, NORMAL_9995))
        .flatten();
    let sentence = match finding {
        Finding::TooFewCells => too_few(groups, units),
        Finding::Different => different(groups, units, sides, &found, surer),
        Finding::NoDifference => no_difference(groups, units, sides, &found, five),
    };
    Verdict { finding, sentence, cells_for_five_points: five, cells_to_be_surer: surer }
}

/// What is said of the hexagons.
struct Hexagons {
    share: [f64; 2],
    difference: f64,
    interval: Option<[f64; 2]>,
}

fn hexagons(sides: &SidesTest) -> Hexagons {
    sides.classes.iter().find(|class| class.sides == 6).map_or(
        Hexagons { share: [0.0; 2], difference: 0.0, interval: None },
        |class| Hexagons {
            share: class.share.map(|estimate| estimate.value),
            difference: class.difference.value,
            interval: class.difference.interval,
        },
    )
}

/// Complete cells of each kind for a difference `difference` in the share of hexagons to be found four times in five:
/// n = (z + z₀.₈)² · 2·p(1 − p)·D / difference², with the design effect D of the cells at hand (W. Cochran, "Sampling
/// Techniques", 1977).
fn cells_needed(groups: &[Group; 2], share: [f64; 2], difference: f64, z: f64) -> Option<usize> {
    let variance = |at: usize| {
        // One more of each kind than was seen, so that no share is taken for certain.
        let cells = groups[at].cells as f64;
        let p = (share[at] * cells + 1.0) / (cells + 2.0);
        // Fewer than one would promise more than independent cells can.
        p * (1.0 - p) * groups[at].design_effect.unwrap_or(1.0).max(1.0)
    };
    let needed = (z + NORMAL_800).powi(2) * (variance(0) + variance(1)) / difference.powi(2);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded just before")]
    (needed < 1e9).then(|| two_digits(needed) as usize)
}

/// Rounded up to two digits.
fn two_digits(value: f64) -> f64 {
    let unit = 10.0_f64.powf((value.max(1.0).log10().floor() - 1.0).max(0.0));
    (value / unit).ceil() * unit
}

fn unit_name(units: Units) -> &'static str {
    if units == Units::Patterns { "whole patterns" } else { "patches" }
}

fn too_few(groups: &[Group; 2], units: Units) -> String {
    let lacking: Vec<String> = groups
        .iter()
        .filter(|group| group.cells < LEAST_CELLS || group.units < LEAST_UNITS)
        .map(|group| {
            format!(
                "the {} has {} complete cells in {} {}",
                group.kind,
                group.cells,
                group.units,
                unit_name(units)
            )
        })
        .collect();
    format!(
        "No verdict: {}; at least {LEAST_CELLS} cells in {LEAST_UNITS} {} are needed of each.",
        lacking.join(", and "),
        unit_name(units)
    )
}

/// p in words and as a number, never smaller than the permutations allow.
fn chance(sides: &SidesTest, groups: &[Group; 2], units: Units) -> String {
    let what = format!(
        "{}{} permutations of {} {}",
        if sides.exhaustive { "all " } else { "" },
        sides.permutations,
        groups[0].units + groups[1].units,
        unit_name(units)
    );
    format!("p = {}; {what}", short(sides.p))
}

fn short(p: f64) -> String {
    if p < 0.001 {
        format!("{p:.4}")
    } else if p < 0.1 {
        format!("{p:.3}")
    } else {
        format!("{p:.2}")
    }
}

fn points(value: f64) -> String {
    format!("{:+.1}", 100.0 * value)
}

fn between(interval: Option<[f64; 2]>) -> String {
    interval.map_or_else(String::new, |[low, high]| {
        format!(" (95 % interval {} to {})", points(low), points(high))
    })
}

fn shares(groups: &[Group; 2], found: &Hexagons) -> String {
    format!(
        "{:.1} % of the comb's {} complete cells are hexagons and {:.1} % of the foam's {}, a difference of {} points{}",
        100.0 * found.share[0],
        groups[0].cells,
        100.0 * found.share[1],
        groups[1].cells,
        points(found.difference),
        between(found.interval)
    )
}

fn different(
    groups: &[Group; 2],
    units: Units,
    sides: &SidesTest,
    found: &Hexagons,
    surer: Option<usize>,
) -> String {
    let sure = match sides.p {
        p if p < 0.001 => "almost certainly",
        p if p < 0.01 => "very probably",
        _ => "probably",
    };
    let more = match surer {
        Some(cells) if sides.p >= 0.001 && groups.iter().any(|group| group.cells < cells) => format!(
            " About {cells} complete cells of each would make such a difference almost certain (p < 0.001) four times in five."
        ),
        _ if sides.p >= 0.001 => {
            " More patterns, rather than more cells of these, would make it surer.".to_owned()
        }
        _ => " Four times as many cells would halve the interval.".to_owned(),
    };
    format!(
        "Comb and foam {sure} differ in their numbers of sides ({}): {}.{}{more}",
        chance(sides, groups, units),
        shares(groups, found),
        largest(sides)
    )
}

/// The class with the largest difference, where that is not the hexagons.
fn largest(sides: &SidesTest) -> String {
    let by_difference =
        |a: &&SideClass, b: &&SideClass| a.difference.value.abs().total_cmp(&b.difference.value.abs());
    match sides.classes.iter().max_by(by_difference) {
        Some(class) if class.sides != 6 => format!(
            " They differ most in cells of {} sides: {:.1} % against {:.1} %, {} points{}.",
            class.sides,
            100.0 * class.share[0].value,
            100.0 * class.share[1].value,
            points(class.difference.value),
            between(class.difference.interval)
        ),
        _ => String::new(),
    }
}

fn no_difference(
    groups: &[Group; 2],
    units: Units,
    sides: &SidesTest,
    found: &Hexagons,
    five: Option<usize>,
) -> String {
    let bound = found.interval.map_or_else(String::new, |[low, high]| {
        let largest = 100.0 * low.abs().max(high.abs());
        format!(" A difference of up to {largest:.0} points cannot be excluded.")
    });
    let more = match five {
        Some(cells) if groups.iter().all(|group| group.cells >= cells) => {
            " There are cells enough to have found a difference of 5 points four times in five.".to_owned()
        }
        Some(cells) => format!(
            " To find a difference of 5 points four times in five, about {cells} complete cells of each are needed."
        ),
        None => String::new(),
    };
    format!(
        "No difference was found between comb and foam in their numbers of sides ({}): {}.{bound}{more}",
        chance(sides, groups, units),
        shares(groups, found)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(kind: &'static str, cells: usize, design_effect: Option<f64>) -> Group {
        Group {
            kind,
            patterns: Vec::new(),
            cells,
            units: 10,
            cells_per_unit: cells as f64 / 10.0,
            design_effect,
        }
    }

    #[test]
    fn cells_needed_agree_with_the_textbook() {
        // Shares of 85 % and 85 %, 5 points, independent cells: 7.849 · 2 · 0.1275 / 0.0025 = 801.
        let groups = [group("comb", 1_000_000, Some(1.0)), group("foam", 1_000_000, None)];
        assert_eq!(cells_needed(&groups, [0.85; 2], 0.05, NORMAL_975), Some(810));
        let paired = [group("comb", 1_000_000, Some(2.0)), group("foam", 1_000_000, Some(2.0))];
        assert_eq!(cells_needed(&paired, [0.85; 2], 0.05, NORMAL_975), Some(1700));
        assert_eq!(cells_needed(&groups, [0.85; 2], 0.0, NORMAL_975), None);
    }

    #[test]
    fn too_few_cells_get_no_verdict_but_what_is_missing() {
        let mut groups = [group("comb", 20, None), group("foam", 500, None)];
        groups[0].units = 2;
        let text = too_few(&groups, Units::Patches);
        assert!(text.contains("the comb has 20 complete cells in 2 patches"), "{text}");
        assert!(!text.contains("foam has"), "{text}");
    }
}
