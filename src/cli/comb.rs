//! `combwright comb`: photographs in, a folder of results per photograph out.

use super::{CliError, progress};
use crate::{
    comb::{self, Comb, Corrections, Mask, Part, Photo, Settings},
    report::{
        comb::{self as output, CombSummary, Scale},
        folder::{OutputFolder, write_whole},
    },
    units::Mm,
};
use anyhow::{Context, anyhow};
use indicatif::ProgressBar;
use rayon::prelude::*;
use serde::Serialize;
use std::{
    fs, io,
    path::{Path, PathBuf},
    str::FromStr,
    time::Instant,
};

/// Extensions of the files that are taken from a folder.
const EXTENSIONS: [&str; 6] = ["jpg", "jpeg", "png", "tif", "tiff", "webp"];

/// The corrections of a photograph in its folder.
const CORRECTIONS: &str = "corrections.json";

/// What was typed after `comb`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:\n  \
    combwright comb frame.jpg -o out\n  \
    combwright comb photos/ -o out --scale 5.3mm\n  \
    combwright comb frame.jpg --corrections out/frame/cells.csv -o out\n\n\
    Per photograph: cells.csv, pattern.json, cells.geojson, overlay.png, summary.json, run.json; for all: photos.csv.")]
pub(super) struct CombArguments {
    #[command(subcommand)]
    command: Option<CombCommand>,
    /// Photographs (JPEG, PNG, TIFF, WebP), or folders of them
    #[arg(required = true, value_name = "PHOTO")]
    photos: Vec<PathBuf>,
    /// The folder for the results; each photograph gets one of its own in it
    #[arg(short, long, value_name = "FOLDER", default_value = "out")]
    output: PathBuf,
    /// Pixels from cell to cell, if the search for it should be helped
    #[arg(long, value_name = "PIXELS")]
    pitch: Option<f64>,
    /// Read only this part: left,top,width,height in pixels
    #[arg(long, value_name = "X,Y,W,H")]
    roi: Option<Roi>,
    /// A picture of the photograph's size, white where the comb is hidden
    #[arg(long, value_name = "PICTURE")]
    mask: Option<PathBuf>,
    /// The median pitch of the cells (5.3mm), or the size of a pixel (0.06mm/px)
    #[arg(long, value_name = "LENGTH")]
    scale: Option<ScaleArgument>,
    /// Corrections by hand: a corrections.json, or a cells.csv that was edited (rows removed, added, other sides or status)
    ///
    /// What was corrected is kept as corrections.json in the photograph's folder and holds for every later run into it. A
    /// corrections.json is written so, points in pixels, any number of entries, of which the later holds:
    ///
    /// {"schema": "combwright.corrections/1", "corrections": [
    ///   {"add": {"at": [310, 95]}}, {"remove": {"at": [200, 40]}},
    ///   {"join": {"at": [50, 60], "with": [80, 60]}}, {"split": {"at": [400, 300], "into": [[390, 300], [410, 300]]}},
    ///   {"sides": {"at": [120, 80], "sides": 5}}, {"status": {"at": [140, 80], "status": "uncertain"}},
    ///   {"mask": {"polygon": [[0, 0], [90, 0], [90, 70]]}}]}
    #[arg(long, value_name = "FILE", verbatim_doc_comment)]
    corrections: Option<PathBuf>,
    /// Read anew, without the corrections.json that the photograph's folder holds
    #[arg(long, conflicts_with = "corrections")]
    no_corrections: bool,
    /// Threads; all cores if none is given
    #[arg(short, long, value_name = "COUNT")]
    jobs: Option<usize>,
}

#[derive(Debug, clap::Subcommand)]
enum CombCommand {
    /// Draw a synthetic photograph of comb, with its exact truth
    Render(super::comb_render::RenderArguments),
    /// Compare a table of cells with a truth
    Score(super::comb_score::ScoreArguments),
}

/// A region of interest as typed.
#[derive(Clone, Copy, Debug)]
struct Roi(Part);

impl FromStr for Roi {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<usize> = text.split(',').map_while(|n| n.trim().parse().ok()).collect();
        match (numbers.as_slice(), text.split(',').count()) {
            (&[left, top, width, height], 4) => Ok(Self(Part { left, top, width, height })),
            _ => Err("give four whole numbers: left,top,width,height".to_owned()),
        }
    }
}

/// A scale as typed.
#[derive(Clone, Copy, Debug)]
struct ScaleArgument(Scale);

impl FromStr for ScaleArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (length, kind): (&str, fn(Mm) -> Scale) = match text.strip_suffix("/px") {
            Some(length) => (length, Scale::Pixel),
            None => (text, Scale::Pitch),
        };
        let length = Mm::from_str(length).map_err(|e| e.to_string())?;
        if length.0 > 0.0 { Ok(Self(kind(length))) } else { Err("a scale is greater than 0".to_owned()) }
    }
}

