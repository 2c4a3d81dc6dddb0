//! The energy of a held bubble over the surface: along a route, or over the part of the surface that its symmetries repeat.

use super::{
    Bubble, Chart, Meshes, NoBubble, ThinGap,
    held::{chart_at, held},
    symmetry::Orbits,
};
use crate::{
    foam::{convert::as_f64, setup::FoamSpace},
    surface::{Gap, LevelSet, SurfaceSamples},
};
use faer::{Mat, prelude::Solve};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A place with the bubble that is held there.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The place.
    pub place: DVec3,
    /// Along a route: the length of the way so far. Not a number on a patch.
    pub along: f64,
    /// What thin gaps say there.
    pub thin: ThinGap,
    /// The bubble, or why there is none.
    pub bubble: Result<Bubble, NoBubble>,
}

/// Holds a bubble of this volume at each of the places, in parallel; the order is kept.
///
/// # Errors
/// A place off the surface or a volume that is none.
pub fn scan(gap: &Gap, volume: f64, places: &[DVec3], meshes: &Meshes) -> Result<Vec<Sample>, NoBubble> {
    places
        .par_iter()
        .map(|&place| {
            let chart = chart_at(gap, volume, place)?;
            let thin = ThinGap::at(&chart)?;
            let bubble = held(gap, volume, place, meshes);
            Ok(Sample { place: chart.place(), along: f64::NAN, thin, bubble })
        })
        .collect()
}

/// The same with the length of the way from place to place.
///
/// # Errors
/// As [`scan`].
pub fn scan_route(
    gap: &Gap,
    volume: f64,
    places: &[DVec3],
    meshes: &Meshes,
) -> Result<Vec<Sample>, NoBubble> {
    let mut samples = scan(gap, volume, places, meshes)?;
    let mut along = 0.0;
    let mut last = samples.first().map(|sample| sample.place);
    for sample in &mut samples {
        along += last.map_or(0.0, |last| last.distance(sample.place));
        last = Some(sample.place);
        sample.along = along;
    }
    Ok(samples)
}

/// `count` places along the surface from one place to another: the segment between them, brought onto the surface.
///
/// # Errors
/// [`NoBubble::Place`] where the surface is not near.
pub fn route(gap: &Gap, from: DVec3, to: DVec3, count: usize) -> Result<Vec<DVec3>, NoBubble> {
    let last = as_f64(count.max(2) - 1);
    (0..count).map(|at| Ok(Chart::new(gap, from.lerp(to, as_f64(at) / last))?.place())).collect()
}

/// The route that shows most of a surface: round the tube of a torus, from a flat point over a neck of the P-surface (on
/// other triply periodic surfaces, between the points of least and of greatest curvature), a part of a great circle, a line.
///
/// # Errors
/// As [`route`].
pub fn usual_route(space: &FoamSpace, gap: &Gap, count: usize) -> Result<Vec<DVec3>, NoBubble> {
    match *space {
        FoamSpace::Torus { ring, tubes } => Ok(round_tube(ring, 0.5 * (tubes[0] + tubes[1]), TAU, count)),
        FoamSpace::Sphere { radii } => {
            let radius = 0.5 * (radii[0] + radii[1]);
            route(gap, DVec3::X * radius, DVec3::Y * radius, count)
        }
        FoamSpace::Plane { periods, .. } | FoamSpace::Box { sides: periods, .. } => {
            route(gap, DVec3::ZERO, DVec3::X * periods[0], count)
        }
        FoamSpace::Periodic { .. } | FoamSpace::Piece { .. } => {
            let [steep, flat] = extremes(gap.middle().as_ref());
            route(gap, flat, steep, count)
        }
    }
}

fn round_tube(ring: f64, tube: f64, angle: f64, count: usize) -> Vec<DVec3> {
    (0..count)
        .map(|at| {
            let (sin, cos) = (angle * as_f64(at) / as_f64(count.max(2) - 1)).sin_cos();
            DVec3::new(ring + tube * cos, 0.0, tube * sin)
        })
        .collect()
}

/// Lines per axis of the candidates for places on a patch.
const CANDIDATE_LINES: usize = 24;

/// The points of least and of greatest Gaussian curvature, the second in the nearest image to the first.
fn extremes(surface: &dyn LevelSet) -> [DVec3; 2] {
    let samples = SurfaceSamples::new(surface, 0.0, CANDIDATE_LINES);
    let (low, _) = samples.minimise(surface, |p| surface.curvature(p).gauss);
    let flat = |p: DVec3| -surface.curvature(p).gauss;
    let points = samples.points().iter().map(|point| point.position);
    let near = |p: DVec3| low + surface.period().nearest_image(p - low);
    let (_, high) = samples.minimise(surface, flat);
    // Among the samples that are nearly as flat as any, the one nearest to the low point.
    let nearly = 0.02 * (flat(low) - high);
    let start = points
        .filter(|&p| flat(p) - high < nearly)
        .map(near)
        .min_by(|a, b| a.distance(low).total_cmp(&b.distance(low)))
        .unwrap_or(low);
    [low, start]
}

