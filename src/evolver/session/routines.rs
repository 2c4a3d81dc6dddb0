//! Procedures and functions: their arguments and local variables, and what functions print.
//!
//! A function may run statements while an expression is evaluated, where there is nobody to print to: what it says is kept
//! until the statement with the expression goes on.

use super::{Flow, Host, Session, evaluate::Scope};
use crate::evolver::{
    command::Routine,
    error::EvolverError,
    language::expression::Expression,
    source::{Position, Source},
};
use std::sync::Arc;

/// How deep procedures may call procedures.
const DEPTH: usize = 60;

/// A procedure or function with the text that it stands in.
#[derive(Clone, Debug)]
pub(super) struct Known {
    routine: Arc<Routine>,
    source: Option<Arc<Source>>,
}

impl Known {
    pub(super) fn is_function(&self) -> bool {
        self.routine.function
    }
}

/// What functions have printed and written.
#[derive(Debug, Default)]
pub(super) struct Told {
    text: String,
    files: Vec<(String, String, bool)>,
}

impl std::fmt::Write for Told {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.text.push_str(text);
        Ok(())
    }
}

impl Host for Told {
    fn print(&mut self, text: &str) {
        self.text.push_str(text);
    }

    fn write(&mut self, name: &str, text: &str, append: bool) -> Result<(), std::io::Error> {
        self.files.push((name.to_owned(), text.to_owned(), append));
        Ok(())
    }

    fn interrupted(&self) -> bool {
        false
    }
}

impl Session {
    /// Keeps a procedure or function.
    pub(super) fn learn(&mut self, name: &Arc<str>, routine: Arc<Routine>, scope: &Scope) {
        self.routines.insert(name.clone(), Known { routine, source: scope.source().cloned() });
    }

    pub(super) fn is_procedure(&self, name: &str) -> bool {
        self.routines.get(name).is_some_and(|known| !known.routine.function)
    }

    /// Runs a procedure.
    pub(super) fn call_with(
        &mut self,
        name: &str,
        operands: &[Expression],
        position: Position,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Result<Flow, EvolverError> {
        let Some(known) = self.routines.get(name).cloned() else {
            return scope.fail(position, format!("there is no procedure «{name}»"));
        };
        let mut values = Vec::with_capacity(operands.len());
        for operand in operands {
            values.push(self.evaluate(operand, scope)?);
        }
        Ok(match self.run_routine(name, &known, &values, (position, scope), host)? {
            Flow::Quit => Flow::Quit,
            _ => Flow::Next,
        })
    }

    /// The value of a function of several statements; `None` if there is none of this name.
    pub(super) fn call_function(
        &mut self,
        name: &str,
        values: &[f64],
        position: Position,
        scope: &Scope,
    ) -> Result<Option<f64>, EvolverError> {
        let Some(known) = self.routines.get(name).filter(|known| known.routine.function).cloned() else {
            return Ok(None);
        };
        let mut told = std::mem::take(&mut self.told);
        self.returned = None;
        let ran = self.run_routine(name, &known, values, (position, scope), &mut told);
        self.told = told;
        ran?;
        match self.returned.take() {
            Some(value) => Ok(Some(value)),
            None => scope.fail(position, format!("«{name}» ended without «return» and a value")),
        }
    }

    fn run_routine(
        &mut self,
        name: &str,
        known: &Known,
        values: &[f64],
        (position, scope): (Position, &Scope),
        host: &mut dyn Host,
    ) -> Result<Flow, EvolverError> {
        let names = &known.routine.arguments;
        if names.len() != values.len() {
            let message = format!("{name} takes {} arguments, {} are given", names.len(), values.len());
            return scope.fail(position, message);
        }
        self.spend()?;
        if self.depth >= DEPTH {
            return scope.fail(position, format!("«{name}» calls itself without end"));
        }
        // It sees no elements and no local variables of its caller.
        let mut own = Scope::new(known.source.clone());
        for (name, value) in names.iter().zip(values) {
            own.declare(name.clone(), *value);
        }
        self.depth += 1;
        let flow = self.execute(&known.routine.body, &mut own, host);
        self.depth -= 1;
        flow
    }

    /// Says what functions have said.
    pub(super) fn tell(&mut self, host: &mut dyn Host) -> Result<(), EvolverError> {
        if self.told.text.is_empty() && self.told.files.is_empty() {
            return Ok(());
        }
        let Told { text, files } = std::mem::take(&mut self.told);
        host.print(&text);
        for (name, text, append) in files {
            host.write(&name, &text, append).map_err(|error| EvolverError::File { name, error })?;
        }
        Ok(())
    }
}
