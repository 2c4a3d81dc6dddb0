//! Law: the outside lies beyond planes, borders cells only, and leaves cells over.

use super::NetworkDefect;
use crate::foam::network::Network;

pub(in crate::foam::network) fn check(network: &Network) -> Vec<NetworkDefect> {
    let rim = &network.rim;
    if rim.outside >= network.cells.len() {
        return vec![NetworkDefect::Rim { what: "all its faces are the outside" }];
    }
    if rim.outside > 0 && rim.planes.is_empty() {
        return vec![NetworkDefect::Rim { what: "it has an outside, but no planes that cut it off" }];
    }
    let both_outside =
        |side: &_| network.is_outside(network.cell(*side)) && network.is_outside(network.neighbour(*side));
    let twice = network.edges().map(|edge| edge.half_edges()[0]).filter(both_outside);
    twice.map(|_| NetworkDefect::Rim { what: "an edge has the outside on both sides" }).collect()
}
