//! A foam of `combwright foam` as a datafile that Surface Evolver reads without a warning.
//!
//! Films become flat triangles between their nodes, eight to a biquadratic element; each cell is closed by a fan of triangles
//! without tension on each wall. Nodes stay on the walls' formulas, in full precision; the volumes are those of the triangles.

use crate::{
    foam::{
        complex::{Complex, NodeImage, Places, RegionId, RegionImage, RegionKind, Shape, WallId},
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
    },
    index::Id,
};
use glam::{DVec3, IVec3};
use std::{collections::BTreeMap, fmt::Write as _};

/// Why a foam cannot be written as a datafile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// Walls without a formula.
    #[error(
        "parallel walls of a periodic surface have no closed formula that a datafile could hold; make the foam between level sets (--delta)"
    )]
    NoFormula,
    /// Planes that cut the gap off.
    #[error(
        "a foam that ends at plane walls cannot be written as a datafile yet; make it periodic (--open-faces periodic, a whole cell)"
    )]
    CutOff,
    /// An edge over more than one period.
    #[error("an edge reaches over more than one period; a datafile's wraps are +, - and *: use more cells")]
    LongEdge,
    /// A wall is not found.
    #[error("the middle of a cell's wall patch cannot be brought onto the wall")]
    NoWall,
}

/// A point of the datafile: a node of the foam, or the middle of a wall patch.
type Vertex = usize;

/// A piece of an outline between two wrapped vertices.
type Piece = [(Vertex, IVec3); 2];

/// The digits that bring a number back as it was.
const DIGITS: usize = 17;

/// A height that stands for a missing period, in units of the foam's own extent: nothing wraps along it.
const TALL: f64 = 10.0;

struct Writer<'a> {
    complex: &'a Complex,
    vertices: Vec<(DVec3, Vec<WallId>)>,
    /// By how many periods each vertex was moved into the first cell of the lattice.
    moved: Vec<IVec3>,
    edges: BTreeMap<(Vertex, Vertex, [i32; 3]), usize>,
    edge_lines: Vec<String>,
    face_lines: Vec<String>,
    bodies: BTreeMap<RegionId, (String, f64)>,
}

/// The datafile of a foam: `title` says what made it.
///
/// # Errors
/// [`WriteError`].
pub fn foam_datafile(
    space: &FoamSpace,
    complex: &Complex,
    places: &Places,
    title: &str,
) -> Result<String, WriteError> {
    if complex.walls.iter().any(|wall| wall.field.cuts_off()) {
        return Err(WriteError::CutOff);
    }
    let head = head(space, complex, places, title)?;
    let mut writer = Writer {
        complex,
        vertices: Vec::new(),
        moved: Vec::new(),
        edges: BTreeMap::new(),
        edge_lines: Vec::new(),
        face_lines: Vec::new(),
        bodies: BTreeMap::new(),
    };
    for (id, node) in complex.nodes.enumerated() {
        writer.vertex(places[id], node.walls.clone());
    }
    writer.films()?;
    writer.patches()?;
    Ok(writer.finish(head))
}

fn number(value: f64) -> String {
    super::session::significant(value, DIGITS)
}

