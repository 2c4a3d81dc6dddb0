//! Single bubbles against exact and independently measured figures.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail by a panic, too")]

use combwright::{
    foam::{
        bubble::{Chart, Meshes, NoBubble, ThinGap, cluster, flat_perimeter, held, landing, settled},
        relax::Ending,
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
    },
    surface::Gap,
};
use glam::DVec3;
use std::f64::consts::PI;

fn gap(space: FoamSpace) -> Gap {
    space.gap().unwrap()
}

fn p_gap() -> Gap {
    let walls = PeriodicWalls::LevelSet { delta: 0.2 };
    gap(FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 1.0, walls })
}

/// The flat point of three-fold symmetry and the neck.
const FLAT: DVec3 = DVec3::splat(0.25);
const NECK: DVec3 = DVec3::new(0.0, 0.5, 0.25);

#[test]
fn bubbles_between_spheres_have_the_energy_and_the_pressure_of_the_shooting_method() -> Result<(), NoBubble> {
    // Radii, volume, energy, pressure: surfaces of constant mean curvature by shooting, to the digits given. Where the bubble
    // is as wide as the sphere's radius, the limit of the meshes errs by a few 1e-9.
    for (radii, volume, energy, pressure, tolerance) in [
        ([20.0, 20.5], 0.5, 1.772_233_011, 1.771_897_383_6, 1e-9),
        ([1.0, 1.1], 0.05, 0.246_008_108_196, 2.368_057_698_5, 2e-9),
        ([1.0, 1.1], 0.3, 0.543_320_254_121, 0.655_499_685_7, 2e-8),
        ([1.0, 1.2], 0.5, 1.023_571_695_913, 0.822_840_897_3, 2e-8),
        ([1.0, 1.5], 0.5, 1.715_121_599_043, 1.626_410_986_6, 1e-8),
        ([1.0, 1.5], 2.0, 3.147_505_123_224, 0.589_074_254_2, 2e-8),
    ] {
        let gap = gap(FoamSpace::Sphere { radii });
        let place = 0.5 * (radii[0] + radii[1]) * DVec3::new(0.6, 0.0, 0.8);
        let bubble = held(&gap, volume, place, &Meshes::fine())?;
        let (off, push) = ((bubble.energy - energy).abs(), bubble.force.length());
        println!(
            "spheres {radii:?}, V {volume}: E {:.12}, off {off:.1e}; p {:.10}, off {:.1e}",
            bubble.energy,
            bubble.pressure,
            (bubble.pressure - pressure).abs()
        );
        assert!(off < tolerance && (bubble.pressure - pressure).abs() < 40.0 * tolerance, "{bubble:?}");
        // A sphere pushes nowhere.
        assert!(push < 1e-12 && bubble.residual < 1e-12, "{push} {}", bubble.residual);
    }
    Ok(())
}

#[test]
fn a_torus_pushes_to_its_outer_equator_as_thin_gaps_say() -> Result<(), NoBubble> {
    let thin = gap(FoamSpace::Torus { ring: 5.0, tubes: [0.995, 1.005] });
    let volume = PI * 0.03 * 0.03 * 0.01;
    for (x, measured, formula) in [(6.0, -1.913_255e-5, -1.913_468e-5), (4.0, 2.989_201e-5, 2.989_258e-5)] {
        let bubble = held(&thin, volume, DVec3::new(x, 0.0, 0.0), &Meshes::fine())?;
        let here = ThinGap::at(&Chart::new(&thin, bubble.place)?)?;
        let excess = |energy: f64| energy / here.flat_energy(volume) - 1.0;
        println!(
            "torus at {x}: {:.6e} by films, {:.6e} by the formula",
            excess(bubble.energy),
            excess(here.energy(volume))
        );
        // The last digit of the measured figure, and of the formula as printed.
        assert!((excess(bubble.energy) - measured).abs() < 1e-11, "{}", excess(bubble.energy));
        assert!((excess(here.energy(volume)) - formula).abs() < 1e-11, "{}", excess(here.energy(volume)));
    }
    let wide = gap(FoamSpace::Torus { ring: 5.0, tubes: [0.9, 1.0] });
    for (x, energy, falling) in [(5.95, 0.079_233_726_4, 0), (4.05, 0.079_319_317_8, 1)] {
        let place = DVec3::new(x, 0.0, 0.0);
        let bubble = held(&wide, 0.005, place, &Meshes::fine())?;
        assert!((bubble.energy - energy).abs() < 1e-10, "{}", bubble.energy);
        let landing = landing(&wide, 0.005, place)?;
        assert_eq!((landing.falling, landing.rigid), (falling, 1), "{landing:?}");
    }
    Ok(())
}

