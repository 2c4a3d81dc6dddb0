//! The two moves: where their new corners stand, and what the films round them become.

use super::{Body, Moves, plane_of, wall_of};
use crate::foam::free::division::{Corner, CornerImage, Polygon, Stacking, moved};
use glam::{DVec3, IVec3};
use std::collections::{BTreeMap, BTreeSet, btree_map::Entry};

/// New corners lie this far from the middle of the move, in spacings, if there is room.
const NEW_SIZE: f64 = 0.06;
/// The part of the shortest adjoining border that new corners may use up.
const ROOM: f64 = 0.4;

/// The shortest side of a triangle whose other sides are longer than a small one's, in units of the latter, when it goes.
const LONG: f64 = 0.3;

/// The old and the new corners of a move, all in one frame.
pub(super) struct Rewrite {
    pub(super) old: Vec<CornerImage>,
    /// With the bodies that meet there.
    pub(super) new: Vec<(BTreeSet<Body>, DVec3)>,
}

/// What a move makes of the films round it.
pub(super) struct Rewritten {
    /// Their new corners; none where the film is gone.
    pub(super) films: BTreeMap<usize, Vec<CornerImage>>,
    pub(super) made: Option<Polygon>,
}

impl Moves<'_> {
    /// Whether a film or a place on a wall may come to be between two bodies: not a second one, none between walls, and none
    /// through which a cell would reach the wall of the other layer or a layer lose its own.
    fn may_touch(&self, u: Body, v: Body) -> bool {
        let ((Body::Cell(cell, at), other) | (other, Body::Cell(cell, at))) = (u, v) else { return false };
        // A cell that ends at a plane or a wall already would do so in two places.
        let keeps_off = |is_there: &dyn Fn(&Corner) -> bool| {
            !self.corners_of(cell).iter().any(|image| is_there(&self.division.corners[image.corner]))
        };
        let (other, there) = match other {
            Body::Cell(other, there) => (other, there),
            Body::Plane(_) => return keeps_off(&|corner| corner.plane.is_some()),
            Body::Wall(side) => {
                return self.division.stacking == Stacking::One
                    && keeps_off(&|corner| corner.wall == Some(side));
            }
        };
        let apart = IVec3::from_array(there) - IVec3::from_array(at);
        // Long cells may part in the midst of the gap and touch on both walls.
        let may_again = self.division.stacking == Stacking::One;
        (cell, [0; 3]) != (other, apart.to_array())
            && (may_again
                || self.division.polygons.iter().enumerate().all(|(id, film)| {
                    let same = (film.cell, film.neighbour, film.shift) == (cell, other, apart)
                        || (film.cell, film.neighbour, film.shift) == (other, cell, -apart);
                    !same || self.dead_polygons.contains(&id)
                }))
    }

    pub(super) fn border_to_film(&self, first: CornerImage, second: CornerImage) -> Option<Rewrite> {
        let (p, q) = (self.bodies(first), self.bodies(second));
        let shared: Vec<Body> = p.intersection(&q).copied().collect();
        let (u, v) = (*p.difference(&q).next()?, *q.difference(&p).next()?);
        // A triangle beside it would be left with two corners: it goes as a whole.
        if !self.may_touch(u, v) || !self.covered_triangles(first, second).is_empty() {
            return None;
        }
        let (start, end) = (self.division.place(first), self.division.place(second));
        let (beyond, behind) = (self.borders(first), self.borders(second));
        let middle = 0.5 * (start + end);
        let mut room = f64::INFINITY;
        let mut ways = Vec::with_capacity(3);
        for &left_out in &shared {
            let pair = |end: Body| {
                let mut bodies: Vec<Body> = shared.iter().copied().filter(|&body| body != left_out).collect();
                bodies.push(end);
                bodies.sort();
                bodies
            };
            let (a, b) = (*beyond.get(&pair(u))?, *behind.get(&pair(v))?);
            let (a, b) = (self.division.place(a) - start, self.division.place(b) - end);
            room = room.min(a.length()).min(b.length());
            ways.push((left_out, a.normalize_or_zero() + b.normalize_or_zero()));
        }
        let axis = (end - start).normalize_or_zero();
        let size = (ROOM * room).min(NEW_SIZE * self.spacing);
        let new = ways.into_iter().map(|(left_out, way)| {
            let bodies: BTreeSet<Body> = p.union(&q).copied().filter(|&body| body != left_out).collect();
            let across = (way - way.dot(axis) * axis).normalize_or_zero();
            let place = self.on_walls(&bodies, middle + size * across);
            (bodies, place)
        });
        Some(Rewrite { new: new.collect(), old: vec![first, second] })
    }

    /// What a triangle between two bodies becomes when it shrinks to nothing, a film or what a cell covers of a plane or wall.
    pub(super) fn film_to_border(
        &self,
        corners: Vec<CornerImage>,
        [u, v]: [Body; 2],
        small: f64,
    ) -> Option<Rewrite> {
        let places: Vec<DVec3> = corners.iter().map(|&image| self.division.place(image)).collect();
        let length = |i: &usize| places[*i].distance(places[(i + 1) % 3]);
        let shortest = (0..3).min_by(|i, j| length(i).total_cmp(&length(j)))?;
        let is_small = (0..3).all(|i| length(&i) <= small);
        // A film is not left with two corners: where one side of a longer triangle vanishes, it goes from there.
        if !is_small && (self.division.stacking != Stacking::One || length(&shortest) > LONG * small) {
            return None;
        }
        let bodies: Vec<BTreeSet<Body>> = corners.iter().map(|&image| self.bodies(image)).collect();
        let all: BTreeSet<Body> = bodies.iter().flatten().copied().collect();
        if all.len() != 5 || bodies.iter().any(|at| at.len() != 4) {
            return None;
        }
        let middle = match is_small {
            true => places.iter().sum::<DVec3>() / 3.0,
            false => 0.5 * (places[shortest] + places[(shortest + 1) % 3]),
        };
        let (mut room, mut axis) = (f64::INFINITY, DVec3::ZERO);
        for ((&corner, place), at) in corners.iter().zip(&places).zip(&bodies) {
            let borders = self.borders(corner);
            for (end, sign) in [(u, -1.0), (v, 1.0)] {
                let away = if end == u { v } else { u };
                let border: Vec<Body> = at.iter().copied().filter(|&body| body != away).collect();
                let way = self.division.place(*borders.get(&border)?) - *place;
                room = room.min(way.length());
                axis += sign * way.normalize_or_zero();
            }
        }
        let half = (ROOM * room).min(NEW_SIZE * self.spacing) * axis.normalize_or_zero();
        let new = [(v, -half), (u, half)].map(|(away, offset)| {
            let bodies: BTreeSet<Body> = all.iter().copied().filter(|&body| body != away).collect();
            let place = self.on_walls(&bodies, middle + offset);
            (bodies, place)
        });
        Some(Rewrite { old: corners, new: new.to_vec() })
    }

    fn on_walls(&self, bodies: &BTreeSet<Body>, place: DVec3) -> DVec3 {
        self.division.retracted(self.gap, wall_of(bodies), plane_of(bodies), place)
    }

    /// What a move makes of the films round it; nothing if one would be left with two corners.
    pub(super) fn rewritten(&self, rewrite: &Rewrite) -> Option<Rewritten> {
        let first = self.division.corners.len();
        let mut films = BTreeMap::new();
        for corner in &rewrite.old {
            for seen in self.seen(corner.corner) {
                if let Entry::Vacant(entry) = films.entry(seen.polygon) {
                    let back = seen.back + IVec3::from_array(corner.shift);
                    entry.insert(self.replacement(seen.polygon, back, rewrite, first)?);
                }
            }
        }
        let made = self.made(rewrite, &films, first)?;
        Some(Rewritten { films, made })
    }

    /// The corners of a film after the move, in its own frame; none if the film is gone.
    fn replacement(
        &self,
        polygon: usize,
        back: IVec3,
        rewrite: &Rewrite,
        first: usize,
    ) -> Option<Vec<CornerImage>> {
        let corners: Vec<CornerImage> =
            self.division.polygons[polygon].corners.iter().map(|&image| moved(image, back)).collect();
        let is_old = |image: &CornerImage| rewrite.old.contains(image);
        let count = corners.len();
        if corners.iter().all(is_old) {
            return Some(Vec::new());
        }
        let start =
            (0..count).find(|&at| is_old(&corners[at]) && !is_old(&corners[(at + count - 1) % count]))?;
        let run = (0..count).take_while(|&i| is_old(&corners[(start + i) % count])).count();
        if (run..count).any(|i| is_old(&corners[(start + i) % count])) {
            return None;
        }
        let sides = self.sides(polygon, back);
        let third = |inside: usize, outside: usize| {
            let (inside, outside) = (corners[inside % count], corners[outside % count]);
            let shared = self.bodies(inside).intersection(&self.bodies(outside)).copied().collect::<Vec<_>>();
            shared.into_iter().find(|body| !sides.contains(body))
        };
        let entered = third(start, start + count - 1)?;
        let left = third(start + run - 1, start + run)?;
        let mut new: Vec<usize> = (0..rewrite.new.len())
            .filter(|&at| sides.iter().all(|side| rewrite.new[at].0.contains(side)))
            .collect();
        if new.len() > 1 && !rewrite.new[new[0]].0.contains(&entered) {
            new.reverse();
        }
        let (&head, &tail) = (new.first()?, new.last()?);
        if !rewrite.new[head].0.contains(&entered) || !rewrite.new[tail].0.contains(&left) {
            return None;
        }
        let new = new.into_iter().map(|at| CornerImage { corner: first + at, shift: [0; 3] });
        let rest = (run..count).map(|i| corners[(start + i) % count]);
        let after: Vec<CornerImage> = new.chain(rest).map(|image| moved(image, -back)).collect();
        (after.len() > 2).then_some(after)
    }

    /// The film that a move makes: between the bodies that no old corner had together.
    fn made(
        &self,
        rewrite: &Rewrite,
        replaced: &BTreeMap<usize, Vec<CornerImage>>,
        first: usize,
    ) -> Option<Option<Polygon>> {
        if rewrite.new.len() != 3 {
            return Some(None);
        }
        let in_all = |body: &&Body| rewrite.new.iter().all(|(bodies, _)| bodies.contains(body));
        let common: Vec<Body> = rewrite.new[0].0.iter().filter(in_all).copied().collect();
        if let [Body::Cell(..), Body::Plane(_) | Body::Wall(_)] = common[..] {
            // The cell comes to the plane or the wall, on which it has no film.
            return Some(None);
        }
        let [Body::Cell(cell, at), Body::Cell(neighbour, there)] = common[..] else { return None };
        // A film beside the new one, with the cell on one side, runs along their border the other way.
        let beside = replaced.iter().find_map(|(&polygon, corners)| {
            let new: Vec<&CornerImage> = corners.iter().filter(|image| image.corner >= first).collect();
            let [a, b] = new[..] else { return None };
            let frame = IVec3::from_array(a.shift);
            let sides = self.sides(polygon, -frame);
            let cell = Body::Cell(cell, at);
            let follows =
                corners.iter().position(|image| image == a)? + 1 == corners.iter().position(|i| i == b)?;
            let (a, b) = if follows { (a.corner, b.corner) } else { (b.corner, a.corner) };
            (sides[0] == cell).then_some((b, a)).or((sides[1] == cell).then_some((a, b)))
        });
        let (a, b) = beside?;
        let c = (first..first + 3).find(|&corner| corner != a && corner != b)?;
        let frame = IVec3::from_array(at);
        let corners = [a, b, c].map(|corner| CornerImage { corner, shift: (-frame).to_array() }).to_vec();
        Some(Some(Polygon { cell, neighbour, shift: IVec3::from_array(there) - frame, corners }))
    }
}
