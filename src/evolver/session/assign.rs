//! Assignments: to variables, quantities, and attributes of elements.

use super::{
    Session,
    evaluate::{Element, Scope},
};
use crate::{
    evolver::{
        command::Assignment,
        datafile::Purpose,
        error::EvolverError,
        language::{
            expression::{ElementKind, Expression},
            formula::is_zero,
        },
        physics::FunctionalId,
        source::Position,
        surface::{BodyId, EdgeId, FacetId, VertexId},
    },
    index::Id,
};

impl Session {
    pub(super) fn assign(
        &mut self,
        name: &str,
        operator: Assignment,
        value: f64,
        position: Position,
        scope: &mut Scope,
    ) -> Result<(), EvolverError> {
        if let Some(local) = scope.local(name) {
            *local = combined(*local, operator, value);
            return Ok(());
        }
        match name {
            "scale" => {
                self.descent.scale = combined(self.descent.scale, operator, value);
                return Ok(());
            }
            "scale_limit" => {
                self.descent.limit = combined(self.descent.limit, operator, value);
                return Ok(());
            }
            "gap_constant" | "spring_constant" => {
                self.gap = combined(self.gap, operator, value);
                self.problem = None;
                return Ok(());
            }
            "quiet" => {
                self.quiet = !is_zero(value);
                return Ok(());
            }
            _ => {}
        }
        if let Some(element) = scope.innermost()
            && operator == Assignment::Set
            && self.variables.get(name).is_none()
            && self.attribute(element, name, None)?.is_some()
        {
            return self.set_attribute(element, name, None, Assignment::Set, value, position, scope);
        }
        let old = match (operator, self.variables.get(name)) {
            (_, Some(old)) => old,
            (Assignment::Set, None) => 0.0,
            (_, None) => return scope.fail(position, format!("«{name}» is not defined")),
        };
        self.variables.set(name, combined(old, operator, value));
        Ok(())
    }

    pub(super) fn assign_member(
        &mut self,
        target: &Expression,
        operator: Assignment,
        value: f64,
        position: Position,
        scope: &mut Scope,
    ) -> Result<(), EvolverError> {
        match target {
            Expression::Member(owner, name, at) => {
                if let Expression::Name(quantity, _) = &**owner
                    && self.set_quantity(quantity, name, operator, value)?
                {
                    return Ok(());
                }
                let element = self.element(owner, scope)?;
                self.set_attribute(element, name, None, operator, value, *at, scope)
            }
            Expression::Index(parts, at) => {
                let (base, indices) = super::arrays::indexed(&parts[0], &parts[1]);
                let mut places = Vec::with_capacity(indices.len());
                for index in indices {
                    places.push(self.evaluate(index, scope)?);
                }
                match base {
                    Expression::Member(owner, name, _) => {
                        let element = self.element(owner, scope)?;
                        let index = Some(self.flat_index(element.kind, name, &places));
                        self.set_attribute(element, name, index, operator, value, *at, scope)
                    }
                    Expression::Name(name, _) if self.arrays.contains_key(name) => {
                        self.assign_entry(name, &places, operator, value, *at, scope)
                    }
                    Expression::Name(name, _) => {
                        scope.fail(*at, format!("«{name}» is no array: define {name} real[…] makes one"))
                    }
                    _ => scope.fail(*at, "only arrays and attributes have an index"),
                }
            }
            _ => scope.fail(position, "only variables and attributes can be assigned to"),
        }
    }

    fn set_quantity(
        &mut self,
        quantity: &str,
        name: &str,
        operator: Assignment,
        value: f64,
    ) -> Result<bool, EvolverError> {
        let Some(at) = self.data.quantities.iter().position(|q| *q.name == *quantity) else {
            return Ok(false);
        };
        let state = &mut self.quantities[at];
        match (name, state.purpose) {
            ("modulus", _) => state.modulus = combined(state.modulus, operator, value),
            ("target", Purpose::Fixed(old)) => state.purpose = Purpose::Fixed(combined(old, operator, value)),
            _ => return Ok(false),
        }
        self.problem = None;
        Ok(true)
    }

