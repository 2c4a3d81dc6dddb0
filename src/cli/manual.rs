//! Shell completions and the manual page.

use super::CliError;
use std::io::{self, Write};

/// Print a completion script for a shell to stdout.
#[derive(Debug, clap::Args)]
pub(super) struct CompletionArguments {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the completion script.
pub(super) fn completions(
    arguments: &CompletionArguments,
    mut command: clap::Command,
) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "combwright", &mut script);
    io::stdout().write_all(&script).map_err(CliError::failure)
}

/// Prints one manual page: the program and, behind it, each command.
pub(super) fn page(command: clap::Command) -> Result<(), CliError> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page).map_err(CliError::failure)?;
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
        let named = sub.clone().name(format!("combwright-{}", sub.get_name()));
        clap_mangen::Man::new(named).render(&mut page).map_err(CliError::failure)?;
    }
    io::stdout().write_all(&page).map_err(CliError::failure)
}
