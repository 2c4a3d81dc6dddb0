//! `combwright evolver`: datafiles of Surface Evolver.

use super::CliError;
use super::interrupt;
use super::prompt::{Prompt, Typed};
use crate::evolver::{
    Document, EvolverError,
    datafile::{Model, Purpose, Representation},
    open, parse_commands,
    session::{COMMAND_BUDGET, Flow, Host, Session, significant},
    source::Source,
};
use anyhow::anyhow;
use clap::{Args, Subcommand};
use std::{
    fmt::Write as _,
    fs,
    io::{self, IsTerminal, Write as _},
    path::{Path, PathBuf},
};

/// Arguments of `evolver`.
#[derive(Debug, Args)]
pub(super) struct EvolverArguments {
    #[command(subcommand)]
    command: EvolverCommand,
}

#[derive(Debug, Subcommand)]
enum EvolverCommand {
    /// Say what a datafile holds and what is wrong with it, and where
    Check {
        /// The datafile
        file: PathBuf,
    },
    /// Run a datafile: its own read section, then commands, then a table of energy, volumes and pressures
    #[command(after_help = EXAMPLES)]
    Run(RunArguments),
}

const EXAMPLES: &str = "\
Examples:
  combwright evolver run Sphere.fe -c 'r; g 20; hessian'
  combwright evolver run Psurface.fe --fix -c 'gogo; V' -o out
  combwright evolver run foam.fe < commands.txt

Without -c and with a terminal, commands are typed at a prompt; h lists them, q ends.";

/// Arguments of `evolver run`.
#[derive(Debug, Args)]
struct RunArguments {
    /// The datafile
    file: PathBuf,
    /// Commands to run, in order; otherwise they come from standard input
    #[arg(short, long = "command", value_name = "COMMANDS")]
    commands: Vec<String>,
    /// Folder for the files that commands write and for the final surface, final.fe
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Turn faces round that point the wrong way in their bodies
    #[arg(long)]
    fix: bool,
    /// Run the file as it is printed, wrong faces and all
    #[arg(long, conflicts_with = "fix")]
    as_printed: bool,
    /// Stop after so many commands and steps of g
    #[arg(long, value_name = "COUNT", default_value_t = COMMAND_BUDGET)]
    max_commands: u64,
}

/// Runs the command.
pub(super) fn run(arguments: &EvolverArguments) -> Result<(), CliError> {
    match &arguments.command {
        EvolverCommand::Check { file } => check(file),
        EvolverCommand::Run(arguments) => run_file(arguments),
    }
}

/// What a user wrote wrongly is a mistake; the rest is a failure.
fn ended(error: EvolverError) -> CliError {
    match error {
        EvolverError::Numerical(_) | EvolverError::Interrupted | EvolverError::Budget(_) => {
            CliError::failure(error)
        }
        _ => CliError::mistake(error),
    }
}

fn check(file: &Path) -> Result<(), CliError> {
    let document = Document::new(&open(file).map_err(ended)?).map_err(ended)?;
    out(&summary(&document));
    let name = file.display();
    for fault in &document.faults {
        let grave = if fault.is_grave() { "error" } else { "note" };
        out(&format!("{grave}: {name}: line {}: {fault}\n", fault.position().line));
    }
    let grave = document.faults.iter().filter(|fault| fault.is_grave()).count();
    if grave > 0 {
        return Err(CliError::mistake(anyhow!("{name} has {grave} error(s)")));
    }
    out("no errors\n");
    Ok(())
}

