//! Constraints, boundaries, quantities and functions.

use super::{
    Boundary, Constraint, FormulaVector, Method, MethodInstance, Purpose, Quantity, Reader, Side,
    header::whole,
};
use crate::evolver::{
    command::{Statement, arguments, routine},
    error::EvolverError,
    language::{
        TokenKind,
        expression::{BinaryOperator, Expression, Function},
        formula::Space,
    },
    source::Position,
};
use std::sync::Arc;

impl Reader {
    /// A number or a name as a name.
    pub(super) fn label(&mut self) -> Result<Arc<str>, EvolverError> {
        if let Some(word) = self.cursor.word() {
            self.cursor.bump();
            return Ok(word.into());
        }
        Ok(self.cursor.integer()?.to_string().into())
    }

    pub(super) fn constraint(&mut self, position: Position) -> Result<(), EvolverError> {
        let name = self.label()?;
        let (mut side, mut convex, mut global) = (Side::On, false, false);
        loop {
            let at = self.cursor.position();
            if self.cursor.accept_any(&["nonnegative", "nonneg"]) {
                side = Side::NonNegative;
            } else if self.cursor.accept_any(&["nonpositive", "nonpos"]) {
                side = Side::NonPositive;
            } else if self.cursor.accept_word("convex") {
                convex = true;
            } else if self.cursor.accept_word("global") {
                global = true;
            } else if self.cursor.accept_any(&["content_rank", "quantity"]) {
                return self.cursor.unsupported(at, "this attribute of a constraint", "");
            } else {
                break;
            }
        }
        if !self.cursor.accept_any(&["formula", "function", "equation"]) {
            return self.cursor.expected("«formula:» of the constraint");
        }
        self.cursor.accept(":");
        let at = self.cursor.position();
        let left = self.cursor.expression()?;
        let whole = if self.cursor.accept("=") || self.cursor.accept("==") {
            let right = self.cursor.expression()?;
            Expression::Binary(BinaryOperator::Subtract, Box::new([left, right]))
        } else {
            left
        };
        let formula = self.compile(&whole, Space::Coordinates, at)?;
        let (energy, content) = self.integrands()?;
        if self.data.constraints.iter().any(|other| other.name == name) {
            return self.cursor.invalid(position, format!("constraint {name} is defined twice"));
        }
        let constraint = Constraint { name, position, formula, side, convex, global, energy, content };
        self.data.constraints.push(constraint);
        Ok(())
    }

    /// `energy: e1: … e2: …` and `content: c1: …`.
    fn integrands(&mut self) -> Result<(Option<FormulaVector>, Option<FormulaVector>), EvolverError> {
        let (mut energy, mut content) = (None, None);
        loop {
            if self.cursor.accept_word("energy") {
                self.cursor.accept(":");
                energy = Some(self.components('e', Space::Coordinates)?);
            } else if self.cursor.accept_word("content") {
                self.cursor.accept(":");
                content = Some(self.components('c', Space::Coordinates)?);
            } else {
                return Ok((energy, content));
            }
        }
    }

    /// Components `e1:`, `e2:`, `e3:` in any order and number.
    fn components(&mut self, letter: char, space: Space) -> Result<FormulaVector, EvolverError> {
        let mut out: FormulaVector = [None, None, None];
        let mut some = false;
        loop {
            let at = (1..=3).find(|n| self.cursor.word() == Some(format!("{letter}{n}")));
            let colon = matches!(self.cursor.ahead(1).kind, TokenKind::Symbol(":"));
            match at {
                Some(n) if colon => {
                    self.cursor.bump();
                    self.cursor.bump();
                    out[n - 1] = Some(self.formula(space)?);
                    some = true;
                }
                _ if some => return Ok(out),
                _ => return self.cursor.expected(&format!("«{letter}1:» and a formula")),
            }
        }
    }

    pub(super) fn boundary(&mut self) -> Result<(), EvolverError> {
        let name = self.label()?;
        let position = self.cursor.position();
        if !self.cursor.accept_any(&["parameters", "parameter"]) {
            return self.cursor.expected("«parameters» and their number");
        }
        let parameters = match self.cursor.integer()? {
            1 => 1,
            2 => 2,
            n => return self.cursor.unsupported(position, &format!("a boundary of {n} parameters"), ""),
        };
        if self.cursor.accept_word("convex") {
            self.data.ignored.push(("convex".to_owned(), position));
        }
        let coordinates = self.components('x', Space::Parameters)?;
        let (energy, content) = self.integrands()?;
        self.data.boundaries.push(Boundary { name, parameters, coordinates, energy, content });
        Ok(())
    }

    pub(super) fn quantity(&mut self, position: Position) -> Result<(), EvolverError> {
        let name: Arc<str> = self.cursor.expect_word()?.into();
        let (mut purpose, mut modulus) = (Purpose::Information, 1.0);
        let mut methods = Vec::new();
        loop {
            let at = self.cursor.position();
            if self.cursor.accept_word("energy") {
                purpose = Purpose::Energy;
            } else if self.cursor.accept_word("info_only") {
                purpose = Purpose::Information;
            } else if self.cursor.accept_word("conserved") {
                return self.cursor.unsupported(at, "a CONSERVED quantity", "give it a FIXED value");
            } else if self.cursor.accept_word("fixed") {
                self.cursor.expect("=")?;
                purpose = Purpose::Fixed(self.number()?);
            } else if self.cursor.accept_any(&["modulus"]) {
                self.cursor.accept("=");
                modulus = self.number()?;
            } else if self.cursor.accept_any(&["tolerance", "volconst", "lagrange_multiplier"]) {
                self.cursor.accept("=");
                self.number()?;
            } else if self.cursor.accept_word("method") {
                methods.push(self.method(name.clone())?);
            } else if self.cursor.accept_word("global_method") {
                let instance = self.cursor.expect_word()?;
                let Some(known) = self.instances.get(instance.as_str()).cloned() else {
                    return self.cursor.invalid(at, format!("there is no method instance «{instance}»"));
                };
                methods.push(MethodInstance { global: true, ..known });
            } else if self.cursor.accept_word("function") {
                return self.cursor.unsupported(at, "a compound quantity", "");
            } else {
                break;
            }
        }
        self.data.quantities.push(Quantity { name, position, purpose, modulus, methods });
        Ok(())
    }

