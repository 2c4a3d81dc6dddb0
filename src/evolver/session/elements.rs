//! Commands that change, delete or list elements.

use super::{
    Host, Session,
    evaluate::{Element, Scope},
    format::significant,
};
use crate::{
    evolver::{
        command::{Assignment, ElementCommand, Target},
        error::EvolverError,
        language::expression::{ElementKind, Expression, Query},
        source::Position,
        surface::{BodyId, BoundaryId, Common, ConstraintId, EdgeId, FacetId, Surface, VertexId},
    },
    index::Id,
};
use std::fmt::Write as _;

impl Session {
    pub(super) fn common_mut(&mut self, element: Element) -> Option<&mut Common> {
        match element.kind {
            ElementKind::Vertex => {
                Some(&mut self.surface.vertices[VertexId::from_index(element.index)].common)
            }
            ElementKind::Edge => Some(&mut self.surface.edges[EdgeId::from_index(element.index)].common),
            ElementKind::Facet => Some(&mut self.surface.facets[FacetId::from_index(element.index)].common),
            ElementKind::Body => None,
        }
    }

    pub(super) fn set_extra(&mut self, element: Element, place: usize, value: f64) {
        let extra = match element.kind {
            ElementKind::Body => &mut self.surface.bodies[BodyId::from_index(element.index)].extra,
            ElementKind::Vertex => {
                &mut self.surface.vertices[VertexId::from_index(element.index)].common.extra
            }
            ElementKind::Edge => &mut self.surface.edges[EdgeId::from_index(element.index)].common.extra,
            ElementKind::Facet => &mut self.surface.facets[FacetId::from_index(element.index)].common.extra,
        };
        if extra.len() <= place {
            extra.resize(place + 1, 0.0);
        }
        extra[place] = value;
    }

    fn targets(&mut self, target: &Target, scope: &mut Scope) -> Result<Vec<Element>, EvolverError> {
        match target {
            Target::Query(query) => self.found(query, scope),
            Target::Element(expression) => Ok(vec![self.element(expression, scope)?]),
        }
    }

