//! The power cells of two sheets of weighted seeds, cut off by the walls: cells, films as polygons, corners.
//!
//! Each cell is a convex polyhedron, cut from a cube by the half spaces towards its neighbours. What the walls leave of it
//! is decided corner by corner: corners inside the gap stay, an edge that leaves the gap ends where it meets the wall, and a
//! film that is cut off ends in an edge on the wall. Corners of neighbouring cells that coincide become one, so that
//! arrangements of high symmetry, where more than four cells meet, come out right.

use super::{NoLayers, Sheets};
use crate::foam::partition::polyhedron::{Behind, Face, HalfSpace, Polyhedron};
use crate::{
    foam::{
        domain::{Domain, Image},
        free::{Corner, CornerImage, Division, Polygon, Stacking, Unlawful, unlawful},
        spatial::Bins,
    },
    index::checked_u32,
    surface::{Gap, GapKind, Period, SurfaceSamples, WallSide},
};
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Neighbours are sought within this many spacings of a seed.
const REACH: f64 = 5.0;
/// Half the cube that cells are cut from, in spacings and in distances between the walls: it reaches beyond both walls.
const CUBE: f64 = 4.0;
const CUBE_OF_DEPTH: f64 = 1.2;
/// Corners nearer to each other than this part of the spacing are one: those of rows, where more than four cells meet, come out
/// equal to 1e-11 from each cell. Far above that, a corner that lies near a wall by chance would be joined with where its own
/// borders meet the wall, to a corner of five bodies that no change of topology can part.
const JOINED: f64 = 1e-8;

/// One face of a cell as it is left by the walls.
struct Cut {
    neighbour: usize,
    shift: IVec3,
    corners: Vec<(DVec3, Option<WallSide>)>,
}

/// Divides the gap between the seeds of `sheets`.
///
/// # Errors
/// [`NoLayers`] if two seeds coincide or the cells are no two layers.
pub fn divided(gap: &Gap, domain: &Domain, sheets: &Sheets) -> Result<Division, NoLayers> {
    let division = divided_unchecked(gap, domain, sheets)?;
    check(&division)?;
    Ok(division)
}

/// The same, whether the cells are two layers or not.
pub(super) fn divided_unchecked(gap: &Gap, domain: &Domain, sheets: &Sheets) -> Result<Division, NoLayers> {
    let sheets = sheets.wrapped(domain);
    let (sight, neighbours) = (Sight::new(gap), Neighbours::new(domain, &sheets));
    let cells: Vec<Vec<Cut>> = (0..sheets.seeds.len())
        .into_par_iter()
        .map(|cell| cut_cell(&sight, &neighbours, &sheets, cell))
        .collect::<Result<_, _>>()?;
    let Sheets { seeds, lower, spacing, volumes, .. } = sheets;
    let volumes = (0..seeds.len()).map(|cell| volumes[usize::from(cell >= lower)]).collect();
    let (stacking, period) = (Stacking::Two { lower }, domain.period());
    let mut division = Division {
        seeds,
        stacking,
        volumes,
        period,
        planes: Vec::new(),
        euler: i64::from(gap.middle().euler_characteristic()),
        corners: Vec::new(),
        polygons: Vec::new(),
    };
    let mut joiner = Joiner::new(domain.period(), JOINED * spacing);
    for (cell, cuts) in cells.into_iter().enumerate() {
        for cut in cuts {
            // Each film once: from the cell of lower number, or along the positive period to its own image.
            let first = cut.neighbour > cell || (cut.neighbour == cell && cut.shift.to_array() > [0, 0, 0]);
            let mut corners: Vec<CornerImage> = Vec::with_capacity(cut.corners.len());
            for (place, wall) in cut.corners {
                let image = joiner.image(place, wall);
                if corners.last() != Some(&image) && corners.first() != Some(&image) {
                    corners.push(image);
                }
            }
            if first && corners.len() > 2 {
                let (neighbour, shift) = (cut.neighbour, cut.shift);
                division.polygons.push(Polygon { cell, neighbour, shift, corners });
            }
        }
    }
    division.corners = joiner.corners;
    Ok(division)
}

/// The laws of two layers: every cell has its own wall and only that one, and on each wall cells, edges and corners have
/// Euler's number.
pub(super) fn check(division: &Division) -> Result<(), NoLayers> {
    let found = unlawful(division);
    let count = |wanted: bool| {
        found.iter().filter(|law| matches!(law, Unlawful::Wall { touches, .. } if *touches == wanted)).count()
    };
    let (reaching, missing) = (count(true), count(false));
    if reaching + missing > 0 {
        return Err(NoLayers::Through { reaching, missing });
    }
    let euler = found.iter().find_map(|law| match *law {
        Unlawful::Euler { found, expected, .. } => Some(NoLayers::Euler { found, expected }),
        _ => None,
    });
    euler.map_or(Ok(()), Err)
}

