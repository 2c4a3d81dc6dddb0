//! Formulas: expressions of coordinates, boundary parameters and variables, compiled to a list of instructions and evaluated
//! with exact first and second derivatives.

pub use super::function::is_zero;
pub(crate) use super::function::{BinaryFunction, UnaryFunction};

use super::{
    expression::{Expression, Function, UnaryOperator},
    jet::{Jet, Scalar},
};
use crate::evolver::source::Position;
use glam::DVec3;
use std::{collections::BTreeMap, sync::Arc};

/// The named numbers of a datafile and its commands, lower case.
#[derive(Clone, Debug, Default)]
pub struct Variables {
    slots: BTreeMap<Arc<str>, usize>,
    values: Vec<f64>,
    /// Counts the changes, so that bound formulas know when they are old.
    version: u64,
}

impl Variables {
    /// The value of `name`, if it is defined.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<f64> {
        self.slots.get(name).map(|&slot| self.values[slot])
    }

    /// Sets `name`, new or not.
    pub fn set(&mut self, name: &str, value: f64) {
        self.version += 1;
        if let Some(&slot) = self.slots.get(name) {
            self.values[slot] = value;
        } else {
            self.slots.insert(name.into(), self.values.len());
            self.values.push(value);
        }
    }

    /// How often a value was set.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.version
    }

    /// All names with their values, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.slots.iter().map(|(name, &slot)| (&**name, self.values[slot]))
    }
}

/// The variable that holds the gravity constant; formulas call it `G`.
pub const GRAVITY: &str = "gravity_constant";

/// What the variables of a formula are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The coordinates x, y, z.
    Coordinates,
    /// The parameters p1, p2 of a boundary.
    Parameters,
    /// None: a number.
    Nothing,
}

#[derive(Clone, Debug, PartialEq)]
enum Instruction {
    Constant(f64),
    Variable(usize),
    Axis(usize),
    Unary(UnaryFunction),
    Binary(BinaryFunction),
    /// Goes on `0` instructions further if the top is zero, and drops it.
    SkipIfZero(usize),
    Skip(usize),
}

/// Why an expression is no formula: where, and what.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoFormula {
    /// Where.
    pub position: Position,
    /// What is wrong.
    pub message: String,
    /// Whether it is something of Surface Evolver that is not supported.
    pub unsupported: bool,
}

/// A compiled expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    instructions: Vec<Instruction>,
}

/// What compiling needs to know.
pub(crate) struct Names<'a> {
    pub(crate) variables: &'a Variables,
    pub(crate) functions: &'a BTreeMap<Arc<str>, Function>,
    pub(crate) space: Space,
    /// How many coordinates or parameters there are.
    pub(crate) dimension: usize,
}

/// How deep functions may call functions.
const CALLS: usize = 24;

/// How long a formula may be: functions that use their arguments many times over grow fast.
const INSTRUCTIONS: usize = 200_000;

type Arguments<'a> = BTreeMap<Arc<str>, &'a [Instruction]>;

impl Formula {
    /// Compiles an expression.
    pub(crate) fn new(expression: &Expression, names: &Names<'_>) -> Result<Self, NoFormula> {
        let mut instructions = Vec::new();
        compile(expression, names, &BTreeMap::new(), 0, &mut instructions)?;
        Ok(Self { instructions })
    }

    /// The present values of the variables that this depends on.
    pub(crate) fn inputs(&self, variables: &Variables, into: &mut Vec<f64>) {
        into.extend(self.instructions.iter().filter_map(|instruction| match instruction {
            Instruction::Variable(slot) => variables.values.get(*slot).copied(),
            _ => None,
        }));
    }

    /// Puts the present values in the place of the variables.
    #[must_use]
    pub fn bind(&self, variables: &Variables) -> Bound {
        let instructions = self.instructions.iter().map(|instruction| match instruction {
            Instruction::Variable(slot) => Instruction::Constant(variables.values[*slot]),
            other => other.clone(),
        });
        Bound { instructions: folded(instructions) }
    }
}

