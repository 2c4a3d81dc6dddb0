//! Integrals along one edge: lengths, scalars, vectors, and the gap between a chord and a convex wall.

use super::field::VectorField;
use crate::{
    evolver::language::formula::Bound,
    foam::{
        complex::{CurvePoint, curve_points},
        energy::{Blocks, outer},
    },
};
use glam::{DMat3, DVec3};

/// What is integrated along edges.
#[derive(Clone, Debug)]
pub(super) enum EdgeField {
    /// 1: the length.
    Length,
    /// A scalar.
    Scalar(Bound),
    /// A vector's component along the edge.
    Along(VectorField),
}

/// Gauss points along straight edges and bent ones: as many as Surface Evolver takes, so that energies agree on one mesh.
pub(super) const STRAIGHT_POINTS: usize = 2;
pub(super) const BENT_POINTS: usize = 4;

/// Gauss points where contents are to be those of the wall itself: below that the rule's error shows beside the slivers.
pub(super) const FINE_POINTS: usize = 6;

/// The rule for edges of `nodes` nodes at `points` points.
pub(super) fn rule(nodes: usize, points: usize) -> Vec<CurvePoint> {
    curve_points(nodes, points)
}

/// Place and tangent at a point.
fn place(point: &CurvePoint, nodes: &[DVec3]) -> (DVec3, DVec3) {
    let (mut x, mut t) = (DVec3::ZERO, DVec3::ZERO);
    for (i, &node) in nodes.iter().enumerate() {
        x += point.value[i] * node;
        t += point.dt[i] * node;
    }
    (x, t)
}

impl EdgeField {
    /// The integral.
    pub(super) fn value(&self, rule: &[CurvePoint], nodes: &[DVec3]) -> f64 {
        if let (Self::Length, [a, b]) = (self, nodes) {
            return a.distance(*b);
        }
        rule.iter()
            .map(|point| {
                let (x, t) = place(point, nodes);
                point.weight
                    * match self {
                        Self::Length => t.length(),
                        Self::Scalar(bound) => bound.value(x) * t.length(),
                        Self::Along(field) => field.value(x).dot(t),
                    }
            })
            .sum()
    }

    /// Adds `factor` times the gradient, and the Hessian where it is asked for.
    pub(super) fn add(
        &self,
        factor: f64,
        rule: &[CurvePoint],
        nodes: &[DVec3],
        gradient: &mut [DVec3],
        mut hessian: Option<&mut Blocks>,
    ) {
        for point in rule {
            let (x, t) = place(point, nodes);
            let (first, second) = self.parts(x, t);
            let weight = factor * point.weight;
            for (i, out) in gradient.iter_mut().enumerate().take(nodes.len()) {
                *out += weight * (point.value[i] * first[0] + point.dt[i] * first[1]);
            }
            let Some(hessian) = hessian.as_deref_mut() else { continue };
            let [xx, xt, tt] = second;
            let tx = xt.transpose();
            for j in 0..nodes.len() {
                let (n, d) = (weight * point.value[j], weight * point.dt[j]);
                let (by_x, by_t) = (n * xx + d * xt, n * tx + d * tt);
                for i in 0..nodes.len() {
                    hessian.add(i, j, point.value[i] * by_x + point.dt[i] * by_t);
                }
            }
        }
    }

    /// Derivatives of the integrand by place and tangent: `[x, t]` and `[xx, xt, tt]`.
    fn parts(&self, x: DVec3, t: DVec3) -> ([DVec3; 2], [DMat3; 3]) {
        let length = t.length();
        let unit = t / length;
        let flat = (1.0 / length) * (DMat3::IDENTITY - outer(unit, unit));
        match self {
            Self::Length => ([DVec3::ZERO, unit], [DMat3::ZERO, DMat3::ZERO, flat]),
            Self::Scalar(bound) => {
                let f = bound.jet(x);
                (
                    [length * f.gradient, f.value * unit],
                    [length * f.hessian, outer(f.gradient, unit), f.value * flat],
                )
            }
            Self::Along(field) => {
                let jet = field.jet(x);
                let turned = jet.jacobian.transpose();
                ([turned * t, jet.value], [jet.bend(t).unwrap_or(DMat3::ZERO), turned, DMat3::ZERO])
            }
        }
    }
}

