//! A person has the last word: corrections by hand, from `corrections.json` or from an edited `cells.csv`.
//!
//! Cells are named by a point in them, not by their number, so that corrections hold when the photograph is read again.
//! Cells added, removed, joined and split change what is segmented, so that their neighbours' walls are found anew; numbers
//! of sides and statuses are set at the end. Where two corrections speak of one cell, the later one holds.

use super::{Comb, lattice::Site, table::CellRow};
use crate::tessellation::{CellId, CellStatus};
use glam::DVec2;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// The name and version of the form of `corrections.json`.
const CORRECTIONS_SCHEMA: &str = "combwright.corrections/1";
/// A correction means the nearest cell within this many pitches.
const WITHIN: f64 = 0.5;
/// Numbers of sides that a person may give.
const SIDES: RangeInclusive<u32> = 3..=12;
/// Cells that are joined lie within this many pitches of one another; the halves of a split one within this of its middle.
const BESIDE: f64 = 1.6;
/// Halves of a split cell are at least this many pitches apart.
const APART: f64 = 0.2;
/// A row of an edited table means the cell within this many pitches.
const SAME: f64 = 0.35;

/// One correction; points are in pixels of the photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Correction {
    /// There is a cell here; it takes the place of a hidden one.
    Add {
        /// Its centre.
        at: DVec2,
    },
    /// There is no cell here; those around it are cut.
    Remove {
        /// A point in it.
        at: DVec2,
    },
    /// Two cells are one.
    Join {
        /// A point in the one.
        at: DVec2,
        /// A point in the other.
        with: DVec2,
    },
    /// One cell is two.
    Split {
        /// A point in it.
        at: DVec2,
        /// The centres of the two.
        into: [DVec2; 2],
    },
    /// A cell has this many sides, 3 to 12; it is complete then, and seen.
    Sides {
        /// A point in it.
        at: DVec2,
        /// Its number of sides.
        sides: u32,
    },
    /// A cell has this status.
    Status {
        /// A point in it.
        at: DVec2,
        /// Its status.
        status: CellStatus,
    },
    /// Nothing is to be read within this polygon.
    Mask {
        /// Its corners.
        polygon: Vec<DVec2>,
    },
}

/// What a person says of a photograph's cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Corrections {
    schema: String,
    /// The corrections, in order.
    pub corrections: Vec<Correction>,
}

impl Default for Corrections {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

/// Why corrections cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CorrectionError {
    /// The file is not JSON of the expected form.
    #[error("the corrections are not of the expected form: {0}")]
    Form(#[from] serde_json::Error),
    /// The file is of another kind or version.
    #[error("the corrections' schema is '{found}'; this program reads '{CORRECTIONS_SCHEMA}'")]
    Schema {
        /// What was found.
        found: String,
    },
    /// There is no cell at the point.
    #[error(
        "correction {number} ({what}): no cell within half a pitch of ({x:.1}, {y:.1}); check the point and whether the \
         corrections belong to this photograph, or add the cell"
    )]
    NoCell {
        /// Place in the list, from 1.
        number: usize,
        /// What it would do.
        what: &'static str,
        /// The point.
        x: f64,
        /// The point.
        y: f64,
    },
    /// What it says cannot be.
    #[error("correction {number} ({what}): {why}")]
    Senseless {
        /// Place in the list, from 1.
        number: usize,
        /// What it would do.
        what: &'static str,
        /// Why not, and what to do.
        why: String,
    },
}

impl Corrections {
    /// Corrections in order.
    #[must_use]
    pub fn new(corrections: Vec<Correction>) -> Self {
        Self { schema: CORRECTIONS_SCHEMA.to_owned(), corrections }
    }

    /// Reads the text of `corrections.json`.
    ///
    /// # Errors
    /// The text is not of the form, or of another version.
    pub fn from_json(text: &str) -> Result<Self, CorrectionError> {
        let read: Self = serde_json::from_str(text)?;
        if read.schema == CORRECTIONS_SCHEMA {
            Ok(read)
        } else {
            Err(CorrectionError::Schema { found: read.schema })
        }
    }

