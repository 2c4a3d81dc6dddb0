//! Statements: blocks, loops, conditions, assignments, redirection and repetition.

use super::{Action, Assignment, Simple, Statement};
use crate::evolver::{
    error::EvolverError,
    language::{
        Cursor, TokenKind,
        expression::{ElementKind, Expression},
    },
};
use std::sync::Arc;

type Parsed = Result<Action, EvolverError>;

/// All statements up to the end of the text. A line's end ends a statement that is complete.
pub(crate) fn statements(cursor: &mut Cursor) -> Result<Vec<Statement>, EvolverError> {
    let mut out = Vec::new();
    loop {
        while cursor.accept(";") {}
        if cursor.at_end() {
            return Ok(out);
        }
        out.push(statement(cursor)?);
        if !cursor.at_end() && !cursor.is_symbol(";") && !cursor.token().first_on_line {
            return cursor.expected("«;» or the end of the line");
        }
    }
}

/// One statement with its repetition and redirection.
pub(super) fn statement(cursor: &mut Cursor) -> Result<Statement, EvolverError> {
    let position = cursor.position();
    cursor.enter()?;
    let mut action = simple_statement(cursor)?;
    loop {
        let here = !cursor.token().first_on_line;
        if here && repeatable(&action) && starts_count(cursor) {
            let count = cursor.expression()?;
            action = Action::Repeat(Box::new(Statement { position, action }), count);
        } else if here && (cursor.is_symbol(">>") || cursor.is_symbol("|")) {
            if cursor.accept("|") {
                return cursor.unsupported(
                    position,
                    "a pipe to another program",
                    "redirect to a file with >>",
                );
            }
            cursor.bump();
            let name = cursor.postfix()?;
            action = Action::Redirect(Box::new(Statement { position, action }), name, true);
        } else {
            break;
        }
    }
    cursor.leave();
    Ok(Statement { position, action })
}

/// Whether a number behind the statement says how often it runs.
fn repeatable(action: &Action) -> bool {
    matches!(
        action,
        Action::Block(_)
            | Action::Call(_)
            | Action::Simple(Simple::Refine | Simple::Equiangulate | Simple::Average | Simple::Hessian)
    )
}

fn starts_count(cursor: &Cursor) -> bool {
    matches!(cursor.kind(), TokenKind::Number(..))
}

pub(super) fn block(cursor: &mut Cursor) -> Parsed {
    cursor.expect("{")?;
    let mut out = Vec::new();
    loop {
        while cursor.accept(";") {}
        if cursor.accept("}") {
            return Ok(Action::Block(out));
        }
        if cursor.at_end() {
            return cursor.expected("«}»");
        }
        let compound = cursor.is_symbol("{");
        out.push(statement(cursor)?);
        let ended_with_block = compound
            || matches!(
                out.last().map(|s| &s.action),
                Some(
                    Action::If(..)
                        | Action::While(..)
                        | Action::For(..)
                        | Action::Foreach(..)
                        | Action::DoWhile(..)
                        | Action::Routine(..)
                )
            );
        if !cursor.is_symbol(";")
            && !cursor.is_symbol("}")
            && !ended_with_block
            && !cursor.token().first_on_line
        {
            return cursor.expected("«;» or «}»");
        }
    }
}

fn boxed(cursor: &mut Cursor) -> Result<Box<Statement>, EvolverError> {
    statement(cursor).map(Box::new)
}

fn simple_statement(cursor: &mut Cursor) -> Parsed {
    if cursor.is_symbol("{") {
        return block(cursor);
    }
    if cursor.accept("!") {
        return cursor.unsupported(cursor.position(), "the history command «!»", "use the arrow keys");
    }
    if cursor.accept("?") {
        return Ok(Action::Simple(Simple::Help));
    }
    let Some(word) = cursor.word() else {
        return cursor.expected("a command");
    };
    match word.as_str() {
        "if" => {
            cursor.bump();
            condition(cursor)
        }
        "while" => {
            cursor.bump();
            let test = cursor.expression()?;
            cursor.accept_word("do");
            Ok(Action::While(test, boxed(cursor)?))
        }
        "do" => {
            cursor.bump();
            let body = boxed(cursor)?;
            cursor.accept(";");
            if !cursor.accept_word("while") {
                return cursor.expected("«while» and a condition");
            }
            Ok(Action::DoWhile(body, cursor.expression()?))
        }
        "for" => {
            cursor.bump();
            for_loop(cursor)
        }
        "foreach" => {
            cursor.bump();
            let query = cursor.query()?;
            if !cursor.accept_word("do") {
                return cursor.expected("«do» and a command");
            }
            Ok(Action::Foreach(query, boxed(cursor)?))
        }
        "local" => {
            cursor.bump();
            super::routine::locals(cursor)
        }
        "function" | "procedure" => {
            cursor.bump();
            super::routine::routine(cursor, word == "function")
        }
        "break" | "continue" => {
            cursor.bump();
            Ok(Action::Simple(if word == "break" { Simple::Break } else { Simple::Continue }))
        }
        "return" => {
            cursor.bump();
            super::actions::optional_number(cursor).map(Action::Return)
        }
        _ => match assignment(cursor)? {
            Some(action) => Ok(action),
            None => super::actions::action(cursor, &word),
        },
    }
}

