//! A comparison's table, CSV files, figures and the list of what is there.

use super::{
    compare_charts::{self, ChartError},
    compare_map,
    figure::{Figure, FigureError},
    folder::{OutputError, OutputFolder},
};
use crate::{
    compare::{Comparison, Estimate, Group, PatternFigures, Sample},
    tessellation::hexatic,
};
use std::{fmt::Write as _, io};

/// The JSON schema of `comparison.json`.
pub const SCHEMA: &str = include_str!("comparison.schema.json");

/// What `README.txt` says.
const README: &str = include_str!("compare_readme.txt");

/// Pixels to a unit of a chart in its PNG: 1440 pixels, 122 mm at 300 dpi.
const FINENESS: f32 = 2.0;

/// Why a comparison's files cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum CompareOutputError {
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A chart cannot be drawn.
    #[error(transparent)]
    Chart(#[from] ChartError),
    /// A figure cannot be rasterised.
    #[error(transparent)]
    Figure(#[from] FigureError),
}

/// Every chart of a comparison with the name of its files.
///
/// # Errors
/// [`ChartError`] if one cannot be drawn.
pub fn charts(comparison: &Comparison) -> Result<Vec<(&'static str, Figure)>, ChartError> {
    let mut charts = vec![
        ("sides", compare_charts::sides(comparison)?),
        ("aboav_weaire", compare_charts::aboav_weaire(comparison)?),
        ("lewis", compare_charts::lewis(comparison)?),
        ("correlations", compare_charts::correlations(comparison)?),
        ("chains", compare_charts::chains(comparison)?),
    ];
    if let Some(figure) = compare_charts::curvature(comparison)? {
        charts.push(("curvature", figure));
    }
    Ok(charts)
}

/// Writes everything of a comparison: JSON with its schema, tables, figures, `README.txt`.
///
/// # Errors
/// [`CompareOutputError`] if a file cannot be written or drawn.
pub fn write(
    folder: &mut OutputFolder,
    comparison: &Comparison,
    samples: [&[Sample]; 2],
) -> Result<(), CompareOutputError> {
    folder.write_json("comparison.json", comparison)?;
    folder.write_bytes("comparison.schema.json", SCHEMA.as_bytes())?;
    folder.write_bytes("verdict.txt", format!("{}\n", comparison.verdict.sentence).as_bytes())?;
    for (name, rows) in tables(comparison) {
        write_table(folder, name, &rows)?;
    }
    write_table(folder, "hexatic.csv", &hexatic_rows(samples))?;
    for (name, figure) in charts(comparison)? {
        figure.write(folder, name, FINENESS)?;
    }
    for (kind, group) in ["comb", "foam"].into_iter().zip(samples) {
        for sample in group {
            if let Some(map) = compare_map::hexatic_map(sample) {
                map.write(folder, &format!("psi6-{kind}-{}", file_name(&sample.name)), 1.0)?;
            }
        }
    }
    folder.write_bytes("README.txt", README.as_bytes())?;
    Ok(())
}

/// A name without what file systems dislike.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || c == '-' || c == '.' { c } else { '_' }).collect()
}

/// A table: its header, then its rows.
pub type Rows = Vec<Vec<String>>;

/// Every table of a comparison with the name of its file.
#[must_use]
pub fn tables(comparison: &Comparison) -> Vec<(&'static str, Rows)> {
    vec![
        ("sides.csv", side_rows(comparison)),
        ("figures.csv", figure_rows(comparison)),
        ("patterns.csv", pattern_rows(comparison)),
        (
            "aboav_weaire.csv",
            per_pattern(comparison, &["sides", "walls", "mean_sides_of_neighbours"], |pattern| {
                let points = &pattern.statistics.aboav_weaire.points;
                let row = |p: &crate::tessellation::NeighbourMean| {
                    vec![p.sides.to_string(), p.walls.to_string(), number(p.mean_sides_of_neighbours)]
                };
                points.iter().map(row).collect()
            }),
        ),
        (
            "lewis.csv",
            per_pattern(comparison, &["sides", "cells", "relative_area", "deviation"], |pattern| {
                let row = |p: &crate::tessellation::AreaMean| {
                    vec![
                        p.sides.to_string(),
                        p.cells.to_string(),
                        number(p.relative_area),
                        number(p.deviation),
                    ]
                };
                pattern.statistics.lewis.points.iter().map(row).collect()
            }),
        ),
        (
            "correlations.csv",
            per_pattern(comparison, &["distance_walls", "pairs", "correlation"], |pattern| {
                let row = |p: &crate::tessellation::DistanceCorrelation| {
                    vec![p.distance.to_string(), p.pairs.to_string(), number(p.correlation)]
                };
                pattern.statistics.correlations.iter().map(row).collect()
            }),
        ),
        (
            "chains.csv",
            per_pattern(comparison, &["cells", "charge"], |pattern| {
                let row = |(cells, charge): &(usize, i64)| vec![cells.to_string(), charge.to_string()];
                pattern.statistics.chains.iter().map(row).collect()
            }),
        ),
        (
            "curvature.csv",
            per_pattern(comparison, &["radius_walls", "curvature_integral", "charge_pi_over_3"], |pattern| {
                let regions = pattern.statistics.curvature.iter().flatten();
                let rows = regions.flat_map(|region| {
                    let row = |[k, q]: &[f64; 2]| vec![region.radius.to_string(), number(*k), number(*q)];
                    region.regions.iter().map(row)
                });
                rows.collect()
            }),
        ),
    ]
}