    /// What was changed in a table by hand, compared with what was read from the photograph: rows that are gone or new,
    /// other numbers of sides, other statuses.
    #[must_use]
    pub fn from_table(rows: &[CellRow], read: &Comb) -> Self {
        let near = |a: DVec2, b: DVec2| a.distance(b) < SAME * read.pitch;
        let mut corrections = Vec::new();
        for cell in &read.pattern.cells {
            let at = cell.position.truncate();
            if !rows.iter().any(|row| near(row.position(), at)) {
                corrections.push(Correction::Remove { at });
            }
        }
        for row in rows {
            let at = row.position();
            let Some(id) = nearest(read, at, SAME) else {
                corrections.push(Correction::Add { at });
                corrections.extend(row.sides.map(|sides| Correction::Sides { at, sides }));
                continue;
            };
            let cell = &read.pattern.cells[id];
            if let Some(sides) = row.sides.filter(|n| cell.sides != Some(*n)) {
                corrections.push(Correction::Sides { at, sides });
            }
            if row.status != cell.status && (row.sides == cell.sides || row.status != CellStatus::Complete) {
                corrections.push(Correction::Status { at, status: row.status });
            }
        }
        Self::new(corrections)
    }

    /// The corrections of `self` and then those of `more`.
    #[must_use]
    pub fn and(mut self, more: Self) -> Self {
        self.corrections.extend(more.corrections);
        self
    }

    /// Whether every correction can be meant, in a photograph of the given size and pitch in pixels.
    pub(crate) fn check(&self, size: DVec2, pitch: f64) -> Result<(), CorrectionError> {
        for (index, correction) in self.corrections.iter().enumerate() {
            correction.check(size, pitch).map_err(|why| senseless(index, correction.name(), why))?;
        }
        Ok(())
    }

    /// Adds, removes and splits places of the lattice; points are brought to the raster by `to_raster`.
    pub(crate) fn place(
        &self,
        sites: &mut Vec<Site>,
        to_raster: impl Fn(DVec2) -> DVec2,
        pitch: f64,
    ) -> Result<(), CorrectionError> {
        for (index, correction) in self.corrections.iter().enumerate() {
            let within = WITHIN * pitch;
            let find = |at: DVec2, sites: &[Site]| {
                let place = nearest_site(sites, to_raster(at), within, |site| !site.removed);
                place.ok_or_else(|| missing(index, correction.name(), at))
            };
            match correction {
                Correction::Add { at } => add(sites, to_raster(*at), pitch)
                    .map_err(|why| senseless(index, correction.name(), why))?,
                Correction::Remove { at } => {
                    let place = find(*at, sites)?;
                    sites[place].removed = true;
                }
                Correction::Split { at, into } => {
                    sites.remove(find(*at, sites)?);
                    sites.extend(into.iter().map(|part| Site::by_hand(to_raster(*part))));
                }
                Correction::Sides { at, .. } | Correction::Status { at, status: CellStatus::Complete } => {
                    let place = find(*at, sites)?;
                    sites[place].by_hand |= sites[place].depth > 0;
                }
                Correction::Join { .. } | Correction::Status { .. } | Correction::Mask { .. } => {}
            }
        }
        Ok(())
    }

    /// The pairs of places to be joined.
    pub(crate) fn joined(
        &self,
        sites: &[Site],
        to_raster: impl Fn(DVec2) -> DVec2,
        pitch: f64,
    ) -> Result<Vec<(usize, usize)>, CorrectionError> {
        let mut pairs = Vec::new();
        for (index, correction) in self.corrections.iter().enumerate() {
            if let Correction::Join { at, with } = correction {
                let find = |at: DVec2| {
                    nearest_site(sites, to_raster(at), WITHIN * pitch, |site| !site.removed)
                        .ok_or_else(|| missing(index, correction.name(), at))
                };
                let (a, b) = (find(*at)?, find(*with)?);
                pairs.push((a.min(b), a.max(b)));
            }
        }
        Ok(pairs.into_iter().filter(|(a, b)| a != b).collect())
    }

    /// Whether a point is in a masked polygon.
    pub(crate) fn hides(&self, point: DVec2) -> bool {
        self.corrections.iter().any(|c| matches!(c, Correction::Mask { polygon } if contains(polygon, point)))
    }

    /// Whether any polygon is masked.
    pub(crate) fn masks(&self) -> bool {
        self.corrections.iter().any(|c| matches!(c, Correction::Mask { .. }))
    }

