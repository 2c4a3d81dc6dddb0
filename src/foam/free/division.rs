//! Who touches whom in a foam of free topology, before its films are meshed: cells, films as polygons, corners.

use super::{Side, films::side_between};
use crate::{
    foam::{
        complex::{NodeId, Places},
        convert::as_f64,
    },
    index::{Id, checked_u32},
    surface::{CutPlane, Gap, Period, Wall, WallSide},
};
use glam::{DVec3, IVec3};
use std::{collections::BTreeMap, sync::Arc};

/// A corner: an end of borders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Where it is.
    pub place: DVec3,
    /// The wall that it lies on, if any.
    pub wall: Option<WallSide>,
    /// The plane that cuts the gap off on which it lies, if any, by its number in [`Division::planes`].
    pub plane: Option<usize>,
}

impl Corner {
    /// Whether four cells meet there, inside the gap.
    #[must_use]
    pub const fn is_inside(&self) -> bool {
        self.wall.is_none() && self.plane.is_none()
    }
}

/// A corner of a film's polygon, seen from the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CornerImage {
    /// Its number.
    pub corner: usize,
    /// How many periods away.
    pub shift: [i32; 3],
}

/// A film between two cells, before it is meshed.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    /// The cell that it is seen from.
    pub cell: usize,
    /// The cell behind it.
    pub neighbour: usize,
    /// Which image of the neighbour, in periods.
    pub shift: IVec3,
    /// Its corners, counter-clockwise seen from the neighbour, in the frame of `cell`.
    pub corners: Vec<CornerImage>,
}

/// Which walls the cells touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stacking {
    /// One layer: cells reach from wall to wall at first; in a deep gap one may leave a wall, or come to one.
    One,
    /// Two layers: every cell touches its own wall only.
    Two {
        /// How many cells, the first ones, belong to the lower wall.
        lower: usize,
    },
}

impl Stacking {
    /// Whether a cell has to touch the lower and the upper wall; nothing if it may touch those that it comes to.
    #[must_use]
    pub const fn walls(self, cell: usize) -> Option<[bool; 2]> {
        match self {
            Self::One => None,
            Self::Two { lower } => Some([cell < lower, cell >= lower]),
        }
    }
}

/// Cells and their films.
#[derive(Clone, Debug, PartialEq)]
pub struct Division {
    /// A place in the midst of each cell.
    pub seeds: Vec<DVec3>,
    /// Which walls the cells touch.
    pub stacking: Stacking,
    /// The volume that each cell shall have; between walls that close the foam their proportions count.
    pub volumes: Vec<f64>,
    /// The lattice.
    pub period: Period,
    /// The planes that cut the gap off: frictionless walls that films meet at a right angle.
    pub planes: Vec<CutPlane>,
    /// Euler's number of the cells on each wall; of a piece, without an outside that closes it.
    pub euler: i64,
    /// All corners.
    pub corners: Vec<Corner>,
    /// All films, each once.
    pub polygons: Vec<Polygon>,
}

impl Division {
    /// The place of a corner's image.
    #[must_use]
    pub fn place(&self, image: CornerImage) -> DVec3 {
        self.corners[image.corner].place + self.period.translation(IVec3::from_array(image.shift))
    }

    /// The same with its corners where a descent has brought their nodes.
    pub(super) fn at(&self, places: &Places) -> Self {
        let mut division = self.clone();
        for (at, corner) in division.corners.iter_mut().enumerate() {
            corner.place = places[NodeId::from_index(at)];
        }
        division
    }

    /// The edges that a polygon has on a wall: the number of their first corner.
    pub fn wall_sides<'a>(&'a self, polygon: &'a Polygon) -> impl Iterator<Item = (usize, WallSide)> + 'a {
        let count = polygon.corners.len();
        (0..count).filter_map(move |at| {
            let wall = |at: usize| self.corners[polygon.corners[at % count].corner].wall;
            let here = wall(at)?;
            (wall(at + 1) == Some(here)).then_some((at, here))
        })
    }

    /// How many cells, the first ones, belong to the lower wall.
    #[must_use]
    pub const fn lower(&self) -> usize {
        match self.stacking {
            Stacking::One => self.seeds.len(),
            Stacking::Two { lower } => lower,
        }
    }

    /// Whether a cell belongs to the lower wall.
    #[must_use]
    pub const fn is_lower(&self, cell: usize) -> bool {
        cell < self.lower()
    }

    /// The corners inside the gap, where four cells meet.
    #[must_use]
    pub fn inner_corners(&self) -> usize {
        self.corners.iter().filter(|corner| corner.is_inside()).count()
    }

    /// Whether each cell touches the lower and the upper wall.
    #[must_use]
    pub fn touches(&self) -> Vec<[bool; 2]> {
        let [lower, upper] = WallSide::BOTH.map(|wall| self.rims(wall));
        lower.iter().zip(&upper).map(|(low, high)| [!low.is_empty(), !high.is_empty()]).collect()
    }

