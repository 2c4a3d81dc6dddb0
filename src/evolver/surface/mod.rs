//! The surface that a datafile describes, with typed ids: a non-manifold mesh of facets (loops of edges, in the string
//! model) with bodies on their sides.
//!
//! | step | file |
//! |---|---|
//! | from the datafile's lines; faces to triangles | `build.rs` |
//! | bodies that are not closed, fronts that clash, elements of no use | `check.rs` |
//! | who borders on whom | `neighbours.rs` |
//! | which image of a facet a body has in a torus | `images.rs` |
//! | refinement; linear and quadratic elements | `refine.rs` |
//! | swaps of edges, averages of vertices | `improve.rs` |
//! | removal of short edges and small facets | `collapse.rs` |
//! | T1s and pops: of strings, of lines of films, of points of films | `pop_string.rs`, `pop_film.rs`, `pop_vertex.rs` |
//! | places brought back onto their constraints | `constrain.rs` |

mod build;
mod check;
mod collapse;
mod constrain;
mod images;
mod improve;
mod neighbours;
mod pop_film;
mod pop_string;
mod pop_vertex;
mod refine;

pub use check::{Fault, check};
pub(crate) use constrain::{Wall, multipliers, return_to};
pub(crate) use images::body_images;
pub(crate) use improve::one_sided;
pub(crate) use neighbours::{Kind, Neighbours};

use super::datafile::{ExtraAttribute, Model, Representation};
use crate::index::IndexVec;
use glam::{DMat3, DVec3, IVec3};

crate::define_id!(
    /// A vertex of a [`Surface`].
    VertexId
);
crate::define_id!(
    /// An edge of a [`Surface`].
    EdgeId
);
crate::define_id!(
    /// A facet of a [`Surface`].
    FacetId
);
crate::define_id!(
    /// A body of a [`Surface`].
    BodyId
);
crate::define_id!(
    /// A constraint of a datafile.
    ConstraintId
);
crate::define_id!(
    /// A boundary of a datafile.
    BoundaryId
);

/// What every element has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Common {
    /// The number in the datafile of the element that this one came from; 0 if from none.
    pub original: i64,
    /// Whether it may not move (vertices) or be changed.
    pub fixed: bool,
    /// The constraints that it is on.
    pub constraints: Vec<ConstraintId>,
    /// The boundary that it is on.
    pub boundary: Option<BoundaryId>,
    /// Its colour's number.
    pub color: i32,
    /// Values of added attributes, one after the other.
    pub extra: Vec<f64>,
    /// The quantities and method instances that are taken over it by name.
    pub quantities: Vec<u32>,
}

/// A vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct Vertex {
    /// Its place.
    pub position: DVec3,
    /// The parameters on its boundary.
    pub parameters: [f64; 2],
    /// Whether it is the middle of a quadratic edge.
    pub middle: bool,
    /// The one-sided constraints that it sits on.
    pub hit: Vec<ConstraintId>,
    /// The rest.
    pub common: Common,
}

/// An edge.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Tail and head.
    pub ends: [VertexId; 2],
    /// The middle, in the tail's frame, of a quadratic edge.
    pub middle: Option<VertexId>,
    /// How many periods lie between tail and head.
    pub wrap: IVec3,
    /// Energy per length.
    pub tension: f64,
    /// Not to be divided.
    pub no_refine: bool,
    /// Not part of content integrals.
    pub noncontent: bool,
    /// The rest.
    pub common: Common,
}

/// An edge with a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Directed {
    /// The edge.
    pub edge: EdgeId,
    /// Whether from head to tail.
    pub reversed: bool,
}

impl Directed {
    /// The other direction.
    #[must_use]
    pub fn turned(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }
}

/// A facet: a triangle, or a loop of edges in the string model.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Its edges; its normal is right-handed to them.
    pub edges: Vec<Directed>,
    /// The body that the normal points out of, and the body that it points into.
    pub bodies: [Option<BodyId>; 2],
    /// Energy per area.
    pub tension: f64,
    /// Not to be divided.
    pub no_refine: bool,
    /// Not part of volumes.
    pub noncontent: bool,
    /// The rest.
    pub common: Common,
}

/// A body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Its number in the datafile.
    pub id: i64,
    /// The volume that it shall have.
    pub target: Option<f64>,
    /// What is added to the integral of its volume.
    pub volconst: f64,
    /// Mass per volume.
    pub density: f64,
    /// The pressure: given, or the multiplier of the volume.
    pub pressure: f64,
    /// Whether the pressure is given.
    pub prescribed: bool,
    /// Values of added attributes.
    pub extra: Vec<f64>,
}

/// The surface.
#[derive(Clone, Debug)]
pub struct Surface {
    /// 2 or 3.
    pub dimension: usize,
    /// Films or strings.
    pub representation: Representation,
    /// Flat or bent elements.
    pub model: Model,
    /// The periods as columns, if there are any.
    pub periods: Option<DMat3>,
    /// Whether the bodies fill the torus.
    pub filled: bool,
    /// Added attributes; values lie in [`Common::extra`] in this order.
    pub attributes: Vec<ExtraAttribute>,
    /// Vertices.
    pub vertices: IndexVec<VertexId, Vertex>,
    /// Edges.
    pub edges: IndexVec<EdgeId, Edge>,
    /// Facets.
    pub facets: IndexVec<FacetId, Facet>,
    /// Bodies.
    pub bodies: IndexVec<BodyId, Body>,
    /// Deletions leave gaps: which elements are gone.
    pub gone: Gone,
}

