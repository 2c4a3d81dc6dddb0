//! What happens at Ctrl-C: files on their way are removed, or the work ends at the next safe place.

use std::{
    fs,
    ops::ControlFlow,
    path::Path,
    process,
    sync::{
        Once,
        atomic::{AtomicBool, Ordering},
    },
};

/// The exit code of a program ended by an interrupt: 128 + SIGINT.
const INTERRUPTED: i32 = 130;

/// Whether an interrupt was asked for since [`listen`].
static ASKED: AtomicBool = AtomicBool::new(false);
static LISTENING: Once = Once::new();

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

/// From now on Ctrl-C only asks to stop, as [`flow`] tells. A second one ends the program at once.
pub(super) fn listen() {
    LISTENING.call_once(|| {
        let set = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::SeqCst) {
                process::exit(INTERRUPTED);
            }
        });
        if let Err(error) = set {
            eprintln!("note: Ctrl-C will end the program without a checkpoint: {error}");
        }
    });
}

/// Whether to go on.
pub(super) fn flow() -> ControlFlow<()> {
    if ASKED.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
