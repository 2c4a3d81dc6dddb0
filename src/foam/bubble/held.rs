//! One bubble held at a place, on several meshes, and the limit of fine meshes.

use super::{
    Annulus, Chart, NoBubble,
    extrapolate::limit_with_error,
    newton::{Equilibrium, Sheet},
};
use crate::foam::{
    complex::{Complex, Places},
    convert::as_f64,
};
use crate::surface::Gap;
use glam::DVec3;
use serde::Serialize;
use std::f64::consts::PI;

/// The meshes that a bubble is relaxed on, coarse to fine, in one ratio of elements round to elements through.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Meshes(Vec<Annulus>);

impl Meshes {
    /// One mesh of 12 × 2 elements: energies to about 1e-5.
    #[must_use]
    pub fn coarse() -> Self {
        Self(vec![Annulus { around: 12, through: 2 }])
    }

    /// Two meshes: energies to about 1e-7.
    #[must_use]
    pub fn medium() -> Self {
        Self(vec![Annulus { around: 12, through: 2 }, Annulus { around: 18, through: 3 }])
    }

    /// Four meshes up to 40 × 5 elements: energies to about 1e-10 where the bubble is less wide than the radius of curvature,
    /// to about 1e-6 where it bends round a neck: the paper's bubble in a neck of P comes out 8e-7 off.
    #[must_use]
    pub fn fine() -> Self {
        Self((2..2 + MESHES).map(|through| Annulus { around: 8 * through, through }).collect())
    }

    /// The limit of a figure that was found on all meshes, and how far it moves without the coarsest.
    fn limit(&self, values: &[f64]) -> (f64, f64) {
        let sizes: Vec<f64> = self.0.iter().map(|mesh| 1.0 / as_f64(mesh.through)).collect();
        limit_with_error(&sizes, values)
    }
}

/// A bubble at its place in equilibrium.
#[derive(Clone, Debug)]
pub struct Bubble {
    /// Where its centre is held, on the middle surface.
    pub place: DVec3,
    /// Its volume.
    pub volume: f64,
    /// The energy: the area of its film times the tension 1, in the limit of fine meshes.
    pub energy: f64,
    /// How far the limit moves without the coarsest mesh; not a number with one mesh.
    pub energy_error: f64,
    /// The pressure above the open air, in the limit of fine meshes.
    pub pressure: f64,
    /// As for the energy.
    pub pressure_error: f64,
    /// The force of the walls on the bubble along the surface: minus the gradient of its energy. What holds the bubble pulls
    /// against it.
    pub force: DVec3,
    /// The largest force left on a node of the finest mesh.
    pub residual: f64,
    /// Ways to deform on which the energy falls although the centre is held.
    pub unstable_shapes: usize,
    /// The finest mesh.
    pub mesh: Annulus,
    /// The film on the finest mesh.
    pub complex: Complex,
    /// The places of its nodes.
    pub places: Places,
}

/// How many meshes the finest figures come from.
const MESHES: usize = 4;
/// How many eigenvalues are reported.
const EIGENVALUES: usize = 4;

/// A place may lie off the middle surface by this part of the local gap, within rounding of what people type.
const OFF_SURFACE: f64 = 0.5;

