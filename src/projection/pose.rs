//! The camera's pose from marked points: least squares in pixels from many starts.
//!
//! Four points give eight equations for three angles, three coordinates and the focal length. The sum of squares has several
//! minima, so that Levenberg–Marquardt steps start from 48 directions; the lowest minimum is taken, and a second one nearly as
//! low is told.

use super::camera::Camera;
use faer::{Mat, linalg::solvers::Solve};
use glam::{DMat3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// A point of the enclosure that was found in the photograph.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// In the photograph, to the right, in pixels.
    pub x_px: f64,
    /// In the photograph, downward, in pixels.
    pub y_px: f64,
    /// On the enclosure.
    pub x_mm: f64,
    /// On the enclosure.
    pub y_mm: f64,
    /// On the enclosure.
    pub z_mm: f64,
}

impl Mark {
    fn pixel(&self) -> DVec2 {
        DVec2::new(self.x_px, self.y_px)
    }

    fn point(&self) -> DVec3 {
        DVec3::new(self.x_mm, self.y_mm, self.z_mm)
    }
}

/// A camera's pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pose {
    /// The camera.
    pub camera: Camera,
    /// The root mean square of the marks' distances from where the camera sees them, in pixels.
    pub error_px: f64,
    /// That of the next best pose, if it turns by more than 5° and its error is no more than three times as large or a pixel:
    /// the marks do not tell the two apart, and one more would.
    pub rival_error_px: Option<f64>,
}

/// Why there is no pose.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PoseError {
    /// Too few marks.
    #[error("a camera's pose needs at least four marked points, not {0}")]
    TooFew(usize),
    /// Marks that are no numbers.
    #[error("mark {0} is not finite: each needs x_px, y_px, x_mm, y_mm and z_mm")]
    NotFinite(usize),
    /// Marks on a line or in one place.
    #[error(
        "the marked points lie on a line, or on each other: mark points that span an area, on the enclosure and in the photograph"
    )]
    Degenerate,
    /// No start leads anywhere.
    #[error("no camera sees the marked points where they were marked: check their order and units")]
    NoPose,
}

/// Focal lengths to start from, over the larger side of the picture: a telephoto, a normal and a wide lens.
const FOCAL_STARTS: [f64; 3] = [3.0, 1.2, 0.7];

/// Steps from each start; most settle after a dozen.
const STEPS: usize = 60;

