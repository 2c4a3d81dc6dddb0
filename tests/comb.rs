//! The comb room from outside: synthetic photographs with exact truth, real ones where they are at hand, bad input.

use combwright::{
    comb::{
        self, Comb, CombError, Correction, Corrections, Mask, Part, Photo, PhotoError, Settings, Truth,
        synthetic::{Arrangement, Difficulty, RenderSettings, Style, render},
    },
    tessellation::{CellId, CellStatus},
};
use glam::DVec2;
use image::{DynamicImage, RgbImage};
use std::{collections::HashMap, error::Error, fs, path::Path};

type TestResult = Result<(), Box<dyn Error>>;

fn settings(pitch: u32, difficulty: f64, style: Style) -> RenderSettings {
    RenderSettings {
        width: 900,
        height: 700,
        pitch: f64::from(pitch),
        style,
        difficulty: Difficulty::dial(difficulty),
        torn_edge: false,
        seed: 7,
    }
}

fn drawn(disorder: f64, settings: &RenderSettings) -> (Photo, Truth) {
    let extent = [settings.width, settings.height].map(|length| f64::from(length) / settings.pitch);
    let (picture, truth) =
        render(&Arrangement::random(extent[0], extent[1], disorder, settings.seed), settings);
    (Photo::from_picture(DynamicImage::ImageRgb8(picture)), truth)
}

fn table(comb: &Comb) -> Result<Vec<comb::CellRow>, Box<dyn Error>> {
    let mut bytes = Vec::new();
    comb::write_cells(comb, &mut bytes)?;
    Ok(comb::read_cells(bytes.as_slice())?)
}

