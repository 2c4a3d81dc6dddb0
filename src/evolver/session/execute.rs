//! Statements, one by one.

use super::{
    Host, Session,
    evaluate::Scope,
    format::{Argument, printf, significant},
};
use crate::evolver::{
    command::{Action, Routine, Simple, Statement},
    error::EvolverError,
    language::{
        expression::{Expression, Query},
        formula::is_zero,
    },
    source::{Position, Source},
};
use std::sync::Arc;

/// How a statement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// It ran to its end.
    Next,
    /// `break`.
    Break,
    /// `continue`.
    Continue,
    /// `return`.
    Return,
    /// `quit`.
    Quit,
}

type Ran = Result<Flow, EvolverError>;

/// Collects what a redirected statement prints.
struct Collected<'a> {
    host: &'a mut dyn Host,
    text: String,
}

impl Host for Collected<'_> {
    fn print(&mut self, text: &str) {
        self.text.push_str(text);
    }

    fn write(&mut self, name: &str, text: &str, append: bool) -> Result<(), std::io::Error> {
        self.host.write(name, text, append)
    }

    fn interrupted(&self) -> bool {
        self.host.interrupted()
    }
}

impl Session {
    /// Runs statements from one text.
    ///
    /// # Errors
    /// The first [`EvolverError`]; the surface is as the statements before left it.
    pub fn run(&mut self, source: &Arc<Source>, statements: &[Statement], host: &mut dyn Host) -> Ran {
        let mut scope = Scope::new(Some(source.clone()));
        for statement in statements {
            if self.execute(statement, &mut scope, host)? == Flow::Quit {
                return Ok(Flow::Quit);
            }
        }
        Ok(Flow::Next)
    }

    /// Counts a command against the budget.
    pub(super) fn spend(&mut self) -> Result<(), EvolverError> {
        self.spent += 1;
        if self.spent > self.budget { Err(EvolverError::Budget(self.budget)) } else { Ok(()) }
    }

    pub(super) fn execute(&mut self, statement: &Statement, scope: &mut Scope, host: &mut dyn Host) -> Ran {
        self.spend()?;
        if host.interrupted() {
            return Err(EvolverError::Interrupted);
        }
        match &statement.action {
            Action::Block(statements) => {
                let outer = scope.locals();
                let flow = self.block(statements, scope, host);
                scope.forget(outer);
                flow
            }
            Action::Repeat(body, count) => {
                let count = self.evaluate(count, scope)?;
                let mut done = 0.0;
                while done < count {
                    done += 1.0;
                    match self.execute(body, scope, host)? {
                        Flow::Next | Flow::Continue => {}
                        Flow::Break => break,
                        flow => return Ok(flow),
                    }
                }
                Ok(Flow::Next)
            }
            Action::If(test, yes, no) => {
                if !is_zero(self.evaluate(test, scope)?) {
                    self.execute(yes, scope, host)
                } else if let Some(no) = no {
                    self.execute(no, scope, host)
                } else {
                    Ok(Flow::Next)
                }
            }
            Action::While(..) | Action::DoWhile(..) | Action::For(..) => {
                self.repeat(&statement.action, scope, host)
            }
            Action::Foreach(query, body) => self.foreach(query, body, scope, host),
            Action::Redirect(body, name, append) => self.redirect(body, name, *append, scope, host),
            Action::Call(name) => self.call_procedure(name, statement.position, scope, host),
            Action::Simple(Simple::Break) => Ok(Flow::Break),
            Action::Simple(Simple::Continue) => Ok(Flow::Continue),
            Action::Return(value) => {
                self.returned = value.as_ref().map(|value| self.evaluate(value, scope)).transpose()?;
                Ok(Flow::Return)
            }
            Action::Show(Expression::Call(name, operands, position)) if self.is_procedure(name) => {
                self.call_with(name, operands, *position, scope, host)
            }
            Action::Simple(Simple::Quit) => Ok(Flow::Quit),
            other => {
                let done = self.act(other, statement.position, scope, host);
                self.tell(host)?;
                done.map(|()| Flow::Next)
            }
        }
    }