fn condition(cursor: &mut Cursor) -> Parsed {
    let test = cursor.expression()?;
    cursor.accept_word("then");
    let yes = boxed(cursor)?;
    let mark = cursor.mark();
    while cursor.accept(";") {}
    if cursor.accept_word("else") {
        return Ok(Action::If(test, yes, Some(boxed(cursor)?)));
    }
    cursor.rewind(mark);
    Ok(Action::If(test, yes, None))
}

fn for_loop(cursor: &mut Cursor) -> Parsed {
    cursor.expect("(")?;
    let first = statement(cursor)?;
    cursor.expect(";")?;
    let test = cursor.expression()?;
    cursor.expect(";")?;
    let next = statement(cursor)?;
    cursor.expect(")")?;
    let body = boxed(cursor)?;
    Ok(Action::For(Box::new([first, next]), test, body))
}

fn assignment_operator(cursor: &Cursor) -> Option<Assignment> {
    Some(match cursor.kind() {
        TokenKind::Symbol(":=") => Assignment::Set,
        TokenKind::Symbol("+=") => Assignment::Add,
        TokenKind::Symbol("-=") => Assignment::Subtract,
        TokenKind::Symbol("*=") => Assignment::Multiply,
        TokenKind::Symbol("/=") => Assignment::Divide,
        _ => return None,
    })
}

/// Whether a command on elements stands where a value could: `cells := show facet where …`.
fn starts_command(cursor: &Cursor) -> bool {
    let known = ["show", "list", "set", "unset", "refine", "delete", "fix", "unfix", "foreach"];
    let kind = match &cursor.ahead(1).kind {
        TokenKind::Word(word) => ElementKind::named(&word.to_lowercase()),
        _ => None,
    };
    let Some(word) = cursor.word() else { return false };
    let display = ["transform_expr", "transforms"].contains(&word.as_str());
    display || (kind.is_some() && known.contains(&word.as_str()))
}

/// Whether `++` or `--` stands `ahead` tokens from here, with nothing behind it that it could be added to.
fn steps(cursor: &Cursor, ahead: usize) -> bool {
    let sign = |at: usize| match cursor.ahead(at).kind {
        TokenKind::Symbol(sign @ ("+" | "-")) => Some(sign),
        _ => None,
    };
    let close = !cursor.ahead(ahead + 1).space_before && !cursor.ahead(ahead + 1).first_on_line;
    let behind = cursor.ahead(ahead + 2);
    let ends =
        behind.first_on_line || matches!(behind.kind, TokenKind::Symbol(";" | "}" | ")") | TokenKind::End);
    sign(ahead).is_some() && sign(ahead) == sign(ahead + 1) && close && ends
}

fn assigned(target: Expression, operator: Assignment, value: Expression) -> Action {
    match target {
        Expression::Name(name, _) => Action::Assign(name, operator, value),
        target => Action::AssignMember(target, operator, value),
    }
}

/// An assignment, if one begins here.
fn assignment(cursor: &mut Cursor) -> Result<Option<Action>, EvolverError> {
    let follows = match cursor.ahead(1).kind {
        TokenKind::Symbol(":=" | "+=" | "-=" | "*=" | "/=" | "[" | ".") => true,
        TokenKind::Symbol("+" | "-") => steps(cursor, 1),
        TokenKind::Symbol("=") => {
            return cursor.expected("a command; assignments are written with «:=»");
        }
        _ => false,
    };
    if !follows {
        return Ok(None);
    }
    let mark = cursor.mark();
    let target = cursor.postfix()?;
    if steps(cursor, 0) {
        let operator = if cursor.is_symbol("+") { Assignment::Add } else { Assignment::Subtract };
        cursor.bump();
        cursor.bump();
        return Ok(Some(assigned(target, operator, Expression::Number(1.0))));
    }
    let Some(operator) = assignment_operator(cursor) else {
        cursor.rewind(mark);
        return Ok(None);
    };
    cursor.bump();
    if cursor.starts_list() {
        return Ok(Some(assigned(target, operator, cursor.list()?)));
    }
    let Expression::Name(name, _) = &target else {
        return Ok(Some(Action::AssignMember(target, operator, cursor.expression()?)));
    };
    if operator == Assignment::Set && cursor.is_symbol("{") {
        let position = cursor.position();
        let action = block(cursor)?;
        return Ok(Some(Action::Define(name.clone(), Arc::new(Statement { position, action }))));
    }
    if operator == Assignment::Set && starts_command(cursor) {
        let body = statement(cursor)?;
        return Ok(Some(Action::Define(name.clone(), Arc::new(body))));
    }
    let value = cursor.expression()?;
    if matches!(value, Expression::Text(_))
        || matches!(&value, Expression::Call(name, _, _) if &**name == "sprintf")
    {
        return Ok(Some(Action::AssignText(name.clone(), value)));
    }
    Ok(Some(Action::Assign(name.clone(), operator, value)))
}
