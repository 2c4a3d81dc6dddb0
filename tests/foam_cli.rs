//! `combwright foam` from outside: what it writes, and what it says to bad input.

use serde_json::Value;
use std::{
    error::Error,
    fs,
    path::Path,
    process::{Command, Output},
};

type Tested = Result<(), Box<dyn Error>>;

fn foam(folder: &Path, arguments: &str) -> Result<Output, std::io::Error> {
    Command::new(env!("CARGO_BIN_EXE_combwright"))
        .arg("foam")
        .args(arguments.split_whitespace())
        .arg("-o")
        .arg(folder.join("out"))
        .output()
}

fn json(path: &Path) -> Result<Value, Box<dyn Error>> {
    Ok(serde_json::from_slice(&fs::read(path)?)?)
}

#[test]
fn a_partition_is_written_whole() -> Tested {
    let home = tempfile::tempdir()?;
    let ended = foam(home.path(), "--cells 40 --sweeps 200 --stop-after partition")?;
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let out = home.path().join("out");
    let summary = json(&out.join("summary.json"))?;
    assert_eq!(summary["charge"], -24);
    let partition = json(&out.join("partition.json"))?;
    let cells = partition["cells"].as_array().ok_or("no cells")?;
    assert_eq!(cells.len(), 40);
    let volume: f64 = cells.iter().filter_map(|cell| cell["volume"].as_f64()).sum();
    // The volume of |Φ| < 0.2; cells of this size are measured to 1e-10.
    assert!((volume / 0.114_158_996_552_87 - 1.0).abs() < 1e-9, "{volume}");
    for name in ["cells.csv", "pattern.json", "partition.obj", "foam.png", "anneal.svg", "run.json"] {
        assert!(fs::metadata(out.join(name))?.len() > 0, "{name} is empty");
    }
    assert_eq!(fs::read_to_string(out.join("cells.csv"))?.lines().count(), 41);
    Ok(())
}

#[test]
fn any_number_of_threads_gives_the_same_files() -> Tested {
    let written = |jobs: &str| -> Result<Vec<Vec<u8>>, Box<dyn Error>> {
        let home = tempfile::tempdir()?;
        let ended = foam(
            home.path(),
            &format!("--surface sphere --radii 1,1.1 -n 20 --sweeps 100 --stop-after partition -j {jobs}"),
        )?;
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        ["partition.json", "cells.csv", "pattern.json", "foam.png", "anneal.csv"]
            .iter()
            .map(|name| Ok(fs::read(home.path().join("out").join(name))?))
            .collect()
    };
    assert_eq!(written("1")?, written("2")?);
    Ok(())
}

#[test]
fn seeds_alone_can_be_had() -> Tested {
    let home = tempfile::tempdir()?;
    let ended = foam(
        home.path(),
        "--surface plane --periods 4,4 --height 0.5 -n 16 --sweeps 50 --density uniform --stop-after seeds",
    )?;
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert_eq!(fs::read_to_string(home.path().join("out/seeds.csv"))?.lines().count(), 17);
    assert!(!home.path().join("out/partition.json").exists());
    Ok(())
}

