//! A convex polyhedron clipped by the two walls: the loops of its films, of its patches on the walls, and of its section by
//! the middle surface.
//!
//! Every face is walked round once. Its boundary crosses the levels at nodes, which the two faces of an edge share; inside
//! the face the level's arcs join the nodes where the boundary rises through the level with those where it falls. Films are
//! what lies between the walls; a wall's patch is bounded by the arcs of all faces, walked the other way.

use super::{
    levels::{Crossing, Level, Levels},
    polyhedron::{Behind, Face, Polyhedron},
};
use glam::DVec3;
use std::collections::BTreeMap;

/// A corner of a clipped cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) point: DVec3,
    /// The two faces of the polyhedron's edge that it lies on; none for a corner of the polyhedron itself.
    pub(super) between: Option<[usize; 2]>,
}

/// A piece of a loop: from one node to the next, straight or along a wall.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) from: usize,
    pub(super) to: usize,
    /// The face of the polyhedron that it lies in.
    pub(super) face: usize,
    /// The level that it follows, if it is an arc.
    pub(super) level: Option<Level>,
    /// Its points, ends included.
    pub(super) points: Vec<DVec3>,
}

impl Piece {
    pub(super) fn length(&self) -> f64 {
        self.points.windows(2).map(|ends| ends[0].distance(ends[1])).sum()
    }

    pub(super) fn reversed(&self) -> Self {
        let points = self.points.iter().rev().copied().collect();
        Self { from: self.to, to: self.from, points, ..*self }
    }
}

/// A closed loop of pieces.
pub(super) type Loop = Vec<Piece>;

/// A polyhedron clipped by the walls. All loops run counter-clockwise seen from outside the cell; those of the section as
/// seen from the upper wall.
#[derive(Clone, Debug)]
pub(super) struct Clipped {
    pub(super) nodes: Vec<Node>,
    /// With the face that each lies in.
    pub(super) films: Vec<(usize, Loop)>,
    /// On the lower and the upper wall.
    pub(super) patches: [Vec<Loop>; 2],
    /// On the middle surface.
    pub(super) section: Vec<Loop>,
}

impl Clipped {
    /// The number of connected pieces.
    pub(super) fn pieces(&self) -> usize {
        let loops = || self.films.iter().map(|(_, film)| film).chain(self.patches.iter().flatten());
        let mut parent: Vec<usize> = (0..self.nodes.len()).collect();
        for piece in loops().flatten() {
            let (a, b) = (root(&parent, piece.from), root(&parent, piece.to));
            parent[a.max(b)] = a.min(b);
        }
        let mut roots: Vec<usize> = loops().flatten().map(|piece| root(&parent, piece.from)).collect();
        roots.sort_unstable();
        roots.dedup();
        roots.len()
    }
}

fn root(parent: &[usize], mut node: usize) -> usize {
    while parent[node] != node {
        node = parent[node];
    }
    node
}

/// The arcs of a level in this face of the polyhedron could not be told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tangled {
    pub(super) behind: Behind,
}

/// Where the boundary of a face meets a level, or a corner between.
#[derive(Clone, Copy, Debug)]
enum Stop {
    Corner { node: usize, inside: bool },
    Crossing { node: usize, level: Level, rises: bool },
}

/// Clips `body` by the walls. Pairs of crossings nearer than `step` along an edge may be missed.
pub(super) fn clip(body: &Polyhedron, levels: &Levels<'_>, step: f64) -> Result<Clipped, Tangled> {
    let clipping = Clipping::new(body, levels, step);
    let mut films = Vec::new();
    let mut arcs: [Vec<Piece>; 3] = Default::default();
    for (index, face) in body.faces.iter().enumerate() {
        let stops = clipping.stops(face);
        let own = clipping.arcs(index, &stops)?;
        films.extend(clipping.films(index, &stops, &own)?.into_iter().map(|film| (index, film)));
        let [lower, middle, upper] = own;
        arcs[Level::Lower as usize].extend(lower);
        arcs[Level::Middle as usize].extend(middle.iter().map(Piece::reversed));
        arcs[Level::Upper as usize].extend(upper.iter().map(Piece::reversed));
    }
    let any_face = Tangled { behind: Behind::Cube };
    let [lower, middle, upper] = arcs.map(|arcs| joined(arcs).ok_or(any_face));
    Ok(Clipped { nodes: clipping.nodes, films, patches: [lower?, upper?], section: middle? })
}

