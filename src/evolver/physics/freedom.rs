//! How vertices may move: on constraints, on boundaries, fixed; and the normals along which Newton steps move them.

use super::{
    Places,
    problem::{Problem, Wall},
};
use crate::{
    evolver::{
        datafile::{Representation, Side},
        surface::{BoundaryId, ConstraintId, Directed, Neighbours, Surface, VertexId},
    },
    index::{Id, IndexVec},
};
use glam::{DMat3, DVec3};

/// What holds a vertex.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    /// It does not move.
    Fixed,
    /// It moves on these constraints.
    On(Vec<ConstraintId>),
    /// It moves on a boundary by its parameters.
    Boundary(BoundaryId),
}

/// Everything that moves: places, boundary parameters, and which one-sided constraints are touched.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) places: Places,
    pub(crate) parameters: IndexVec<VertexId, [f64; 2]>,
    /// One bit for each constraint of the vertex that is one-sided and touched.
    pub(crate) hits: IndexVec<VertexId, u32>,
}

/// Steps and tolerance of the return to constraints: those of Surface Evolver, so that both stop at the same place.
const STEPS: usize = 10;
const TOLERANCE: f64 = 1e-12;

impl State {
    pub(crate) fn new(surface: &Surface) -> Self {
        let hits = surface.vertices.iter().map(|vertex| {
            vertex.common.constraints.iter().enumerate().fold(0, |bits, (at, constraint)| {
                bits | (u32::from(vertex.hit.contains(constraint)) << at.min(31))
            })
        });
        Self {
            places: surface.vertices.iter().map(|vertex| vertex.position).collect(),
            parameters: surface.vertices.iter().map(|vertex| vertex.parameters).collect(),
            hits: hits.collect(),
        }
    }

    /// Writes the state back into the surface.
    pub(crate) fn store(&self, surface: &mut Surface) {
        for (id, vertex) in surface.vertices.as_mut_slice().iter_mut().enumerate() {
            let id = VertexId::from_index(id);
            vertex.position = self.places[id];
            vertex.parameters = self.parameters[id];
            let bits = self.hits[id];
            vertex.hit = vertex
                .common
                .constraints
                .iter()
                .enumerate()
                .filter(|(at, _)| bits >> (*at).min(31) & 1 == 1)
                .map(|(_, constraint)| *constraint)
                .collect();
        }
    }
}

/// Gradients of the constraints that hold a vertex now: at most three.
fn active<'a>(
    problem: &'a Problem,
    constraints: &'a [ConstraintId],
    hits: u32,
) -> impl Iterator<Item = &'a Wall> + 'a {
    constraints.iter().enumerate().filter_map(move |(at, &id)| {
        let wall = &problem.walls[id];
        (wall.side == Side::On || hits >> at.min(31) & 1 == 1).then_some(wall)
    })
}

/// An orthonormal basis of the span of `gradients`.
fn orthonormal(gradients: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
    let mut basis: Vec<DVec3> = Vec::new();
    for gradient in gradients {
        let size = gradient.length();
        let rest = basis.iter().fold(gradient, |rest, &b| rest - rest.dot(b) * b);
        if rest.length() > 1e-10 * size {
            basis.push(rest / rest.length());
        }
    }
    basis
}

impl Problem {
    /// `vector` without its part against the constraints that hold a vertex; on a boundary, the velocity of its parameters.
    pub(crate) fn projected(&self, state: &State, vertex: VertexId, vector: DVec3) -> DVec3 {
        match &self.holds[vertex] {
            Hold::Fixed => DVec3::ZERO,
            Hold::On(constraints) if constraints.is_empty() => vector,
            Hold::On(constraints) => {
                let p = state.places[vertex];
                let walls = active(self, constraints, state.hits[vertex]);
                orthonormal(walls.map(|wall| wall.formula.jet(p).gradient))
                    .into_iter()
                    .fold(vector, |rest, n| rest - rest.dot(n) * n)
            }
            Hold::Boundary(boundary) => {
                let [u, v] = self.boundary_tangents(*boundary, state.parameters[vertex]);
                DVec3::new(u.dot(vector), v.dot(vector), 0.0)
            }
        }
    }

