//! Commands that move or refine the surface, and what they report.

use super::{Current, Host, Session, evaluate::Scope, format::significant};
use crate::{
    evolver::{
        command::{Action, Numeric, Simple},
        datafile::{Model, Representation},
        error::EvolverError,
        language::{
            expression::Expression,
            formula::{GRAVITY, is_zero},
        },
        physics::{Values, freedom::State, newton::Newton},
        source::Position,
        surface::{EdgeId, FacetId, VertexId},
    },
    index::{Id, IndexVec},
};
use std::fmt::Write as _;

/// Steps of one `g` at most.
const MOST_STEPS: f64 = 1e7;

type Done = Result<(), EvolverError>;

impl Session {
    pub(super) fn motion_command(
        &mut self,
        action: &Action,
        position: Position,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Done {
        match action {
            Action::Simple(simple) => self.simple(simple, position, scope, host),
            Action::Numeric(numeric, value) => self.numeric(*numeric, value.as_ref(), position, scope, host),
            Action::Ritz(value, count) => {
                let shift = self.evaluate(value, scope)?;
                let count = super::evaluate::whole(self.evaluate(count, scope)?).unwrap_or(1);
                self.ritz(shift, count, host)
            }
            _ => Ok(()),
        }
    }

    fn simple(
        &mut self,
        simple: &Simple,
        position: Position,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Done {
        match simple {
            Simple::Refine => {
                self.surface.refine();
                self.changed();
                self.counts(host);
            }
            Simple::Equiangulate => {
                if !self.has_films() {
                    return scope.fail(position, "strings have no triangles to make equal");
                }
                let count = self.surface.equiangulate();
                self.changed();
                self.say(host, &format!("Edges swapped in equiangulation: {count}\n"));
            }
            Simple::Average => {
                self.average(None)?;
                self.say(host, "Vertex averaging done.\n");
            }
            Simple::Volumes => self.volumes(host)?,
            Simple::Counts => self.counts(host),
            Simple::PopEdges | Simple::PopNonminimal => return self.pop(host),
            Simple::ConjugateGradient(on) => {
                self.descent.conjugate = on.unwrap_or(!self.descent.conjugate);
                self.descent.restart();
                let state = if self.descent.conjugate { "ON" } else { "OFF" };
                self.say(host, &format!("Conjugate gradient now {state}.\n"));
            }
            Simple::Hessian => self.hessian(host)?,
            Simple::Linear | Simple::Quadratic => {
                let model = if *simple == Simple::Linear { Model::Linear } else { Model::Quadratic };
                self.set_model(model)?;
            }
            Simple::Recalculate => {
                self.problem = None;
                self.current()?;
            }
            Simple::Check | Simple::Information => {
                let values = self.values()?;
                let energy = significant(values.energy, 15);
                host.print(&format!("Total energy: {energy}  area: {}\n", significant(values.area, 15)));
            }
            Simple::Help => host.print(HELP),
            _ => {}
        }
        Ok(())
    }

    pub(super) fn toggle(&mut self, name: &str, on: Option<bool>) {
        let new = |old: bool| on.unwrap_or(!old);
        match name {
            "quiet" => self.quiet = new(self.quiet),
            "gravity" => {
                self.gravity = new(self.gravity);
                self.problem = None;
            }
            "conj_grad" => self.descent.conjugate = new(self.descent.conjugate),
            "hessian_normal" => self.normal = new(self.normal),
            _ => {}
        }
    }

    /// `V`: averages vertices, all or some.
    pub(super) fn average(&mut self, only: Option<&[VertexId]>) -> Done {
        self.current()?;
        let Some(Current { problem, state, .. }) = self.problem.take() else { return Ok(()) };
        self.surface.average(only, &|vertex, step| problem.projected(&state, vertex, step));
        self.changed();
        self.current()?;
        Ok(())
    }

    fn say(&self, host: &mut dyn Host, text: &str) {
        if !self.quiet {
            host.print(text);
        }
    }

    pub(super) fn set_model(&mut self, model: Model) -> Done {
        self.surface.set_model(model);
        self.changed();
        self.current()?;
        Ok(())
    }

    fn numeric(
        &mut self,
        numeric: Numeric,
        value: Option<&Expression>,
        position: Position,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Done {
        let value = value.map(|value| self.evaluate(value, scope)).transpose()?;
        let needed = |what: &str| scope.fail(position, format!("{what} needs a number here"));
        match (numeric, value) {
            (Numeric::Iterate, value) => self.iterate(value.unwrap_or(1.0).min(MOST_STEPS), host),
            (Numeric::HessianSeek, value) => self.hessian_seek(value.unwrap_or(10.0), host),
            (Numeric::Saddle, value) => self.saddle(value.unwrap_or(10.0), host),
            (Numeric::Eigenprobe, value) => self.eigenprobe(value.unwrap_or(0.0), host),
            (Numeric::FixScale, value) => {
                self.descent.fixed = value.is_some_and(|v| !is_zero(v));
                if let Some(value) = value.filter(|v| !is_zero(*v)) {
                    self.descent.scale = value;
                }
                Ok(())
            }
            (Numeric::Gravity, Some(value)) => {
                self.variables.set(GRAVITY, value);
                self.gravity = !is_zero(value);
                self.problem = None;
                Ok(())
            }
            (Numeric::Gravity, None) => {
                self.gravity = !self.gravity;
                self.problem = None;
                Ok(())
            }
            (Numeric::Model, Some(value)) => {
                let model = match value {
                    v if (v - 1.0).abs() < 0.5 => Model::Linear,
                    v if (v - 2.0).abs() < 0.5 => Model::Quadratic,
                    _ => return scope.fail(position, "M 1 is linear, M 2 quadratic; there are no others"),
                };
                self.set_model(model)
            }
            (Numeric::RemoveShortEdges, Some(value)) => self.remove_short(value, host),
            (Numeric::DivideLongEdges, Some(value)) => {
                let long: Vec<EdgeId> =
                    self.surface.edges.ids().filter(|&id| self.surface.edge_length(id) > value).collect();
                self.refine_edges(&long);
                self.changed();
                self.say(host, &format!("Edges divided: {}\n", long.len()));
                Ok(())
            }
            (Numeric::RemoveSmallFacets, Some(value)) => self.remove_small(value, host),
            (Numeric::DivideSkinnyFacets, Some(value)) => self.divide_skinny(value, host),
            (Numeric::Notch, Some(_)) => {
                scope.fail(position, "not supported: n; refine edges where dihedral > a")
            }
            (Numeric::Model, None) => needed("M"),
            (_, None) => needed("this command"),
        }
    }

    /// `g`: steps down the gradient.
    fn iterate(&mut self, steps: f64, host: &mut dyn Host) -> Done {
        let label = if self.has_films() { "area" } else { "length" };
        let mut left = steps;
        let mut slots = None;
        while left > 0.5 {
            if host.interrupted() {
                return Err(EvolverError::Interrupted);
            }
            self.current()?;
            let Some(current) = &mut self.problem else { return Ok(()) };
            let old = current.state.clone();
            let pattern = slots.take().unwrap_or_else(|| current.problem.slots());
            let (done, pattern) = current.problem.descend(&mut current.state, &mut self.descent, pattern)?;
            slots = Some(pattern);
            self.multipliers = done.multipliers.clone();
            let folded = folded_facets(&self.surface, &old, &current.state);
            if folded > 0 && done.values.energy > done.base {
                current.state = old;
                self.say(host, "The step would turn facets over and raise the energy: undone.\n");
                return Ok(());
            }
            current.values = done.values.clone();
            let (area, energy) = (done.values.area, done.values.energy);
            if !self.quiet {
                host.print(&format!(
                    "{left:3}. {label}: {:>17} energy: {:>17}  scale: {}\n",
                    significant(area, 15),
                    significant(energy, 15),
                    significant(done.scale, 6)
                ));
            }
            left -= 1.0;
            if done.stuck && !self.descent.conjugate {
                self.descent.scale = 1e-3 * self.descent.limit;
            }
            if done.stuck && self.descent.conjugate {
                self.descent.restart();
            }
        }
        self.finish_motion()?;
        Ok(())
    }

    /// Writes the places back into the surface and sees that volumes are what they seem.
    fn finish_motion(&mut self) -> Done {
        if let Some(current) = &self.problem {
            current.state.store(&mut self.surface);
        }
        self.compare_volumes()
    }

    /// The matrix of a Newton step here.
    fn newton(&mut self) -> Result<(Newton, Values, State), EvolverError> {
        self.current()?;
        let around = self.neighbours();
        let Some(current) = &mut self.problem else {
            return Err(EvolverError::Surface("the surface has no terms".to_owned()));
        };
        if self.multipliers.iter().all(|m| is_zero(*m)) {
            self.multipliers = current.problem.estimated_multipliers(&current.state)?;
        }
        let newton = Newton::new(
            &current.problem,
            &self.surface,
            &around,
            &current.state,
            &self.multipliers,
            self.normal,
        )?;
        Ok((newton, current.values.clone(), current.state.clone()))
    }

    /// `hessian`: a full Newton step, undone where it would destroy the surface.
    fn hessian(&mut self, host: &mut dyn Host) -> Done {
        let (newton, values, old) = self.newton()?;
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
        multipliers: &IndexVec<crate::evolver::physics::FunctionalId, f64>,
    ) -> Result<Option<String>, EvolverError> {
        if !after.energy.is_finite() || moved.places.iter().any(|p| !p.is_finite()) {
            return Ok(Some("it gives no finite energy".to_owned()));
        }
        let folded = folded_facets(&self.surface, old, moved);
        if folded > 0 {
            return Ok(Some(format!("it would turn {folded} facet(s) over")));
        }
        // The energy less what the change of the held volumes costs.
        let Some(current) = &self.problem else { return Ok(None) };
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
        let there = Newton::new(&current.problem, &self.surface, &around, moved, multipliers, self.normal)?;
        if there.residual() < residual {
            return Ok(None);
        }
        Ok(Some(format!("it would raise the energy by {rise:.3e} and the forces")))
    }

    fn accept(
        &mut self,
        state: State,
        values: Values,
        multipliers: IndexVec<crate::evolver::physics::FunctionalId, f64>,
    ) -> Done {
        if let Some(current) = &mut self.problem {
            (current.state, current.values) = (state, values);
        }
        self.multipliers = multipliers;
        self.descent.restart();
        self.finish_motion()
    }

    fn report_energy(&mut self, host: &mut dyn Host) -> Done {
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
    fn hessian_seek(&mut self, most: f64, host: &mut dyn Host) -> Done {
        let (newton, values, old) = self.newton()?;
        let Some(current) = &self.problem else { return Ok(()) };
        let step = newton.step(&current.problem, &values)?;
        let (_, base) = current.problem.stepped(&old, &step.velocity, 0.0)?;
        let energy = |scale: f64| -> Result<f64, EvolverError> {
            let energy = current.problem.stepped(&old, &step.velocity, scale)?.1.energy;
            Ok(if energy.is_finite() { energy } else { f64::MAX })
        };
        let best = seek(&energy, base.energy, most)?;
        let (moved, after) = current.problem.stepped(&old, &step.velocity, best)?;
        let folded = folded_facets(&self.surface, &old, &moved);
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
    fn saddle(&mut self, most: f64, host: &mut dyn Host) -> Done {
        let (newton, _, old) = self.newton()?;
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
        if folded_facets(&self.surface, &old, &moved) > 0 {
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

    fn eigenprobe(&mut self, value: f64, host: &mut dyn Host) -> Done {
        let (newton, ..) = self.newton()?;
        let below = newton.below(value)?;
        host.print(&format!("Eigencounts below {}: {below}\n", significant(value, 8)));
        Ok(())
    }

    fn ritz(&mut self, shift: f64, count: usize, host: &mut dyn Host) -> Done {
        let (newton, ..) = self.newton()?;
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

    /// `v`: the bodies, with their volumes both ways.
    fn volumes(&mut self, host: &mut dyn Host) -> Done {
        let mut text = format!(
            "{:>6} {:>20} {:>20} {:>20} {:>20}\n",
            "Body", "target volume", "actual volume", "closed volume", "pressure"
        );
        for body in self.bodies()? {
            let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| significant(value, 15));
            let pressure = if body.target.is_some() { Some(body.pressure) } else { None };
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "{:>6} {:>20} {:>20} {:>20} {:>20}",
                body.id,
                number(body.target),
                significant(body.volume, 15),
                number(body.closed),
                number(pressure)
            );
        }
        for (name, value, _) in self.quantities()? {
            let _ = writeln!(text, "{name:>6} {:>41}", significant(value, 15));
        }
        host.print(&text);
        Ok(())
    }

    fn counts(&self, host: &mut dyn Host) {
        let surface = &self.surface;
        self.say(
            host,
            &format!(
                "Vertices: {}  Edges: {}  Facets: {}  Bodies: {}\n",
                surface.vertices.len(),
                surface.edges.len(),
                surface.facets.len(),
                surface.bodies.len()
            ),
        );
    }

    fn remove_short(&mut self, value: f64, host: &mut dyn Host) -> Done {
        let mut count = 0;
        let mut tried = 0;
        while let Some(edge) = self
            .surface
            .edges
            .ids()
            .filter(|&id| self.surface.edge_length(id) < value && !self.surface.edges[id].common.fixed)
            .nth(tried)
        {
            self.spend()?;
            if self.surface.collapse(edge) {
                count += 1;
            } else {
                tried += 1;
            }
        }
        self.changed();
        self.say(host, &format!("Edges deleted: {count}\n"));
        Ok(())
    }

    fn remove_small(&mut self, value: f64, host: &mut dyn Host) -> Done {
        let mut count = 0;
        let mut tried = 0;
        while let Some(facet) = self
            .surface
            .facets
            .ids()
            .filter(|&id| self.has_films() && self.surface.facet_area(id) < value)
            .nth(tried)
        {
            self.spend()?;
            let shortest = self.surface.facets[facet]
                .edges
                .iter()
                .map(|d| d.edge)
                .min_by(|a, b| self.surface.edge_length(*a).total_cmp(&self.surface.edge_length(*b)));
            if shortest.is_some_and(|edge| self.surface.collapse(edge)) {
                count += 1;
            } else {
                tried += 1;
            }
        }
        self.changed();
        self.say(host, &format!("Facets deleted: {count}\n"));
        Ok(())
    }

    /// `K`: divides the longest edge of facets with an angle below `value`.
    fn divide_skinny(&mut self, value: f64, host: &mut dyn Host) -> Done {
        if self.surface.representation == Representation::String {
            return Ok(());
        }
        let skinny = |id: FacetId| {
            let mut sides: Vec<(f64, EdgeId)> = self.surface.facets[id]
                .edges
                .iter()
                .map(|d| (self.surface.edge_length(d.edge), d.edge))
                .collect();
            sides.sort_by(|a, b| a.0.total_cmp(&b.0));
            let [(a, _), (b, _), (c, longest)] = sides[..] else { return None };
            let cosine = (b * b + c * c - a * a) / (2.0 * b * c);
            (cosine.clamp(-1.0, 1.0).acos() < value).then_some(longest)
        };
        let mut long: Vec<EdgeId> = self.surface.facets.ids().filter_map(skinny).collect();
        long.sort_unstable();
        long.dedup();
        self.refine_edges(&long);
        self.changed();
        self.say(host, &format!("Edges divided: {}\n", long.len()));
        Ok(())
    }

    /// `o`, `O`: nothing to do where at most three films, or strings, meet; else it is not supported.
    fn pop(&mut self, host: &mut dyn Host) -> Done {
        let around = self.surface.neighbours();
        let over = if self.has_films() {
            self.surface.edges.ids().filter(|&edge| around.facets[edge].len() > 3).count()
        } else {
            self.surface.vertices.ids().filter(|&vertex| around.edges[vertex].len() > 3).count()
        };
        if over > 0 {
            let message = format!(
                "not supported: popping ({over} places where more than three films or strings meet). \
                 T1s of whole foams: combwright foam"
            );
            return Err(EvolverError::Surface(message));
        }
        self.say(host, "Popped: 0\n");
        Ok(())
    }
}

fn sum<I: Id>(a: &IndexVec<I, f64>, b: &IndexVec<I, f64>) -> IndexVec<I, f64> {
    a.iter().zip(b.iter()).map(|(a, b)| a + b).collect()
}

/// How many facets of films turned over by more than a right angle between two states.
fn folded_facets(surface: &crate::evolver::surface::Surface, old: &State, new: &State) -> usize {
    if surface.representation == Representation::String {
        return 0;
    }
    let normal = |state: &State, id: FacetId| {
        let corners = surface.corners(id);
        let at = |i: usize| state.places[corners[i].0] + surface.translation(corners[i].1);
        (at(1) - at(0)).cross(at(2) - at(0))
    };
    surface
        .facets
        .ids()
        .filter(|&id| surface.facets[id].tension.abs() > 0.0)
        .filter(|&id| normal(old, id).dot(normal(new, id)) < 0.0)
        .count()
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

const HELP: &str = "\
g N        N steps down the energy          r  refine        u  equiangulate    V  average vertices
hessian    Newton step                      hessian_seek     saddle             ritz(value, count)
v          volumes and pressures            e  counts        t l w K  threshold
print E    printf \"…\", a, b                 list vertices where …              set edge tension 2 where …
M 1, M 2   linear, quadratic                dump \"file.fe\"   quit
All of it: the table of supported commands in the documentation.
";