/// Finds the camera that sees the marks where they were marked, in a photograph of `size` pixels. The focal length, in pixels,
/// is found too unless given.
///
/// # Errors
/// [`PoseError`].
pub fn pose(marks: &[Mark], size: DVec2, focal: Option<f64>) -> Result<Pose, PoseError> {
    check(marks)?;
    let task = Task { marks, principal: size / 2.0, focal };
    let starts: Vec<f64> = match focal {
        Some(focal) => vec![focal],
        None => FOCAL_STARTS.map(|f| f * size.max_element()).to_vec(),
    };
    let mut found: Vec<(f64, Camera)> = Vec::new();
    for turn in turns() {
        for &focal in &starts {
            let ended = task.descend(task.start(turn, focal));
            found.extend(ended.filter(|(error, _)| error.is_finite()));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (error_px, camera) = found.first().copied().ok_or(PoseError::NoPose)?;
    // A picture's tenth: no camera at all.
    if error_px > 0.1 * size.max_element() {
        return Err(PoseError::NoPose);
    }
    let apart = |other: &Camera| {
        DQuat::from_mat3(&(other.rotation * camera.rotation.transpose())).to_axis_angle().1.abs()
            > 5.0_f64.to_radians()
    };
    let rival = found.iter().find(|(_, other)| apart(other)).map(|(error, _)| *error);
    Ok(Pose { camera, error_px, rival_error_px: rival.filter(|e| *e < (3.0 * error_px).max(1.0)) })
}

fn check(marks: &[Mark]) -> Result<(), PoseError> {
    if marks.len() < 4 {
        return Err(PoseError::TooFew(marks.len()));
    }
    if let Some(at) = marks.iter().position(|m| !(m.pixel().is_finite() && m.point().is_finite())) {
        return Err(PoseError::NotFinite(at + 1));
    }
    let flat = |place: &dyn Fn(&Mark) -> DVec3| {
        let origin = place(&marks[0]);
        let steps: Vec<DVec3> = marks.iter().map(|m| place(m) - origin).collect();
        let longest = steps.iter().map(|s| s.length()).fold(0.0, f64::max);
        let pairs = steps.iter().flat_map(|a| steps.iter().map(|b| a.cross(*b).length()));
        pairs.fold(0.0, f64::max) <= 1e-3 * longest * longest
    };
    if flat(&|mark| mark.point()) || flat(&|mark| mark.pixel().extend(0.0)) {
        return Err(PoseError::Degenerate);
    }
    Ok(())
}

/// Directions that cover all rotations: those of a cube, and the same turned by 45° about x and z.
fn turns() -> impl Iterator<Item = DMat3> {
    let faces = [
        DQuat::IDENTITY,
        DQuat::from_rotation_x(FRAC_PI_2),
        DQuat::from_rotation_x(2.0 * FRAC_PI_2),
        DQuat::from_rotation_x(-FRAC_PI_2),
        DQuat::from_rotation_y(FRAC_PI_2),
        DQuat::from_rotation_y(-FRAC_PI_2),
    ];
    let twist = DQuat::from_rotation_z(FRAC_PI_4) * DQuat::from_rotation_x(FRAC_PI_4);
    [DQuat::IDENTITY, twist].into_iter().flat_map(move |start| {
        faces.into_iter().flat_map(move |face| {
            (0..4).map(move |quarter| {
                DMat3::from_quat(DQuat::from_rotation_z(f64::from(quarter) * FRAC_PI_2) * face * start)
            })
        })
    })
}

struct Task<'a> {
    marks: &'a [Mark],
    principal: DVec2,
    focal: Option<f64>,
}

impl Task<'_> {
    /// A camera of this direction that sees the marks' middle in the right place and at about the right size.
    fn start(&self, rotation: DMat3, focal: f64) -> Camera {
        let count = self.marks.len() as f64;
        let middle = self.marks.iter().map(Mark::point).sum::<DVec3>() / count;
        let seen = self.marks.iter().map(Mark::pixel).sum::<DVec2>() / count;
        let spread = |distances: f64| (distances / count).sqrt();
        let real = spread(self.marks.iter().map(|m| m.point().distance_squared(middle)).sum());
        let pixels = spread(self.marks.iter().map(|m| m.pixel().distance_squared(seen)).sum());
        let depth = focal * real / pixels;
        let at = ((seen - self.principal) / focal).extend(1.0) * depth;
        let centre = middle - rotation.transpose() * at;
        Camera { rotation, centre, focal, principal: self.principal, parallel: false }
    }

    /// Distances in pixels along x and y of each mark; infinite behind the camera.
    fn residuals(&self, camera: &Camera) -> Vec<f64> {
        let one = |mark: &Mark| {
            let seen = camera.project(mark.point()).unwrap_or(DVec2::INFINITY) - mark.pixel();
            [seen.x, seen.y]
        };
        self.marks.iter().flat_map(one).collect()
    }

    /// Levenberg–Marquardt steps; the error in pixels and the camera.
    fn descend(&self, start: Camera) -> Option<(f64, Camera)> {
        let squares = |residuals: &[f64]| residuals.iter().map(|r| r * r).sum::<f64>();
        let mut camera = start;
        let mut residuals = self.residuals(&camera);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let error = squares(&residuals);
            if !error.is_finite() {
                return None;
            }
            let jacobian = self.jacobian(&camera, &residuals);
            let step = normal_step(&jacobian, &residuals, damping);
            let moved = self.moved(&camera, &step);
            let after = self.residuals(&moved);
            if squares(&after) < error {
                let settled = error - squares(&after) < 1e-14 * error;
                (camera, residuals) = (moved, after);
                damping = (damping * 0.3).max(1e-12);
                if settled {
                    break;
                }
            } else {
                damping *= 4.0;
                if damping > 1e12 {
                    break;
                }
            }
        }
        Some(((squares(&residuals) / self.marks.len() as f64).sqrt(), camera))
    }

    /// Unknowns: a turn about the marks' depth, a shift, both relative to the camera's distance, and the logarithm of the focal
    /// length.
    fn moved(&self, camera: &Camera, step: &[f64]) -> Camera {
        let turn = DVec3::new(step[0], step[1], step[2]);
        let middle = self.marks.iter().map(Mark::point).sum::<DVec3>() / self.marks.len() as f64;
        let seen = camera.rotation * (middle - camera.centre);
        let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turn)) * camera.rotation;
        let shifted = seen + seen.z.abs() * DVec3::new(step[3], step[4], step[5]);
        let focal = camera.focal * step.get(6).map_or(1.0, |s| s.clamp(-1.0, 1.0).exp());
        Camera { rotation, centre: middle - rotation.transpose() * shifted, focal, ..*camera }
    }

    /// Derivatives of the residuals by forward differences: one column for each unknown.
    fn jacobian(&self, camera: &Camera, residuals: &[f64]) -> Vec<Vec<f64>> {
        let unknowns = if self.focal.is_some() { 6 } else { 7 };
        let tiny = 1e-6;
        let column = |unknown: usize| {
            let mut step = vec![0.0; unknowns];
            step[unknown] = tiny;
            let moved = self.residuals(&self.moved(camera, &step));
            moved.iter().zip(residuals).map(|(after, before)| (after - before) / tiny).collect()
        };
        (0..unknowns).map(column).collect()
    }
}

