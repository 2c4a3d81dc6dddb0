//! The matrix of a Newton step: the Hessian of the Lagrangian between directions of motion, bordered by the gradients of the
//! held functionals.

use super::{
    carry::Velocity,
    freedom::{Directions, State},
    gradient::{Local, Weights},
    normals::normals,
    problem::{FunctionalId, Problem},
};
use crate::{
    evolver::surface::{Neighbours, Surface, VertexId},
    index::{Id, IndexVec, checked_u32},
};
use glam::DVec3;
use rayon::prelude::*;

/// The directions of a vertex and the first of its unknowns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Own {
    pub(super) first: u32,
    pub(super) along: Directions,
}

/// A matrix by its entries, with the right side of a step.
pub(super) struct Assembled {
    pub(super) directions: IndexVec<VertexId, Own>,
    pub(super) held: Vec<FunctionalId>,
    /// How many rows there are: directions, held functionals, and motions that are left out.
    pub(super) size: usize,
    /// Row and column of each entry, `row ≥ column`; places may come more than once.
    pub(super) entries: Vec<(u32, u32)>,
    pub(super) values: Vec<f64>,
    /// The gradient of the Lagrangian by unknown.
    pub(super) gradient: Vec<f64>,
    /// The entries, all zero, of the diagonal of the directions.
    pub(super) diagonal: std::ops::Range<usize>,
}

/// What the elements of a chunk add.
#[derive(Default)]
pub(super) struct Share {
    entries: Vec<(u32, u32)>,
    values: Vec<f64>,
    forces: Vec<(u32, DVec3)>,
}

impl Share {
    /// With room for what elements of these nodes add.
    pub(super) fn with_room<'a>(
        elements: impl Iterator<Item = &'a [u32]>,
        directions: &IndexVec<VertexId, Own>,
    ) -> Self {
        let (mut entries, mut forces) = (0, 0);
        for nodes in elements {
            let own = |&node: &u32| directions[VertexId::from_index(node as usize)].along.as_slice().len();
            let all: usize = nodes.iter().map(own).sum();
            entries += all * (all + 1) / 2;
            forces += nodes.len();
        }
        Self {
            entries: Vec::with_capacity(entries),
            values: Vec::with_capacity(entries),
            forces: Vec::with_capacity(forces),
        }
    }

    fn push(&mut self, row: u32, column: u32, value: f64) {
        self.entries.push((row.max(column), row.min(column)));
        self.values.push(value);
    }

    /// Adds an element's gradient and the blocks between its nodes.
    pub(super) fn add(&mut self, local: &Local, directions: &IndexVec<VertexId, Own>) {
        let nodes = &local.nodes[..local.count];
        for (i, &a) in nodes.iter().enumerate() {
            self.forces.push((a, local.gradient[i]));
            let of_a = &directions[VertexId::from_index(a as usize)];
            for (j, &b) in nodes.iter().enumerate().take(i + 1) {
                let of_b = &directions[VertexId::from_index(b as usize)];
                let block = local.hessian.block(i, j);
                // One vertex twice in an element, as over a torus, counts in both orders.
                let twice = a == b && i != j;
                for (s, &u) in (of_a.first..).zip(of_a.along.as_slice()) {
                    for (t, &w) in (of_b.first..).zip(of_b.along.as_slice()) {
                        if a == b && s < t {
                            continue;
                        }
                        let both = if twice { w.dot(block * u) } else { 0.0 };
                        self.push(s, t, u.dot(block * w) + both);
                    }
                }
            }
        }
    }
}

/// Where a Newton step starts, and what it may move.
#[derive(Clone, Copy)]
pub(crate) struct Start<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) surface: &'a Surface,
    pub(crate) neighbours: &'a Neighbours,
    pub(crate) state: &'a State,
    pub(crate) multipliers: &'a IndexVec<FunctionalId, f64>,
    /// Whether vertices move along the normals of the films only.
    pub(crate) normal: bool,
    /// Motions to which steps are at right angles.
    pub(crate) still: &'a [Velocity],
}

