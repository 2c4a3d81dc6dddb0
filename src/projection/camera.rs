//! A camera without distortion.

use glam::{DMat3, DVec2, DVec3};
use serde::Serialize;

/// A camera. Pixels count from the upper left corner, x to the right and y downward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Camera {
    /// From the world to the camera's axes: right, down, forward.
    pub rotation: DMat3,
    /// Where it stands; for a parallel camera, a point of its picture's plane.
    pub centre: DVec3,
    /// Pixels of one unit at unit distance; for a parallel camera, pixels of one unit.
    pub focal: f64,
    /// Where the optical axis meets the picture, in pixels.
    pub principal: DVec2,
    /// Whether its rays are parallel.
    pub parallel: bool,
}

impl Camera {
    /// A camera at `eye` that looks at `target`; `up` points upward in the picture of `size` pixels.
    #[must_use]
    pub fn looking_at(eye: DVec3, target: DVec3, up: DVec3, focal: f64, size: DVec2) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let down = forward.cross(right);
        let rotation = DMat3::from_cols(right, down, forward).transpose();
        Self { rotation, centre: eye, focal, principal: size / 2.0, parallel: false }
    }

    /// A view straight down from far above: x to the right, y upward in the picture, whose middle shows `target`.
    #[must_use]
    pub fn top(target: DVec3, pixels_per_unit: f64, size: DVec2) -> Self {
        let rotation = DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z).transpose();
        Self { rotation, centre: target, focal: pixels_per_unit, principal: size / 2.0, parallel: true }
    }

    /// Where a point appears; `None` behind the camera.
    #[must_use]
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        let seen = self.rotation * (point - self.centre);
        if self.parallel {
            return Some(self.principal + self.focal * seen.truncate());
        }
        (seen.z > 0.0).then(|| self.principal + self.focal * seen.truncate() / seen.z)
    }

    /// The ray of a pixel: a point and a unit direction. A parallel camera's rays start at the plane through its centre.
    #[must_use]
    pub fn ray(&self, pixel: DVec2) -> (DVec3, DVec3) {
        let back = self.rotation.transpose();
        let at = (pixel - self.principal) / self.focal;
        if self.parallel {
            (self.centre + back * at.extend(0.0), back * DVec3::Z)
        } else {
            (self.centre, (back * at.extend(1.0)).normalize())
        }
    }

    /// The direction from a point towards the camera.
    #[must_use]
    pub fn towards(&self, point: DVec3) -> DVec3 {
        if self.parallel {
            self.rotation.transpose() * DVec3::NEG_Z
        } else {
            (self.centre - point).normalize_or_zero()
        }
    }

    /// What a step of one pixel to the right and one downward at `pixel` is on the plane through `point` with this normal.
    #[must_use]
    pub fn footprint(&self, pixel: DVec2, point: DVec3, normal: DVec3) -> [DVec3; 2] {
        let on_plane = |pixel: DVec2| {
            let (from, along) = self.ray(pixel);
            from + along * ((point - from).dot(normal) / along.dot(normal))
        };
        // Central differences over one pixel.
        [DVec2::X, DVec2::Y].map(|step| on_plane(pixel + 0.5 * step) - on_plane(pixel - 0.5 * step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_the_points_that_they_show() {
        let size = DVec2::new(640.0, 480.0);
        let cameras = [
            Camera::looking_at(DVec3::new(3.0, -4.0, 5.0), DVec3::ZERO, DVec3::Z, 900.0, size),
            Camera::looking_at(DVec3::new(0.0, 0.0, 9.0), DVec3::X, DVec3::Y, 500.0, size),
            Camera::top(DVec3::new(1.0, 2.0, 3.0), 40.0, size),
        ];
        for camera in cameras {
            assert!((camera.rotation.determinant() - 1.0).abs() < 1e-12);
            for point in [DVec3::ZERO, DVec3::new(0.5, -0.7, 0.3)] {
                let Some(pixel) = camera.project(point) else { panic!("behind the camera") };
                let (from, along) = camera.ray(pixel);
                assert!((point - from).reject_from_normalized(along).length() < 1e-12);
            }
        }
        let Some(above) = cameras[2].project(DVec3::new(1.0, 2.5, -7.0)) else { panic!("not seen") };
        assert!(above.distance(DVec2::new(320.0, 220.0)) < 1e-9, "y points upward: {above}");
    }

    #[test]
    fn an_oblique_footprint_is_longer_than_a_square_one() {
        let camera = Camera::looking_at(
            DVec3::new(0.0, 0.0, 10.0),
            DVec3::ZERO,
            DVec3::Y,
            1000.0,
            DVec2::splat(400.0),
        );
        let area = |normal| {
            let [a, b] = camera.footprint(DVec2::splat(200.0), DVec3::ZERO, normal);
            a.cross(b).length()
        };
        assert!((area(DVec3::Z) - 1e-4).abs() < 1e-10);
        let tilted = DVec3::new(3.0_f64.sqrt() / 2.0, 0.0, 0.5);
        assert!((area(tilted) / area(DVec3::Z) - 2.0).abs() < 1e-3);
    }
}
