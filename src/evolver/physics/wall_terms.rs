//! The terms of constraints and boundaries: their energies and contents, what lies between edges and walls, gaps.

use super::{
    edge::EdgeField,
    field::VectorField,
    problem::{Contact, Destination, EdgePart, FunctionalId, Part, Point},
    sliver::Sliver,
    terms::{Collector, SIGNS, edge_term},
};
use crate::{
    evolver::{
        datafile::{FormulaVector, Model, Side},
        surface::{Common, Edge, EdgeId},
    },
    index::Id,
};
use glam::{DVec3, IVec3};

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
        let on_one_wall = |edge: &Edge| edge.common.constraints.len() == 1;
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
                        let sliver = slivers.get(at).copied().flatten().filter(|_| on_one_wall(edge));
                        self.edge_content(id, (field, sliver), sign);
                    }
                }
            }
        }
        self.gaps();
    }

    /// What lies between edges and each constraint that has a content and holds edges from both sides.
    fn slivers(&mut self) -> Vec<Option<u32>> {
        let film = if self.data.symmetric_content { VectorField::Cone } else { VectorField::Height };
        let mut slivers = Vec::new();
        for constraint in &self.data.constraints {
            let content = constraint.content.as_ref().filter(|_| constraint.side == Side::On);
            slivers.push(content.map(|content| {
                let wall = constraint.formula.bind(self.conditions.variables);
                let sliver = Sliver { wall, content: self.vector(content), film: film.clone() };
                self.edge_field(EdgePart::Sliver(Box::new(sliver)))
            }));
        }
        slivers
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
                // The content is that of the edge as it is stored: an image of it has another sliver.
                let Some(sliver) = sliver.filter(|_| self.images[id.index()][side] == IVec3::ZERO) else {
                    continue;
                };
                if self.conditions.on_walls {
                    self.edge_parts[edge.index()].push(Part { field: sliver, ..part });
                }
                self.problem.contacts.push(Contact {
                    edge: edge_term(self.surface, edge),
                    body,
                    weight: part.weight,
                    field,
                    sliver,
                    tension: facet.tension,
                });
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
