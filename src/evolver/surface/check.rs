//! What is wrong with a surface although it is well formed.

use super::{BodyId, EdgeId, Neighbours, Surface};
use crate::{
    evolver::{
        datafile::{Datafile, FaceLine, Representation},
        source::Position,
    },
    index::Id,
};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

/// A fault of a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// Faces of a body that point the wrong way: with them turned the body is a closed surface of one sense.
    Misoriented {
        /// The body's number.
        body: i64,
        /// The faces' numbers.
        faces: Vec<i64>,
        /// Where the body stands.
        position: Position,
    },
    /// A body with edges where its surface ends although no constraint or boundary could close it.
    Open {
        /// The body's number.
        body: i64,
        /// The edges' numbers.
        edges: Vec<i64>,
        /// Where the body stands.
        position: Position,
    },
    /// A vertex that no edge uses, neither fixed nor a boundary's.
    UnusedVertex {
        /// The vertex's number.
        vertex: i64,
        /// Where it stands.
        position: Position,
    },
    /// A vertex far from a constraint that it is on.
    OffConstraint {
        /// The vertex's number.
        vertex: i64,
        /// The constraint's name.
        constraint: String,
        /// What the formula gives there.
        value: f64,
        /// Where the vertex stands.
        position: Position,
    },
    /// A body whose volume changes sign, or is far from its target, is suspicious but allowed; one without faces is not.
    EmptyBody {
        /// The body's number.
        body: i64,
        /// Where it stands.
        position: Position,
    },
}

impl Fault {
    /// Whether a run would compute nonsense.
    #[must_use]
    pub fn is_grave(&self) -> bool {
        matches!(self, Self::Misoriented { .. } | Self::Open { .. } | Self::EmptyBody { .. })
    }

    /// Where it stands in the datafile.
    #[must_use]
    pub fn position(&self) -> Position {
        match self {
            Self::Misoriented { position, .. }
            | Self::Open { position, .. }
            | Self::UnusedVertex { position, .. }
            | Self::OffConstraint { position, .. }
            | Self::EmptyBody { position, .. } => *position,
        }
    }
}

fn list(numbers: &[i64]) -> String {
    let shown: Vec<String> = numbers.iter().take(8).map(i64::to_string).collect();
    let more = if numbers.len() > 8 { format!(" and {} more", numbers.len() - 8) } else { String::new() };
    shown.join(", ") + &more
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Misoriented { body, faces, .. } => write!(
                f,
                "the faces of body {body} do not all point outward: face {} points the other way than the rest. \
                 Its volume would be wrong; turn it round in the body's line (a minus sign), or run with --fix",
                list(faces)
            ),
            Self::Open { body, edges, .. } => write!(
                f,
                "body {body} is not closed: its surface ends at edge {}, which is on no constraint, boundary or \
                 fixed frame with a content",
                list(edges)
            ),
            Self::UnusedVertex { vertex, .. } => write!(f, "vertex {vertex} belongs to no edge"),
            Self::OffConstraint { vertex, constraint, value, .. } => write!(
                f,
                "vertex {vertex} lies off constraint {constraint} by {value:.3e} of its formula; it is moved onto it"
            ),
            Self::EmptyBody { body, .. } => write!(f, "body {body} has no faces"),
        }
    }
}

/// All faults of a surface just built from `data`.
#[must_use]
pub fn check(data: &Datafile, surface: &Surface) -> Vec<Fault> {
    let mut faults = Vec::new();
    if surface.representation == Representation::Soapfilm {
        for (body, line) in surface.bodies.ids().zip(&data.bodies) {
            body_faults(data, surface, (body, line.position), &mut faults);
        }
    }
    let neighbours = Neighbours::new(surface);
    for (line, id) in data.vertices.iter().zip(surface.vertices.ids()) {
        let vertex = &surface.vertices[id];
        if neighbours.edges[id].is_empty() && !vertex.middle {
            faults.push(Fault::UnusedVertex { vertex: line.id, position: line.position });
        }
        for &constraint in &vertex.common.constraints {
            let constraint = &data.constraints[constraint.index()];
            let value = constraint.formula.bind(&data.variables).value(vertex.position);
            // Surface Evolver moves vertices onto their constraints at once; only a visible move is worth a word.
            if constraint.side == crate::evolver::datafile::Side::On && value.abs() > 1e-3 {
                let constraint = constraint.name.to_string();
                faults.push(Fault::OffConstraint {
                    vertex: line.id,
                    constraint,
                    value,
                    position: line.position,
                });
            }
        }
    }
    faults
}

