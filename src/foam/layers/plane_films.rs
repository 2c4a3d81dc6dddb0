//! The energy of plane films between power cells, and its gradient by seeds and weights.
//!
//! Energy: the area of the films, a wetting of walls that are not the cells' own, and a penalty on unequal volumes. In units
//! of the spacing. A corner stands where planes `a·y = (|a|² + w − w')/2` meet, `a` the way to the seed behind each and `y` the
//! way to the corner, or two planes and a wall; the force on a corner is passed on to the planes' seeds and weights by the
//! inverse of that. The gradient is that of the energy to rounding, but for the walls' bulges, which are held.

use super::{
    NoLayers, Sheets,
    division::{Body, Kept, Near, Neighbours, Sight, within_walls},
};
use crate::{
    foam::{convert::as_f64, partition::polyhedron::Behind},
    surface::{Gap, WallSide},
};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// The stiffness against unequal volumes, in tensions over a spacing for a cell of twice its volume: cells of a foam differ in
/// pressure by less than a tension over their size, so that volumes come out equal to some percent.
const STIFFNESS: f64 = 14.0;
/// A cell's patch on its own wall below this part of the mean is stretched, and how stiffly, in tension × spacing²: power cells,
/// which have plane sides through their whole height, would leave the wall to their neighbours where curved films keep it.
const SMALL_PATCH: f64 = 0.4;
const HOLD: f64 = 5.0;

/// The tension of a wall of the other layer: more than films cost, so that cells withdraw from it.
const WETTING: f64 = 2.0;

/// Energy and gradient.
#[derive(Clone, Debug)]
pub(super) struct PlaneFilms {
    /// In units of tension × spacing².
    pub(super) energy: f64,
    /// By the seeds' places and their weights, in units of spacing and spacing².
    pub(super) gradient: Vec<[f64; 4]>,
}

/// A cell's share.
struct Share {
    energy: f64,
    /// By seed: its place and its weight.
    gradient: Vec<(usize, [f64; 4])>,
}

/// A cell as its films and walls bound it.
struct Bounded<'a> {
    body: &'a Body,
    seed: DVec3,
    /// The faces at each corner of the body.
    faces_at: Vec<Vec<usize>>,
    films: Vec<Vec<Kept>>,
}

/// Forces on the corners of films, as `films` of [`Bounded`].
type Forces = Vec<Vec<DVec3>>;

impl PlaneFilms {
    /// At `sheets`; the walls bulge out of the corners' chords by `bulges`, in units of spacing³.
    ///
    /// # Errors
    /// [`NoLayers::Seeds`] if a cell is empty.
    pub(super) fn new(
        sight: &Sight<'_>,
        neighbours: &Neighbours,
        sheets: &Sheets,
        bulges: &[f64],
    ) -> Result<Self, NoLayers> {
        let cells = sheets.seeds.len();
        let shares: Vec<Share> = (0..cells)
            .into_par_iter()
            .map(|cell| {
                let body = neighbours.body(sheets, cell)?;
                let bounded = Bounded::new(sight, &body, sheets.seeds[cell]);
                Ok(bounded.share(sight.gap, sheets, cell, bulges))
            })
            .collect::<Result<_, NoLayers>>()?;
        let mut gradient = vec![[0.0; 4]; cells];
        for &(cell, by) in shares.iter().flat_map(|share| &share.gradient) {
            gradient[cell].iter_mut().zip(by).for_each(|(sum, by)| *sum += by);
        }
        let energy = shares.iter().map(|share| share.energy).sum();
        Ok(Self { energy, gradient })
    }
}

/// By how much the walls bulge out of the chords between the corners on them, for each cell, in units of spacing³.
///
/// # Errors
/// [`NoLayers::Seeds`] if a cell is empty.
pub(super) fn bulges(
    sight: &Sight<'_>,
    neighbours: &Neighbours,
    sheets: &Sheets,
) -> Result<Vec<f64>, NoLayers> {
    (0..sheets.seeds.len())
        .into_par_iter()
        .map(|cell| {
            let body = neighbours.body(sheets, cell)?;
            let bounded = Bounded::new(sight, &body, sheets.seeds[cell]);
            let bulge: f64 = WallSide::BOTH.into_iter().map(|side| bounded.bulge(sight.gap, side)).sum();
            Ok(bulge / sheets.spacing.powi(3))
        })
        .collect()
}