/// What a datafile says, as a table.
fn summary(document: &Document) -> String {
    let (data, surface) = (&document.data, &document.surface);
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<16}{value}");
    };
    let model = match data.model {
        Model::Linear => "linear",
        Model::Quadratic => "quadratic",
    };
    let kind = match data.representation {
        Representation::Soapfilm => "films",
        Representation::String => "strings",
    };
    line("surface", format!("{kind} in {} dimensions, {model}", data.dimension));
    if let Some(periods) = data.periods {
        let filled = if data.filled { ", filled" } else { "" };
        line("torus", format!("{} × {} × {}{filled}", periods.x_axis, periods.y_axis, periods.z_axis));
    }
    for name in &data.parameters {
        line("parameter", format!("{name} = {}", data.variables.get(name).unwrap_or(f64::NAN)));
    }
    for constraint in &data.constraints {
        let parts = [
            (constraint.energy.is_some(), "energy"),
            (constraint.content.is_some(), "content"),
            (constraint.convex, "convex"),
            (constraint.global, "global"),
        ];
        let parts: Vec<&str> = parts.iter().filter(|(has, _)| *has).map(|(_, name)| *name).collect();
        line("constraint", format!("{} {}", constraint.name, parts.join(", ")));
    }
    for boundary in &data.boundaries {
        line("boundary", format!("{} with {} parameter(s)", boundary.name, boundary.parameters));
    }
    for quantity in &data.quantities {
        line("quantity", format!("{} ({:?})", quantity.name, quantity.purpose));
    }
    line(
        "vertices",
        format!("{} in the file, {} with the middles of faces", data.vertices.len(), surface.vertices.len()),
    );
    line("edges", format!("{} in the file, {} triangulated", data.edges.len(), surface.edges.len()));
    line("faces", format!("{} in the file, {} triangulated", data.faces.len(), surface.facets.len()));
    line("bodies", format!("{}", data.bodies.len()));
    line("commands", format!("{} in the read section", document.commands.len()));
    for (word, position) in &data.ignored {
        line("without effect", format!("{word}, line {}", position.line));
    }
    text
}

/// Prints. Whoever reads may stop reading; the surface is computed all the same.
fn out(text: &str) {
    let _ = io::stdout().write_all(text.as_bytes());
}

/// Output of commands to the terminal, files to a folder.
struct Terminal {
    folder: PathBuf,
}

impl Host for Terminal {
    fn print(&mut self, text: &str) {
        out(text);
    }

    fn write(&mut self, name: &str, text: &str, append: bool) -> Result<(), io::Error> {
        let path = self.folder.join(name);
        let mut file =
            fs::OpenOptions::new().create(true).write(true).append(append).truncate(!append).open(path)?;
        file.write_all(text.as_bytes())
    }

    fn interrupted(&self) -> bool {
        interrupt::flow().is_break()
    }
}

fn run_file(arguments: &RunArguments) -> Result<(), CliError> {
    let source = open(&arguments.file).map_err(ended)?;
    let mut document = Document::new(&source).map_err(ended)?;
    let name = arguments.file.display().to_string();
    if arguments.fix {
        for (body, face) in document.turn_faces().map_err(ended)? {
            out(&format!("fixed: face {face} turned round in body {body}\n"));
        }
    }
    if !arguments.as_printed
        && let Some(fault) = document.faults.iter().find(|fault| fault.is_grave())
    {
        let line = fault.position().line;
        return Err(CliError::mistake(anyhow!(
            "{name}: line {line}: {fault} (--as-printed runs it all the same)"
        )));
    }
    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from("."));
    fs::create_dir_all(&folder).map_err(|error| {
        CliError::mistake(anyhow!("the folder {} cannot be made: {error}", folder.display()))
    })?;
    interrupt::listen();
    let mut host = Terminal { folder };
    let read_section = std::mem::take(&mut document.commands);
    let mut session = Session::new(document).map_err(ended)?;
    session.set_budget(arguments.max_commands);
    if arguments.as_printed {
        session.keep_chords();
    }
    let flow = session.run(&source, &read_section, &mut host);
    let flow = flow.and_then(|flow| {
        if flow == Flow::Quit { Ok(flow) } else { all_commands(arguments, &mut session, &mut host) }
    });
    if let Err(error) = flow {
        save_interrupted(&mut session, &mut host, &error);
        return Err(ended(error));
    }
    out(&table(&mut session).map_err(ended)?);
    if arguments.output.is_some() {
        let text = session.datafile().map_err(ended)?;
        host.write("final.fe", &text, false).map_err(CliError::failure)?;
    }
    Ok(())
}

