//! From the lines of a datafile to the surface. Faces of more than three edges get a vertex in their middle.

use super::{
    Body, BodyId, BoundaryId, Common, ConstraintId, Directed, Edge, EdgeId, Facet, FacetId, Gone, Surface,
    Vertex, VertexId, Wall, return_to,
};
use crate::{
    evolver::{
        datafile::{
            Attributes, BodyLine, Constraint, Datafile, EdgeLine, FaceLine, Representation, VertexLine,
        },
        error::EvolverError,
        language::expression::ElementKind,
        source::{Place, Position},
    },
    index::{Id, IndexVec},
};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// Numbers of a datafile and what they are called here.
#[derive(Debug, Default)]
struct Numbers<I>(BTreeMap<i64, I>);

struct Builder<'a> {
    data: &'a Datafile,
    surface: Surface,
    vertices: Numbers<VertexId>,
    edges: Numbers<EdgeId>,
    faces: Numbers<Vec<FacetId>>,
}

impl Surface {
    /// The surface that a datafile describes.
    ///
    /// # Errors
    /// [`EvolverError::Invalid`] with the place of the line that names what does not exist or does not fit.
    pub fn new(data: &Datafile) -> Result<Self, EvolverError> {
        let mut builder = Builder {
            data,
            surface: Self {
                dimension: data.dimension,
                representation: data.representation,
                model: data.model,
                periods: data.periods,
                filled: data.filled,
                attributes: data.extra_attributes.clone(),
                vertices: IndexVec::new(),
                edges: IndexVec::new(),
                facets: IndexVec::new(),
                bodies: IndexVec::new(),
                gone: Gone::default(),
            },
            vertices: Numbers(BTreeMap::new()),
            edges: Numbers(BTreeMap::new()),
            faces: Numbers(BTreeMap::new()),
        };
        if data.dimension == 2 && data.representation != Representation::String {
            let message = "films need three dimensions; a foam in the plane is STRING".to_owned();
            let place = Place { source: data.source.clone(), position: Position { line: 1, column: 1 } };
            return Err(EvolverError::Invalid { place, message });
        }
        let middles: Vec<i64> = data.edges.iter().filter_map(|edge| edge.middle).collect();
        data.vertices.iter().try_for_each(|line| builder.vertex(line, &middles))?;
        builder.onto_constraints();
        data.edges.iter().try_for_each(|line| builder.edge(line))?;
        data.faces.iter().try_for_each(|line| builder.face(line))?;
        data.bodies.iter().try_for_each(|line| builder.body(line))?;
        Ok(builder.surface)
    }
}

