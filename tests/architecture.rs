//! Rooms import downward only: the table of the README's map, held against the code.

use std::{
    collections::BTreeSet,
    fs, io,
    path::{Path, PathBuf},
};

/// Each room and the rooms that it may import.
const ROOMS: &[(&str, &[&str])] = &[
    ("units", &[]),
    ("index", &[]),
    ("surface", &["units"]),
    ("mesh", &["units", "index", "surface"]),
    ("tessellation", &["units", "index"]),
    ("enclosure", &["units", "index", "surface", "mesh"]),
    ("foam", &["units", "index", "surface", "tessellation"]),
    ("evolver", &["index", "surface", "foam"]),
    ("comb", &["units", "index", "tessellation"]),
    ("compare", &["tessellation"]),
    ("projection", &["units", "index", "surface", "tessellation"]),
    (
        "report",
        &[
            "units",
            "index",
            "surface",
            "mesh",
            "tessellation",
            "enclosure",
            "foam",
            "evolver",
            "comb",
            "compare",
            "projection",
        ],
    ),
];

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            rust_files(&path, into)?;
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
    Ok(())
}

/// The room of a file: the first part of its path below `src`, without `.rs`.
fn room_of(source: &Path, file: &Path) -> String {
    let inner = file.strip_prefix(source).unwrap_or(file);
    let first = inner.components().next().map(|c| c.as_os_str().to_string_lossy().into_owned());
    first.unwrap_or_default().trim_end_matches(".rs").to_owned()
}

/// The rooms named behind `crate::` anywhere in the code, grouped imports included; comments and strings do not count.
fn imported(text: &str) -> BTreeSet<String> {
    let code: String =
        text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
    let mut rooms = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(group) => top_level_names(group),
            None => vec![rest],
        };
        for name in names {
            let word: String = name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            rooms.insert(word);
        }
    }
    rooms
}

/// The first words of the entries of a braced import, up to its closing brace.
fn top_level_names(group: &str) -> Vec<&str> {
    let (mut depth, mut start, mut names) = (0, 0, Vec::new());
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => {
                names.push(&group[start..at]);
                break;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                names.push(&group[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    names
}

#[test]
fn rooms_import_downward_only() -> io::Result<()> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&source, &mut files)?;
    assert!(files.len() > 10, "the source was not found");
    let known: BTreeSet<&str> = ROOMS.iter().map(|(room, _)| *room).collect();
    let mut faults = Vec::new();
    for file in files {
        let room = room_of(&source, &file);
        if ["lib", "main", "cli"].contains(&room.as_str()) {
            continue;
        }
        let Some((_, allowed)) = ROOMS.iter().find(|(name, _)| *name == room) else {
            faults.push(format!("{}: the room '{room}' is not in the table", file.display()));
            continue;
        };
        for other in imported(&fs::read_to_string(&file)?) {
            if other != room && known.contains(other.as_str()) && !allowed.contains(&other.as_str()) {
                faults.push(format!("{}: {room} may not import {other}", file.display()));
            }
            if other == "cli" {
                faults.push(format!("{}: {room} may not import cli", file.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    Ok(())
}

#[test]
fn grouped_and_inline_imports_are_seen() {
    let text = "use crate::{mesh::{A, B}, units::Mm};\nfn f() -> crate::foam::Foam {} // crate::comb";
    let expected: BTreeSet<String> = ["mesh", "units", "foam"].map(str::to_owned).into();
    assert_eq!(imported(text), expected);
}
