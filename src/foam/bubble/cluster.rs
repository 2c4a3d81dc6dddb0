//! Two or three bubbles that touch: the smallest foams.
//!
//! A cluster starts as the standard one of the plane, laid on the surface round a place: two equal bubbles with arcs of 240°
//! and a straight film between them, or three with half circles outside and three films that meet in the middle. Volumes may
//! differ; the descent of any film complex (`relax::Descent`) does the rest. The cluster is free to slide.

use super::{Chart, NoBubble, extrapolate::limit_with_error};
use crate::foam::{
    complex::{
        Complex, Element, Film, Motion, Node, NodeId, NodeImage, Places, Region, RegionId, RegionImage,
        RegionKind, Shape, WallId, coons,
    },
    convert::as_f64,
    relax::{Descended, Descent, DescentSettings},
};
use crate::{
    index::{Id, IndexVec},
    surface::{Gap, Period},
};
use glam::{DVec2, DVec3, IVec3};
use std::{
    collections::BTreeMap,
    f64::consts::{FRAC_PI_2, TAU},
    ops::ControlFlow,
};

/// A cluster in balance.
#[derive(Debug)]
pub struct Cluster {
    /// The energy, in the limit of fine meshes.
    pub energy: f64,
    /// How far the limit moves without the coarsest mesh.
    pub energy_error: f64,
    /// The pressures above the open air, in the limit.
    pub pressures: Vec<f64>,
    /// The wanted volumes.
    pub volumes: Vec<f64>,
    /// How the descent on the finest mesh ended.
    pub descended: Descended,
    /// The films on the finest mesh.
    pub complex: Complex,
    /// The places of their nodes.
    pub places: Places,
    /// The first nodes are those of borders: so many.
    border_nodes: usize,
}

/// An arc between two vertices of a plane cluster.
struct Arc {
    from: usize,
    to: usize,
    /// Half the angle that it turns by, to the right of the chord; 0 for a straight film.
    half_angle: f64,
    /// The regions on its left and on its right.
    sides: [usize; 2],
}

/// A plane cluster of equal bubbles with arcs of radius 1; the open air is the last region.
struct Plan {
    /// The borders' feet, then the joints of pieces of arcs.
    vertices: Vec<DVec2>,
    /// How many of them are borders' feet.
    borders: usize,
    /// Into how many pieces the arcs are cut.
    pieces: usize,
    arcs: Vec<Arc>,
    cells: usize,
    /// The area of each bubble.
    area: f64,
}

impl Plan {
    fn new(cells: usize) -> Self {
        let outer = |from, to, half_angle, cell| Arc { from, to, half_angle, sides: [cell, cells] };
        if cells == 2 {
            let half = 0.75_f64.sqrt();
            let vertices = vec![DVec2::new(0.0, -half), DVec2::new(0.0, half)];
            let arcs = vec![
                outer(0, 1, TAU / 3.0, 0),
                outer(1, 0, TAU / 3.0, 1),
                Arc { from: 0, to: 1, half_angle: 0.0, sides: [1, 0] },
            ];
            let area = TAU / 3.0 + 0.75_f64.sqrt() / 2.0;
            return Self { vertices, borders: 2, pieces: 1, arcs, cells, area };
        }
        let spoke = 2.0 / 3.0_f64.sqrt();
        let rim = (0..3_u32).map(|k| spoke * DVec2::from_angle(TAU / 3.0 * f64::from(k)));
        let vertices = rim.chain([DVec2::ZERO]).collect();
        let area = FRAC_PI_2 + spoke * spoke * 0.75_f64.sqrt() / 2.0;
        let arcs = (0..3)
            .map(|k| outer(k, (k + 1) % 3, FRAC_PI_2, k))
            // A spoke has the bubble after it on its left, the one before it on its right.
            .chain((0..3).map(|k| Arc { from: 3, to: k, half_angle: 0.0, sides: [k, (k + 2) % 3] }))
            .collect();
        Self { vertices, borders: 4, pieces: 1, arcs, cells, area }
    }

    /// The same with each of its arcs cut into so many films.
    fn in_pieces(mut self, pieces: usize) -> Self {
        self.pieces = pieces;
        for arc in std::mem::take(&mut self.arcs) {
            if arc.half_angle <= 0.0 {
                self.arcs.push(arc);
                continue;
            }
            let mut from = arc.from;
            for piece in 1..=pieces {
                let joint = self.vertices.len();
                let to = if piece == pieces { arc.to } else { joint };
                if to == joint {
                    self.vertices.push(self.point(&arc, as_f64(piece) / as_f64(pieces)));
                }
                let half_angle = arc.half_angle / as_f64(pieces);
                self.arcs.push(Arc { from, to, half_angle, sides: arc.sides });
                from = to;
            }
        }
        self
    }

