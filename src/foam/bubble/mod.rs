//! One bubble, or a few, between two walls: where it wants to be.
//!
//! **Enters** a [`crate::surface::Gap`], a volume and a place. **Leaves** the bubble in equilibrium there with its energy,
//! pressure and the force that the walls put on it; the landscape of its energy over the surface; the place to which a
//! free bubble slides.
//!
//! | step | file |
//! |---|---|
//! | polar coordinates on the middle surface, columns from wall to wall | `chart.rs` |
//! | the film: one closed strip of biquadratic elements | `annulus.rs` |
//! | the constraint that holds the bubble at a place | `balance.rs` |
//! | Newton steps on film, pressure and multipliers; the second variation | `newton.rs` |
//! | a held bubble on several meshes, and their limit | `held.rs`, `extrapolate.rs` |
//! | a bubble that meets itself | `touch.rs` |
//! | the way of a free bubble; whether its end is a minimum | `settle.rs` |
//! | two or three bubbles that touch | `cluster.rs` |
//! | what thin gaps say | `thin.rs` |
//! | many places: a route, or the patch that symmetries repeat | `landscape.rs`, `symmetry.rs` |
//!
//! Not promised: bubbles are columns from wall to wall; one that would rather sit on one wall as a cap, or close round a
//! neck as a ring, is not found. The free bubble's end is the bottom of the basin that it started in.
//!
//! Sources: A. Mughal, S. J. Cox and G. E. Schröder-Turk, "Curvature driven motion of a bubble in a toroidal Hele-Shaw
//! cell", Interface Focus 7 (2017), for bubbles that move to where the Gaussian curvature is largest; K. A. Brakke, "The Surface Evolver",
//! Experimental Mathematics 1 (1992), for films under constraints.

mod annulus;
mod balance;
mod chart;
mod cluster;
mod extrapolate;
mod held;
mod landscape;
mod newton;
mod settle;
mod symmetry;
mod thin;
mod touch;

pub use annulus::Annulus;
pub use chart::Chart;
pub use cluster::{Cluster, cluster, flat_perimeter};
pub use extrapolate::{limit, limit_with_error};
pub use held::{Bubble, Meshes, held, shape_modes};
pub use landscape::{Sample, Scattered, patch, route, scan, scan_route, usual_route};
pub use settle::{Landing, Settled, landing, settled};
pub use symmetry::{Orbits, Symmetry};
pub use thin::ThinGap;

use glam::DVec3;

fn last_step(residual: f64) -> String {
    if residual.is_finite() {
        format!(" (the last step was {residual:.1e} of its radius)")
    } else {
        String::new()
    }
}

/// Why there is no such bubble.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoBubble {
    /// The volume is none.
    #[error("the bubble's volume is {volume}: it must be a positive number")]
    Volume {
        /// As given.
        volume: f64,
    },
    /// The place is nowhere near the surface.
    #[error("no point of the middle surface is found from the place {place}: give a place on it")]
    Place {
        /// As given.
        place: DVec3,
    },
    /// The place lies outside the gap.
    #[error(
        "the place {place} is off the middle surface by {distance:.6}: the nearest point along the gradient is {nearest}"
    )]
    OffSurface {
        /// As given.
        place: DVec3,
        /// On the surface.
        nearest: DVec3,
        /// Between the two.
        distance: f64,
    },
    /// The film leaves the part of the gap that can be reached from its place.
    #[error("the bubble is too large for the gap: its film loses a wall near {place}; ask for less volume")]
    Wide {
        /// Where.
        place: DVec3,
    },
    /// The film meets itself.
    #[error(
        "the bubble at {place} would touch itself round the period or round the surface; ask for less volume"
    )]
    Touches {
        /// Its centre.
        place: DVec3,
    },
    /// A cluster of so many is not known.
    #[error("{count} touching bubbles are not known: a pair has 2, a triple 3")]
    Count {
        /// As given.
        count: usize,
    },
    /// Newton's steps did not end.
    #[error(
        "the bubble at {place} does not come to equilibrium{}: it is probably too large for the gap there",
        last_step(*.residual)
    )]
    Unsolved {
        /// Its centre.
        place: DVec3,
        /// The last step over the radius.
        residual: f64,
    },
    /// A cluster did not come to balance.
    #[error(
        "the cluster from {place} does not come to balance: after {steps} steps the largest force is still {force:.1e} of the tension. Nothing holds a cluster where it starts, and it slides over the surface until its films are too oblique for their elements; start it where it can stay, or with less volume"
    )]
    Unbalanced {
        /// Where it started.
        place: DVec3,
        /// Steps done.
        steps: usize,
        /// The largest force, in units of tension × size.
        force: f64,
    },
    /// The free bubble did not come to rest.
    #[error("the free bubble still slides after {steps} steps, at {place}")]
    Restless {
        /// Where it is.
        place: DVec3,
        /// Steps done.
        steps: usize,
    },
}
