//! Which unknowns there are: the freedoms of the bounding nodes, then the pressures; the inner nodes of each film are
//! condensed out and have no number here.

use super::rigid;
use crate::{
    foam::complex::{Complex, Film, Motion, NodeId, NodeImage, Places, RegionId, RegionKind},
    index::{Id, IndexVec, checked_u32},
};
use std::collections::BTreeMap;

/// The nodes and freedoms of a film.
#[derive(Clone, Debug)]
pub(super) struct FilmLayout {
    /// The distinct nodes, in the film's frame.
    pub(super) nodes: Vec<NodeImage>,
    /// For each element, the rows of its nodes in `nodes`.
    pub(super) rows: Vec<Vec<usize>>,
    /// The rows of the inner nodes, masters before their slaves.
    pub(super) inner: Vec<usize>,
    /// For each inner node its masters that are inner nodes, too: their places in `inner` and their weights.
    pub(super) inner_masters: Vec<Vec<(usize, f64)>>,
    /// The freedoms of the bounding nodes that move this film, in order.
    pub(super) freedoms: Vec<usize>,
    /// The unknowns: those of `freedoms`, then the pressures of back and front; `None` where held.
    pub(super) unknowns: Vec<Option<usize>>,
}

/// The unknowns of a complex and the pattern of their matrix.
#[derive(Debug)]
pub(super) struct Layout {
    /// The first freedom of each bounding node, and how many it has.
    pub(super) freedoms: IndexVec<NodeId, (usize, usize)>,
    /// The unknown of each freedom; `None` where it is held to fix a rigid motion.
    pub(super) of_freedom: Vec<Option<usize>>,
    /// The unknown of each region's pressure; `None` for the open air and for one cell of a closed foam, whose volume
    /// follows from the others.
    pub(super) of_pressure: IndexVec<RegionId, Option<usize>>,
    /// All unknowns.
    pub(super) unknowns: usize,
    /// How many of them are pressures.
    pub(super) pressures: usize,
    pub(super) films: Vec<FilmLayout>,
    /// The cells of each part whose volumes' sum is fixed by walls.
    pub(super) closed_parts: Vec<Vec<RegionId>>,
    /// All nodes, masters before their slaves.
    pub(super) order_of_motion: Vec<NodeId>,
}

impl Layout {
    pub(super) fn new(complex: &Complex, places: &Places) -> Self {
        let mut count = 0;
        let freedoms: IndexVec<NodeId, (usize, usize)> = complex
            .nodes
            .iter()
            .map(|node| {
                let own = match node.motion {
                    Motion::Free => 3 - node.walls.len().min(3),
                    Motion::Border(_) => 2 - node.walls.len().min(2),
                    Motion::Inner(_) => 0,
                };
                count += own;
                (count - own, own)
            })
            .collect();
        let held = rigid::held_freedoms(complex, places, &freedoms);
        let mut unknowns = 0;
        let mut next = |free: bool| {
            free.then(|| {
                unknowns += 1;
                unknowns - 1
            })
        };
        let of_freedom: Vec<Option<usize>> =
            (0..count).map(|freedom| next(!held.contains(&freedom))).collect();
        let closed_parts = closed_parts(complex);
        // The volume of one cell of such a part follows from the others.
        let gauged: Vec<RegionId> = closed_parts.iter().filter_map(|part| part.first().copied()).collect();
        let of_pressure: IndexVec<RegionId, Option<usize>> = complex
            .regions
            .enumerated()
            .map(|(id, region)| next(region.kind == RegionKind::Cell && !gauged.contains(&id)))
            .collect();
        let pressures = of_pressure.iter().flatten().count();
        let depths = depths(complex);
        let mut order_of_motion: Vec<NodeId> = complex.nodes.ids().collect();
        order_of_motion.sort_by_key(|&node| depths[node]);
        let films: Vec<FilmLayout> = complex
            .films
            .iter()
            .map(|film| film_layout(complex, film, &depths, &freedoms, &of_freedom, &of_pressure))
            .collect();
        Self { freedoms, of_freedom, of_pressure, unknowns, pressures, films, closed_parts, order_of_motion }
    }

    /// The lower triangle's entries, row and column, in the order in which values are given: each film's, each bounding node's
    /// own block, the diagonal.
    pub(super) fn entries(&self) -> Vec<(u32, u32)> {
        let mut entries = Vec::new();
        let blocks = self.freedoms.iter().map(|&(first, own)| &self.of_freedom[first..first + own]);
        for unknowns in self.films.iter().map(|film| &film.unknowns[..]).chain(blocks) {
            let places =
                lower_pairs(unknowns).map(|(_, _, row, column)| (checked_u32(row), checked_u32(column)));
            entries.extend(places);
        }
        entries.extend((0..checked_u32(self.unknowns)).map(|at| (at, at)));
        entries
    }
}

