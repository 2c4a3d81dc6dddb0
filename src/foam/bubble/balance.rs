//! The constraint that holds a bubble at a place.
//!
//! With `y = x − o` from the place `o` on the middle surface and a tangent `t` there, the bubble is centred along `t` if
//! `M = ¼ ∫ (y·t) (y·N) du dv` over its film vanishes: the first moment of the cone from `o` over the film. On a thin round
//! bubble that is its centre; it is a polynomial of the nodes' places, so Newton sees it exactly. The multiplier of `M` is
//! a pressure that grows linearly along `t`, as under a weight: that is the force which holds the bubble.

use super::Chart;
use crate::foam::{
    complex::{Shape, ShapePoint},
    energy::{Blocks, cross_matrix, jet, outer},
};
use glam::{DMat3, DVec3};

/// Adds `factor` times the gradient of `M`, and of its Hessian, for an element with nodes at `y`. Gives `M`.
pub(super) fn add_moment(
    shape: Shape,
    y: &[DVec3],
    tangent: DVec3,
    factor: f64,
    gradient: &mut [DVec3],
    mut hessian: Option<&mut Blocks>,
) -> f64 {
    let mut moment = 0.0;
    for point in shape.points() {
        let (x, a, b) = jet(point, y);
        let normal = a.cross(b);
        let along = x.dot(tangent);
        moment += 0.25 * point.weight * along * x.dot(normal);
        let scale = 0.25 * factor * point.weight;
        let (by_a, by_b) = (b.cross(x), x.cross(a));
        let by_x = x.dot(normal) * tangent + along * normal;
        for (node, sum) in gradient.iter_mut().enumerate().take(y.len()) {
            let (n, u, v) = (point.value[node], point.du[node], point.dv[node]);
            *sum += scale * (n * by_x + along * (u * by_a + v * by_b));
        }
        if let Some(hessian) = hessian.as_deref_mut() {
            let second = Second {
                xx: scale * (outer(tangent, normal) + outer(normal, tangent)),
                ax: scale * (outer(by_a, tangent) + along * cross_matrix(b)),
                bx: scale * (outer(by_b, tangent) - along * cross_matrix(a)),
                ab: -scale * along * cross_matrix(x),
            };
            second.scatter(point, y.len(), hessian);
        }
    }
    moment
}

/// Second derivatives by place and tangents at one point.
struct Second {
    xx: DMat3,
    ax: DMat3,
    bx: DMat3,
    ab: DMat3,
}

impl Second {
    fn scatter(&self, point: &ShapePoint, count: usize, hessian: &mut Blocks) {
        let (xa, xb, ba) = (self.ax.transpose(), self.bx.transpose(), self.ab.transpose());
        for column in 0..count {
            let (n, u, v) = (point.value[column], point.du[column], point.dv[column]);
            let by_x = n * self.xx + u * xa + v * xb;
            let by_a = n * self.ax + v * self.ab;
            let by_b = n * self.bx + u * ba;
            for row in 0..count {
                let block = point.value[row] * by_x + point.du[row] * by_a + point.dv[row] * by_b;
                hessian.add(row, column, block);
            }
        }
    }
}

/// How the two moments of an element change when the place moves by a unit along each tangent: `d[moment][tangent]`. The
/// frame turns with the surface, so the moment along the normal comes in by the surface's bend.
pub(super) fn by_place(shape: Shape, y: &[DVec3], chart: &Chart<'_>) -> [[f64; 2]; 2] {
    let axes = chart.axes();
    let mut slopes = [[0.0; 2]; 2];
    for point in shape.points() {
        let (x, a, b) = jet(point, y);
        let normal = a.cross(b);
        let lifted = x.dot(chart.normal()) * x.dot(normal);
        for (row, t) in slopes.iter_mut().zip(axes) {
            for (slope, e) in row.iter_mut().zip(axes) {
                let moved = e.dot(t) * x.dot(normal) + x.dot(t) * e.dot(normal);
                *slope -= 0.25 * point.weight * (moved + chart.bend(e, t) * lifted);
            }
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_and_hessian_are_the_differences_of_the_moment() {
        let t = DVec3::new(0.6, -0.3, 0.2);
        let nodes: Vec<DVec3> = (0..9)
            .map(|i| {
                let (u, v) = (f64::from(i % 3), f64::from(i / 3));
                DVec3::new(1.0 + 0.1 * v * u, u - 1.0 + 0.05 * v * v, v - 0.8 + 0.1 * u * u)
            })
            .collect();
        let moment = |nodes: &[DVec3]| add_moment(Shape::Quad9, nodes, t, 0.0, &mut [], None);
        let slope = |nodes: &[DVec3], hessian: Option<&mut Blocks>| {
            let mut gradient = [DVec3::ZERO; 9];
            add_moment(Shape::Quad9, nodes, t, 1.0, &mut gradient, hessian);
            gradient
        };
        let mut hessian = Blocks::zero(9);
        let gradient = slope(&nodes, Some(&mut hessian));
        // The moment is a quartic of order one: central differences err by step² and by rounding over the step.
        let step = 1e-4;
        for column in 0..27 {
            let moved = |sign: f64| {
                let mut nodes = nodes.clone();
                nodes[column / 3][column % 3] += sign * step;
                (moment(&nodes), slope(&nodes, None))
            };
            let ((up, gu), (down, gd)) = (moved(1.0), moved(-1.0));
            let difference = (up - down) / (2.0 * step);
            assert!((gradient[column / 3][column % 3] - difference).abs() < 1e-7, "{column}");
            for row in 0..27 {
                let difference = (gu[row / 3][row % 3] - gd[row / 3][row % 3]) / (2.0 * step);
                assert!((hessian.as_mat()[(row, column)] - difference).abs() < 1e-7, "{row} {column}");
            }
        }
    }
}