    /// The derivatives of a boundary's place by its parameters.
    fn boundary_tangents(&self, boundary: BoundaryId, [p, q]: [f64; 2]) -> [DVec3; 2] {
        let jets = self.boundaries[boundary].each_ref().map(|bound| bound.jet(DVec3::new(p, q, 0.0)));
        [0, 1].map(|axis| DVec3::from_array(jets.map(|jet| jet.gradient[axis])))
    }

    /// The place on a boundary.
    pub(crate) fn boundary_place(&self, boundary: BoundaryId, [p, q]: [f64; 2]) -> DVec3 {
        DVec3::from_array(
            self.boundaries[boundary].each_ref().map(|bound| bound.value(DVec3::new(p, q, 0.0))),
        )
    }

    /// Moves one vertex by `scale` times its velocity (see [`Problem::projected`]), without the return to constraints.
    pub(crate) fn push(&self, state: &mut State, vertex: VertexId, velocity: DVec3, scale: f64) {
        match &self.holds[vertex] {
            Hold::Fixed => {}
            Hold::On(_) => state.places[vertex] += scale * velocity,
            Hold::Boundary(boundary) => {
                let parameters = &mut state.parameters[vertex];
                parameters[0] += scale * velocity.x;
                parameters[1] += scale * velocity.y;
                state.places[vertex] = self.boundary_place(*boundary, *parameters);
            }
        }
    }

    /// Brings a vertex back onto its constraints; `reset` forgets which one-sided ones it touched. False if it does not
    /// get there.
    pub(crate) fn settle(&self, state: &mut State, vertex: VertexId, reset: bool) -> bool {
        let Hold::On(constraints) = &self.holds[vertex] else { return true };
        if constraints.is_empty() {
            return true;
        }
        let mut hits = if reset { 0 } else { state.hits[vertex] };
        let mut p = state.places[vertex];
        for _ in 0..STEPS {
            let mut rows: Vec<(DVec3, f64)> = Vec::with_capacity(constraints.len());
            let mut total = 0.0;
            for (at, &id) in constraints.iter().enumerate() {
                let wall = &self.walls[id];
                let jet = wall.formula.jet(p);
                let free = match wall.side {
                    Side::On => false,
                    Side::NonNegative => jet.value > TOLERANCE,
                    Side::NonPositive => jet.value < -TOLERANCE,
                };
                let bit = 1 << at.min(31);
                if free && hits & bit == 0 {
                    continue;
                }
                if wall.side != Side::On {
                    hits |= bit;
                }
                total += jet.value.abs();
                rows.push((jet.gradient, jet.value));
            }
            state.hits[vertex] = hits;
            state.places[vertex] = p;
            if total < TOLERANCE {
                return true;
            }
            p -= least_motion(&rows);
        }
        state.places[vertex] = p;
        p.is_finite()
    }

    /// Brings all vertices back; the first that does not get there.
    pub(crate) fn settle_all(&self, state: &mut State, reset: bool) -> Result<(), VertexId> {
        for vertex in self.holds.ids() {
            if !self.settle(state, vertex, reset) {
                return Err(vertex);
            }
        }
        Ok(())
    }

    /// Lets go of the one-sided constraints that `forces` pull vertices away from.
    pub(crate) fn release(&self, state: &mut State, forces: &IndexVec<VertexId, DVec3>) {
        for (vertex, hold) in self.holds.enumerated() {
            let Hold::On(constraints) = hold else { continue };
            for (at, &id) in constraints.iter().enumerate() {
                let wall = &self.walls[id];
                let bit = 1 << at.min(31);
                if wall.side == Side::On || state.hits[vertex] & bit == 0 {
                    continue;
                }
                let along = forces[vertex].dot(wall.formula.jet(state.places[vertex]).gradient);
                let away = if wall.side == Side::NonNegative { along > 0.0 } else { along < 0.0 };
                if away {
                    state.hits[vertex] &= !bit;
                }
            }
        }
    }

    /// Puts all vertices on boundaries where their parameters say, fixed ones, too: the boundary itself may have changed.
    pub(crate) fn follow_boundaries(&self, surface: &Surface, state: &mut State) {
        for (id, vertex) in surface.vertices.enumerated() {
            if let Some(boundary) = vertex.common.boundary {
                state.places[id] = self.boundary_place(boundary, state.parameters[id]);
            }
        }
    }

