//! Marching cubes over one level of a level set, streaming through the grid.
//!
//! Only the signs of two planes of samples are held. Vertices are exact crossings of grid edges, not linear interpolates.
//! Where the surface passes within [`SNAP`] of a grid node, all crossings next to that node become one vertex, the node's
//! projection, so that no sliver is left; nodes on the surface itself, which a grid aligned with mirror planes has many of,
//! need no other care. Slabs of a fixed number of layers are meshed in parallel and joined in order: the result does not
//! depend on the number of threads.

use super::{TriMesh, VertexId, cube_cases::CUBE_CASES};
use crate::{
    index::Id,
    surface::{GridSampler, LevelSet, NoFoot, SurfaceSamples},
};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A box divided into equal cells along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The lower corner.
    pub low: DVec3,
    /// The upper corner.
    pub high: DVec3,
    /// Cells along x, y and z; at least one each.
    pub cells: [usize; 3],
}

impl Grid {
    /// The coordinates of the nodes along each axis. The ends are exact.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "node numbers are far below 2^52")]
    pub fn axes(&self) -> [Vec<f64>; 3] {
        std::array::from_fn(|axis| {
            let n = self.cells[axis];
            let at = |i: usize| match i {
                i if i == n => self.high[axis],
                i => self.low[axis] + (self.high[axis] - self.low[axis]) * (i as f64 / n as f64),
            };
            (0..=n).map(at).collect()
        })
    }

    /// The longest side of a cell.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "cell numbers are far below 2^52")]
    pub fn spacing(&self) -> f64 {
        (0..3).map(|axis| (self.high[axis] - self.low[axis]) / self.cells[axis] as f64).fold(0.0, f64::max)
    }

    /// About how many bytes [`march`] holds at its peak: planes of signs and vertex numbers, and the mesh of a surface that
    /// fills the box like one sheet per `period`.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    pub fn memory_estimate(&self, period: f64) -> f64 {
        let [nx, ny, nz] = self.cells.map(|n| n as f64);
        let planes = (nx + 1.0) * (ny + 1.0) * PLANE_BYTES * rayon::current_num_threads() as f64;
        let sheets = (self.high - self.low) / period;
        // A surface of area 2.4 per period crosses about 1.6 edges for each cell face that it fills; each vertex comes with
        // two triangles.
        let vertices = 2.4 * 1.6 * nx * ny * nz * (sheets.max_element() / nx.max(ny).max(nz));
        planes + vertices * (24.0 + 2.0 * 12.0)
    }
}

/// Bytes held per node of a plane while marching: two planes of signs and three kinds of numbers each.
const PLANE_BYTES: f64 = 2.0 * (1.0 + 3.0 * 4.0) + 4.0;

/// Layers of one slab. Fewer cost repeated planes, more leave threads idle.
const SLAB_LAYERS: usize = 16;

/// Distance from a node, in parts of the spacing, within which crossings are joined to it. Below 0.02 triangles get angles
/// that single precision spoils; above 0.3 neighbouring nodes begin to compete and sheets can pinch.
const SNAP: f64 = 0.12;

/// Nodes on the surface up to rounding count as above it, so that the rounding does not scatter their signs.
const ON_SURFACE: f64 = 1e-12;

/// No vertex yet.
const NONE: u32 = u32::MAX;

/// Vertices of a slab's last plane are numbered from here: they belong to the next slab if it has them too.
const FOREIGN: u32 = 1 << 31;

/// The surface `surface = level` within the grid's box, as triangles whose normals point along `∇Φ`.
///
/// The mesh has a border where the surface leaves the box; its vertices there lie exactly on the box's faces if those are
/// mirror planes of the surface.
///
/// # Errors
/// [`NoFoot`] if a node next to the surface cannot be projected onto it.
///
/// # Panics
/// If the grid has no cells along an axis.
pub fn march(surface: &dyn LevelSet, level: f64, grid: &Grid) -> Result<TriMesh, NoFoot> {
    assert!(grid.cells.iter().all(|&n| n > 0), "a grid has cells along each axis");
    let axes = grid.axes();
    let sampler = surface.sampler(axes.each_ref().map(Vec::as_slice));
    let field = Field {
        surface,
        level,
        axes: &axes,
        sampler: sampler.as_ref(),
        near: near_value(surface, level, grid),
    };
    let layers = grid.cells[2];
    let slabs: Vec<Slab> = (0..layers.div_ceil(SLAB_LAYERS))
        .into_par_iter()
        .map(|slab| {
            let first = slab * SLAB_LAYERS;
            Slab::mesh(&field, first, (first + SLAB_LAYERS).min(layers))
        })
        .collect::<Result<_, _>>()?;
    Ok(join(&slabs))
}

