//! All terms of a surface, and their values.

use super::{
    Places,
    edge::{self, EdgeField},
    facet::FacetField,
    freedom::Hold,
    gradient::Slots,
    rim::Rim,
    sliver::Sliver,
};
use crate::{
    evolver::{
        language::formula::Bound,
        surface::{BodyId, BoundaryId, ConstraintId, VertexId, Wall},
    },
    foam::complex::CurvePoint,
    index::{Id, IndexVec},
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

crate::define_id!(
    /// A functional of a [`Problem`].
    FunctionalId
);

/// What a functional measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// The volume of a body; its area in the plane.
    Volume(BodyId),
    /// The quantity of this place in the datafile.
    Quantity(usize),
}

/// A functional: a volume or a named quantity.
#[derive(Clone, Debug)]
pub struct Functional {
    /// What it measures.
    pub measured: Measured,
    /// What it is called.
    pub name: Arc<str>,
    /// The value at which it is held.
    pub target: Option<f64>,
    /// By what it enters the energy.
    pub coupling: f64,
    /// What is added to its integral.
    pub constant: f64,
}

/// What a term is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Destination {
    Energy,
    Functional(FunctionalId),
}

/// A field over an element, with its weight, seen from an image of the element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) field: u32,
    pub(super) destination: Destination,
    pub(super) weight: f64,
    pub(super) offset: DVec3,
}

/// An element: its nodes, and which parts it has.
#[derive(Clone, Debug)]
pub(super) struct Term<const N: usize> {
    pub(super) nodes: [u32; N],
    pub(super) count: u8,
    /// Where its nodes are seen, where it reaches over the border of a torus.
    pub(super) shifts: Option<Box<[DVec3; N]>>,
    /// Energy per area or length.
    pub(super) tension: f64,
    pub(super) parts: std::ops::Range<u32>,
}

impl<const N: usize> Term<N> {
    pub(super) fn places(&self, places: &[DVec3]) -> [DVec3; N] {
        let mut out = [DVec3::ZERO; N];
        let count = usize::from(self.count);
        for (out, &node) in out[..count].iter_mut().zip(&self.nodes) {
            *out = places[node as usize];
        }
        if let Some(shifts) = &self.shifts {
            for (out, &shift) in out[..count].iter_mut().zip(shifts.iter()) {
                *out += shift;
            }
        }
        out
    }

    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes[..usize::from(self.count)]
    }

    pub(super) fn parts(&self) -> std::ops::Range<usize> {
        self.parts.start as usize..self.parts.end as usize
    }
}

/// A scalar taken at a vertex.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) vertex: VertexId,
    pub(super) field: Bound,
    pub(super) destination: Destination,
    pub(super) weight: f64,
}

/// An edge along which a content is integrated.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    pub(super) edge: Term<3>,
    pub(super) body: BodyId,
    /// The content's sign for the body.
    pub(super) weight: f64,
    /// The integrand along the edge, and what lies between the edge and the wall.
    pub(super) field: u32,
    pub(super) sliver: u32,
    /// The tension of the films that end there.
    pub(super) tension: f64,
}

/// Everything that energy and functionals need, for one topology and one set of parameters.
#[derive(Clone, Debug)]
pub struct Problem {
    pub(super) functionals: IndexVec<FunctionalId, Functional>,
    pub(super) facets: Vec<Term<6>>,
    pub(super) facet_parts: Vec<Part>,
    pub(super) facet_fields: Vec<FacetField>,
    pub(super) edges: Vec<Term<3>>,
    pub(super) edge_parts: Vec<Part>,
    pub(super) edge_fields: Vec<EdgePart>,
    pub(super) points: Vec<Point>,
    pub(super) walls: IndexVec<ConstraintId, Wall>,
    pub(super) boundaries: IndexVec<BoundaryId, [Bound; 3]>,
    pub(super) holds: IndexVec<VertexId, Hold>,
    pub(super) rules: [Vec<CurvePoint>; 2],
    /// The edges along which contents are integrated, body by body.
    pub(super) contacts: Vec<Contact>,
    /// Those whose slivers never count.
    pub(super) kept_chords: Vec<Contact>,
    pub(super) strings: bool,
    /// Whether volumes are restored to a part of their shares, as quantities are, instead of absolutely.
    pub(crate) relative: bool,
    /// Which functionals depend on which vertex, once it was asked for.
    pub(super) pattern: OnceLock<Slots>,
}

