//! Law (Euler): F − E + V = χ, hence V = 2N − 2χ and E = 3N − 3χ; and the cells are one connected piece.

use super::NetworkDefect;
use crate::{
    foam::network::{CellId, Network},
    index::Id,
};

pub(in crate::foam::network) fn check(network: &Network) -> Vec<NetworkDefect> {
    let (cells, edges, vertices) =
        (network.cells.len(), network.half_edges.len() / 2, network.vertices.len());
    let expected = network.euler_characteristic;
    let mut found = Vec::new();
    let sum = signed(cells) - signed(edges) + signed(vertices);
    if sum != i64::from(expected) {
        found.push(NetworkDefect::Euler { cells, edges, vertices, expected, found: sum });
    }
    let reached = reached_from_first(network);
    if reached != cells {
        found.push(NetworkDefect::Apart { reached, cells });
    }
    found
}

fn signed(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

fn reached_from_first(network: &Network) -> usize {
    let mut seen = vec![false; network.cells.len()];
    let mut stack: Vec<CellId> = network.cells().take(1).collect();
    let mut count = 0;
    while let Some(cell) = stack.pop() {
        if std::mem::replace(&mut seen[cell.index()], true) {
            continue;
        }
        count += 1;
        stack.extend(network.ring(cell).map(|side| network.neighbour(side)));
    }
    count
}
