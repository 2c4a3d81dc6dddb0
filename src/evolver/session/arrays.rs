//! Arrays: their entries, whole arrays on the right and left of an assignment, attributes with several numbers.

use super::{
    Session,
    assign::combined,
    evaluate::{Scope, whole},
    format::significant,
};
use crate::evolver::{
    command::Assignment,
    error::EvolverError,
    language::expression::{BinaryOperator, ElementKind, Expression},
    source::Position,
};
use std::{fmt, sync::Arc};

/// How many numbers all arrays may hold together.
const MOST: usize = 4_000_000;

/// Numbers by one or several indices, the last running fastest.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    sizes: Vec<usize>,
    values: Vec<f64>,
    integer: bool,
}

/// The base of `base[i][j]…` and its indices in order.
pub(super) fn indexed<'a>(
    base: &'a Expression,
    last: &'a Expression,
) -> (&'a Expression, Vec<&'a Expression>) {
    let (mut base, mut indices) = (base, vec![last]);
    while let Expression::Index(parts, _) = base {
        // `vertex[1]` is an element and not an entry.
        if matches!(&parts[0], Expression::Name(name, _) if ElementKind::named(name).is_some()) {
            break;
        }
        indices.push(&parts[1]);
        base = &parts[0];
    }
    indices.reverse();
    (base, indices)
}

/// The place of an entry; `None` outside the array.
fn place(sizes: &[usize], at: &[f64]) -> Option<usize> {
    if sizes.len() != at.len() {
        return None;
    }
    sizes.iter().zip(at).try_fold(0, |place, (&size, &index)| {
        let index = whole(index)?.checked_sub(1).filter(|&index| index < size)?;
        Some(place * size + index)
    })
}

impl Array {
    fn new(sizes: Vec<usize>, integer: bool) -> Self {
        let length = sizes.iter().product();
        Self { sizes, values: vec![0.0; length], integer }
    }

    pub(super) fn len(&self) -> usize {
        self.values.len()
    }

    fn set(&mut self, place: usize, value: f64) {
        self.values[place] = if self.integer { value.floor() } else { value };
    }

    /// All places with their indices, as far as both arrays have them.
    fn shared(&self, other: &Self) -> Vec<(usize, usize)> {
        let mut pairs = vec![(0, 0)];
        for (&own, &theirs) in self.sizes.iter().zip(&other.sizes) {
            let both = own.min(theirs);
            pairs = pairs
                .iter()
                .flat_map(|&(a, b)| (0..both).map(move |at| (a * own + at, b * theirs + at)))
                .collect();
        }
        pairs
    }

    /// The part with these first indices.
    fn part(&self, at: &[f64]) -> Option<Self> {
        let (first, rest) = self.sizes.split_at_checked(at.len())?;
        let length: usize = rest.iter().product();
        let start = place(first, at)? * length;
        let values = self.values.get(start..start + length)?.to_vec();
        Some(Self { sizes: rest.to_vec(), values, integer: self.integer })
    }

    fn product(&self, other: &Self) -> Option<Self> {
        let ([rows, inner], [others, columns]) = (&self.sizes[..], &other.sizes[..]) else { return None };
        if inner != others {
            return None;
        }
        let mut product = Self::new(vec![*rows, *columns], false);
        for row in 0..*rows {
            for column in 0..*columns {
                product.values[row * columns + column] = (0..*inner)
                    .map(|at| self.values[row * inner + at] * other.values[at * columns + column])
                    .sum();
            }
        }
        Some(product)
    }
}

impl fmt::Display for Array {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.sizes.is_empty() {
            return write!(f, "{}", significant(self.values.first().copied().unwrap_or(0.0), 15));
        }
        let rest: usize = self.sizes[1..].iter().product();
        f.write_str("{")?;
        for at in 0..self.sizes[0] {
            if at > 0 {
                f.write_str(", ")?;
            }
            let values = self.values[at * rest..(at + 1) * rest].to_vec();
            write!(f, "{}", Self { sizes: self.sizes[1..].to_vec(), values, integer: self.integer })?;
        }
        f.write_str("}")
    }
}

