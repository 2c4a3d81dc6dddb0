//! Cells that are seen obliquely, and so are narrower than the lattice allows.
//!
//! Blobs of one cell's size miss them, and the lattice keeps its places a good part of a pitch apart. Each is an opening all the
//! same: a basin of the relief with a wall around it. The relief is flooded from its lowest point on; where two waters meet that
//! are both as deep as a cell, each has filled one opening to its brim. An opening that no place of the lattice lies in is a cell
//! if it continues comb that is seen obliquely: beside cells, a wall away, whose openings are narrow, and in the same
//! direction. On comb that faces the camera nothing is added, so that gaps at its edge, caps and the grooves around a larva make
//! no cells.

use super::{
    ellipse::{Ellipse, narrowness},
    grid::Grid,
    kinds::median,
    lattice::Site,
    plane::{Plane, pixels},
};
use glam::{DMat2, DVec2};
use rayon::prelude::*;
use std::ops::Range;

/// Least height of the wall around an opening, in units of the relief: the usual one rises by 1.5 to 2.
const LEAST_DEPTH: f64 = 0.6;
/// Area of the opening of a cell that the lattice missed, over the square of the pitch; that of a cell seen from above is 0.5.
const AREA: Range<f64> = 0.06..0.7;
/// Openings whose mean shape is longer than wide by this factor are seen obliquely. Those of hexagons are as wide either way to
/// within 1.2, and their directions differ.
const NARROW: f64 = 1.25;
/// Openings this near (in pitches) may be neighbours.
const NEAR: f64 = 1.15;
/// Neighbours are no more than this many times their half widths apart: the wall takes up the rest.
const WALL_APART: f64 = 1.6;
/// Narrow neighbours that an opening must have to continue their comb.
const LEAST_NEIGHBOURS: usize = 3;
/// An inferred place within the ellipse of an opening, enlarged by this factor, stands for it.
const STANDS_FOR: f64 = 1.3;
/// Half the width of an opening over the pitch: walls take the rest.
const HALF_OPENING: f64 = 0.42;
/// What a cell's width is taken for over its least one. Discs in its middle shrink with it, and must lie within the opening, but
/// a marker must still reach the far ends.
const WIDTH: f64 = 1.4;
const LEAST_WIDTH: f64 = 0.62;
/// Edge of a tile in pixels, and what lies around it in pitches: no opening is wider.
const TILE: usize = 192;
const MARGIN: f64 = 1.5;

/// Cells that the lattice missed.
pub(crate) struct Missed {
    /// Their places, in pixels of the relief, and their [`Site::width`].
    pub(crate) cells: Vec<(DVec2, f64)>,
    /// Inferred places that stood for them.
    pub(crate) replaced: Vec<usize>,
}

/// Finds the cells that the lattice missed in a relief; `positions` are those of `sites` in its pixels, `pitch` is the
/// local one.
pub(crate) fn missed(
    relief: &Plane,
    sites: &[Site],
    positions: &[DVec2],
    pitch: impl Fn(DVec2) -> f64,
) -> Missed {
    let typical = median(positions.iter().map(|p| pitch(*p))).max(1.0);
    let openings = openings(relief, typical);
    let grid = Grid::of(positions, typical);
    let is_known = |opening: &Ellipse| {
        let reach = opening.half_axes()[0];
        let within = grid.within(opening.centre, reach);
        within.map(|(site, _)| site).any(|s| sites[s].depth == 0 && opening.holds(positions[s], 1.0))
    };
    let known: Vec<bool> = openings.iter().map(is_known).collect();
    let added = grown(&openings, known, typical, &pitch);
    let stands_for = |site: &usize| {
        let place = positions[*site];
        sites[*site].depth > 0 && added.iter().any(|opening| opening.holds(place, STANDS_FOR))
    };
    Missed {
        replaced: (0..sites.len()).filter(stands_for).collect(),
        cells: added.iter().map(|opening| (opening.centre, width(opening, pitch(opening.centre)))).collect(),
    }
}

fn width(opening: &Ellipse, pitch: f64) -> f64 {
    (WIDTH * opening.half_axes()[1] / (HALF_OPENING * pitch)).clamp(LEAST_WIDTH, 1.0)
}

