//! The language shared by datafiles and commands: tokens, expressions, and formulas with exact derivatives.
//!
//! | step | file |
//! |---|---|
//! | text to tokens, macros expanded | `lexer.rs` |
//! | reading tokens with clear errors | `cursor.rs` |
//! | expressions as trees | `expression.rs`, `parse.rs` |
//! | value, gradient and Hessian of an expression | `jet.rs`, `function.rs`, `formula.rs` |

pub(crate) mod cursor;
pub mod expression;
pub mod formula;
mod function;
pub mod jet;
pub(crate) mod lexer;
mod parse;

pub(crate) use cursor::Cursor;
pub(crate) use lexer::TokenKind;
