//! Angles at the corners of a foam of free topology.

use super::FreeFoam;
use crate::{foam::complex::NodeImage, index::Id};
use glam::DVec3;
use std::collections::BTreeMap;

/// The angle between borders that meet at a corner of a soap foam, acos(−1/3) (J. Plateau, 1873).
#[must_use]
pub fn tetrahedral_angle() -> f64 {
    (-1.0_f64 / 3.0).acos()
}

/// The angles between the borders at every corner inside the gap where four of them meet, six to a corner, in radians.
#[must_use]
pub fn corner_angles(foam: &FreeFoam) -> Vec<f64> {
    let mut ways: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for nodes in foam.films.borders.values() {
        let first = nodes[0].node.index();
        let last = nodes[nodes.len() - 1].node.index();
        ways.entry(first).or_default().push(start_way(foam, nodes.iter()));
        ways.entry(last).or_default().push(start_way(foam, nodes.iter().rev()));
    }
    let inside = |corner: usize| foam.division.corners[corner].wall.is_none();
    ways.iter()
        .filter(|(corner, ways)| inside(**corner) && ways.len() == 4)
        .flat_map(|(_, ways)| {
            (0..4).flat_map(move |i| (0..i).map(move |j| ways[i].dot(ways[j]).clamp(-1.0, 1.0).acos()))
        })
        .collect()
}

/// The unit tangent at the start of a border: that of its first quadratic piece.
fn start_way<'a>(foam: &FreeFoam, mut nodes: impl Iterator<Item = &'a NodeImage>) -> DVec3 {
    let first = nodes.next().copied();
    let place = |image: Option<NodeImage>| image.map_or(DVec3::NAN, |image| foam.place(image));
    let a = place(first);
    let (b, c) = (place(nodes.next().copied()), place(nodes.next().copied()));
    (4.0 * b - 3.0 * a - c).normalize_or_zero()
}
