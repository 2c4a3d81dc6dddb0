//! How the sides of a cell go with its neighbours' and with its size.
//!
//! - Aboav–Weaire: n·m(n) = (⟨n⟩ − a)·n + a·⟨n⟩ + μ₂, where m(n) is the mean number of sides of the neighbours of cells of n
//!   sides (D. Aboav, Metallography 3, 1970; D. Weaire, Metallography 7, 1974).
//! - Lewis: ⟨A⟩ₙ / ⟨A⟩ = 1 + λ·(n − ⟨n⟩), where ⟨A⟩ₙ is the mean area of cells of n sides (F. T. Lewis, Anat. Rec. 38, 1928).
//! - Correlations: C(r) = ⟨δnᵢ δnⱼ⟩ / μ₂ over the pairs of cells r walls apart, with δn = n − ⟨n⟩.
//!
//! Only complete cells count, and of their neighbours only complete ones.

use super::pattern::{CellId, CellPattern, CellStatus};
use crate::index::{Id, IndexVec};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The neighbours of cells with one number of sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeighbourMean {
    /// The number of sides n.
    pub sides: u32,
    /// Walls between such a cell and a complete neighbour.
    pub walls: usize,
    /// m(n): the mean number of sides of those neighbours.
    pub mean_sides_of_neighbours: f64,
}

/// The Aboav–Weaire law, fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AboavWeaire {
    /// m(n), ascending in n.
    pub points: Vec<NeighbourMean>,
    /// The parameter a: about 1 in foams, 0 without correlation. None where all cells have as many sides.
    pub a: Option<f64>,
}

/// The areas of cells with one number of sides.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AreaMean {
    /// The number of sides n.
    pub sides: u32,
    /// How many cells.
    pub cells: usize,
    /// ⟨A⟩ₙ / ⟨A⟩.
    pub relative_area: f64,
    /// The standard deviation of A / ⟨A⟩ among them; 0 of a single cell.
    pub deviation: f64,
}

/// Lewis' law, fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lewis {
    /// ⟨A⟩ₙ / ⟨A⟩, ascending in n.
    pub points: Vec<AreaMean>,
    /// The slope λ. None where all cells have as many sides.
    pub slope: Option<f64>,
}

/// How the sides of cells a distance apart go together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DistanceCorrelation {
    /// The least number of walls from one cell to the other.
    pub distance: usize,
    /// How many pairs of cells.
    pub pairs: usize,
    /// C(r), between −1 and 1 but for scatter.
    pub correlation: f64,
}

/// Complete cells and their sides.
fn counted(pattern: &CellPattern) -> impl Iterator<Item = (CellId, u32)> {
    pattern.complete().filter_map(|(id, cell)| Some((id, cell.sides?)))
}

/// ⟨n⟩ and μ₂; `None` without complete cells.
fn moments(pattern: &CellPattern) -> Option<(f64, f64)> {
    let sides: Vec<f64> = counted(pattern).map(|(_, n)| f64::from(n)).collect();
    let count = sides.len() as f64;
    let mean = sides.iter().sum::<f64>() / count;
    let second = sides.iter().map(|n| (n - mean) * (n - mean)).sum::<f64>() / count;
    (!sides.is_empty()).then_some((mean, second))
}

/// The complete neighbours of a cell with their sides, one for each wall.
fn neighbours(pattern: &CellPattern, id: CellId) -> impl Iterator<Item = u32> {
    let behind = pattern.cells[id].walls.iter().filter_map(|wall| wall.neighbour);
    behind
        .map(|other| &pattern.cells[other])
        .filter(|other| other.status == CellStatus::Complete)
        .filter_map(|other| other.sides)
}

/// m(n) and the parameter of the Aboav–Weaire law, by least squares in n·m(n), each n weighted by its walls.
#[must_use]
pub fn aboav_weaire(pattern: &CellPattern) -> AboavWeaire {
    let Some((mean, second)) = moments(pattern) else { return AboavWeaire::default() };
    let mut sums: BTreeMap<u32, (usize, f64)> = BTreeMap::new();
    for (id, n) in counted(pattern) {
        for other in neighbours(pattern, id) {
            let entry = sums.entry(n).or_default();
            entry.0 += 1;
            entry.1 += f64::from(other);
        }
    }
    let points: Vec<NeighbourMean> = sums
        .into_iter()
        .map(|(sides, (walls, sum))| NeighbourMean {
            sides,
            walls,
            mean_sides_of_neighbours: sum / walls as f64,
        })
        .collect();
    // n m(n) − ⟨n⟩ n − μ₂ = a (⟨n⟩ − n).
    let fit = slope(points.iter().map(|point| {
        let n = f64::from(point.sides);
        (mean - n, n * point.mean_sides_of_neighbours - mean * n - second, point.walls as f64)
    }));
    AboavWeaire { points, a: fit }
}

/// The slope of a line through the origin by weighted least squares, from (x, y, weight).
fn slope(points: impl Iterator<Item = (f64, f64, f64)>) -> Option<f64> {
    let (xy, xx) = points.fold((0.0, 0.0), |(xy, xx), (x, y, w)| (xy + w * x * y, xx + w * x * x));
    (xx > 1e-9).then(|| xy / xx)
}

