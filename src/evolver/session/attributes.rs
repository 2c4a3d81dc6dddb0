//! Attributes of elements, and their parts.

use super::{
    Session,
    evaluate::{Element, Scope, whole},
};
use crate::{
    evolver::{
        datafile::{Purpose, Representation},
        error::EvolverError,
        language::expression::{ElementKind, ElementTest},
        physics::FunctionalId,
        source::Position,
        surface::{BodyId, Common, Directed, EdgeId, FacetId, VertexId},
    },
    index::Id,
};
use glam::DVec3;
fn number(n: usize) -> f64 {
    n as f64
}

fn truth(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

/// A vector's component by its name or index from 1.
fn component(vector: DVec3, name: &str, index: Option<f64>) -> Option<f64> {
    match (name, index.and_then(whole)) {
        ("x" | "x1", None) | ("x", Some(1)) => Some(vector.x),
        ("y" | "x2", None) | ("x", Some(2)) => Some(vector.y),
        ("z" | "x3", None) | ("x", Some(3)) => Some(vector.z),
        _ => None,
    }
}

impl Session {
    /// How many elements there are.
    pub(super) fn count(&self, kind: ElementKind) -> usize {
        match kind {
            ElementKind::Vertex => self.surface.vertices.len(),
            ElementKind::Edge => self.surface.edges.len(),
            ElementKind::Facet => self.surface.facets.len(),
            ElementKind::Body => self.surface.bodies.len(),
        }
    }

    /// The number by which an element is known.
    pub(super) fn element_number(&self, element: Element) -> f64 {
        match element.kind {
            ElementKind::Body => self.surface.bodies[BodyId::from_index(element.index)].id as f64,
            _ => number(element.index + 1),
        }
    }

    fn common(&self, element: Element) -> Option<&Common> {
        match element.kind {
            ElementKind::Vertex => Some(&self.surface.vertices[VertexId::from_index(element.index)].common),
            ElementKind::Edge => Some(&self.surface.edges[EdgeId::from_index(element.index)].common),
            ElementKind::Facet => Some(&self.surface.facets[FacetId::from_index(element.index)].common),
            ElementKind::Body => None,
        }
    }

    /// The value of an attribute; `None` if there is no such attribute.
    pub(super) fn attribute(
        &mut self,
        element: Element,
        name: &str,
        index: Option<f64>,
    ) -> Result<Option<f64>, EvolverError> {
        let own = match element.kind {
            ElementKind::Vertex => self.vertex_attribute(VertexId::from_index(element.index), name, index)?,
            ElementKind::Edge => self.edge_attribute(EdgeId::from_index(element.index), name, index)?,
            ElementKind::Facet => self.facet_attribute(FacetId::from_index(element.index), name, index)?,
            ElementKind::Body => self.body_attribute(BodyId::from_index(element.index), name)?,
        };
        if own.is_some() {
            return Ok(own);
        }
        if matches!(name, "id" | "oid") {
            return Ok(Some(self.element_number(element)));
        }
        if let Some(common) = self.common(element) {
            match name {
                "fixed" => return Ok(Some(truth(common.fixed))),
                "original" => return Ok(Some(common.original as f64)),
                "color" | "frontcolor" | "backcolor" => return Ok(Some(f64::from(common.color))),
                _ => {}
            }
        }
        Ok(self.extra_attribute(element, name, index))
    }

    /// Where an added attribute lies among an element's extra numbers.
    pub(super) fn extra_place(&self, kind: ElementKind, name: &str, index: Option<f64>) -> Option<usize> {
        let mut at = 0;
        for attribute in self.surface.attributes.iter().filter(|attribute| attribute.kind == kind) {
            if *attribute.name == *name {
                let offset = match index {
                    None => 0,
                    Some(index) => whole(index)?.checked_sub(1)?,
                };
                return (offset < attribute.length).then_some(at + offset);
            }
            at += attribute.length;
        }
        None
    }

    fn extra_attribute(&self, element: Element, name: &str, index: Option<f64>) -> Option<f64> {
        let place = self.extra_place(element.kind, name, index)?;
        let extra = match self.common(element) {
            Some(common) => &common.extra,
            None => &self.surface.bodies[BodyId::from_index(element.index)].extra,
        };
        Some(extra.get(place).copied().unwrap_or(0.0))
    }

    fn vertex_attribute(
        &mut self,
        id: VertexId,
        name: &str,
        index: Option<f64>,
    ) -> Result<Option<f64>, EvolverError> {
        let vertex = &self.surface.vertices[id];
        if let Some(value) = component(vertex.position, name, index) {
            return Ok(Some(value));
        }
        Ok(match name {
            "p1" => Some(vertex.parameters[0]),
            "p2" => Some(vertex.parameters[1]),
            "valence" => Some(number(
                self.parts(Element { kind: ElementKind::Vertex, index: id.index() }, ElementKind::Edge).len(),
            )),
            "midv" => Some(truth(vertex.middle)),
            _ => None,
        })
    }

    fn edge_attribute(
        &mut self,
        id: EdgeId,
        name: &str,
        index: Option<f64>,
    ) -> Result<Option<f64>, EvolverError> {
        let side = self.surface.side(Directed { edge: id, reversed: false });
        if let Some(value) = component(side, name, index) {
            return Ok(Some(value));
        }
        let edge = &self.surface.edges[id];
        Ok(match name {
            "length" => Some(self.surface.edge_length(id)),
            "tension" | "density" => Some(edge.tension),
            "no_refine" => Some(truth(edge.no_refine)),
            "noncontent" => Some(truth(edge.noncontent)),
            "valence" => Some(number(self.around(id).len())),
            "dihedral" => Some(self.dihedral(id)),
            _ => None,
        })
    }

    /// The angle between the normals of the two facets at an edge; 0 where there are not two.
    fn dihedral(&mut self, id: EdgeId) -> f64 {
        let [f, g] = self.around(id)[..] else { return 0.0 };
        let (f, g) = (FacetId::from_index(f), FacetId::from_index(g));
        let sense =
            |facet: FacetId| self.surface.facets[facet].edges.iter().any(|d| d.edge == id && d.reversed);
        let turned = sense(f) == sense(g);
        let (a, b) = (self.surface.area_vector(f), self.surface.area_vector(g));
        let b = if turned { -b } else { b };
        a.cross(b).length().atan2(a.dot(b))
    }

    fn facet_attribute(
        &mut self,
        id: FacetId,
        name: &str,
        index: Option<f64>,
    ) -> Result<Option<f64>, EvolverError> {
        if matches!(name, "x" | "y" | "z" | "x1" | "x2" | "x3") {
            return Ok(component(self.surface.area_vector(id), name, index));
        }
        let facet = &self.surface.facets[id];
        Ok(match name {
            "area" => Some(self.surface.facet_area(id)),
            "tension" | "density" => Some(facet.tension),
            "no_refine" => Some(truth(facet.no_refine)),
            "noncontent" => Some(truth(facet.noncontent)),
            "valence" => Some(number(facet.edges.len())),
            _ => None,
        })
    }

    fn body_attribute(&mut self, id: BodyId, name: &str) -> Result<Option<f64>, EvolverError> {
        let body = &self.surface.bodies[id];
        Ok(match name {
            "target" => Some(body.target.unwrap_or(0.0)),
            "density" => Some(body.density),
            "volconst" => Some(body.volconst),
            "pressure" => Some(self.pressure(id)),
            "volume" => Some(self.values()?.functionals[FunctionalId::from_index(id.index())]),
            "fixedvol" => Some(truth(body.target.is_some())),
            "valence" => Some(number(
                self.parts(Element { kind: ElementKind::Body, index: id.index() }, ElementKind::Facet).len(),
            )),
            _ => None,
        })
    }

    /// A number of a named quantity.
    pub(super) fn quantity_member(
        &mut self,
        quantity: &str,
        name: &str,
    ) -> Result<Option<f64>, EvolverError> {
        let Some(at) = self.data.quantities.iter().position(|q| *q.name == *quantity) else {
            return Ok(None);
        };
        let id = FunctionalId::from_index(self.surface.bodies.len() + at);
        Ok(match name {
            "value" => Some(self.values()?.functionals[id]),
            "modulus" => Some(self.quantities[at].modulus),
            "pressure" => Some(self.multipliers[id]),
            "target" => {
                Some(if let Purpose::Fixed(target) = self.quantities[at].purpose { target } else { 0.0 })
            }
            _ => None,
        })
    }

    pub(super) fn element_test(
        &self,
        test: ElementTest,
        element: Element,
        label: &str,
        position: Position,
        scope: &Scope,
    ) -> Result<f64, EvolverError> {
        let Some(common) = self.common(element) else { return Ok(0.0) };
        if test == ElementTest::OnBoundary {
            let on = common.boundary.is_some_and(|id| *self.data.boundaries[id.index()].name == *label);
            return Ok(truth(on));
        }
        let Some(at) = self.data.constraints.iter().position(|c| *c.name == *label) else {
            return scope.fail(position, format!("there is no constraint {label}"));
        };
        let on = |list: &[crate::evolver::surface::ConstraintId]| list.iter().any(|id| id.index() == at);
        let yes = match (test, element.kind) {
            (ElementTest::HitConstraint, ElementKind::Vertex) => {
                on(&self.surface.vertices[VertexId::from_index(element.index)].hit)
            }
            (ElementTest::HitConstraint, _) => false,
            _ => on(&common.constraints),
        };
        Ok(truth(yes))
    }

    /// The facets at an edge.
    fn around(&mut self, id: EdgeId) -> Vec<usize> {
        self.neighbours().facets[id].iter().map(|(facet, _)| facet.index()).collect()
    }

    /// The parts of one kind that an element has, or the elements of that kind that it is a part of.
    pub(super) fn parts(&mut self, owner: Element, kind: ElementKind) -> Vec<usize> {
        let mut out: Vec<usize> = match (owner.kind, kind) {
            (ElementKind::Edge, ElementKind::Vertex) => {
                return self.surface.edges[EdgeId::from_index(owner.index)]
                    .ends
                    .iter()
                    .map(|v| v.index())
                    .collect();
            }
            (ElementKind::Facet, ElementKind::Edge) => {
                let facet = &self.surface.facets[FacetId::from_index(owner.index)];
                return facet.edges.iter().map(|d| d.edge.index()).collect();
            }
            (ElementKind::Facet, ElementKind::Vertex) => {
                let id = FacetId::from_index(owner.index);
                let count = self.surface.facets[id].edges.len();
                return self.surface.corners(id)[..count].iter().map(|(v, _)| v.index()).collect();
            }
            (ElementKind::Vertex, ElementKind::Edge) => {
                let id = VertexId::from_index(owner.index);
                return self.neighbours().edges[id].iter().map(|e| e.index()).collect();
            }
            (ElementKind::Vertex, ElementKind::Facet) => {
                let id = VertexId::from_index(owner.index);
                return self.neighbours().facets_at(id).into_iter().map(|f| f.index()).collect();
            }
            (ElementKind::Edge, ElementKind::Facet) => return self.around(EdgeId::from_index(owner.index)),
            (ElementKind::Facet, ElementKind::Body) => {
                let facet = &self.surface.facets[FacetId::from_index(owner.index)];
                facet.bodies.iter().flatten().map(|b| b.index()).collect()
            }
            (ElementKind::Body, ElementKind::Facet) => {
                let body = BodyId::from_index(owner.index);
                let has = |f: &FacetId| self.surface.facets[*f].bodies.contains(&Some(body));
                self.surface.facets.ids().filter(has).map(|f| f.index()).collect()
            }
            (_, ElementKind::Body) => {
                let facets = self.parts(owner, ElementKind::Facet);
                let element = |index| Element { kind: ElementKind::Facet, index };
                facets.into_iter().flat_map(|f| self.parts(element(f), ElementKind::Body)).collect()
            }
            (ElementKind::Body, _) => {
                let facets = self.parts(owner, ElementKind::Facet);
                let element = |index| Element { kind: ElementKind::Facet, index };
                facets.into_iter().flat_map(|f| self.parts(element(f), kind)).collect()
            }
            (ElementKind::Vertex, ElementKind::Vertex) => {
                let edges = self.parts(owner, ElementKind::Edge);
                let element = |index| Element { kind: ElementKind::Edge, index };
                edges.into_iter().flat_map(|e| self.parts(element(e), ElementKind::Vertex)).collect()
            }
            (ElementKind::Edge, ElementKind::Edge) | (ElementKind::Facet, ElementKind::Facet) => {
                vec![owner.index]
            }
        };
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Whether attributes of facets are those of films.
    pub(super) fn has_films(&self) -> bool {
        self.surface.representation == Representation::Soapfilm
    }
}