impl Session {
    /// `define name real[n][m]`: a new array, or one with other sizes that keeps what fits.
    pub(super) fn define_array(
        &mut self,
        name: &Arc<str>,
        (sizes, integer): (&[Expression], bool),
        values: Option<&Expression>,
        position: Position,
        scope: &mut Scope,
    ) -> Result<(), EvolverError> {
        if sizes.is_empty() {
            let value = match values {
                Some(value) => self.evaluate(value, scope)?,
                None => self.variables.get(name).unwrap_or(0.0),
            };
            self.variables.set(name, value);
            return Ok(());
        }
        let mut counts = Vec::with_capacity(sizes.len());
        for size in sizes {
            match whole(self.evaluate(size, scope)?) {
                Some(count) => counts.push(count),
                None => {
                    return scope
                        .fail(position, "the size of an array is a whole number that is not negative");
                }
            }
        }
        let others: usize = self.arrays.iter().filter(|(own, _)| *own != name).map(|(_, a)| a.len()).sum();
        let length = counts.iter().try_fold(1_usize, |length, &count| length.checked_mul(count));
        if length.and_then(|length| length.checked_add(others)).is_none_or(|total| total > MOST) {
            return scope.fail(position, format!("arrays hold at most {MOST} numbers together"));
        }
        let mut array = Array::new(counts, integer);
        if let Some(old) = self.arrays.get(name) {
            if old.sizes.len() != array.sizes.len() {
                return scope.fail(position, format!("«{name}» has {} indices", old.sizes.len()));
            }
            for (to, from) in array.shared(old) {
                array.set(to, old.values[from]);
            }
        }
        self.arrays.insert(name.clone(), array);
        match values {
            Some(values) => self.assign_array(name, Assignment::Set, values, position, scope).map(|_| ()),
            None => Ok(()),
        }
    }

    /// One number of an array.
    pub(super) fn array_entry(
        &mut self,
        name: &str,
        at: &[f64],
        position: Position,
        scope: &Scope,
    ) -> Result<&mut f64, EvolverError> {
        let sizes = self.arrays.get(name).map(|array| array.sizes.clone()).unwrap_or_default();
        match self.arrays.get_mut(name).zip(place(&sizes, at)) {
            Some((array, place)) => Ok(&mut array.values[place]),
            None => {
                let index: String = at.iter().map(|at| format!("[{at}]")).collect();
                scope.fail(position, format!("there is no {name}{index}: the sizes of {name} are {sizes:?}"))
            }
        }
    }

    pub(super) fn assign_entry(
        &mut self,
        name: &str,
        at: &[f64],
        operator: Assignment,
        value: f64,
        position: Position,
        scope: &Scope,
    ) -> Result<(), EvolverError> {
        let integer = self.arrays.get(name).is_some_and(|array| array.integer);
        let entry = self.array_entry(name, at, position, scope)?;
        let new = combined(*entry, operator, value);
        *entry = if integer { new.floor() } else { new };
        Ok(())
    }

    /// `a*b` of two arrays with one index.
    pub(super) fn dot_product(&self, operator: BinaryOperator, operands: &[Expression; 2]) -> Option<f64> {
        let (BinaryOperator::Multiply, [Expression::Name(a, _), Expression::Name(b, _)]) =
            (operator, operands)
        else {
            return None;
        };
        let (a, b) = (self.arrays.get(a)?, self.arrays.get(b)?);
        (a.sizes.len() == 1 && a.sizes == b.sizes)
            .then(|| a.values.iter().zip(&b.values).map(|(a, b)| a * b).sum())
    }