impl<'a> Bounded<'a> {
    fn new(sight: &Sight<'_>, body: &'a Body, seed: DVec3) -> Self {
        let mut faces_at = vec![Vec::new(); body.polyhedron.corners.len()];
        for (at, face) in body.polyhedron.faces.iter().enumerate() {
            for &corner in &face.corners {
                faces_at[corner as usize].push(at);
            }
        }
        let outside = sight.beyond(&body.polyhedron, seed);
        let kept = |face| within_walls(sight.gap, &body.polyhedron, face, &outside, seed);
        Self { body, seed, faces_at, films: body.polyhedron.faces.iter().map(kept).collect() }
    }

    /// The chords on a wall: the film and its two corners in order round the patch, seen from outside.
    fn chords(&self, wall: WallSide) -> impl Iterator<Item = (usize, [usize; 2])> + '_ {
        self.films.iter().enumerate().flat_map(move |(film, kept)| {
            let count = kept.len();
            (0..count).filter_map(move |at| {
                let next = (at + 1) % count;
                (kept[at].wall == Some(wall) && kept[next].wall == Some(wall)).then_some((film, [next, at]))
            })
        })
    }

    /// The corners' mean and twice the area vector of the patch on a wall.
    fn patch(&self, wall: WallSide) -> Option<(DVec3, DVec3, f64)> {
        let (mut sum, mut twice, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (film, [a, b]) in self.chords(wall) {
            let [a, b] = [a, b].map(|at| self.films[film][at].place);
            sum += a;
            twice += a.cross(b);
            count += 1.0;
        }
        (count > 0.0).then(|| (sum / count, twice, count))
    }

    /// The volume between the fan over the chords on a wall and the wall: heights are quadratic over each triangle, which the
    /// middles of its sides integrate.
    fn bulge(&self, gap: &Gap, side: WallSide) -> f64 {
        let Some((middle, ..)) = self.patch(side) else { return 0.0 };
        let wall = gap.wall(side);
        let out = if side == WallSide::Upper { -1.0 } else { 1.0 };
        let height = |y: DVec3| {
            let place = self.seed + y;
            out * wall.value(place) / wall.field.gradient(place).length()
        };
        self.chords(side)
            .map(|(film, chord)| {
                let [a, b] = chord.map(|at| self.films[film][at].place);
                let area = 0.5 * (a - middle).cross(b - middle).length();
                let heights = height(0.5 * (a + b)) + height(0.5 * (a + middle)) + height(0.5 * (b + middle));
                area * heights / 3.0
            })
            .sum()
    }

    fn share(&self, gap: &Gap, sheets: &Sheets, cell: usize, bulges: &[f64]) -> Share {
        let spacing = sheets.spacing;
        let mut by_area: Forces = self.films.iter().map(|kept| vec![DVec3::ZERO; kept.len()]).collect();
        let mut by_volume = by_area.clone();
        let (mut area, mut volume) = (0.0, 0.0);
        for (film, kept) in self.films.iter().enumerate().filter(|(_, kept)| kept.len() > 2) {
            let loop_of: Vec<DVec3> = kept.iter().map(|kept| kept.place).collect();
            // Each film belongs to two cells.
            area += 0.5 * add_area(&loop_of, 0.5, &mut by_area[film]);
            volume += add_cone(&loop_of, &mut by_volume[film]);
        }
        let layer = usize::from(cell >= sheets.lower);
        let foreign = if layer == 0 { WallSide::Upper } else { WallSide::Lower };
        for wall in WallSide::BOTH {
            volume += self.add_patch_cone(wall, &mut by_volume);
            area += if wall == foreign {
                WETTING * self.add_patch_area(wall, WETTING, &mut by_area)
            } else {
                let least = SMALL_PATCH * sheets.patches[layer];
                spacing * spacing * self.add_hold(wall, least, spacing * spacing, &mut by_area)
            };
        }
        let (area, volume) = (area / (spacing * spacing), volume / spacing.powi(3) + bulges[cell]);
        let wanted = sheets.volumes[layer] / spacing.powi(3);
        let off = volume / wanted - 1.0;
        let pull = STIFFNESS * off / spacing;
        for (area, volume) in by_area.iter_mut().flatten().zip(by_volume.iter().flatten()) {
            *area += pull * *volume;
        }
        let gradient = self.passed_on(gap, cell, &by_area, spacing);
        Share { energy: area + 0.5 * STIFFNESS * wanted * off * off, gradient }
    }

    /// The cone from the seed over the chords on a wall and their mean.
    fn add_patch_cone(&self, wall: WallSide, by_volume: &mut Forces) -> f64 {
        let Some((middle, twice, count)) = self.patch(wall) else { return 0.0 };
        for (film, [a, b]) in self.chords(wall) {
            let places = [a, b].map(|at| self.films[film][at].place);
            by_volume[film][a] += places[1].cross(middle) / 6.0 + twice / (6.0 * count);
            by_volume[film][b] += middle.cross(places[0]) / 6.0;
        }
        middle.dot(twice) / 6.0
    }

    /// What it costs, in tension × spacing², that a patch is smaller than `least`.
    fn add_hold(&self, wall: WallSide, least: f64, unit: f64, by_area: &mut Forces) -> f64 {
        let area = self.patch(wall).map_or(0.0, |(_, twice, _)| 0.5 * twice.length());
        let short = 1.0 - area / least;
        if short <= 0.0 {
            return 0.0;
        }
        self.add_patch_area(wall, -HOLD * short * unit / least, by_area);
        0.5 * HOLD * short * short
    }

    fn add_patch_area(&self, wall: WallSide, factor: f64, by_area: &mut Forces) -> f64 {
        let Some((_, twice, _)) = self.patch(wall) else { return 0.0 };
        let normal = twice.normalize_or_zero();
        for (film, [a, b]) in self.chords(wall) {
            let places = [a, b].map(|at| self.films[film][at].place);
            by_area[film][a] += 0.5 * factor * places[1].cross(normal);
            by_area[film][b] += 0.5 * factor * normal.cross(places[0]);
        }
        0.5 * twice.length()
    }

    /// Forces on corners passed on to seeds and weights, in units of the spacing. Forces are derivatives of an energy in
    /// units of tension × area.
    fn passed_on(&self, gap: &Gap, cell: usize, forces: &Forces, spacing: f64) -> Vec<(usize, [f64; 4])> {
        let mut passed = Vec::new();
        let (mut own, mut own_weight) = (DVec3::ZERO, 0.0);
        for (kept, &force) in self.films.iter().flatten().zip(forces.iter().flatten()) {
            let ways = self.ways(kept);
            let wall = kept.wall.map(|side| {
                gap.wall(side).field.gradient(self.seed + kept.place).normalize_or_zero() * spacing
            });
            let rows = ways.iter().map(|near| near.way).chain(wall);
            let gram = rows.map(|way| DMat3::from_cols(way * way.x, way * way.y, way * way.z));
            let gram = gram.fold(DMat3::ZERO, |sum, own| sum + own);
            let answer = gram.inverse() * (force / spacing);
            if !answer.is_finite() {
                continue;
            }
            if let Some(normal) = wall {
                own -= normal.dot(answer) * normal;
            }
            for near in ways {
                let part = near.way.dot(answer);
                let by = part * (near.way - kept.place);
                own -= by;
                own_weight += 0.5 * part * spacing;
                passed.push((near.cell, [by.x, by.y, by.z, -0.5 * part * spacing]));
            }
        }
        passed.push((cell, [own.x, own.y, own.z, own_weight]));
        passed
    }

    /// The seeds whose planes meet in a corner.
    fn ways(&self, kept: &Kept) -> Vec<&'a Near> {
        let [from, to] = kept.edge.map(|corner| &self.faces_at[corner as usize]);
        from.iter()
            .filter(|face| to.contains(face))
            .filter_map(|&face| match self.body.polyhedron.faces[face].half_space.behind {
                Behind::Cell(at) => Some(&self.body.near[at as usize]),
                _ => None,
            })
            .collect()
    }
}