/// A face of a body: its line and whether the body has it turned round.
type Sided<'a> = (&'a FaceLine, bool);

fn body_faults(
    data: &Datafile,
    surface: &Surface,
    (body, position): (BodyId, Position),
    faults: &mut Vec<Fault>,
) {
    let Some(line) = data.bodies.get(body.index()) else { return };
    let by_id: BTreeMap<i64, &FaceLine> = data.faces.iter().map(|face| (face.id, face)).collect();
    let faces: Vec<Sided<'_>> = line
        .faces
        .iter()
        .filter_map(|number| by_id.get(&number.abs()).map(|face| (*face, *number < 0)))
        .collect();
    if faces.is_empty() {
        if line.attributes.volume.is_some() {
            faults.push(Fault::EmptyBody { body: line.id, position });
        }
        return;
    }
    // At each edge the faces of the body, with the sense in which they run along it.
    let mut at_edge: BTreeMap<i64, Vec<(usize, bool)>> = BTreeMap::new();
    for (index, (face, turned)) in faces.iter().enumerate() {
        for &edge in &face.edges {
            at_edge.entry(edge.abs()).or_default().push((index, (edge < 0) != *turned));
        }
    }
    let turned = minority(&faces, &at_edge);
    if !turned.is_empty() {
        faults.push(Fault::Misoriented { body: line.id, faces: turned, position });
    }
    let edges_by_id: BTreeMap<i64, EdgeId> =
        data.edges.iter().map(|edge| edge.id).zip(surface.edges.ids()).collect();
    let closable = |number: &i64| {
        edges_by_id.get(number).is_some_and(|&id| {
            let edge = &surface.edges[id];
            !edge.common.constraints.is_empty() || edge.common.boundary.is_some() || edge.common.fixed
        })
    };
    let open: Vec<i64> = at_edge
        .iter()
        .filter(|(edge, uses)| uses.len() == 1 && !closable(edge))
        .map(|(edge, _)| *edge)
        .collect();
    if !open.is_empty() && line.attributes.volconst.is_none() && !data.symmetric_content {
        faults.push(Fault::Open { body: line.id, edges: open, position });
    }
}

/// The faces to turn round so that neighbours run oppositely along their edges: the smaller part of each connected piece.
fn minority(faces: &[Sided<'_>], at_edge: &BTreeMap<i64, Vec<(usize, bool)>>) -> Vec<i64> {
    let mut links: Vec<Vec<(usize, bool)>> = vec![Vec::new(); faces.len()];
    for uses in at_edge.values() {
        if let [(a, sense_a), (b, sense_b)] = uses[..]
            && a != b
        {
            links[a].push((b, sense_a == sense_b));
            links[b].push((a, sense_a == sense_b));
        }
    }
    let mut flip: Vec<Option<bool>> = vec![None; faces.len()];
    let mut out = BTreeSet::new();
    for start in 0..faces.len() {
        if flip[start].is_some() {
            continue;
        }
        flip[start] = Some(false);
        let mut piece = vec![start];
        let mut next = 0;
        while let Some(&here) = piece.get(next) {
            next += 1;
            for &(other, clash) in &links[here] {
                if flip[other].is_none() {
                    flip[other] = Some(flip[here].unwrap_or(false) != clash);
                    piece.push(other);
                }
            }
        }
        let flipped = piece.iter().filter(|&&at| flip[at] == Some(true)).count();
        let smaller = 2 * flipped <= piece.len();
        out.extend(piece.iter().filter(|&&at| flip[at] == Some(smaller)).map(|&at| faces[at].0.id));
    }
    out.into_iter().collect()
}
