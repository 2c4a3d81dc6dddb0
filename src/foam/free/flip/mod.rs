//! Changes of topology: a border that shrinks becomes a film, a film of three sides that shrinks becomes a border.
//!
//! Both are one move and its reverse (K. A. Brakke, "The Surface Evolver"; the 2–3 move of triangulations). A border between
//! the bodies X, Y, Z ends at two corners, U beyond the one and V beyond the other. It becomes a triangle between U and V,
//! whose corners are XYUV, YZUV and ZXUV. A wall counts as a body: an edge on a wall is a border of two cells and the wall, so
//! that the T1 on a wall is the same move; and what a cell covers of a wall is a film between the two, so that a cell of three
//! sides there leaves the wall, and comes to it again, by the same moves.
//!
//! A film that meets the changed corners has a run of them among its own; what it gets instead are the new corners that
//! both its bodies share, in the order of the borders by which the run is entered and left.

mod rewrite;

use super::{
    division::{Corner, CornerImage, Division, Stacking, moved},
    films::Side,
};
use crate::surface::{Gap, WallSide};
use glam::IVec3;
use rewrite::{Rewrite, Rewritten};
use std::collections::{BTreeMap, BTreeSet};

/// What meets at a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Body {
    /// An image of a cell.
    Cell(usize, [i32; 3]),
    /// A wall.
    Wall(WallSide),
    /// A plane that cuts the gap off.
    Plane(usize),
}

impl Body {
    fn moved(self, by: IVec3) -> Self {
        match self {
            Self::Cell(cell, shift) => Self::Cell(cell, (IVec3::from_array(shift) + by).to_array()),
            Self::Wall(_) | Self::Plane(_) => self,
        }
    }
}

/// The bodies of a move, without their images: what the move is known by when it comes again.
pub(super) type Cluster = Vec<Body>;

/// What happened to the numbers of corners and polygons.
#[derive(Debug)]
pub(super) struct Renumbering {
    /// The new number of each old corner that is still there.
    pub(super) corners: Vec<Option<usize>>,
    /// The old number of each new polygon that has kept its corners.
    pub(super) polygons: Vec<Option<usize>>,
}

/// A division under change.
pub(super) struct Moves<'a> {
    gap: &'a Gap,
    spacing: f64,
    division: Division,
    /// Corners and polygons that are gone, and polygons whose corners are others now.
    dead_corners: BTreeSet<usize>,
    dead_polygons: BTreeSet<usize>,
    changed: BTreeSet<usize>,
    /// The polygons at each corner, with the corner's place among theirs.
    films: Vec<Vec<(usize, usize)>>,
    old: [usize; 2],
}

/// A film at a corner, in the corner's frame.
struct Seen {
    polygon: usize,
    at: usize,
    /// What takes the polygon's frame to the corner's.
    back: IVec3,
}

impl<'a> Moves<'a> {
    pub(super) fn new(division: &Division, gap: &'a Gap, spacing: f64) -> Self {
        let old = [division.corners.len(), division.polygons.len()];
        let mut moves = Self {
            gap,
            spacing,
            division: division.clone(),
            dead_corners: BTreeSet::new(),
            dead_polygons: BTreeSet::new(),
            changed: BTreeSet::new(),
            films: Vec::new(),
            old,
        };
        moves.films = vec![Vec::new(); old[0]];
        for polygon in 0..old[1] {
            moves.list(polygon);
        }
        moves
    }

    fn list(&mut self, polygon: usize) {
        for (at, image) in self.division.polygons[polygon].corners.iter().enumerate() {
            self.films[image.corner].push((polygon, at));
        }
    }

    /// The corners that films of a corner have.
    pub(super) fn neighbourhood(&self, corner: usize) -> BTreeSet<usize> {
        let polygons = self.films[corner].iter().map(|&(polygon, _)| polygon);
        polygons.flat_map(|p| self.division.polygons[p].corners.iter().map(|image| image.corner)).collect()
    }

