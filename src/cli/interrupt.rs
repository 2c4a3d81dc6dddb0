//! What happens at Ctrl-C.

use std::{fs, path::Path, process};

/// The exit code of a program ended by an interrupt: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

/// At Ctrl-C (or a polite kill) removes the files on their way and ends. What the output folder held is untouched.
///
/// Only the first call in a process counts; where no handler can be set, an interrupt leaves the temporary files behind.
pub(super) fn remove_on_interrupt(staging: &Path) {
    let staging = staging.to_path_buf();
    let set = ctrlc::set_handler(move || {
        // There is no one left to tell if this fails.
        let _ = fs::remove_dir_all(&staging);
        process::exit(INTERRUPTED);
    });
    if let Err(error) = set {
        eprintln!("note: Ctrl-C will leave temporary files: {error}");
    }
}
