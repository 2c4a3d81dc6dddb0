//! What keeps a mesh from bounding a solid.

use super::{TriMesh, VertexId};
use crate::index::Id;
use glam::DVec3;

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

/// No opposite half-edge: the border.
const NONE: u32 = u32::MAX;

/// A half-edge of an edge that does not pair up.
const BAD: u32 = u32::MAX - 1;

/// All defects of a mesh that should be closed; open edges among them. Also its border edges, in order of their triangles.
pub(super) fn inspect(mesh: &TriMesh) -> (Vec<MeshDefect>, Vec<BorderEdge>) {
    let (mut defects, border) = inspect_open(mesh);
    defects.extend(border.iter().map(|edge| MeshDefect::OpenEdge(edge.from, edge.to)));
    (defects, border)
}

/// All defects of a mesh that may have a border, and its border.
pub(super) fn inspect_open(mesh: &TriMesh) -> (Vec<MeshDefect>, Vec<BorderEdge>) {
    let mut defects = bad_elements(mesh);
    if !defects.is_empty() {
        return (defects, Vec::new());
    }
    let opposites = pair_half_edges(mesh, &mut defects);
    if defects.is_empty() {
        find_doubles(mesh, &opposites, &mut defects);
        find_pinches(mesh, &opposites, &mut defects);
    }
    let border = opposites
        .iter()
        .enumerate()
        .filter(|&(_, &opposite)| opposite == NONE)
        .map(|(half_edge, _)| {
            let (from, to) = ends(mesh, half_edge);
            BorderEdge { from, to }
        })
        .collect();
    (defects, border)
}

/// Places that are not finite, corners that do not exist, triangles without area.
fn bad_elements(mesh: &TriMesh) -> Vec<MeshDefect> {
    let mut defects: Vec<MeshDefect> = mesh
        .positions
        .enumerated()
        .filter(|(_, p)| !p.is_finite())
        .map(|(vertex, _)| MeshDefect::NotFinite(vertex))
        .collect();
    let count = mesh.positions.len();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        if triangle.iter().any(|vertex| vertex.index() >= count) {
            defects.push(MeshDefect::NoSuchVertex(index));
            continue;
        }
        let [a, b, c] = mesh.corners(*triangle);
        if (b - a).cross(c - a) == DVec3::ZERO {
            defects.push(MeshDefect::Degenerate(index));
        }
    }
    defects
}

/// The ends of a half-edge: the `half_edge % 3`-th side of triangle `half_edge / 3`.
fn ends(mesh: &TriMesh, half_edge: usize) -> (VertexId, VertexId) {
    let triangle = mesh.triangles[half_edge / 3];
    (triangle[half_edge % 3], triangle[(half_edge + 1) % 3])
}

/// The opposite of each half-edge, or [`NONE`]; edges that do not pair up are reported.
///
/// Half-edges are sorted into buckets by their lower end, then matched within each: linear in time.
fn pair_half_edges(mesh: &TriMesh, defects: &mut Vec<MeshDefect>) -> Vec<u32> {
    let count = 3 * mesh.triangles.len();
    let lower = |half_edge: usize| {
        let (from, to) = ends(mesh, half_edge);
        from.min(to).index()
    };
    let mut starts = vec![0_u32; mesh.positions.len() + 1];
    for half_edge in 0..count {
        starts[lower(half_edge) + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut bucketed = vec![0_u32; count];
    for half_edge in 0..count {
        let slot = &mut next[lower(half_edge)];
        bucketed[*slot as usize] = crate::index::checked_u32(half_edge);
        *slot += 1;
    }
    let mut opposites = vec![NONE; count];
    for window in starts.windows(2) {
        match_bucket(mesh, &bucketed[window[0] as usize..window[1] as usize], &mut opposites, defects);
    }
    opposites
}

/// Pairs the half-edges of one bucket: those with the same ends, one in each direction.
fn match_bucket(mesh: &TriMesh, bucket: &[u32], opposites: &mut [u32], defects: &mut Vec<MeshDefect>) {
    for (place, &one) in bucket.iter().enumerate() {
        let (from, to) = ends(mesh, one as usize);
        let same = |&&other: &&u32| {
            let (f, t) = ends(mesh, other as usize);
            (f, t) == (from, to) || (f, t) == (to, from)
        };
        // The first of an edge's half-edges speaks for all of them.
        if bucket[..place].iter().any(|other| same(&other)) {
            continue;
        }
        let there = bucket.iter().filter(same).filter(|&&other| ends(mesh, other as usize).0 == from).count();
        let back = bucket.iter().filter(same).count() - there;
        match (there, back) {
            (1, 1) => {
                if let Some(&other) = bucket[place + 1..].iter().find(|other| same(other)) {
                    opposites[one as usize] = other;
                    opposites[other as usize] = one;
                }
            }
            (1, 0) => {}
            _ => {
                bucket.iter().filter(same).for_each(|&other| opposites[other as usize] = BAD);
                defects.push(MeshDefect::BadEdge(from, to, there, back));
            }
        }
    }
}

/// Neighbouring triangles with the same three corners: closed, but without volume.
fn find_doubles(mesh: &TriMesh, opposites: &[u32], defects: &mut Vec<MeshDefect>) {
    let apex = |half_edge: usize| mesh.triangles[half_edge / 3][(half_edge % 3 + 2) % 3];
    for (one, &other) in opposites.iter().enumerate() {
        let (mine, its) = (one / 3, other as usize / 3);
        if other != NONE && mine < its && apex(one) == apex(other as usize) {
            let double = MeshDefect::Doubled(mine, its);
            if !defects.contains(&double) {
                defects.push(double);
            }
        }
    }
}

/// Vertices whose triangles form more than one fan: turning round from one corner must visit all of them.
fn find_pinches(mesh: &TriMesh, opposites: &[u32], defects: &mut Vec<MeshDefect>) {
    let mut corners = vec![0_u32; mesh.positions.len()];
    let mut first = vec![NONE; mesh.positions.len()];
    for (half_edge, &opposite) in opposites.iter().enumerate() {
        let (vertex, _) = ends(mesh, half_edge);
        corners[vertex.index()] += 1;
        let slot = &mut first[vertex.index()];
        // On a border start where the turn begins, so that it meets every corner of the fan.
        if *slot == NONE || opposite == NONE {
            *slot = crate::index::checked_u32(half_edge);
        }
    }
    for (vertex, &start) in first.iter().enumerate() {
        if start == NONE {
            continue;
        }
        let (mut turned, mut at) = (0, start);
        loop {
            turned += 1;
            // The side before this one in the same triangle ends at the vertex; its opposite leaves it.
            let before = at / 3 * 3 + (at + 2) % 3;
            at = opposites[before as usize];
            if at == NONE || at == start || turned > corners[vertex] {
                break;
            }
        }
        if turned != corners[vertex] {
            defects.push(MeshDefect::PinchedVertex(VertexId::from_index(vertex)));
        }
    }
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