    fn seen(&self, corner: usize) -> impl Iterator<Item = Seen> + '_ {
        self.films[corner].iter().map(|&(polygon, at)| {
            let back = -IVec3::from_array(self.division.polygons[polygon].corners[at].shift);
            Seen { polygon, at, back }
        })
    }

    /// The two bodies of a film, in a frame.
    fn sides(&self, polygon: usize, back: IVec3) -> [Body; 2] {
        let polygon = &self.division.polygons[polygon];
        [Body::Cell(polygon.cell, [0; 3]), Body::Cell(polygon.neighbour, polygon.shift.to_array())]
            .map(|body| body.moved(back))
    }

    /// The bodies that meet at a corner's image.
    fn bodies(&self, image: CornerImage) -> BTreeSet<Body> {
        let shift = IVec3::from_array(image.shift);
        let cells = self.seen(image.corner).flat_map(|seen| self.sides(seen.polygon, seen.back + shift));
        let Corner { wall, plane, .. } = self.division.corners[image.corner];
        cells.chain(wall.map(Body::Wall)).chain(plane.map(Body::Plane)).collect()
    }

    /// The corners at the other ends of the borders of a corner's image, by the three bodies of each border.
    fn borders(&self, image: CornerImage) -> BTreeMap<Vec<Body>, CornerImage> {
        let own = self.bodies(image);
        let mut borders = BTreeMap::new();
        for seen in self.seen(image.corner) {
            let corners = &self.division.polygons[seen.polygon].corners;
            let count = corners.len();
            for other in [corners[(seen.at + 1) % count], corners[(seen.at + count - 1) % count]] {
                let other = moved(other, seen.back + IVec3::from_array(image.shift));
                let shared: Vec<Body> = own.intersection(&self.bodies(other)).copied().collect();
                borders.insert(shared, other);
            }
        }
        for (shared, other) in self.cut_lines(image, &own) {
            borders.insert(shared, other);
        }
        borders
    }

    /// The lines without a film that start at a corner on a wall and a plane: one for each of its two cells, with the other
    /// end.
    fn cut_lines(&self, image: CornerImage, own: &BTreeSet<Body>) -> Vec<(Vec<Body>, CornerImage)> {
        let Corner { wall: Some(wall), plane: Some(plane), .. } = self.division.corners[image.corner] else {
            return Vec::new();
        };
        let of_cell = |&body: &Body| {
            let Body::Cell(cell, shift) = body else { return None };
            let frame = IVec3::from_array(shift);
            let other = self.corners_of(cell).into_iter().map(|other| moved(other, frame)).find(|other| {
                let corner = self.division.corners[other.corner];
                *other != image && corner.wall == Some(wall) && corner.plane.is_some()
            })?;
            Some((vec![body, Body::Wall(wall), Body::Plane(plane)], other))
        };
        own.iter().filter_map(of_cell).collect()
    }

    /// All corners of a cell, in its frame.
    fn corners_of(&self, cell: usize) -> BTreeSet<CornerImage> {
        let alive =
            self.division.polygons.iter().enumerate().filter(|(id, _)| !self.dead_polygons.contains(id));
        alive
            .flat_map(|(_, film)| {
                let here = (film.cell == cell).then_some(IVec3::ZERO);
                let beyond = (film.neighbour == cell).then_some(-film.shift);
                here.into_iter()
                    .chain(beyond)
                    .flat_map(|by| film.corners.iter().map(move |&image| moved(image, by)))
            })
            .collect()
    }

    /// Triangles that cells cover of a plane, or of a wall that they may leave, with two corners of a side among theirs: their
    /// corners, the plane or wall, and the cell.
    pub(super) fn covered_triangles(
        &self,
        first: CornerImage,
        second: CornerImage,
    ) -> Vec<(Vec<CornerImage>, [Body; 2])> {
        let shared: Vec<Body> = self.bodies(first).intersection(&self.bodies(second)).copied().collect();
        let is_left = |body: &Body| match body {
            Body::Cell(..) => false,
            Body::Plane(_) => true,
            Body::Wall(_) => self.division.stacking == Stacking::One,
        };
        let triangle = |hard: Body, soft: Body| {
            let Body::Cell(cell, shift) = soft else { return None };
            let corners: Vec<CornerImage> = self
                .corners_of(cell)
                .into_iter()
                .filter(|image| self.lies_on(image.corner, hard))
                .map(|image| moved(image, IVec3::from_array(shift)))
                .collect();
            let whole = corners.len() == 3 && corners.contains(&first) && corners.contains(&second);
            whole.then_some((corners, [hard, soft]))
        };
        let hard = shared.iter().copied().filter(is_left);
        hard.flat_map(|hard| shared.iter().filter_map(move |&soft| triangle(hard, soft))).collect()
    }

    /// Whether a corner lies on a wall or a plane.
    fn lies_on(&self, corner: usize, body: Body) -> bool {
        let Corner { wall, plane, .. } = self.division.corners[corner];
        match body {
            Body::Wall(side) => wall == Some(side),
            Body::Plane(at) => plane == Some(at),
            Body::Cell(..) => false,
        }
    }

    /// The bodies that meet along a border or an edge on a wall and at its two ends; nothing where more than four bodies meet
    /// at an end, or an end is gone.
    pub(super) fn cluster(&self, (first, second, shift): Side) -> Option<Cluster> {
        let [p, q] = [(first, [0; 3]), (second, shift)].map(|(corner, shift)| CornerImage { corner, shift });
        if [first, second].iter().any(|corner| self.dead_corners.contains(corner)) {
            return None;
        }
        let (p, q) = (self.bodies(p), self.bodies(q));
        let all: BTreeSet<Body> = p.union(&q).copied().collect();
        (p.len() == 4 && q.len() == 4 && all.len() == 5).then(|| without_images(all))
    }

    /// Whether a border or an edge on a wall can vanish.
    pub(super) fn can_vanish(&self, side: Side, small: f64) -> bool {
        self.vanished(side, small).is_some()
    }

    /// Turns a border, or an edge on a wall, into a film, or a triangle beside it into a border if its sides are all below
    /// `small`. Gives the bodies of the move, or nothing if this border cannot change so.
    pub(super) fn vanish(&mut self, side: Side, small: f64) -> Option<Cluster> {
        let cluster = self.cluster(side)?;
        let (rewrite, rewritten) = self.vanished(side, small)?;
        self.carry_out(&rewrite, rewritten);
        Some(cluster)
    }

    fn vanished(&self, side: Side, small: f64) -> Option<(Rewrite, Rewritten)> {
        self.cluster(side)?;
        let [first, second] =
            [(side.0, [0; 3]), (side.1, side.2)].map(|(corner, shift)| CornerImage { corner, shift });
        let whole = self.border_to_film(first, second).and_then(|rewrite| {
            let rewritten = self.rewritten(&rewrite)?;
            Some((rewrite, rewritten))
        });
        whole.or_else(|| {
            let triangles = self.seen(first.corner).filter(|seen| {
                let polygon = &self.division.polygons[seen.polygon];
                let has_second = polygon.corners.iter().any(|&image| moved(image, seen.back) == second);
                polygon.corners.len() == 3 && has_second
            });
            let films = triangles.map(|seen| {
                let corners = self.division.polygons[seen.polygon].corners.iter();
                let corners: Vec<CornerImage> = corners.map(|&image| moved(image, seen.back)).collect();
                (corners, self.sides(seen.polygon, seen.back))
            });
            let all = films.chain(self.covered_triangles(first, second));
            let mut rewrites = all.filter_map(|(corners, sides)| self.film_to_border(corners, sides, small));
            rewrites.find_map(|rewrite| {
                let rewritten = self.rewritten(&rewrite)?;
                Some((rewrite, rewritten))
            })
        })
    }

    fn carry_out(&mut self, rewrite: &Rewrite, rewritten: Rewritten) {
        self.dead_corners.extend(rewrite.old.iter().map(|image| image.corner));
        for (bodies, place) in &rewrite.new {
            let (wall, plane) = (wall_of(bodies), plane_of(bodies));
            self.division.corners.push(Corner { place: *place, wall, plane });
            self.films.push(Vec::new());
        }
        for (polygon, corners) in rewritten.films {
            self.unlist(polygon);
            if corners.is_empty() {
                self.dead_polygons.insert(polygon);
            } else {
                self.division.polygons[polygon].corners = corners;
                self.changed.insert(polygon);
                self.list(polygon);
            }
        }
        if let Some(made) = rewritten.made {
            self.division.polygons.push(made);
            self.list(self.division.polygons.len() - 1);
        }
    }

    fn unlist(&mut self, polygon: usize) {
        for image in self.division.polygons[polygon].corners.clone() {
            self.films[image.corner].retain(|&(other, _)| other != polygon);
        }
    }

    /// The division after all moves, with corners and polygons numbered anew in their old order.
    pub(super) fn finish(self) -> (Division, Renumbering) {
        let mut division = self.division;
        let mut corners = vec![None; division.corners.len()];
        let mut kept = Vec::with_capacity(division.corners.len());
        for (old, corner) in division.corners.iter().enumerate() {
            if !self.dead_corners.contains(&old) {
                corners[old] = Some(kept.len());
                kept.push(*corner);
            }
        }
        let mut polygons = Vec::new();
        let mut left = Vec::with_capacity(division.polygons.len());
        for (id, mut polygon) in division.polygons.into_iter().enumerate() {
            if self.dead_polygons.contains(&id) {
                continue;
            }
            for image in &mut polygon.corners {
                image.corner = corners[image.corner].unwrap_or(image.corner);
            }
            polygons.push((id < self.old[1] && !self.changed.contains(&id)).then_some(id));
            left.push(polygon);
        }
        corners.truncate(self.old[0]);
        division.corners = kept;
        division.polygons = left;
        (division, Renumbering { corners, polygons })
    }
}

fn wall_of(bodies: &BTreeSet<Body>) -> Option<WallSide> {
    bodies.iter().find_map(|body| match body {
        Body::Wall(side) => Some(*side),
        Body::Cell(..) | Body::Plane(_) => None,
    })
}

fn plane_of(bodies: &BTreeSet<Body>) -> Option<usize> {
    bodies.iter().find_map(|body| match body {
        Body::Plane(plane) => Some(*plane),
        Body::Cell(..) | Body::Wall(_) => None,
    })
}

fn without_images(bodies: BTreeSet<Body>) -> Cluster {
    let bare = bodies.into_iter().map(|body| match body {
        Body::Cell(cell, _) => Body::Cell(cell, [0; 3]),
        Body::Wall(_) | Body::Plane(_) => body,
    });
    let mut bare: Cluster = bare.collect();
    bare.sort();
    bare
}

#[cfg(test)]
mod tests;
