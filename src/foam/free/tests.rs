//! A foam taken over from its network, and what becomes of it between walls farther apart.

use super::{
    extruded::taken_over,
    line::Line,
    relax::{Begin, relaxed_from},
    *,
};
use crate::{
    foam::{
        pattern::pattern_of_free,
        relax::{self, Descent, DescentSettings, DescentStep, Ending, RelaxSettings, State, Stop, relax},
        seeds::SeedSettings,
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
        start::start,
    },
    surface::{Gap, WallSide},
};
use std::{error::Error, ops::ControlFlow, sync::LazyLock};

const CELLS: usize = 32;
const SPACE: FoamSpace = FoamSpace::Periodic {
    kind: PeriodicSurface::SchwarzP,
    period: 1.0,
    walls: PeriodicWalls::LevelSet { delta: 0.9 },
};
/// A network's foam in the widest part of the gap that it reaches, and its energy.
fn network() -> Result<(State, Gap, f64), Box<dyn Error>> {
    let (gap, domain) = (SPACE.gap()?, SPACE.domain()?);
    let goes_on = &mut |_| ControlFlow::Continue(());
    let started = start(&gap, &domain, &SeedSettings::new(CELLS, 2), goes_on)?;
    let mut energy = f64::NAN;
    let relaxed = relax(started.network, &gap, &RelaxSettings::default(), &mut |told| {
        energy = told.energy;
        ControlFlow::Continue(())
    })?;
    assert!(matches!(relaxed.stop, Stop::TooWide { .. }), "{:?}", relaxed.stop);
    assert!(relaxed.residuals.force < 1e-10 && (0.5..0.9).contains(&relaxed.state.part));
    Ok((relaxed.state, gap, energy))
}

static NETWORK: LazyLock<(State, Gap, f64)> = LazyLock::new(|| network().unwrap());

/// The same foam in the whole gap.
static WIDE: LazyLock<(Widened, Gap)> = LazyLock::new(|| {
    let (state, gap, _) = &*NETWORK;
    let wide = widened(state, gap, &FreeSettings::of(state), &mut |_| ControlFlow::Continue(())).unwrap();
    (wide, gap.clone())
});

#[test]
fn films_from_wall_to_wall_have_the_energy_of_their_network() -> Result<(), Box<dyn Error>> {
    let (state, gap, energy) = &*NETWORK;
    let narrow = gap.narrowed(state.part);
    let (division, films) = taken_over(state, &narrow, 1);
    assert_eq!(unlawful(&division), []);
    // Both meshes have two elements along each side of a film, and the same nodes.
    let same = crate::foam::energy::energy(&films.complex, &films.places) / energy - 1.0;
    assert!(same.abs() < 1e-12, "{same}");
    let begin = Begin { division, films, fineness: 1, pressures: state.pressures.clone() };
    let foam = relaxed_from(begin, &narrow, &FreeSettings::of(state), &mut |_| ControlFlow::Continue(()))?;
    assert_eq!((foam.descended.ending, foam.flips), (Ending::Converged, 0));
    assert_eq!((foam.twisted_cells(), foam.division.inner_corners()), (0, 0));
    // Nodes within films are spread otherwise than the network's; with so few cells the error of the mesh is some 1e-4.
    assert!((foam.energy / energy - 1.0).abs() < 1.5e-4, "{} {energy}", foam.energy);
    let differ = |(&a, &b): (&f64, &f64)| (a - b).abs();
    let mean = |pressures: &[f64]| pressures.iter().sum::<f64>() / 32.0;
    let (free, network) = (foam.pressures.as_slice(), state.pressures.as_slice());
    let gauge = mean(free) - mean(network);
    let shifted: Vec<f64> = network.iter().map(|pressure| pressure + gauge).collect();
    let worst = free.iter().zip(&shifted).map(differ).fold(0.0, f64::max);
    // Pressures range over ±2.
    assert!(worst < 2e-2, "{worst}");
    // Without a mesh both are the same.
    let goes_on = &mut |_: &DescentStep<'_>| ControlFlow::Continue(());
    let free = extrapolate(&foam, &narrow, &FreeSettings::of(state), goes_on)?.ok_or("no balance")?;
    let network =
        relax::extrapolate(state, &narrow, &RelaxSettings::default(), &mut || ControlFlow::Continue(()))?;
    let network = network.ok_or("no balance of the network")?;
    let apart = |a: f64, b: f64| (a / b - 1.0).abs();
    assert!(
        apart(free.limit, network.limit)
            < 0.05 * apart(free.energy, free.limit).min(apart(*energy, network.limit)),
        "{free:?} {network:?}"
    );
    Ok(())
}

