//! Seeds and weights of both layers moved until plane films between power cells have the least area at about equal volumes:
//! both layers settle together before any film is curved, at a small part of the cost, and change who touches whom freely.
//!
//! Steps are those of limited-memory BFGS with a bound on their length (J. Nocedal, Math. Comp. 35 (1980)). The area has
//! continuous first derivatives where the topology changes, for films and borders vanish with all their area.

use super::{
    NoLayers, Sheets,
    division::{Neighbours, Sight},
    plane_films::{PlaneFilms, bulges},
};
use crate::{
    foam::{domain::Domain, seeds::Progress},
    surface::Gap,
};
use glam::DVec3;
use std::{collections::VecDeque, ops::ControlFlow};

/// Rounds, at the start of each of which the walls' bulges are measured and the neighbours listed, and the steps of each.
const ROUNDS: u32 = 10;
const STEPS: u32 = 30;
/// Pairs of steps and changes of the gradient that are remembered.
const MEMORY: usize = 12;
/// No seed moves farther in a step, in spacings.
const LONGEST: f64 = 0.1;
/// The part of the slope that a step must bring.
const SUFFICIENT: f64 = 1e-4;
const HALVINGS: usize = 12;
/// A fall of the energy in a round, relative, below which films count as settled: curved films lower it by far more.
const SETTLED: f64 = 2e-5;

/// Places and weights of all cells, in units of the spacing.
type Vector = Vec<[f64; 4]>;

/// The two sheets, settled, or as far as the rounds bring them.
///
/// # Errors
/// [`NoLayers`] if a cell is empty at the start.
pub(super) fn settled(
    gap: &Gap,
    domain: &Domain,
    sheets: Sheets,
    progress: &mut Progress<'_>,
) -> Result<Sheets, NoLayers> {
    let sight = Sight::new(gap);
    let mut sheets = sheets;
    let mut memory: VecDeque<(Vector, Vector)> = VecDeque::new();
    for round in 0..ROUNDS {
        sheets = sheets.wrapped(domain);
        let neighbours = Neighbours::new(domain, &sheets);
        let bulges = bulges(&sight, &neighbours, &sheets)?;
        let mut films = PlaneFilms::new(&sight, &neighbours, &sheets, &bulges)?;
        let first = films.energy;
        for step in 0..STEPS {
            let done = f64::from(round * STEPS + step) / f64::from(ROUNDS * STEPS);
            if progress(done) == ControlFlow::Break(()) {
                return Ok(sheets);
            }
            let Some((moved, next, way)) = taken(&sight, &neighbours, &sheets, &films, &bulges, &memory)
            else {
                if memory.is_empty() {
                    break;
                }
                memory.clear();
                continue;
            };
            let change = combined(&next.gradient, &films.gradient, -1.0);
            if dot(&change, &way) > 0.0 {
                memory.push_back((way, change));
            }
            if memory.len() > MEMORY {
                memory.pop_front();
            }
            (sheets, films) = (moved, next);
        }
        if first - films.energy < SETTLED * first {
            break;
        }
    }
    Ok(sheets)
}

/// A step down, and the way that it went; nothing if there is none.
fn taken(
    sight: &Sight<'_>,
    neighbours: &Neighbours,
    sheets: &Sheets,
    films: &PlaneFilms,
    bulges: &[f64],
    memory: &VecDeque<(Vector, Vector)>,
) -> Option<(Sheets, PlaneFilms, Vector)> {
    let direction = direction(&films.gradient, memory);
    let slope = dot(&direction, &films.gradient);
    let mut fraction = (LONGEST / largest(&direction)).min(1.0);
    for _ in 0..HALVINGS {
        let way: Vector = direction.iter().map(|by| by.map(|x| fraction * x)).collect();
        let moved = moved(sheets, &way);
        if let Ok(next) = PlaneFilms::new(sight, neighbours, &moved, bulges)
            && next.energy <= films.energy + SUFFICIENT * fraction * slope
        {
            return Some((moved, next, way));
        }
        fraction *= 0.5;
    }
    None
}

fn moved(sheets: &Sheets, way: &Vector) -> Sheets {
    let spacing = sheets.spacing;
    let mut moved = sheets.clone();
    for ((seed, weight), &[x, y, z, w]) in moved.seeds.iter_mut().zip(&mut moved.weights).zip(way) {
        *seed += spacing * DVec3::new(x, y, z);
        *weight += spacing * spacing * w;
    }
    moved
}

/// Minus the inverse Hessian as remembered times the gradient: the two loops of L-BFGS.
fn direction(gradient: &Vector, memory: &VecDeque<(Vector, Vector)>) -> Vector {
    let mut direction: Vector = gradient.iter().map(|by| by.map(|x| -x)).collect();
    let mut parts = Vec::with_capacity(memory.len());
    for (way, change) in memory.iter().rev() {
        let part = dot(way, &direction) / dot(way, change);
        direction = combined(&direction, change, -part);
        parts.push(part);
    }
    if let Some((way, change)) = memory.back() {
        let scale = dot(way, change) / dot(change, change);
        direction.iter_mut().flatten().for_each(|x| *x *= scale);
    }
    for ((way, change), part) in memory.iter().zip(parts.into_iter().rev()) {
        let back = dot(change, &direction) / dot(way, change);
        direction = combined(&direction, way, part - back);
    }
    direction
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a * b).sum()
}

fn combined(a: &Vector, b: &Vector, factor: f64) -> Vector {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|at| a[at] + factor * b[at])).collect()
}

fn largest(a: &Vector) -> f64 {
    a.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()))
}
