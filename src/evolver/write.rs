//! A foam of `combwright foam` as a datafile that Surface Evolver reads without a warning.
//!
//! Films become flat triangles between their nodes, eight to a biquadratic element; each cell is closed by a fan of triangles
//! without tension on each wall, and on each plane that cuts the gap off. Nodes stay on the walls' formulas, in full precision;
//! the volumes are those of the triangles.

use crate::{
    foam::{
        complex::{Complex, NodeImage, Places, RegionId, RegionImage, RegionKind, Shape, WallId},
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls},
    },
    index::Id,
    surface::Wall,
};
use glam::{DVec3, IVec3};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
};

/// Why a foam cannot be written as a datafile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WriteError {
    /// Walls without a formula.
    #[error(
        "parallel walls of a periodic surface have no closed formula that a datafile could hold; make the foam between level sets (--delta)"
    )]
    NoFormula,
    /// An edge over more than one period.
    #[error("an edge reaches over more than one period; a datafile's wraps are +, - and *: use more cells")]
    LongEdge,
    /// A wall is not found.
    #[error("a place near {0} cannot be brought onto a cell's walls")]
    NoWall(DVec3),
}

/// A point of the datafile: a node of the foam, or the middle of a wall patch.
type Vertex = usize;

/// A vertex and its shift in periods.
type Point = (Vertex, IVec3);

/// A piece of an outline between two wrapped vertices.
type Piece = [Point; 2];

/// The outline of each cell on each wall, in the cell's frame, running as the patch's own outline does.
type Outlines = BTreeMap<(RegionId, WallId), Vec<Piece>>;

/// Pieces of the line along which a wall meets a plane that cuts it off, between the ends of two films.
const RIM_PIECES: u32 = 4;
/// Steps of the search for a place on several walls: Newton's, from within a cell.
const ONTO_STEPS: usize = 30;

/// The digits that bring a number back as it was.
const DIGITS: usize = 17;

/// What to do about volumes where walls are curved.
const VOLUMES: [&str; 2] = [
    "// Volumes are those between these flat faces, on curved walls a little too small and unequal. To equal ones, again after",
    "// each refinement (r, V):  each := avg(bodies, volume); set bodies target each; g 50",
];

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
    for line in VOLUMES {
        push(line.to_owned());
    }
    if complex.period.0.iter().any(Option::is_some) {
        let extent = places.iter().fold(0.0, |most: f64, p| most.max(p.abs().max_element()));
        push("TORUS\nPERIODS".to_owned());
        for axis in 0..3 {
            let mut row = ["0".to_owned(), "0".to_owned(), "0".to_owned()];
            row[axis] = number(complex.period.0[axis].unwrap_or(TALL * extent.max(1.0)));
            push(row.join(" "));
        }
    }
    for line in walls(space, complex)? {
        push(line);
    }
    Ok(out)
}

