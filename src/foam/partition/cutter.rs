//! Voronoi cells, one by one: a cube round the seed, cut by the bisecting planes of its neighbours, clipped by the walls.
//!
//! A seed at distance s from another cannot cut what lies within s/2 of it, so neighbours are taken in the order of their
//! distance until that reaches the farthest corner. The cube must not be seen between the walls; where it is, the cell is
//! cut again from a larger one.

use super::{
    Beyond, CellFace, PartitionCell, PartitionDefect, Side, clip,
    clip::Clipped,
    levels::Levels,
    measure,
    polyhedron::{Behind, DegenerateCut, HalfSpace, Polyhedron},
};
use crate::{
    foam::{
        convert::as_f64,
        domain::{Axis, Domain, Image},
        ground::{Density, Ground},
        network::CellId,
        spatial::Bins,
    },
    index::{Id, checked_u32},
    surface::{Gap, WallSide},
};
use glam::DVec3;

/// Cuts one cell after another out of space.
pub(super) struct Cutter<'a> {
    levels: Levels<'a>,
    domain: &'a Domain,
    seeds: &'a [DVec3],
    bins: Bins,
    spacing: f64,
}

/// First half edge of the cube that a cell is cut from, in mean spacings: most cells fit at once.
const FIRST_CUBE: f64 = 1.3;

/// What a cube that was too small is enlarged by.
const CUBE_GROWTH: f64 = 1.7;

/// Crossings of an edge with a wall are sought at this step, in mean spacings.
const SEARCH_STEP: f64 = 0.12;

/// Neighbours are cut with until their squared distance exceeds this many squared radii: four, and a little for the weights.
const SECURITY: f64 = 4.001;

/// Weights reach this fraction of the squared spacing: films move by less than it, and corners that coincide part by about
/// as much, far above rounding.
const TIE: f64 = 1e-6;