    /// The walls of `gap`, then the planes that cut it off.
    pub(super) fn walls(&self, gap: &Gap) -> Vec<Wall> {
        let plane = |&plane: &CutPlane| Wall { field: Arc::new(plane), level: 0.0 };
        gap.walls().iter().cloned().chain(self.planes.iter().map(plane)).collect()
    }

    /// A place moved onto the wall and the plane of a corner. The planes are mirrors of the walls, so that one after the other
    /// is enough.
    pub(super) fn retracted(
        &self,
        gap: &Gap,
        wall: Option<WallSide>,
        plane: Option<usize>,
        place: DVec3,
    ) -> DVec3 {
        let on_plane = plane.map_or(place, |plane| self.planes[plane].nearest_to(place));
        wall.map_or(on_plane, |side| gap.wall(side).project(on_plane).unwrap_or(on_plane))
    }

    /// The plane on which a side of a polygon lies; a side on a wall lies on none.
    pub(super) fn plane_of_side(&self, from: CornerImage, to: CornerImage) -> Option<usize> {
        let [a, b] = [from, to].map(|image| self.corners[image.corner]);
        let on_wall = a.wall.is_some() && a.wall == b.wall;
        a.plane.filter(|_| a.plane == b.plane && !on_wall)
    }

    /// Which cells end at planes.
    #[must_use]
    pub fn cut(&self) -> Vec<bool> {
        let mut cut = vec![false; self.seeds.len()];
        for polygon in &self.polygons {
            if polygon.corners.iter().any(|image| self.corners[image.corner].plane.is_some()) {
                cut[polygon.cell] = true;
                cut[polygon.neighbour] = true;
            }
        }
        cut
    }

    /// The lines in which cells end on a wall and a plane at once, from the corner of one film to that of the next.
    pub(super) fn cut_lines(&self) -> impl Iterator<Item = Side> {
        let ends =
            WallSide::BOTH.into_iter().flat_map(|wall| self.rims(wall)).filter_map(|rim| open_ends(&rim));
        let line = |[a, b]: [CornerImage; 2]| {
            let planes = [a, b].map(|image| self.corners[image.corner].plane);
            (planes[0] == planes[1]).then(|| side_between(a, b).0)
        };
        ends.filter_map(line).collect::<Vec<_>>().into_iter()
    }

    /// The edges round each cell's patch on a wall, in the frame of the cell and counter-clockwise seen against the wall's
    /// normal `∇Φ`: from corner to corner, with the cell behind the edge and its image.
    pub(super) fn rims(&self, wall: WallSide) -> Vec<Vec<Rim>> {
        let mut rims = vec![Vec::new(); self.seeds.len()];
        for polygon in &self.polygons {
            for (at, _) in self.wall_sides(polygon).filter(|(_, side)| *side == wall) {
                let count = polygon.corners.len();
                let [from, to] = [polygon.corners[at], polygon.corners[(at + 1) % count]];
                let (cell, neighbour, shift) = (polygon.cell, polygon.neighbour, polygon.shift);
                // On the upper wall a film's edge runs against the order in which one walks round its cell's patch.
                let [from, to] = if wall == WallSide::Upper { [to, from] } else { [from, to] };
                rims[cell].push(Rim { from, to, neighbour, shift });
                let [from, to] = [to, from].map(|image| moved(image, -shift));
                rims[neighbour].push(Rim { from, to, neighbour: cell, shift: -shift });
            }
        }
        rims
    }
}

/// Where the edges round a patch that a plane cuts off start and end; nothing if they close, or do not hang together.
pub(super) fn open_ends(rim: &[Rim]) -> Option<[CornerImage; 2]> {
    let mut ends: BTreeMap<CornerImage, [usize; 2]> = BTreeMap::new();
    for edge in rim {
        ends.entry(edge.from).or_default()[0] += 1;
        ends.entry(edge.to).or_default()[1] += 1;
    }
    let only = |which: usize| {
        let mut found = ends.iter().filter(move |(_, count)| count[which] == 1 && count[1 - which] == 0);
        found.next().map(|(image, _)| *image).filter(|_| found.next().is_none())
    };
    Some([only(0)?, only(1)?])
}

/// An edge on a wall, seen from the cell on its left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rim {
    pub(super) from: CornerImage,
    pub(super) to: CornerImage,
    pub(super) neighbour: usize,
    pub(super) shift: IVec3,
}

/// A corner's image in another frame.
pub(super) fn moved(image: CornerImage, by: IVec3) -> CornerImage {
    CornerImage { corner: image.corner, shift: (IVec3::from_array(image.shift) + by).to_array() }
}

/// The spacing of `count` seeds on `area`, as of a hexagonal lattice.
#[must_use]
pub fn spacing(area: f64, count: usize) -> f64 {
    (area / as_f64(count) * 2.0 / 3.0_f64.sqrt()).sqrt()
}

/// A count as it is compared with Euler's number.
pub(super) fn signed(count: usize) -> i64 {
    i64::from(checked_u32(count))
}
