//! `combwright compare`, `demo` and `view` as a user meets them, and the honesty of the test by simulation.

use combwright::{
    comb::{
        self, Photo,
        synthetic::{Arrangement, Difficulty, RenderSettings, Style, render},
    },
    compare::{Comparison, Finding, Sample, Settings, compare},
    tessellation::{CellPattern, CellStatus, Surroundings, flipped_hexagons},
};
use glam::{DVec3, IVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::{
    error::Error,
    fs,
    path::Path,
    process::{Command, Output},
};

type Tried<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// The significance level of the comparison.
const LEVEL: f64 = 0.05;

fn torus(side: usize, flips: usize, seed: u64) -> Tried<CellPattern> {
    flipped_hexagons(side, side, flips, seed).map_err(|defects| format!("{defects:?}").into())
}

/// Cells with sides of their own: 85 % hexagons, as many fives as sevens.
fn independent(side: usize, seed: u64) -> Tried<CellPattern> {
    let mut pattern = torus(side, 0, 1)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for cell in pattern.cells.iter_mut() {
        let draw: f64 = random.random();
        cell.sides = Some(if draw < 0.075 {
            5
        } else if draw < 0.15 {
            7
        } else {
            6
        });
    }
    Ok(pattern)
}

fn samples(patterns: impl IntoIterator<Item = CellPattern>) -> Vec<Sample> {
    let named = |(i, pattern): (usize, CellPattern)| Sample { name: format!("pattern-{i}"), pattern };
    patterns.into_iter().enumerate().map(named).collect()
}

fn compared(comb: CellPattern, foam: CellPattern) -> Tried<Comparison> {
    Ok(compare(&samples([comb]), &samples([foam]), &Settings::default())?)
}

/// The share of 1000 pairs of the same process, of `sides` × `sides` cells each, that the test finds different.
fn level(sides: [usize; 2], maker: impl Fn(usize, u64) -> Tried<CellPattern> + Sync) -> Tried<f64> {
    let rejected = |run: u64| -> Tried<bool> {
        let settings = Settings { permutations: 399, resamples: 99, seed: run, ..Settings::default() };
        let pair = [samples([maker(sides[0], 2 * run)?]), samples([maker(sides[1], 2 * run + 1)?])];
        Ok(compare(&pair[0], &pair[1], &settings)?.sides.p <= LEVEL)
    };
    let found: Vec<bool> = (0..1000).into_par_iter().map(rejected).collect::<Tried<_>>()?;
    Ok(found.iter().filter(|r| **r).count() as f64 / 1000.0)
}

/// Patterns of one size and of two.
const SIDES: [[usize; 2]; 3] = [[14, 14], [10, 16], [20, 14]];

#[test]
fn the_test_rejects_true_nulls_at_its_level() -> Tried<()> {
    for sides in SIDES {
        let share = level(sides, independent)?;
        // 5 % ± 1.5 %; the standard error of 1000 pairs is 0.7 %.
        assert!((share - LEVEL).abs() <= 0.015, "independent cells, {sides:?}: {share}");
    }
    Ok(())
}

#[test]
fn cells_that_depend_on_their_neighbours_do_not_fool_the_test() -> Tried<()> {
    // Flips come in random number, two fives and two sevens each: a test that takes cells for independent rejects a fifth of
    // these nulls, one that shuffles patches without regard to what links them a twelfth.
    for sides in SIDES {
        let share = level(sides, |side, seed| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let flips = (0..2 * side * side).filter(|_| random.random::<f64>() < 0.025).count();
            torus(side, flips, seed)
        })?;
        assert!((share - LEVEL).abs() <= 0.015, "pairs, {sides:?}: {share}");
    }
    Ok(())
}

/// A flat foam-like pattern on a square with its neighbours by geometry: what an imprint is compared with.
fn drawn(seed: u64, disorder: f64) -> Tried<(CellPattern, Arrangement)> {
    let arrangement = Arrangement::random(26.0, 22.0, disorder, seed);
    let pattern = read_back(&arrangement, 0.0, seed)?;
    Ok((pattern, arrangement))
}

/// The arrangement as a photograph of the given difficulty, read.
fn read_back(arrangement: &Arrangement, difficulty: f64, seed: u64) -> Tried<CellPattern> {
    let settings = RenderSettings {
        width: 936,
        height: 792,
        pitch: 36.0,
        style: Style::Wax,
        difficulty: Difficulty::dial(difficulty),
        torn_edge: false,
        seed,
    };
    let (picture, _) = render(arrangement, &settings);
    Ok(comb::read(&Photo::from_picture(picture.into()), &comb::Settings::default())?.pattern)
}

#[test]
fn an_imprint_read_back_is_no_different_from_what_left_it() -> Tried<()> {
    // A pattern with 5-7 pairs stands for the foam. Its cells, rendered as a photograph with noise and tilt and read, are the
    // comb.
    let (foam, _) = drawn(5, 0.4)?;
    let arrangement = Arrangement::from_pattern(&foam)?;
    let imprint = read_back(&arrangement, 0.3, 9)?;
    let found = compared(imprint, foam)?;
    assert!(found.comb.cells > 200, "{} cells", found.comb.cells);
    assert_eq!(found.verdict.finding, Finding::NoDifference, "{}", found.verdict.sentence);
    assert!(found.verdict.sentence.starts_with("No difference was found"));
    assert!(found.sides.p > 0.5, "{}", found.sides.p);
    Ok(())
}