    pub(super) fn element_command(
        &mut self,
        command: ElementCommand,
        target: &Target,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Result<(), EvolverError> {
        let elements = self.targets(target, scope)?;
        let kind = elements.first().map(|element| element.kind);
        let count = match (command, kind) {
            (_, None) => 0,
            (ElementCommand::List, _) => return self.list(&elements, host),
            (ElementCommand::Fix | ElementCommand::Unfix, _) => {
                for element in &elements {
                    if let Some(common) = self.common_mut(*element) {
                        common.fixed = command == ElementCommand::Fix;
                    }
                }
                elements.len()
            }
            (ElementCommand::Refine, Some(ElementKind::Edge)) => {
                let edges: Vec<EdgeId> =
                    elements.iter().map(|element| EdgeId::from_index(element.index)).collect();
                self.refine_edges(&edges);
                edges.len()
            }
            (ElementCommand::Refine, Some(ElementKind::Facet)) if self.has_films() => {
                let facets: Vec<FacetId> =
                    elements.iter().map(|element| FacetId::from_index(element.index)).collect();
                facets.iter().for_each(|&facet| self.surface.star(facet));
                facets.len()
            }
            (ElementCommand::Average, Some(ElementKind::Vertex)) => {
                let chosen: Vec<VertexId> = elements.iter().map(|e| VertexId::from_index(e.index)).collect();
                self.average(Some(&chosen))?;
                chosen.len()
            }
            (ElementCommand::Equiangulate | ElementCommand::Edgeswap, Some(ElementKind::Edge)) => {
                let mut around = self.surface.neighbours();
                let swap = |surface: &mut Surface, edge: EdgeId, around: &mut _| match command {
                    ElementCommand::Equiangulate => surface.equiangulate_edge(edge, around),
                    _ => surface.swap(edge, around),
                };
                elements
                    .iter()
                    .filter(|e| swap(&mut self.surface, EdgeId::from_index(e.index), &mut around))
                    .count()
            }
            (ElementCommand::Delete, Some(ElementKind::Edge)) => {
                let edges: Vec<EdgeId> =
                    elements.iter().map(|element| EdgeId::from_index(element.index)).collect();
                self.delete_edges(&edges)
            }
            (ElementCommand::Pop, Some(ElementKind::Vertex | ElementKind::Edge)) => {
                self.pop_elements(&elements, scope)?
            }
            (ElementCommand::T1, Some(ElementKind::Edge)) => self.t1_edges(&elements, scope)?,
            (command, Some(kind)) => {
                let message = format!("not supported: {command:?} of elements of the kind {}", kind.name());
                return scope.fail(Position::default(), message);
            }
        };
        self.changed();
        if !self.quiet {
            let done = match (command, kind) {
                (ElementCommand::T1, _) => "T1 swaps".to_owned(),
                (ElementCommand::Pop, Some(ElementKind::Edge)) => "Edges popped".to_owned(),
                (ElementCommand::Pop, _) => "Vertices popped".to_owned(),
                (command, _) => format!("{command:?}, elements"),
            };
            host.print(&format!("{done}: {count}\n"));
        }
        Ok(())
    }

    /// Divides edges in the order given.
    pub(super) fn refine_edges(&mut self, edges: &[EdgeId]) {
        let mut around = self.surface.neighbours();
        for &edge in edges {
            let facets = around.facets[edge].clone();
            self.surface.refine_edge(edge, &facets);
            // Only the facets on the edge have changed, but their edges have new neighbours.
            if !facets.is_empty() {
                around = self.surface.neighbours();
            }
        }
    }

    /// Collapses edges one after the other, as far as they still exist. How many.
    pub(super) fn delete_edges(&mut self, edges: &[EdgeId]) -> usize {
        let mut left: Vec<EdgeId> = edges.to_vec();
        let mut count = 0;
        left.reverse();
        while let Some(edge) = left.pop() {
            let Some(renumbered) = self.surface.collapse(edge) else { continue };
            count += 1;
            left =
                left.into_iter().filter_map(|old| renumbered.get(old.index()).copied().flatten()).collect();
        }
        count
    }

    fn list(&mut self, elements: &[Element], host: &mut dyn Host) -> Result<(), EvolverError> {
        let mut text = String::new();
        for element in elements {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{}", self.element_line(*element));
        }
        host.print(&text);
        Ok(())
    }

    pub(super) fn set(
        &mut self,
        query: &Query,
        name: &str,
        (index, value): (Option<&Expression>, Option<&Expression>),
        position: Position,
        scope: &mut Scope,
    ) -> Result<(), EvolverError> {
        let index = index.map(|index| self.evaluate(index, scope)).transpose()?;
        let elements = self.found(query, scope)?;
        // All values are taken before any is set: a coordinate may depend on others.
        let mut values = Vec::with_capacity(elements.len());
        for element in &elements {
            scope.push(query.name.clone(), *element);
            let one = match (name, value) {
                ("constraint" | "boundary", Some(label)) => self
                    .label(label, scope)
                    .and_then(|label| self.attach(*element, name, &label, position, scope)),
                (_, Some(value)) => self.evaluate(value, scope).map(|value| values.push((*element, value))),
                (_, None) => {
                    values.push((*element, 1.0));
                    Ok(())
                }
            };
            scope.pop();
            one?;
        }
        for (element, value) in values {
            self.set_attribute(element, name, index, Assignment::Set, value, position, scope)?;
        }
        self.problem = None;
        Ok(())
    }

    /// Puts an element on a constraint or boundary.
    fn attach(
        &mut self,
        element: Element,
        name: &str,
        label: &str,
        position: Position,
        scope: &Scope,
    ) -> Result<(), EvolverError> {
        let (constraint, boundary) = self.labelled(label);
        let Some(common) = self.common_mut(element) else { return Ok(()) };
        match (name, constraint, boundary) {
            ("constraint", Some(id), _) => {
                if !common.constraints.contains(&id) {
                    common.constraints.push(id);
                }
            }
            ("boundary", _, Some(id)) => common.boundary = Some(id),
            _ => return scope.fail(position, format!("there is no {name} {label}")),
        }
        Ok(())
    }

    fn labelled(&self, label: &str) -> (Option<ConstraintId>, Option<BoundaryId>) {
        (
            self.data.constraints.iter().position(|c| *c.name == *label).map(ConstraintId::from_index),
            self.data.boundaries.iter().position(|b| *b.name == *label).map(BoundaryId::from_index),
        )
    }

    pub(super) fn unset(
        &mut self,
        query: &Query,
        name: &str,
        value: Option<&Expression>,
        position: Position,
        scope: &mut Scope,
    ) -> Result<(), EvolverError> {
        for element in self.found(query, scope)? {
            let label = match value {
                Some(value) => Some(self.label(value, scope)?),
                None => None,
            };
            let ids = label.map(|label| self.labelled(&label));
            match (name, ids) {
                ("constraint" | "constraints", Some((Some(id), _))) => {
                    if let Some(common) = self.common_mut(element) {
                        common.constraints.retain(|other| *other != id);
                    }
                }
                ("boundary", _) => {
                    if let Some(common) = self.common_mut(element) {
                        common.boundary = None;
                    }
                }
                ("volume" | "target", _) if element.kind == ElementKind::Body => {
                    self.surface.bodies[BodyId::from_index(element.index)].target = None;
                }
                ("pressure", _) if element.kind == ElementKind::Body => {
                    self.surface.bodies[BodyId::from_index(element.index)].prescribed = false;
                }
                ("constraint" | "constraints", _) => {
                    return scope.fail(position, "there is no such constraint");
                }
                _ => self.set_attribute(element, name, None, Assignment::Set, 0.0, position, scope)?,
            }
        }
        self.problem = None;
        Ok(())
    }

    /// How many values lie in each of twenty equal bins.
    pub(super) fn histogram(
        &mut self,
        query: &Query,
        value: &Expression,
        scope: &mut Scope,
        host: &mut dyn Host,
    ) -> Result<(), EvolverError> {
        let mut values = Vec::new();
        for element in self.found(query, scope)? {
            scope.push(query.name.clone(), element);
            let value = self.evaluate(value, scope);
            scope.pop();
            values.push(value?);
        }
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let width = (high - low) / f64::from(BINS);
        let mut text = String::new();
        for bin in 0..BINS {
            let from = low + f64::from(bin) * width;
            let to = from + width;
            let last = bin + 1 == BINS;
            let count = values.iter().filter(|v| **v >= from && (**v < to || last)).count();
            // Writing to a string does not fail.
            let _ = writeln!(text, "{:>14} - {:>14}  {count}", significant(from, 8), significant(to, 8));
            if width <= 0.0 {
                break;
            }
        }
        host.print(&text);
        Ok(())
    }
}

/// Bins of a histogram.
const BINS: u32 = 20;