    fn block(&mut self, statements: &[Statement], scope: &mut Scope, host: &mut dyn Host) -> Ran {
        for statement in statements {
            let flow = self.execute(statement, scope, host)?;
            if flow != Flow::Next {
                return Ok(flow);
            }
        }
        Ok(Flow::Next)
    }

    fn repeat(&mut self, action: &Action, scope: &mut Scope, host: &mut dyn Host) -> Ran {
        let (test, body, next) = match action {
            Action::While(test, body) | Action::DoWhile(body, test) => (test, body, None),
            Action::For(parts, test, body) => {
                self.execute(&parts[0], scope, host)?;
                (test, body, Some(&parts[1]))
            }
            _ => return Ok(Flow::Next),
        };
        let mut first = matches!(action, Action::DoWhile(..));
        loop {
            self.spend()?;
            if !std::mem::take(&mut first) && is_zero(self.evaluate(test, scope)?) {
                return Ok(Flow::Next);
            }
            match self.execute(body, scope, host)? {
                Flow::Next | Flow::Continue => {}
                Flow::Break => return Ok(Flow::Next),
                flow => return Ok(flow),
            }
            if let Some(next) = next {
                self.execute(next, scope, host)?;
            }
        }
    }

    fn foreach(&mut self, query: &Query, body: &Statement, scope: &mut Scope, host: &mut dyn Host) -> Ran {
        for element in self.found(query, scope)? {
            if element.index >= self.count(element.kind) {
                break;
            }
            scope.push(query.name.clone(), element);
            let flow = self.execute(body, scope, host);
            scope.pop();
            match flow? {
                Flow::Next | Flow::Continue => {}
                Flow::Break => break,
                flow => return Ok(flow),
            }
        }
        Ok(Flow::Next)
    }

