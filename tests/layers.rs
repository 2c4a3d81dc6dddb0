//! Foams of two layers against their derivation and Plateau's laws.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail by a panic, too")]

use combwright::foam::{
    complex::Shape,
    free::{FreeFoam, FreeSettings, corner_angles, relaxed, tetrahedral_angle},
    layers::{Arrangement, NoLayers, divided, layer_figures, plane_end, sheets},
    relax::{Descent, DescentStep, Ending},
    setup::FoamSpace,
};
use combwright::report::layers::picture;
use std::ops::ControlFlow;

/// Sixteen regular hexagons a layer.
const CELLS: usize = 16;
const HEIGHT: f64 = 2.3;

fn space() -> FoamSpace {
    FoamSpace::Plane { periods: [4.0, 8.0 / 3.0_f64.sqrt()], height: HEIGHT }
}

fn flat(arrangement: Arrangement, fineness: usize) -> Result<FreeFoam, NoLayers> {
    made(&space(), arrangement, CELLS, fineness)
}

fn made(
    space: &FoamSpace,
    arrangement: Arrangement,
    cells: usize,
    fineness: usize,
) -> Result<FreeFoam, NoLayers> {
    made_while(space, arrangement, cells, fineness, ControlFlow::Continue(()))
}

/// `flow` is what the observer answers after each step.
fn made_while(
    space: &FoamSpace,
    arrangement: Arrangement,
    cells: usize,
    fineness: usize,
    flow: ControlFlow<()>,
) -> Result<FreeFoam, NoLayers> {
    let gap = space.gap().unwrap();
    let sheets = sheets(space, &gap, arrangement, cells, 1, &mut |_| ControlFlow::Continue(()))?;
    let domain = space.domain().unwrap();
    let division = divided(&gap, &domain, &sheets)?;
    let changes_topology = arrangement == Arrangement::Annealed;
    let settings = FreeSettings { fineness, changes_topology, ..FreeSettings::new(sheets.spacing) };
    Ok(relaxed(division, &gap, &settings, &mut |_: &DescentStep<'_>| flow).unwrap())
}

/// The energy of plane films: side films of half the height in either layer, and the ends by their formula.
fn plane_energy(arrangement: Arrangement) -> f64 {
    let opening = 4.0 * 8.0 / 3.0_f64.sqrt() / 16.0;
    let side = (opening / 1.5 / 3.0_f64.sqrt()).sqrt();
    16.0 * (3.0 * side * HEIGHT + plane_end(arrangement).unwrap().area * opening)
}

#[test]
fn bees_ends_stay_plane_and_have_the_energy_of_the_formula() -> Result<(), NoLayers> {
    let layers = flat(Arrangement::Rhombic, 1)?;
    assert_eq!(layers.descended.ending, Ending::Converged);
    assert!(layers.descended.residuals.force < 1e-10, "{:?}", layers.descended);
    for energy in [layers.first_energy, layers.energy] {
        // The seeds' height is right to the root of rounding, where the energy is flat.
        assert!((energy / plane_energy(Arrangement::Rhombic) - 1.0).abs() < 1e-12, "{energy}");
    }
    for figures in layer_figures(&layers.division) {
        assert_eq!((figures.side_counts[6], figures.end_counts[3]), (CELLS, CELLS));
    }
    Ok(())
}

#[test]
fn toths_ends_curve_and_beat_the_bees_at_tetrahedral_corners() -> Result<(), NoLayers> {
    let off = |layers: &FreeFoam| -> f64 {
        let angles = corner_angles(layers);
        assert_eq!(angles.len(), 6 * 6 * CELLS, "each cell has six corners of its own");
        angles.iter().map(|angle| (angle - tetrahedral_angle()).abs()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (flat(Arrangement::Toth, 1)?, flat(Arrangement::Toth, 2)?);
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
    for figures in layer_figures(&coarse.division) {
        assert_eq!((figures.side_counts[6], figures.end_counts[4]), (CELLS, CELLS));
    }
    Ok(())
}

/// What holds for every two-layer foam in balance: the walls' topology, equal volumes, four borders at every corner inside.
fn assert_lawful(layers: &FreeFoam, charge: f64) {
    assert_eq!(
        (layers.descended.ending, layers.descended.unstable),
        (Ending::Converged, 0),
        "{:?}",
        layers.descended
    );
    assert!(layers.descended.residuals.force < 1e-10 && layers.volume_spread() < 1e-10);
    assert!(layers.energy < layers.first_energy);
    let inside = layers.division.corners.iter().filter(|corner| corner.wall.is_none()).count();
    assert_eq!(corner_angles(layers).len(), 6 * inside, "four borders meet at every corner");
    for figures in layer_figures(&layers.division) {
        let found: f64 =
            figures.sides.iter().map(|&sides| 6.0 - f64::from(u32::try_from(sides).unwrap())).sum();
        assert!((found - charge).abs() < 1e-9, "Σ(6 − n) is {found}, should be {charge}");
    }
}

#[test]
fn layers_annealed_for_themselves_come_to_balance() -> Result<(), NoLayers> {
    let layers = made(&space(), Arrangement::Annealed, CELLS, 1)?;
    assert_lawful(&layers, 0.0);
    // Both named arrangements are foams of the same cells; annealed ones may lie above them, but not far.
    let best = flat(Arrangement::Toth, 1)?.energy;
    assert!((best * 0.9999..best * 1.02).contains(&layers.energy), "{} {best}", layers.energy);
    Ok(())
}

#[test]
fn layers_between_spheres_come_to_a_balance_that_is_a_minimum() -> Result<(), NoLayers> {
    // The outer wall's cells are sixteen times as large as the inner wall's.
    let layers = made(&FoamSpace::Sphere { radii: [1.0, 4.0] }, Arrangement::Annealed, 24, 1)?;
    assert_lawful(&layers, 12.0);
    // Slivers that hold up the others' steps would take four times as many.
    assert!(layers.descended.steps < 60, "{:?}", layers.descended);
    let wanted = layers.division.volumes.iter().copied();
    let (complex, places) = (layers.films.complex.clone(), layers.places().clone());
    // Rotations, along which the energy is constant, are held.
    let descent = Descent::new(complex, wanted.collect(), places, layers.pressures.clone()).unwrap();
    let lowest = descent.lowest_mode().unwrap().eigenvalue;
    assert!(lowest > 1e-6, "{lowest}");
    Ok(())
}

#[test]
fn a_foam_that_is_stopped_on_its_first_films_can_be_drawn() -> Result<(), NoLayers> {
    let layers = made_while(&space(), Arrangement::Annealed, CELLS, 1, ControlFlow::Break(()))?;
    assert_eq!(layers.descended.ending, Ending::Halted);
    // The first films are triangles; those of a foam in balance are quadrilaterals.
    let shapes = layers.films.complex.films.iter().flat_map(|film| &film.elements);
    assert!(shapes.map(|element| element.shape).all(|shape| shape == Shape::Tri6));
    let figures = layer_figures(&layers.division);
    assert!(picture(&layers, &figures, &space().gap().unwrap(), "stopped").is_ok());
    Ok(())
}

#[test]
fn bees_ends_on_almost_regular_hexagons_slide_to_toths() -> Result<(), NoLayers> {
    // Corners where eight borders meet part into short borders, along which the energy falls.
    let space = FoamSpace::Plane { periods: [4.0, 4.62], height: HEIGHT };
    let layers = made(&space, Arrangement::Rhombic, CELLS, 1)?;
    assert_lawful(&layers, 0.0);
    assert_eq!(layers.flips, 0);
    for figures in layer_figures(&layers.division) {
        assert_eq!((figures.side_counts[6], figures.end_counts[4]), (CELLS, CELLS));
    }
    // The opening is larger by 2.6e-4 than that of regular hexagons, and films by less than that.
    let toth = flat(Arrangement::Toth, 1)?.energy;
    assert!((toth..toth * 1.000_26).contains(&layers.energy), "{} {toth}", layers.energy);
    Ok(())
}

#[test]
fn layers_that_do_not_fit_are_refused() {
    let sown = |space: FoamSpace, arrangement, cells| {
        let gap = space.gap().unwrap();
        let sheets = sheets(&space, &gap, arrangement, cells, 1, &mut |_| ControlFlow::Continue(()))?;
        divided(&gap, &space.domain().unwrap(), &sheets)
    };
    let low = FoamSpace::Plane { periods: [4.0, 8.0 / 3.0_f64.sqrt()], height: 0.3 };
    assert!(sown(low, Arrangement::Rhombic, 16).is_err());
    assert!(matches!(sown(space(), Arrangement::Toth, 14), Err(NoLayers::Rows { .. })));
    let sphere = FoamSpace::Sphere { radii: [1.0, 1.5] };
    assert!(matches!(sown(sphere, Arrangement::Toth, 16), Err(NoLayers::Curved { .. })));
    // Cells a third as high as wide, and more cells than memory holds.
    let Err(NoLayers::Flat { flattest, needed }) = sown(sphere, Arrangement::Annealed, 16) else {
        panic!("flat layers are refused");
    };
    assert!((0.1..0.5).contains(&flattest) && needed > 64.0, "{flattest} {needed}");
    let large = FoamSpace::Plane { periods: [80.0, 80.0], height: HEIGHT };
    assert!(matches!(sown(large, Arrangement::Annealed, 6000), Err(NoLayers::Many { .. })));
    // A sphere's pattern has cells of five sides: too deep ones are refused before anything is settled.
    let deep = FoamSpace::Sphere { radii: [1.0, 2.0] };
    let Err(NoLayers::Deep { deepest, fitting }) = sown(deep, Arrangement::Annealed, 400) else {
        panic!("deep layers are refused");
    };
    assert!(deepest > 2.5 && (50.0..200.0).contains(&fitting), "{deepest} {fitting}");
}

#[test]
fn an_arrangement_with_a_name_ends_where_its_borders_vanish() -> Result<(), NoLayers> {
    // On a small block of bees' ends that is stretched by a thousandth, corners of eight borders part into borders that shrink.
    let space = FoamSpace::Plane { periods: [8.0, 9.24], height: HEIGHT };
    let layers = made(&space, Arrangement::Rhombic, 64, 1)?;
    assert_eq!((layers.descended.ending, layers.flips), (Ending::Halted, 0), "{:?}", layers.descended);
    assert!(!layers.vanishing.is_empty() && layers.leaving.is_empty());
    assert!(layers.descended.residuals.force > 1e-10);
    for figures in layer_figures(&layers.division) {
        assert_eq!(figures.side_counts[6], 64, "the arrangement stays what it is");
    }
    Ok(())
}

#[test]
fn a_foam_ends_where_a_cell_of_few_sides_is_squeezed_off_its_wall() -> Result<(), NoLayers> {
    // Half the height is once and twice the width of a cell, 1.155.
    let layers =
        |height: f64| made(&FoamSpace::Plane { periods: [5.0, 5.77], height }, Arrangement::Annealed, 25, 1);
    assert_lawful(&layers(2.4)?, 0.0);
    let deep = layers(4.8)?;
    assert_eq!(deep.descended.ending, Ending::Halted, "{:?}", deep.descended);
    let figures = layer_figures(&deep.division);
    let sides = [&figures[0].sides[..], &figures[1].sides].concat();
    assert!(
        !deep.leaving.is_empty() && deep.leaving.iter().all(|&(cell, _)| sides[cell] < 6),
        "{:?}",
        deep.leaving
    );
    Ok(())
}
