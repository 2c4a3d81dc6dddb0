//! Foams of free topology: cells that may have other neighbours on one wall than on the other, or touch one wall only.
//!
//! **Enters** a [`Division`]: two layers of cells ([`super::layers`]), or a one-layer foam in a gap that is too wide for films
//! that all reach from wall to wall ([`super::relax`]). **Leaves** a film complex in balance.
//!
//! | step | file |
//! |---|---|
//! | cells, films as polygons, corners inside the gap or on a wall | `division.rs` |
//! | the laws: cells in one piece, patches on walls, Euler's numbers | `laws.rs` |
//! | slivers among their sides opened | `open.rs` |
//! | the film complex: each polygon as curved quadrilaterals round its middle | `films.rs` |
//! | the same on finer elements | `finer.rs` |
//! | places along borders | `line.rs` |
//! | the descent to least energy at given volumes | `relax.rs` |
//! | borders and films that vanish: changes of topology | `flip/` |
//! | nodes spread evenly in balance | `even.rs` |
//! | a one-layer foam taken over from its network | `extruded.rs` |
//! | walls moved apart in stages | `widen.rs` |
//! | films that slide round a corner between two open faces | `turn.rs` |
//! | what cells cover of the walls | `outline.rs` |
//! | angles at corners | `angles.rs` |
//!
//! Not promised: balance. A change at corners where more than four cells meet, as in the bees' arrangement, is not made; nor, in
//! two layers, one by which a cell would leave its wall, reach the other or get a second film with a neighbour; nor one that
//! leaves a film with two corners. A foam that needs it ends as stalled, with the borders that vanish.

mod angles;
mod division;
mod even;
mod extruded;
mod films;
mod finer;
mod flip;
mod laws;
mod line;
mod open;
mod outline;
mod relax;
mod turn;
mod widen;

pub use angles::{corner_angles, tetrahedral_angle};
pub use division::{Corner, CornerImage, Division, Polygon, Stacking, spacing};
pub use films::{FreeFilms, Side, free_films};
pub use finer::extrapolate;
pub use laws::{Unlawful, unlawful};
pub use outline::WallLine;
pub use relax::{FreeFoam, FreeSettings, relaxed};
pub use widen::{Obstacle, Widened, WideningStep, widened};

#[cfg(test)]
mod tests;
