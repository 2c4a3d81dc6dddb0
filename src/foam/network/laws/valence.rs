//! Law (Plateau): three edges meet at every vertex.

use super::NetworkDefect;
use crate::foam::network::Network;

pub(in crate::foam::network) fn check(network: &Network) -> Vec<NetworkDefect> {
    let mut starting = vec![0_usize; network.vertices.len()];
    for side in &network.half_edges {
        starting[crate::index::Id::index(side.origin)] += 1;
    }
    network
        .vertices()
        .zip(starting)
        // Three sides that do not form one turn round the vertex are as wrong as four.
        .map(|(vertex, sides)| (vertex, if sides == 3 { network.outgoing(vertex).count() } else { sides }))
        .filter(|&(_, valence)| valence != 3)
        .map(|(vertex, valence)| NetworkDefect::Valence { vertex, valence })
        .collect()
}
