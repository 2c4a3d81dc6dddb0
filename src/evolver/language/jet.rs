//! Forward automatic differentiation to second order in three variables.

use glam::{DMat3, DVec3};
use std::ops::{Add, Mul, Neg, Sub};

/// A number that formulas compute with: a plain one or a [`Jet`].
pub trait Scalar:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// A constant.
    fn constant(value: f64) -> Self;
    /// The value alone.
    fn value(&self) -> f64;
    /// A function of one variable, from its value and its first two derivatives at [`Scalar::value`].
    fn unary(self, value: f64, first: f64, second: f64) -> Self;
    /// A function of two variables, from its value, its gradient `[a, b]` and its second derivatives `[aa, ab, bb]`.
    fn binary(self, other: Self, value: f64, first: [f64; 2], second: [f64; 3]) -> Self;
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }

    fn value(&self) -> f64 {
        *self
    }

    fn unary(self, value: f64, _first: f64, _second: f64) -> Self {
        value
    }

    fn binary(self, _other: Self, value: f64, _first: [f64; 2], _second: [f64; 3]) -> Self {
        value
    }
}

/// A value with its gradient and its Hessian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// The value.
    pub value: f64,
    /// First derivatives.
    pub gradient: DVec3,
    /// Second derivatives.
    pub hessian: DMat3,
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl Jet {
    /// The variable along `axis` at `value`.
    #[must_use]
    pub fn variable(value: f64, axis: usize) -> Self {
        Self { value, gradient: DVec3::AXES[axis], hessian: DMat3::ZERO }
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
            hessian: self.hessian + other.hessian,
        }
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, gradient: -self.gradient, hessian: -1.0 * self.hessian }
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let cross = outer(self.gradient, other.gradient);
        Self {
            value: self.value * other.value,
            gradient: self.value * other.gradient + other.value * self.gradient,
            hessian: self.value * other.hessian + other.value * self.hessian + cross + cross.transpose(),
        }
    }
}

impl Scalar for Jet {
    fn constant(value: f64) -> Self {
        Self { value, gradient: DVec3::ZERO, hessian: DMat3::ZERO }
    }

    fn value(&self) -> f64 {
        self.value
    }

    fn unary(self, value: f64, first: f64, second: f64) -> Self {
        Self {
            value,
            gradient: first * self.gradient,
            hessian: first * self.hessian + second * outer(self.gradient, self.gradient),
        }
    }

    fn binary(self, other: Self, value: f64, [a, b]: [f64; 2], [aa, ab, bb]: [f64; 3]) -> Self {
        let cross = outer(self.gradient, other.gradient);
        Self {
            value,
            gradient: a * self.gradient + b * other.gradient,
            hessian: a * self.hessian
                + b * other.hessian
                + aa * outer(self.gradient, self.gradient)
                + ab * (cross + cross.transpose())
                + bb * outer(other.gradient, other.gradient),
        }
    }
}
