//! The demo's comb: drawn on the inner wall, photographed from eight corners, read, and mapped back.
//!
//! A photograph of one unit cell shows few whole rings of cells, since the cut ends of the necks are never far. The comb
//! therefore covers a block of 2 × 2 × 2 unit cells of the same wall.

use super::CliError;
use crate::{
    comb::{self, Comb, CombError, Photo},
    foam::{
        domain::{Axis, Domain},
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

/// Width and height of a photograph in pixels: cells are then 24 to 47 pixels wide.
const SIZE: [u32; 2] = [900, 900];

/// Unit cells along each edge of the block.
pub(super) const UNIT_CELLS: u32 = 2;

/// The camera's distance from the middle, in edges of the block.
const DISTANCE: f64 = 5.0;
/// How much of the picture's width is shown, in periods. Seen from a corner, a unit cell is one period wide and its neighbours
/// are 0.82 periods aside.
const SHOWN: f64 = 2.75;

/// Annealing sweeps and polishing steps of the comb's places: fewer than a foam gets, so that it has more defects.
const SWEEPS: usize = 300;
const STEPS: usize = 200;

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

/// The piece of wall that carries the comb: a block of unit cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block {
    /// The period of the wall.
    pub(super) period: f64,
}

impl Block {
    /// The box of the block, from the origin.
    pub(super) fn extent(self) -> Extent {
        Extent { low: DVec3::ZERO, high: DVec3::splat(self.edge()) }
    }

    fn edge(self) -> f64 {
        f64::from(UNIT_CELLS) * self.period
    }

    /// Settings for the places of a comb with so many cells in each unit cell.
    pub(super) fn seeds(cells: usize, seed: u64) -> SeedSettings {
        // Another stretch of random numbers than the foam's.
        let mut settings =
            SeedSettings::new(cells * UNIT_CELLS.pow(3) as usize, seed.wrapping_add(1_000_000));
        settings.anneal.sweeps = SWEEPS;
        settings.polish.steps = STEPS;
        settings
    }

    /// Where the comb's cells are, with copies beyond the block as far as they touch cells within.
    pub(super) fn comb(self, gap: &Gap, settings: &SeedSettings) -> Result<CombOnWall, CliError> {
        let axis = Axis::Periodic { low: 0.0, length: self.edge() };
        let seeds = sow(gap, &Domain { axes: [axis; 3] }, settings, 0, &mut |_| ControlFlow::Continue(()))
            .map_err(CliError::failure)?;
        let wall = gap.wall(WallSide::Lower);
        let of_unit_cell = SurfaceSamples::new(wall.field.as_ref(), wall.level, 40).area();
        let area = of_unit_cell * f64::from(UNIT_CELLS.pow(3));
        #[expect(clippy::cast_precision_loss, reason = "counts of cells lie far below 2^53")]
        let pitch = (area / settings.count as f64 / 0.75_f64.sqrt()).sqrt();
        let margin = DVec3::splat(2.0 * pitch);
        let mut places = Vec::new();
        for seed in seeds.points {
            let place = wall.project(seed).map_err(CliError::failure)?;
            let copies = copies(place, self.edge());
            places.extend(
                copies.filter(|c| c.cmpgt(-margin).all() && c.cmplt(self.extent().high + margin).all()),
            );
        }
        Ok(CombOnWall { places, pitch })
    }

    /// Cameras that look at the middle of the block from its eight corners.
    fn cameras(self) -> Vec<Camera> {
        let middle = DVec3::splat(0.5 * self.edge());
        let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
        let shown = SHOWN * self.period;
        let distance = DISTANCE * self.edge();
        (0..8_u32)
            .map(|corner| {
                let sign = |bit: u32| if corner & (1 << bit) == 0 { 1.0 } else { -1.0 };
                let eye = middle + distance * DVec3::new(sign(0), sign(1), sign(2)).normalize();
                Camera::looking_at(eye, middle, DVec3::Z, size.x * distance / shown, size)
            })
            .collect()
    }
}

/// A place and its copies in the 26 boxes around its own.
fn copies(place: DVec3, edge: f64) -> impl Iterator<Item = DVec3> {
    (0..27_i32).map(move |k| {
        let step = [k % 3, k / 3 % 3, k / 9].map(|n| f64::from(n - 1));
        place + edge * DVec3::from_array(step)
    })
}

/// What came of the photographs.
pub(super) struct Photographs {
    /// Those that could be read.
    pub(super) views: Vec<View>,
    /// Those that show too little comb.
    pub(super) unread: Vec<Unread>,
}

/// A photograph that could not be read.
pub(super) struct Unread {
    /// `view-1` and so on.
    pub(super) name: String,
    pub(super) picture: RgbImage,
    /// Why.
    pub(super) reason: CombError,
}

impl Photographs {
    /// A line on what was read.
    pub(super) fn in_words(&self) -> String {
        let read: usize = self.views.iter().map(|view| view.comb.pattern.complete().count()).sum();
        let counted: usize = self.views.iter().map(|view| view.on_wall.complete().count()).sum();
        let unread = match self.unread.len() {
            0 => String::new(),
            count => format!(" ({count} show too little)"),
        };
        let views = self.views.len();
        format!("{views} views{unread}, {read} complete cells read, {counted} after each is counted once")
    }
}

/// Photographs the comb from all sides, reads the photographs, and maps what was read onto the wall.
pub(super) fn photograph(
    comb: &CombOnWall,
    gap: &Gap,
    block: Block,
    seed: u64,
    bar: &ProgressBar,
) -> Result<Photographs, CliError> {
    let caster = Caster::new(gap.wall(WallSide::Lower).clone(), WallSide::Lower, block.extent());
    let view = |(index, camera): (usize, Camera)| {
        let picture = paint(comb, &caster, &camera, SIZE, seed.wrapping_add(index as u64));
        let name = format!("view-{}", index + 1);
        let view = View::new(name, camera, picture, &caster);
        bar.inc(1);
        view
    };
    let cameras: Vec<(usize, Camera)> = block.cameras().into_iter().enumerate().collect();
    let read: Vec<Result<View, Unread>> = cameras.into_par_iter().map(view).collect::<Result<_, _>>()?;
    let (mut views, mut unread) = (Vec::new(), Vec::new());
    for view in read {
        match view {
            Ok(view) => views.push(view),
            Err(without) => unread.push(without),
        }
    }
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
    Ok(Photographs { views, unread })
}

impl View {
    /// Reads a photograph, if it shows enough comb.
    fn new(
        name: String,
        camera: Camera,
        picture: RgbImage,
        caster: &Caster,
    ) -> Result<Result<Self, Unread>, CliError> {
        let photo = Photo::from_picture(picture.clone().into());
        let comb = match comb::read(&photo, &comb::Settings::default()) {
            Ok(comb) => comb,
            Err(reason @ (CombError::NoComb | CombError::TooFine { .. })) => {
                return Ok(Err(Unread { name, picture, reason }));
            }
            Err(error) => return Err(CliError::failure(error)),
        };
        let Mapped { pattern, of_photo, .. } =
            map_pattern(&comb.pattern, &camera, caster, "mm").map_err(CliError::failure)?;
        let onto_wall = |pixel: &DVec2| {
            let (from, along) = camera.ray(*pixel);
            caster.first_hit(from, along)
        };
        let outline = |photo_cell| comb.details[photo_cell].outline.iter().filter_map(onto_wall).collect();
        let outlines = of_photo.iter().map(|id| outline(*id)).collect();
        Ok(Ok(Self { name, camera, picture, photo, comb, on_wall: pattern, outlines }))
    }
}
