//! How many sides a cell has: two constructions, and a decision where they differ.
//!
//! The Delaunay triangulation of the centres says who ought to be neighbours; the segmentation says how long the wall
//! between two cells is. They can differ only where four cells nearly meet, and there each has a length to offer: the
//! Voronoi edge and the wall, both counted as negative if they run the other way (if it is the other two cells that touch).
//! Their weighted mean decides, and its size says how sure that is.

use super::{
    ellipse::{narrowness, unit, upright},
    kinds::Kind,
    triangulation::{Delaunay, Edge, voronoi_length},
    walls::Wall,
};
use glam::{DMat2, DVec2};
use std::collections::{BTreeMap, BTreeSet};

/// Error of a decided length, in pitches, from walls counted by eye and from synthetic photographs: the chance that a
/// decision is wrong falls with the length over this, as a logistic function.
const LENGTH_ERROR: f64 = 0.022;
/// Weight of the wall's length where one of the four cells cannot be seen.
const HIDDEN_WALL_WEIGHT: f64 = 0.1;
/// Weight of the Voronoi edge where one of the four cells is cut by the border, so that its centre is off.
const BORDER_CENTRE_WEIGHT: f64 = 0.5;
/// An edge whose decision is more doubtful than this gives a second value to its four cells.
const DOUBT: f64 = 0.12;

/// What is known of the cells.
pub(crate) struct Cells<'a> {
    /// Centres.
    pub(crate) centres: &'a [DVec2],
    /// Local pitches.
    pub(crate) pitches: &'a [f64],
    /// Seen, hidden or nothing.
    pub(crate) kinds: &'a [Kind],
    /// Whether the border, a mask or nothing cuts the cell.
    pub(crate) cut: &'a [bool],
    /// Whether so little of the cell is seen that its walls do not tell.
    pub(crate) slivers: &'a [bool],
    /// The shape of a cell that is seen as a whole: the matrix of its ellipse's half axes' squares, of determinant 1.
    pub(crate) shapes: &'a [Option<DMat2>],
}

/// The count of one cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Count {
    /// Neighbours, hidden ones and places beyond the comb included, in ascending order.
    pub(crate) neighbours: Vec<usize>,
    /// The other number of sides that the photograph allows.
    pub(crate) other: Option<usize>,
    /// Chance that the number of neighbours is right.
    pub(crate) confidence: f64,
}

/// One edge of the triangulation with the two cells across it.
struct Quad {
    edge: (usize, usize),
    across: (usize, usize),
    /// Positive if the edge's cells touch, in pitches.
    length: f64,
}

/// Counts the sides of all cells.
pub(crate) fn count(cells: &Cells<'_>, walls: &BTreeMap<(usize, usize), Wall>) -> Vec<Count> {
    let delaunay = Delaunay::of(cells.centres).edges();
    let quads = quads(cells, walls, &delaunay);
    let edges = decided(&delaunay, &quads);
    let mut counts = vec![Count { confidence: 1.0, ..Count::default() }; cells.centres.len()];
    for (a, b) in edges {
        counts[a].neighbours.push(b);
        counts[b].neighbours.push(a);
    }
    counts.iter_mut().for_each(|c| c.neighbours.sort_unstable());
    add_doubt(&quads, &mut counts);
    counts
}

/// How four cells are seen.
struct View {
    /// What makes the comb as it would be seen from above, leaving areas as they are.
    upright: DMat2,
    /// How much smaller that is than comb seen from above.
    shrinkage: f64,
}

impl View {
    fn of(cells: &Cells<'_>, four: [usize; 4]) -> Self {
        let shape = unit(four.iter().filter_map(|i| cells.shapes[*i]).sum()).unwrap_or(DMat2::IDENTITY);
        // The longer half axis is a circle's radius, the geometric mean of both is what remains of it.
        Self { upright: upright(shape), shrinkage: narrowness(shape).sqrt().recip() }
    }
}

fn quads(cells: &Cells<'_>, walls: &BTreeMap<(usize, usize), Wall>, delaunay: &[Edge]) -> Vec<Quad> {
    let mut quads = Vec::new();
    for edge in delaunay {
        let [Some(c), Some(d)] = edge.thirds else { continue };
        let (a, b) = edge.ends;
        let four = [a, b, c, d];
        let view = View::of(cells, four);
        let [p, q, r, s] = four.map(|i| view.upright * cells.centres[i]);
        let Some(voronoi) = voronoi_length([p, q], [r, s]) else { continue };
        let pitch = view.shrinkage * four.iter().map(|i| cells.pitches[*i]).sum::<f64>() / 4.0;
        let wall = |a: usize, b: usize| {
            let along = (cells.centres[b] - cells.centres[a]).perp().normalize_or_zero();
            let seen = walls.get(&(a.min(b), a.max(b))).map_or(0.0, |w| w.length);
            seen * (view.upright * along).length()
        };
        let all_seen = four.iter().all(|i| cells.kinds[*i] == Kind::Seen && !cells.slivers[*i]);
        let any_cut = four.iter().any(|i| cells.cut[*i]);
        let wall_weight = if all_seen { 1.0 } else { HIDDEN_WALL_WEIGHT };
        let centre_weight = if any_cut && all_seen { BORDER_CENTRE_WEIGHT } else { 1.0 };
        let sum = wall_weight * (wall(a, b) - wall(c, d)) + centre_weight * voronoi;
        quads.push(Quad {
            edge: (a, b),
            across: (c.min(d), c.max(d)),
            length: sum / (wall_weight + centre_weight) / pitch,
        });
    }
    quads
}

/// The edges of the triangulation, those of negative length exchanged for the ones across.
fn decided(delaunay: &[Edge], quads: &[Quad]) -> BTreeSet<(usize, usize)> {
    let mut edges: BTreeSet<(usize, usize)> = delaunay.iter().map(|edge| edge.ends).collect();
    let mut exchanged: BTreeSet<(usize, usize)> = BTreeSet::new();
    let mut order: Vec<&Quad> = quads.iter().filter(|q| q.length < 0.0).collect();
    order.sort_by(|p, q| p.length.total_cmp(&q.length));
    for quad in order {
        let ((a, b), (c, d)) = (quad.edge, quad.across);
        let rim = [(a, c), (a, d), (b, c), (b, d)].map(|(p, q)| (p.min(q), p.max(q)));
        if rim.iter().any(|e| exchanged.contains(e)) || edges.contains(&quad.across) {
            continue;
        }
        edges.remove(&quad.edge);
        edges.insert(quad.across);
        exchanged.insert(quad.edge);
    }
    edges
}

/// Lowers the confidence of the four cells of every quad by the chance that it was decided wrongly.
fn add_doubt(quads: &[Quad], counts: &mut [Count]) {
    let mut worst = vec![DOUBT; counts.len()];
    for quad in quads {
        let wrong = 1.0 / (1.0 + (quad.length.abs() / LENGTH_ERROR).exp());
        let touching = if quad.length >= 0.0 { quad.edge } else { quad.across };
        for cell in [quad.edge.0, quad.edge.1, quad.across.0, quad.across.1] {
            let count = &mut counts[cell];
            count.confidence *= 1.0 - wrong;
            if wrong > worst[cell] {
                worst[cell] = wrong;
                let sides = count.neighbours.len();
                let loses = cell == touching.0 || cell == touching.1;
                count.other = Some(if loses { sides.saturating_sub(1) } else { sides + 1 });
            }
        }
    }
}
