//! The enclosure's figures: time, memory, accuracy and its order, of the reference solid.
//!
//! `cargo bench --bench enclosure` prints ours. With `PEERS_PYTHON=/path/to/python` (numpy, vtk, scikit-image) the same
//! solid is meshed by VTK and scikit-image in the same run, each in a process of its own, and ratios are printed.

#![allow(clippy::print_stdout, missing_docs, reason = "a benchmark prints")]

use combwright::{
    enclosure::{BuildError, Move, shell_from_level},
    mesh::{ClosedMesh, Grid, measure, self_intersections, write_stl},
    surface::{SchwarzP, WallSide},
};
use glam::DVec3;
use std::{
    env, fs,
    io::{BufWriter, Write},
    process::{Command, Stdio},
    time::Instant,
};

type AnyError = Box<dyn std::error::Error>;

/// The reference solid: 0.2 ≤ |Φ| ≤ 0.365, L = 100 mm, the half cell.
const LEVELS: [f64; 2] = [0.2, 0.365];
const PERIOD_MM: f64 = 100.0;

/// Values of a far finer mesh by Richardson extrapolation of this program's own, which agree with clipped VTK to its digits:
/// volume 47,135 mm³, area 49,327 mm², cap at z = 0 735.70 mm².
const PUBLISHED: [f64; 3] = [47_135.0, 49_327.0, 735.70];

fn grid(samples: usize) -> Grid {
    Grid { low: DVec3::ZERO, high: DVec3::new(1.0, 1.0, 0.5), cells: [samples, samples, samples / 2] }
}

fn solid(samples: usize, side: WallSide, sign: f64) -> Result<ClosedMesh, BuildError> {
    let surface = SchwarzP { period: 1.0 };
    let [front, back] = LEVELS.map(|level| sign * level);
    let shell = shell_from_level(&surface, front, Move::ToLevel(back), &grid(samples), side)?;
    Ok(shell.solid(None)?.scaled_and_moved(PERIOD_MM, DVec3::ZERO))
}

fn solids(samples: usize) -> Result<[ClosedMesh; 2], AnyError> {
    let (inner, outer) =
        rayon::join(|| solid(samples, WallSide::Lower, -1.0), || solid(samples, WallSide::Upper, 1.0));
    Ok([inner?, outer?])
}

/// The most memory that this process has held, in MB.
fn peak_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<f64>().ok()).map_or(f64::NAN, |kb| kb / 1024.0)
}

fn seconds<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let started = Instant::now();
    let result = work();
    (started.elapsed().as_secs_f64(), result)
}

/// Meshes in this process and prints one line: seconds, peak MB, triangles.
fn mesh_once(samples: usize) -> Result<(), AnyError> {
    let (time, meshes) = seconds(|| solids(samples));
    let triangles: usize = meshes?.iter().map(|m| m.mesh().triangles.len()).sum();
    println!("{time} {} {triangles}", peak_mb());
    Ok(())
}

/// Meshes and writes both shells as STL into the temporary folder; prints seconds of both, of writing alone, and of writing
/// as many bytes that are there already. Files count when they are on the disk, not when the system has taken them.
fn write_once(samples: usize) -> Result<(), AnyError> {
    let folder = tempfile::tempdir()?;
    let (meshing, meshes) = seconds(|| solids(samples));
    let meshes = meshes?;
    let (writing, bytes) = seconds(|| -> Result<u64, AnyError> {
        let mut bytes = 0;
        for (index, mesh) in meshes.iter().enumerate() {
            let path = folder.path().join(format!("{index}.stl"));
            let mut writer = BufWriter::with_capacity(1 << 20, fs::File::create(&path)?);
            write_stl(mesh, &mut writer)?;
            writer.into_inner()?.sync_all()?;
            bytes += fs::metadata(path)?.len();
        }
        Ok(bytes)
    });
    let content = vec![0x5a_u8; usize::try_from(bytes?)?];
    let (raw, written) = seconds(|| -> Result<(), AnyError> {
        let mut file = fs::File::create(folder.path().join("raw"))?;
        file.write_all(&content)?;
        Ok(file.sync_all()?)
    });
    written?;
    println!("{} {writing} {raw}", meshing + writing);
    Ok(())
}

