//! Expressions as trees.

use crate::evolver::source::Position;
use std::sync::Arc;

/// A kind of element of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ElementKind {
    /// Vertices.
    Vertex,
    /// Edges.
    Edge,
    /// Facets.
    Facet,
    /// Bodies.
    Body,
}

impl ElementKind {
    /// The kind named by a word in lower case, singular or plural.
    #[must_use]
    pub fn named(word: &str) -> Option<Self> {
        Some(match word {
            "vertex" | "vertices" => Self::Vertex,
            "edge" | "edges" => Self::Edge,
            "facet" | "facets" | "face" | "faces" => Self::Facet,
            "body" | "bodies" => Self::Body,
            _ => return None,
        })
    }

    /// The singular.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vertex => "vertex",
            Self::Edge => "edge",
            Self::Facet => "facet",
            Self::Body => "body",
        }
    }
}

/// Operators of two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinaryOperator {
    /// `a + b`
    Add,
    /// `a - b`
    Subtract,
    /// `a * b`
    Multiply,
    /// `a / b`
    Divide,
    /// `a ^ b`, `a ** b`
    Power,
    /// `a % b`, `a mod b`: the real modulus, with the sign of `b`.
    Modulus,
    /// `a imod b` of whole numbers.
    IntegerModulus,
    /// `a idiv b` of whole numbers.
    IntegerDivide,
    /// `a == b`
    Equal,
    /// `a != b`
    Unequal,
    /// `a < b`
    Less,
    /// `a <= b`
    AtMost,
    /// `a > b`
    Greater,
    /// `a >= b`
    AtLeast,
    /// `a && b`
    And,
    /// `a || b`
    Or,
}

/// Operators of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnaryOperator {
    /// `-a`
    Negative,
    /// `!a`, `not a`
    Not,
}

/// What is done with the elements of a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aggregate {
    /// The sum of the values.
    Sum,
    /// The largest value.
    Max,
    /// The smallest value.
    Min,
    /// The mean of the values.
    Average,
    /// How many values are not zero.
    Count,
}

/// What a test such as `on_constraint 2` asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementTest {
    /// Whether the element is on the constraint.
    OnConstraint,
    /// Whether the vertex sits on the one-sided constraint.
    HitConstraint,
    /// Whether the element is on the boundary.
    OnBoundary,
}

/// Elements of one kind, of the whole surface or of one element, with a name and a filter.
#[derive(Clone, Debug, PartialEq)]
pub struct Query {
    /// The element whose parts are meant, as in `vv.edge`.
    pub owner: Option<Expression>,
    /// The kind.
    pub kind: ElementKind,
    /// The name by which each is known in the filter and beyond.
    pub name: Option<Arc<str>>,
    /// `where …`.
    pub filter: Option<Expression>,
}

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// A number.
    Number(f64),
    /// A text.
    Text(Arc<str>),
    /// A variable, a coordinate, an attribute, an element's name: lower case.
    Name(Arc<str>, Position),
    /// An operator on one operand.
    Unary(UnaryOperator, Box<Expression>),
    /// An operator on two operands.
    Binary(BinaryOperator, Box<[Expression; 2]>),
    /// `a ? b : c`.
    Conditional(Box<[Expression; 3]>),
    /// A function of arguments.
    Call(Arc<str>, Vec<Expression>, Position),
    /// `a[i]`.
    Index(Box<[Expression; 2]>, Position),
    /// `a.name`.
    Member(Box<Expression>, Arc<str>, Position),
    /// `on_constraint n` and its kin.
    Test(ElementTest, Box<Expression>, Position),
    /// `{1, 2}`, `{{1, 2}, {3, 4}}`: the values of an array.
    List(Vec<Expression>, Position),
    /// `sum(query, value)` and its kin.
    Aggregate(Aggregate, Box<(Query, Expression)>, Position),
}

/// A `function real name(real a, …) { return …; }` of a datafile.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    /// The names of its arguments, lower case.
    pub arguments: Vec<Arc<str>>,
    /// What it returns.
    pub body: Expression,
}
