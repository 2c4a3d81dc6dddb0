//! A bounding-volume hierarchy over the triangles of a mesh: nearest points and overlapping pairs.
//!
//! The tree is perfect: every leaf is at the same depth and the triangles are shared out evenly among the leaves, so that
//! the nodes are nothing but boxes in preorder (the left child follows its parent, the right one follows the left one's
//! subtree) and no child is stored. Each split halves the triangles at the median of their middles along the longest side
//! of the box round those middles. Boxes are in `f32`, rounded outward: 24 bytes a node, about 18 bytes a triangle in all.
//!
//! It is our own because the walk of a tree against itself is what [`super::self_intersections`] lives on: the crate `bvh`
//! (0.13) has the nearest shape and rays but no pairs, and needs a second linear algebra, `nalgebra`, and a record per
//! triangle; `parry3d` has both in one scalar type and brings a physics engine's shapes along.
//!
//! Source of the nearest point on a triangle: Ericson, *Real-Time Collision Detection* (2005), section 5.1.5.

use super::TriMesh;
use crate::index::checked_u32;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles of a leaf, at most.
const LEAF: usize = 4;

/// Subtrees of at least this height are built, and walked, by tasks of their own.
const TASK_HEIGHT: u32 = 9;

/// A box, rounded outward from `f64`.
#[derive(Clone, Copy, Debug)]
struct Aabb {
    low: [f32; 3],
    high: [f32; 3],
}

/// A node: its place in preorder, its height above the leaves and the part of [`Bvh::order`] below it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    at: usize,
    height: u32,
    start: usize,
    end: usize,
}

impl Node {
    fn children(self) -> [Self; 2] {
        let Self { at, height, start, end } = self;
        let (height, middle) = (height - 1, start.midpoint(end));
        // The left subtree has 2^(height + 1) − 1 nodes.
        [
            Self { at: at + 1, height, start, end: middle },
            Self { at: at + (2 << height), height, start: middle, end },
        ]
    }
}

/// What the build sorts: a triangle and the middle of its box.
#[derive(Clone, Copy)]
struct Item {
    middle: [f32; 3],
    triangle: u32,
}

/// The tree over the triangles of a mesh.
#[derive(Clone, Debug)]
pub struct Bvh<'a> {
    mesh: &'a TriMesh,
    /// The height of the root; leaves have 0.
    height: u32,
    /// The boxes of the nodes in preorder.
    boxes: Vec<Aabb>,
    /// Triangles in the order of the leaves.
    order: Vec<u32>,
}

/// The point of a mesh nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Where it is.
    pub position: DVec3,
    /// How far it is.
    pub distance: f64,
    /// The triangle it lies on; of several the first.
    pub triangle: usize,
}

impl<'a> Bvh<'a> {
    /// The tree over `mesh`, whose places are finite. The same for any number of threads.
    #[must_use]
    pub fn new(mesh: &'a TriMesh) -> Self {
        let count = mesh.triangles.len();
        let height = count.div_ceil(LEAF).max(1).next_power_of_two().ilog2();
        let mut items: Vec<Item> = (0..count)
            .into_par_iter()
            .map(|index| {
                let Aabb { low, high } = Aabb::of(mesh.corners(mesh.triangles[index]));
                let middle = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
                Item { middle, triangle: checked_u32(index) }
            })
            .collect();
        let mut boxes = vec![Aabb::EMPTY; (2 << height) - 1];
        build(mesh, height, &mut items, &mut boxes);
        Self { mesh, height, boxes, order: items.iter().map(|item| item.triangle).collect() }
    }

