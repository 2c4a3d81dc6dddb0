//! Values of expressions in commands.

use super::Session;
use crate::evolver::{
    error::EvolverError,
    language::{
        expression::{Aggregate, BinaryOperator, ElementKind, Expression, Query, UnaryOperator},
        formula::{BinaryFunction, GRAVITY, UnaryFunction, is_zero},
    },
    source::{Place, Position, Source},
};
use std::sync::Arc;

/// An element by its kind and its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) kind: ElementKind,
    pub(super) index: usize,
}

/// The elements that names stand for, the innermost last; one without a name lends its attributes.
#[derive(Clone, Debug)]
pub(super) struct Scope {
    entries: Vec<(Option<Arc<str>>, Element)>,
    /// Local variables, the innermost last.
    locals: Vec<(Arc<str>, f64)>,
    /// The text that the expressions come from.
    source: Option<Arc<Source>>,
}

impl Scope {
    /// No elements; expressions come from `source`.
    pub(super) fn new(source: Option<Arc<Source>>) -> Self {
        Self { entries: Vec::new(), locals: Vec::new(), source }
    }

    /// The text that the expressions come from.
    pub(super) fn source(&self) -> Option<&Arc<Source>> {
        self.source.as_ref()
    }

    /// How many local variables there are.
    pub(super) fn locals(&self) -> usize {
        self.locals.len()
    }

    /// Forgets all local variables but the first `count`.
    pub(super) fn forget(&mut self, count: usize) {
        self.locals.truncate(count);
    }

    pub(super) fn declare(&mut self, name: Arc<str>, value: f64) {
        self.locals.push((name, value));
    }

    /// The innermost local variable of a name.
    pub(super) fn local(&mut self, name: &str) -> Option<&mut f64> {
        self.locals.iter_mut().rev().find(|(own, _)| **own == *name).map(|(_, value)| value)
    }

    fn named(&self, name: &str) -> Option<Element> {
        self.entries.iter().rev().find(|(own, _)| own.as_deref() == Some(name)).map(|(_, element)| *element)
    }

    pub(super) fn innermost(&self) -> Option<Element> {
        self.entries.last().map(|(_, element)| *element)
    }

    pub(super) fn push(&mut self, name: Option<Arc<str>>, element: Element) {
        self.entries.push((name, element));
    }

    pub(super) fn pop(&mut self) {
        self.entries.pop();
    }

    pub(super) fn unsupported<T>(
        &self,
        position: Position,
        what: &str,
        hint: &str,
    ) -> Result<T, EvolverError> {
        match &self.source {
            Some(source) => {
                let place = Place { source: source.clone(), position };
                Err(EvolverError::Unsupported { what: what.to_owned(), place, hint: hint.to_owned() })
            }
            None => Err(EvolverError::Surface(format!("not supported: {what}"))),
        }
    }

    pub(super) fn fail<T>(&self, position: Position, message: impl Into<String>) -> Result<T, EvolverError> {
        let message = message.into();
        match &self.source {
            Some(source) if position != Position::default() => {
                Err(EvolverError::Invalid { place: Place { source: source.clone(), position }, message })
            }
            _ => Err(EvolverError::Surface(message)),
        }
    }
}

type Value = Result<f64, EvolverError>;