impl Assembled {
    pub(super) fn new(start: &Start<'_>) -> Self {
        let &Start { problem, surface, neighbours, state, multipliers, normal, still } = start;
        let along = normal.then(|| normals(problem, &state.places, surface, neighbours));
        let plane = surface.dimension == 2;
        let used = used_vertices(surface);
        let directions_of = |at: usize| {
            let vertex = VertexId::from_index(at);
            let along = along.as_ref().and_then(|along| along[vertex].as_ref());
            if used[at] { problem.directions(state, vertex, along, plane) } else { Directions::default() }
        };
        let all: Vec<Directions> = (0..problem.holds.len()).into_par_iter().map(directions_of).collect();
        let mut freedoms = 0;
        let own = |along: Directions| {
            let first = checked_u32(freedoms);
            freedoms += along.as_slice().len();
            Own { first, along }
        };
        let directions: IndexVec<VertexId, Own> = all.into_iter().map(own).collect();
        let held = problem.held();
        let mut assembled = Self {
            directions,
            size: freedoms + held.len() + still.len(),
            held,
            entries: Vec::new(),
            values: Vec::new(),
            gradient: vec![0.0; freedoms],
            diagonal: 0..0,
        };
        assembled.elements(problem, state, multipliers);
        assembled.constrain(problem, state);
        for (at, motion) in still.iter().enumerate() {
            assembled.leave_out(assembled.size - still.len() + at, motion);
        }
        let start = assembled.entries.len();
        for at in 0..checked_u32(assembled.size) {
            assembled.push(at, at, 0.0);
        }
        assembled.diagonal = start..start + freedoms;
        assembled
    }

    fn push(&mut self, row: u32, column: u32, value: f64) {
        self.entries.push((row, column));
        self.values.push(value);
    }

    /// The shares of all elements, and what bent constraints add under the forces.
    fn elements(&mut self, problem: &Problem, state: &State, multipliers: &IndexVec<FunctionalId, f64>) {
        let weights = Weights::lagrangian(problem, multipliers);
        let mut forces: IndexVec<VertexId, DVec3> = IndexVec::from_elem(DVec3::ZERO, problem.holds.len());
        let shares = problem.shares(&state.places, &weights, &self.directions);
        let entries = shares.iter().map(|share| share.entries.len()).sum();
        self.entries.reserve(entries);
        self.values.reserve(entries);
        for share in shares {
            self.entries.extend(share.entries);
            self.values.extend(share.values);
            for (vertex, force) in share.forces {
                forces[VertexId::from_index(vertex as usize)] += force;
            }
        }
        for (vertex, &force) in forces.enumerated() {
            let Own { first, along } = self.directions[vertex];
            let along = along.as_slice();
            for (s, &u) in (first..).zip(along) {
                self.gradient[s as usize] += force.dot(u);
            }
            if along.is_empty() || !problem.is_bent(vertex) {
                continue;
            }
            let bend = problem.bend(state, vertex, force, along);
            for s in 0..along.len() {
                for t in 0..=s {
                    self.push(first + checked_u32(s), first + checked_u32(t), bend.col(t)[s]);
                }
            }
        }
    }

    /// A row that keeps steps at right angles to a motion.
    fn leave_out(&mut self, row: usize, motion: &Velocity) {
        for (vertex, &velocity) in motion.enumerated() {
            let Own { first, along } = self.directions[vertex];
            for (s, &u) in (first..).zip(along.as_slice()) {
                self.push(checked_u32(row), s, velocity.dot(u));
            }
        }
    }

    /// The gradients of the held functionals.
    fn constrain(&mut self, problem: &Problem, state: &State) {
        let slots = problem.functional_gradients(&state.places);
        let mut rows = IndexVec::from_elem(None, problem.functionals.len());
        for (at, &id) in self.held.iter().enumerate() {
            rows[id] = Some(checked_u32(self.gradient.len() + at));
        }
        for vertex in problem.holds.ids() {
            let Own { first, along } = self.directions[vertex];
            for (id, gradient) in slots.at(vertex) {
                let Some(row) = rows[id] else { continue };
                for (s, &u) in (first..).zip(along.as_slice()) {
                    self.push(row, s, -gradient.dot(u));
                }
            }
        }
    }
}

fn used_vertices(surface: &Surface) -> Vec<bool> {
    let mut used = vec![false; surface.vertices.len()];
    for edge in &surface.edges {
        for vertex in edge.ends.into_iter().chain(edge.middle) {
            used[vertex.index()] = true;
        }
    }
    used
}