/// Places spread over the part of a surface that its symmetries repeat: one on spheres and planes, half the way round the
/// tube of a torus, and on triply periodic surfaces `count` places as far from each other as can be, modulo the symmetries
/// that take walls to walls.
#[must_use]
pub fn patch(space: &FoamSpace, gap: &Gap, count: usize) -> Vec<DVec3> {
    match *space {
        FoamSpace::Sphere { radii } => vec![DVec3::Z * 0.5 * (radii[0] + radii[1])],
        FoamSpace::Plane { .. } | FoamSpace::Box { .. } => vec![DVec3::ZERO],
        FoamSpace::Torus { ring, tubes } => round_tube(ring, 0.5 * (tubes[0] + tubes[1]), PI, count),
        FoamSpace::Periodic { .. } | FoamSpace::Piece { .. } => farthest(gap.middle().as_ref(), count),
    }
}

/// Farthest-point sampling of the orbits.
fn farthest(surface: &dyn LevelSet, count: usize) -> Vec<DVec3> {
    let orbits = Orbits::of(surface);
    let mut candidates: Vec<DVec3> = extremes(surface).to_vec();
    let samples = SurfaceSamples::new(surface, 0.0, CANDIDATE_LINES);
    candidates.extend(samples.points().iter().map(|point| point.position));
    let mut distances = vec![f64::INFINITY; candidates.len()];
    let mut chosen = Vec::with_capacity(count);
    let mut next = 0;
    while chosen.len() < count.min(candidates.len()) {
        let place = candidates[next];
        chosen.push(place);
        distances.par_iter_mut().zip(&candidates).for_each(|(distance, &p)| {
            *distance = distance.min(orbits.distance(p, place));
        });
        let best = distances.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        next = best.map_or(0, |(index, _)| index);
    }
    chosen
}

/// A value between scattered samples, modulo the symmetries of a surface: the interpolant c + Σ λᵢ |p − pᵢ| with Σ λᵢ = 0,
/// which joins samples on a line by straight pieces (R. Franke, Mathematics of Computation 38, 1982).
#[derive(Clone, Debug)]
pub struct Scattered {
    orbits: Orbits,
    places: Vec<DVec3>,
    weights: Vec<f64>,
    constant: f64,
}

/// Samples nearer to each other than this, in the surface's unit, are one: their rows could not be told apart.
const SAME_PLACE: f64 = 1e-6;

impl Scattered {
    /// From values at places. Of samples at one place the first counts.
    #[must_use]
    pub fn new(surface: &dyn LevelSet, samples: &[(DVec3, f64)]) -> Self {
        let orbits = Orbits::of(surface);
        let mut places: Vec<DVec3> = Vec::new();
        let mut values = Vec::new();
        for &(place, value) in samples {
            if places.iter().all(|&other| orbits.distance(place, other) > SAME_PLACE) {
                places.push(place);
                values.push(value);
            }
        }
        let count = places.len();
        let system = Mat::from_fn(count + 1, count + 1, |i, j| match (i == count, j == count) {
            (false, false) => orbits.distance(places[i], places[j]),
            (true, true) => 0.0,
            _ => 1.0,
        });
        let sides = Mat::from_fn(count + 1, 1, |i, _| values.get(i).copied().unwrap_or(0.0));
        let solution = system.partial_piv_lu().solve(&sides);
        let weights = (0..count).map(|i| solution[(i, 0)]).collect();
        Self { orbits, places, weights, constant: solution[(count, 0)] }
    }

    /// The value at `p`; not a number without samples.
    #[must_use]
    pub fn at(&self, p: DVec3) -> f64 {
        let parts =
            self.places.iter().zip(&self.weights).map(|(&q, weight)| weight * self.orbits.distance(p, q));
        self.constant + parts.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Plane, SchwarzP};

    #[test]
    fn a_line_of_samples_is_joined_by_straight_pieces() {
        let plane = Plane { periods: [8.0, 8.0] };
        let heights = [1.0, 3.0, 2.0, 2.5];
        let samples: Vec<(DVec3, f64)> =
            heights.iter().zip([0.0, 0.5, 1.5, 2.0]).map(|(&value, x)| (x * DVec3::X, value)).collect();
        let between = Scattered::new(&plane, &samples);
        for (&(p, value), &(q, next)) in samples.iter().zip(&samples[1..]) {
            // Sums of a few numbers of order one.
            assert!((between.at(p) - value).abs() < 1e-12);
            assert!((between.at(p.lerp(q, 0.3)) - (0.7 * value + 0.3 * next)).abs() < 1e-12);
        }
    }

    #[test]
    fn images_of_a_sample_have_its_value() {
        let surface = SchwarzP { period: 1.0 };
        let (neck, flat) = (DVec3::new(0.0, 0.5, 0.25), DVec3::splat(0.25));
        let between = Scattered::new(&surface, &[(neck, 2.0), (flat, 1.0), (DVec3::splat(0.75), 5.0)]);
        for (p, value) in [(DVec3::new(0.5, 1.0, 0.75), 2.0), (DVec3::new(0.25, 0.75, 0.25), 1.0)] {
            assert!((between.at(p) - value).abs() < 1e-12, "{p}");
        }
    }
}