    /// A point of an arc, `part` of the way along.
    fn point(&self, arc: &Arc, part: f64) -> DVec2 {
        let (a, b) = (self.vertices[arc.from], self.vertices[arc.to]);
        if arc.half_angle <= 0.0 {
            return a.lerp(b, part);
        }
        let chord = b - a;
        let radius = 0.5 * chord.length() / arc.half_angle.sin();
        // The arc bulges to the right of its chord: anticlockwise round a centre on the left.
        let left = chord.perp().normalize();
        let centre = 0.5 * (a + b) + left * radius * arc.half_angle.cos();
        centre + DVec2::from_angle(2.0 * arc.half_angle * part).rotate(a - centre)
    }
}

/// Pieces that an arc may be cut into; as many elements along it as three straight films have.
const PIECES: usize = 3;

/// A triple is flat where its size squared times the Gaussian curvature is below this.
const FLAT: f64 = 1e-3;

/// In how many pieces the arcs are tried.
///
/// As one film an arc slides along curved walls as it should. But by itself, between fixed borders at fixed pressures, a half
/// circle is just about to be unstable, and its share of Newton's system has no inverse: that is the flat triple. Cut arcs
/// are stable by themselves, but nothing holds the joints along them: good only where the start is nearly the end.
fn tries(cells: usize, chart: &Chart<'_>, scale: f64) -> [usize; 2] {
    let curvature = chart.gap().middle().curvature(chart.place()).gauss;
    let is_flat = cells == 3 && curvature.abs() * scale * scale < FLAT;
    if is_flat { [PIECES, 1] } else { [1, PIECES] }
}

/// The mesh of a cluster: elements along a straight film, and from wall to wall; arcs have three times as many along.
#[derive(Clone, Copy)]
struct Mesh {
    along: usize,
    through: usize,
}

/// The meshes of the limit.
const MESHES: [Mesh; 3] =
    [Mesh { along: 2, through: 1 }, Mesh { along: 4, through: 2 }, Mesh { along: 6, through: 3 }];

impl Mesh {
    fn rows(self) -> usize {
        2 * self.through + 1
    }

    /// Nodes along an arc, both ends included, if all arcs are cut into so many pieces.
    fn columns(self, arc: &Arc, pieces: usize) -> usize {
        2 * self.along * if arc.half_angle > 0.0 { PIECES / pieces } else { 1 } + 1
    }
}

/// Two or three bubbles of these volumes round a place of the middle surface.
///
/// # Errors
/// [`NoBubble`] if there are other than two or three volumes, one is none, or the cluster does not come to rest.
pub fn cluster(gap: &Gap, volumes: &[f64], place: DVec3) -> Result<Cluster, NoBubble> {
    if !(2..=3).contains(&volumes.len()) {
        return Err(NoBubble::Count { count: volumes.len() });
    }
    for &volume in volumes {
        super::held::chart_at(gap, volume, place)?;
    }
    let chart = Chart::new(gap, place)?;
    let plan = Plan::new(volumes.len());
    let mean = volumes.iter().sum::<f64>() / as_f64(volumes.len());
    let scale = (mean / (chart.height()? * plan.area)).sqrt();
    let [first, second] = tries(volumes.len(), &chart, scale);
    let tried = |pieces| on_meshes(&chart, &Plan::new(volumes.len()).in_pieces(pieces), scale, volumes);
    match tried(first) {
        Err(NoBubble::Unsolved { .. } | NoBubble::Unbalanced { .. }) => tried(second),
        other => other,
    }
}

