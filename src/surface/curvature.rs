//! Curvature of a level set from the derivatives of its function.

use glam::{DMat3, DVec3};

/// The curvature of a surface at a point, for the normal `n = ∇Φ/|∇Φ|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curvature {
    /// `H = (κ₁ + κ₂)/2 = ½ div n`, in 1/length: `+1/r` on a sphere whose `Φ` grows outward.
    pub mean: f64,
    /// `K = κ₁ κ₂`, in 1/length².
    pub gauss: f64,
}

impl Curvature {
    /// From gradient and Hessian (Goldman 2005, eqs. 4.1 and 4.2, with the sign of `H` chosen as above).
    #[must_use]
    pub fn of_level_set(gradient: DVec3, hessian: &DMat3) -> Self {
        let slope2 = gradient.length_squared();
        let trace = hessian.x_axis.x + hessian.y_axis.y + hessian.z_axis.z;
        let mean = (slope2 * trace - gradient.dot(*hessian * gradient)) / (2.0 * slope2 * slope2.sqrt());
        let gauss = gradient.dot(adjugate(hessian) * gradient) / (slope2 * slope2);
        Self { mean, gauss }
    }

    /// The principal curvatures, the smaller first.
    #[must_use]
    pub fn principal(self) -> [f64; 2] {
        // Rounding can take the discriminant of an umbilic point below zero.
        let root = (self.mean * self.mean - self.gauss).max(0.0).sqrt();
        [self.mean - root, self.mean + root]
    }

    /// The larger of |κ₁| and |κ₂|.
    #[must_use]
    pub fn largest(self) -> f64 {
        let [low, high] = self.principal();
        low.abs().max(high.abs())
    }
}

/// The adjugate of a symmetric matrix: its columns are cross products of the other two.
fn adjugate(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_adjugate_times_the_matrix_is_the_determinant() {
        let m = DMat3::from_cols(
            DVec3::new(2.0, -1.0, 0.5),
            DVec3::new(-1.0, 3.0, 0.25),
            DVec3::new(0.5, 0.25, -1.5),
        );
        let product = adjugate(&m) * m;
        assert!(product.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(m.determinant())), 1e-13));
    }
}
