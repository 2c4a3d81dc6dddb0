//! Shaded triangles in a picture.
//!
//! A depth buffer with the surface's colour and normal at each sample; light, contact shadows and outlines are added when
//! the picture is finished, then samples are averaged.

use crate::report::palette::Colour;
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use rayon::prelude::*;

/// Samples along each side of a pixel.
const SAMPLES: u32 = 2;

/// From where a scene is seen: parallel projection.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    right: DVec3,
    up: DVec3,
    back: DVec3,
    centre: DVec3,
    half_height: f64,
}

impl Camera {
    /// Looks along `-towards_eye` at `centre`; `half_height` of the scene fits above and below it. `up` need not be at right
    /// angles to the view.
    #[must_use]
    pub fn new(centre: DVec3, towards_eye: DVec3, up: DVec3, half_height: f64) -> Self {
        let back = towards_eye.normalize();
        let right = up.cross(back).normalize();
        Self { right, up: back.cross(right), back, centre, half_height }
    }

    /// As [`Camera::new`], with the size chosen so that all `points` are in view of a picture of this aspect (width over
    /// height), with a margin.
    pub fn fit(points: impl Iterator<Item = DVec3>, towards_eye: DVec3, up: DVec3, aspect: f64) -> Self {
        let mut camera = Self::new(DVec3::ZERO, towards_eye, up, 1.0);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let q = DVec3::new(p.dot(camera.right), p.dot(camera.up), p.dot(camera.back));
            (low, high) = (low.min(q), high.max(q));
        }
        let middle = 0.5 * (low + high);
        camera.centre = middle.x * camera.right + middle.y * camera.up + middle.z * camera.back;
        let half = 0.5 * (high - low);
        camera.half_height = 1.04 * half.y.max(half.x / aspect).max(f64::MIN_POSITIVE);
        camera
    }
}

/// One corner of a triangle to be drawn.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Where it is.
    pub position: DVec3,
    /// The surface's normal there; either side may face the eye.
    pub normal: DVec3,
}

#[derive(Clone, Copy)]
struct Sample {
    depth: f32,
    normal: [f32; 3],
    colour: [u8; 3],
}

const EMPTY: Sample = Sample { depth: f32::NEG_INFINITY, normal: [0.0; 3], colour: [255; 3] };

/// A picture under construction.
#[derive(Debug)]
pub struct Canvas {
    width: u32,
    height: u32,
    camera: Camera,
    samples: Vec<Sample>,
}

impl std::fmt::Debug for Sample {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.depth)
    }
}

impl Canvas {
    /// A white picture of `width` × `height` pixels.
    #[must_use]
    pub fn new(width: u32, height: u32, camera: Camera) -> Self {
        let count = (width * SAMPLES) as usize * (height * SAMPLES) as usize;
        Self { width, height, camera, samples: vec![EMPTY; count] }
    }

