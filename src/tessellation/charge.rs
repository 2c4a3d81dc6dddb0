//! Topological charge: what it must be, and how it goes with curvature.
//!
//! **One rule for cells at the border**, alike for foam and comb: only complete cells carry charge. They make up a piece of
//! surface; every corner where three walls meet belongs to one, two or three of them. With V₁ corners of one complete cell
//! and V₂ of two, Euler's relation for three-valent corners gives
//! Σ(6 − n) = 6χ + V₂ − V₁. On a closed surface there is no border, and Σ(6 − n) = 6χ.
//!
//! On a curved surface charges gather where the Gaussian curvature is: Σ(6 − n)·π/3 over a region follows ∫K dA, and equals
//! it on the whole of a closed surface (Gauss–Bonnet; M. Bowick, D. Nelson and A. Travesset, Phys. Rev. B 62, 2000).

use super::{
    neighbours::cells_within,
    pattern::{CellId, CellPattern, CellStatus, Surroundings},
};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, f64::consts::PI};

/// The charge of the complete cells against what Euler's relation asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChargeBalance {
    /// Σ(6 − n) over the complete cells.
    pub charge: i64,
    /// χ of the piece of surface that the complete cells make up.
    pub euler_characteristic: i64,
    /// V₂ − V₁ of its border; 0 on a closed surface.
    pub border: i64,
    /// 6χ + V₂ − V₁.
    pub expected: i64,
}

impl ChargeBalance {
    /// What is left over: 0 unless corners of four walls, or numbers of sides that differ from the walls seen, are among the
    /// cells.
    #[must_use]
    pub const fn unexplained(&self) -> i64 {
        self.charge - self.expected
    }
}

/// Charge against curvature over all regions of one size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionCharges {
    /// The regions are all cells at most this many walls from a middle one.
    pub radius: usize,
    /// The mean number of cells in a region.
    pub mean_cells: f64,
    /// The slope of Σ(6 − n)·π/3 against ∫K dA, by least squares through the origin: 1 where charge follows curvature.
    pub slope: f64,
    /// Their correlation; `None` where one of them is the same everywhere.
    pub correlation: Option<f64>,
    /// Of each region ∫K dA and Σ(6 − n)·π/3.
    pub regions: Vec<[f64; 2]>,
}

fn is_complete(pattern: &CellPattern, id: CellId) -> bool {
    pattern.cells[id].status == CellStatus::Complete
}

/// The complete cell behind a wall.
fn behind(pattern: &CellPattern, id: CellId, wall: usize) -> Option<CellId> {
    pattern.cells[id].walls[wall].neighbour.filter(|other| is_complete(pattern, *other))
}

/// The balance of a pattern's charge.
#[must_use]
pub fn charge_balance(pattern: &CellPattern) -> ChargeBalance {
    let charge = pattern.charge();
    let mut border = 0;
    let mut half_corners = 0;
    for (id, cell) in pattern.complete() {
        let count = cell.walls.len();
        for wall in 0..count {
            let others = [wall, (wall + 1) % count].map(|w| behind(pattern, id, w).is_some());
            match others {
                [true, true] => {}
                // Met from two complete cells, so that each counts a half.
                [true, false] | [false, true] => half_corners += 1,
                [false, false] => border -= 1,
            }
        }
    }
    border += half_corners / 2;
    let euler_characteristic = match pattern.surroundings {
        Surroundings::Closed { euler_characteristic } if border == 0 && half_corners == 0 => {
            i64::from(euler_characteristic)
        }
        _ => pieces(pattern) * 2 - border_loops(pattern),
    };
    ChargeBalance { charge, euler_characteristic, border, expected: 6 * euler_characteristic + border }
}

/// Connected pieces of complete cells.
fn pieces(pattern: &CellPattern) -> i64 {
    let mut left: BTreeSet<CellId> = pattern.complete().map(|(id, _)| id).collect();
    let mut count = 0;
    while let Some(start) = left.pop_first() {
        count += 1;
        let mut open = vec![start];
        while let Some(id) = open.pop() {
            for wall in 0..pattern.cells[id].walls.len() {
                if let Some(other) = behind(pattern, id, wall)
                    && left.remove(&other)
                {
                    open.push(other);
                }
            }
        }
    }
    count
}

/// Closed lines of walls that bound the complete cells.
fn border_loops(pattern: &CellPattern) -> i64 {
    let mut left: BTreeSet<(CellId, usize)> = pattern
        .complete()
        .flat_map(|(id, cell)| (0..cell.walls.len()).map(move |wall| (id, wall)))
        .filter(|(id, wall)| behind(pattern, *id, *wall).is_none())
        .collect();
    let mut count = 0;
    while let Some(start) = left.pop_first() {
        count += 1;
        let mut at = start;
        while let Some(next) = next_on_border(pattern, at).filter(|next| left.remove(next)) {
            at = next;
        }
    }
    count
}

/// The border wall that begins where this one ends: round the corner, through the complete cells that meet there.
fn next_on_border(pattern: &CellPattern, (start, wall): (CellId, usize)) -> Option<(CellId, usize)> {
    let mut cell = start;
    let mut wall = (wall + 1) % pattern.cells[cell].walls.len();
    // As many cells as ever meet in a corner.
    for _ in 0..8 {
        let Some(other) = behind(pattern, cell, wall) else { return Some((cell, wall)) };
        let shift = pattern.cells[cell].walls[wall].shift;
        let walls = &pattern.cells[other].walls;
        let back = walls.iter().position(|w| w.neighbour == Some(cell) && w.shift == -shift)?;
        wall = (back + 1) % walls.len();
        cell = other;
    }
    None
}