fn near(comb: &Comb, at: DVec2) -> Option<CellId> {
    let distance = |id: &CellId| comb.pattern.cells[*id].position.truncate().distance(at);
    comb.pattern.cells.ids().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// One wrong cell in a hundred, or one wrong pair, is what may be asked of pictures of 50 to 900 cells; the accuracy study
/// measures more finely.
#[test]
fn sides_are_right_in_every_style_and_size() -> TestResult {
    for (style, pitch) in
        [(Style::Wax, 25), (Style::Base, 25), (Style::Bright, 30), (Style::Brood, 45), (Style::Wax, 90)]
    {
        let (photo, truth) = drawn(0.6, &settings(pitch, 0.3, style));
        let comb = comb::read(&photo, &Settings::default())?;
        assert!(
            (comb.pitch / f64::from(pitch) - 1.0).abs() < 0.05,
            "{style:?}: pitch {} for {pitch}",
            comb.pitch
        );
        let score = comb::score(&table(&comb)?, &truth);
        assert!(score.recall > 0.99, "{style:?} {pitch}: recall {}", score.recall);
        assert!(score.coverage > 0.9, "{style:?} {pitch}: coverage {}", score.coverage);
        let allowed = (score.counted / 100).max(2);
        assert!(score.wrong.len() <= allowed, "{style:?} {pitch}: {} {:?}", score.sides_right, score.wrong);
        assert!(score.sure_right >= 0.95, "{style:?} {pitch}: {}", score.sure_right);
    }
    Ok(())
}

/// The classic error: at the edges of photograph, comb and cover a naive count finds fives and sevens.
#[test]
fn hexagons_have_no_defects_at_any_edge() -> TestResult {
    for torn_edge in [false, true] {
        let mut render = settings(40, 0.3, Style::Wax);
        render.torn_edge = torn_edge;
        let (photo, _) = drawn(0.0, &render);
        let comb = comb::read(&photo, &Settings::default())?;
        let counts = comb.pattern.side_counts();
        assert!(counts[6] > 100, "{counts:?}");
        let odd: Vec<_> = comb.pattern.complete().filter(|(_, c)| c.sides != Some(6)).collect();
        assert!(odd.is_empty(), "torn {torn_edge}: {odd:?}");
    }
    Ok(())
}

#[test]
fn what_a_mask_hides_gives_no_cells_and_cuts_its_neighbours() -> TestResult {
    let (photo, _) = drawn(0.0, &settings(40, 0.2, Style::Wax));
    let hidden = |x: u32, y: u32| (300..600).contains(&x) && (200..500).contains(&y);
    let mask = RgbImage::from_fn(900, 700, |x, y| image::Rgb([if hidden(x, y) { 255 } else { 0 }; 3]));
    let mask = Mask::from_picture(&Photo::from_picture(DynamicImage::ImageRgb8(mask)));
    let comb = comb::read(&photo, &Settings { mask: Some(mask), ..Settings::default() })?;
    let beside = |p: DVec2| p.x > 280.0 && p.x < 620.0 && p.y > 180.0 && p.y < 520.0;
    for cell in &comb.pattern.cells {
        let at = cell.position.truncate();
        let inside = at.x > 300.0 && at.x < 600.0 && at.y > 200.0 && at.y < 500.0;
        assert!(!inside, "a cell at {at}");
        assert!(!beside(at) || cell.status != CellStatus::Complete, "complete at {at}");
    }
    assert_eq!(comb.pattern.side_counts().len(), 7);
    let small = RgbImage::new(10, 10);
    let wrong = Mask::from_picture(&Photo::from_picture(DynamicImage::ImageRgb8(small)));
    let refused = comb::read(&photo, &Settings { mask: Some(wrong), ..Settings::default() });
    assert!(matches!(refused, Err(CombError::MaskSize { .. })));
    Ok(())
}

#[test]
fn a_region_is_read_in_the_pixels_of_the_photograph() -> TestResult {
    let (photo, _) = drawn(0.3, &settings(40, 0.2, Style::Wax));
    let whole = comb::read(&photo, &Settings::default())?;
    let part = Part { left: 250, top: 150, width: 500, height: 450 };
    let comb = comb::read(&photo, &Settings { part: Some(part), ..Settings::default() })?;
    let mut same = 0;
    for (_, cell) in comb.pattern.complete() {
        let at = cell.position.truncate();
        let Some(other) = near(&whole, at) else { panic!("no cells") };
        // A pixel of the working raster is a pixel here; the two readings differ by less than two.
        let distance = whole.pattern.cells[other].position.truncate().distance(at);
        assert!(distance < 2.0, "{at} is {distance} px off");
        same += usize::from(whole.pattern.cells[other].sides == cell.sides);
    }
    assert!(same > 60, "only {same} cells agree");
    let beyond = Part { left: 800, top: 0, width: 101, height: 10 };
    let refused = comb::read(&photo, &Settings { part: Some(beyond), ..Settings::default() });
    assert!(matches!(refused, Err(CombError::Region { .. })));
    Ok(())
}

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

#[test]
fn threads_do_not_change_a_byte() -> TestResult {
    let (photo, _) = drawn(0.5, &settings(30, 0.5, Style::Base));
    let mut tables = Vec::new();
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let comb = pool.install(|| comb::read(&photo, &Settings::default()))?;
        tables.push((serde_json::to_string(&comb.pattern)?, drawn(0.5, &settings(30, 0.5, Style::Base)).1));
    }
    assert_eq!(tables[0], tables[1]);
    Ok(())
}

#[test]
fn what_is_no_comb_is_refused() {
    let read = |picture: RgbImage| {
        comb::read(&Photo::from_picture(DynamicImage::ImageRgb8(picture)), &Settings::default())
    };
    let mut state = 1_u32;
    let noise = RgbImage::from_fn(500, 400, |_, _| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        image::Rgb([(state >> 24) as u8; 3])
    });
    let stripes = RgbImage::from_fn(500, 400, |x, _| image::Rgb([if x / 20 % 2 == 0 { 40 } else { 200 }; 3]));
    for (name, picture) in [
        ("blank", RgbImage::new(400, 300)),
        ("one pixel", RgbImage::new(1, 1)),
        ("a line", RgbImage::new(900, 1)),
        ("noise", noise),
        ("stripes", stripes),
    ] {
        assert!(matches!(read(picture), Err(CombError::NoComb)), "{name}");
    }
    let (small, _) = drawn(0.0, &settings(8, 0.0, Style::Wax));
    assert!(matches!(comb::read(&small, &Settings::default()), Err(CombError::TooFine { .. })));
}