/// What `run.json` says.
#[derive(Serialize)]
struct Run<'a> {
    schema: &'static str,
    version: &'static str,
    photo: String,
    pitch: Option<f64>,
    region: Option<[usize; 4]>,
    mask: Option<&'a Path>,
    scale_mm_per_px: Option<f64>,
    corrections: Option<&'a Corrections>,
    cells_crc32: u32,
    seconds: f64,
}

pub(super) fn run(arguments: &CombArguments) -> Result<(), CliError> {
    match &arguments.command {
        Some(CombCommand::Render(render)) => super::comb_render::run(render),
        Some(CombCommand::Score(score)) => super::comb_score::run(score),
        None => read_all(arguments),
    }
}

fn read_all(arguments: &CombArguments) -> Result<(), CliError> {
    let photos = named(gather(&arguments.photos)?);
    if photos.len() > 1 && arguments.corrections.is_some() {
        return Err(CliError::mistake(anyhow!(
            "corrections belong to one photograph, but {} are given",
            photos.len()
        )));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.jobs.unwrap_or(0)).build();
    let pool = pool.map_err(CliError::failure)?;
    fs::create_dir_all(&arguments.output)
        .with_context(|| format!("cannot make the folder {}", arguments.output.display()))
        .map_err(CliError::mistake)?;
    let bar = progress::steps(photos.len() as u64);
    let results: Vec<Result<CombSummary, CliError>> = pool.install(|| {
        let one = |(name, path): &(String, PathBuf)| {
            let result = read_one(arguments, name, path, &bar);
            bar.inc(1);
            result
        };
        photos.par_iter().map(one).collect()
    });
    bar.finish_and_clear();
    report(arguments, &photos, results)
}

/// Prints a line per photograph, writes `photos.csv`, and says how the batch ended.
fn report(
    arguments: &CombArguments,
    photos: &[(String, PathBuf)],
    results: Vec<Result<CombSummary, CliError>>,
) -> Result<(), CliError> {
    let reasons: Vec<String> =
        results.iter().map(|r| r.as_ref().err().map(ToString::to_string).unwrap_or_default()).collect();
    for result in &results {
        match result {
            Ok(summary) => println!("{}", output::line(summary)),
            Err(error) if photos.len() > 1 => eprintln!("error: {error}"),
            Err(_) => {}
        }
    }
    let entries =
        photos.iter().zip(&results).zip(&reasons).map(|(((name, _), result), reason)| {
            (name.as_str(), result.as_ref().map_err(|_| reason.as_str()))
        });
    let failed = reasons.iter().filter(|r| !r.is_empty()).count();
    if photos.len() > 1 {
        let path = arguments.output.join("photos.csv");
        write_whole(&path, |file| output::write_batch(entries, file).map_err(io::Error::other))?;
    }
    if failed == 0 {
        return Ok(());
    }
    match results.into_iter().find_map(Result::err) {
        Some(error) if photos.len() == 1 => Err(error),
        _ if failed == photos.len() => {
            Err(CliError::mistake(anyhow!("none of the {failed} photographs could be read")))
        }
        _ => Err(CliError::failure(anyhow!(
            "{failed} of {} photographs could not be read; the others are done",
            photos.len()
        ))),
    }
}

fn read_one(
    arguments: &CombArguments,
    name: &str,
    path: &Path,
    bar: &ProgressBar,
) -> Result<CombSummary, CliError> {
    let start = Instant::now();
    let shown = path.display().to_string();
    let photo = Photo::open(path).map_err(CliError::mistake)?;
    let mut settings = Settings {
        pitch: arguments.pitch,
        part: arguments.roi.map(|r| r.0),
        mask: arguments.mask.as_deref().map(open_mask).transpose()?,
        corrections: Corrections::default(),
    };
    let target = arguments.output.join(name);
    let kept = target.join(CORRECTIONS);
    let of_folder = (!arguments.no_corrections && kept.is_file()).then_some(kept.as_path());
    let corrections = arguments.corrections.as_deref().or(of_folder);
    let comb = read_corrected(&photo, &mut settings, corrections).map_err(|e| in_photo(e, &shown))?;
    if let (None, Some(kept)) = (&arguments.corrections, of_folder) {
        bar.suspend(|| eprintln!("{}", applied(kept, &settings.corrections)));
    }
    let scale = arguments.scale.map(|s| s.0);
    let summary = output::summary(name, &comb, scale);
    let mut folder = OutputFolder::begin(&target)?;
    output::write(&mut folder, &comb, &photo, &summary).map_err(CliError::failure)?;
    if arguments.corrections.is_some() {
        folder.write_json(CORRECTIONS, &settings.corrections)?;
    }
    let run = Run {
        schema: "combwright.run/1",
        version: env!("CARGO_PKG_VERSION"),
        photo: shown,
        pitch: arguments.pitch,
        region: arguments.roi.map(|r| [r.0.left, r.0.top, r.0.width, r.0.height]),
        mask: arguments.mask.as_deref(),
        scale_mm_per_px: summary.mm_per_px,
        corrections: corrections.is_some().then_some(&settings.corrections),
        cells_crc32: folder.checksum(output::CELLS)?,
        seconds: start.elapsed().as_secs_f64(),
    };
    folder.write_json("run.json", &run)?;
    if let Some(copy) = folder.keep_other(output::CELLS, written_before(&target))? {
        bar.suspend(|| eprintln!("note: the folder's {} was edited; it is kept as {copy}", output::CELLS));
    }
    folder.commit()?;
    Ok(summary)
}

