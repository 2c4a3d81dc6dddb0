//! The Delaunay triangulation of cell centres.

use glam::DVec2;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation as _};

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

/// An edge between two neighbouring centres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    /// Its ends, lower index first.
    pub(crate) ends: (usize, usize),
    /// The third corners of the triangles on both sides; one is missing at the hull.
    pub(crate) thirds: [Option<usize>; 2],
}

impl Edge {
    /// The third corners that exist.
    pub(crate) fn across(&self) -> impl Iterator<Item = usize> + use<> {
        self.thirds.into_iter().flatten()
    }
}

/// Triangles between points, and who is opposite whom across each edge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Delaunay {
    /// Triples of indices.
    pub(crate) triangles: Vec<[usize; 3]>,
    /// All edges, in ascending order of their ends.
    pub(crate) edges: Vec<Edge>,
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
        let mut edges: Vec<Edge> = triangulation
            .undirected_edges()
            .map(|edge| {
                let [a, b] = edge.vertices().map(|vertex| vertex.data().index);
                let third = |side: spade::handles::DirectedEdgeHandle<'_, Centre, (), (), ()>| {
                    side.opposite_vertex().map(|vertex| vertex.data().index)
                };
                let side = edge.as_directed();
                Edge { ends: (a.min(b), a.max(b)), thirds: [third(side), third(side.rev())] }
            })
            .collect();
        edges.sort_unstable_by_key(|edge| edge.ends);
        Self { triangles, edges }
    }

    /// Neighbours of every point, in ascending order.
    pub(crate) fn neighbours(&self, count: usize) -> Vec<Vec<usize>> {
        let mut neighbours = vec![Vec::new(); count];
        for Edge { ends: (a, b), .. } in &self.edges {
            neighbours[*a].push(*b);
            neighbours[*b].push(*a);
        }
        neighbours.iter_mut().for_each(|list| list.sort_unstable());
        neighbours
    }
}

/// Length of the Voronoi edge across an edge: the distance of the circumcentres on both sides; `None` at the hull.
pub(crate) fn voronoi_length(points: &[DVec2], edge: &Edge) -> Option<f64> {
    let [Some(c), Some(d)] = edge.thirds else { return None };
    let (a, b) = (points[edge.ends.0], points[edge.ends.1]);
    let one = circumcentre(a, b, points[c])?;
    let two = circumcentre(a, b, points[d])?;
    Some(one.distance(two))
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
