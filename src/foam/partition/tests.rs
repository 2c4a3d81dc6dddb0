//! The laws of partitions.

use super::*;
use crate::{
    foam::{
        domain::Axis,
        seeds::{SeedSettings, sow},
    },
    index::Id,
    surface::{GapError, LevelSet, Plane, SchwarzP, Sphere, Torus},
    units::LevelOffset,
};
use rand::{RngExt, SeedableRng};
use std::{collections::BTreeMap, f64::consts::PI, ops::ControlFlow, sync::Arc};

type Tested = Result<(), Box<dyn std::error::Error>>;

fn quick_seeds(gap: &Gap, domain: &Domain, count: usize, seed: u64) -> Vec<DVec3> {
    let mut settings = SeedSettings::new(count, seed);
    settings.anneal.sweeps = 200;
    sow(gap, domain, &settings, 0, &mut |_| ControlFlow::Continue(())).unwrap().points
}

fn partitioned(gap: &Gap, count: usize, seed: u64) -> Partition {
    let domain = Domain::of_surface(gap.middle().as_ref());
    match Partition::new(gap, &domain, &quick_seeds(gap, &domain, count, seed)) {
        Ok(partition) => partition,
        Err(defects) => panic!("{count} cells on {}: {defects:?}", gap.middle().name()),
    }
}

fn schwarz_p() -> Result<Gap, GapError> {
    Gap::level_set(Arc::new(SchwarzP { period: 1.0 }), LevelOffset(0.2))
}

fn sphere() -> Result<Gap, GapError> {
    Gap::between(Arc::new(Sphere { radius: 1.025 }), [-0.025, 0.025])
}

fn torus() -> Result<Gap, GapError> {
    Gap::between(Arc::new(Torus { ring: 5.0, tube: 0.95 }), [-0.05, 0.05])
}

fn plane() -> Result<Gap, GapError> {
    Gap::between(Arc::new(Plane { periods: [8.0, 7.0] }), [-0.25, 0.25])
}

/// The area of the nodal P-surface of period 1, and the volume of |Φ| < 0.2: reference figures of 15 and 14 digits.
const AREA_OF_P: f64 = 2.352_566_800_109_08;
const VOLUME_OF_P: f64 = 0.114_158_996_552_87;

#[test]
fn volumes_fill_the_gap_exactly() -> Tested {
    let width = 0.048;
    let cases = [
        (schwarz_p()?, 64, VOLUME_OF_P),
        (sphere()?, 32, 4.0 / 3.0 * PI * (1.05_f64.powi(3) - 1.0)),
        (torus()?, 60, 2.0 * PI * PI * 5.0 * (1.0 - 0.81)),
        (plane()?, 30, 28.0),
        // Steiner's formula with ∫ K dA = 2πχ = −8π.
        (
            Gap::parallel(Arc::new(SchwarzP { period: 1.0 }), width, 0.0)?,
            40,
            width * AREA_OF_P - 8.0 * PI * width.powi(3) / 12.0,
        ),
    ];
    for (gap, count, exact) in cases {
        let volume = partitioned(&gap, count, 1).volume();
        // Eight Gauss points per piece leave 1e-11 where a cell of the P-surface is a quarter of a period wide.
        assert!((volume / exact - 1.0).abs() < 1e-9, "{}: {volume} is not {exact}", gap.middle().name());
    }
    let volume = partitioned(&schwarz_p()?, 200, 1).volume();
    assert!((volume - VOLUME_OF_P).abs() < 2e-13, "smaller cells: {volume}");
    Ok(())
}

#[test]
fn every_network_obeys_euler() -> Tested {
    let cases: [(Gap, &[usize]); 4] = [
        (schwarz_p()?, &[40, 57, 100]),
        // Eight seeds on a sphere are an antiprism: two vertices where four cells meet.
        (sphere()?, &[4, 5, 6, 7, 8, 12, 13, 24, 50]),
        (torus()?, &[33, 80]),
        (plane()?, &[12, 31, 64]),
    ];
    for (gap, counts) in cases {
        for &count in counts {
            let partition = partitioned(&gap, count, 2);
            let network = partition.network().map_err(|defects| format!("{count}: {defects:?}"))?;
            let chi = i64::from(gap.middle().euler_characteristic());
            let cells = i64::try_from(count)?;
            assert_eq!(i64::try_from(network.vertices().len())?, 2 * cells - 2 * chi);
            let charge: i64 =
                network.cells().map(|cell| 6 - i64::try_from(network.sides(cell)).unwrap()).sum();
            assert_eq!(charge, 6 * chi, "{count} cells on {}", gap.middle().name());
        }
    }
    Ok(())
}

