//! The ideal foam between two walls: least film area at given volumes.
//!
//! **Enters** a [`crate::surface::Gap`] and a number of cells. **Leaves** a relaxed foam: its network, its curved films, each
//! cell's pressure, and how the relaxation ended.
//!
//! | step | file |
//! |---|---|
//! | what is asked for, checked | `setup.rs`, `domain.rs` |
//! | seeds, annealed and polished | `seeds/` |
//! | cells of the seeds, clipped by the walls, and their network | `partition/`, `start.rs` |
//! | who touches whom; T1 and T2; the laws | `network/` |
//! | films: nodes, curved elements, regions, walls | `complex/` |
//! | energy and volumes with exact derivatives | `energy.rs`, `volume/` |
//! | Newton steps on the constrained system | `solve/` |
//! | when a film has shrunk: T1 by geometry | `topology.rs` |
//! | the descent of any film complex; the whole run with its T1s, and its state as data | `relax/` |
//! | pressures against sides and curvature, cell by cell | `audit.rs` |
//! | who touches whom, for the comparison with combs | `pattern.rs` |
//! | one bubble, held or free, and the landscape of its energy | `bubble/` |
//! | foams of two layers, as in natural comb | `layers/` |
//!
//! Not promised: a relaxed foam is a local minimum; other seeds may lie lower. Cells must be small against the curvature of
//! the walls: with two dozen cells in a period of the P-surface the coarse mesh of the descent is too coarse, and the run
//! ends as stalled. Relaxation knows periodic and closed surfaces only, not plane walls across the gap.
//!
//! Sources: K. A. Brakke, "The Surface Evolver", Experimental Mathematics 1 (1992), for films as minimised energies;
//! J. Nocedal and S. Wright, "Numerical Optimization" (2006), for Newton steps under constraints and inertia.

pub mod audit;
pub mod bubble;
pub mod complex;
pub mod energy;
pub mod layers;
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