/// Instructions with operations on constants carried out.
fn folded(instructions: impl Iterator<Item = Instruction>) -> Vec<Instruction> {
    let all: Vec<Instruction> = instructions.collect();
    if all.iter().any(|i| matches!(i, Instruction::Skip(_) | Instruction::SkipIfZero(_))) {
        return all;
    }
    let mut out: Vec<Instruction> = Vec::with_capacity(all.len());
    for instruction in all {
        let count = out.len();
        match (&instruction, out.as_slice()) {
            (Instruction::Unary(function), [.., Instruction::Constant(a)]) => {
                out[count - 1] = Instruction::Constant(function.apply(*a));
            }
            (Instruction::Binary(function), [.., Instruction::Constant(a), Instruction::Constant(b)]) => {
                let value = function.apply(*a, *b);
                out.truncate(count - 2);
                out.push(Instruction::Constant(value));
            }
            _ => out.push(instruction),
        }
    }
    out
}

fn fail<T>(position: Position, message: impl Into<String>, unsupported: bool) -> Result<T, NoFormula> {
    Err(NoFormula { position, message: message.into(), unsupported })
}

fn compile(
    expression: &Expression,
    names: &Names<'_>,
    arguments: &Arguments<'_>,
    calls: usize,
    out: &mut Vec<Instruction>,
) -> Result<(), NoFormula> {
    match expression {
        Expression::Number(value) => out.push(Instruction::Constant(*value)),
        Expression::Name(name, position) => match arguments.get(name) {
            Some(argument) => out.extend_from_slice(argument),
            None => out.push(named(name, *position, names)?),
        },
        Expression::Unary(operator, inner) => {
            compile(inner, names, arguments, calls, out)?;
            out.push(Instruction::Unary(match operator {
                UnaryOperator::Negative => UnaryFunction::Negative,
                UnaryOperator::Not => UnaryFunction::Not,
            }));
        }
        Expression::Binary(operator, operands) => {
            compile(&operands[0], names, arguments, calls, out)?;
            compile(&operands[1], names, arguments, calls, out)?;
            out.push(Instruction::Binary(BinaryFunction::Operator(*operator)));
        }
        Expression::Conditional(parts) => {
            compile(&parts[0], names, arguments, calls, out)?;
            let test = out.len();
            out.push(Instruction::SkipIfZero(0));
            compile(&parts[1], names, arguments, calls, out)?;
            let skip = out.len();
            out.push(Instruction::Skip(0));
            compile(&parts[2], names, arguments, calls, out)?;
            out[test] = Instruction::SkipIfZero(skip - test);
            out[skip] = Instruction::Skip(out.len() - 1 - skip);
        }
        Expression::Call(name, operands, position) => {
            call(name, operands, *position, (names, arguments, calls), out)?;
        }
        Expression::Index(parts, position) => match (&parts[0], &parts[1]) {
            (Expression::Name(name, at), Expression::Number(n)) if &**name == "x" => {
                out.push(named(&format!("x{n}"), *at, names)?);
            }
            _ => return fail(*position, "an indexed attribute inside a formula", true),
        },
        Expression::Member(_, name, position) => {
            return fail(*position, format!("the attribute «{name}» inside a formula"), true);
        }
        Expression::List(_, position) => {
            return fail(*position, "an array inside a formula", true);
        }
        Expression::Test(_, _, position) | Expression::Aggregate(_, _, position) => {
            return fail(*position, "a query inside a formula", true);
        }
        Expression::Text(_) => {
            return fail(Position::default(), "a text stands where a number is needed", false);
        }
    }
    if out.len() > INSTRUCTIONS {
        return fail(Position::default(), "the formula grows beyond all bounds", false);
    }
    Ok(())
}