    /// Draws a flat triangle.
    pub fn flat(&mut self, corners: [DVec3; 3], colour: Colour) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        self.triangle(corners.map(|position| Corner { position, normal }), colour, 1.0);
    }

    /// Draws a triangle with normals at its corners; `opacity` below 1 leaves out a part of the samples.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the picture; depth and normals need no more than f32"
    )]
    pub fn triangle(&mut self, corners: [Corner; 3], colour: Colour, opacity: f64) {
        let [columns, rows] = [self.width * SAMPLES, self.height * SAMPLES];
        let [a, b, c] = corners.map(|corner| self.to_screen(corner.position));
        let doubled = (b.0 - a.0).perp_dot(c.0 - a.0);
        if doubled.abs() < 1e-12 {
            return;
        }
        let low = a.0.min(b.0).min(c.0).max(DVec2::ZERO);
        let high = a.0.max(b.0).max(c.0).min(DVec2::new(f64::from(columns), f64::from(rows)) - 1.0);
        if high.x < low.x - 1.0 || high.y < low.y - 1.0 {
            return;
        }
        for row in low.y.ceil() as u32..=high.y.max(0.0).floor() as u32 {
            for column in low.x.ceil() as u32..=high.x.max(0.0).floor() as u32 {
                let p = DVec2::new(f64::from(column), f64::from(row));
                let u = (b.0 - p).perp_dot(c.0 - p) / doubled;
                let v = (c.0 - p).perp_dot(a.0 - p) / doubled;
                let w = 1.0 - u - v;
                if u < 0.0 || v < 0.0 || w < 0.0 || hidden_by_screen(column, row, opacity) {
                    continue;
                }
                let depth = (u * a.1 + v * b.1 + w * c.1) as f32;
                let sample = &mut self.samples[row as usize * columns as usize + column as usize];
                if depth > sample.depth {
                    let normal = u * corners[0].normal + v * corners[1].normal + w * corners[2].normal;
                    *sample = Sample { depth, normal: normal.as_vec3().to_array(), colour: colour.0 };
                }
            }
        }
    }

    /// Screen place in samples, y down, and depth towards the eye.
    fn to_screen(&self, p: DVec3) -> (DVec2, f64) {
        let d = p - self.camera.centre;
        let scale = f64::from(self.height * SAMPLES) / (2.0 * self.camera.half_height);
        let x = f64::from(self.width * SAMPLES) / 2.0 + scale * d.dot(self.camera.right);
        let y = f64::from(self.height * SAMPLES) / 2.0 - scale * d.dot(self.camera.up);
        (DVec2::new(x, y), d.dot(self.camera.back))
    }

    /// Where a point of the scene lies in the finished picture, in pixels from the upper left corner.
    #[must_use]
    pub fn pixel_of(&self, p: DVec3) -> DVec2 {
        self.to_screen(p).0 / f64::from(SAMPLES)
    }

    /// Whether the point `p` can be seen: nothing drawn so far lies before it by more than `slack`.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked against the picture"
    )]
    pub fn sees(&self, p: DVec3, slack: f64) -> bool {
        let (at, depth) = self.to_screen(p);
        let inside = at.x >= 0.0
            && at.y >= 0.0
            && at.x < f64::from(self.width * SAMPLES)
            && at.y < f64::from(self.height * SAMPLES);
        let index = at.y as usize * (self.width * SAMPLES) as usize + at.x as usize;
        inside && f64::from(self.samples[index].depth) <= depth + slack
    }

    /// Lights the samples and averages them to the picture.
    #[must_use]
    pub fn finish(&self) -> RgbImage {
        let columns = (self.width * SAMPLES) as usize;
        let ring = self.ring();
        let lit: Vec<[f32; 3]> = (0..self.samples.len())
            .into_par_iter()
            .map(|index| self.light(index % columns, index / columns, &ring))
            .collect();
        let mut picture = RgbImage::new(self.width, self.height);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the byte range"
        )]
        for (x, y, pixel) in picture.enumerate_pixels_mut() {
            let mut sum = [0.0_f32; 3];
            for dy in 0..SAMPLES {
                for dx in 0..SAMPLES {
                    let index = (y * SAMPLES + dy) as usize * columns + (x * SAMPLES + dx) as usize;
                    for (total, part) in sum.iter_mut().zip(lit[index]) {
                        *total += part;
                    }
                }
            }
            let count = 4.0;
            *pixel = Rgb(sum.map(|total| (total / count).round().clamp(0.0, 255.0) as u8));
        }
        picture
    }

    /// Places round a sample at which to look for what hides the sky: two rings.
    #[expect(clippy::cast_possible_truncation, reason = "a few dozen samples wide")]
    fn ring(&self) -> Vec<(isize, isize)> {
        let widest = f64::from((self.height * SAMPLES / 60).max(3));
        (0..24_i32)
            .map(|step| {
                let angle = f64::from(step) * std::f64::consts::TAU / 12.0;
                let radius = if step < 12 { 0.35 * widest } else { widest };
                ((radius * angle.cos()) as isize, (radius * angle.sin()) as isize)
            })
            .collect()
    }

    /// The colour of one sample in light: a key light over the left shoulder, the sky's light from above, less of it in
    /// corners, and a dark line where the surface ends.
    fn light(&self, column: usize, row: usize, ring: &[(isize, isize)]) -> [f32; 3] {
        let sample = self.samples[row * (self.width * SAMPLES) as usize + column];
        if sample.depth == f32::NEG_INFINITY {
            return [255.0; 3];
        }
        let mut normal = DVec3::from_array(sample.normal.map(f64::from)).normalize_or_zero();
        if normal.dot(self.camera.back) < 0.0 {
            normal = -normal;
        }
        let key = (self.camera.back + 0.6 * self.camera.up - 0.7 * self.camera.right).normalize();
        let diffuse = normal.dot(key).max(0.0);
        let sky = 0.5 + 0.5 * normal.dot(self.camera.up);
        let (open, edge) = self.surroundings(column, row, sample.depth, ring);
        let gloss = normal.dot((key + self.camera.back).normalize()).max(0.0).powi(40);
        #[expect(clippy::cast_possible_truncation, reason = "colours need no more than f32")]
        let (light, shine) =
            ((open * (0.34 + 0.2 * sky + 0.56 * diffuse) * edge) as f32, (18.0 * gloss * open * edge) as f32);
        sample.colour.map(|c| f32::from(c) * light + shine)
    }

    /// How open the sample lies (1 in the open, less in corners) and whether it stands at an outline (below 1).
    #[expect(
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        clippy::cast_possible_truncation,
        reason = "places in a picture, clamped to it"
    )]
    fn surroundings(&self, column: usize, row: usize, depth: f32, ring: &[(isize, isize)]) -> (f64, f64) {
        let [columns, rows] = [(self.width * SAMPLES) as isize, (self.height * SAMPLES) as isize];
        let at = |dx: isize, dy: isize| {
            let x = (column as isize + dx).clamp(0, columns - 1);
            let y = (row as isize + dy).clamp(0, rows - 1);
            self.samples[(y * columns + x) as usize].depth
        };
        let reach = 0.05 * self.camera.half_height as f32;
        let hidden: f32 = ring
            .iter()
            .map(|&(dx, dy)| at(dx, dy) - depth)
            .filter(|&above| above > 0.1 * reach && above < 4.0 * reach)
            .map(|above| (above / reach).min(1.0) / ring.len() as f32)
            .sum();
        let step = 0.3 * reach;
        let outline = [(2, 0), (-2, 0), (0, 2), (0, -2)].into_iter().any(|(dx, dy)| {
            let there = at(dx, dy);
            there == f32::NEG_INFINITY || depth - there > step + 4.0 * (depth - at(-dx, -dy)).abs()
        });
        (1.0 - 0.75 * f64::from(hidden), if outline { 0.45 } else { 1.0 })
    }
}