struct Clipping<'a> {
    body: &'a Polyhedron,
    levels: &'a Levels<'a>,
    nodes: Vec<Node>,
    /// Per edge of the polyhedron, its lower corner first: the crossings with their nodes.
    edges: BTreeMap<(u32, u32), Vec<(Crossing, usize)>>,
    /// Whether each corner of the polyhedron, which is the node of the same number, lies between the walls.
    inside: Vec<bool>,
}

impl<'a> Clipping<'a> {
    fn new(body: &'a Polyhedron, levels: &'a Levels<'a>, step: f64) -> Self {
        let mut clipping = Self {
            body,
            levels,
            nodes: body.corners.iter().map(|&point| Node { point, between: None }).collect(),
            edges: BTreeMap::new(),
            inside: body.corners.iter().map(|&corner| is_inside(levels, corner)).collect(),
        };
        for (edge, between) in edges(body) {
            let [a, b] = [edge.0, edge.1].map(|corner| body.corners[corner as usize]);
            let crossings = levels.crossings(a, b, step).into_iter().map(|crossing| {
                clipping.nodes.push(Node { point: crossing.point, between: Some(between) });
                (crossing, clipping.nodes.len() - 1)
            });
            let crossings = crossings.collect();
            clipping.edges.insert(edge, crossings);
        }
        clipping
    }

    /// The corners and crossings round a face, counter-clockwise.
    fn stops(&self, face: &Face) -> Vec<Stop> {
        let mut stops = Vec::new();
        for (index, &from) in face.corners.iter().enumerate() {
            let to = face.corners[(index + 1) % face.corners.len()];
            stops.push(Stop::Corner { node: from as usize, inside: self.inside[from as usize] });
            let Some(crossings) = self.edges.get(&(from.min(to), from.max(to))) else { continue };
            let forward = from < to;
            let mut add = |&(Crossing { level, rises, .. }, node): &(Crossing, usize)| {
                stops.push(Stop::Crossing { node, level, rises: rises == forward });
            };
            if forward {
                crossings.iter().for_each(&mut add);
            } else {
                crossings.iter().rev().for_each(&mut add);
            }
        }
        stops
    }

    /// The arcs of each level in a face, with the part below the level on their left, seen from outside the cell.
    fn arcs(&self, face: usize, stops: &[Stop]) -> Result<[Vec<Piece>; 3], Tangled> {
        let mut arcs: [Vec<Piece>; 3] = Default::default();
        for level in Level::ALL {
            let (mut rising, mut falling) = (Vec::new(), Vec::new());
            for stop in stops {
                if let Stop::Crossing { node, level: crossed, rises } = *stop
                    && crossed == level
                {
                    if rises { rising.push(node) } else { falling.push(node) }
                }
            }
            arcs[level as usize] = self
                .matched(face, level, &rising, &falling)
                .ok_or(Tangled { behind: self.body.faces[face].half_space.behind })?;
        }
        Ok(arcs)
    }

    /// Joins every rising crossing with a falling one. More than one pair: the first rotation all of whose arcs stay in the
    /// face, since crossings alternate and arcs do not cross.
    fn matched(&self, face: usize, level: Level, rising: &[usize], falling: &[usize]) -> Option<Vec<Piece>> {
        if rising.len() != falling.len() {
            return None;
        }
        if rising.is_empty() {
            return Some(Vec::new());
        }
        (0..falling.len()).find_map(|turn| {
            let arcs: Option<Vec<Piece>> = rising
                .iter()
                .enumerate()
                .map(|(index, &from)| self.arc(face, level, from, falling[(index + turn) % falling.len()]))
                .collect();
            arcs.filter(|arcs| arcs.len() == 1 || arcs.iter().all(|arc| self.stays_in(face, arc)))
        })
    }

    fn arc(&self, face: usize, level: Level, from: usize, to: usize) -> Option<Piece> {
        let normal = self.body.faces[face].half_space.normal;
        let points = self.levels.arc(self.nodes[from].point, self.nodes[to].point, normal, level)?;
        Some(Piece { from, to, face, level: Some(level), points })
    }