#[test]
fn walls_farther_apart_change_neighbours_on_one_wall_and_keep_all_laws() -> Result<(), Box<dyn Error>> {
    let (wide, gap) = &*WIDE;
    let foam = &wide.foam;
    assert_eq!((wide.obstacle, wide.part), (None, 1.0));
    assert!(
        wide.flips > 0 && foam.twisted_cells() > 0 && foam.division.inner_corners() > 0,
        "{}",
        wide.flips
    );
    assert!(foam.descended.residuals.force < 1e-10 && foam.descended.unstable == 0, "{:?}", foam.descended);
    assert_eq!(unlawful(&foam.division), []);
    for wall in WallSide::BOTH {
        let pattern = pattern_of_free(foam, gap, wall).map_err(|defects| format!("{defects:?}"))?;
        assert_eq!(pattern.charge(), -24, "{wall:?}");
    }
    assert!(foam.volume_spread() < 1e-11, "{}", foam.volume_spread());
    // The part of a period where |Φ| < 0.9, by an integral over z in closed form and 4000 × 4000 lines.
    let total: f64 = foam.volumes.iter().sum();
    assert!((total / 0.515_543_0 - 1.0).abs() < 2e-6, "{total}");
    Ok(())
}

#[test]
fn a_pressure_is_what_the_energy_costs_per_volume() -> Result<(), Box<dyn Error>> {
    let foam = &WIDE.0.foam;
    let (a, b) = (0, 1);
    let energy = |by: f64| -> Result<f64, Box<dyn Error>> {
        let mut wanted = foam.volumes.clone();
        let [first, second] = [a, b].map(crate::index::Id::from_index);
        let step = by * wanted[first];
        wanted[first] += step;
        wanted[second] -= step;
        let (complex, places) = (foam.films.complex.clone(), foam.places().clone());
        let mut descent = Descent::new(complex, wanted, places, foam.pressures.clone())?;
        let settings =
            DescentSettings { length: 0.3, tolerance: 1e-9, volume_tolerance: 1e-11, step_limit: 30 };
        let ended = descent.descend(&settings, &mut |_| ControlFlow::Continue(()))?;
        assert_eq!(ended.ending, Ending::Converged);
        Ok(descent.energy())
    };
    let part = 1e-3;
    let pressures = foam.pressures.as_slice();
    let slope = (energy(part)? - energy(-part)?) / (2.0 * part * foam.volumes.as_slice()[a]);
    let expected = pressures[a] - pressures[b];
    // Nodes inside films are slaved to their borders, so that the mesh has a part in the difference.
    assert!((slope - expected).abs() < 1e-3, "{slope} {expected}");
    Ok(())
}

#[test]
fn borders_meet_at_the_tetrahedral_angle_as_the_mesh_is_refined() -> Result<(), Box<dyn Error>> {
    let (wide, gap) = &*WIDE;
    let off = |foam: &FreeFoam| {
        let angles = corner_angles(foam);
        let count = f64::from(crate::index::checked_u32(angles.len()));
        angles.iter().map(|angle| (angle - tetrahedral_angle()).abs()).sum::<f64>() / count
    };
    let foam = &wide.foam;
    let films = finer::films_finer(&foam.division, gap, 2, (&foam.films, 1));
    let (division, pressures) = (foam.division.clone(), foam.pressures.clone());
    let begin = Begin { division, films, fineness: 2, pressures };
    let settings = FreeSettings { fineness: 2, tolerance: 1e-6, ..FreeSettings::of(&NETWORK.0) };
    let finer = relaxed_from(begin, gap, &settings, &mut |_| ControlFlow::Continue(()))?;
    assert_eq!((finer.descended.ending, finer.flips), (Ending::Converged, 0));
    let (coarse, fine) = (off(foam), off(&finer));
    // Some borders are as short as the coarse elements, so that the order of tangents, two, is not seen yet.
    assert!(fine < 0.1 && fine < 0.7 * coarse, "{coarse} {fine}");
    Ok(())
}

