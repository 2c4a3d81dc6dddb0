//! Where the cells of a synthetic comb are.

use crate::{
    comb::{
        kinds::median,
        triangulation::{Delaunay, Edge, circumcentre, voronoi_length},
    },
    tessellation::CellPattern,
};
use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Margin of a random comb around the picture, in pitches.
const MARGIN: f64 = 4.0;
/// Cells per grain at disorder 1; at 0.5 about a tenth of the cells then lie on grain boundaries and are no hexagons.
const CELLS_PER_GRAIN: f64 = 55.0;
/// Greatest step of a cell from its place in the lattice at disorder 1, in pitches.
const JITTER: f64 = 0.2;
/// Steps towards the centre of the Voronoi polygon: bees build walls of nearly equal length.
const LLOYD_STEPS: usize = 10;
/// Cells of a pattern whose normal is turned further than this from the mean are left out (cosine).
const FACING: f64 = 0.5;

/// Places of cells, with the median distance of neighbours as unit and the middle as origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrangement {
    centres: Vec<DVec2>,
}

/// Why a pattern gives no arrangement.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ArrangementError {
    /// Too few cells face one way.
    #[error("only {0} cells of the pattern face the camera; at least 7 are needed")]
    TooFew(usize),
}

/// A cell as it is drawn.
#[derive(Clone, Debug)]
pub(super) struct DrawnCell {
    /// Centre on the comb.
    pub(super) centre: DVec2,
    /// Corners on the comb, in order around it; empty at the rim of the arrangement.
    pub(super) corners: Vec<DVec2>,
    /// The cells behind its walls, in ascending order.
    pub(super) neighbours: Vec<usize>,
    /// Length of its shortest wall.
    pub(super) shortest_wall: f64,
    /// Length by which two of its neighbours' neighbours miss touching it, or the reverse: the least of all near misses.
    pub(super) nearest_miss: f64,
}

impl Arrangement {
    /// A random comb that fills a picture of `width` x `height` pitches: grains of hexagons of different orientation, and
    /// random places in the given share of the area, evened out by Lloyd's steps. About a tenth of the cells are no hexagons
    /// at `disorder` 0.5; none is at 0.
    #[must_use]
    pub fn random(width: f64, height: f64, disorder: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let half = DVec2::new(width, height) / 2.0 + DVec2::splat(MARGIN);
        let grains = 1 + crate::comb::plane::pixels(4.0 * half.x * half.y * disorder / CELLS_PER_GRAIN);
        let seeds: Vec<(DVec2, f64)> = (0..grains)
            .map(|_| {
                let at = half * DVec2::new(random.random_range(-1.0..1.0), random.random_range(-1.0..1.0));
                (at, random.random_range(0.0..std::f64::consts::FRAC_PI_3))
            })
            .collect();
        let nearest_grain = |point: DVec2| {
            (0..grains).min_by(|a, b| {
                seeds[*a].0.distance_squared(point).total_cmp(&seeds[*b].0.distance_squared(point))
            })
        };
        let mut centres = Vec::new();
        for (grain, (_, turn)) in seeds.iter().enumerate() {
            for point in hexagonal(half, *turn) {
                if nearest_grain(point) == Some(grain) {
                    let step = DVec2::new(random.random_range(-1.0..1.0), random.random_range(-1.0..1.0));
                    centres.push(point + step * (0.02 + JITTER * disorder));
                }
            }
        }
        let mut arrangement = Self { centres };
        arrangement.thin(0.55);
        for _ in 0..LLOYD_STEPS {
            arrangement.even_out();
        }
        arrangement
    }

    /// The cells of a pattern that face its mean normal, seen along it.
    ///
    /// # Errors
    /// Fewer than seven cells face one way.
    pub fn from_pattern(pattern: &CellPattern) -> Result<Self, ArrangementError> {
        let mean = pattern.cells.iter().map(|c| c.normal).sum::<DVec3>();
        let normal = mean.try_normalize().unwrap_or(DVec3::Z);
        let along = DVec3::X.reject_from_normalized(normal).try_normalize().unwrap_or(DVec3::Y);
        let across = if normal.abs_diff_eq(DVec3::Z, 1e-9) { DVec3::Y } else { normal.cross(along) };
        let facing = pattern.cells.iter().filter(|c| c.normal.dot(normal) > FACING);
        let flat: Vec<DVec2> =
            facing.map(|c| DVec2::new(c.position.dot(along), c.position.dot(across))).collect();
        if flat.len() < 7 {
            return Err(ArrangementError::TooFew(flat.len()));
        }
        let middle = flat.iter().sum::<DVec2>() / flat.len() as f64;
        let pitch = median(nearest_distances(&flat).into_iter());
        Ok(Self { centres: flat.iter().map(|p| (*p - middle) / pitch.max(1e-12)).collect() })
    }

    /// Width and height in pitches.
    #[must_use]
    pub fn extent(&self) -> DVec2 {
        let low = self.centres.iter().copied().reduce(DVec2::min).unwrap_or_default();
        let high = self.centres.iter().copied().reduce(DVec2::max).unwrap_or_default();
        high - low
    }

    /// Removes cells that are nearer than this to an earlier one: two grains overlap where they meet.
    fn thin(&mut self, least: f64) {
        let mut grid = crate::comb::grid::Grid::new(1.0);
        let mut kept = Vec::new();
        for centre in &self.centres {
            if grid.nearest(*centre, least).is_none() {
                grid.insert(*centre, kept.len());
                kept.push(*centre);
            }
        }
        self.centres = kept;
    }

