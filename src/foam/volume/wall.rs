//! The strip of a wall between the reference position of a film's edge and its present one.
//!
//! With `y(s,t) = (1−s) e₀(t) + s e(t)` ruled between the two quadratic curves and directions `d(t)` given at the nodes, the
//! wall is `y + z d` with `Φ(y + z d) = level`. The cone over the wall strip is the cone over the ruled strip,
//! `⅓∫(y − o)·(y_s × y_t)`, plus the prism between them, `∫ z d·(y_s × y_t) + ½z² y_s·(d' × d)`. As the directions belong to
//! the nodes, prisms of neighbouring edges close without a seam. Implicit differentiation gives
//! `∂z/∂y = −∇Φ/c` with `c = ∇Φ·d`, and `∂²z/∂y² = −(I + z_y dᵀ) Φ'' (I + d z_yᵀ)/c`.

use super::{
    super::{
        complex::{Complex, CurvePoint, Element, WallId, curve_points},
        energy::{Blocks, cross_matrix, outer},
    },
    Reference,
};
use crate::surface::{Jet, Wall};
use glam::{DMat3, DVec3};
use std::sync::LazyLock;

/// Gauss points along an edge. Four keep the error of the smooth prism far below that of the film's shape.
const ALONG: usize = 4;
/// Gauss points across a strip: the ruled part is quadratic in `s`, and strips are thin.
const ACROSS: usize = 3;

/// Steps of the search for the wall along a direction.
const FOOT_STEPS: usize = 30;

/// A step this short against the wall's radius of curvature is the last: Halley's steps shrink to the third power, and the
/// jet is carried to their end to second order.
const LAST_STEP: f64 = 1e-6;

static CURVES: LazyLock<[Vec<CurvePoint>; 2]> =
    LazyLock::new(|| [curve_points(2, ALONG), curve_points(3, ALONG)]);
static RULE: LazyLock<Vec<CurvePoint>> = LazyLock::new(|| curve_points(2, ACROSS));

/// The height of a wall over `y` along `direction`: `z` with `y + z·direction` on the wall, by Halley's steps; and the jet
/// there. Not numbers if none is found.
pub(super) fn foot(wall: &Wall, y: DVec3, direction: DVec3, guess: f64) -> (f64, Jet) {
    let mut z = guess;
    for _ in 0..FOOT_STEPS {
        let jet = wall.field.jet(y + z * direction);
        let bend = jet.hessian * direction;
        let (value, slope, second) =
            (jet.value - wall.level, jet.gradient.dot(direction), bend.dot(direction));
        let step = -2.0 * value * slope / (2.0 * slope * slope - value * second);
        z += step;
        let columns = [jet.hessian.x_axis, jet.hessian.y_axis, jet.hessian.z_axis];
        let curvature = columns.map(DVec3::length_squared).iter().sum::<f64>().sqrt() * direction.length();
        if step.abs() * curvature <= LAST_STEP * slope.abs() {
            return (z, Jet { value: wall.level, gradient: jet.gradient + step * bend, ..jet });
        }
        if !step.is_finite() {
            break;
        }
    }
    let nothing = Jet { value: f64::NAN, gradient: DVec3::NAN, hessian: DMat3::NAN };
    (f64::NAN, nothing)
}

/// An edge of an element on a wall: reference and present nodes, and the directions at them.
#[derive(Clone, Debug)]
pub(crate) struct WallEdge<'a> {
    wall: &'a Wall,
    /// Two or three nodes.
    count: usize,
    old: [DVec3; 3],
    new: [DVec3; 3],
    directions: [DVec3; 3],
}

/// How a strip enters the Lagrangian: as [`super::super::energy::FilmLoads`], without tension.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StripLoads {
    /// `p_b − p_f`.
    pub(crate) difference: f64,
    /// `(p_b o_b − p_f o_f) / 3`, with origins in the frame of the edge's nodes.
    pub(crate) moment: DVec3,
}

/// The geometry across the strip at one place along the edge.
struct StripRow<'a> {
    curve: &'a CurvePoint,
    old: [DVec3; 2],
    new: [DVec3; 2],
    direction: DVec3,
    /// `d' × d`.
    twist: DVec3,
}

/// What is needed of the geometry at one quadrature point.
struct StripPoint {
    s: f64,
    weight: f64,
    y: DVec3,
    ys: DVec3,
    yt: DVec3,
    /// The height of the wall, and the jet there.
    z: f64,
    jet: Jet,
}

impl StripRow<'_> {
    /// The points from the old edge to the new one; the search for the wall goes on from each to the next.
    fn points<'b>(&'b self, wall: &'b Wall) -> impl Iterator<Item = StripPoint> + 'b {
        let mut height = 0.0;
        RULE.iter().map(move |rule| {
            let s = rule.value[1];
            let at = |part: usize| (1.0 - s) * self.old[part] + s * self.new[part];
            let (z, jet) = foot(wall, at(0), self.direction, height);
            height = z;
            let weight = rule.weight * self.curve.weight;
            StripPoint { s, weight, y: at(0), ys: self.new[0] - self.old[0], yt: at(1), z, jet }
        })
    }
}