#[test]
fn bubbles_on_the_p_surface_change_from_flat_points_to_necks_as_they_grow() -> Result<(), NoBubble> {
    let gap = p_gap();
    // Volume, energies at the flat point (measured to 1e-7) and at the neck (`analysis/README_bubble.md`: a global expansion,
    // converged to 1e-11), falling directions at both. The largest bubbles bend round the neck, and the limit of the meshes
    // errs there by up to 1e-6.
    for (volume, flat, neck, falling) in [
        (0.0005, 0.015_526_558, 0.019_732_225_087, [0, 2]),
        (0.002, 0.032_976_688, 0.037_656_858_728, [0, 2]),
        (0.004, 0.050_112_830, 0.051_530_047_914, [0, 0]),
        (0.005, 0.057_853_460, 0.057_123_535_412, [0, 0]),
        (0.007, 0.072_373_044, 0.067_138_201_779, [2, 0]),
        (0.010, 0.091_995_94, 0.080_823_231_223, [2, 0]),
    ] {
        for (place, energy, falling, tolerance) in
            [(FLAT, flat, falling[0], 3e-7), (NECK, neck, falling[1], 1.5e-6)]
        {
            let bubble = held(&gap, volume, place, &Meshes::fine())?;
            let off = bubble.energy / energy - 1.0;
            println!("P, V {volume} at {place}: E {:.10}, off {off:.1e} of the reference", bubble.energy);
            assert!(off.abs() < tolerance, "{}", bubble.energy);
            let landing = landing(&gap, volume, place)?;
            assert_eq!((landing.falling, bubble.unstable_shapes), (falling, 0), "{volume}: {landing:?}");
        }
    }
    Ok(())
}

#[test]
fn free_bubbles_slide_to_where_they_are_stable() -> Result<(), NoBubble> {
    let torus = gap(FoamSpace::Torus { ring: 5.0, tubes: [0.9, 1.0] });
    let end = settled(&torus, 0.005, DVec3::new(4.4, 0.0, 0.75), &Meshes::medium())?;
    assert!(end.is_minimum(), "{:?}", end.landing);
    let place = end.bubble.place;
    assert!((place.x.hypot(place.y) - 5.95).abs() < 1e-6 && place.z.abs() < 1e-4, "{place}");
    let end = settled(&p_gap(), 0.01, FLAT, &Meshes::medium())?;
    // A neck: two coordinates at quarters, the third at a multiple of a half.
    let mut from_neck = end.bubble.place.to_array().map(|x| (4.0 * x - (4.0 * x).round()).abs());
    from_neck.sort_by(f64::total_cmp);
    assert!(end.is_minimum() && from_neck[2] < 1e-6, "{} {:?}", end.bubble.place, end.landing);
    assert!(end.bubble.energy < 0.0809, "{}", end.bubble.energy);
    Ok(())
}

