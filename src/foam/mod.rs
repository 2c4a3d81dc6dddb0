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
//! | cells that touch others on one wall than on the other, or one wall only | `free/` |
//! | foams of two layers, as in natural comb, on their way into `free/` | `layers/` |
//!
//! Not promised: a relaxed foam is a local minimum; other seeds may lie lower, and annealing (`relax/anneal.rs`) finds some of
//! them. Energies are those of the mesh: their error falls with the fourth power of the number of elements along a film, is
//! 1e-5 with the default on a foam of 64 cells, and can be extrapolated away. Networks have three cells at every vertex and
//! three sides or more, so that a sphere needs four cells.
//!
//! Where planes of mirror symmetry cut the gap off, as at the open faces of an enclosure, they are frictionless walls: films
//! end on them at a right angle, and cells at them are cut (`network/rim.rs`, `complex/rim.rs`, `topology.rs`). A cell there
//! may cover one corner of the box and end at planes that do not face each other; too few cells for that are refused.
//!
//! A network has films from wall to wall, so that cells have the same neighbours on both walls. Where walls are far apart for
//! their curvature there is no such foam: on the P-surface beyond about Φ = ±0.6, where a film is squeezed to nothing on the
//! inner side of a neck while it is long on the outer. `relax/widen.rs` goes as far as there is one and says where the next one
//! ends. `free/` goes on: neighbours change on that wall alone, and films grow from it down to corners inside the gap.
//!
//! Films meet walls at a right angle, and no other angle is offered: Young's law for a film between the cells *a* and *b* is
//! cos θ = (γ_wa − γ_wb)/γ with the wall's energies γ_w under each, and these are the same where all cells hold the same gas
//! between the same walls. Cells do not vanish (T2) in a relaxation, for their volumes are held; the network knows how
//! ([`network::Network::remove`]), for a foam that coarsens.
//!
//! Sources: K. A. Brakke, "The Surface Evolver", Experimental Mathematics 1 (1992), for films as minimised energies;
//! J. Nocedal and S. Wright, "Numerical Optimization" (2006), for Newton steps under constraints and inertia.

pub mod audit;
pub mod bubble;
pub mod complex;
pub mod energy;
pub mod free;
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