impl<'a> WallEdge<'a> {
    /// The `edge` of `element`, whose nodes lie at `nodes`, on `wall`.
    pub(crate) fn new(
        complex: &'a Complex,
        reference: &Reference,
        element: &Element,
        nodes: &[DVec3],
        wall: WallId,
        edge: &[usize],
    ) -> Self {
        let mut strip = Self {
            wall: &complex.walls[wall],
            count: edge.len(),
            old: [DVec3::ZERO; 3],
            new: [DVec3::ZERO; 3],
            directions: [DVec3::ZERO; 3],
        };
        for (slot, &at) in edge.iter().enumerate() {
            let image = element.nodes[at];
            strip.new[slot] = nodes[at];
            strip.old[slot] = complex.place(reference.places(), image);
            strip.directions[slot] = reference.direction(complex, image.node, wall);
        }
        strip
    }

    fn rows(&self) -> impl Iterator<Item = StripRow<'_>> {
        CURVES[self.count - 2].iter().map(move |curve| {
            let along = |nodes: &[DVec3; 3], by: &[f64; 3]| -> DVec3 {
                (0..self.count).map(|i| by[i] * nodes[i]).sum()
            };
            let line = |nodes: &[DVec3; 3]| [along(nodes, &curve.value), along(nodes, &curve.dt)];
            let [direction, turn] = line(&self.directions);
            let twist = turn.cross(direction);
            StripRow { curve, old: line(&self.old), new: line(&self.new), direction, twist }
        })
    }

    /// The cone over the wall strip, from each of two origins.
    pub(crate) fn value(&self, origins: [DVec3; 2]) -> [f64; 2] {
        let mut values = [0.0; 2];
        if self.new == self.old {
            return values;
        }
        for row in self.rows() {
            for point in row.points(self.wall) {
                let (z, area) = (point.z, point.ys.cross(point.yt));
                let prism = z * row.direction.dot(area) + 0.5 * z * z * point.ys.dot(row.twist);
                for (value, origin) in values.iter_mut().zip(origins) {
                    *value += point.weight * ((point.y - origin).dot(area) / 3.0 + prism);
                }
            }
        }
        values
    }

    /// Adds the gradients of `difference · (strip) − moment · (area vector)` at several loads, and the Hessian of the first;
    /// `local` are the rows of the edge's nodes, `base` is where the origin of the loads' frame lies.
    pub(crate) fn add(
        &self,
        loads: &[StripLoads],
        base: DVec3,
        local: &[usize],
        gradients: &mut [&mut [DVec3]],
        mut hessian: Option<&mut Blocks>,
    ) {
        for row in self.rows() {
            let curve = row.curve;
            let mut second = Second { ee: DMat3::ZERO, ef: DMat3::ZERO };
            for point in row.points(self.wall) {
                for (load, gradient) in loads.iter().zip(gradients.iter_mut()) {
                    let [by_e, by_f] = row.first(&point, load, base);
                    for (slot, &row) in local.iter().enumerate() {
                        gradient[row] += curve.value[slot] * by_e + curve.dt[slot] * by_f;
                    }
                }
                if let (Some(_), Some(load)) = (&hessian, loads.first()) {
                    second.add(&row, &point, load, base);
                }
            }
            let Some(hessian) = hessian.as_deref_mut() else { continue };
            for (j, &column) in local.iter().enumerate() {
                let (n, d) = (curve.value[j], curve.dt[j]);
                let by_e = n * second.ee + d * second.ef;
                let by_f = n * second.ef.transpose();
                for (i, &row) in local.iter().enumerate() {
                    hessian.add(row, column, curve.value[i] * by_e + curve.dt[i] * by_f);
                }
            }
        }
    }
}

impl StripRow<'_> {
    /// The weighted derivatives at one point by the new edge's place and tangent there.
    fn first(&self, p: &StripPoint, load: &StripLoads, base: DVec3) -> [DVec3; 2] {
        let (z, third) = (p.z, load.difference / 3.0);
        let zy = -p.jet.gradient / p.jet.gradient.dot(self.direction);
        let area = p.ys.cross(p.yt);
        let through = self.direction.dot(area) + z * self.twist.dot(p.ys);
        let q = third * (p.y - base) - load.moment + load.difference * z * self.direction;
        let by_y = third * area + load.difference * through * zy;
        let by_ys = p.yt.cross(q) + 0.5 * load.difference * z * z * self.twist;
        let by_yt = q.cross(p.ys);
        [p.weight * (p.s * by_y + by_ys), p.weight * p.s * by_yt]
    }
}