/// An ordered screen: of each 8 × 8 samples a part `opacity` shows.
fn hidden_by_screen(column: u32, row: u32, opacity: f64) -> bool {
    if opacity >= 1.0 {
        return false;
    }
    // The bits of x and of x xor y, interleaved and reversed, order the 64 places of a Bayer screen.
    let (x, y) = (column & 7, (column ^ row) & 7);
    let place = (0..3)
        .fold(0, |sum, bit| sum | (((y >> bit) & 1) << (5 - 2 * bit)) | (((x >> bit) & 1) << (4 - 2 * bit)));
    (f64::from(place) + 0.5) / 64.0 >= opacity
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::palette::{BLUE, ORANGE};

    fn square(z: f64, size: f64) -> [[DVec3; 3]; 2] {
        let p = |x: f64, y: f64| DVec3::new(size * x, size * y, z);
        [[p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]]
    }

    fn more_blue(pixel: &Rgb<u8>) -> bool {
        pixel.0[2] > pixel.0[0]
    }

    #[test]
    fn the_nearer_surface_hides_the_farther_whatever_the_order() {
        let camera = Camera::new(DVec3::ZERO, DVec3::Z, DVec3::Y, 1.0);
        for order in [[0, 1], [1, 0]] {
            let mut canvas = Canvas::new(20, 20, camera);
            for which in order {
                let (z, size, colour) = [(0.0, 0.9, ORANGE), (0.5, 0.4, BLUE)][which];
                for corners in square(z, size) {
                    canvas.flat(corners, colour);
                }
            }
            let picture = canvas.finish();
            assert!(more_blue(picture.get_pixel(10, 10)), "the nearer one is blue");
            assert!(!more_blue(picture.get_pixel(3, 10)), "the farther one is orange");
            assert_eq!(picture.get_pixel(0, 0), &Rgb([255; 3]), "the corner is empty");
        }
    }

    #[test]
    fn half_opacity_shows_half_of_the_samples() {
        let shown = (0..64).filter(|i| !hidden_by_screen(i % 8, i / 8, 0.5)).count();
        assert_eq!(shown, 32);
    }
}
