//! What is in the cells, what hides them, and so what can be seen.

use super::{RenderSettings, arrangement::DrawnCell, camera::Camera};
use crate::comb::score::{Truth, TruthCell};
use glam::DVec2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A wall shorter than this, in pitches, is no longer than the wax is thick, so that four cells seem to meet: both readings
/// are right.
const AMBIGUOUS: f64 = 0.1;
/// Half axes of a bee, in pitches.
const BEE: DVec2 = DVec2::new(1.5, 0.62);

/// What is seen in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Content {
    /// Its bottom.
    Empty,
    /// Pollen of a hue between yellow (0) and red (1).
    Pollen(f64),
    /// A larva, curled up.
    Larva,
    /// Nectar, with a glint at a place relative to the centre.
    Nectar(DVec2),
    /// Nothing: it is capped.
    Cap,
}

/// A bee on the comb.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bee {
    pub(super) centre: DVec2,
    pub(super) direction: DVec2,
}

impl Bee {
    /// Where a point is relative to the bee, in its half axes, head first; inside if shorter than 1.
    pub(super) fn inward(&self, point: DVec2) -> DVec2 {
        let step = point - self.centre;
        DVec2::new(step.dot(self.direction), step.dot(self.direction.perp())) / BEE
    }
}

/// Contents of all cells, bees, and the edge of the comb.
pub(super) struct Contents {
    pub(super) of_cell: Vec<Content>,
    pub(super) bees: Vec<Bee>,
    edge: Option<Edge>,
}

/// A wavy edge: comb is where `x · normal < offset + waves`.
struct Edge {
    normal: DVec2,
    offset: f64,
    phases: [f64; 3],
}

impl Contents {
    pub(super) fn choose(cells: &[DrawnCell], settings: &RenderSettings, view: &Camera) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        random.set_stream(1);
        let difficulty = settings.difficulty;
        let of_cell =
            cells.iter().map(|_| content(&mut random, difficulty.contents, difficulty.capped)).collect();
        let size = DVec2::new(f64::from(settings.width), f64::from(settings.height));
        let area = size.x * size.y / (settings.pitch * settings.pitch * 0.75_f64.sqrt());
        let bees = crate::comb::plane::pixels(area * difficulty.bees / 100.0);
        let bees = (0..bees)
            .map(|_| Bee {
                centre: view.on_comb(size * DVec2::new(random.random(), random.random())),
                direction: DVec2::from_angle(random.random_range(0.0..std::f64::consts::TAU)),
            })
            .collect();
        let edge = settings.torn_edge.then(|| {
            let normal = DVec2::from_angle(random.random_range(0.0..std::f64::consts::TAU));
            let reach = size.dot(normal.abs()) / settings.pitch / 2.0;
            Edge {
                normal,
                offset: 0.6 * reach,
                phases: std::array::from_fn(|_| random.random_range(0.0..6.0)),
            }
        });
        Self { of_cell, bees, edge }
    }

    /// Whether there is comb at a point.
    pub(super) fn is_comb(&self, point: DVec2) -> bool {
        self.edge.as_ref().is_none_or(|edge| {
            let along = point.dot(edge.normal.perp());
            let waves: f64 = edge
                .phases
                .iter()
                .zip([0.35, 0.9, 2.1])
                .map(|(p, f)| (along * f + p).sin() * 0.5 / f.sqrt())
                .sum();
            point.dot(edge.normal) < edge.offset + waves
        })
    }

    /// What is true of the picture.
    pub(super) fn truth(&self, cells: &[DrawnCell], settings: &RenderSettings, view: &Camera) -> Truth {
        let size = DVec2::new(f64::from(settings.width), f64::from(settings.height));
        let within = |p: DVec2| p.cmpge(DVec2::ZERO).all() && p.cmplt(size).all();
        let shown: Vec<bool> = cells.iter().map(|c| self.is_shown(c)).collect();
        let mut truth = Truth::default();
        for (index, cell) in cells.iter().enumerate() {
            let at = view.in_picture(cell.centre);
            if !within(at) || cell.corners.is_empty() || !self.is_comb(cell.centre) {
                continue;
            }
            // With the outer half of its walls.
            let framed = cell.corners.iter().all(|c| within(view.in_picture(cell.centre.lerp(*c, 1.1))));
            let open = |i: usize| shown[i] && self.of_cell[i] != Content::Cap;
            let complete = framed && open(index) && cell.neighbours.iter().all(|n| open(*n));
            let sides = u32::try_from(cell.neighbours.len()).ok();
            let fewer = (cell.shortest_wall < AMBIGUOUS).then(|| sides.map(|n| n - 1)).flatten();
            let more = (cell.nearest_miss < AMBIGUOUS).then(|| sides.map(|n| n + 1)).flatten();
            truth.cells.push(TruthCell {
                x_px: at.x,
                y_px: at.y,
                sides,
                other_sides: fewer.or(more),
                complete: u8::from(complete),
            });
        }
        truth
    }

    /// Whether the whole cell is on the comb and no bee is on it.
    fn is_shown(&self, cell: &DrawnCell) -> bool {
        let points = || cell.corners.iter().chain([&cell.centre]);
        let covered = self.bees.iter().any(|bee| {
            bee.centre.distance(cell.centre) < 3.0
                && points().any(|p| bee.inward(cell.centre.lerp(*p, 1.1)).length() < 1.0)
        });
        !covered && points().all(|p| self.is_comb(*p))
    }
}

fn content(random: &mut ChaCha8Rng, filled: f64, capped: f64) -> Content {
    let kind: f64 = random.random();
    let what: f64 = random.random();
    let glint = DVec2::new(random.random_range(-0.25..0.25), random.random_range(-0.25..0.25));
    if kind < capped {
        Content::Cap
    } else if kind < capped + filled {
        match what {
            w if w < 0.15 => Content::Pollen(w / 0.15),
            w if w < 0.35 => Content::Larva,
            _ => Content::Nectar(glint),
        }
    } else {
        Content::Empty
    }
}