    pub(super) fn method_instance(&mut self) -> Result<(), EvolverError> {
        let name: Arc<str> = self.cursor.expect_word()?.into();
        if !self.cursor.accept_word("method") {
            return self.cursor.expected("«method» and its name");
        }
        let instance = self.method(name.clone())?;
        self.instances.insert(name, instance);
        Ok(())
    }

    fn method(&mut self, name: Arc<str>) -> Result<MethodInstance, EvolverError> {
        let position = self.cursor.position();
        let method = self.cursor.expect_word()?;
        let (mut modulus, mut global) = (1.0, false);
        loop {
            let at = self.cursor.position();
            if self.cursor.accept_word("global") {
                global = true;
            } else if self.cursor.accept_word("modulus") {
                self.cursor.accept("=");
                modulus = self.number()?;
            } else if self.cursor.accept_any(&["element_modulus", "integral_order", "vertices"]) {
                return self.cursor.unsupported(at, "this setting of a method", "");
            } else {
                break;
            }
        }
        let method = match method.as_str() {
            "facet_area" => Method::FacetArea,
            "facet_tension" => Method::FacetTension,
            "edge_length" => Method::EdgeLength,
            "edge_tension" => Method::EdgeTension,
            "facet_volume" | "volume" => Method::FacetVolume,
            "facet_scalar_integral" => Method::FacetScalarIntegral(self.scalar_integrand()?),
            "edge_scalar_integral" => Method::EdgeScalarIntegral(self.scalar_integrand()?),
            "vertex_scalar_integral" => Method::VertexScalarIntegral(self.scalar_integrand()?),
            "facet_vector_integral" => Method::FacetVectorIntegral(self.vector_integrand()?),
            "edge_vector_integral" => Method::EdgeVectorIntegral(self.vector_integrand()?),
            other => {
                return self.cursor.unsupported(position, &format!("the method {other}"), "");
            }
        };
        Ok(MethodInstance { name, method, modulus, global })
    }

    fn scalar_integrand(&mut self) -> Result<super::Formula, EvolverError> {
        if !self.cursor.accept_word("scalar_integrand") {
            return self.cursor.expected("«scalar_integrand:» and a formula");
        }
        self.cursor.accept(":");
        self.formula(Space::Coordinates)
    }

    fn vector_integrand(&mut self) -> Result<FormulaVector, EvolverError> {
        if !self.cursor.accept_word("vector_integrand") {
            return self.cursor.expected("«vector_integrand:» and its components q1, q2, q3");
        }
        self.cursor.accept(":");
        self.components('q', Space::Coordinates)
    }

    /// `function real name (real a, real b) { return …; }`, which formulas may use; one of several statements is for commands
    /// only.
    pub(super) fn function(&mut self, position: Position) -> Result<(), EvolverError> {
        let start = self.cursor.mark();
        let Some((name, function)) = self.formula_function()? else {
            self.cursor.rewind(start);
            let action = routine(&mut self.cursor, true)?;
            self.data.prelude.push(Statement { position, action });
            self.cursor.accept(";");
            return Ok(());
        };
        self.data.functions.insert(name, function);
        Ok(())
    }

    /// A function that is one expression; `None` for any other.
    fn formula_function(&mut self) -> Result<Option<(Arc<str>, Function)>, EvolverError> {
        if !self.cursor.accept_any(&["real", "integer"]) {
            return self.cursor.expected("«real», the type of what the function returns");
        }
        let name: Arc<str> = self.cursor.expect_word()?.into();
        let arguments = arguments(&mut self.cursor)?;
        if !self.cursor.accept("{") || !self.cursor.accept_word("return") {
            return Ok(None);
        }
        let body = self.cursor.expression()?;
        self.cursor.accept(";");
        Ok(self.cursor.accept("}").then_some((name, Function { arguments, body })))
    }

    /// A list of labels: `1 2`, `1,2`.
    pub(super) fn labels(&mut self, into: &mut Vec<(Arc<str>, Position)>) -> Result<(), EvolverError> {
        loop {
            let position = self.cursor.position();
            into.push((self.label()?, position));
            if self.cursor.accept(",") {
                continue;
            }
            let more = matches!(self.cursor.kind(), TokenKind::Number(_, true))
                && !self.cursor.token().first_on_line;
            let named = self.cursor.word().is_some_and(|word| {
                !self.cursor.token().first_on_line && self.data.constraints.iter().any(|c| *c.name == *word)
            });
            if !more && !named {
                return Ok(());
            }
        }
    }

    /// Reads whole numbers with signs up to the end of the line or the first word.
    pub(super) fn signed_list(&mut self) -> Result<Vec<i64>, EvolverError> {
        let mut out = Vec::new();
        while !self.cursor.token().first_on_line {
            match self.cursor.kind() {
                TokenKind::Number(..) | TokenKind::Symbol("-" | "+" | "(") => {
                    let position = self.cursor.position();
                    let expression = self.cursor.list_expression()?;
                    let Some(number) = whole(&expression) else {
                        return self.cursor.invalid(position, "an element's number is a whole number");
                    };
                    out.push(number);
                }
                _ => break,
            }
        }
        Ok(out)
    }
}
