//! Whether a cell counts, and how sure its count is.

use super::{
    evidence::Evidence,
    kinds::{Kind, UNEVENNESS, median},
    read::Reading,
};
use crate::tessellation::CellStatus;
use glam::DVec2;

/// Least confidence with which a count counts.
const LEAST_CONFIDENCE: f64 = 0.6;
/// Least share of rays that meet a wall for the whole outline to be seen.
const LEAST_CLOSURE: f64 = 0.85;
/// Least rise to the wall, as a share of the photograph's median: textures of caps rise by half of it.
const LEAST_RISE: f64 = 0.5;
/// Greatest raggedness of an outline that was seen from wall to wall.
const GREATEST_RAGGEDNESS: f64 = 0.22;
/// Area of a cell of fewer than six sides, and of more, over that of its neighbours: on flat comb about 0.7 to 1 and 1 to 1.5.
const GREATEST_PENTAGON: f64 = 1.05;
const LEAST_HEPTAGON: f64 = 0.8;
/// Above this share of its neighbours' area a cell is two of which one was missed: a drone's cell among workers' has 1.5.
const GREATEST_SIZE: f64 = 1.6;
/// Chance that a side is right whose neighbour is hidden, and whose neighbour lies beyond the photograph, from synthetic
/// photographs (analysis/comb_accuracy/calibration.csv).
const HIDDEN_SIDE: f64 = 0.78;
const SIDE_BEYOND: f64 = 0.985;
/// Hidden neighbours that a complete cell may have: with two, a wall between them may end anywhere.
const HIDDEN_NEIGHBOURS: usize = 1;
/// No reading is surer than this.
const GREATEST_CONFIDENCE: f64 = 0.995;
/// Comb seen more obliquely than this (longer over shorter axis of what a circle looks like: 1.8 at 56 degrees) hides cells behind
/// others.
const GREATEST_NARROWNESS: f64 = 1.8;
/// Comb seen more obliquely than this is curved or far away: what is hidden there need not be as regular as what is seen.
const TURNED: f64 = 1.3;
/// A place beyond the comb that is this near to the border (in pitches) may be a cell of which little can be seen.
const BORDER: f64 = 0.3;

/// The status of one cell and the chance that its number of sides is right.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standing {
    pub(crate) status: CellStatus,
    pub(crate) confidence: f64,
}

/// The standing of all places; that of places beyond the comb means nothing.
pub(crate) fn standings(reading: &Reading) -> Vec<Standing> {
    let seen = |i: &usize| reading.kinds[*i] == Kind::Seen;
    let count = reading.centres.len();
    let typical = median((0..count).filter(seen).map(|i| reading.evidence[i].rise));
    (0..count).map(|cell| standing(reading, cell, typical)).collect()
}

fn standing(reading: &Reading, cell: usize, typical_rise: f64) -> Standing {
    let neighbours = &reading.counts[cell].neighbours;
    let of_kind = |kind| neighbours.iter().filter(move |n| reading.kinds[**n] == kind);
    let hidden = of_kind(Kind::Hidden).count();
    let (at_edge, beyond): (Vec<&usize>, Vec<&usize>) =
        of_kind(Kind::Outside).partition(|n| well_inside(reading, **n));
    let evidence = &reading.evidence[cell];
    let doubt = HIDDEN_SIDE.powi(saturating(hidden)) * SIDE_BEYOND.powi(saturating(beyond.len()));
    let confidence = (reading.counts[cell].confidence * doubt * evidence.closure).min(GREATEST_CONFIDENCE);
    // The place of a neighbour of which little is seen was inferred as if there were no defect: it cannot prove one.
    let is_vague = |n: &usize| {
        let is_whole = || is_shaped(&reading.evidence[*n]) && size(reading, *n) < GREATEST_SIZE;
        reading.slivers[*n] || !reading.cut[*n] && !is_whole()
    };
    let vague = of_kind(Kind::Seen).filter(|n| is_vague(n)).count();
    let narrowness = narrowness(reading, cell);
    let (odd, unseen) = (neighbours.len() != 6, hidden + beyond.len() + vague);
    let status = if reading.kinds[cell] != Kind::Seen {
        CellStatus::Uncertain
    } else if reading.cut[cell] || !at_edge.is_empty() || hidden > HIDDEN_NEIGHBOURS {
        CellStatus::Cut
    } else if confidence < LEAST_CONFIDENCE
        || !is_plain(evidence, typical_rise)
        || narrowness > GREATEST_NARROWNESS
        || (unseen > 0 && (odd || narrowness > TURNED))
        || (odd && !is_sized(reading, cell))
    {
        CellStatus::Uncertain
    } else {
        CellStatus::Complete
    };
    Standing { status, confidence }
}

fn is_plain(evidence: &Evidence, typical_rise: f64) -> bool {
    evidence.closure >= LEAST_CLOSURE && evidence.rise >= LEAST_RISE * typical_rise && is_shaped(evidence)
}

fn is_shaped(evidence: &Evidence) -> bool {
    evidence.unevenness <= UNEVENNESS && evidence.raggedness <= GREATEST_RAGGEDNESS
}

/// How obliquely a cell or the most oblique one beside it is seen.
fn narrowness(reading: &Reading, cell: usize) -> f64 {
    let whole = |n: &&usize| reading.kinds[**n] == Kind::Seen && !reading.cut[**n];
    let beside = reading.counts[cell].neighbours.iter().filter(whole);
    beside.map(|n| reading.evidence[*n].narrowness()).fold(reading.evidence[cell].narrowness(), f64::max)
}

/// Whether a cell has the size that goes with its number of sides: those of fewer than six are smaller than their neighbours,
/// those of more are larger. One that is not has got the pixels of a neighbour that was missed.
fn is_sized(reading: &Reading, cell: usize) -> bool {
    let size = size(reading, cell);
    if reading.counts[cell].neighbours.len() < 6 { size < GREATEST_PENTAGON } else { size > LEAST_HEPTAGON }
}

/// Area of a cell over that of its neighbours. The pitch is no measure of it: seen obliquely, cells are as wide as ever one way.
/// Where comb is turned, cells shrink from one to the next, and the mean makes up for it: the neighbours on one side are larger, on
/// the other smaller. Elsewhere the median does not mind a neighbour that got the pixels of the same missed cell.
fn size(reading: &Reading, cell: usize) -> f64 {
    let whole = |n: &&usize| reading.kinds[**n] == Kind::Seen && !reading.cut[**n];
    let areas = || reading.counts[cell].neighbours.iter().filter(whole).map(|n| reading.regions[*n].area);
    let usual = if narrowness(reading, cell) > TURNED {
        let (sum, count) = areas().fold((0.0, 0.0), |(sum, count), area| (sum + area, count + 1.0));
        sum / f64::max(count, 1.0)
    } else {
        median(areas())
    };
    if usual > 0.0 { reading.regions[cell].area / usual } else { 1.0 }
}

/// Whether a place beyond the comb lies within the photograph, so that a cell there would have been seen.
fn well_inside(reading: &Reading, place: usize) -> bool {
    let margin = DVec2::splat(BORDER * reading.pitches[place]);
    let at = reading.centres[place];
    at.cmpgt(margin).all() && at.cmplt(reading.size - margin).all()
}

fn saturating(count: usize) -> i32 {
    i32::try_from(count).unwrap_or(i32::MAX)
}
