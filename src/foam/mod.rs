//! The ideal foam between two walls.
pub mod complex;
pub mod energy;
pub mod network;
pub mod solve;
pub mod volume;

pub mod domain;
pub mod partition;
pub mod pattern;
pub mod seeds;
pub mod setup;
pub mod spatial;
pub mod start;

mod convert;
mod ground;

pub use ground::gap_volume;
