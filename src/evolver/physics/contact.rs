//! Contact lines with contents: how much volume lies between them and their walls, and what that would be worth.

use super::{
    Places,
    edge::{FINE_POINTS, rule},
    facet::FacetField,
    problem::{Contact, Destination, EdgePart, Problem},
};
use crate::{
    evolver::surface::BodyId,
    foam::complex::CurvePoint,
    index::{Id, IndexVec},
};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The contact lines of one body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactLine {
    /// The volume between the wall and the edges, signed and by absolute shares.
    pub(crate) cut: f64,
    pub(crate) magnitude: f64,
    /// The energy of the films that would fill the gaps between edges and wall.
    pub(crate) films: f64,
    /// By how much a finer rule changes the integrals along the edges.
    pub(crate) refined: f64,
    /// The middle of the edge where the finer rule changes most.
    pub(crate) worst: DVec3,
    most: f64,
    /// The edges on the wall that has the fewest.
    edges: usize,
}

/// What the volume may err by, as a part of it, with edges that turn by the angle `h`: `h²/40` for straight ones, as the energy
/// of the sphere's bubble, and `h⁴/1000` for bent ones, where that errs by `h⁴/7000`; no more than a fiftieth. On the bubbles of
/// sphere and torus as they should lie both are ten times what the volumes part by.
const STRAIGHT_ERROR: f64 = 1.0 / 40.0;
const BENT_ERROR: f64 = 1e-3;
const MOST_ERROR: f64 = 0.02;

impl ContactLine {
    fn add(&mut self, share: &Self) {
        self.cut += share.cut;
        self.magnitude += share.magnitude;
        self.films += share.films;
        self.refined += share.refined;
        if share.most > self.most {
            (self.most, self.worst) = (share.most, share.worst);
        }
    }

    /// The part of the volume by which edges as many as these err when they lie as they should.
    pub(crate) fn mesh_error(&self, quadratic: bool) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a count of edges")]
        let turn = std::f64::consts::TAU / self.edges.max(1) as f64;
        let error = if quadratic { BENT_ERROR * turn.powi(4) } else { STRAIGHT_ERROR * turn.powi(2) };
        error.min(MOST_ERROR)
    }
}

impl Default for ContactLine {
    fn default() -> Self {
        Self { cut: 0.0, magnitude: 0.0, films: 0.0, refined: 0.0, worst: DVec3::NAN, most: -1.0, edges: 0 }
    }
}

impl Problem {
    /// Whether volumes have content integrals.
    pub(crate) fn has_contents(&self) -> bool {
        !self.contacts.is_empty()
    }

    /// The contact lines of all bodies.
    pub(crate) fn contact_lines(&self, bodies: usize, places: &Places) -> IndexVec<BodyId, ContactLine> {
        let mut lines = IndexVec::from_elem(ContactLine::default(), bodies);
        let mut edges: BTreeMap<(BodyId, u32), usize> = BTreeMap::new();
        let fine = [2, 3].map(|nodes| rule(nodes, FINE_POINTS));
        let shares: Vec<ContactLine> =
            self.contacts.par_iter().map(|contact| self.contact_share(contact, places, &fine)).collect();
        for (contact, share) in self.contacts.iter().zip(shares) {
            *edges.entry((contact.body, contact.sliver)).or_default() += 1;
            lines[contact.body].add(&share);
        }
        for ((body, _), count) in edges {
            let line = &mut lines[body];
            line.edges = if line.edges == 0 { count } else { line.edges.min(count) };
        }
        lines
    }

    /// What one edge adds.
    fn contact_share(&self, contact: &Contact, places: &Places, fine: &[Vec<CurvePoint>; 2]) -> ContactLine {
        let nodes = contact.edge.places(places.as_slice());
        let nodes = &nodes[..usize::from(contact.edge.count)];
        let mut share = ContactLine::default();
        if let EdgePart::Sliver(sliver) = &self.edge_fields[contact.sliver as usize] {
            let [volume, area] = sliver.value(nodes);
            share.cut = contact.weight * volume;
            share.magnitude = volume.abs();
            share.films = contact.tension * area;
        }
        if let EdgePart::Field(field) = &self.edge_fields[contact.field as usize] {
            let change =
                field.value(&fine[nodes.len() - 2], nodes) - field.value(self.rule(nodes.len()), nodes);
            share.refined = contact.weight * change;
            share.most = change.abs();
            share.worst = 0.5 * (nodes[0] + nodes[nodes.len() - 1]);
        }
        share
    }

    /// The most that the edges of each body's contact lines could gain by what lies between them and the walls, at a pressure of
    /// half the films' energy per volume, as a multiple of the films that would fill those gaps.
    pub(crate) fn temptation(
        &self,
        places: &Places,
        lines: &IndexVec<BodyId, ContactLine>,
        volumes: &dyn Fn(BodyId) -> f64,
    ) -> f64 {
        let mut energies: IndexVec<BodyId, f64> = IndexVec::from_elem(0.0, lines.len());
        for term in self.facets.iter().filter(|term| term.tension.abs() > 0.0) {
            let nodes = term.places(places.as_slice());
            let energy = term.tension * FacetField::Area.value(&nodes[..usize::from(term.count)]);
            for part in &self.facet_parts[term.parts()] {
                if let Destination::Functional(id) = part.destination
                    && id.index() < energies.len()
                {
                    energies[BodyId::from_index(id.index())] += energy;
                }
            }
        }
        let gain = |(body, line): (BodyId, &ContactLine)| {
            0.5 * energies[body] / volumes(body) * line.magnitude / line.films
        };
        lines.enumerated().map(gain).filter(|gain| gain.is_finite()).fold(0.0, f64::max)
    }

    /// The ends of each edge of the contact lines.
    pub(crate) fn contact_ends(&self, places: &Places) -> Vec<[DVec3; 2]> {
        let ends = |contact: &Contact| {
            let nodes = contact.edge.places(places.as_slice());
            [nodes[0], nodes[usize::from(contact.edge.count) - 1]]
        };
        self.contacts.iter().map(ends).collect()
    }

    /// What lies between the walls and the edges whose slivers never count, for each body by absolute shares: along the normals
    /// of the content's wall. Edges that do not lie on that wall have none.
    pub(crate) fn kept_volumes(&self, bodies: usize, places: &Places) -> IndexVec<BodyId, f64> {
        let mut kept = IndexVec::from_elem(0.0, bodies);
        for contact in &self.kept_chords {
            let nodes = contact.edge.places(places.as_slice());
            let nodes = &nodes[..usize::from(contact.edge.count)];
            let EdgePart::Sliver(sliver) = &self.edge_fields[contact.sliver as usize] else { continue };
            if sliver.is_on_wall(nodes) {
                let volume = sliver.value(nodes)[0].abs();
                kept[contact.body] += if volume.is_finite() { volume } else { 0.0 };
            }
        }
        kept
    }
}
