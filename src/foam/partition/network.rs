//! The network on the middle surface: the restricted Voronoi diagram.

use super::{Beyond, Partition, PartitionDefect, Side};
use crate::{
    foam::network::{CellId, CellRing, Network, RingCorner, VertexId},
    index::IndexVec,
};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// Two corners are the same vertex if they lie within this fraction of the largest coordinate: far above rounding, far below
/// the shortest edge that a relaxation can use.
const SAME_PLACE: f64 = 1e-9;

/// The three cells round a vertex with their shifts, relative to the first.
type Triple = [(CellId, [i32; 3]); 3];

impl Partition {
    /// The network of the cells on the middle surface.
    ///
    /// # Errors
    /// [`PartitionDefect::OpenDomain`] where the domain has plane walls, or every violation of the network's laws.
    pub fn network(&self) -> Result<Network, Vec<PartitionDefect>> {
        if self.domain.has_walls() {
            return Err(vec![PartitionDefect::OpenDomain]);
        }
        let mut vertices = Vertices { partition: self, places: IndexVec::new(), known: BTreeMap::new() };
        let mut rings = IndexVec::new();
        for (id, cell) in self.cells.enumerated() {
            rings.push(CellRing {
                centre: cell.seed,
                corners: cell
                    .sections
                    .iter()
                    .flatten()
                    .filter_map(|side| vertices.corner(id, side))
                    .collect(),
            });
        }
        Network::new(self.domain.period(), self.euler_characteristic, &vertices.places, &rings)
            .map_err(|defects| defects.into_iter().map(PartitionDefect::Network).collect())
    }
}

/// The vertices found so far.
struct Vertices<'a> {
    partition: &'a Partition,
    places: IndexVec<VertexId, DVec3>,
    known: BTreeMap<Triple, Vec<VertexId>>,
}

impl Vertices<'_> {
    /// The corner where a side of cell `id` starts; none where the domain ends.
    fn corner(&mut self, id: CellId, side: &Side) -> Option<RingCorner> {
        let (Beyond::Cell(neighbour, image), Beyond::Cell(other, other_image)) = (side.beyond, side.before)
        else {
            return None;
        };
        let round = [(id, IVec3::ZERO), (neighbour, image.shift()), (other, other_image.shift())];
        let (triple, base) = canonical(round);
        let place = side.start - self.partition.domain.period().translation(base);
        let tolerance = SAME_PLACE * (1.0 + place.abs().max_element());
        let same = self.known.entry(triple).or_default();
        let found = same.iter().copied().find(|&vertex| self.places[vertex].distance(place) < tolerance);
        let vertex = found.unwrap_or_else(|| {
            let vertex = self.places.push(place);
            same.push(vertex);
            vertex
        });
        Some(RingCorner { vertex, shift: base, neighbour })
    }
}

/// The least of the ways to write three cells with one of them unshifted, and the shift that was taken off.
fn canonical(round: [(CellId, IVec3); 3]) -> (Triple, IVec3) {
    let written = |base: IVec3| {
        let mut triple = round.map(|(cell, shift)| (cell, (shift - base).to_array()));
        triple.sort_unstable();
        (triple, base.to_array())
    };
    let [a, b, c] = round.map(|(_, shift)| written(shift));
    let (triple, base) = a.min(b).min(c);
    (triple, IVec3::from_array(base))
}
