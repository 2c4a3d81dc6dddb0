//! The volume between an edge and the wall that its ends lie on.
//!
//! A content integral taken along the chord of a contact line instead of along the wall is wrong by the flux through the sliver
//! between the two, `∫ (F + ∇×ω)·dS` with the films' field `F` (whose divergence is 1) and the integrand `ω`, for which
//! `∇×ω = −F` along the wall's normal. Near the place where `ω` vanishes the two fields cancel; away from it a zig-zag of the
//! contact line gains volume that no body holds, and the least energy is that of a collapsed bubble. With the sliver added a
//! body is closed by the wall itself, and its volume does not depend on the choice of `ω`.
//!
//! The wall is reached from the edge along directions `d(t)` between its unit normals at the nodes: `y = x + z d`, `f(y) = 0`.
//! Slivers of neighbouring edges close without a seam, as their directions belong to the nodes.

use super::{
    edge::{add_differences, rule},
    field::VectorField,
};
use crate::{
    evolver::language::formula::Bound,
    foam::{
        complex::CurvePoint,
        energy::{Blocks, outer},
    },
};
use glam::{DMat3, DVec3};
use std::sync::LazyLock;

/// Gauss points along an edge: the height over it is smooth and vanishes at the nodes.
const ALONG: usize = 4;
/// Gauss points across a sliver, which is thin: exact to the third order in its height.
const ACROSS: usize = 2;
/// Steps of the search for the wall, and the last one as a part of the edge: Newton's method from within a sagitta settles in
/// five.
const STEPS: usize = 20;
const SETTLED: f64 = 1e-9;

static CURVES: LazyLock<[Vec<CurvePoint>; 2]> = LazyLock::new(|| [rule(2, ALONG), rule(3, ALONG)]);
static RULE: LazyLock<Vec<CurvePoint>> = LazyLock::new(|| rule(2, ACROSS));

/// The fields whose flux through the sliver between an edge and its wall counts.
#[derive(Clone, Debug)]
pub(super) struct Sliver {
    pub(super) wall: Bound,
    /// The integrand `ω` of the content.
    pub(super) content: VectorField,
    /// The films' field `F`.
    pub(super) film: VectorField,
}

/// The wall over one point of an edge.
struct Foot<'a> {
    curve: &'a CurvePoint,
    x: DVec3,
    along: DVec3,
    d: DVec3,
    turn: DVec3,
    z: f64,
    /// The wall's gradient at the foot.
    slope: DVec3,
}

impl Foot<'_> {
    /// The place at `s` of the way to the wall, and the sliver's tangent there.
    fn at(&self, s: f64) -> (DVec3, DVec3) {
        (self.x + s * self.z * self.d, self.along + s * self.z * self.turn)
    }
}

impl Sliver {
    /// The unit normal of the wall and its derivative.
    fn normal(&self, p: DVec3) -> (DVec3, DMat3) {
        let jet = self.wall.jet(p);
        let size = jet.gradient.length();
        let n = jet.gradient / size;
        (n, (DMat3::IDENTITY - outer(n, n)) * jet.hessian * (1.0 / size))
    }

