use super::*;
use crate::{
    foam::{
        audit::audit,
        energy::energy,
        network::tests::hexagons,
        seeds::SeedSettings,
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
        start::start,
        volume::{Reference, volumes},
    },
    surface::{LevelSet, Plane},
};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::{error::Error, fs, sync::Arc};

/// Flat foams of the reference, from dumps of the string model.
mod flat_foam {
    use crate::{
        foam::network::{CellId, CellRing, Network, RingCorner, VertexId},
        index::{Id, IndexVec},
        surface::Period,
    };
    use glam::{DVec3, IVec3};
    use std::collections::BTreeMap;

    include!("../../../tests/support/flat_foam.rs");

    pub(super) fn network(text: &str, periods: [f64; 2]) -> Option<Network> {
        flat_network(text, periods)
    }
}

const HEIGHT: f64 = 0.5;

fn crooked_hexagons() -> (Network, Gap) {
    let mut network = hexagons(4, 4);
    let [Some(x), Some(y), None] = network.period().0 else { panic!("a flat torus") };
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut noise = || random.random_range(-0.1..0.1);
    for vertex in network.vertices() {
        let place = network.position(vertex) + DVec3::new(noise(), noise(), 0.0);
        network.set_position(vertex, place);
    }
    let plane: Arc<dyn LevelSet> = Arc::new(Plane { periods: [x, y] });
    (network, Gap::between(plane, [-0.5 * HEIGHT, 0.5 * HEIGHT]).unwrap())
}