impl Session {
    /// The value of an expression.
    pub(super) fn evaluate(&mut self, expression: &Expression, scope: &mut Scope) -> Value {
        match expression {
            Expression::Number(value) => Ok(*value),
            Expression::List(_, position) => {
                scope.fail(*position, "an array stands where a number is needed")
            }
            Expression::Text(_) => scope.fail(Position::default(), "a text stands where a number is needed"),
            Expression::Name(name, position) => self.name(name, *position, scope),
            Expression::Unary(operator, inner) => {
                let value = self.evaluate(inner, scope)?;
                Ok(match operator {
                    UnaryOperator::Negative => -value,
                    UnaryOperator::Not => f64::from(u8::from(is_zero(value))),
                })
            }
            Expression::Binary(operator, operands) => {
                if let Some(product) = self.dot_product(*operator, operands) {
                    return Ok(product);
                }
                let left = self.evaluate(&operands[0], scope)?;
                // The second operand is not looked at where the first decides: it may make no sense then.
                match operator {
                    BinaryOperator::And if is_zero(left) => return Ok(0.0),
                    BinaryOperator::Or if !is_zero(left) => return Ok(1.0),
                    _ => {}
                }
                let right = self.evaluate(&operands[1], scope)?;
                Ok(BinaryFunction::Operator(*operator).apply(left, right))
            }
            Expression::Conditional(parts) => {
                let yes = !is_zero(self.evaluate(&parts[0], scope)?);
                self.evaluate(&parts[if yes { 1 } else { 2 }], scope)
            }
            Expression::Call(name, operands, position) => self.call(name, operands, *position, scope),
            Expression::Index(parts, position) => self.index(&parts[0], &parts[1], *position, scope),
            Expression::Member(owner, name, position) => self.member(owner, name, None, *position, scope),
            Expression::Test(test, operand, position) => {
                let Some(element) = scope.innermost() else {
                    return scope.fail(*position, "this test needs an element: use it behind «where»");
                };
                let label = self.label(operand, scope)?;
                self.element_test(*test, element, &label, *position, scope)
            }
            Expression::Aggregate(aggregate, parts, _) => {
                self.aggregate(*aggregate, &parts.0, &parts.1, scope)
            }
        }
    }

    /// The name of a constraint or boundary: a word as it stands, or a number.
    pub(super) fn label(&mut self, operand: &Expression, scope: &mut Scope) -> Result<String, EvolverError> {
        if let Expression::Name(name, _) = operand
            && self.data.constraints.iter().any(|c| c.name == *name)
        {
            return Ok(name.to_string());
        }
        Ok(format!("{}", self.evaluate(operand, scope)?))
    }

    fn name(&mut self, name: &str, position: Position, scope: &mut Scope) -> Value {
        if let Some(value) = scope.local(name) {
            return Ok(*value);
        }
        if let Some(element) = scope.innermost()
            && let Some(value) = self.attribute(element, name, None)?
        {
            return Ok(value);
        }
        if let Some(element) = scope.named(name) {
            // An element's name as a number is its number.
            return Ok(self.element_number(element));
        }
        if let Some(value) = self.variables.get(name) {
            return Ok(value);
        }
        if let Some(value) = self.internal(name)? {
            return Ok(value);
        }
        if self.arrays.contains_key(name) {
            return scope.fail(position, format!("«{name}» is an array: one of its numbers is {name}[1]"));
        }
        scope.fail(position, format!("«{name}» is not defined"))
    }

    fn call(&mut self, name: &str, operands: &[Expression], position: Position, scope: &mut Scope) -> Value {
        if let ("sizeof", [Expression::Name(array, _)]) = (name, operands)
            && let Some(array) = self.arrays.get(array)
        {
            return Ok(array.len() as f64);
        }
        let mut values = Vec::with_capacity(operands.len());
        for operand in operands {
            values.push(self.evaluate(operand, scope)?);
        }
        if let Some(value) = self.call_function(name, &values, position, scope)? {
            return Ok(value);
        }
        if let ([value], Some(function)) = (&values[..], UnaryFunction::named(name)) {
            return Ok(function.apply(*value));
        }
        if let ([a, b], Some(function)) = (&values[..], BinaryFunction::named(name)) {
            return Ok(function.apply(*a, *b));
        }
        let Some(function) = self.data.functions.get(name).cloned() else {
            return scope
                .fail(position, format!("there is no function «{name}» of {} arguments", values.len()));
        };
        if function.arguments.len() != values.len() {
            let message =
                format!("{name} takes {} arguments, {} are given", function.arguments.len(), values.len());
            return scope.fail(position, message);
        }
        let body = substituted(&function.body, &function.arguments, &values);
        self.spend()?;
        self.evaluate(&body, scope)
    }

