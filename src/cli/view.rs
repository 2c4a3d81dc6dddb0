//! `combwright view`: the page of a folder, opened in the browser.

use super::CliError;
use crate::report::page::PAGE_NAME;
use anyhow::anyhow;
use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// Open the page of a folder of results. It needs no server and no network.
#[derive(Debug, clap::Args)]
pub(super) struct ViewArguments {
    /// The folder that holds report.html, or the page itself
    #[arg(value_name = "FOLDER", default_value = "demo-out")]
    folder: PathBuf,
    /// Only name the page
    #[arg(long)]
    no_open: bool,
}

/// Runs the command.
pub(super) fn run(arguments: &ViewArguments) -> Result<(), CliError> {
    let given = &arguments.folder;
    let page = if given.is_dir() { given.join(PAGE_NAME) } else { given.clone() };
    let page = page.canonicalize().map_err(|error| {
        CliError::mistake(anyhow!(
            "no page at {}: {error}; make one with: combwright demo -o {}",
            page.display(),
            given.display()
        ))
    })?;
    println!("{}", page.display());
    if arguments.no_open || open(&page) {
        return Ok(());
    }
    Err(CliError::failure(anyhow!("no browser could be started; open the page named above by hand")))
}

/// Hands the page to the system's opener.
fn open(page: &Path) -> bool {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(target_os = "windows") {
        "explorer"
    } else {
        "xdg-open"
    };
    let started = Command::new(opener).arg(page).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    started.is_ok()
}