/// The cluster on all meshes.
fn on_meshes(chart: &Chart<'_>, plan: &Plan, scale: f64, volumes: &[f64]) -> Result<Cluster, NoBubble> {
    let (mut energies, mut pressures) = (Vec::new(), vec![Vec::new(); volumes.len()]);
    let mut finest = None;
    for mesh in MESHES {
        let (descent, descended) = settle(chart, plan, mesh, scale, volumes)?;
        energies.push(descent.energy());
        for (all, &pressure) in pressures.iter_mut().zip(descent.pressures().iter()) {
            all.push(pressure);
        }
        finest = Some((descent, descended));
    }
    let Some((descent, descended)) = finest else { return Err(NoBubble::Count { count: 0 }) };
    refuse_overlap(chart.gap(), &descent, chart.place())?;
    let sizes = MESHES.map(|mesh| 1.0 / as_f64(mesh.along));
    let (energy, energy_error) = limit_with_error(&sizes, &energies);
    Ok(Cluster {
        energy,
        energy_error,
        pressures: pressures.iter().map(|all| limit_with_error(&sizes, all).0).collect(),
        volumes: volumes.to_vec(),
        descended,
        border_nodes: plan.borders * MESHES[MESHES.len() - 1].rows(),
        complex: descent.complex().clone(),
        places: descent.places().clone(),
    })
}

fn settle(
    chart: &Chart<'_>,
    plan: &Plan,
    mesh: Mesh,
    scale: f64,
    volumes: &[f64],
) -> Result<(Descent, Descended), NoBubble> {
    let (complex, places) = laid(chart, plan, mesh, scale)?;
    let unsolved = |residual| NoBubble::Unsolved { place: chart.place(), residual };
    let wanted: IndexVec<RegionId, f64> = volumes.iter().copied().chain([0.0]).collect();
    let pressures: IndexVec<RegionId, f64> = volumes.iter().map(|_| 1.0 / scale).chain([0.0]).collect();
    let mut descent = Descent::new(complex, wanted, places, pressures).map_err(|_| unsolved(f64::NAN))?;
    let settings =
        DescentSettings { length: scale, tolerance: 1e-10, volume_tolerance: 1e-11, step_limit: 80 };
    let descended =
        descent.descend(&settings, &mut |_| ControlFlow::Continue(())).map_err(|_| unsolved(f64::NAN))?;
    if descended.residuals.force > 1e-8 {
        let (steps, force) = (descended.steps, descended.residuals.force);
        return Err(NoBubble::Unbalanced { place: chart.place(), steps, force });
    }
    Ok((descent, descended))
}

/// Refuses a cluster that is as wide as a period.
fn refuse_overlap(gap: &Gap, descent: &Descent, place: DVec3) -> Result<(), NoBubble> {
    let period = gap.middle().period();
    for axis in [IVec3::X, IVec3::Y, IVec3::Z] {
        let way = period.translation(axis);
        let along = descent.places().iter().map(|p| p.dot(way.normalize_or_zero()));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if way != DVec3::ZERO && high - low >= way.length() {
            return Err(NoBubble::Touches { place });
        }
    }
    Ok(())
}

/// The complex of a plan on the surface, and its first places.
fn laid(chart: &Chart<'_>, plan: &Plan, mesh: Mesh, scale: f64) -> Result<(Complex, Places), NoBubble> {
    let rows = mesh.rows();
    let (mut nodes, mut places): (IndexVec<NodeId, Node>, Places) = (IndexVec::new(), Places::new());
    let walls = |row: usize| match row {
        0 => vec![WallId::from_index(0)],
        row if row + 1 == rows => vec![WallId::from_index(1)],
        _ => Vec::new(),
    };
    let column = |point: DVec2, places: &mut Places| -> Result<(), NoBubble> {
        let [low, high] = chart.column(chart.point(scale * point.x, scale * point.y)?)?;
        for row in 0..rows {
            places.push(low.lerp(high, as_f64(row) / as_f64(rows - 1)));
        }
        Ok(())
    };
    let vertex_node = |vertex: usize, row: usize| NodeId::from_index(vertex * rows + row);
    for (vertex, &point) in plan.vertices.iter().enumerate() {
        column(point, &mut places)?;
        for row in 0..rows {
            let part = as_f64(row) / as_f64(rows - 1);
            let ends = [(vertex_node(vertex, 0), 1.0 - part), (vertex_node(vertex, rows - 1), part)];
            let motion = if walls(row).is_empty() { Motion::Border(ends.to_vec()) } else { Motion::Free };
            nodes.push(Node { walls: walls(row), motion });
        }
    }
    let mut films = IndexVec::new();
    for arc in &plan.arcs {
        let (columns, first) = (mesh.columns(arc, plan.pieces), places.len());
        let node = |column: usize, row: usize| match column {
            0 => vertex_node(arc.from, row),
            column if column + 1 == columns => vertex_node(arc.to, row),
            column => NodeId::from_index(first + (column - 1) * rows + row),
        };
        for at in 1..columns - 1 {
            column(plan.point(arc, as_f64(at) / as_f64(columns - 1)), &mut places)?;
            for row in 0..rows {
                let masters = coons([at, columns - 1], [row, rows - 1], node);
                nodes.push(Node { walls: walls(row), motion: Motion::Inner(masters) });
            }
        }
        let image = |node| NodeImage { node, shift: IVec3::ZERO };
        let element = |i: usize, j: usize| Element {
            shape: Shape::Quad9,
            nodes: (0..9).map(|at| image(node(2 * i + at % 3, 2 * j + at / 3))).collect(),
        };
        let elements =
            (0..mesh.through).flat_map(|j| (0..columns / 2).map(move |i| (i, j))).map(|(i, j)| element(i, j));
        let [left, right] =
            arc.sides.map(|region| RegionImage { region: RegionId::from_index(region), shift: IVec3::ZERO });
        films.push(Film { front: right, back: left, tension: 1.0, elements: elements.collect() });
    }
    let kinds = (0..=plan.cells).map(|at| if at < plan.cells { RegionKind::Cell } else { RegionKind::Open });
    let complex = Complex {
        // No film meets an image of another, so the lattice plays no part, and on planes a cluster may turn.
        period: Period::NONE,
        walls: chart.gap().walls().to_vec().into(),
        regions: kinds.map(|kind| Region { kind, anchor: chart.place() }).collect(),
        nodes,
        films,
    };
    complex.retract(&mut places).map_err(|node| NoBubble::Wide { place: places[node] })?;
    Ok((complex, places))
}

