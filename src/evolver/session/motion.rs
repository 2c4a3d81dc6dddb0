//! Commands that move or refine the surface, and what they report.

use super::{Current, Host, Session, evaluate::Scope, format::significant};
use crate::evolver::{
    command::{Action, Numeric, Simple},
    datafile::Model,
    error::EvolverError,
    language::{
        expression::Expression,
        formula::{GRAVITY, is_zero},
    },
    source::Position,
    surface::{EdgeId, VertexId},
};
use std::fmt::Write as _;

/// Elements that a refinement may make: an element takes about a kilobyte, its Hessian as much again.
const MOST_ELEMENTS: usize = 4_000_000;

/// Steps of one `g` at most.
const MOST_STEPS: f64 = 1e7;

/// Steps of `g` between two looks at what chords would gain.
const STEPS_ON_CHORDS: usize = 10;

pub(super) type Done = Result<(), EvolverError>;

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
                let grown = 4 * self.surface.facets.len().max(self.surface.edges.len() / 2);
                if grown > MOST_ELEMENTS {
                    let message =
                        format!("refining would make {grown} elements; at most {MOST_ELEMENTS} are kept");
                    return scope.fail(position, message);
                }
                let energy = self.values()?.energy;
                self.levels.push(energy);
                self.surface.refine();
                self.changed();
                self.current()?;
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
            Simple::Extrapolate => self.extrapolate(host)?,
            Simple::Variables => self.list_variables(host),
            Simple::NamedQuantities => {
                let mut text = "Quantities:\n".to_owned();
                for (name, value, _) in self.quantities()? {
                    // Writing to a string does not fail.
                    let _ = writeln!(text, "{name:>32} {:>20}", significant(value, 15));
                }
                host.print(&text);
            }
            Simple::PopNonminimal => return self.pop(true, scope, host),
            Simple::PopEdges => return self.pop(false, scope, host),
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
            Simple::Quantities => self.convert_to_quantities(),
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

    pub(super) fn say(&self, host: &mut dyn Host, text: &str) {
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
            (Numeric::Slide, value) => self.slide(value, host),
            (Numeric::FixScale, value) => {
                self.descent.fixed = value.is_some_and(|v| !is_zero(v));
                if let Some(value) = value.filter(|v| !is_zero(*v)) {
                    self.descent.scale = value;
                    self.say(host, &format!("Scale fixed at {}.\n", significant(value, 6)));
                } else {
                    self.say(host, "Scale optimizing.\n");
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
        let (mut slots, mut steps_done) = (None, 0_usize);
        while left > 0.5 {
            let allowed = if host.interrupted() { Err(EvolverError::Interrupted) } else { self.spend() };
            if let Err(stop) = allowed {
                // What the steps so far have come to is kept.
                self.finish_motion()?;
                return Err(stop);
            }
            if steps_done % STEPS_ON_CHORDS == 0 {
                self.look_at_contents()?;
                slots = None;
            }
            steps_done += 1;
            self.current()?;
            let Some(current) = &mut self.problem else { return Ok(()) };
            let old = current.state.clone();
            let pattern = slots.take().unwrap_or_else(|| current.problem.slots());
            let (done, pattern) = current.problem.descend(&mut current.state, &mut self.descent, pattern)?;
            slots = Some(pattern);
            self.multipliers = done.multipliers.clone();
            let folded = current.problem.turned_over(&old.places, &current.state.places);
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
    pub(super) fn finish_motion(&mut self) -> Done {
        if let Some(current) = &self.problem {
            current.state.store(&mut self.surface);
        }
        self.look_at_contents()
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
}

const HELP: &str = "\
g N        N steps down the energy          r  refine        u  equiangulate    V  average vertices
hessian    Newton step                      hessian_seek     saddle             ritz(value, count)
slide      along the walls, as long as that lowers the energy
v          volumes and pressures            c  counts        t l w K  threshold
e          energies by refinement           A  variables     Q  quantities
print E    printf \"…\", a, b                 list vertices where …              set edge tension 2 where …
M 1, M 2   linear, quadratic                dump \"file.fe\"   quit
All of it: the table of supported commands in the documentation.
";
