//! A surface with its commands: what `run` does.
//!
//! | part | file |
//! |---|---|
//! | the state; energies kept up to date | this page |
//! | statements: loops, assignments, procedures | `execute.rs` |
//! | procedures, functions, local variables | `routines.rs` |
//! | assignments; arrays | `assign.rs`, `arrays.rs` |
//! | values of expressions | `evaluate.rs`, `attributes.rs` |
//! | contents on walls; volumes held against those of the closed bodies | `contents.rs` |
//! | moving the surface: `g`, `r`, `V` and their kin | `motion.rs` |
//! | Newton steps and eigenvalues; sliding along walls | `seek.rs`, `slide.rs` |
//! | short edges, small and narrow facets | `mend.rs` |
//! | T1s and pops | `pop.rs` |
//! | changing and listing elements | `elements.rs` |
//! | energies by refinement, variables, procedures | `information.rs` |
//! | text with formats | `format.rs` |
//! | datafiles | `dump.rs` |

mod arrays;
mod assign;
mod attributes;
mod contents;
mod dump;
mod elements;
mod evaluate;
mod execute;
mod format;
mod information;
mod mend;
mod motion;
mod pop;
mod routines;
mod seek;
mod slide;

use contents::Contents;
pub use execute::Flow;
pub use format::significant;

use super::{
    datafile::{Datafile, Model, Purpose, Representation},
    error::EvolverError,
    language::formula::{GRAVITY, Variables},
    open::Document,
    physics::{
        FunctionalId, Problem, Values,
        closed::closed_volumes,
        descend::Descent,
        freedom::State,
        terms::{Conditions, QuantityState},
    },
    surface::{BodyId, Neighbours, Surface},
};
use crate::{
    foam::solve::symmetric::SymmetricPattern,
    index::{Id, IndexVec},
};
use glam::DVec3;
use std::{collections::BTreeMap, sync::Arc};

/// What a session asks of the program around it.
pub trait Host {
    /// Shows text.
    fn print(&mut self, text: &str);
    /// Writes a file, whole or at its end.
    ///
    /// # Errors
    /// Why it cannot be written.
    fn write(&mut self, name: &str, text: &str, append: bool) -> Result<(), std::io::Error>;
    /// Whether to stop.
    fn interrupted(&self) -> bool;
}

/// A surface, its variables and procedures.
pub struct Session {
    pub(super) data: Datafile,
    pub(super) surface: Surface,
    pub(super) variables: Variables,
    texts: BTreeMap<Arc<str>, Arc<str>>,
    arrays: BTreeMap<Arc<str>, arrays::Array>,
    routines: BTreeMap<Arc<str>, routines::Known>,
    /// What the function that runs has returned.
    returned: Option<f64>,
    /// What functions have printed and written while an expression was evaluated.
    told: routines::Told,
    quantities: Vec<QuantityState>,
    multipliers: IndexVec<FunctionalId, f64>,
    gravity: bool,
    gap: f64,
    descent: Descent,
    normal: bool,
    /// Whether volumes and energies count as quantities, as they do in Surface Evolver from the first use that needs it.
    by_quantities: bool,
    /// Along what contents are integrated.
    contents: Contents,
    /// The ends of the edges of contact lines when their slivers were last looked at, and when volumes were last compared.
    looked_at: Vec<[DVec3; 2]>,
    compared: Vec<[DVec3; 2]>,
    /// Whether edges that keep their chords were spoken of.
    told_kept_chords: bool,
    quiet: bool,
    eigenvalue: f64,
    /// The energies before each refinement.
    levels: Vec<f64>,
    /// How many commands may still run.
    budget: u64,
    spent: u64,
    depth: usize,
    problem: Option<Current>,
    /// Who borders on whom, as long as that stays.
    around: Option<Arc<Neighbours>>,
    /// The order in which the last Newton matrix was factored.
    pattern: Option<Arc<SymmetricPattern>>,
}

