//! Expressions by recursive descent.

use super::{
    cursor::{Cursor, word_of},
    expression::{
        Aggregate, BinaryOperator as Op, ElementKind, ElementTest, Expression, Query, UnaryOperator,
    },
    lexer::TokenKind,
};
use crate::evolver::error::EvolverError;

type Parsed = Result<Expression, EvolverError>;

/// How long a chain of operators may be: it is as deep as a tree.
const CHAIN: usize = 2000;

/// Binary operators by precedence, the weakest first.
const LEVELS: [&[(&str, Op)]; 5] = [
    &[("||", Op::Or), ("or", Op::Or)],
    &[("&&", Op::And), ("and", Op::And)],
    &[
        ("==", Op::Equal),
        ("!=", Op::Unequal),
        ("<=", Op::AtMost),
        (">=", Op::AtLeast),
        ("<", Op::Less),
        (">", Op::Greater),
    ],
    &[("+", Op::Add), ("-", Op::Subtract)],
    &[
        ("*", Op::Multiply),
        ("/", Op::Divide),
        ("%", Op::Modulus),
        ("mod", Op::Modulus),
        ("imod", Op::IntegerModulus),
        ("idiv", Op::IntegerDivide),
    ],
];
/// The level of `+` and `-`.
const SUMS: usize = 3;

impl Cursor {
    /// An expression.
    pub(crate) fn expression(&mut self) -> Parsed {
        self.conditional(false)
    }

    /// An expression in a list without commas, such as coordinates: a sign that stands off to its left and close to its
    /// right starts the next item.
    pub(crate) fn list_expression(&mut self) -> Parsed {
        self.conditional(true)
    }

    fn conditional(&mut self, list: bool) -> Parsed {
        self.enter()?;
        let condition = self.binary(0, list)?;
        let out = if self.accept("?") {
            let yes = self.conditional(list)?;
            self.expect(":")?;
            let no = self.conditional(list)?;
            Expression::Conditional(Box::new([condition, yes, no]))
        } else {
            condition
        };
        self.leave();
        Ok(out)
    }

    fn operator(&self, level: usize, list: bool) -> Option<Op> {
        let symbol = match self.kind() {
            TokenKind::Symbol(symbol) => (*symbol).to_owned(),
            TokenKind::Word(word) => word.to_lowercase(),
            _ => return None,
        };
        if list && (self.token().first_on_line || (level == SUMS && self.starts_item())) {
            return None;
        }
        LEVELS[level].iter().find(|(name, _)| *name == symbol).map(|&(_, op)| op)
    }

    /// Whether the sign here stands off to its left and close to its right.
    fn starts_item(&self) -> bool {
        self.token().space_before && !self.ahead(1).space_before && !self.ahead(1).first_on_line
    }

    fn binary(&mut self, level: usize, list: bool) -> Parsed {
        if level == LEVELS.len() {
            return self.unary();
        }
        let mut left = self.binary(level + 1, list)?;
        let mut length = 0;
        while let Some(op) = self.operator(level, list) {
            length += 1;
            if length > CHAIN {
                return self.invalid(self.position(), format!("more than {CHAIN} operators in a row"));
            }
            self.bump();
            let right = self.binary(level + 1, list)?;
            left = Expression::Binary(op, Box::new([left, right]));
        }
        Ok(left)
    }

    fn unary(&mut self) -> Parsed {
        self.enter()?;
        let out = if self.accept("-") {
            Expression::Unary(UnaryOperator::Negative, Box::new(self.unary()?))
        } else if self.accept("+") {
            self.unary()?
        } else if self.accept("!") || self.accept_word("not") {
            Expression::Unary(UnaryOperator::Not, Box::new(self.unary()?))
        } else {
            let base = self.postfix()?;
            if self.accept("^") || self.accept("**") {
                // Right to left, and a sign may follow.
                let power = self.unary()?;
                Expression::Binary(Op::Power, Box::new([base, power]))
            } else {
                base
            }
        };
        self.leave();
        Ok(out)
    }

    /// A primary with indices and members.
    pub(crate) fn postfix(&mut self) -> Parsed {
        let mut out = self.primary()?;
        let mut length = 0;
        loop {
            let position = self.position();
            length += 1;
            if length > super::cursor::DEPTH {
                return self.invalid(position, "too many members in a row");
            }
            if self.is_symbol("[") {
                self.bump();
                let index = self.expression()?;
                self.expect("]")?;
                out = Expression::Index(Box::new([out, index]), position);
            } else if self.is_symbol(".") {
                self.bump();
                let name = self.expect_word()?;
                out = Expression::Member(Box::new(out), name.into(), position);
            } else {
                return Ok(out);
            }
        }
    }

    fn primary(&mut self) -> Parsed {
        let position = self.position();
        match self.kind().clone() {
            TokenKind::Number(value, _) => {
                self.bump();
                Ok(Expression::Number(value))
            }
            TokenKind::Text(text) => {
                self.bump();
                Ok(Expression::Text(text))
            }
            TokenKind::Symbol("(") => {
                self.bump();
                let inner = self.expression()?;
                self.expect(")")?;
                Ok(inner)
            }
            TokenKind::Word(word) => {
                // `G` is the gravity constant, `g` a command that no expression holds.
                let name = word.to_lowercase();
                self.bump();
                if let Some(test) = test_named(&name) {
                    let operand = self.postfix()?;
                    return Ok(Expression::Test(test, Box::new(operand), position));
                }
                if self.is_symbol("(") {
                    if let Some(aggregate) = aggregate_named(&name) {
                        return self.aggregate(aggregate);
                    }
                    let arguments = self.arguments()?;
                    return Ok(Expression::Call(name.into(), arguments, position));
                }
                Ok(Expression::Name(name.into(), position))
            }
            _ => self.expected("an expression"),
        }
    }