    /// The second-order part of the return to constraints, and of a boundary's bend, under the gradient `force`: what is added
    /// to a vertex's own block of the Hessian, in its own directions.
    pub(super) fn bend(&self, state: &State, vertex: VertexId, force: DVec3, basis: &[DVec3]) -> DMat3 {
        let mut block = DMat3::ZERO;
        match &self.holds[vertex] {
            Hold::Fixed => {}
            Hold::On(constraints) => {
                let p = state.places[vertex];
                let jets: Vec<_> =
                    active(self, constraints, state.hits[vertex]).map(|wall| wall.formula.jet(p)).collect();
                let rows: Vec<(DVec3, f64)> =
                    jets.iter().map(|jet| (jet.gradient, jet.gradient.dot(force))).collect();
                for (jet, lambda) in jets.iter().zip(multipliers(&rows)) {
                    for (i, &a) in basis.iter().enumerate() {
                        for (j, &b) in basis.iter().enumerate() {
                            block.col_mut(j)[i] -= lambda * a.dot(jet.hessian * b);
                        }
                    }
                }
            }
            Hold::Boundary(boundary) => {
                let [p, q] = state.parameters[vertex];
                let jets =
                    self.boundaries[*boundary].each_ref().map(|bound| bound.jet(DVec3::new(p, q, 0.0)));
                for i in 0..basis.len().min(2) {
                    for j in 0..basis.len().min(2) {
                        block.col_mut(j)[i] +=
                            (0..3).map(|axis| force[axis] * jets[axis].hessian.col(j)[i]).sum::<f64>();
                    }
                }
            }
        }
        block
    }

    /// The directions in which a vertex may move, orthonormal, within the span of `normals` where they are given; on a
    /// boundary the derivatives by its parameters.
    pub(super) fn directions(
        &self,
        state: &State,
        vertex: VertexId,
        normals: Option<&[DVec3]>,
        plane: bool,
    ) -> Vec<DVec3> {
        match &self.holds[vertex] {
            Hold::Fixed => Vec::new(),
            Hold::Boundary(boundary) => {
                let [u, v] = self.boundary_tangents(*boundary, state.parameters[vertex]);
                if v.length_squared() > 0.0 { vec![u, v] } else { vec![u] }
            }
            Hold::On(constraints) => {
                let p = state.places[vertex];
                let mut held = orthonormal(
                    active(self, constraints, state.hits[vertex]).map(|wall| wall.formula.jet(p).gradient),
                );
                if plane {
                    held = orthonormal([DVec3::Z].into_iter().chain(held));
                }
                let wanted: &[DVec3] = normals.unwrap_or(&DVec3::AXES);
                let within = wanted.iter().map(|&w| held.iter().fold(w, |rest, &n| rest - rest.dot(n) * n));
                // A normal that the constraint nearly forbids is no freedom: a step along it would be wild.
                let mut basis: Vec<DVec3> = Vec::new();
                for w in within {
                    let rest = basis.iter().fold(w, |rest, &b| rest - rest.dot(b) * b);
                    if rest.length() > LEAST_SLANT {
                        basis.push(rest / rest.length());
                    }
                }
                basis
            }
        }
    }
}

/// The least sine between a normal and a constraint's normal for which the vertex keeps its freedom.
const LEAST_SLANT: f64 = 1e-6;

/// The least motion that changes the values of all rows by what they say.
fn least_motion(rows: &[(DVec3, f64)]) -> DVec3 {
    rows.iter().zip(multipliers(rows)).map(|((gradient, _), factor)| factor * *gradient).sum()
}

