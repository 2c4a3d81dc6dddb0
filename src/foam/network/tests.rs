use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// `nx` × `ny` regular hexagons of area 1 in the plane z = 0 of a periodic box, rows shifted by half a cell.
///
/// # Panics
/// If `ny` is odd: the rows would not close.
pub(crate) fn hexagons(nx: usize, ny: usize) -> Network {
    assert!(ny.is_multiple_of(2), "rows come in pairs");
    let width = (2.0 / 3.0_f64.sqrt()).sqrt();
    let height = 1.0 / width;
    let size = |n: usize, step: f64| f64::from(crate::index::checked_u32(n)) * step;
    let period = Period([Some(size(nx, width)), Some(size(ny, height)), None]);
    let whole = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
    let (nx, ny) = (whole(nx), whole(ny));
    let cell_at = |i: i32, j: i32| {
        let lift = j.div_euclid(ny);
        let column = i;
        let wrapped = (column.rem_euclid(nx), j.rem_euclid(ny));
        (
            CellId::from_index((wrapped.1 * nx + wrapped.0) as usize),
            IVec3::new(column.div_euclid(nx), lift, 0),
        )
    };
    let centre = |i: i32, j: i32| {
        let lean = if j.rem_euclid(2) == 1 { 0.5 } else { 0.0 };
        DVec3::new((f64::from(i) + lean) * width, f64::from(j) * height, 0.0)
    };
    // Neighbours counter-clockwise from the right.
    let around = |i: i32, j: i32| {
        let o = j.rem_euclid(2);
        [(i + 1, j), (i + o, j + 1), (i + o - 1, j + 1), (i - 1, j), (i + o - 1, j - 1), (i + o, j - 1)]
    };
    // Each vertex lies between a cell and two consecutive neighbours; a cell owns those after neighbours 1 and 2.
    let mut places = IndexVec::new();
    let mut rings = IndexVec::new();
    for j in 0..ny {
        for i in 0..nx {
            let near = around(i, j);
            for k in [0, 1] {
                let (p, q) = (near[k], near[k + 1]);
                places.push((centre(i, j) + centre(p.0, p.1) + centre(q.0, q.1)) / 3.0);
            }
        }
    }
    for j in 0..ny {
        for i in 0..nx {
            let near = around(i, j);
            let corners = (0..6)
                .map(|k| {
                    // The corner before the side towards neighbour k lies between neighbours k − 1 and k.
                    let (p, q) = (near[(k + 5) % 6], near[k]);
                    let here = (centre(i, j) + centre(p.0, p.1) + centre(q.0, q.1)) / 3.0;
                    let found = [(i, j), p, q].into_iter().find_map(|(a, b)| {
                        let (cell, shift) = cell_at(a, b);
                        (0..2).find_map(|k| {
                            let vertex = VertexId::from_index(2 * cell.index() + k);
                            let place: DVec3 = places[vertex] + period.translation(shift);
                            (place.distance(here) < 1e-9).then_some((vertex, shift))
                        })
                    });
                    let Some((vertex, shift)) = found else { panic!("no vertex at {here}") };
                    RingCorner { vertex, shift, neighbour: cell_at(q.0, q.1).0 }
                })
                .collect();
            rings.push(CellRing { centre: centre(i, j), corners });
        }
    }
    match Network::new(period, 0, &places, &rings) {
        Ok(network) => network,
        Err(defects) => panic!("{defects:?}"),
    }
}

#[test]
fn hexagons_close() {
    let network = hexagons(4, 4);
    assert_eq!((network.cells().len(), network.edges().len(), network.vertices().len()), (16, 48, 32));
    for cell in network.cells() {
        assert_eq!(network.sides(cell), 6);
        for corner in network.outline(cell) {
            // The distance from the centre to a corner of a regular hexagon of area 1.
            let radius = (2.0 / (3.0 * 3.0_f64.sqrt())).sqrt();
            assert!((corner.distance(network.centre(cell)) - radius).abs() < 1e-12);
        }
    }
}