#[test]
fn bad_input_gets_one_clear_message_and_no_output() -> Tested {
    for (arguments, says) in [
        ("--cells 0", "N = 0"),
        ("--cells 1", "N = 1"),
        ("--cells 1000000", "GB of memory"),
        ("--cells -3", "invalid value"),
        ("--delta NaN", "NaN"),
        ("--delta 0", "level offset is 0"),
        ("--delta -0.1", "-0.1"),
        ("--delta 1.5", "1.5"),
        ("--parallel 0.5", "fold"),
        ("--period 0", "the period is 0"),
        ("--surface sphere", "--radii"),
        ("--surface sphere --radii 1", "two numbers"),
        ("--surface sphere --radii 1.1,1", "must be larger"),
        ("--surface sphere --radii 1,inf", "inf"),
        ("--surface torus --tube 0.9,1 --ring 0.5", "not smaller than the ring"),
        ("--surface plane --periods 0,8 --height 0.5", "the first period is 0"),
        ("--surface plane --periods 8,8 --height -1", "the height is -1"),
        ("--surface plane --periods 8,8 --height 1 --delta 0.2", "--delta belongs to"),
        ("--cells 1 --hot NaN --cold 2 --runs 0", "faults in the arguments"),
        ("--surface klein-bottle", "possible values"),
        ("--surface sphere --radii 1,1.1 --open-faces walls", "no open faces"),
        ("--surface gyroid --open-faces walls", "no planes of mirror symmetry"),
        // Strips from wall to wall.
        (
            "--surface plane --periods 8,1 --height 0.5 --cells 4 --open-faces walls --sweeps 20",
            "too few cells",
        ),
        // Three cells cannot cover the P-surface, whatever the seed.
        ("--cells 3 --sweeps 20", "sound partition of the gap"),
    ] {
        let home = tempfile::tempdir()?;
        let ended = foam(home.path(), &format!("{arguments} --stop-after partition"))?;
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains(says), "{arguments}: {said}");
        assert!(!said.contains("panicked"), "{arguments}: {said}");
        assert_eq!(said.matches("error:").count(), 1, "{arguments}: {said}");
        assert_eq!(fs::read_dir(home.path())?.count(), 0, "{arguments} left something behind");
    }
    Ok(())
}

#[test]
fn a_file_in_the_place_of_the_folder_is_kept() -> Tested {
    let home = tempfile::tempdir()?;
    fs::write(home.path().join("out"), "precious")?;
    let ended = foam(home.path(), "--cells 40 --stop-after seeds")?;
    assert_eq!(ended.status.code(), Some(2));
    assert_eq!(fs::read_to_string(home.path().join("out"))?, "precious");
    Ok(())
}

#[test]
fn a_foam_of_twelve_cells_has_its_exact_energy() -> Tested {
    let home = tempfile::tempdir()?;
    let ended = foam(home.path(), "--surface sphere --radii 1,1.1 -n 12 --sweeps 100 --elements 4,2")?;
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let out = home.path().join("out");
    let summary = json(&out.join("summary.json"))?;
    // Plane films along the edges of a dodecahedron.
    let exact = 30.0 * (5.0_f64.sqrt() / 3.0).acos() * (1.1 * 1.1 - 1.0) / 2.0;
    let energy = summary["energy"].as_f64().ok_or("no energy")?;
    // Fourth order in the length of an element: 4e-5 was measured with two of them along an edge, a sixteenth with four.
    assert!((energy / exact - 1.0).abs() < 5e-6, "{energy} is not {exact}");
    assert_eq!(summary["stop"], "converged");
    for name in
        ["films.vtp", "films.glb", "foam.png", "energy.svg", "energy.csv", "cells.csv", "pattern.json"]
    {
        assert!(fs::metadata(out.join(name))?.len() > 0, "{name} is empty");
    }
    assert_eq!(&fs::read(out.join("films.glb"))?[..4], b"glTF");
    assert!(!out.join("checkpoint.json").exists());
    Ok(())
}

#[test]
fn the_best_of_some_runs_is_kept_whatever_the_threads() -> Tested {
    let written = |jobs: &str| -> Result<(Vec<u8>, Value), Box<dyn Error>> {
        let home = tempfile::tempdir()?;
        let ended = foam(
            home.path(),
            &format!("--surface sphere --radii 1,1.1 -n 14 --sweeps 50 --runs 3 -j {jobs}"),
        )?;
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let out = home.path().join("out");
        assert_eq!(fs::read_to_string(out.join("runs.csv"))?.lines().count(), 4);
        Ok((fs::read(out.join("cells.csv"))?, json(&out.join("summary.json"))?))
    };
    assert_eq!(written("1")?, written("2")?);
    Ok(())
}

#[test]
fn what_is_known_exactly_is_told_instead_of_relaxed() -> Tested {
    for (cells, films) in [(2, 2.0), (3, 3.0)] {
        let home = tempfile::tempdir()?;
        let ended = foam(home.path(), &format!("--surface sphere --radii 1,1.1 -n {cells}"))?;
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{said}");
        // Half discs between the spheres, each of area π (R₂² − R₁²)/2.
        let energy = films * 0.5 * std::f64::consts::PI * (1.1_f64.powi(2) - 1.0);
        assert!(said.contains(&format!("{energy:.10}")), "{said}");
    }
    Ok(())
}