/// The cells of every part of the foam that does not touch the open air.
fn closed_parts(complex: &Complex) -> Vec<Vec<RegionId>> {
    let mut part: Vec<usize> = (0..complex.regions.len()).collect();
    fn root(part: &mut [usize], mut at: usize) -> usize {
        while part[at] != at {
            part[at] = part[part[at]];
            at = part[at];
        }
        at
    }
    for film in &complex.films {
        let (a, b) = (root(&mut part, film.back.region.index()), root(&mut part, film.front.region.index()));
        part[a.max(b)] = a.min(b);
    }
    let mut parts: BTreeMap<usize, Vec<RegionId>> = BTreeMap::new();
    for id in complex.regions.ids() {
        parts.entry(root(&mut part, id.index())).or_default().push(id);
    }
    let closed = |part: &Vec<RegionId>| part.iter().all(|&id| complex.regions[id].kind == RegionKind::Cell);
    parts.into_values().filter(closed).collect()
}

/// How many generations of masters each node has. Masters of masters are few, and chains of them end at free nodes.
fn depths(complex: &Complex) -> IndexVec<NodeId, usize> {
    let mut depths = IndexVec::from_elem(0, complex.nodes.len());
    for _ in 0..MOST_GENERATIONS {
        for (id, node) in complex.nodes.enumerated() {
            if let Motion::Border(masters) | Motion::Inner(masters) = &node.motion {
                depths[id] = masters.iter().map(|&(master, _)| depths[master] + 1).max().unwrap_or(1);
            }
        }
    }
    depths
}

/// Free nodes, nodes of borders, inner nodes on walls, inner nodes that follow those.
const MOST_GENERATIONS: usize = 4;

/// The bounding nodes that a node's motion depends on, itself included if it is one.
fn bounding(complex: &Complex, node: NodeId, found: &mut Vec<NodeId>) {
    match &complex.nodes[node].motion {
        Motion::Free => found.push(node),
        Motion::Border(masters) => {
            found.push(node);
            found.extend(masters.iter().map(|&(master, _)| master));
        }
        Motion::Inner(masters) => {
            for &(master, _) in masters {
                bounding(complex, master, found);
            }
        }
    }
}

fn film_layout(
    complex: &Complex,
    film: &Film,
    depths: &IndexVec<NodeId, usize>,
    freedoms: &IndexVec<NodeId, (usize, usize)>,
    of_freedom: &[Option<usize>],
    of_pressure: &IndexVec<RegionId, Option<usize>>,
) -> FilmLayout {
    let mut numbers: BTreeMap<(NodeId, [i32; 3]), usize> = BTreeMap::new();
    let mut nodes = Vec::new();
    let rows = film
        .elements
        .iter()
        .map(|element| {
            element
                .nodes
                .iter()
                .map(|&image| {
                    *numbers.entry((image.node, image.shift.to_array())).or_insert_with(|| {
                        nodes.push(image);
                        nodes.len() - 1
                    })
                })
                .collect()
        })
        .collect();
    let mut found = Vec::new();
    let mut inner = Vec::new();
    for (row, image) in nodes.iter().enumerate() {
        bounding(complex, image.node, &mut found);
        if matches!(complex.nodes[image.node].motion, Motion::Inner(_)) {
            inner.push(row);
        }
    }
    inner.sort_by_key(|&row: &usize| depths[nodes[row].node]);
    let place_of: BTreeMap<NodeId, usize> =
        inner.iter().enumerate().rev().map(|(at, &row)| (nodes[row].node, at)).collect();
    let inner_masters = inner
        .iter()
        .map(|&row| match &complex.nodes[nodes[row].node].motion {
            Motion::Inner(masters) => masters
                .iter()
                .filter_map(|(master, weight)| Some((*place_of.get(master)?, *weight)))
                .collect(),
            _ => Vec::new(),
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    let own: Vec<usize> =
        found.iter().flat_map(|&node| freedoms[node].0..freedoms[node].0 + freedoms[node].1).collect();
    let mut unknowns: Vec<Option<usize>> = own.iter().map(|&freedom| of_freedom[freedom]).collect();
    unknowns.extend([of_pressure[film.back.region], of_pressure[film.front.region]]);
    FilmLayout { nodes, rows, inner, inner_masters, freedoms: own, unknowns }
}

/// All pairs of places in `unknowns` on or below the diagonal of the matrix: the two places, then row and column.
pub(super) fn lower_pairs(
    unknowns: &[Option<usize>],
) -> impl Iterator<Item = (usize, usize, usize, usize)> + '_ {
    unknowns.iter().enumerate().flat_map(move |(i, &row)| {
        unknowns
            .iter()
            .enumerate()
            .filter_map(move |(j, &column)| Some((i, j, row?, column?)))
            // A region on both sides of a film would appear twice; its off-diagonal pair is met twice, too, as it must.
            .filter(|&(i, j, row, column)| row > column || (row == column && i >= j))
    })
}