#[test]
fn the_energy_is_the_foams_wherever_its_nodes_lay() -> Result<(), Box<dyn Error>> {
    let (wide, gap) = &*WIDE;
    let foam = &wide.foam;
    let mut films = foam.films.clone();
    for nodes in films.borders.values().chain(films.wall_edges.values()) {
        let places: Vec<_> = nodes.iter().map(|&node| films.complex.place(&films.places, node)).collect();
        let (line, last) = (Line::new(&places), nodes.len() - 1);
        for (at, image) in nodes.iter().enumerate().take(last).skip(1) {
            let part = crate::foam::convert::as_f64(at) / crate::foam::convert::as_f64(last);
            films.places[image.node] = line.at(line.at_length(part + 0.2 * part * (1.0 - part)));
        }
    }
    let energy = |spreads_evenly| -> Result<f64, Box<dyn Error>> {
        let (division, films) = (foam.division.clone(), films.clone());
        let begin = Begin { division, films, fineness: 1, pressures: foam.pressures.clone() };
        let settings = FreeSettings { spreads_evenly, ..FreeSettings::of(&NETWORK.0) };
        let again = relaxed_from(begin, gap, &settings, &mut |_| ControlFlow::Continue(()))?;
        assert_eq!((again.descended.ending, again.flips), (Ending::Converged, 0));
        Ok(again.energy)
    };
    let off = |energy: f64| (energy / foam.energy - 1.0).abs();
    // Spreading ends at a change of 1e-12.
    assert!(off(energy(true)?) < 1e-11, "{:e}", off(energy(true)?));
    assert!(off(energy(false)?) > 1e-7, "{:e}", off(energy(false)?));
    Ok(())
}

#[test]
fn finer_films_lie_on_the_coarser_ones() -> Result<(), Box<dyn Error>> {
    let (wide, gap) = &*WIDE;
    let foam = &wide.foam;
    let films = finer::films_finer(&foam.division, gap, 2, (&foam.films, 1));
    let laid = crate::foam::energy::energy(&films.complex, &films.places);
    // The same surface but where films end: the ends of these large ones lie off the curved walls between their nodes.
    assert!((laid / foam.energy - 1.0).abs() < 2e-3, "{:e}", laid / foam.energy - 1.0);
    Ok(())
}

#[test]
fn each_broken_law_is_told() -> Result<(), Box<dyn Error>> {
    let (wide, _) = &*WIDE;
    let sound = &wide.foam.division;
    // A film that is missing leaves a hole in two cells, and in what they cover of walls.
    let mut holed = sound.clone();
    let film = holed.polygons.remove(0);
    let found = unlawful(&holed);
    for cell in [film.cell, film.neighbour] {
        assert!(found.contains(&Unlawful::Cell { cell, found: 1 }), "{found:?}");
    }
    assert!(found.iter().any(|law| matches!(law, Unlawful::Patch { loops: 0, .. })), "{found:?}");
    assert!(found.iter().any(|law| matches!(law, Unlawful::Euler { .. })), "{found:?}");
    // Layers that touch both walls are no two layers.
    let layered = Division { stacking: Stacking::Two { lower: CELLS / 2 }, ..sound.clone() };
    let found = unlawful(&layered);
    let through = |law: &&Unlawful| matches!(law, Unlawful::Wall { touches: true, .. });
    assert_eq!(found.iter().filter(through).count(), CELLS);
    // A film that ends inside the gap instead of on the wall: its cells no longer close there.
    let mut torn = sound.clone();
    let corner = torn.corners.iter().position(|corner| corner.wall.is_some()).ok_or("no corner on a wall")?;
    torn.corners[corner].wall = None;
    assert!(!unlawful(&torn).is_empty());
    Ok(())
}