/// `|Φ − level|` at a node that counts as next to the surface.
fn near_value(surface: &dyn LevelSet, level: f64, grid: &Grid) -> f64 {
    const LINES: usize = 12;
    let samples = SurfaceSamples::new(surface, level, LINES);
    let slope = samples.integrate(|p| surface.gradient(p).length()) / samples.area();
    // A level that is not met at all has no crossings either.
    if slope.is_finite() { (SNAP * grid.spacing() * slope).max(2.0 * ON_SURFACE) } else { 2.0 * ON_SURFACE }
}

/// What is marched over.
struct Field<'a> {
    surface: &'a dyn LevelSet,
    level: f64,
    axes: &'a [Vec<f64>; 3],
    sampler: &'a dyn GridSampler,
    near: f64,
}

impl Field<'_> {
    fn node(&self, [i, j, k]: [usize; 3]) -> DVec3 {
        DVec3::new(self.axes[0][i], self.axes[1][j], self.axes[2][k])
    }

    fn value(&self, [i, j, k]: [usize; 3]) -> f64 {
        self.sampler.at(i, j, k) - self.level
    }

    /// Nodes along x and along y.
    fn plane_size(&self) -> [usize; 2] {
        [self.axes[0].len(), self.axes[1].len()]
    }

    /// The end of a crossed edge that its crossing is joined to, if one is near enough; the nearer one of two.
    fn node_to_join(&self, ends: [[usize; 3]; 2]) -> Option<[usize; 3]> {
        let [a, b] = ends.map(|end| self.value(end).abs());
        if a.min(b) > self.near {
            None
        } else if a <= b {
            Some(ends[0])
        } else {
            Some(ends[1])
        }
    }

    /// The projection of a node; coordinates in which the step has no part stay exactly those of the node.
    fn joined_place(&self, node: [usize; 3]) -> Result<DVec3, NoFoot> {
        let place = self.node(node);
        let mut foot = self.surface.project(place, self.level)?;
        for axis in 0..3 {
            // On a mirror plane the gradient lies in the plane, up to rounding.
            if (node[axis] == 0 || node[axis] + 1 == self.axes[axis].len())
                && (foot[axis] - place[axis]).abs() < 1e-9 * (1.0 + place[axis].abs())
            {
                foot[axis] = place[axis];
            }
        }
        Ok(foot)
    }
}

/// One plane of nodes: signs, and the vertices on its edges and at its nodes.
struct Plane {
    k: usize,
    above: Vec<u8>,
    x_ids: Vec<u32>,
    y_ids: Vec<u32>,
    node_ids: Vec<u32>,
    joined: Vec<usize>,
}

impl Plane {
    fn empty([nx, ny]: [usize; 2]) -> Self {
        let numbers = || vec![NONE; nx * ny];
        Self {
            k: 0,
            above: vec![0; nx * ny],
            x_ids: numbers(),
            y_ids: numbers(),
            node_ids: numbers(),
            joined: vec![],
        }
    }

    fn sample(&mut self, field: &Field<'_>, k: usize) {
        self.k = k;
        for node in self.joined.drain(..) {
            self.node_ids[node] = NONE;
        }
        let [nx, _] = field.plane_size();
        for (j, row) in self.above.chunks_exact_mut(nx).enumerate() {
            field.sampler.row_above(j, k, field.level - ON_SURFACE, row);
        }
    }
}

/// What a vertex in a plane is called by both slabs that meet there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    XEdge(usize),
    YEdge(usize),
    Node(usize),
}

/// The mesh of some layers.
struct Slab {
    first: usize,
    last: usize,
    positions: Vec<DVec3>,
    /// Vertices of the last plane, which the next slab may have too.
    top: Vec<(Key, DVec3)>,
    /// Numbers of the vertices of the first plane.
    bottom: Vec<(Key, u32)>,
    triangles: Vec<[u32; 3]>,
    /// Whether there is another slab above.
    ends_inside: bool,
}

