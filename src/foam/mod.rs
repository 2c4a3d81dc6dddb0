//! The ideal foam between two walls.
pub mod network;