    /// The wall over each point of the edge; heights are no numbers where the wall is not found.
    fn feet<'a>(&'a self, nodes: &'a [DVec3], normals: &'a [DVec3]) -> impl Iterator<Item = Foot<'a>> {
        CURVES[nodes.len() - 2].iter().map(move |curve| {
            let sum = |by: &[f64; 3], of: &[DVec3]| of.iter().zip(by).map(|(v, w)| *w * *v).sum::<DVec3>();
            let (x, along) = (sum(&curve.value, nodes), sum(&curve.dt, nodes));
            let (d, turn) = (sum(&curve.value, normals), sum(&curve.dt, normals));
            let (mut z, mut slope, mut step) = (0.0, DVec3::NAN, f64::NAN);
            for _ in 0..STEPS {
                let jet = self.wall.jet(x + z * d);
                slope = jet.gradient;
                step = jet.value / slope.dot(d);
                z -= step;
                // The last step of a quadratic search: what is left is its square, or rounding.
                if step.abs() <= SETTLED * along.length() || step.is_nan() {
                    break;
                }
            }
            if step.is_nan() || step.abs() > SETTLED * along.length() {
                z = f64::NAN;
            }
            Foot { curve, x, along, d, turn, z, slope }
        })
    }

    /// `F + ∇×ω`.
    fn field(&self, q: DVec3) -> DVec3 {
        let rows = self.content.jet(q).jacobian.transpose();
        self.film.value(q) + curl([rows.x_axis, rows.y_axis, rows.z_axis])
    }

    /// The volume that the chord leaves out, for a film that runs along the edge; and the area of the sliver.
    pub(super) fn value(&self, nodes: &[DVec3]) -> [f64; 2] {
        let mut normals = [DVec3::ZERO; 3];
        normals.iter_mut().zip(nodes).for_each(|(n, &p)| *n = self.normal(p).0);
        let mut sums = [0.0; 2];
        for foot in self.feet(nodes, &normals[..nodes.len()]) {
            for across in RULE.iter() {
                let (q, tangent) = foot.at(across.value[1]);
                let area = (foot.z * foot.d).cross(tangent);
                let weight = foot.curve.weight * across.weight;
                sums[0] += weight * self.field(q).dot(area);
                sums[1] += weight * area.length();
            }
        }
        sums
    }

    /// Adds `factor` times the gradient of the volume, and the Hessian where it is asked for.
    pub(super) fn add(
        &self,
        factor: f64,
        nodes: &[DVec3],
        gradient: &mut [DVec3],
        hessian: Option<&mut Blocks>,
    ) {
        self.add_gradient(factor, nodes, gradient);
        if let Some(hessian) = hessian {
            let gradient = |nodes: &[DVec3], out: &mut [DVec3]| self.add_gradient(factor, nodes, out);
            add_differences(nodes, &gradient, hessian);
        }
    }

    fn add_gradient(&self, factor: f64, nodes: &[DVec3], gradient: &mut [DVec3]) {
        let (mut normals, mut turns) = ([DVec3::ZERO; 3], [DMat3::ZERO; 3]);
        for (at, &node) in nodes.iter().enumerate() {
            (normals[at], turns[at]) = self.normal(node);
        }
        for foot in self.feet(nodes, &normals[..nodes.len()]) {
            let Foot { curve, d, turn, z, slope, .. } = foot;
            let (mut by_x, mut by_along, mut by_d, mut by_turn, mut by_z) =
                (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0);
            for across in RULE.iter() {
                let (s, weight) = (across.value[1], factor * curve.weight * across.weight);
                let (q, m) = foot.at(s);
                let (w, u) = self.pulled(q, (z * d).cross(m));
                by_x += weight * u;
                by_z += weight * (s * u.dot(d) + w.dot(d.cross(m)) + s * z * w.dot(d.cross(turn)));
                by_d += weight * z * (s * u + m.cross(w));
                by_along += weight * z * w.cross(d);
                by_turn += weight * s * z * z * w.cross(d);
            }
            // The height follows the edge: ∇f·(dx + z dd + d dz) = 0.
            let follows = by_z / slope.dot(d) * slope;
            by_x -= follows;
            by_d -= z * follows;
            for (at, out) in gradient.iter_mut().enumerate().take(nodes.len()) {
                let (n, t) = (curve.value[at], curve.dt[at]);
                *out += n * by_x + t * by_along + turns[at].transpose() * (n * by_d + t * by_turn);
            }
        }
    }

    /// The field at `q`, and the gradient there of its product with a constant `area`.
    fn pulled(&self, q: DVec3, area: DVec3) -> (DVec3, DVec3) {
        let film = self.film.jet(q);
        let content = self.content.jet(q);
        let rows = content.jacobian.transpose();
        let value = film.value + curl([rows.x_axis, rows.y_axis, rows.z_axis]);
        let mut slope = film.jacobian.transpose() * area;
        if let Some([first, second, third]) = content.second {
            slope += area.x * (third.y_axis - second.z_axis)
                + area.y * (first.z_axis - third.x_axis)
                + area.z * (second.x_axis - first.y_axis);
        }
        (value, slope)
    }
}