/// The perimeter of two or three equal bubbles in the plane over the root of the area of one, 6.3591298… for two: arcs of
/// radius 1 and straight films between them.
#[must_use]
pub fn flat_perimeter(count: usize) -> Option<f64> {
    matches!(count, 2 | 3).then(|| {
        let plan = Plan::new(count);
        let length = |arc: &Arc| {
            let chord = plan.vertices[arc.from].distance(plan.vertices[arc.to]);
            if arc.half_angle > 0.0 { chord * arc.half_angle / arc.half_angle.sin() } else { chord }
        };
        plan.arcs.iter().map(length).sum::<f64>() / plan.area.sqrt()
    })
}

impl Cluster {
    /// The mean place of its films.
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        self.places.iter().sum::<DVec3>() / as_f64(self.places.len())
    }

    /// Whether a node lies on a border.
    #[must_use]
    pub fn is_border(&self, node: NodeId) -> bool {
        node.index() < self.border_nodes
    }

    /// The largest distance from 120° of the angles between the three films of a border, at its ends on the walls and in
    /// mid-gap, in radians; on the finest mesh.
    #[must_use]
    pub fn border_angle_error(&self) -> f64 {
        let mut ways: BTreeMap<NodeId, Vec<DVec3>> = BTreeMap::new();
        for element in self.complex.films.iter().flat_map(|film| &film.elements) {
            for (at, image) in
                element.nodes.iter().enumerate().filter(|(_, image)| self.is_border(image.node))
            {
                let row = at - at % 3;
                let far = if at % 3 == 0 { [row + 1, row + 2] } else { [row + 1, row] };
                let [a, b, c] = [at, far[0], far[1]].map(|at| self.places[element.nodes[at].node]);
                let [low, middle, high] = [0, 3, 6].map(|row| self.places[element.nodes[row + at % 3].node]);
                // Tangents of parabolas through three nodes: of the border, and of the film across it.
                let border = match at / 3 {
                    0 => 4.0 * middle - 3.0 * low - high,
                    1 => high - low,
                    _ => 3.0 * high + low - 4.0 * middle,
                };
                let way = (4.0 * b - 3.0 * a - c).reject_from(border).normalize_or_zero();
                let ways = ways.entry(image.node).or_default();
                if ways.iter().all(|other: &DVec3| other.dot(way) < 0.9) {
                    ways.push(way);
                }
            }
        }
        let off = |(i, j): (&DVec3, &DVec3)| (i.dot(*j).clamp(-1.0, 1.0).acos() - TAU / 3.0).abs();
        let pairs = ways.values().flat_map(|w| [(&w[0], &w[1]), (&w[1], &w[2]), (&w[2], &w[0])]);
        pairs.map(off).fold(0.0, f64::max)
    }
}
