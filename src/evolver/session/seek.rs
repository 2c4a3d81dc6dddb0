//! Commands that use second derivatives: Newton steps, guarded so that none leaves a destroyed surface, and eigenvalues.

use super::{Host, Session, format::significant, motion::Done};
use crate::{
    evolver::{
        error::EvolverError,
        language::formula::is_zero,
        physics::{FunctionalId, Values, assemble::Start, carry::Velocity, freedom::State, newton::Newton},
    },
    index::{Id, IndexVec},
};
use std::fmt::Write as _;

impl Session {
    /// The matrix of a Newton step here, which leaves out the motions in `still`.
    pub(super) fn newton(&mut self, still: &[Velocity]) -> Result<(Newton, Values, State), EvolverError> {
        self.current()?;
        if self.needs_quantities() {
            self.convert_to_quantities();
        }
        let around = self.neighbours();
        let Some(current) = &mut self.problem else {
            return Err(EvolverError::Surface("the surface has no terms".to_owned()));
        };
        if self.multipliers.iter().all(|m| is_zero(*m)) {
            self.multipliers = current.problem.estimated_multipliers(&current.state)?;
        }
        let start = Start {
            problem: &current.problem,
            surface: &self.surface,
            neighbours: &around,
            state: &current.state,
            multipliers: &self.multipliers,
            normal: self.normal,
            still,
        };
        let newton = Newton::new(&start, &mut self.pattern)?;
        Ok((newton, current.values.clone(), current.state.clone()))
    }

    /// `hessian`: a full Newton step, undone where it would destroy the surface.
    pub(super) fn hessian(&mut self, host: &mut dyn Host) -> Done {
        let (newton, values, old) = self.newton(&[])?;
        let residual = newton.residual();
        let Some(current) = &mut self.problem else { return Ok(()) };
        let step = newton.step(&current.problem, &values)?;
        if step.unstable > 0 {
            let text = format!("Hessian not positive definite: {} direction(s) go down.\n", step.unstable);
            if !self.quiet {
                host.print(&text);
            }
        }
        let (moved, after) = current.problem.stepped(&old, &step.velocity, 1.0)?;
        let multipliers = sum(&self.multipliers, &step.multipliers);
        if let Some(reason) = self.refused(&old, &moved, &values, &after, residual, &multipliers)? {
            self.say(host, &format!("The step is undone: {reason}. Use hessian_seek or g steps first.\n"));
            return Ok(());
        }
        self.accept(moved, after, multipliers)?;
        self.report_energy(host)
    }

    /// Why a Newton step must not be taken.
    fn refused(
        &mut self,
        old: &State,
        moved: &State,
        before: &Values,
        after: &Values,
        residual: f64,
        multipliers: &IndexVec<FunctionalId, f64>,
    ) -> Result<Option<String>, EvolverError> {
        if !after.energy.is_finite() || moved.places.iter().any(|p| !p.is_finite()) {
            return Ok(Some("it gives no finite energy".to_owned()));
        }
        let Some(current) = &self.problem else { return Ok(None) };
        let folded = current.problem.turned_over(&old.places, &moved.places);
        if folded > 0 {
            return Ok(Some(format!("it would turn {folded} facet(s) over")));
        }
        // The energy less what the change of the held volumes costs.
        let work: f64 = current
            .problem
            .functionals()
            .enumerated()
            .filter(|(_, f)| f.target.is_some())
            .map(|(id, _)| multipliers[id] * (after.functionals[id] - before.functionals[id]))
            .sum();
        let rise = after.energy - before.energy - work;
        if rise <= 1e-10 * before.energy.abs() {
            return Ok(None);
        }
        // On the way to a saddle the energy may rise, but the forces must fall.
        let around = self.neighbours();
        let Some(current) = &self.problem else { return Ok(None) };
        let start = Start {
            problem: &current.problem,
            surface: &self.surface,
            neighbours: &around,
            state: moved,
            multipliers,
            normal: self.normal,
            still: &[],
        };
        let there = Newton::new(&start, &mut self.pattern)?;
        if there.residual() < residual {
            return Ok(None);
        }
        Ok(Some(format!("it would raise the energy by {rise:.3e} and the forces")))
    }

    pub(super) fn accept(
        &mut self,
        state: State,
        values: Values,
        multipliers: IndexVec<FunctionalId, f64>,
    ) -> Done {
        if let Some(current) = &mut self.problem {
            (current.state, current.values) = (state, values);
        }
        self.multipliers = multipliers;
        self.descent.restart();
        self.finish_motion()
    }

    pub(super) fn report_energy(&mut self, host: &mut dyn Host) -> Done {
        let values = self.values()?;
        let label = if self.has_films() { "area" } else { "length" };
        self.say(
            host,
            &format!(
                "  1. {label}: {:>17} energy: {:>17}\n",
                significant(values.area, 15),
                significant(values.energy, 15)
            ),
        );
        Ok(())
    }

