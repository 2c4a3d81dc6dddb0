//! A foam between walls that lie far apart for their curvature: relaxed in a narrow gap, which is then widened.
//!
//! A cell's end on one wall is stretched and its end on the other is squeezed. Where that is much, straight films between the
//! walls are too crooked to start from; in a narrow gap they are not, and each wider gap starts from the balance of the one
//! before. The walls move along the normals of their level sets, and the films with them.
//!
//! How far this goes is physics: at some width a film has shrunk to nothing on one wall while it is long on the other.
//! Beyond it, cells touch other neighbours on one wall than on the other, and there is no foam of films that all reach from
//! wall to wall with these cells. [`Pinch`] says where; the foam of the widest gap reached is kept, and
//! [`crate::foam::free::widened`] goes on from it.

use super::{Progress, RelaxError, RelaxSettings, Relaxed, Run, State, Stop, go_on, real};
use crate::{
    foam::{
        complex::{NodeId, NodeImage},
        network::{CellId, EdgeId},
    },
    surface::{Gap, WallSide},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// A film that has all but vanished on one wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pinch {
    /// The cells that it parts.
    pub cells: [CellId; 2],
    /// The wall on which it is short.
    pub wall: WallSide,
    /// Its length on that wall, in cell widths.
    pub short: f64,
    /// Its length on the other wall, in cell widths.
    pub long: f64,
    /// Where it is short.
    pub place: DVec3,
}

/// Walls count as steep where an edge's first extrusion is squeezed below this part of its length half-way. On the P-surface
/// that is from about Φ = ±0.6 on; runs that start at once settle up to there, and parallel walls rarely come so far.
const STEEP: f64 = 0.45;

/// Edges shorter than this part of the cell width say nothing about the walls.
const LONG_ENOUGH: f64 = 0.3;

/// The part of the gap that is relaxed first: between Φ = ±0.86 on the P-surface an ordinary foam.
pub(super) const FIRST_PART: f64 = 0.25;

/// By how much the gap grows from stage to stage; half as much in the logarithm after each stage that failed.
const GROWTH: f64 = 1.25;

/// A stage that widens by less is not tried: foams of free topology go on from there.
const LEAST_GROWTH: f64 = 1.1;

/// Newton steps of one stage; those that settle take three to twenty.
const STAGE_STEPS: usize = 30;

/// A film that is shorter on a wall than this part of the cell width counts as gone there. Where a film vanishes at all
/// heights a T1 follows at a twentieth; what coarse meshes hold at a hundredth, fine ones do not.
const GONE: f64 = 0.04;

/// Lengths of a film on its two walls that differ by this factor make it a pinch.
const PINCHED: f64 = 3.0;

/// Whether straight films through the network are too crooked to start from.
pub(super) fn is_steep(state: &State) -> bool {
    let width = state.cell_width();
    state.network.films().any(|edge| {
        let [lower, middle, upper] = heights(state, edge).map(|(from, to)| from.distance(to));
        middle > LONG_ENOUGH * width && lower.min(upper) < STEEP * middle
    })
}

/// The ends of an edge on the lower wall, half-way and on the upper wall.
fn heights(state: &State, edge: EdgeId) -> [(DVec3, DVec3); 3] {
    let (columns, rows) = (state.strips.columns(), state.strips.rows());
    let place = |image: NodeImage| state.places[image.node] + state.network.period().translation(image.shift);
    [0, rows / 2, rows - 1].map(|row| {
        let at = |column| place(state.strips.film_node(&state.network, edge, column, row));
        (at(0), at(columns - 1))
    })
}

/// The film that is shortest on one wall of those that are much longer on the other.
fn pinch(state: &State) -> Option<Pinch> {
    let width = state.cell_width();
    state
        .network
        .films()
        .filter_map(|edge| {
            let [lower, _, upper] = heights(state, edge);
            let (on_lower, on_upper) = (lower.0.distance(lower.1), upper.0.distance(upper.1));
            let (wall, short, long, ends) = if on_lower < on_upper {
                (WallSide::Lower, on_lower, on_upper, lower)
            } else {
                (WallSide::Upper, on_upper, on_lower, upper)
            };
            let cells = edge.half_edges().map(|side| state.network.cell(side));
            let place = 0.5 * (ends.0 + ends.1);
            (long > PINCHED * short).then_some(Pinch {
                cells,
                wall,
                short: short / width,
                long: long / width,
                place,
            })
        })
        .min_by(|a, b| a.short.total_cmp(&b.short))
}