#[test]
fn rings_and_back_is_the_same_network() {
    let network = hexagons(4, 4);
    let places = network.vertices().map(|v| network.position(v)).collect();
    let Ok(again) = Network::new(network.period(), 0, &places, &network.rings()) else { panic!("refused") };
    for cell in network.cells() {
        assert_eq!(network.outline(cell), again.outline(cell));
    }
}

#[test]
fn random_flips_keep_every_law() {
    let mut network = hexagons(6, 6);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let edges = network.edges().len();
    let mut flips = 0;
    for _ in 0..2000 {
        let edge = EdgeId::from_index(random.random_range(0..edges));
        let before = network.clone();
        match network.flip(edge) {
            Ok(()) => flips += 1,
            Err(_) => assert_eq!(before, network),
        }
        assert_eq!(network.defects(), []);
    }
    assert!(flips > 500, "{flips}");
    let charge: i64 = network.cells().map(|c| 6 - i64::try_from(network.sides(c)).unwrap()).sum();
    assert_eq!(charge, 0);
}

#[test]
fn a_flip_changes_the_sides_of_four_cells_and_three_flips_undo_nothing_but_two_do() {
    let mut network = hexagons(4, 4);
    let edge = EdgeId::from_index(7);
    let [h, t] = edge.half_edges();
    let beside = [network.cell(h), network.cell(t)];
    let (c, d) = network.end_sides(edge);
    let ends = [network.cell(c), network.cell(d)];
    network.flip(edge).unwrap();
    assert!(beside.iter().all(|&cell| network.sides(cell) == 5));
    assert!(ends.iter().all(|&cell| network.sides(cell) == 7));
    network.flip(edge).unwrap();
    assert!(network.cells().all(|cell| network.sides(cell) == 6));
}

#[test]
fn a_triangle_vanishes() {
    let mut network = hexagons(6, 6);
    let cell = CellId::from_index(14);
    while network.sides(cell) > 3 {
        let Some(side) = network.ring(cell).find(|side| network.can_flip(side.edge()).is_ok()) else {
            panic!("no side can go")
        };
        network.flip(side.edge()).unwrap();
    }
    let removed = network.remove(cell).unwrap();
    assert_eq!(removed.network.cells().len(), 35);
    assert_eq!(removed.network.defects(), []);
    assert_eq!(removed.cells[cell], None);
    assert!(matches!(network.remove(CellId::from_index(0)), Err(RemoveRefusal::NotTriangle { .. })));
}

#[test]
fn every_violation_is_reported() {
    let network = hexagons(4, 4);
    let places = network.vertices().map(|v| network.position(v)).collect();
    let rings = network.rings();
    let build = |rings: &IndexVec<CellId, CellRing>, euler| {
        Network::new(network.period(), euler, &places, rings).expect_err("accepted")
    };
    assert!(matches!(build(&rings, 2)[..], [NetworkDefect::Euler { found: 0, expected: 2, .. }]));
    let mut missing = rings.clone();
    missing[CellId::from_index(3)].corners.clear();
    assert!(build(&missing, 0).iter().any(|d| matches!(d, NetworkDefect::FewCorners { corners: 0, .. })));
    let mut moved = rings.clone();
    moved[CellId::from_index(3)].corners[2].neighbour = CellId::from_index(3);
    assert_eq!(build(&moved, 0).len(), 2);
    let mut pinched = rings.clone();
    let corner = pinched[CellId::from_index(5)].corners[0];
    pinched[CellId::from_index(5)].corners.push(corner);
    assert!(build(&pinched, 0).iter().any(|d| matches!(d, NetworkDefect::Pinched { .. })));
}

#[test]
fn a_cell_that_touches_itself_round_the_period_is_found() {
    // One column of hexagons: each touches its own image to the right.
    let found = std::panic::catch_unwind(|| hexagons(1, 4));
    let Err(message) = found else { panic!("accepted") };
    let text = message.downcast_ref::<String>().cloned().unwrap_or_default();
    assert!(text.contains("TouchesItself"), "{text}");
}