impl Slab {
    fn mesh(field: &Field<'_>, first: usize, last: usize) -> Result<Self, NoFoot> {
        let size = field.plane_size();
        let mut slab = Self {
            first,
            last,
            positions: Vec::new(),
            top: Vec::new(),
            bottom: Vec::new(),
            triangles: Vec::new(),
            ends_inside: last + 1 < field.axes[2].len(),
        };
        let (mut lower, mut upper) = (Plane::empty(size), Plane::empty(size));
        let mut z_ids = vec![NONE; size[0] * size[1]];
        lower.sample(field, first);
        slab.cross_plane(field, &mut lower)?;
        for k in first..last {
            upper.sample(field, k + 1);
            slab.cross_layer(field, &mut lower, &mut upper, &mut z_ids)?;
            slab.cross_plane(field, &mut upper)?;
            slab.fill_layer(size, &lower, &upper, &z_ids);
            std::mem::swap(&mut lower, &mut upper);
        }
        Ok(slab)
    }

    /// A new vertex of plane `k` (or of no plane: `None`).
    fn add(&mut self, place: DVec3, plane: Option<(usize, Key)>) -> u32 {
        match plane {
            Some((k, key)) if k == self.last && self.ends_inside => {
                self.top.push((key, place));
                FOREIGN + crate::index::checked_u32(self.top.len() - 1)
            }
            _ => {
                self.positions.push(place);
                let id = crate::index::checked_u32(self.positions.len() - 1);
                if let Some((k, key)) = plane
                    && k == self.first
                    && k > 0
                {
                    self.bottom.push((key, id));
                }
                id
            }
        }
    }

    /// The vertex at a node of a plane, made when it is first needed.
    fn joined(&mut self, field: &Field<'_>, plane: &mut Plane, node: [usize; 3]) -> Result<u32, NoFoot> {
        let at = node[1] * field.plane_size()[0] + node[0];
        if plane.node_ids[at] == NONE {
            let place = field.joined_place(node)?;
            plane.node_ids[at] = self.add(place, Some((plane.k, Key::Node(at))));
            plane.joined.push(at);
        }
        Ok(plane.node_ids[at])
    }

    /// Vertices on the edges within a plane.
    fn cross_plane(&mut self, field: &Field<'_>, plane: &mut Plane) -> Result<(), NoFoot> {
        let [nx, ny] = field.plane_size();
        let k = plane.k;
        let mut crossed = Vec::new();
        for j in 0..ny {
            let row = &plane.above[j * nx..(j + 1) * nx];
            crossed.clear();
            each_difference(&row[..nx - 1], &row[1..], |i| crossed.push(i));
            for &i in &crossed {
                plane.x_ids[j * nx + i] =
                    self.vertex_in_plane(field, plane, [[i, j, k], [i + 1, j, k]], Key::XEdge(j * nx + i))?;
            }
            if j + 1 < ny {
                crossed.clear();
                each_difference(
                    &plane.above[j * nx..(j + 1) * nx],
                    &plane.above[(j + 1) * nx..(j + 2) * nx],
                    |i| crossed.push(i),
                );
                for &i in &crossed {
                    plane.y_ids[j * nx + i] = self.vertex_in_plane(
                        field,
                        plane,
                        [[i, j, k], [i, j + 1, k]],
                        Key::YEdge(j * nx + i),
                    )?;
                }
            }
        }
        Ok(())
    }

    fn vertex_in_plane(
        &mut self,
        field: &Field<'_>,
        plane: &mut Plane,
        ends: [[usize; 3]; 2],
        key: Key,
    ) -> Result<u32, NoFoot> {
        match field.node_to_join(ends) {
            Some(node) => self.joined(field, plane, node),
            None => {
                let place = field.surface.crossing(field.node(ends[0]), field.node(ends[1]), field.level);
                Ok(self.add(place, Some((plane.k, key))))
            }
        }
    }

    /// Vertices on the edges between two planes.
    fn cross_layer(
        &mut self,
        field: &Field<'_>,
        lower: &mut Plane,
        upper: &mut Plane,
        z_ids: &mut [u32],
    ) -> Result<(), NoFoot> {
        let [nx, _] = field.plane_size();
        let mut crossed = Vec::new();
        each_difference(&lower.above, &upper.above, |at| crossed.push(at));
        for at in crossed {
            let (i, j) = (at % nx, at / nx);
            let ends = [[i, j, lower.k], [i, j, upper.k]];
            z_ids[at] = match field.node_to_join(ends) {
                Some(node) if node[2] == lower.k => self.joined(field, lower, node)?,
                Some(node) => self.joined(field, upper, node)?,
                None => {
                    let place = field.surface.crossing(field.node(ends[0]), field.node(ends[1]), field.level);
                    self.add(place, None)
                }
            };
        }
        Ok(())
    }