    fn index(
        &mut self,
        base: &Expression,
        index: &Expression,
        position: Position,
        scope: &mut Scope,
    ) -> Value {
        let (base, indices) = super::arrays::indexed(base, index);
        let mut at = Vec::with_capacity(indices.len());
        for index in indices {
            at.push(self.evaluate(index, scope)?);
        }
        match base {
            Expression::Name(name, _) => {
                if let Some(element) = scope.innermost() {
                    let flat = self.flat_index(element.kind, name, &at);
                    if let Some(value) = self.attribute(element, name, Some(flat))? {
                        return Ok(value);
                    }
                }
                if self.arrays.contains_key(name) {
                    return self.array_entry(name, &at, position, scope).map(|entry| *entry);
                }
                scope.fail(position, format!("«{name}» has no element {at:?}"))
            }
            Expression::Member(owner, name, _) => {
                let element = self.element(owner, scope)?;
                let flat = self.flat_index(element.kind, name, &at);
                self.member(owner, name, Some(flat), position, scope)
            }
            _ => scope.fail(position, "only names and attributes have an index"),
        }
    }

    fn member(
        &mut self,
        owner: &Expression,
        name: &str,
        index: Option<f64>,
        position: Position,
        scope: &mut Scope,
    ) -> Value {
        if let Expression::Name(owner, _) = owner
            && scope.named(owner).is_none()
            && let Some(value) = self.quantity_member(owner, name)?
        {
            return Ok(value);
        }
        let element = self.element(owner, scope)?;
        match self.attribute(element, name, index)? {
            Some(value) => Ok(value),
            None => scope.fail(position, format!("a {} has no attribute «{name}»", element.kind.name())),
        }
    }

    /// The element that an expression stands for.
    pub(super) fn element(
        &mut self,
        expression: &Expression,
        scope: &mut Scope,
    ) -> Result<Element, EvolverError> {
        match expression {
            Expression::Name(name, position) => match scope.named(name) {
                Some(element) => Ok(element),
                None => scope.fail(*position, format!("«{name}» is the name of no element")),
            },
            Expression::Index(parts, position) => {
                let number = self.evaluate(&parts[1], scope)?;
                match &parts[0] {
                    Expression::Name(name, at) => match ElementKind::named(name) {
                        Some(kind) => {
                            // In a query «vertex[1]» may be a part of the element at hand.
                            if let Some(inner) = scope.innermost()
                                && inner.kind != kind
                                && kind == ElementKind::Vertex
                            {
                                return self.part(inner, kind, number, *position, scope);
                            }
                            self.numbered(kind, number, *position, scope)
                        }
                        None => scope.fail(*at, format!("«{name}» is no kind of element")),
                    },
                    Expression::Member(owner, name, at) => {
                        let owner = self.element(owner, scope)?;
                        match ElementKind::named(name) {
                            Some(kind) => self.part(owner, kind, number, *position, scope),
                            None => scope.fail(*at, format!("«{name}» is no kind of element")),
                        }
                    }
                    _ => scope.fail(*position, "expected an element such as vertex[3]"),
                }
            }
            Expression::Member(_, _, position) | Expression::Call(_, _, position) => {
                scope.fail(*position, "expected an element such as vertex[3]")
            }
            _ => scope.fail(Position::default(), "expected an element such as vertex[3]"),
        }
    }

    fn part(
        &mut self,
        owner: Element,
        kind: ElementKind,
        number: f64,
        position: Position,
        scope: &Scope,
    ) -> Result<Element, EvolverError> {
        let parts = self.parts(owner, kind);
        match whole(number).and_then(|n| n.checked_sub(1)).and_then(|n| parts.get(n)) {
            Some(&index) => Ok(Element { kind, index }),
            None => {
                let message = format!(
                    "a {} has {} of these parts, not a number {number}",
                    owner.kind.name(),
                    parts.len()
                );
                scope.fail(position, message)
            }
        }
    }

    fn numbered(
        &mut self,
        kind: ElementKind,
        number: f64,
        position: Position,
        scope: &Scope,
    ) -> Result<Element, EvolverError> {
        let index = if kind == ElementKind::Body {
            self.surface.bodies.iter().position(|body| (body.id as f64 - number).abs() < 0.5)
        } else {
            whole(number).and_then(|n| n.checked_sub(1)).filter(|&n| n < self.count(kind))
        };
        match index {
            Some(index) => Ok(Element { kind, index }),
            None => scope.fail(position, format!("there is no {} {number}", kind.name())),
        }
    }