    /// `hessian_seek`: the best place along the Newton direction.
    pub(super) fn hessian_seek(&mut self, most: f64, host: &mut dyn Host) -> Done {
        let (newton, values, old) = self.newton(&[])?;
        let Some(current) = &self.problem else { return Ok(()) };
        let step = newton.step(&current.problem, &values)?;
        let (_, base) = current.problem.stepped(&old, &step.velocity, 0.0)?;
        let energy = |scale: f64| -> Result<f64, EvolverError> {
            let energy = current.problem.stepped(&old, &step.velocity, scale)?.1.energy;
            Ok(if energy.is_finite() { energy } else { f64::MAX })
        };
        let best = seek(&energy, base.energy, most)?;
        let (moved, after) = current.problem.stepped(&old, &step.velocity, best)?;
        let folded = current.problem.turned_over(&old.places, &moved.places);
        let taken = best.abs() > 0.0 && folded == 0 && after.energy.is_finite();
        let (state, after) =
            if taken { (moved, after) } else { current.problem.stepped(&old, &step.velocity, 0.0)? };
        let multipliers =
            if taken { sum(&self.multipliers, &step.multipliers) } else { self.multipliers.clone() };
        self.accept(state, after, multipliers)?;
        self.say(host, &format!("  1. stepsize: {}\n", significant(if taken { best } else { 0.0 }, 6)));
        self.report_energy(host)
    }

    /// `saddle`: down the most unstable direction.
    pub(super) fn saddle(&mut self, most: f64, host: &mut dyn Host) -> Done {
        let (newton, _, old) = self.newton(&[])?;
        let (values, direction) = newton.eigenvalues(lowest_guess(&newton)?, 1)?;
        let lowest = values.first().copied().unwrap_or(0.0);
        self.eigenvalue = lowest;
        if lowest >= 0.0 {
            self.say(
                host,
                &format!("Lowest eigenvalue {}: no direction goes down.\n", significant(lowest, 8)),
            );
            return Ok(());
        }
        let Some(current) = &self.problem else { return Ok(()) };
        let (_, base) = current.problem.stepped(&old, &direction, 0.0)?;
        let energy = |scale: f64| -> Result<f64, EvolverError> {
            let energy = current.problem.stepped(&old, &direction, scale)?.1.energy;
            Ok(if energy.is_finite() { energy } else { f64::MAX })
        };
        let best = seek(&energy, base.energy, most)?;
        let (moved, after) = current.problem.stepped(&old, &direction, best)?;
        if current.problem.turned_over(&old.places, &moved.places) > 0 {
            self.say(host, "The step is undone: it would turn facets over.\n");
            return Ok(());
        }
        let multipliers = current.problem.estimated_multipliers(&moved)?;
        self.accept(moved, after, multipliers)?;
        self.say(
            host,
            &format!("Lowest eigenvalue {}, stepsize {}\n", significant(lowest, 8), significant(best, 6)),
        );
        self.report_energy(host)
    }

    pub(super) fn eigenprobe(&mut self, value: f64, host: &mut dyn Host) -> Done {
        let (newton, ..) = self.newton(&[])?;
        let below = newton.below(value)?;
        host.print(&format!("Eigencounts below {}: {below}\n", significant(value, 8)));
        Ok(())
    }

    pub(super) fn ritz(&mut self, shift: f64, count: usize, host: &mut dyn Host) -> Done {
        let (newton, ..) = self.newton(&[])?;
        let (values, _) = newton.eigenvalues(shift, count)?;
        let mut text = String::new();
        for (at, value) in values.iter().enumerate() {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{:4}. {}", at + 1, significant(*value, 12));
        }
        self.eigenvalue = values.last().copied().unwrap_or(f64::NAN);
        host.print(&text);
        Ok(())
    }
}

pub(super) fn sum<I: Id>(a: &IndexVec<I, f64>, b: &IndexVec<I, f64>) -> IndexVec<I, f64> {
    a.iter().zip(b.iter()).map(|(a, b)| a + b).collect()
}

/// A value below all eigenvalues that matter: probing downwards until none lies below.
fn lowest_guess(newton: &Newton) -> Result<f64, EvolverError> {
    let mut value = -1e-3;
    for _ in 0..40 {
        if newton.below(value)? == 0 {
            return Ok(value);
        }
        value *= 2.0;
    }
    Ok(value)
}

/// The scale of least energy along a direction, either way, as Surface Evolver seeks it: a step that lowers the energy,
/// doubled as long as that helps, then a parabola. 0 if nothing lowers it.
fn seek(
    energy: &dyn Fn(f64) -> Result<f64, EvolverError>,
    base: f64,
    most: f64,
) -> Result<f64, EvolverError> {
    let mut step = most / 100.0;
    let mut sign = 0.0;
    while step > 1e-15 {
        let (up, down) = (energy(step)?, energy(-step)?);
        if up < base || down < base {
            sign = if up > down { -1.0 } else { 1.0 };
            break;
        }
        step /= 10.0;
    }
    if is_zero(sign) {
        return Ok(0.0);
    }
    let (mut s0, mut e0, mut s1, mut e1) = (0.0, base, step, energy(sign * step)?);
    let (mut s2, mut e2) = (s1, e1);
    while step < most {
        step = (2.0 * step).min(most);
        (s2, e2) = (step, energy(sign * step)?);
        if e2 > e1 {
            break;
        }
        (s0, e0, s1, e1) = (s1, e1, s2, e2);
    }
    if e2 <= e1 {
        return Ok(sign * s1);
    }
    let denominator = e0 * (s1 - s2) + e1 * (s2 - s0) + e2 * (s0 - s1);
    let best = ((e0 - e2) * s1 * s1 + (e1 - e0) * s2 * s2 + (e2 - e1) * s0 * s0) / 2.0 / denominator;
    let best = if best.is_finite() { best.clamp(s0, s2) } else { s1 };
    Ok(sign * if energy(sign * best)? <= e1 { best } else { s1 })
}