/// Factors `c` with `Σ cⱼ gⱼ·gᵢ = vᵢ`, by Gauss elimination of up to three rows; zero where rows depend on each other.
#[allow(clippy::needless_range_loop, reason = "elimination goes by rows and columns")]
fn multipliers(rows: &[(DVec3, f64)]) -> Vec<f64> {
    let n = rows.len().min(3);
    let mut matrix = [[0.0; 4]; 3];
    for (row, (gradient, value)) in matrix.iter_mut().zip(&rows[..n]) {
        for (entry, (other, _)) in row.iter_mut().zip(&rows[..n]) {
            *entry = gradient.dot(*other);
        }
        row[3] = *value;
    }
    let mut dropped = [false; 3];
    for pivot in 0..n {
        let size = rows[pivot].0.length_squared();
        if matrix[pivot][pivot] <= 1e-14 * size || size <= 0.0 {
            dropped[pivot] = true;
            continue;
        }
        for row in 0..n {
            if row != pivot && !dropped[row] {
                let factor = matrix[row][pivot] / matrix[pivot][pivot];
                for column in 0..4 {
                    matrix[row][column] -= factor * matrix[pivot][column];
                }
            }
        }
    }
    (0..rows.len()).map(|i| if i < n && !dropped[i] { matrix[i][3] / matrix[i][i] } else { 0.0 }).collect()
}

/// The normals of a surface at each vertex: one within a film, two where three films meet along a line, none (all directions)
/// where lines meet.
pub(super) fn normals(surface: &Surface, neighbours: &Neighbours) -> IndexVec<VertexId, Option<Vec<DVec3>>> {
    match surface.representation {
        Representation::Soapfilm => film_normals(surface, neighbours),
        Representation::String => string_normals(surface, neighbours),
    }
}

fn film_normals(surface: &Surface, neighbours: &Neighbours) -> IndexVec<VertexId, Option<Vec<DVec3>>> {
    let areas: IndexVec<crate::evolver::surface::FacetId, DVec3> =
        surface.facets.ids().map(|id| surface.area_vector(id)).collect();
    let mut middles: IndexVec<VertexId, Option<crate::evolver::surface::EdgeId>> =
        IndexVec::from_elem(None, surface.vertices.len());
    for (id, edge) in surface.edges.enumerated() {
        if let Some(middle) = edge.middle {
            middles[middle] = Some(id);
        }
    }
    surface
        .vertices
        .ids()
        .map(|id| {
            let around: &[_] = match &middles[id] {
                Some(edge) => std::slice::from_ref(edge),
                None => &neighbours.edges[id],
            };
            let lines: Vec<_> =
                around.iter().copied().filter(|&edge| neighbours.facets[edge].len() > 2).collect();
            let bare = around.iter().all(|&edge| neighbours.facets[edge].is_empty());
            if bare || lines.len() > 2 {
                return None;
            }
            if !lines.is_empty() {
                return Some(line_normals(surface, id, &lines));
            }
            let facets = match &middles[id] {
                Some(edge) => neighbours.facets[*edge].iter().map(|&(facet, _)| facet).collect(),
                None => neighbours.facets_at(id),
            };
            let &first = facets.first()?;
            // Neighbouring facets may be turned round: all are counted to the side of the first.
            let start = areas[first];
            let sum: DVec3 = facets
                .iter()
                .map(|&facet| if areas[facet].dot(start) < 0.0 { -areas[facet] } else { areas[facet] })
                .sum();
            (sum.length() > 0.0).then(|| vec![sum.normalize()])
        })
        .collect()
}

/// The two directions across the line that a vertex lies on.
fn line_normals(
    surface: &Surface,
    vertex: VertexId,
    lines: &[crate::evolver::surface::EdgeId],
) -> Vec<DVec3> {
    let outward = |edge: crate::evolver::surface::EdgeId| {
        let reversed = surface.edges[edge].ends[0] != vertex;
        surface.side(Directed { edge, reversed })
    };
    let middle = surface.vertices[vertex].middle;
    let tangent = match lines {
        [a, b] if !middle => outward(*a) - outward(*b),
        [a, ..] => surface.side(Directed { edge: *a, reversed: false }),
        [] => DVec3::ZERO,
    };
    if tangent.length() <= 0.0 {
        return DVec3::AXES.to_vec();
    }
    let (u, v) = tangent.normalize().any_orthonormal_pair();
    vec![u, v]
}

fn string_normals(surface: &Surface, neighbours: &Neighbours) -> IndexVec<VertexId, Option<Vec<DVec3>>> {
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
                return Some(vec![DVec3::Z.cross(tangent)]);
            }
            let (u, v) = tangent.any_orthonormal_pair();
            Some(vec![u, v])
        })
        .collect()
}
