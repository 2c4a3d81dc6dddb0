//! Places brought back onto the constraints that hold them, by Newton's method along the least motion.

use crate::evolver::{datafile::Side, language::formula::Bound};
use glam::DVec3;

/// A constraint with the variables' values put in.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    pub(crate) formula: Bound,
    pub(crate) side: Side,
}

/// Where a return to constraints ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Returned {
    pub(crate) place: DVec3,
    /// One bit for each constraint that is one-sided and touched.
    pub(crate) hits: u32,
    /// Whether the place is a number: where steps ran out it lies as near as they got.
    pub(crate) finite: bool,
}

/// Steps and tolerance of the return to constraints: those of Surface Evolver, so that both stop at the same place.
const STEPS: usize = 10;
const TOLERANCE: f64 = 1e-12;

/// Brings `place` onto all `walls`; one-sided ones hold from the side that is not allowed, or where `hits` says that they
/// were touched.
pub(crate) fn return_to<'a>(
    walls: impl Iterator<Item = &'a Wall> + Clone,
    mut hits: u32,
    place: DVec3,
) -> Returned {
    let mut place = place;
    let mut rows: Vec<(DVec3, f64)> = Vec::new();
    for _ in 0..STEPS {
        rows.clear();
        let mut total = 0.0;
        for (at, wall) in walls.clone().enumerate() {
            let jet = wall.formula.jet(place);
            let free = match wall.side {
                Side::On => false,
                Side::NonNegative => jet.value > TOLERANCE,
                Side::NonPositive => jet.value < -TOLERANCE,
            };
            let bit = 1 << at.min(31);
            if free && hits & bit == 0 {
                continue;
            }
            if wall.side != Side::On {
                hits |= bit;
            }
            total += jet.value.abs();
            rows.push((jet.gradient, jet.value));
        }
        if total < TOLERANCE {
            return Returned { place, hits, finite: true };
        }
        place -= least_motion(&rows);
    }
    Returned { place, hits, finite: place.is_finite() }
}

/// The least motion that changes the values of all rows by what they say.
fn least_motion(rows: &[(DVec3, f64)]) -> DVec3 {
    rows.iter().zip(multipliers(rows)).map(|((gradient, _), factor)| factor * *gradient).sum()
}

/// Factors `c` with `Σ cⱼ gⱼ·gᵢ = vᵢ`, by Gauss elimination of up to three rows; zero where rows depend on each other.
#[allow(clippy::needless_range_loop, reason = "elimination goes by rows and columns")]
pub(crate) fn multipliers(rows: &[(DVec3, f64)]) -> Vec<f64> {
    let n = rows.len().min(3);
    let mut matrix = [[0.0; 4]; 3];
    for (row, (gradient, value)) in matrix.iter_mut().zip(&rows[..n]) {
        for (entry, (other, _)) in row.iter_mut().zip(&rows[..n]) {
            *entry = gradient.dot(*other);
        }
        row[3] = *value;
    }
    let mut dropped = [false; 3];
    for pivot in 0..n {
        let size = rows[pivot].0.length_squared();
        if matrix[pivot][pivot] <= 1e-14 * size || size <= 0.0 {
            dropped[pivot] = true;
            continue;
        }
        for row in 0..n {
            if row != pivot && !dropped[row] {
                let factor = matrix[row][pivot] / matrix[pivot][pivot];
                for column in 0..4 {
                    matrix[row][column] -= factor * matrix[pivot][column];
                }
            }
        }
    }
    (0..rows.len()).map(|i| if i < n && !dropped[i] { matrix[i][3] / matrix[i][i] } else { 0.0 }).collect()
}
