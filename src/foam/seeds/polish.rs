//! Descent from the annealed seeds to the nearest minimum of a smooth repulsion on the surface.
//!
//! The potential of a pair is (1 − q)³ / q with q = (r/D)² < 1, twice continuously differentiable; it keeps seeds apart, as a
//! soft core would not. D is the mean of the two seeds' ranges, a fixed multiple of the local spacing. Steps are those of
//! J. Barzilai and J. Borwein (IMA J. Numer. Anal. 8, 1988) along the tangential gradient, each followed by a projection onto
//! the surface, with the non-monotone guard of L. Grippo, F. Lampariello and S. Lucidi (SIAM J. Numer. Anal. 23, 1986).

use super::PolishSettings;
use crate::foam::{convert::as_f64, ground::Ground, spatial::NearList};
use glam::DVec3;
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

/// Polishes `points` in place.
pub(super) fn polish(ground: &Ground, points: &mut Vec<DVec3>, settings: &PolishSettings) -> PolishStop {
    let spacing = ground.mean_spacing(as_f64(points.len()));
    let mut current = Repulsion::new(ground, points, settings.range);
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
            let next = Repulsion::new(ground, &moved, settings.range);
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
    points
        .iter()
        .zip(forces)
        .map(|(&point, &force)| ground.project(point + step * force).unwrap_or(point))
        .collect()
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
    fn new(ground: &Ground, points: &[DVec3], range: f64) -> Self {
        let count = as_f64(points.len());
        let ranges: Vec<f64> = points.iter().map(|&point| range * ground.spacing(count, point)).collect();
        let longest = ranges.iter().copied().fold(0.0, f64::max);
        let near = NearList::new(&ground.domain, points, longest, |i, j| 0.5 * (ranges[i] + ranges[j]));
        let mut energy = 0.0;
        let mut forces = Vec::with_capacity(points.len());
        for (index, &point) in points.iter().enumerate() {
            let (mut force, mut squeeze) = (DVec3::ZERO, 0.0);
            for &entry in near.of(index) {
                let other = entry.index as usize;
                let reach = 0.5 * (ranges[index] + ranges[other]);
                let apart = point - near.place(entry, points[other]);
                let q = apart.length_squared() / (reach * reach);
                if q < 1.0 {
                    energy += 0.5 * (1.0 - q).powi(3) / q;
                    let slope = 2.0 * ((1.0 - q) / (q * reach)).powi(2) * (1.0 + 2.0 * q);
                    force += slope * apart;
                    squeeze += slope * q * reach;
                }
            }
            // A pair's reach follows half of each range.
            force -= 0.5 * squeeze * range * ground.spacing_gradient(count, point);
            let normal = ground.normal(point);
            forces.push(force - normal * force.dot(normal));
        }
        Self { energy, forces }
    }

    fn largest_force(&self) -> f64 {
        self.forces.iter().map(|force| force.length_squared()).fold(0.0, f64::max).sqrt()
    }
}
