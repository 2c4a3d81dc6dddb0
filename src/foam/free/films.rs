//! The film complex of a division: each polygon as curved quadrilaterals round its middle.
//!
//! A film with `k` corners is cut into `k` quadrilaterals, from each corner to the middles of the two sides that meet there
//! and to the middle of the film, of `fineness × fineness` biquadratic elements each. The coarsest films, of fineness 0, are
//! `k` quadratic triangles from each whole side to the middle: a third of the unknowns, a tenth of the work. Borders are shared by their films;
//! their nodes are slaved to the two corners, and those inside a film to all nodes round it, by mean value coordinates
//! (M. S. Floater, "Mean value coordinates", CAGD 20, 2003), so that a film goes with its borders and its wall. After a change
//! of topology, borders and films that were not touched keep their places.

use super::{Division, Polygon, division::CornerImage, flip::Renumbering, line::Line};
use crate::foam::{
    complex::{
        Complex, Element, Film, Motion, Node, NodeId, NodeImage, Places, Region, RegionId, RegionImage,
        RegionKind, Shape, WallId,
    },
    convert::as_f64,
};
use crate::{
    index::{Id, IndexVec},
    surface::{Gap, WallSide},
};
use glam::{DVec2, DVec3, IVec3};
use std::{collections::BTreeMap, ops::Range};

/// A border or an edge on a wall: its two corners, the second in the frame of the first.
pub type Side = (usize, usize, [i32; 3]);

/// The side between two corners of a polygon, and whether it goes from the first to the second.
pub(super) fn side_between(from: CornerImage, to: CornerImage) -> (Side, bool) {
    let forward = (from.corner, from.shift) <= (to.corner, to.shift);
    let (a, b) = if forward { (from, to) } else { (to, from) };
    let shift = IVec3::from_array(b.shift) - IVec3::from_array(a.shift);
    ((a.corner, b.corner, shift.to_array()), forward)
}

/// The films of a foam of free topology.
#[derive(Clone, Debug)]
pub struct FreeFilms {
    /// The complex: a region for each cell, a film for each polygon, the corners' nodes first.
    pub complex: Complex,
    /// The first places: plane films.
    pub places: Places,
    /// The nodes along each border, from its first corner to its second, in the frame of the first; edges on walls are not
    /// among them.
    pub borders: BTreeMap<Side, Vec<NodeImage>>,
    /// The same of edges on walls.
    pub wall_edges: BTreeMap<Side, Vec<NodeImage>>,
    /// The nodes inside the film of each polygon.
    inner: Vec<Range<usize>>,
}

impl FreeFilms {
    /// Lines of another complex that films can be laid along by [`films_refined`].
    pub(super) const fn of_lines(
        complex: Complex,
        places: Places,
        borders: BTreeMap<Side, Vec<NodeImage>>,
        wall_edges: BTreeMap<Side, Vec<NodeImage>>,
    ) -> Self {
        Self { complex, places, borders, wall_edges, inner: Vec::new() }
    }
}

/// Builds the complex of `division` with `fineness` elements on each half side, or one on each whole side for 0, from plane
/// films.
#[must_use]
pub fn free_films(division: &Division, gap: &Gap, fineness: usize) -> FreeFilms {
    build(division, gap, fineness, None)
}

/// Builds the complex anew after a change of topology.
pub(super) fn films_after(
    division: &Division,
    gap: &Gap,
    fineness: usize,
    before: &FreeFilms,
    renumbering: &Renumbering,
) -> FreeFilms {
    let mut corners = vec![None; division.corners.len()];
    for (old, new) in renumbering.corners.iter().enumerate() {
        if let Some(new) = *new {
            corners[new] = Some(old);
        }
    }
    let before = Before { films: before, corners, polygons: &renumbering.polygons, evenly: false };
    build(division, gap, fineness, Some(&before))
}

fn build(division: &Division, gap: &Gap, fineness: usize, before: Option<&Before<'_>>) -> FreeFilms {
    let mut builder = Builder::new(division, gap, fineness, before);
    let mut films = IndexVec::new();
    let mut inner = Vec::with_capacity(division.polygons.len());
    for (id, polygon) in division.polygons.iter().enumerate() {
        builder.kept = before.and_then(|before| before.inner(id)).unwrap_or_default();
        let (film, nodes) = builder.film(polygon);
        films.push(film);
        inner.push(nodes);
    }
    let regions = division.seeds.iter().map(|&anchor| Region { kind: RegionKind::Cell, anchor }).collect();
    let walls: IndexVec<WallId, _> = division.walls(gap).into();
    let Builder { nodes, places, sides, .. } = builder;
    let complex = Complex { period: division.period, walls, regions, nodes, films };
    let (on_walls, borders): (BTreeMap<_, _>, BTreeMap<_, _>) =
        sides.into_iter().partition(|(_, side)| side.is_on_wall);
    let nodes =
        |sides: BTreeMap<Side, SideNodes>| sides.into_iter().map(|(key, side)| (key, side.nodes)).collect();
    FreeFilms { complex, places, borders: nodes(borders), wall_edges: nodes(on_walls), inner }
}

