//! The partition: Voronoi cells of the seeds, clipped by the two walls.
//!
//! **Enters** a gap, a domain and seeds. **Leaves** [`Partition`]: every cell with closed, outward-oriented loops (plane
//! films, patches on the true walls), its exact volume, and its section by the middle surface; and from the sections the
//! [`Network`](super::network::Network) that a foam is relaxed from.
//!
//! | step | file |
//! |---|---|
//! | a convex polyhedron cut by half spaces | `polyhedron.rs` |
//! | the Voronoi cell of a seed, images included | `cutter.rs` |
//! | where lines and planes meet the walls | `levels.rs` |
//! | the polyhedron clipped by the walls: loops | `clip.rs` |
//! | volume by quadrature on the true walls | `measure.rs` |
//! | the network on the middle surface, and its rim where planes cut it off | `network.rs`, `rim.rs` |
//! | a cell as polygons, for export | `mesh.rs` |
//! | seeds moved to the centres of their cells | `lloyd.rs` |
//! | what can be wrong | `defect.rs` |
//!
//! Only a sound partition is handed out: every cell in one piece, with one patch on each wall and one loop on the middle
//! surface, and all volumes together filling the gap. What is not sound is reported with all its defects.
//!
//! Not promised: equal neighbours on both walls. Where two films cross over inside the gap, a cell has other neighbours
//! below than above, and [`PartitionCell::is_twisted`] says so; the network has those of the middle surface.
//!
//! Sources: F. Aurenhammer, "Voronoi diagrams", ACM Computing Surveys 23 (1991); H. Edelsbrunner and N. Shah, "Triangulating
//! topological spaces" (1997), for the diagram restricted to a surface and its condition to be a cell decomposition.

mod clip;
mod cutter;
mod defect;
mod levels;
mod lloyd;
mod measure;
mod mesh;
mod network;
pub(in crate::foam) mod polyhedron;
mod rim;

pub use defect::PartitionDefect;
pub use mesh::CellMesh;

use super::{
    domain::{Domain, Image},
    ground::gap_volume,
    network::CellId,
};
use crate::{
    index::IndexVec,
    surface::{Gap, WallSide},
};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

/// What lies on the other side of a face of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Beyond {
    /// An image of a cell.
    Cell(CellId, Image),
    /// A plane wall of the domain.
    Plane {
        /// Its axis, 0 to 2.
        axis: u8,
        /// Whether it is the upper one.
        high: bool,
    },
    /// One of the two walls of the gap.
    Wall(WallSide),
}

/// A side of a cell's section by the middle surface, or of its patch on a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Where it starts.
    pub start: DVec3,
    /// How long it is.
    pub length: f64,
    /// What lies behind the side that ended there.
    pub before: Beyond,
    /// What lies behind it.
    pub beyond: Beyond,
}

/// One face of a cell: a closed loop, counter-clockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct CellFace {
    /// What lies behind.
    pub beyond: Beyond,
    /// Its corners and the points of its arcs along walls, in order.
    pub outline: Vec<DVec3>,
}

/// One cell, round its seed: it may reach out of the primary box.
#[derive(Clone, Debug, PartialEq)]
pub struct PartitionCell {
    /// Its seed, inside the primary box.
    pub seed: DVec3,
    /// Its volume.
    pub volume: f64,
    /// Its faces: films first, then the patches on the lower and the upper wall.
    pub faces: Vec<CellFace>,
    /// The loops in which it meets the middle surface, counter-clockwise as seen from the upper wall.
    pub sections: Vec<Vec<Side>>,
    /// The edge of its patch on the lower and on the upper wall, counter-clockwise as seen from the upper wall.
    pub on_walls: [Vec<Side>; 2],
    /// The number of connected pieces.
    pub pieces: usize,
}

impl PartitionCell {
    /// Whether it has other neighbours on one wall than on the other.
    #[must_use]
    pub fn is_twisted(&self) -> bool {
        let [lower, upper] = [0, 1].map(|wall: usize| {
            let mut beyond: Vec<Beyond> = self.on_walls[wall].iter().map(|side| side.beyond).collect();
            beyond.sort_unstable();
            beyond
        });
        lower != upper
    }
}

/// All cells of a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Partition {
    domain: Domain,
    /// Of one period of the middle surface.
    euler_characteristic: i32,
    /// How many periods of the middle surface the domain holds.
    periods: f64,
    cells: IndexVec<CellId, PartitionCell>,
}

impl Partition {
    /// The cells of `seeds`, which lie on the middle surface of `gap` inside the primary box of `domain`.
    ///
    /// # Errors
    /// Every [`PartitionDefect`] found.
    pub fn new(gap: &Gap, domain: &Domain, seeds: &[DVec3]) -> Result<Self, Vec<PartitionDefect>> {
        let cutter = cutter::Cutter::new(gap, domain, seeds);
        let results: Vec<_> = (0..seeds.len()).into_par_iter().map(|index| cutter.cell(index)).collect();
        let (mut cells, mut defects) = (IndexVec::new(), Vec::new());
        for result in results {
            match result {
                Ok(cell) => _ = cells.push(cell),
                Err(defect) => defects.push(defect),
            }
        }
        if !defects.is_empty() {
            return Err(defects);
        }
        defects.extend(cells.enumerated().flat_map(|(id, cell)| defect::of_cell(id, cell)));
        let partition = Self {
            domain: *domain,
            euler_characteristic: gap.middle().euler_characteristic(),
            periods: domain.periods_of(gap.middle().as_ref()),
            cells,
        };
        defects.extend(defect::of_volume(partition.volume(), gap_volume(gap, domain)));
        if defects.is_empty() { Ok(partition) } else { Err(defects) }
    }

    /// The cells.
    #[must_use]
    pub fn cells(&self) -> &IndexVec<CellId, PartitionCell> {
        &self.cells
    }

    /// The space that they fill.
    #[must_use]
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The volumes of all cells together.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.cells.iter().map(|cell| cell.volume).sum()
    }
}

#[cfg(test)]
mod tests;
