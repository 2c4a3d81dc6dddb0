//! Integrals over one facet: areas by the foam's elements, fluxes and scalar integrals here.

use super::field::VectorField;
use crate::{
    evolver::language::formula::Bound,
    foam::{
        complex::{Shape, ShapePoint},
        energy::{Blocks, FilmLoads, add_element, cross_matrix, element_area, jet, outer},
    },
};
use glam::{DMat3, DVec3};
use std::sync::LazyLock;

/// What is integrated over facets.
#[derive(Clone, Debug)]
pub(super) enum FacetField {
    /// 1: the area.
    Area,
    /// A scalar.
    Scalar(Bound),
    /// A vector's flux.
    Flux(VectorField),
}

/// Rows of the nodes of a facet in its own blocks.
pub(super) const ROWS: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// Points for integrands of higher order on flat triangles: the collapsed rule of 3 × 3 Gauss points, exact to order 4.
static FINE: LazyLock<Vec<ShapePoint>> = LazyLock::new(|| {
    // The quadratic triangle's own points, with the flat triangle's shape functions.
    Shape::Tri6
        .points()
        .iter()
        .map(|point| {
            // Place in the unit triangle: half of the middles' weights tell u and v.
            let u = point.value[1] + 0.5 * (point.value[3] + point.value[4]);
            let v = point.value[2] + 0.5 * (point.value[4] + point.value[5]);
            Shape::Tri3.at(u, v, point.weight)
        })
        .collect()
});

pub(super) fn shape_of(nodes: usize) -> Shape {
    if nodes == 6 { Shape::Tri6 } else { Shape::Tri3 }
}

impl FacetField {
    fn points(&self, shape: Shape) -> &'static [ShapePoint] {
        let flat = match self {
            Self::Area => true,
            Self::Flux(field) => field.is_linear(),
            Self::Scalar(_) => false,
        };
        if shape == Shape::Tri3 && !flat { &FINE } else { shape.points() }
    }

    /// The integral.
    pub(super) fn value(&self, nodes: &[DVec3]) -> f64 {
        let shape = shape_of(nodes.len());
        match self {
            Self::Area => element_area(shape, nodes),
            Self::Flux(VectorField::Height) if shape == Shape::Tri3 => {
                let n = 0.5 * (nodes[1] - nodes[0]).cross(nodes[2] - nodes[0]).z;
                n * (nodes[0].z + nodes[1].z + nodes[2].z) / 3.0
            }
            Self::Flux(field) => self
                .points(shape)
                .iter()
                .map(|point| {
                    let (x, a, b) = jet(point, nodes);
                    point.weight * field.value(x).dot(a.cross(b))
                })
                .sum(),
            Self::Scalar(bound) => self
                .points(shape)
                .iter()
                .map(|point| {
                    let (x, a, b) = jet(point, nodes);
                    point.weight * bound.value(x) * a.cross(b).length()
                })
                .sum(),
        }
    }

    /// Adds `factor` times the gradient, and the blocks on and below the diagonal of the Hessian where it is asked for.
    pub(super) fn add(
        &self,
        factor: f64,
        nodes: &[DVec3],
        gradient: &mut [DVec3],
        mut hessian: Option<&mut Blocks>,
    ) {
        match (self, nodes) {
            (Self::Area, &[a, b, c]) => return add_flat_area(factor, [a, b, c], gradient, hessian),
            (Self::Flux(VectorField::Height), &[a, b, c]) => {
                return add_flat_height(factor, [a, b, c], gradient, hessian);
            }
            _ => {}
        }
        let shape = shape_of(nodes.len());
        let count = nodes.len();
        if let Self::Area = self {
            let loads = FilmLoads { tension: factor, difference: 0.0, moment: DVec3::ZERO };
            add_element(shape, nodes, &ROWS[..count], &[loads], &mut [gradient], hessian);
            return;
        }
        for point in self.points(shape) {
            let (x, a, b) = jet(point, nodes);
            let parts = match self {
                Self::Flux(field) => Parts::flux(field, x, a, b, hessian.is_some()),
                Self::Scalar(bound) => Parts::scalar(bound, x, a, b, hessian.is_some()),
                Self::Area => continue,
            };
            let weight = factor * point.weight;
            for (i, out) in gradient.iter_mut().enumerate().take(count) {
                *out += weight
                    * (point.value[i] * parts.first[0]
                        + point.du[i] * parts.first[1]
                        + point.dv[i] * parts.first[2]);
            }
            if let (Some(hessian), Some(second)) = (hessian.as_deref_mut(), &parts.second) {
                scatter(point, weight, count, second, hessian);
            }
        }
    }
}

