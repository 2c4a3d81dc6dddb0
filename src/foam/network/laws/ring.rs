//! Law: the ring of a cell names vertices and cells that exist and passes no vertex twice.

use super::{CellId, NetworkDefect, VertexId};
use crate::{
    foam::network::CellRing,
    index::{Id, IndexVec},
};
use glam::DVec3;
use std::collections::BTreeSet;

pub(in crate::foam::network) fn check(
    vertices: &IndexVec<VertexId, DVec3>,
    cells: &IndexVec<CellId, CellRing>,
) -> Vec<NetworkDefect> {
    let mut found = Vec::new();
    for (id, &position) in vertices.enumerated().filter(|(_, p)| !p.is_finite()) {
        found.push(NetworkDefect::Place { what: "vertex", number: id.index(), position });
    }
    // Three cells that meet at two poles are the smallest foam on a sphere; elsewhere two sides pinch a cell.
    let least = if vertices.len() == 2 { 2 } else { 3 };
    for (cell, ring) in cells.enumerated() {
        if !ring.centre.is_finite() {
            found.push(NetworkDefect::Place { what: "cell", number: cell.index(), position: ring.centre });
        }
        if ring.corners.len() < least {
            found.push(NetworkDefect::FewCorners { cell, corners: ring.corners.len(), least });
        }
        let mut seen = BTreeSet::new();
        for corner in &ring.corners {
            let (number, count) = (corner.vertex.index(), vertices.len());
            if number >= count {
                found.push(NetworkDefect::NoSuch { cell, what: "vertex", number, count });
            }
            let (number, count) = (corner.neighbour.index(), cells.len());
            if number >= count {
                found.push(NetworkDefect::NoSuch { cell, what: "cell", number, count });
            }
            if !seen.insert((corner.vertex, corner.shift.to_array())) {
                found.push(NetworkDefect::Pinched { cell, vertex: corner.vertex });
            }
        }
    }
    found
}