/// Parameters and constraints: the walls of the gap, then the planes that cut it off.
fn walls(space: &FoamSpace, complex: &Complex) -> Result<Vec<String>, WriteError> {
    let mut lines = Vec::new();
    let mut wall = |id: WallId, name: &str, value: f64, formula: &str| {
        let at = id.index() + 1;
        lines.push(format!("PARAMETER {name}{at} = {}", number(value)));
        lines.push(format!("CONSTRAINT {at}\nFORMULA: {formula} = {name}{at}"));
    };
    let (planes, own): (Vec<_>, Vec<_>) =
        complex.walls.enumerated().partition(|(_, wall)| wall.field.cuts_off());
    for (id, Wall { level, .. }) in own {
        match *space {
            FoamSpace::Periodic { walls: PeriodicWalls::Parallel { .. }, .. }
            | FoamSpace::Piece { walls: PeriodicWalls::Parallel { .. }, .. } => {
                return Err(WriteError::NoFormula);
            }
            FoamSpace::Periodic { kind, period, .. } => {
                wall(id, "level", *level, &periodic_formula(kind, period));
            }
            FoamSpace::Piece { period, .. } => {
                wall(id, "level", *level, &periodic_formula(PeriodicSurface::SchwarzP, period));
            }
            FoamSpace::Sphere { radii } => {
                wall(id, "radius", radii[id.index()], "sqrt(x^2 + y^2 + z^2)");
            }
            FoamSpace::Torus { ring, tubes } => {
                let formula = format!("sqrt((sqrt(x^2 + y^2) - {})^2 + z^2)", number(ring));
                wall(id, "tube", tubes[id.index()], &formula);
            }
            FoamSpace::Plane { .. } | FoamSpace::Box { .. } => wall(id, "height", *level, "z"),
        }
    }
    for (id, plane) in planes {
        let axis = (0..3).find(|&axis| plane.field.normal(DVec3::ZERO)[axis].abs() > 0.5).unwrap_or(2);
        let foot = plane.project(DVec3::ZERO).map_err(|_| WriteError::NoWall(DVec3::ZERO))?;
        wall(id, "side", foot[axis], ["x", "y", "z"][axis]);
    }
    Ok(lines)
}

