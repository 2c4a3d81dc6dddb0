//! The demo's comb: drawn on the enclosure's inner shell, photographed from eight corners, read, and mapped back.

use super::CliError;
use crate::{
    comb::{self, Comb, Photo},
    enclosure::Design,
    foam::{
        domain::Domain,
        seeds::{SeedSettings, sow},
    },
    projection::{Camera, Caster, CombOnWall, Extent, Mapped, keep_squarest, map_pattern, paint},
    surface::{Gap, SurfaceSamples, WallSide},
    tessellation::CellPattern,
};
use glam::{DVec2, DVec3};
use image::RgbImage;
use indicatif::ProgressBar;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Width and height of a photograph in pixels: cells are then about 45 pixels wide, with 256 of them.
const SIZE: [u32; 2] = [720, 720];

/// The camera's distance from the middle, and how much of the picture's width is shown, in periods.
const DISTANCE: f64 = 5.0;
const SHOWN: f64 = 1.6;

/// Annealing sweeps of the comb's places: fewer than a foam gets, so that it has more defects.
const SWEEPS: usize = 150;

/// One photograph and what came of it.
pub(super) struct View {
    /// `view-1` and so on.
    pub(super) name: String,
    pub(super) camera: Camera,
    pub(super) picture: RgbImage,
    pub(super) photo: Photo,
    pub(super) comb: Comb,
    /// The cells on the wall; those that another camera sees better are cut.
    pub(super) on_wall: CellPattern,
    /// Their outlines on the wall.
    pub(super) outlines: Vec<Vec<DVec3>>,
}

/// The settings of the comb's places.
pub(super) fn comb_seeds(cells: usize, seed: u64) -> SeedSettings {
    // Another stretch of random numbers than the foam's.
    let mut settings = SeedSettings::new(cells, seed.wrapping_add(1_000_000));
    settings.anneal.sweeps = SWEEPS;
    settings
}

/// Where the comb's cells are, with copies beyond the box as far as they touch cells within.
pub(super) fn comb_on_wall(
    gap: &Gap,
    domain: &Domain,
    settings: &SeedSettings,
    period: f64,
) -> Result<CombOnWall, CliError> {
    let seeds =
        sow(gap, domain, settings, 0, &mut |_| ControlFlow::Continue(())).map_err(CliError::failure)?;
    let wall = gap.wall(WallSide::Lower);
    let area = SurfaceSamples::new(wall.field.as_ref(), wall.level, 40).area();
    #[expect(clippy::cast_precision_loss, reason = "counts of cells lie far below 2^53")]
    let pitch = (area / settings.count as f64 / 0.75_f64.sqrt()).sqrt();
    let mut places = Vec::new();
    for seed in seeds.points {
        let place = wall.project(seed).map_err(CliError::failure)?;
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let copy = place + period * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    if copy.cmpgt(DVec3::splat(-2.0 * pitch)).all()
                        && copy.cmplt(DVec3::splat(period + 2.0 * pitch)).all()
                    {
                        places.push(copy);
                    }
                }
            }
        }
    }
    Ok(CombOnWall { places, pitch })
}

/// Cameras that look at the middle of the cell from its eight corners.
fn cameras(period: f64) -> Vec<Camera> {
    let middle = DVec3::splat(0.5 * period);
    let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
    let focal = size.x * DISTANCE / SHOWN;
    (0..8_u32)
        .map(|corner| {
            let sign = |bit: u32| if corner & (1 << bit) == 0 { 1.0 } else { -1.0 };
            let eye = middle + DISTANCE * period * DVec3::new(sign(0), sign(1), sign(2)).normalize();
            Camera::looking_at(eye, middle, DVec3::Z, focal, size)
        })
        .collect()
}

/// The box of the printed piece, in mm.
fn extent(design: &Design) -> Extent {
    let period = design.period.0;
    Extent { low: period * design.region.low(), high: period * design.region.high() }
}

/// Photographs the comb from all sides, reads the photographs, and maps what was read onto the wall.
pub(super) fn photograph(
    comb: &CombOnWall,
    gap: &Gap,
    design: &Design,
    seed: u64,
    bar: &ProgressBar,
) -> Result<Vec<View>, CliError> {
    let caster = Caster::new(gap.wall(WallSide::Lower).clone(), WallSide::Lower, extent(design));
    let view = |(index, camera): (usize, Camera)| {
        let picture = paint(comb, &caster, &camera, SIZE, seed.wrapping_add(index as u64));
        let name = format!("view-{}", index + 1);
        let view = View::new(name, camera, picture, &caster);
        bar.inc(1);
        view
    };
    let cameras: Vec<(usize, Camera)> = cameras(design.period.0).into_iter().enumerate().collect();
    let mut views: Vec<View> = cameras.into_par_iter().map(view).collect::<Result<_, _>>()?;
    let mut patterns: Vec<(CellPattern, Camera)> =
        views.iter().map(|view| (view.on_wall.clone(), view.camera)).collect();
    let near = 0.3 * comb.pitch;
    keep_squarest(&mut patterns, |point, camera| {
        let (from, along) = camera.ray(camera.project(point).unwrap_or_default());
        caster.first_hit(from, along).is_none_or(|hit| hit.distance(point) > near)
    });
    for (view, (pattern, _)) in views.iter_mut().zip(patterns) {
        view.on_wall = pattern;
    }
    Ok(views)
}

impl View {
    fn new(name: String, camera: Camera, picture: RgbImage, caster: &Caster) -> Result<Self, CliError> {
        let photo = Photo::from_picture(picture.clone().into());
        let comb = comb::read(&photo, &comb::Settings::default()).map_err(CliError::failure)?;
        let Mapped { pattern, of_photo, .. } =
            map_pattern(&comb.pattern, &camera, caster, "mm").map_err(CliError::failure)?;
        let onto_wall = |pixel: &DVec2| {
            let (from, along) = camera.ray(*pixel);
            caster.first_hit(from, along)
        };
        let outline = |photo_cell| comb.details[photo_cell].outline.iter().filter_map(onto_wall).collect();
        let outlines = of_photo.iter().map(|id| outline(*id)).collect();
        Ok(Self { name, camera, picture, photo, comb, on_wall: pattern, outlines })
    }
}
