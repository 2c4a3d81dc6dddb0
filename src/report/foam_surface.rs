//! A relaxed foam as polygons: films and patches on the walls, for pictures and for other programs.

use crate::{
    foam::{
        complex::{Film, RegionImage},
        free::{FreeFoam, WallLine},
        network::{CellId, EdgeId, HalfEdgeId},
        relax::State,
    },
    index::Id,
    surface::{Gap, WallSide},
};
use glam::DVec3;
use std::collections::BTreeMap;

/// What a piece of surface is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PieceKind {
    /// A film between a cell and its neighbour.
    Film {
        /// The neighbour; for the cell itself see [`Piece::cell`].
        neighbour: CellId,
    },
    /// The part of a wall that belongs to the cell.
    Wall(WallSide),
}

/// A piece of surface: polygons with shared points.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// What it is.
    pub kind: PieceKind,
    /// The cell that it bounds, at whose stored place it lies.
    pub cell: CellId,
    /// Its points, unwrapped.
    pub points: Vec<DVec3>,
    /// For a wall's patch, how many of the first points are its edge, in order; 0 for a film.
    pub outline: usize,
    /// Its polygons, as places in `points`: counter-clockwise seen from outside the cell.
    pub polygons: Vec<Vec<usize>>,
}

/// Rings of points between the edge of a wall's patch and its middle.
const RINGS: usize = 4;

/// All films, then all patches of the lower wall, then those of the upper. A film stands at the stored place of the cell on
/// its left; one that touches another image of its neighbour also stands at the neighbour's, so that no cell lies open where
/// the period ends.
#[must_use]
pub fn pieces(state: &State, gap: &Gap) -> Vec<Piece> {
    let network = &state.network;
    let shown = |edge: EdgeId| {
        let [left, right] = edge.half_edges();
        let apart = network.neighbour_shift(left) != glam::IVec3::ZERO;
        [Some(left), apart.then_some(right)].into_iter().flatten()
    };
    let films = network.films().flat_map(shown).map(|side| {
        let lines: Vec<Vec<DVec3>> = (0..state.rows()).map(|row| closed_line(state, side, row)).collect();
        let (points, polygons) = woven(&lines, false);
        let kind = PieceKind::Film { neighbour: network.neighbour(side) };
        Piece { kind, cell: network.cell(side), points, outline: 0, polygons }
    });
    let patches = WallSide::BOTH.into_iter().flat_map(|side| {
        network.cells().map(move |cell| {
            let row = if side == WallSide::Lower { 0 } else { state.rows() - 1 };
            wall_piece(cell, &state.outline_at(cell, row), gap, side)
        })
    });
    films.chain(patches).collect()
}

/// The same pieces of a foam of free topology.
#[must_use]
pub fn free_pieces(foam: &FreeFoam, gap: &Gap) -> Vec<Piece> {
    let films = foam.films.complex.films.iter().flat_map(|film| {
        let (points, polygons) = facets(foam, film);
        let far = foam.films.complex.period.translation(film.front.shift);
        let cell = |side: RegionImage| CellId::from_index(side.region.index());
        let kind = PieceKind::Film { neighbour: cell(film.front) };
        let here = Piece { kind, cell: cell(film.back), points, outline: 0, polygons };
        let beyond = (film.front.shift != film.back.shift).then(|| Piece {
            kind: PieceKind::Film { neighbour: cell(film.back) },
            cell: cell(film.front),
            points: here.points.iter().map(|&point| point - far).collect(),
            outline: 0,
            polygons: here.polygons.iter().map(|corners| corners.iter().rev().copied().collect()).collect(),
        });
        std::iter::once(here).chain(beyond)
    });
    let patches = WallSide::BOTH.into_iter().flat_map(|side| {
        foam.outlines(gap, side).into_iter().enumerate().filter(|(_, lines)| !lines.is_empty()).map(
            move |(cell, lines)| {
                let inner = |line: &WallLine| line.points[..line.points.len() - 1].to_vec();
                let edge: Vec<DVec3> = lines.iter().flat_map(inner).collect();
                wall_piece(CellId::from_index(cell), &edge, gap, side)
            },
        )
    });
    films.chain(patches).collect()
}

