//! A convex polyhedron, cut by one half space after another.
//!
//! What a cut keeps follows from one sign per corner alone, so that all faces agree about it.

use glam::DVec3;
use std::collections::BTreeMap;

/// What lies behind a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::foam) enum Behind {
    /// Nothing yet: a face of the cube that the polyhedron was cut from.
    Cube,
    /// A plane wall of the domain.
    Plane {
        /// Its axis.
        axis: u8,
        /// Whether it is the upper one.
        high: bool,
    },
    /// A neighbour, by its place in the list of candidates.
    Cell(u32),
}

/// The half space `normal · x ≤ offset` with a unit normal, pointing out.
#[derive(Clone, Copy, Debug)]
pub(in crate::foam) struct HalfSpace {
    pub(in crate::foam) normal: DVec3,
    pub(in crate::foam) offset: f64,
    pub(in crate::foam) behind: Behind,
}

impl HalfSpace {
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// A face: its plane, and its corners counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub(in crate::foam) struct Face {
    pub(in crate::foam) half_space: HalfSpace,
    pub(in crate::foam) corners: Vec<u32>,
}

/// A convex polyhedron, closed and bounded.
#[derive(Clone, Debug)]
pub(in crate::foam) struct Polyhedron {
    pub(in crate::foam) corners: Vec<DVec3>,
    pub(in crate::foam) faces: Vec<Face>,
}

/// A cut ran so close through corners that what it leaves is no polyhedron, or leaves nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::foam) struct DegenerateCut;

impl Polyhedron {
    /// The cube `[-half, half]³`.
    pub(in crate::foam) fn cube(half: f64) -> Self {
        let corners = (0..8)
            .map(|code: u8| {
                let side = |bit: u8| if code & bit > 0 { half } else { -half };
                DVec3::new(side(1), side(2), side(4))
            })
            .collect();
        let face = |normal, corners: [u32; 4]| Face {
            half_space: HalfSpace { normal, offset: half, behind: Behind::Cube },
            corners: corners.to_vec(),
        };
        let faces = vec![
            face(DVec3::NEG_X, [0, 4, 6, 2]),
            face(DVec3::X, [1, 3, 7, 5]),
            face(DVec3::NEG_Y, [0, 1, 5, 4]),
            face(DVec3::Y, [2, 6, 7, 3]),
            face(DVec3::NEG_Z, [0, 2, 3, 1]),
            face(DVec3::Z, [4, 5, 7, 6]),
        ];
        Self { corners, faces }
    }

    /// The square of the distance of the farthest corner from the origin.
    pub(in crate::foam) fn radius_squared(&self) -> f64 {
        self.corners.iter().map(|corner| corner.length_squared()).fold(0.0, f64::max)
    }

    /// Cuts off what lies outside `half_space`; says whether anything did.
    ///
    /// # Errors
    /// [`DegenerateCut`]; the polyhedron is then unchanged.
    pub(in crate::foam) fn cut(&mut self, half_space: HalfSpace) -> Result<bool, DegenerateCut> {
        let heights: Vec<f64> = self.corners.iter().map(|&corner| half_space.height(corner)).collect();
        if heights.iter().all(|&height| height <= 0.0) {
            return Ok(false);
        }
        let mut cutting =
            Cutting { corners: &self.corners, heights: &heights, new: BTreeMap::new(), points: Vec::new() };
        let mut faces = Vec::with_capacity(self.faces.len() + 1);
        // The edge that each old face leaves on the cut, walked by the new face the other way.
        let mut rim: BTreeMap<u32, u32> = BTreeMap::new();
        for face in &self.faces {
            let (kept, edge) = cutting.kept(&face.corners)?;
            if let Some((leaves, returns)) = edge
                && rim.insert(returns, leaves).is_some()
            {
                return Err(DegenerateCut);
            }
            if !kept.is_empty() {
                faces.push(Face { half_space: face.half_space, corners: kept });
            }
        }
        faces.push(Face { half_space, corners: closed_loop(&rim)? });
        let points = cutting.points;
        self.corners.extend(points);
        self.faces = faces;
        self.drop_unused_corners();
        Ok(true)
    }

    fn drop_unused_corners(&mut self) {
        let mut place = vec![None; self.corners.len()];
        let mut kept = Vec::new();
        for face in &mut self.faces {
            for corner in &mut face.corners {
                let old = *corner as usize;
                *corner = *place[old].get_or_insert_with(|| {
                    kept.push(self.corners[old]);
                    crate::index::checked_u32(kept.len() - 1)
                });
            }
        }
        self.corners = kept;
    }
}

/// The corners of a face's kept part, and where its boundary leaves the kept side and returns to it, if it does.
type Kept = (Vec<u32>, Option<(u32, u32)>);

