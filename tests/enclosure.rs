//! The command `combwright enclosure` as its user meets it.

use serde_json::Value;
use std::{
    error::Error,
    fs,
    path::Path,
    process::{Command, Output},
};

type Tested = Result<(), Box<dyn Error>>;

fn combwright(arguments: &[&str], folder: &Path) -> std::io::Result<Output> {
    Command::new(env!("CARGO_BIN_EXE_combwright")).args(arguments).current_dir(folder).output()
}

fn check_of(folder: &Path) -> Result<Value, Box<dyn Error>> {
    Ok(serde_json::from_str(&fs::read_to_string(folder.join("check.json"))?)?)
}

/// What must hold of every enclosure, whatever the recipe.
fn assert_sound(check: &Value, what: &str) {
    for part in check["parts"].as_array().into_iter().flatten() {
        let name = format!("{what}: {}", part["name"]);
        assert_eq!(part["closed"], true, "{name}");
        assert_eq!(part["oriented"], true, "{name}");
        assert_eq!(part["components"], 1, "{name}");
        assert_eq!(part["genus"], part["expected_genus"], "{name}");
        assert_eq!(part["self_intersections"], 0, "{name}");
    }
    assert_eq!(check["sound"], true, "{what}");
}

#[test]
fn the_defaults_leave_parts_pictures_and_tables() -> Tested {
    let home = tempfile::tempdir()?;
    let ran = combwright(&["enclosure", "--cells", "48", "--format", "ply,obj,glb"], home.path())?;
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let out = home.path().join("enclosure-out");
    let mut files: Vec<String> = fs::read_dir(&out)?
        .map(|e| e.map(|e| e.file_name().to_string_lossy().into_owned()))
        .collect::<Result<_, _>>()?;
    files.sort();
    let expected = [
        "base.ply",
        "base.png",
        "base.stl",
        "base.svg",
        "check.json",
        "enclosure.3mf",
        "enclosure.glb",
        "enclosure.obj",
        "gap.csv",
        "inner-shell.ply",
        "inner-shell.stl",
        "outer-shell.ply",
        "outer-shell.stl",
        "preview.png",
        "run.json",
        "section.png",
    ];
    assert_eq!(files, expected);
    let check = check_of(&out)?;
    assert_sound(&check, "defaults");
    // At 48 cells chords lie up to h²κ/8 = 4.2² · 0.07 / 8 = 0.15 mm inside the walls on either side.
    let gap = &check["gap_mm"];
    assert!(
        (gap["min"].as_f64().unwrap_or(0.0) - 32.0).abs() < 0.3
            && (gap["max"].as_f64().unwrap_or(0.0) - 32.0).abs() < 0.3
    );
    let table = String::from_utf8(ran.stdout)?;
    assert!(table.contains("gap") && table.contains("inner-shell") && table.contains("sound"), "{table}");
    Ok(())
}

#[test]
fn every_recipe_is_sound_and_measures_what_its_folder_says() -> Tested {
    let recipes = Path::new(env!("CARGO_MANIFEST_DIR")).join("enclosures");
    let mut count = 0;
    for entry in fs::read_dir(recipes)? {
        let folder = entry?.path();
        let home = tempfile::tempdir()?;
        let recipe = folder.join("recipe.toml");
        let ran = combwright(&["enclosure", &recipe.to_string_lossy(), "-o", "out"], home.path())?;
        assert!(ran.status.success(), "{}: {}", recipe.display(), String::from_utf8_lossy(&ran.stderr));
        let (fresh, kept) = (check_of(&home.path().join("out"))?, check_of(&folder)?);
        assert_sound(&fresh, &recipe.to_string_lossy());
        assert_close(&fresh, &kept, &recipe.to_string_lossy());
        count += 1;
    }
    assert!(count >= 3, "recipes are missing");
    Ok(())
}

/// The same page, numbers to the rounding of another machine's functions.
fn assert_close(fresh: &Value, kept: &Value, at: &str) {
    match (fresh, kept) {
        (Value::Object(a), Value::Object(b)) => {
            assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>(), "{at}");
            a.iter().for_each(|(key, value)| assert_close(value, &b[key], &format!("{at}/{key}")));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{at}");
            a.iter().zip(b).for_each(|(x, y)| assert_close(x, y, at));
        }
        (Value::Number(a), Value::Number(b)) => {
            let (x, y) = (a.as_f64().unwrap_or(f64::NAN), b.as_f64().unwrap_or(f64::NAN));
            assert!((x - y).abs() <= 1e-6 * (1.0 + y.abs()), "{at}: {x} is not {y}");
        }
        _ => assert_eq!(fresh, kept, "{at}"),
    }
}

