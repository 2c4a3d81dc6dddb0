//! What keeps a mesh from bounding a solid.

use super::{TriMesh, VertexId};
use crate::index::Id;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// One defect of a mesh, with the vertices that show it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshDefect {
    /// A vertex whose place is not finite.
    #[error("vertex {0:?} is not at a finite place")]
    NotFinite(VertexId),
    /// A triangle that names a vertex that does not exist.
    #[error("triangle {0} names a vertex that does not exist")]
    NoSuchVertex(usize),
    /// A triangle with a repeated corner or without area.
    #[error("triangle {0} has no area")]
    Degenerate(usize),
    /// An edge with one triangle.
    #[error("the edge {0:?}–{1:?} has only one triangle")]
    OpenEdge(VertexId, VertexId),
    /// An edge whose triangles do not pair up, one in each direction.
    #[error("the edge {0:?}–{1:?} has {2} triangles one way and {3} the other")]
    BadEdge(VertexId, VertexId, usize, usize),
    /// Two triangles on the same three corners, back to back.
    #[error("triangles {0} and {1} have the same corners")]
    Doubled(usize, usize),
    /// A vertex at which several fans of triangles touch.
    #[error("vertex {0:?} joins separate fans of triangles")]
    PinchedVertex(VertexId),
}

/// A directed edge `from → to` of a triangle without an opposite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BorderEdge {
    pub(super) from: VertexId,
    pub(super) to: VertexId,
}

/// All defects of a mesh that should be closed; open edges among them. Also its border edges, in order of their first ends.
pub(super) fn inspect(mesh: &TriMesh) -> (Vec<MeshDefect>, Vec<BorderEdge>) {
    let (mut defects, border) = inspect_open(mesh);
    defects.extend(border.iter().map(|edge| MeshDefect::OpenEdge(edge.from, edge.to)));
    (defects, border)
}

/// All defects of a mesh that may have a border, and its border.
///
/// A mesh is a manifold if the link of every vertex, the opposite sides of its triangles, is one circle or one path; each
/// link needs nothing but the triangles of its vertex, so they are looked at in parallel.
pub(super) fn inspect_open(mesh: &TriMesh) -> (Vec<MeshDefect>, Vec<BorderEdge>) {
    let defects = bad_elements(mesh);
    if !defects.is_empty() {
        return (defects, Vec::new());
    }
    let links = Links::new(mesh);
    let found: Vec<Found> = (0..mesh.positions.len().div_ceil(LINKS_AT_A_TIME))
        .into_par_iter()
        .map(|part| {
            let first = part * LINKS_AT_A_TIME;
            let last = (first + LINKS_AT_A_TIME).min(mesh.positions.len());
            let mut found = Found::default();
            (first..last).for_each(|vertex| links.inspect(VertexId::from_index(vertex), mesh, &mut found));
            found
        })
        .collect();
    let (mut defects, mut border) = (Vec::new(), Vec::new());
    for part in found {
        defects.extend(part.defects);
        border.extend(part.border);
    }
    (defects, border)
}

/// Vertices whose links are looked at by one thread in a row: enough to make starting it cheap.
const LINKS_AT_A_TIME: usize = 1 << 14;

/// Places that are not finite, corners that do not exist, triangles without area.
fn bad_elements(mesh: &TriMesh) -> Vec<MeshDefect> {
    let count = mesh.positions.len();
    let places = mesh.positions.as_slice().par_iter().enumerate();
    let far = places
        .filter(|(_, p)| !p.is_finite())
        .map(|(vertex, _)| MeshDefect::NotFinite(VertexId::from_index(vertex)));
    let mut defects: Vec<MeshDefect> = far.collect();
    let flat = mesh.triangles.par_iter().enumerate().filter_map(|(index, triangle)| {
        if triangle.iter().any(|vertex| vertex.index() >= count) {
            return Some(MeshDefect::NoSuchVertex(index));
        }
        has_no_area(mesh.corners(*triangle)).then_some(MeshDefect::Degenerate(index))
    });
    defects.par_extend(flat);
    defects
}

