//! The terms of a surface: which fields are integrated over which element, and where they go.

use super::{
    edge::{BENT_POINTS, EdgeField, FINE_POINTS, STRAIGHT_POINTS, rule},
    facet::FacetField,
    field::VectorField,
    freedom::Hold,
    problem::{
        Contact, Destination, EdgePart, Functional, FunctionalId, Measured, Part, Point, Problem, Term,
    },
    sliver::Sliver,
};
use crate::{
    evolver::{
        datafile::{Datafile, FormulaVector, Method, Model, Purpose, Quantity, Representation, Side},
        error::EvolverError,
        language::formula::{Bound, Variables},
        surface::{
            BodyId, Common, Directed, Edge, EdgeId, FacetId, Neighbours, Surface, VertexId, Wall, body_images,
        },
    },
    index::{Id, IndexVec, checked_u32},
};
use glam::{DVec3, IVec3};
use std::sync::OnceLock;

/// What may change while commands run.
#[derive(Clone, Debug)]
pub(crate) struct Conditions<'a> {
    pub(crate) variables: &'a Variables,
    /// The strength of gravity; 0 where it is off.
    pub(crate) gravity: f64,
    /// The strength of gaps at convex constraints.
    pub(crate) gap: f64,
    /// Targets and moduli of quantities.
    pub(crate) quantities: &'a [QuantityState],
    /// Whether volumes count as quantities.
    pub(crate) relative: bool,
    /// Whether contents are those of the wall itself, the slivers between it and the edges included.
    pub(crate) on_walls: bool,
}

/// The numbers of a quantity that commands can change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct QuantityState {
    pub(crate) purpose: Purpose,
    pub(crate) modulus: f64,
}

/// Collects the terms.
struct Collector<'a> {
    data: &'a Datafile,
    surface: &'a Surface,
    conditions: &'a Conditions<'a>,
    neighbours: Neighbours,
    /// The image of each facet that the bodies on its sides have.
    images: Vec<[IVec3; 2]>,
    problem: Problem,
    facet_parts: Vec<Vec<Part>>,
    edge_parts: Vec<Vec<Part>>,
    first_quantity: usize,
}

impl Problem {
    /// All terms of `surface`.
    pub(crate) fn new(
        data: &Datafile,
        surface: &Surface,
        conditions: &Conditions<'_>,
    ) -> Result<Self, EvolverError> {
        let neighbours = Neighbours::new(surface);
        let images = body_images(surface, &neighbours)?;
        let bind = |formula: &crate::evolver::language::formula::Formula| formula.bind(conditions.variables);
        let problem = Self {
            functionals: IndexVec::new(),
            facets: Vec::new(),
            facet_parts: Vec::new(),
            facet_fields: Vec::new(),
            edges: Vec::new(),
            edge_parts: Vec::new(),
            edge_fields: Vec::new(),
            points: Vec::new(),
            walls: data
                .constraints
                .iter()
                .map(|c| Wall { formula: bind(&c.formula), side: c.side })
                .collect(),
            boundaries: data
                .boundaries
                .iter()
                .map(|b| b.coordinates.each_ref().map(|f| f.as_ref().map_or(Bound::constant(0.0), bind)))
                .collect(),
            holds: surface.vertices.iter().map(|vertex| hold(&vertex.common)).collect(),
            rules: rules(data, conditions.on_walls),
            contacts: Vec::new(),
            strings: surface.representation == Representation::String,
            relative: conditions.relative,
            pattern: OnceLock::new(),
        };
        let mut collector = Collector {
            data,
            surface,
            conditions,
            neighbours,
            images,
            problem,
            facet_parts: vec![Vec::new(); surface.facets.len()],
            edge_parts: vec![Vec::new(); surface.edges.len()],
            first_quantity: 0,
        };
        collector.functionals();
        match surface.representation {
            Representation::Soapfilm => collector.film_bodies(),
            Representation::String => collector.string_bodies(),
        }
        collector.constraints();
        collector.quantities();
        Ok(collector.finish())
    }
}

fn hold(common: &Common) -> Hold {
    match (common.fixed, common.boundary) {
        (true, _) => Hold::Fixed(common.constraints.clone()),
        (false, Some(boundary)) => Hold::Boundary(boundary),
        (false, None) => Hold::On(common.constraints.clone()),
    }
}

fn rules(data: &Datafile, on_walls: bool) -> [Vec<crate::foam::complex::CurvePoint>; 2] {
    let least = if on_walls { FINE_POINTS } else { 0 };
    let points = |default: usize| data.edge_points.unwrap_or(default.max(least));
    [rule(2, points(STRAIGHT_POINTS)), rule(3, points(BENT_POINTS))]
}

/// Plus for the body that a facet's normal points out of, minus for the other.
const SIGNS: [f64; 2] = [1.0, -1.0];

