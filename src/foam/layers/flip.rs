//! Changes of topology: a border that shrinks becomes a film, a film of three sides that shrinks becomes a border.
//!
//! Both are one move and its reverse (K. A. Brakke, "The Surface Evolver"; the 2–3 move of triangulations). A border between
//! the bodies X, Y, Z ends at two corners, U beyond the one and V beyond the other. It becomes a triangle between U and V,
//! whose corners are XYUV, YZUV and ZXUV. A wall counts as a body: an edge on a wall is a border of two cells and the wall, so
//! that the T1 on a wall is the same move.
//!
//! A film that meets the changed corners has a run of them among its own; what it gets instead are the new corners that
//! both its bodies share, in the order of the borders by which the run is entered and left.

use super::{
    division::{Corner, CornerImage, Division, Polygon},
    films::Side,
};
use crate::surface::{Gap, WallSide};
use glam::{DVec3, IVec3};
use std::collections::{BTreeMap, BTreeSet, btree_map::Entry};

/// What meets at a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Body {
    /// An image of a cell.
    Cell(usize, [i32; 3]),
    /// A wall.
    Wall(WallSide),
}

impl Body {
    fn moved(self, by: IVec3) -> Self {
        match self {
            Self::Cell(cell, shift) => Self::Cell(cell, (IVec3::from_array(shift) + by).to_array()),
            Self::Wall(_) => self,
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

/// New corners lie this far from the middle of the move, in spacings, if there is room.
const NEW_SIZE: f64 = 0.06;
/// The part of the shortest adjoining border that new corners may use up.
const ROOM: f64 = 0.4;

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

/// The old and the new corners of a move, all in one frame.
struct Rewrite {
    old: Vec<CornerImage>,
    /// With the bodies that meet there.
    new: Vec<(BTreeSet<Body>, DVec3)>,
}

/// What a move makes of the films round it.
struct Rewritten {
    /// Their new corners; none where the film is gone.
    films: BTreeMap<usize, Vec<CornerImage>>,
    made: Option<Polygon>,
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
        let wall = self.division.corners[image.corner].wall.map(Body::Wall);
        cells.chain(wall).collect()
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
        borders
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
            let mut rewrites =
                triangles.filter_map(|seen| self.film_to_border(seen.polygon, seen.back, small));
            rewrites.find_map(|rewrite| {
                let rewritten = self.rewritten(&rewrite)?;
                Some((rewrite, rewritten))
            })
        })
    }

    /// Whether a film or a place on a wall may come to be between two bodies: not a second one, none between walls, and none
    /// through which a cell would reach the wall of the other layer or a layer lose its own.
    fn may_touch(&self, u: Body, v: Body) -> bool {
        let (Body::Cell(cell, at), Body::Cell(other, there)) = (u, v) else { return false };
        let apart = IVec3::from_array(there) - IVec3::from_array(at);
        (cell, [0; 3]) != (other, apart.to_array())
            && self.division.polygons.iter().enumerate().all(|(id, film)| {
                let same = (film.cell, film.neighbour, film.shift) == (cell, other, apart)
                    || (film.cell, film.neighbour, film.shift) == (other, cell, -apart);
                !same || self.dead_polygons.contains(&id)
            })
    }

