//! Which image of each facet bounds a body in a torus.
//!
//! A body is followed from facet to facet across their edges. Where more than two sides of it meet at an edge, as when a body
//! meets its own image, neighbours are those that follow each other round the edge.

use super::{BodyId, Directed, FacetId, Neighbours, Surface};
use crate::{evolver::error::EvolverError, index::Id};
use glam::{DVec3, IVec3};

/// A side of a facet: 0 where the normal points out of the body.
type Sided = (FacetId, usize);

/// For each facet and each of its sides, by how many periods it must be moved to lie on its body's surface.
pub(crate) fn body_images(
    surface: &Surface,
    neighbours: &Neighbours,
) -> Result<Vec<[IVec3; 2]>, EvolverError> {
    let mut images = vec![[IVec3::ZERO; 2]; surface.facets.len()];
    if surface.periods.is_none() {
        return Ok(images);
    }
    let mut found = vec![[false; 2]; surface.facets.len()];
    for start in surface.facets.ids() {
        for side in 0..2 {
            if surface.facets[start].bodies[side].is_some() && !found[start.index()][side] {
                follow(surface, neighbours, (start, side), &mut images, &mut found);
            }
        }
    }
    Ok(images)
}

fn follow(
    surface: &Surface,
    neighbours: &Neighbours,
    start: Sided,
    images: &mut [[IVec3; 2]],
    found: &mut [[bool; 2]],
) {
    let Some(body) = surface.facets[start.0].bodies[start.1] else { return };
    // A body of several pieces gets each of them where its facets stand.
    found[start.0.index()][start.1] = true;
    let mut queue = vec![start];
    while let Some((facet, side)) = queue.pop() {
        for at in 0..surface.facets[facet].edges.len() {
            let Some((next, next_at)) = across(surface, neighbours, body, (facet, side), at) else {
                continue;
            };
            if found[next.0.index()][next.1] {
                continue;
            }
            found[next.0.index()][next.1] = true;
            let here = images[facet.index()][side] + edge_frame(surface, facet, at);
            images[next.0.index()][next.1] = here - edge_frame(surface, next.0, next_at);
            queue.push(next);
        }
    }
}

/// Where the tail of a facet's edge lies in the facet's frame, in periods.
fn edge_frame(surface: &Surface, facet: FacetId, at: usize) -> IVec3 {
    let mut wrap = IVec3::ZERO;
    for &directed in &surface.facets[facet].edges[..at] {
        wrap += surface.wrap(directed);
    }
    let directed = surface.facets[facet].edges[at];
    if directed.reversed { wrap + surface.wrap(directed) } else { wrap }
}

/// The side of the same body that follows across an edge.
fn across(
    surface: &Surface,
    neighbours: &Neighbours,
    body: BodyId,
    here: Sided,
    at: usize,
) -> Option<(Sided, usize)> {
    let edge = surface.facets[here.0].edges[at].edge;
    let sides: Vec<(Sided, usize)> = neighbours.facets[edge]
        .iter()
        .flat_map(|&(facet, place)| (0..2).map(move |side| ((facet, side), place)))
        .filter(|((facet, side), _)| surface.facets[*facet].bodies[*side] == Some(body))
        .filter(|(other, place)| (*other, *place) != (here, at))
        .collect();
    if let [only] = sides[..] {
        return Some(only);
    }
    // The facet that comes next round the edge on this side, seen from the edge's own direction.
    let along = surface.side(Directed { edge, reversed: false });
    let own = inward(surface, here.0, at, along);
    let turn = sense(surface, here, at);
    sides
        .into_iter()
        .filter(|(other, place)| sense(surface, *other, *place) != turn)
        .map(|(other, place)| {
            let angle = angle(own, inward(surface, other.0, place, along), along);
            let angle = if turn { angle } else { std::f64::consts::TAU - angle };
            (if angle <= 1e-12 { std::f64::consts::TAU } else { angle }, (other, place))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, next)| next)
}

/// Whether the body lies to the left of the facet, seen against the edge's direction.
fn sense(surface: &Surface, (facet, side): Sided, at: usize) -> bool {
    surface.facets[facet].edges[at].reversed == (side == 0)
}

/// The direction from an edge into a facet, across the edge.
fn inward(surface: &Surface, facet: FacetId, at: usize, along: DVec3) -> DVec3 {
    let edges = &surface.facets[facet].edges;
    let next = edges[(at + 1) % edges.len()];
    let out = if edges[at].reversed { surface.side(edges[at]) } else { DVec3::ZERO };
    // From the edge's tail or head to the far corner: either has the same part across the edge.
    let far = surface.side(next) + out;
    let unit = along.normalize_or_zero();
    far - far.dot(unit) * unit
}

/// The angle from `a` to `b` counter-clockwise about `axis`, in [0, 2π).
fn angle(a: DVec3, b: DVec3, axis: DVec3) -> f64 {
    let unit = axis.normalize_or_zero();
    let angle = unit.dot(a.cross(b)).atan2(a.dot(b));
    if angle < 0.0 { angle + std::f64::consts::TAU } else { angle }
}
