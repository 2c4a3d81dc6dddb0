//! From a partition or a relaxed foam to the pattern that is compared with comb.

use super::{
    domain::Axis,
    free::{FreeFoam, WallLine},
    partition::{Beyond, Partition, PartitionCell, Side},
    relax::State,
};
use crate::{
    index::{Id, IndexVec},
    surface::{Gap, LevelSet, WallSide},
    tessellation::{Cell, CellId, CellPattern, CellStatus, CellWall, PatternDefect, Surroundings},
};
use glam::DVec3;

/// Where a one-layer foam's neighbours are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatternPlace {
    /// On the middle surface.
    Middle,
    /// On one of the walls, as a photograph of comb built on it would show.
    Wall(WallSide),
}

/// The pattern of a partition's cells on its middle surface or on one wall. Lengths are in the surface's unit, `L`.
///
/// A cell that ends at a plane wall of the domain is cut.
///
/// # Errors
/// Every [`PatternDefect`] found.
pub fn pattern_of_partition(
    partition: &Partition,
    gap: &Gap,
    place: PatternPlace,
) -> Result<CellPattern, Vec<PatternDefect>> {
    let cells =
        partition.cells().iter().map(|cell| pattern_cell(cell, gap, place)).collect::<IndexVec<_, _>>();
    let is_cut = partition.domain().axes.iter().any(|axis| matches!(axis, Axis::Walls { .. }));
    CellPattern::new("L", within(is_cut, || gap.middle().euler_characteristic()), cells)
}

/// The pattern of a relaxed foam's cells. Its neighbours are the same at every height; lengths and areas are those of the
/// films at the place asked for. Lengths are in the surface's unit, `L`.
///
/// # Errors
/// Every [`PatternDefect`] found.
pub fn pattern_of_state(
    state: &State,
    gap: &Gap,
    place: PatternPlace,
) -> Result<CellPattern, Vec<PatternDefect>> {
    let network = &state.network;
    let row = match place {
        PatternPlace::Wall(WallSide::Lower) => 0,
        PatternPlace::Middle => state.rows() / 2,
        PatternPlace::Wall(WallSide::Upper) => state.rows() - 1,
    };
    let cell = |id| {
        let (position, surface) = placed(network.centre(id), gap, place);
        let walls = network.ring(id).map(|side| {
            let across = Some(network.neighbour(side)).filter(|&cell| !network.is_outside(cell));
            CellWall {
                neighbour: across.map(|cell| CellId::from_index(cell.index())),
                shift: across.map_or(glam::IVec3::ZERO, |_| network.neighbour_shift(side)),
                length: length(&state.side_line(side, row), &state.side_line(network.next(side), row)),
            }
        });
        cell_on(surface, position, &state.outline_at(id, row), walls.collect())
    };
    let cells: IndexVec<CellId, Cell> = network.cells().map(cell).collect();
    CellPattern::new("L", within(!network.planes().is_empty(), || network.euler_characteristic()), cells)
}

/// The pattern of the cells of a foam of free topology on one wall. Lengths are in the surface's unit, `L`.
///
/// # Errors
/// Every [`PatternDefect`] found.
pub fn pattern_of_free(
    foam: &FreeFoam,
    gap: &Gap,
    wall: WallSide,
) -> Result<CellPattern, Vec<PatternDefect>> {
    let cell = |(id, lines): (usize, Vec<WallLine>)| {
        let outline: Vec<DVec3> = lines
            .iter()
            .flat_map(|line| &line.points[..line.points.len().saturating_sub(1)])
            .copied()
            .collect();
        let count = f64::from(crate::index::checked_u32(outline.len().max(1)));
        let midst =
            if outline.is_empty() { foam.division.seeds[id] } else { outline.iter().sum::<DVec3>() / count };
        let (position, surface) = placed(midst, gap, PatternPlace::Wall(wall));
        let walls = lines.iter().map(|line| CellWall {
            neighbour: line.neighbour.map(CellId::from_index),
            shift: line.shift,
            length: length(&line.points, &[]),
        });
        cell_on(surface, position, &outline, walls.collect())
    };
    let cells: IndexVec<CellId, Cell> = foam.outlines(gap, wall).into_iter().enumerate().map(cell).collect();
    let is_cut = !foam.division.planes.is_empty();
    CellPattern::new("L", within(is_cut, || gap.middle().euler_characteristic()), cells)
}