/// A field along edges, the gap at a convex wall, the volume between an edge and its wall, or the film there.
#[derive(Clone, Debug)]
pub(super) enum EdgePart {
    Field(EdgeField),
    Gap(Bound),
    Sliver(Box<Sliver>),
    Rim(Rim),
}

/// Energy and functionals of one set of places.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// The energy, couplings included.
    pub energy: f64,
    /// The area of all facets, with or without tension; the length of strings.
    pub area: f64,
    /// The functionals.
    pub functionals: IndexVec<FunctionalId, f64>,
    /// The sums of the absolute shares of which the functionals are made.
    pub(crate) magnitudes: IndexVec<FunctionalId, f64>,
}

/// Facets that one thread sums at a time: fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 2048;

/// The same for edges, whose formulas take longer.
pub(super) const EDGE_CHUNK: usize = 64;

/// What a chunk adds up.
struct Sums {
    energy: f64,
    area: f64,
    /// Each functional with its sum and the sum of the absolute shares.
    functionals: Vec<(FunctionalId, f64, f64)>,
}

impl Sums {
    fn new() -> Self {
        Self { energy: 0.0, area: 0.0, functionals: Vec::new() }
    }

    fn add(&mut self, destination: Destination, value: f64) {
        match destination {
            Destination::Energy => self.energy += value,
            // Neighbouring elements share their functionals: the last entries are the likely ones.
            Destination::Functional(id) => {
                match self.functionals.iter_mut().rev().take(8).find(|(other, ..)| *other == id) {
                    Some((_, sum, magnitude)) => {
                        *sum += value;
                        *magnitude += value.abs();
                    }
                    None => self.functionals.push((id, value, value.abs())),
                }
            }
        }
    }
}

impl Problem {
    /// The functionals.
    #[must_use]
    pub fn functionals(&self) -> &IndexVec<FunctionalId, Functional> {
        &self.functionals
    }

    /// In a torus volumes are known up to whole tori only: takes off so many of them that held volumes come nearest to their
    /// targets.
    pub(crate) fn take_off_tori(&mut self, torus: f64, values: &Values) {
        for (id, functional) in self.functionals.as_mut_slice().iter_mut().enumerate() {
            let (Some(target), Measured::Volume(_)) = (functional.target, functional.measured) else {
                continue;
            };
            let over = (values.functionals[FunctionalId::from_index(id)] - target) / torus;
            functional.constant -= torus * over.round();
        }
    }

    /// Those that are held.
    pub(crate) fn held(&self) -> Vec<FunctionalId> {
        self.functionals.enumerated().filter(|(_, f)| f.target.is_some()).map(|(id, _)| id).collect()
    }

    /// Energy and functionals.
    #[must_use]
    pub fn values(&self, places: &Places) -> Values {
        let places = places.as_slice();
        let chunks: Vec<Sums> = if self.facets.len() <= CHUNK {
            vec![self.facet_sums(&self.facets, places)]
        } else {
            self.facets.par_chunks(CHUNK).map(|chunk| self.facet_sums(chunk, places)).collect()
        };
        let edges: Vec<Sums> = if self.edges.len() <= EDGE_CHUNK {
            vec![self.edge_sums(&self.edges, places)]
        } else {
            self.edges.par_chunks(EDGE_CHUNK).map(|chunk| self.edge_sums(chunk, places)).collect()
        };
        let mut points = Sums::new();
        for point in &self.points {
            points.add(point.destination, point.weight * point.field.value(places[point.vertex.index()]));
        }
        let mut values = Values {
            energy: 0.0,
            area: 0.0,
            functionals: self.functionals.iter().map(|functional| functional.constant).collect(),
            magnitudes: IndexVec::from_elem(0.0, self.functionals.len()),
        };
        for sums in chunks.into_iter().chain(edges).chain([points]) {
            values.energy += sums.energy;
            values.area += sums.area;
            for (id, value, magnitude) in sums.functionals {
                values.functionals[id] += value;
                values.magnitudes[id] += magnitude;
            }
        }
        for (id, functional) in self.functionals.enumerated() {
            if functional.coupling.abs() > 0.0 {
                values.energy += functional.coupling * values.functionals[id];
            }
        }
        values
    }

