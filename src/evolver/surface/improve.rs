//! Better triangles: swaps of edges by Delaunay's criterion, and averages of vertices, as Surface Evolver's `u` and `V`.

use super::{Directed, EdgeId, FacetId, Neighbours, Surface, VertexId};
use crate::{
    evolver::datafile::{Model, Representation},
    index::Id,
};
use glam::DVec3;

/// The part of the way to the mean that a vertex goes: less than the whole, so that neighbours do not swing past each other.
const STEP: f64 = 0.25;

/// The sum of cosines below which an edge is swapped; a little below zero so that equal squares do not swap for ever.
const SWAP: f64 = -0.001;

impl Surface {
    /// Swaps every edge once where Delaunay's criterion asks for it. How many were swapped.
    pub(crate) fn equiangulate(&mut self) -> usize {
        let mut neighbours = self.neighbours();
        let edges: Vec<EdgeId> = self.edges.ids().collect();
        edges.into_iter().filter(|&edge| self.equiangulate_edge(edge, &mut neighbours)).count()
    }

    /// Swaps an edge if that makes its two triangles more equal.
    pub(crate) fn equiangulate_edge(&mut self, edge: EdgeId, neighbours: &mut Neighbours) -> bool {
        if !self.swappable(edge, neighbours) {
            return false;
        }
        let [(f, at_f), (g, at_g)] = neighbours.facets[edge][..] else { return false };
        let a = self.chord(edge);
        let others = |facet: FacetId, at: usize| {
            let edges = &self.facets[facet].edges;
            (self.chord(edges[(at + 1) % 3].edge), self.chord(edges[(at + 2) % 3].edge))
        };
        let ((b, c), (d, e)) = (others(f, at_f), others(g, at_g));
        if b * c <= 0.0 || d * e <= 0.0 {
            return false;
        }
        let cosines = (b * b + c * c - a * a) / b / c + (d * d + e * e - a * a) / d / e;
        cosines <= SWAP && self.swap(edge, neighbours)
    }

    /// Whether two facets of one kind meet at an edge that may change.
    fn swappable(&self, edge: EdgeId, neighbours: &Neighbours) -> bool {
        let data = &self.edges[edge];
        let [(f, _), (g, _)] = neighbours.facets[edge][..] else { return false };
        if self.representation == Representation::String || data.common.fixed || f == g {
            return false;
        }
        let (first, second) = (&self.facets[f], &self.facets[g]);
        let same = |a: &[super::ConstraintId], b: &[super::ConstraintId]| {
            a.len() == b.len() && a.iter().all(|c| b.contains(c))
        };
        (first.tension - second.tension).abs() <= 1e-10
            && [first, second].iter().all(|facet| {
                same(&facet.common.constraints, &data.common.constraints)
                    && facet.common.boundary == data.common.boundary
            })
    }

    /// Turns an edge within the quadrilateral of its two triangles.
    pub(crate) fn swap(&mut self, edge: EdgeId, neighbours: &mut Neighbours) -> bool {
        let [(f, at_f), (g, at_g)] = neighbours.facets[edge][..] else { return false };
        if f == g || self.representation == Representation::String {
            return false;
        }
        let own = self.facets[f].edges[at_f];
        let b = self.facets[f].edges[(at_f + 1) % 3];
        let c = self.facets[f].edges[(at_f + 2) % 3];
        // The other facet, seen as running along the edge the other way.
        let other = self.facets[g].edges[at_g];
        let (d, e) = (self.facets[g].edges[(at_g + 1) % 3], self.facets[g].edges[(at_g + 2) % 3]);
        let turned = other.reversed == own.reversed;
        let (d, e) = if turned { (e.turned(), d.turned()) } else { (d, e) };
        // `own` leads from P to Q; b from Q to R, c from R to P; d from P to S, e from S to Q.
        let (r, s) = (self.head(b), self.head(d));
        if r == s && self.wrap(b) + self.wrap(own) == self.wrap(d) {
            return false;
        }
        let joined = neighbours.edges[r].iter().any(|&candidate| {
            let wrap = self.wrap(own) + self.wrap(b) - self.wrap(d);
            let data = &self.edges[candidate];
            (data.ends == [s, r] && data.wrap == wrap) || (data.ends == [r, s] && data.wrap == -wrap)
        });
        if joined {
            return false;
        }
        let ends = self.edges[edge].ends;
        for end in ends {
            neighbours.edges[end].retain(|&other| other != edge);
        }
        // The edge now leads from S to R.
        let wrap = -self.wrap(d) + self.wrap(own) + self.wrap(b);
        let data = &mut self.edges[edge];
        data.ends = [s, r];
        data.wrap = wrap;
        let middle = data.middle;
        neighbours.edges[s].push(edge);
        neighbours.edges[r].push(edge);
        let up = Directed { edge, reversed: false };
        // One triangle keeps c and d, the other b and e.
        let first = vec![up, c, d];
        let second = vec![up.turned(), e, b];
        let second = if turned { second.iter().rev().map(|d| d.turned()).collect() } else { second };
        self.facets[f].edges = first;
        self.facets[g].edges = second;
        for side in [edge, b.edge, c.edge, d.edge, e.edge] {
            neighbours.facets[side].retain(|&(facet, _)| facet != f && facet != g);
        }
        for facet in [f, g] {
            for (at, directed) in self.facets[facet].edges.iter().enumerate() {
                neighbours.facets[directed.edge].push((facet, at));
            }
        }
        if let Some(middle) = middle {
            self.vertices[middle].position =
                self.vertices[s].position + 0.5 * self.side(Directed { edge, reversed: false });
        }
        true
    }

