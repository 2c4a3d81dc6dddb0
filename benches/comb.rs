//! The comb's figures: time of reading a synthetic photograph of 12 million pixels, at several sizes of cells.
//!
//! `cargo bench --bench comb` prints ours. With `PEERS_PYTHON=/path/to/python` (the packages of analysis/requirements.txt)
//! OpenCV reads the same photographs in the same run by analysis/opencv_check.py, and the ratio of times is printed.

#![allow(clippy::print_stdout, missing_docs, reason = "a benchmark prints")]

use combwright::comb::{
    self, Photo, Settings,
    synthetic::{Arrangement, Difficulty, RenderSettings, Style, render},
};
use std::{env, error::Error, fs, path::Path, process::Command, time::Instant};

/// A photograph of 12 million pixels.
const SIZE: [u32; 2] = [4000, 3000];

fn main() -> Result<(), Box<dyn Error>> {
    let home = tempfile::tempdir()?;
    println!("pixels per cell   cells   read, s   OpenCV, s   ratio");
    for pitch in [120.0, 60.0, 30.0] {
        let path = home.path().join("photo.png");
        draw(pitch, &path)?;
        let start = Instant::now();
        let read = comb::read(&Photo::open(&path)?, &Settings::default())?;
        let ours = start.elapsed().as_secs_f64();
        let peer = opencv_seconds(&path, home.path())?;
        let ratio = peer.map_or_else(String::new, |p| format!("{:.1}", p / ours));
        let peer = peer.map_or_else(String::new, |p| format!("{p:.2}"));
        println!("{pitch:15.0}   {:5}   {ours:7.2}   {peer:>9}   {ratio:>5}", read.pattern.cells.len());
    }
    Ok(())
}

fn draw(pitch: f64, path: &Path) -> Result<(), Box<dyn Error>> {
    let [width, height] = SIZE;
    let settings = RenderSettings {
        width,
        height,
        pitch,
        style: Style::Wax,
        difficulty: Difficulty::dial(0.3),
        torn_edge: false,
        seed: 1,
    };
    let arrangement = Arrangement::random(f64::from(width) / pitch, f64::from(height) / pitch, 0.2, 1);
    Ok(render(&arrangement, &settings).0.save(path)?)
}

/// Seconds that OpenCV takes for its reading, without the start of Python; `None` if it is not asked for.
fn opencv_seconds(photo: &Path, home: &Path) -> Result<Option<f64>, Box<dyn Error>> {
    let Ok(python) = env::var("PEERS_PYTHON") else { return Ok(None) };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("analysis/opencv_check.py");
    let output = home.join("opencv");
    let done = Command::new(python).arg(script).arg(photo).arg("-o").arg(&output).output()?;
    if !done.status.success() {
        return Err(String::from_utf8_lossy(&done.stderr).into_owned().into());
    }
    let report: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(output.join("agreement.json"))?)?;
    Ok(report["seconds"].as_f64())
}
