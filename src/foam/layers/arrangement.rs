//! Two sheets of seeds.

use super::{
    NoLayers,
    division::{check, divided_unchecked},
    layer_figures, plane_end,
    settle::settled,
};
use crate::{
    foam::{
        convert::as_f64,
        domain::Domain,
        free::{Division, spacing},
        ground::gap_volume,
        seeds::{Progress, SeedSettings, sow},
        setup::FoamSpace,
    },
    surface::{Curvature, Gap, SurfacePoint, SurfaceSamples, Wall},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How the cells of the two layers are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Arrangement {
    /// As bees build: the axes of the upper cells over every second corner of the lower ones; three rhombi to an end.
    Rhombic,
    /// As Fejes Tóth found: the upper axes over the middles of sides; two hexagons and two rhombi to an end.
    Toth,
    /// Annealed on both sides, each for itself.
    Annealed,
}

impl Arrangement {
    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rhombic => "rhombic",
            Self::Toth => "toth",
            Self::Annealed => "annealed",
        }
    }
}

/// Two sheets of seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheets {
    /// The seeds, those of the lower layer first.
    pub seeds: Vec<DVec3>,
    /// Their weights, in units of area: a heavier seed has the larger cell.
    pub weights: Vec<f64>,
    /// How many belong to the lower layer.
    pub lower: usize,
    /// The distance of neighbours in a layer, as of a hexagonal lattice.
    pub spacing: f64,
    /// The volume that each cell of the lower and of the upper layer shall have: together the layers fill the gap up to its
    /// middle surface.
    pub volumes: [f64; 2],
    /// The mean area that a cell of either layer has on its own wall.
    pub patches: [f64; 2],
    /// The greatest distance between the walls.
    pub depth: f64,
}

impl Sheets {
    /// The same sheets with their seeds inside the primary box.
    pub(super) fn wrapped(&self, domain: &Domain) -> Self {
        let seeds = self.seeds.iter().map(|&seed| domain.wrap(seed).0).collect();
        Self { seeds, weights: self.weights.clone(), ..*self }
    }
}

/// Rows may be stretched by this part against those of regular hexagons.
const STRETCH: f64 = 0.02;

/// Lines per axis when the middle surface's area is measured.
const AREA_LINES: usize = 40;