    /// Triangles of the cubes between two planes.
    fn fill_layer(&mut self, [nx, ny]: [usize; 2], lower: &Plane, upper: &Plane, z_ids: &[u32]) {
        let mut columns = vec![0_u8; nx];
        for j in 0..ny - 1 {
            let (near, far) = (j * nx..(j + 1) * nx, (j + 1) * nx..(j + 2) * nx);
            let rows = [
                &lower.above[near.clone()],
                &lower.above[far.clone()],
                &upper.above[near],
                &upper.above[far],
            ];
            for (i, column) in columns.iter_mut().enumerate() {
                *column = rows[0][i] | rows[1][i] << 1 | rows[2][i] << 2 | rows[3][i] << 3;
            }
            each_mixed(&columns, |i| {
                let case = SPREAD[usize::from(columns[i])] | SPREAD[usize::from(columns[i + 1])] << 1;
                for triangle in &CUBE_CASES[usize::from(case)] {
                    let corners =
                        triangle.map(|edge| vertex_of_edge(edge, [i, j], nx, [lower, upper], z_ids));
                    let [a, b, c] = corners;
                    // Crossings joined at a node leave triangles with repeated corners.
                    if a != b && b != c && c != a {
                        self.triangles.push(corners);
                    }
                }
            });
        }
    }
}

/// Moves the four bits of a column of corners (y, z) to the places of corners with x = 0.
const SPREAD: [u8; 16] = {
    let mut table = [0; 16];
    let mut column = 0_u8;
    while column < 16 {
        table[column as usize] = (column & 1) | (column & 2) << 1 | (column & 4) << 2 | (column & 8) << 3;
        column += 1;
    }
    table
};

/// The vertex on an edge (numbered as in `cube_cases`) of the cube at column `i`, row `j`.
fn vertex_of_edge(edge: u8, [i, j]: [usize; 2], nx: usize, planes: [&Plane; 2], z_ids: &[u32]) -> u32 {
    let (first, second) = (usize::from(edge & 1), usize::from(edge >> 1 & 1));
    match edge / 4 {
        0 => planes[second].x_ids[(j + first) * nx + i],
        1 => planes[first].y_ids[j * nx + i + second],
        _ => z_ids[(j + second) * nx + i + first],
    }
}

/// Calls `f` with each place where two rows of equal length differ, in order; eight at a time where they agree.
fn each_difference(a: &[u8], b: &[u8], mut f: impl FnMut(usize)) {
    let words = a.len() / 8 * 8;
    for start in (0..words).step_by(8) {
        if a[start..start + 8] != b[start..start + 8] {
            (start..start + 8).filter(|&i| a[i] != b[i]).for_each(&mut f);
        }
    }
    (words..a.len()).filter(|&i| a[i] != b[i]).for_each(&mut f);
}

/// Calls `f` with each `i` for which the columns `i` and `i + 1` have corners on both sides of the level, in order.
fn each_mixed(columns: &[u8], mut f: impl FnMut(usize)) {
    const ALL: u8 = 15;
    let cells = columns.len() - 1;
    let mixed = |i: usize| {
        let (here, next) = (columns[i], columns[i + 1]);
        here != next || (here != 0 && here != ALL)
    };
    let words = cells / 8 * 8;
    for start in (0..words).step_by(8) {
        let word = &columns[start..start + 9];
        if word != [0; 9] && word != [ALL; 9] {
            (start..start + 8).filter(|&i| mixed(i)).for_each(&mut f);
        }
    }
    (words..cells).filter(|&i| mixed(i)).for_each(&mut f);
}

