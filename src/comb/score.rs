//! A reading against a truth, by the rules of the photographs' hand-checked truth.
//!
//! A cell is found when a cell of the reading lies within 0.35 of the pitch of its true centre, one to one, nearest first.

use super::table::CellRow;
use crate::tessellation::CellStatus;
use glam::DVec2;
use serde::{Deserialize, Serialize};
use std::io;

/// Greatest distance of a found cell from its true centre, in pitches.
const MATCH: f64 = 0.35;

/// A true cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TruthCell {
    /// Centre, from the left edge.
    pub x_px: f64,
    /// Centre, from the upper edge.
    pub y_px: f64,
    /// Number of sides, where it is known.
    pub sides: Option<u32>,
    /// Another number of sides that counts as right.
    #[serde(default)]
    pub other_sides: Option<u32>,
    /// 1 if the whole cell can be seen.
    pub complete: u8,
}

/// The true cells of a photograph.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// All cells.
    pub cells: Vec<TruthCell>,
}

/// Why a truth cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("the truth needs the columns x_px, y_px, sides, complete: {0}")]
pub struct TruthError(#[from] csv::Error);

impl Truth {
    /// Reads a table with the columns `x_px, y_px, sides, complete` and perhaps `other_sides`.
    ///
    /// # Errors
    /// [`TruthError`] where it is not such a table.
    pub fn read(from: impl io::Read) -> Result<Self, TruthError> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(from);
        Ok(Self { cells: reader.deserialize().collect::<Result<_, _>>()? })
    }

    /// Writes the table.
    ///
    /// # Errors
    /// [`TruthError`] if `to` cannot be written to.
    pub fn write(&self, to: impl io::Write) -> Result<(), TruthError> {
        let mut writer = csv::Writer::from_writer(to);
        for cell in &self.cells {
            writer.serialize(cell)?;
        }
        writer.flush().map_err(csv::Error::from)?;
        Ok(())
    }
}

/// A cell whose count is wrong though it was reported as complete.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wrong {
    /// True centre.
    pub x_px: f64,
    /// True centre.
    pub y_px: f64,
    /// True number of sides.
    pub sides: u32,
    /// What the reading says.
    pub said: Option<u32>,
    /// How sure it says it is.
    pub confidence: f64,
}

/// How well a reading agrees with a truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Complete true cells.
    pub truth_complete: usize,
    /// Share of them that were found.
    pub recall: f64,
    /// Share of the reading's complete cells that are true cells.
    pub precision: f64,
    /// True cells with a known number of sides.
    pub counted: usize,
    /// Share of them that were found and reported as complete.
    pub coverage: f64,
    /// Share of those whose number of sides is right.
    pub sides_right: f64,
    /// True cells that are not hexagons, without those of two readings.
    pub defects: usize,
    /// Share of them found, complete and right.
    pub defect_recall: f64,
    /// Complete cells of the reading, among the true ones, said not to be hexagons.
    pub defect_claims: usize,
    /// Share of those that are right.
    pub defect_precision: f64,
    /// Cells said to be 90 % sure or more, and the share of them that is right.
    pub sure: usize,
    /// Share of the sure ones that is right.
    pub sure_right: f64,
    /// All wrong counts.
    pub wrong: Vec<Wrong>,
}

/// Compares a reading with a truth.
#[must_use]
pub fn score(cells: &[CellRow], truth: &Truth) -> Score {
    let found: Vec<DVec2> = cells.iter().map(CellRow::position).collect();
    let centres: Vec<DVec2> = truth.cells.iter().map(|c| DVec2::new(c.x_px, c.y_px)).collect();
    let partner = matched(&centres, &found);
    let complete: Vec<usize> = (0..centres.len()).filter(|i| truth.cells[*i].complete == 1).collect();
    let counted: Vec<usize> = complete.iter().copied().filter(|i| truth.cells[*i].sides.is_some()).collect();
    let told = |i: usize| partner[i].map(|j| &cells[j]).filter(|c| c.status == CellStatus::Complete);
    let right = |i: usize, row: &CellRow| {
        let cell = &truth.cells[i];
        row.sides.is_some() && (row.sides == cell.sides || row.sides == cell.other_sides)
    };
    let reported: Vec<(usize, &CellRow)> = counted.iter().filter_map(|i| told(*i).map(|c| (*i, c))).collect();
    let correct = |rows: &[(usize, &CellRow)]| rows.iter().filter(|(i, c)| right(*i, c)).count();
    let odd: Vec<usize> = counted
        .iter()
        .copied()
        .filter(|i| truth.cells[*i].sides != Some(6) && truth.cells[*i].other_sides.is_none())
        .collect();
    let claims: Vec<(usize, &CellRow)> =
        reported.iter().copied().filter(|(_, c)| c.sides != Some(6)).collect();
    let sure: Vec<(usize, &CellRow)> =
        reported.iter().copied().filter(|(_, c)| c.confidence >= 0.9).collect();
    let matched_cells =
        partner.iter().flatten().filter(|j| cells[**j].status == CellStatus::Complete).count();
    let claimed_cells = cells.iter().filter(|c| c.status == CellStatus::Complete).count();
    Score {
        truth_complete: complete.len(),
        recall: share(complete.iter().filter(|i| partner[**i].is_some()).count(), complete.len()),
        precision: share(matched_cells, claimed_cells),
        counted: counted.len(),
        coverage: share(reported.len(), counted.len()),
        sides_right: share(correct(&reported), reported.len()),
        defects: odd.len(),
        defect_recall: share(
            odd.iter().filter(|i| told(**i).is_some_and(|c| right(**i, c))).count(),
            odd.len(),
        ),
        defect_claims: claims.len(),
        defect_precision: share(correct(&claims), claims.len()),
        sure: sure.len(),
        sure_right: share(correct(&sure), sure.len()),
        wrong: wrong(truth, &reported, right),
    }
}

fn wrong(
    truth: &Truth,
    reported: &[(usize, &CellRow)],
    right: impl Fn(usize, &CellRow) -> bool,
) -> Vec<Wrong> {
    let of = |(i, row): &(usize, &CellRow)| {
        let cell = &truth.cells[*i];
        cell.sides.filter(|_| !right(*i, row)).map(|sides| Wrong {
            x_px: cell.x_px,
            y_px: cell.y_px,
            sides,
            said: row.sides,
            confidence: row.confidence,
        })
    };
    reported.iter().filter_map(of).collect()
}

/// A share; 1 of nothing.
fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 1.0 } else { part as f64 / whole as f64 }
}

/// For each true centre the found one that belongs to it.
fn matched(truth: &[DVec2], found: &[DVec2]) -> Vec<Option<usize>> {
    let pitch = median_spacing(truth);
    let grid = super::grid::Grid::of(found, pitch.max(1e-9));
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, centre) in truth.iter().enumerate() {
        pairs.extend(grid.within(*centre, MATCH * pitch).map(|(j, squared)| (squared, i, j)));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut partner = vec![None; truth.len()];
    let mut used = vec![false; found.len()];
    for (_, i, j) in pairs {
        if partner[i].is_none() && !used[j] {
            partner[i] = Some(j);
            used[j] = true;
        }
    }
    partner
}

/// Median distance of a centre from its nearest other.
fn median_spacing(points: &[DVec2]) -> f64 {
    let nearest = super::triangulation::Delaunay::of(points).neighbours();
    super::kinds::median(
        points
            .iter()
            .zip(&nearest)
            .filter_map(|(p, near)| near.iter().map(|n| points[*n].distance(*p)).min_by(f64::total_cmp)),
    )
}