#[test]
fn damaged_files_are_named() -> TestResult {
    let home = tempfile::tempdir()?;
    let (photo, _) = drawn(0.0, &settings(40, 0.0, Style::Wax));
    let whole = home.path().join("whole.png");
    photo.to_rgb8().save(&whole)?;
    let bytes = fs::read(&whole)?;
    let cut = home.path().join("cut.png");
    fs::write(&cut, &bytes[..bytes.len() / 2])?;
    let video = home.path().join("video.mp4");
    fs::write(&video, b"\0\0\0\x18ftypmp42")?;
    for path in [cut, video] {
        let Err(error) = Photo::open(&path) else { panic!("{} was read", path.display()) };
        assert!(matches!(error, PhotoError::Decode { .. }), "{error}");
        assert!(error.to_string().contains(&path.display().to_string()));
    }
    assert!(matches!(Photo::open(&home.path().join("none.png")), Err(PhotoError::Open { .. })));
    Ok(())
}

#[test]
fn sixteen_bits_and_grey_are_read_like_eight() -> TestResult {
    let home = tempfile::tempdir()?;
    let (photo, truth) = drawn(0.4, &settings(40, 0.3, Style::Wax));
    let eight = DynamicImage::ImageRgb8(photo.to_rgb8());
    for (name, picture) in [
        ("sixteen.png", DynamicImage::ImageRgb16(eight.to_rgb16())),
        ("grey.tiff", DynamicImage::ImageLuma16(eight.to_luma16())),
        ("colour.webp", eight.clone()),
    ] {
        let path = home.path().join(name);
        picture.save(&path)?;
        let comb = comb::read(&Photo::open(&path)?, &Settings::default())?;
        let score = comb::score(&table(&comb)?, &truth);
        assert!(score.recall > 0.99 && score.sides_right > 0.985, "{name}: {score:?}");
    }
    Ok(())
}

/// The picture lies on its side in the file, and the file says so: cells are where a viewer shows them.
#[test]
fn a_photograph_is_turned_upright_as_its_exif_says() -> TestResult {
    let home = tempfile::tempdir()?;
    let (photo, truth) = drawn(0.4, &settings(40, 0.2, Style::Wax));
    let lying = image::imageops::rotate270(&photo.to_rgb8());
    let mut jpeg = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 92);
    // A TIFF header and one entry: orientation (0x0112), one short, 6: to be turned by 90 degrees clockwise.
    let orientation = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0".to_vec();
    image::ImageEncoder::set_exif_metadata(&mut encoder, orientation)?;
    encoder.encode_image(&lying)?;
    let path = home.path().join("lying.jpg");
    fs::write(&path, jpeg)?;
    let upright = Photo::open(&path)?;
    assert_eq!((upright.width(), upright.height()), (photo.width(), photo.height()));
    let score = comb::score(&table(&comb::read(&upright, &Settings::default())?)?, &truth);
    assert!(score.recall > 0.99 && score.sides_right > 0.985, "{score:?}");
    Ok(())
}

/// The header alone tells the size: nothing of that size is held in memory.
#[test]
fn what_is_too_large_is_refused_before_it_is_read() -> TestResult {
    let home = tempfile::tempdir()?;
    let path = home.path().join("huge.png");
    let mut bytes = Vec::new();
    image::DynamicImage::new_luma8(1, 1)
        .write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png)?;
    // Width and height of the header chunk, and its checksum for 20000 x 20000 grey pixels of 8 bits.
    let header =
        [&b"IHDR"[..], &20_000_u32.to_be_bytes(), &20_000_u32.to_be_bytes(), &bytes[24..29]].concat();
    bytes[12..29].copy_from_slice(&header);
    bytes[29..33].copy_from_slice(&checksum(&header).to_be_bytes());
    fs::write(&path, bytes)?;
    let refused = Photo::open(&path);
    assert!(matches!(refused, Err(PhotoError::TooLarge { width: 20_000, .. })), "{refused:?}");
    Ok(())
}

/// The cyclic redundancy check of PNG chunks.
fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |s, _| if s & 1 == 1 { 0xedb8_8320 ^ (s >> 1) } else { s >> 1 })
    })
}