    /// The point of the mesh nearest to `p`; none if the mesh has no triangle.
    #[must_use]
    pub fn closest(&self, p: DVec3) -> Option<Closest> {
        let mut best: Option<(f64, usize, DVec3)> = None;
        let mut stack = vec![(0.0, self.root())];
        while let Some((bound, node)) = stack.pop() {
            if best.is_some_and(|(distance, ..)| bound > distance) {
                continue;
            }
            if node.height > 0 {
                let mut next = node.children().map(|child| (self.boxes[child.at].distance_squared(p), child));
                // The nearer child is taken first, so it goes on the stack last.
                if next[0].0 < next[1].0 {
                    next.swap(0, 1);
                }
                stack.extend(next);
                continue;
            }
            for (triangle, corners) in self.leaf(node) {
                let position = nearest_on_triangle(p, corners);
                let squared = p.distance_squared(position);
                if best
                    .is_none_or(|(least, first, _)| squared < least || (squared <= least && triangle < first))
                {
                    best = Some((squared, triangle, position));
                }
            }
        }
        best.map(|(squared, triangle, position)| Closest { position, distance: squared.sqrt(), triangle })
    }

    /// All pairs of triangles whose boxes meet and that `keep` accepts; each with its lower triangle first, in order.
    pub fn overlaps(&self, keep: impl Fn(usize, usize) -> bool + Sync) -> Vec<(usize, usize)> {
        let boxes: Vec<Aabb> = self.order.par_iter().map(|&triangle| self.triangle_box(triangle)).collect();
        let mut tasks = Vec::new();
        self.walk(vec![(self.root(), self.root())], TASK_HEIGHT, |a, b| tasks.push((a, b)));
        let mut pairs: Vec<(usize, usize)> = tasks
            .into_par_iter()
            .flat_map_iter(|task| {
                let mut pairs = Vec::new();
                self.walk(vec![task], 0, |a, b| self.leaf_overlaps(a, b, &boxes, &keep, &mut pairs));
                pairs
            })
            .collect();
        pairs.par_sort_unstable();
        pairs
    }

    /// Calls `f` with each pair of nodes at `height` or below whose boxes meet, nodes with themselves included, below the
    /// pairs in `stack`. Both nodes of a pair have the same height.
    fn walk(&self, mut stack: Vec<(Node, Node)>, height: u32, mut f: impl FnMut(Node, Node)) {
        while let Some((a, b)) = stack.pop() {
            if !self.boxes[a.at].meets(&self.boxes[b.at]) {
                continue;
            }
            if a.height <= height {
                f(a, b);
                continue;
            }
            let ([a_left, a_right], [b_left, b_right]) = (a.children(), b.children());
            stack.extend([(a_left, b_left), (a_left, b_right), (a_right, b_right)]);
            if a != b {
                stack.push((a_right, b_left));
            }
        }
    }

    /// The pairs of two leaves, or of one with itself. `boxes` are those of the triangles in the order of the leaves.
    fn leaf_overlaps(
        &self,
        a: Node,
        b: Node,
        boxes: &[Aabb],
        keep: &impl Fn(usize, usize) -> bool,
        pairs: &mut Vec<(usize, usize)>,
    ) {
        for one in a.start..a.end {
            let others = if a == b { one + 1..b.end } else { b.start..b.end };
            for other in others.filter(|&other| boxes[one].meets(&boxes[other])) {
                let (one, other) = (self.order[one] as usize, self.order[other] as usize);
                let pair = (one.min(other), one.max(other));
                if keep(pair.0, pair.1) {
                    pairs.push(pair);
                }
            }
        }
    }

    fn triangle_box(&self, triangle: u32) -> Aabb {
        Aabb::of(self.mesh.corners(self.mesh.triangles[triangle as usize]))
    }

    fn root(&self) -> Node {
        Node { at: 0, height: self.height, start: 0, end: self.order.len() }
    }

    /// The triangles of a leaf.
    fn leaf(&self, node: Node) -> impl Iterator<Item = (usize, [DVec3; 3])> {
        self.order[node.start..node.end].iter().map(|&triangle| {
            let triangle = triangle as usize;
            (triangle, self.mesh.corners(self.mesh.triangles[triangle]))
        })
    }
}

