//! Units that may be exchanged: compact patches of a pattern, or whole patterns.

use super::{
    Sample, Units,
    links::Links,
    tally::{Tally, tallies},
};
use crate::tessellation::{CellId, CellPattern, defects};
use glam::DVec3;
use std::collections::BTreeMap;

/// Fewest patterns of each kind for whole patterns to be shuffled: 4 and 4 can be divided in 35 ways, the least number that
/// allows p < 0.05.
pub(super) const LEAST_PATTERNS: usize = 4;

/// Patches that the smaller group is divided into where it has cells enough. With eight in each group there are 12 870
/// divisions; the larger the patches, the fewer links between neighbours are left to be made up for.
const PATCHES: usize = 8;

/// The smallest patches: a cell with all its neighbours, and one.
const LEAST_CELLS: usize = 8;

/// The largest: beyond this more patches are worth more.
const MOST_CELLS: usize = 100;

/// Comb and foam divided into units of the same kind.
pub(super) struct Divided {
    /// What a unit is: never [`Units::Auto`].
    pub(super) units: Units,
    /// The tally of each unit of comb.
    pub(super) comb: Vec<Tally>,
    /// The tally of each unit of foam.
    pub(super) foam: Vec<Tally>,
    /// The cells of both and what links them.
    pub(super) links: Links,
}

/// Divides both groups. Units without complete cells are left out.
pub(super) fn divide(comb: &[Sample], foam: &[Sample], units: Units) -> Divided {
    let enough = comb.len() >= LEAST_PATTERNS && foam.len() >= LEAST_PATTERNS;
    let whole = units == Units::Patterns || (units == Units::Auto && enough);
    let complete = |samples: &[Sample]| samples.iter().map(|s| s.pattern.complete().count()).sum::<usize>();
    let smaller = complete(comb).min(complete(foam));
    let size = (smaller / PATCHES).clamp(LEAST_CELLS, MOST_CELLS);
    let mut links = Links::default();
    let mut divided = |samples: &[Sample]| -> Vec<Tally> {
        let parts = |pattern: &CellPattern| match whole {
            true => 1,
            // To the nearest: patches of comb and foam come out of about one size.
            false => ((pattern.complete().count() + size / 2) / size).max(1),
        };
        let all = samples
            .iter()
            .flat_map(|sample| pattern_units(&sample.pattern, parts(&sample.pattern), &mut links));
        all.filter(|tally| tally.cells() > 0.0).collect()
    };
    let [comb, foam] = [divided(comb), divided(foam)];
    Divided { units: if whole { Units::Patterns } else { Units::Patches }, comb, foam, links }
}

fn pattern_units(pattern: &CellPattern, parts: usize, links: &mut Links) -> Vec<Tally> {
    let mut cells: Vec<(CellId, DVec3)> = pattern.complete().map(|(id, cell)| (id, cell.position)).collect();
    let mut unit_of = BTreeMap::new();
    let mut next = 0;
    split(&mut cells, parts, &mut |patch| {
        unit_of.extend(patch.iter().map(|(id, _)| (*id, next)));
        next += 1;
    });
    let found = defects(pattern);
    links.add(pattern, &found, &unit_of);
    tallies(pattern, &found, &unit_of, next)
}

/// Halves the cells across their longest extent until there are `parts` patches, whose sizes differ by one at most from level
/// to level.
fn split(cells: &mut [(CellId, DVec3)], parts: usize, patch: &mut impl FnMut(&[(CellId, DVec3)])) {
    if parts <= 1 || cells.len() <= 1 {
        patch(cells);
        return;
    }
    let (low, high) = cells
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (_, at)| (low.min(*at), high.max(*at)));
    let extent = (high - low).to_array();
    let axis = (0..3).max_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
    cells.sort_by(|(a, p), (b, q)| p[axis].total_cmp(&q[axis]).then(a.cmp(b)));
    let first = parts / 2;
    let (left, right) = cells.split_at_mut(cells.len() * first / parts);
    split(left, first, patch);
    split(right, parts - first, patch);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellation::flipped_hexagons;

    fn sample(columns: usize, rows: usize) -> Result<Sample, String> {
        let pattern = flipped_hexagons(columns, rows, 10, 1).map_err(|d| format!("{d:?}"))?;
        Ok(Sample { name: "torus".to_owned(), pattern })
    }

    #[test]
    fn patches_hold_all_cells_in_nearly_equal_numbers() -> Result<(), String> {
        let (small, large) = (sample(16, 10)?, sample(30, 20)?);
        let Divided { units, comb, foam, .. } = divide(&[small], &[large], Units::Auto);
        assert_eq!(units, Units::Patches);
        assert_eq!((comb.len(), foam.len()), (8, 30));
        assert!((Tally::sum(&foam).cells() - 600.0).abs() < 1e-9);
        for tally in comb.iter().chain(&foam) {
            assert!((17.0..=23.0).contains(&tally.cells()), "{}", tally.cells());
        }
        Ok(())
    }

    #[test]
    fn four_patterns_of_each_are_shuffled_whole() -> Result<(), String> {
        let four: Vec<Sample> = (0..4).map(|_| sample(6, 6)).collect::<Result<_, _>>()?;
        let divided = divide(&four, &four, Units::Auto);
        assert_eq!((divided.units, divided.comb.len(), divided.foam.len()), (Units::Patterns, 4, 4));
        let divided = divide(&four, &four[..3], Units::Auto);
        assert_eq!(divided.units, Units::Patches);
        Ok(())
    }
}
