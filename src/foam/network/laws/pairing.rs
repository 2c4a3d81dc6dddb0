//! Law: twins run opposite ways between the same images of the same vertices, and sides link into rings of one cell.

use super::NetworkDefect;
use crate::{
    foam::network::{HalfEdgeId, Network},
    index::Id,
};

pub(in crate::foam::network) fn check(network: &Network) -> Vec<NetworkDefect> {
    let mut found = Vec::new();
    let count = network.half_edges.len();
    let exists = |side: HalfEdgeId| side.index() < count;
    for (side, here) in network.half_edges.enumerated() {
        let mut say = |what| found.push(NetworkDefect::Links { side, what });
        if !exists(side.twin()) || !exists(here.next) || !exists(here.previous) {
            say("it links to a half-edge that does not exist");
            continue;
        }
        if here.origin.index() >= network.vertices.len() || here.cell.index() >= network.cells.len() {
            say("it names a vertex or cell that does not exist");
            continue;
        }
        if network.half_edges[side.twin()].target_shift != -here.target_shift {
            say("its twin does not run back between the same images");
        }
        let next = &network.half_edges[here.next];
        if next.previous != side || network.half_edges[here.previous].next != side {
            say("its next and previous sides do not link back");
        }
        if next.cell != here.cell || next.cell_shift != here.cell_shift - here.target_shift {
            say("its next side belongs to another cell or image");
        }
        if network.target(side) != next.origin {
            say("its next side does not start where it ends");
        }
    }
    for (id, cell) in network.cells.enumerated() {
        if !exists(cell.side) || network.half_edges[cell.side].cell != id {
            found.push(NetworkDefect::Links {
                side: cell.side,
                what: "a cell claims it, but it has another cell",
            });
        }
    }
    for (id, vertex) in network.vertices.enumerated() {
        if !exists(vertex.out) || network.half_edges[vertex.out].origin != id {
            found.push(NetworkDefect::Links {
                side: vertex.out,
                what: "a vertex claims it, but it starts elsewhere",
            });
        }
    }
    found
}
