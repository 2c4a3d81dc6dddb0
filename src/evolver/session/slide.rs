//! `slide`: the surface is carried along its walls as a whole, as far as that lowers its energy.
//!
//! A bubble between walls whose curvature varies has a slow direction: its energy changes by less than its mesh's error, so
//! that steps down stay where the mesh pins them. Carried with its mesh, the error comes along and cancels. After each
//! stretch of way Newton steps bring the films back to rest, and the way goes on only if the energy at rest is lower.

use super::{Current, Host, Session, format::significant, motion::Done};
use crate::evolver::{error::EvolverError, physics::Values};

/// Stretches of way before giving up.
const STRETCHES: f64 = 200.0;
/// The first stretch and the least, as parts of the size of the surface.
const FIRST: f64 = 0.25;
const LEAST: f64 = 1e-4;
/// Newton steps to rest after each stretch.
const STEPS_TO_REST: usize = 12;
/// The relative change of the energy at which the films rest.
const REST: f64 = 1e-14;

impl Session {
    /// Slides in at most `most` stretches.
    pub(super) fn slide(&mut self, most: Option<f64>, host: &mut dyn Host) -> Done {
        let mut best = self.come_to_rest()?;
        let mut stretch = FIRST * self.size();
        let least = LEAST * self.size();
        let (mut way, mut left) = (0.0, most.unwrap_or(STRETCHES));
        while left > 0.5 && stretch > least {
            if host.interrupted() {
                return Err(EvolverError::Interrupted);
            }
            left -= 1.0;
            let Some(Current { problem, state, values, .. }) = &self.problem else { return Ok(()) };
            let (old, before) = (state.clone(), values.clone());
            let Some(carrier) = problem.carrier(state, &self.multipliers)? else {
                self.say(host, "Nothing lets the surface slide.\n");
                break;
            };
            let multipliers = self.multipliers.clone();
            let (moved, after) = problem.stepped(&old, &carrier.velocity, stretch)?;
            let sound = after.energy.is_finite() && problem.turned_over(&old.places, &moved.places) == 0;
            let rested = if sound {
                self.accept(moved, after, multipliers.clone())?;
                self.come_to_rest().ok().filter(|values| values.energy < best.energy)
            } else {
                None
            };
            match rested {
                Some(values) => {
                    best = values;
                    way += stretch;
                }
                None => {
                    self.accept(old, before, multipliers)?;
                    stretch *= 0.25;
                }
            }
        }
        self.say(host, &format!("Slid by {}.\n", significant(way, 6)));
        self.report_energy(host)
    }

    /// Newton steps until the energy stays; none that turns facets over.
    fn come_to_rest(&mut self) -> Result<Values, EvolverError> {
        for _ in 0..STEPS_TO_REST {
            let (newton, values, old) = self.newton()?;
            let Some(current) = &self.problem else { break };
            let step = newton.step(&current.problem, &values)?;
            let (moved, after) = current.problem.stepped(&old, &step.velocity, 1.0)?;
            if !after.energy.is_finite() || current.problem.turned_over(&old.places, &moved.places) > 0 {
                return Err(EvolverError::Numerical("the films do not come to rest".to_owned()));
            }
            let change = (after.energy - values.energy).abs();
            let multipliers = super::seek::sum(&self.multipliers, &step.multipliers);
            self.accept(moved, after, multipliers)?;
            if change <= REST * values.energy.abs() {
                break;
            }
        }
        self.values()
    }

    /// The root mean square distance of the vertices from their mean.
    fn size(&self) -> f64 {
        let places = || self.surface.vertices.iter().map(|vertex| vertex.position);
        #[expect(clippy::cast_precision_loss, reason = "a count of vertices")]
        let count = self.surface.vertices.len().max(1) as f64;
        let mean = places().sum::<glam::DVec3>() / count;
        (places().map(|place| place.distance_squared(mean)).sum::<f64>() / count).sqrt()
    }
}
