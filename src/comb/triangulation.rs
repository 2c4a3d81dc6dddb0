//! The Delaunay triangulation of cell centres.

use glam::DVec2;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation as _};
use std::collections::BTreeMap;

/// A centre in the triangulation, with its place in the list that it came from.
#[derive(Clone, Copy)]
struct Centre {
    position: Point2<f64>,
    index: usize,
}

impl HasPosition for Centre {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Triangles between points, and who is opposite whom across each edge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Delaunay {
    /// Counter-clockwise (in a frame with y up) triples of indices.
    pub(crate) triangles: Vec<[usize; 3]>,
    /// For every edge (lower index first), the third corner of each triangle on it.
    pub(crate) edges: BTreeMap<(usize, usize), Vec<usize>>,
}

impl Delaunay {
    /// Triangulates; coincident or non-finite points stay out.
    pub(crate) fn of(points: &[DVec2]) -> Self {
        let centres = points
            .iter()
            .enumerate()
            .filter(|(_, p)| p.is_finite())
            .map(|(index, p)| Centre { position: Point2::new(p.x, p.y), index })
            .collect();
        let Ok(triangulation) = DelaunayTriangulation::<Centre>::bulk_load_stable(centres) else {
            return Self::default();
        };
        let triangles: Vec<[usize; 3]> = triangulation
            .inner_faces()
            .map(|face| face.vertices().map(|vertex| vertex.data().index))
            .collect();
        let mut edges: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for [a, b, c] in &triangles {
            for (p, q, third) in [(a, b, c), (b, c, a), (c, a, b)] {
                edges.entry((*p.min(q), *p.max(q))).or_default().push(*third);
            }
        }
        Self { triangles, edges }
    }

    /// Neighbours of every point, in ascending order.
    pub(crate) fn neighbours(&self, count: usize) -> Vec<Vec<usize>> {
        let mut neighbours = vec![Vec::new(); count];
        for (a, b) in self.edges.keys() {
            neighbours[*a].push(*b);
            neighbours[*b].push(*a);
        }
        neighbours.iter_mut().for_each(|list| list.sort_unstable());
        neighbours
    }

    /// Length of the Voronoi edge between two neighbours: the distance of the circumcentres on both sides; `None` at the
    /// hull.
    pub(crate) fn voronoi_length(&self, points: &[DVec2], a: usize, b: usize) -> Option<f64> {
        let &[c, d] = self.edges.get(&(a.min(b), a.max(b)))?.as_slice() else { return None };
        let one = circumcentre(points[a], points[b], points[c])?;
        let two = circumcentre(points[a], points[b], points[d])?;
        Some(one.distance(two))
    }
}

/// Centre of the circle through three points; `None` where they are in line.
pub(crate) fn circumcentre(a: DVec2, b: DVec2, c: DVec2) -> Option<DVec2> {
    let (p, q) = (b - a, c - a);
    let twice_area = 2.0 * p.perp_dot(q);
    if twice_area.abs() < 1e-9 {
        return None;
    }
    let (pp, qq) = (p.length_squared(), q.length_squared());
    Some(a + DVec2::new(q.y * pp - p.y * qq, p.x * qq - q.x * pp) / twice_area)
}
