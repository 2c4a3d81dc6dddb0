//! Volumes of regions, with the walls' share integrated on the walls themselves.
//!
//! A region is bounded by films and by patches of walls. With its origin `o` the films give the polynomial cone sums
//! `⅓∫ (x − o)·N`. A film's edge on a wall is a quadratic curve with its nodes on the wall and lies only near it in between;
//! the wall itself is reached from there along a fixed field of directions (`wall.rs`). For a *reference* position of all
//! wall edges the patch between the foot of the region's anchor and its outline is integrated once as a fan (`reference.rs`);
//! what has changed since is the strip between the reference edge and the present one, for which gradient and Hessian are
//! exact and need no more than second derivatives of the wall's level function.
//!
//! Planes that cut the gap off need no integral: the origin of a region that ends at some lies on all of them.
//!
//! Both regions beside a film see the same strip with opposite signs, so the sum of all volumes cannot drift.

mod reference;
mod wall;

pub use reference::Reference;
pub(crate) use wall::{StripLoads, WallEdge};

use super::{
    complex::{Complex, Places, RegionId, Shape},
    energy::jet,
};
use crate::index::IndexVec;
use glam::DVec3;
use rayon::prelude::*;

/// `⅓∫ (x − o)·N` over an element.
#[must_use]
pub(crate) fn element_cone(shape: Shape, nodes: &[DVec3], origin: DVec3) -> f64 {
    shape
        .points()
        .iter()
        .map(|point| {
            let (x, a, b) = jet(point, nodes);
            point.weight * (x - origin).dot(a.cross(b)) / 3.0
        })
        .sum()
}

/// The volumes of all regions (of the open air: what is missing from it, negative).
///
/// Not a number where a wall is not found from a film's edge.
#[must_use]
pub fn volumes(complex: &Complex, places: &Places, reference: &Reference) -> IndexVec<RegionId, f64> {
    let shares: Vec<[f64; 2]> = complex
        .films
        .as_slice()
        .par_iter()
        .map(|film| {
            let origins = reference.origins(complex, film);
            let mut share = [0.0; 2];
            for element in &film.elements {
                let nodes: Vec<DVec3> =
                    element.nodes.iter().map(|&image| complex.place(places, image)).collect();
                for (side, sign) in [(0, 1.0), (1, -1.0)] {
                    share[side] += sign * element_cone(element.shape, &nodes, origins[side]);
                }
                for (wall, edge) in complex.wall_edges(element) {
                    let strip = WallEdge::new(complex, reference, element, &nodes, wall, edge);
                    let values = strip.value(origins);
                    share[0] -= values[0];
                    share[1] += values[1];
                }
            }
            share
        })
        .collect();
    let mut volumes = reference.offsets().clone();
    for (film, share) in complex.films.iter().zip(shares) {
        volumes[film.back.region] += share[0];
        volumes[film.front.region] += share[1];
    }
    volumes
}
