//! A place in a list of tokens.

use super::lexer::{Token, TokenKind, tokens};
use crate::evolver::{
    error::EvolverError,
    source::{Place, Position, Source},
};
use std::sync::Arc;

/// How deep expressions and blocks may nest, so that no text exhausts the stack.
pub(crate) const DEPTH: usize = 120;

/// Reads tokens one by one.
#[derive(Debug)]
pub(crate) struct Cursor {
    source: Arc<Source>,
    tokens: Vec<Token>,
    at: usize,
    pub(crate) depth: usize,
}

impl Cursor {
    /// The tokens of a text.
    pub(crate) fn new(source: &Arc<Source>) -> Result<Self, EvolverError> {
        Ok(Self { source: source.clone(), tokens: tokens(source)?, at: 0, depth: 0 })
    }

    pub(crate) fn token(&self) -> &Token {
        &self.tokens[self.at.min(self.tokens.len() - 1)]
    }

    pub(crate) fn kind(&self) -> &TokenKind {
        &self.token().kind
    }

    pub(crate) fn ahead(&self, count: usize) -> &Token {
        &self.tokens[(self.at + count).min(self.tokens.len() - 1)]
    }

    pub(crate) fn position(&self) -> Position {
        self.token().position
    }

    pub(crate) fn bump(&mut self) {
        if self.at + 1 < self.tokens.len() {
            self.at += 1;
        }
    }

    pub(crate) fn at_end(&self) -> bool {
        *self.kind() == TokenKind::End
    }

    /// Where the cursor stands, to come back to.
    pub(crate) fn mark(&self) -> usize {
        self.at
    }

    pub(crate) fn rewind(&mut self, mark: usize) {
        self.at = mark;
    }

    /// The word that stands here, in lower case.
    pub(crate) fn word(&self) -> Option<String> {
        word_of(self.token())
    }

    /// Takes the word if it stands here.
    pub(crate) fn accept_word(&mut self, word: &str) -> bool {
        let here = matches!(self.kind(), TokenKind::Word(here) if here.eq_ignore_ascii_case(word));
        if here {
            self.bump();
        }
        here
    }

    /// Takes any of the words if one stands here.
    pub(crate) fn accept_any(&mut self, words: &[&str]) -> bool {
        words.iter().any(|word| self.accept_word(word))
    }

    pub(crate) fn is_symbol(&self, symbol: &str) -> bool {
        matches!(self.kind(), TokenKind::Symbol(here) if *here == symbol)
    }

    pub(crate) fn accept(&mut self, symbol: &str) -> bool {
        let here = self.is_symbol(symbol);
        if here {
            self.bump();
        }
        here
    }

    pub(crate) fn expect(&mut self, symbol: &str) -> Result<(), EvolverError> {
        if self.accept(symbol) { Ok(()) } else { self.expected(&format!("«{symbol}»")) }
    }

    pub(crate) fn expect_word(&mut self) -> Result<String, EvolverError> {
        match self.word() {
            Some(word) => {
                self.bump();
                Ok(word)
            }
            None => self.expected("a name"),
        }
    }

    /// A whole number, with a sign if it has one.
    pub(crate) fn integer(&mut self) -> Result<i64, EvolverError> {
        let mark = self.mark();
        let negative = self.accept("-");
        if !negative {
            self.accept("+");
        }
        if let TokenKind::Number(value, true) = *self.kind()
            && value < 2_147_483_648.0
        {
            self.bump();
            #[expect(clippy::cast_possible_truncation, reason = "a whole number below 2³¹")]
            let value = value as i64;
            return Ok(if negative { -value } else { value });
        }
        self.rewind(mark);
        self.expected("a whole number")
    }

    pub(crate) fn place(&self) -> Place {
        self.place_at(self.position())
    }

    pub(crate) fn place_at(&self, position: Position) -> Place {
        Place { source: self.source.clone(), position }
    }

    /// The error of something else standing here.
    pub(crate) fn expected<T>(&self, expected: &str) -> Result<T, EvolverError> {
        let found = match self.kind() {
            TokenKind::Number(value, _) => format!("the number {value}"),
            TokenKind::Word(word) => format!("the word «{word}»"),
            TokenKind::Text(text) => format!("the text \"{}\"", text.chars().take(40).collect::<String>()),
            TokenKind::Symbol(symbol) => format!("«{symbol}»"),
            TokenKind::End => "the end of the text".to_owned(),
        };
        Err(EvolverError::Syntax { place: self.place(), expected: expected.to_owned(), found })
    }

    pub(crate) fn unsupported<T>(
        &self,
        position: Position,
        what: &str,
        hint: &str,
    ) -> Result<T, EvolverError> {
        let place = self.place_at(position);
        Err(EvolverError::Unsupported { what: what.to_owned(), place, hint: hint.to_owned() })
    }

    pub(crate) fn invalid<T>(
        &self,
        position: Position,
        message: impl Into<String>,
    ) -> Result<T, EvolverError> {
        Err(EvolverError::Invalid { place: self.place_at(position), message: message.into() })
    }

    /// Goes one level deeper; an error where that would be too deep.
    pub(crate) fn enter(&mut self) -> Result<(), EvolverError> {
        self.depth += 1;
        if self.depth > DEPTH {
            return self.invalid(self.position(), format!("nested deeper than {DEPTH} levels"));
        }
        Ok(())
    }

    pub(crate) fn leave(&mut self) {
        self.depth -= 1;
    }
}

/// The word of a token in lower case.
pub(crate) fn word_of(token: &Token) -> Option<String> {
    match &token.kind {
        TokenKind::Word(word) => Some(word.to_lowercase()),
        _ => None,
    }
}
