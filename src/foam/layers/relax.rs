//! The descent of a two-layer foam.

use super::{Division, LayerFilms, NoLayers, films::Side, layer_films};
use crate::foam::{
    complex::{NodeImage, Places, RegionId},
    convert::as_f64,
    energy::energy,
    relax::{Descended, Descent, DescentSettings, DescentStep, Ending},
};
use crate::{index::IndexVec, surface::Gap};
use glam::DVec3;
use std::{collections::BTreeMap, ops::ControlFlow};

/// A two-layer foam.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Cells, corners and polygons, as the seeds made them.
    pub division: Division,
    /// The films where they ended.
    pub films: LayerFilms,
    /// The energy of the first, plane films.
    pub first_energy: f64,
    /// The energy at the end.
    pub energy: f64,
    /// The pressures.
    pub pressures: IndexVec<RegionId, f64>,
    /// The volumes.
    pub volumes: IndexVec<RegionId, f64>,
    /// How the descent ended.
    pub descended: Descended,
    /// Borders that had shrunk below a twentieth of the spacing at the end, and their lengths: here the foam would change its
    /// topology.
    pub vanishing: Vec<(Side, f64)>,
}

/// Borders below this part of the spacing are about to vanish: between corners that near, films of a stable foam change
/// neighbours.
const VANISHING: f64 = 0.05;
/// Below this part the descent stops: the elements beside such a border are slivers.
const VANISHED: f64 = 0.004;
/// The most Newton steps. Plane films of equal cells need about ten, annealed ones several dozen.
const STEP_LIMIT: usize = 120;

/// Relaxes `division` at equal volumes on films of this fineness; `spacing` is the size of a cell, `tolerance` the largest force
/// that may be left, in units of tension × spacing.
///
/// # Errors
/// [`NoLayers::Factor`] if the system cannot be solved at all.
pub fn relaxed(
    division: Division,
    gap: &Gap,
    fineness: usize,
    spacing: f64,
    tolerance: f64,
    progress: &mut dyn FnMut(&DescentStep<'_>) -> ControlFlow<()>,
) -> Result<Layers, NoLayers> {
    let films = layer_films(&division, gap, fineness);
    let first_energy = energy(&films.complex, &films.places);
    let cells = division.seeds.len();
    let wanted = IndexVec::from_elem(1.0 / as_f64(cells), cells);
    // The mean curvature of films this size is of the order of one over the spacing; equal cells have equal pressures.
    let pressures = IndexVec::from_elem(0.0, cells);
    let mut descent = Descent::new(films.complex, wanted, films.places, pressures)?;
    let settings =
        DescentSettings { length: spacing, tolerance, volume_tolerance: 1e-11, step_limit: STEP_LIMIT };
    let borders = films.borders;
    let descended = descent.descend(&settings, &mut |told: &DescentStep<'_>| {
        let shortest =
            lengths(&borders, told.descent).map(|(_, length)| length).fold(f64::INFINITY, f64::min);
        if shortest < VANISHED * spacing { ControlFlow::Break(()) } else { progress(told) }
    })?;
    let vanishing = if descended.ending == Ending::Converged {
        Vec::new()
    } else {
        lengths(&borders, &descent).filter(|(_, length)| *length < VANISHING * spacing).collect()
    };
    Ok(Layers {
        division,
        first_energy,
        energy: descent.energy(),
        pressures: descent.pressures().clone(),
        volumes: descent.volumes(),
        descended,
        vanishing,
        films: LayerFilms { complex: descent.complex().clone(), places: descent.places().clone(), borders },
    })
}

/// The lengths of the chords of borders.
fn lengths<'a>(
    borders: &'a BTreeMap<Side, Vec<NodeImage>>,
    descent: &'a Descent,
) -> impl Iterator<Item = (Side, f64)> + 'a {
    borders.iter().map(|(&side, nodes)| {
        let place = |image: &NodeImage| descent.complex().place(descent.places(), *image);
        let length = nodes.windows(2).map(|pair| place(&pair[0]).distance(place(&pair[1]))).sum();
        (side, length)
    })
}

impl Layers {
    /// The place of a node.
    #[must_use]
    pub fn place(&self, image: NodeImage) -> DVec3 {
        self.films.complex.place(&self.films.places, image)
    }

    /// The places of all nodes.
    #[must_use]
    pub fn places(&self) -> &Places {
        &self.films.places
    }

    /// The relative spread of the volumes round their mean.
    #[must_use]
    pub fn volume_spread(&self) -> f64 {
        let count = as_f64(self.volumes.len());
        let mean = self.volumes.iter().sum::<f64>() / count;
        (self.volumes.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / count).sqrt()
    }
}