/// Orders `items` and fills the `boxes` of the subtree over them.
fn build(mesh: &TriMesh, height: u32, items: &mut [Item], boxes: &mut [Aabb]) {
    let Some((root, below)) = boxes.split_first_mut() else { return };
    if height == 0 {
        let corners = items.iter().flat_map(|item| mesh.corners(mesh.triangles[item.triangle as usize]));
        *root = Aabb::of(corners);
        return;
    }
    let mut middles = Aabb::EMPTY;
    items.iter().for_each(|item| middles.add(item.middle, item.middle));
    let axis = middles.longest_axis();
    let half = items.len() / 2;
    if half > 0 {
        // The triangle's number breaks ties, so that the halves do not depend on the way of selection.
        items.select_nth_unstable_by(half, |a, b| {
            a.middle[axis].total_cmp(&b.middle[axis]).then(a.triangle.cmp(&b.triangle))
        });
    }
    let (left_items, right_items) = items.split_at_mut(half);
    let (left, right) = below.split_at_mut(below.len() / 2);
    let mut build_left = || build(mesh, height - 1, left_items, left);
    let mut build_right = || build(mesh, height - 1, right_items, right);
    if height >= TASK_HEIGHT {
        rayon::join(build_left, build_right);
    } else {
        build_left();
        build_right();
    }
    for child in [left[0], right[0]] {
        root.add(child.low, child.high);
    }
}

impl Aabb {
    /// Meets nothing.
    const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// The box round places.
    fn of(places: impl IntoIterator<Item = DVec3>) -> Self {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = places.into_iter().fold(none, |(low, high), p| (low.min(p), high.max(p)));
        Self { low: low.to_array().map(below), high: high.to_array().map(above) }
    }

    fn add(&mut self, low: [f32; 3], high: [f32; 3]) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(low[axis]);
            self.high[axis] = self.high[axis].max(high[axis]);
        }
    }

    fn meets(&self, other: &Self) -> bool {
        let apart = |axis: usize| (self.low[axis] > other.high[axis]) | (other.low[axis] > self.high[axis]);
        // Without branches: whether two near boxes meet is not predictable.
        !(apart(0) | apart(1) | apart(2))
    }

    fn longest_axis(&self) -> usize {
        let [x, y, z] = std::array::from_fn(|axis| self.high[axis] - self.low[axis]);
        if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        }
    }

    /// The squared distance from `p`; infinite if the box is empty.
    fn distance_squared(&self, p: DVec3) -> f64 {
        let [low, high] = [self.low, self.high].map(|corner| DVec3::from_array(corner.map(f64::from)));
        (low - p).max(p - high).max(DVec3::ZERO).length_squared()
    }
}

/// The greatest `f32` that is not above `x`.
#[expect(clippy::cast_possible_truncation, reason = "rounded, then put on the right side")]
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The least `f32` that is not below `x`.
fn above(x: f64) -> f32 {
    -below(-x)
}

