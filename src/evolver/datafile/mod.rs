//! What a datafile says, statement by statement, with the values of its parameters put in.
//!
//! | part | file |
//! |---|---|
//! | the order of sections; settings | `header.rs` |
//! | constraints, boundaries, quantities, functions | `definitions.rs` |
//! | vertices, edges, faces, bodies | `elements.rs` |

mod definitions;
mod elements;
mod header;

use super::{
    command::Statement,
    error::EvolverError,
    language::{
        Cursor,
        expression::{ElementKind, Expression, Function},
        formula::{Formula, GRAVITY, Names, NoFormula, Space, Variables},
    },
    source::{Position, Source},
};
use glam::{DMat3, DVec3};
use std::{collections::BTreeMap, sync::Arc};

/// The number of a colour's name.
pub(crate) fn color_named(name: &str) -> Option<i32> {
    elements::COLORS.iter().position(|color| *color == name).and_then(|at| i32::try_from(at).ok())
}

/// The dimension of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Representation {
    /// Films in space, made of triangles.
    Soapfilm,
    /// Films in the plane (or threads in space), made of edges.
    String,
}

/// How elements are bent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Flat triangles and straight edges.
    Linear,
    /// Quadratic triangles and edges.
    Quadratic,
}

/// On which side of a constraint a vertex may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// On it.
    On,
    /// Where the formula is not negative.
    NonNegative,
    /// Where the formula is not positive.
    NonPositive,
}

/// A vector of formulas; what is not given is zero.
pub type FormulaVector = [Option<Formula>; 3];

/// A `constraint`.
#[derive(Clone, Debug)]
pub struct Constraint {
    /// Its number or name.
    pub name: Arc<str>,
    /// Where it is defined.
    pub position: Position,
    /// Zero on the constraint.
    pub formula: Formula,
    /// The side.
    pub side: Side,
    /// Whether edges bulge from a convex wall: the gap between chord and wall has an energy.
    pub convex: bool,
    /// Whether all vertices are on it.
    pub global: bool,
    /// The energy integrand along edges.
    pub energy: Option<FormulaVector>,
    /// The content integrand along edges.
    pub content: Option<FormulaVector>,
}

/// A `boundary`.
#[derive(Clone, Debug)]
pub struct Boundary {
    /// Its number or name.
    pub name: Arc<str>,
    /// How many parameters it has: 1 or 2.
    pub parameters: usize,
    /// The coordinates as formulas of the parameters.
    pub coordinates: FormulaVector,
    /// The energy integrand along edges, as formulas of the coordinates.
    pub energy: Option<FormulaVector>,
    /// The content integrand along edges.
    pub content: Option<FormulaVector>,
}

/// What a quantity is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    /// Its value times its modulus is part of the energy.
    Energy,
    /// It is held at a value.
    Fixed(f64),
    /// It is only reported.
    Information,
}

/// How a quantity is computed.
#[derive(Clone, Debug)]
pub enum Method {
    /// The area of facets.
    FacetArea,
    /// The length of edges.
    EdgeLength,
    /// Tension times length of edges.
    EdgeTension,
    /// Tension times area of facets.
    FacetTension,
    /// A scalar integrated over facets.
    FacetScalarIntegral(Formula),
    /// The flux of a vector through facets.
    FacetVectorIntegral(FormulaVector),
    /// A scalar integrated along edges.
    EdgeScalarIntegral(Formula),
    /// A vector integrated along edges.
    EdgeVectorIntegral(FormulaVector),
    /// A scalar summed over vertices.
    VertexScalarIntegral(Formula),
    /// The volume below facets.
    FacetVolume,
}

/// A quantity, or an instance of a method.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Its name.
    pub name: Arc<str>,
    /// Where it is defined.
    pub position: Position,
    /// What it is for.
    pub purpose: Purpose,
    /// What its value is multiplied by.
    pub modulus: f64,
    /// The methods that it sums, with their moduli; whether over all elements.
    pub methods: Vec<MethodInstance>,
}

/// A method with its modulus.
#[derive(Clone, Debug)]
pub struct MethodInstance {
    /// The name of the instance, or of the quantity.
    pub name: Arc<str>,
    /// The method.
    pub method: Method,
    /// What its value is multiplied by.
    pub modulus: f64,
    /// Whether it is taken over all elements.
    pub global: bool,
}

/// An attribute that a datafile adds to elements.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraAttribute {
    /// On what.
    pub kind: ElementKind,
    /// Its name, lower case.
    pub name: Arc<str>,
    /// How many numbers it holds by each of its indices; none if it is one number.
    pub sizes: Vec<usize>,
    /// How many numbers it holds.
    pub length: usize,
    /// Whether they are whole.
    pub integer: bool,
}