/// Mean areas by number of sides and the slope of Lewis' law, each n weighted by its cells. Cells without area are left out.
#[must_use]
pub fn lewis(pattern: &CellPattern) -> Lewis {
    let sized: Vec<(u32, f64)> =
        counted(pattern).map(|(id, n)| (n, pattern.cells[id].area)).filter(|(_, area)| *area > 0.0).collect();
    let count = sized.len() as f64;
    let (mean_sides, mean_area) = sized
        .iter()
        .fold((0.0, 0.0), |(n, a), (sides, area)| (n + f64::from(*sides) / count, a + area / count));
    let mut groups: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for (sides, area) in sized {
        groups.entry(sides).or_default().push(area / mean_area);
    }
    let points: Vec<AreaMean> = groups
        .into_iter()
        .map(|(sides, areas)| {
            let cells = areas.len();
            let mean = areas.iter().sum::<f64>() / cells as f64;
            let squares: f64 = areas.iter().map(|a| (a - mean) * (a - mean)).sum();
            AreaMean { sides, cells, relative_area: mean, deviation: (squares / cells as f64).sqrt() }
        })
        .collect();
    let fit = slope(
        points.iter().map(|p| (f64::from(p.sides) - mean_sides, p.relative_area - 1.0, p.cells as f64)),
    );
    Lewis { points, slope: fit }
}

/// C(r) for r from 1 to `reach`, as far as there are pairs. Paths may pass through cells that do not count. Empty where all
/// cells have as many sides.
#[must_use]
pub fn side_correlations(pattern: &CellPattern, reach: usize) -> Vec<DistanceCorrelation> {
    let Some((mean, second)) = moments(pattern).filter(|(_, second)| *second > 1e-12) else {
        return Vec::new();
    };
    let mut sums = vec![(0_usize, 0.0); reach + 1];
    for (id, n) in counted(pattern) {
        for (other, distance) in cells_within(pattern, id, reach) {
            let complete = pattern.cells[other].status == CellStatus::Complete;
            if let Some(m) = pattern.cells[other].sides.filter(|_| complete) {
                sums[distance].0 += 1;
                sums[distance].1 += (f64::from(n) - mean) * (f64::from(m) - mean);
            }
        }
    }
    let found = sums.into_iter().enumerate().skip(1).filter(|(_, (pairs, _))| *pairs > 0);
    found
        .map(|(distance, (pairs, sum))| DistanceCorrelation {
            distance,
            // Each pair was met from both ends.
            pairs: pairs / 2,
            correlation: sum / pairs as f64 / second,
        })
        .collect()
}

/// The cells at most `reach` walls from a cell, itself included, with their distances; nearest first.
#[must_use]
pub fn cells_within(pattern: &CellPattern, start: CellId, reach: usize) -> Vec<(CellId, usize)> {
    let mut seen: IndexVec<CellId, bool> = IndexVec::from_elem(false, pattern.cells.len());
    seen[start] = true;
    let mut found = vec![(start, 0)];
    let mut next = 0;
    while let Some((id, distance)) = found.get(next).copied() {
        next += 1;
        if distance == reach {
            break;
        }
        for other in pattern.cells[id].walls.iter().filter_map(|wall| wall.neighbour) {
            if !seen[other] {
                seen[other] = true;
                found.push((other, distance + 1));
            }
        }
    }
    debug_assert!(found.iter().all(|(id, _)| id.index() < pattern.cells.len()));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellation::testing::{flipped_torus, hexagons};

    #[test]
    fn hexagons_have_six_sided_neighbours_and_nothing_to_fit() {
        let pattern = hexagons(9, 8, 0.0);
        let law = aboav_weaire(&pattern);
        assert_eq!(law.a, None);
        assert_eq!(law.points.len(), 1);
        assert!((law.points[0].mean_sides_of_neighbours - 6.0).abs() < 1e-12);
        assert_eq!(lewis(&pattern).slope, None);
        assert!(side_correlations(&pattern, 3).is_empty());
    }

    #[test]
    fn weaires_sum_rule_holds_on_a_closed_pattern() {
        // Σ p(n) n m(n) = ⟨n²⟩ = ⟨n⟩² + μ₂: each cell is counted once by each of its neighbours.
        let pattern = flipped_torus(12, 12, 40, 3);
        let (mean, second) = moments(&pattern).unwrap_or_default();
        let counts = pattern.side_counts();
        let sum: f64 = aboav_weaire(&pattern)
            .points
            .iter()
            .map(|p| counts[p.sides as usize] as f64 * f64::from(p.sides) * p.mean_sides_of_neighbours)
            .sum();
        assert!((sum / 144.0 - (mean * mean + second)).abs() < 1e-9);
    }

    #[test]
    fn flips_make_neighbours_compensate() {
        let pattern = flipped_torus(20, 20, 30, 1);
        let correlations = side_correlations(&pattern, 4);
        assert_eq!(correlations.len(), 4);
        assert_eq!(correlations[0].pairs, 3 * 400);
        assert!(correlations[0].correlation < -0.1, "{correlations:?}");
        assert!(correlations[3].correlation.abs() < 0.1, "{correlations:?}");
        assert!(aboav_weaire(&pattern).a.is_some_and(|a| a > 0.5));
    }

    #[test]
    fn lewis_slope_of_areas_that_obey_the_law() {
        let mut pattern = flipped_torus(10, 10, 20, 2);
        for cell in pattern.cells.iter_mut() {
            cell.area = 1.0 + 0.25 * (f64::from(cell.sides.unwrap_or(6)) - 6.0);
        }
        assert!(lewis(&pattern).slope.is_some_and(|slope| (slope - 0.25).abs() < 1e-12));
    }
}
