//! The command line: the only room that prints.
//!
//! **Enters** what was typed. **Leaves** settings for the library, results on stdout or in files, messages on stderr, and
//! an exit code: 0, 1 for a failure, 2 for a user's mistake.
//!
//! | command | file |
//! |---|---|
//! | `enclosure` | `enclosure.rs` |
//! | `foam` | `foam.rs`, `foam_settings.rs`, `foam_run.rs`, `foam_relax.rs`, `foam_batch.rs` |
//! | `foam bubble`, `foam --layers 2` | `foam_bubble.rs`, `foam_layers.rs` |
//! | how a command ends, progress on a terminal, Ctrl-C | `outcome.rs`, `progress.rs`, `interrupt.rs` |
//! | `evolver check`, `evolver run` | `evolver.rs`, `prompt.rs` |
//! | `comb`, `comb render`, `comb score` | `comb.rs`, `comb_render.rs`, `comb_score.rs` |
//! | `compare` | `compare.rs`, `compare_wall.rs` |
//! | `demo`, `view` | `demo.rs`, `demo_comb.rs`, `view.rs` |
//! | shell completions, manual page | `manual.rs` |

// Printing is this room's job.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "the only room that prints")]

mod comb;
mod comb_render;
mod comb_score;
mod compare;
mod compare_wall;
mod demo;
mod demo_comb;
mod demo_foam;
mod enclosure;
mod evolver;
mod foam;
mod foam_batch;
mod foam_bubble;
mod foam_figures;
mod foam_free;
mod foam_layers;
mod foam_relax;
mod foam_run;
mod foam_settings;
mod interrupt;
mod manual;
mod outcome;
mod progress;
mod prompt;
mod view;

use clap::{CommandFactory, Parser, Subcommand};
use std::process::ExitCode;

pub use outcome::CliError;

/// Enclosures for bees between two curved walls, the ideal foam in the same gap, and the comb read from photographs.
#[derive(Debug, Parser)]
#[command(name = "combwright", version, max_term_width = 100, arg_required_else_help = true)]
#[command(after_help = "Each command has a page of its own: combwright COMMAND --help")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Build an enclosure: two shells with a gap for bees, and a base, as parts that print
    Enclosure(Box<enclosure::EnclosureArguments>),
    Foam(Box<foam::FoamArguments>),
    /// Read the cells of comb and their numbers of sides from photographs
    Comb(Box<comb::CombArguments>),
    /// Read, check and run datafiles of Surface Evolver
    Evolver(evolver::EvolverArguments),
    Compare(compare::CompareArguments),
    Demo(demo::DemoArguments),
    View(view::ViewArguments),
    /// Print a completion script for a shell to stdout
    Completions(manual::CompletionArguments),
    /// Print the manual page (roff) to stdout
    Man,
}

/// Runs the program with the arguments of the process.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let ended = match arguments.command {
        Command::Enclosure(arguments) => enclosure::run(&arguments),
        Command::Foam(foam) => foam::foam(&foam),
        Command::Comb(comb) => comb::run(&comb),
        Command::Evolver(arguments) => evolver::run(&arguments),
        Command::Compare(compare) => compare::run(&compare),
        Command::Demo(demo) => demo::run(&demo),
        Command::View(view) => view::run(&view),
        Command::Completions(shell) => manual::completions(&shell, Arguments::command()),
        Command::Man => manual::page(Arguments::command()),
    };
    outcome::exit_code(ended)
}
