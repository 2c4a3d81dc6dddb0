//! What is written for a photograph of comb, and for a folder of them.

use super::{
    comb_overlay,
    figure::FigureError,
    folder::{OutputError, OutputFolder},
};
use crate::{
    comb::{CellDetail, Comb, Photo, Polarity, TableError, write_cells},
    index::Id,
    tessellation::{Cell, CellId, CellStatus, Defects, SideStatistics, defects, side_statistics},
    units::Mm,
};
use rayon::prelude::*;
use serde::Serialize;
use std::io::{self, Write};

/// The name of the table of cells.
pub const CELLS: &str = "cells.csv";

/// The name and version of the form of `summary.json`.
pub const COMB_SUMMARY_SCHEMA: &str = "combwright.comb-summary/1";

/// The figures of one photograph.
#[derive(Clone, Debug, Serialize)]
pub struct CombSummary {
    /// Form and version.
    pub schema: &'static str,
    /// The photograph's name.
    pub photo: String,
    /// Its width in pixels.
    pub width_px: usize,
    /// Its height in pixels.
    pub height_px: usize,
    /// Pixels of `overlay.png` per pixel of the photograph.
    pub overlay_scale: f64,
    /// Median distance of neighbouring cells in pixels.
    pub pitch_px: f64,
    /// Millimetres per pixel, if a scale is known.
    pub mm_per_px: Option<f64>,
    /// `dark` or `bright` cells.
    pub cells_are: &'static str,
    /// Hidden cells, inferred from their neighbours (they are among the uncertain ones).
    pub hidden: usize,
    /// Sides, order and charge of the complete cells.
    pub sides: SideStatistics,
    /// Cells of fewer and of more than six sides that touch, as pairs.
    pub pairs: usize,
    /// Groups of touching defects, by the number of cells and the charge.
    pub chains: Vec<ChainSummary>,
    /// Width of the complete cells (that of a regular hexagon of the same area, from wall to wall) in pixels.
    pub width_of_cells_px: Option<Distribution>,
    /// The same in millimetres.
    pub width_of_cells_mm: Option<Distribution>,
}

/// One group of touching defects.
#[derive(Clone, Debug, Serialize)]
pub struct ChainSummary {
    /// Its cells.
    pub cells: usize,
    /// The sum of 6 − n.
    pub charge: i64,
}

/// A distribution in brief.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Distribution {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// A tenth is smaller.
    pub lower_tenth: f64,
    /// Half are smaller.
    pub median: f64,
    /// A tenth is larger.
    pub upper_tenth: f64,
}

/// How the scale of a photograph is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// The median pitch of the cells is this long.
    Pitch(Mm),
    /// A pixel is this long.
    Pixel(Mm),
}

impl Scale {
    /// Millimetres per pixel in a photograph of the given pitch.
    #[must_use]
    pub fn mm_per_px(self, pitch_px: f64) -> f64 {
        match self {
            Self::Pitch(Mm(length)) => length / pitch_px,
            Self::Pixel(Mm(length)) => length,
        }
    }
}

/// Gathers the figures of a photograph.
#[must_use]
pub fn summary(name: &str, comb: &Comb, scale: Option<Scale>) -> CombSummary {
    let Defects { pairs, chains } = defects(&comb.pattern);
    let mm_per_px = scale.map(|s| s.mm_per_px(comb.pitch));
    let width = |area: f64| (area / 0.75_f64.sqrt()).sqrt();
    let widths: Vec<f64> = comb.pattern.complete().map(|(_, c)| width(c.area)).filter(|w| *w > 0.0).collect();
    CombSummary {
        schema: COMB_SUMMARY_SCHEMA,
        photo: name.to_owned(),
        width_px: comb.width,
        height_px: comb.height,
        overlay_scale: comb_overlay::scale(comb),
        pitch_px: comb.pitch,
        mm_per_px,
        cells_are: if comb.polarity == Polarity::DarkCells { "dark" } else { "bright" },
        hidden: comb.details.iter().filter(|d| !d.seen).count(),
        sides: side_statistics(&comb.pattern),
        pairs: pairs.len(),
        chains: chains.iter().map(|c| ChainSummary { cells: c.cells.len(), charge: c.charge }).collect(),
        width_of_cells_px: distribution(&widths, 1.0),
        width_of_cells_mm: mm_per_px.and_then(|unit| distribution(&widths, unit)),
    }
}

fn distribution(values: &[f64], unit: f64) -> Option<Distribution> {
    let mut sorted: Vec<f64> = values.iter().map(|v| v * unit).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |tenths: usize| sorted.get(sorted.len() * tenths / 10).copied();
    let count = sorted.len() as f64;
    let mean = sorted.iter().sum::<f64>() / count;
    let variance = sorted.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
    Some(Distribution {
        mean,
        deviation: variance.sqrt(),
        lower_tenth: at(1)?,
        median: at(5)?,
        upper_tenth: at(9)?,
    })
}

/// Why a photograph's files cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum CombOutputError {
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The overlay cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The table cannot be written.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Writes `cells.csv`, `pattern.json`, `cells.geojson`, `overlay.png` and `summary.json`.
///
/// # Errors
/// A file cannot be written, or the overlay cannot be drawn.
pub fn write(
    folder: &mut OutputFolder,
    comb: &Comb,
    photo: &Photo,
    summary: &CombSummary,
) -> Result<(), CombOutputError> {
    let (overlay, tables) =
        rayon::join(|| comb_overlay::draw(comb, photo), || write_tables(folder, comb, summary));
    tables?;
    folder.write_bytes("overlay.png", &overlay?)?;
    Ok(())
}

