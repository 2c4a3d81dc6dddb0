//! The triangles of a cube whose corners lie above or below a level.
//!
//! The table is derived, not listed. On each face the corners above the level are cut off from those below, run by run; on
//! an ambiguous face that separates the two upper corners. Both cubes at a face apply the same rule, so their cuts agree
//! and the surface is closed whatever the case. The cuts link up to loops, and each loop is filled with triangles none of
//! which lies in a face (two cubes would both put one there).
//!
//! Corner `c` stands at `(c & 1, c >> 1 & 1, c >> 2 & 1)`. Edge `4a + i` runs along axis `a`; the bits of `i` are its
//! coordinates along the axes `a + 1` and `a + 2` (cyclically).

use std::sync::LazyLock;

/// For each of the 256 cases the triangles, as edges of the cube; the normal points to the side above the level.
pub(super) static CUBE_CASES: LazyLock<Vec<Vec<[u8; 3]>>> =
    LazyLock::new(|| (0..=u8::MAX).map(triangles).collect());

/// The two ends of an edge of the cube, the lower coordinate first.
pub(super) const fn edge_corners(edge: u8) -> [u8; 2] {
    let (axis, i) = (edge / 4, edge % 4);
    let first = ((i & 1) << ((axis + 1) % 3)) | ((i >> 1) << ((axis + 2) % 3));
    [first, first | (1 << axis)]
}

/// The edge between two neighbouring corners.
fn edge_between(a: u8, b: u8) -> u8 {
    (0..12).find(|&edge| edge_corners(edge) == [a.min(b), a.max(b)]).unwrap_or(u8::MAX)
}

/// The four corners of each face, counter-clockwise seen from outside.
fn faces() -> [[u8; 4]; 6] {
    std::array::from_fn(|face| {
        let (axis, far) = (face / 2, face % 2);
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let base = u8::from(far == 1) << axis;
        if far == 1 {
            [base, base | u, base | u | v, base | v]
        } else {
            [base, base | v, base | u | v, base | u]
        }
    })
}

/// Whether edge `edge` lies in face `face` (numbered as in [`faces`]).
fn lies_in(edge: u8, face: [u8; 4]) -> bool {
    edge_corners(edge).iter().all(|corner| face.contains(corner))
}

fn triangles(above: u8) -> Vec<[u8; 3]> {
    loops(above).into_iter().flat_map(|ring| fill(&ring)).collect()
}

/// The closed rings of crossed edges.
fn loops(above: u8) -> Vec<Vec<u8>> {
    let is_above = |corner: u8| above >> corner & 1 == 1;
    let mut next = [u8::MAX; 12];
    for face in faces() {
        for start in 0..4 {
            // A run of corners above the level begins where the one before it is below.
            let before = face[(start + 3) % 4];
            if !is_above(face[start]) || is_above(before) {
                continue;
            }
            let run = (1..4).take_while(|&k| is_above(face[(start + k) % 4])).count();
            let last = face[(start + run) % 4];
            let after = face[(start + run + 1) % 4];
            // Seen from outside, the cut runs from where the run ends to where it begins.
            next[usize::from(edge_between(last, after))] = edge_between(before, face[start]);
        }
    }
    let mut rings = Vec::new();
    for first in 0..12_u8 {
        let mut ring = Vec::new();
        let mut edge = first;
        while next[usize::from(edge)] != u8::MAX {
            ring.push(edge);
            edge = std::mem::replace(&mut next[usize::from(edge)], u8::MAX);
        }
        if !ring.is_empty() {
            rings.push(ring);
        }
    }
    rings
}

/// Fills a ring with triangles, none in a face if that can be had.
fn fill(ring: &[u8]) -> Vec<[u8; 3]> {
    let in_face = |t: &[u8; 3]| faces().iter().any(|&face| t.iter().all(|&edge| lies_in(edge, face)));
    fillings(ring)
        .into_iter()
        .min_by_key(|filling| filling.iter().filter(|t| in_face(t)).count())
        .unwrap_or_default()
}

