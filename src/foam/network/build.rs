//! A network from lists, and its check.

use super::{Cell, CellId, HalfEdge, HalfEdgeId, Network, NetworkDefect, Vertex, VertexId, laws, rim::Rim};
use crate::{
    index::{Id, IndexVec},
    surface::Period,
};
use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One corner of a cell and the side that starts there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RingCorner {
    /// The vertex.
    pub vertex: VertexId,
    /// Which image of it: its place plus this many periods lies at the cell round the stored centre.
    pub shift: IVec3,
    /// The cell across the side from this corner to the next.
    pub neighbour: CellId,
}

/// A cell as the ring of its corners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellRing {
    /// Its centre, unwrapped.
    pub centre: DVec3,
    /// Its corners, counter-clockwise as seen from the upper wall.
    pub corners: Vec<RingCorner>,
}

/// Two sides are the same edge if these agree (one of them reversed): ends, image of the target, and the two cells.
type SideKey = (VertexId, VertexId, [i32; 3], CellId, CellId);

impl Network {
    /// The network of the given cells on a surface of Euler characteristic `euler_characteristic`.
    ///
    /// # Errors
    /// Every [`NetworkDefect`] found: sides without exactly one partner, vertices that are not three-valent, numbers of
    /// vertices and edges that contradict the Euler characteristic, cells that touch themselves, malformed rings.
    pub fn new(
        period: Period,
        euler_characteristic: i32,
        vertices: &IndexVec<VertexId, DVec3>,
        cells: &IndexVec<CellId, CellRing>,
    ) -> Result<Self, Vec<NetworkDefect>> {
        let defects = laws::ring::check(vertices, cells);
        if !defects.is_empty() {
            return Err(defects);
        }
        let (pairs, defects) = pair_sides(cells);
        if !defects.is_empty() {
            return Err(defects);
        }
        let network = assemble(period, euler_characteristic, vertices, cells, &pairs);
        let defects = network.defects();
        if defects.is_empty() { Ok(network) } else { Err(defects) }
    }

    /// Every violation of the laws: empty unless the network was read from a damaged file.
    #[must_use]
    pub fn defects(&self) -> Vec<NetworkDefect> {
        let mut found = laws::pairing::check(self);
        if !found.is_empty() {
            // The other laws walk along rings, which need not end where sides do not pair.
            return found;
        }
        found.extend(laws::valence::check(self));
        found.extend(laws::euler::check(self));
        found.extend(laws::contact::check(self));
        found.extend(laws::rim::check(self));
        found
    }
}

/// The half-edge of every corner of every cell; partners get twin ids. Ids follow the order of the lists.
fn pair_sides(cells: &IndexVec<CellId, CellRing>) -> (Vec<Vec<HalfEdgeId>>, Vec<NetworkDefect>) {
    let mut ids: Vec<Vec<Option<HalfEdgeId>>> =
        cells.iter().map(|ring| vec![None; ring.corners.len()]).collect();
    let mut open: BTreeMap<SideKey, (CellId, usize)> = BTreeMap::new();
    let mut defects = Vec::new();
    let mut edges = 0;
    for (cell, ring) in cells.enumerated() {
        for (at, corner) in ring.corners.iter().enumerate() {
            let to = ring.corners[(at + 1) % ring.corners.len()];
            let shift = to.shift - corner.shift;
            let reversed = (to.vertex, corner.vertex, (-shift).to_array(), corner.neighbour, cell);
            if let Some((other, other_at)) = open.remove(&reversed) {
                ids[other.index()][other_at] = Some(HalfEdgeId::from_index(2 * edges));
                ids[cell.index()][at] = Some(HalfEdgeId::from_index(2 * edges + 1));
                edges += 1;
                continue;
            }
            let key = (corner.vertex, to.vertex, shift.to_array(), cell, corner.neighbour);
            if open.insert(key, (cell, at)).is_some() {
                defects.push(NetworkDefect::SideTwice { cell, from: corner.vertex, to: to.vertex });
            }
        }
    }
    defects.extend(open.into_iter().map(|((from, to, _, cell, neighbour), _)| NetworkDefect::Unpaired {
        cell,
        neighbour,
        from,
        to,
    }));
    let paired = ids.into_iter().map(|ring| ring.into_iter().flatten().collect()).collect();
    (paired, defects)
}

fn assemble(
    period: Period,
    euler_characteristic: i32,
    vertices: &IndexVec<VertexId, DVec3>,
    cells: &IndexVec<CellId, CellRing>,
    sides: &[Vec<HalfEdgeId>],
) -> Network {
    let count = sides.iter().map(Vec::len).sum();
    let first = HalfEdgeId::from_index(0);
    let blank = HalfEdge {
        origin: VertexId::from_index(0),
        target_shift: IVec3::ZERO,
        next: first,
        previous: first,
        cell: CellId::from_index(0),
        cell_shift: IVec3::ZERO,
    };
    let mut half_edges = IndexVec::from_elem(blank, count);
    let mut places: IndexVec<VertexId, Vertex> =
        vertices.iter().map(|&position| Vertex { position, out: first }).collect();
    for (cell, ring) in cells.enumerated() {
        let ids = &sides[cell.index()];
        let n = ids.len();
        for at in 0..n {
            let (corner, to) = (ring.corners[at], ring.corners[(at + 1) % n]);
            half_edges[ids[at]] = HalfEdge {
                origin: corner.vertex,
                target_shift: to.shift - corner.shift,
                next: ids[(at + 1) % n],
                previous: ids[(at + n - 1) % n],
                cell,
                cell_shift: -corner.shift,
            };
            places[corner.vertex].out = ids[at];
        }
    }
    let cells = cells
        .enumerated()
        .map(|(id, ring)| Cell {
            centre: ring.centre,
            side: sides[id.index()].first().copied().unwrap_or(first),
        })
        .collect();
    Network { period, euler_characteristic, vertices: places, cells, half_edges, rim: Rim::default() }
}