    /// The array that an expression is; `None` if it is a number.
    pub(super) fn array_value(
        &mut self,
        expression: &Expression,
        scope: &mut Scope,
    ) -> Result<Option<Array>, EvolverError> {
        match expression {
            Expression::Name(name, _) => Ok(self.arrays.get(name).cloned()),
            Expression::List(..) => self.listed(expression, scope).map(Some),
            Expression::Index(parts, _) => {
                let (base, indices) = indexed(&parts[0], &parts[1]);
                let Some(array) = self.whole_array(base, scope)? else { return Ok(None) };
                if indices.len() >= array.sizes.len() {
                    return Ok(None);
                }
                let mut at = Vec::with_capacity(indices.len());
                for index in indices {
                    at.push(self.evaluate(index, scope)?);
                }
                Ok(array.part(&at))
            }
            Expression::Member(..) => self.whole_array(expression, scope),
            Expression::Binary(operator, operands) => {
                if self.dot_product(*operator, operands).is_some() {
                    return Ok(None);
                }
                self.array_of_two(*operator, operands, scope)
            }
            _ => Ok(None),
        }
    }

    /// An array, or an attribute of several numbers.
    fn whole_array(&mut self, base: &Expression, scope: &mut Scope) -> Result<Option<Array>, EvolverError> {
        match base {
            Expression::Name(name, _) => Ok(self.arrays.get(name).cloned()),
            Expression::Member(owner, name, _) => {
                let known = self.surface.attributes.iter().any(|a| a.name == *name && !a.sizes.is_empty());
                if !known {
                    return Ok(None);
                }
                let element = self.element(owner, scope)?;
                let own = self.surface.attributes.iter().find(|a| a.kind == element.kind && a.name == *name);
                let Some(sizes) = own.map(|attribute| attribute.sizes.clone()) else { return Ok(None) };
                let mut array = Array::new(sizes, false);
                for (at, place) in array.values.iter_mut().zip(1_u32..) {
                    *at = self.attribute(element, name, Some(f64::from(place)))?.unwrap_or(0.0);
                }
                Ok(Some(array))
            }
            _ => Ok(None),
        }
    }

    fn array_of_two(
        &mut self,
        operator: BinaryOperator,
        operands: &[Expression; 2],
        scope: &mut Scope,
    ) -> Result<Option<Array>, EvolverError> {
        let (a, b) = (self.array_value(&operands[0], scope)?, self.array_value(&operands[1], scope)?);
        let combine = |mut a: Array, b: &Array, sign: f64| {
            a.integer = false;
            a.values.iter_mut().zip(&b.values).for_each(|(a, b)| *a += sign * b);
            a
        };
        let scaled = |mut array: Array, factor: f64| {
            array.integer = false;
            array.values.iter_mut().for_each(|value| *value *= factor);
            array
        };
        Ok(match (operator, a, b) {
            (_, None, None) => None,
            (BinaryOperator::Add, Some(a), Some(b)) if a.sizes == b.sizes => Some(combine(a, &b, 1.0)),
            (BinaryOperator::Subtract, Some(a), Some(b)) if a.sizes == b.sizes => Some(combine(a, &b, -1.0)),
            (BinaryOperator::Multiply, Some(a), Some(b)) => match a.product(&b) {
                Some(product) => Some(product),
                None => {
                    return scope.fail(
                        Position::default(),
                        "these arrays cannot be multiplied: their sizes do not fit",
                    );
                }
            },
            (BinaryOperator::Multiply, Some(a), None) => Some(scaled(a, self.evaluate(&operands[1], scope)?)),
            (BinaryOperator::Multiply, None, Some(b)) => Some(scaled(b, self.evaluate(&operands[0], scope)?)),
            _ => {
                return scope.fail(
                    Position::default(),
                    "arrays are added, subtracted and multiplied, with sizes that fit",
                );
            }
        })
    }

