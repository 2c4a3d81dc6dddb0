//! The ellipse with the second moments of an outline: how obliquely a cell is seen.
//!
//! A regular cell that is seen from above has the moments of a circle; seen obliquely, those of an ellipse whose axes' ratio is the
//! secant of the angle.

use glam::{DMat2, DVec2};

/// An ellipse with a middle; lengths in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ellipse {
    /// The middle.
    pub(crate) centre: DVec2,
    /// The area of what it stands for.
    pub(crate) area: f64,
    /// Squares of the half axes, as a matrix.
    squares: DMat2,
}

/// Squares of the half axes' product below which a shape is a line or a point.
const LEAST_SQUARES: f64 = 1e-3;

impl Ellipse {
    /// From the second moments about the middle over the area: of an ellipse, a quarter of its half axes' squares.
    pub(crate) fn of_moments(centre: DVec2, area: f64, moments: DMat2) -> Self {
        Self { centre, area, squares: moments * 4.0 }
    }

    /// The same elsewhere.
    pub(crate) fn moved(self, by: DVec2) -> Self {
        Self { centre: self.centre + by, ..self }
    }

    /// The ellipse of the same shape whose half axes' product is 1, as the matrix of their squares; `None` of a line.
    pub(crate) fn shape(&self) -> Option<DMat2> {
        unit(self.squares)
    }

    /// Half axes, the longer first.
    pub(crate) fn half_axes(&self) -> [f64; 2] {
        half_axes(self.squares)
    }

    /// Whether a point lies in the ellipse, enlarged by a factor.
    pub(crate) fn holds(&self, point: DVec2, factor: f64) -> bool {
        let off = point - self.centre;
        off == DVec2::ZERO || off.length() <= factor * half_width(self.squares, off.normalize())
    }

    /// Distance of two middles over the sum of the half widths along it: 1 if the ellipses touch there.
    pub(crate) fn apart(&self, other: &Self) -> f64 {
        let off = other.centre - self.centre;
        let along = off.normalize_or(DVec2::X);
        off.length()
            / (half_width(self.squares, along) + half_width(other.squares, along)).max(f64::MIN_POSITIVE)
    }
}

/// The ellipse of the same shape whose half axes' product is 1, all given as the matrix of the half axes' squares; `None` of a line.
pub(crate) fn unit(squares: DMat2) -> Option<DMat2> {
    let determinant = squares.determinant();
    (determinant > LEAST_SQUARES).then(|| squares * determinant.sqrt().recip())
}

/// How much longer than wide an ellipse is, from the matrix of its half axes' squares.
pub(crate) fn narrowness(squares: DMat2) -> f64 {
    let [long, short] = half_axes(squares);
    long / short.max(f64::MIN_POSITIVE)
}

/// Half the width of an ellipse along a direction, from the matrix of its half axes' squares.
pub(crate) fn half_width(squares: DMat2, along: DVec2) -> f64 {
    along.dot(squares.inverse() * along).sqrt().recip()
}

/// What makes circles of the ellipses of a shape and leaves areas as they are; `shape` is the matrix of the half axes' squares, and
/// its determinant is 1.
pub(crate) fn upright(shape: DMat2) -> DMat2 {
    // The square root of a matrix of determinant 1 is (M + 1) / √(tr M + 2).
    let trace = shape.x_axis.x + shape.y_axis.y;
    ((shape + DMat2::IDENTITY) * (trace + 2.0).sqrt().recip()).inverse()
}

fn half_axes(squares: DMat2) -> [f64; 2] {
    let mean = 0.5 * (squares.x_axis.x + squares.y_axis.y);
    let difference = (0.5 * (squares.x_axis.x - squares.y_axis.y)).hypot(squares.x_axis.y);
    [mean + difference, mean - difference].map(|square| square.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle that is turned away by an angle about an axis, and what undoes it.
    #[test]
    fn a_circle_seen_obliquely_is_made_a_circle_again() {
        for (turn, narrow) in [(0.3, 1.0), (0.3, 1.4), (1.2, 2.5), (2.9, 4.0_f64)] {
            let axes = DMat2::from_angle(turn);
            let squares =
                axes * DMat2::from_diagonal(DVec2::new(9.0, 9.0 / (narrow * narrow))) * axes.transpose();
            let ellipse = Ellipse::of_moments(DVec2::new(5.0, 7.0), 1.0, squares * 0.25);
            let [long, short] = ellipse.half_axes();
            assert!((long - 3.0).abs() < 1e-12 && (short - 3.0 / narrow).abs() < 1e-12, "{long} {short}");
            assert!((half_width(squares, axes.x_axis) - 3.0).abs() < 1e-12);
            assert!((half_width(squares, axes.y_axis) - 3.0 / narrow).abs() < 1e-12);
            let shape = ellipse.shape().unwrap_or(DMat2::ZERO);
            assert!((narrowness(shape) - narrow).abs() < 1e-12);
            let undo = upright(shape);
            assert!((undo.determinant() - 1.0).abs() < 1e-12);
            assert!((undo * shape * undo.transpose()).abs_diff_eq(DMat2::IDENTITY, 1e-12));
            let end = ellipse.centre + 3.0 * axes.x_axis;
            assert!(ellipse.holds(end, 1.0 + 1e-9) && !ellipse.holds(end, 1.0 - 1e-9));
        }
    }
}
