//! Where a mesh intersects itself.
//!
//! The tests are exact: they rest on the signs of determinants alone (`robust`, after Shewchuk 1997), so a smooth or flat
//! fan of triangles never counts as crossing, whatever the rounding of its corners. Triangles are closed sets: touching
//! counts, and so does overlap in a plane. What two triangles share by their corners' numbers does not count:
//!
//! - no corner: they intersect if an edge of one meets the other;
//! - one corner: they meet elsewhere too exactly if the edge opposite to it in one meets the other, because what convex sets
//!   have in common is convex and so reaches from the corner to one of these edges;
//! - an edge: they meet elsewhere too exactly if they lie in one plane on the same side of the edge;
//! - all three corners: always.
//!
//! Source of the predicates: Shewchuk, *Adaptive precision floating-point arithmetic and fast robust geometric predicates*,
//! Discrete & Computational Geometry 18 (1997).

use super::{Bvh, TriMesh, VertexId};
use glam::DVec3;
use robust::{Coord, Coord3D};

/// All pairs of triangles that meet elsewhere than in shared corners and edges; each pair has its lower triangle first, and
/// the pairs are in order.
///
/// Triangles without area ([`super::MeshDefect::Degenerate`]) are found only where their edges meet others.
#[must_use]
pub fn self_intersections(mesh: &TriMesh) -> Vec<(usize, usize)> {
    Bvh::new(mesh).overlaps(|one, other| intersect(mesh, mesh.triangles[one], mesh.triangles[other]))
}

/// Whether two triangles meet elsewhere than in what they share.
fn intersect(mesh: &TriMesh, one: [VertexId; 3], other: [VertexId; 3]) -> bool {
    let shared = one.map(|vertex| other.contains(&vertex));
    match shared {
        [false, false, false] => apart_intersect(mesh.corners(one), mesh.corners(other)),
        [true, true, true] => true,
        [true, false, false] | [false, true, false] | [false, false, true] => {
            let [one, other] =
                [corner_first(one, |v| other.contains(&v)), corner_first(other, |v| one.contains(&v))];
            fan_intersect(mesh.corners(one), mesh.corners(other))
        }
        [false, true, true] | [true, false, true] | [true, true, false] => {
            let [one, other] =
                [corner_first(one, |v| !other.contains(&v)), corner_first(other, |v| !one.contains(&v))];
            let [apex, a, b] = mesh.corners(one);
            folded(a, b, apex, mesh.positions[other[0]])
        }
    }
}

/// The triangle turned so that its first corner for which `is_first` holds comes first.
fn corner_first(triangle: [VertexId; 3], is_first: impl Fn(VertexId) -> bool) -> [VertexId; 3] {
    let mut turned = triangle;
    turned.rotate_left(triangle.iter().position(|&v| is_first(v)).unwrap_or(0));
    turned
}

/// Whether two triangles without a common corner meet.
fn apart_intersect(one: [DVec3; 3], other: [DVec3; 3]) -> bool {
    let edges = |[a, b, c]: [DVec3; 3]| [(a, b), (b, c), (c, a)];
    !all_on_one_side(one, other)
        && !all_on_one_side(other, one)
        && (edges(one).into_iter().any(|(p, q)| segment_meets(p, q, other))
            || edges(other).into_iter().any(|(p, q)| segment_meets(p, q, one)))
}

/// Whether two triangles meet elsewhere than in their common first corner.
fn fan_intersect(one: [DVec3; 3], other: [DVec3; 3]) -> bool {
    let ([_, a, b], [_, c, d]) = (one, other);
    !all_on_one_side(one, [c, d])
        && !all_on_one_side(other, [a, b])
        && (segment_meets(a, b, other) || segment_meets(c, d, one))
}

/// Whether all `points` lie strictly on one side of the triangle's plane.
fn all_on_one_side<const N: usize>(triangle: [DVec3; 3], points: [DVec3; N]) -> bool {
    strictly_alike(points.map(|p| side(triangle, p)))
}

