//! Who touches whom.
//!
//! **Enters** a list of cells, each with the ring of its neighbours, from a foam or from a photograph. **Leaves**
//! [`CellPattern`], checked: the only thing that foam and comb share, so that a comparison cannot tell one from the other.
//!
//! | step | file |
//! |---|---|
//! | cells, walls, status; the laws of a pattern | `pattern.rs` |
//! | distribution of sides, its moments, hexatic order | `statistics.rs` |
//! | 5–7 pairs and chains | `defects.rs` |
//!
//! Not promised: a pattern holds no geometry beyond a place, a normal and wall lengths.

mod defects;
mod pattern;
mod statistics;
#[cfg(test)]
mod testing;

pub use defects::{Chain, Defects, Pair, defects};
pub use pattern::{
    Cell, CellId, CellPattern, CellStatus, CellWall, PATTERN_SCHEMA, PatternDefect, Surroundings,
};
pub use statistics::{SideStatistics, hexatic, side_statistics};
