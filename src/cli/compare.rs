//! `combwright compare`: patterns of comb against patterns of foam.

use super::{
    CliError,
    compare_wall::{self, MappedPhoto, WallArguments},
    progress::Stages,
};
use crate::{
    compare::{self, CompareError, Finding, Sample, Settings, Units},
    report::{compare_files, folder::OutputFolder},
    tessellation::CellPattern,
};
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// What may be shuffled in the permutation test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum UnitsName {
    /// Whole patterns where there are four or more of each, else patches
    Auto,
    /// Patches of neighbouring cells
    Patches,
    /// Whole patterns: what combs differ by among themselves is then counted
    Patterns,
}

/// Compare patterns of comb with patterns of foam: numbers of sides, defects, chains, charge against curvature.
///
/// Only complete cells count. The test shuffles groups of neighbouring cells, never single ones, since neighbours depend on
/// each other.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  combwright compare --comb comb/*/pattern.json --foam foam/*/pattern.json -o out
  combwright compare --comb comb/frame --foam foam-out -o out
  combwright compare --comb a.json b.json --foam c.json --units patches --seed 7
  combwright compare --comb comb/frame --recipe my.toml --marks frame-marks.csv --foam foam-out
  combwright compare --comb comb/frame --recipe my.toml --view top --mm-per-px 0.06 --foam foam-out")]
pub(super) struct CompareArguments {
    /// Patterns of comb: pattern.json files, or folders that hold one
    #[arg(long, required = true, num_args = 1.., value_name = "PATTERN")]
    comb: Vec<PathBuf>,
    /// Patterns of foam, likewise
    #[arg(long, required = true, num_args = 1.., value_name = "PATTERN")]
    foam: Vec<PathBuf>,
    #[command(flatten)]
    wall: WallArguments,
    /// What is shuffled
    #[arg(long, value_enum, default_value = "auto")]
    units: UnitsName,
    /// Random permutations, where not all can be tried
    #[arg(long, value_name = "COUNT", default_value_t = 9999)]
    permutations: usize,
    /// Resamples for the intervals
    #[arg(long, value_name = "COUNT", default_value_t = 4000)]
    resamples: usize,
    /// Where the random numbers start
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// The folder for the results
    #[arg(short, long, value_name = "FOLDER", default_value = "compare-out")]
    output: PathBuf,
}

/// How a comparison came about: `run.json`.
#[derive(Serialize)]
struct Run<'a> {
    schema: &'static str,
    command: &'static str,
    version: &'static str,
    settings: &'a Settings,
    comb: Vec<String>,
    foam: Vec<String>,
    mapped: Vec<MappedPhoto>,
    seconds: BTreeMap<&'static str, f64>,
    ended: Finding,
}

/// Runs the command.
pub(super) fn run(arguments: &CompareArguments) -> Result<(), CliError> {
    let mut comb = read_all(&arguments.comb)?;
    let foam = read_all(&arguments.foam)?;
    let settings = Settings {
        units: match arguments.units {
            UnitsName::Auto => Units::Auto,
            UnitsName::Patches => Units::Patches,
            UnitsName::Patterns => Units::Patterns,
        },
        permutations: arguments.permutations,
        resamples: arguments.resamples,
        seed: arguments.seed,
    };
    let mapped = compare_wall::map_all(&arguments.wall, &mut comb, &arguments.comb)?;
    let mut folder = OutputFolder::begin(&arguments.output)?;
    super::interrupt::remove_on_interrupt(folder.staging());
    let mut stages = Stages::new(2);
    stages.begin("comparing");
    let comparison = compare::compare(&comb, &foam, &settings).map_err(mistaken)?;
    stages.begin("writing");
    compare_files::write(&mut folder, &comparison, [&comb, &foam]).map_err(CliError::failure)?;
    let names = |paths: &[PathBuf]| paths.iter().map(|path| path.display().to_string()).collect();
    let run = Run {
        schema: "combwright.run/1",
        command: "compare",
        version: env!("CARGO_PKG_VERSION"),
        settings: &comparison.settings,
        comb: names(&arguments.comb),
        foam: names(&arguments.foam),
        mapped,
        seconds: stages.finish(),
        ended: comparison.verdict.finding,
    };
    folder.write_json("run.json", &run)?;
    let files = folder.commit()?;
    print!("{}", compare_files::table(&comparison));
    println!("{} files in {}", files.len(), arguments.output.display());
    Ok(())
}

/// Everything that keeps a comparison from being made lies in what was given.
fn mistaken(error: CompareError) -> CliError {
    CliError::mistake(error)
}

/// The patterns of these files and folders, each with a name of its own.
fn read_all(paths: &[PathBuf]) -> Result<Vec<Sample>, CliError> {
    let mut samples: Vec<Sample> = Vec::new();
    for path in paths {
        let pattern = read_pattern(path)?;
        let name = name_of(path);
        let taken = |name: &str| samples.iter().any(|sample| sample.name == name);
        let name = (1..)
            .map(|number| if number == 1 { name.clone() } else { format!("{name}-{number}") })
            .find(|name| !taken(name))
            .unwrap_or(name.clone());
        samples.push(Sample { name, pattern });
    }
    Ok(samples)
}

/// A pattern from a file, or from `pattern.json` in a folder, checked.
pub(super) fn read_pattern(path: &Path) -> Result<CellPattern, CliError> {
    let file = if path.is_dir() { path.join("pattern.json") } else { path.to_path_buf() };
    let shown = file.display().to_string();
    let text = fs::read_to_string(&file)
        .with_context(|| format!("cannot read {shown}"))
        .map_err(CliError::mistake)?;
    // The version is looked at first: another one may have other fields.
    let value: serde_json::Value = serde_json::from_str(&text)
        .with_context(|| format!("{shown} is no pattern: it is not JSON"))
        .map_err(CliError::mistake)?;
    let schema = value.get("schema").and_then(serde_json::Value::as_str).unwrap_or("none");
    if schema != crate::tessellation::PATTERN_SCHEMA {
        return Err(CliError::mistake(anyhow!(
            "{shown}: the schema is '{schema}', but this program reads '{}'; read the photograph or make the foam again with \
             this version",
            crate::tessellation::PATTERN_SCHEMA
        )));
    }
    let pattern: CellPattern = serde_json::from_value(value)
        .with_context(|| format!("{shown} is no pattern"))
        .map_err(CliError::mistake)?;
    match &pattern.defects()[..] {
        [] => Ok(pattern),
        [first, rest @ ..] => {
            let more =
                if rest.is_empty() { String::new() } else { format!(", and {} more faults", rest.len()) };
            Err(CliError::mistake(anyhow!("{shown}: {first}{more}")))
        }
    }
}

/// The folder's name for `…/NAME/pattern.json` and for a folder, else the file's own.
fn name_of(path: &Path) -> String {
    let plain = path.file_stem().is_some_and(|stem| stem == "pattern");
    let named = if plain { path.parent().unwrap_or(path) } else { path };
    let name = if named.is_dir() { named.file_name() } else { named.file_stem() };
    name.map_or_else(|| "pattern".to_owned(), |name| name.to_string_lossy().into_owned())
}
