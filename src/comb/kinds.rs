//! What each place of the lattice is: a cell that was seen, one that something hides, or nothing.

use super::{
    evidence::Evidence,
    grid::Grid,
    triangulation::{Delaunay, circumcentre},
};
use glam::DVec2;

/// Least share of rays that must meet a wall for a place to be a seen cell.
const CLOSURE: f64 = 0.65;
/// Least share of the middle that must be lower than the wall. Caps and pollen of a wall's colour are below it.
const OPENNESS: f64 = 0.7;
/// The same between cells that are open: pollen, glare and nectar fill much of the middle there.
const ENCLOSED_OPENNESS: f64 = 0.5;
/// The same for a cell that the border of the photograph cuts, between two cells that are seen.
const PARTIAL_OPENNESS: f64 = 0.5;
/// Least mean rise of the levelled relief; noise that was levelled up rises by about 0.5.
const RISE: f64 = 0.6;
/// Least contrast before levelling, as a share of the photograph's median. Sky and blurred ground are below it; comb in
/// the shade is above.
const CONTRAST: f64 = 0.08;
/// Greatest relative unevenness of the rim.
pub(crate) const UNEVENNESS: f64 = 0.3;
/// Greatest raggedness of a whole cell; complete cells of the photographs with hand-checked truth have up to 0.2.
const RAGGEDNESS: f64 = 0.27;
/// Cells that must hang together for a piece of comb.
const PIECE: usize = 7;
/// Open cells within this many pitches hang together.
const LINK: f64 = 2.2;
/// Seen cells this far apart (as radius of an empty circle, in pitches) still have comb between them.
const BRIDGE: f64 = 4.5;

/// What a place of the lattice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A cell whose opening can be seen.
    Seen,
    /// A place within the comb whose cell cannot be seen: capped, behind a bee, in glare.
    Hidden,
    /// A place beyond the comb.
    Outside,
}

/// Decides what each place is; `whole` are the cells that neither the border nor a mask cuts, `clear` those whose blob stands
/// out as an open cell among caps does.
pub(crate) fn classify(
    centres: &[DVec2],
    pitches: &[f64],
    evidence: &[Evidence],
    whole: &[bool],
    clear: &[bool],
) -> Vec<Kind> {
    let typical = median(evidence.iter().zip(whole).filter(|(_, w)| **w).map(|(e, _)| e.contrast));
    // Among caps nothing bounds the pixels that such a cell gets; its opening is no less a cell.
    let shaped = |i: usize| {
        clear[i]
            || evidence[i].unevenness <= UNEVENNESS && (!whole[i] || evidence[i].raggedness <= RAGGEDNESS)
    };
    let is_open = |i: usize, openness: f64| shaped(i) && is_open(&evidence[i], typical, openness);
    let open: Vec<bool> = (0..centres.len()).map(|i| is_open(i, OPENNESS)).collect();
    let anchored = pieces(centres, pitches, &open);
    let grid = Grid::of(centres, median(pitches.iter().copied()).max(1.0));
    let partial = |i: usize| {
        let neighbours = grid.within(centres[i], 1.4 * pitches[i]).filter(|(n, _)| anchored[*n]).count();
        !whole[i] && evidence[i].openness >= PARTIAL_OPENNESS && neighbours >= 2
    };
    let inside = between(centres, pitches, &anchored);
    (0..centres.len())
        .map(|i| match (anchored[i], inside[i]) {
            (true, _) => Kind::Seen,
            (false, true) if is_open(i, ENCLOSED_OPENNESS) => Kind::Seen,
            (false, false) if partial(i) => Kind::Seen,
            (false, true) => Kind::Hidden,
            (false, false) => Kind::Outside,
        })
        .collect()
}

fn is_open(evidence: &Evidence, typical: f64, least_openness: f64) -> bool {
    evidence.closure >= CLOSURE
        && evidence.openness >= least_openness
        && evidence.rise >= RISE
        && evidence.contrast >= CONTRAST * typical
}

/// The open cells of every group of at least [`PIECE`] that touch one another.
fn pieces(centres: &[DVec2], pitches: &[f64], open: &[bool]) -> Vec<bool> {
    let grid = Grid::of(centres, median(pitches.iter().copied()).max(1.0));
    let open_neighbours = |a: usize| {
        grid.within(centres[a], LINK * pitches[a])
            .map(|(b, _)| b)
            .filter(|b| open[*b])
            .collect::<Vec<usize>>()
    };
    let mut kept = vec![false; centres.len()];
    let mut visited = vec![false; centres.len()];
    for start in 0..centres.len() {
        if !open[start] || visited[start] {
            continue;
        }
        let mut group = vec![start];
        visited[start] = true;
        let mut next = 0;
        while next < group.len() {
            for other in open_neighbours(group[next]) {
                if !visited[other] {
                    visited[other] = true;
                    group.push(other);
                }
            }
            next += 1;
        }
        if group.len() >= PIECE {
            group.iter().for_each(|i| kept[*i] = true);
        }
    }
    kept
}

/// Which places lie between anchored cells: in a triangle of them whose circle is no wider than what is bridged.
fn between(centres: &[DVec2], pitches: &[f64], anchored: &[bool]) -> Vec<bool> {
    let seen: Vec<usize> = (0..centres.len()).filter(|i| anchored[*i]).collect();
    let points: Vec<DVec2> = seen.iter().map(|i| centres[*i]).collect();
    let pitch = median(seen.iter().map(|i| pitches[*i])).max(1.0);
    let grid = Grid::of(centres, pitch);
    let mut inside = vec![false; centres.len()];
    for corners in Delaunay::of(&points).triangles() {
        let [a, b, c] = corners.map(|i| points[i]);
        let Some(middle) = circumcentre(a, b, c) else { continue };
        let radius = middle.distance(a);
        if radius < BRIDGE * pitch {
            for (place, _) in grid.within(middle, radius) {
                let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| (q - p).perp_dot(centres[place] - p));
                inside[place] |= sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
            }
        }
    }
    inside
}

/// The middle value; 0 of none.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}
