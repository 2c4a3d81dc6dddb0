//! Random defects: hexagons on a torus, some of whose walls have flipped.
//!
//! A T1 takes one side from each of the two cells that share a wall and gives one to each of the two at its ends: two fives
//! and two sevens from four hexagons. Any number of them keeps the mean at six. What results has the topology of a defected
//! comb without its geometry: the null model of tests and of studies of power.

use super::pattern::{Cell, CellId, CellPattern, CellStatus, CellWall, PatternDefect, Surroundings};
use crate::index::{Id, IndexVec};
use glam::{DVec3, IVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Cells keep between this many sides …
const FEWEST: usize = 4;
/// … and this many.
const MOST: usize = 9;

/// `columns` × `rows` hexagons of unit pitch on a flat torus after `flips` random T1s. `rows` must be even.
///
/// A flip that would leave a cell with fewer than 4 or more than 9 sides, or make two cells touch twice, is not made, and
/// another is drawn, 100 times at most; with a tenth as many flips as cells all are made.
///
/// # Errors
/// Every [`PatternDefect`]: with fewer than five rows or columns a cell meets the same neighbour twice.
pub fn flipped_hexagons(
    columns: usize,
    rows: usize,
    flips: usize,
    seed: u64,
) -> Result<CellPattern, Vec<PatternDefect>> {
    let mut rings = hexagonal_rings(columns, rows);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..flips {
        for _ in 0..100 {
            let cell = random.random_range(0..rings.len());
            let wall = random.random_range(0..rings[cell].len());
            if flip(&mut rings, cell, wall) {
                break;
            }
        }
    }
    let cells = rings.iter().enumerate().map(|(index, ring)| {
        let (column, row) = (index % columns, index / columns);
        let walls = ring.iter().map(|other| CellWall {
            neighbour: Some(CellId::from_index(*other)),
            shift: IVec3::ZERO,
            length: 1.0 / 3.0_f64.sqrt(),
        });
        Cell {
            position: DVec3::new(column as f64 + 0.5 * (row % 2) as f64, row as f64 * 0.75_f64.sqrt(), 0.0),
            normal: DVec3::Z,
            sides: u32::try_from(ring.len()).ok(),
            status: CellStatus::Complete,
            confidence: 1.0,
            area: 0.75_f64.sqrt(),
            gauss_curvature: None,
            walls: walls.collect(),
        }
    });
    let cells: IndexVec<CellId, Cell> = cells.collect();
    CellPattern::new("pitch", Surroundings::Closed { euler_characteristic: 0 }, cells)
}

/// The neighbours of each cell, counter-clockwise.
fn hexagonal_rings(columns: usize, rows: usize) -> Vec<Vec<usize>> {
    let at = |column: usize, row: usize| (row % rows) * columns + column % columns;
    let ring = |index: usize| {
        let (column, row) = (index % columns, index / columns);
        // Odd rows are shifted by half a pitch to the right.
        let (left, right) = if row % 2 == 0 { (column + columns - 1, column) } else { (column, column + 1) };
        let (above, below) = (row + 1, row + rows - 1);
        vec![
            at(column + 1, row),
            at(right, above),
            at(left, above),
            at(column + columns - 1, row),
            at(left, below),
            at(right, below),
        ]
    };
    (0..columns * rows).map(ring).collect()
}

/// Flips the wall between a cell and a neighbour; `false` if that is not allowed, and nothing is changed.
fn flip(rings: &mut [Vec<usize>], cell: usize, wall: usize) -> bool {
    let ring = &rings[cell];
    let count = ring.len();
    let other = ring[wall];
    let (before, after) = (ring[(wall + count - 1) % count], ring[(wall + 1) % count]);
    let thin = count <= FEWEST || rings[other].len() <= FEWEST;
    let thick = rings[before].len() >= MOST || rings[after].len() >= MOST;
    if thin || thick || before == after || rings[before].contains(&after) {
        return false;
    }
    rings[cell].retain(|n| *n != other);
    rings[other].retain(|n| *n != cell);
    // At the wall's ends a new neighbour comes between the two that have parted.
    insert_between(&mut rings[before], cell, other, after);
    insert_between(&mut rings[after], other, cell, before);
    true
}

/// Puts `new` between two neighbours that follow each other in a ring.
fn insert_between(ring: &mut Vec<usize>, one: usize, two: usize, new: usize) {
    let count = ring.len();
    let follows = |at: &usize| {
        let pair = (ring[*at], ring[(*at + 1) % count]);
        pair == (one, two) || pair == (two, one)
    };
    if let Some(at) = (0..count).find(follows) {
        ring.insert(at + 1, new);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flips_keep_the_laws_and_the_mean() -> Result<(), String> {
        for (flips, seed) in [(0, 1), (1, 1), (10, 2), (60, 3)] {
            let pattern = flipped_hexagons(12, 10, flips, seed).map_err(|d| format!("{d:?}"))?;
            assert_eq!(pattern.charge(), 0);
            let odd: usize = pattern.cells.iter().filter(|c| c.sides != Some(6)).count();
            assert!(odd <= 4 * flips && (flips == 0 || odd > 0), "{flips} flips, {odd} defects");
            // Three neighbours in a row touch: every corner is shared by three cells.
            for cell in pattern.cells.iter() {
                for (one, two) in cell.walls.iter().zip(cell.walls.iter().cycle().skip(1)) {
                    let (Some(one), Some(two)) = (one.neighbour, two.neighbour) else {
                        return Err("a wall to nowhere".to_owned());
                    };
                    assert!(pattern.cells[one].walls.iter().any(|w| w.neighbour == Some(two)));
                }
            }
        }
        Ok(())
    }

    #[test]
    fn the_same_seed_gives_the_same_pattern() {
        assert_eq!(flipped_hexagons(8, 8, 9, 5), flipped_hexagons(8, 8, 9, 5));
        assert_ne!(flipped_hexagons(8, 8, 9, 5), flipped_hexagons(8, 8, 9, 6));
    }
}
