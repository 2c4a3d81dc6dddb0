//! The Delaunay triangulation of cell centres.

use glam::DVec2;
use rayon::prelude::*;
use spade::{
    DelaunayTriangulation, HasPosition, HierarchyHintGenerator, Point2, Triangulation as _,
    handles::{DirectedEdgeHandle, FixedUndirectedEdgeHandle},
};

/// Edges that are not worth sharing among threads.
const EDGES_PER_TASK: usize = 512;

/// A triangulation in which a place is found in O(log n).
type Triangulated = DelaunayTriangulation<Centre, (), (), (), HierarchyHintGenerator<f64>>;

/// A centre in the triangulation, with its place in the list that it came from.
#[derive(Clone, Copy)]
struct Centre {
    position: Point2<f64>,
    index: usize,
}

impl Centre {
    const fn new(position: DVec2, index: usize) -> Self {
        Self { position: Point2 { x: position.x, y: position.y }, index }
    }
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
#[derive(Default)]
pub(crate) struct Delaunay {
    triangulation: Triangulated,
    count: usize,
}

impl Delaunay {
    /// Triangulates; coincident or non-finite points stay out.
    pub(crate) fn of(points: &[DVec2]) -> Self {
        let centres = points.iter().enumerate().filter(|(_, p)| p.is_finite());
        let centres = centres.map(|(index, point)| Centre::new(*point, index)).collect();
        let triangulation = Triangulated::bulk_load_stable(centres).unwrap_or_default();
        Self { triangulation, count: points.len() }
    }

    /// Adds a point, whose index is the number of those before it; one that coincides with another takes its place.
    pub(crate) fn add(&mut self, point: DVec2) {
        // What cannot be inserted stays out, as in `of`.
        let _ = self.triangulation.insert(Centre::new(point, self.count));
        self.count += 1;
    }

    /// Triples of indices.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.triangulation.inner_faces().map(|face| face.vertices().map(|vertex| vertex.data().index))
    }

    /// All edges, in no particular order.
    pub(crate) fn unsorted_edges(&self) -> impl IndexedParallelIterator<Item = Edge> {
        let edges: Vec<FixedUndirectedEdgeHandle> = self.triangulation.fixed_undirected_edges().collect();
        edges.into_par_iter().with_min_len(EDGES_PER_TASK).map(|edge| self.edge(edge))
    }

    fn edge(&self, edge: FixedUndirectedEdgeHandle) -> Edge {
        let edge = self.triangulation.undirected_edge(edge);
        let [a, b] = edge.vertices().map(|vertex| vertex.data().index);
        let third = |side: DirectedEdgeHandle<'_, Centre, (), (), ()>| {
            side.opposite_vertex().map(|vertex| vertex.data().index)
        };
        let side = edge.as_directed();
        Edge { ends: (a.min(b), a.max(b)), thirds: [third(side), third(side.rev())] }
    }

    /// All edges, in ascending order of their ends.
    pub(crate) fn edges(&self) -> Vec<Edge> {
        let mut edges: Vec<Edge> = self.unsorted_edges().collect();
        edges.sort_unstable_by_key(|edge| edge.ends);
        edges
    }

    /// Neighbours of every point, in ascending order.
    pub(crate) fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut neighbours = vec![Vec::new(); self.count];
        for Edge { ends: (a, b), .. } in self.edges() {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        neighbours.iter_mut().for_each(|list| list.sort_unstable());
        neighbours
    }
}

/// Length of the Voronoi edge between two points that have two others on either side: the distance of the circumcentres, negative
/// if it is the others that touch; `None` where three are in line.
pub(crate) fn voronoi_length([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> Option<f64> {
    let across = (b - a).perp().normalize_or_zero();
    let length = (circumcentre(a, b, c)? - circumcentre(a, b, d)?).dot(across);
    Some(if (c - a).dot(across) > 0.0 { length } else { -length })
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
