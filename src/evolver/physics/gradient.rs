//! Gradients of the energy and of the functionals, by vertex; and the Lagrangian's blocks, element by element.

use super::{
    Places,
    assemble::{Own, Share},
    edge::{self, EdgeField},
    facet::FacetField,
    problem::{Destination, EDGE_CHUNK, EdgePart, FunctionalId, Part, Problem, Term, shifted},
};
use crate::{
    evolver::surface::VertexId,
    foam::energy::Blocks,
    index::{Id, IndexVec},
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Which functionals depend on which vertex, vertex after vertex.
#[derive(Debug)]
struct SlotPattern {
    starts: Vec<u32>,
    ids: Vec<FunctionalId>,
}

/// The gradients of the functionals at the vertices that they depend on.
#[derive(Clone, Debug)]
pub(crate) struct Slots {
    pattern: Arc<SlotPattern>,
    pub(crate) values: Vec<DVec3>,
}

impl Slots {
    /// The places of a vertex's entries.
    pub(crate) fn range(&self, vertex: usize) -> std::ops::Range<usize> {
        self.pattern.starts[vertex] as usize..self.pattern.starts[vertex + 1] as usize
    }

    /// The functionals that depend on a vertex with their gradients there.
    pub(crate) fn at(&self, vertex: VertexId) -> impl Iterator<Item = (FunctionalId, DVec3)> + '_ {
        let range = self.range(vertex.index());
        self.pattern.ids[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    fn add(&mut self, vertex: u32, id: FunctionalId, value: DVec3) {
        for slot in self.range(vertex as usize) {
            if self.pattern.ids[slot] == id {
                self.values[slot] += value;
                return;
            }
        }
    }

    fn cleared(&self) -> Self {
        Self { pattern: Arc::clone(&self.pattern), values: vec![DVec3::ZERO; self.values.len()] }
    }
}

/// Gradients of the energy, couplings included, and of the held functionals.
#[derive(Clone, Debug)]
pub(crate) struct Gradients {
    pub(crate) energy: IndexVec<VertexId, DVec3>,
    pub(crate) functionals: Slots,
}

/// The factor of each destination in a sum of energy and functionals.
#[derive(Clone, Debug)]
pub(crate) struct Weights {
    pub(crate) energy: f64,
    pub(crate) functionals: IndexVec<FunctionalId, f64>,
}

impl Weights {
    /// The Lagrangian with these multipliers.
    pub(crate) fn lagrangian(problem: &Problem, multipliers: &IndexVec<FunctionalId, f64>) -> Self {
        let functionals = problem
            .functionals
            .enumerated()
            .map(|(id, functional)| functional.coupling - multipliers[id])
            .collect();
        Self { energy: 1.0, functionals }
    }

    fn of(&self, destination: Destination) -> f64 {
        match destination {
            Destination::Energy => self.energy,
            Destination::Functional(id) => self.functionals[id],
        }
    }
}

/// Where gradients are summed.
struct Sink {
    /// By vertex, where it is asked for.
    energy: Option<Vec<DVec3>>,
    functionals: Slots,
}

impl Sink {
    fn cleared(&self) -> Self {
        let energy = self.energy.as_ref().map(|energy| vec![DVec3::ZERO; energy.len()]);
        Self { energy, functionals: self.functionals.cleared() }
    }

    fn add_all(&mut self, parts: &[Self]) {
        let add = |sums: &mut [DVec3], of: &(dyn Fn(&Self) -> &[DVec3] + Sync)| {
            sums.par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(at, sum)| {
                *sum = parts.iter().map(|part| of(part)[at]).sum();
            });
        };
        if let Some(energy) = &mut self.energy {
            add(energy, &|part| part.energy.as_deref().unwrap_or_default());
        }
        add(&mut self.functionals.values, &|part| &part.functionals.values);
    }
}

/// The gradient and the Hessian of one element's share.
pub(super) struct Local {
    pub(super) nodes: [u32; 6],
    pub(super) count: usize,
    pub(super) gradient: [DVec3; 6],
    pub(super) hessian: Blocks,
}

impl Problem {
    /// The pattern of the functionals by vertex, with zero gradients.
    pub(crate) fn slots(&self) -> Slots {
        self.pattern.get_or_init(|| self.new_slots()).clone()
    }

    fn new_slots(&self) -> Slots {
        let held: Vec<bool> = self.functionals.iter().map(|functional| functional.target.is_some()).collect();
        let mut pairs: Vec<(u32, FunctionalId)> = Vec::new();
        let mut note = |nodes: &[u32], destination: Destination| {
            if let Destination::Functional(id) = destination
                && held[id.index()]
            {
                pairs.extend(nodes.iter().map(|&node| (node, id)));
            }
        };
        for term in &self.facets {
            self.facet_parts[term.parts()].iter().for_each(|part| note(term.nodes(), part.destination));
        }
        for term in &self.edges {
            self.edge_parts[term.parts()].iter().for_each(|part| note(term.nodes(), part.destination));
        }
        for point in &self.points {
            note(&[crate::index::checked_u32(point.vertex.index())], point.destination);
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; self.holds.len() + 1];
        for (node, _) in &pairs {
            starts[*node as usize + 1] += 1;
        }
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        let ids: Vec<FunctionalId> = pairs.into_iter().map(|(_, id)| id).collect();
        Slots { values: vec![DVec3::ZERO; ids.len()], pattern: Arc::new(SlotPattern { starts, ids }) }
    }

    /// The gradients at `places`; `slots` is a pattern of this problem.
    pub(crate) fn gradients(&self, places: &Places, slots: Slots) -> Gradients {
        let Sink { energy, functionals } = self.gradients_of(places, slots, true);
        Gradients { energy: energy.unwrap_or_default().into(), functionals }
    }

    /// The gradients of the held functionals alone.
    pub(crate) fn functional_gradients(&self, places: &Places) -> Slots {
        self.gradients_of(places, self.slots(), false).functionals
    }

    fn gradients_of(&self, places: &Places, mut slots: Slots, energy: bool) -> Sink {
        slots.values.fill(DVec3::ZERO);
        let mut sink = Sink { energy: energy.then(|| vec![DVec3::ZERO; places.len()]), functionals: slots };
        let places = places.as_slice();
        if self.facets.len() < PARTS * CHUNK {
            self.facet_gradients(&self.facets, places, &mut sink);
        } else {
            let parts = self.facets.par_chunks(self.facets.len().div_ceil(PARTS));
            let parts: Vec<Sink> = parts
                .map(|terms| {
                    let mut part = sink.cleared();
                    self.facet_gradients(terms, places, &mut part);
                    part
                })
                .collect();
            sink.add_all(&parts);
        }
        if self.edges.len() <= EDGE_CHUNK {
            self.edge_gradients(&self.edges, places, energy, &mut |nodes, local, destination| {
                self.pass(nodes, local, destination, &mut sink);
            });
        } else {
            let shares = self.edges.par_chunks(EDGE_CHUNK).map(|terms| {
                let mut shares = Vec::new();
                self.edge_gradients(terms, places, energy, &mut |nodes, local, destination| {
                    let (mut at, mut own) = ([0; 3], [DVec3::ZERO; 3]);
                    at[..nodes.len()].copy_from_slice(nodes);
                    own.copy_from_slice(&local[..3]);
                    shares.push((at, nodes.len(), own, destination));
                });
                shares
            });
            for (nodes, count, local, destination) in shares.collect::<Vec<_>>().into_iter().flatten() {
                self.pass(&nodes[..count], &local, destination, &mut sink);
            }
        }
        for point in &self.points {
            let slope = point.weight * point.field.jet(places[point.vertex.index()]).gradient;
            let node = [crate::index::checked_u32(point.vertex.index())];
            self.pass(&node, &[slope], point.destination, &mut sink);
        }
        sink
    }

    /// Gives the gradients of edges, part by part, to `pass`.
    fn edge_gradients(
        &self,
        terms: &[Term<3>],
        places: &[DVec3],
        energy: bool,
        pass: &mut dyn FnMut(&[u32], &[DVec3], Destination),
    ) {
        let mut local = [DVec3::ZERO; 6];
        for term in terms {
            let nodes = term.places(places);
            let nodes = &nodes[..usize::from(term.count)];
            if energy && term.tension.abs() > 0.0 {
                local.fill(DVec3::ZERO);
                EdgeField::Length.add(term.tension, self.rule(nodes.len()), nodes, &mut local, None);
                pass(term.nodes(), &local, Destination::Energy);
            }
            for part in self.edge_parts[term.parts()].iter().filter(|part| self.counts(part, energy)) {
                local.fill(DVec3::ZERO);
                self.edge_part(part, nodes, part.weight, &mut local, None);
                pass(term.nodes(), &local, part.destination);
            }
        }
    }

    /// Whether a part enters the gradients that are asked for.
    fn counts(&self, part: &Part, energy: bool) -> bool {
        match part.destination {
            Destination::Energy => energy,
            Destination::Functional(id) => {
                let functional = &self.functionals[id];
                functional.target.is_some() || (energy && functional.coupling.abs() > 0.0)
            }
        }
    }

    fn facet_gradients(&self, terms: &[Term<6>], places: &[DVec3], sink: &mut Sink) {
        let mut local = [DVec3::ZERO; 6];
        let energy = sink.energy.is_some();
        for term in terms {
            let nodes = term.places(places);
            let nodes = &nodes[..usize::from(term.count)];
            if energy && term.tension.abs() > 0.0 {
                local.fill(DVec3::ZERO);
                if let [a, b, c] = nodes {
                    // ∂|n|/∂a = (b − c) × n/|n| and round the corners; the area is half of |n|.
                    let n = (*b - *a).cross(*c - *a);
                    let unit = 0.5 * term.tension / n.length() * n;
                    for (out, far) in local.iter_mut().zip([*c - *b, *a - *c, *b - *a]) {
                        *out = unit.cross(far);
                    }
                } else {
                    FacetField::Area.add(term.tension, nodes, &mut local, None);
                }
                self.pass(term.nodes(), &local, Destination::Energy, sink);
            }
            for part in self.facet_parts[term.parts()].iter().filter(|part| self.counts(part, energy)) {
                local.fill(DVec3::ZERO);
                let field = &self.facet_fields[part.field as usize];
                match shifted(nodes, part.offset) {
                    Some(moved) => field.add(part.weight, &moved[..nodes.len()], &mut local, None),
                    None => field.add(part.weight, nodes, &mut local, None),
                }
                self.pass(term.nodes(), &local, part.destination, sink);
            }
        }
    }

    fn pass(&self, nodes: &[u32], local: &[DVec3], destination: Destination, sink: &mut Sink) {
        let mut to_energy = |factor: f64| {
            let Some(energy) = &mut sink.energy else { return };
            for (&node, &value) in nodes.iter().zip(local) {
                energy[node as usize] += factor * value;
            }
        };
        match destination {
            Destination::Energy => to_energy(1.0),
            Destination::Functional(id) => {
                let functional = &self.functionals[id];
                if functional.coupling.abs() > 0.0 {
                    to_energy(functional.coupling);
                }
                if functional.target.is_some() {
                    for (&node, &value) in nodes.iter().zip(local) {
                        sink.functionals.add(node, id, value);
                    }
                }
            }
        }
    }

    fn edge_part(
        &self,
        part: &Part,
        nodes: &[DVec3],
        factor: f64,
        gradient: &mut [DVec3; 6],
        hessian: Option<&mut Blocks>,
    ) {
        let count = nodes.len();
        let mut moved = [DVec3::ZERO; 3];
        for (to, from) in moved.iter_mut().zip(nodes) {
            *to = *from + part.offset;
        }
        match &self.edge_fields[part.field as usize] {
            EdgePart::Field(field) => {
                field.add(factor, self.rule(count), &moved[..count], gradient, hessian);
            }
            EdgePart::Gap(wall) => {
                edge::add_gap(factor, wall, nodes, gradient);
                if let Some(hessian) = hessian {
                    edge::add_gap_hessian(factor, wall, nodes, hessian);
                }
            }
            EdgePart::Sliver(sliver) => sliver.add(factor, nodes, gradient, hessian),
            EdgePart::Rim(rim) => rim.add(factor, nodes, gradient, hessian),
        }
    }

    /// Gradient and Hessian of every element's share of the weighted sum, chunk by chunk.
    pub(super) fn shares(
        &self,
        places: &Places,
        weights: &Weights,
        directions: &IndexVec<VertexId, Own>,
    ) -> Vec<Share> {
        let places = places.as_slice();
        let facets = self.facets.par_chunks(CHUNK).map(|terms| {
            let mut local = Local::default();
            let mut share = Share::with_room(terms.iter().map(Term::nodes), directions);
            for term in terms {
                if self.facet_local(term, places, weights, &mut local) {
                    share.add(&local, directions);
                }
            }
            share
        });
        let edges = self.edges.par_chunks(EDGE_CHUNK).map(|terms| {
            let mut local = Local::default();
            let mut share = Share::with_room(terms.iter().map(Term::nodes), directions);
            for term in terms {
                self.edge_local(term, places, weights, &mut local);
                share.add(&local, directions);
            }
            share
        });
        let mut shares: Vec<Share> = facets.collect();
        shares.extend(edges.collect::<Vec<Share>>());
        let (mut local, mut share) = (Local::default(), Share::default());
        for point in &self.points {
            let jet = point.field.jet(places[point.vertex.index()]);
            let factor = weights.of(point.destination) * point.weight;
            local.restart(&[crate::index::checked_u32(point.vertex.index())]);
            local.gradient[0] = factor * jet.gradient;
            local.hessian.add(0, 0, factor * jet.hessian);
            share.add(&local, directions);
        }
        shares.push(share);
        shares
    }

    /// Makes `local` the share of a facet; false where it has none.
    fn facet_local(&self, term: &Term<6>, places: &[DVec3], weights: &Weights, local: &mut Local) -> bool {
        let parts = &self.facet_parts[term.parts()];
        if term.tension.abs() <= 0.0 && parts.is_empty() {
            return false;
        }
        let nodes = term.places(places);
        let nodes = &nodes[..usize::from(term.count)];
        local.restart(term.nodes());
        if term.tension.abs() > 0.0 {
            let factor = weights.energy * term.tension;
            FacetField::Area.add(factor, nodes, &mut local.gradient, Some(&mut local.hessian));
        }
        for part in parts {
            let factor = weights.of(part.destination) * part.weight;
            if factor.abs() <= 0.0 {
                continue;
            }
            let field = &self.facet_fields[part.field as usize];
            let moved = shifted(nodes, part.offset);
            let seen = moved.as_ref().map_or(nodes, |moved| &moved[..nodes.len()]);
            field.add(factor, seen, &mut local.gradient, Some(&mut local.hessian));
        }
        true
    }

    /// Makes `local` the share of an edge.
    fn edge_local(&self, term: &Term<3>, places: &[DVec3], weights: &Weights, local: &mut Local) {
        let nodes = term.places(places);
        let nodes = &nodes[..usize::from(term.count)];
        local.restart(term.nodes());
        if term.tension.abs() > 0.0 {
            let factor = weights.energy * term.tension;
            let rule = self.rule(nodes.len());
            EdgeField::Length.add(factor, rule, nodes, &mut local.gradient, Some(&mut local.hessian));
        }
        for part in &self.edge_parts[term.parts()] {
            let factor = weights.of(part.destination) * part.weight;
            if factor.abs() > 0.0 {
                let Local { gradient, hessian, .. } = &mut *local;
                self.edge_part(part, nodes, factor, gradient, Some(hessian));
            }
        }
    }
}

/// Parts of the facets of large surfaces, whose gradients are summed apart: fixed, so that sums do not depend on the number of
/// threads.
const PARTS: usize = 4;

/// Elements whose shares one thread assembles at a time: fixed, so that the order does not depend on the number of threads.
const CHUNK: usize = 1024;

impl Default for Local {
    fn default() -> Self {
        Self { nodes: [0; 6], count: 0, gradient: [DVec3::ZERO; 6], hessian: Blocks::zero(0) }
    }
}

impl Local {
    /// Makes it zero, for an element of these nodes.
    fn restart(&mut self, nodes: &[u32]) {
        self.count = nodes.len();
        self.nodes[..nodes.len()].copy_from_slice(nodes);
        self.gradient = [DVec3::ZERO; 6];
        self.hessian.restart(nodes.len());
    }
}
