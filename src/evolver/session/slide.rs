//! `slide`: the surface is carried along its walls as a whole, as far as that lowers its energy.
//!
//! A bubble between walls whose curvature varies has a slow direction: its energy changes by less than its mesh's error, so
//! that steps down stay where the mesh pins them. Carried with its mesh, the error comes along and cancels. After each
//! stretch of way Newton steps bring the films to rest at that place, and the way goes on only if the energy there is lower,
//! with the volumes as they are closed on the walls: those by content integrals favour places away from their gauge's origin.

use super::{Current, Host, Session, format::significant, motion::Done};
use crate::{
    evolver::{
        error::EvolverError,
        physics::{Values, carry::Velocity},
    },
    index::IndexVec,
};
use glam::DVec3;

/// Stretches of way before giving up.
const STRETCHES: f64 = 300.0;
/// The first stretch and the least, as parts of the size of the surface.
const FIRST: f64 = 0.25;
const LEAST: f64 = 1e-3;
/// Newton steps to rest after each stretch.
const STEPS_TO_REST: usize = 12;
/// The relative change of the energy at which the films rest.
const REST: f64 = 1e-13;

/// How often the mesh is evened out on the way: it grows uneven as it is carried along.
const RENEWALS: usize = 12;
/// The way behind a renewal, as a part of the size of the surface, below which the surface has come to where it stays.
const WORTH: f64 = 0.02;

impl Session {
    /// Slides in at most `most` stretches, and evens out the mesh wherever it goes no further, as long as it goes on then.
    pub(super) fn slide(&mut self, most: Option<f64>, host: &mut dyn Host) -> Done {
        let mut left = most.unwrap_or(STRETCHES);
        let mut way = self.slide_on(&mut left, host)?;
        for _ in 0..RENEWALS {
            if left < 0.5 || way <= 0.0 {
                break;
            }
            let (surface, multipliers) = (self.surface.clone(), self.multipliers.clone());
            let further = self.average(None).and_then(|()| self.slide_on(&mut left, host));
            match further {
                Ok(further) if further > WORTH * self.size() => way += further,
                Err(EvolverError::Interrupted) => return Err(EvolverError::Interrupted),
                _ => {
                    // The mesh before it was evened out in vain.
                    (self.surface, self.multipliers) = (surface, multipliers);
                    self.changed();
                    self.current()?;
                    break;
                }
            }
        }
        self.say(host, &format!("Slid by {}.\n", significant(way, 6)));
        self.report_energy(host)
    }

    /// Slides as far as the energy falls with this mesh. The way.
    fn slide_on(&mut self, left: &mut f64, host: &mut dyn Host) -> Result<f64, EvolverError> {
        let mut way = 0.0;
        let (mut stretch, least) = (FIRST * self.size(), LEAST * self.size());
        let mut best = self.energy_at_rest()?;
        while *left > 0.5 && stretch > least {
            if host.interrupted() {
                return Err(EvolverError::Interrupted);
            }
            *left -= 1.0;
            let Some(direction) = self.way_down(least)? else {
                self.say(host, "Nothing lets the surface slide.\n");
                break;
            };
            let Some(Current { problem, state, values, .. }) = &self.problem else { break };
            let (old, before, multipliers) = (state.clone(), values.clone(), self.multipliers.clone());
            let (moved, after) = problem.stepped(&old, &direction, stretch)?;
            let sound = after.energy.is_finite() && problem.turned_over(&old.places, &moved.places) == 0;
            let mut rested = None;
            if sound && self.accept(moved, after, multipliers.clone()).is_ok() {
                rested = self.energy_at_rest().ok().filter(|energy| *energy < best);
            }
            if let Some(energy) = rested {
                best = energy;
                way += stretch;
                stretch = (1.5 * stretch).min(FIRST * self.size());
            } else {
                self.accept(old, before, multipliers)?;
                stretch *= 0.5;
            }
        }
        Ok(way)
    }

    /// The unit velocity along the walls by which the energy falls most.
    fn way_down(&mut self, step: f64) -> Result<Option<Velocity>, EvolverError> {
        self.current()?;
        let Some(Current { problem, state, .. }) = &self.problem else { return Ok(None) };
        let carriers = problem.carriers(state)?;
        let slopes: Vec<f64> = carriers
            .iter()
            .map(|carrier| problem.slope(&self.surface, state, &self.multipliers, carrier, step))
            .collect();
        let steepness = slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        if steepness.is_nan() || steepness <= 0.0 {
            return Ok(None);
        }
        let mut direction = IndexVec::from_elem(DVec3::ZERO, state.places.len());
        for (carrier, slope) in carriers.iter().zip(slopes) {
            for (sum, velocity) in direction.as_mut_slice().iter_mut().zip(carrier.iter()) {
                *sum -= slope / steepness * *velocity;
            }
        }
        Ok(Some(direction))
    }

    /// The energy once the films have come to rest where they are, for the volumes closed on the walls.
    fn energy_at_rest(&mut self) -> Result<f64, EvolverError> {
        self.come_to_rest()?;
        let Some(Current { problem, state, values, .. }) = &self.problem else { return Ok(0.0) };
        Ok(values.energy + problem.discrepancy(&self.surface, &state.places, &self.multipliers))
    }

    /// Newton steps that do not carry the surface along, until the energy stays; none that turns facets over.
    fn come_to_rest(&mut self) -> Done {
        for _ in 0..STEPS_TO_REST {
            self.current()?;
            let Some(Current { problem, state, .. }) = &self.problem else { break };
            let still = problem.carriers(state)?;
            let (newton, values, old) = self.newton(&still)?;
            let Some(current) = &self.problem else { break };
            let step = newton.step(&current.problem, &values)?;
            let mut sound = None;
            for scale in [1.0, 0.25, 0.05] {
                let (moved, after) = current.problem.stepped(&old, &step.velocity, scale)?;
                let turned = current.problem.turned_over(&old.places, &moved.places);
                if after.energy.is_finite() && turned == 0 {
                    sound = Some((moved, after));
                    break;
                }
            }
            let Some((moved, after)) = sound else {
                return Err(EvolverError::Numerical("the films do not come to rest".to_owned()));
            };
            let multipliers = super::seek::sum(&self.multipliers, &step.multipliers);
            let settled = is_settled(&values, &after);
            self.accept(moved, after, multipliers)?;
            if settled {
                break;
            }
        }
        Ok(())
    }

    /// The root mean square distance of the vertices from their mean.
    fn size(&self) -> f64 {
        let places = || self.surface.vertices.iter().map(|vertex| vertex.position);
        #[expect(clippy::cast_precision_loss, reason = "a count of vertices")]
        let count = self.surface.vertices.len().max(1) as f64;
        let mean = places().sum::<DVec3>() / count;
        (places().map(|place| place.distance_squared(mean)).sum::<f64>() / count).sqrt()
    }
}

fn is_settled(before: &Values, after: &Values) -> bool {
    (after.energy - before.energy).abs() <= REST * before.energy.abs()
}
