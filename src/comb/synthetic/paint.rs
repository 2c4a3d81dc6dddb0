//! Painting the comb, pixel by pixel.

use super::{
    RenderSettings, Style,
    arrangement::DrawnCell,
    camera::Camera,
    contents::{Content, Contents},
};
use crate::comb::{
    grid::Grid,
    plane::{Plane, narrow},
};
use glam::{DVec2, DVec3};
use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Half the thickness of a wall in pitches; it varies by a third from wall to wall.
const WALL: f64 = 0.055;
/// How sharply walls meet: corners are rounded over about 1/ROUNDING pitches.
const ROUNDING: f64 = 16.0;
/// Where the light comes from.
const LIGHT: DVec2 = DVec2::new(-0.6, -0.8);

/// Colours of a style, linear in the shade.
struct Colours {
    wall: DVec3,
    side: DVec3,
    bottom: DVec3,
    behind: DVec3,
}

impl Colours {
    const fn of(style: Style) -> Self {
        let (wall, side, bottom, behind) = match style {
            Style::Wax => ([0.86, 0.80, 0.62], [0.50, 0.46, 0.33], [0.10, 0.10, 0.09], [0.55, 0.62, 0.70]),
            Style::Brood => ([0.46, 0.34, 0.20], [0.22, 0.15, 0.09], [0.06, 0.045, 0.04], [0.30, 0.36, 0.28]),
            Style::Base => ([0.84, 0.79, 0.66], [0.40, 0.44, 0.45], [0.05, 0.16, 0.36], [0.04, 0.20, 0.50]),
            Style::Bright => ([0.30, 0.22, 0.14], [0.55, 0.47, 0.32], [0.80, 0.74, 0.58], [0.20, 0.22, 0.20]),
        };
        Self {
            wall: DVec3::from_array(wall),
            side: DVec3::from_array(side),
            bottom: DVec3::from_array(bottom),
            behind: DVec3::from_array(behind),
        }
    }
}

/// Paints the picture.
pub(super) fn paint(
    cells: &[DrawnCell],
    contents: &Contents,
    settings: &RenderSettings,
    view: &Camera,
) -> RgbImage {
    let scene = Scene::new(cells, contents, settings);
    let width = settings.width as usize;
    let rows: Vec<Vec<DVec3>> = (0..settings.height)
        .into_par_iter()
        .map(|y| {
            let pixel = |x: u32| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            (0..settings.width)
                .map(|x| scene.colour(view.on_comb(pixel(x))) * scene.light(pixel(x)))
                .collect()
        })
        .collect();
    let channel = |c: usize| {
        Plane::from_fn(width, rows.len(), |x, y| narrow(rows[y][x][c])).blurred(settings.difficulty.blur)
    };
    let channels = [channel(0), channel(1), channel(2)];
    develop(&channels, settings)
}

/// Adds noise and rounds to bytes. The noise of a row has a stream of its own.
fn develop(channels: &[Plane; 3], settings: &RenderSettings) -> RgbImage {
    let mut picture = RgbImage::new(settings.width, settings.height);
    let row_bytes = settings.width as usize * 3;
    picture.par_chunks_mut(row_bytes.max(1)).enumerate().for_each(|(y, row)| {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        random.set_stream(2 + y as u64);
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            for (c, value) in pixel.iter_mut().enumerate() {
                // Twelve uniform numbers make a normal one well enough.
                let normal: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
                let grey = f64::from(channels[c].at(x, y)) + settings.difficulty.noise * normal;
                *value = byte(grey);
            }
        }
    });
    picture
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the byte range")]
fn byte(grey: f64) -> u8 {
    (grey * 255.0).round().clamp(0.0, 255.0) as u8
}

struct Scene<'a> {
    cells: &'a [DrawnCell],
    contents: &'a Contents,
    grid: Grid,
    bees: Grid,
    colours: Colours,
    settings: &'a RenderSettings,
}

impl<'a> Scene<'a> {
    fn new(cells: &'a [DrawnCell], contents: &'a Contents, settings: &'a RenderSettings) -> Self {
        let centres: Vec<DVec2> = cells.iter().map(|c| c.centre).collect();
        let bees: Vec<DVec2> = contents.bees.iter().map(|b| b.centre).collect();
        let plain = Colours::of(settings.style);
        let faded = |c: DVec3| c.lerp((plain.wall + plain.bottom) / 2.0, settings.difficulty.fading * 0.8);
        let colours = Colours {
            wall: faded(plain.wall),
            side: faded(plain.side),
            bottom: faded(plain.bottom),
            behind: plain.behind,
        };
        Self { cells, contents, grid: Grid::of(&centres, 1.0), bees: Grid::of(&bees, 2.0), colours, settings }
    }