    /// The array of `{…}`: rows that are too short end with zeros.
    fn listed(&mut self, list: &Expression, scope: &mut Scope) -> Result<Array, EvolverError> {
        let Expression::List(items, position) = list else {
            let value = self.evaluate(list, scope)?;
            return Ok(Array { sizes: Vec::new(), values: vec![value], integer: false });
        };
        let mut parts = Vec::with_capacity(items.len());
        for item in items {
            parts.push(self.listed(item, scope)?);
        }
        let depth = parts.first().map_or(0, |part| part.sizes.len());
        if parts.iter().any(|part| part.sizes.len() != depth) {
            return scope.fail(*position, "a list holds numbers or lists, not both");
        }
        let inner: Vec<usize> =
            (0..depth).map(|at| parts.iter().map(|part| part.sizes[at]).max().unwrap_or(0)).collect();
        let total = inner.iter().try_fold(parts.len(), |total, &size| total.checked_mul(size));
        if total.is_none_or(|total| total > MOST) {
            return scope.fail(*position, format!("arrays hold at most {MOST} numbers together"));
        }
        let mut sizes = vec![parts.len()];
        sizes.extend(&inner);
        let mut values = Vec::new();
        for part in &parts {
            let mut padded = Array::new(inner.clone(), false);
            for (to, from) in padded.shared(part) {
                padded.values[to] = part.values[from];
            }
            values.extend(padded.values);
        }
        Ok(Array { sizes, values, integer: false })
    }

    /// Assigns to a whole array. False if the name is that of no array.
    pub(super) fn assign_array(
        &mut self,
        name: &str,
        operator: Assignment,
        value: &Expression,
        position: Position,
        scope: &mut Scope,
    ) -> Result<bool, EvolverError> {
        let Some(mut array) = self.arrays.get(name).cloned() else { return Ok(false) };
        match self.array_value(value, scope)? {
            None => {
                let value = self.evaluate(value, scope)?;
                (0..array.len()).for_each(|at| array.set(at, combined(array.values[at], operator, value)));
            }
            Some(other) => {
                if other.sizes.len() != array.sizes.len() {
                    let message = format!(
                        "«{name}» has {} indices, the value {}",
                        array.sizes.len(),
                        other.sizes.len()
                    );
                    return scope.fail(position, message);
                }
                let mut right = vec![0.0; array.len()];
                array.shared(&other).into_iter().for_each(|(to, from)| right[to] = other.values[from]);
                for (at, right) in right.into_iter().enumerate() {
                    array.set(at, combined(array.values[at], operator, right));
                }
            }
        }
        self.arrays.insert(name.into(), array);
        Ok(true)
    }

    /// `vertex[1].name := {…}`.
    pub(super) fn assign_whole_attribute(
        &mut self,
        target: &Expression,
        operator: Assignment,
        value: &Expression,
        position: Position,
        scope: &mut Scope,
    ) -> Result<(), EvolverError> {
        let Expression::Member(owner, name, _) = target else {
            return scope
                .fail(position, "a list is assigned to an array or to an attribute of several numbers");
        };
        let (old, new) = (self.whole_array(target, scope)?, self.listed(value, scope)?);
        let Some(old) = old.filter(|old| old.sizes.len() == new.sizes.len()) else {
            return scope.fail(position, format!("the sizes of «{name}» are not those of the list"));
        };
        let mut right = vec![0.0; old.len()];
        old.shared(&new).into_iter().for_each(|(to, from)| right[to] = new.values[from]);
        let element = self.element(owner, scope)?;
        for (place, right) in (1_u32..).zip(right) {
            let index = Some(f64::from(place));
            self.set_attribute(element, name, index, operator, right, position, scope)?;
        }
        Ok(())
    }

    /// The place, counted from 1, of an entry of an attribute; not a number outside it.
    pub(super) fn flat_index(&self, kind: ElementKind, name: &str, at: &[f64]) -> f64 {
        let own = self.surface.attributes.iter().find(|a| a.kind == kind && *a.name == *name);
        match (own, at) {
            (None, [one]) => *one,
            (Some(attribute), at) => match place(&attribute.sizes, at) {
                Some(place) => (place + 1) as f64,
                None => f64::NAN,
            },
            _ => f64::NAN,
        }
    }
}
