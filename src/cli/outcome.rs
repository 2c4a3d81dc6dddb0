//! How a command ends.

use std::{fmt, process::ExitCode};

/// Why a command ended without its result.
#[derive(Debug)]
pub enum CliError {
    /// Something that the user can mend: exit code 2.
    Mistake(anyhow::Error),
    /// Something that failed on the way, such as a full disk: exit code 1.
    Failure(anyhow::Error),
}

impl CliError {
    /// A user's mistake.
    pub fn mistake(error: impl Into<anyhow::Error>) -> Self {
        Self::Mistake(error.into())
    }

    /// A failure.
    pub fn failure(error: impl Into<anyhow::Error>) -> Self {
        Self::Failure(error.into())
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Self::Mistake(error) | Self::Failure(error)) = self;
        // Errors of the library tell their cause in their own text; only what is not told yet is added.
        let mut told = error.to_string();
        for cause in error.chain().skip(1).map(ToString::to_string) {
            if !told.contains(&cause) {
                told = format!("{told}: {cause}");
            }
        }
        f.write_str(&told)
    }
}

/// Files that cannot be written are failures, unless the place itself was named wrongly.
impl From<crate::report::folder::OutputError> for CliError {
    fn from(error: crate::report::folder::OutputError) -> Self {
        use std::io::ErrorKind::{NotADirectory, NotFound, PermissionDenied, ReadOnlyFilesystem};
        if matches!(error.kind(), NotADirectory | NotFound | PermissionDenied | ReadOnlyFilesystem) {
            Self::mistake(error)
        } else {
            Self::failure(error)
        }
    }
}

impl From<crate::report::figure::FigureError> for CliError {
    fn from(error: crate::report::figure::FigureError) -> Self {
        match error {
            crate::report::figure::FigureError::Output(error) => error.into(),
            other => Self::failure(other),
        }
    }
}

/// Prints the error, if there is one, and gives the exit code.
pub(super) fn exit_code(ended: Result<(), CliError>) -> ExitCode {
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            match error {
                CliError::Mistake(_) => ExitCode::from(2),
                CliError::Failure(_) => ExitCode::from(1),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::WriteError;

    #[test]
    fn a_cause_is_told_once() {
        let disk = || std::io::Error::other("no space");
        let nested =
            CliError::failure(anyhow::Error::new(WriteError::Io(disk())).context("cannot write a.stl"));
        assert_eq!(nested.to_string(), "cannot write a.stl: cannot write the mesh: no space");
        assert_eq!(CliError::failure(WriteError::Io(disk())).to_string(), "cannot write the mesh: no space");
    }
}