fn call(
    name: &Arc<str>,
    operands: &[Expression],
    position: Position,
    (names, arguments, calls): (&Names<'_>, &Arguments<'_>, usize),
    out: &mut Vec<Instruction>,
) -> Result<(), NoFormula> {
    let wrong = |needed: usize| {
        fail(position, format!("{name} takes {needed} arguments, {} are given", operands.len()), false)
    };
    if let Some(function) = names.functions.get(name) {
        if operands.len() != function.arguments.len() {
            return wrong(function.arguments.len());
        }
        if calls >= CALLS {
            return fail(position, format!("{name} calls itself without end"), false);
        }
        let mut values = Vec::with_capacity(operands.len());
        for operand in operands {
            let mut value = Vec::new();
            compile(operand, names, arguments, calls, &mut value)?;
            values.push(value);
        }
        let inner: Arguments<'_> =
            function.arguments.iter().cloned().zip(values.iter().map(Vec::as_slice)).collect();
        return compile(&function.body, names, &inner, calls + 1, out);
    }
    let instruction = if let Some(function) = UnaryFunction::named(name) {
        if operands.len() != 1 {
            return wrong(1);
        }
        Instruction::Unary(function)
    } else if let Some(function) = BinaryFunction::named(name) {
        if operands.len() != 2 {
            return wrong(2);
        }
        Instruction::Binary(function)
    } else {
        let known =
            ["ellipticK", "ellipticE", "incompleteEllipticF", "incompleteEllipticE", "usr1", "wrap_inverse"];
        let unsupported = known.iter().any(|k| k.eq_ignore_ascii_case(name));
        let what = if unsupported { "the function" } else { "there is no function" };
        return fail(position, format!("{what} «{name}»"), unsupported);
    };
    for operand in operands {
        compile(operand, names, arguments, calls, out)?;
    }
    out.push(instruction);
    Ok(())
}

fn named(name: &str, position: Position, names: &Names<'_>) -> Result<Instruction, NoFormula> {
    let axis = match name {
        "x" | "x1" => Some(0),
        "y" | "x2" => Some(1),
        "z" | "x3" => Some(2),
        _ => None,
    };
    let parameter = match name {
        "p1" => Some(0),
        "p2" => Some(1),
        "p3" => Some(2),
        _ => None,
    };
    let axis = match names.space {
        Space::Coordinates => axis,
        Space::Parameters => parameter,
        Space::Nothing => None,
    };
    if let Some(axis) = axis {
        if axis >= names.dimension {
            let message = format!("«{name}» does not exist: there are {} dimensions", names.dimension);
            return fail(position, message, false);
        }
        return Ok(Instruction::Axis(axis));
    }
    let variable = if name == "g" { GRAVITY } else { name };
    if let Some(&slot) = names.variables.slots.get(variable) {
        return Ok(Instruction::Variable(slot));
    }
    match name {
        "pi" => Ok(Instruction::Constant(std::f64::consts::PI)),
        "e" => Ok(Instruction::Constant(std::f64::consts::E)),
        _ => fail(position, format!("«{name}» is not defined"), false),
    }
}

/// A formula with all variables' values put in.
#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    instructions: Vec<Instruction>,
}

/// The deepest stack of most formulas; deeper ones grow it.
const STACK: usize = 16;

impl Bound {
    /// A constant.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self { instructions: vec![Instruction::Constant(value)] }
    }

    /// Whether this is zero everywhere.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        matches!(self.instructions[..], [Instruction::Constant(value)] if is_zero(value))
    }

    fn evaluate<T: Scalar>(&self, axes: [T; 3]) -> T {
        if let [Instruction::Constant(value)] = self.instructions[..] {
            return T::constant(value);
        }
        let mut stack: Vec<T> = Vec::with_capacity(STACK);
        let mut at = 0;
        while let Some(instruction) = self.instructions.get(at) {
            at += 1;
            match instruction {
                Instruction::Constant(value) => stack.push(T::constant(*value)),
                Instruction::Axis(axis) => stack.push(axes[*axis]),
                Instruction::Variable(_) => stack.push(T::constant(f64::NAN)),
                Instruction::Unary(function) => {
                    if let Some(top) = stack.last_mut() {
                        *top = function.apply(*top);
                    }
                }
                Instruction::Binary(function) => {
                    if let (Some(b), Some(a)) = (stack.pop(), stack.last_mut()) {
                        *a = function.apply(*a, b);
                    }
                }
                Instruction::SkipIfZero(count) => {
                    if stack.pop().is_none_or(|top| is_zero(top.value())) {
                        at += count;
                    }
                }
                Instruction::Skip(count) => at += count,
            }
        }
        stack.pop().unwrap_or(T::constant(f64::NAN))
    }

    /// The value at `p`.
    #[must_use]
    pub fn value(&self, p: DVec3) -> f64 {
        self.evaluate(p.to_array())
    }

    /// Value, gradient and Hessian at `p`.
    #[must_use]
    pub fn jet(&self, p: DVec3) -> Jet {
        self.evaluate([Jet::variable(p.x, 0), Jet::variable(p.y, 1), Jet::variable(p.z, 2)])
    }
}
