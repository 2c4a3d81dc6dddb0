//! Formulas: expressions of coordinates, boundary parameters and variables, compiled to a list of instructions and evaluated
//! with exact first and second derivatives.

use super::{
    expression::{BinaryOperator, Expression, Function, UnaryOperator},
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnaryFunction {
    Negative,
    Not,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Acosh,
    Atanh,
    Exp,
    Log,
    Sqrt,
    Square,
    Abs,
    Floor,
    Ceiling,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BinaryFunction {
    Operator(BinaryOperator),
    Atan2,
    Minimum,
    Maximum,
}

impl UnaryFunction {
    pub(crate) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "sin" => Self::Sin,
            "cos" => Self::Cos,
            "tan" => Self::Tan,
            "asin" => Self::Asin,
            "acos" => Self::Acos,
            "atan" => Self::Atan,
            "sinh" => Self::Sinh,
            "cosh" => Self::Cosh,
            "tanh" => Self::Tanh,
            "asinh" => Self::Asinh,
            "acosh" => Self::Acosh,
            "atanh" => Self::Atanh,
            "exp" => Self::Exp,
            "log" => Self::Log,
            "sqrt" => Self::Sqrt,
            "sqr" => Self::Square,
            "abs" => Self::Abs,
            "floor" => Self::Floor,
            "ceil" => Self::Ceiling,
            _ => return None,
        })
    }

    /// The value and the first two derivatives at `x`.
    fn at(self, x: f64) -> [f64; 3] {
        match self {
            Self::Negative => [-x, -1.0, 0.0],
            Self::Not => [truth(is_zero(x)), 0.0, 0.0],
            Self::Sin => [x.sin(), x.cos(), -x.sin()],
            Self::Cos => [x.cos(), -x.sin(), -x.cos()],
            Self::Tan => {
                let t = x.tan();
                [t, 1.0 + t * t, 2.0 * t * (1.0 + t * t)]
            }
            Self::Asin => {
                let q = 1.0 - x * x;
                [x.asin(), q.powf(-0.5), x * q.powf(-1.5)]
            }
            Self::Acos => {
                let q = 1.0 - x * x;
                [x.acos(), -q.powf(-0.5), -x * q.powf(-1.5)]
            }
            Self::Atan => {
                let q = 1.0 / (1.0 + x * x);
                [x.atan(), q, -2.0 * x * q * q]
            }
            Self::Sinh => [x.sinh(), x.cosh(), x.sinh()],
            Self::Cosh => [x.cosh(), x.sinh(), x.cosh()],
            Self::Tanh => {
                let t = x.tanh();
                [t, 1.0 - t * t, -2.0 * t * (1.0 - t * t)]
            }
            Self::Asinh => {
                let q = 1.0 + x * x;
                [x.asinh(), q.powf(-0.5), -x * q.powf(-1.5)]
            }
            Self::Acosh => {
                let q = x * x - 1.0;
                [x.acosh(), q.powf(-0.5), -x * q.powf(-1.5)]
            }
            Self::Atanh => {
                let q = 1.0 / (1.0 - x * x);
                [x.atanh(), q, 2.0 * x * q * q]
            }
            Self::Exp => [x.exp(); 3],
            Self::Log => [x.ln(), 1.0 / x, -1.0 / (x * x)],
            Self::Sqrt => [x.sqrt(), 0.5 / x.sqrt(), -0.25 / (x * x.sqrt())],
            Self::Square => [x * x, 2.0 * x, 2.0],
            Self::Abs => [x.abs(), x.signum(), 0.0],
            Self::Floor => [x.floor(), 0.0, 0.0],
            Self::Ceiling => [x.ceil(), 0.0, 0.0],
        }
    }

    pub(crate) fn apply<T: Scalar>(self, x: T) -> T {
        let [value, first, second] = self.at(x.value());
        x.unary(value, first, second)
    }
}

/// Whether a number is exactly zero: what conditions ask.
#[must_use]
pub fn is_zero(x: f64) -> bool {
    // Conditions of the language compare exactly.
    x.abs() <= 0.0
}

