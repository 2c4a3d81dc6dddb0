//! Two sheets of seeds.

use super::{NoLayers, plane_end, spacing};
use crate::{
    foam::{
        convert::as_f64,
        domain::Domain,
        seeds::{Progress, SeedSettings, sow},
        setup::FoamSpace,
    },
    surface::{Gap, SurfaceSamples, WallSide},
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
    /// How many belong to the lower layer.
    pub lower: usize,
    /// The distance of neighbours in a layer, as of a hexagonal lattice.
    pub spacing: f64,
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
        (Arrangement::Annealed, _) => annealed(gap, cells, seed, progress),
        (_, FoamSpace::Plane { periods, .. }) => rows(arrangement, periods, cells),
        _ => Err(NoLayers::Curved { pattern: arrangement.name(), surface: gap.middle().name() }),
    }
}

/// Rows of regular hexagons, the upper layer shifted as the arrangement says. The seeds' height sets the slope of the plane
/// films between the layers to that of least area.
fn rows(arrangement: Arrangement, periods: [f64; 2], cells: usize) -> Result<Sheets, NoLayers> {
    let fits = [false, true].into_iter().flat_map(|turned| {
        let [along, across] = if turned { [periods[1], periods[0]] } else { periods };
        (2..=cells).step_by(2).filter(move |rows| cells.is_multiple_of(*rows)).map(move |rows| {
            let columns = cells / rows;
            let (pitch, height) = (along / as_f64(columns), across / as_f64(rows));
            let ratio = height / (pitch * 0.75_f64.sqrt());
            (ratio.max(1.0 / ratio) - 1.0, rows, columns, turned, pitch, height)
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
    let Some((stretch, rows, columns, turned, pitch, height)) = best else {
        return Err(unfit(0, 0, f64::NAN));
    };
    if stretch > STRETCH {
        return Err(unfit(rows, columns, stretch));
    }
    let side = (pitch * height / 1.5 / 3.0_f64.sqrt()).sqrt();
    let end = plane_end(arrangement).map_or(0.25, |end| end.height);
    let (shift, z) = match arrangement {
        Arrangement::Toth => ([0.5 * pitch, 0.0], 3.0 * side / (16.0 * end)),
        Arrangement::Rhombic | Arrangement::Annealed => ([0.5 * pitch, height / 3.0], side / (4.0 * end)),
    };
    let mut seeds = Vec::with_capacity(2 * cells);
    for (layer, z) in [(0.0, -z), (1.0, z)] {
        for row in 0..rows {
            for column in 0..columns {
                let odd = if row % 2 == 1 { 0.5 } else { 0.0 };
                let x = (as_f64(column) + odd) * pitch + layer * shift[0];
                let y = as_f64(row) * height + layer * shift[1];
                seeds.push(if turned { DVec3::new(y, x, z) } else { DVec3::new(x, y, z) });
            }
        }
    }
    Ok(Sheets { seeds, lower: cells, spacing: spacing(periods[0] * periods[1], cells) })
}

/// Where a layer's seeds lie between the walls, from the lower one.
const QUARTERS: [f64; 2] = [0.25, 0.75];

/// Two sheets annealed on the middle surface with independent random numbers of one seed, then moved a quarter of the gap
/// towards their walls.
fn annealed(gap: &Gap, cells: usize, seed: u64, progress: &mut Progress<'_>) -> Result<Sheets, NoLayers> {
    let domain = Domain::of_surface(gap.middle().as_ref());
    let settings = SeedSettings::new(cells, seed);
    let [lower, upper] = WallSide::BOTH.map(|side| gap.wall(side));
    let mut seeds = Vec::with_capacity(2 * cells);
    for (layer, part) in QUARTERS.into_iter().enumerate() {
        let level = lower.level + part * (upper.level - lower.level);
        let stream = u64::from(crate::index::checked_u32(layer));
        let sown = sow(gap, &domain, &settings, stream, &mut |share| {
            progress(0.5 * (share + if layer == 0 { 0.0 } else { 1.0 }))
        })?;
        for place in sown.points {
            seeds.push(lower.field.project(place, level).map_err(|_| NoLayers::Lost { place })?);
        }
    }
    let area = SurfaceSamples::new(gap.middle().as_ref(), 0.0, AREA_LINES).area();
    Ok(Sheets { seeds, lower: cells, spacing: spacing(area, cells) })
}
