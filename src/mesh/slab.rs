//! The layers of cubes that one thread meshes.

use super::cube_cases::CUBE_CASES;
use crate::surface::{GridSampler, LevelSet, NoFoot};
use glam::DVec3;

/// Nodes on the surface up to rounding count as above it, so that the rounding does not scatter their signs.
pub(super) const ON_SURFACE: f64 = 1e-12;

/// No vertex yet.
const NONE: u32 = u32::MAX;

/// Vertices of a slab's last plane are numbered from here: they belong to the next slab if it has them too.
pub(super) const FOREIGN: u32 = 1 << 31;

/// What is marched over.
pub(super) struct Field<'a> {
    pub(super) surface: &'a dyn LevelSet,
    pub(super) level: f64,
    pub(super) axes: &'a [Vec<f64>; 3],
    pub(super) sampler: &'a dyn GridSampler,
    pub(super) near: f64,
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

/// Two planes and the numbers of the vertices between them, kept from slab to slab: numbers are read only where this slab has
/// set them.
pub(super) struct Workspace {
    lower: Plane,
    upper: Plane,
    z_ids: Vec<u32>,
}

impl Workspace {
    pub(super) fn new(field: &Field<'_>) -> Self {
        let size = field.plane_size();
        Self { lower: Plane::empty(size), upper: Plane::empty(size), z_ids: vec![NONE; size[0] * size[1]] }
    }
}

/// What a vertex in a plane is called by both slabs that meet there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Key {
    XEdge(usize),
    YEdge(usize),
    Node(usize),
}

/// The mesh of some layers.
pub(super) struct Slab {
    first: usize,
    last: usize,
    pub(super) positions: Vec<DVec3>,
    /// Vertices of the last plane, which the next slab may have too.
    pub(super) top: Vec<(Key, DVec3)>,
    /// Numbers of the vertices of the first plane.
    pub(super) bottom: Vec<(Key, u32)>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Whether there is another slab above.
    ends_inside: bool,
}

impl Slab {
    /// The mesh of the layers from `first` to before `last`.
    pub(super) fn mesh(
        field: &Field<'_>,
        workspace: &mut Workspace,
        first: usize,
        last: usize,
    ) -> Result<Self, NoFoot> {
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
        let Workspace { lower, upper, z_ids } = workspace;
        lower.sample(field, first);
        slab.cross_plane(field, lower)?;
        for k in first..last {
            upper.sample(field, k + 1);
            slab.cross_layer(field, lower, upper, z_ids)?;
            slab.cross_plane(field, upper)?;
            slab.fill_layer(size, lower, upper, z_ids);
            std::mem::swap(lower, upper);
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
