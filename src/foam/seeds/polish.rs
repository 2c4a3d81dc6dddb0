//! Descent from the annealed seeds to the nearest minimum of a smooth repulsion on the surface.
//!
//! The potential of a pair is (1 − q)³ / q with q = (r/D)² < 1, twice continuously differentiable; it keeps seeds apart, as a
//! soft core would not. D is the mean of the two seeds' ranges, a fixed multiple of the local spacing. Steps are those of
//! J. Barzilai and J. Borwein (IMA J. Numer. Anal. 8, 1988) along the tangential gradient, each followed by a projection onto
//! the surface, with the non-monotone guard of L. Grippo, F. Lampariello and S. Lucidi (SIAM J. Numer. Anal. 23, 1986).

use super::PolishSettings;
use crate::foam::{convert::as_f64, ground::Ground, spatial::NearList};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::VecDeque;

/// How a polish ended.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "how", rename_all = "snake_case")]
pub enum PolishStop {
    /// The largest tangential force fell below the tolerance.
    Converged {
        /// Steps taken.
        steps: usize,
    },
    /// The steps ran out.
    StepLimit {
        /// The largest tangential force left, in units of the pair energy over the mean spacing.
        force: f64,
    },
}

/// The energies among which a new one may be the highest.
const MEMORY: usize = 8;

/// No seed moves farther than this in one step, in mean spacings.
const LONGEST_MOVE: f64 = 0.2;

/// A step that raised the energy is shortened by this.
const SHORTENING: f64 = 0.3;

/// Where the energy is concave along the last step, the next is longer by this.
const LENGTHENING: f64 = 4.0;

/// The first step, in squared mean spacings: a unit force moves a seed by a hundredth of the spacing.
const FIRST_STEP: f64 = 0.01;

/// A step shorter than this, in squared mean spacings, is rounding and is taken whatever the energy says.
const SHORTEST_STEP: f64 = 1e-14;

/// Neighbours are listed out to this much beyond contact, in mean spacings.
const MARGIN: f64 = 0.3;

/// Polishes `points` in place.
pub(super) fn polish(ground: &Ground, points: &mut Vec<DVec3>, settings: &PolishSettings) -> PolishStop {
    let spacing = ground.mean_spacing(as_f64(points.len()));
    let mut neighbours = Neighbours::new(ground, points, settings.range);
    let mut current = neighbours.repulsion(points);
    let mut recent = VecDeque::from([current.energy]);
    let mut step = FIRST_STEP * spacing * spacing;
    for taken in 0..settings.steps {
        let largest = current.largest_force();
        if largest * spacing < settings.tolerance {
            return PolishStop::Converged { steps: taken };
        }
        let ceiling = recent.iter().copied().fold(f64::MIN, f64::max);
        step = step.min(LONGEST_MOVE * spacing / largest);
        let (moved, next) = loop {
            let moved = displaced(ground, points, &current.forces, step);
            let next = neighbours.repulsion(&moved);
            if next.energy <= ceiling || step < SHORTEST_STEP * spacing * spacing {
                break (moved, next);
            }
            step *= SHORTENING;
        };
        let curved = barzilai_borwein(ground, points, &moved, &current.forces, &next.forces);
        step = curved.unwrap_or(LENGTHENING * step);
        *points = moved;
        current = next;
        recent.push_back(current.energy);
        if recent.len() > MEMORY {
            recent.pop_front();
        }
    }
    PolishStop::StepLimit { force: current.largest_force() * spacing }
}

fn displaced(ground: &Ground, points: &[DVec3], forces: &[DVec3], step: f64) -> Vec<DVec3> {
    let moved = points.par_iter().zip(forces);
    moved.map(|(&point, &force)| ground.project(point + step * force).unwrap_or(point)).collect()
}

/// ⟨s, s⟩ / ⟨s, y⟩ with s the last displacement and y the change of gradient, where the energy is convex along s.
fn barzilai_borwein(
    ground: &Ground,
    old: &[DVec3],
    new: &[DVec3],
    old_forces: &[DVec3],
    new_forces: &[DVec3],
) -> Option<f64> {
    let period = ground.domain.period();
    let (mut squared, mut product) = (0.0, 0.0);
    for index in 0..old.len() {
        let moved = period.nearest_image(new[index] - old[index]);
        squared += moved.length_squared();
        product += moved.dot(old_forces[index] - new_forces[index]);
    }
    (product > 0.0 && squared > 0.0).then(|| squared / product)
}

/// Energy and tangential forces of a set of seeds.
struct Repulsion {
    energy: f64,
    forces: Vec<DVec3>,
}

impl Repulsion {
    fn largest_force(&self) -> f64 {
        self.forces.iter().map(|force| force.length_squared()).fold(0.0, f64::max).sqrt()
    }
}

/// Who is near whom, good until the seeds have moved by a share of [`MARGIN`].
struct Neighbours<'a> {
    ground: &'a Ground,
    /// A seed's range in its spacings.
    range: f64,
    spacing: f64,
    near: NearList,
    /// Places and ranges when the neighbours were listed.
    listed: Vec<(DVec3, f64)>,
}

