//! The network on the middle surface: the restricted Voronoi diagram.

use super::{Beyond, Partition, PartitionDefect, Side, rim};
use crate::{
    foam::{
        convert::{as_f64, whole},
        network::{CellId, CellRing, Network, RingCorner, VertexId},
    },
    index::{Id, IndexVec},
};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// Two corners are the same vertex if they lie within this fraction of the largest coordinate: far above rounding, far below
/// the shortest edge that a relaxation can use.
const SAME_PLACE: f64 = 1e-9;

/// A cell and which image of it.
type Image = (CellId, IVec3);

/// The cells round a vertex with their shifts, relative to one of them: three, or two where a film ends at a plane.
type Round = Vec<(CellId, [i32; 3])>;

impl Partition {
    /// The network of the cells on the middle surface; where planes cut it off, with its rim.
    ///
    /// # Errors
    /// Every violation of the network's laws.
    pub fn network(&self) -> Result<Network, Vec<PartitionDefect>> {
        let outside = CellId::from_index(self.cells.len());
        let mut vertices = Vertices { partition: self, places: IndexVec::new(), known: BTreeMap::new() };
        let mut rings: IndexVec<CellId, CellRing> = IndexVec::new();
        for (id, cell) in self.cells.enumerated() {
            let sides = cell.sections.iter().flatten();
            let corners = sides.filter_map(|side| vertices.corner(id, side, outside)).collect();
            rings.push(CellRing { centre: cell.seed, corners });
        }
        let rims = rim::outside(&mut rings, &vertices.places, &self.domain.period()).map_err(|e| vec![e])?;
        let count = rims.len();
        rims.into_iter().for_each(|ring| _ = rings.push(ring));
        // Each line of the rim is closed by a disc.
        let euler_characteristic = self.euler_of_piece() + i32::try_from(count).unwrap_or(i32::MAX);
        Network::new(self.domain.period(), euler_characteristic, &vertices.places, &rings)
            .and_then(|network| network.with_rim(self.domain.cut_planes(), count))
            .map_err(|defects| defects.into_iter().map(PartitionDefect::Network).collect())
    }

    /// The Euler characteristic of the middle surface inside the domain, by the Gauss–Bonnet theorem: a plane of mirror
    /// symmetry cuts in geodesics, two of them meet at a right angle, and ∫ K dA is shared out evenly.
    fn euler_of_piece(&self) -> i32 {
        let is_corner =
            |side: &&Side| matches!((side.before, side.beyond), (Beyond::Plane { .. }, Beyond::Plane { .. }));
        let sides = self.cells.iter().flat_map(|cell| cell.sections.iter().flatten());
        let corners = sides.filter(is_corner).count();
        whole((f64::from(self.euler_characteristic) * self.periods + 0.25 * as_f64(corners)).round())
    }
}

/// The vertices found so far.
struct Vertices<'a> {
    partition: &'a Partition,
    places: IndexVec<VertexId, DVec3>,
    known: BTreeMap<Round, Vec<VertexId>>,
}

impl Vertices<'_> {
    /// The corner where a side of cell `id` starts, with `outside` for what lies beyond planes; none where two planes meet.
    fn corner(&mut self, id: CellId, side: &Side, outside: CellId) -> Option<RingCorner> {
        let own = (id, IVec3::ZERO);
        let (round, plane, neighbour) = match (side.before, side.beyond) {
            (Beyond::Cell(before, first), Beyond::Cell(beyond, second)) => {
                (vec![own, (beyond, second.shift()), (before, first.shift())], None, beyond)
            }
            (Beyond::Cell(before, image), Beyond::Plane { axis, high }) => {
                (vec![own, (before, image.shift())], Some((axis, high)), outside)
            }
            (Beyond::Plane { axis, high }, Beyond::Cell(beyond, image)) => {
                (vec![own, (beyond, image.shift())], Some((axis, high)), beyond)
            }
            _ => return None,
        };
        let start = match plane.map(|(axis, high)| self.partition.domain.cut_plane(axis, high)) {
            Some(plane) => plane.nearest_to(side.start),
            None => side.start,
        };
        let (vertex, shift) = self.vertex(&round, start);
        Some(RingCorner { vertex, shift, neighbour })
    }

    /// The vertex between some cells at a place, and which image of it lies there.
    fn vertex(&mut self, between: &[Image], start: DVec3) -> (VertexId, IVec3) {
        let (round, base) = canonical(between);
        let place = start - self.partition.domain.period().translation(base);
        let tolerance = SAME_PLACE * (1.0 + place.abs().max_element());
        let same = self.known.entry(round).or_default();
        let found = same.iter().copied().find(|&vertex| self.places[vertex].distance(place) < tolerance);
        let vertex = found.unwrap_or_else(|| {
            let vertex = self.places.push(place);
            same.push(vertex);
            vertex
        });
        (vertex, base)
    }
}

/// The least of the ways to write some cells with one of them unshifted, and the shift that was taken off.
fn canonical(between: &[Image]) -> (Round, IVec3) {
    let written = |&(_, base): &Image| {
        let mut round: Round =
            between.iter().map(|&(cell, shift)| (cell, (shift - base).to_array())).collect();
        round.sort_unstable();
        (round, base.to_array())
    };
    let (round, base) = between.iter().map(written).min().unwrap_or_default();
    (round, IVec3::from_array(base))
}