/// The openings that continue narrow comb from those that are cells, layer by layer.
fn grown(
    openings: &[Ellipse],
    mut is_cell: Vec<bool>,
    typical: f64,
    pitch: impl Fn(DVec2) -> f64,
) -> Vec<Ellipse> {
    let centres: Vec<DVec2> = openings.iter().map(|opening| opening.centre).collect();
    let near = Grid::of(&centres, typical);
    let mut added = Vec::new();
    loop {
        let continues = |i: &usize| {
            let (opening, pitch) = (&openings[*i], pitch(centres[*i]));
            if is_cell[*i] || !AREA.contains(&(opening.area / (pitch * pitch))) {
                return false;
            }
            let (shapes, count) = near
                .within(opening.centre, NEAR * pitch)
                .filter(|(other, _)| is_cell[*other] && opening.apart(&openings[*other]) <= WALL_APART)
                .filter_map(|(other, _)| openings[other].shape())
                .fold((DMat2::ZERO, 0), |(sum, count), shape| (sum + shape, count + 1));
            count >= LEAST_NEIGHBOURS && narrowness(shapes) >= NARROW
        };
        let layer: Vec<usize> = (0..openings.len()).filter(continues).collect();
        if layer.is_empty() {
            return added;
        }
        layer.iter().for_each(|i| is_cell[*i] = true);
        added.extend(layer.into_iter().map(|i| openings[i]));
    }
}

/// Water on a relief: the sums over its pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Water {
    lowest: f64,
    area: f64,
    places: DVec2,
    squares: DMat2,
    /// Whether an opening in it has been filled to its brim.
    is_full: bool,
}

impl Water {
    fn on_pixel(place: DVec2, level: f64) -> Self {
        let squares = DMat2::from_cols(place * place.x, place * place.y);
        Self { lowest: level, area: 1.0, places: place, squares, is_full: false }
    }

    fn and(&self, other: &Self) -> Self {
        Self {
            lowest: self.lowest.min(other.lowest),
            area: self.area + other.area,
            places: self.places + other.places,
            squares: self.squares + other.squares,
            is_full: self.is_full || other.is_full,
        }
    }

    fn ellipse(&self) -> Ellipse {
        let centre = self.places / self.area;
        let spread =
            self.squares * self.area.recip() - DMat2::from_cols(centre * centre.x, centre * centre.y);
        // A pixel is a square, not a point.
        Ellipse::of_moments(centre, self.area, spread + DMat2::from_diagonal(DVec2::splat(1.0 / 12.0)))
    }
}

/// The openings of a relief. It is flooded in tiles, which stay in a processor's cache, with a margin in which what reaches into a
/// tile ends; their number follows from the relief alone.
fn openings(relief: &Plane, pitch: f64) -> Vec<Ellipse> {
    let margin = pixels(MARGIN * pitch);
    let starts = |length: usize| (0..length).step_by(TILE);
    let tiles: Vec<[usize; 2]> =
        starts(relief.height()).flat_map(|y| starts(relief.width()).map(move |x| [x, y])).collect();
    let of_tile = |[x, y]: [usize; 2]| {
        let corner = [x.saturating_sub(margin), y.saturating_sub(margin)];
        let end = |start: usize, length: usize| (start + TILE + margin).min(length);
        let size = [end(x, relief.width()) - corner[0], end(y, relief.height()) - corner[1]];
        let tile = Plane::from_fn(size[0], size[1], |u, v| relief.at(corner[0] + u, corner[1] + v));
        let offset = DVec2::new(corner[0] as f64, corner[1] as f64);
        let core = DVec2::new(x as f64, y as f64);
        let is_inside = move |opening: &Ellipse| {
            let place = opening.centre - core;
            place.cmpge(DVec2::ZERO).all() && place.cmplt(DVec2::splat(TILE as f64)).all()
        };
        flooded(&tile, AREA.start * pitch * pitch)
            .into_iter()
            .map(|opening| opening.moved(offset))
            .filter(is_inside)
            .collect::<Vec<Ellipse>>()
    };
    tiles.into_par_iter().flat_map_iter(of_tile).collect()
}

/// The openings of a tile, none smaller than `least_area` pixels.
fn flooded(relief: &Plane, least_area: f64) -> Vec<Ellipse> {
    let (width, count) = (relief.width(), relief.width() * relief.height());
    let level = |pixel: u32| relief.data()[pixel as usize];
    let mut order: Vec<u32> = (0..crate::index::checked_u32(count)).collect();
    order.sort_unstable_by(|a, b| level(*a).total_cmp(&level(*b)).then(a.cmp(b)));
    let mut flood =
        Flood { water_of: vec![Flood::DRY; count], waters: Vec::new(), least_area, found: Vec::new() };
    for number in order {
        let pixel = number as usize;
        let (x, y) = (pixel % width, pixel / width);
        let beside = [
            (y > 0).then(|| pixel.wrapping_sub(width)),
            (x > 0).then(|| pixel.wrapping_sub(1)),
            (x + 1 < width).then_some(pixel + 1),
            (pixel + width < count).then_some(pixel + width),
        ];
        let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        flood.wet(pixel, place, f64::from(level(number)), beside.into_iter().flatten());
    }
    flood.found
}