/// Seeds for `cells` cells on each wall.
///
/// # Errors
/// [`NoLayers`] if a pattern of plane walls does not fit, or without seeds.
pub fn sheets(
    space: &FoamSpace,
    gap: &Gap,
    arrangement: Arrangement,
    cells: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Sheets, NoLayers> {
    match (arrangement, *space) {
        (_, FoamSpace::Box { .. } | FoamSpace::Piece { .. }) => Err(NoLayers::Walled { space: *space }),
        (Arrangement::Annealed, _) => annealed(gap, cells, seed, progress),
        (_, FoamSpace::Plane { periods, height }) => rows(arrangement, periods, height, cells),
        _ => Err(NoLayers::Curved { pattern: arrangement.name(), surface: gap.middle().name() }),
    }
}

/// Rows of regular hexagons, the upper layer shifted as the arrangement says. The seeds' height sets the slope of the plane
/// films between the layers to that of least area.
fn rows(arrangement: Arrangement, periods: [f64; 2], height: f64, cells: usize) -> Result<Sheets, NoLayers> {
    let fits = [false, true].into_iter().flat_map(|turned| {
        let [along, across] = if turned { [periods[1], periods[0]] } else { periods };
        (2..=cells).step_by(2).filter(move |rows| cells.is_multiple_of(*rows)).map(move |rows| {
            let columns = cells / rows;
            let (pitch, step) = (along / as_f64(columns), across / as_f64(rows));
            let ratio = step / (pitch * 0.75_f64.sqrt());
            (ratio.max(1.0 / ratio) - 1.0, rows, columns, turned, pitch, step)
        })
    });
    let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
    let unfit = |rows, columns, stretch: f64| NoLayers::Rows {
        cells,
        periods,
        rows,
        columns,
        stretch: 100.0 * stretch,
    };
    let Some((stretch, rows, columns, turned, pitch, step)) = best else {
        return Err(unfit(0, 0, f64::NAN));
    };
    if stretch > STRETCH {
        return Err(unfit(rows, columns, stretch));
    }
    let side = (pitch * step / 1.5 / 3.0_f64.sqrt()).sqrt();
    let end = plane_end(arrangement).map_or(0.25, |end| end.height);
    let (shift, z) = match arrangement {
        Arrangement::Toth => ([0.5 * pitch, 0.0], 3.0 * side / (16.0 * end)),
        Arrangement::Rhombic | Arrangement::Annealed => ([0.5 * pitch, step / 3.0], side / (4.0 * end)),
    };
    let mut seeds = Vec::with_capacity(2 * cells);
    for (layer, z) in [(0.0, -z), (1.0, z)] {
        for row in 0..rows {
            for column in 0..columns {
                let odd = if row % 2 == 1 { 0.5 } else { 0.0 };
                let x = (as_f64(column) + odd) * pitch + layer * shift[0];
                let y = as_f64(row) * step + layer * shift[1];
                seeds.push(if turned { DVec3::new(y, x, z) } else { DVec3::new(x, y, z) });
            }
        }
    }
    let area = periods[0] * periods[1];
    Ok(Sheets {
        weights: vec![0.0; seeds.len()],
        seeds,
        lower: cells,
        spacing: spacing(area, cells),
        volumes: [area * height / as_f64(2 * cells); 2],
        patches: [area / as_f64(cells); 2],
        depth: height,
    })
}

/// How far from the middle surface the seeds of a layer are put, in spacings: where those of rows stand, so that the films
/// between the layers slope as in natural comb.
const HEIGHT: f64 = 0.41;
/// Films between seeds at the distance `z` from the middle surface reach from it as far as `FARTHEST s²/4z` for the spacing `s`,
/// from the corners of hexagons: a third of the spacing squared.
const FARTHEST: f64 = 1.0 / 3.0;
/// The part of half the gap that the films between the layers may fill at first.
const FILLED: f64 = 0.65;
/// The part of the least radius of curvature within which seeds stay: normals cross beyond it.
const WITHIN: f64 = 0.8;

/// Cells less high than this part of their spacing are refused: the films between the layers, which slope as much as cells
/// are wide, lower their area by reaching the walls. Between planes, for cells of opening `A` and height `h`, the bees' foam has
/// the energy `√(2/3) + 12^(1/4) 2h/√A` per area, and one layer of twice as many cells `12^(1/4) 2h/√(A/2)`: less from
/// `h = 0.493` spacings down.
const FLATTEST: f64 = 0.5;
/// The height, in spacings, from which on layers keep apart on all surfaces that were tried.
const COMFORTABLE: f64 = 0.7;
/// Cells of five sides or fewer that are deeper than this many of their widths at their wall are refused. Between planes those of
/// 64 cells a wall stay on their walls at 1.5 widths and leave them at 1.9, between spheres (radii 1 and 2) they stay at
/// 1.5 and leave at 2.1; with the 12 of 24 cells between the radii 1 and 4, which brace each other, all stay at 1.9.
const DEEPEST: f64 = 2.5;
/// Patterns of so many cells, annealed, have some of five sides.
const MANY: usize = 100;
/// The depth, in widths, up to which cells stayed on their walls on all surfaces that were tried.
const SHALLOW: f64 = 1.5;
/// The most cells on each wall: memory grows by 2 MB and a Newton step by 12 ms with each.
const MOST_CELLS: usize = 2000;

/// The share of the time that sowing takes before the layers settle.
const SOWING: f64 = 0.1;

/// How much farther seeds are put where the cells of the nearest ones reach the other wall.
const FARTHER: [f64; 4] = [1.0, 1.4, 2.0, 2.8];

/// Two sheets annealed on the middle surface with independent random numbers of one seed, then moved along its normals to their
/// sides; so far that flat cells reach their own wall only, even if that is beyond the wall.
fn annealed(gap: &Gap, cells: usize, seed: u64, progress: &mut Progress<'_>) -> Result<Sheets, NoLayers> {
    let middle = gap.middle().as_ref();
    let domain = Domain::of_surface(middle);
    let middle_samples = SurfaceSamples::new(middle, 0.0, AREA_LINES);
    let spacing = spacing(middle_samples.area(), cells);
    let [below, above] = gap.halves().map(|half| gap_volume(&half, &domain) / as_f64(cells));
    refuse_flat(gap, &middle_samples, [below, above], cells)?;
    refuse_deep_everywhere(gap, &middle_samples, [below, above], cells)?;
    if cells > MOST_CELLS {
        return Err(NoLayers::Many {
            cells,
            most: MOST_CELLS,
            width: spacing * (as_f64(cells) / as_f64(MOST_CELLS)).sqrt(),
        });
    }
    let settings = SeedSettings::new(cells, seed);
    let mut places = Vec::with_capacity(2 * cells);
    for layer in 0..2 {
        let sown = sow(gap, &domain, &settings, layer, &mut |share| {
            progress(SOWING * 0.5 * (share + if layer == 0 { 0.0 } else { 1.0 }))
        })?;
        places.extend(sown.points);
    }
    let patches = patches(gap, &middle_samples, cells);
    let heights = middle_samples.points().iter().map(|point| gap.local_gap(point.position));
    let depth = heights.fold(0.0, f64::max);
    let moved = |farther: f64| -> Result<Sheets, NoLayers> {
        let seeds = places.iter().enumerate().map(|(at, &place)| {
            let away = farther * distance(gap, place, spacing)?;
            let Curvature { gauss, mean } = middle.curvature(place);
            let bend = mean.abs() + (mean * mean - gauss).max(0.0).sqrt();
            let side = if at < cells { -1.0 } else { 1.0 };
            Ok(place + side * away.min(WITHIN / bend) * middle.normal(place))
        });
        let seeds: Vec<DVec3> = seeds.collect::<Result<_, NoLayers>>()?;
        let (weights, volumes) = (vec![0.0; seeds.len()], [below, above]);
        Ok(Sheets { weights, seeds, lower: cells, spacing, volumes, patches, depth })
    };
    let settling = &mut |done| progress(SOWING + (1.0 - SOWING) * done);
    let mut judged = false;
    for farther in FARTHER {
        let sheets = moved(farther)?;
        let Ok(division) = divided_unchecked(gap, &domain, &sheets) else { continue };
        if !judged {
            refuse_deep(gap, &division, &places)?;
            judged = true;
        }
        if check(&division).is_ok() {
            return settled(gap, &domain, sheets, settling);
        }
    }
    settled(gap, &domain, moved(FARTHER[0])?, settling)
}

/// Refuses layers in which cells of few sides are so deep that they leave their walls. `places` are those of the seeds on the
/// middle surface.
fn refuse_deep(gap: &Gap, division: &Division, places: &[DVec3]) -> Result<(), NoLayers> {
    let figures = layer_figures(division);
    let sides = figures.iter().flat_map(|layer| &layer.sides);
    let few = sides.zip(places).enumerate().filter(|(_, (sides, _))| **sides < 6);
    let deepest = few
        .map(|(cell, (_, &place))| {
            let layer = usize::from(!division.is_lower(cell));
            slenderness(gap, &gap.walls()[layer], division.volumes[cell], place)
        })
        .fold(0.0, f64::max);
    if deepest > DEEPEST { Err(too_deep(deepest, division.lower())) } else { Ok(()) }
}

/// The same before seeds are sown, of so many cells that some have five sides, where the layers are that deep everywhere.
fn refuse_deep_everywhere(
    gap: &Gap,
    middle: &SurfaceSamples,
    volumes: [f64; 2],
    cells: usize,
) -> Result<(), NoLayers> {
    for (wall, volume) in gap.walls().iter().zip(volumes) {
        let depths = middle.points().iter().map(|point| slenderness(gap, wall, volume, point.position));
        let (least, most) =
            depths.fold((f64::INFINITY, 0.0_f64), |(low, high), depth| (low.min(depth), high.max(depth)));
        if cells >= MANY && least > DEEPEST {
            return Err(too_deep(most, cells));
        }
    }
    Ok(())
}

fn too_deep(deepest: f64, cells: usize) -> NoLayers {
    NoLayers::Deep { deepest, fitting: (SHALLOW / deepest).powi(2) * as_f64(cells) }
}

/// The depth of a cell over its width at its wall.
fn slenderness(gap: &Gap, wall: &Wall, volume: f64, place: DVec3) -> f64 {
    let height = height(wall, place);
    // Where normals almost meet, a cell would end in a point.
    let [filled, open] = steiner(gap, wall, place).map(|part| part.max(0.01));
    let area = volume / height / filled * open;
    height / (2.0 / 3.0_f64.sqrt() * area).sqrt()
}

/// The distance of a wall from the middle surface, to first order in the gap.
fn height(wall: &Wall, place: DVec3) -> f64 {
    wall.level.abs() / wall.field.gradient(place).length()
}

/// What lies between the middle surface and a wall over the prism of that height, and the wall's area over the middle surface's
/// (J. Steiner).
fn steiner(gap: &Gap, wall: &Wall, place: DVec3) -> [f64; 2] {
    let far = height(wall, place).copysign(wall.level);
    let Curvature { gauss, mean } = gap.middle().curvature(place);
    [1.0 + far * (mean + far * gauss / 3.0), 1.0 + far * (2.0 * mean + far * gauss)]
}

/// The mean area of a cell on its own wall.
fn patches(gap: &Gap, middle: &SurfaceSamples, cells: usize) -> [f64; 2] {
    gap.walls().each_ref().map(|wall| {
        let area = |point: &SurfacePoint| point.weight * steiner(gap, wall, point.position)[1].max(0.0);
        middle.points().iter().map(area).sum::<f64>() / as_f64(cells)
    })
}

/// Refuses layers that are so flat that films between the layers would reach the walls.
fn refuse_flat(gap: &Gap, middle: &SurfaceSamples, volumes: [f64; 2], cells: usize) -> Result<(), NoLayers> {
    for (wall, volume) in gap.walls().iter().zip(volumes) {
        // A cell's height, to first order in the gap, over the spacing of neighbours of its volume.
        let flat = |place: DVec3| height(wall, place).powi(3).sqrt() / (volume * 2.0 / 3.0_f64.sqrt()).sqrt();
        let flattest = middle.points().iter().map(|point| flat(point.position)).fold(f64::INFINITY, f64::min);
        if flattest < FLATTEST {
            // The spacing falls with the root of the number of cells.
            let needed = (COMFORTABLE / flattest).powi(2) * as_f64(cells);
            return Err(NoLayers::Flat { flattest, needed });
        }
    }
    Ok(())
}

/// How far from the middle surface a seed is put.
fn distance(gap: &Gap, place: DVec3, spacing: f64) -> Result<f64, NoLayers> {
    let height = gap.local_gap(place);
    if height.is_nan() {
        return Err(NoLayers::Lost { place });
    }
    Ok((HEIGHT * spacing).max(FARTHEST * spacing * spacing / (2.0 * FILLED * height)))
}
