//! The energy without the error of the mesh.

use super::{RelaxError, RelaxSettings, State, Stop, resume};
use crate::{
    foam::{complex::Strips, energy::energy},
    surface::Gap,
};
use serde::Serialize;
use std::ops::ControlFlow;

/// A foam's energy on two meshes and what they tend to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Extrapolated {
    /// On the mesh of the foam itself.
    pub energy: f64,
    /// On a mesh of twice as many elements both ways.
    pub finer: f64,
    /// Without a mesh, if the error falls with the fourth power of the elements' size.
    pub limit: f64,
}

/// The error of quadratic elements falls by this factor when their size is halved.
const FALL: f64 = 16.0;

impl Extrapolated {
    /// From the energies on a mesh and on one of twice as many elements both ways (L. F. Richardson, 1911).
    pub(in crate::foam) fn of(energy: f64, finer: f64) -> Self {
        Self { energy, finer, limit: finer + (finer - energy) / (FALL - 1.0) }
    }
}

/// Relaxes a settled foam on a mesh of half the element size and extrapolates. `None` if the finer mesh does not settle or
/// other cells touch on it.
///
/// # Errors
/// [`RelaxError`] as for the relaxation itself.
pub fn extrapolate(
    state: &State,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Option<Extrapolated>, RelaxError> {
    let of = |state: &State| energy(&state.strips.complex(&state.network, gap), &state.places);
    let Strips { along, through } = state.strips;
    let strips = Strips { along: 2 * along, through: 2 * through };
    let settings = RelaxSettings {
        strips,
        step_limit: settings.step_limit.saturating_add(state.steps),
        ..settings.clone()
    };
    let finer = resume(state.clone(), gap, &settings, &mut |_| progress())?;
    if !matches!(finer.stop, Stop::Converged { .. }) || finer.state.flips != state.flips {
        return Ok(None);
    }
    Ok(Some(Extrapolated::of(of(state), of(&finer.state))))
}