/// Builds the complex anew with other elements, where the films are.
pub(super) fn films_refined(
    division: &Division,
    gap: &Gap,
    fineness: usize,
    before: &FreeFilms,
) -> FreeFilms {
    build(division, gap, fineness, Some(&Before::of_lines(division, before)))
}

/// Builds the complex anew with nodes at even distances along the lines where they are.
pub(super) fn films_evened(division: &Division, gap: &Gap, fineness: usize, before: &FreeFilms) -> FreeFilms {
    let polygons: Vec<Option<usize>> = (0..division.polygons.len()).map(Some).collect();
    let before = Before { polygons: &polygons, evenly: true, ..Before::of_lines(division, before) };
    build(division, gap, fineness, Some(&before))
}

/// Films before a change of topology or of the mesh.
struct Before<'a> {
    films: &'a FreeFilms,
    /// The old number of each corner that was there.
    corners: Vec<Option<usize>>,
    /// The old number of each polygon that has kept its corners.
    polygons: &'a [Option<usize>],
    /// Whether parts of a side are those of its length, not of its nodes.
    evenly: bool,
}

impl<'a> Before<'a> {
    /// Films between the same corners, of which only the lines are taken over.
    fn of_lines(division: &Division, films: &'a FreeFilms) -> Self {
        let corners = (0..division.corners.len()).map(Some).collect();
        Self { films, corners, polygons: &[], evenly: false }
    }

    /// The place at `part` of the way along a side that was there.
    fn on_side(&self, (first, last, shift): Side, part: f64) -> Option<DVec3> {
        let key = (self.corners[first]?, self.corners[last]?, shift);
        let nodes = self.films.borders.get(&key).or_else(|| self.films.wall_edges.get(&key))?;
        let places: Vec<DVec3> =
            nodes.iter().map(|&node| self.films.complex.place(&self.films.places, node)).collect();
        let line = Line::new(&places);
        Some(line.at(if self.evenly { line.at_length(part) } else { line.at_node(part) }))
    }

    /// The places inside a film that was there, last to first.
    fn inner(&self, polygon: usize) -> Option<Vec<DVec3>> {
        let nodes = self.films.inner[(*self.polygons.get(polygon)?)?].clone();
        Some(nodes.rev().map(|node| self.films.places[NodeId::from_index(node)]).collect())
    }
}

struct SideNodes {
    nodes: Vec<NodeImage>,
    is_on_wall: bool,
}

struct Builder<'a> {
    division: &'a Division,
    gap: &'a Gap,
    fineness: usize,
    /// Nodes along a half side, less one.
    half: usize,
    nodes: IndexVec<NodeId, Node>,
    places: Places,
    sides: BTreeMap<Side, SideNodes>,
    before: Option<&'a Before<'a>>,
    /// Places that inner nodes of the present film had before, last to first.
    kept: Vec<DVec3>,
}

impl<'a> Builder<'a> {
    fn new(division: &'a Division, gap: &'a Gap, fineness: usize, before: Option<&'a Before<'a>>) -> Self {
        let nodes = division
            .corners
            .iter()
            .map(|corner| Node {
                walls: corner.wall.map(wall_id).into_iter().chain(corner.plane.map(plane_id)).collect(),
                motion: Motion::Free,
            })
            .collect();
        let places = division.corners.iter().map(|corner| corner.place).collect();
        let (sides, kept) = (BTreeMap::new(), Vec::new());
        let half = (2 * fineness).max(1);
        Self { division, gap, fineness, half, nodes, places, sides, before, kept }
    }

    fn add(&mut self, node: Node, place: DVec3) -> NodeId {
        self.places.push(place);
        self.nodes.push(node)
    }

    /// The nodes along a side of a polygon, both ends included, in the polygon's frame.
    fn side(&mut self, from: CornerImage, to: CornerImage, wall: Option<WallSide>) -> Vec<NodeImage> {
        let (key, forward) = side_between(from, to);
        if !self.sides.contains_key(&key) {
            let made = self.new_side(key, IVec3::from_array(key.2), wall);
            self.sides.insert(key, made);
        }
        let shift = IVec3::from_array(if forward { from.shift } else { to.shift });
        let mut nodes: Vec<NodeImage> = self.sides[&key]
            .nodes
            .iter()
            .map(|image| NodeImage { node: image.node, shift: image.shift + shift })
            .collect();
        if !forward {
            nodes.reverse();
        }
        nodes
    }