/// Adds the derivatives of the area of a flat triangle, `|n|/2` with `n` the product of two sides:
/// `∂|n|/∂xᵢ = sᵢ × u` with `sᵢ` the side opposite to a corner and `u = n/|n|`.
fn add_flat_area(factor: f64, nodes: [DVec3; 3], gradient: &mut [DVec3], hessian: Option<&mut Blocks>) {
    let [a, b, c] = nodes;
    let n = (b - a).cross(c - a);
    let length = n.length();
    let unit = n / length;
    let sides = [c - b, a - c, b - a];
    let half = 0.5 * factor;
    for (out, side) in gradient.iter_mut().zip(sides) {
        *out += half * unit.cross(side);
    }
    let Some(hessian) = hessian else { return };
    let flat = (half / length) * (DMat3::IDENTITY - outer(unit, unit));
    // By corner, ∂n/∂xᵢ = [sᵢ]ₓ up to sign; the product of two sides bends n itself between different corners.
    let turns = sides.map(cross_matrix);
    let bend = half * cross_matrix(unit);
    for i in 0..3 {
        let left = turns[i].transpose() * flat;
        for (j, turn) in turns.iter().enumerate().take(i + 1) {
            let both = left * *turn;
            hessian.add(
                i,
                j,
                match (3 + j - i) % 3 {
                    0 => both,
                    1 => both - bend,
                    _ => both + bend,
                },
            );
        }
    }
}

/// Adds the derivatives of the volume below a flat triangle, `n_z z̄/2` with the mean height `z̄`.
fn add_flat_height(factor: f64, nodes: [DVec3; 3], gradient: &mut [DVec3], hessian: Option<&mut Blocks>) {
    let mean = (nodes[0].z + nodes[1].z + nodes[2].z) / 3.0;
    let [a, b, c] = nodes;
    // ∂n_z/∂xᵢ: the opposite side, turned in the plane.
    let slopes = [c - b, a - c, b - a].map(|side| DVec3::new(-side.y, side.x, 0.0));
    let n = (b - a).cross(c - a).z;
    for (out, slope) in gradient.iter_mut().zip(slopes) {
        *out += factor * (0.5 * mean * slope + n / 6.0 * DVec3::Z);
    }
    let Some(hessian) = hessian else { return };
    let (sixth, turn) = (factor / 6.0, 0.5 * factor * mean);
    for i in 0..3 {
        for j in 0..=i {
            // ∂²n_z/∂xᵢ∂yⱼ is 1 for the next corner and −1 for the one before.
            let sign = match (3 + j - i) % 3 {
                0 => 0.0,
                1 => turn,
                _ => -turn,
            };
            let x = DVec3::new(0.0, -sign, sixth * slopes[j].x);
            let y = DVec3::new(sign, 0.0, sixth * slopes[j].y);
            let z = sixth * slopes[i];
            hessian.add(i, j, DMat3::from_cols(x, y, z));
        }
    }
}

/// Derivatives of an integrand by place and tangents: `[x, a, b]`, and `[xx, xa, xb, aa, ab, bb]`.
struct Parts {
    first: [DVec3; 3],
    second: Option<[DMat3; 6]>,
}

impl Parts {
    fn flux(field: &VectorField, x: DVec3, a: DVec3, b: DVec3, second: bool) -> Self {
        let n = a.cross(b);
        let jet = field.jet(x);
        let turned = jet.jacobian.transpose();
        let first = [turned * n, b.cross(jet.value), jet.value.cross(a)];
        let second = second.then(|| {
            let (na, nb) = (-cross_matrix(b), cross_matrix(a));
            [
                jet.bend(n).unwrap_or(DMat3::ZERO),
                turned * na,
                turned * nb,
                DMat3::ZERO,
                -cross_matrix(jet.value),
                DMat3::ZERO,
            ]
        });
        Self { first, second }
    }

