//! Law: no cell touches itself, not even an image of itself one period away.

use super::NetworkDefect;
use crate::foam::network::Network;

pub(in crate::foam::network) fn check(network: &Network) -> Vec<NetworkDefect> {
    network
        .edges()
        .map(|edge| edge.half_edges()[0])
        .filter(|&side| network.cell(side) == network.neighbour(side))
        .map(|side| NetworkDefect::TouchesItself {
            cell: network.cell(side),
            shift: network.neighbour_shift(side),
        })
        .collect()
}