    /// Sets one attribute of one element.
    #[expect(
        clippy::too_many_arguments,
        reason = "an attribute, its index, how, to what, and where it is said"
    )]
    pub(super) fn set_attribute(
        &mut self,
        element: Element,
        name: &str,
        index: Option<f64>,
        operator: Assignment,
        value: f64,
        position: Position,
        scope: &Scope,
    ) -> Result<(), EvolverError> {
        let old = self.attribute(element, name, index)?.unwrap_or(0.0);
        let value = combined(old, operator, value);
        let axis = match (name, index) {
            ("x" | "x1", None) => Some(0),
            ("y" | "x2", None) => Some(1),
            ("z" | "x3", None) => Some(2),
            ("x", Some(at)) => {
                super::evaluate::whole(at).and_then(|at| at.checked_sub(1)).filter(|at| *at < 3)
            }
            _ => None,
        };
        let on = !is_zero(value);
        #[expect(clippy::cast_possible_truncation, reason = "colours and numbers of elements are small")]
        let small = value as i32;
        if let Some(place) = self.extra_place(element.kind, name, index) {
            self.set_extra(element, place, value);
            return Ok(());
        }
        match (element.kind, name) {
            (ElementKind::Vertex, _) if axis.is_some() => {
                self.surface.vertices[VertexId::from_index(element.index)].position[axis.unwrap_or(0)] =
                    value;
            }
            (ElementKind::Vertex, "p1") => {
                self.surface.vertices[VertexId::from_index(element.index)].parameters[0] = value;
            }
            (ElementKind::Vertex, "p2") => {
                self.surface.vertices[VertexId::from_index(element.index)].parameters[1] = value;
            }
            (ElementKind::Edge, "tension" | "density") => {
                self.surface.edges[EdgeId::from_index(element.index)].tension = value;
            }
            (ElementKind::Facet, "tension" | "density") => {
                self.surface.facets[FacetId::from_index(element.index)].tension = value;
            }
            (ElementKind::Edge, "no_refine") => {
                self.surface.edges[EdgeId::from_index(element.index)].no_refine = on
            }
            (ElementKind::Facet, "no_refine") => {
                self.surface.facets[FacetId::from_index(element.index)].no_refine = on
            }
            (ElementKind::Body, _) => {
                return self.set_body(BodyId::from_index(element.index), name, value, position, scope);
            }
            (_, "color" | "frontcolor" | "backcolor") => {
                if let Some(common) = self.common_mut(element) {
                    common.color = small;
                }
                return Ok(());
            }
            (_, "fixed") => {
                if let Some(common) = self.common_mut(element) {
                    common.fixed = on;
                }
            }
            (_, "original") => {
                if let Some(common) = self.common_mut(element) {
                    common.original = i64::from(small);
                }
                return Ok(());
            }
            (_, "opacity" | "bare" | "no_display") => return Ok(()),
            _ => {
                let message = format!("the attribute «{name}» of a {} cannot be set", element.kind.name());
                return scope.fail(position, message);
            }
        }
        self.problem = None;
        Ok(())
    }

    fn set_body(
        &mut self,
        id: BodyId,
        name: &str,
        value: f64,
        position: Position,
        scope: &Scope,
    ) -> Result<(), EvolverError> {
        let body = &mut self.surface.bodies[id];
        match name {
            "target" | "volume" => {
                body.target = Some(value);
                body.prescribed = false;
            }
            "pressure" => {
                body.pressure = value;
                body.prescribed = true;
                body.target = None;
                self.multipliers[FunctionalId::from_index(id.index())] = 0.0;
            }
            "density" => body.density = value,
            "volconst" => body.volconst = value,
            _ => return scope.fail(position, format!("the attribute «{name}» of a body cannot be set")),
        }
        self.problem = None;
        Ok(())
    }
}

/// The value after an assignment.
pub(super) fn combined(old: f64, operator: Assignment, value: f64) -> f64 {
    match operator {
        Assignment::Set => value,
        Assignment::Add => old + value,
        Assignment::Subtract => old - value,
        Assignment::Multiply => old * value,
        Assignment::Divide => old / value,
    }
}
