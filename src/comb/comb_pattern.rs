//! From a reading at working scale to the cells of the photograph.

use super::{
    cell_status::{Standing, standings},
    evidence::{RAYS, direction},
    kinds::Kind,
    read::Reading,
};
use crate::{
    index::{Id, IndexVec},
    tessellation::{Cell, CellId, CellPattern, CellStatus, CellWall, PatternDefect, Surroundings},
};
use glam::{DVec2, DVec3, IVec3};
use rayon::prelude::*;

/// What a photograph tells of a cell beyond the pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct CellDetail {
    /// Its outline in pixels of the photograph, from the middle of wall to the middle of wall; empty for a cell that cannot
    /// be seen.
    pub outline: Vec<DVec2>,
    /// The other number of sides that the photograph allows, where a wall is too short to decide.
    pub other_sides: Option<u32>,
    /// Whether the cell can be seen; if not, its place was inferred from its neighbours.
    pub seen: bool,
}

/// Cells and details of a reading; `origin` is the corner of the part that was read.
pub(crate) fn assemble(
    reading: &Reading,
    origin: DVec2,
) -> Result<(CellPattern, IndexVec<CellId, CellDetail>), Vec<PatternDefect>> {
    let standings = standings(reading);
    let listed: Vec<usize> = (0..reading.centres.len())
        .filter(|i| reading.kinds[*i] != Kind::Outside && reading.holds(reading.centres[*i]))
        .collect();
    let mut ids = vec![None; reading.centres.len()];
    for (position, index) in listed.iter().enumerate() {
        ids[*index] = Some(CellId::from_index(position));
    }
    let place = |at: DVec2| at / reading.scale + origin;
    let cells: Vec<Cell> = listed.par_iter().map(|i| cell(reading, *i, standings[*i], &ids, place)).collect();
    let cells = cells.into_iter().collect();
    let details: Vec<CellDetail> = listed.par_iter().map(|i| detail(reading, *i, place)).collect();
    let details = details.into_iter().collect();
    Ok((CellPattern::new("px", Surroundings::Open, cells)?, details))
}

fn cell(
    reading: &Reading,
    index: usize,
    standing: Standing,
    ids: &[Option<CellId>],
    place: impl Fn(DVec2) -> DVec2,
) -> Cell {
    let count = &reading.counts[index];
    let centre = reading.centres[index];
    let mut ring = count.neighbours.clone();
    ring.sort_by(|a, b| {
        let angle = |n: &usize| (reading.centres[*n] - centre).to_angle();
        angle(a).total_cmp(&angle(b))
    });
    let wall = |n: &usize| CellWall {
        neighbour: ids[*n],
        shift: IVec3::ZERO,
        length: reading.wall_length(index, *n) / reading.scale,
    };
    let seen = reading.kinds[index] == Kind::Seen;
    let counted = seen && standing.status != CellStatus::Cut;
    Cell {
        position: place(centre).extend(0.0),
        normal: DVec3::Z,
        sides: if counted { u32::try_from(ring.len()).ok() } else { None },
        status: standing.status,
        confidence: if counted { standing.confidence } else { 0.0 },
        area: if seen { reading.regions[index].area / reading.scale.powi(2) } else { 0.0 },
        gauss_curvature: None,
        walls: ring.iter().map(wall).collect(),
    }
}

fn detail(reading: &Reading, index: usize, place: impl Fn(DVec2) -> DVec2) -> CellDetail {
    let seen = reading.kinds[index] == Kind::Seen;
    let corner = |ray: usize| {
        let at = reading.centres[index] + direction(ray) * reading.evidence[index].radii[ray];
        place(at.clamp(DVec2::ZERO, reading.size))
    };
    CellDetail {
        outline: if seen { (0..RAYS).map(corner).collect() } else { Vec::new() },
        other_sides: reading.counts[index].other.filter(|_| seen).and_then(|n| u32::try_from(n).ok()),
        seen,
    }
}