fn periodic_formula(kind: PeriodicSurface, period: f64) -> String {
    let formula = match kind {
        PeriodicSurface::SchwarzP => "cos(K*x) + cos(K*y) + cos(K*z)",
        PeriodicSurface::Gyroid => "sin(K*x)*cos(K*y) + sin(K*y)*cos(K*z) + sin(K*z)*cos(K*x)",
        PeriodicSurface::Diamond => "cos(K*x)*cos(K*y)*cos(K*z) - sin(K*x)*sin(K*y)*sin(K*z)",
    };
    formula.replace('K', &format!("(2*pi/{})", number(period)))
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
            line.push_str(&constraints(&common));
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

    /// Closes every cell on every wall and plane by a fan round the middle of its outline.
    fn patches(&mut self) -> Result<(), WriteError> {
        let mut outlines = self.outlines();
        // First along the lines in which walls meet planes, then along those in which planes meet each other.
        for of_planes in [false, true] {
            let keys: Vec<(RegionId, WallId)> =
                outlines.keys().copied().filter(|&(_, wall)| self.cuts_off(wall) == of_planes).collect();
            for (region, wall) in keys {
                self.close(&mut outlines, region, wall)?;
            }
        }
        for ((region, wall), pieces) in outlines {
            let count = f64::from(crate::index::checked_u32(pieces.len()));
            let mean = pieces.iter().map(|piece| self.place(piece[0])).sum::<DVec3>() / count;
            let middle = self.complex.walls[wall].project(mean).map_err(|_| WriteError::NoWall(mean))?;
            let centre = self.point(middle, vec![wall]);
            for [from, to] in pieces {
                let corners = [from, to, centre];
                let face = self.face(corners, &format!("tension 0{}", constraints(&[wall])))?;
                self.bound(RegionImage { region, shift: IVec3::ZERO }, face, corners, false);
            }
        }
        Ok(())
    }

    fn cuts_off(&self, wall: WallId) -> bool {
        self.complex.walls[wall].field.cuts_off()
    }

    /// A new vertex at a place in a cell's frame.
    fn point(&mut self, place: DVec3, walls: Vec<WallId>) -> Point {
        let vertex = self.vertex(place, walls);
        (vertex, self.moved[vertex])
    }

    /// What films leave of the outlines: closed ones, and chains that end at planes.
    fn outlines(&self) -> Outlines {
        let complex = self.complex;
        let mut outlines = Outlines::new();
        for film in &complex.films {
            for (side, turned) in [(film.back, false), (film.front, true)] {
                if complex.regions[side.region].kind != RegionKind::Cell {
                    continue;
                }
                for element in &film.elements {
                    for (wall, edge) in complex.edges_on_walls(element) {
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
        outlines
    }

    /// Closes the chains of one outline along the planes that they end at; what closes it on one side opens the outline on the
    /// plane, and closes that where the plane's own turn comes.
    fn close(&mut self, outlines: &mut Outlines, region: RegionId, wall: WallId) -> Result<(), WriteError> {
        let (ends, mut starts) =
            outlines.get(&(region, wall)).map(|pieces| loose(pieces)).unwrap_or_default();
        for end in ends {
            let from = self.place(end);
            let shared = |writer: &Self, start: Point| writer.shared_plane(end, start, wall);
            let nearest = (0..starts.len()).min_by(|&a, &b| {
                let key =
                    |at: usize| (shared(self, starts[at]).is_none(), self.place(starts[at]).distance(from));
                let ((far_a, a), (far_b, b)) = (key(a), key(b));
                far_a.cmp(&far_b).then(a.total_cmp(&b))
            });
            let start = starts.remove(nearest.ok_or(WriteError::NoWall(from))?);
            let way = match shared(self, start) {
                Some(plane) => self.way(wall, plane, end, start)?,
                None => {
                    let planes = [end, start].map(|point| self.planes(point, wall).next());
                    let [Some(a), Some(b)] = planes else { return Err(WriteError::NoWall(from)) };
                    let middle = self.onto(0.5 * (from + self.place(start)), wall, &[a, b])?;
                    let corner = self.point(middle, vec![wall, a, b]);
                    let mut way = self.way(wall, a, end, corner)?;
                    way.extend(self.way(wall, b, corner, start)?);
                    way
                }
            };
            for (plane, [from, to]) in way {
                outlines.entry((region, wall)).or_default().push([from, to]);
                outlines.entry((region, plane)).or_default().push([to, from]);
            }
        }
        Ok(())
    }

    /// The planes that a point lies on, besides `wall`.
    fn planes(&self, point: Point, wall: WallId) -> impl Iterator<Item = WallId> + '_ {
        let walls = self.vertices[point.0].1.iter().copied();
        walls.filter(move |&other| other != wall && self.cuts_off(other))
    }

    fn shared_plane(&self, a: Point, b: Point, wall: WallId) -> Option<WallId> {
        self.planes(a, wall).find(|&plane| self.planes(b, wall).any(|other| other == plane))
    }

    /// From point to point along the line in which a wall meets a plane, with the plane of each piece.
    fn way(
        &mut self,
        wall: WallId,
        plane: WallId,
        from: Point,
        to: Point,
    ) -> Result<Vec<(WallId, Piece)>, WriteError> {
        // Two planes meet in a straight line.
        let pieces = if self.cuts_off(wall) { 1 } else { RIM_PIECES };
        let [start, end] = [from, to].map(|point| self.place(point));
        let mut way = Vec::new();
        let mut last = from;
        for at in 1..=pieces {
            let next = if at == pieces {
                to
            } else {
                let straight = start.lerp(end, f64::from(at) / f64::from(pieces));
                let place = self.onto(straight, wall, &[plane])?;
                self.point(place, vec![wall, plane])
            };
            way.push((plane, [last, next]));
            last = next;
        }
        Ok(way)
    }

    /// A place on a wall and on planes across the axes, near `p`.
    fn onto(&self, p: DVec3, wall: WallId, planes: &[WallId]) -> Result<DVec3, WriteError> {
        let Wall { field, level } = &self.complex.walls[wall];
        let lost = || WriteError::NoWall(p);
        let mut place = p;
        let mut free = DVec3::ONE;
        for &plane in planes {
            place = self.complex.walls[plane].project(place).map_err(|_| lost())?;
            free -= self.complex.walls[plane].field.normal(place).abs();
        }
        for _ in 0..ONTO_STEPS {
            let (value, gradient) = field.value_and_gradient(place);
            let slope = gradient * free;
            let step = (value - level) / slope.length_squared() * slope;
            place -= step;
            if step.length() <= 1e-14 * place.length().max(f64::MIN_POSITIVE) {
                return Ok(place);
            }
        }
        if (field.value(place) - level).abs() < 1e-12 { Ok(place) } else { Err(lost()) }
    }

    fn finish(self, mut out: String) -> String {
        out.push_str("\nvertices\n");
        // Lines that close outlines in pictures have nodes of their own, which no face has.
        let used: BTreeSet<Vertex> = self.edges.keys().flat_map(|&(tail, head, _)| [tail, head]).collect();
        for &at in &used {
            let (place, walls) = &self.vertices[at];
            // Writing to a string does not fail.
            let _ = write!(out, "{}  {}  {}  {}", at + 1, number(place.x), number(place.y), number(place.z));
            out.push_str(&constraints(walls));
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

/// The ends of an outline's chains, and their starts.
fn loose(pieces: &[Piece]) -> (Vec<Point>, Vec<Point>) {
    let key = |point: &Point| (point.0, point.1.to_array());
    let [starts, ends] = [0, 1].map(|at| pieces.iter().map(|piece| key(&piece[at])).collect::<BTreeSet<_>>());
    let only = |own: usize, other: &BTreeSet<(Vertex, [i32; 3])>| -> Vec<Point> {
        pieces.iter().map(|piece| piece[own]).filter(|point| !other.contains(&key(point))).collect()
    };
    (only(1, &starts), only(0, &ends))
}

/// A line's note of the walls that a vertex or an edge stays on.
fn constraints(walls: &[WallId]) -> String {
    if walls.is_empty() {
        return String::new();
    }
    let names: Vec<String> = walls.iter().map(|wall| (wall.index() + 1).to_string()).collect();
    format!("  constraint {}", names.join(", "))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        relax::{RelaxSettings, relax},
        seeds::SeedSettings,
        setup::OpenFaces,
        start::start,
    };
    use std::ops::ControlFlow;

    /// The volumes of the bodies of a relaxed foam's datafile.
    fn body_volumes(space: &FoamSpace, cells: usize) -> Vec<f64> {
        let (gap, domain) = (space.gap().unwrap(), space.domain().unwrap());
        let seeds = SeedSettings::new(cells, 1);
        let network = start(&gap, &domain, &seeds, &mut |_| ControlFlow::Continue(())).unwrap().network;
        let settings = RelaxSettings::default();
        let state = relax(network, &gap, &settings, &mut |_| ControlFlow::Continue(())).unwrap().state;
        let complex = state.strips.complex(&state.network, &gap);
        let text = foam_datafile(space, &complex, &state.places, "a foam").unwrap();
        let volume = |line: &str| line.split_once("  volume ").and_then(|(_, volume)| volume.parse().ok());
        text.lines().filter_map(volume).collect()
    }

    #[test]
    fn cells_in_a_box_fill_it() {
        // Walls and planes are flat: triangles fill the box to rounding, and single cells but for the arcs of their films.
        let space = FoamSpace::Box { sides: [4.0, 4.62], height: 0.5 };
        let volumes = body_volumes(&space, 16);
        assert_eq!(volumes.len(), 16);
        assert!((volumes.iter().sum::<f64>() - 9.24).abs() < 1e-12, "{volumes:?}");
        assert!(volumes.iter().all(|volume| (volume / 0.5775 - 1.0).abs() < 0.01), "{volumes:?}");
    }

    #[test]
    fn cells_between_level_sets_and_planes_fill_the_gap_but_for_chords() {
        let walls = PeriodicWalls::LevelSet { delta: 0.2 };
        let open_faces = OpenFaces::Walls;
        let space = FoamSpace::Piece { period: 1.0, walls, low: [0; 3], high: [2, 2, 1], open_faces };
        let volumes = body_volumes(&space, 32);
        assert_eq!(volumes.len(), 32);
        // Half a period's gap; chords of 32 cells leave out a part of the order of the square of an edge's turn.
        let part = volumes.iter().sum::<f64>() / (0.5 * 0.114_158_996_552_87);
        assert!((0.97..1.0).contains(&part), "{part}");
    }
}