#[test]
fn a_square_lattice_is_resolved_the_same_way_by_all_its_cells() -> Tested {
    let gap = Gap::between(Arc::new(Plane { periods: [6.0, 6.0] }), [-0.2, 0.2])?;
    let at = |index: i32| DVec3::new(f64::from(index % 6) + 0.5, f64::from(index / 6) + 0.5, 0.0);
    let seeds: Vec<DVec3> = (0..36).map(at).collect();
    let domain = Domain::of_surface(gap.middle().as_ref());
    let partition = Partition::new(&gap, &domain, &seeds).map_err(|defects| format!("{defects:?}"))?;
    let network = partition.network().map_err(|defects| format!("{defects:?}"))?;
    assert_eq!(network.vertices().len(), 72);
    // The ties are broken by weights of 1e-6.
    assert!(partition.cells().iter().all(|cell| (cell.volume - 0.4).abs() < 1e-6));
    Ok(())
}

#[test]
fn cells_are_closed_and_point_outward() -> Tested {
    for (gap, count) in [(schwarz_p()?, 40), (sphere()?, 12), (torus()?, 40), (plane()?, 20)] {
        for cell in partitioned(&gap, count, 3).cells() {
            let mesh = cell.mesh(&gap);
            let mut edges: BTreeMap<(usize, usize), usize> = BTreeMap::new();
            let mut volume = 0.0;
            for (_, corners) in &mesh.loops {
                let at = |index: usize| mesh.vertices[corners[index % corners.len()]] - cell.seed;
                for index in 0..corners.len() {
                    *edges.entry((corners[index], corners[(index + 1) % corners.len()])).or_default() += 1;
                    volume += at(0).dot(at(index).cross(at(index + 1))) / 6.0;
                }
            }
            for (&(from, to), &times) in &edges {
                assert_eq!((times, edges.get(&(to, from))), (1, Some(&1)), "edge {from}–{to}");
            }
            // Chords on the walls: second order in their length.
            assert!((volume / cell.volume - 1.0).abs() < 0.03, "{volume} is not {}", cell.volume);
        }
    }
    Ok(())
}

#[test]
fn corners_lie_on_their_walls_and_between_their_seeds() -> Tested {
    let gap = schwarz_p()?;
    let partition = partitioned(&gap, 50, 4);
    for cell in partition.cells() {
        for face in &cell.faces {
            for &point in &face.outline {
                match face.beyond {
                    Beyond::Wall(side) => assert!(gap.wall(side).value(point).abs() < 1e-12),
                    Beyond::Cell(other, image) => {
                        let seed = partition.domain().apply(image, partition.cells()[other].seed);
                        // The ties' weights move films by less than 1e-6 of the spacing.
                        assert!((seed.distance(point) - cell.seed.distance(point)).abs() < 1e-6);
                    }
                    Beyond::Plane { .. } => panic!("no plane walls here"),
                }
            }
        }
    }
    Ok(())
}

#[test]
fn plane_walls_cut_the_unit_cell_in_half() -> Tested {
    let gap = schwarz_p()?;
    let walls = |high| Axis::Walls { low: 0.0, high };
    let domain = Domain { axes: [walls(1.0), walls(1.0), walls(0.5)] };
    let seeds = quick_seeds(&gap, &domain, 40, 5);
    let partition = Partition::new(&gap, &domain, &seeds).map_err(|defects| format!("{defects:?}"))?;
    assert!((partition.volume() / (0.5 * VOLUME_OF_P) - 1.0).abs() < 1e-9, "{}", partition.volume());
    let at_a_wall =
        |cell: &PartitionCell| cell.faces.iter().any(|f| matches!(f.beyond, Beyond::Plane { .. }));
    assert!(partition.cells().iter().any(at_a_wall));
    let network = partition.network().map_err(|defects| format!("{defects:?}"))?;
    // An annulus, and a disc behind each of its edges.
    assert_eq!((network.euler_characteristic(), network.planes().len()), (2, 6));
    let ends = network.cells().filter(|&cell| network.is_cut(cell)).count();
    assert_eq!(ends, partition.cells().iter().filter(|cell| at_a_wall(cell)).count());
    for vertex in network.vertices() {
        let plane = network.plane_of(vertex).map(|place| network.planes()[place]);
        assert!(plane.is_none_or(|plane| plane.value(network.position(vertex)).abs() < 1e-15));
    }
    Ok(())
}