fn number(value: f64) -> String {
    if value.is_finite() { format!("{value:.6}") } else { String::new() }
}

fn estimate(estimate: &Estimate) -> [String; 3] {
    let [low, high] = estimate.interval.map_or([String::new(), String::new()], |ends| ends.map(number));
    [number(estimate.value), low, high]
}

fn header(columns: &[&str]) -> Vec<String> {
    columns.iter().map(ToString::to_string).collect()
}

fn side_rows(comparison: &Comparison) -> Rows {
    let mut rows = vec![header(&[
        "sides",
        "comb_cells",
        "foam_cells",
        "comb_share",
        "comb_low",
        "comb_high",
        "foam_share",
        "foam_low",
        "foam_high",
        "difference",
        "difference_low",
        "difference_high",
    ])];
    for class in &comparison.sides.classes {
        let mut row = vec![class.sides.to_string(), class.cells[0].to_string(), class.cells[1].to_string()];
        for figure in [&class.share[0], &class.share[1], &class.difference] {
            row.extend(estimate(figure));
        }
        rows.push(row);
    }
    rows
}

fn figure_rows(comparison: &Comparison) -> Rows {
    let mut rows = vec![header(&[
        "figure",
        "comb",
        "comb_low",
        "comb_high",
        "foam",
        "foam_low",
        "foam_high",
        "difference",
        "difference_low",
        "difference_high",
        "p",
        "p_holm",
    ])];
    for test in &comparison.figures {
        let mut row = vec![test.figure.label().to_owned()];
        for figure in [&test.value[0], &test.value[1], &test.difference] {
            row.extend(estimate(figure));
        }
        row.extend([number(test.p), number(test.p_holm)]);
        rows.push(row);
    }
    rows
}

fn pattern_rows(comparison: &Comparison) -> Rows {
    let mut rows = vec![header(&[
        "group",
        "pattern",
        "length_unit",
        "complete",
        "cut",
        "uncertain",
        "mean_sides",
        "second_moment",
        "charge",
        "charge_expected",
        "euler_characteristic",
        "pairs",
        "isolated_disclinations",
        "isolated_dislocations",
        "neutral_chains",
        "charged_chains",
        "aboav_weaire_a",
        "lewis_slope",
        "hexatic_order",
    ])];
    for (kind, pattern) in patterns(comparison) {
        let s = &pattern.statistics;
        let optional = |value: Option<f64>| value.map_or_else(String::new, number);
        rows.push(vec![
            kind.to_owned(),
            pattern.name.clone(),
            pattern.unit.clone(),
            s.sides.complete.to_string(),
            s.sides.cut.to_string(),
            s.sides.uncertain.to_string(),
            optional(s.sides.mean_sides),
            optional(s.sides.second_moment),
            s.charge.charge.to_string(),
            s.charge.expected.to_string(),
            s.charge.euler_characteristic.to_string(),
            s.pairs.to_string(),
            s.census.isolated_disclinations.to_string(),
            s.census.isolated_dislocations.to_string(),
            s.census.neutral_chains.to_string(),
            s.census.charged_chains.to_string(),
            optional(s.aboav_weaire.a),
            optional(s.lewis.slope),
            optional(s.sides.hexatic_order),
        ]);
    }
    rows
}