/// Whether a triangle with these corners has no area, or a repeated corner.
pub(super) fn has_no_area([a, b, c]: [DVec3; 3]) -> bool {
    (b - a).cross(c - a) == DVec3::ZERO
}

/// The corners of all triangles, by vertex.
struct Links {
    /// Where each vertex's corners start, and the end of the last's.
    starts: Vec<u32>,
    /// For each corner, the two others of its triangle, counter-clockwise.
    others: Vec<[VertexId; 2]>,
}

/// What was found at some vertices.
#[derive(Default)]
struct Found {
    defects: Vec<MeshDefect>,
    border: Vec<BorderEdge>,
}

impl Links {
    /// Corners are counted, then put in their places: linear in time.
    fn new(mesh: &TriMesh) -> Self {
        let count = mesh.positions.len();
        let mut starts = vec![0_u32; count + 1];
        for vertex in mesh.triangles.iter().flatten() {
            starts[vertex.index()] += 1;
        }
        // Each start is set to the end of its corners and comes back while they are filled in from there.
        let mut sum = 0_u32;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let nobody = VertexId::from_index(0);
        let mut others = vec![[nobody; 2]; 3 * mesh.triangles.len()];
        for &[a, b, c] in mesh.triangles.iter().rev() {
            for (vertex, pair) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                let start = &mut starts[vertex.index()];
                *start -= 1;
                others[*start as usize] = pair;
            }
        }
        Self { starts, others }
    }

    /// The link of a vertex: directed from the first to the second of each corner's others.
    fn of(&self, vertex: VertexId) -> &[[VertexId; 2]] {
        let at = vertex.index();
        &self.others[self.starts[at] as usize..self.starts[at + 1] as usize]
    }

    /// What is wrong at one vertex, and the border edge that leaves it. Edges that do not pair up are told by their lower end.
    fn inspect(&self, vertex: VertexId, mesh: &TriMesh, found: &mut Found) {
        let link = self.of(vertex);
        if is_circle(link) {
            if link.len() == 2 {
                found.defects.extend(doubled(mesh, vertex, link[0]));
            }
            return;
        }
        let bad = bad_edges(vertex, link);
        if !bad.is_empty() {
            found.defects.extend(bad.into_iter().filter(|&(end, _)| vertex < end).map(|(_, defect)| defect));
            return;
        }
        if !is_path_or_empty(link) {
            found.defects.push(MeshDefect::PinchedVertex(vertex));
        }
        found.border.extend(path_starts(link).map(|side| BorderEdge { from: vertex, to: side[0] }));
    }
}

/// How many sides of a link are passed from `first` on, each starting where the one before ends, and whether the first
/// comes again. Links with repeated ends are left after as many steps as there are sides.
fn turn(link: &[[VertexId; 2]], first: [VertexId; 2]) -> (usize, bool) {
    let mut at = first;
    for turned in 1..=link.len() {
        match link.iter().find(|side| side[0] == at[1]) {
            Some(&next) if next == first => return (turned, true),
            Some(&next) => at = next,
            None => return (turned, false),
        }
    }
    (0, false)
}

/// Whether a link's sides, from the first on, are all passed once before the first comes again.
fn is_circle(link: &[[VertexId; 2]]) -> bool {
    link.first().is_some_and(|&first| turn(link, first) == (link.len(), true))
}

fn is_path_or_empty(link: &[[VertexId; 2]]) -> bool {
    link.is_empty() || path_starts(link).any(|&first| turn(link, first) == (link.len(), false))
}

/// Sides that start where none ends.
fn path_starts(link: &[[VertexId; 2]]) -> impl Iterator<Item = &[VertexId; 2]> {
    link.iter().filter(|side| link.iter().all(|other| other[1] != side[0]))
}

