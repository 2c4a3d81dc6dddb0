//! The ideal foam between two walls.
pub mod complex;
pub mod energy;
pub mod network;
pub mod solve;
pub mod volume;

pub mod domain;
pub mod seeds;
pub mod spatial;

mod convert;
mod ground;
