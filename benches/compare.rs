//! How honest the comparison is: its level on true nulls, and its power against a difference of five points in the share of
//! hexagons.
//!
//! `cargo bench --bench compare -- FOLDER` prints both as tables and draws the power into FOLDER as `compare_power.svg`
//! and `.png`. It takes about a minute on two cores.

#![allow(clippy::print_stdout, missing_docs, reason = "a benchmark prints")]

use combwright::{
    compare::{LEVEL, Sample, Settings, compare},
    report::{compare_charts::power_chart, folder::OutputFolder},
    tessellation::{CellPattern, flipped_hexagons},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::error::Error;

/// Pairs of patterns for each level, whose standard error is then 0.7 points; half as many for each power.
const PAIRS: u64 = 1000;

/// How a pattern of about `cells` cells comes about; `share` is the share of hexagons.
type Maker = fn(cells: usize, share: f64, seed: u64) -> Result<CellPattern, Box<dyn Error + Send + Sync>>;

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let folder = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with('-'))
        .ok_or("name a folder for the figure")?;
    let makers: [(&str, Maker); 2] = [("independent cells", independent), ("5-7 pairs", flipped)];
    println!("share of {PAIRS} true nulls that are rejected at {LEVEL}, with 85 % hexagons");
    println!("{:<20} {:>6} {:>6} {:>12} {:>18}", "process", "comb", "foam", "this test", "cells shuffled");
    for (name, maker) in makers {
        for (comb, foam) in [(64, 64), (100, 100), (100, 256), (196, 196), (400, 196), (100, 900)] {
            let (ours, naive) = rejected(maker, [comb, foam], [0.85, 0.85], PAIRS)?;
            println!("{name:<20} {comb:>6} {foam:>6} {:>10.1} % {:>16.1} %", 100.0 * ours, 100.0 * naive);
        }
    }
    println!("\nshare of {} pairs with 85 % and 80 % hexagons that are found different", PAIRS / 2);
    println!("{:<20} {:>6} {:>12}", "process", "cells", "power");
    let mut curves = Vec::new();
    for (name, maker) in makers {
        let mut points = Vec::new();
        for cells in [64, 100, 196, 400, 784, 1600] {
            let (power, _) = rejected(maker, [cells, cells], [0.85, 0.80], PAIRS / 2)?;
            println!("{name:<20} {cells:>6} {:>10.1} %", 100.0 * power);
            points.push((cells as f64, power));
        }
        curves.push((name, points));
    }
    let mut folder = OutputFolder::begin(folder)?;
    power_chart(&curves)?.write(&mut folder, "compare_power", 1.5)?;
    folder.commit()?;
    Ok(())
}

/// The share of pairs found different by the comparison, and by a chi-square test that takes cells for independent.
fn rejected(
    maker: Maker,
    cells: [usize; 2],
    share: [f64; 2],
    pairs: u64,
) -> Result<(f64, f64), Box<dyn Error + Send + Sync>> {
    let pair = |run: u64| -> Result<[usize; 2], Box<dyn Error + Send + Sync>> {
        let sample = |at: usize| -> Result<Sample, Box<dyn Error + Send + Sync>> {
            let pattern = maker(cells[at], share[at], 2 * run + at as u64)?;
            Ok(Sample { name: at.to_string(), pattern })
        };
        let settings = Settings { permutations: 499, resamples: 99, seed: run, ..Settings::default() };
        let samples = [sample(0)?, sample(1)?];
        let found = compare(&samples[..1], &samples[1..], &settings)?;
        // Two degrees of freedom: fewer than six, six, more.
        let naive = (-0.5 * three_classes(&samples[0].pattern, &samples[1].pattern)).exp() <= LEVEL;
        Ok([usize::from(found.sides.p <= LEVEL), usize::from(naive)])
    };
    let found: Vec<[usize; 2]> = (0..pairs).into_par_iter().map(pair).collect::<Result<_, _>>()?;
    let share = |at: usize| found.iter().map(|f| f[at]).sum::<usize>() as f64 / pairs as f64;
    Ok((share(0), share(1)))
}

fn three_classes(one: &CellPattern, two: &CellPattern) -> f64 {
    let counts = [one, two].map(|pattern| {
        pattern.complete().filter_map(|(_, cell)| cell.sides).fold([0.0; 3], |mut counts, sides| {
            counts[match sides {
                0..=5 => 0,
                6 => 1,
                _ => 2,
            }] += 1.0;
            counts
        })
    });
    let totals = counts.map(|c| c.iter().sum::<f64>());
    let all = totals[0] + totals[1];
    let of_class = |class: usize| {
        let pooled = (counts[0][class] + counts[1][class]) / all;
        let of_group = |(count, total): (&[f64; 3], &f64)| {
            let expected = total * pooled;
            if expected > 0.0 { (count[class] - expected).powi(2) / expected } else { 0.0 }
        };
        counts.iter().zip(&totals).map(of_group).sum::<f64>()
    };
    (0..3).map(of_class).sum()
}

/// Every cell has its sides for itself.
fn independent(cells: usize, share: f64, seed: u64) -> Result<CellPattern, Box<dyn Error + Send + Sync>> {
    let mut pattern = torus(cells, 0, seed)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for cell in pattern.cells.iter_mut() {
        let draw: f64 = random.random();
        let odd = 0.5 * (1.0 - share);
        cell.sides = Some(if draw < odd {
            5
        } else if draw < 2.0 * odd {
            7
        } else {
            6
        });
    }
    Ok(pattern)
}

/// Hexagons of which T1s, at random walls and in random number, have made pairs of fives and sevens.
fn flipped(cells: usize, share: f64, seed: u64) -> Result<CellPattern, Box<dyn Error + Send + Sync>> {
    // A flip changes four cells; of those changed twice some are hexagons again. The rates were found by counting.
    let per_cell = -0.275 * (share.ln());
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let flips = (0..3 * cells).filter(|_| random.random::<f64>() < per_cell / 3.0).count();
    torus(cells, flips, seed)
}

fn torus(cells: usize, flips: usize, seed: u64) -> Result<CellPattern, Box<dyn Error + Send + Sync>> {
    let side = (4..).find(|side| (side + 1) * (side + 1) > cells).unwrap_or(8);
    let rows = side - side % 2;
    flipped_hexagons(side, rows, flips, seed).map_err(|defects| format!("{defects:?}").into())
}
