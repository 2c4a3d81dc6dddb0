//! Who touches whom.
//!
//! **Enters** a list of cells, each with the ring of its neighbours, from a foam or from a photograph. **Leaves**
//! [`CellPattern`], checked: the only thing that foam and comb share, so that a comparison cannot tell one from the other.
//!
//! | step | file |
//! |---|---|
//! | cells, walls, status; the laws of a pattern | `pattern.rs` |
//!
//! Not promised: a pattern holds no geometry beyond a place, a normal and wall lengths.

mod pattern;

pub use pattern::{
    Cell, CellId, CellPattern, CellStatus, CellWall, PATTERN_SCHEMA, PatternDefect, Surroundings,
};