/// The area of a plane loop; `factor` times its gradient is added to `forces`.
fn add_area(places: &[DVec3], factor: f64, forces: &mut [DVec3]) -> f64 {
    let twice = twice_area(places);
    let normal = twice.normalize_or_zero();
    for (at, force) in forces.iter_mut().enumerate() {
        *force += 0.5 * factor * across(places, at).cross(normal);
    }
    0.5 * twice.length()
}

/// The volume of the cone from the origin over a loop; its gradient is added to `forces`.
fn add_cone(places: &[DVec3], forces: &mut [DVec3]) -> f64 {
    let twice = twice_area(places);
    let count = as_f64(places.len());
    let middle = places.iter().sum::<DVec3>() / count;
    for (at, force) in forces.iter_mut().enumerate() {
        *force += (twice / count + across(places, at).cross(middle)) / 6.0;
    }
    middle.dot(twice) / 6.0
}

fn twice_area(places: &[DVec3]) -> DVec3 {
    places.iter().zip(places.iter().cycle().skip(1)).map(|(a, b)| a.cross(*b)).sum()
}

/// From the place before to the place after.
fn across(places: &[DVec3], at: usize) -> DVec3 {
    let count = places.len();
    places[(at + 1) % count] - places[(at + count - 1) % count]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        layers::{Arrangement, sheets},
        setup::{FoamSpace, PeriodicSurface, PeriodicWalls, SpaceError},
    };
    use std::ops::ControlFlow;

    #[test]
    fn the_gradient_is_that_of_the_energy_between_any_walls() -> Result<(), SpaceError> {
        let kind = PeriodicSurface::SchwarzP;
        let walls = PeriodicWalls::LevelSet { delta: 0.8 };
        let spaces = [
            FoamSpace::Periodic { kind, period: 1.0, walls },
            FoamSpace::Plane { periods: [4.0, 4.62], height: 2.3 },
        ];
        for space in spaces {
            let (gap, domain) = (space.gap()?, space.domain()?);
            let cells = if matches!(space, FoamSpace::Plane { .. }) { 16 } else { 200 };
            let goes_on = &mut |_| ControlFlow::Continue(());
            let mut settled = sheets(&space, &gap, Arrangement::Annealed, cells, 5, goes_on).unwrap();
            // Off the least energy, so that there are forces; and with many patches that are held as too small.
            settled.patches = settled.patches.map(|patch| 2.5 * patch);
            for (at, (seed, weight)) in settled.seeds.iter_mut().zip(&mut settled.weights).enumerate() {
                let by = as_f64(at * 7 % 11) / 11.0 - 0.5;
                *seed += 0.1 * settled.spacing * by * DVec3::new(1.0, -0.5, 0.7);
                *weight += 0.05 * settled.spacing.powi(2) * by;
            }
            let start = settled.wrapped(&domain);
            let neighbours = Neighbours::new(&domain, &start);
            let sight = Sight::new(&gap);
            let bulges = bulges(&sight, &neighbours, &start).unwrap();
            let films = PlaneFilms::new(&sight, &neighbours, &start, &bulges).unwrap();
            for (cell, axis) in
                [(0, 0), (2, 1), (5, 2), (7, 3), (cells + 1, 0), (cells + 3, 2), (cells + 4, 3)]
            {
                let at = |by: f64| {
                    let mut moved = start.clone();
                    if axis < 3 {
                        moved.seeds[cell][axis] += by * start.spacing;
                    } else {
                        moved.weights[cell] += by * start.spacing.powi(2);
                    }
                    PlaneFilms::new(&sight, &neighbours, &moved, &bulges).unwrap().energy
                };
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                // Second differences of an energy of some hundreds leave eight digits.
                let off = (films.gradient[cell][axis] - difference).abs();
                assert!(off < 1e-5 && difference.abs() > 1e-4, "{space} {cell} {axis}: {difference} {off}");
            }
        }
        Ok(())
    }
}
