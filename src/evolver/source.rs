//! Texts with names, and places in them.

use std::{fmt, sync::Arc};

/// The longest line that an error message shows.
const EXCERPT: usize = 160;

/// A text that was read: a datafile, or a line of commands.
#[derive(Debug, PartialEq, Eq)]
pub struct Source {
    /// The file's name, or what stands for it.
    pub name: String,
    /// The whole text.
    pub text: String,
}

impl Source {
    /// A named text.
    #[must_use]
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Arc<Self> {
        Arc::new(Self { name: name.into(), text: text.into() })
    }
}

/// A line and a column, both from 1; columns count characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// The line.
    pub line: u32,
    /// The column.
    pub column: u32,
}

/// A position in a text.
#[derive(Clone, PartialEq, Eq)]
pub struct Place {
    /// The text.
    pub source: Arc<Source>,
    /// Where in it.
    pub position: Position,
}

impl Place {
    /// «line L, column C».
    #[must_use]
    pub fn line_and_column(&self) -> String {
        format!("line {}, column {}", self.position.line, self.position.column)
    }

    /// The line with a mark below the place.
    #[must_use]
    pub fn excerpt(&self) -> String {
        let line = (self.position.line as usize).saturating_sub(1);
        let text = self.source.text.lines().nth(line).unwrap_or_default();
        let column = (self.position.column as usize).saturating_sub(1);
        let first = column.saturating_sub(EXCERPT / 2);
        let shown: String = text
            .chars()
            .skip(first)
            .take(EXCERPT)
            .map(|c| if c == '\t' || c.is_control() { ' ' } else { c })
            .collect();
        format!("    {}\n    {}^", shown.trim_end(), " ".repeat(column - first))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.source.name, self.line_and_column())
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