#[test]
fn hexagons_and_random_defects_are_found_different() -> Tried<()> {
    let (foam, _) = drawn(5, 0.6)?;
    let hexagons = compared(torus(18, 0, 1)?, foam)?;
    assert_eq!(hexagons.verdict.finding, Finding::Different, "{}", hexagons.verdict.sentence);
    let random = compared(torus(18, 60, 3)?, torus(18, 2, 4)?)?;
    assert_eq!(random.verdict.finding, Finding::Different, "{}", random.verdict.sentence);
    assert!(random.sides.p < 0.01);
    Ok(())
}

#[test]
fn too_few_cells_get_no_verdict() -> Tried<()> {
    let found = compared(torus(6, 3, 1)?, torus(14, 10, 2)?)?;
    assert_eq!(found.verdict.finding, Finding::TooFewCells);
    assert!(found.verdict.sentence.contains("the comb has 36 complete cells in 5 patches"));
    Ok(())
}

#[test]
fn whole_patterns_are_shuffled_where_there_are_four_of_each() -> Tried<()> {
    let make = |from: u64, flips: usize| -> Tried<Vec<Sample>> {
        Ok(samples((from..from + 5).map(|seed| torus(10, flips, seed)).collect::<Tried<Vec<_>>>()?))
    };
    let found = compare(&make(1, 3)?, &make(10, 12)?, &Settings::default())?;
    assert_eq!((found.comb.units, found.foam.units), (5, 5));
    assert!(found.sides.exhaustive && found.sides.permutations == 252);
    assert_eq!(found.verdict.finding, Finding::Different);
    Ok(())
}

#[test]
fn the_result_depends_on_the_seed_alone() -> Tried<()> {
    let make = || compared(torus(14, 20, 1)?, torus(20, 20, 2)?);
    assert_eq!(make()?, make()?);
    Ok(())
}

fn combwright(arguments: &[&str], folder: &Path) -> Tried<Output> {
    let run = Command::new(env!("CARGO_BIN_EXE_combwright")).args(arguments).current_dir(folder).output()?;
    Ok(run)
}

fn write(pattern: &CellPattern, path: &Path) -> Tried<()> {
    Ok(fs::write(path, serde_json::to_string(pattern)?)?)
}

#[test]
fn the_command_leaves_tables_figures_and_a_verdict() -> Tried<()> {
    let home = tempfile::tempdir()?;
    write(&torus(14, 20, 1)?, &home.path().join("a.json"))?;
    write(&torus(14, 20, 2)?, &home.path().join("b.json"))?;
    let run = combwright(&["compare", "--comb", "a.json", "--foam", "b.json", "-o", "out"], home.path())?;
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let told = String::from_utf8(run.stdout)?;
    let out = home.path().join("out");
    let verdict = fs::read_to_string(out.join("verdict.txt"))?;
    assert!(told.contains(verdict.trim()), "{told}");
    let listed = fs::read_to_string(out.join("README.txt"))?;
    for name in
        ["comparison.json", "comparison.schema.json", "sides.csv", "figures.csv", "patterns.csv", "run.json"]
    {
        assert!(listed.contains(name), "README.txt does not tell of {name}");
        assert!(out.join(name).is_file(), "{name}");
    }
    for name in ["sides", "aboav_weaire", "lewis", "correlations", "chains"] {
        assert!(image::open(out.join(format!("{name}.png")))?.width() > 1000);
        assert!(fs::read_to_string(out.join(format!("{name}.svg")))?.contains("<svg"));
    }
    let comparison: serde_json::Value = serde_json::from_slice(&fs::read(out.join("comparison.json"))?)?;
    let schema: serde_json::Value = serde_json::from_slice(&fs::read(out.join("comparison.schema.json"))?)?;
    assert_eq!(comparison["schema"], schema["properties"]["schema"]["const"]);
    let fields = comparison.as_object().ok_or("no object")?;
    for field in fields.keys() {
        assert!(schema["properties"].get(field).is_some(), "the schema does not tell of {field}");
    }
    Ok(())
}

#[test]
fn bad_input_is_told_and_leaves_nothing() -> Tried<()> {
    let home = tempfile::tempdir()?;
    let at = |name: &str| home.path().join(name);
    let good = torus(14, 5, 1)?;
    write(&good, &at("good.json"))?;
    let other = serde_json::to_string(&good)?.replace("pattern/1", "pattern/7");
    fs::write(at("version.json"), other)?;
    let empty =
        CellPattern::new("px", Surroundings::Open, Vec::new().into()).map_err(|d| format!("{d:?}"))?;
    write(&empty, &at("empty.json"))?;
    let mut cut = good.clone();
    cut.cells.iter_mut().for_each(|cell| cell.status = CellStatus::Cut);
    write(&cut, &at("cut.json"))?;
    let mut one_sided = good.clone();
    if let Some(cell) = one_sided.cells.iter_mut().next() {
        cell.walls[0].shift = IVec3::X;
        cell.position = DVec3::ZERO;
    }
    write(&one_sided, &at("one-sided.json"))?;
    fs::write(at("words.json"), "no JSON")?;
    for (name, word) in [
        ("missing.json", "cannot read"),
        ("version.json", "combwright.pattern/7"),
        ("empty.json", "the pattern is empty"),
        ("cut.json", "no complete cell"),
        ("one-sided.json", "touches"),
        ("words.json", "is not JSON"),
    ] {
        let run = combwright(&["compare", "--comb", name, "--foam", "good.json", "-o", "out"], home.path())?;
        let said = String::from_utf8(run.stderr)?;
        assert_eq!(run.status.code(), Some(2), "{name}: {said}");
        assert!(said.contains(word), "{name}: {said}");
        assert!(!at("out").exists(), "{name} left something behind");
    }
    Ok(())
}
