//! The energy of a surface and what is held constant, with exact derivatives.
//!
//! The Lagrangian is `E + Σ cₖ Fₖ − Σ pₖ Fₖ`: tension times area and length, gravity and the constraints' integrals in `E`; the
//! functionals `Fₖ` are the bodies' volumes and the named quantities, coupled with prescribed pressures or moduli `cₖ` and
//! held with multipliers `pₖ`.
//!
//! | step | file |
//! |---|---|
//! | fields to be integrated, with derivatives | `field.rs` |
//! | one facet, one edge: integral, gradient, Hessian; areas are the foam's elements | `facet.rs`, `edge.rs` |
//! | all terms of a surface; energy and functionals | `problem.rs`, `terms.rs`, `wall_terms.rs` |
//! | gradients, and volumes' gradients by vertex | `gradient.rs` |
//! | directions in which vertices may move; return to constraints; normals of films | `freedom.rs`, `normals.rs` |
//! | gradient steps with volumes held | `descend.rs` |
//! | the matrix of a Newton step; the step and its inertia; eigenvalues, by the foam's sparse solver | `assemble.rs`, `newton.rs`, `eigen.rs` |
//! | what lies between edges and their walls, volume and film, and how much it weighs | `sliver.rs`, `rim.rs`, `contact.rs` |
//! | carrying the surface along its walls | `carry.rs` |
//! | volumes closed on the walls themselves, by the foam's kernels | `closed.rs` |

pub(crate) mod assemble;
pub(crate) mod carry;
pub(crate) mod closed;
pub(crate) mod contact;
pub(crate) mod descend;
mod edge;
mod eigen;
mod facet;
mod field;
pub(crate) mod freedom;
mod gradient;
pub(crate) mod newton;
mod normals;
mod problem;
mod rim;
mod sliver;
pub(crate) mod terms;
mod wall_terms;

pub use problem::{Functional, FunctionalId, Measured, Problem, Values};

use super::surface::VertexId;
use crate::index::IndexVec;
use glam::DVec3;

/// The places of the vertices.
pub type Places = IndexVec<VertexId, DVec3>;