impl Builder<'_> {
    fn fail<T>(&self, position: Position, message: String) -> Result<T, EvolverError> {
        Err(EvolverError::Invalid { place: Place { source: self.data.source.clone(), position }, message })
    }

    fn insert<I>(
        &self,
        numbers: &mut BTreeMap<i64, I>,
        (id, position): (i64, Position),
        kind: ElementKind,
        value: I,
    ) -> Result<(), EvolverError> {
        if id <= 0 {
            return self.fail(position, format!("the number of a {} is positive, not {id}", kind.name()));
        }
        if numbers.insert(id, value).is_some() {
            return self.fail(position, format!("{} {id} is defined twice", kind.name()));
        }
        Ok(())
    }

    fn common(
        &self,
        (id, position): (i64, Position),
        attributes: &Attributes,
        kind: ElementKind,
    ) -> Result<Common, EvolverError> {
        let mut constraints = Vec::new();
        for (name, at) in &attributes.constraints {
            match self.data.constraints.iter().position(|constraint| constraint.name == *name) {
                Some(index) => constraints.push(ConstraintId::from_index(index)),
                None => return self.fail(*at, format!("there is no constraint {name}")),
            }
        }
        for (index, constraint) in self.data.constraints.iter().enumerate() {
            let id = ConstraintId::from_index(index);
            if constraint.global && !constraints.contains(&id) {
                constraints.push(id);
            }
        }
        let mut boundary = None;
        if let Some((name, at)) = &attributes.boundary {
            match self.data.boundaries.iter().position(|boundary| boundary.name == *name) {
                Some(index) => boundary = Some(BoundaryId::from_index(index)),
                None => return self.fail(*at, format!("there is no boundary {name}")),
            }
        }
        let mut quantities = Vec::new();
        for name in &attributes.quantities {
            let index = self.data.quantities.iter().position(|quantity| quantity.name == *name);
            let Some(index) = index else {
                return self.fail(position, format!("{name} is an instance without a quantity"));
            };
            quantities.push(crate::index::checked_u32(index));
        }
        Ok(Common {
            original: attributes.original.unwrap_or(id),
            fixed: attributes.fixed,
            constraints,
            boundary,
            color: attributes.color.unwrap_or(15),
            extra: self.extra(attributes, kind),
            quantities,
        })
    }

    fn extra(&self, attributes: &Attributes, kind: ElementKind) -> Vec<f64> {
        let mut values = Vec::new();
        for attribute in self.data.extra_attributes.iter().filter(|attribute| attribute.kind == kind) {
            let given = attributes.extra.iter().find(|(name, _)| *name == attribute.name);
            match given {
                Some((_, given)) => values.extend_from_slice(given),
                None => values.extend(std::iter::repeat_n(0.0, attribute.length)),
            }
        }
        values
    }

    fn vertex(&mut self, line: &VertexLine, middles: &[i64]) -> Result<(), EvolverError> {
        let common = self.common((line.id, line.position), &line.attributes, ElementKind::Vertex)?;
        let mut parameters = [0.0; 2];
        let mut position = DVec3::ZERO;
        if let Some(boundary) = common.boundary {
            let boundary = &self.data.boundaries[boundary.index()];
            if line.numbers.len() != boundary.parameters {
                let message = format!(
                    "vertex {} on boundary {} has {} parameters, {} are needed",
                    line.id,
                    boundary.name,
                    line.numbers.len(),
                    boundary.parameters
                );
                return self.fail(line.position, message);
            }
            parameters[..line.numbers.len()].copy_from_slice(&line.numbers);
            let at = DVec3::new(parameters[0], parameters[1], 0.0);
            for (axis, formula) in boundary.coordinates.iter().enumerate() {
                if let Some(formula) = formula {
                    position[axis] = formula.bind(&self.data.variables).value(at);
                }
            }
        } else {
            for (axis, number) in line.numbers.iter().enumerate() {
                position[axis] = *number;
            }
        }
        let middle = middles.contains(&line.id);
        let vertex = Vertex { position, parameters, middle, hit: Vec::new(), common };
        let id = self.surface.vertices.push(vertex);
        let mut numbers = std::mem::take(&mut self.vertices.0);
        self.insert(&mut numbers, (line.id, line.position), ElementKind::Vertex, id)?;
        self.vertices.0 = numbers;
        Ok(())
    }

    /// Brings the vertices onto their constraints: the middles of faces are those of the places after that. What does not
    /// get there is found when the surface is first used.
    fn onto_constraints(&mut self) {
        let bind = |constraint: &Constraint| Wall {
            formula: constraint.formula.bind(&self.data.variables),
            side: constraint.side,
        };
        let walls: IndexVec<ConstraintId, Wall> = self.data.constraints.iter().map(bind).collect();
        for vertex in self.surface.vertices.as_mut_slice() {
            let own = vertex.common.constraints.iter().map(|&id| &walls[id]);
            let returned = return_to(own, 0, vertex.position);
            if returned.finite && vertex.common.boundary.is_none() {
                vertex.position = returned.place;
            }
        }
    }

    fn edge(&mut self, line: &EdgeLine) -> Result<(), EvolverError> {
        let find = |number: i64| match self.vertices.0.get(&number) {
            Some(&id) => Ok(id),
            None => {
                let message = format!("edge {} names vertex {number}, which does not exist", line.id);
                self.fail(line.position, message)
            }
        };
        let ends = [find(line.ends[0])?, find(line.ends[1])?];
        let middle = line.middle.map(find).transpose()?;
        let common = self.common((line.id, line.position), &line.attributes, ElementKind::Edge)?;
        let string = self.data.representation == Representation::String;
        let edge = Edge {
            ends,
            middle,
            wrap: IVec3::from_array(line.wrap),
            tension: line.attributes.tension.unwrap_or(if string { 1.0 } else { 0.0 }),
            no_refine: line.attributes.no_refine,
            noncontent: line.attributes.noncontent,
            common,
        };
        let id = self.surface.edges.push(edge);
        let mut numbers = std::mem::take(&mut self.edges.0);
        self.insert(&mut numbers, (line.id, line.position), ElementKind::Edge, id)?;
        self.edges.0 = numbers;
        Ok(())
    }

    fn face(&mut self, line: &FaceLine) -> Result<(), EvolverError> {
        let mut edges = Vec::with_capacity(line.edges.len());
        for &number in &line.edges {
            match self.edges.0.get(&number.abs()) {
                Some(&edge) => edges.push(Directed { edge, reversed: number < 0 }),
                None => {
                    let message =
                        format!("face {} names edge {}, which does not exist", line.id, number.abs());
                    return self.fail(line.position, message);
                }
            }
        }
        let string = self.data.representation == Representation::String;
        if edges.is_empty() || (!string && edges.len() < 3) {
            let message = format!("face {} has {} edges; a face has at least three", line.id, edges.len());
            return self.fail(line.position, message);
        }
        self.check_loop(line, &edges)?;
        let common = self.common((line.id, line.position), &line.attributes, ElementKind::Facet)?;
        let facet = Facet {
            edges,
            bodies: [None, None],
            tension: line.attributes.tension.unwrap_or(if string { 0.0 } else { 1.0 }),
            no_refine: line.attributes.no_refine,
            noncontent: line.attributes.noncontent,
            common,
        };
        let ids = if string || facet.edges.len() == 3 {
            vec![self.surface.facets.push(facet)]
        } else {
            self.triangulate(facet)
        };
        let mut numbers = std::mem::take(&mut self.faces.0);
        self.insert(&mut numbers, (line.id, line.position), ElementKind::Facet, ids)?;
        self.faces.0 = numbers;
        Ok(())
    }

    /// Each edge must start where the one before ends; an open chain is allowed in the string model.
    fn check_loop(&self, line: &FaceLine, edges: &[Directed]) -> Result<(), EvolverError> {
        let count = edges.len();
        let open = usize::from(self.data.representation == Representation::String);
        let mut wrap = IVec3::ZERO;
        for (at, &edge) in edges.iter().enumerate() {
            wrap += self.surface.wrap(edge);
            if at + open >= count {
                continue;
            }
            let next = (at + 1) % count;
            if self.surface.head(edge) != self.surface.tail(edges[next]) {
                let message = format!(
                    "face {} is no loop: edge {} does not start where edge {} ends. A minus sign turns an edge round",
                    line.id, line.edges[next], line.edges[at]
                );
                return self.fail(line.position, message);
            }
        }
        let closed = self.surface.head(edges[count - 1]) == self.surface.tail(edges[0]);
        if closed && wrap != IVec3::ZERO {
            let message = format!("the wraps of face {} do not add up to zero but to {wrap}", line.id);
            return self.fail(line.position, message);
        }
        Ok(())
    }

    /// A fan of triangles round a new vertex at the mean of the corners.
    fn triangulate(&mut self, face: Facet) -> Vec<FacetId> {
        let count = face.edges.len();
        let mut wraps = Vec::with_capacity(count);
        let (mut wrap, mut sum) = (IVec3::ZERO, DVec3::ZERO);
        for &edge in &face.edges {
            wraps.push(wrap);
            sum += self.surface.place((self.surface.tail(edge), wrap));
            wrap += self.surface.wrap(edge);
        }
        #[expect(clippy::cast_precision_loss, reason = "a face has few corners")]
        let position = sum / count as f64;
        let inner = Common { original: 0, extra: Vec::new(), quantities: Vec::new(), ..face.common.clone() };
        let vertex = self.surface.vertices.push(Vertex {
            position,
            parameters: [0.0; 2],
            middle: false,
            hit: Vec::new(),
            common: Common {
                extra: vec![0.0; self.surface.extra_length(ElementKind::Vertex)],
                boundary: face.common.boundary,
                ..inner.clone()
            },
        });
        // Spokes run from the middle out.
        let spokes: Vec<EdgeId> = face
            .edges
            .iter()
            .zip(&wraps)
            .map(|(&edge, &wrap)| {
                self.surface.edges.push(Edge {
                    ends: [vertex, self.surface.tail(edge)],
                    middle: None,
                    wrap,
                    tension: 0.0,
                    no_refine: face.no_refine,
                    noncontent: false,
                    common: Common {
                        extra: vec![0.0; self.surface.extra_length(ElementKind::Edge)],
                        ..inner.clone()
                    },
                })
            })
            .collect();
        (0..count)
            .map(|at| {
                let out = Directed { edge: spokes[at], reversed: false };
                let back = Directed { edge: spokes[(at + 1) % count], reversed: true };
                self.surface.facets.push(Facet { edges: vec![face.edges[at], back, out], ..face.clone() })
            })
            .collect()
    }

    fn body(&mut self, line: &BodyLine) -> Result<(), EvolverError> {
        let attributes = &line.attributes;
        if self.surface.bodies.iter().any(|body| body.id == line.id) {
            return self.fail(line.position, format!("body {} is defined twice", line.id));
        }
        let id: BodyId = self.surface.bodies.push(Body {
            id: line.id,
            target: attributes.volume,
            volconst: attributes.volconst.unwrap_or(0.0),
            density: attributes.density.unwrap_or(0.0),
            pressure: attributes.pressure.unwrap_or(0.0),
            prescribed: attributes.pressure.is_some() && attributes.volume.is_none(),
            extra: self.extra(attributes, ElementKind::Body),
        });
        for &number in &line.faces {
            let Some(facets) = self.faces.0.get(&number.abs()) else {
                let message = format!("body {} names face {}, which does not exist", line.id, number.abs());
                return self.fail(line.position, message);
            };
            let side = usize::from(number < 0);
            for &facet in facets {
                let place = &mut self.surface.facets[facet].bodies[side];
                if let Some(other) = place.replace(id) {
                    let other = self.surface.bodies[other].id;
                    let message = format!(
                        "face {} has body {other} and body {} on the same side; turn it round in one of them",
                        number.abs(),
                        line.id
                    );
                    return self.fail(line.position, message);
                }
            }
        }
        Ok(())
    }
}

impl Surface {
    /// How many numbers the added attributes of a kind hold.
    pub(crate) fn extra_length(&self, kind: ElementKind) -> usize {
        self.attributes
            .iter()
            .filter(|attribute| attribute.kind == kind)
            .map(|attribute| attribute.length)
            .sum()
    }
}
