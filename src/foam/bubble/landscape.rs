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
        FoamSpace::Plane { periods, .. } => route(gap, DVec3::ZERO, DVec3::X * periods[0], count),
        FoamSpace::Periodic { .. } => {
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
        FoamSpace::Plane { .. } => vec![DVec3::ZERO],
        FoamSpace::Torus { ring, tubes } => round_tube(ring, 0.5 * (tubes[0] + tubes[1]), PI, count),
        FoamSpace::Periodic { .. } => farthest(gap.middle().as_ref(), count),
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

/// A value between scattered samples, modulo the symmetries of a surface: the mean with weights that fall with the fourth
/// power of the distance, among the nearest.
#[derive(Clone, Debug)]
pub struct Scattered {
    orbits: Orbits,
    samples: Vec<(DVec3, f64)>,
}

/// Samples that count at a point.
const NEIGHBOURS: usize = 5;

impl Scattered {
    /// From values at places.
    #[must_use]
    pub fn new(surface: &dyn LevelSet, samples: Vec<(DVec3, f64)>) -> Self {
        Self { orbits: Orbits::of(surface), samples }
    }

    /// The value at `p`; not a number without samples.
    #[must_use]
    pub fn at(&self, p: DVec3) -> f64 {
        let mut near: Vec<(f64, f64)> =
            self.samples.iter().map(|&(q, value)| (self.orbits.distance(p, q), value)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEIGHBOURS);
        let (mut sum, mut weights) = (0.0, 0.0);
        for (distance, value) in near {
            let weight = distance.max(1e-9).powi(-4);
            sum += weight * value;
            weights += weight;
        }
        sum / weights
    }
}