/// True centres and sides of a photograph that was checked by eye: `NAME_sides.csv`.
fn checked_by_eye(folder: &Path, name: &str) -> Result<Truth, Box<dyn Error>> {
    let mut truth = Truth::default();
    for row in csv::Reader::from_path(folder.join(format!("{name}_sides.csv")))?.deserialize() {
        let row: HashMap<String, String> = row?;
        let number = |key: &str| row[key].trim().parse::<f64>();
        let count = |key: &str| row[key].trim().parse::<u32>().ok();
        truth.cells.push(comb::TruthCell {
            x_px: number("cx")?,
            y_px: number("cy")?,
            sides: count("sides"),
            other_sides: count("alt_sides"),
            complete: 1,
        });
    }
    Ok(truth)
}

#[test]
fn real_photographs_are_read_as_by_eye() -> TestResult {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/photos");
    if !folder.is_dir() {
        println!("skipped: ../shared/photos is not here");
        return Ok(());
    }
    let (mut defects, mut found, mut claims, mut right) = (0.0, 0.0, 0.0, 0.0);
    for (name, extension) in [
        ("peleg_1A_7-13", "png"),
        ("peleg_5C_7-13", "jpg"),
        ("peleg_R3_6-21", "jpg"),
        ("peleg_N2_6-21", "jpg"),
        ("biorobotics_20240613_cam-1", "png"),
    ] {
        let photo = Photo::open(&folder.join(format!("{name}.{extension}")))?;
        let comb = comb::read(&photo, &Settings::default())?;
        let score = comb::score(&table(&comb)?, &checked_by_eye(&folder, name)?);
        assert!(score.recall >= 0.995, "{name}: recall {}", score.recall);
        assert!(score.coverage >= 0.95, "{name}: coverage {}", score.coverage);
        assert!(score.sides_right >= 0.995, "{name}: {:?}", score.wrong);
        defects += score.defects as f64;
        found += score.defect_recall * score.defects as f64;
        claims += score.defect_claims as f64;
        right += score.defect_precision * score.defect_claims as f64;
    }
    assert!(found / defects >= 0.95, "{found} of {defects} defects");
    assert!(right / claims >= 0.95, "{right} of {claims} claims");
    Ok(())
}

fn combwright(arguments: &[&str]) -> Result<std::process::Output, std::io::Error> {
    std::process::Command::new(env!("CARGO_BIN_EXE_combwright")).args(arguments).output()
}

#[test]
fn one_bad_photograph_does_not_stop_the_others() -> TestResult {
    let home = tempfile::tempdir()?;
    let path = |name: &str| home.path().join(name).display().to_string();
    let drawn =
        combwright(&["comb", "render", "--cells", "150", "--difficulty", "0.2", "-o", &path("photos")])?;
    assert!(drawn.status.success(), "{}", String::from_utf8_lossy(&drawn.stderr));
    fs::write(home.path().join("photos/bad.jpg"), b"no picture")?;
    let read = combwright(&["comb", &path("photos"), "-o", &path("out"), "--scale", "5.3mm"])?;
    assert_eq!(read.status.code(), Some(1));
    let errors = String::from_utf8(read.stderr)?;
    assert!(errors.contains("bad.jpg") && errors.contains("1 of 2"), "{errors}");
    let batch = fs::read_to_string(home.path().join("out/photos.csv"))?;
    assert_eq!(batch.lines().count(), 3, "{batch}");
    assert!(!home.path().join("out/bad").exists());
    for file in ["cells.csv", "pattern.json", "cells.geojson", "overlay.png", "summary.json", "run.json"] {
        assert!(home.path().join("out/photo").join(file).is_file(), "{file} is missing");
    }
    let summary: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(path("out/photo/summary.json"))?)?;
    let width = summary["width_of_cells_mm"]["median"].as_f64();
    assert!(width.is_some_and(|w| (w - 5.3).abs() < 0.3), "{width:?}");
    let score =
        combwright(&["comb", "score", &path("out/photo/cells.csv"), &path("photos/truth.csv"), "--json"])?;
    let score: serde_json::Value = serde_json::from_slice(&score.stdout)?;
    assert!(score["recall"].as_f64().is_some_and(|r| r > 0.98), "{score}");
    let alone = combwright(&["comb", &path("photos/bad.jpg"), "-o", &path("out")])?;
    assert_eq!(alone.status.code(), Some(2));
    Ok(())
}