/// Periods, parameters and walls.
fn head(space: &FoamSpace, complex: &Complex, places: &Places, title: &str) -> Result<String, WriteError> {
    let mut out = format!("// {}\n", title.replace('\n', " "));
    let mut push = |line: String| {
        // Writing to a string does not fail.
        let _ = writeln!(out, "{line}");
    };
    push("// Films are faces of tension 1; faces of tension 0 close the cells on the walls.".to_owned());
    if complex.period.0.iter().any(Option::is_some) {
        let extent = places.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
        push("TORUS\nPERIODS".to_owned());
        for axis in 0..3 {
            let mut row = ["0".to_owned(), "0".to_owned(), "0".to_owned()];
            row[axis] = number(complex.period.0[axis].unwrap_or(TALL * extent.max(1.0)));
            push(row.join(" "));
        }
    }
    let level = |wall: usize| number(complex.walls[WallId::from_index(wall)].level);
    match *space {
        FoamSpace::Periodic { kind, period, walls } => {
            let PeriodicWalls::LevelSet { .. } = walls else { return Err(WriteError::NoFormula) };
            push(format!("PARAMETER kk = 2*pi/{}", number(period)));
            for wall in 0..complex.walls.len() {
                push(format!("PARAMETER level{} = {}", wall + 1, level(wall)));
                let formula = match kind {
                    PeriodicSurface::SchwarzP => "cos(kk*x) + cos(kk*y) + cos(kk*z)",
                    PeriodicSurface::Gyroid => {
                        "sin(kk*x)*cos(kk*y) + sin(kk*y)*cos(kk*z) + sin(kk*z)*cos(kk*x)"
                    }
                    PeriodicSurface::Diamond => {
                        "cos(kk*x)*cos(kk*y)*cos(kk*z) - sin(kk*x)*sin(kk*y)*sin(kk*z)"
                    }
                };
                push(format!("CONSTRAINT {}\nFORMULA: {formula} = level{}", wall + 1, wall + 1));
            }
        }
        FoamSpace::Sphere { radii } => {
            for (wall, radius) in radii.into_iter().enumerate() {
                push(format!("PARAMETER radius{} = {}", wall + 1, number(radius)));
                push(format!("CONSTRAINT {}\nFORMULA: sqrt(x^2 + y^2 + z^2) = radius{}", wall + 1, wall + 1));
            }
        }
        FoamSpace::Torus { ring, tubes } => {
            push(format!("PARAMETER ring = {}", number(ring)));
            for (wall, tube) in tubes.into_iter().enumerate() {
                push(format!("PARAMETER tube{} = {}", wall + 1, number(tube)));
                let formula = format!("sqrt((sqrt(x^2 + y^2) - ring)^2 + z^2) = tube{}", wall + 1);
                push(format!("CONSTRAINT {}\nFORMULA: {formula}", wall + 1));
            }
        }
        FoamSpace::Piece { .. } | FoamSpace::Box { .. } => return Err(WriteError::CutOff),
        FoamSpace::Plane { .. } => {
            for wall in 0..complex.walls.len() {
                push(format!("PARAMETER height{} = {}", wall + 1, level(wall)));
                push(format!("CONSTRAINT {}\nFORMULA: z = height{}", wall + 1, wall + 1));
            }
        }
    }
    Ok(out)
}