#[test]
fn coarse_and_fine_grids_and_all_parts_are_sound() -> Tested {
    let home = tempfile::tempdir()?;
    let cases: [&[&str]; 8] = [
        &["--cells", "32"],
        &["--cells", "64"],
        &["--cells", "127"],
        &["--cells", "32", "--shape", "level-set", "--gap", "30"],
        &["--cells", "64", "--delta", "0.2", "--wall", "1.2", "--no-base"],
        &["--cells", "48", "--part", "whole", "--gap", "24"],
        &["--cells", "64", "--part", "octant"],
        &["--cells", "40", "--block", "1.5,1,0.5", "--period", "130"],
    ];
    for (index, case) in cases.iter().enumerate() {
        let out = format!("out{index}");
        let ran = combwright(&[&["enclosure", "-o", &out], *case].concat(), home.path())?;
        assert!(ran.status.success(), "{case:?}: {}", String::from_utf8_lossy(&ran.stderr));
        assert_sound(&check_of(&home.path().join(&out))?, &format!("{case:?}"));
    }
    Ok(())
}

#[test]
fn one_and_two_threads_write_the_same_bytes() -> Tested {
    let home = tempfile::tempdir()?;
    for threads in ["1", "2"] {
        let status = Command::new(env!("CARGO_BIN_EXE_combwright"))
            .args(["enclosure", "--cells", "64", "-o", threads])
            .env("RAYON_NUM_THREADS", threads)
            .current_dir(home.path())
            .status()?;
        assert!(status.success());
    }
    for entry in fs::read_dir(home.path().join("1"))? {
        let name = entry?.file_name();
        // run.json holds the times.
        if name != "run.json" {
            let bytes = |threads| fs::read(home.path().join(threads).join(&name));
            assert!(bytes("1")? == bytes("2")?, "{}", name.to_string_lossy());
        }
    }
    Ok(())
}

#[test]
fn a_recipe_to_edit_is_written_once() -> Tested {
    let home = tempfile::tempdir()?;
    assert!(combwright(&["enclosure", "--init", "my.toml"], home.path())?.status.success());
    let written = fs::read_to_string(home.path().join("my.toml"))?;
    fs::write(home.path().join("my.toml"), "mine")?;
    let again = combwright(&["enclosure", "--init", "my.toml"], home.path())?;
    assert_eq!(again.status.code(), Some(2));
    assert_eq!(fs::read_to_string(home.path().join("my.toml"))?, "mine");
    fs::write(home.path().join("my.toml"), written)?;
    let ran = combwright(&["enclosure", "my.toml", "--cells", "32"], home.path())?;
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    Ok(())
}

#[test]
fn mistakes_are_told_with_their_place_and_leave_nothing_behind() -> Tested {
    let home = tempfile::tempdir()?;
    let write = |name: &str, text: &str| fs::write(home.path().join(name), text);
    write("unknown.toml", "[wall]\nthicknes = 2.0\n")?;
    write("negative.toml", "name = 'x'\n[cell]\nperiod = -5.0\n")?;
    write("nan.toml", "[wall]\nthickness = nan\n")?;
    write("kind.toml", "[mesh]\nsamples = 'many'\n")?;
    write("broken.toml", "[wall\n")?;
    write("afile", "")?;
    fs::write(home.path().join("binary.toml"), [0xff, 0xfe, 0x00])?;
    let cases: [(&[&str], &[&str]); 16] = [
        (&["unknown.toml"], &["unknown.toml", "line 2", "thicknes"]),
        (&["negative.toml"], &["line 3", "cell.period", "-5"]),
        (&["nan.toml"], &["line 2", "wall.thickness", "NaN"]),
        (&["kind.toml"], &["line 2", "many"]),
        (&["broken.toml"], &["line 1"]),
        (&["binary.toml"], &["cannot read", "binary.toml"]),
        (&["missing.toml"], &["cannot read", "missing.toml"]),
        (&["--period", "0"], &["cell.period", "0"]),
        (&["--gap", "-3"], &["gap.width", "-3"]),
        (&["--gap", "NaN"], &["gap.width", "NaN"]),
        (&["--gap", "90"], &["gap", "fold", "largest parallel gap", "period above"]),
        (&["--gap", "90", "--shape", "level-set"], &["largest", "period above"]),
        (&["--wall", "30", "--delta", "0.5"], &["wall.thickness", "thicker"]),
        (&["--cells", "4000"], &["mesh.samples", "GB"]),
        (&["-o", "afile"], &["afile"]),
        (&["--block", "1.2,1,1"], &["cell.block", "1.2"]),
    ];
    for (arguments, words) in cases {
        let ran = combwright(&[&["enclosure"], arguments].concat(), home.path())?;
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert_eq!(ran.status.code(), Some(2), "{arguments:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{arguments:?}: '{word}' is missing in: {said}");
        }
        assert!(!home.path().join("enclosure-out").exists(), "{arguments:?} left a folder");
        let hidden =
            fs::read_dir(home.path())?.flatten().any(|e| e.file_name().to_string_lossy().starts_with('.'));
        assert!(!hidden, "{arguments:?} left temporary files");
    }
    Ok(())
}
