//! What there is to count and to measure of the layers.

use super::{Division, Layers};
use crate::foam::complex::NodeImage;
use crate::index::Id;
use glam::DVec3;
use serde::Serialize;
use std::collections::BTreeMap;

/// The angle between borders that meet at a corner of a soap foam, acos(−1/3) (J. Plateau, 1873).
#[must_use]
pub fn tetrahedral_angle() -> f64 {
    (-1.0_f64 / 3.0).acos()
}

/// The cells of one layer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerFigures {
    /// How many cells have 0, 1, 2 … sides on their wall.
    pub side_counts: Vec<usize>,
    /// How many cells touch 0, 1, 2 … cells of the other layer.
    pub end_counts: Vec<usize>,
    /// The number of sides of every cell.
    pub sides: Vec<usize>,
    /// The number of films at its end.
    pub ends: Vec<usize>,
}

/// Side counts of the lower and the upper layer.
#[must_use]
pub fn layer_figures(division: &Division) -> [LayerFigures; 2] {
    let cells = division.seeds.len();
    let (mut sides, mut across) = (vec![0_usize; cells], vec![Vec::new(); cells]);
    for polygon in &division.polygons {
        let (a, b) = (polygon.cell, polygon.neighbour);
        if division.is_lower(a) == division.is_lower(b) {
            // Films between cells of one layer that do not reach the wall are no sides.
            let on_wall = division.wall_sides(polygon).count();
            sides[a] += on_wall;
            sides[b] += on_wall;
        } else {
            across[a].push(b);
            across[b].push(a);
        }
    }
    [0..division.lower, division.lower..cells].map(|layer| LayerFigures {
        side_counts: counts(layer.clone().map(|cell| sides[cell])),
        end_counts: counts(layer.clone().map(|cell| across[cell].len())),
        sides: sides[layer.clone()].to_vec(),
        ends: layer.clone().map(|cell| across[cell].len()).collect(),
    })
}

fn counts(values: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut counts = Vec::new();
    for value in values {
        if counts.len() <= value {
            counts.resize(value + 1, 0);
        }
        counts[value] += 1;
    }
    counts
}

/// The angles between the borders at every corner inside the gap where four of them meet, six to a corner, in radians.
#[must_use]
pub fn corner_angles(layers: &Layers) -> Vec<f64> {
    let mut ways: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for nodes in layers.films.borders.values() {
        let first = nodes[0].node.index();
        let last = nodes[nodes.len() - 1].node.index();
        ways.entry(first).or_default().push(start_way(layers, nodes.iter()));
        ways.entry(last).or_default().push(start_way(layers, nodes.iter().rev()));
    }
    let inside = |corner: usize| layers.division.corners[corner].wall.is_none();
    ways.iter()
        .filter(|(corner, ways)| inside(**corner) && ways.len() == 4)
        .flat_map(|(_, ways)| {
            (0..4).flat_map(move |i| (0..i).map(move |j| ways[i].dot(ways[j]).clamp(-1.0, 1.0).acos()))
        })
        .collect()
}

/// The unit tangent at the start of a border: that of its first quadratic piece.
fn start_way<'a>(layers: &Layers, mut nodes: impl Iterator<Item = &'a NodeImage>) -> DVec3 {
    let first = nodes.next().copied();
    let place = |image: Option<NodeImage>| image.map_or(DVec3::NAN, |image| layers.place(image));
    let a = place(first);
    let (b, c) = (place(nodes.next().copied()), place(nodes.next().copied()));
    (4.0 * b - 3.0 * a - c).normalize_or_zero()
}