impl<'a> Neighbours<'a> {
    fn new(ground: &'a Ground, points: &[DVec3], range: f64) -> Self {
        let spacing = ground.mean_spacing(as_f64(points.len()));
        let near = NearList::new(&ground.domain, &[], 1.0, |_, _| 0.0);
        Self { ground, range, spacing, near, listed: Vec::new() }
    }

    /// Whether each pair in reach of each other is still listed: neither its distance nor its reach has changed by more than
    /// half of the margin. A seed that left the box at one side and came back at the other counts as far moved.
    fn cover(&self, points: &[DVec3], ranges: &[f64]) -> bool {
        let slack = 0.5 * MARGIN * self.spacing;
        self.listed.len() == points.len()
            && self.listed.iter().zip(points.iter().zip(ranges)).all(|((place, listed), (point, range))| {
                point.distance(*place) + 0.5 * (range - listed).abs() <= slack
            })
    }

    fn list(&mut self, points: &[DVec3], ranges: &[f64]) {
        let margin = MARGIN * self.spacing;
        let farthest = ranges.iter().copied().fold(0.0, f64::max) + margin;
        let reach = |i: usize, j: usize| 0.5 * (ranges[i] + ranges[j]) + margin;
        self.near = NearList::new(&self.ground.domain, points, farthest, reach);
        self.listed = points.iter().copied().zip(ranges.iter().copied()).collect();
    }

    fn repulsion(&mut self, points: &[DVec3]) -> Repulsion {
        let count = as_f64(points.len());
        let ranges: Vec<f64> =
            points.par_iter().map(|&point| self.range * self.ground.spacing(count, point)).collect();
        if !self.cover(points, &ranges) {
            self.list(points, &ranges);
        }
        let each: Vec<(f64, DVec3)> =
            (0..points.len()).into_par_iter().map(|index| self.on_seed(index, points, &ranges)).collect();
        Repulsion {
            energy: each.iter().map(|(energy, _)| energy).sum(),
            forces: each.into_iter().map(|(_, force)| force).collect(),
        }
    }

    /// Half of the energy of a seed's pairs, and the tangential force on it.
    fn on_seed(&self, index: usize, points: &[DVec3], ranges: &[f64]) -> (f64, DVec3) {
        let (ground, count, point) = (self.ground, as_f64(points.len()), points[index]);
        let (mut energy, mut force, mut squeeze) = (0.0_f64, DVec3::ZERO, 0.0_f64);
        for &entry in self.near.of(index) {
            let other = entry.index as usize;
            let reach = 0.5 * (ranges[index] + ranges[other]);
            let apart = point - self.near.place(entry, points[other]);
            let q: f64 = apart.length_squared() / (reach * reach);
            if q < 1.0 {
                energy += 0.5 * (1.0 - q).powi(3) / q;
                let slope = 2.0 * ((1.0 - q) / (q * reach)).powi(2) * (1.0 + 2.0 * q);
                force += slope * apart;
                squeeze += slope * q * reach;
            }
        }
        // A pair's reach follows half of each range.
        force -= 0.5 * squeeze * self.range * ground.spacing_gradient(count, point);
        let normal = ground.normal(point);
        (energy, force - normal * force.dot(normal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        foam::{domain::Domain, ground::Density},
        surface::{Gap, SchwarzP},
        units::LevelOffset,
    };
    use rand::{RngExt, SeedableRng};
    use std::sync::Arc;

    #[test]
    fn kept_neighbours_give_the_forces_of_new_ones() {
        let Ok(gap) = Gap::level_set(Arc::new(SchwarzP { period: 1.0 }), LevelOffset(0.2)) else {
            panic!("no gap")
        };
        let domain = Domain::of_surface(gap.middle().as_ref());
        let ground = Ground::new(&gap, &domain, Density::Gap);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut points: Vec<DVec3> = (0..40).filter_map(|_| ground.sample(40.0, &mut rng)).collect();
        let mut kept = Neighbours::new(&ground, &points, 2.0);
        let step = 0.03 * ground.mean_spacing(40.0);
        // Far enough for several lists, and for seeds that leave the box.
        for _ in 0..60 {
            let pushes =
                points.iter().map(|_| DVec3::from_array(rng.random::<[f64; 3]>()) * 2.0 - DVec3::splat(0.7));
            let pushes: Vec<DVec3> = pushes.collect();
            points = displaced(&ground, &points, &pushes, step);
            let (old, new) =
                (kept.repulsion(&points), Neighbours::new(&ground, &points, 2.0).repulsion(&points));
            // Sums of some ten terms in another order.
            assert!((old.energy / new.energy - 1.0).abs() < 1e-12, "{} {}", old.energy, new.energy);
            for (a, b) in old.forces.iter().zip(&new.forces) {
                assert!(a.distance(*b) <= 1e-10 * (1.0 + b.length()), "{a} {b}");
            }
        }
    }
}
