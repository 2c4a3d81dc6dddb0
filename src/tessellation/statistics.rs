//! How many sides cells have, and how well they are ordered.
//!
//! p(n) and its second moment μ₂ = Σ p(n)(n − ⟨n⟩)² are the usual measures of topological disorder (D. Weaire and
//! N. Rivier, "Soap, cells and statistics", Contemp. Phys. 25, 1984). The bond-orientational order of a cell is
//! ψ₆ = ⟨exp(6iθ)⟩ over the directions θ of its neighbours (B. Halperin and D. Nelson, Phys. Rev. Lett. 41, 1978).

use super::pattern::{CellId, CellPattern, CellStatus};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Figures of the complete cells of a pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SideStatistics {
    /// Complete cells.
    pub complete: usize,
    /// Cells that are cut.
    pub cut: usize,
    /// Cells that are uncertain.
    pub uncertain: usize,
    /// Complete cells with 0, 1, 2 … sides.
    pub cells_by_sides: Vec<usize>,
    /// Mean number of sides; none without complete cells.
    pub mean_sides: Option<f64>,
    /// Second moment of the number of sides about its mean, μ₂.
    pub second_moment: Option<f64>,
    /// Σ(6 − n), the topological charge.
    pub charge: i64,
    /// Mean of |ψ₆| over the complete cells: 1 for regular hexagons.
    pub hexatic_order: Option<f64>,
    /// |⟨ψ₆⟩|: 1 if all cells point the same way too. Only in the plane, where directions can be compared.
    pub common_orientation: Option<f64>,
    /// The common direction of neighbours, in degrees from x towards y, between 0 and 60. Only in the plane.
    pub orientation_deg: Option<f64>,
}

/// Counts and averages over a pattern.
#[must_use]
pub fn side_statistics(pattern: &CellPattern) -> SideStatistics {
    let cells_by_sides = pattern.side_counts();
    let of_status = |status| pattern.cells.iter().filter(|c| c.status == status).count();
    let (mean_sides, second_moment) = moments(&cells_by_sides);
    let orders: Vec<DVec2> = pattern.complete().filter_map(|(id, _)| hexatic(pattern, id)).collect();
    let count = orders.len() as f64;
    let mean = |sum: f64| (count > 0.0).then(|| sum / count);
    let flat = pattern.cells.iter().all(|c| c.normal.cross(DVec3::Z).length() < 1e-9);
    let common = orders.iter().sum::<DVec2>();
    SideStatistics {
        complete: of_status(CellStatus::Complete),
        cut: of_status(CellStatus::Cut),
        uncertain: of_status(CellStatus::Uncertain),
        cells_by_sides,
        mean_sides,
        second_moment,
        charge: pattern.charge(),
        hexatic_order: mean(orders.iter().map(|o| o.length()).sum()),
        common_orientation: mean(common.length()).filter(|_| flat),
        orientation_deg: (flat && count > 0.0)
            .then(|| common.to_angle().rem_euclid(std::f64::consts::TAU).to_degrees() / 6.0),
    }
}

/// Mean and second moment of a distribution given by counts.
fn moments(counts: &[usize]) -> (Option<f64>, Option<f64>) {
    let total = counts.iter().sum::<usize>() as f64;
    if total < 0.5 {
        return (None, None);
    }
    let average = |f: &dyn Fn(f64) -> f64| {
        counts.iter().enumerate().map(|(n, c)| f(n as f64) * *c as f64).sum::<f64>() / total
    };
    let mean = average(&|n| n);
    (Some(mean), Some(average(&|n| (n - mean) * (n - mean))))
}

/// ψ₆ of a cell as a vector; directions are measured in its tangent plane, from x towards y where that is the xy-plane.
/// `None` where a neighbour is missing or the pattern is periodic there (a shift has no length in it).
#[must_use]
pub fn hexatic(pattern: &CellPattern, id: CellId) -> Option<DVec2> {
    let cell = &pattern.cells[id];
    let along = DVec3::X.reject_from_normalized(cell.normal).try_normalize()?;
    let across = if cell.normal.z.abs() > 0.999_999 { DVec3::Y } else { cell.normal.cross(along) };
    let mut sum = DVec2::ZERO;
    for wall in &cell.walls {
        let neighbour = wall.neighbour.filter(|_| wall.shift == glam::IVec3::ZERO)?;
        let step = pattern.cells[neighbour].position - cell.position;
        sum += DVec2::from_angle(6.0 * DVec2::new(step.dot(along), step.dot(across)).to_angle());
    }
    (!cell.walls.is_empty()).then(|| sum / cell.walls.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellation::testing::hexagons;

    #[test]
    fn hexagons_are_in_perfect_order() {
        for turn in [0.0_f64, 0.2, 0.9] {
            let pattern = hexagons(6, 5, turn);
            let statistics = side_statistics(&pattern);
            assert_eq!(statistics.cells_by_sides, [0, 0, 0, 0, 0, 0, 12]);
            assert_eq!(statistics.charge, 0);
            assert!(statistics.mean_sides.is_some_and(|m| (m - 6.0).abs() < 1e-12));
            assert!(statistics.second_moment.is_some_and(|m| m.abs() < 1e-12));
            assert!(statistics.hexatic_order.is_some_and(|o| (o - 1.0).abs() < 1e-9));
            assert!(statistics.common_orientation.is_some_and(|o| (o - 1.0).abs() < 1e-9));
            let expected = turn.to_degrees().rem_euclid(60.0);
            let found = statistics.orientation_deg.unwrap_or(f64::NAN);
            let off = (found - expected).rem_euclid(60.0);
            assert!(off.min(60.0 - off) < 1e-6, "turned by {expected}, found {found}");
        }
    }

    #[test]
    fn second_moment_of_a_known_distribution() {
        // Two fives, six sixes, two sevens: mean 6, μ₂ = (2 + 2)/10.
        let (mean, moment) = moments(&[0, 0, 0, 0, 0, 2, 6, 2]);
        assert!(mean.is_some_and(|m| (m - 6.0).abs() < 1e-12));
        assert!(moment.is_some_and(|m| (m - 0.4).abs() < 1e-12));
        assert_eq!(moments(&[]), (None, None));
    }
}