    /// Arguments in parentheses.
    fn arguments(&mut self) -> Result<Vec<Expression>, EvolverError> {
        self.expect("(")?;
        let mut arguments = Vec::new();
        if self.accept(")") {
            return Ok(arguments);
        }
        loop {
            arguments.push(self.expression()?);
            if self.accept(")") {
                return Ok(arguments);
            }
            if !self.accept(",") {
                return self.expected("«,» or «)»");
            }
        }
    }

    /// `{1, 2}` or `{{1, 2}, {3, 4}}`.
    pub(crate) fn list(&mut self) -> Parsed {
        let position = self.position();
        self.enter()?;
        self.expect("{")?;
        let mut values = Vec::new();
        while !self.is_symbol("}") {
            values.push(if self.is_symbol("{") { self.list()? } else { self.expression()? });
            if !self.accept(",") {
                break;
            }
        }
        self.expect("}")?;
        self.leave();
        Ok(Expression::List(values, position))
    }

    /// Whether values of an array stand here, and not statements: a number or a name before a comma.
    pub(crate) fn starts_list(&self) -> bool {
        if !self.is_symbol("{") {
            return false;
        }
        let mut depth = 1;
        while matches!(self.ahead(depth).kind, TokenKind::Symbol("{")) {
            depth += 1;
        }
        match self.ahead(depth).kind {
            TokenKind::Number(..) | TokenKind::Symbol("-" | "+" | "(") => true,
            TokenKind::Word(_) => matches!(self.ahead(depth + 1).kind, TokenKind::Symbol(",")),
            _ => false,
        }
    }

    fn aggregate(&mut self, aggregate: Aggregate) -> Parsed {
        let position = self.position();
        self.enter()?;
        self.expect("(")?;
        let query = self.query()?;
        self.expect(",")?;
        let value = self.expression()?;
        self.expect(")")?;
        self.leave();
        Ok(Expression::Aggregate(aggregate, Box::new((query, value)), position))
    }

    /// `vertex vv where …`, `vv.edge ee where …`.
    pub(crate) fn query(&mut self) -> Result<Query, EvolverError> {
        let position = self.position();
        let next_indexes = matches!(self.ahead(1).kind, TokenKind::Symbol("["));
        let kind = word_of(self.token()).and_then(|word| ElementKind::named(&word));
        let (owner, kind) = match kind {
            Some(kind) if !next_indexes => {
                self.bump();
                (None, kind)
            }
            _ => match self.postfix()? {
                Expression::Member(owner, member, at) => match ElementKind::named(&member) {
                    Some(kind) => (Some(*owner), kind),
                    None => return self.invalid(at, format!("«{member}» is no kind of element")),
                },
                Expression::Index(parts, at) => {
                    // One element, as in `fix vertex[3]`.
                    return self.one_element(*parts, at);
                }
                _ => {
                    return self
                        .invalid(position, "expected elements: vertex, edge, facet or body".to_owned());
                }
            },
        };
        let name = match self.word() {
            Some(word) if !is_reserved_after_query(&word) && !self.token().first_on_line => {
                self.bump();
                Some(word.into())
            }
            _ => None,
        };
        let filter = if self.accept_word("where") { Some(self.expression()?) } else { None };
        Ok(Query { owner, kind, name, filter })
    }

    /// `vertex[3]` as the query of the one vertex with that number.
    fn one_element(
        &self,
        parts: [Expression; 2],
        at: crate::evolver::source::Position,
    ) -> Result<Query, EvolverError> {
        let [Expression::Name(base, position), index] = parts else {
            return self.invalid(at, "expected elements: vertex, edge, facet or body");
        };
        let Some(kind) = ElementKind::named(&base) else {
            return self.invalid(position, format!("«{base}» is no kind of element"));
        };
        let id = Expression::Name("id".into(), at);
        let filter = Expression::Binary(Op::Equal, Box::new([id, index]));
        Ok(Query { owner: None, kind, name: None, filter: Some(filter) })
    }
}

fn test_named(name: &str) -> Option<ElementTest> {
    Some(match name {
        "on_constraint" => ElementTest::OnConstraint,
        "hit_constraint" => ElementTest::HitConstraint,
        "on_boundary" => ElementTest::OnBoundary,
        _ => return None,
    })
}

fn aggregate_named(name: &str) -> Option<Aggregate> {
    Some(match name {
        "sum" => Aggregate::Sum,
        "max" => Aggregate::Max,
        "min" => Aggregate::Min,
        "avg" => Aggregate::Average,
        "count" => Aggregate::Count,
        _ => return None,
    })
}

/// Words that follow a query and are not the name of its elements.
fn is_reserved_after_query(word: &str) -> bool {
    [
        "where",
        "do",
        "then",
        "fixed",
        "constraint",
        "constraints",
        "boundary",
        "tension",
        "density",
        "color",
        "frontcolor",
        "backcolor",
        "opacity",
        "no_refine",
        "bare",
        "noncontent",
        "no_display",
        "pressure",
        "volume",
        "target",
        "volconst",
        "coord",
        "x",
        "y",
        "z",
        "value",
        "method_instance",
        "else",
        "orientation",
        "original",
        "attribute",
        "no_hessian_normal",
    ]
    .contains(&word)
}
