//! The piece of the periodic surface that is printed: a box whose faces are mirror planes.

use super::recipe::{CellSection, Part};
use crate::mesh::Grid;
use glam::DVec3;
use serde::Serialize;

/// A box of half periods of the nodal P-surface. All its faces are mirror planes, which every wall meets at right angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Region {
    /// The lower corner, in half periods.
    pub low: [i32; 3],
    /// The upper corner, in half periods.
    pub high: [i32; 3],
}

impl Region {
    /// The region of a recipe's cell section; its upper faces are lattice planes, its lower faces too unless it has half a
    /// cell more.
    ///
    /// # Errors
    /// What is wrong with the block.
    pub fn new(cell: &CellSection) -> Result<Self, String> {
        let cells = match (cell.part, cell.block) {
            (Part::Half, None) => [1.0, 1.0, 0.5],
            (Part::Whole, None) => [1.0, 1.0, 1.0],
            (Part::Octant, None) => [0.5, 0.5, 0.5],
            (Part::Block, Some(block)) => block,
            (Part::Block, None) => return Err("part = \"block\" needs block = [nx, ny, nz]".to_owned()),
            (_, Some(_)) => return Err("block is only for part = \"block\"".to_owned()),
        };
        let mut high = [0; 3];
        for axis in 0..3 {
            high[axis] = half_periods(cells[axis]).ok_or_else(|| {
                format!("a block has 0.5 to 50 cells along each axis, in steps of 0.5, not {}", cells[axis])
            })?;
        }
        // An odd number of half periods begins on the plane through a cell's centre.
        Ok(Self { low: high.map(|n| n % 2), high: high.map(|n| n + n % 2) })
    }

    /// The lower corner in units of the period.
    #[must_use]
    pub fn low(&self) -> DVec3 {
        DVec3::from_array(self.low.map(|n| 0.5 * f64::from(n)))
    }

    /// The upper corner in units of the period.
    #[must_use]
    pub fn high(&self) -> DVec3 {
        DVec3::from_array(self.high.map(|n| 0.5 * f64::from(n)))
    }

    /// The extent in units of the period.
    #[must_use]
    pub fn size(&self) -> DVec3 {
        self.high() - self.low()
    }

    /// The marching grid with `samples` cells per period (rounded up to an even number, so that mirror planes are planes of
    /// the grid), in units of the period.
    #[must_use]
    pub fn grid(&self, samples: u32) -> Grid {
        let half = samples.div_ceil(2).max(1) as usize;
        let cells = std::array::from_fn(|axis| half * self.halves(axis));
        Grid { low: self.low(), high: self.high(), cells }
    }

    fn halves(&self, axis: usize) -> usize {
        usize::try_from(self.high[axis] - self.low[axis]).unwrap_or(0)
    }

    /// The Euler number of the sheet `Φ = level`, |level| < 1, in this box, counted from how the sheet passes through the
    /// octants: one disc in each, across one arc in each octant face, and one point on each octant edge between a corner
    /// with one odd coordinate and one with two.
    #[must_use]
    pub fn sheet_euler_number(&self) -> i64 {
        let [x, y, z] = [0, 1, 2].map(|axis| i64::from(self.high[axis] - self.low[axis]));
        let discs = x * y * z;
        let arcs = (x + 1) * y * z + x * (y + 1) * z + x * y * (z + 1);
        let points: i64 = (0..3).map(|axis| self.crossed_edges(axis)).sum();
        points - arcs + discs
    }

    /// How many octant edges along `axis` the sheet crosses: those whose ends have one and two odd coordinates, which is
    /// where the other two coordinates are one odd, one even.
    fn crossed_edges(&self, axis: usize) -> i64 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mixed = (self.low[u]..=self.high[u])
            .flat_map(|a| (self.low[v]..=self.high[v]).map(move |b| (a + b) % 2))
            .filter(|&parity| parity != 0)
            .count();
        i64::from(self.high[axis] - self.low[axis]) * i64::try_from(mixed).unwrap_or(i64::MAX)
    }
}

/// `cells` as a number of half periods, if it is one between 1 and 100.
#[expect(clippy::cast_possible_truncation, reason = "checked to be between 1 and 100")]
fn half_periods(cells: f64) -> Option<i32> {
    let halves = (2.0 * cells).round();
    ((halves - 2.0 * cells).abs() < 1e-9 && (1.0..=100.0).contains(&halves)).then_some(halves as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(part: Part, block: Option<[f64; 3]>) -> Result<Region, String> {
        Region::new(&CellSection { period: 100.0, part, block })
    }

    #[test]
    fn parts_have_the_euler_numbers_of_their_sheets() -> Result<(), String> {
        // A hexagon; an annulus; a sphere with six holes; per further cell χ falls by 4, each shared face mends one hole.
        assert_eq!(region(Part::Octant, None)?.sheet_euler_number(), 1);
        assert_eq!(region(Part::Half, None)?.sheet_euler_number(), 0);
        assert_eq!(region(Part::Whole, None)?.sheet_euler_number(), -4);
        assert_eq!(region(Part::Block, Some([2.0, 1.0, 1.0]))?.sheet_euler_number(), -8);
        Ok(())
    }

    #[test]
    fn half_cells_begin_on_the_plane_through_the_centre() -> Result<(), String> {
        let half = region(Part::Half, None)?;
        assert_eq!((half.low, half.high), ([0, 0, 1], [2, 2, 2]));
        let octant = region(Part::Octant, None)?;
        assert_eq!((octant.low, octant.high), ([1; 3], [2; 3]));
        assert_eq!(half.grid(255).cells, [256, 256, 128]);
        Ok(())
    }

    #[test]
    fn blocks_that_are_none_are_refused() {
        for block in
            [[0.0, 1.0, 1.0], [1.0, 1.2, 1.0], [1.0, 1.0, f64::NAN], [-1.0, 1.0, 1.0], [51.0, 1.0, 1.0]]
        {
            assert!(region(Part::Block, Some(block)).is_err(), "{block:?}");
        }
        assert!(region(Part::Block, None).is_err() && region(Part::Half, Some([1.0; 3])).is_err());
    }
}
