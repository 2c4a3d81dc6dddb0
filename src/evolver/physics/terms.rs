//! The terms of a surface: which fields are integrated over which element, and where they go.

use super::{
    edge::{BENT_POINTS, EdgeField, FINE_POINTS, STRAIGHT_POINTS, rule},
    facet::FacetField,
    field::VectorField,
    freedom::Hold,
    problem::{Destination, EdgePart, Functional, FunctionalId, Measured, Part, Point, Problem, Term},
};
use crate::{
    evolver::{
        datafile::{Datafile, FormulaVector, Method, Purpose, Quantity, Representation},
        error::EvolverError,
        language::formula::{Bound, Variables},
        surface::{
            BodyId, Common, Directed, EdgeId, FacetId, Neighbours, Surface, VertexId, Wall, body_images,
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
pub(super) struct Collector<'a> {
    pub(super) data: &'a Datafile,
    pub(super) surface: &'a Surface,
    pub(super) conditions: &'a Conditions<'a>,
    pub(super) neighbours: Neighbours,
    /// The image of each facet that the bodies on its sides have.
    pub(super) images: Vec<[IVec3; 2]>,
    pub(super) problem: Problem,
    pub(super) facet_parts: Vec<Vec<Part>>,
    pub(super) edge_parts: Vec<Vec<Part>>,
    pub(super) first_quantity: usize,
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
            kept_chords: Vec::new(),
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
pub(super) const SIGNS: [f64; 2] = [1.0, -1.0];

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

    pub(super) fn edge_field(&mut self, field: EdgePart) -> u32 {
        self.problem.edge_fields.push(field);
        checked_u32(self.problem.edge_fields.len() - 1)
    }

    pub(super) fn vector(&self, formulas: &FormulaVector) -> VectorField {
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

pub(super) fn edge_term(surface: &Surface, id: EdgeId) -> Term<3> {
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