/// A cut in progress: the new corner on each cut edge.
struct Cutting<'a> {
    corners: &'a [DVec3],
    heights: &'a [f64],
    new: BTreeMap<(u32, u32), u32>,
    points: Vec<DVec3>,
}

impl Cutting<'_> {
    /// The part of a face that is kept.
    fn kept(&mut self, face: &[u32]) -> Result<Kept, DegenerateCut> {
        let mut kept = Vec::with_capacity(face.len() + 1);
        let (mut leaves, mut returns) = (None, None);
        for (index, &from) in face.iter().enumerate() {
            let to = face[(index + 1) % face.len()];
            let (inside, stays) = (self.is_kept(from), self.is_kept(to));
            if inside {
                kept.push(from);
            }
            if inside != stays {
                let corner = self.corner_between(from, to);
                kept.push(corner);
                let end = if inside { &mut leaves } else { &mut returns };
                if end.replace(corner).is_some() {
                    return Err(DegenerateCut);
                }
            }
        }
        Ok((kept, leaves.zip(returns)))
    }

    fn is_kept(&self, corner: u32) -> bool {
        self.heights[corner as usize] <= 0.0
    }

    /// The corner where the cut meets the edge between two old ones; the same from both of its faces.
    fn corner_between(&mut self, a: u32, b: u32) -> u32 {
        let (low, high) = (a.min(b), a.max(b));
        let (corners, heights, points) = (self.corners, self.heights, &mut self.points);
        *self.new.entry((low, high)).or_insert_with(|| {
            let (from, to) = (heights[low as usize], heights[high as usize]);
            points.push(corners[low as usize].lerp(corners[high as usize], from / (from - to)));
            crate::index::checked_u32(corners.len() + points.len() - 1)
        })
    }
}

/// The single loop that follows `next` from corner to corner.
fn closed_loop(next: &BTreeMap<u32, u32>) -> Result<Vec<u32>, DegenerateCut> {
    let (&first, _) = next.first_key_value().ok_or(DegenerateCut)?;
    let mut corners = vec![first];
    let mut current = *next.get(&first).ok_or(DegenerateCut)?;
    while current != first {
        if corners.len() > next.len() {
            return Err(DegenerateCut);
        }
        corners.push(current);
        current = *next.get(&current).ok_or(DegenerateCut)?;
    }
    if corners.len() == next.len() && corners.len() > 2 { Ok(corners) } else { Err(DegenerateCut) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Volume by the divergence theorem over fans.
    fn volume(body: &Polyhedron) -> f64 {
        let fan = |face: &Face| -> f64 {
            let at = |index: usize| body.corners[face.corners[index] as usize];
            (1..face.corners.len() - 1).map(|i| at(0).dot(at(i).cross(at(i + 1))) / 6.0).sum()
        };
        body.faces.iter().map(fan).sum()
    }

    fn is_closed(body: &Polyhedron) -> bool {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for face in &body.faces {
            for (index, &from) in face.corners.iter().enumerate() {
                let to = face.corners[(index + 1) % face.corners.len()];
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        edges.values().all(|&balance| balance == 0)
    }

    #[test]
    fn a_cube_is_closed_and_points_out() {
        let cube = Polyhedron::cube(1.5);
        assert!(is_closed(&cube));
        assert!((volume(&cube) - 27.0).abs() < 1e-12);
    }

    #[test]
    fn the_two_sides_of_a_cut_make_up_the_whole() -> Result<(), DegenerateCut> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut body = Polyhedron::cube(1.0);
        for _ in 0..60 {
            let [x, y, z, d]: [f64; 4] = [rng.random(), rng.random(), rng.random(), rng.random()];
            let normal = (DVec3::new(x, y, z) - 0.5).normalize();
            let half_space = HalfSpace { normal, offset: 0.4 + 0.5 * d, behind: Behind::Cell(0) };
            let other = HalfSpace { normal: -normal, offset: -half_space.offset, ..half_space };
            let (before, mut far) = (volume(&body), body.clone());
            if body.cut(half_space)? {
                far.cut(other)?;
                assert!((volume(&body) + volume(&far) - before).abs() < 1e-12);
                assert!(is_closed(&body) && is_closed(&far));
                // Euler: a convex polyhedron is a sphere.
                let edges: usize = body.faces.iter().map(|face| face.corners.len()).sum::<usize>() / 2;
                assert_eq!(body.corners.len() + body.faces.len(), edges + 2);
            }
        }
        assert!(body.faces.len() > 12, "cut too little to test: {} faces", body.faces.len());
        Ok(())
    }

    #[test]
    fn a_cut_that_leaves_nothing_is_refused() {
        let half_space = HalfSpace { normal: DVec3::X, offset: -2.0, behind: Behind::Cell(0) };
        assert_eq!(Polyhedron::cube(1.0).cut(half_space), Err(DegenerateCut));
    }
}
