//! Cells that are not hexagons: 5–7 pairs and chains.
//!
//! A cell of n sides carries the charge 6 − n. A five touching a seven is a dislocation; a row of them in which they
//! alternate is a grain boundary (D. Nelson, "Defects and Geometry in Condensed Matter Physics", 2002, chapter 2).

use super::pattern::{CellId, CellPattern, CellStatus};
use crate::index::Id;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Complete cells that are not hexagons, and how they hang together.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Defects {
    /// Touching cells of positive and of negative charge, each cell in one pair at most; as many pairs as possible.
    pub pairs: Vec<Pair>,
    /// Groups of touching defects, a single one included; largest first.
    pub chains: Vec<Chain>,
}

/// A cell of fewer than six sides and one of more that touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair {
    /// The cell of fewer than six sides.
    pub few: CellId,
    /// The cell of more than six.
    pub many: CellId,
}

/// A group of defects that touch one another.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Chain {
    /// Its cells in ascending order.
    pub cells: Vec<CellId>,
    /// The sum of their charges.
    pub charge: i64,
}

/// Finds the defects of a pattern. The result is the same for the same pattern.
#[must_use]
pub fn defects(pattern: &CellPattern) -> Defects {
    let charges: BTreeMap<CellId, i64> = pattern
        .complete()
        .filter_map(|(id, cell)| cell.sides.map(|n| (id, 6 - i64::from(n))))
        .filter(|(_, charge)| *charge != 0)
        .collect();
    let touching = |id: CellId| touching_defects(pattern, &charges, id);
    Defects { pairs: pairs(&charges, &touching), chains: chains(&charges, &touching) }
}

/// The defects that a cell touches, in ascending order.
fn touching_defects(pattern: &CellPattern, charges: &BTreeMap<CellId, i64>, id: CellId) -> Vec<CellId> {
    let mut found: Vec<CellId> = pattern.cells[id]
        .walls
        .iter()
        .filter_map(|wall| wall.neighbour)
        .filter(|other| *other != id && charges.contains_key(other))
        .filter(|other| pattern.cells[*other].status == CellStatus::Complete)
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// A largest set of pairs, by augmenting paths.
fn pairs(charges: &BTreeMap<CellId, i64>, touching: &impl Fn(CellId) -> Vec<CellId>) -> Vec<Pair> {
    let few: Vec<CellId> = charges.iter().filter(|(_, q)| **q > 0).map(|(id, _)| *id).collect();
    let options: BTreeMap<CellId, Vec<CellId>> = few
        .iter()
        .map(|id| (*id, touching(*id).into_iter().filter(|other| charges[other] < 0).collect()))
        .collect();
    let mut taken: BTreeMap<CellId, CellId> = BTreeMap::new();
    for id in few {
        let mut tried = Vec::new();
        place(id, &options, &mut taken, &mut tried);
    }
    let mut found: Vec<Pair> = taken.into_iter().map(|(many, few)| Pair { few, many }).collect();
    found.sort_unstable_by_key(|pair| pair.few.index());
    found
}

/// Gives `few` a partner, moving earlier ones to other partners where needed.
fn place(
    few: CellId,
    options: &BTreeMap<CellId, Vec<CellId>>,
    taken: &mut BTreeMap<CellId, CellId>,
    tried: &mut Vec<CellId>,
) -> bool {
    for many in &options[&few] {
        if tried.contains(many) {
            continue;
        }
        tried.push(*many);
        let free = match taken.get(many).copied() {
            None => true,
            Some(holder) => place(holder, options, taken, tried),
        };
        if free {
            taken.insert(*many, few);
            return true;
        }
    }
    false
}

fn chains(charges: &BTreeMap<CellId, i64>, touching: &impl Fn(CellId) -> Vec<CellId>) -> Vec<Chain> {
    let mut left: Vec<CellId> = charges.keys().copied().collect();
    let mut found = Vec::new();
    while let Some(start) = left.first().copied() {
        let mut cells = vec![start];
        let mut next = 0;
        while let Some(cell) = cells.get(next).copied() {
            for other in touching(cell) {
                if !cells.contains(&other) {
                    cells.push(other);
                }
            }
            next += 1;
        }
        cells.sort_unstable();
        left.retain(|id| cells.binary_search(id).is_err());
        let charge = cells.iter().map(|id| charges[id]).sum();
        found.push(Chain { cells, charge });
    }
    found.sort_by_key(|chain| (std::cmp::Reverse(chain.cells.len()), chain.cells[0].index()));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellation::testing::hexagons;

    /// Hexagons whose cells of the given places claim other numbers of sides.
    fn with_sides(changes: &[(usize, u32)]) -> CellPattern {
        let mut pattern = hexagons(9, 9, 0.0);
        for (place, sides) in changes {
            pattern.cells[CellId::from_index(*place)].sides = Some(*sides);
        }
        pattern
    }

    #[test]
    fn hexagons_have_no_defects() {
        assert_eq!(defects(&with_sides(&[])), Defects::default());
    }

    #[test]
    fn a_row_of_fives_and_sevens_is_one_neutral_chain_of_pairs() {
        let found = defects(&with_sides(&[(38, 5), (39, 7), (40, 5), (41, 7)]));
        assert_eq!(found.pairs.len(), 2);
        assert_eq!(found.chains.len(), 1);
        assert_eq!((found.chains[0].cells.len(), found.chains[0].charge), (4, 0));
    }

    #[test]
    fn pairing_leaves_none_out_that_could_be_paired() {
        // Seven, five, seven, five in a row with the first five tried first: greedy pairing by lowest id would do; here the
        // middle seven is the only partner of the last five.
        let found = defects(&with_sides(&[(38, 7), (39, 5), (40, 7), (41, 5)]));
        assert_eq!(found.pairs.len(), 2);
        let lone = defects(&with_sides(&[(38, 5), (42, 7)]));
        assert!(lone.pairs.is_empty());
        assert_eq!(lone.chains.len(), 2);
    }
}
