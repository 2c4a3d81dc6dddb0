//! What can be wrong with a partition.

use super::{Beyond, PartitionCell, Side};
use crate::{
    foam::network::{CellId, NetworkDefect},
    surface::WallSide,
};

/// The volumes must fill the gap to this relative error: that of the gap's own volume by quadrature. A cell that is lost
/// from up to some hundred shows; the network's laws find it among any number.
const VOLUME_TOLERANCE: f64 = 2e-3;

/// A way in which clipped Voronoi cells are no one-layer foam.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PartitionDefect {
    /// Planes meet so closely that rounding decides what they leave.
    #[error("cell {cell}: its bisecting planes meet too closely to be told apart; two seeds may coincide")]
    Degenerate {
        /// The cell.
        cell: CellId,
    },
    /// Walls and films cross in a way that cannot be resolved.
    #[error(
        "cell {cell}: a wall crosses its films in a way that cannot be resolved; the gap is too wide or too curved for it"
    )]
    Tangled {
        /// The cell.
        cell: CellId,
    },
    /// The cell does not end.
    #[error("cell {cell} reaches across the whole domain: there are too few cells")]
    Unbounded {
        /// The cell.
        cell: CellId,
    },
    /// The cell is not connected.
    #[error("cell {cell} is in {pieces} pieces: there are too few cells for this surface")]
    Pieces {
        /// The cell.
        cell: CellId,
        /// How many.
        pieces: usize,
    },
    /// The cell does not reach from wall to wall, or meets a wall in several places.
    #[error("cell {cell} meets the {} wall in {patches} patches instead of one: the gap is too wide for one layer of so many cells", name(*.wall))]
    Patches {
        /// The cell.
        cell: CellId,
        /// The wall.
        wall: WallSide,
        /// How many patches.
        patches: usize,
    },
    /// The cell does not meet the middle surface in one loop.
    #[error(
        "cell {cell} meets the middle surface in {loops} loops instead of one: there are too few cells for this surface"
    )]
    Sections {
        /// The cell.
        cell: CellId,
        /// How many loops.
        loops: usize,
    },
    /// The volume came out undefined.
    #[error(
        "cell {cell}: its patch on a wall is too strongly curved for its volume to be measured; there are too few cells"
    )]
    Curved {
        /// The cell.
        cell: CellId,
    },
    /// Part of the gap belongs to no cell, or to two.
    #[error("the cells fill {sum} of the gap's volume {gap}: part of the gap has no cell")]
    Volume {
        /// All cells together.
        sum: f64,
        /// The gap, by quadrature.
        gap: f64,
    },
    /// The cell ends at two planes that face each other.
    #[error("cell {cell} reaches from one cut plane to the one that faces it: there are too few cells")]
    Spans {
        /// The cell.
        cell: CellId,
    },
    /// The cell covers more than one corner of the domain.
    #[error("cell {cell} covers two corners of the domain: there are too few cells")]
    Corners {
        /// The cell.
        cell: CellId,
    },
    /// The lines in which planes cut the middle surface do not close.
    #[error(
        "the cut beside cell {cell} closes in no line: it winds round the period, or one cell has all of it"
    )]
    OpenRim {
        /// The cell.
        cell: CellId,
    },
    /// The cells on the middle surface are no network.
    #[error("the cells do not cover the middle surface properly: {0}")]
    Network(#[from] NetworkDefect),
}

impl PartitionDefect {
    /// Whether the cells may be sound in a narrower gap round the same middle surface.
    #[must_use]
    pub const fn is_of_depth(&self) -> bool {
        matches!(
            self,
            Self::Tangled { .. }
                | Self::Pieces { .. }
                | Self::Patches { .. }
                | Self::Curved { .. }
                | Self::Volume { .. }
        )
    }
}

const fn name(wall: WallSide) -> &'static str {
    match wall {
        WallSide::Lower => "lower",
        WallSide::Upper => "upper",
    }
}

/// What is wrong with one cell.
pub(super) fn of_cell(id: CellId, cell: &PartitionCell) -> Vec<PartitionDefect> {
    let mut defects = Vec::new();
    if cell.pieces != 1 {
        defects.push(PartitionDefect::Pieces { cell: id, pieces: cell.pieces });
    }
    for wall in WallSide::BOTH {
        let patches = cell.faces.iter().filter(|face| face.beyond == Beyond::Wall(wall)).count();
        if patches != 1 {
            defects.push(PartitionDefect::Patches { cell: id, wall, patches });
        }
    }
    if cell.sections.len() != 1 {
        defects.push(PartitionDefect::Sections { cell: id, loops: cell.sections.len() });
    }
    let sides: Vec<&Side> = cell.sections.iter().flatten().collect();
    let ends_at = |end: Beyond| sides.iter().any(|side| side.beyond == end);
    let faces = |high| (0_u8..3).map(move |axis| Beyond::Plane { axis, high });
    if faces(false).zip(faces(true)).any(|(low, high)| ends_at(low) && ends_at(high)) {
        defects.push(PartitionDefect::Spans { cell: id });
    }
    let is_plane = |beyond| matches!(beyond, Beyond::Plane { .. });
    if sides.iter().filter(|side| is_plane(side.before) && is_plane(side.beyond)).count() > 1 {
        defects.push(PartitionDefect::Corners { cell: id });
    }
    if !cell.volume.is_finite() {
        defects.push(PartitionDefect::Curved { cell: id });
    }
    defects
}

/// Whether the volumes fill the gap.
pub(super) fn of_volume(sum: f64, gap: f64) -> Option<PartitionDefect> {
    ((sum / gap - 1.0).abs() > VOLUME_TOLERANCE).then_some(PartitionDefect::Volume { sum, gap })
}