#[test]
fn crooked_hexagons_become_the_hexagonal_foam() {
    let (network, gap) = crooked_hexagons();
    let mut last = 0.0;
    let relaxed = relax(network, &gap, &RelaxSettings::default(), &mut |told| {
        last = told.energy;
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(matches!(relaxed.stop, Stop::Converged { .. }), "{:?}", relaxed.stop);
    assert_eq!(relaxed.unstable, 0);
    // Films are flat: the energy of cells of area 1 is exact, h √(2√3) each.
    let exact = 16.0 * HEIGHT * (2.0 * 3.0_f64.sqrt()).sqrt();
    assert!((last - exact).abs() < 1e-12 * exact, "{last} {exact}");
}

#[test]
fn a_state_read_back_goes_on_to_the_same_foam() {
    let (network, gap) = crooked_hexagons();
    let settings = RelaxSettings::default();
    let mut saved = None;
    let stopped = relax(network, &gap, &settings, &mut |told| {
        saved = Some(serde_json::to_string(told.state).unwrap());
        ControlFlow::Break(())
    })
    .unwrap();
    assert_eq!(stopped.stop, Stop::Interrupted { steps: 1 });
    let read: State = serde_json::from_str(&saved.unwrap()).unwrap();
    let go_on = |state| resume(state, &gap, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let (a, b) = (go_on(stopped.state), go_on(read));
    assert!(matches!(a.stop, Stop::Converged { .. }));
    assert_eq!(a.state.places, b.state.places);
}

#[test]
fn shares_must_be_one_positive_number_for_each_cell() {
    let (network, gap) = crooked_hexagons();
    for shares in [vec![1.0; 3], vec![0.0; 16], vec![f64::NAN; 16]] {
        let settings = RelaxSettings { shares: Some(shares), ..RelaxSettings::default() };
        let refused = relax(network.clone(), &gap, &settings, &mut |_| ControlFlow::Continue(()));
        assert!(matches!(refused, Err(RelaxError::Shares { .. })));
    }
}

/// Where walls lie far apart on the P-surface, films are squeezed to nothing on one wall: a foam of one layer ends there.
#[test]
fn a_gap_is_widened_as_far_as_there_is_a_foam_and_the_pinch_is_told() -> Result<(), Box<dyn Error>> {
    let walls = PeriodicWalls::LevelSet { delta: 0.86 };
    let space = FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 1.0, walls };
    let (relaxed, gap) = foam(space, 64, &meshed(2, 1))?;
    let Stop::TooWide { part, pinch: Some(pinch), .. } = relaxed.stop else {
        panic!("{:?} with {:?}", relaxed.stop, relaxed.residuals);
    };
    let state = &relaxed.state;
    assert!((state.part - part).abs() < 1e-15 && (0.5..1.0).contains(&part), "{part}");
    // A film that is all but gone on one wall and an ordinary one on the other.
    assert!(pinch.short < 0.1 && pinch.long > 0.3, "{pinch:?}");
    // What is kept is a foam in balance in the part that was reached.
    assert!(relaxed.residuals.force < 1e-10 && relaxed.unstable == 0, "{:?}", relaxed.residuals);
    let narrowed = gap.narrowed(part);
    let complex = state.strips.complex(&state.network, &narrowed);
    let held = volumes(&complex, &state.places, &Reference::new(&complex, &state.places));
    let total: f64 = held.iter().sum();
    // The gap's volume is measured with 40 lines per axis, which is good to 1e-4.
    assert!((total / crate::foam::gap_volume(&narrowed, &space.domain()?) - 1.0).abs() < 1e-4);
    let worst = held.iter().map(|volume| (64.0 * volume / total - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-10, "{worst:e}");
    Ok(())
}

/// Films between planes are cylinders whatever the height, but with cells of five and seven sides among hexagons they are no
/// minimum where the planes lie more than four or five widths of a cell apart: the foam is had between nearer ones then.
#[test]
fn a_flat_foam_too_deep_for_its_cells_is_had_between_nearer_walls() -> Result<(), Box<dyn Error>> {
    let flat = |height| foam(FoamSpace::Plane { periods: [8.0, 8.0], height }, 64, &meshed(2, 1));
    let (deep, _) = flat(6.0)?;
    let Stop::TooWide { part, .. } = deep.stop else { panic!("{:?} with {:?}", deep.stop, deep.residuals) };
    assert!((2.0..5.0).contains(&(6.0 * part)), "{part}");
    assert!(deep.residuals.force < 1e-10 && deep.unstable == 0, "{:?}", deep.residuals);
    let (shallow, gap) = flat(0.5)?;
    let per_height = |relaxed: &Relaxed, gap: &Gap, height: f64| {
        let complex = relaxed.state.strips.complex(&relaxed.state.network, gap);
        energy(&complex, &relaxed.state.places) / height
    };
    let narrowed = FoamSpace::Plane { periods: [8.0, 8.0], height: 6.0 }.gap()?.narrowed(part);
    let ratio = per_height(&deep, &narrowed, 6.0 * part) / per_height(&shallow, &gap, 0.5);
    // Forces of 1e-10 leave the energy at its least to rounding.
    assert!((ratio - 1.0).abs() < 1e-11, "{ratio}");
    Ok(())
}

/// N = 20 on a sphere is one that plain starts miss by 0.3 %; disturbances find the table's.
#[test]
fn annealing_finds_the_least_partition_of_a_sphere_that_plain_starts_miss() -> Result<(), Box<dyn Error>> {
    let settings = meshed(2, 1);
    let (plain, gap) = foam(SPHERES, 20, &settings)?;
    let domain = SPHERES.domain()?;
    let annealed = |cycles| {
        let settle = AnnealSettings { cycles, seed: 1 };
        anneal(plain.clone(), &gap, &domain, &settings, settle, &mut |_| ControlFlow::Continue(()))
    };
    let found = annealed(60)?;
    assert!(matches!(found.relaxed.stop, Stop::Converged { .. }));
    assert!(found.after < found.before * (1.0 - 1e-3), "{} {}", found.before, found.after);
    let extrapolated = extrapolate(&found.relaxed.state, &gap, &settings, &mut || ControlFlow::Continue(()))?;
    let limit = extrapolated.ok_or("the finer mesh did not settle")?.limit;
    let length = limit * 2.0 / (1.05_f64.powi(2) - 1.0);
    // Films of this foam are not quite planes: in a gap of a twentieth the difference is below 1e-7.
    assert!((length / 28.999_172_41 - 1.0).abs() < 2e-7, "{length}");
    // Nothing to find: the same foam comes back.
    assert_eq!(annealed(0)?.after.to_bits(), found.before.to_bits());
    Ok(())
}

const P: FoamSpace = FoamSpace::Periodic {
    kind: PeriodicSurface::SchwarzP,
    period: 1.0,
    walls: PeriodicWalls::LevelSet { delta: 0.2 },
};
const SPHERES: FoamSpace = FoamSpace::Sphere { radii: [1.0, 1.05] };

/// A settled foam of `cells` cells from few sweeps.
fn foam(space: FoamSpace, cells: usize, settings: &RelaxSettings) -> Result<(Relaxed, Gap), Box<dyn Error>> {
    let (gap, domain) = (space.gap()?, space.domain()?);
    let mut seeds = SeedSettings::new(cells, 1);
    seeds.anneal.sweeps = 100;
    let start = start(&gap, &domain, &seeds, &mut |_| ControlFlow::Continue(()))?;
    let network = start.network;
    let relaxed = relax(network, &gap, settings, &mut |_| ControlFlow::Continue(()))?;
    Ok((relaxed, gap))
}

fn energy_of(state: &State, gap: &Gap) -> f64 {
    energy(&state.strips.complex(&state.network, gap), &state.places)
}

fn meshed(along: usize, through: usize) -> RelaxSettings {
    RelaxSettings { strips: Strips { along, through }, ..RelaxSettings::default() }
}

/// Films between spheres that are planes through the centre: E = L (r₂² − r₁²)/2 with the length L on the unit sphere.
#[test]
fn planar_films_between_spheres_have_their_exact_energy_and_the_error_falls_with_the_fourth_power() {
    let third: f64 = 1.0 / 3.0;
    for (cells, length) in
        [(4, 6.0 * (-third).acos()), (6, 12.0 * third.acos()), (12, 30.0 * (5.0_f64.sqrt() / 3.0).acos())]
    {
        let exact = length * (1.05_f64.powi(2) - 1.0) / 2.0;
        let errors = [4, 8].map(|along| {
            let (relaxed, gap) = foam(SPHERES, cells, &meshed(along, 1)).unwrap();
            assert!(matches!(relaxed.stop, Stop::Converged { .. }), "{cells}: {:?}", relaxed.stop);
            energy_of(&relaxed.state, &gap) - exact
        });
        let order = (errors[0] / errors[1]).log2();
        // An element's share of the tetrahedral foam still turns by 14°: 4 up to a tenth.
        assert!((order - 4.0).abs() < 0.2, "{cells} cells: order {order}");
        let extrapolated = (16.0 * errors[1] - errors[0]) / 15.0;
        assert!((extrapolated / exact).abs() < 1e-6, "{cells} cells: {extrapolated:e}");
    }
}

/// The table of least partitions found: N = 32 is one that plain starts find, with 12 pentagons and 20 hexagons.
#[test]
fn thirty_two_cells_on_a_sphere_are_the_tables() {
    let energies = [4, 8].map(|along| {
        let (relaxed, gap) = foam(SPHERES, 32, &meshed(along, 1)).unwrap();
        energy_of(&relaxed.state, &gap)
    });
    let extrapolated = (16.0 * energies[1] - energies[0]) / 15.0;
    // Films of this foam are planar to the digits compared: the reference's own 3D value agrees.
    let length = extrapolated * 2.0 / (1.05_f64.powi(2) - 1.0);
    assert!((length / 36.931_031_72 - 1.0).abs() < 1e-7, "{length}");
}

#[test]
fn the_reference_foam_between_plates_has_the_energy_of_its_two_dimensional_limit() {
    let Ok(text) = fs::read_to_string("../shared/fe/foams/flat2d_64.fe") else {
        return println!("skipped: ../shared/fe/foams/flat2d_64.fe is not here");
    };
    let network = flat_foam::network(&text, [8.0, 8.0]).unwrap();
    let plane: Arc<dyn LevelSet> = Arc::new(Plane { periods: [8.0, 8.0] });
    let gap = Gap::between(plane, [-0.25, 0.25]).unwrap();
    let relaxed = relax(network, &gap, &meshed(4, 1), &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(matches!(relaxed.stop, Stop::Converged { .. }), "{:?}", relaxed.stop);
    let energy = energy_of(&relaxed.state, &gap);
    // The same network with circular arcs for films, without any mesh (`analysis/flat_foam_exact.py`). The reference's
    // 61.5290265 is that of Evolver's quadratic edges, 2.7e-7 too high. Four elements along an arc of at most 0.3 rad err by
    // less than 1e-9.
    let exact = 61.529_010_049_4;
    assert!((energy / exact - 1.0).abs() < 1e-8, "{energy}");
}

#[test]
fn random_cells_between_plates_settle_by_t1s_and_keep_every_law() -> Result<(), Box<dyn Error>> {
    let space = FoamSpace::Plane { periods: [6.0, 6.0], height: 0.5 };
    let (gap, domain) = (space.gap()?, space.domain()?);
    for seed in [1, 2] {
        let mut seeds = SeedSettings::new(36, seed);
        (seeds.anneal.sweeps, seeds.polish.steps) = (0, 0);
        let start = start(&gap, &domain, &seeds, &mut |_| ControlFlow::Continue(()))?;
        let network = start.network;
        let settings = RelaxSettings::default();
        let relaxed = relax(network, &gap, &settings, &mut |_| ControlFlow::Continue(()))?;
        assert!(matches!(relaxed.stop, Stop::Converged { .. }), "seed {seed}: {:?}", relaxed.stop);
        assert!(relaxed.state.flips > 0);
        assert_eq!(relaxed.state.network.defects(), []);
        let hexagonal = 36.0 * 0.5 * (2.0 * 3.0_f64.sqrt()).sqrt();
        // Hales' honeycomb theorem: no foam of these cells has less.
        assert!(energy_of(&relaxed.state, &gap) > hexagonal);
    }
    Ok(())
}

#[test]
fn the_energy_grows_with_a_volume_as_the_pressure_says() -> Result<(), Box<dyn Error>> {
    let (relaxed, gap) = foam(SPHERES, 9, &meshed(3, 1))?;
    let state = &relaxed.state;
    let complex = state.strips.complex(&state.network, &gap);
    let total: f64 = volumes(&complex, &state.places, &Reference::new(&complex, &state.places)).iter().sum();
    let least = state.network.cells().min_by_key(|&cell| state.network.sides(cell)).ok_or("no cells")?;
    let most = state.network.cells().max_by_key(|&cell| state.network.sides(cell)).ok_or("no cells")?;
    let change = 1e-4;
    let at = |sign: f64| -> Result<f64, Box<dyn Error>> {
        let mut other = state.clone();
        other.shares[least] += sign * change;
        other.shares[most] -= sign * change;
        let moved = resume(other, &gap, &meshed(3, 1), &mut |_| ControlFlow::Continue(()))?;
        Ok(energy_of(&moved.state, &gap))
    };
    let slope = (at(1.0)? - at(-1.0)?) / (2.0 * change * total);
    let pressure = state.pressures[State::region(least)] - state.pressures[State::region(most)];
    // Central differences err by the square of a thousandth of a cell; nodes are spread anew, which costs 1e-8 of E.
    assert!((slope / pressure - 1.0).abs() < 1e-3, "{slope} {pressure}");
    Ok(())
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_one_thread_and_on_two_and_obeys_the_thin_law() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| foam(P, 40, &RelaxSettings::default()).unwrap())
    };
    let ((one, gap), (two, _)) = (on(1), on(2));
    assert!(matches!(one.stop, Stop::Converged { .. }), "{:?}", one.stop);
    assert_eq!(serde_json::to_string(&one.state).unwrap(), serde_json::to_string(&two.state).unwrap());
    let audit = audit(&one.state, &gap);
    // The law is that of a thin gap: with 40 cells 0.99985 is seen, with 256 cells 0.99998; without the gap's slope 0.9.
    assert!(audit.correlation.unwrap() > 0.9995, "{audit:?}");
}