impl Collector<'_> {
    fn functionals(&mut self) {
        let surface = self.surface;
        let fixed = |body: BodyId| surface.bodies[body].target.is_some();
        // In a filled torus the volumes add up to that of the torus: one of them follows from the others.
        let full = surface.filled && surface.bodies.ids().all(fixed) && surface.bodies.len() > 1;
        for (id, body) in surface.bodies.enumerated() {
            let follows = full && id.index() + 1 == surface.bodies.len();
            self.problem.functionals.push(Functional {
                measured: Measured::Volume(id),
                name: format!("body {}", body.id).into(),
                target: if follows || body.prescribed { None } else { body.target },
                coupling: if body.prescribed { -body.pressure } else { 0.0 },
                constant: body.volconst,
            });
        }
        self.first_quantity = self.problem.functionals.len();
        for (at, (quantity, state)) in self.data.quantities.iter().zip(self.conditions.quantities).enumerate()
        {
            self.problem.functionals.push(Functional {
                measured: Measured::Quantity(at),
                name: quantity.name.clone(),
                target: if let Purpose::Fixed(target) = state.purpose { Some(target) } else { None },
                coupling: if state.purpose == Purpose::Energy { state.modulus } else { 0.0 },
                constant: 0.0,
            });
        }
    }

    fn facet_field(&mut self, field: FacetField) -> u32 {
        self.problem.facet_fields.push(field);
        checked_u32(self.problem.facet_fields.len() - 1)
    }

    fn edge_field(&mut self, field: EdgePart) -> u32 {
        self.problem.edge_fields.push(field);
        checked_u32(self.problem.edge_fields.len() - 1)
    }

    fn vector(&self, formulas: &FormulaVector) -> VectorField {
        let bind = |formula: &Option<crate::evolver::language::formula::Formula>| {
            formula.as_ref().map_or(Bound::constant(0.0), |formula| formula.bind(self.conditions.variables))
        };
        VectorField::Formula(Box::new(formulas.each_ref().map(bind)))
    }

    /// Volumes and weights of bodies bounded by films.
    fn film_bodies(&mut self) {
        let field = if self.data.symmetric_content { VectorField::Cone } else { VectorField::Height };
        let volume = self.facet_field(FacetField::Flux(field));
        let weight = self.facet_field(FacetField::Flux(VectorField::HalfSquare));
        for (id, facet) in self.surface.facets.enumerated() {
            for (side, sign) in SIGNS.into_iter().enumerate() {
                let Some(body) = facet.bodies[side] else { continue };
                let offset = self.surface.translation(self.images[id.index()][side]);
                let parts = &mut self.facet_parts[id.index()];
                if !facet.noncontent {
                    let destination = Destination::Functional(FunctionalId::from_index(body.index()));
                    parts.push(Part { field: volume, destination, weight: sign, offset });
                }
                let heavy = sign * self.surface.bodies[body].density * self.conditions.gravity;
                if heavy.abs() > 0.0 {
                    parts.push(Part {
                        field: weight,
                        destination: Destination::Energy,
                        weight: heavy,
                        offset,
                    });
                }
            }
        }
    }

    /// Areas and weights of the cells of a foam in the plane.
    fn string_bodies(&mut self) {
        let field =
            if self.data.symmetric_content { VectorField::PlaneCone } else { VectorField::PlaneHeight };
        let area = self.edge_field(EdgePart::Field(EdgeField::Along(field)));
        let weight = self.edge_field(EdgePart::Field(EdgeField::Along(VectorField::PlaneHalfSquare)));
        for (id, facet) in self.surface.facets.enumerated() {
            let mut wrap = IVec3::ZERO;
            for &directed in &facet.edges {
                let next = wrap + self.surface.wrap(directed);
                let frame = if directed.reversed { next } else { wrap };
                wrap = next;
                let along = if directed.reversed { -1.0 } else { 1.0 };
                for (side, sign) in SIGNS.into_iter().enumerate() {
                    let Some(body) = facet.bodies[side] else { continue };
                    if self.surface.edges[directed.edge].noncontent {
                        continue;
                    }
                    let offset = self.surface.translation(frame + self.images[id.index()][side]);
                    let parts = &mut self.edge_parts[directed.edge.index()];
                    let destination = Destination::Functional(FunctionalId::from_index(body.index()));
                    parts.push(Part { field: area, destination, weight: sign * along, offset });
                    let heavy = sign * along * self.surface.bodies[body].density * self.conditions.gravity;
                    if heavy.abs() > 0.0 {
                        let destination = Destination::Energy;
                        parts.push(Part { field: weight, destination, weight: heavy, offset });
                    }
                }
            }
        }
    }

    /// Energies and contents of edges on constraints and boundaries; of vertices, in the string model.
    fn constraints(&mut self) {
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

    fn quantities(&mut self) {
        for (at, quantity) in self.data.quantities.iter().enumerate() {
            for instance in &quantity.methods {
                self.method(at, quantity, instance);
            }
        }
    }

    fn method(
        &mut self,
        at: usize,
        quantity: &Quantity,
        instance: &crate::evolver::datafile::MethodInstance,
    ) {
        let destination = Destination::Functional(FunctionalId::from_index(self.first_quantity + at));
        let of = |common: &Common| instance.global || common.quantities.contains(&checked_u32(at));
        let modulus = instance.modulus;
        debug_assert!(!quantity.methods.is_empty(), "the instance is one of them");
        let (facet, edge): (Option<FacetField>, Option<EdgeField>) = match &instance.method {
            Method::FacetArea | Method::FacetTension => (Some(FacetField::Area), None),
            Method::FacetVolume => (Some(FacetField::Flux(VectorField::Height)), None),
            Method::FacetScalarIntegral(f) => {
                (Some(FacetField::Scalar(f.bind(self.conditions.variables))), None)
            }
            Method::FacetVectorIntegral(f) => (Some(FacetField::Flux(self.vector(f))), None),
            Method::EdgeLength | Method::EdgeTension => (None, Some(EdgeField::Length)),
            Method::EdgeScalarIntegral(f) => {
                (None, Some(EdgeField::Scalar(f.bind(self.conditions.variables))))
            }
            Method::EdgeVectorIntegral(f) => (None, Some(EdgeField::Along(self.vector(f)))),
            Method::VertexScalarIntegral(f) => {
                let field = f.bind(self.conditions.variables);
                for (vertex, _) in self.surface.vertices.enumerated().filter(|(_, v)| of(&v.common)) {
                    self.problem.points.push(Point {
                        vertex,
                        field: field.clone(),
                        destination,
                        weight: modulus,
                    });
                }
                return;
            }
        };
        let weighted = matches!(instance.method, Method::FacetTension | Method::EdgeTension);
        if let Some(field) = facet {
            let field = self.facet_field(field);
            for (id, facet) in self.surface.facets.enumerated().filter(|(_, f)| of(&f.common)) {
                let weight = if weighted { modulus * facet.tension } else { modulus };
                self.facet_parts[id.index()].push(Part { field, destination, weight, offset: DVec3::ZERO });
            }
        }
        if let Some(field) = edge {
            let field = self.edge_field(EdgePart::Field(field));
            for (id, edge) in self.surface.edges.enumerated().filter(|(_, e)| of(&e.common)) {
                let weight = if weighted { modulus * edge.tension } else { modulus };
                self.edge_parts[id.index()].push(Part { field, destination, weight, offset: DVec3::ZERO });
            }
        }
    }

    fn finish(mut self) -> Problem {
        let surface = self.surface;
        let facets = if self.problem.strings { 0 } else { surface.facets.len() };
        for (at, parts) in self.facet_parts.into_iter().enumerate().take(facets) {
            let element = FacetId::from_index(at);
            let tension = surface.facets[element].tension;
            let term = term(surface, &surface.corners(element), tension);
            push(&mut self.problem.facets, &mut self.problem.facet_parts, term, parts);
        }
        for (at, parts) in self.edge_parts.into_iter().enumerate() {
            let element = EdgeId::from_index(at);
            let edge = &surface.edges[element];
            if edge.tension.abs() <= 0.0 && parts.is_empty() {
                continue;
            }
            let term = edge_term(surface, element);
            push(&mut self.problem.edges, &mut self.problem.edge_parts, term, parts);
        }
        self.problem
    }
}

