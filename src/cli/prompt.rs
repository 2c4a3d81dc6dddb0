//! The prompt of `evolver run` on a terminal: lines that can be edited, with the history of the session.

use rustyline::{DefaultEditor, config::Config, error::ReadlineError};
use std::io;

/// What was typed.
pub(super) enum Typed {
    /// A line.
    Line(String),
    /// Ctrl-C: the line, and what stood before it, is forgotten.
    Forget,
    /// Ctrl-D.
    End,
}

/// Reads lines from a terminal.
pub(super) struct Prompt {
    editor: DefaultEditor,
    commands: Vec<String>,
}

impl Prompt {
    /// A prompt with an empty history.
    ///
    /// # Errors
    /// Why the terminal cannot be set up.
    pub(super) fn new() -> Result<Self, io::Error> {
        let config = Config::builder().auto_add_history(false).max_history_size(HISTORY).map(|b| b.build());
        let editor = config.and_then(DefaultEditor::with_config).map_err(io::Error::other)?;
        Ok(Self { editor, commands: Vec::new() })
    }

    /// The next line.
    ///
    /// # Errors
    /// Why the terminal cannot be read.
    pub(super) fn line(&mut self, prompt: &str) -> Result<Typed, io::Error> {
        match self.editor.readline(prompt) {
            Ok(line) => Ok(Typed::Line(line)),
            Err(ReadlineError::Interrupted) => Ok(Typed::Forget),
            Err(ReadlineError::Eof) => Ok(Typed::End),
            Err(error) => Err(io::Error::other(error)),
        }
    }

    /// Keeps a command for the arrow keys.
    pub(super) fn remember(&mut self, command: &str) {
        // A history that is full or says the same twice is no fault.
        let _ = self.editor.add_history_entry(command);
        self.commands.push(command.to_owned());
        if self.commands.len() > HISTORY {
            self.commands.remove(0);
        }
    }

    /// The commands so far, the oldest first, each with its number.
    pub(super) fn history(&self) -> String {
        self.commands.iter().enumerate().map(|(at, command)| format!("{}) {command}\n", at + 1)).collect()
    }
}

/// Commands that the history keeps.
const HISTORY: usize = 1000;
