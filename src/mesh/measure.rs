//! Measures of a mesh.

use super::{TriMesh, VertexId};
use crate::index::Id;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Triangles summed at a time: the sums of the parts are added in order, so that any number of threads gives the same bits.
const PART: usize = 1 << 14;

/// `Σ f` over the triangles.
fn sum(mesh: &TriMesh, f: impl Fn([DVec3; 3]) -> f64 + Sync) -> f64 {
    let parts: Vec<f64> = mesh
        .triangles
        .par_chunks(PART)
        .map(|part| part.iter().map(|&triangle| f(mesh.corners(triangle))).sum())
        .collect();
    parts.iter().sum()
}

/// The volume enclosed, positive for a closed mesh whose triangles face outward (divergence theorem).
#[must_use]
pub fn volume(mesh: &TriMesh) -> f64 {
    let (low, high) = mesh.bounds();
    // From the middle of the mesh, so that far-away meshes lose no digits.
    let origin = if low.x <= high.x { 0.5 * (low + high) } else { DVec3::ZERO };
    sum(mesh, |t| {
        let [a, b, c] = t.map(|p| p - origin);
        a.dot(b.cross(c)) / 6.0
    })
}

/// The total area.
#[must_use]
pub fn area(mesh: &TriMesh) -> f64 {
    sum(mesh, |[a, b, c]| 0.5 * (b - a).cross(c - a).length())
}

/// The area of the triangles whose three corners lie on the plane `axis = at` exactly.
#[must_use]
pub fn area_on_plane(mesh: &TriMesh, axis: usize, at: f64) -> f64 {
    sum(mesh, |[a, b, c]| {
        let on_plane = [a, b, c].iter().all(|p| p[axis].to_bits() == at.to_bits());
        if on_plane { 0.5 * (b - a).cross(c - a).length() } else { 0.0 }
    })
}

/// The area of triangles that face downward more steeply than `degrees` from the vertical walls (0 counts every downward
/// face, 90 none) and do not lie on the bed, when printed standing on its lowest plane.
#[must_use]
pub fn overhang_area(mesh: &TriMesh, degrees: f64) -> f64 {
    let (low, high) = mesh.bounds();
    let bed = low.z + 1e-9 * (high - low).max_element();
    let steepest = degrees.to_radians().sin();
    sum(mesh, |[a, b, c]| {
        let doubled = (b - a).cross(c - a);
        let on_bed = a.z.max(b.z).max(c.z) <= bed;
        if !on_bed && -doubled.z > steepest * doubled.length() { 0.5 * doubled.length() } else { 0.0 }
    })
}

/// Vertices − edges + triangles, of a mesh whose edges each have one or two triangles. Vertices without triangles do not
/// count.
#[must_use]
pub fn euler_number(mesh: &TriMesh) -> i64 {
    let mut used = vec![false; mesh.positions.len()];
    let mut edges: Vec<(VertexId, VertexId)> = Vec::with_capacity(3 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            used[from.index()] = true;
            edges.push((from.min(to), from.max(to)));
        }
    }
    edges.par_sort_unstable();
    edges.dedup();
    let count = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    count(used.iter().filter(|&&u| u).count()) - count(edges.len()) + count(mesh.triangles.len())
}

/// The connected pieces of a mesh: for each its triangles, largest first.
#[must_use]
pub fn components(mesh: &TriMesh) -> Vec<Vec<usize>> {
    let mut parent: Vec<u32> = (0..mesh.positions.len()).map(crate::index::checked_u32).collect();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| find(&mut parent, crate::index::checked_u32(v.index())));
        parent[b as usize] = a;
        let c = find(&mut parent, c);
        parent[c as usize] = a;
    }
    let mut pieces: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let root = find(&mut parent, crate::index::checked_u32(triangle[0].index()));
        pieces.entry(root).or_default().push(index);
    }
    let mut pieces: Vec<_> = pieces.into_values().collect();
    pieces.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
    pieces
}

/// The root of a set, with the path to it halved.
fn find(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        parent[at as usize] = parent[parent[at as usize] as usize];
        at = parent[at as usize];
    }
    at
}