    /// Moves each cell halfway to the centre of its Voronoi polygon.
    fn even_out(&mut self) {
        let cells = self.cells();
        for (centre, cell) in self.centres.iter_mut().zip(&cells) {
            if let Some(middle) = centroid(&cell.corners) {
                *centre = centre.lerp(middle, 0.5);
            }
        }
    }

    /// The Voronoi cells.
    pub(super) fn cells(&self) -> Vec<DrawnCell> {
        let delaunay = Delaunay::of(&self.centres);
        let neighbours = delaunay.neighbours();
        let mut corners = vec![Vec::new(); self.centres.len()];
        for triangle in delaunay.triangles() {
            let [a, b, c] = triangle.map(|i| self.centres[i]);
            if let Some(corner) = circumcentre(a, b, c) {
                triangle.iter().for_each(|i| corners[*i].push(corner));
            }
        }
        let mut rim = vec![false; self.centres.len()];
        let edges = delaunay.edges();
        for edge in edges.iter().filter(|edge| edge.across().count() < 2) {
            rim[edge.ends.0] = true;
            rim[edge.ends.1] = true;
        }
        let near_misses = self.near_misses(&edges);
        (0..self.centres.len())
            .map(|i| self.cell(i, &neighbours[i], corners[i].clone(), rim[i], near_misses[i]))
            .collect()
    }

    fn cell(
        &self,
        index: usize,
        neighbours: &[usize],
        mut corners: Vec<DVec2>,
        rim: bool,
        miss: f64,
    ) -> DrawnCell {
        let centre = self.centres[index];
        corners.sort_by(|a, b| (*a - centre).to_angle().total_cmp(&(*b - centre).to_angle()));
        let walls = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| a.distance(*b));
        DrawnCell {
            centre,
            neighbours: neighbours.to_vec(),
            shortest_wall: walls.fold(f64::INFINITY, f64::min),
            nearest_miss: miss,
            corners: if rim { Vec::new() } else { corners },
        }
    }

    /// For each cell, the length of the shortest wall across whose ends it lies: were that wall gone, it would have a side
    /// more.
    fn near_misses(&self, edges: &[Edge]) -> Vec<f64> {
        let mut least = vec![f64::INFINITY; self.centres.len()];
        for edge in edges {
            let [Some(c), Some(d)] = edge.thirds else { continue };
            let at = |cell: usize| self.centres[cell];
            if let Some(length) = voronoi_length([edge.ends.0, edge.ends.1].map(at), [c, d].map(at)) {
                for third in edge.across() {
                    least[third] = least[third].min(length);
                }
            }
        }
        least
    }
}

/// Points of a hexagonal lattice of unit pitch within ±`half`, turned.
fn hexagonal(half: DVec2, turn: f64) -> Vec<DVec2> {
    let reach = half.length().ceil();
    let rows = crate::comb::plane::pixels(2.0 * reach / 0.75_f64.sqrt()) + 1;
    let columns = crate::comb::plane::pixels(2.0 * reach) + 1;
    let place = |row: usize, column: usize| {
        let x = column as f64 - reach + 0.5 * (row % 2) as f64;
        DVec2::from_angle(turn).rotate(DVec2::new(x, row as f64 * 0.75_f64.sqrt() - reach))
    };
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| place(row, column)))
        .filter(|p| p.abs().cmple(half).all())
        .collect()
}

fn nearest_distances(points: &[DVec2]) -> Vec<f64> {
    let neighbours = Delaunay::of(points).neighbours();
    points
        .iter()
        .zip(&neighbours)
        .filter_map(|(p, near)| near.iter().map(|n| points[*n].distance(*p)).min_by(f64::total_cmp))
        .collect()
}

/// Centre of mass of a polygon; `None` of an empty one.
fn centroid(corners: &[DVec2]) -> Option<DVec2> {
    let pairs = || corners.iter().zip(corners.iter().cycle().skip(1));
    let twice_area: f64 = pairs().map(|(a, b)| a.perp_dot(*b)).sum();
    let sum: DVec2 = pairs().map(|(a, b)| (*a + *b) * a.perp_dot(*b)).sum();
    (twice_area.abs() > 1e-12).then(|| sum / (3.0 * twice_area))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_disorder_all_are_hexagons() {
        let cells = Arrangement::random(12.0, 10.0, 0.0, 3).cells();
        let inner: Vec<&DrawnCell> =
            cells.iter().filter(|c| c.centre.abs().cmple(DVec2::new(6.0, 5.0)).all()).collect();
        assert!(inner.len() > 100);
        assert!(inner.iter().all(|c| c.neighbours.len() == 6 && c.corners.len() == 6));
    }

    #[test]
    fn disorder_makes_defects_of_no_net_charge_to_speak_of() {
        let cells = Arrangement::random(60.0, 60.0, 0.5, 1).cells();
        let inner: Vec<&DrawnCell> =
            cells.iter().filter(|c| c.centre.abs().cmple(DVec2::splat(30.0)).all()).collect();
        let odd = inner.iter().filter(|c| c.neighbours.len() != 6).count();
        let share = odd as f64 / inner.len() as f64;
        assert!((0.1..0.5).contains(&share), "{share}");
        // Within a patch the charge is a sum over its rim only: of the order of the root of the rim's length.
        let charge: i64 = inner.iter().map(|c| 6 - c.neighbours.len() as i64).sum();
        assert!(charge.abs() < 30, "{charge}");
    }

    #[test]
    fn the_same_seed_gives_the_same_comb() {
        assert_eq!(Arrangement::random(9.0, 9.0, 0.4, 5), Arrangement::random(9.0, 9.0, 0.4, 5));
        assert_ne!(Arrangement::random(9.0, 9.0, 0.4, 5), Arrangement::random(9.0, 9.0, 0.4, 6));
    }
}