/// All patterns, comb first.
fn patterns(comparison: &Comparison) -> impl Iterator<Item = (&'static str, &PatternFigures)> {
    let of = |group: &'_ Group| group.kind;
    [&comparison.comb, &comparison.foam]
        .into_iter()
        .flat_map(move |group| group.patterns.iter().map(move |pattern| (of(group), pattern)))
}

fn per_pattern(comparison: &Comparison, columns: &[&str], rows_of: impl Fn(&PatternFigures) -> Rows) -> Rows {
    let mut rows = vec![header(&["group", "pattern"])];
    rows[0].extend(header(columns));
    for (kind, pattern) in patterns(comparison) {
        for row in rows_of(pattern) {
            rows.push([vec![kind.to_owned(), pattern.name.clone()], row].concat());
        }
    }
    rows
}

/// ψ6 of every complete cell.
fn hexatic_rows(samples: [&[Sample]; 2]) -> Rows {
    let mut rows =
        vec![header(&["group", "pattern", "cell", "x", "y", "z", "psi6_modulus", "direction_deg"])];
    for (kind, group) in ["comb", "foam"].into_iter().zip(samples) {
        for sample in group {
            for (id, cell) in sample.pattern.complete() {
                let Some(psi) = hexatic(&sample.pattern, id) else { continue };
                let mut row = vec![
                    kind.to_owned(),
                    sample.name.clone(),
                    crate::tessellation::CellPattern::number(id).to_string(),
                ];
                row.extend(cell.position.to_array().map(number));
                row.extend([
                    number(psi.length()),
                    number(psi.to_angle().to_degrees().rem_euclid(360.0) / 6.0),
                ]);
                rows.push(row);
            }
        }
    }
    rows
}

/// A table as CSV text.
///
/// # Errors
/// What the writer says.
pub fn csv_text(rows: &Rows) -> io::Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(row)?;
    }
    let bytes = writer.into_inner().map_err(|error| io::Error::other(error.to_string()))?;
    String::from_utf8(bytes).map_err(io::Error::other)
}

fn write_table(folder: &mut OutputFolder, name: &str, rows: &Rows) -> Result<(), OutputError> {
    folder.write(name, |writer| io::Write::write_all(writer, csv_text(rows)?.as_bytes()))
}

/// The table that a run prints.
#[must_use]
pub fn table(comparison: &Comparison) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(text, "{:<20} {:>24} {:>24} {:>25}", "", "comb", "foam", "difference");
    let cells = |group: &Group| format!("{} in {} units", group.cells, group.units);
    let _ = writeln!(
        text,
        "{:<20} {:>24} {:>24}",
        "complete cells",
        cells(&comparison.comb),
        cells(&comparison.foam)
    );
    for class in &comparison.sides.classes {
        let percent = |e: &Estimate| shown(e, 100.0, 1);
        let _ = writeln!(
            text,
            "{:<20} {:>24} {:>24} {:>25}",
            format!("{} sides, %", class.sides),
            percent(&class.share[0]),
            percent(&class.share[1]),
            percent(&class.difference)
        );
    }
    let _ = writeln!(text, "{:<20} {:>24} {:>24} {:>25} {:>8}", "", "", "", "", "p (Holm)");
    for test in &comparison.figures {
        let _ = writeln!(
            text,
            "{:<20} {:>24} {:>24} {:>25} {:>8.4}",
            test.figure.label(),
            shown(&test.value[0], 1.0, 3),
            shown(&test.value[1], 1.0, 3),
            shown(&test.difference, 1.0, 3),
            test.p_holm
        );
    }
    let sides = &comparison.sides;
    let _ = writeln!(
        text,
        "\nall sides: p = {:.4}, total variation {:.3} ({:.3} by chance), Cohen's w {:.3}",
        sides.p, sides.total_variation, sides.total_variation_by_chance, sides.cohens_w
    );
    for left in &comparison.left_out {
        let _ = writeln!(text, "left out: {}: {}", left.what, left.why);
    }
    for note in &comparison.notes {
        let _ = writeln!(text, "note: {note}");
    }
    let _ = writeln!(text, "\n{}", comparison.verdict.sentence);
    text
}

/// A figure with its interval.
fn shown(estimate: &Estimate, scale: f64, digits: usize) -> String {
    let value = estimate.value * scale;
    match estimate.interval {
        Some([low, high]) => {
            format!("{value:.digits$} [{:.digits$}, {:.digits$}]", low * scale, high * scale)
        }
        None => format!("{value:.digits$}"),
    }
}