/// What a line of an element says behind its definition.
#[derive(Clone, Debug, Default)]
pub struct Attributes {
    /// `fixed`.
    pub fixed: bool,
    /// Names of constraints.
    pub constraints: Vec<(Arc<str>, Position)>,
    /// The name of a boundary.
    pub boundary: Option<(Arc<str>, Position)>,
    /// `tension`, or `density` of edges and facets.
    pub tension: Option<f64>,
    /// `density` of bodies.
    pub density: Option<f64>,
    /// `color`.
    pub color: Option<i32>,
    /// `original`.
    pub original: Option<i64>,
    /// `no_refine`.
    pub no_refine: bool,
    /// `noncontent`.
    pub noncontent: bool,
    /// `volume` of bodies.
    pub volume: Option<f64>,
    /// `volconst` of bodies.
    pub volconst: Option<f64>,
    /// `pressure` of bodies.
    pub pressure: Option<f64>,
    /// Names of quantities and method instances.
    pub quantities: Vec<Arc<str>>,
    /// Values of extra attributes.
    pub extra: Vec<(Arc<str>, Vec<f64>)>,
}

/// A vertex.
#[derive(Clone, Debug)]
pub struct VertexLine {
    /// Its number.
    pub id: i64,
    /// Where it stands.
    pub position: Position,
    /// Coordinates, or parameters of its boundary.
    pub numbers: Vec<f64>,
    /// The rest.
    pub attributes: Attributes,
}

/// An edge.
#[derive(Clone, Debug)]
pub struct EdgeLine {
    /// Its number.
    pub id: i64,
    /// Where it stands.
    pub position: Position,
    /// Tail and head.
    pub ends: [i64; 2],
    /// The middle, where it is given.
    pub middle: Option<i64>,
    /// How many periods lie between tail and head.
    pub wrap: [i32; 3],
    /// The rest.
    pub attributes: Attributes,
}

/// A face: a loop of edges, negative where backwards.
#[derive(Clone, Debug)]
pub struct FaceLine {
    /// Its number.
    pub id: i64,
    /// Where it stands.
    pub position: Position,
    /// The edges.
    pub edges: Vec<i64>,
    /// The rest.
    pub attributes: Attributes,
}

/// A body: faces, negative where they point inward.
#[derive(Clone, Debug)]
pub struct BodyLine {
    /// Its number.
    pub id: i64,
    /// Where it stands.
    pub position: Position,
    /// The faces.
    pub faces: Vec<i64>,
    /// The rest.
    pub attributes: Attributes,
}

/// A datafile.
#[derive(Debug)]
pub struct Datafile {
    /// The text.
    pub source: Arc<Source>,
    /// 2 or 3.
    pub dimension: usize,
    /// Films or strings.
    pub representation: Representation,
    /// Flat or bent elements.
    pub model: Model,
    /// The periods as columns, if there are any.
    pub periods: Option<DMat3>,
    /// `torus_filled`: the bodies fill the torus.
    pub filled: bool,
    /// Parameters and variables.
    pub variables: Variables,
    /// Which variables are parameters.
    pub parameters: Vec<Arc<str>>,
    /// Functions.
    pub functions: BTreeMap<Arc<str>, Function>,
    /// Constraints in order.
    pub constraints: Vec<Constraint>,
    /// Boundaries in order.
    pub boundaries: Vec<Boundary>,
    /// Quantities in order.
    pub quantities: Vec<Quantity>,
    /// What the definitions do before the `read` section: procedures, functions of several statements, arrays.
    pub prelude: Vec<Statement>,
    /// Added attributes.
    pub extra_attributes: Vec<ExtraAttribute>,
    /// Whether gravity acts.
    pub gravity: bool,
    /// Whether volumes are the flux of x/3 instead of z.
    pub symmetric_content: bool,
    /// The energy of gaps at convex walls.
    pub gap_constant: f64,
    /// How many Gauss points an edge integral has, where the datafile says so.
    pub edge_points: Option<usize>,
    /// The step of `g`, where the datafile says so, and whether it is fixed.
    pub scale: Option<(f64, bool)>,
    /// The largest step of `g`.
    pub scale_limit: Option<f64>,
    /// Vertices.
    pub vertices: Vec<VertexLine>,
    /// Edges.
    pub edges: Vec<EdgeLine>,
    /// Faces.
    pub faces: Vec<FaceLine>,
    /// Bodies.
    pub bodies: Vec<BodyLine>,
    /// Settings that change nothing here, with their places.
    pub ignored: Vec<(String, Position)>,
    /// Where the section of the vertices begins.
    pub vertices_at: Option<Position>,
    /// Where the word `read` stands.
    pub read_at: Option<Position>,
}