fn cut_cell(
    sight: &Sight<'_>,
    neighbours: &Neighbours,
    sheets: &Sheets,
    cell: usize,
) -> Result<Vec<Cut>, NoLayers> {
    let seed = sheets.seeds[cell];
    let Body { polyhedron, near } = neighbours.body(sheets, cell)?;
    let outside = sight.beyond(&polyhedron, seed);
    let faces = polyhedron.faces.iter().filter_map(|face| {
        let Behind::Cell(at) = face.half_space.behind else { return None };
        let Near { cell: neighbour, shift, .. } = near[at as usize];
        let kept = within_walls(sight.gap, &polyhedron, face, &outside, seed);
        let corners: Vec<_> = kept.into_iter().map(|kept| (seed + kept.place, kept.wall)).collect();
        (corners.len() > 2).then_some(Cut { neighbour, shift, corners })
    });
    Ok(faces.collect())
}

/// Who may touch whom: for each seed, the seeds near it and their images in periods.
pub(super) struct Neighbours {
    near: Vec<Vec<(usize, IVec3)>>,
    period: Period,
}

/// A seed near another.
pub(super) struct Near {
    pub(super) cell: usize,
    pub(super) shift: IVec3,
    /// The way to it.
    pub(super) way: DVec3,
}

/// A cell round its seed as the origin, before the walls cut it off; and the seeds that its faces are numbered by.
pub(super) struct Body {
    pub(super) polyhedron: Polyhedron,
    pub(super) near: Vec<Near>,
}

impl Neighbours {
    /// Of seeds inside the primary box: those that bound the cell first, so that hardly any other cuts anything away, then the
    /// nearest first.
    pub(super) fn new(domain: &Domain, sheets: &Sheets) -> Self {
        let Sheets { seeds, spacing, .. } = sheets;
        let bins = Bins::new(domain, *spacing, seeds);
        let near = seeds.par_iter().enumerate().map(|(cell, &seed)| {
            let mut near = Vec::new();
            bins.for_each_near(seed, REACH * spacing, |other, image, place| {
                if other != cell || image != Image::IDENTITY {
                    near.push((place.distance_squared(seed), other, image.shift()));
                }
            });
            let key = |&(_, other, shift): &(f64, usize, IVec3)| (other, shift.to_array());
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(key(a).cmp(&key(b))));
            near.into_iter().map(|(_, other, shift)| (other, shift)).collect()
        });
        let mut neighbours = Self { near: near.collect(), period: domain.period() };
        let bounding = |cell| {
            let body = neighbours.body(sheets, cell).ok()?;
            let behind = body.polyhedron.faces.iter().filter_map(|face| match face.half_space.behind {
                Behind::Cell(at) => Some(at as usize),
                _ => None,
            });
            Some(behind.collect::<BTreeSet<usize>>())
        };
        let bounding: Vec<_> = (0..sheets.seeds.len()).into_par_iter().map(bounding).collect();
        for (near, bounding) in neighbours.near.iter_mut().zip(bounding) {
            let bounding = bounding.unwrap_or_default();
            let (mut first, rest): (Vec<_>, Vec<_>) =
                near.drain(..).enumerate().partition(|(at, _)| bounding.contains(at));
            first.extend(rest);
            near.extend(first.into_iter().map(|(_, seed)| seed));
        }
        neighbours
    }

    /// The cell of a seed; the seeds may have moved since the neighbours were listed.
    ///
    /// # Errors
    /// [`NoLayers::Seeds`] if nothing is left of it.
    pub(super) fn body(&self, sheets: &Sheets, cell: usize) -> Result<Body, NoLayers> {
        let (seed, own, spacing) = (sheets.seeds[cell], sheets.weights[cell], sheets.spacing);
        let near = self.near[cell].iter().map(|&(other, shift)| {
            let way = sheets.seeds[other] + self.period.translation(shift) - seed;
            Near { cell: other, shift, way }
        });
        let near: Vec<Near> = near.collect();
        let mut polyhedron = Polyhedron::cube((CUBE * spacing).max(CUBE_OF_DEPTH * sheets.depth));
        for (at, Near { cell: other, way, .. }) in near.iter().enumerate() {
            let distance = way.length();
            let square = way.length_squared() + own - sheets.weights[*other];
            // A cut that only grazes corners takes nothing away.
            let half_space = HalfSpace {
                normal: way.normalize_or_zero(),
                offset: 0.5 * square / distance + 1e-12 * spacing,
                behind: Behind::Cell(checked_u32(at)),
            };
            if half_space.offset * half_space.offset < polyhedron.radius_squared() || half_space.offset < 0.0
            {
                polyhedron.cut(half_space).map_err(|_| NoLayers::Seeds { place: seed })?;
            }
        }
        Ok(Body { polyhedron, near })
    }
}

/// A corner of what the walls leave of a face, seen from the seed.
pub(super) struct Kept {
    pub(super) place: DVec3,
    /// The wall that it lies on.
    pub(super) wall: Option<WallSide>,
    /// The ends of the polyhedron's edge that it lies on; twice the same for a corner of the polyhedron.
    pub(super) edge: [u32; 2],
}

