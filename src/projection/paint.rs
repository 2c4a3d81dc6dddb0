//! Comb on a curved wall as a photograph shows it.
//!
//! Each pixel's ray meets the wall in a point; the nearest of the cells' places owns it. Wax is bright along the walls between
//! two cells; cells are dark; light comes from beside the camera. What is drawn is the Voronoi diagram of the places on the
//! wall.

use super::{camera::Camera, cast::Caster};
use glam::{DVec2, DVec3};
use image::RgbImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Half the thickness of a wall, over the cells' pitch.
const WALL: f64 = 0.06;
/// How sharply a rim rounds off into its cell, per pitch.
const RIM: f64 = 40.0;
/// The standard deviation of the noise, in grey values of 0 to 1.
const NOISE: f64 = 0.015;

/// Colours: wax, the sides of a cell, its bottom, what lies behind the comb.
const WAX: DVec3 = DVec3::new(0.86, 0.78, 0.56);
const SIDE: DVec3 = DVec3::new(0.48, 0.40, 0.26);
const BOTTOM: DVec3 = DVec3::new(0.14, 0.11, 0.08);
const BEHIND: DVec3 = DVec3::new(0.56, 0.60, 0.64);

/// Comb that stands on a wall.
#[derive(Clone, Debug)]
pub struct CombOnWall {
    /// The middle of each cell, on or near the wall; copies by the wall's period included as far as they are to be seen.
    pub places: Vec<DVec3>,
    /// The usual distance of neighbours.
    pub pitch: f64,
}

/// The photograph of a comb on a wall by a camera, of `width` × `height` pixels. `seed` is that of its noise; the same
/// arguments give the same bytes.
#[must_use]
pub fn paint(
    comb: &CombOnWall,
    caster: &Caster,
    camera: &Camera,
    [width, height]: [u32; 2],
    seed: u64,
) -> RgbImage {
    let mut picture = RgbImage::new(width, height);
    let index = Index::new(comb);
    let row_bytes = 3 * width as usize;
    picture.par_chunks_mut(row_bytes.max(1)).enumerate().for_each(|(y, row)| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(y as u64);
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let middle = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let colour = shade(comb, &index, caster, camera, middle);
            for (c, byte) in pixel.iter_mut().enumerate() {
                // Twelve uniform numbers make a normal one well enough.
                let normal: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
                *byte = to_byte(colour[c] + NOISE * normal);
            }
        }
    });
    picture
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the byte range")]
fn to_byte(grey: f64) -> u8 {
    (grey * 255.0).round().clamp(0.0, 255.0) as u8
}

fn shade(comb: &CombOnWall, index: &Index, caster: &Caster, camera: &Camera, pixel: DVec2) -> DVec3 {
    let (from, along) = camera.ray(pixel);
    let Some(point) = caster.first_hit(from, along) else { return BEHIND };
    let outward = caster.wall().field.normal(point);
    let facing = outward.dot(along).abs();
    let light = 0.55 + 0.45 * facing;
    let Some(distance) = index.to_wall(comb, point) else { return WAX * light };
    let from_rim = (distance - WALL * comb.pitch) / comb.pitch;
    let rim = 1.0 / (1.0 + (RIM * from_rim).exp());
    let depth = (-6.0 * from_rim.max(0.0)).exp();
    BOTTOM.lerp(SIDE, depth).lerp(WAX, rim) * light
}

/// Places sorted into cubes, to find the nearest.
struct Index {
    low: DVec3,
    side: f64,
    counts: [usize; 3],
    cubes: Vec<Vec<usize>>,
}

impl Index {
    fn new(comb: &CombOnWall) -> Self {
        let side = 1.5 * comb.pitch;
        let places = || comb.places.iter().copied();
        let low = places().reduce(DVec3::min).unwrap_or_default();
        let high = places().reduce(DVec3::max).unwrap_or_default();
        let counts = ((high - low) / side).to_array().map(|n| whole(n) + 1);
        let mut index = Self { low, side, counts, cubes: vec![Vec::new(); counts.iter().product()] };
        for (number, place) in comb.places.iter().enumerate() {
            let cube = index.cube(*place);
            let at = index.flat(cube);
            index.cubes[at].push(number);
        }
        index
    }

    fn cube(&self, point: DVec3) -> [usize; 3] {
        let at = ((point - self.low) / self.side).to_array();
        std::array::from_fn(|axis| whole(at[axis]).min(self.counts[axis] - 1))
    }

    const fn flat(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// The distance to the nearest wall between two cells; `None` far from all cells.
    fn to_wall(&self, comb: &CombOnWall, point: DVec3) -> Option<f64> {
        let around = self.cube(point);
        let reach =
            |axis: usize| around[axis].saturating_sub(1)..=(around[axis] + 1).min(self.counts[axis] - 1);
        let mut near: Vec<(f64, DVec3)> = Vec::with_capacity(32);
        for z in reach(2) {
            for y in reach(1) {
                for x in reach(0) {
                    let cube = &self.cubes[self.flat([x, y, z])];
                    near.extend(
                        cube.iter().map(|&i| (comb.places[i].distance_squared(point), comb.places[i])),
                    );
                }
            }
        }
        let (nearest, owner) = near.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let bisector = |(squared, other): &(f64, DVec3)| {
            let apart = other.distance(owner);
            (apart > 0.0).then(|| 0.5 * (squared - nearest) / apart)
        };
        near.iter().filter_map(bisector).min_by(f64::total_cmp)
    }
}

/// A length in whole cubes.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped at zero; boxes are small"
)]
fn whole(length: f64) -> usize {
    length.max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        projection::Extent,
        surface::{Plane, Wall, WallSide},
    };
    use std::sync::Arc;

    #[test]
    fn cells_are_dark_walls_are_bright_and_nothing_lies_beyond() {
        let wall = Wall { field: Arc::new(Plane { periods: [10.0, 10.0] }), level: 0.0 };
        let extent = Extent { low: DVec3::new(0.0, 0.0, -1.0), high: DVec3::new(4.0, 4.0, 1.0) };
        let caster = Caster::new(wall, WallSide::Lower, extent);
        let places =
            (0..4).flat_map(|i| (0..4).map(move |j| DVec3::new(f64::from(i) + 0.5, f64::from(j) + 0.5, 0.0)));
        let comb = CombOnWall { places: places.collect(), pitch: 1.0 };
        let camera = Camera::top(DVec3::new(2.0, 2.0, 0.0), 20.0, DVec2::splat(100.0));
        let picture = paint(&comb, &caster, &camera, [100, 100], 1);
        let grey = |x: u32, y: u32| picture.get_pixel(x, y).0.iter().map(|b| u32::from(*b)).sum::<u32>() / 3;
        // The comb covers pixels 10 to 90; a cell's middle is at 20, a wall at 30.
        assert!(grey(20, 20) < 70, "{}", grey(20, 20));
        assert!(grey(30, 20) > 130, "{}", grey(30, 20));
        assert!((140..180).contains(&grey(3, 50)), "{}", grey(3, 50));
        assert_eq!(picture, paint(&comb, &caster, &camera, [100, 100], 1));
    }
}