fn truth(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

impl BinaryFunction {
    pub(crate) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "atan2" => Self::Atan2,
            "minimum" => Self::Minimum,
            "maximum" => Self::Maximum,
            "pow" => Self::Operator(BinaryOperator::Power),
            "mod" => Self::Operator(BinaryOperator::Modulus),
            _ => return None,
        })
    }

    pub(crate) fn apply<T: Scalar>(self, a: T, b: T) -> T {
        let (x, y) = (a.value(), b.value());
        match self {
            Self::Atan2 => {
                let q = x * x + y * y;
                let (qx, qy) = (x / q, y / q);
                let second = [-2.0 * qx * qy, qx * qx - qy * qy, 2.0 * qx * qy];
                a.binary(b, x.atan2(y), [qy, -qx], second)
            }
            Self::Minimum => {
                if x <= y {
                    a
                } else {
                    b
                }
            }
            Self::Maximum => {
                if x >= y {
                    a
                } else {
                    b
                }
            }
            Self::Operator(operator) => arithmetic(operator, a, b),
        }
    }
}

fn arithmetic<T: Scalar>(operator: BinaryOperator, a: T, b: T) -> T {
    let (x, y) = (a.value(), b.value());
    #[expect(clippy::float_cmp, reason = "`==` of the language is exact")]
    let equal = x == y;
    match operator {
        BinaryOperator::Add => a + b,
        BinaryOperator::Subtract => a - b,
        BinaryOperator::Multiply => a * b,
        BinaryOperator::Divide => {
            a.binary(b, x / y, [1.0 / y, -x / (y * y)], [0.0, -1.0 / (y * y), 2.0 * x / (y * y * y)])
        }
        BinaryOperator::Power => power(a, b),
        // x − y·floor(x/y): the slope by y is that of the whole part.
        BinaryOperator::Modulus => {
            let whole = (x / y).floor();
            a.binary(b, x - y * whole, [1.0, -whole], [0.0; 3])
        }
        BinaryOperator::IntegerModulus => T::constant(x.floor().rem_euclid(y.floor())),
        BinaryOperator::IntegerDivide => T::constant((x.trunc() / y.trunc()).trunc()),
        BinaryOperator::Equal => T::constant(truth(equal)),
        BinaryOperator::Unequal => T::constant(truth(!equal)),
        BinaryOperator::Less => T::constant(truth(x < y)),
        BinaryOperator::AtMost => T::constant(truth(x <= y)),
        BinaryOperator::Greater => T::constant(truth(x > y)),
        BinaryOperator::AtLeast => T::constant(truth(x >= y)),
        BinaryOperator::And => T::constant(truth(!is_zero(x) && !is_zero(y))),
        BinaryOperator::Or => T::constant(truth(!is_zero(x) || !is_zero(y))),
    }
}

/// `a^b`. Whole powers take any base; the derivatives by the power need a positive one.
fn power<T: Scalar>(a: T, b: T) -> T {
    let (x, n) = (a.value(), b.value());
    if is_zero(n.fract()) && n.abs() <= 64.0 {
        #[expect(clippy::cast_possible_truncation, reason = "a whole number up to 64")]
        let n = n as i32;
        let m = f64::from(n);
        let slope = if n == 0 { 0.0 } else { m * x.powi(n - 1) };
        let second = if n == 0 || n == 1 { 0.0 } else { m * (m - 1.0) * x.powi(n - 2) };
        if x <= 0.0 {
            return a.unary(x.powi(n), slope, second);
        }
        let (value, l) = (x.powi(n), x.ln());
        return a.binary(b, value, [slope, value * l], [second, value / x * (1.0 + m * l), value * l * l]);
    }
    let value = x.powf(n);
    if is_zero(x) {
        return a.unary(value, n * x.powf(n - 1.0), n * (n - 1.0) * x.powf(n - 2.0));
    }
    let l = x.ln();
    let second = [n * (n - 1.0) * x.powf(n - 2.0), x.powf(n - 1.0) * (1.0 + n * l), value * l * l];
    a.binary(b, value, [n * x.powf(n - 1.0), value * l], second)
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
