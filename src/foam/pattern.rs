//! From a partition to the pattern that is compared with comb.

use super::{
    domain::{Axis, Domain},
    partition::{Beyond, Partition, PartitionCell, Side},
};
use crate::{
    index::{Id, IndexVec},
    surface::{Gap, WallSide},
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
    CellPattern::new("L", surroundings(gap, partition.domain()), cells)
}

fn surroundings(gap: &Gap, domain: &Domain) -> Surroundings {
    if domain.axes.iter().any(|axis| matches!(axis, Axis::Walls { .. })) {
        return Surroundings::Open;
    }
    Surroundings::Closed { euler_characteristic: gap.middle().euler_characteristic() }
}

fn pattern_cell(cell: &PartitionCell, gap: &Gap, place: PatternPlace) -> Cell {
    let none = Vec::new();
    let sides = match place {
        PatternPlace::Middle => cell.sections.first().unwrap_or(&none),
        PatternPlace::Wall(wall) => &cell.on_walls[wall as usize],
    };
    let (surface, position) = match place {
        PatternPlace::Middle => (gap.middle(), cell.seed),
        PatternPlace::Wall(side) => {
            let wall = gap.wall(side);
            (&wall.field, wall.project(cell.seed).unwrap_or(cell.seed))
        }
    };
    let walls: Vec<CellWall> = sides.iter().map(pattern_wall).collect();
    let cut = walls.iter().any(|wall| wall.neighbour.is_none());
    Cell {
        position,
        normal: surface.normal(position),
        sides: (!cut).then(|| u32::try_from(walls.len()).unwrap_or(u32::MAX)),
        status: if cut { CellStatus::Cut } else { CellStatus::Complete },
        confidence: 1.0,
        area: area(position, sides),
        gauss_curvature: Some(surface.curvature(position).gauss),
        walls,
    }
}

fn pattern_wall(side: &Side) -> CellWall {
    let (neighbour, shift) = match side.beyond {
        Beyond::Cell(cell, image) => (Some(CellId::from_index(cell.index())), image.shift()),
        Beyond::Plane { .. } | Beyond::Wall(_) => (None, glam::IVec3::ZERO),
    };
    CellWall { neighbour, shift, length: side.length }
}

/// The area of the triangles between a centre and the sides.
fn area(centre: DVec3, sides: &[Side]) -> f64 {
    let next = sides.iter().cycle().skip(1);
    let triangle = |(side, next): (&Side, &Side)| (side.start - centre).cross(next.start - centre).length();
    0.5 * sides.iter().zip(next).map(triangle).sum::<f64>()
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