/// What an interrupted or endless run had come to is kept.
fn save_interrupted(session: &mut Session, host: &mut Terminal, error: &EvolverError) {
    if !matches!(error, EvolverError::Interrupted | EvolverError::Budget(_)) {
        return;
    }
    let saved = session.datafile().is_ok_and(|text| host.write(INTERRUPTED, &text, false).is_ok());
    if saved {
        eprintln!("note: the surface was saved as {}", host.folder.join(INTERRUPTED).display());
    }
}

/// The file that keeps the surface of a run that was stopped.
const INTERRUPTED: &str = "interrupted.fe";

fn all_commands(
    arguments: &RunArguments,
    session: &mut Session,
    host: &mut Terminal,
) -> Result<Flow, EvolverError> {
    if !arguments.commands.is_empty() {
        for text in &arguments.commands {
            let source = Source::new("commands", text.as_str());
            if session.run(&source, &parse_commands(&source)?, host)? == Flow::Quit {
                break;
            }
        }
        return Ok(Flow::Next);
    }
    if io::stdin().is_terminal() {
        return prompt(session, host);
    }
    let mut text = String::new();
    let failed = |error| EvolverError::File { name: "standard input".to_owned(), error };
    io::Read::read_to_string(&mut io::stdin().lock(), &mut text).map_err(failed)?;
    let source = Source::new("standard input", text);
    session.run(&source, &parse_commands(&source)?, host)
}

/// Commands typed line by line: a wrong one is told and forgotten, one that is not complete goes on in the next line.
fn prompt(session: &mut Session, host: &mut Terminal) -> Result<Flow, EvolverError> {
    let failed = |error| EvolverError::File { name: "the terminal".to_owned(), error };
    let mut prompt = Prompt::new().map_err(failed)?;
    let mut command = String::new();
    loop {
        let shown = if command.is_empty() { "Enter command: " } else { "more> " };
        match prompt.line(shown).map_err(failed)? {
            Typed::End => return Ok(Flow::Quit),
            Typed::Forget => {
                command.clear();
                continue;
            }
            Typed::Line(line) => {
                let goes_on = !command.is_empty() && !line.trim().is_empty();
                command.push_str(&line);
                if open_brackets(&command) && (goes_on || command == line) {
                    command.push('\n');
                    continue;
                }
            }
        }
        let text = std::mem::take(&mut command);
        if text.trim().is_empty() {
            continue;
        }
        if text.trim() == "history" {
            out(&prompt.history());
            continue;
        }
        prompt.remember(&text.replace('\n', " "));
        let source = Source::new("command", text);
        match parse_commands(&source).and_then(|statements| session.run(&source, &statements, host)) {
            Ok(Flow::Quit) => return Ok(Flow::Quit),
            Ok(_) => {}
            Err(error @ (EvolverError::Interrupted | EvolverError::Budget(_))) => return Err(error),
            Err(error) => eprintln!("error: {error}"),
        }
    }
}

/// Whether more brackets open than close: the command goes on.
fn open_brackets(text: &str) -> bool {
    let count = |brackets: [char; 3]| text.matches(brackets).count();
    count(['{', '(', '[']) > count(['}', ')', ']'])
}

/// Energy, volumes, pressures and quantities.
fn table(session: &mut Session) -> Result<String, EvolverError> {
    let mut text = String::new();
    let values = session.values()?;
    let _ = writeln!(text, "{:<16}{}", "energy", significant(values.energy, 15));
    let _ = writeln!(text, "{:<16}{}", "area", significant(values.area, 15));
    for body in session.bodies()? {
        let closed =
            body.closed.map_or(String::new(), |closed| format!("  closed {}", significant(closed, 15)));
        let target =
            body.target.map_or(String::new(), |target| format!("  target {}", significant(target, 15)));
        let name = format!("body {}", body.id);
        let _ = writeln!(
            text,
            "{name:<16}volume {}{target}{closed}  pressure {}",
            significant(body.volume, 15),
            significant(body.pressure, 15)
        );
    }
    for (name, value, purpose) in session.quantities()? {
        let kind = match purpose {
            Purpose::Energy => "energy",
            Purpose::Fixed(_) => "held",
            Purpose::Information => "for information",
        };
        let _ = writeln!(text, "{:<16}{} ({kind})", format!("quantity {name}"), significant(value, 15));
    }
    Ok(text)
}