fn edge_term(surface: &Surface, id: EdgeId) -> Term<3> {
    let edge = &surface.edges[id];
    let end = surface.wrap(Directed { edge: id, reversed: false });
    let mut nodes = vec![(edge.ends[0], IVec3::ZERO), (edge.ends[1], end)];
    if let Some(middle) = edge.middle {
        nodes.insert(1, (middle, IVec3::ZERO));
    }
    term(surface, &nodes, edge.tension)
}

fn term<const N: usize>(surface: &Surface, corners: &[(VertexId, IVec3)], tension: f64) -> Term<N> {
    let mut nodes = [0; N];
    let mut shifts = [DVec3::ZERO; N];
    for (at, &(vertex, wrap)) in corners.iter().enumerate().take(N) {
        nodes[at] = checked_u32(vertex.index());
        shifts[at] = surface.translation(wrap);
    }
    let wrapped = shifts.iter().any(|shift| *shift != DVec3::ZERO);
    Term {
        nodes,
        count: u8::try_from(corners.len().min(N)).unwrap_or(0),
        shifts: wrapped.then(|| Box::new(shifts)),
        tension,
        parts: 0..0,
    }
}

fn push<const N: usize>(terms: &mut Vec<Term<N>>, all: &mut Vec<Part>, mut term: Term<N>, parts: Vec<Part>) {
    let start = checked_u32(all.len());
    all.extend(parts);
    term.parts = start..checked_u32(all.len());
    terms.push(term);
}