/// Goes on from a state in the part [`State::part`] of `gap` to the whole of it, or as far as there is a foam.
pub(super) fn widen(
    state: State,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    let first = stage(state, gap, settings, progress)?;
    if !matches!(first.stop, Stop::Converged { .. }) {
        return Ok(first);
    }
    let mut settled = vec![first.state];
    let mut growth = GROWTH;
    while growth >= LEAST_GROWTH
        && let Some(state) = settled.last().filter(|state| state.part < 1.0)
    {
        let part = (state.part * growth).min(1.0);
        let tried = widened(state, gap, part).and_then(|wider| stage(wider, gap, settings, progress).ok());
        match tried {
            Some(relaxed) if matches!(relaxed.stop, Stop::Interrupted { .. }) => return Ok(relaxed),
            Some(relaxed) if is_sound(&relaxed) => settled.push(relaxed.state),
            _ => growth = growth.sqrt(),
        }
    }
    widest(settled, gap, settings, progress)
}

/// Whether a stage settled, with no film gone on either wall.
fn is_sound(relaxed: &Relaxed) -> bool {
    matches!(relaxed.stop, Stop::Converged { .. })
        && pinch(&relaxed.state).is_none_or(|pinch| pinch.short > GONE)
}

/// One width of the gap, relaxed on the coarse mesh.
fn stage(
    state: State,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    let step_limit = settings.step_limit.min(state.steps + STAGE_STEPS);
    let settings = RelaxSettings { step_limit, ..settings.clone() };
    let narrowed = gap.narrowed(state.part);
    let mut run = Run::new(state, &narrowed, &settings)?;
    let stop = run.coarsely(progress)?;
    let steps = run.state.steps;
    Ok(run.ended(stop.unwrap_or(Stop::Converged { steps })))
}

/// The foam in the widest gap that settles on the final mesh; marked as such where that is not the whole gap.
fn widest(
    mut settled: Vec<State>,
    gap: &Gap,
    settings: &RelaxSettings,
    progress: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Relaxed, RelaxError> {
    loop {
        let Some(state) = settled.pop() else { unreachable!("the narrowest gap has settled") };
        let (part, allowed) = (state.part, settings.step_limit.max(state.steps + STAGE_STEPS));
        let settings = RelaxSettings { step_limit: allowed, ..settings.clone() };
        let mut relaxed = go_on(state, &gap.narrowed(part), &settings, progress)?;
        match relaxed.stop {
            Stop::Interrupted { .. } => return Ok(relaxed),
            Stop::Converged { .. } if part >= 1.0 => return Ok(relaxed),
            Stop::Converged { steps } => {
                relaxed.stop = Stop::TooWide { steps, part, pinch: pinch(&relaxed.state) };
                return Ok(relaxed);
            }
            // A narrower gap is tried, if there is one.
            _ if settled.is_empty() => return Ok(relaxed),
            _ => {}
        }
    }
}

/// The state with its walls at another part of `gap` and its films stretched between them; `None` if a wall is not found.
fn widened(state: &State, gap: &Gap, part: f64) -> Option<State> {
    let narrowed = gap.narrowed(part);
    let mut wider = State { part, ..state.clone() };
    let last = state.strips.rows() - 1;
    for column in columns(state) {
        let ends = [column[0], column[last]].map(|node| state.places[node]);
        let lower = narrowed.wall(WallSide::Lower).project(ends[0]).ok()? - ends[0];
        let upper = narrowed.wall(WallSide::Upper).project(ends[1]).ok()? - ends[1];
        for (row, &node) in column.iter().enumerate() {
            wider.places[node] += lower.lerp(upper, real(row) / real(last));
        }
    }
    Some(wider)
}

/// The nodes from the lower to the upper wall, at every vertex and inside every film.
fn columns(state: &State) -> Vec<Vec<NodeId>> {
    let strips = state.strips;
    let of_vertices = state
        .network
        .vertices()
        .map(|vertex| (0..strips.rows()).map(|row| strips.border_node(vertex, row)).collect::<Vec<_>>());
    let of_films = state.network.edges().flat_map(|edge| {
        (1..strips.columns() - 1).map(move |column| {
            (0..strips.rows())
                .map(|row| strips.film_node(&state.network, edge, column, row).node)
                .collect::<Vec<_>>()
        })
    });
    of_vertices.chain(of_films).collect()
}