/// A bubble of this volume in the gap, its centre held at `place`.
///
/// # Errors
/// [`NoBubble`] if there is none: a bad volume, a place off the surface, a bubble that loses a wall, closes on itself or
/// does not come to rest.
pub fn held(gap: &Gap, volume: f64, place: DVec3, meshes: &Meshes) -> Result<Bubble, NoBubble> {
    let chart = chart_at(gap, volume, place)?;
    let (ends, sheet) = levels(&chart, volume, meshes)?;
    let last = ends.len() - 1;
    let (finest, mesh) = (&ends[last], meshes.0[last]);
    super::touch::refuse(&sheet.complex, &finest.places, mesh, chart.place())?;
    let limit_of =
        |figure: &dyn Fn(&Equilibrium) -> f64| meshes.limit(&ends.iter().map(figure).collect::<Vec<_>>());
    let (energy, energy_error) = limit_of(&|end| end.energy);
    let (pressure, pressure_error) = limit_of(&|end| end.pressure);
    let force = -(0..2).map(|i| limit_of(&|end| end.slope[i]).0 * chart.axes()[i]).sum::<DVec3>();
    Ok(Bubble {
        place: chart.place(),
        volume,
        energy,
        energy_error,
        pressure,
        pressure_error,
        force,
        residual: finest.residual,
        unstable_shapes: finest.unstable,
        mesh,
        places: finest.places.clone(),
        complex: sheet.complex,
    })
}

/// The lowest eigenvalues of the second variation of a bubble's energy with volume and centre held: energy per squared
/// displacement of the film, integrated over it, on the finest mesh.
///
/// # Errors
/// As [`held`].
pub fn shape_modes(gap: &Gap, volume: f64, place: DVec3) -> Result<Vec<f64>, NoBubble> {
    let chart = chart_at(gap, volume, place)?;
    let finest = Meshes::fine().0.split_off(MESHES - 1);
    let (ends, sheet) = levels(&chart, volume, &Meshes(finest))?;
    Ok(sheet.spectrum(&ends[0], EIGENVALUES))
}

/// The chart for a bubble of this volume at `place`, checked.
pub(super) fn chart_at(gap: &Gap, volume: f64, place: DVec3) -> Result<Chart<'_>, NoBubble> {
    if !(volume > 0.0 && volume.is_finite()) {
        return Err(NoBubble::Volume { volume });
    }
    let chart = Chart::new(gap, place)?;
    let (distance, height) = (chart.place().distance(place), chart.height()?);
    if distance > OFF_SURFACE * height {
        return Err(NoBubble::OffSurface { place, nearest: chart.place(), distance });
    }
    Ok(chart)
}

/// Equilibria on all meshes, each from the same round start, so that they differ by the size of the elements alone; and the
/// finest sheet.
fn levels<'a>(
    chart: &'a Chart<'a>,
    volume: f64,
    meshes: &Meshes,
) -> Result<(Vec<Equilibrium>, Sheet<'a>), NoBubble> {
    let radius = first_radius(chart, volume)?;
    let sheets = meshes
        .0
        .iter()
        .map(|&mesh| Sheet::round(chart, mesh, radius, volume))
        .collect::<Result<Vec<_>, _>>()?;
    let ends = sheets.iter().map(Sheet::settle).collect::<Result<Vec<_>, _>>()?;
    Ok((ends, sheets.into_iter().last().ok_or(NoBubble::Place { place: chart.place() })?))
}

/// The equilibrium on the coarse mesh alone.
pub(super) fn coarse_equilibrium(chart: &Chart<'_>, volume: f64) -> Result<Equilibrium, NoBubble> {
    let (mut ends, _) = levels(chart, volume, &Meshes::coarse())?;
    Ok(ends.swap_remove(0))
}

/// Corrections of the first radius: each leaves about the square of the error.
const RADIUS_STEPS: usize = 4;

/// The radius of a round bubble of about this volume.
pub(super) fn first_radius(chart: &Chart<'_>, volume: f64) -> Result<f64, NoBubble> {
    let mesh = Annulus { around: 8, through: 1 };
    let mut radius = (volume / (PI * chart.height()?)).sqrt();
    for _ in 0..RADIUS_STEPS {
        let sheet = Sheet::round(chart, mesh, radius, volume)?;
        let ratio = (volume / sheet.volume_at(&sheet.places)).sqrt();
        if ratio.is_nan() || ratio <= 0.0 {
            return Err(NoBubble::Wide { place: chart.place() });
        }
        radius *= ratio.clamp(0.5, 2.0);
    }
    Ok(radius)
}