    fn scalar(bound: &Bound, x: DVec3, a: DVec3, b: DVec3, second: bool) -> Self {
        let n = a.cross(b);
        let length = n.length();
        let unit = n / length;
        let f = bound.jet(x);
        let (by_a, by_b) = (b.cross(unit), unit.cross(a));
        let first = [length * f.gradient, f.value * by_a, f.value * by_b];
        let second = second.then(|| {
            let (na, nb) = (-cross_matrix(b), cross_matrix(a));
            let flat = (f.value / length) * (DMat3::IDENTITY - outer(unit, unit));
            let (ta, tb) = (na.transpose() * flat, nb.transpose() * flat);
            [
                length * f.hessian,
                outer(f.gradient, by_a),
                outer(f.gradient, by_b),
                ta * na,
                ta * nb - f.value * cross_matrix(unit),
                tb * nb,
            ]
        });
        Self { first, second }
    }
}

fn scatter(point: &ShapePoint, weight: f64, count: usize, second: &[DMat3; 6], hessian: &mut Blocks) {
    let [xx, xa, xb, aa, ab, bb] = second;
    let (ax, bx, ba) = (xa.transpose(), xb.transpose(), ab.transpose());
    for j in 0..count {
        let (n, u, v) = (weight * point.value[j], weight * point.du[j], weight * point.dv[j]);
        let by_x = n * *xx + u * *xa + v * *xb;
        let by_a = n * ax + u * *aa + v * *ab;
        let by_b = n * bx + u * ba + v * *bb;
        for i in 0..count {
            hessian.add(i, j, point.value[i] * by_x + point.du[i] * by_a + point.dv[i] * by_b);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Compares gradient and Hessian with central differences of the value, good to step² and rounding over the step.
    pub(in super::super) fn check_derivatives(
        nodes: &[DVec3],
        value: impl Fn(&[DVec3]) -> f64,
        add: impl Fn(&[DVec3], &mut [DVec3], Option<&mut Blocks>),
    ) {
        let count = nodes.len();
        let mut gradient = vec![DVec3::ZERO; count];
        let mut hessian = Blocks::zero(count);
        add(nodes, &mut gradient, Some(&mut hessian));
        let step = 1e-5;
        for column in 0..3 * count {
            let moved = |sign: f64| {
                let mut nodes = nodes.to_vec();
                nodes[column / 3][column % 3] += sign * step;
                let mut g = vec![DVec3::ZERO; count];
                add(&nodes, &mut g, None);
                (value(&nodes), g)
            };
            let ((up, gu), (down, gd)) = (moved(1.0), moved(-1.0));
            let slope = (up - down) / (2.0 * step);
            let here = gradient[column / 3][column % 3];
            assert!((here - slope).abs() < 1e-8, "column {column}: {here} {slope}");
            for row in 0..3 * count {
                let second = (gu[row / 3][row % 3] - gd[row / 3][row % 3]) / (2.0 * step);
                let (i, j) = (row.max(column), row.min(column));
                let here = hessian.as_mat()[(i, j)];
                assert!((here - second).abs() < 1e-7, "{row} {column}: {here} {second}");
            }
        }
    }

    #[test]
    fn gradients_and_hessians_are_the_differences_of_the_values() {
        let six = [
            DVec3::new(0.1, 0.0, 0.3),
            DVec3::new(1.1, 0.2, 0.1),
            DVec3::new(0.0, 1.2, 0.2),
            DVec3::new(0.6, 0.05, 0.25),
            DVec3::new(0.5, 0.8, 0.2),
            DVec3::new(0.1, 0.6, 0.4),
        ];
        for nodes in [&six[..3], &six[..]] {
            for field in [
                FacetField::Area,
                FacetField::Flux(VectorField::Height),
                FacetField::Flux(VectorField::Cone),
                FacetField::Flux(VectorField::HalfSquare),
            ] {
                check_derivatives(nodes, |n| field.value(n), |n, g, h| field.add(1.0, n, g, h));
            }
        }
    }
}