impl Writer<'_> {
    /// A new vertex, moved into the first cell of the lattice.
    fn vertex(&mut self, place: DVec3, walls: Vec<WallId>) -> Vertex {
        let home = self.complex.period.wrap(place, DVec3::ZERO);
        let shift = self.complex.period.nearest_shift(place - home);
        self.vertices.push((place - self.complex.period.translation(shift), walls));
        self.moved.push(shift);
        self.vertices.len() - 1
    }

    fn image(&self, image: NodeImage) -> (Vertex, IVec3) {
        let vertex = image.node.index();
        (vertex, image.shift + self.moved[vertex])
    }

    fn place(&self, (vertex, shift): (Vertex, IVec3)) -> DVec3 {
        self.vertices[vertex].0 + self.complex.period.translation(shift)
    }

    /// The number of an edge, negative where it runs from the second to the first.
    fn edge(&mut self, a: (Vertex, IVec3), b: (Vertex, IVec3)) -> Result<i64, WriteError> {
        let wrap = (b.1 - a.1).to_array();
        let backward = (a.0, wrap) > (b.0, wrap.map(|n| -n));
        let key = if backward { (b.0, a.0, wrap.map(|n| -n)) } else { (a.0, b.0, wrap) };
        let next = self.edges.len() + 1;
        let id = *self.edges.entry(key).or_insert(next);
        if id == next {
            let (tail, head, wrap) = key;
            let mut line = format!("{id}  {}  {}", tail + 1, head + 1);
            if self.complex.period.0.iter().any(Option::is_some) {
                for n in wrap {
                    line.push_str(match n {
                        0 => "  *",
                        1 => "  +",
                        -1 => "  -",
                        _ => return Err(WriteError::LongEdge),
                    });
                }
            }
            let walls = &self.vertices[head].1;
            let common: Vec<WallId> =
                self.vertices[tail].1.iter().copied().filter(|wall| walls.contains(wall)).collect();
            if let Some(wall) = common.first() {
                // Writing to a string does not fail.
                let _ = write!(line, "  constraint {}", wall.index() + 1);
            }
            self.edge_lines.push(line);
        }
        let id = i64::try_from(id).unwrap_or(i64::MAX);
        Ok(if backward { -id } else { id })
    }

    /// A triangle; its number.
    fn face(&mut self, corners: [(Vertex, IVec3); 3], rest: &str) -> Result<usize, WriteError> {
        let [a, b, c] = corners;
        let edges = [self.edge(a, b)?, self.edge(b, c)?, self.edge(c, a)?];
        let id = self.face_lines.len() + 1;
        self.face_lines.push(format!("{id}  {} {} {}  {rest}", edges[0], edges[1], edges[2]));
        Ok(id)
    }

    /// Adds a face to the body of a region, turned round or not.
    fn bound(&mut self, side: RegionImage, face: usize, corners: [(Vertex, IVec3); 3], turned: bool) {
        if self.complex.regions[side.region].kind != RegionKind::Cell {
            return;
        }
        let [a, b, c] = corners.map(|(vertex, shift)| self.place((vertex, shift - side.shift)));
        let sign = if turned { -1.0 } else { 1.0 };
        let (faces, volume) = self.bodies.entry(side.region).or_default();
        let _ = write!(faces, " {}{face}", if turned { "-" } else { "" });
        *volume += sign * a.dot(b.cross(c)) / 6.0;
    }

    fn films(&mut self) -> Result<(), WriteError> {
        let complex = self.complex;
        for film in &complex.films {
            for element in &film.elements {
                let nodes: Vec<(Vertex, IVec3)> =
                    element.nodes.iter().map(|&image| self.image(image)).collect();
                for corners in triangles(element.shape) {
                    let corners = corners.map(|at| nodes[at]);
                    let face = self.face(corners, &format!("tension {}", number(film.tension)))?;
                    self.bound(film.back, face, corners, false);
                    self.bound(film.front, face, corners, true);
                }
            }
        }
        Ok(())
    }

    /// Closes every cell on every wall by a fan round the middle of its outline.
    fn patches(&mut self) -> Result<(), WriteError> {
        let complex = self.complex;
        // The outline of each cell on each wall, in the cell's frame, running as the patch's own outline does.
        let mut outlines: BTreeMap<(RegionId, WallId), Vec<Piece>> = BTreeMap::new();
        for film in &complex.films {
            for (side, turned) in [(film.back, false), (film.front, true)] {
                if complex.regions[side.region].kind != RegionKind::Cell {
                    continue;
                }
                for element in &film.elements {
                    for (wall, edge) in complex.wall_edges(element) {
                        let own = |at: usize| {
                            let (vertex, shift) = self.image(element.nodes[at]);
                            (vertex, shift - side.shift)
                        };
                        for pair in edge.windows(2) {
                            let (from, to) = (own(pair[0]), own(pair[1]));
                            let piece = if turned { [from, to] } else { [to, from] };
                            outlines.entry((side.region, wall)).or_default().push(piece);
                        }
                    }
                }
            }
        }
        for ((region, wall), pieces) in outlines {
            let count = f64::from(crate::index::checked_u32(pieces.len()));
            let mean = pieces.iter().map(|piece| self.place(piece[0])).sum::<DVec3>() / count;
            let middle = complex.walls[wall].project(mean).map_err(|_| WriteError::NoWall)?;
            let vertex = self.vertex(middle, vec![wall]);
            let centre = (vertex, self.moved[vertex]);
            for [from, to] in pieces {
                let corners = [from, to, centre];
                let face = self.face(corners, &format!("tension 0  constraint {}", wall.index() + 1))?;
                self.bound(RegionImage { region, shift: IVec3::ZERO }, face, corners, false);
            }
        }
        Ok(())
    }

    fn finish(self, mut out: String) -> String {
        out.push_str("\nvertices\n");
        for (at, (place, walls)) in self.vertices.iter().enumerate() {
            // Writing to a string does not fail.
            let _ = write!(out, "{}  {}  {}  {}", at + 1, number(place.x), number(place.y), number(place.z));
            if !walls.is_empty() {
                let names: Vec<String> = walls.iter().map(|wall| (wall.index() + 1).to_string()).collect();
                let _ = write!(out, "  constraint {}", names.join(", "));
            }
            out.push('\n');
        }
        for (title, lines) in [("edges", &self.edge_lines), ("faces", &self.face_lines)] {
            let _ = writeln!(out, "\n{title}\n{}", lines.join("\n"));
        }
        out.push_str("\nbodies\n");
        for (region, (faces, volume)) in &self.bodies {
            let _ = writeln!(out, "{} {faces}  volume {}", region.index() + 1, number(*volume));
        }
        out
    }
}

/// The flat triangles of an element.
fn triangles(shape: Shape) -> Vec<[usize; 3]> {
    match shape {
        Shape::Tri3 => vec![[0, 1, 2]],
        Shape::Tri6 => vec![[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
        Shape::Quad9 => {
            [0, 1, 3, 4].into_iter().flat_map(|a| [[a, a + 1, a + 4], [a, a + 4, a + 3]]).collect()
        }
    }
}