/// Second derivatives at one place along the edge, by its place *e* and its tangent *f* there.
struct Second {
    ee: DMat3,
    ef: DMat3,
}

impl Second {
    fn add(&mut self, row: &StripRow<'_>, p: &StripPoint, load: &StripLoads, base: DVec3) {
        let (z, third, direction) = (p.z, load.difference / 3.0, row.direction);
        let c = p.jet.gradient.dot(direction);
        let zy = -p.jet.gradient / c;
        let through = direction.dot(p.ys.cross(p.yt)) + z * row.twist.dot(p.ys);
        let q = third * (p.y - base) - load.moment + load.difference * z * direction;
        let lift = DMat3::IDENTITY + outer(direction, zy);
        let zyy = (-1.0 / c) * (lift.transpose() * p.jet.hessian * lift);
        let twisted = row.twist.dot(p.ys);
        let yy = load.difference * (through * zyy + twisted * outer(zy, zy));
        let flux = third * DMat3::IDENTITY + load.difference * outer(zy, direction);
        let y_ys = load.difference * z * outer(zy, row.twist) - flux * cross_matrix(p.yt);
        let y_yt = flux * cross_matrix(p.ys);
        self.ee += p.weight * (p.s * p.s * yy + p.s * (y_ys + y_ys.transpose()));
        self.ef += p.weight * (p.s * p.s * y_yt - p.s * cross_matrix(q));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SchwarzP, Sphere};
    use std::sync::Arc;

    fn bent_edge(wall: &Wall) -> WallEdge<'_> {
        let on = |p: DVec3| wall.project(p).unwrap();
        let (a, b) = (DVec3::new(0.30, 0.22, 0.21), DVec3::new(0.24, 0.29, 0.20));
        let old = [on(a), on(0.5 * (a + b) + DVec3::new(0.003, 0.0, 0.001)), on(b)];
        let drift = DVec3::new(0.01, 0.012, -0.015);
        let new = [on(old[0] + drift), on(old[1] + 1.3 * drift), on(old[2] + 0.6 * drift)];
        let directions = old.map(|p| wall.field.normal(p));
        WallEdge { wall, count: 3, old, new, directions }
    }

    #[test]
    fn gradient_and_hessian_are_the_differences_of_the_value() {
        let wall = Wall { field: Arc::new(SchwarzP { period: 1.0 }), level: 0.2 };
        let strip = bent_edge(&wall);
        let origins = [DVec3::new(0.2, 0.3, 0.25), DVec3::new(0.31, 0.2, 0.2)];
        let pressures = [1.7, 0.4];
        let loads = StripLoads {
            difference: pressures[0] - pressures[1],
            moment: (pressures[0] * origins[0] - pressures[1] * origins[1]) / 3.0,
        };
        let value = |strip: &WallEdge<'_>| {
            let [back, front] = strip.value(origins);
            pressures[0] * back - pressures[1] * front
        };
        let derivative = |strip: &WallEdge<'_>, hessian: Option<&mut Blocks>| {
            let mut gradient = [DVec3::ZERO; 3];
            strip.add(&[loads], DVec3::ZERO, &[0, 1, 2], &mut [&mut gradient[..]], hessian);
            gradient
        };
        let mut hessian = Blocks::zero(3);
        let gradient = derivative(&strip, Some(&mut hessian));
        let step = 1e-5;
        for column in 0..9 {
            let moved = |sign: f64| {
                let mut other = strip.clone();
                other.new[column / 3][column % 3] += sign * step;
                (value(&other), derivative(&other, None))
            };
            let ((up, gu), (down, gd)) = (moved(1.0), moved(-1.0));
            // Values are about 1e-3 and vary over 0.1: differences are good to 1e-8 of that.
            let slope = (up - down) / (2.0 * step);
            assert!((gradient[column / 3][column % 3] - slope).abs() < 1e-9, "{column}");
            for row in 0..9 {
                let second = (gu[row / 3][row % 3] - gd[row / 3][row % 3]) / (2.0 * step);
                let here = hessian.as_mat()[(row, column)];
                assert!((here - second).abs() < 1e-8, "{row} {column}: {here} {second}");
            }
        }
    }

    #[test]
    fn heights_are_found_along_a_slanted_direction() {
        let wall = Wall { field: Arc::new(Sphere { radius: 2.0 }), level: 0.5 };
        let y = DVec3::new(0.0, 0.3, 2.0);
        let direction = DVec3::new(0.0, 0.1, 1.0);
        let (z, jet) = foot(&wall, y, direction, 0.0);
        let there = wall.field.jet(y + z * direction);
        // The square of the last step's bound, times the gradient of 1.
        assert!((jet.gradient - there.gradient).length() < 2e-12);
        assert!(((y + z * direction).length() - 2.5).abs() < 1e-14);
    }
}