/// Whether the triangles `a b one` and `a b other` lie in one plane on the same side of `a b`.
fn folded(a: DVec3, b: DVec3, one: DVec3, other: DVec3) -> bool {
    if side([a, b, one], other) != 0 {
        return false;
    }
    let Some(drop) = projection([a, b, one]) else { return false };
    turn(drop, a, b, one) * turn(drop, a, b, other) > 0
}

/// Whether the segment `p q` and the triangle have a point in common.
fn segment_meets(p: DVec3, q: DVec3, triangle: [DVec3; 3]) -> bool {
    let [of_p, of_q] = [p, q].map(|end| side(triangle, end));
    if strictly_alike([of_p, of_q]) {
        return false;
    }
    if of_p == 0 && of_q == 0 {
        return segment_meets_in_plane(p, q, triangle);
    }
    // The line crosses the plane in one point, within the segment. It is in the triangle if the line has all three edges on
    // the same hand.
    let [a, b, c] = triangle;
    let hands = [side([p, q, a], b), side([p, q, b], c), side([p, q, c], a)];
    hands.iter().all(|&h| h >= 0) || hands.iter().all(|&h| h <= 0)
}

/// The same in the triangle's plane: they are apart exactly if an edge of the triangle or the segment's line has the other
/// strictly on its outer side (the edges of the two convex sets' difference are no others).
fn segment_meets_in_plane(p: DVec3, q: DVec3, triangle: [DVec3; 3]) -> bool {
    let Some(drop) = projection(triangle) else { return false };
    let [a, b, c] = triangle;
    let inner = turn(drop, a, b, c);
    let outside = |from, to| [p, q].iter().all(|&end| turn(drop, from, to, end) * inner < 0);
    !(outside(a, b)
        || outside(b, c)
        || outside(c, a)
        || strictly_alike(triangle.map(|corner| turn(drop, p, q, corner))))
}

/// Whether all signs are the same and none is zero.
fn strictly_alike<const N: usize>(signs: [i8; N]) -> bool {
    signs == [1; N] || signs == [-1; N]
}