/// The checksum of the table that the last run into a folder has written.
fn written_before(folder: &Path) -> Option<u32> {
    let run: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("run.json")).ok()?).ok()?;
    run["cells_crc32"].as_u64().and_then(|sum| u32::try_from(sum).ok())
}

fn applied(kept: &Path, corrections: &Corrections) -> String {
    format!(
        "note: {} corrections of {} hold; --no-corrections reads without them",
        corrections.corrections.len(),
        kept.display()
    )
}

/// Reads a photograph with the corrections of a file. A table is compared with what is read without it first, but with the
/// corrections beside it, of which masks and joined cells leave no trace in it.
fn read_corrected(
    photo: &Photo,
    settings: &mut Settings,
    corrections: Option<&Path>,
) -> Result<Comb, CliError> {
    let Some(path) = corrections else {
        return comb::read(photo, settings).map_err(CliError::mistake);
    };
    let text = fs::read_to_string(path)
        .with_context(|| format!("cannot read {}", path.display()))
        .map_err(CliError::mistake)?;
    let named = |e: anyhow::Error| CliError::Mistake(e.context(path.display().to_string()));
    settings.corrections = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        let rows = comb::read_cells(text.as_bytes()).map_err(|e| named(e.into()))?;
        if rows.is_empty() {
            return Err(named(anyhow!("the table has no cells; to hide all of a photograph, leave it out")));
        }
        let beside = path.with_file_name(CORRECTIONS);
        if beside.is_file() {
            let text = fs::read_to_string(&beside).map_err(|e| named(e.into()))?;
            settings.corrections = Corrections::from_json(&text).map_err(|e| named(e.into()))?;
        }
        let before = comb::read(photo, settings).map_err(CliError::mistake)?;
        settings.corrections.clone().and(Corrections::from_table(&rows, &before))
    } else {
        Corrections::from_json(&text).map_err(|e| named(e.into()))?
    };
    comb::read(photo, settings).map_err(CliError::mistake)
}

fn open_mask(path: &Path) -> Result<Mask, CliError> {
    Ok(Mask::from_picture(&Photo::open(path).map_err(CliError::mistake)?))
}

fn in_photo(error: CliError, photo: &str) -> CliError {
    match error {
        CliError::Mistake(e) => CliError::Mistake(e.context(photo.to_owned())),
        CliError::Failure(e) => CliError::Failure(e.context(photo.to_owned())),
    }
}

/// The photographs named, and those in the folders named, in order.
fn gather(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CliError> {
    let mut photos = Vec::new();
    for path in paths {
        if !path.is_dir() {
            photos.push(path.clone());
            continue;
        }
        let inside = photos_in(path).with_context(|| format!("cannot list {}", path.display()));
        let inside = inside.map_err(CliError::mistake)?;
        if inside.is_empty() {
            return Err(CliError::mistake(anyhow!(
                "{} holds no photographs (files ending in {})",
                path.display(),
                EXTENSIONS.join(", ")
            )));
        }
        photos.extend(inside);
    }
    Ok(photos)
}

fn photos_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if path.is_file() && extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Each photograph with the name of its folder: its own without extension, numbered where two are called the same.
fn named(photos: Vec<PathBuf>) -> Vec<(String, PathBuf)> {
    let mut named: Vec<(String, PathBuf)> = Vec::new();
    for path in photos {
        let stem = path.file_stem().map_or_else(|| "photo".to_owned(), |s| s.to_string_lossy().into_owned());
        let taken = |name: &str| named.iter().any(|(other, _)| other == name);
        let mut name = stem.clone();
        let mut number = 2;
        while taken(&name) {
            name = format!("{stem}-{number}");
            number += 1;
        }
        named.push((name, path));
    }
    named
}