    fn new_side(&mut self, key: Side, relative: IVec3, wall: Option<WallSide>) -> SideNodes {
        let [first, last] = [key.0, key.1].map(NodeId::from_index);
        let (start, end) =
            (self.places[first], self.places[last] + self.division.period.translation(relative));
        let count = 2 * self.half;
        let image = |corner, shift| CornerImage { corner, shift };
        let plane = self.division.plane_of_side(image(key.0, [0; 3]), image(key.1, key.2));
        let mut nodes = vec![NodeImage { node: first, shift: IVec3::ZERO }];
        for at in 1..count {
            let part = as_f64(at) / as_f64(count);
            let masters = vec![(first, 1.0 - part), (last, part)];
            let kept = self.before.and_then(|before| before.on_side(key, part));
            let straight = kept.unwrap_or_else(|| start.lerp(end, part));
            let (node, place) = match wall {
                None => {
                    let place = self.division.retracted(self.gap, None, plane, straight);
                    let walls = plane.map(plane_id).into_iter().collect();
                    (Node { walls, motion: Motion::Border(masters) }, place)
                }
                Some(side) => {
                    let place = self.gap.wall(side).project(straight).unwrap_or(straight);
                    (Node { walls: vec![wall_id(side)], motion: Motion::Inner(masters) }, place)
                }
            };
            nodes.push(NodeImage { node: self.add(node, place), shift: IVec3::ZERO });
        }
        nodes.push(NodeImage { node: last, shift: relative });
        SideNodes { nodes, is_on_wall: wall.is_some() }
    }

    /// The film, and the range of its inner nodes.
    fn film(&mut self, polygon: &Polygon) -> (Film, Range<usize>) {
        let corners = &polygon.corners;
        let count = corners.len();
        let on_wall: BTreeMap<usize, WallSide> = self.division.wall_sides(polygon).collect();
        let sides: Vec<Vec<NodeImage>> = (0..count)
            .map(|at| self.side(corners[at], corners[(at + 1) % count], on_wall.get(&at).copied()))
            .collect();
        let patch = Patch::new(self, &sides);
        let first = self.nodes.len();
        let elements = match self.fineness {
            0 => self.triangles(&sides, &patch),
            _ => self.quadrilaterals(&sides, &patch),
        };
        let side = |cell: usize, shift| RegionImage { region: RegionId::from_index(cell), shift };
        let film = Film {
            front: side(polygon.neighbour, polygon.shift),
            back: side(polygon.cell, IVec3::ZERO),
            tension: 1.0,
            elements,
        };
        (film, first..self.nodes.len())
    }

    /// One for each side, with its third corner in the middle.
    fn triangles(&mut self, sides: &[Vec<NodeImage>], patch: &Patch) -> Vec<Element> {
        let count = sides.len();
        let centre = self.inner(patch, patch.centre);
        let spokes: Vec<NodeImage> = (0..count).map(|k| self.spoke(patch, k * 2 * self.half)).collect();
        let nodes = |k: usize| {
            vec![sides[k][0], sides[k][2], centre, sides[k][1], spokes[(k + 1) % count], spokes[k]]
        };
        (0..count).map(|k| Element { shape: Shape::Tri6, nodes: nodes(k) }).collect()
    }

    fn quadrilaterals(&mut self, sides: &[Vec<NodeImage>], patch: &Patch) -> Vec<Element> {
        let mut elements = Vec::new();
        for quad in self.inner_nodes(sides, patch) {
            for j in (0..self.half).step_by(2) {
                for i in (0..self.half).step_by(2) {
                    let nodes = (0..9).map(|at| quad[j + at / 3][i + at % 3]).collect();
                    elements.push(Element { shape: Shape::Quad9, nodes });
                }
            }
        }
        elements
    }