    /// The elements that a query finds, with the filter applied.
    pub(super) fn found(&mut self, query: &Query, scope: &mut Scope) -> Result<Vec<Element>, EvolverError> {
        let kind = query.kind;
        let all: Vec<usize> = match &query.owner {
            Some(owner) => {
                let owner = self.element(owner, scope)?;
                self.parts(owner, kind)
            }
            None => (0..self.count(kind)).collect(),
        };
        let mut found = Vec::with_capacity(all.len());
        for index in all {
            let element = Element { kind, index };
            if let Some(filter) = &query.filter {
                scope.push(query.name.clone(), element);
                let value = self.evaluate(filter, scope);
                scope.pop();
                if is_zero(value?) {
                    continue;
                }
            }
            found.push(element);
        }
        Ok(found)
    }

    fn aggregate(
        &mut self,
        aggregate: Aggregate,
        query: &Query,
        value: &Expression,
        scope: &mut Scope,
    ) -> Value {
        let mut values = Vec::new();
        for element in self.found(query, scope)? {
            scope.push(query.name.clone(), element);
            let value = self.evaluate(value, scope);
            scope.pop();
            values.push(value?);
        }
        let count = values.len() as f64;
        Ok(match aggregate {
            Aggregate::Sum => values.iter().sum(),
            Aggregate::Average => values.iter().sum::<f64>() / count,
            Aggregate::Max => values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            Aggregate::Min => values.iter().copied().fold(f64::INFINITY, f64::min),
            Aggregate::Count => values.iter().filter(|value| !is_zero(**value)).count() as f64,
        })
    }

    /// Variables of Surface Evolver itself.
    fn internal(&mut self, name: &str) -> Result<Option<f64>, EvolverError> {
        let count = |n: usize| n as f64;
        Ok(Some(match name {
            "pi" => std::f64::consts::PI,
            "e" => std::f64::consts::E,
            "g" => self.variables.get(GRAVITY).unwrap_or(0.0),
            "total_energy" => self.values()?.energy,
            "total_area" | "total_length" => self.values()?.area,
            "vertex_count" => count(self.surface.vertices.len()),
            "edge_count" => count(self.surface.edges.len()),
            "facet_count" => count(self.surface.facets.len()),
            "body_count" => count(self.surface.bodies.len()),
            "scale" => self.descent.scale,
            "scale_limit" => self.descent.limit,
            "space_dimension" => count(self.surface.dimension),
            "quadratic_flag" | "quadratic" => {
                f64::from(u8::from(self.surface.model == crate::evolver::datafile::Model::Quadratic))
            }
            "torus" => f64::from(u8::from(self.surface.periods.is_some())),
            "last_eigenvalue" | "eigenneg" => self.eigenvalue,
            // Times are not part of the result: they would differ from run to run.
            "clock" | "cpu_counter" | "total_time" => 0.0,
            _ => {
                // A quantity's name alone is its value, as in print.
                return self.quantity_member(name, "value");
            }
        }))
    }
}

/// A whole number that is not negative.
pub(super) fn whole(number: f64) -> Option<usize> {
    let fits = (0.0..4e9).contains(&number) && is_zero(number.fract());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
    let whole = fits.then_some(number as usize);
    whole
}

/// A function's body with its arguments' values put in.
fn substituted(body: &Expression, names: &[Arc<str>], values: &[f64]) -> Expression {
    let go = |inner: &Expression| substituted(inner, names, values);
    match body {
        Expression::Name(name, _) => match names.iter().position(|own| own == name) {
            Some(at) => Expression::Number(values[at]),
            None => body.clone(),
        },
        Expression::Unary(operator, inner) => Expression::Unary(*operator, Box::new(go(inner))),
        Expression::Binary(operator, parts) => {
            Expression::Binary(*operator, Box::new([go(&parts[0]), go(&parts[1])]))
        }
        Expression::Conditional(parts) => {
            Expression::Conditional(Box::new([go(&parts[0]), go(&parts[1]), go(&parts[2])]))
        }
        Expression::Call(name, operands, at) => {
            Expression::Call(name.clone(), operands.iter().map(go).collect(), *at)
        }
        _ => body.clone(),
    }
}