#[test]
fn t1s_at_plane_walls_keep_every_law() -> Tested {
    let gap = Gap::between(Arc::new(Plane { periods: [6.0, 6.0] }), [-0.2, 0.2])?;
    let walls = Axis::Walls { low: 0.0, high: 6.0 };
    let domain = Domain { axes: [walls, walls, Axis::Open { low: -1.0, high: 1.0 }] };
    let seeds = quick_seeds(&gap, &domain, 36, 3);
    let partition = Partition::new(&gap, &domain, &seeds).map_err(|defects| format!("{defects:?}"))?;
    let mut network = partition.network().map_err(|defects| format!("{defects:?}"))?;
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let edges = network.edges().len();
    let (mut at_the_rim, mut inside) = (0, 0);
    for _ in 0..2000 {
        let edge = crate::foam::network::EdgeId::from_index(random.random_range(0..edges));
        let was_rim = network.is_rim(edge);
        if network.flip(edge).is_ok() {
            // At the rim a film becomes a line of the rim or a line a film.
            *(if was_rim == network.is_rim(edge) { &mut inside } else { &mut at_the_rim }) += 1;
        }
        assert_eq!(network.defects(), []);
    }
    assert!(at_the_rim > 30 && inside > 100, "{at_the_rim} {inside}");
    // A disc, closed by one outside: Σ (6 − n) = 12 with it.
    let charge = |sides: usize| 6 - i64::try_from(sides).unwrap_or(i64::MAX);
    let cells: i64 = network.cells().map(|cell| charge(network.sides(cell))).sum();
    assert_eq!(cells + charge(network.rim().count()), 12);
    Ok(())
}

#[test]
fn too_few_cells_for_plane_walls_are_refused() -> Tested {
    let gap = Gap::between(Arc::new(Plane { periods: [6.0, 1.0] }), [-0.2, 0.2])?;
    let walls = |high| Axis::Walls { low: 0.0, high };
    let domain = Domain { axes: [walls(6.0), walls(1.0), Axis::Open { low: -1.0, high: 1.0 }] };
    let seeds: Vec<DVec3> = (0..4).map(|i| DVec3::new(1.5 * f64::from(i) + 0.75, 0.5, 0.0)).collect();
    let Err(defects) = Partition::new(&gap, &domain, &seeds) else { panic!("strips were accepted") };
    assert_eq!(defects.iter().filter(|d| matches!(d, PartitionDefect::Spans { .. })).count(), 4);
    assert_eq!(defects.iter().filter(|d| matches!(d, PartitionDefect::Corners { .. })).count(), 2);
    Ok(())
}

#[test]
fn what_is_not_sound_is_reported() -> Tested {
    // One seed only: a cell that is all of the gap.
    let gap = schwarz_p()?;
    let domain = Domain::of_surface(gap.middle().as_ref());
    let one = [gap.middle().project(DVec3::new(0.2, 0.3, 0.2), 0.0)?];
    assert!(Partition::new(&gap, &domain, &one).is_err());
    // Two seeds in the same place.
    let gap = sphere()?;
    let domain = Domain::of_surface(gap.middle().as_ref());
    let mut seeds = quick_seeds(&gap, &domain, 12, 1);
    seeds[3] = seeds[7];
    let Err(defects) = Partition::new(&gap, &domain, &seeds) else { panic!("accepted twins") };
    assert!(defects.contains(&PartitionDefect::Degenerate { cell: CellId::from_index(3) }), "{defects:?}");
    // A thick shell of many cells: some do not reach the outer wall.
    let gap = Gap::between(Arc::new(Sphere { radius: 1.0 }), [-0.9, 4.0])?;
    let domain = Domain { axes: [Axis::Open { low: -6.0, high: 6.0 }; 3] };
    let mut seeds = quick_seeds(&gap, &domain, 30, 1);
    seeds[0] = 1.8 * seeds[0];
    let Err(defects) = Partition::new(&gap, &domain, &seeds) else { panic!("accepted a thick shell") };
    assert!(defects.iter().any(|d| matches!(d, PartitionDefect::Patches { patches: 0, .. })), "{defects:?}");
    Ok(())
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() -> Tested {
    let gap = schwarz_p()?;
    let on = |threads| -> Result<Partition, rayon::ThreadPoolBuildError> {
        Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?.install(|| partitioned(&gap, 40, 6)))
    };
    assert_eq!(on(1)?, on(2)?);
    Ok(())
}

#[test]
fn lloyd_steps_even_out_the_volumes() -> Tested {
    let gap = schwarz_p()?;
    let domain = Domain::of_surface(gap.middle().as_ref());
    let spread = |partition: &Partition| -> f64 {
        let mean = partition.volume() / 60.0;
        partition.cells().iter().map(|cell| (cell.volume / mean - 1.0).powi(2)).sum()
    };
    // A rough start: annealed hot and hardly polished.
    let mut settings = SeedSettings::new(60, 9);
    settings.anneal.sweeps = 30;
    settings.anneal.cold = settings.anneal.hot;
    settings.polish.steps = 3;
    let seeds = sow(&gap, &domain, &settings, 0, &mut |_| ControlFlow::Continue(()))?;
    let mut partition = Partition::new(&gap, &domain, &seeds.points).map_err(|d| format!("{d:?}"))?;
    let before = spread(&partition);
    for _ in 0..10 {
        partition =
            Partition::new(&gap, &domain, &partition.centred_seeds(&gap)).map_err(|d| format!("{d:?}"))?;
    }
    assert!(spread(&partition) < 0.5 * before, "{} from {before}", spread(&partition));
    Ok(())
}
