//! The foam's figures: flat foams beside Surface Evolver in the same run, and how the work grows with the number of cells.
//!
//! `cargo bench --bench foam` prints CPU seconds of one thread. The flat foams come from `../shared/fe/foams`; the part is
//! skipped where that folder is not there, and Surface Evolver's column where `evolver` is not installed.

#![allow(clippy::print_stdout, missing_docs, reason = "a benchmark prints")]

use combwright::{
    foam::{
        complex::Strips,
        energy::energy,
        network::{CellId, CellRing, Network, RingCorner, VertexId},
        relax::{RelaxSettings, Relaxed, relax},
        seeds::SeedSettings,
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
        start::start,
    },
    index::{Id, IndexVec},
    surface::{Gap, Period, Plane},
};
use glam::{DVec3, IVec3};
use std::{
    collections::BTreeMap, error::Error, fs, ops::ControlFlow, path::Path, process::Command, sync::Arc,
};

include!("../tests/support/flat_foam.rs");

const FOAMS: &str = "../shared/fe/foams";

/// Flat foams: cells, period, and the energy with circular arcs for films times the height, from
/// `analysis/flat_foam_exact.py`.
const FLAT: [(u32, f64, f64); 2] = [(64, 8.0, 61.529_010_049_4), (256, 16.0, 245.926_949_182_2)];

/// User CPU seconds of this process so far, in ticks of a hundredth.
fn cpu_seconds() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    after_name
        .split_whitespace()
        .nth(11)
        .and_then(|ticks| ticks.parse::<f64>().ok())
        .map_or(f64::NAN, |t| t / 100.0)
}

fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let before = cpu_seconds();
    let result = work();
    (cpu_seconds() - before, result)
}

fn energy_of(relaxed: &Relaxed, gap: &Gap) -> f64 {
    let state = &relaxed.state;
    energy(&state.strips.complex(&state.network, gap), &state.places)
}

fn flat_foam(cells: u32, period: f64, exact: f64) -> Result<(), Box<dyn Error>> {
    let text = fs::read_to_string(format!("{FOAMS}/flat2d_{cells}.fe"))?;
    let network = flat_network(&text, [period; 2]).ok_or("the dump holds no foam")?;
    let gap = Gap::between(Arc::new(Plane { periods: [period; 2] }), [-0.25, 0.25])?;
    let mut ours = f64::NAN;
    for along in [2, 4] {
        let settings = RelaxSettings { strips: Strips { along, through: 1 }, ..RelaxSettings::default() };
        let (seconds, relaxed) =
            timed(|| relax(network.clone(), &gap, &settings, &mut |_| ControlFlow::Continue(())));
        let relaxed = relaxed?;
        let error = energy_of(&relaxed, &gap) / exact - 1.0;
        ours = seconds;
        println!(
            "flat {cells}: {along} elements along: {seconds:.2} CPU s, error {error:+.1e}, {:?}",
            relaxed.stop
        );
    }
    match evolver(cells, exact) {
        Some((seconds, error)) => println!(
            "flat {cells}: Surface Evolver's script: {seconds:.2} CPU s to its error {error:+.1e}: {:.1} times ours",
            seconds / ours
        ),
        None => println!("flat {cells}: Surface Evolver did not run here"),
    }
    Ok(())
}

/// CPU seconds of Surface Evolver's best script until its energy is within 1.2e-4 of the exact one, or as near as it comes;
/// the script prints its clock and its energy.
fn evolver(cells: u32, exact: f64) -> Option<(f64, f64)> {
    let folder = Path::new(FOAMS).canonicalize().ok()?;
    let output = Command::new("sh")
        .arg("-c")
        .arg(format!("evolver-nox-d {0}/plates_{cells}.fe < {0}/relax.cmd || evolver {0}/plates_{cells}.fe < {0}/relax.cmd", folder.display()))
        .current_dir(std::env::temp_dir())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let figure = |line: &str, name: &str| -> Option<f64> {
        let mut words = line.split_whitespace();
        words.find(|&word| word == name)?;
        words.next()?.parse().ok()
    };
    let reports: Vec<(f64, f64)> = text
        .lines()
        .filter(|line| line.contains("REP"))
        .filter_map(|line| Some((figure(line, "clk")?, figure(line, "en")? / exact - 1.0)))
        .collect();
    let near = reports.iter().find(|(_, error)| error.abs() < 1.2e-4).or(reports.last())?;
    Some(*near)
}

/// Relaxed foams on the P-surface: CPU seconds of each part, and the power of N by least squares.
fn growth() -> Result<(), Box<dyn Error>> {
    let walls = PeriodicWalls::LevelSet { delta: 0.2 };
    let space = FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 1.0, walls };
    let (gap, domain) = (space.gap()?, space.domain()?);
    let mut points = Vec::new();
    for cells in [64, 128, 256, 512, 1000, 2000] {
        let seeds = SeedSettings::new(cells, 1);
        let (until, started) = timed(|| start(&gap, &domain, &seeds, &mut |_| ControlFlow::Continue(())));
        let network = started?.network;
        let settings = RelaxSettings::default();
        let (seconds, relaxed) =
            timed(|| relax(network, &gap, &settings, &mut |_| ControlFlow::Continue(())));
        let relaxed = relaxed?;
        println!(
            "P {cells}: seeds and partition {until:.2} CPU s, relaxation {seconds:.2} CPU s, {:?}, energy {:.10}",
            relaxed.stop,
            energy_of(&relaxed, &gap)
        );
        points.push((f64::from(u32::try_from(cells)?).ln(), seconds.ln()));
    }
    let count = f64::from(u32::try_from(points.len())?);
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let power = mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2));
    println!("the relaxation's CPU time grows as N^{power:.2}");
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    threads.install(|| {
        if Path::new(FOAMS).is_dir() {
            for (cells, period, exact) in FLAT {
                flat_foam(cells, period, exact).map_err(|error| error.to_string())?;
            }
        } else {
            println!("flat foams skipped: {FOAMS} is not here");
        }
        growth().map_err(|error| error.to_string())
    })?;
    Ok(())
}
