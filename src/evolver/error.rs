//! What can be wrong with a datafile or a command.

use super::source::Place;
use std::io;

/// Why a datafile could not be read or a command not be run.
#[derive(Debug, thiserror::Error)]
pub enum EvolverError {
    /// The text does not follow the grammar.
    #[error("{place}: expected {expected}, found {found}\n{}", place.excerpt())]
    Syntax {
        /// Where.
        place: Place,
        /// What may stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A construct of Surface Evolver that is not supported here.
    #[error("not supported: {what}, {}{}\n{}", place.line_and_column(), hint_text(hint), place.excerpt())]
    Unsupported {
        /// The construct.
        what: String,
        /// Where.
        place: Place,
        /// The nearest way to do it; empty if there is none.
        hint: String,
    },
    /// A statement that is well formed but wrong.
    #[error("{place}: {message}\n{}", place.excerpt())]
    Invalid {
        /// Where.
        place: Place,
        /// What is wrong and what to do.
        message: String,
    },
    /// The surface itself is wrong.
    #[error("{0}")]
    Surface(String),
    /// A computation without a result.
    #[error("{0}")]
    Numerical(String),
    /// The step budget ran out.
    #[error("stopped after {0} commands: a loop does not seem to end (raise the budget with --max-commands)")]
    Budget(u64),
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
    /// The file is too large.
    #[error(
        "{name} holds {bytes} bytes; datafiles of up to {limit} bytes are read. Is it a datafile of Surface Evolver?"
    )]
    TooLarge {
        /// The file.
        name: String,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// A file could not be read or written.
    #[error("{name}: {error}")]
    File {
        /// The file.
        name: String,
        /// Why not.
        error: io::Error,
    },
}

fn hint_text(hint: &str) -> String {
    if hint.is_empty() { String::new() } else { format!(" ({hint})") }
}