/// Joins the slabs: a vertex of a slab's last plane is the next slab's vertex of that name, if it has one.
fn join(slabs: &[Slab]) -> TriMesh {
    let mut offsets = Vec::with_capacity(slabs.len() + 1);
    let mut count = 0;
    for slab in slabs {
        offsets.push(count);
        count += slab.positions.len();
    }
    let mut positions: Vec<DVec3> = Vec::with_capacity(count);
    slabs.iter().for_each(|slab| positions.extend(&slab.positions));
    let mut triangles = Vec::with_capacity(slabs.iter().map(|slab| slab.triangles.len()).sum());
    for (index, slab) in slabs.iter().enumerate() {
        let above: BTreeMap<Key, u32> =
            slabs.get(index + 1).map(|next| next.bottom.iter().copied().collect()).unwrap_or_default();
        let foreign: Vec<usize> = slab
            .top
            .iter()
            .map(|(key, place)| match above.get(key) {
                Some(&id) => offsets[index + 1] + id as usize,
                None => {
                    positions.push(*place);
                    positions.len() - 1
                }
            })
            .collect();
        let global = |id: u32| {
            VertexId::from_index(if id >= FOREIGN {
                foreign[(id - FOREIGN) as usize]
            } else {
                offsets[index] + id as usize
            })
        };
        triangles.extend(slab.triangles.iter().map(|triangle| triangle.map(global)));
    }
    TriMesh { positions: positions.into(), triangles }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::{ClosedMesh, Sheet, euler_number, measure},
        surface::{Diamond, Gyroid, SchwarzP, Sphere, Torus},
    };
    use std::f64::consts::{PI, TAU};

    fn cube(low: f64, high: f64, cells: usize) -> Grid {
        Grid { low: DVec3::splat(low), high: DVec3::splat(high), cells: [cells; 3] }
    }

    #[test]
    fn spheres_are_closed_and_approach_their_volume_from_below_by_the_square_of_the_spacing()
    -> Result<(), NoFoot> {
        let sphere = Sphere { radius: 1.0 };
        let volume = |cells| -> Result<f64, NoFoot> {
            let mesh = march(&sphere, 0.0, &cube(-1.25, 1.25, cells))?;
            assert!(mesh.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-12));
            assert_eq!(euler_number(&mesh), 2);
            let Ok(closed) = ClosedMesh::new(mesh) else { panic!("{cells} cells: not closed") };
            Ok(measure::volume(closed.mesh()))
        };
        let error = [16, 32, 64].map(|cells| volume(cells).map(|v| 4.0 * PI / 3.0 - v));
        let [coarse, middle, fine] = error;
        let (coarse, middle, fine) = (coarse?, middle?, fine?);
        // Inscribed: less than the ball. A second-order error falls to a quarter; 3.3 leaves room for the grid's phase.
        assert!(fine > 0.0 && coarse / middle > 3.3 && middle / fine > 3.3, "{coarse} {middle} {fine}");
        Ok(())
    }

    #[test]
    fn whole_periods_have_the_euler_number_of_their_sheet() -> Result<(), NoFoot> {
        // One cell of P: a sphere with six holes.
        for cells in [8, 12, 17, 32, 48] {
            let mesh = march(&SchwarzP { period: 1.0 }, 0.0, &cube(0.0, 1.0, cells))?;
            assert_eq!(euler_number(&mesh), -4, "{cells}");
            assert!(Sheet::new(mesh).is_ok(), "{cells}");
        }
        let torus = march(&Torus { ring: 2.0, tube: 0.7 }, 0.1, &cube(-3.1, 3.1, 40))?;
        assert_eq!(euler_number(&torus), 0);
        assert!((measure::volume(&torus) / (TAU * 2.0 * PI * 0.64) - 1.0).abs() < 0.01);
        assert!(ClosedMesh::new(torus).is_ok());
        Ok(())
    }

    #[test]
    fn sheets_of_every_surface_are_manifold_on_coarse_and_fine_grids() -> Result<(), NoFoot> {
        let surfaces: [Box<dyn LevelSet>; 3] = [
            Box::new(SchwarzP { period: 1.0 }),
            Box::new(Gyroid { period: 1.0 }),
            Box::new(Diamond { period: 1.0 }),
        ];
        for surface in &surfaces {
            for cells in [16, 20, 27, 32, 50, 64] {
                for level in [-0.6, -0.2, 0.0, 0.3] {
                    // Off the planes that touch the diamond surface along its straight lines: there the box itself would
                    // cut the sheet into touching pieces.
                    let mesh = march(surface.as_ref(), level, &cube(0.013, 1.013, cells))?;
                    assert!(mesh.positions.iter().all(|&p| (surface.value(p) - level).abs() < 1e-9));
                    if let Err(defects) = Sheet::new(mesh) {
                        panic!("{surface:?} at {level}, {cells} cells: {defects}");
                    }
                }
            }
        }
        Ok(())
    }

    #[test]
    fn the_same_bytes_for_one_and_two_threads() {
        let grid = Grid { low: DVec3::ZERO, high: DVec3::new(1.0, 1.0, 0.5), cells: [64, 64, 40] };
        let meshes = [1, 2].map(|threads| {
            let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else {
                panic!("no pool")
            };
            pool.install(|| march(&SchwarzP { period: 1.0 }, 0.2, &grid))
        });
        assert!(meshes[0].is_ok() && meshes[0] == meshes[1]);
    }
}