/// A problem that belongs to the present surface, with its values.
struct Current {
    problem: Problem,
    state: State,
    values: Values,
    /// The values of the variables that formulas use, as they were.
    inputs: Vec<f64>,
}

/// Commands that a session runs before it believes that a loop does not end.
pub const COMMAND_BUDGET: u64 = 10_000_000;

/// The volumes of a body by its integrals and by its closed surface.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyReport {
    /// The body's number.
    pub id: i64,
    /// The volume that it shall have.
    pub target: Option<f64>,
    /// The volume by the datafile's integrals.
    pub volume: f64,
    /// The volume of the body closed on its walls, where that is possible.
    pub closed: Option<f64>,
    /// The pressure.
    pub pressure: f64,
}

impl Session {
    /// A session with the surface of a datafile, its vertices brought onto their constraints.
    ///
    /// # Errors
    /// [`EvolverError`] if the surface makes no sense.
    pub fn new(document: Document) -> Result<Self, EvolverError> {
        let Document { data, surface, .. } = document;
        let quantities = data
            .quantities
            .iter()
            .map(|q| QuantityState { purpose: q.purpose, modulus: q.modulus })
            .collect();
        let mut descent = Descent::default();
        if let Some((scale, fixed)) = data.scale {
            (descent.scale, descent.fixed) = (scale, fixed);
        }
        if let Some(limit) = data.scale_limit {
            descent.limit = limit;
        }
        let functionals = surface.bodies.len() + data.quantities.len();
        let mut multipliers = IndexVec::from_elem(0.0, functionals);
        for (id, body) in surface.bodies.enumerated() {
            multipliers[FunctionalId::from_index(id.index())] = body.pressure;
        }
        let mut session = Self {
            variables: data.variables.clone(),
            gravity: data.gravity,
            gap: data.gap_constant,
            surface,
            texts: BTreeMap::new(),
            arrays: BTreeMap::new(),
            routines: BTreeMap::new(),
            returned: None,
            told: routines::Told::default(),
            quantities,
            multipliers,
            descent,
            normal: true,
            by_quantities: data.boundaries.iter().any(|b| b.energy.is_some() || b.content.is_some()),
            contents: Contents::Chords,
            looked_at: Vec::new(),
            compared: Vec::new(),
            told_kept_chords: false,
            quiet: false,
            eigenvalue: f64::NAN,
            levels: Vec::new(),
            budget: COMMAND_BUDGET,
            spent: 0,
            depth: 0,
            problem: None,
            around: None,
            pattern: None,
            data,
        };
        let name: Arc<str> = session.data.source.name.as_str().into();
        session.texts.insert("datafilename".into(), name);
        session.make_quadratic();
        session.compare_volumes()?;
        Ok(session)
    }

    /// Middles for a datafile that says `quadratic` but gives none.
    fn make_quadratic(&mut self) {
        let wanted = self.surface.model;
        if wanted == Model::Quadratic && self.surface.edges.iter().any(|edge| edge.middle.is_none()) {
            self.surface.model = Model::Linear;
            self.surface.set_model(wanted);
        }
    }

