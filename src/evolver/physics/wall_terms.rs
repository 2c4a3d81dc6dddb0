//! The terms of constraints and boundaries: their energies and contents, what lies between edges and walls, gaps.
//!
//! Slivers between edges and walls (`sliver.rs`, `rim.rs`) count for edges on one two-sided constraint that has a content. Those
//! on several constraints or on one-sided ones keep their chords, and so do images that another content than the edge's own
//! would close; what these leave out is only measured.

use super::{
    edge::EdgeField,
    field::VectorField,
    problem::{Contact, Destination, EdgePart, FunctionalId, Part, Point},
    rim::Rim,
    sliver::{Reach, Sliver},
    terms::{Collector, SIGNS, edge_term},
};
use crate::{
    evolver::{
        datafile::{FormulaVector, Model, Side},
        surface::{Common, ConstraintId, Edge, EdgeId, FacetId},
    },
    index::Id,
};
use glam::DVec3;

impl Collector<'_> {
    /// Energies and contents of edges on constraints and boundaries; of vertices, in the string model.
    pub(super) fn constraints(&mut self) {
        let integrands: Vec<(Option<FormulaVector>, Option<FormulaVector>)> = self
            .data
            .constraints
            .iter()
            .map(|c| (c.energy.clone(), c.content.clone()))
            .chain(self.data.boundaries.iter().map(|b| (b.energy.clone(), b.content.clone())))
            .collect();
        let of_constraints = self.data.constraints.len();
        let slivers = self.slivers();
        for (at, (energy, content)) in integrands.iter().enumerate() {
            let on = |common: &Common| {
                if at < of_constraints {
                    common.constraints.iter().any(|id| id.index() == at)
                } else {
                    common.boundary.is_some_and(|id| id.index() + of_constraints == at)
                }
            };
            if self.problem.strings {
                self.point_integrals(energy.as_ref(), content.as_ref(), &on);
                continue;
            }
            if let Some(energy) = energy {
                let field = EdgePart::Field(EdgeField::Along(self.vector(energy)));
                let field = self.edge_field(field);
                for (id, _) in self.surface.edges.enumerated().filter(|(_, edge)| on(&edge.common)) {
                    let part =
                        Part { field, destination: Destination::Energy, weight: 1.0, offset: DVec3::ZERO };
                    self.edge_parts[id.index()].push(part);
                }
            }
            if let Some(content) = content {
                let field = EdgePart::Field(EdgeField::Along(self.vector(content)));
                let field = self.edge_field(field);
                // Surface Evolver takes the contents of boundaries with the other sign.
                let sign = if at < of_constraints { 1.0 } else { -1.0 };
                for (id, edge) in self.surface.edges.enumerated().filter(|(_, edge)| on(&edge.common)) {
                    if !edge.noncontent {
                        self.edge_content(id, (field, slivers.get(at).copied().flatten()), sign);
                    }
                }
            }
        }
        if self.conditions.on_walls {
            self.rims();
        }
        self.gaps();
    }

    /// What lies between edges and each constraint that has a content.
    fn slivers(&mut self) -> Vec<Option<u32>> {
        let film = if self.data.symmetric_content { VectorField::Cone } else { VectorField::Height };
        let mut slivers = Vec::new();
        for constraint in &self.data.constraints {
            slivers.push(constraint.content.as_ref().map(|content| {
                let reach = Reach::new(constraint.formula.bind(self.conditions.variables));
                let sliver = Sliver::new(reach, self.vector(content), film.clone());
                self.edge_field(EdgePart::Sliver(Box::new(sliver)))
            }));
        }
        slivers
    }

    /// What films, gravity and the walls' energies have between edges and walls.
    fn rims(&mut self) {
        let data = self.data;
        for (at, constraint) in data.constraints.iter().enumerate() {
            if constraint.content.is_none() || constraint.side != Side::On {
                continue;
            }
            let reach = Reach::new(constraint.formula.bind(self.conditions.variables));
            let rims = [true, false]
                .map(|negative| self.edge_field(EdgePart::Rim(Rim::new(reach.clone(), negative))));
            let energy = constraint.energy.as_ref().map(|energy| {
                let sliver = Sliver::new(reach.clone(), self.vector(energy), VectorField::zero());
                self.edge_field(EdgePart::Sliver(Box::new(sliver)))
            });
            let weight = Sliver::new(reach, VectorField::zero(), VectorField::HalfSquare);
            let weight = self.edge_field(EdgePart::Sliver(Box::new(weight)));
            let wall = ConstraintId::from_index(at);
            for (id, edge) in self.surface.edges.enumerated() {
                if edge.common.constraints != [wall] {
                    continue;
                }
                let mut parts: Vec<(u32, f64)> = energy.map(|energy| (energy, 1.0)).into_iter().collect();
                for &(facet, at) in &self.neighbours.facets[id] {
                    let film = &self.surface.facets[facet];
                    if film.common.constraints.contains(&wall) {
                        continue;
                    }
                    let value = self.problem.walls[wall].formula.value(self.across(facet, at));
                    parts.push((rims[usize::from(value > 0.0)], film.tension));
                    let along = if film.edges[at].reversed { -1.0 } else { 1.0 };
                    for (side, sign) in SIGNS.into_iter().enumerate() {
                        let density = film.bodies[side].map_or(0.0, |body| self.surface.bodies[body].density);
                        parts.push((weight, sign * along * density * self.conditions.gravity));
                    }
                }
                let parts = parts.into_iter().filter(|(_, weight)| weight.abs() > 0.0);
                let (destination, offset) = (Destination::Energy, DVec3::ZERO);
                self.edge_parts[id.index()].extend(parts.map(|(field, weight)| Part {
                    field,
                    destination,
                    weight,
                    offset,
                }));
            }
        }
    }

    /// A place within a film next to its edge number `at`, seen from that edge as it is stored.
    fn across(&self, facet: FacetId, at: usize) -> DVec3 {
        let surface = self.surface;
        let edges = &surface.facets[facet].edges;
        let (own, next) = (edges[at], edges[(at + 1) % edges.len()]);
        let end = &surface.vertices[surface.head(own)].position;
        let end = if own.reversed { *end } else { *end + surface.translation(surface.wrap(own)) };
        // The middle between the edge's own middle and the corner across.
        end - 0.25 * surface.side(own) + 0.5 * surface.side(next)
    }

    /// Whether an edge's own sliver closes the content of a body that has its facet moved by `offset`: on one two-sided
    /// constraint, with the same field there.
    fn is_closed_by_sliver(&self, edge: &Edge, offset: DVec3) -> bool {
        let [wall] = edge.common.constraints[..] else { return false };
        let same_field =
            if self.data.symmetric_content { offset == DVec3::ZERO } else { offset.z.abs() <= 0.0 };
        same_field && self.data.constraints.as_slice()[wall.index()].side == Side::On
    }

    /// The content of an edge goes to the bodies of its facets, in the sense in which each facet runs along it.
    fn edge_content(&mut self, edge: EdgeId, (field, sliver): (u32, Option<u32>), factor: f64) {
        for &(id, at) in &self.neighbours.facets[edge] {
            let facet = &self.surface.facets[id];
            if facet.noncontent {
                continue;
            }
            let along = if facet.edges[at].reversed { -factor } else { factor };
            for (side, sign) in SIGNS.into_iter().enumerate() {
                let Some(body) = facet.bodies[side] else { continue };
                let destination = Destination::Functional(FunctionalId::from_index(body.index()));
                let part = Part { field, destination, weight: sign * along, offset: DVec3::ZERO };
                self.edge_parts[edge.index()].push(part);
                let Some(sliver) = sliver else { continue };
                let contact = Contact {
                    edge: edge_term(self.surface, edge),
                    body,
                    weight: part.weight,
                    field,
                    sliver,
                    tension: facet.tension,
                };
                let offset = self.surface.translation(self.images[id.index()][side]);
                if !self.is_closed_by_sliver(&self.surface.edges[edge], offset) {
                    self.problem.kept_chords.push(contact);
                    continue;
                }
                if self.conditions.on_walls {
                    self.edge_parts[edge.index()].push(Part { field: sliver, ..part });
                }
                self.problem.contacts.push(contact);
            }
        }
    }

    /// The gaps between chords and convex constraints; bent edges have none.
    fn gaps(&mut self) {
        if self.conditions.gap.abs() <= 0.0 || self.surface.model == Model::Quadratic {
            return;
        }
        for (at, constraint) in self.data.constraints.iter().enumerate().filter(|(_, c)| c.convex) {
            let wall = constraint.formula.bind(self.conditions.variables);
            let field = self.edge_field(EdgePart::Gap(wall));
            for (id, edge) in self.surface.edges.enumerated() {
                if !edge.common.fixed && edge.common.constraints.iter().any(|id| id.index() == at) {
                    let weight = self.conditions.gap;
                    let part = Part { field, destination: Destination::Energy, weight, offset: DVec3::ZERO };
                    self.edge_parts[id.index()].push(part);
                }
            }
        }
    }

    /// In the string model constraints have scalar integrands, taken where strings end on them.
    fn point_integrals(
        &mut self,
        energy: Option<&FormulaVector>,
        content: Option<&FormulaVector>,
        on: &dyn Fn(&Common) -> bool,
    ) {
        let bind = |formulas: Option<&FormulaVector>| {
            formulas.and_then(|f| f[0].as_ref()).map(|formula| formula.bind(self.conditions.variables))
        };
        let (energy, content) = (bind(energy), bind(content));
        if let Some(field) = energy {
            for (vertex, _) in self.surface.vertices.enumerated().filter(|(_, v)| on(&v.common)) {
                let destination = Destination::Energy;
                self.problem.points.push(Point { vertex, field: field.clone(), destination, weight: 1.0 });
            }
        }
        let Some(field) = content else { return };
        for facet in &self.surface.facets {
            let (Some(&first), Some(&last)) = (facet.edges.first(), facet.edges.last()) else { continue };
            let (start, end) = (self.surface.tail(first), self.surface.head(last));
            if start == end {
                continue;
            }
            for (vertex, weight) in [(start, -1.0), (end, 1.0)] {
                if !on(&self.surface.vertices[vertex].common) {
                    continue;
                }
                for (side, sign) in SIGNS.into_iter().enumerate() {
                    let Some(body) = facet.bodies[side] else { continue };
                    let destination = Destination::Functional(FunctionalId::from_index(body.index()));
                    let weight = sign * weight;
                    self.problem.points.push(Point { vertex, field: field.clone(), destination, weight });
                }
            }
        }
    }
}
