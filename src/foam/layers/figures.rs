//! What there is to count of the layers.

use crate::foam::free::Division;
use serde::Serialize;

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
    [0..division.lower(), division.lower()..cells].map(|layer| LayerFigures {
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
