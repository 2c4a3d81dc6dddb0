//! What holds for every foam of one or of two layers, whoever touches whom: cells, patches and walls keep their topology.

use super::{
    Division,
    division::{CornerImage, Rim, moved, open_ends, signed},
};
use crate::surface::WallSide;
use std::collections::{BTreeMap, BTreeSet};

/// A law that does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unlawful {
    /// A cell misses a wall that it shall touch, or touches one that it shall not.
    #[error("cell {cell} {} the {} wall", if *touches { "has come to" } else { "does not touch" }, name(*wall))]
    Wall {
        /// The cell.
        cell: usize,
        /// The wall.
        wall: WallSide,
        /// Whether it touches it.
        touches: bool,
    },
    /// What a cell covers of a wall is no disc.
    #[error("cell {cell} touches the {} wall in {loops} places", name(*wall))]
    Patch {
        /// The cell.
        cell: usize,
        /// The wall.
        wall: WallSide,
        /// The closed lines round its patch; 0 if they do not close.
        loops: usize,
    },
    /// A cell's boundary is no sphere. Cells that end at planes are not asked.
    #[error("cell {cell} is not in one piece: its boundary has Euler's number {found} instead of 2")]
    Cell {
        /// The cell.
        cell: usize,
        /// Corners less edges plus faces.
        found: i64,
    },
    /// The cells on a wall do not cover it once.
    #[error("the cells on the {} wall have Euler's number {found}, the wall has {expected}", name(*wall))]
    Euler {
        /// The wall.
        wall: WallSide,
        /// Of the cells.
        found: i64,
        /// Of the wall.
        expected: i64,
    },
}

const fn name(wall: WallSide) -> &'static str {
    match wall {
        WallSide::Lower => "lower",
        WallSide::Upper => "upper",
    }
}

/// All laws that do not hold: first those of cells, in their order, then those of walls.
#[must_use]
pub fn unlawful(division: &Division) -> Vec<Unlawful> {
    let rims = WallSide::BOTH.map(|wall| division.rims(wall));
    let (boundaries, cut) = (boundaries(division), division.cut());
    let mut found = Vec::new();
    for cell in 0..division.seeds.len() {
        let mut patches = 0;
        for wall in WallSide::BOTH {
            let rim = &rims[wall as usize][cell];
            let touches = !rim.is_empty();
            if division.stacking.walls(cell).is_some_and(|walls| walls[wall as usize] != touches) {
                found.push(Unlawful::Wall { cell, wall, touches });
            }
            // A plane that cuts a patch off opens the line round it.
            let loops = if cut[cell] && open_ends(rim).is_some() { chains(rim) } else { loops(rim) };
            if touches && loops != 1 {
                found.push(Unlawful::Patch { cell, wall, loops });
            }
            patches += loops;
        }
        let Boundary { corners, sides, films } = &boundaries[cell];
        let euler = signed(corners.len()) - signed(sides.len()) + signed(films + patches);
        if euler != 2 && !cut[cell] {
            found.push(Unlawful::Cell { cell, found: euler });
        }
    }
    let expected = division.euler;
    for wall in WallSide::BOTH {
        let euler = division.euler_of(wall);
        if euler != expected {
            found.push(Unlawful::Euler { wall, found: euler, expected });
        }
    }
    found
}

impl Division {
    /// Euler's number of the cells on a wall: corners less edges plus cells.
    pub(super) fn euler_of(&self, wall: WallSide) -> i64 {
        let rims = self.rims(wall);
        let cells = rims.iter().filter(|rim| !rim.is_empty());
        let cut_lines = rims.iter().filter(|rim| open_ends(rim).is_some()).count();
        let edges = rims.iter().map(Vec::len).sum::<usize>() / 2 + cut_lines;
        let corners = self.corners.iter().filter(|corner| corner.wall == Some(wall)).count();
        signed(corners) - signed(edges) + signed(cells.count())
    }
}

/// How many closed lines the edges round a patch make; 0 if they do not close.
fn loops(rim: &[Rim]) -> usize {
    let next: BTreeMap<CornerImage, CornerImage> = rim.iter().map(|edge| (edge.from, edge.to)).collect();
    if next.len() != rim.len() {
        return 0;
    }
    let mut left: BTreeSet<CornerImage> = next.keys().copied().collect();
    let mut count = 0;
    while let Some(start) = left.pop_first() {
        let mut at = next[&start];
        while at != start {
            if !left.remove(&at) {
                return 0;
            }
            at = next[&at];
        }
        count += 1;
    }
    count
}

/// 1 if the edges round a patch make one open line, else 0.
fn chains(rim: &[Rim]) -> usize {
    let next: BTreeMap<CornerImage, CornerImage> = rim.iter().map(|edge| (edge.from, edge.to)).collect();
    let Some([mut at, end]) = open_ends(rim) else { return 0 };
    let mut length = 0;
    while at != end && length < rim.len() {
        let Some(&to) = next.get(&at) else { return 0 };
        (at, length) = (to, length + 1);
    }
    usize::from(at == end && length == rim.len())
}

/// What bounds a cell, in its frame.
#[derive(Clone, Default)]
struct Boundary {
    corners: BTreeSet<CornerImage>,
    sides: BTreeSet<[CornerImage; 2]>,
    films: usize,
}

fn boundaries(division: &Division) -> Vec<Boundary> {
    let mut boundaries = vec![Boundary::default(); division.seeds.len()];
    for polygon in &division.polygons {
        for (cell, by) in [(polygon.cell, glam::IVec3::ZERO), (polygon.neighbour, -polygon.shift)] {
            let boundary = &mut boundaries[cell];
            boundary.films += 1;
            let count = polygon.corners.len();
            for at in 0..count {
                let mut side = [at, (at + 1) % count].map(|at| moved(polygon.corners[at], by));
                boundary.corners.insert(side[0]);
                side.sort_unstable();
                boundary.sides.insert(side);
            }
        }
    }
    boundaries
}