    /// Moves every free vertex towards the mean of its neighbours, within the surface and, by `tangent`, along its
    /// constraints. The caller brings vertices back onto bent ones.
    pub(crate) fn average(&mut self, only: Option<&[VertexId]>, tangent: &dyn Fn(VertexId, DVec3) -> DVec3) {
        let neighbours = self.neighbours();
        let areas: Vec<f64> = self.facets.ids().map(|id| self.area_vector(id).length()).collect();
        let chosen = |id: VertexId| only.is_none_or(|only| only.contains(&id));
        let moved: Vec<(VertexId, DVec3)> = self
            .vertices
            .ids()
            .filter(|&id| chosen(id) && !self.vertices[id].middle)
            .filter_map(|id| self.averaged(id, &neighbours, &areas, tangent).map(|step| (id, step)))
            .collect();
        let mut steps = vec![DVec3::ZERO; self.vertices.len()];
        for (id, step) in moved {
            self.vertices[id].position += step;
            steps[id.index()] = step;
        }
        if self.model == Model::Quadratic {
            self.average_middles(&steps, &neighbours);
        }
    }

    /// Middles go to the middle of their chords, at their height above them.
    fn average_middles(&mut self, steps: &[DVec3], neighbours: &Neighbours) {
        for id in self.edges.ids() {
            let edge = &self.edges[id];
            let Some(middle) = edge.middle else { continue };
            let common = &self.vertices[middle].common;
            if common.fixed || common.boundary.is_some() {
                continue;
            }
            let whole = Directed { edge: id, reversed: false };
            let chord = self.vertices[edge.ends[0]].position + 0.5 * self.side(whole);
            let normal = neighbours.facets[id].first().map(|&(facet, _)| self.area_vector(facet));
            let along = edge.ends.iter().map(|end| 0.5 * steps[end.index()]).sum::<DVec3>();
            let place = self.vertices[middle].position + along;
            let normal = normal.and_then(DVec3::try_normalize);
            let height = normal.map_or(place - chord, |n| (place - chord).dot(n) * n);
            self.vertices[middle].position = chord + height;
        }
    }

    /// The step of one vertex towards the mean of its neighbours; `None` if it stays.
    fn averaged(
        &self,
        id: VertexId,
        neighbours: &Neighbours,
        areas: &[f64],
        tangent: &dyn Fn(VertexId, DVec3) -> DVec3,
    ) -> Option<DVec3> {
        let vertex = &self.vertices[id];
        if vertex.common.fixed || vertex.common.boundary.is_some() {
            return None;
        }
        let films = self.representation == Representation::Soapfilm;
        let usable: Vec<(EdgeId, usize)> = neighbours.edges[id]
            .iter()
            .filter(|&&edge| {
                let on = &self.edges[edge].common.constraints;
                vertex.common.constraints.iter().all(|constraint| on.contains(constraint))
            })
            .map(|&edge| (edge, neighbours.facets[edge].len()))
            .collect();
        let lines: Vec<(EdgeId, usize)> =
            usable.iter().copied().filter(|&(_, count)| films && count > 2).collect();
        let ends: Vec<(EdgeId, usize)> =
            usable.iter().copied().filter(|&(_, count)| films && count == 1).collect();
        // Along a line of films or their end only its own neighbours count, and all the same.
        let (taken, even) = if lines.len() >= 3 {
            return None;
        } else if !lines.is_empty() {
            (lines, true)
        } else if !ends.is_empty() {
            (ends, true)
        } else {
            (usable, !films)
        };
        if taken.len() < 2 {
            return None;
        }
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (edge, _) in &taken {
            let weight = if even {
                1.0
            } else {
                neighbours.facets[*edge].iter().map(|&(facet, _)| areas[facet.index()]).sum()
            };
            let reversed = self.edges[*edge].ends[0] != id;
            sum += weight * weight * self.side(Directed { edge: *edge, reversed });
            total += weight * weight;
        }
        if total <= 0.0 {
            return None;
        }
        let normals = self.normals_at(id, neighbours, &taken)?;
        let within = |v: DVec3| normals.iter().fold(v, |rest, &n| rest - rest.dot(n) * n);
        let step = if vertex.common.constraints.is_empty() {
            within(sum)
        } else {
            tangent(id, within(tangent(id, sum)))
        };
        Some(STEP / total * step)
    }

    /// The normals along which an averaged vertex must not move; `None` where it must not move at all.
    fn normals_at(
        &self,
        id: VertexId,
        neighbours: &Neighbours,
        taken: &[(EdgeId, usize)],
    ) -> Option<Vec<DVec3>> {
        let outward = |edge: EdgeId| self.side(Directed { edge, reversed: self.edges[edge].ends[0] != id });
        let line = self.representation == Representation::String
            || taken.iter().any(|&(edge, _)| neighbours.facets[edge].len() > 2);
        if line {
            let [(a, _), (b, _)] = taken[..] else { return None };
            let tangent = (outward(a) - outward(b)).try_normalize()?;
            let (u, v) = tangent.any_orthonormal_pair();
            return Some(vec![u, v]);
        }
        let sum = neighbours
            .facets_at(id)
            .iter()
            .map(|&facet| self.area_vector(facet))
            .fold(DVec3::ZERO, one_sided);
        Some(sum.try_normalize().into_iter().collect())
    }
}

/// The sum with one more vector, turned to the side of the sum: neighbouring facets may be turned round.
pub(crate) fn one_sided(sum: DVec3, next: DVec3) -> DVec3 {
    if sum.dot(next) < 0.0 { sum - next } else { sum + next }
}