/// The upper half of a 64-bit number that looks random (the finaliser of G. Steele et al., "Fast splittable pseudorandom
/// number generators", 2014): regular numbering of a regular lattice must not make weights cancel.
fn scrambled(index: usize) -> u32 {
    let mut bits = (index as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let [a, b, c, d, ..] = bits.to_be_bytes();
    u32::from_be_bytes([a, b, c, d])
}

impl<'a> Cutter<'a> {
    pub(super) fn new(gap: &'a Gap, domain: &'a Domain, seeds: &'a [DVec3]) -> Self {
        let spacing = Ground::new(gap, domain, Density::Uniform).mean_spacing(as_f64(seeds.len()));
        Self { levels: Levels::new(gap), domain, seeds, bins: Bins::new(domain, spacing, seeds), spacing }
    }

    /// The cell of a seed.
    ///
    /// # Errors
    /// [`PartitionDefect`] if it has no bounded, resolvable form.
    pub(super) fn cell(&self, index: usize) -> Result<PartitionCell, PartitionDefect> {
        let id = CellId::from_index(index);
        let limit = self.domain.extent().length();
        let mut half = FIRST_CUBE * self.spacing;
        loop {
            let (body, behind) =
                self.polyhedron(index, half).map_err(|_| PartitionDefect::Degenerate { cell: id })?;
            let clipped = clip::clip(&body, &self.levels, SEARCH_STEP * self.spacing)
                .map_err(|_| PartitionDefect::Tangled { cell: id })?;
            let open =
                clipped.films.iter().any(|(face, _)| body.faces[*face].half_space.behind == Behind::Cube);
            if !open {
                return Ok(self.finished(index, &body, &behind, &clipped));
            }
            if half > limit {
                return Err(PartitionDefect::Unbounded { cell: id });
            }
            half *= CUBE_GROWTH;
        }
    }

    /// The Voronoi cell of a seed inside a cube around it, placed at the seed; and what lies behind its faces.
    fn polyhedron(
        &self,
        index: usize,
        half: f64,
    ) -> Result<(Polyhedron, Vec<(CellId, Image)>), DegenerateCut> {
        let seed = self.seeds[index];
        let mut body = Polyhedron::cube(half);
        for half_space in self.planes_round(seed) {
            body.cut(half_space)?;
        }
        let mut near = Vec::new();
        self.bins.for_each_near(seed, (SECURITY * body.radius_squared()).sqrt(), |other, image, place| {
            if (other != index || image != Image::IDENTITY) && !image.is_mirrored() {
                near.push((place - seed, other, image));
            }
        });
        near.sort_by(|a, b| {
            a.0.length_squared().total_cmp(&b.0.length_squared()).then((a.1, a.2).cmp(&(b.1, b.2)))
        });
        let mut behind = Vec::new();
        for (towards, other, image) in near {
            let distance = towards.length();
            if distance * distance > SECURITY * body.radius_squared() {
                break;
            }
            let half_space = HalfSpace {
                normal: towards / distance,
                offset: 0.5 * (distance + (self.weight(index) - self.weight(other)) / distance),
                behind: Behind::Cell(checked_u32(behind.len())),
            };
            if body.cut(half_space)? {
                behind.push((CellId::from_index(other), image));
            }
        }
        for corner in &mut body.corners {
            *corner += seed;
        }
        Ok((body, behind))
    }

    /// The weight of a seed in the power diagram that is really cut. It only decides between equals: where four seeds lie on
    /// a circle, their cells must agree which two touch.
    fn weight(&self, index: usize) -> f64 {
        f64::from(scrambled(index)) / f64::from(u32::MAX) * TIE * self.spacing * self.spacing
    }

    /// The plane walls of the domain as half spaces round a seed.
    fn planes_round(&self, seed: DVec3) -> Vec<HalfSpace> {
        let mut planes = Vec::new();
        for (axis, kind) in (0_u8..).zip(&self.domain.axes) {
            let Axis::Walls { low, high } = *kind else { continue };
            let direction = DVec3::AXES[usize::from(axis)];
            let here = seed.dot(direction);
            planes.push(HalfSpace {
                normal: -direction,
                offset: here - low,
                behind: Behind::Plane { axis, high: false },
            });
            planes.push(HalfSpace {
                normal: direction,
                offset: high - here,
                behind: Behind::Plane { axis, high: true },
            });
        }
        planes
    }

    fn finished(
        &self,
        index: usize,
        body: &Polyhedron,
        behind: &[(CellId, Image)],
        cell: &Clipped,
    ) -> PartitionCell {
        let beyond = |face: usize| match body.faces[face].half_space.behind {
            Behind::Cell(place) => {
                let (cell, image) = behind[place as usize];
                Beyond::Cell(cell, image)
            }
            Behind::Plane { axis, high } => Beyond::Plane { axis, high },
            // A cell that meets the cube is cut again from a larger one.
            Behind::Cube => Beyond::Cell(CellId::from_index(index), Image::IDENTITY),
        };
        let outline =
            |pieces: &clip::Loop| pieces.iter().flat_map(|piece| piece.points[1..].iter().copied()).collect();
        let films =
            cell.films.iter().map(|(face, film)| CellFace { beyond: beyond(*face), outline: outline(film) });
        let patches = WallSide::BOTH.into_iter().flat_map(|side| {
            cell.patches[side as usize]
                .iter()
                .map(move |patch| CellFace { beyond: Beyond::Wall(side), outline: outline(patch) })
        });
        let sides = |pieces: &[clip::Piece]| -> Vec<Side> {
            let previous = pieces.iter().cycle().skip(pieces.len() - 1);
            let side = |(piece, previous): (&clip::Piece, &clip::Piece)| Side {
                start: cell.nodes[piece.from].point,
                length: piece.length(),
                before: beyond(previous.face),
                beyond: beyond(piece.face),
            };
            pieces.iter().zip(previous).map(side).collect()
        };
        let on_wall = |wall: WallSide| -> Vec<Side> {
            let edge = cell.patches[wall as usize].first();
            // Seen from outside the cell, the lower wall's patch runs clockwise for the upper wall.
            edge.map_or_else(Vec::new, |edge| match wall {
                WallSide::Upper => sides(edge),
                WallSide::Lower => sides(&edge.iter().rev().map(clip::Piece::reversed).collect::<Vec<_>>()),
            })
        };
        PartitionCell {
            seed: self.seeds[index],
            volume: measure::volume(cell, body, self.seeds[index], &self.levels),
            faces: films.chain(patches).collect(),
            sections: cell.section.iter().map(|pieces| sides(pieces)).collect(),
            on_walls: WallSide::BOTH.map(on_wall),
            pieces: cell.pieces(),
        }
    }
}