/// Tells on which side of the walls places lie; between parallel walls by the level function of the middle surface where
/// that decides, for the distance takes a search.
pub(super) struct Sight<'a> {
    pub(super) gap: &'a Gap,
    /// The range of the middle surface's level function on each wall, with a margin.
    on_wall: Option<[[f64; 2]; 2]>,
}

/// Lines per axis of the samples of that range, and its margin as a part of it.
const SIGHT_LINES: usize = 30;
const SIGHT_MARGIN: f64 = 0.1;

impl<'a> Sight<'a> {
    pub(super) fn new(gap: &'a Gap) -> Self {
        let middle = gap.middle();
        let searches = gap.kind() == GapKind::Parallel && !middle.is_distance();
        let on_wall = searches.then(|| {
            let samples = SurfaceSamples::new(middle.as_ref(), 0.0, SIGHT_LINES);
            gap.walls().each_ref().map(|wall| {
                let value = |p: DVec3| middle.value(p + wall.level * middle.normal(p));
                let values = samples.points().iter().map(|point| value(point.position));
                let start = (f64::INFINITY, f64::NEG_INFINITY);
                let (low, high) = values.fold(start, |(l, h), x| (l.min(x), h.max(x)));
                let margin = SIGHT_MARGIN * (high - low);
                [low - margin, high + margin]
            })
        });
        Self { gap, on_wall }
    }

    /// The wall beyond which each corner of a body lies; none inside the gap.
    pub(super) fn beyond(&self, body: &Polyhedron, seed: DVec3) -> Vec<Option<WallSide>> {
        let places = body.corners.iter().map(|&corner| seed + corner);
        places.map(|p| WallSide::BOTH.into_iter().find(|&side| self.is_beyond(p, side))).collect()
    }

    fn is_beyond(&self, p: DVec3, side: WallSide) -> bool {
        // Upwards out of the upper wall, downwards out of the lower one.
        let sign = if side == WallSide::Upper { 1.0 } else { -1.0 };
        if let Some(on_wall) = self.on_wall {
            let level = self.gap.middle().value(p);
            let [low, high] = on_wall[side as usize];
            if !(low..=high).contains(&level) {
                return sign * (level - low) > 0.0;
            }
        }
        sign * self.gap.wall(side).value(p) > 0.0
    }
}

/// The part of a face inside the gap: corners that stay, and the places where its edges meet the walls.
pub(super) fn within_walls(
    gap: &Gap,
    body: &Polyhedron,
    face: &Face,
    outside: &[Option<WallSide>],
    seed: DVec3,
) -> Vec<Kept> {
    let mut kept = Vec::with_capacity(face.corners.len() + 2);
    let count = face.corners.len();
    for at in 0..count {
        let edge = [face.corners[at], face.corners[(at + 1) % count]];
        let [from, to] = edge.map(|corner| seed + body.corners[corner as usize]);
        let [leaves, enters] = edge.map(|corner| outside[corner as usize]);
        if leaves.is_none() {
            kept.push(Kept { place: from - seed, wall: None, edge: [edge[0]; 2] });
        }
        for side in [leaves, enters].into_iter().flatten() {
            if leaves != enters {
                let wall = gap.wall(side);
                let place = wall.field.crossing(from, to, wall.level) - seed;
                kept.push(Kept { place, wall: Some(side), edge });
            }
        }
    }
    kept
}

/// Joins corners that coincide modulo the lattice.
struct Joiner {
    period: Period,
    tolerance: f64,
    corners: Vec<Corner>,
    buckets: BTreeMap<[i64; 3], Vec<usize>>,
}

impl Joiner {
    fn new(period: Period, tolerance: f64) -> Self {
        Self { period, tolerance, corners: Vec::new(), buckets: BTreeMap::new() }
    }

    #[expect(clippy::cast_possible_truncation, reason = "places over the tolerance lie far below 2^63")]
    fn image(&mut self, place: DVec3, wall: Option<WallSide>) -> CornerImage {
        let home = self.period.wrap(place, DVec3::ZERO);
        // Buckets a thousand tolerances wide: near a bucket's border its neighbours are looked at, too.
        let width = 1000.0 * self.tolerance;
        let bucket =
            |p: DVec3| (self.period.wrap(p, DVec3::ZERO) / width).floor().to_array().map(|x| x as i64);
        for corner in 0..27 {
            let offset = DVec3::new(
                f64::from(corner % 3 - 1),
                f64::from(corner / 3 % 3 - 1),
                f64::from(corner / 9 - 1),
            );
            let Some(found) = self.buckets.get(&bucket(home + self.tolerance * offset)) else { continue };
            for &candidate in found {
                let stored = self.corners[candidate].place;
                let apart = place - stored;
                if self.period.nearest_image(apart).length() < self.tolerance {
                    let shift = self.period.nearest_shift(apart).to_array();
                    return CornerImage { corner: candidate, shift };
                }
            }
        }
        let corner = self.corners.len();
        let key = bucket(home);
        self.corners.push(Corner { place, wall, plane: None });
        self.buckets.entry(key).or_default().push(corner);
        CornerImage { corner, shift: [0; 3] }
    }
}