fn write_tables(
    folder: &mut OutputFolder,
    comb: &Comb,
    summary: &CombSummary,
) -> Result<(), CombOutputError> {
    let mut table = Vec::new();
    write_cells(comb, &mut table)?;
    folder.write_bytes(CELLS, &table)?;
    folder.write_json("pattern.json", &comb.pattern)?;
    folder.write("cells.geojson", |file| file.write_all(&outlines(comb)?))?;
    folder.write_json("summary.json", summary)?;
    Ok(())
}

/// The outline of a cell as GeoJSON.
#[derive(Serialize)]
struct Feature {
    r#type: &'static str,
    id: usize,
    properties: Properties,
    geometry: Geometry,
}

#[derive(Serialize)]
struct Properties {
    sides: Option<u32>,
    other_sides: Option<u32>,
    status: CellStatus,
    confidence: f64,
}

#[derive(Serialize)]
struct Geometry {
    r#type: &'static str,
    coordinates: [Vec<[f64; 2]>; 1],
}

impl Feature {
    fn new(id: CellId, cell: &Cell, detail: &CellDetail) -> Self {
        let round = |v: f64| (v * 100.0).round() / 100.0;
        let mut ring: Vec<[f64; 2]> = detail.outline.iter().map(|p| [round(p.x), round(p.y)]).collect();
        ring.extend(ring.first().copied());
        Self {
            r#type: "Feature",
            id: id.index(),
            properties: Properties {
                sides: cell.sides,
                other_sides: detail.other_sides,
                status: cell.status,
                confidence: cell.confidence,
            },
            geometry: Geometry { r#type: "Polygon", coordinates: [ring] },
        }
    }
}

/// The outlines of the seen cells as GeoJSON, in pixels of the photograph with y downward, as annotation tools read it; a line
/// for each.
fn outlines(comb: &Comb) -> serde_json::Result<Vec<u8>> {
    let seen: Vec<(CellId, &Cell)> =
        comb.pattern.cells.enumerated().filter(|(id, _)| comb.details[*id].seen).collect();
    let line = |(id, cell): (CellId, &Cell)| serde_json::to_vec(&Feature::new(id, cell, &comb.details[id]));
    let lines = seen.into_par_iter().map(line).collect::<serde_json::Result<Vec<Vec<u8>>>>()?;
    let text = [b"{\"type\":\"FeatureCollection\",\"features\":[\n", &*lines.join(&b",\n"[..]), b"\n]}\n"];
    Ok(text.concat())
}

/// A photograph of a batch: its name, and what was read or why not.
pub type BatchEntry<'a> = (&'a str, Result<&'a CombSummary, &'a str>);

/// Writes `photos.csv`: one row per photograph, those that failed with the reason.
///
/// # Errors
/// What `to` says when it cannot be written to.
pub fn write_batch<'a>(
    entries: impl IntoIterator<Item = BatchEntry<'a>>,
    to: impl io::Write,
) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(to);
    writer.write_record(BATCH_COLUMNS)?;
    for (name, result) in entries {
        match result {
            Ok(summary) => writer.write_record(batch_row(name, summary))?,
            Err(reason) => {
                let mut row = vec![String::new(); BATCH_COLUMNS.len()];
                name.clone_into(&mut row[0]);
                reason.clone_into(&mut row[BATCH_COLUMNS.len() - 1]);
                writer.write_record(row)?;
            }
        }
    }
    writer.flush()?;
    Ok(())
}

const BATCH_COLUMNS: [&str; 20] = [
    "photo",
    "width_px",
    "height_px",
    "pitch_px",
    "mm_per_px",
    "complete",
    "cut",
    "uncertain",
    "hidden",
    "sides_4",
    "sides_5",
    "sides_6",
    "sides_7",
    "sides_8",
    "mean_sides",
    "second_moment",
    "charge",
    "pairs",
    "hexatic_order",
    "error",
];

fn batch_row(name: &str, summary: &CombSummary) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.5}"));
    let sides = |n: usize| summary.sides.cells_by_sides.get(n).copied().unwrap_or(0).to_string();
    vec![
        name.to_owned(),
        summary.width_px.to_string(),
        summary.height_px.to_string(),
        format!("{:.2}", summary.pitch_px),
        number(summary.mm_per_px),
        summary.sides.complete.to_string(),
        summary.sides.cut.to_string(),
        summary.sides.uncertain.to_string(),
        summary.hidden.to_string(),
        sides(4),
        sides(5),
        sides(6),
        sides(7),
        sides(8),
        number(summary.sides.mean_sides),
        number(summary.sides.second_moment),
        summary.sides.charge.to_string(),
        summary.pairs.to_string(),
        number(summary.sides.hexatic_order),
        String::new(),
    ]
}

/// One line on a photograph for a person.
#[must_use]
pub fn line(summary: &CombSummary) -> String {
    let sides: Vec<String> = summary
        .sides
        .cells_by_sides
        .iter()
        .enumerate()
        .filter(|(_, count)| **count > 0)
        .map(|(n, count)| format!("{count} of {n}"))
        .collect();
    format!(
        "{}: {} complete cells ({} sides), {} cut, {} uncertain, {} hidden, {} 5-7 pairs, pitch {:.1} px",
        summary.photo,
        summary.sides.complete,
        if sides.is_empty() { "none of any".to_owned() } else { sides.join(", ") },
        summary.sides.cut,
        summary.sides.uncertain.saturating_sub(summary.hidden),
        summary.hidden,
        summary.pairs,
        summary.pitch_px,
    )
}

/// How a cell of this status is called in the legend.
#[must_use]
pub const fn status_name(status: CellStatus) -> &'static str {
    match status {
        CellStatus::Complete => "complete",
        CellStatus::Cut => "cut: not counted",
        CellStatus::Uncertain => "uncertain",
    }
}