/// The number of sides and the status of a cell with these walls. One that ends at a plane is cut, like a cell at the edge of
/// a photograph: how many sides the rest of it would have is not known. So is one that does not reach the surface: others hide
/// it.
fn counted(walls: &[CellWall]) -> (Option<u32>, CellStatus) {
    if walls.is_empty() || walls.iter().any(|wall| wall.neighbour.is_none()) {
        (None, CellStatus::Cut)
    } else {
        (Some(crate::index::checked_u32(walls.len())), CellStatus::Complete)
    }
}

/// The foot of `centre` on the surface that the pattern lies on, and that surface.
fn placed(centre: DVec3, gap: &Gap, place: PatternPlace) -> (DVec3, &dyn LevelSet) {
    match place {
        PatternPlace::Middle => (gap.middle().project(centre, 0.0).unwrap_or(centre), gap.middle().as_ref()),
        PatternPlace::Wall(side) => {
            let wall = gap.wall(side);
            (wall.project(centre).unwrap_or(centre), wall.field.as_ref())
        }
    }
}

/// The length of a line that ends where `next` starts.
fn length(line: &[DVec3], next: &[DVec3]) -> f64 {
    let points: Vec<DVec3> = line.iter().chain(next.first()).copied().collect();
    points.windows(2).map(|ends| ends[0].distance(ends[1])).sum()
}

/// The area of the triangles between a centre and an outline.
fn fan_area(centre: DVec3, outline: &[DVec3]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    let triangle = |(&a, &b): (&DVec3, &DVec3)| (a - centre).cross(b - centre).length();
    0.5 * outline.iter().zip(next).map(triangle).sum::<f64>()
}

/// A cell of a foam at a place of a surface, within its outline there.
fn cell_on(surface: &dyn LevelSet, position: DVec3, outline: &[DVec3], walls: Vec<CellWall>) -> Cell {
    let (sides, status) = counted(&walls);
    Cell {
        position,
        normal: surface.normal(position),
        sides,
        status,
        confidence: 1.0,
        area: fan_area(position, outline),
        gauss_curvature: Some(surface.curvature(position).gauss),
        walls,
    }
}

/// What the cells lie in: planes cut them off, or they close over the whole surface.
fn within(is_cut: bool, euler_characteristic: impl FnOnce() -> i32) -> Surroundings {
    if is_cut {
        Surroundings::Open
    } else {
        Surroundings::Closed { euler_characteristic: euler_characteristic() }
    }
}

fn pattern_cell(cell: &PartitionCell, gap: &Gap, place: PatternPlace) -> Cell {
    let none = Vec::new();
    let outline = match place {
        PatternPlace::Middle => cell.sections.first().unwrap_or(&none),
        PatternPlace::Wall(wall) => &cell.on_walls[wall as usize],
    };
    let (position, surface) = placed(cell.seed, gap, place);
    let corners: Vec<DVec3> = outline.iter().map(|side| side.start).collect();
    cell_on(surface, position, &corners, outline.iter().map(pattern_wall).collect())
}

fn pattern_wall(side: &Side) -> CellWall {
    let (neighbour, shift) = match side.beyond {
        Beyond::Cell(cell, image) => (Some(CellId::from_index(cell.index())), image.shift()),
        Beyond::Plane { .. } | Beyond::Wall(_) => (None, glam::IVec3::ZERO),
    };
    CellWall { neighbour, shift, length: side.length }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        seeds::SeedSettings,
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
        start::start,
    };
    use std::ops::ControlFlow;

    #[test]
    fn all_three_patterns_have_the_charge_of_the_surface() -> Result<(), Box<dyn std::error::Error>> {
        let walls = PeriodicWalls::LevelSet { delta: 0.2 };
        let space = FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 1.0, walls };
        let (gap, domain) = (space.gap()?, space.domain()?);
        let mut settings = SeedSettings::new(48, 1);
        settings.anneal.sweeps = 200;
        let start = start(&gap, &domain, &settings, &mut |_| ControlFlow::Continue(()))?;
        for place in
            [PatternPlace::Middle, PatternPlace::Wall(WallSide::Lower), PatternPlace::Wall(WallSide::Upper)]
        {
            let pattern =
                pattern_of_partition(&start.partition, &gap, place).map_err(|d| format!("{d:?}"))?;
            assert_eq!(pattern.charge(), -24, "{place:?}");
        }
        Ok(())
    }
}
