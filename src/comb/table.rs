//! `cells.csv`: one row per cell.

use super::Comb;
use crate::{index::Id, tessellation::CellStatus};
use glam::DVec2;
use serde::{Deserialize, Deserializer, Serialize};
use std::io;

/// A row of `cells.csv`. What is missing at the end of a row, or left empty, in a file edited by hand is taken as 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellRow {
    /// The cell's number in the pattern.
    #[serde(default)]
    pub id: Option<usize>,
    /// Centre, from the left edge of the photograph.
    pub x_px: f64,
    /// Centre, from its upper edge.
    pub y_px: f64,
    /// Number of sides; empty for cells that are cut or hidden.
    pub sides: Option<u32>,
    /// The other number that the photograph allows.
    #[serde(default)]
    pub other_sides: Option<u32>,
    /// `complete`, `cut` or `uncertain`.
    pub status: CellStatus,
    /// The chance that `sides` is right; 0 where there is none.
    #[serde(default, deserialize_with = "or_default")]
    pub confidence: f64,
    /// Area up to the middle of the walls; 0 for hidden cells.
    #[serde(default, deserialize_with = "or_default")]
    pub area_px2: f64,
    /// Whether the cell is seen; 0 for one inferred from its neighbours.
    #[serde(default, deserialize_with = "or_default")]
    pub seen: u8,
}

/// An empty field as the default.
fn or_default<'de, D, T>(from: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + Default,
{
    Ok(Option::deserialize(from)?.unwrap_or_default())
}

impl CellRow {
    /// The centre.
    #[must_use]
    pub const fn position(&self) -> DVec2 {
        DVec2::new(self.x_px, self.y_px)
    }
}

/// Why a table cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[error("the table of cells: {0}")]
pub struct TableError(#[from] csv::Error);

/// Reads a table.
///
/// # Errors
/// [`TableError`] with the row where it is not such a table.
pub fn read_cells(from: impl io::Read) -> Result<Vec<CellRow>, TableError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(from);
    Ok(reader.deserialize().collect::<Result<_, _>>()?)
}

/// Writes the table of a photograph's cells.
///
/// # Errors
/// [`TableError`] if `to` cannot be written to.
pub fn write_cells(comb: &Comb, to: impl io::Write) -> Result<(), TableError> {
    let mut writer = csv::Writer::from_writer(to);
    for row in rows(comb) {
        writer.serialize(row)?;
    }
    writer.flush().map_err(csv::Error::from)?;
    Ok(())
}

fn rows(comb: &Comb) -> impl Iterator<Item = CellRow> {
    let round = |value: f64, digits: i32| {
        let unit = 10.0_f64.powi(digits);
        (value * unit).round() / unit
    };
    comb.pattern.cells.enumerated().map(move |(id, cell)| CellRow {
        id: Some(id.index()),
        x_px: round(cell.position.x, 2),
        y_px: round(cell.position.y, 2),
        sides: cell.sides,
        other_sides: comb.details[id].other_sides,
        status: cell.status,
        confidence: round(cell.confidence, 3),
        area_px2: round(cell.area, 1),
        seen: u8::from(comb.details[id].seen),
    })
}
