//! T1s by geometry: when a film has shrunk, its network edge flips and the films round it are extruded anew.
//!
//! An edge flips when it is shorter than a part of the cell width. Each flip of an edge lowers the part for that edge, and
//! the new edge is laid longer than the threshold: so no edge flips back and forth for ever.

use super::{
    network::{EdgeId, HalfEdgeId, Network, VertexId},
    relax::State,
};
use crate::{index::IndexVec, surface::Gap};
use glam::DVec3;

/// By how much each flip of an edge lowers its threshold.
const WEARINESS: f64 = 0.6;

/// The new edge's length in units of the cell width. Shorter ones are pulled apart in more steps, longer ones disturb the
/// neighbours more.
const NEW_LENGTH: f64 = 0.12;

/// The most of its shortest neighbour's length that a new edge may have: longer ones would cross others.
const ROOM: f64 = 0.5;

/// The distance between the ends of every edge.
#[must_use]
pub fn edge_lengths(state: &State) -> IndexVec<EdgeId, f64> {
    state
        .network
        .edges()
        .map(|edge| {
            let (start, end) = state.chord(edge);
            start.distance(end)
        })
        .collect()
}

/// The edges that may flip, are shorter than `part` of the cell width and were longer `before`; the shortest first. Short edges
/// that grow are left alone: a rough start has many.
#[must_use]
pub fn vanishing_edges(state: &State, before: &IndexVec<EdgeId, f64>, part: f64) -> Vec<EdgeId> {
    let width = state.cell_width();
    let mut short: Vec<(f64, EdgeId)> = edge_lengths(state)
        .enumerated()
        .filter_map(|(edge, &length)| {
            let weary = WEARINESS.powi(i32::try_from(state.flips_of_edge[edge]).unwrap_or(i32::MAX));
            let relative = length / (width * part * weary);
            (relative < 1.0 && length < before[edge] && state.network.can_flip(edge).is_ok())
                .then_some((relative, edge))
        })
        .collect();
    short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    short.into_iter().map(|(_, edge)| edge).collect()
}

/// The two ends of an edge and their four other neighbours.
#[must_use]
pub fn round(network: &Network, edge: EdgeId) -> Vec<VertexId> {
    let ends = edge.half_edges().map(|side| network.origin(side));
    let mut round: Vec<VertexId> = ends
        .iter()
        .flat_map(|&end| network.outgoing(end).map(|side| network.target(side)))
        .chain(ends)
        .collect();
    round.sort_unstable();
    round.dedup();
    round
}

/// Passes that draw vertices apart, and how far each goes towards the mean of the neighbours: a tangle of a few vertices
/// opens, and the rest of the foam keeps its shape.
const PASSES: usize = 4;
const PART: f64 = 0.5;

/// Moves every vertex towards the mean of its neighbours, along the middle surface.
pub fn draw_apart(network: &mut Network, gap: &Gap) {
    for _ in 0..PASSES {
        let moved: Vec<(VertexId, DVec3)> = network
            .vertices()
            .map(|vertex| {
                let here = network.position(vertex);
                let pull: DVec3 = network.outgoing(vertex).map(|side| network.edge_vector(side) / 3.0).sum();
                let level = gap.middle().value(here);
                (vertex, gap.middle().project(here + PART * pull, level).unwrap_or(here))
            })
            .collect();
        for (vertex, place) in moved {
            network.set_position(vertex, place);
        }
    }
}

/// Does the T1 of an edge: flips the network, turns the edge across the middle surface and lays the five
/// films that meet it anew. Gives whether it was done; otherwise only the edge's threshold has changed.
pub fn flip(state: &mut State, gap: &Gap, edge: EdgeId) -> bool {
    let before = state.clone();
    state.follow_films();
    if flip_in_place(state, gap, edge).is_some() {
        return true;
    }
    *state = before;
    state.flips_of_edge[edge] += 1;
    false
}

/// The length of an edge after its flip: what the neighbours leave room for.
fn new_length(state: &State, edge: EdgeId) -> f64 {
    let network = &state.network;
    let length = |edge| {
        let (start, end) = state.chord(edge);
        start.distance(end)
    };
    let shortest = edge
        .half_edges()
        .iter()
        .flat_map(|&side| network.outgoing(network.origin(side)))
        .map(HalfEdgeId::edge)
        .filter(|&other| other != edge)
        .map(length)
        .fold(f64::INFINITY, f64::min);
    (ROOM * shortest).min(NEW_LENGTH * state.cell_width()).max(length(edge))
}

fn flip_in_place(state: &mut State, gap: &Gap, edge: EdgeId) -> Option<()> {
    let (start, end) = state.chord(edge);
    let length = new_length(state, edge);
    state.network.flip(edge).ok()?;
    let side = edge.half_edges()[0];
    let (u, v) = (state.network.origin(side), state.network.target(side));
    let far = state.network.period().translation(state.network.target_shift(side));
    let middle = 0.5 * (start + end);
    // Across the middle surface from the neighbours of the one new corner to those of the other: the old edge is too short
    // to say where to turn.
    let neighbours = |vertex: VertexId, frame: DVec3| -> DVec3 {
        let others = state.network.outgoing(vertex).filter(|&side| side.edge() != edge);
        others
            .map(|side| 0.5 * (state.network.position(vertex) + state.network.edge_vector(side) + frame))
            .sum()
    };
    let across = neighbours(u, DVec3::ZERO) - neighbours(v, far);
    let up = gap.middle().normal(middle);
    let left = (across - across.dot(up) * up).normalize_or(up.any_orthonormal_vector());
    let half = 0.5 * length;
    state.network.set_position(u, middle + half * left);
    state.network.set_position(v, middle - half * left - far);
    for vertex in [u, v] {
        state.strips.lay_column(&state.network, gap, vertex, &mut state.places).ok()?;
    }
    let touched: Vec<EdgeId> = [u, v]
        .into_iter()
        .flat_map(|w| state.network.outgoing(w).map(|side| side.edge()).collect::<Vec<_>>())
        .collect();
    for edge in touched {
        state.strips.lay_film(&state.network, gap, edge, &mut state.places).ok()?;
    }
    state.flips += 1;
    state.flips_of_edge[edge] += 1;
    Some(())
}