/// −(JᵀJ + λ diag JᵀJ)⁻¹ Jᵀ r.
fn normal_step(jacobian: &[Vec<f64>], residuals: &[f64], damping: f64) -> Vec<f64> {
    let count = jacobian.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let matrix = Mat::from_fn(count, count, |row, column| {
        let product = dot(&jacobian[row], &jacobian[column]);
        if row == column { product * (1.0 + damping) + 1e-12 } else { product }
    });
    let right = Mat::from_fn(count, 1, |row, _| -dot(&jacobian[row], residuals));
    let solution = matrix.partial_piv_lu().solve(&right);
    (0..count).map(|row| solution[(row, 0)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: DVec2 = DVec2::new(4000.0, 3000.0);

    fn camera() -> Camera {
        Camera::looking_at(
            DVec3::new(300.0, -420.0, 510.0),
            DVec3::new(90.0, 110.0, 40.0),
            DVec3::Z,
            4200.0,
            SIZE,
        )
    }

    fn marks(points: &[DVec3], noise: f64) -> Vec<Mark> {
        let mark = |(i, p): (usize, &DVec3)| {
            let seen = camera().project(*p).unwrap_or(DVec2::NAN);
            let off = noise * DVec2::from_angle(2.4 * i as f64);
            Mark { x_px: seen.x + off.x, y_px: seen.y + off.y, x_mm: p.x, y_mm: p.y, z_mm: p.z }
        };
        points.iter().enumerate().map(mark).collect()
    }

    fn corners() -> [DVec3; 6] {
        [
            [0.0, 0.0, 0.0],
            [200.0, 0.0, 0.0],
            [200.0, 200.0, 0.0],
            [0.0, 200.0, 0.0],
            [100.0, 100.0, 100.0],
            [100.0, 0.0, 60.0],
        ]
        .map(DVec3::from_array)
    }

    #[test]
    fn exact_marks_give_the_camera_back() -> Result<(), PoseError> {
        for count in [4, 5, 6] {
            let found = pose(&marks(&corners()[..count], 0.0), SIZE, None)?;
            assert!(found.error_px < 1e-6, "{count} marks: {} px", found.error_px);
            assert!(
                found.camera.centre.distance(camera().centre) < 1e-2,
                "{count} marks: {}",
                found.camera.centre
            );
            assert!((found.camera.focal / 4200.0 - 1.0).abs() < 1e-4);
        }
        let fixed = pose(&marks(&corners()[..4], 0.0), SIZE, Some(4200.0))?;
        assert!(fixed.camera.centre.distance(camera().centre) < 1e-3);
        Ok(())
    }

    #[test]
    fn marks_off_by_a_pixel_put_points_of_the_wall_off_by_little() -> Result<(), PoseError> {
        let found = pose(&marks(&corners(), 1.0), SIZE, None)?;
        assert!(found.error_px < 1.1);
        assert_eq!(found.rival_error_px, None);
        // A pixel is 0.15 mm here: rays through a point between the marks pass it within a few of these.
        let point = DVec3::new(80.0, 120.0, 50.0);
        let (from, along) = found.camera.ray(camera().project(point).unwrap_or_default());
        assert!((point - from).reject_from_normalized(along).length() < 0.5);
        Ok(())
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        let some = marks(&corners(), 0.0);
        assert_eq!(pose(&some[..3], SIZE, None), Err(PoseError::TooFew(3)));
        let line: Vec<DVec3> = (0..5).map(|i| DVec3::new(20.0 * f64::from(i), 0.0, 0.0)).collect();
        assert_eq!(pose(&marks(&line, 0.0), SIZE, None), Err(PoseError::Degenerate));
        let mut wrong = some.clone();
        wrong[2].z_mm = f64::NAN;
        assert_eq!(pose(&wrong, SIZE, None), Err(PoseError::NotFinite(3)));
    }
}
