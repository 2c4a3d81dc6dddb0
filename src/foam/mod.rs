//! The ideal foam between two walls.
pub mod complex;
pub mod energy;
pub mod network;
pub mod relax;
pub mod solve;
pub mod topology;
pub mod volume;

pub mod checkpoint;
pub mod domain;
pub mod partition;
pub mod pattern;
pub mod seeds;
pub mod setup;
pub mod spatial;
pub mod start;

mod convert;
mod ground;
mod side_lines;

pub use ground::{flat_hexagonal_energy, gap_volume};