    /// Brightness of the light at a pixel: brightest near one corner.
    fn light(&self, pixel: DVec2) -> f64 {
        let size = DVec2::new(f64::from(self.settings.width), f64::from(self.settings.height));
        let far = (pixel / size - DVec2::new(0.75, 0.3)).length();
        1.05 / (1.0 + self.settings.difficulty.shade * far * far)
    }

    fn colour(&self, point: DVec2) -> DVec3 {
        for (bee, _) in self.bees.within(point, 1.6) {
            let inward = self.contents.bees[bee].inward(point);
            if inward.length() < 1.0 {
                return bee_colour(inward);
            }
        }
        if !self.contents.is_comb(point) {
            return self.colours.behind * (0.9 + 0.1 * grain(point, 1.7));
        }
        match self.grid.nearest(point, 2.5) {
            Some((cell, _)) => self.cell_colour(cell, point),
            None => self.colours.behind,
        }
    }

    fn cell_colour(&self, index: usize, point: DVec2) -> DVec3 {
        let cell = &self.cells[index];
        let from_centre = point - cell.centre;
        let (distance, thickness, outward) = self.to_wall(cell, point);
        let wax = self.colours.wall * (0.95 + 0.08 * grain(point, 5.0) + 0.05 * grain(point, 1.3));
        if self.contents.of_cell[index] == Content::Cap {
            return wax * (0.92 - 0.18 * from_centre.length() + 0.07 * grain(point, 9.0));
        }
        // The rim is brightest in its middle and rounds off into the cell.
        let rim = 1.0 / (1.0 + ((distance - thickness) * 60.0).exp());
        let depth = (-(distance - thickness).max(0.0) * 7.0).exp();
        let lit = 0.45 + 0.55 * outward.dot(-LIGHT).max(0.0);
        let sector = (from_centre.to_angle() * 3.0 / std::f64::consts::TAU).rem_euclid(1.0);
        let facet = 0.9 + 0.2 * (sector - 0.5).abs();
        let bottom = self.content_colour(index, point, from_centre) * facet;
        let inside = bottom.lerp(self.colours.side, depth * lit);
        inside.lerp(wax, rim)
    }

    /// Distance to the nearest wall's middle (rounded at corners), half the wall's thickness, and the direction to it.
    fn to_wall(&self, cell: &DrawnCell, point: DVec2) -> (f64, f64, DVec2) {
        let (mut sum, mut thickness, mut nearest, mut outward) = (0.0, WALL, f64::INFINITY, DVec2::ZERO);
        for neighbour in &cell.neighbours {
            let step = self.cells[*neighbour].centre - cell.centre;
            let middle = cell.centre + step / 2.0;
            let along = step.normalize_or_zero();
            let distance = (middle - point).dot(along);
            sum += (-ROUNDING * distance).exp();
            if distance < nearest {
                nearest = distance;
                outward = along;
                thickness = WALL * (1.0 + grain(middle * 3.1, 1.0) / 3.0);
            }
        }
        (-sum.max(1e-300).ln() / ROUNDING, thickness, outward)
    }

    fn content_colour(&self, index: usize, point: DVec2, from_centre: DVec2) -> DVec3 {
        let bottom = self.colours.bottom * (1.0 + 0.25 * grain(point, 3.0));
        match self.contents.of_cell[index] {
            Content::Pollen(hue) => {
                let pollen = DVec3::new(0.72, 0.50, 0.08).lerp(DVec3::new(0.62, 0.20, 0.06), hue);
                pollen * (0.85 + 0.2 * grain(point, 12.0))
            }
            Content::Larva => {
                let ring = ((from_centre.length() - 0.16) / 0.07).powi(2);
                let open = (from_centre.to_angle() - 1.0).cos() < 0.8;
                let pale = if open { (-ring).exp() * 0.7 } else { 0.0 };
                bottom.lerp(DVec3::new(0.75, 0.74, 0.68), pale)
            }
            Content::Nectar(at) => {
                let glint = (-(from_centre - at).length_squared() / 0.0018).exp();
                (bottom * 1.2).lerp(DVec3::ONE, glint)
            }
            Content::Empty | Content::Cap => bottom,
        }
    }
}

fn bee_colour(inward: DVec2) -> DVec3 {
    let stripe = (inward.x * 9.0).sin() > 0.2 && inward.x < 0.2;
    let fur = if stripe { DVec3::new(0.45, 0.30, 0.12) } else { DVec3::new(0.10, 0.07, 0.05) };
    fur * (1.1 - 0.6 * inward.length_squared())
}

/// Smooth noise between −1 and 1, of about `frequency` waves per pitch.
fn grain(point: DVec2, frequency: f64) -> f64 {
    let p = point * frequency;
    let a = (p.x * 2.13 + (p.y * 1.37).sin() * 1.9).sin();
    let b = (p.y * 2.71 - (p.x * 1.11).cos() * 2.3 + 0.7).sin();
    let c = ((p.x + p.y) * 1.53 + (p.x - p.y).sin() * 1.7 + 2.1).sin();
    (a + b + c) / 3.0
}
