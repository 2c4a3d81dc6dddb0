//! Corrections by hand: what a person says of cells holds, and nothing of it is lost.

#[path = "support/comb.rs"]
mod support;

use combwright::{
    comb::{self, Correction, Corrections, Settings, synthetic::Style},
    tessellation::{CellId, CellStatus},
};
use glam::DVec2;
use std::fs;
use support::{TestResult, combwright, drawn, near, settings, table};

#[test]
fn a_person_has_the_last_word() -> TestResult {
    let (photo, _) = drawn(0.0, &settings(40, 0.2, Style::Wax));
    let first = comb::read(&photo, &Settings::default())?;
    let Some(id) = near(&first, DVec2::new(450.0, 350.0)) else { panic!("no cells") };
    let cell = first.pattern.cells[id].clone();
    let at = cell.position.truncate();
    let Some(neighbour) = cell.walls.iter().find_map(|w| w.neighbour) else { panic!("no neighbours") };
    let with = first.pattern.cells[neighbour].position.truncate();
    let read = |corrections| {
        comb::read(&photo, &Settings { corrections: Corrections::new(corrections), ..Settings::default() })
    };
    let set = read(vec![Correction::Sides { at, sides: 9 }])?;
    assert_eq!(near(&set, at).and_then(|i| set.pattern.cells[i].sides), Some(9));
    // Two hexagons side by side have eight neighbours together.
    let joined = read(vec![Correction::Join { at, with }])?;
    assert_eq!(joined.pattern.cells.len() + 1, first.pattern.cells.len());
    assert_eq!(near(&joined, (at + with) / 2.0).and_then(|i| joined.pattern.cells[i].sides), Some(8));
    let doubted = read(vec![Correction::Status { at, status: CellStatus::Uncertain }])?;
    assert_eq!(near(&doubted, at).map(|i| doubted.pattern.cells[i].status), Some(CellStatus::Uncertain));
    let gone = read(vec![Correction::Remove { at }])?;
    assert_eq!(gone.pattern.cells.len() + 1, first.pattern.cells.len());
    let back = read(vec![Correction::Remove { at }, Correction::Add { at }])?;
    assert_eq!(back.pattern.cells.len(), first.pattern.cells.len());
    assert_eq!(near(&back, at).and_then(|i| back.pattern.cells[i].sides), Some(6));
    let split = read(vec![Correction::Split { at, into: [at - DVec2::X * 9.0, at + DVec2::X * 9.0] }])?;
    assert_eq!(split.pattern.cells.len(), first.pattern.cells.len() + 1);
    let polygon =
        [(-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (-60.0, 60.0)].map(|(x, y)| at + DVec2::new(x, y));
    let masked = read(vec![Correction::Mask { polygon: polygon.to_vec() }])?;
    assert!(masked.pattern.cells.len() + 4 < first.pattern.cells.len());
    assert!(read(vec![Correction::Remove { at: DVec2::new(-500.0, 0.0) }]).is_err());
    Ok(())
}

#[test]
fn an_edited_table_is_read_back_and_nothing_is_lost() -> TestResult {
    let (photo, _) = drawn(0.4, &settings(40, 0.3, Style::Wax));
    let first = comb::read(&photo, &Settings::default())?;
    let mut rows = table(&first)?;
    assert!(
        Corrections::from_table(&rows, &first).corrections.is_empty(),
        "an unedited table corrects nothing"
    );
    let Some(place) = rows.iter().position(|r| r.sides == Some(6)) else { panic!("no hexagon") };
    rows[place].sides = Some(4);
    let removed = rows.remove(place + 5);
    let corrections = Corrections::from_table(&rows, &first);
    let text = serde_json::to_string(&corrections)?;
    let again = Corrections::from_json(&text)?;
    assert_eq!(again, corrections);
    let second = comb::read(&photo, &Settings { corrections: again, ..Settings::default() })?;
    let edited = near(&second, rows[place].position());
    assert_eq!(edited.and_then(|id| second.pattern.cells[id].sides), Some(4));
    let gone = near(&second, removed.position()).map(|id| second.pattern.cells[id].position.truncate());
    assert!(gone.is_some_and(|p| p.distance(removed.position()) > 10.0));
    Ok(())
}

#[test]
fn cells_around_a_removed_one_are_cut() -> TestResult {
    // Hexagons: without the hole its six neighbours would share its pixels and count five or seven.
    let (photo, _) = drawn(0.0, &settings(40, 0.2, Style::Wax));
    let first = comb::read(&photo, &Settings::default())?;
    let Some(id) = near(&first, DVec2::new(450.0, 350.0)) else { panic!("no cells") };
    let at = first.pattern.cells[id].position.truncate();
    let corrections = Corrections::new(vec![Correction::Remove { at }]);
    let comb = comb::read(&photo, &Settings { corrections, ..Settings::default() })?;
    let around = comb.pattern.cells.iter().filter(|c| c.position.truncate().distance(at) < 55.0);
    let statuses: Vec<CellStatus> = around.map(|cell| cell.status).collect();
    assert!(statuses.len() == 6 && statuses.iter().all(|s| *s == CellStatus::Cut), "{statuses:?}");
    assert!(comb.pattern.complete().all(|(_, cell)| cell.sides == Some(6)));
    Ok(())
}

#[test]
fn a_cell_added_takes_the_place_of_a_hidden_one() -> TestResult {
    let (photo, _) = drawn(0.0, &settings(40, 0.5, Style::Wax));
    let first = comb::read(&photo, &Settings::default())?;
    let enclosed = |id: &CellId| {
        let cell = &first.pattern.cells[*id];
        !first.details[*id].seen && cell.position.truncate().distance(DVec2::new(450.0, 350.0)) < 250.0
    };
    let Some(hidden) = first.pattern.cells.ids().find(enclosed) else { panic!("no cell is hidden") };
    let at = first.pattern.cells[hidden].position.truncate();
    let cell = 40.0 * 40.0 * 0.75_f64.sqrt();
    for correction in [Correction::Add { at }, Correction::Sides { at, sides: 6 }] {
        let corrections = Corrections::new(vec![correction]);
        let comb = comb::read(&photo, &Settings { corrections, ..Settings::default() })?;
        assert_eq!(comb.pattern.cells.len(), first.pattern.cells.len());
        let Some(id) = near(&comb, at) else { panic!("no cells") };
        assert!(comb.details[id].seen && !comb.details[id].outline.is_empty());
        // What fills it may keep some of its pixels from it, but not most.
        assert!(
            (0.5..1.3).contains(&(comb.pattern.cells[id].area / cell)),
            "{}",
            comb.pattern.cells[id].area
        );
    }
    Ok(())
}

#[test]
fn corrections_that_cannot_be_meant_are_refused() {
    let (photo, _) = drawn(0.0, &settings(40, 0.2, Style::Wax));
    let at = DVec2::new(450.0, 350.0);
    let far = DVec2::new(1e300, 222.0);
    for (correction, word) in [
        (Correction::Sides { at, sides: 4_000_000_000 }, "number of sides"),
        (Correction::Sides { at, sides: 0 }, "number of sides"),
        (Correction::Add { at: far }, "not in the photograph"),
        (Correction::Add { at: DVec2::new(f64::NAN, 1.0) }, "not in the photograph"),
        (Correction::Join { at, with: at + DVec2::X * 200.0 }, "only neighbours"),
        (Correction::Split { at, into: [at, at] }, "coincide"),
        (Correction::Split { at, into: [at, at + DVec2::X * 300.0] }, "not in the cell"),
        (Correction::Mask { polygon: vec![at, at + DVec2::X] }, "three corners"),
    ] {
        let corrections = Corrections::new(vec![correction.clone()]);
        let read = comb::read(&photo, &Settings { corrections, ..Settings::default() });
        let Err(error) = read else { panic!("{correction:?} is accepted") };
        assert!(error.to_string().contains(word), "{error}");
    }
    let Some(id) = comb::read(&photo, &Settings::default())
        .ok()
        .and_then(|comb| near(&comb, at).map(|id| comb.pattern.cells[id].position.truncate()))
    else {
        panic!("no cells")
    };
    let corrections = Corrections::new(vec![Correction::Add { at: id }]);
    let twice = comb::read(&photo, &Settings { corrections, ..Settings::default() });
    assert!(twice.is_err_and(|e| e.to_string().contains("was found there")));
}

#[test]
fn rows_may_be_short_and_fields_empty() -> TestResult {
    let text = "id,x_px,y_px,sides,other_sides,status,confidence,area_px2,seen\n,10,20,6,,complete,,,\n,30,40,5,,uncertain\n";
    let rows = comb::read_cells(text.as_bytes())?;
    assert_eq!(rows.iter().map(|row| row.sides).collect::<Vec<_>>(), [Some(6), Some(5)]);
    assert!(rows.iter().all(|row| row.area_px2 == 0.0 && row.seen == 0));
    Ok(())
}

#[test]
fn what_a_person_said_holds_in_later_runs() -> TestResult {
    let home = tempfile::tempdir()?;
    let path = |name: &str| home.path().join(name).display().to_string();
    let drawn =
        combwright(&["comb", "render", "--cells", "150", "--difficulty", "0.2", "-o", &path("photos")])?;
    assert!(drawn.status.success());
    let (photo, out) = (path("photos/photo.png"), path("out"));
    let table = home.path().join("out/photo/cells.csv");
    let run = |more: &[&str]| combwright(&[&["comb", &photo, "-o", &out], more].concat());
    assert!(run(&[])?.status.success());
    let plain = fs::read_to_string(&table)?;
    let [width, height] = [200, 150];
    let mask = format!(
        r#"{{"schema": "combwright.corrections/1", "corrections": [{{"mask": {{"polygon": [[0, 0], [{width}, 0], [{width}, {height}], [0, {height}]]}}}}]}}"#
    );
    fs::write(home.path().join("mine.json"), mask)?;
    assert!(run(&["--corrections", &path("mine.json")])?.status.success());
    let masked = fs::read_to_string(&table)?;
    assert!(masked.lines().count() < plain.lines().count());
    // Without a word they hold; a table that was edited adds to them.
    assert!(String::from_utf8(run(&[])?.stderr)?.contains("1 corrections"));
    assert_eq!(fs::read_to_string(&table)?, masked);
    let row = masked.lines().find(|row| row.contains(",6,,complete,")).ok_or("no hexagon")?;
    let edited = masked.replace(row, &row.replace(",6,,complete,", ",4,,complete,"));
    fs::write(&table, &edited)?;
    assert!(run(&["--corrections", &table.display().to_string()])?.status.success());
    let again = fs::read_to_string(&table)?;
    assert_eq!(again.lines().count(), masked.lines().count());
    assert!(again.contains(",4,,complete,1"), "{again}");
    // Nothing that a person wrote is lost.
    let notes = home.path().join("out/photo/cells.before-1.csv");
    assert_eq!(fs::read_to_string(&notes)?, edited);
    fs::remove_file(&notes)?;
    fs::write(&table, "x_px,y_px,sides,status\n1,2,6,complete\n")?;
    assert!(run(&["--no-corrections"])?.status.success());
    assert_eq!(fs::read_to_string(&table)?, plain);
    let kept = fs::read_to_string(&notes)?;
    assert!(kept.starts_with("x_px,y_px,sides,status"));
    Ok(())
}