#[test]
fn touching_bubbles_between_planes_are_those_of_the_plane() -> Result<(), NoBubble> {
    const GAP: f64 = 0.2;
    let plane = gap(FoamSpace::Plane { periods: [4.0, 4.0], height: GAP });
    // The perimeter of two: 8π/3 + √3 over the root of the area 2π/3 + √3/4 of one.
    assert!((flat_perimeter(2).unwrap() - 6.359_129_254).abs() < 1e-9);
    for volumes in [&[0.02, 0.02][..], &[0.02; 3], &[0.02, 0.04]] {
        let cluster = cluster(&plane, volumes, DVec3::ZERO)?;
        assert_eq!((cluster.descended.ending, cluster.descended.unstable), (Ending::Converged, 0));
        // In the plane a stretch by a factor f takes the perimeter by f and the areas by f²: E = 2 Σ p V.
        let work: f64 = 2.0 * cluster.pressures.iter().zip(volumes).map(|(p, v)| p * v).sum::<f64>();
        assert!((work / cluster.energy - 1.0).abs() < 1e-7, "{volumes:?}: {work} {}", cluster.energy);
        if volumes.iter().all(|v| (v - volumes[0]).abs() < 1e-12) {
            let exact = flat_perimeter(volumes.len()).unwrap() * (volumes[0] * GAP).sqrt();
            let off = cluster.energy / exact - 1.0;
            println!("{} bubbles between planes: E {:.12}, off {off:.1e}", volumes.len(), cluster.energy);
            assert!(off.abs() < 1e-8);
        }
        // Tangents of quadratic elements at their ends: a first-order measure on arcs of 240° in 18 elements.
        assert!(cluster.border_angle_error() < 0.02, "{}", cluster.border_angle_error());
    }
    Ok(())
}

#[test]
fn pressures_of_touching_bubbles_are_the_slopes_of_their_energy() -> Result<(), NoBubble> {
    let sphere = gap(FoamSpace::Sphere { radii: [1.0, 1.1] });
    for (gap, volume, place) in [(p_gap(), 0.002, FLAT), (sphere, 0.02, 1.05 * DVec3::Z)] {
        for count in [2, 3] {
            let at = |change: f64| {
                let mut volumes = vec![volume; count];
                volumes[0] += change * volume;
                cluster(&gap, &volumes, place)
            };
            let (here, more, less) = (at(0.0)?, at(1e-3)?, at(-1e-3)?);
            assert_eq!((here.descended.ending, here.descended.unstable), (Ending::Converged, 0), "{place}");
            let slope = (more.energy - less.energy) / (2e-3 * volume);
            // The limits of the meshes err by about 1e-9 of the energy, over a change of the volume of 2e-3.
            assert!(
                (slope / here.pressures[0] - 1.0).abs() < 1e-5,
                "{count} at {place}: {slope} {:?}",
                here.pressures
            );
        }
    }
    assert!(matches!(cluster(&p_gap(), &[0.001; 4], FLAT), Err(NoBubble::Count { count: 4 })));
    Ok(())
}

#[test]
fn the_force_is_the_slope_of_the_energy() -> Result<(), NoBubble> {
    let gap = p_gap();
    let chart = Chart::new(&gap, DVec3::new(0.1, 0.3, 0.3))?;
    let energy = |place| Ok(held(&gap, 0.003, place, &Meshes::medium())?.energy);
    let bubble = held(&gap, 0.003, chart.place(), &Meshes::medium())?;
    let step = 2e-3;
    for axis in chart.axes() {
        let slope =
            (energy(chart.place() + step * axis)? - energy(chart.place() - step * axis)?) / (2.0 * step);
        // Differences err by the square of the step over the size of the bubble, 2e-4, and by the meshes.
        assert!(
            (bubble.force.dot(axis) + slope).abs() < 2e-3 * bubble.force.length(),
            "{} {slope}",
            bubble.force.dot(axis)
        );
    }
    Ok(())
}

#[test]
fn bubbles_that_cannot_be_are_refused() {
    let sphere = gap(FoamSpace::Sphere { radii: [1.0, 1.1] });
    let meshes = Meshes::coarse();
    let north = DVec3::Z * 1.05;
    assert!(matches!(held(&sphere, -1.0, north, &meshes), Err(NoBubble::Volume { .. })));
    assert!(matches!(held(&sphere, 0.1, 3.0 * north, &meshes), Err(NoBubble::OffSurface { .. })));
    assert!(held(&sphere, 5.0, north, &meshes).is_err(), "the gap holds 1.39");
    let plane = gap(FoamSpace::Plane { periods: [1.0, 1.0], height: 0.1 });
    assert!(matches!(held(&plane, 0.09, DVec3::ZERO, &meshes), Err(NoBubble::Touches { .. })));
}