    fn border_to_film(&self, first: CornerImage, second: CornerImage) -> Option<Rewrite> {
        let (p, q) = (self.bodies(first), self.bodies(second));
        let shared: Vec<Body> = p.intersection(&q).copied().collect();
        let (u, v) = (*p.difference(&q).next()?, *q.difference(&p).next()?);
        if !self.may_touch(u, v) {
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

    fn film_to_border(&self, polygon: usize, back: IVec3, small: f64) -> Option<Rewrite> {
        let corners: Vec<CornerImage> =
            self.division.polygons[polygon].corners.iter().map(|&image| moved(image, back)).collect();
        let places: Vec<DVec3> = corners.iter().map(|&image| self.division.place(image)).collect();
        if (0..3).any(|i| places[i].distance(places[(i + 1) % 3]) > small) {
            return None;
        }
        let [u, v] = self.sides(polygon, back);
        let bodies: Vec<BTreeSet<Body>> = corners.iter().map(|&image| self.bodies(image)).collect();
        let all: BTreeSet<Body> = bodies.iter().flatten().copied().collect();
        if all.len() != 5 || bodies.iter().any(|at| at.len() != 4) {
            return None;
        }
        let middle = places.iter().sum::<DVec3>() / 3.0;
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
        match wall_of(bodies) {
            Some(side) => self.gap.wall(side).project(place).unwrap_or(place),
            None => place,
        }
    }

    /// What a move makes of the films round it; nothing if one would be left with two corners.
    fn rewritten(&self, rewrite: &Rewrite) -> Option<Rewritten> {
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

    fn carry_out(&mut self, rewrite: &Rewrite, rewritten: Rewritten) {
        self.dead_corners.extend(rewrite.old.iter().map(|image| image.corner));
        for (bodies, place) in &rewrite.new {
            self.division.corners.push(Corner { place: *place, wall: wall_of(bodies) });
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

fn moved(image: CornerImage, by: IVec3) -> CornerImage {
    CornerImage { corner: image.corner, shift: (IVec3::from_array(image.shift) + by).to_array() }
}

fn wall_of(bodies: &BTreeSet<Body>) -> Option<WallSide> {
    bodies.iter().find_map(|body| match body {
        Body::Wall(side) => Some(*side),
        Body::Cell(..) => None,
    })
}

fn without_images(bodies: BTreeSet<Body>) -> Cluster {
    let bare = bodies.into_iter().map(|body| match body {
        Body::Cell(cell, _) => Body::Cell(cell, [0; 3]),
        Body::Wall(_) => body,
    });
    let mut bare: Cluster = bare.collect();
    bare.sort();
    bare
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        layers::{Arrangement, sheets},
        setup::{FoamSpace, SpaceError},
    };
    use std::ops::ControlFlow;

    const SPACE: FoamSpace = FoamSpace::Plane { periods: [4.0, 4.6], height: 2.3 };

    fn annealed() -> Result<(Division, Gap, f64), SpaceError> {
        let gap = SPACE.gap()?;
        let sown =
            sheets(&SPACE, &gap, Arrangement::Annealed, 16, 3, &mut |_| ControlFlow::Continue(())).unwrap();
        let domain = SPACE.domain()?;
        let division = Division::new(&gap, &domain, &sown.seeds, sown.lower, sown.spacing).unwrap();
        Ok((division, gap, sown.spacing))
    }

    /// All borders and edges on walls with the number of their films.
    fn sides(division: &Division) -> BTreeMap<Side, usize> {
        let mut sides = BTreeMap::new();
        for polygon in &division.polygons {
            for (at, &to) in polygon.corners.iter().enumerate() {
                let from = polygon.corners[(at + polygon.corners.len() - 1) % polygon.corners.len()];
                let (a, b) =
                    if (from.corner, from.shift) <= (to.corner, to.shift) { (from, to) } else { (to, from) };
                let shift = IVec3::from_array(b.shift) - IVec3::from_array(a.shift);
                *sides.entry((a.corner, b.corner, shift.to_array())).or_insert(0) += 1;
            }
        }
        sides
    }

    /// The law of foams: four bodies at a corner; three films at a border, one at an edge on a wall.
    fn assert_lawful(division: &Division, gap: &Gap) {
        let moves = Moves::new(division, gap, 1.0);
        for corner in 0..division.corners.len() {
            assert_eq!(moves.bodies(CornerImage { corner, shift: [0; 3] }).len(), 4, "corner {corner}");
        }
        for (side, films) in sides(division) {
            let walls = [side.0, side.1].map(|corner| division.corners[corner].wall);
            let on_wall = walls[0].is_some() && walls[0] == walls[1];
            assert_eq!(films, if on_wall { 1 } else { 3 }, "{side:?}");
        }
    }

    #[test]
    fn any_border_may_vanish_and_the_film_that_it_becomes_gives_it_back() -> Result<(), SpaceError> {
        let (division, gap, spacing) = annealed()?;
        assert_lawful(&division, &gap);
        let counts =
            |division: &Division| [division.corners.len(), division.polygons.len(), sides(division).len()];
        let (mut done, mut on_walls) = (0, 0);
        for side in sides(&division).into_keys() {
            let mut moves = Moves::new(&division, &gap, spacing);
            let Some(cluster) = moves.vanish(side, 0.0) else { continue };
            let (after, renumbering) = moves.finish();
            assert_lawful(&after, &gap);
            let [corners, films, borders] = counts(&division);
            assert_eq!(counts(&after), [corners + 1, films + 1, borders + 2]);
            assert_eq!(renumbering.corners.iter().filter(|new| new.is_none()).count(), 2);
            // The new film is the last, a triangle; one of its sides brings it back.
            let made = after.polygons.last().unwrap().clone();
            assert_eq!(made.corners.len(), 3);
            let own = |side: &Side| {
                made.corners.iter().any(|image| image.corner == side.0)
                    && made.corners.iter().any(|i| i.corner == side.1)
            };
            let back = sides(&after).into_keys().filter(own).find_map(|side| {
                let mut moves = Moves::new(&after, &gap, spacing);
                let again = moves.vanish(side, f64::INFINITY)?;
                (again == cluster).then(|| moves.finish().0)
            });
            if let Some(back) = back {
                assert_lawful(&back, &gap);
                assert_eq!(counts(&back), counts(&division));
                done += 1;
                on_walls += usize::from(cluster.iter().any(|body| matches!(body, Body::Wall(_))));
            }
        }
        // 32 cells have about 250 sides; those beside a triangle, or between cells that touch already, stay.
        assert!(done > 60 && on_walls > 10, "{done} {on_walls}");
        Ok(())
    }
}