    /// For every corner the grid of nodes of its quadrilateral: `[j][i]`, `i` along the side that follows the corner, `j` back
    /// along the one before it.
    fn inner_nodes(&mut self, sides: &[Vec<NodeImage>], patch: &Patch) -> Vec<Vec<Vec<NodeImage>>> {
        let (count, half) = (sides.len(), self.half);
        let centre = self.inner(patch, patch.centre);
        let spokes: Vec<Vec<NodeImage>> = (0..count)
            .map(|k| {
                let rim = patch.at(k * 2 * half + half);
                let inner =
                    (1..half).map(|t| self.inner(patch, rim.lerp(patch.centre, as_f64(t) / as_f64(half))));
                let inner: Vec<NodeImage> = inner.collect();
                std::iter::once(sides[k][half]).chain(inner).chain([centre]).collect()
            })
            .collect();
        (0..count)
            .map(|k| {
                let before = (k + count - 1) % count;
                let corner = patch.at(k * 2 * half);
                let (next, last) = (patch.at(k * 2 * half + half), patch.at(before * 2 * half + half));
                let mut rows = Vec::with_capacity(half + 1);
                for j in 0..=half {
                    let row = (0..=half).map(|i| match (i, j) {
                        (i, 0) => sides[k][i],
                        (0, j) => sides[before][2 * half - j],
                        (i, j) if i == half => spokes[k][j],
                        (i, j) if j == half => spokes[before][i],
                        (i, j) => {
                            let (u, v) = (as_f64(i) / as_f64(half), as_f64(j) / as_f64(half));
                            let place = (1.0 - u) * (1.0 - v) * corner
                                + u * (1.0 - v) * next
                                + (1.0 - u) * v * last
                                + u * v * patch.centre;
                            self.inner(patch, place)
                        }
                    });
                    rows.push(row.collect());
                }
                rows
            })
            .collect()
    }

    /// Half way from a node of the rim to the middle. It follows both, so that spokes stay straight in their film and no
    /// triangle folds where a short side grows.
    fn spoke(&mut self, patch: &Patch, rim: usize) -> NodeImage {
        let mut weights = patch.weights(patch.centre);
        weights.iter_mut().for_each(|weight| *weight *= 0.5);
        weights[rim] += 0.5;
        self.inner_of(patch, weights)
    }

    fn inner(&mut self, patch: &Patch, at: DVec2) -> NodeImage {
        self.inner_of(patch, patch.weights(at))
    }

    fn inner_of(&mut self, patch: &Patch, weights: Vec<f64>) -> NodeImage {
        let drawn = || weights.iter().zip(&patch.places).map(|(&w, &p)| w * p).sum();
        let place = self.kept.pop().unwrap_or_else(drawn);
        let masters = patch.nodes.iter().zip(weights).map(|(image, w)| (image.node, w)).collect();
        let node = self.add(Node { walls: Vec::new(), motion: Motion::Inner(masters) }, place);
        NodeImage { node, shift: IVec3::ZERO }
    }
}

fn wall_id(side: WallSide) -> WallId {
    WallId::from_index(side as usize)
}

/// Planes follow the walls.
fn plane_id(plane: usize) -> WallId {
    WallId::from_index(WallSide::BOTH.len() + plane)
}

/// A polygon laid flat: the nodes round it.
struct Patch {
    nodes: Vec<NodeImage>,
    places: Vec<DVec3>,
    flat: Vec<DVec2>,
    centre: DVec2,
}

impl Patch {
    fn new(builder: &Builder<'_>, sides: &[Vec<NodeImage>]) -> Self {
        let nodes: Vec<NodeImage> = sides.iter().flat_map(|side| &side[..side.len() - 1]).copied().collect();
        let place =
            |image: &NodeImage| builder.places[image.node] + builder.division.period.translation(image.shift);
        let places: Vec<DVec3> = nodes.iter().map(place).collect();
        let middle = places.iter().sum::<DVec3>() / as_f64(places.len());
        let around = places.iter().zip(places.iter().cycle().skip(1));
        let normal: DVec3 = around.map(|(&a, &b)| (a - middle).cross(b - middle)).sum();
        let (x, y) = normal.normalize_or(DVec3::Z).any_orthonormal_pair();
        let flat: Vec<DVec2> =
            places.iter().map(|&p| DVec2::new((p - middle).dot(x), (p - middle).dot(y))).collect();
        let corners = flat.iter().step_by(2 * builder.half);
        let centre = corners.sum::<DVec2>() / as_f64(sides.len());
        Self { nodes, places, flat, centre }
    }

    fn at(&self, node: usize) -> DVec2 {
        self.flat[node % self.flat.len()]
    }

    /// Mean value coordinates of a point inside.
    fn weights(&self, at: DVec2) -> Vec<f64> {
        let count = self.flat.len();
        let arm = |i: usize| self.flat[i % count] - at;
        let half_tangents: Vec<f64> = (0..count)
            .map(|i| {
                let (a, b) = (arm(i), arm(i + 1));
                (0.5 * a.perp_dot(b).atan2(a.dot(b))).tan()
            })
            .collect();
        let raw: Vec<f64> = (0..count)
            .map(|i| (half_tangents[(i + count - 1) % count] + half_tangents[i]) / arm(i).length())
            .collect();
        let sum: f64 = raw.iter().sum();
        raw.into_iter().map(|w| w / sum).collect()
    }
}