/// All ways to fill a ring: the triangle on its first side has any other corner, and splits the rest in two.
fn fillings(ring: &[u8]) -> Vec<Vec<[u8; 3]>> {
    if ring.len() < 3 {
        return vec![Vec::new()];
    }
    let mut all = Vec::new();
    for tip in 2..ring.len() {
        for left in fillings(&ring[1..=tip]) {
            for right in fillings(&[&ring[..1], &ring[tip..]].concat()) {
                let mut filling = vec![[ring[0], ring[1], ring[tip]]];
                filling.extend(&left);
                filling.extend(&right);
                all.push(filling);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::collections::BTreeMap;

    fn middle(edge: u8) -> DVec3 {
        let place = |c: u8| DVec3::new(f64::from(c & 1), f64::from(c >> 1 & 1), f64::from(c >> 2 & 1));
        let [a, b] = edge_corners(edge);
        0.5 * (place(a) + place(b))
    }

    /// Directed edges of a case that have no opposite within it.
    fn border(case: &[[u8; 3]]) -> BTreeMap<(u8, u8), i32> {
        let mut sum = BTreeMap::new();
        for t in case {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *sum.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
            }
        }
        sum.retain(|_, &mut n| n != 0);
        sum
    }

    #[test]
    fn exactly_the_crossed_edges_are_used() {
        for (above, case) in CUBE_CASES.iter().enumerate() {
            for edge in 0..12 {
                let [a, b] = edge_corners(edge);
                let crossed = (above >> a & 1) != (above >> b & 1);
                assert_eq!(crossed, case.iter().flatten().any(|&e| e == edge), "case {above} edge {edge}");
            }
        }
    }

    #[test]
    fn the_border_of_each_case_lies_in_the_faces_and_no_triangle_does() {
        for (above, case) in CUBE_CASES.iter().enumerate() {
            for (&(a, b), &times) in &border(case) {
                let shared = faces().iter().filter(|&&f| lies_in(a, f) && lies_in(b, f)).count();
                assert!(shared == 1 && times.abs() == 1, "case {above}: edge {a}–{b}");
            }
            for t in case {
                assert!(!faces().iter().any(|&f| t.iter().all(|&e| lies_in(e, f))), "case {above}: {t:?}");
            }
        }
    }

    #[test]
    fn any_two_cubes_that_share_a_face_share_its_cut() {
        // Exhausts all pairs of corner signs on either side of the face x = 1 | x = 0, and the same along y and z.
        for axis in 0..3_u8 {
            let on_far = |edge: u8| edge_corners(edge).iter().all(|c| c >> axis & 1 == 1);
            let on_near = |edge: u8| edge_corners(edge).iter().all(|c| c >> axis & 1 == 0);
            let across = |edge: u8| {
                let [a, b] = edge_corners(edge);
                edge_between(a & !(1 << axis), b & !(1 << axis))
            };
            let cut = |case: &[[u8; 3]], on: &dyn Fn(u8) -> bool| -> BTreeMap<(u8, u8), i32> {
                border(case).into_iter().filter(|((a, b), _)| on(*a) && on(*b)).collect()
            };
            for left in 0..256_usize {
                let far: BTreeMap<_, _> = cut(&CUBE_CASES[left], &on_far)
                    .into_iter()
                    .map(|((a, b), n)| {
                        let (a, b, n) = if across(a) < across(b) { (a, b, n) } else { (b, a, -n) };
                        ((across(a), across(b)), -n)
                    })
                    .collect();
                for right in 0..256_usize {
                    let agree = (0..8)
                        .filter(|c| c >> axis & 1 == 0)
                        .all(|c| (right >> c & 1) == (left >> (c | 1 << axis) & 1));
                    if agree {
                        assert_eq!(far, cut(&CUBE_CASES[right], &on_near), "axis {axis}: {left} | {right}");
                    }
                }
            }
        }
    }

    #[test]
    fn normals_point_to_the_side_above() {
        for corner in 0..8_u8 {
            let case = &CUBE_CASES[1 << corner];
            assert_eq!(case.len(), 1);
            let [a, b, c] = case[0].map(middle);
            let place =
                DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2 & 1));
            assert!((b - a).cross(c - a).dot(place - a) > 0.0, "corner {corner}");
        }
    }

    #[test]
    fn the_number_of_triangles_is_that_of_the_rings() {
        // A ring of n crossings takes n − 2 triangles.
        for above in 0..=u8::MAX {
            let expected: usize = loops(above).iter().map(|ring| ring.len() - 2).sum();
            assert_eq!(CUBE_CASES[usize::from(above)].len(), expected);
        }
    }
}
