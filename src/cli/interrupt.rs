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
//! Ctrl-C: asked for once, obeyed at the next safe place.

use std::{
    ops::ControlFlow,
    sync::{
        Once,
        atomic::{AtomicBool, Ordering},
    },
};

static ASKED: AtomicBool = AtomicBool::new(false);
static LISTENING: Once = Once::new();

/// Listens for Ctrl-C from now on. A second one ends the program at once.
pub(super) fn listen() {
    LISTENING.call_once(|| {
        // Where no handler can be installed, Ctrl-C ends the program as usual.
        let _ = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
    });
}

/// Whether to go on.
pub(super) fn flow() -> ControlFlow<()> {
    if ASKED.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