/// −1, 0 or 1: products of signs do not vanish as those of tiny numbers do.
fn sign(x: f64) -> i8 {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

/// The sign of the side of the triangle's plane on which `p` lies, exactly.
fn side(triangle: [DVec3; 3], p: DVec3) -> i8 {
    let [a, b, c, d] = [triangle[0], triangle[1], triangle[2], p].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    sign(robust::orient3d(a, b, c, d))
}

/// The sign of the turn `a b c` seen along the axis `drop`, exactly.
fn turn(drop: usize, a: DVec3, b: DVec3, c: DVec3) -> i8 {
    let flat = |p: DVec3| Coord { x: p[(drop + 1) % 3], y: p[(drop + 2) % 3] };
    sign(robust::orient2d(flat(a), flat(b), flat(c)))
}

/// An axis along which the triangle is seen with an area; none if it has no area.
fn projection([a, b, c]: [DVec3; 3]) -> Option<usize> {
    (0..3).find(|&drop| turn(drop, a, b, c) != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        index::{Id, IndexVec},
        mesh::{ClosedMesh, Grid, Sheet, march},
        surface::{LevelSet, SchwarzP},
    };
    use glam::{DMat3, DQuat};
    use std::f64::consts::TAU;

    fn mesh_of(positions: Vec<DVec3>, triangles: &[[usize; 3]]) -> TriMesh {
        let triangles = triangles.iter().map(|t| t.map(VertexId::from_index)).collect();
        TriMesh { positions: positions.into(), triangles }
    }

    /// Two triangles in all orders of their corners, moved by whole-numbered turns and mirrors: the answer never changes.
    fn check(name: &str, places: &[[i32; 3]], other: [usize; 3], expected: bool) {
        // Columns of length 3 at right angles: coordinates stay whole, so places that lie in a plane stay in it exactly.
        let turned = DMat3::from_cols_array(&[2.0, 2.0, -1.0, -1.0, 2.0, 2.0, 2.0, -1.0, 2.0]);
        let sheared = DMat3::from_cols_array(&[1.0, 3.0, 0.0, 0.0, 1.0, -2.0, 5.0, 0.0, 1.0]);
        let swapped = DMat3::from_cols_array(&[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        for map in [DMat3::IDENTITY, swapped, swapped * swapped, turned, sheared, turned * sheared] {
            for (first, second) in orders.iter().flat_map(|&f| orders.map(|s| (f, s))) {
                let positions = places.iter().map(|p| map * DVec3::from_array(p.map(f64::from))).collect();
                let triangles = [first, second.map(|corner| other[corner])];
                let found = self_intersections(&mesh_of(positions, &triangles));
                let expected = if expected { vec![(0, 1)] } else { vec![] };
                assert_eq!(found, expected, "{name}, {map}, {triangles:?}");
            }
        }
    }

    const BASE: [[i32; 3]; 3] = [[0, 0, 0], [6, 0, 0], [0, 6, 0]];

    #[test]
    fn triangles_without_a_common_corner() {
        let cases: [(&str, [[i32; 3]; 3], bool); 14] = [
            ("pierced", [[1, 1, -1], [1, 1, 1], [8, 8, 1]], true),
            ("each edge-on to the other", [[2, 2, -2], [2, 2, 2], [9, 9, 0]], true),
            ("above", [[1, 1, 1], [2, 1, 1], [1, 2, 3]], false),
            ("crosses the plane outside", [[7, 7, -1], [7, 7, 1], [9, 9, 1]], false),
            ("a corner on the face", [[1, 1, 0], [1, 1, 3], [2, 1, 3]], true),
            ("a corner on an edge", [[3, 0, 0], [3, 0, 3], [3, -1, 3]], true),
            ("a corner on a corner", [[0, 0, 0], [-1, 0, 3], [0, -1, 3]], true),
            ("edges that cross in a point", [[3, -1, -1], [3, 1, 1], [3, -5, 1]], true),
            ("a corner on an edge's line", [[7, 0, 0], [7, 0, 3], [8, 1, 3]], false),
            ("in the plane, overlapping", [[1, 1, 0], [7, 1, 0], [1, 7, 0]], true),
            ("in the plane, inside", [[1, 1, 0], [2, 1, 0], [1, 2, 0]], true),
            ("in the plane, star", [[-1, 1, 0], [7, 1, 0], [2, -9, 0]], true),
            ("in the plane, touching along an edge", [[1, 0, 0], [2, 0, 0], [1, -3, 0]], true),
            ("in the plane, apart", [[4, 4, 0], [8, 4, 0], [4, 8, 0]], false),
        ];
        for (name, other, expected) in cases {
            check(name, &[BASE, other].concat(), [3, 4, 5], expected);
        }
        let around = [[-30, -30, 0], [60, -30, 0], [-30, 60, 0]];
        check("in the plane, around", &[BASE, around].concat(), [3, 4, 5], true);
    }

    #[test]
    fn triangles_with_one_common_corner() {
        let cases: [(&str, [[i32; 3]; 2], bool); 9] = [
            ("rising", [[1, 1, 3], [2, 1, 4]], false),
            ("behind", [[-3, 0, 0], [0, -3, 0]], false),
            ("behind, out of plane", [[-3, 0, 1], [0, -3, -1]], false),
            ("cutting into the face", [[2, 2, -1], [2, 2, 1]], true),
            ("cutting through the far edge", [[9, 9, -1], [9, 9, 1]], true),
            ("in the plane, overlapping", [[3, 1, 0], [1, 3, 0]], true),
            ("in the plane, next sector", [[-1, 4, 0], [-4, 1, 0]], false),
            ("in the plane, along an edge", [[3, 0, 0], [3, -3, 0]], true),
            ("an edge in the face", [[2, 2, 0], [2, 2, 5]], true),
        ];
        for (name, [a, b], expected) in cases {
            check(name, &[&BASE[..], &[a, b]].concat(), [0, 3, 4], expected);
        }
    }

    #[test]
    fn triangles_with_a_common_edge_or_all_corners() {
        for (name, apex, expected) in [
            ("flat", [6, 6, 0], false),
            ("bent", [1, 1, 1], false),
            ("folded onto itself", [1, 1, 0], true),
            ("folded beyond", [-1, -1, 0], true),
        ] {
            check(name, &[&BASE[..], &[apex]].concat(), [1, 2, 3], expected);
        }
        check("the same", &BASE, [0, 1, 2], true);
    }

    /// A tube about a ring, by its angles.
    fn torus(ring: f64, tube: f64, counts: [u32; 2]) -> TriMesh {
        let [m, n] = counts;
        let places = (0..m).flat_map(|i| {
            (0..n).map(move |j| {
                let (u, v) = (TAU * f64::from(i) / f64::from(m), TAU * f64::from(j) / f64::from(n));
                let out = ring + tube * v.cos();
                DVec3::new(out * u.cos(), out * u.sin(), tube * v.sin())
            })
        });
        let id = |i: u32, j: u32| ((i % m) * n + j % n) as usize;
        let triangles: Vec<[usize; 3]> = (0..m)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        mesh_of(places.collect(), &triangles)
    }

    #[test]
    fn a_torus_crosses_itself_exactly_if_its_tube_is_thicker_than_its_ring() {
        for counts in [[24, 12], [61, 37]] {
            assert_eq!(self_intersections(&torus(2.0, 1.0, counts)), []);
            let found = self_intersections(&torus(1.0, 1.5, counts));
            assert!(!found.is_empty() && found.is_sorted(), "{found:?}");
        }
    }

    #[test]
    fn a_flat_plate_in_any_position_has_no_crossing() {
        let side = 20_u32;
        let id = |i: u32, j: u32| (i * (side + 1) + j) as usize;
        let mut triangles = Vec::new();
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            // Diagonals both ways: corners of 4 to 8 triangles.
            triangles.extend(if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
        }
        for turn in [
            DQuat::IDENTITY,
            DQuat::from_rotation_x(0.3),
            DQuat::from_rotation_z(1.0) * DQuat::from_rotation_y(2.1),
        ] {
            let places =
                (0..=side).flat_map(|i| (0..=side).map(move |j| DVec3::new(f64::from(i), f64::from(j), 0.0)));
            let places = places.map(|p| turn * (p * 0.1) + DVec3::new(0.1, 7.3, -2.9)).collect();
            assert_eq!(self_intersections(&mesh_of(places, &triangles)), []);
        }
    }

    /// The half cell of the P surface of period 1 with both faces moved along the normals.
    fn wall(cells: usize, offset: f64) -> ClosedMesh {
        let surface = SchwarzP { period: 1.0 };
        let grid =
            Grid { low: DVec3::ZERO, high: DVec3::new(1.0, 1.0, 0.5), cells: [cells, cells, cells / 2] };
        let Ok(sheet) = march(&surface, 0.0, &grid) else { panic!("no sheet") };
        let Ok(sheet) = Sheet::new(sheet) else { panic!("no manifold") };
        let moved = |by: f64| -> IndexVec<VertexId, DVec3> {
            sheet.mesh().positions.iter().map(|&p| p + by * surface.gradient(p).normalize()).collect()
        };
        let Ok(wall) = sheet.thicken(moved(-offset), moved(offset), None) else { panic!("degenerate") };
        wall
    }

    #[test]
    fn a_thick_sheet_crosses_itself_exactly_beyond_its_least_radius_of_curvature() {
        // The least radius of curvature of the nodal P surface is 0.159 of its period.
        for (cells, offset) in [(16, 0.10), (33, 0.13), (64, 0.15)] {
            assert_eq!(self_intersections(wall(cells, offset).mesh()), [], "{cells}");
        }
        assert!(!self_intersections(wall(64, 0.17).mesh()).is_empty());
    }
}
