//! Functions and operators of numbers, with first and second derivatives.

use super::{expression::BinaryOperator, jet::Scalar};

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
