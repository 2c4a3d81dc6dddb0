//! Rigid motions that leave all walls where they are: a sphere's rotations, a flat gap's translations. Along them the energy
//! is constant and Newton's matrix singular; as many freedoms are held.

use super::motion::tangent_basis;
use crate::{
    foam::complex::{Complex, Motion, NodeId, Places},
    index::IndexVec,
};
use faer::{Mat, Side};
use glam::DVec3;
use std::collections::BTreeSet;

/// A motion counts as rigid if it moves no wall node off its wall by more than this part of the average.
const STILL: f64 = 1e-9;

/// The velocity at `p` of the six generators: translations along the axes, rotations about them.
fn generators(p: DVec3) -> [DVec3; 6] {
    [DVec3::X, DVec3::Y, DVec3::Z, DVec3::X.cross(p), DVec3::Y.cross(p), DVec3::Z.cross(p)]
}

/// The combinations of generators that keep every wall node on its walls to first order.
fn symmetries(complex: &Complex, places: &Places) -> Vec<[f64; 6]> {
    // A lattice allows no rotations.
    let count = if complex.period.0.iter().any(Option::is_some) { 3 } else { 6 };
    let mut gram = Mat::<f64>::zeros(count, count);
    for (id, node) in complex.nodes.enumerated() {
        for &wall in &node.walls {
            let normal = complex.walls[wall].field.normal(places[id]);
            let off = generators(places[id]).map(|velocity| velocity.dot(normal));
            for a in 0..count {
                for b in 0..count {
                    gram[(a, b)] += off[a] * off[b];
                }
            }
        }
    }
    let Ok(eigen) = gram.self_adjoint_eigen(Side::Lower) else { return Vec::new() };
    let values = eigen.S();
    let largest = (0..count).map(|i| values[i]).fold(0.0, f64::max);
    (0..count)
        .filter(|&i| values[i] <= STILL * largest)
        .map(|i| std::array::from_fn(|a| if a < count { eigen.U()[(a, i)] } else { 0.0 }))
        .collect()
}

/// One freedom for each rigid motion, chosen so that holding them stops the motions: pivots of Gaussian elimination.
pub(super) fn held_freedoms(
    complex: &Complex,
    places: &Places,
    freedoms: &IndexVec<NodeId, (usize, usize)>,
) -> BTreeSet<usize> {
    let symmetries = symmetries(complex, places);
    let mut held = BTreeSet::new();
    if symmetries.is_empty() {
        return held;
    }
    let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
    for (id, node) in complex.nodes.enumerated() {
        if node.motion != Motion::Free {
            continue;
        }
        let basis = tangent_basis(complex, node, places[id]);
        let velocities = generators(places[id]);
        for (at, direction) in basis.iter().enumerate() {
            let row = symmetries
                .iter()
                .map(|s| s.iter().zip(velocities).map(|(c, v)| c * v.dot(*direction)).sum())
                .collect();
            rows.push((freedoms[id].0 + at, row));
        }
    }
    for _ in 0..symmetries.len() {
        let Some((pivot_row, pivot_column)) = largest_entry(&rows) else { break };
        let (freedom, pivot) = rows[pivot_row].clone();
        held.insert(freedom);
        for (_, row) in &mut rows {
            let factor = row[pivot_column] / pivot[pivot_column];
            row.iter_mut().zip(&pivot).for_each(|(value, p)| *value -= factor * p);
            row[pivot_column] = 0.0;
        }
    }
    // Column operations are not needed: each pivot's column is zero in all rows afterwards.
    held
}

fn largest_entry(rows: &[(usize, Vec<f64>)]) -> Option<(usize, usize)> {
    let mut best = (0.0, None);
    for (i, (_, row)) in rows.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            if value.abs() > best.0 {
                best = (value.abs(), Some((i, j)));
            }
        }
    }
    best.1
}