    fn facet_sums(&self, terms: &[Term<6>], places: &[DVec3]) -> Sums {
        let mut sums = Sums::new();
        for term in terms {
            let nodes = term.places(places);
            let nodes = &nodes[..usize::from(term.count)];
            let area = match nodes {
                [a, b, c] => 0.5 * (*b - *a).cross(*c - *a).length(),
                _ => FacetField::Area.value(nodes),
            };
            sums.energy += term.tension * area;
            sums.area += area;
            for part in &self.facet_parts[term.parts()] {
                let field = &self.facet_fields[part.field as usize];
                let value = match shifted(nodes, part.offset) {
                    Some(moved) => field.value(&moved[..nodes.len()]),
                    None => field.value(nodes),
                };
                sums.add(part.destination, part.weight * value);
            }
        }
        sums
    }

    fn edge_sums(&self, terms: &[Term<3>], places: &[DVec3]) -> Sums {
        let mut sums = Sums::new();
        for term in terms {
            let nodes = term.places(places);
            let nodes = &nodes[..usize::from(term.count)];
            let rule = self.rule(nodes.len());
            if term.tension.abs() > 0.0 {
                let length = EdgeField::Length.value(rule, nodes);
                sums.energy += term.tension * length;
                if self.strings {
                    sums.area += length;
                }
            }
            for part in &self.edge_parts[term.parts()] {
                let mut moved = [DVec3::ZERO; 3];
                for (to, from) in moved.iter_mut().zip(nodes) {
                    *to = *from + part.offset;
                }
                let value = match &self.edge_fields[part.field as usize] {
                    EdgePart::Field(field) => field.value(rule, &moved[..nodes.len()]),
                    EdgePart::Gap(wall) => edge::gap(wall, &[nodes[0], nodes[nodes.len() - 1]]),
                    EdgePart::Sliver(sliver) => sliver.value(nodes)[0],
                    EdgePart::Rim(rim) => {
                        let area = rim.value(nodes);
                        sums.area += area;
                        area
                    }
                };
                sums.add(part.destination, part.weight * value);
            }
        }
        sums
    }

    /// How many facets of films turned over by more than a right angle between two sets of places.
    pub(crate) fn turned_over(&self, old: &Places, new: &Places) -> usize {
        let normal = |term: &Term<6>, places: &Places| {
            let [a, b, c, ..] = term.places(places.as_slice());
            (b - a).cross(c - a)
        };
        let turned = |term: &&Term<6>| normal(term, old).dot(normal(term, new)) < 0.0;
        self.facets.iter().filter(|term| term.tension.abs() > 0.0).filter(turned).count()
    }

    pub(super) fn rule(&self, nodes: usize) -> &[CurvePoint] {
        &self.rules[nodes - 2]
    }
}

/// The nodes moved by `offset`; `None` where it is zero.
pub(super) fn shifted(nodes: &[DVec3], offset: DVec3) -> Option<[DVec3; 6]> {
    if offset == DVec3::ZERO {
        return None;
    }
    let mut moved = [DVec3::ZERO; 6];
    for (to, from) in moved.iter_mut().zip(nodes) {
        *to = *from + offset;
    }
    Some(moved)
}