    /// Sets numbers of sides and statuses.
    pub(crate) fn decide(&self, comb: &mut Comb) -> Result<(), CorrectionError> {
        for (index, correction) in self.corrections.iter().enumerate() {
            match correction {
                Correction::Sides { at, sides } => {
                    let id = nearest(comb, *at, WITHIN).ok_or_else(|| missing(index, "sides", *at))?;
                    let cell = &mut comb.pattern.cells[id];
                    cell.sides = Some(*sides);
                    cell.status = CellStatus::Complete;
                    cell.confidence = 1.0;
                    comb.details[id].other_sides = None;
                }
                Correction::Status { at, status } => {
                    let id = nearest(comb, *at, WITHIN).ok_or_else(|| missing(index, "status", *at))?;
                    let cell = &mut comb.pattern.cells[id];
                    if *status == CellStatus::Complete && cell.sides.is_none() {
                        cell.sides = u32::try_from(cell.walls.len()).ok();
                    }
                    cell.status = *status;
                    if *status == CellStatus::Complete {
                        cell.confidence = 1.0;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }
}

impl Correction {
    /// The word that it is written by.
    const fn name(&self) -> &'static str {
        match self {
            Self::Add { .. } => "add",
            Self::Remove { .. } => "remove",
            Self::Join { .. } => "join",
            Self::Split { .. } => "split",
            Self::Sides { .. } => "sides",
            Self::Status { .. } => "status",
            Self::Mask { .. } => "mask",
        }
    }

    /// The points that must lie in the photograph.
    fn points(&self) -> Vec<DVec2> {
        match self {
            Self::Add { at } | Self::Remove { at } | Self::Sides { at, .. } | Self::Status { at, .. } => {
                vec![*at]
            }
            Self::Join { at, with } => vec![*at, *with],
            Self::Split { at, into: [one, other] } => vec![*at, *one, *other],
            Self::Mask { .. } => Vec::new(),
        }
    }

    /// What cannot be meant by it.
    fn check(&self, size: DVec2, pitch: f64) -> Result<(), String> {
        let within = |p: &DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(size).all();
        if let Some(p) = self.points().iter().find(|p| !within(p)) {
            return Err(format!("({}, {}) is not in the photograph of {} x {} px", p.x, p.y, size.x, size.y));
        }
        match self {
            Self::Sides { sides, .. } if !SIDES.contains(sides) => {
                Err(format!("{sides} is not a number of sides; {} to {} are", SIDES.start(), SIDES.end()))
            }
            Self::Join { at, with } if at.distance(*with) > BESIDE * pitch => Err(format!(
                "the two points are {:.0} px apart, but cells are {pitch:.0} px wide; only neighbours can be joined",
                at.distance(*with)
            )),
            Self::Split { into: [one, other], .. } if one.distance(*other) < APART * pitch => {
                Err("the centres of the two parts coincide".to_owned())
            }
            Self::Split { at, into } if into.iter().any(|part| part.distance(*at) > BESIDE * pitch) => {
                Err(format!("the centres of the two parts are not in the cell, which is {pitch:.0} px wide"))
            }
            Self::Mask { polygon } if polygon.len() < 3 || polygon.iter().any(|p| !p.is_finite()) => {
                Err(format!("a polygon has three corners or more, this one has {}", polygon.len()))
            }
            _ => Ok(()),
        }
    }
}

/// Puts a cell at a point, in place of a hidden or a removed one.
fn add(sites: &mut Vec<Site>, at: DVec2, pitch: f64) -> Result<(), String> {
    if nearest_site(sites, at, SAME * pitch, Site::is_seen).is_some() {
        return Err("a cell was found there; split it if it is two".to_owned());
    }
    if let Some(place) = nearest_site(sites, at, WITHIN * pitch, |site| !site.is_seen()) {
        sites.remove(place);
    }
    sites.push(Site::by_hand(at));
    Ok(())
}

const fn senseless(index: usize, what: &'static str, why: String) -> CorrectionError {
    CorrectionError::Senseless { number: index + 1, what, why }
}

fn missing(index: usize, what: &'static str, at: DVec2) -> CorrectionError {
    CorrectionError::NoCell { number: index + 1, what, x: at.x, y: at.y }
}

fn nearest(comb: &Comb, at: DVec2, within: f64) -> Option<CellId> {
    let distance = |id: CellId| comb.pattern.cells[id].position.truncate().distance(at);
    comb.pattern
        .cells
        .ids()
        .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
        .filter(|id| distance(*id) < within * comb.pitch)
}

fn nearest_site(sites: &[Site], at: DVec2, within: f64, meant: impl Fn(&Site) -> bool) -> Option<usize> {
    let distance = |i: &usize| sites[*i].position.distance(at);
    let meant = (0..sites.len()).filter(|i| meant(&sites[*i]));
    meant.min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|i| distance(i) < within)
}

/// Whether a polygon holds a point, by the parity of crossings to its right.
fn contains(polygon: &[DVec2], point: DVec2) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossings = edges.filter(|(a, b)| {
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}
