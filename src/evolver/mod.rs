//! Surface Evolver datafiles: read, check, run, write.
//!
//! **Enters** the text of a datafile and commands. **Leaves** the surface that it describes, its faults, its energy, volumes and
//! pressures as the commands move it, and datafiles that Surface Evolver reads.
//!
//! | step | file |
//! |---|---|
//! | tokens, expressions, formulas with exact derivatives | `language/` |
//! | what a datafile says | `datafile/` |
//! | commands as trees | `command/` |
//! | the surface with typed ids; its faults; refinement and mending | `surface/` |
//! | energy, volumes, quantities with exact derivatives; steps down and Newton's, by the foam's kernels | `physics/` |
//! | running commands, writing datafiles | `session/` |
//! | a foam as a datafile | `write.rs` |
//! | places and messages of errors | `source.rs`, `error.rs` |
//!
//! Sources: K. A. Brakke, "The Surface Evolver", Experimental Mathematics 1 (1992), and the manual of Surface Evolver 2.70 for
//! the language and the meaning of its commands.

pub mod command;
pub mod datafile;
pub mod error;
pub mod language;
pub mod physics;
pub mod session;
pub mod source;
pub mod surface;

pub use error::EvolverError;
pub use open::{Document, FILE_LIMIT, open, parse_commands};

mod open;
pub mod write;
