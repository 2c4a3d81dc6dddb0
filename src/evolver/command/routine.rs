//! Procedures and functions with arguments, local variables, arrays.

use super::{Action, Routine, Simple, Statement, parse::block};
use crate::evolver::{
    error::EvolverError,
    language::{Cursor, TokenKind},
    source::Position,
};
use std::sync::Arc;

type Parsed = Result<Action, EvolverError>;

/// The rest of `function real name(real a, integer b) { … }` or `procedure name(real a) { … }` behind its first word. A
/// prototype does nothing: procedures are looked for when they are called.
pub(crate) fn routine(cursor: &mut Cursor, function: bool) -> Parsed {
    if function && !cursor.accept_any(&["real", "integer"]) {
        return cursor.expected("«real», the type of what the function returns");
    }
    let name: Arc<str> = cursor.expect_word()?.into();
    let arguments = arguments(cursor)?;
    if !cursor.is_symbol("{") {
        return Ok(Action::Simple(Simple::Nothing));
    }
    let position = cursor.position();
    let body = Statement { position, action: block(cursor)? };
    Ok(Action::Routine(name, Arc::new(Routine { arguments, body, function })))
}

/// `(real a, integer b)`.
pub(crate) fn arguments(cursor: &mut Cursor) -> Result<Vec<Arc<str>>, EvolverError> {
    let mut arguments = Vec::new();
    cursor.expect("(")?;
    while !cursor.accept(")") {
        if !cursor.accept_any(&["real", "integer"]) {
            return cursor.expected("the type of an argument, «real», or «)»");
        }
        arguments.push(cursor.expect_word()?.into());
        if !cursor.is_symbol(")") {
            cursor.expect(",")?;
        }
    }
    Ok(arguments)
}

/// The names behind `local`.
pub(super) fn locals(cursor: &mut Cursor) -> Parsed {
    let mut names: Vec<Arc<str>> = vec![cursor.expect_word()?.into()];
    while cursor.accept(",") {
        names.push(cursor.expect_word()?.into());
    }
    Ok(Action::Local(names))
}

/// The rest of `define name real[2][3] = {{1, 2, 3}, {4, 5, 6}}` behind the name.
pub(crate) fn array(cursor: &mut Cursor, position: Position, name: &str) -> Parsed {
    let integer = cursor.accept_word("integer");
    if !integer && !cursor.accept_word("real") {
        if cursor.word().as_deref() == Some("string") {
            return cursor.unsupported(position, "an array of texts", "");
        }
        return cursor.expected("«real» or «integer»");
    }
    let mut sizes = Vec::new();
    while cursor.accept("[") {
        sizes.push(cursor.expression()?);
        cursor.expect("]")?;
    }
    let values = if matches!(cursor.kind(), TokenKind::Symbol("=" | ":=")) {
        cursor.bump();
        Some(if cursor.is_symbol("{") { cursor.list()? } else { cursor.expression()? })
    } else {
        None
    };
    Ok(Action::DefineArray(name.into(), sizes, integer, values))
}
