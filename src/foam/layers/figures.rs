//! What there is to count and to measure of two layers.

use super::{Division, Layers};
use crate::foam::{complex::NodeImage, convert::as_f64};
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
    /// How the cells that are no hexagons sit to those of the other layer.
    pub companions: Companions,
}

/// How the defects of one layer sit to those of the other. Lengths are straight, in units of the spacing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Companions {
    /// Cells of this layer that are no hexagons.
    pub defects: usize,
    /// The mean distance from such a cell to the nearest of the other layer; not a number without any.
    pub nearest: f64,
    /// The same from all cells of this layer: what chance would give.
    pub nearest_by_chance: f64,
    /// The correlation, over this layer's cells, of 6 − n with its mean over the cells of the other layer that they touch.
    pub charge_correlation: f64,
}

/// Side counts and defects of the lower and the upper layer. `spacing` is the unit of the distances.
#[must_use]
pub fn layer_figures(division: &Division, spacing: f64) -> [LayerFigures; 2] {
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
    [0..division.lower, division.lower..cells].map(|layer| {
        let other: Vec<usize> = (0..cells).filter(|cell| !layer.contains(cell)).collect();
        LayerFigures {
            side_counts: counts(layer.clone().map(|cell| sides[cell])),
            end_counts: counts(layer.clone().map(|cell| across[cell].len())),
            sides: sides[layer.clone()].to_vec(),
            ends: layer.clone().map(|cell| across[cell].len()).collect(),
            companions: companions(division, &sides, &across, &layer, &other, spacing),
        }
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

fn companions(
    division: &Division,
    sides: &[usize],
    across: &[Vec<usize>],
    layer: &std::ops::Range<usize>,
    other: &[usize],
    spacing: f64,
) -> Companions {
    let far: Vec<DVec3> =
        other.iter().filter(|&&cell| sides[cell] != 6).map(|&cell| division.seeds[cell]).collect();
    let nearest = |cell: usize| {
        let apart = |q: &DVec3| division.period.nearest_image(division.seeds[cell] - *q).length();
        far.iter().map(apart).fold(f64::NAN, f64::min) / spacing
    };
    let charge = |cell: usize| 6.0 - as_f64(sides[cell]);
    let pairs: Vec<(f64, f64)> = layer
        .clone()
        .filter(|&cell| !across[cell].is_empty())
        .map(|cell| (charge(cell), mean(across[cell].iter().map(|&b| charge(b)))))
        .collect();
    Companions {
        defects: layer.clone().filter(|&cell| sides[cell] != 6).count(),
        nearest: mean(layer.clone().filter(|&cell| sides[cell] != 6).map(nearest)),
        nearest_by_chance: mean(layer.clone().map(nearest)),
        charge_correlation: correlation(&pairs),
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let (a, b) = (mean(pairs.iter().map(|p| p.0)), mean(pairs.iter().map(|p| p.1)));
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
    sum(&|p| (p.0 - a) * (p.1 - b)) / (sum(&|p| (p.0 - a).powi(2)) * sum(&|p| (p.1 - b).powi(2))).sqrt()
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