    /// Whether the inner points of an arc lie inside its face.
    fn stays_in(&self, face: usize, arc: &Piece) -> bool {
        let Face { half_space, corners } = &self.body.faces[face];
        let at = |index: usize| self.body.corners[corners[index % corners.len()] as usize];
        let inner = &arc.points[1..arc.points.len() - 1];
        let middles = arc.points.windows(2).map(|ends| ends[0].midpoint(ends[1]));
        inner.iter().copied().chain(middles).all(|point| {
            (0..corners.len()).all(|index| {
                let (from, to) = (at(index), at(index + 1));
                half_space.normal.dot((to - from).cross(point - from)) >= 0.0
            })
        })
    }

    /// The loops of a face's part between the walls.
    fn films(&self, face: usize, stops: &[Stop], arcs: &[Vec<Piece>; 3]) -> Result<Vec<Loop>, Tangled> {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut open: Option<usize> = None;
        // Begun where the boundary comes into the gap, the walk ends outside of it.
        let start = stops.iter().position(|stop| enters(stop).is_some());
        let Some(start) = start else {
            let all_inside = stops.iter().all(|stop| matches!(stop, Stop::Corner { inside: true, .. }));
            return Ok(if all_inside { vec![self.whole_face(face)] } else { Vec::new() });
        };
        for stop in stops[start..].iter().chain(&stops[..start]) {
            let (node, ends) = match *stop {
                Stop::Corner { node, .. } => (node, false),
                Stop::Crossing { level: Level::Middle, .. } => continue,
                Stop::Crossing { node, .. } => (node, enters(stop).is_none()),
            };
            if let Some(from) = open.take() {
                pieces.push(self.straight(face, from, node));
            } else if enters(stop).is_none() {
                continue;
            }
            open = (!ends).then_some(node);
        }
        let [lower, _, upper] = arcs;
        pieces.extend(lower.iter().map(Piece::reversed));
        pieces.extend(upper.iter().cloned());
        joined(pieces).ok_or(Tangled { behind: self.body.faces[face].half_space.behind })
    }

    fn straight(&self, face: usize, from: usize, to: usize) -> Piece {
        let points = vec![self.nodes[from].point, self.nodes[to].point];
        Piece { from, to, face, level: None, points }
    }

    fn whole_face(&self, face: usize) -> Loop {
        let corners = &self.body.faces[face].corners;
        let node = |index: usize| corners[index % corners.len()] as usize;
        (0..corners.len()).map(|index| self.straight(face, node(index), node(index + 1))).collect()
    }
}

fn is_inside(levels: &Levels<'_>, point: DVec3) -> bool {
    let value = levels.value(point);
    value > levels.offset(Level::Lower) && value <= levels.offset(Level::Upper)
}

/// Whether the boundary comes into the gap here.
fn enters(stop: &Stop) -> Option<Level> {
    match *stop {
        Stop::Crossing { level: Level::Lower, rises: true, .. } => Some(Level::Lower),
        Stop::Crossing { level: Level::Upper, rises: false, .. } => Some(Level::Upper),
        Stop::Crossing { .. } | Stop::Corner { .. } => None,
    }
}

/// The edges of a polyhedron, lower corner first, with their two faces.
fn edges(body: &Polyhedron) -> BTreeMap<(u32, u32), [usize; 2]> {
    let mut edges: BTreeMap<(u32, u32), [usize; 2]> = BTreeMap::new();
    for (index, face) in body.faces.iter().enumerate() {
        for (at, &from) in face.corners.iter().enumerate() {
            let to = face.corners[(at + 1) % face.corners.len()];
            edges
                .entry((from.min(to), from.max(to)))
                .and_modify(|faces| faces[1] = index)
                .or_insert([index; 2]);
        }
    }
    edges
}

/// Joins pieces end to start into loops.
fn joined(pieces: Vec<Piece>) -> Option<Vec<Loop>> {
    let count = pieces.len();
    let mut by_start: BTreeMap<usize, Piece> = pieces.into_iter().map(|piece| (piece.from, piece)).collect();
    if by_start.len() != count {
        return None;
    }
    let mut loops = Vec::new();
    while let Some((first, piece)) = by_start.pop_first() {
        let mut current = vec![piece];
        while let Some(next) = current.last().map(|piece| piece.to).filter(|&next| next != first) {
            current.push(by_start.remove(&next)?);
        }
        loops.push(current);
    }
    Some(loops)
}
