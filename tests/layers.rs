//! Foams of two layers against their derivation and Plateau's laws.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail by a panic, too")]

use combwright::foam::{
    layers::{
        Arrangement, Division, Layers, NoLayers, corner_angles, layer_figures, plane_end, relaxed, sheets,
        tetrahedral_angle,
    },
    relax::{DescentStep, Ending},
    setup::FoamSpace,
};
use std::ops::ControlFlow;

/// Sixteen regular hexagons a layer.
const CELLS: usize = 16;
const HEIGHT: f64 = 2.3;

fn space() -> FoamSpace {
    FoamSpace::Plane { periods: [4.0, 8.0 / 3.0_f64.sqrt()], height: HEIGHT }
}

fn flat(arrangement: Arrangement, fineness: usize) -> Result<(Layers, f64), NoLayers> {
    let gap = space().gap().unwrap();
    let sheets = sheets(&space(), &gap, arrangement, CELLS, 1, &mut |_| ControlFlow::Continue(()))?;
    let domain = space().domain().unwrap();
    let division = Division::new(&gap, &domain, &sheets.seeds, sheets.lower, sheets.spacing)?;
    let go_on = &mut |_: &DescentStep<'_>| ControlFlow::Continue(());
    Ok((relaxed(division, &gap, fineness, sheets.spacing, 1e-10, go_on)?, sheets.spacing))
}

/// The energy of plane films: side films of half the height in either layer, and the ends by their formula.
fn plane_energy(arrangement: Arrangement) -> f64 {
    let opening = 4.0 * 8.0 / 3.0_f64.sqrt() / 16.0;
    let side = (opening / 1.5 / 3.0_f64.sqrt()).sqrt();
    16.0 * (3.0 * side * HEIGHT + plane_end(arrangement).unwrap().area * opening)
}

#[test]
fn bees_ends_stay_plane_and_have_the_energy_of_the_formula() -> Result<(), NoLayers> {
    let (layers, spacing) = flat(Arrangement::Rhombic, 1)?;
    assert_eq!(layers.descended.ending, Ending::Converged);
    assert!(layers.descended.residuals.force < 1e-10, "{:?}", layers.descended);
    for energy in [layers.first_energy, layers.energy] {
        // The seeds' height is right to the root of rounding, where the energy is flat.
        assert!((energy / plane_energy(Arrangement::Rhombic) - 1.0).abs() < 1e-12, "{energy}");
    }
    for figures in layer_figures(&layers.division, spacing) {
        assert_eq!((figures.side_counts[6], figures.end_counts[3]), (CELLS, CELLS));
    }
    Ok(())
}

#[test]
fn toths_ends_curve_and_beat_the_bees_at_tetrahedral_corners() -> Result<(), NoLayers> {
    let off = |layers: &Layers| -> f64 {
        let angles = corner_angles(layers);
        assert_eq!(angles.len(), 6 * 6 * CELLS, "each cell has six corners of its own");
        angles.iter().map(|angle| (angle - tetrahedral_angle()).abs()).fold(0.0, f64::max)
    };
    let ((coarse, spacing), (fine, _)) = (flat(Arrangement::Toth, 1)?, flat(Arrangement::Toth, 2)?);
    for layers in [&coarse, &fine] {
        assert_eq!((layers.descended.ending, layers.descended.unstable), (Ending::Converged, 0));
        assert!(layers.volume_spread() < 1e-11);
        let first = layers.first_energy / plane_energy(Arrangement::Toth);
        assert!((first - 1.0).abs() < 1e-12, "{first}");
        assert!(layers.energy < layers.first_energy);
    }
    assert!(fine.energy < coarse.energy + 1e-9, "{} {}", fine.energy, coarse.energy);
    assert!(plane_energy(Arrangement::Rhombic) > fine.first_energy);
    // Tangents of quadratic elements are of first order at their ends: half the elements, half the error or better.
    let (coarse_off, fine_off) = (off(&coarse), off(&fine));
    assert!(fine_off < 0.65 * coarse_off && fine_off < 0.06, "{coarse_off} {fine_off}");
    for figures in layer_figures(&coarse.division, spacing) {
        assert_eq!((figures.side_counts[6], figures.end_counts[4]), (CELLS, CELLS));
    }
    Ok(())
}

#[test]
fn layers_that_do_not_fit_are_refused() {
    let sown = |space: FoamSpace, arrangement, cells| {
        let gap = space.gap().unwrap();
        let sheets = sheets(&space, &gap, arrangement, cells, 1, &mut |_| ControlFlow::Continue(()))?;
        Division::new(&gap, &space.domain().unwrap(), &sheets.seeds, sheets.lower, sheets.spacing)
    };
    let low = FoamSpace::Plane { periods: [4.0, 8.0 / 3.0_f64.sqrt()], height: 0.3 };
    assert!(sown(low, Arrangement::Rhombic, 16).is_err());
    assert!(matches!(sown(space(), Arrangement::Toth, 14), Err(NoLayers::Rows { .. })));
    let sphere = FoamSpace::Sphere { radii: [1.0, 1.5] };
    assert!(matches!(sown(sphere, Arrangement::Toth, 16), Err(NoLayers::Curved { .. })));
}