/// `∇×ω` from the gradients of the components.
fn curl([first, second, third]: [DVec3; 3]) -> DVec3 {
    DVec3::new(third.y - second.z, first.z - third.x, second.x - first.y)
}

#[cfg(test)]
mod tests {
    use super::{super::facet::tests::check_derivatives, *};
    use crate::evolver::{Document, source::Source};

    /// A sliver at the wall of a datafile with one constraint.
    fn sliver(lines: &str) -> Sliver {
        let text = format!("constraint 1\n{lines}\nvertices\n1 0 0 0\n");
        let document = Document::new(&Source::new("wall.fe", text)).unwrap();
        let data = &document.data;
        let constraint = data.constraints.first().unwrap();
        let bind = |formula: &Option<crate::evolver::language::formula::Formula>| {
            formula.as_ref().map_or(Bound::constant(0.0), |formula| formula.bind(&data.variables))
        };
        let content = constraint.content.as_ref().unwrap().each_ref().map(bind);
        Sliver {
            wall: constraint.formula.bind(&data.variables),
            content: VectorField::Formula(Box::new(content)),
            film: VectorField::Height,
        }
    }

    const SPHERE: &str = "formula: x^2 + y^2 + z^2 = 4\ncontent:\nc1: (4 + 2*z + z^2)*y/(2+z)/3\nc2: -(4 + 2*z + z^2)*x/(2+z)/3\nc3: 0";

    fn on(angle: f64, height: f64) -> DVec3 {
        let ring = (4.0 - height * height).sqrt();
        DVec3::new(ring * angle.cos(), ring * angle.sin(), height)
    }

    #[test]
    fn gradients_and_hessians_are_the_differences_of_the_values() {
        let sliver = sliver(SPHERE);
        for nodes in [vec![on(0.3, -0.2), on(0.7, 0.1)], vec![on(0.3, -0.2), on(0.45, 0.0), on(0.7, 0.1)]] {
            check_derivatives(&nodes, |n| sliver.value(n)[0], |n, g, h| sliver.add(1.0, n, g, h));
        }
    }

    #[test]
    fn what_a_ring_of_chords_holds_does_not_depend_on_the_gauge() {
        // The integrand that vanishes at the other pole counts the rest of the ball instead, 4π 2³/3 in all. Along chords alone
        // the two differ from that by a tenth and more.
        let below = SPHERE.replace("4 + 2*z", "4 - 2*z").replace("z^2)*", "z^2)*(-1)*").replace("2+z", "2-z");
        assert_ne!(below, SPHERE);
        let ball = 32.0 * std::f64::consts::PI / 3.0;
        let corner = |at: u32| {
            let angle = std::f64::consts::TAU * f64::from(at) / 12.0;
            on(angle, 0.3 + 0.2 * angle.sin() - 0.1 * f64::from(at % 2))
        };
        let held = |lines: &str, slivers: bool| -> f64 {
            let sliver = sliver(lines);
            let along = super::super::edge::EdgeField::Along(sliver.content.clone());
            let share = |at: u32| {
                let nodes = [corner(at), corner((at + 1) % 12)];
                let more = if slivers { sliver.value(&nodes)[0] } else { 0.0 };
                along.value(&rule(2, 8), &nodes) + more
            };
            (0..12).map(share).sum()
        };
        let apart = |slivers: bool| (held(&below, slivers) - held(SPHERE, slivers)).abs() - ball;
        // Two points across a sliver of a tenth of the radius err by its fourth power.
        assert!(apart(true).abs() < 1e-4 * ball, "{}", apart(true));
        assert!(apart(false).abs() > 1e-2 * ball, "{}", apart(false));
    }
}