/// The point of a triangle nearest to `p`.
fn nearest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    // Weights of the corners, each with the sign of the side of the opposite edge on which `p` lies.
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + (ab * of_b + ac * of_c) / (of_a + of_b + of_c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::{Grid, VertexId, march},
        surface::{SchwarzP, Sphere},
    };
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Triangles with random corners, small ones among large ones.
    fn soup(count: usize, seed: u64) -> TriMesh {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut mesh = TriMesh::default();
        for index in 0..count {
            let size = if index % 7 == 0 { 1.0 } else { 0.05 };
            let middle = DVec3::from_array(rng.random::<[f64; 3]>());
            let corners: [VertexId; 3] = std::array::from_fn(|_| {
                mesh.positions.push(middle + size * (DVec3::from_array(rng.random::<[f64; 3]>()) - 0.5))
            });
            mesh.triangles.push(corners);
        }
        mesh
    }

    #[test]
    fn the_nearest_point_is_that_of_all_triangles_tried() {
        for count in [1, 2, 3, 5, 8, 9, 100, 777] {
            let mesh = soup(count, 7);
            let tree = Bvh::new(&mesh);
            let mut rng = ChaCha8Rng::seed_from_u64(8);
            for _ in 0..200 {
                let p = 3.0 * DVec3::from_array(rng.random::<[f64; 3]>()) - 1.0;
                let least = mesh
                    .triangle_corners()
                    .map(|corners| nearest_on_triangle(p, corners).distance_squared(p))
                    .fold(f64::INFINITY, f64::min);
                let Some(found) = tree.closest(p) else { panic!("none of {count}") };
                assert_eq!(found.distance.to_bits(), least.sqrt().to_bits());
                assert_eq!(found.position.distance(p).to_bits(), found.distance.to_bits());
            }
        }
        assert_eq!(Bvh::new(&TriMesh::default()).closest(DVec3::ZERO), None);
    }

    /// A point of a triangle is the nearest one if and only if no point of it lies further along the way to `p`: a convex
    /// set's nearest point is where `(q − nearest)·(p − nearest) ≤ 0` for all its corners `q`.
    #[test]
    fn the_nearest_point_of_a_triangle_obeys_the_law_of_projection() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        for _ in 0..20_000 {
            let [p, a, b, c] =
                std::array::from_fn(|_| 2.0 * DVec3::from_array(rng.random::<[f64; 3]>()) - DVec3::ONE);
            let nearest = nearest_on_triangle(p, [a, b, c]);
            for q in [a, b, c] {
                // Rounding of a point on a needle: far below a thousandth of a millionth of the sizes here.
                assert!((q - nearest).dot(p - nearest) < 1e-9, "{p} {a} {b} {c}");
            }
            let volume = (b - a).cross(c - a).dot(nearest - a);
            assert!(volume.abs() < 1e-12, "off the plane");
        }
    }

    #[test]
    fn distances_to_a_ball_are_those_to_its_sphere() {
        let grid = Grid { low: DVec3::splat(-1.25), high: DVec3::splat(1.25), cells: [40; 3] };
        let Ok(mesh) = march(&Sphere { radius: 1.0 }, 0.0, &grid) else { panic!("no sphere") };
        let tree = Bvh::new(&mesh);
        for p in [DVec3::new(2.0, 0.3, -0.5), DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.0, 0.0, 40.0)] {
            let Some(found) = tree.closest(p) else { panic!("none") };
            // The mesh is inscribed. A triangle in a cell of side h = 1/16 has a circle of radius at most h round it, and
            // under that circle the sphere rises by h²/2.
            let short = 1.0 - (p.length() - found.distance * (p.length() - 1.0).signum());
            assert!((-1e-12..0.5 / 256.0).contains(&short), "{found:?} {short}");
        }
    }

    #[test]
    fn overlaps_are_those_of_all_pairs_tried() {
        for count in [0, 1, 4, 5, 300] {
            let mesh = soup(count, 3);
            let boxes: Vec<Aabb> = mesh.triangle_corners().map(Aabb::of).collect();
            let mut expected = Vec::new();
            for one in 0..count {
                expected.extend((one + 1..count).filter(|&o| boxes[one].meets(&boxes[o])).map(|o| (one, o)));
            }
            assert_eq!(Bvh::new(&mesh).overlaps(|_, _| true), expected);
        }
    }

    #[test]
    fn the_same_tree_for_one_and_two_threads() {
        let grid = Grid { low: DVec3::ZERO, high: DVec3::splat(1.0), cells: [48; 3] };
        let Ok(mesh) = march(&SchwarzP { period: 1.0 }, 0.0, &grid) else { panic!("no sheet") };
        let orders = [1, 2].map(|threads| {
            let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else {
                panic!("no pool")
            };
            pool.install(|| Bvh::new(&mesh).order)
        });
        assert!(orders[0] == orders[1] && orders[0].len() == mesh.triangles.len());
    }

    #[test]
    fn boxes_are_rounded_outward() {
        for x in [0.1, -0.1, 1.0, 1e-50, -1e-50, 1.0 + f64::EPSILON, 0.0] {
            assert!(f64::from(below(x)) <= x && x <= f64::from(above(x)), "{x}");
        }
    }
}
