//! Element shapes: nodes, shape functions, quadrature.

use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// The most nodes of any shape.
pub(crate) const MOST_NODES: usize = 9;

/// The shape of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Shape {
    /// A biquadratic quadrilateral: node `i + 3j` at `(u, v) = (i/2, j/2)`.
    Quad9,
    /// A quadratic triangle: corners at `(0,0), (1,0), (0,1)`, then the middles of the edges 0–1, 1–2, 2–0.
    Tri6,
    /// A flat triangle: corners at `(0,0), (1,0), (0,1)`.
    Tri3,
}

/// Shape functions and their derivatives at one quadrature point, with its weight in the unit square or triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapePoint {
    pub(crate) weight: f64,
    pub(crate) value: [f64; MOST_NODES],
    pub(crate) du: [f64; MOST_NODES],
    pub(crate) dv: [f64; MOST_NODES],
}

/// Shape functions and derivatives along an element's edge, `t` in (0, 1), with the quadrature weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvePoint {
    pub(crate) weight: f64,
    pub(crate) value: [f64; 3],
    pub(crate) dt: [f64; 3],
}

/// Gauss points on (0, 1) and their weights, by Newton steps on the Legendre polynomial.
#[must_use]
pub(crate) fn gauss(count: usize) -> Vec<(f64, f64)> {
    let n = f64::from(crate::index::checked_u32(count));
    (0..count)
        .map(|i| {
            let i = f64::from(crate::index::checked_u32(i));
            let mut x = -(std::f64::consts::PI * (i + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let (value, derivative) = legendre(count, x);
                slope = derivative;
                let step = value / derivative;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// The Legendre polynomial of degree `n` and its derivative.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut here) = (1.0, x);
    for k in 2..=n {
        let k = f64::from(crate::index::checked_u32(k));
        (before, here) = (here, ((2.0 * k - 1.0) * x * here - (k - 1.0) * before) / k);
    }
    if n == 0 {
        return (1.0, 0.0);
    }
    let n = f64::from(crate::index::checked_u32(n));
    (here, n * (x * here - before) / (x * x - 1.0))
}

/// The quadratic Lagrange polynomials on nodes 0, ½, 1 and their derivatives.
#[must_use]
pub(crate) fn quadratic(t: f64) -> ([f64; 3], [f64; 3]) {
    (
        [(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)],
        [4.0 * t - 3.0, 4.0 - 8.0 * t, 4.0 * t - 1.0],
    )
}

/// Quadrature along an edge with `nodes` nodes (2 or 3) at `count` points.
#[must_use]
pub(crate) fn curve_points(nodes: usize, count: usize) -> Vec<CurvePoint> {
    gauss(count)
        .into_iter()
        .map(|(t, weight)| {
            let (value, dt) = if nodes == 3 { quadratic(t) } else { ([1.0 - t, t, 0.0], [-1.0, 1.0, 0.0]) };
            CurvePoint { weight, value, dt }
        })
        .collect()
}

impl Shape {
    /// The number of nodes.
    #[must_use]
    pub fn nodes(self) -> usize {
        match self {
            Self::Quad9 => 9,
            Self::Tri6 => 6,
            Self::Tri3 => 3,
        }
    }

    /// The nodes along each edge, counter-clockwise.
    #[must_use]
    pub fn edges(self) -> &'static [&'static [usize]] {
        match self {
            Self::Quad9 => &[&[0, 1, 2], &[2, 5, 8], &[8, 7, 6], &[6, 3, 0]],
            Self::Tri6 => &[&[0, 3, 1], &[1, 4, 2], &[2, 5, 0]],
            Self::Tri3 => &[&[0, 1], &[1, 2], &[2, 0]],
        }
    }

    /// The pairs of nodes that lie beside each other.
    #[must_use]
    pub(crate) fn pairs(self) -> &'static [[usize; 2]] {
        match self {
            Self::Quad9 => &[
                [0, 1],
                [1, 2],
                [3, 4],
                [4, 5],
                [6, 7],
                [7, 8],
                [0, 3],
                [3, 6],
                [1, 4],
                [4, 7],
                [2, 5],
                [5, 8],
            ],
            Self::Tri6 => &[[0, 3], [3, 1], [1, 4], [4, 2], [2, 5], [5, 0], [3, 4], [4, 5], [5, 3]],
            Self::Tri3 => &[[0, 1], [1, 2], [2, 0]],
        }
    }

    /// Plane triangles between the nodes, counter-clockwise, as pictures show the element.
    #[must_use]
    pub fn triangles(self) -> &'static [[usize; 3]] {
        match self {
            Self::Quad9 => {
                &[[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]]
            }
            Self::Tri6 => &[[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
            Self::Tri3 => &[[0, 1, 2]],
        }
    }

    /// The place `(u, v)` of a node.
    #[must_use]
    pub(crate) fn node_at(self, node: usize) -> (f64, f64) {
        const HALVES: [f64; 3] = [0.0, 0.5, 1.0];
        const TRIANGLE: [(f64, f64); 6] =
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)];
        match self {
            Self::Quad9 => (HALVES[node % 3], HALVES[node / 3]),
            Self::Tri6 | Self::Tri3 => TRIANGLE[node],
        }
    }

    /// Shape functions and derivatives at `(u, v)`, with a quadrature weight.
    #[must_use]
    pub(crate) fn at(self, u: f64, v: f64, weight: f64) -> ShapePoint {
        let mut point =
            ShapePoint { weight, value: [0.0; MOST_NODES], du: [0.0; MOST_NODES], dv: [0.0; MOST_NODES] };
        match self {
            Self::Quad9 => {
                let ((a, da), (b, db)) = (quadratic(u), quadratic(v));
                for j in 0..3 {
                    for i in 0..3 {
                        point.value[i + 3 * j] = a[i] * b[j];
                        point.du[i + 3 * j] = da[i] * b[j];
                        point.dv[i + 3 * j] = a[i] * db[j];
                    }
                }
            }
            Self::Tri6 => {
                let w = 1.0 - u - v;
                point.value[..6].copy_from_slice(&[
                    w * (2.0 * w - 1.0),
                    u * (2.0 * u - 1.0),
                    v * (2.0 * v - 1.0),
                    4.0 * w * u,
                    4.0 * u * v,
                    4.0 * v * w,
                ]);
                let corner = 1.0 - 4.0 * w;
                point.du[..6].copy_from_slice(&[
                    corner,
                    4.0 * u - 1.0,
                    0.0,
                    4.0 * (w - u),
                    4.0 * v,
                    -4.0 * v,
                ]);
                point.dv[..6].copy_from_slice(&[
                    corner,
                    0.0,
                    4.0 * v - 1.0,
                    -4.0 * u,
                    4.0 * u,
                    4.0 * (w - v),
                ]);
            }
            Self::Tri3 => {
                point.value[..3].copy_from_slice(&[1.0 - u - v, u, v]);
                point.du[..3].copy_from_slice(&[-1.0, 1.0, 0.0]);
                point.dv[..3].copy_from_slice(&[-1.0, 0.0, 1.0]);
            }
        }
        point
    }

    /// The quadrature points for energy and volume: 3 × 3 Gauss points integrate a biquadratic film's volume exactly, and
    /// its area to O(h⁶), beyond the O(h⁴) of its shape; triangles take the collapsed rule of the same order.
    #[must_use]
    pub(crate) fn points(self) -> &'static [ShapePoint] {
        static POINTS: LazyLock<[Vec<ShapePoint>; 3]> = LazyLock::new(|| {
            let rule = gauss(3);
            let over = |shape: Shape| {
                let mut points = Vec::with_capacity(9);
                for &(v, wv) in &rule {
                    for &(u, wu) in &rule {
                        points.push(match shape {
                            Shape::Quad9 => shape.at(u, v, wu * wv),
                            _ => shape.at(u * (1.0 - v), v, wu * wv * (1.0 - v)),
                        });
                    }
                }
                points
            };
            let flat = vec![Shape::Tri3.at(1.0 / 3.0, 1.0 / 3.0, 0.5)];
            [over(Shape::Quad9), over(Shape::Tri6), flat]
        });
        &POINTS[match self {
            Self::Quad9 => 0,
            Self::Tri6 => 1,
            Self::Tri3 => 2,
        }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    const SHAPES: [Shape; 3] = [Shape::Quad9, Shape::Tri6, Shape::Tri3];

    #[test]
    fn triangles_between_nodes_cover_the_element_once() {
        for (shape, area) in SHAPES.into_iter().zip([1.0, 0.5, 0.5]) {
            let place = |node: usize| DVec2::from(shape.node_at(node));
            let areas = shape.triangles().iter().map(|corners| {
                let [a, b, c] = corners.map(place);
                0.5 * (b - a).perp_dot(c - a)
            });
            let areas: Vec<f64> = areas.collect();
            assert!(areas.iter().all(|a| *a > 0.0), "{shape:?}: {areas:?}");
            // The areas are dyadic fractions: nothing is rounded.
            assert!((areas.iter().sum::<f64>() - area).abs() < 1e-15, "{shape:?}");
        }
    }

    #[test]
    fn gauss_points_integrate_polynomials_of_twice_their_number() {
        for count in 1..=12 {
            let rule = gauss(count);
            for power in 0..i32::try_from(2 * count).unwrap() {
                let sum: f64 = rule.iter().map(|&(x, w)| w * x.powi(power)).sum();
                assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-14, "{count} points, x^{power}");
            }
        }
    }

    #[test]
    fn shape_functions_sum_to_one_and_their_derivatives_to_zero() {
        for shape in SHAPES {
            for point in shape.points() {
                assert!((point.value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                assert!(point.du.iter().sum::<f64>().abs() < 1e-14);
                assert!(point.dv.iter().sum::<f64>().abs() < 1e-14);
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_values() {
        let step = 1e-6;
        for shape in SHAPES {
            let (u, v) = (0.3, 0.45);
            let here = shape.at(u, v, 1.0);
            let (east, west) = (shape.at(u + step, v, 1.0), shape.at(u - step, v, 1.0));
            let (north, south) = (shape.at(u, v + step, 1.0), shape.at(u, v - step, 1.0));
            for i in 0..shape.nodes() {
                // Central differences of a quadratic are exact up to rounding over the step.
                let du = (east.value[i] - west.value[i]) / (2.0 * step);
                let dv = (north.value[i] - south.value[i]) / (2.0 * step);
                assert!((here.du[i] - du).abs() < 1e-9 && (here.dv[i] - dv).abs() < 1e-9, "{shape:?} {i}");
            }
        }
    }
}
