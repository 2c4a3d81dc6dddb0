//! Who touches whom.
//!
//! **Enters** a list of cells, each with the ring of its neighbours, from a foam or from a photograph. **Leaves**
//! [`CellPattern`], checked: the only thing that foam and comb share, so that a comparison cannot tell one from the other;
//! and [`PatternStatistics`], what is known of one pattern in the field's terms.
//!
//! | step | file |
//! |---|---|
//! | cells, walls, status; the laws of a pattern | `pattern.rs` |
//! | distribution of sides, its moments, hexatic order | `statistics.rs` |
//! | 5–7 pairs and chains | `defects.rs` |
//! | Aboav–Weaire, Lewis, correlations of sides with distance | `neighbours.rs` |
//! | topological charge against Euler's relation and against curvature; the rule for cells at the border | `charge.rs` |
//! | defects by kind; all of this for one pattern | `census.rs` |
//! | a null model: hexagons on a torus after random T1s | `flips.rs` |
//!
//! Not promised: a pattern holds no geometry beyond a place, a normal and wall lengths.

mod census;
mod charge;
mod defects;
mod flips;
mod neighbours;
mod pattern;
mod statistics;
#[cfg(test)]
mod testing;

pub use census::{DefectCensus, PatternStatistics, pattern_statistics};
pub use charge::{ChargeBalance, RegionCharges, charge_against_curvature, charge_balance};
pub use defects::{Chain, Defects, Pair, defects};
pub use flips::flipped_hexagons;
pub use neighbours::{
    AboavWeaire, AreaMean, DistanceCorrelation, Lewis, NeighbourMean, aboav_weaire, cells_within, lewis,
    side_correlations,
};
pub use pattern::{
    Cell, CellId, CellPattern, CellStatus, CellWall, PATTERN_SCHEMA, PatternDefect, Surroundings,
};
pub use statistics::{SideStatistics, hexatic, side_statistics};