#[test]
fn annealing_and_extrapolation_are_reported() -> Tested {
    let home = tempfile::tempdir()?;
    let ended =
        foam(home.path(), "--surface sphere --radii 1,1.1 -n 12 --sweeps 100 --anneal 4 --extrapolate")?;
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let summary = json(&home.path().join("out/summary.json"))?;
    assert_eq!(summary["annealing"]["cycles"], 4);
    // The dodecahedron is the least partition of twelve cells: no disturbance can lower it.
    assert_eq!(summary["annealing"]["kept"], 0);
    let exact = 30.0 * (5.0_f64.sqrt() / 3.0).acos() * (1.1 * 1.1 - 1.0) / 2.0;
    let limit = summary["extrapolated"]["limit"].as_f64().ok_or("no limit")?;
    // Richardson's step takes the fourth order away: 4e-5 with two elements along an edge becomes below 1e-6.
    assert!((limit / exact - 1.0).abs() < 1e-6, "{limit} is not {exact}");
    Ok(())
}

#[test]
fn many_runs_tell_their_distribution() -> Tested {
    let home = tempfile::tempdir()?;
    let ended = foam(home.path(), "--surface sphere --radii 1,1.1 -n 12 --sweeps 50 --runs 3")?;
    let said = String::from_utf8_lossy(&ended.stdout);
    for line in ["runs", "best energy", "quartiles", "runs at the lowest", "cells by sides"] {
        assert!(said.contains(line), "{line}: {said}");
    }
    Ok(())
}

#[test]
fn a_checkpoint_that_is_none_is_refused() -> Tested {
    let home = tempfile::tempdir()?;
    for (text, says) in [
        ("{\"schema\": \"combwright.foam-checkpoint/99\"}", "foam-checkpoint/99"),
        ("{\"schema\": \"combwright.foam-check", "cut short"),
        ("soap", "no checkpoint"),
    ] {
        let file = home.path().join("checkpoint.json");
        fs::write(&file, text)?;
        let ended = foam(home.path(), &format!("--resume {}", file.display()))?;
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{said}");
        assert!(said.contains(says), "{said}");
        assert!(!home.path().join("out").exists());
    }
    let ended = foam(home.path(), "--resume nowhere/checkpoint")?;
    assert_eq!(ended.status.code(), Some(2));
    Ok(())
}

/// The default of a recipe: as much of the gap as is printed, with plane walls at its open faces.
#[test]
fn a_recipe_is_filled_as_far_as_it_is_printed_and_cells_at_its_faces_are_cut() -> Tested {
    let home = tempfile::tempdir()?;
    let recipe = home.path().join("half.toml");
    fs::write(
        &recipe,
        "[cell]\nperiod = 50.0\npart = \"half\"\n[gap]\nshape = \"level-set\"\ndelta = 0.2\n",
    )?;
    let of = |faces: &str| -> Result<(Value, String), Box<dyn Error>> {
        let arguments = format!("--recipe {} -n 36 --sweeps 100 {faces}", recipe.display());
        let ended = foam(home.path(), &arguments)?;
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let out = home.path().join("out");
        Ok((json(&out.join("summary.json"))?, fs::read_to_string(out.join("cells.csv"))?))
    };
    let (walls, cells) = of("")?;
    // Half of the volume of |Φ| < 0.2.
    let volume = walls["gap_volume"].as_f64().ok_or("no volume")? / 50.0_f64.powi(3);
    assert!((volume / 0.057_079_498_276_435 - 1.0).abs() < 1e-8, "{volume}");
    let cut = cells.lines().filter(|line| line.contains(",cut,")).count();
    assert!((10..36).contains(&cut) && walls["cut_cells"] == cut, "{cut} in {cells}");
    assert_eq!(cells.lines().filter(|line| line.contains(",complete,")).count(), 36 - cut);
    let pattern = json(&home.path().join("out/pattern.json"))?;
    assert_eq!(pattern["surroundings"], "open");
    // Periodic along x and y, fewer cells end at planes.
    let (periodic, _) = of("--open-faces periodic")?;
    assert!(periodic["cut_cells"].as_u64().ok_or("no count")? < cut as u64);
    assert!(periodic["energy"].as_f64() > walls["energy"].as_f64());
    Ok(())
}