    fn redirect(
        &mut self,
        body: &Statement,
        name: &Expression,
        append: bool,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Ran {
        let name = self.text(name, scope)?;
        let mut collected = Collected { host, text: String::new() };
        let flow = self.execute(body, scope, &mut collected)?;
        let Collected { host, text } = collected;
        host.write(&name, &text, append).map_err(|error| EvolverError::File { name, error })?;
        Ok(flow)
    }

    fn call_procedure(
        &mut self,
        name: &Arc<str>,
        position: Position,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Ran {
        if self.is_procedure(name) {
            return self.call_with(name, &[], position, scope, host);
        }
        let expression = Expression::Name(name.clone(), position);
        if let Some(text) = self.texts.get(name) {
            host.print(&format!("{text}\n"));
            return Ok(Flow::Next);
        }
        match self.evaluate(&expression, scope) {
            Ok(value) => host.print(&format!("{}\n", significant(value, 15))),
            Err(EvolverError::Invalid { place, .. }) => {
                let message = format!("«{name}» is no command, procedure or variable");
                return Err(EvolverError::Invalid { place, message });
            }
            Err(error) => return Err(error),
        }
        Ok(Flow::Next)
    }

    /// Statements that have no statements in them.
    fn act(
        &mut self,
        action: &Action,
        position: Position,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Result<(), EvolverError> {
        match action {
            Action::Assign(name, operator, value) => {
                if self.assign_array(name, *operator, value, position, scope)? {
                    return Ok(());
                }
                let value = self.evaluate(value, scope)?;
                self.assign(name, *operator, value, position, scope)
            }
            Action::Local(names) => {
                names.iter().for_each(|name| scope.declare(name.clone(), 0.0));
                Ok(())
            }
            Action::Routine(name, routine) => {
                self.learn(name, routine.clone(), scope);
                Ok(())
            }
            Action::DefineArray(name, sizes, integer, values) => {
                self.define_array(name, (sizes, *integer), values.as_ref(), position, scope)
            }
            Action::AssignText(name, value) => {
                let text: Arc<str> = self.text(value, scope)?.into();
                self.texts.insert(name.clone(), text);
                Ok(())
            }
            Action::Define(name, body) => {
                let routine =
                    Routine { arguments: Vec::new(), body: Statement::clone(body), function: false };
                self.learn(name, Arc::new(routine), scope);
                Ok(())
            }
            Action::AssignMember(target, operator, value @ Expression::List(..)) => {
                self.assign_whole_attribute(target, *operator, value, position, scope)
            }
            Action::AssignMember(target, operator, value) => {
                let value = self.evaluate(value, scope)?;
                self.assign_member(target, *operator, value, position, scope)
            }
            Action::Print(Expression::Text(text)) => {
                host.print(&format!("{text}\n"));
                Ok(())
            }
            Action::Print(value) | Action::Show(value) => {
                if let Expression::Name(name, _) = value
                    && let Some(text) = self.texts.get(name)
                {
                    host.print(&format!("{text}\n"));
                    return Ok(());
                }
                if let Some(array) = self.array_value(value, scope)? {
                    host.print(&format!("{array}\n"));
                    return Ok(());
                }
                let value = self.evaluate(value, scope)?;
                self.tell(host)?;
                host.print(&format!("{}\n", significant(value, 15)));
                Ok(())
            }
            Action::Printf(format, arguments) => {
                let text = self.formatted(format, arguments, position, scope)?;
                self.tell(host)?;
                host.print(&text);
                Ok(())
            }
            Action::Toggle(name, on) => {
                self.toggle(name, *on);
                Ok(())
            }
            Action::Dump(name) => {
                let name = match name {
                    Some(name) => self.text(name, scope)?,
                    None => format!("{}.dmp", self.data.source.name),
                };
                let text = self.datafile()?;
                self.say(host, &format!("Dumping to {name}.\n"));
                host.write(&name, &text, false).map_err(|error| EvolverError::File { name, error })
            }
            Action::DefineAttribute(attribute) => {
                let at = self.surface.extra_length(attribute.kind);
                self.surface.attributes.push(attribute.clone());
                self.surface.lengthen_extra(attribute.kind, at, attribute.length);
                Ok(())
            }
            Action::Histogram(query, value, _) => self.histogram(query, value, scope, host),
            Action::ListInformation(what) => {
                self.list_information(what, host);
                Ok(())
            }
            Action::Refused(what, hint) => scope.unsupported(position, what, hint),
            Action::Set(query, name, index, value) => {
                self.set(query, name, (index.as_ref(), value.as_ref()), position, scope)
            }
            Action::Unset(query, name, value) => self.unset(query, name, value.as_ref(), position, scope),
            Action::Elements(command, target) => self.element_command(*command, target, scope, host),
            other => self.motion_command(other, position, scope, host),
        }
    }

    /// The text of an expression: a text, a variable that holds one, or a formatted one.
    pub(super) fn text(
        &mut self,
        expression: &Expression,
        scope: &mut Scope,
    ) -> Result<String, EvolverError> {
        match expression {
            Expression::Text(text) => Ok(text.to_string()),
            Expression::Name(name, _) if self.texts.contains_key(name) => {
                Ok(self.texts.get(name).map(ToString::to_string).unwrap_or_default())
            }
            Expression::Call(name, operands, position) if &**name == "sprintf" => {
                match operands.split_first() {
                    Some((format, rest)) => self.formatted(format, rest, *position, scope),
                    None => scope.fail(*position, "sprintf needs a format"),
                }
            }
            other => Ok(significant(self.evaluate(other, scope)?, 15)),
        }
    }

    fn formatted(
        &mut self,
        format: &Expression,
        arguments: &[Expression],
        position: Position,
        scope: &mut Scope,
    ) -> Result<String, EvolverError> {
        let format = self.text(format, scope)?;
        let mut values = Vec::with_capacity(arguments.len());
        for argument in arguments {
            let is_text = match argument {
                Expression::Text(_) => true,
                Expression::Name(name, _) => self.texts.contains_key(name),
                _ => false,
            };
            values.push(if is_text {
                Argument::Text(self.text(argument, scope)?)
            } else {
                Argument::Number(self.evaluate(argument, scope)?)
            });
        }
        match printf(&format, &values) {
            Ok(text) => Ok(text),
            Err(message) => scope.fail(position, message),
        }
    }
}
