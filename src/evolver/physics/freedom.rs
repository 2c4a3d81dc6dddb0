//! How vertices may move: on constraints, on boundaries, fixed; and the normals along which Newton steps move them.

use super::{Places, problem::Problem};
use crate::{
    evolver::{
        datafile::Side,
        surface::{BoundaryId, ConstraintId, Surface, VertexId, Wall, multipliers, return_to},
    },
    index::{Id, IndexVec},
};
use glam::{DMat3, DVec3};

/// What holds a vertex.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    /// Steps do not move it; it follows these constraints where they change.
    Fixed(Vec<ConstraintId>),
    /// It moves on these constraints.
    On(Vec<ConstraintId>),
    /// It moves on a boundary by its parameters.
    Boundary(BoundaryId),
}

impl Hold {
    /// The constraints of a vertex.
    pub(super) fn constraints(&self) -> &[ConstraintId] {
        match self {
            Self::Fixed(constraints) | Self::On(constraints) => constraints,
            Self::Boundary(_) => &[],
        }
    }
}

/// Everything that moves: places, boundary parameters, and which one-sided constraints are touched.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) places: Places,
    pub(crate) parameters: IndexVec<VertexId, [f64; 2]>,
    /// One bit for each constraint of the vertex that is one-sided and touched.
    pub(crate) hits: IndexVec<VertexId, u32>,
}

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

/// Up to three directions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Directions {
    count: u8,
    basis: [DVec3; 3],
}

impl Directions {
    /// These, of which there are at most three.
    pub(super) fn of(directions: &[DVec3]) -> Self {
        let mut all = Self::default();
        directions.iter().take(3).for_each(|&direction| all.push(direction));
        all
    }

    fn push(&mut self, direction: DVec3) {
        self.basis[usize::from(self.count)] = direction;
        self.count += 1;
    }

    pub(super) fn as_slice(&self) -> &[DVec3] {
        &self.basis[..usize::from(self.count)]
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
            Hold::Fixed(_) => DVec3::ZERO,
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
            Hold::Fixed(_) => {}
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
        let (Hold::On(constraints) | Hold::Fixed(constraints)) = &self.holds[vertex] else { return true };
        if constraints.is_empty() {
            return true;
        }
        let hits = if reset { 0 } else { state.hits[vertex] };
        let walls = constraints.iter().map(|&id| &self.walls[id]);
        let returned = return_to(walls, hits, state.places[vertex]);
        state.places[vertex] = returned.place;
        state.hits[vertex] = returned.hits;
        returned.finite
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

    /// Whether a vertex's motion is bent: by constraints or a boundary.
    pub(super) fn is_bent(&self, vertex: VertexId) -> bool {
        match &self.holds[vertex] {
            Hold::Fixed(_) => false,
            Hold::On(constraints) => !constraints.is_empty(),
            Hold::Boundary(_) => true,
        }
    }

    /// The second-order part of the return to constraints, and of a boundary's bend, under the gradient `force`: what is added
    /// to a vertex's own block of the Hessian, in its own directions.
    pub(super) fn bend(&self, state: &State, vertex: VertexId, force: DVec3, basis: &[DVec3]) -> DMat3 {
        let mut block = DMat3::ZERO;
        match &self.holds[vertex] {
            Hold::Fixed(_) => {}
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
        normals: Option<&Directions>,
        plane: bool,
    ) -> Directions {
        match &self.holds[vertex] {
            Hold::Fixed(_) => Directions::default(),
            Hold::Boundary(boundary) => {
                let [u, v] = self.boundary_tangents(*boundary, state.parameters[vertex]);
                let count = if v.length_squared() > 0.0 { 2 } else { 1 };
                Directions::of(&[u, v][..count])
            }
            Hold::On(constraints) if constraints.is_empty() && !plane => {
                normals.copied().unwrap_or_else(|| Directions::of(&DVec3::AXES))
            }
            Hold::On(constraints) => {
                let p = state.places[vertex];
                let mut held = orthonormal(
                    active(self, constraints, state.hits[vertex]).map(|wall| wall.formula.jet(p).gradient),
                );
                if plane {
                    held = orthonormal([DVec3::Z].into_iter().chain(held));
                }
                let wanted: &[DVec3] = normals.map_or(&DVec3::AXES, Directions::as_slice);
                let within = wanted.iter().map(|&w| held.iter().fold(w, |rest, &n| rest - rest.dot(n) * n));
                // A normal that the constraint nearly forbids is no freedom: a step along it would be wild.
                let mut basis = Directions::default();
                for w in within {
                    let rest = basis.as_slice().iter().fold(w, |rest, &b| rest - rest.dot(b) * b);
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
