//! What shuffling patches loses: the links between cells on two sides of a border between patches.
//!
//! Cells near one another are alike in what they differ by from the mean, so that the variance of a share over a whole
//! pattern is C₀ + Σ C over all neighbours, with C₀ the variance of one cell and C the covariance of two. Shuffled patches
//! keep only the terms within a patch. The ratio of the two variances says how much wider the differences of shuffled
//! patches would be if patches kept their links. The covariances come from all cells of both kinds, as the null hypothesis
//! takes them for one process; those of cells up to [`REACH`] walls apart are counted (W. Newey and K. West, Econometrica
//! 55, 1987, for time series; T. Conley, J. Econometrics 92, 1999, for patterns in the plane).

use super::tally::CLASSES;
use crate::tessellation::{CellId, CellPattern, Defects, cells_within};
use std::collections::BTreeMap;

/// Walls between cells whose covariance is counted: the fives of a T1 are two apart. Covariances further away are small
/// against their scatter.
const REACH: usize = 2;

/// Bounds of the ratio of the variances: beyond them covariances of a few cells are scatter.
const BOUNDS: [f64; 2] = [0.75, 3.0];

/// A complete cell as far as it is counted.
pub(super) struct Counted {
    /// Its number of sides, or the last class.
    pub(super) class: usize,
    /// Whether it is the cell of fewer sides of a 5–7 pair.
    pub(super) leads_pair: bool,
}

/// Two cells at most [`REACH`] walls apart.
struct Link {
    cells: [usize; 2],
    distance: usize,
    /// Whether they are in two units.
    crosses: bool,
}

/// Complete cells of both kinds and their links.
#[derive(Default)]
pub(super) struct Links {
    cells: Vec<Counted>,
    links: Vec<Link>,
}

impl Links {
    /// Adds the complete cells of a pattern; `unit_of` says which unit each belongs to.
    pub(super) fn add(&mut self, pattern: &CellPattern, found: &Defects, unit_of: &BTreeMap<CellId, usize>) {
        let mut place = BTreeMap::new();
        for (id, cell) in pattern.complete() {
            let Some(sides) = cell.sides else { continue };
            place.insert(id, self.cells.len());
            self.cells.push(Counted { class: (sides as usize).min(CLASSES - 1), leads_pair: false });
        }
        for at in found.pairs.iter().filter_map(|pair| place.get(&pair.few)) {
            self.cells[*at].leads_pair = true;
        }
        for (one, at) in &place {
            for (two, distance) in cells_within(pattern, *one, REACH) {
                let Some(other) = place.get(&two).filter(|_| *one < two) else { continue };
                let crosses = unit_of.get(one) != unit_of.get(&two);
                self.links.push(Link { cells: [*at, *other], distance, crosses });
            }
        }
    }

    /// By which factor differences of means of `value` between shuffled units are to be widened for the links that units
    /// lose: the root of the ratio of the variances with and without them.
    pub(super) fn widening(&self, value: impl Fn(&Counted) -> f64) -> f64 {
        let count = self.cells.len() as f64;
        let mean = self.cells.iter().map(&value).sum::<f64>() / count;
        let from_mean: Vec<f64> = self.cells.iter().map(|cell| value(cell) - mean).collect();
        let own = from_mean.iter().map(|e| e * e).sum::<f64>() / count;
        let mut rings = [Ring::default(); REACH];
        for link in &self.links {
            let ring = &mut rings[link.distance - 1];
            ring.links += 1.0;
            ring.crossing += f64::from(u8::from(link.crosses));
            ring.covariance += from_mean[link.cells[0]] * from_mean[link.cells[1]];
        }
        // Each link is met from both ends. Differences from the mean of the same cells add up to nothing, which makes each
        // product smaller by the variance of the sum over the square of the count.
        let neighbours = |ring: &Ring| 2.0 * ring.links / count;
        let plain: f64 = own + rings.iter().map(|ring| 2.0 * ring.covariance / count).sum::<f64>();
        let counted = 1.0 + rings.iter().map(neighbours).sum::<f64>();
        let whole = plain / (1.0 - (counted / count).min(0.5));
        let linked = |ring: &Ring| 2.0 * ring.covariance / count + neighbours(ring) * whole / count;
        let lost: f64 = rings
            .iter()
            .filter(|ring| ring.links > 0.0)
            .map(|ring| linked(ring) * ring.crossing / ring.links)
            .sum();
        let kept = whole - lost;
        let [least, most] = BOUNDS;
        // Without scatter there is nothing to widen.
        if own <= 0.0 {
            1.0
        } else if kept > 0.0 {
            (whole / kept).clamp(least, most).sqrt()
        } else {
            most.sqrt()
        }
    }
}

#[derive(Clone, Copy, Default)]
struct Ring {
    links: f64,
    crossing: f64,
    covariance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellation::{defects, flipped_hexagons};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Hexagons on a torus of `side` by `side` cells with the classes given, in square patches of `patch` by `patch`.
    fn links(side: usize, patch: usize, class: impl Fn(usize, usize) -> usize) -> Result<Links, String> {
        let pattern = flipped_hexagons(side, side, 0, 1).map_err(|d| format!("{d:?}"))?;
        let place = |at: usize| (at % side, at / side);
        let unit_of = pattern.complete().enumerate().map(|(at, (id, _))| {
            let (column, row) = place(at);
            (id, row / patch * side + column / patch)
        });
        let mut links = Links::default();
        links.add(&pattern, &defects(&pattern), &unit_of.collect());
        for (at, cell) in links.cells.iter_mut().enumerate() {
            let (column, row) = place(at);
            cell.class = class(column, row);
        }
        Ok(links)
    }

    fn is_hexagon(cell: &Counted) -> f64 {
        f64::from(u8::from(cell.class == 6))
    }

    #[test]
    fn nothing_is_widened_where_nothing_crosses_or_varies() -> Result<(), String> {
        let one_unit = links(12, 12, |column, _| 5 + column / 6)?;
        assert!((one_unit.widening(is_hexagon) - 1.0).abs() < 1e-12);
        let all_alike = links(12, 3, |_, _| 6)?;
        assert!((all_alike.widening(is_hexagon) - 1.0).abs() < 1e-12);
        Ok(())
    }

    #[test]
    fn twins_that_patches_part_are_made_up_for() -> Result<(), String> {
        // Pairs of equal cells side by side, fives and sixes by chance: the variance of a sum is twice that of independent
        // cells. Patches of one cell part all twins.
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let drawn: Vec<usize> = (0..20 * 40).map(|_| random.random_range(5..=6)).collect();
        let twin = |column: usize, row: usize| drawn[row * 20 + column / 2];
        let parted = links(40, 1, twin)?.widening(is_hexagon).powi(2);
        // The covariances of 18 neighbours scatter by 1/√(1600·9) each way, which makes ± 0.15 in sum, and twice that of twins.
        assert!((parted - 2.0).abs() < 0.6, "{parted}");
        // Of the walls of a patch 20 cells wide about one in thirteen crosses its border.
        let kept = links(40, 20, twin)?.widening(is_hexagon).powi(2);
        assert!((1.0..1.15).contains(&kept), "{kept}");
        Ok(())
    }
}