/// Elements that were deleted since the surface was last packed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Gone {
    pub(crate) vertices: Vec<VertexId>,
    pub(crate) edges: Vec<EdgeId>,
    pub(crate) facets: Vec<FacetId>,
}

impl Surface {
    /// The vector of `wrap` periods.
    #[must_use]
    pub fn translation(&self, wrap: IVec3) -> DVec3 {
        match self.periods {
            Some(periods) => periods * wrap.as_dvec3(),
            None => DVec3::ZERO,
        }
    }

    /// The volume of the torus, if there is one; its area in the plane.
    pub(crate) fn torus_volume(&self) -> Option<f64> {
        self.periods.map(|periods| match self.dimension {
            2 => periods.x_axis.cross(periods.y_axis).length(),
            _ => periods.determinant().abs(),
        })
    }

    /// The vertex that a directed edge starts from.
    #[must_use]
    pub fn tail(&self, directed: Directed) -> VertexId {
        self.edges[directed.edge].ends[usize::from(directed.reversed)]
    }

    /// The vertex that a directed edge leads to.
    #[must_use]
    pub fn head(&self, directed: Directed) -> VertexId {
        self.tail(directed.turned())
    }

    /// The periods between tail and head of a directed edge.
    #[must_use]
    pub fn wrap(&self, directed: Directed) -> IVec3 {
        let wrap = self.edges[directed.edge].wrap;
        if directed.reversed { -wrap } else { wrap }
    }

    /// From tail to head.
    #[must_use]
    pub fn side(&self, directed: Directed) -> DVec3 {
        self.vertices[self.head(directed)].position + self.translation(self.wrap(directed))
            - self.vertices[self.tail(directed)].position
    }

    /// The corners of a facet with their wraps, from the tail of its first edge, which has none; the middles behind them
    /// in the quadratic model.
    #[must_use]
    pub fn corners(&self, facet: FacetId) -> Vec<(VertexId, IVec3)> {
        let mut wrap = IVec3::ZERO;
        let mut corners = Vec::with_capacity(6);
        let mut middles = Vec::with_capacity(3);
        for &directed in &self.facets[facet].edges {
            corners.push((self.tail(directed), wrap));
            let next = wrap + self.wrap(directed);
            if let Some(middle) = self.edges[directed.edge].middle {
                // A middle lies in its edge's tail's frame.
                middles.push((middle, if directed.reversed { next } else { wrap }));
            }
            wrap = next;
        }
        corners.extend(middles);
        corners
    }

    /// The place of a wrapped vertex.
    #[must_use]
    pub fn place(&self, (vertex, wrap): (VertexId, IVec3)) -> DVec3 {
        self.vertices[vertex].position + self.translation(wrap)
    }

    /// The area vector of a facet from its corners: half the sum of cross products.
    #[must_use]
    pub fn area_vector(&self, facet: FacetId) -> DVec3 {
        if let [a, b, _] = self.facets[facet].edges[..] {
            return 0.5 * self.side(a).cross(self.side(b));
        }
        let count = self.facets[facet].edges.len();
        let places: Vec<DVec3> =
            self.corners(facet)[..count].iter().map(|&corner| self.place(corner)).collect();
        let Some(&origin) = places.first() else { return DVec3::ZERO };
        0.5 * places.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum::<DVec3>()
    }

    /// The area of a facet; of the loop's plane area in the string model.
    #[must_use]
    pub fn facet_area(&self, facet: FacetId) -> f64 {
        let nodes: Vec<DVec3> = self.corners(facet).into_iter().map(|corner| self.place(corner)).collect();
        match (self.representation, nodes.len()) {
            (Representation::Soapfilm, 6) => {
                crate::foam::energy::element_area(crate::foam::complex::Shape::Tri6, &nodes)
            }
            (Representation::Soapfilm, _) => self.area_vector(facet).length(),
            (Representation::String, _) => self.area_vector(facet).z,
        }
    }

    /// The length of an edge.
    #[must_use]
    pub fn edge_length(&self, edge: EdgeId) -> f64 {
        let Some(middle) = self.edges[edge].middle else { return self.chord(edge) };
        let tail = self.vertices[self.edges[edge].ends[0]].position;
        let nodes =
            [tail, self.vertices[middle].position, tail + self.side(Directed { edge, reversed: false })];
        crate::foam::complex::curve_points(3, 4)
            .iter()
            .map(|point| point.weight * (0..3).map(|i| point.dt[i] * nodes[i]).sum::<DVec3>().length())
            .sum()
    }

    /// The length of an edge's chord.
    #[must_use]
    pub fn chord(&self, edge: EdgeId) -> f64 {
        self.side(Directed { edge, reversed: false }).length()
    }
}