    /// Allows this many commands.
    pub fn set_budget(&mut self, commands: u64) {
        self.budget = commands;
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// The strength of gravity that acts.
    fn gravity(&self) -> f64 {
        if self.gravity { self.variables.get(GRAVITY).unwrap_or(0.0) } else { 0.0 }
    }

    /// The values of the variables that formulas use.
    fn inputs(&self) -> Vec<f64> {
        self.data.formula_inputs(&self.variables)
    }

    /// The problem of the present surface, made anew where something has changed.
    fn current(&mut self) -> Result<&mut Current, EvolverError> {
        let inputs = self.inputs();
        if self.problem.as_ref().is_some_and(|current| current.inputs != inputs) {
            self.problem = None;
        }
        if self.problem.is_none() {
            self.problem = Some(self.new_problem(inputs)?);
            self.leave_chords()?;
        }
        match &mut self.problem {
            Some(current) => Ok(current),
            None => Err(EvolverError::Surface("the surface has no terms".to_owned())),
        }
    }

    /// The problem of the present surface, its vertices brought onto their constraints.
    fn new_problem(&mut self, inputs: Vec<f64>) -> Result<Current, EvolverError> {
        let conditions = Conditions {
            variables: &self.variables,
            gravity: self.gravity(),
            gap: self.gap,
            quantities: &self.quantities,
            relative: self.by_quantities,
            on_walls: self.contents == Contents::OnWalls,
        };
        let mut problem = Problem::new(&self.data, &self.surface, &conditions)?;
        let mut state = State::new(&self.surface);
        problem.follow_boundaries(&self.surface, &mut state);
        if let Err(vertex) = problem.settle_all(&mut state, false) {
            let number = vertex.index() + 1;
            let message = format!("vertex {number} cannot be brought onto its constraints");
            return Err(EvolverError::Surface(message));
        }
        state.store(&mut self.surface);
        let mut values = problem.values(&state.places);
        if let Some(torus) = self.surface.torus_volume() {
            problem.take_off_tori(torus, &values);
            values = problem.values(&state.places);
        }
        Ok(Current { problem, state, values, inputs })
    }

    /// From now on volumes and energies count as quantities.
    fn convert_to_quantities(&mut self) {
        self.by_quantities = true;
        if let Some(current) = &mut self.problem {
            current.problem.relative = true;
        }
    }

    /// Whether Surface Evolver takes second derivatives of this surface only as those of quantities.
    fn needs_quantities(&self) -> bool {
        let surface = &self.surface;
        self.data.constraints.iter().any(|constraint| constraint.content.is_some())
            || (surface.periods.is_some() && surface.bodies.iter().any(|body| body.target.is_some()))
            || surface.bodies.iter().any(|body| body.prescribed)
            || surface.model == Model::Quadratic
            || surface.representation == Representation::String
            || self.gravity().abs() > 0.0
    }

    /// Who borders on whom.
    fn neighbours(&mut self) -> Arc<Neighbours> {
        let surface = &self.surface;
        self.around.get_or_insert_with(|| Arc::new(surface.neighbours())).clone()
    }

    /// The surface has changed otherwise than by moving.
    fn changed(&mut self) {
        self.problem = None;
        self.around = None;
        self.descent.restart();
    }

    /// Energy, area and functionals.
    ///
    /// # Errors
    /// [`EvolverError`] if the surface makes no sense.
    pub fn values(&mut self) -> Result<Values, EvolverError> {
        Ok(self.current()?.values.clone())
    }

    /// All bodies with both of their volumes.
    ///
    /// # Errors
    /// [`EvolverError`] if the surface makes no sense.
    pub fn bodies(&mut self) -> Result<Vec<BodyReport>, EvolverError> {
        self.compare_volumes()?;
        let Some(current) = &self.problem else { return Ok(Vec::new()) };
        let closed = closed_volumes(&current.problem, &self.surface, &current.state.places);
        Ok(self
            .surface
            .bodies
            .enumerated()
            .map(|(id, body)| BodyReport {
                id: body.id,
                target: body.target,
                volume: current.values.functionals[FunctionalId::from_index(id.index())],
                closed: closed[id],
                pressure: self.pressure(id),
            })
            .collect())
    }

    fn pressure(&self, body: BodyId) -> f64 {
        let data = &self.surface.bodies[body];
        if data.prescribed { data.pressure } else { self.multipliers[FunctionalId::from_index(body.index())] }
    }

    /// All quantities with their values.
    ///
    /// # Errors
    /// [`EvolverError`] if the surface makes no sense.
    pub fn quantities(&mut self) -> Result<Vec<(String, f64, Purpose)>, EvolverError> {
        let first = self.surface.bodies.len();
        let values = self.values()?;
        Ok(self
            .data
            .quantities
            .iter()
            .zip(&self.quantities)
            .enumerate()
            .map(|(at, (quantity, state))| {
                (
                    quantity.name.to_string(),
                    values.functionals[FunctionalId::from_index(first + at)],
                    state.purpose,
                )
            })
            .collect())
    }
}
