//! Where a point of the comb is in the picture: tilt in perspective, and a gentle curvature.

use super::RenderSettings;
use glam::{DMat3, DVec2, DVec3};

/// Distance of the camera in widths of the picture.
const DISTANCE: f64 = 2.5;
/// Height of the comb's bulge, in pitches per degree of tilt.
const BULGE: f64 = 0.012;

/// A camera before the comb. Lengths on the comb are in pitches, with the origin at the middle of the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    from_picture: DMat3,
    to_picture: DMat3,
    bulge: f64,
    wave: f64,
}

impl Camera {
    pub(super) fn new(settings: &RenderSettings) -> Self {
        let size = DVec2::new(f64::from(settings.width), f64::from(settings.height));
        let far = DISTANCE * size.max_element();
        let tilt = settings.difficulty.tilt.to_radians();
        let (sin, cos) = tilt.sin_cos();
        // A point (u, v) of the comb, in pixels, is at (u cos τ, v, far + u sin τ); the picture divides by depth / far.
        let tilted = DMat3::from_cols(DVec3::new(cos, 0.0, sin / far), DVec3::Y, DVec3::Z);
        let centred =
            DMat3::from_translation(size / 2.0) * tilted * DMat3::from_scale(DVec2::splat(settings.pitch));
        Self {
            from_picture: centred.inverse(),
            to_picture: centred,
            bulge: BULGE * settings.difficulty.tilt,
            wave: std::f64::consts::TAU / (1.3 * size.max_element() / settings.pitch),
        }
    }

    /// The point of the comb that a point of the picture shows.
    pub(super) fn on_comb(&self, pixel: DVec2) -> DVec2 {
        let p = self.from_picture * pixel.extend(1.0);
        let flat = DVec2::new(p.x, p.y) / p.z;
        flat + self.bent(flat)
    }

    /// Where a point of the comb appears. The bend is undone by fixed-point steps; it is far smaller than its period.
    pub(super) fn in_picture(&self, point: DVec2) -> DVec2 {
        let mut flat = point;
        for _ in 0..20 {
            flat = point - self.bent(flat);
        }
        let p = self.to_picture * flat.extend(1.0);
        DVec2::new(p.x, p.y) / p.z
    }

    fn bent(&self, flat: DVec2) -> DVec2 {
        self.bulge * DVec2::new((self.wave * flat.y).sin(), (self.wave * flat.x).cos())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comb::synthetic::{Difficulty, Style};

    #[test]
    fn picture_and_comb_are_inverse() {
        let settings = RenderSettings {
            width: 800,
            height: 600,
            pitch: 40.0,
            style: Style::Wax,
            difficulty: Difficulty::dial(1.0),
            torn_edge: false,
            seed: 1,
        };
        let camera = Camera::new(&settings);
        for (x, y) in [(0.0, 0.0), (400.0, 300.0), (799.0, 12.0), (33.0, 590.0)] {
            let pixel = DVec2::new(x, y);
            let back = camera.in_picture(camera.on_comb(pixel));
            assert!(back.distance(pixel) < 1e-6, "{pixel} came back as {back}");
        }
    }
}
