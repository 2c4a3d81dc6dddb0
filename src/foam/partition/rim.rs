//! The outside beyond the planes that cut the middle surface off: one ring for each closed line of cuts.

use super::PartitionDefect;
use crate::{
    foam::network::{CellId, CellRing, RingCorner, VertexId},
    index::{Id, IndexVec},
    surface::Period,
};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// A side of a cell that lies on the rim.
struct RimSide {
    cell: CellId,
    /// Its place in the cell's ring.
    at: usize,
    start: (VertexId, IVec3),
    end: (VertexId, IVec3),
}

/// The rings of the outside, which run against the cells' sides. Sides whose neighbour is the cell behind the last one get
/// their part of the outside for it.
///
/// # Errors
/// [`PartitionDefect::OpenRim`] where the sides do not close in lines.
pub(super) fn outside(
    rings: &mut IndexVec<CellId, CellRing>,
    places: &IndexVec<VertexId, DVec3>,
    period: &Period,
) -> Result<Vec<CellRing>, PartitionDefect> {
    let cells = rings.len();
    let mut by_end = sides_by_end(rings, CellId::from_index(cells));
    let mut found = Vec::new();
    while let Some((last, first)) = by_end.pop_first() {
        let beyond = CellId::from_index(cells + found.len());
        let begin = first.end;
        let (mut here, mut offset) = (first, IVec3::ZERO);
        let mut corners = Vec::new();
        loop {
            rings[here.cell].corners[here.at].neighbour = beyond;
            let (vertex, shift) = here.end;
            corners.push(RingCorner { vertex, shift: shift + offset, neighbour: here.cell });
            let (next, shift) = (here.start.0, here.start.1 + offset);
            if next == last {
                if shift != begin.1 {
                    return Err(PartitionDefect::OpenRim { cell: here.cell });
                }
                break;
            }
            let cell = here.cell;
            here = by_end.remove(&next).ok_or(PartitionDefect::OpenRim { cell })?;
            offset = shift - here.end.1;
        }
        let place = |corner: &RingCorner| places[corner.vertex] + period.translation(corner.shift);
        let count = crate::foam::convert::as_f64(corners.len());
        let centre = corners.iter().map(place).sum::<DVec3>() / count;
        found.push(CellRing { centre, corners });
    }
    Ok(found)
}

fn sides_by_end(rings: &IndexVec<CellId, CellRing>, outside: CellId) -> BTreeMap<VertexId, RimSide> {
    let mut sides = BTreeMap::new();
    for (cell, ring) in rings.enumerated() {
        for (at, corner) in ring.corners.iter().enumerate() {
            if corner.neighbour == outside {
                let to = ring.corners[(at + 1) % ring.corners.len()];
                let (start, end) = ((corner.vertex, corner.shift), (to.vertex, to.shift));
                sides.insert(to.vertex, RimSide { cell, at, start, end });
            }
        }
    }
    sides
}
