//! The normals along which Newton steps move vertices: across films, and across lines where films meet.

use super::{Places, freedom::Directions, problem::Problem};
use crate::{
    evolver::{
        datafile::Representation,
        surface::{Directed, EdgeId, FacetId, Kind, Neighbours, Surface, VertexId, one_sided},
    },
    index::{Id, IndexVec},
};
use glam::DVec3;
use rayon::prelude::*;

/// The normals at each vertex: one within a film, two where three films meet along a line, `None` (all directions) where
/// lines meet.
pub(super) fn normals(
    problem: &Problem,
    places: &Places,
    surface: &Surface,
    neighbours: &Neighbours,
) -> IndexVec<VertexId, Option<Directions>> {
    match surface.representation {
        Representation::Soapfilm => film_normals(problem, places, surface, neighbours),
        Representation::String => string_normals(surface, neighbours),
    }
}

fn film_normals(
    problem: &Problem,
    places: &Places,
    surface: &Surface,
    neighbours: &Neighbours,
) -> IndexVec<VertexId, Option<Directions>> {
    let areas: Vec<DVec3> = problem
        .facets
        .par_iter()
        .map(|term| {
            let [a, b, c, ..] = term.places(places.as_slice());
            0.5 * (b - a).cross(c - b)
        })
        .collect();
    let areas: IndexVec<FacetId, DVec3> = areas.into();
    // Neighbouring facets may be turned round: each is counted to the side of those before.
    let mut sums = IndexVec::from_elem(DVec3::ZERO, surface.vertices.len());
    for (term, &area) in problem.facets.iter().zip(areas.iter()) {
        for &corner in &term.nodes[..3] {
            let sum = &mut sums[VertexId::from_index(corner as usize)];
            *sum = one_sided(*sum, area);
        }
    }
    let mut middles: IndexVec<VertexId, Option<EdgeId>> = IndexVec::from_elem(None, surface.vertices.len());
    for (id, edge) in surface.edges.enumerated() {
        let Some(middle) = edge.middle else { continue };
        middles[middle] = Some(id);
        sums[middle] =
            neighbours.facets[id].iter().map(|&(facet, _)| areas[facet]).fold(DVec3::ZERO, one_sided);
    }
    let normal_at = |id: VertexId| match neighbours.kinds[id] {
        Kind::Bare => None,
        Kind::Film => sums[id].try_normalize().map(|normal| Directions::of(&[normal])),
        Kind::Line => {
            let around: &[EdgeId] = match &middles[id] {
                Some(edge) => std::slice::from_ref(edge),
                None => &neighbours.edges[id],
            };
            let is_line = |edge: &EdgeId| neighbours.facets[*edge].len() > 2;
            let lines: Vec<EdgeId> = around.iter().copied().filter(is_line).collect();
            (lines.len() <= 2).then(|| line_normals(surface, id, &lines))
        }
    };
    let normals: Vec<_> =
        (0..surface.vertices.len()).into_par_iter().map(|at| normal_at(VertexId::from_index(at))).collect();
    normals.into()
}

/// The two directions across the line that a vertex lies on.
fn line_normals(surface: &Surface, vertex: VertexId, lines: &[EdgeId]) -> Directions {
    let outward = |edge: EdgeId| {
        let reversed = surface.edges[edge].ends[0] != vertex;
        surface.side(Directed { edge, reversed })
    };
    let middle = surface.vertices[vertex].middle;
    let tangent = match lines {
        [a, b] if !middle => outward(*a) - outward(*b),
        [a, ..] => surface.side(Directed { edge: *a, reversed: false }),
        [] => DVec3::ZERO,
    };
    let Some(tangent) = tangent.try_normalize() else { return Directions::of(&DVec3::AXES) };
    let (u, v) = tangent.any_orthonormal_pair();
    Directions::of(&[u, v])
}

fn string_normals(surface: &Surface, neighbours: &Neighbours) -> IndexVec<VertexId, Option<Directions>> {
    let mut tangents: IndexVec<VertexId, Option<DVec3>> = IndexVec::from_elem(None, surface.vertices.len());
    for (id, edge) in surface.edges.enumerated() {
        if let Some(middle) = edge.middle {
            tangents[middle] = Some(surface.side(Directed { edge: id, reversed: false }));
        }
    }
    for vertex in surface.vertices.ids() {
        if let [a, b] = neighbours.edges[vertex][..] {
            let outward =
                |edge| surface.side(Directed { edge, reversed: surface.edges[edge].ends[0] != vertex });
            tangents[vertex] = Some(outward(a) - outward(b));
        }
    }
    tangents
        .into_iter()
        .map(|tangent| {
            let tangent = (*tangent)?.try_normalize()?;
            if surface.dimension == 2 {
                return Some(Directions::of(&[DVec3::Z.cross(tangent)]));
            }
            let (u, v) = tangent.any_orthonormal_pair();
            Some(Directions::of(&[u, v]))
        })
        .collect()
}
