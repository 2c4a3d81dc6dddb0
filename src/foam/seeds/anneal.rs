//! Simulated annealing of soft discs on the surface.
//!
//! The energy is Σ ½ (r − d)² over all pairs nearer than d, plus Σ ½ Φ²; each step moves one seed inside a cube and is
//! accepted by Metropolis' rule. The temperature falls geometrically; the cube is adapted to a fixed acceptance.

use super::{AnnealSettings, Progress, SeedError, TracePoint, order};
use crate::foam::{convert::as_f64, ground::Ground, spatial::NearList};
use glam::DVec3;
use rand::{Rng, RngExt};

/// The share of accepted moves that the move size is adapted to.
const ACCEPTANCE: f64 = 0.4;

/// The largest move along an axis, in mean spacings: √3 of it stays below [`DRIFT`].
const LARGEST_MOVE: f64 = 0.17;

/// The smallest move, as a fraction of the largest.
const SMALLEST_MOVE: f64 = 1e-5;

/// How strongly one sweep's acceptance changes the move size. Above 1 its noise shows; below 0.1 it lags behind the cooling.
const ADAPTION: f64 = 0.5;

/// Mean |∇Φ|² of the P-surface of period 1 in the paper's units, 6π²: it makes ½ Φ² there and the same stiffness
/// elsewhere, whatever the unit of Φ.
const PAPER_SLOPE: f64 = 6.0 * std::f64::consts::PI * std::f64::consts::PI;

/// The margin of the neighbour list, in mean spacings: of it, each of two discs may use [`DRIFT`] by moving, and the rest is
/// for diameters that change with the place.
const MARGIN: f64 = 0.8;

/// How far a disc may move, in mean spacings, before the neighbours are listed anew.
const DRIFT: f64 = 0.3;

/// The seeds while they anneal.
struct Discs<'a> {
    ground: &'a Ground,
    count: f64,
    spacing: f64,
    /// d over the local spacing.
    ratio: f64,
    /// The factor of ½ Φ².
    stiffness: f64,
    /// Unwrapped since the neighbours were listed.
    points: Vec<DVec3>,
    diameters: Vec<f64>,
    near: NearList,
    /// Places and diameters when the neighbours were listed.
    listed: Vec<(DVec3, f64)>,
    /// Φ at every disc.
    levels: Vec<f64>,
}

/// Anneals `points` and projects them onto the ground.
pub(super) fn anneal(
    ground: &Ground,
    points: &[DVec3],
    settings: &AnnealSettings,
    rng: &mut impl Rng,
    progress: &mut Progress<'_>,
) -> Result<(Vec<DVec3>, Vec<TracePoint>), SeedError> {
    let mut discs = Discs::new(ground, points, settings);
    let mut trace = Vec::new();
    let largest = LARGEST_MOVE * discs.spacing;
    let mut step = largest;
    let unit = (settings.diameter * discs.spacing).powi(2);
    for sweep in 0..settings.sweeps {
        let temperature = unit * settings.temperature(sweep);
        let acceptance = discs.sweep(step, temperature, rng) / discs.count;
        step = (step * (1.0 + ADAPTION * (acceptance - ACCEPTANCE))).clamp(SMALLEST_MOVE * largest, largest);
        if sweep % settings.trace_every() == 0 || sweep + 1 == settings.sweeps {
            trace.push(discs.record(sweep, temperature / unit, acceptance, unit));
        }
        if progress(as_f64(sweep + 1) / as_f64(settings.sweeps)).is_break() {
            return Err(SeedError::Interrupted { done: sweep + 1, sweeps: settings.sweeps });
        }
    }
    Ok((discs.projected(), trace))
}

impl<'a> Discs<'a> {
    fn new(ground: &'a Ground, points: &[DVec3], settings: &AnnealSettings) -> Self {
        let count = as_f64(points.len());
        let mut discs = Self {
            ground,
            count,
            spacing: ground.mean_spacing(count),
            ratio: settings.diameter,
            stiffness: settings.surface_stiffness.unwrap_or(PAPER_SLOPE / ground.mean_square_slope),
            points: points.to_vec(),
            diameters: points.iter().map(|&point| settings.diameter * ground.spacing(count, point)).collect(),
            near: NearList::new(&ground.domain, &[], 1.0, |_, _| 0.0),
            listed: Vec::new(),
            levels: points.iter().map(|&point| ground.value(point)).collect(),
        };
        discs.list_neighbours();
        discs
    }