/// The nodes of a film, and the triangles between them.
fn facets(foam: &FreeFoam, film: &Film) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let mut numbers: BTreeMap<(usize, [i32; 3]), usize> = BTreeMap::new();
    let mut points = Vec::new();
    let mut polygons = Vec::new();
    for element in &film.elements {
        for corners in element.shape.triangles() {
            let numbered = corners.map(|at| {
                let image = element.nodes[at];
                *numbers.entry((image.node.index(), image.shift.to_array())).or_insert_with(|| {
                    points.push(foam.place(image));
                    points.len() - 1
                })
            });
            polygons.push(numbered.to_vec());
        }
    }
    (points, polygons)
}

fn wall_piece(cell: CellId, edge: &[DVec3], gap: &Gap, side: WallSide) -> Piece {
    let (points, mut polygons) = patch(edge, gap, side);
    if side == WallSide::Lower {
        polygons.iter_mut().for_each(|polygon| polygon.reverse());
    }
    Piece { kind: PieceKind::Wall(side), cell, points, outline: edge.len(), polygons }
}

/// The line of a side with its end.
fn closed_line(state: &State, side: HalfEdgeId, row: usize) -> Vec<DVec3> {
    let mut line = state.side_line(side, row);
    line.extend(state.side_line(state.network.next(side), row).first());
    line
}

/// Quadrilaterals between lines of equally many points, each line to the left of the one before it.
fn woven(lines: &[Vec<DVec3>], closed: bool) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let width = lines.first().map_or(0, Vec::len);
    let steps = if closed { width } else { width - 1 };
    let mut polygons = Vec::new();
    for row in 0..lines.len() - 1 {
        for column in 0..steps {
            let (a, b) = (row * width + column, row * width + (column + 1) % width);
            polygons.push(vec![a, b, b + width, a + width]);
        }
    }
    (lines.concat(), polygons)
}

/// The patch of a wall within an outline: rings of quadrilaterals round a fan, all points on the wall.
fn patch(outline: &[DVec3], gap: &Gap, side: WallSide) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let onto_wall = |point: DVec3| gap.wall(side).project(point).unwrap_or(point);
    let middle = onto_wall(outline.iter().sum::<DVec3>() / real(outline.len()));
    let ring = |ring: usize| -> Vec<DVec3> {
        let share = real(ring) / real(RINGS);
        outline.iter().map(|&point| onto_wall(middle.lerp(point, share))).collect()
    };
    let rings: Vec<Vec<DVec3>> = (1..=RINGS).rev().map(ring).collect();
    let (mut points, mut polygons) = woven(&rings, true);
    let (inner, count) = (points.len() - outline.len(), outline.len());
    points.push(middle);
    polygons.extend((0..count).map(|at| vec![inner + at, inner + (at + 1) % count, inner + count]));
    (points, polygons)
}

fn real(count: usize) -> f64 {
    f64::from(crate::index::checked_u32(count))
}

/// What is known of the cells of a relaxed foam, in the order of their ids.
#[derive(Clone, Debug, PartialEq)]
pub struct CellFigures {
    /// The number of sides; 0 for a cell that is cut.
    pub sides: Vec<u32>,
    /// The volume.
    pub volumes: Vec<f64>,
    /// The pressure, less the mean of all.
    pub pressures: Vec<f64>,
    /// The Gaussian curvature of the middle surface.
    pub gauss_curvature: Vec<f64>,
}

impl CellFigures {
    /// Figures of one cell: sides, volume, pressure, curvature.
    #[must_use]
    pub fn of(&self, cell: CellId) -> (u32, f64, f64, f64) {
        let at = cell.index();
        (self.sides[at], self.volumes[at], self.pressures[at], self.gauss_curvature[at])
    }
}
