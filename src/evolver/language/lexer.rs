//! Text to tokens: comments, line splices and `#define` macros are gone afterwards, positions stay.

use crate::evolver::{
    error::EvolverError,
    source::{Place, Position, Source},
};
use std::{collections::BTreeMap, sync::Arc};

/// What a token is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TokenKind {
    /// A number as written, and whether it was written as an integer.
    Number(f64, bool),
    /// A word as written.
    Word(Arc<str>),
    /// A text in quotes, escapes resolved.
    Text(Arc<str>),
    /// An operator or a bracket.
    Symbol(&'static str),
    /// The end of the text.
    End,
}

/// A token with its place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Token {
    pub(crate) kind: TokenKind,
    pub(crate) position: Position,
    /// Whether it is the first on its line; spliced lines count as one.
    pub(crate) first_on_line: bool,
    /// Whether blank space stands before it.
    pub(crate) space_before: bool,
}

/// All operators, the longest first.
const SYMBOLS: [&str; 41] = [
    "::=", ":=", "+=", "-=", "*=", "/=", "==", "!=", "<=", ">=", "&&", "||", ">>", "<<", "**", "->", "(",
    ")", "[", "]", "{", "}", ",", ";", ":", "?", "+", "-", "*", "/", "%", "^", "=", "<", ">", "!", ".", "|",
    "@", "#", "'",
];

/// How deep macros may use macros, and how many tokens they may make: enough for any file written by hand.
const MACRO_DEPTH: usize = 40;
const MACRO_TOKENS: usize = 4_000_000;

/// Cuts a text into tokens.
pub(crate) fn tokens(source: &Arc<Source>) -> Result<Vec<Token>, EvolverError> {
    let mut lexer = Lexer {
        source,
        rest: &source.text,
        position: Position { line: 1, column: 1 },
        first: true,
        space: false,
        out: Vec::new(),
    };
    let mut macros: BTreeMap<Arc<str>, Vec<Token>> = BTreeMap::new();
    while lexer.next_token()? {
        if let Some(at) = lexer.defines() {
            let (name, body) = lexer.macro_line(at)?;
            macros.insert(name, body);
        }
    }
    let mut expanded = Vec::with_capacity(lexer.out.len());
    if macros.is_empty() {
        expanded = lexer.out;
    } else {
        for token in &lexer.out {
            expand(token, None, &macros, 0, &mut expanded, source)?;
        }
    }
    expanded.push(Token {
        kind: TokenKind::End,
        position: lexer.position,
        first_on_line: true,
        space_before: true,
    });
    Ok(expanded)
}

fn expand(
    token: &Token,
    used_at: Option<&Token>,
    macros: &BTreeMap<Arc<str>, Vec<Token>>,
    depth: usize,
    out: &mut Vec<Token>,
    source: &Arc<Source>,
) -> Result<(), EvolverError> {
    let place = |position| Place { source: source.clone(), position };
    if let TokenKind::Word(word) = &token.kind
        && let Some(body) = macros.get(word)
    {
        if depth >= MACRO_DEPTH || out.len() > MACRO_TOKENS {
            let message = format!("the macro {word} expands without end; does it use itself?");
            return Err(EvolverError::Invalid { place: place(token.position), message });
        }
        let at = used_at.unwrap_or(token);
        for (index, inner) in body.iter().enumerate() {
            let start = out.len();
            expand(inner, Some(at), macros, depth + 1, out, source)?;
            // The expansion stands where its name stood.
            if index == 0
                && let Some(first) = out.get_mut(start)
            {
                (first.first_on_line, first.space_before) = (token.first_on_line, token.space_before);
            }
        }
        return Ok(());
    }
    let mut token = token.clone();
    if let Some(at) = used_at {
        token.position = at.position;
        token.first_on_line = false;
    }
    out.push(token);
    Ok(())
}

struct Lexer<'a> {
    source: &'a Arc<Source>,
    rest: &'a str,
    position: Position,
    first: bool,
    space: bool,
    out: Vec<Token>,
}

impl<'a> Lexer<'a> {
    fn advance(&mut self, bytes: usize) {
        let (taken, rest) = self.rest.split_at(bytes);
        for c in taken.chars() {
            if c == '\n' {
                self.position = Position { line: self.position.line + 1, column: 1 };
            } else {
                self.position.column += 1;
            }
        }
        self.rest = rest;
    }

    fn fail<T>(&self, expected: &str, found: String) -> Result<T, EvolverError> {
        let place = Place { source: self.source.clone(), position: self.position };
        Err(EvolverError::Syntax { place, expected: expected.to_owned(), found })
    }

    /// Skips blanks, comments and splices.
    fn skip(&mut self) -> Result<(), EvolverError> {
        loop {
            let Some(c) = self.rest.chars().next() else { return Ok(()) };
            if c == '\n' {
                self.first = true;
                self.space = true;
                self.advance(1);
            } else if c.is_whitespace() || c == '\u{feff}' || c == '\0' {
                self.space = true;
                self.advance(c.len_utf8());
            } else if self.rest.starts_with("//") {
                let end = self.rest.find('\n').unwrap_or(self.rest.len());
                self.advance(end);
            } else if self.rest.starts_with("/*") {
                let Some(end) = self.rest.find("*/") else {
                    return self.fail("the comment's end «*/»", "the end of the text".to_owned());
                };
                // A comment over several lines ends the line that it starts on.
                self.first |= self.rest[..end].contains('\n');
                self.space = true;
                self.advance(end + 2);
            } else if c == '\\' && self.rest[1..].trim_start_matches([' ', '\t', '\r']).starts_with('\n') {
                let end = self.rest.find('\n').map_or(self.rest.len(), |at| at + 1);
                self.advance(end);
                self.space = true;
            } else {
                return Ok(());
            }
        }
    }