/// A relief that is flooded pixel by pixel, from the lowest on.
struct Flood {
    /// The water that each pixel came to.
    water_of: Vec<u32>,
    /// Waters, each with the one that it flows to: itself until it is joined to another.
    waters: Vec<(u32, Water)>,
    least_area: f64,
    /// The openings that are full.
    found: Vec<Ellipse>,
}

impl Flood {
    const DRY: u32 = u32::MAX;

    /// Water comes to a pixel at its height: that of the pixels beside it that are wet, which meet here, or a spring.
    fn wet(&mut self, pixel: usize, place: DVec2, height: f64, beside: impl Iterator<Item = usize>) {
        let mut here = Self::DRY;
        for other in beside {
            let there = self.water_of[other];
            if there != Self::DRY {
                let there = self.root(there);
                here = if here == Self::DRY { there } else { self.join(here, there, height) };
            }
        }
        let drop = Water::on_pixel(place, height);
        if here == Self::DRY {
            here = crate::index::checked_u32(self.waters.len());
            self.waters.push((here, drop));
        } else {
            let water = &mut self.waters[here as usize].1;
            *water = water.and(&drop);
        }
        self.water_of[pixel] = here;
    }

    fn root(&mut self, mut water: u32) -> u32 {
        while self.waters[water as usize].0 != water {
            let next = self.waters[self.waters[water as usize].0 as usize].0;
            self.waters[water as usize].0 = next;
            water = next;
        }
        water
    }

    /// Joins two waters that meet at a height. If both are openings, both are full now.
    fn join(&mut self, here: u32, there: u32, height: f64) -> u32 {
        if here == there {
            return here;
        }
        let mut both = [here, there].map(|water| self.waters[water as usize].1);
        if both.iter().all(|water| height - water.lowest >= LEAST_DEPTH && water.area >= self.least_area) {
            for water in both.iter_mut().filter(|water| !water.is_full) {
                self.found.push(water.ellipse());
                water.is_full = true;
            }
        }
        self.waters[here as usize].0 = there;
        self.waters[there as usize].1 = both[0].and(&both[1]);
        there
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comb::plane::narrow;

    /// Rows of pits on a plane that turns away from the camera: every pit is an opening, of the right shape.
    #[test]
    fn every_pit_is_an_opening_and_has_its_shape() {
        let (across, along) = (40.0, 20.0);
        let relief = Plane::from_fn(400, 200, |x, y| {
            let wave = |v: usize, period: f64| (std::f64::consts::TAU * (v as f64 + 0.5) / period).cos();
            narrow(wave(x, across) + wave(y, along))
        });
        let found = openings(&relief, 30.0);
        // The water rises to the saddles, at 0, where it covers half of the plane.
        assert_eq!(found.len(), 10 * 10);
        // The corners of a pit, a diamond, are thinner than a pixel.
        for opening in &found {
            let [long, short] = opening.half_axes();
            assert!((long / short - across / along).abs() < 0.15, "{long} {short}");
            assert!((opening.area - 0.5 * across * along).abs() < 0.1 * across * along, "{}", opening.area);
        }
    }

    #[test]
    fn a_cell_is_added_beside_narrow_ones_only() {
        for (along, expected) in [(10.0, 1), (18.0, 0)] {
            let relief = Plane::from_fn(200, 180, |x, y| {
                let wave = |v: usize, period: f64| (std::f64::consts::TAU * (v as f64 + 0.5) / period).cos();
                narrow(wave(x, 20.0) + wave(y, along))
            });
            let places: Vec<DVec2> = openings(&relief, 20.0).iter().map(|opening| opening.centre).collect();
            let missing = DVec2::new(110.0, 5.5 * along);
            let positions: Vec<DVec2> = places.into_iter().filter(|p| p.distance(missing) > 3.0).collect();
            let sites: Vec<Site> = positions.iter().map(|place| Site::new(*place, 0)).collect();
            let missed = missed(&relief, &sites, &positions, |_| 20.0);
            assert_eq!(missed.cells.len(), expected, "{along}");
            assert!(missed.cells.iter().all(|(place, _)| place.distance(missing) < 1.0));
        }
    }
}