/// Charge against integrated curvature over regions of growing radius, up to `reach` walls or until a region holds more than
/// half of the cells. Regions that meet a cell which is not complete are left out. `None` where no curvature is known.
///
/// ∫K dA of a cell is its K times its area, in the pattern's own unit.
#[must_use]
pub fn charge_against_curvature(pattern: &CellPattern, reach: usize) -> Option<Vec<RegionCharges>> {
    let known = |id: CellId| -> Option<[f64; 2]> {
        let cell = &pattern.cells[id];
        let sides = cell.sides.filter(|_| is_complete(pattern, id))?;
        Some([cell.gauss_curvature? * cell.area, (6.0 - f64::from(sides)) * PI / 3.0])
    };
    let middles: Vec<CellId> =
        pattern.complete().map(|(id, _)| id).filter(|id| known(*id).is_some()).collect();
    if middles.is_empty() {
        return None;
    }
    let mut found = Vec::new();
    for radius in 0..=reach {
        let mut regions = Vec::new();
        let mut cells = 0;
        for id in &middles {
            let region = cells_within(pattern, *id, radius);
            let figures: Option<Vec<[f64; 2]>> = region.iter().map(|(other, _)| known(*other)).collect();
            if let Some(figures) = figures {
                cells += region.len();
                regions.push(figures.iter().fold([0.0; 2], |sum, f| [sum[0] + f[0], sum[1] + f[1]]));
            }
        }
        let mean_cells = cells as f64 / regions.len() as f64;
        if regions.is_empty() || 2.0 * mean_cells > pattern.cells.len() as f64 {
            break;
        }
        found.push(RegionCharges {
            radius,
            mean_cells,
            slope: slope(&regions),
            correlation: correlation(&regions),
            regions,
        });
    }
    Some(found)
}

/// The slope of y against x through the origin.
fn slope(points: &[[f64; 2]]) -> f64 {
    let (xy, xx) = points.iter().fold((0.0, 0.0), |(xy, xx), [x, y]| (xy + x * y, xx + x * x));
    if xx > 0.0 { xy / xx } else { 0.0 }
}

fn correlation(points: &[[f64; 2]]) -> Option<f64> {
    let count = points.len() as f64;
    let mean = |axis: usize| points.iter().map(|p| p[axis]).sum::<f64>() / count;
    let means = [mean(0), mean(1)];
    let sum = |a: usize, b: usize| points.iter().map(|p| (p[a] - means[a]) * (p[b] - means[b])).sum::<f64>();
    let spread = sum(0, 0) * sum(1, 1);
    (spread > 1e-24).then(|| sum(0, 1) / spread.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Id;
    use crate::tessellation::testing::{flipped_torus, hexagons};

    #[test]
    fn a_patch_of_hexagons_is_explained_by_its_border() {
        let pattern = hexagons(9, 7, 0.0);
        let balance = charge_balance(&pattern);
        assert_eq!(balance.euler_characteristic, 1);
        assert_eq!((balance.charge, balance.border), (0, -6));
        assert_eq!(balance.unexplained(), 0);
    }

    #[test]
    fn a_hole_takes_one_from_the_euler_characteristic() {
        let mut pattern = hexagons(11, 11, 0.0);
        pattern.cells[CellId::from_index(60)].status = CellStatus::Uncertain;
        let balance = charge_balance(&pattern);
        assert_eq!((balance.euler_characteristic, balance.border, balance.unexplained()), (0, 0, 0));
    }

    #[test]
    fn a_side_miscounted_stays_unexplained() {
        let mut pattern = hexagons(9, 7, 0.0);
        pattern.cells[CellId::from_index(31)].sides = Some(5);
        assert_eq!(charge_balance(&pattern).unexplained(), 1);
    }

    #[test]
    fn a_torus_and_any_piece_of_it_balance() {
        let mut pattern = flipped_torus(10, 10, 25, 4);
        assert_eq!(charge_balance(&pattern).expected, 0);
        pattern.surroundings = Surroundings::Open;
        for seed in 0..30_usize {
            let id = CellId::from_index((seed * 37) % 100);
            pattern.cells[id].status = CellStatus::Cut;
        }
        // Pieces of a torus that do not wind round it are planar.
        for row in 0..10 {
            for cut in [row, 10 * row] {
                pattern.cells[CellId::from_index(cut)].status = CellStatus::Cut;
            }
        }
        assert_eq!(charge_balance(&pattern).unexplained(), 0);
    }

    #[test]
    fn charge_that_is_curvature_has_slope_one() {
        let mut pattern = flipped_torus(10, 10, 25, 5);
        assert_eq!(charge_against_curvature(&pattern, 2), None);
        for cell in pattern.cells.iter_mut() {
            cell.area = 2.0;
            let charge = 6.0 - f64::from(cell.sides.unwrap_or(6));
            cell.gauss_curvature = Some(charge * PI / 6.0);
        }
        let found = charge_against_curvature(&pattern, 9).unwrap_or_default();
        assert_eq!(found.iter().map(|r| r.radius).collect::<Vec<_>>(), [0, 1, 2, 3]);
        for region in found {
            assert!((region.slope - 1.0).abs() < 1e-12);
            assert!(region.correlation.is_some_and(|c| (c - 1.0).abs() < 1e-9));
        }
    }
}