/// The edges at `vertex` that have more than one triangle on a side, with their other ends.
fn bad_edges(vertex: VertexId, link: &[[VertexId; 2]]) -> Vec<(VertexId, MeshDefect)> {
    let ends: BTreeSet<VertexId> = link.iter().flatten().copied().collect();
    let sides = |end: VertexId| [0, 1].map(|way| link.iter().filter(|side| side[way] == end).count());
    ends.into_iter()
        .map(|end| (end, sides(end)))
        .filter(|(_, [there, back])| *there > 1 || *back > 1)
        .map(|(end, [there, back])| (end, MeshDefect::BadEdge(vertex, end, there, back)))
        .collect()
}

/// The two triangles on `vertex` and `others`, if `vertex` is the lowest of them.
fn doubled(mesh: &TriMesh, vertex: VertexId, others: [VertexId; 2]) -> Option<MeshDefect> {
    let [a, b] = others;
    let mut same = mesh
        .triangles
        .iter()
        .enumerate()
        .filter(|(_, triangle)| [vertex, a, b].iter().all(|corner| triangle.contains(corner)))
        .map(|(index, _)| index);
    (vertex < a.min(b)).then(|| Some(MeshDefect::Doubled(same.next()?, same.next()?))).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ClosedMesh;

    /// A tetrahedron with its corner at `at`.
    fn tetrahedron(at: DVec3) -> TriMesh {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| p + at).to_vec().into();
        let triangles =
            [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|t| t.map(VertexId::from_index)).to_vec();
        TriMesh { positions, triangles }
    }

    #[test]
    fn a_tetrahedron_is_closed() {
        assert!(ClosedMesh::new(tetrahedron(DVec3::ZERO)).is_ok());
    }

    #[test]
    fn each_defect_is_found() {
        let v = VertexId::from_index;
        let defects = |mesh: &TriMesh| inspect(mesh).0;
        let mut open = tetrahedron(DVec3::ZERO);
        open.triangles.pop();
        assert_eq!(defects(&open).len(), 3, "{:?}", defects(&open));
        let mut turned = tetrahedron(DVec3::ZERO);
        turned.triangles[0].swap(0, 1);
        assert!(
            defects(&turned)
                .iter()
                .all(|d| matches!(d, MeshDefect::BadEdge(_, _, 2, 0) | MeshDefect::BadEdge(_, _, 0, 2)))
        );
        let mut doubled = tetrahedron(DVec3::ZERO);
        doubled.triangles.push(doubled.triangles[0]);
        assert!(
            defects(&doubled).contains(&MeshDefect::BadEdge(v(0), v(2), 2, 1)),
            "{:?}",
            defects(&doubled)
        );
        let mut flat = tetrahedron(DVec3::ZERO);
        flat.positions[v(3)] = DVec3::new(0.5, 0.5, 0.0);
        assert_eq!(defects(&flat), [MeshDefect::Degenerate(2)]);
        let mut lost = tetrahedron(DVec3::ZERO);
        lost.positions[v(3)].x = f64::NAN;
        assert_eq!(defects(&lost), [MeshDefect::NotFinite(v(3))]);
    }

    #[test]
    fn two_triangles_back_to_back_are_no_solid() {
        let mut mesh = tetrahedron(DVec3::ZERO);
        mesh.triangles = [[0, 2, 1], [0, 1, 2]].map(|t| t.map(VertexId::from_index)).to_vec();
        assert_eq!(inspect(&mesh).0, [MeshDefect::Doubled(0, 1)]);
    }

    #[test]
    fn two_solids_that_share_a_vertex_are_pinched() {
        let mut mesh = tetrahedron(DVec3::ZERO);
        let other = tetrahedron(DVec3::ZERO).map(|p| -p);
        let offset = mesh.positions.len();
        mesh.append(&other);
        // The other one is mirrored, so its triangles are turned; its corner at the origin is joined to the first's.
        for triangle in mesh.triangles.iter_mut().skip(4) {
            triangle.swap(1, 2);
            for vertex in triangle {
                if vertex.index() == offset {
                    *vertex = VertexId::from_index(0);
                }
            }
        }
        assert_eq!(inspect(&mesh).0, [MeshDefect::PinchedVertex(VertexId::from_index(0))]);
    }
}