impl Datafile {
    /// Reads the definitions and the elements; what remains in the cursor is the `read` section.
    pub(crate) fn read(source: &Arc<Source>) -> Result<(Self, Cursor), EvolverError> {
        let mut reader = Reader {
            cursor: Cursor::new(source)?,
            data: Self::empty(source.clone()),
            instances: BTreeMap::new(),
        };
        reader.sections()?;
        Ok((reader.data, reader.cursor))
    }

    /// The values of the variables that formulas depend on: where they are the same, so is everything that formulas give.
    pub(crate) fn formula_inputs(&self, variables: &Variables) -> Vec<f64> {
        let mut inputs = Vec::new();
        let mut vectors: Vec<&FormulaVector> = Vec::new();
        for constraint in &self.constraints {
            constraint.formula.inputs(variables, &mut inputs);
            vectors.extend(constraint.energy.iter().chain(&constraint.content));
        }
        for boundary in &self.boundaries {
            vectors.push(&boundary.coordinates);
            vectors.extend(boundary.energy.iter().chain(&boundary.content));
        }
        for instance in self.quantities.iter().flat_map(|quantity| &quantity.methods) {
            match &instance.method {
                Method::FacetScalarIntegral(f)
                | Method::EdgeScalarIntegral(f)
                | Method::VertexScalarIntegral(f) => {
                    f.inputs(variables, &mut inputs);
                }
                Method::FacetVectorIntegral(v) | Method::EdgeVectorIntegral(v) => vectors.push(v),
                _ => {}
            }
        }
        vectors.into_iter().flatten().flatten().for_each(|formula| formula.inputs(variables, &mut inputs));
        inputs
    }

    fn empty(source: Arc<Source>) -> Self {
        let mut variables = Variables::default();
        variables.set(GRAVITY, 1.0);
        Self {
            source,
            dimension: 3,
            representation: Representation::Soapfilm,
            model: Model::Linear,
            periods: None,
            filled: false,
            variables,
            parameters: Vec::new(),
            functions: BTreeMap::new(),
            constraints: Vec::new(),
            boundaries: Vec::new(),
            quantities: Vec::new(),
            prelude: Vec::new(),
            extra_attributes: Vec::new(),
            gravity: true,
            symmetric_content: false,
            gap_constant: 1.0,
            edge_points: None,
            scale: None,
            scale_limit: None,
            vertices: Vec::new(),
            edges: Vec::new(),
            faces: Vec::new(),
            bodies: Vec::new(),
            ignored: Vec::new(),
            vertices_at: None,
            read_at: None,
        }
    }
}

/// Reads a datafile.
struct Reader {
    cursor: Cursor,
    data: Datafile,
    instances: BTreeMap<Arc<str>, MethodInstance>,
}

impl Reader {
    fn compile(
        &self,
        expression: &Expression,
        space: Space,
        position: Position,
    ) -> Result<Formula, EvolverError> {
        let names = Names {
            variables: &self.data.variables,
            functions: &self.data.functions,
            space,
            dimension: if space == Space::Parameters { 3 } else { self.data.dimension },
        };
        Formula::new(expression, &names).map_err(|mut error| {
            let attribute =
                |extra: &ExtraAttribute| error.message == format!("«{}» is not defined", extra.name);
            if self.data.extra_attributes.iter().any(attribute) {
                error = NoFormula {
                    message: "an added attribute inside a formula".to_owned(),
                    unsupported: true,
                    ..error
                };
            }
            no_formula(&self.cursor, error, position)
        })
    }

    /// A formula up to where the next thing must begin.
    fn formula(&mut self, space: Space) -> Result<Formula, EvolverError> {
        let position = self.cursor.position();
        let expression = self.cursor.expression()?;
        self.compile(&expression, space, position)
    }

    /// A number: an expression of parameters.
    fn number(&mut self) -> Result<f64, EvolverError> {
        let position = self.cursor.position();
        let expression = self.cursor.list_expression()?;
        let value = self
            .compile(&expression, Space::Nothing, position)?
            .bind(&self.data.variables)
            .value(DVec3::ZERO);
        if value.is_finite() {
            Ok(value)
        } else {
            self.cursor.invalid(position, format!("this is {value}, not a finite number"))
        }
    }
}

/// The error of an expression that is no formula.
pub(crate) fn no_formula(cursor: &Cursor, error: NoFormula, position: Position) -> EvolverError {
    let at = if error.position == Position::default() { position } else { error.position };
    let place = cursor.place_at(at);
    if error.unsupported {
        EvolverError::Unsupported { what: error.message, place, hint: String::new() }
    } else {
        EvolverError::Invalid { place, message: error.message }
    }
}
