//! Patterns for tests.

use super::pattern::{Cell, CellId, CellPattern, CellStatus, CellWall, Surroundings};
use crate::index::{Id, IndexVec};
use glam::{DVec2, DVec3, IVec3};

/// A patch of regular hexagons of unit pitch, whose rows are turned by `turn` radians; the outermost ones are cut.
pub(crate) fn hexagons(columns: usize, rows: usize, turn: f64) -> CellPattern {
    let place = |c: usize, r: usize| {
        let x = c as f64 + 0.5 * (r % 2) as f64;
        DVec2::from_angle(turn).rotate(DVec2::new(x, r as f64 * 0.75_f64.sqrt()))
    };
    let centres: Vec<DVec2> = (0..rows).flat_map(|r| (0..columns).map(move |c| place(c, r))).collect();
    let cells: IndexVec<CellId, Cell> = centres
        .iter()
        .map(|centre| {
            let mut near: Vec<(f64, usize)> = centres
                .iter()
                .enumerate()
                .filter(|(_, other)| (other.distance(*centre) - 1.0).abs() < 1e-6)
                .map(|(index, other)| ((*other - *centre).to_angle(), index))
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let wall = |(_, index): &(f64, usize)| CellWall {
                neighbour: Some(CellId::from_index(*index)),
                shift: IVec3::ZERO,
                length: 1.0 / 3.0_f64.sqrt(),
            };
            let whole = near.len() == 6;
            Cell {
                position: centre.extend(0.0),
                normal: DVec3::Z,
                sides: whole.then_some(6),
                status: if whole { CellStatus::Complete } else { CellStatus::Cut },
                confidence: 1.0,
                area: 0.75_f64.sqrt(),
                gauss_curvature: None,
                walls: near.iter().map(wall).collect(),
            }
        })
        .collect();
    match CellPattern::new("px", Surroundings::Open, cells) {
        Ok(pattern) => pattern,
        Err(defects) => panic!("{defects:?}"),
    }
}

/// Hexagons on a torus after random flips.
pub(crate) fn flipped_torus(columns: usize, rows: usize, flips: usize, seed: u64) -> CellPattern {
    match super::flipped_hexagons(columns, rows, flips, seed) {
        Ok(pattern) => pattern,
        Err(defects) => panic!("{defects:?}"),
    }
}