    fn record(&mut self, sweep: usize, temperature: f64, acceptance: f64, unit: f64) -> TracePoint {
        self.list_neighbours();
        TracePoint {
            sweep: sweep + 1,
            temperature,
            energy: self.energy() / unit,
            acceptance,
            psi6: order::psi6(self.ground, &self.points),
        }
    }

    fn projected(&self) -> Vec<DVec3> {
        let onto = |point| self.ground.project(self.ground.domain.wrap(point).0).unwrap_or(point);
        self.points.iter().map(|&point| onto(point)).collect()
    }

    /// Wraps all discs and lists their neighbours anew.
    fn list_neighbours(&mut self) {
        for point in &mut self.points {
            *point = self.ground.domain.wrap(*point).0;
        }
        let margin = MARGIN * self.spacing;
        let widest = self.diameters.iter().copied().fold(0.0, f64::max);
        let contact = |i: usize, j: usize| 0.5 * (self.diameters[i] + self.diameters[j]) + margin;
        self.near = NearList::new(&self.ground.domain, &self.points, widest + margin, contact);
        self.listed = self.points.iter().copied().zip(self.diameters.iter().copied()).collect();
    }

    /// Whether the list still names all neighbours of a disc after it moves to `point`.
    fn list_covers(&self, index: usize, point: DVec3, diameter: f64) -> bool {
        let (place, listed) = self.listed[index];
        point.distance(place) <= DRIFT * self.spacing
            && (diameter - listed).abs() <= (MARGIN - 2.0 * DRIFT) * self.spacing
    }

    /// The energy of a disc at `point`, where Φ is `level`, in the field of all others; a pair with its own image counts half.
    fn energy_at(&self, moving: usize, point: DVec3, diameter: f64, level: f64) -> f64 {
        let mut overlap = 0.0;
        for &near in self.near.of(moving) {
            let other = near.index as usize;
            let itself = other == moving;
            let (origin, width) =
                if itself { (point, diameter) } else { (self.points[other], self.diameters[other]) };
            let contact = 0.5 * (diameter + width);
            let squared = self.near.place(near, origin).distance_squared(point);
            if squared < contact * contact {
                let depth = contact - squared.sqrt();
                overlap += depth * depth * if itself { 0.5 } else { 1.0 };
            }
        }
        0.5 * (overlap + self.stiffness * level * level)
    }

    /// One attempt per disc; the number of accepted ones.
    fn sweep(&mut self, step: f64, temperature: f64, rng: &mut impl Rng) -> f64 {
        let mut accepted = 0.0;
        for index in 0..self.points.len() {
            let [x, y, z]: [f64; 3] = [rng.random(), rng.random(), rng.random()];
            let chance: f64 = rng.random();
            let push = step * (2.0 * DVec3::new(x, y, z) - DVec3::ONE);
            let diameter = self.ratio * self.ground.spacing(self.count, self.points[index] + push);
            if !self.list_covers(index, self.points[index] + push, diameter) {
                self.list_neighbours();
            }
            let (old, new) = (self.points[index], self.points[index] + push);
            if !self.ground.domain.is_inside_walls(new) {
                continue;
            }
            let level = self.ground.value(new);
            let change = self.energy_at(index, new, diameter, level)
                - self.energy_at(index, old, self.diameters[index], self.levels[index]);
            if change <= 0.0 || chance < (-change / temperature).exp() {
                self.points[index] = new;
                self.diameters[index] = diameter;
                self.levels[index] = level;
                accepted += 1.0;
            }
        }
        accepted
    }

    /// The energy of all: pairs once.
    fn energy(&self) -> f64 {
        let of_each = self.points.iter().enumerate().map(|(index, &point)| {
            let level = self.levels[index];
            let on_surface = 0.5 * self.stiffness * level * level;
            0.5 * (self.energy_at(index, point, self.diameters[index], level) + on_surface)
        });
        of_each.sum()
    }
}