#[test]
fn annealing_gives_the_same_files_with_any_number_of_threads() -> Tested {
    let written = |jobs: &str| -> Result<Vec<Vec<u8>>, Box<dyn Error>> {
        let home = tempfile::tempdir()?;
        let arguments = "--surface plane --periods 5,5 --height 0.4 -n 20 --sweeps 30 --anneal 12";
        let ended = foam(home.path(), &format!("{arguments} --open-faces walls -j {jobs}"))?;
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        ["cells.csv", "pattern.json", "films.vtp", "summary.json"]
            .iter()
            .map(|name| Ok(fs::read(home.path().join("out").join(name))?))
            .collect()
    };
    assert_eq!(written("1")?, written("2")?);
    Ok(())
}

/// The enclosure of the paper: its gap is too wide for films that all reach from wall to wall.
const PAPER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/enclosures/paper/recipe.toml");

#[test]
fn a_wide_gap_is_filled_by_films_of_free_topology_with_any_number_of_threads() -> Tested {
    let written = |jobs: &str| -> Result<Vec<Vec<u8>>, Box<dyn Error>> {
        let home = tempfile::tempdir()?;
        let ended = foam(home.path(), &format!("--recipe {PAPER} --cells 32 -j {jobs}"))?;
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        ["summary.json", "cells.csv", "films.vtp", "pattern-lower-wall.json", "pattern-upper-wall.json"]
            .iter()
            .map(|name| Ok(fs::read(home.path().join("out").join(name))?))
            .collect()
    };
    let files = written("1")?;
    assert_eq!(files, written("2")?);
    let summary: Value = serde_json::from_slice(&files[0])?;
    let number = |name: &str| summary[name].as_f64().ok_or_else(|| format!("no {name}"));
    assert!(summary["nodes_even"] == true && summary["unstable_directions"] == 0, "{summary}");
    assert!(number("part")? >= 1.0 && number("network_part")? < 1.0, "{summary}");
    // What the relaxation promises.
    assert!(number("residual")? < 1e-10 && number("volume_error")? < 1e-10, "{summary}");
    // Every cell has a number of sides on a wall, or ends at a plane there.
    for wall in 0..2 {
        let counts = summary["side_counts"][wall].as_array().ok_or("no sides")?;
        let complete: u64 = counts.iter().filter_map(Value::as_u64).sum();
        assert_eq!(Some(32 - complete), summary["cut_patches"][wall].as_u64(), "{summary}");
    }
    let cells = String::from_utf8_lossy(&files[1]);
    assert_eq!(cells.lines().filter(|line| line.contains(",cut,")).count() as u64, summary["cut_cells"]);
    assert!(number("twisted_cells")? > 0.0 && number("lowest_eigenvalue")? > 0.0, "{summary}");
    Ok(())
}

#[test]
fn a_gap_too_wide_for_a_foam_ends_with_the_widest_that_is_in_balance_and_says_so() -> Tested {
    let home = tempfile::tempdir()?;
    let ended = foam(home.path(), &format!("--recipe {PAPER} --cells 16"))?;
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("no foam of one layer in so wide a gap") && said.contains("beyond, "), "{said}");
    let summary = json(&home.path().join("out/summary.json"))?;
    // A foam on even nodes goes before one in a wider gap that is in balance on uneven ones only.
    assert_eq!((&summary["nodes_even"], &summary["unstable_directions"]), (&true.into(), &0.into()));
    let part = summary["part"].as_f64().ok_or("no part")?;
    assert!(part < 1.0 && part >= summary["network_part"].as_f64().ok_or("no network")?, "{summary}");
    assert!(summary["residual"].as_f64().ok_or("no residual")? < 1e-10);
    Ok(())
}
