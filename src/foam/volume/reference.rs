//! The reference position of all wall edges, and the wall patches of the regions there.

use super::{
    super::complex::{
        Complex, CurvePoint, Element, Film, NodeId, Places, RegionId, RegionKind, WallId, curve_points,
        region_anchors,
    },
    wall::foot as wall_foot,
};
use crate::{
    index::{Id, IndexVec},
    surface::Wall,
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::LazyLock;

/// Gauss points of a fan along an edge and outward from the anchor's foot.
type Fan = ([Vec<CurvePoint>; 2], Vec<CurvePoint>);

fn fan(along: usize, outward: usize) -> Fan {
    ([curve_points(2, along), curve_points(3, along)], curve_points(2, outward))
}

/// The wall is analytic and a cell turns by less than a right angle from its middle: twelve points outward reach rounding there.
static FINE: LazyLock<Fan> = LazyLock::new(|| fan(6, 12));
/// Good to some 1e-5 of a cell's volume.
static ROUGH: LazyLock<Fan> = LazyLock::new(|| fan(3, 5));

/// Where the wall edges were when the wall patches were last integrated.
#[derive(Clone, Debug)]
pub struct Reference {
    places: Places,
    directions: IndexVec<NodeId, [DVec3; 2]>,
    anchors: IndexVec<RegionId, DVec3>,
    offsets: IndexVec<RegionId, f64>,
}

impl Reference {
    /// Takes the present places as the reference and integrates every region's wall patches.
    #[must_use]
    pub fn new(complex: &Complex, places: &Places) -> Self {
        Self::integrated(complex, places, &FINE)
    }

    /// As [`Reference::new`] with a sixth of the work and volumes good to some 1e-5: for films on their way to where the
    /// patches are integrated anew.
    #[must_use]
    pub fn rough(complex: &Complex, places: &Places) -> Self {
        Self::integrated(complex, places, &ROUGH)
    }

    fn integrated(complex: &Complex, places: &Places, fan: &Fan) -> Self {
        let mut reference = Self::without_patches(complex, places);
        reference.offsets = reference.patches(complex, fan);
        reference
    }

    /// The reference at other places of the same complex, and the volumes there. The wall patches are not integrated anew: they
    /// differ from the old ones by strips, whose quadrature errs by less than 1e-9 of a cell's volume for moves of a tenth of
    /// its width.
    #[must_use]
    pub fn moved(&self, complex: &Complex, places: &Places) -> (Self, IndexVec<RegionId, f64>) {
        let mut moved = Self::without_patches(complex, places);
        let volumes = super::volumes(complex, places, self);
        let cones = super::volumes(complex, places, &moved);
        moved.offsets = volumes.iter().zip(&cones).map(|(volume, cone)| volume - cone).collect();
        (moved, volumes)
    }

    fn without_patches(complex: &Complex, places: &Places) -> Self {
        let directions = complex
            .nodes
            .enumerated()
            .map(|(id, node)| {
                let mut at = [DVec3::ZERO; 2];
                for (slot, &wall) in node.walls.iter().take(2).enumerate() {
                    at[slot] = direction_at(complex, &node.walls, wall, places[id]);
                }
                at
            })
            .collect();
        Self {
            places: places.clone(),
            directions,
            anchors: region_anchors(complex, places),
            offsets: IndexVec::from_elem(0.0, complex.regions.len()),
        }
    }

    /// The places taken as the reference.
    #[must_use]
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// What the wall patches add to each region's volume.
    #[must_use]
    pub fn offsets(&self) -> &IndexVec<RegionId, f64> {
        &self.offsets
    }

    /// The origins of a film's back and front region, in the film's frame.
    #[must_use]
    pub fn origins(&self, complex: &Complex, film: &Film) -> [DVec3; 2] {
        [film.back, film.front].map(|side| self.anchors[side.region] + complex.period.translation(side.shift))
    }

    /// The direction along which `wall` is reached from a node.
    #[must_use]
    pub(crate) fn direction(&self, complex: &Complex, node: NodeId, wall: WallId) -> DVec3 {
        let slot = usize::from(complex.nodes[node].walls.first() != Some(&wall));
        self.directions[node][slot]
    }

    fn patches(&self, complex: &Complex, fan: &Fan) -> IndexVec<RegionId, f64> {
        // The feet of the anchors on each wall that a region has an edge on.
        let shares: Vec<[f64; 2]> = complex
            .films
            .as_slice()
            .par_iter()
            .map(|film| {
                let mut share = [0.0; 2];
                let anchors = self.origins(complex, film);
                for element in &film.elements {
                    for (wall, edge) in complex.wall_edges(element) {
                        for (side, image) in [film.back, film.front].into_iter().enumerate() {
                            if complex.regions[image.region].kind == RegionKind::Cell {
                                share[side] += self.cone(fan, complex, element, wall, edge, anchors[side]);
                            }
                        }
                    }
                }
                share
            })
            .collect();
        let mut offsets = IndexVec::from_elem(0.0, complex.regions.len());
        for (film, share) in complex.films.iter().zip(shares) {
            offsets[film.back.region] -= share[0];
            offsets[film.front.region] += share[1];
        }
        offsets
    }

    /// The cone from `anchor` over the wall between the anchor's foot and an edge.
    fn cone(
        &self,
        (curves, outwards): &Fan,
        complex: &Complex,
        element: &Element,
        wall_id: WallId,
        edge: &[usize],
        anchor: DVec3,
    ) -> f64 {
        let wall: &Wall = &complex.walls[wall_id];
        let Ok(foot) = wall.project(anchor) else { return f64::NAN };
        let foot_direction = wall.field.normal(foot);
        let node = |slot: usize| complex.place(&self.places, element.nodes[edge[slot]]);
        let direction = |slot: usize| self.direction(complex, element.nodes[edge[slot]].node, wall_id);
        let mut total = 0.0;
        for curve in &curves[edge.len() - 2] {
            let mut at = [DVec3::ZERO; 4];
            for slot in 0..edge.len() {
                at[0] += curve.value[slot] * node(slot);
                at[1] += curve.dt[slot] * node(slot);
                at[2] += curve.value[slot] * direction(slot);
                at[3] += curve.dt[slot] * direction(slot);
            }
            let [e, et, d1, d1t] = at;
            let mut z = 0.0;
            for outward in outwards {
                let s = outward.value[1];
                let y = foot + s * (e - foot);
                let (ys, yt) = (e - foot, s * et);
                let d = foot_direction + s * (d1 - foot_direction);
                let (ds, dt) = (d1 - foot_direction, s * d1t);
                (z, _) = wall_foot(wall, y, d, z);
                let area = ys.cross(yt);
                let bend = ds.cross(yt) + ys.cross(dt);
                let prism =
                    z * d.dot(area) + z * z / 2.0 * d.dot(bend) + z * z * z / 3.0 * d.dot(ds.cross(dt));
                total += outward.weight * curve.weight * ((y - anchor).dot(area) / 3.0 + prism);
            }
        }
        total
    }
}

/// The wall's normal at `p`; where the node also lies on a second wall, its part within that wall, so that the patch's side
/// stays on the second wall.
fn direction_at(complex: &Complex, walls: &[WallId], wall: WallId, p: DVec3) -> DVec3 {
    let normal = complex.walls[wall].field.normal(p);
    let Some(other) = walls.iter().take(2).find(|&&other| other.index() != wall.index()) else {
        return normal;
    };
    let across = complex.walls[*other].field.normal(p);
    let within = normal - normal.dot(across) * across;
    within / within.length_squared().max(f64::MIN_POSITIVE).sqrt()
}