    fn push(&mut self, kind: TokenKind, position: Position) {
        let (first_on_line, space_before) = (self.first, self.space);
        self.out.push(Token { kind, position, first_on_line, space_before });
        (self.first, self.space) = (false, false);
    }

    /// Reads one token; false at the end.
    fn next_token(&mut self) -> Result<bool, EvolverError> {
        self.skip()?;
        let Some(c) = self.rest.chars().next() else { return Ok(false) };
        let position = self.position;
        if c.is_ascii_digit() || (c == '.' && self.rest[1..].starts_with(|next: char| next.is_ascii_digit()))
        {
            let (kind, length) = self.number()?;
            self.advance(length);
            self.push(kind, position);
        } else if c.is_alphabetic() || c == '_' {
            let end = self.rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(self.rest.len());
            let word: Arc<str> = self.rest[..end].into();
            self.advance(end);
            self.push(TokenKind::Word(word), position);
        } else if c == '"' {
            let text = self.quoted()?;
            self.push(TokenKind::Text(text.into()), position);
        } else if let Some(symbol) = SYMBOLS.iter().find(|symbol| self.rest.starts_with(**symbol)) {
            self.advance(symbol.len());
            let symbol = if *symbol == "::=" { ":=" } else { symbol };
            self.push(TokenKind::Symbol(symbol), position);
        } else {
            return self
                .fail("a word, a number or an operator", format!("the character «{}»", c.escape_debug()));
        }
        Ok(true)
    }

    fn number(&self) -> Result<(TokenKind, usize), EvolverError> {
        let bytes = self.rest.as_bytes();
        let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        if bytes.len() > 2 && bytes[0] == b'0' && bytes[1] | 32 == b'x' && bytes[2].is_ascii_hexdigit() {
            let count = bytes[2..].iter().take_while(|b| b.is_ascii_hexdigit()).count();
            let value = self.rest[2..2 + count]
                .chars()
                .fold(0.0, |v, c| 16.0 * v + f64::from(c.to_digit(16).unwrap_or(0)));
            return Ok((TokenKind::Number(value, true), 2 + count));
        }
        let mut end = digits(0);
        let mut integer = true;
        if bytes.get(end) == Some(&b'.') {
            integer = false;
            end += 1 + digits(end + 1);
        }
        if bytes.get(end).is_some_and(|b| b | 32 == b'e') {
            let sign = usize::from(bytes.get(end + 1).is_some_and(|b| *b == b'+' || *b == b'-'));
            let exponent = digits((end + 1 + sign).min(bytes.len()));
            if exponent > 0 {
                integer = false;
                end += 1 + sign + exponent;
            }
        }
        match self.rest[..end].parse() {
            Ok(value) => Ok((TokenKind::Number(value, integer), end)),
            Err(_) => self.fail("a number", format!("«{}»", &self.rest[..end])),
        }
    }

    fn quoted(&mut self) -> Result<String, EvolverError> {
        let mut text = String::new();
        let mut characters = self.rest.char_indices().skip(1);
        loop {
            let Some((at, c)) = characters.next() else {
                return self.fail("the closing quote", "the end of the text".to_owned());
            };
            match c {
                '"' => {
                    self.advance(at + 1);
                    return Ok(text);
                }
                '\\' => match characters.next().map(|(_, c)| c) {
                    Some('n') => text.push('\n'),
                    Some('t') => text.push('\t'),
                    Some('r') => text.push('\r'),
                    Some('\n') => {}
                    Some(other) => text.push(other),
                    None => {}
                },
                _ => text.push(c),
            }
        }
    }

    /// Whether the last token was the word `define` after a `#` at the start of a line: where the `#` is.
    fn defines(&self) -> Option<usize> {
        let at = self.out.len().checked_sub(2)?;
        let hash = self.out[at].kind == TokenKind::Symbol("#") && self.out[at].first_on_line;
        let word = matches!(&self.out[at + 1].kind, TokenKind::Word(word) if &**word == "define");
        (hash && word).then_some(at)
    }

    /// The name and the tokens of the macro whose `#define` starts at `at`, up to the end of the line.
    fn macro_line(&mut self, at: usize) -> Result<(Arc<str>, Vec<Token>), EvolverError> {
        let line_end = at + 2;
        loop {
            let (rest, position, first, space) = (self.rest, self.position, self.first, self.space);
            if !self.next_token()? {
                break;
            }
            if self.out.last().is_some_and(|token| token.first_on_line) {
                // The token belongs to the next line: give it back.
                self.out.pop();
                (self.rest, self.position, self.first, self.space) = (rest, position, first, space);
                break;
            }
        }
        let body = self.out.split_off(line_end);
        self.out.truncate(at);
        let mut body = body.into_iter();
        match body.next().map(|token| token.kind) {
            Some(TokenKind::Word(name)) => Ok((name, body.collect())),
            _ => self.fail("a name after #define", "no name".to_owned()),
        }
    }
}