/// The energy of the gap between the chord from `nodes[0]` to `nodes[1]` and a convex wall: `Σ |s·n| |s| / 12` over both
/// ends with the chord `s` and the wall's unit normal `n` there.
pub(super) fn gap(wall: &Bound, nodes: &[DVec3]) -> f64 {
    let s = nodes[1] - nodes[0];
    nodes[..2]
        .iter()
        .map(|&end| {
            let gradient = wall.jet(end).gradient;
            s.dot(gradient).abs() * s.length() / (12.0 * gradient.length())
        })
        .sum()
}

/// Adds `factor` times the gradient of [`gap`]. It needs the wall's second derivatives.
pub(super) fn add_gap(factor: f64, wall: &Bound, nodes: &[DVec3], gradient: &mut [DVec3]) {
    let s = nodes[1] - nodes[0];
    let length = s.length();
    for (at, &end) in nodes[..2].iter().enumerate() {
        let jet = wall.jet(end);
        let size = jet.gradient.length();
        let n = jet.gradient / size;
        let along = s.dot(n);
        let sign = along.signum();
        // By the chord, and by the end through the turning normal.
        let by_s = sign * (length * n + along / length * s);
        let turn = jet.hessian * (s - along * n) / size;
        let scale = factor / 12.0;
        gradient[1] += scale * by_s;
        gradient[0] -= scale * by_s;
        gradient[at] += scale * sign * length * turn;
    }
}

/// Adds `factor` times the Hessian of [`gap`], by differences of its gradient.
pub(super) fn add_gap_hessian(factor: f64, wall: &Bound, nodes: &[DVec3], hessian: &mut Blocks) {
    add_differences(nodes, &|nodes, gradient| add_gap(factor, wall, nodes, gradient), hessian);
}

/// The step of differences of exact gradients, as a part of the edge: third derivatives of walls are not at hand, and these
/// are good to 1e-10 of the Hessian.
const STEP: f64 = 1e-5;

/// Adds the Hessian of a function of an edge's nodes, by central differences of its gradient.
pub(super) fn add_differences(
    nodes: &[DVec3],
    add_gradient: &dyn Fn(&[DVec3], &mut [DVec3]),
    hessian: &mut Blocks,
) {
    let count = nodes.len();
    let step = STEP * nodes[0].distance(nodes[count - 1]);
    for column in 0..count {
        let mut blocks = [[DVec3::ZERO; 3]; 3];
        for axis in 0..3 {
            let moved = |sign: f64| {
                let mut moved = [DVec3::ZERO; 3];
                moved[..count].copy_from_slice(nodes);
                moved[column][axis] += sign * step;
                let mut gradient = [DVec3::ZERO; 3];
                add_gradient(&moved[..count], &mut gradient[..count]);
                gradient
            };
            let (up, down) = (moved(1.0), moved(-1.0));
            for (block, (up, down)) in blocks.iter_mut().zip(up.into_iter().zip(down)) {
                block[axis] = (up - down) / (2.0 * step);
            }
        }
        for (row, columns) in blocks.iter().enumerate().take(count) {
            let block = DMat3::from_cols(columns[0], columns[1], columns[2]);
            // Half of each block and of its transpose keep the sum symmetric.
            hessian.add(row, column, 0.5 * block);
            hessian.add(column, row, 0.5 * block.transpose());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::facet::tests::check_derivatives, *};

    #[test]
    fn gradients_and_hessians_are_the_differences_of_the_values() {
        let three = [DVec3::new(0.1, 0.0, 0.3), DVec3::new(0.6, 0.2, 0.1), DVec3::new(1.0, 0.1, 0.2)];
        for (nodes, order) in [(vec![three[0], three[2]], 2), (three.to_vec(), 4)] {
            let rule = rule(nodes.len(), order);
            for field in [
                EdgeField::Length,
                EdgeField::Along(VectorField::PlaneHeight),
                EdgeField::Along(VectorField::PlaneCone),
                EdgeField::Along(VectorField::PlaneHalfSquare),
            ] {
                check_derivatives(
                    &nodes,
                    |n| field.value(&rule, n),
                    |n, g, h| field.add(1.0, &rule, n, g, h),
                );
            }
        }
    }
}