/// Runs this program again with `arguments` and reads the numbers that it prints; the best of `runs` by the first.
fn numbers(arguments: &[&str], runs: usize) -> Result<Vec<f64>, AnyError> {
    let mut best: Option<Vec<f64>> = None;
    for _ in 0..runs {
        let output = Command::new(env::current_exe()?).args(arguments).stderr(Stdio::inherit()).output()?;
        let row: Vec<f64> =
            String::from_utf8(output.stdout)?.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        if best.as_ref().is_none_or(|b| row[0] < b[0]) {
            best = Some(row);
        }
    }
    best.ok_or_else(|| "no run".into())
}

/// Volume, area and area of the cap at z = 0 of both shells, in mm.
fn measures(samples: usize) -> Result<[f64; 3], AnyError> {
    let mut sum = [0.0; 3];
    for solid in solids(samples)? {
        let mesh = solid.mesh();
        let parts = [measure::volume(mesh), measure::area(mesh), measure::area_on_plane(mesh, 2, 0.0)];
        sum.iter_mut().zip(parts).for_each(|(total, part)| *total += part);
    }
    Ok(sum)
}

fn accuracy() -> Result<(), AnyError> {
    println!("\naccuracy: 0.2 <= |phi| <= 0.365, L = 100 mm, half cell");
    println!("{:>8} {:>14} {:>14} {:>14} {:>10}", "samples", "volume mm3", "area mm2", "cap mm2", "crossing");
    let mut rows = Vec::new();
    for samples in [32, 64, 128, 256, 512] {
        let row = measures(samples)?;
        let crossing: usize =
            solids(samples)?.iter().map(|solid| self_intersections(solid.mesh()).len()).sum();
        println!("{samples:>8} {:>14.4} {:>14.4} {:>14.5} {crossing:>10}", row[0], row[1], row[2]);
        rows.push(row);
    }
    // With an error of h² the limit is the last value plus a third of the last change.
    let (last, before) = (rows[rows.len() - 1], rows[rows.len() - 2]);
    let limit: [f64; 3] = std::array::from_fn(|i| last[i] + (last[i] - before[i]) / 3.0);
    println!("{:>8} {:>14.4} {:>14.4} {:>14.5}", "limit", limit[0], limit[1], limit[2]);
    println!("{:>8} {:>14} {:>14} {:>14}", "known", PUBLISHED[0], PUBLISHED[1], PUBLISHED[2]);
    for window in rows.windows(3).take(3) {
        let order = |i: usize| ((window[1][i] - window[0][i]) / (window[2][i] - window[1][i])).log2();
        println!("{:>8} {:>14.3} {:>14.3} {:>14.3}", "order", order(0), order(1), order(2));
    }
    Ok(())
}

fn main() -> Result<(), AnyError> {
    let arguments: Vec<String> = env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [what, samples] = arguments.as_slice() {
        return match what.as_str() {
            "mesh" => mesh_once(samples.parse()?),
            _ => write_once(samples.parse()?),
        };
    }
    println!("mesh in memory, both shells (best of 5 processes)");
    println!("{:>8} {:>10} {:>10} {:>12}", "samples", "seconds", "peak MB", "triangles");
    for samples in ["128", "256", "512"] {
        let row = numbers(&["mesh", samples], 5)?;
        println!("{samples:>8} {:>10.3} {:>10.0} {:>12}", row[0], row[1], row[2]);
        if let Ok(python) = env::var("PEERS_PYTHON") {
            peers(&python, samples, row[0], row[1])?;
        }
    }
    println!("\nSTL on disk, against writing as many bytes");
    for samples in ["256", "512"] {
        let row = numbers(&["write", samples], 5)?;
        let [both, writing, raw] = row[..] else { return Err("not three figures".into()) };
        println!(
            "{samples:>8} {both:>10.3} s with meshing ({:.2} of raw), {writing:.3} s from the mesh ({:.2}), {raw:.3} s raw",
            both / raw,
            writing / raw
        );
    }
    accuracy()
}

/// The same solid by other programs, in the same run.
fn peers(python: &str, samples: &str, ours: f64, our_peak: f64) -> Result<(), AnyError> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers.py");
    for peer in ["vtk", "vtk-clipped", "skimage"] {
        let mut best = f64::INFINITY;
        let mut peak = f64::NAN;
        for _ in 0..3 {
            let output = Command::new(python).args([script, peer, samples]).output()?;
            let text = String::from_utf8(output.stdout)?;
            let row: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            if let [time, megabytes] = row[..]
                && time < best
            {
                (best, peak) = (time, megabytes);
            }
        }
        println!(
            "         {best:>10.3} {peak:>10.0}  {peer}: {:.1} times our time, {:.1} times our memory",
            best / ours,
            peak / our_peak
        );
    }
    Ok(())
}
