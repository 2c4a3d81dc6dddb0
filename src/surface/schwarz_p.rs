//! The nodal Schwarz P-surface.

use super::{GridSampler, Jet, LevelSet, NoFoot, Period, nearest, rows::Separable};
use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// `Φ = cos(2πx/L) + cos(2πy/L) + cos(2πz/L)`, the nodal approximation of Schwarz's primitive surface with period `L`.
///
/// Close to a minimal surface, but not one: on `Φ = 0` the mean curvature reaches 1.28/L. `Φ` is largest, 3, at the lattice
/// points, so the normal points towards them. Planes `x = 0` and `x = L/2` (and so for y, z) are mirrors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchwarzP {
    /// The period `L`.
    pub period: f64,
}

/// Steps of a projection: three settle from any place within a tenth of a period of the level.
const PROJECTION_STEPS: usize = 6;

/// The longest step, as a phase, at which the second-order model is trusted.
const LONGEST_PHASE: f64 = 0.5;

/// A step this long, as a phase, leaves at most 3 h³/6 of the value: less than its rounding.
const LAST_PHASE: f64 = 5e-6;

impl LevelSet for SchwarzP {
    fn name(&self) -> &'static str {
        "schwarz-p"
    }

    fn value(&self, p: DVec3) -> f64 {
        let k = TAU / self.period;
        (k * p.x).cos() + (k * p.y).cos() + (k * p.z).cos()
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        let k = TAU / self.period;
        -k * DVec3::new((k * p.x).sin(), (k * p.y).sin(), (k * p.z).sin())
    }

    fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let k = TAU / self.period;
        let [x, y, z] = (k * p).to_array().map(f64::sin_cos);
        (x.1 + y.1 + z.1, -k * DVec3::new(x.0, y.0, z.0))
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        let k = TAU / self.period;
        DMat3::from_diagonal(-k * k * DVec3::new((k * p.x).cos(), (k * p.y).cos(), (k * p.z).cos()))
    }

    fn jet(&self, p: DVec3) -> Jet {
        let k = TAU / self.period;
        let [x, y, z] = (k * p).to_array().map(f64::sin_cos);
        Jet {
            value: x.1 + y.1 + z.1,
            gradient: -k * DVec3::new(x.0, y.0, z.0),
            hessian: DMat3::from_diagonal(-k * k * DVec3::new(x.1, y.1, z.1)),
        }
    }

    fn period(&self) -> Period {
        Period::cubic(self.period)
    }

    fn domain(&self) -> (DVec3, DVec3) {
        (DVec3::ZERO, DVec3::splat(self.period))
    }

    fn level_limits(&self) -> (f64, f64) {
        (-1.0, 1.0)
    }

    fn euler_characteristic(&self) -> i32 {
        -4
    }

    fn sampler<'a>(&'a self, axes: [&'a [f64]; 3]) -> Box<dyn GridSampler + 'a> {
        let k = TAU / self.period;
        Box::new(Separable::new(axes.map(|axis| axis.iter().map(|x| (k * x).cos()).collect())))
    }

    /// Steps that solve the second-order model along the gradient, for sines come with their cosines at no cost. What such a
    /// step leaves is known beforehand, so that the last one need not be looked at. Other points are left to the general
    /// search.
    fn project(&self, p: DVec3, level: f64) -> Result<DVec3, NoFoot> {
        let k = TAU / self.period;
        let mut q = p;
        for _ in 0..PROJECTION_STEPS {
            let [x, y, z] = (k * q).to_array().map(f64::sin_cos);
            let residual = x.1 + y.1 + z.1 - level;
            // Gradient and Hessian by the phase kx, so that steps are phases too.
            let slope = -DVec3::new(x.0, y.0, z.0);
            let bend = -DVec3::new(x.1, y.1, z.1).dot(slope * slope);
            let square = slope.length_squared();
            let discriminant = square * square - 2.0 * residual * bend;
            let step = -2.0 * residual / (square + discriminant.max(0.0).sqrt()) * slope;
            let longest = step.abs().max_element();
            if discriminant < 0.0 || longest.is_nan() || longest > LONGEST_PHASE {
                break;
            }
            q += step / k;
            if longest < LAST_PHASE {
                return Ok(q);
            }
        }
        nearest::project(self, p, level)
    }

    /// Along an axis the crossing is an arc cosine; other segments are searched.
    fn crossing(&self, a: DVec3, b: DVec3, level: f64) -> DVec3 {
        let along = (b - a).abs();
        let axis = (0..3).find(|&axis| along[axis] >= along.element_sum());
        let analytic = axis.and_then(|axis| {
            let k = TAU / self.period;
            let others: f64 = (0..3).filter(|&other| other != axis).map(|other| (k * a[other]).cos()).sum();
            let angle = (level - others).clamp(-1.0, 1.0).acos() / k;
            let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
            // The roots are ±angle up to whole periods; take the one between the ends.
            [angle, -angle].into_iter().find_map(|root| {
                let x = root + self.period * ((0.5 * (low + high) - root) / self.period).round();
                (low <= x && x <= high).then(|| {
                    let mut p = a;
                    p[axis] = x;
                    p
                })
            })
        });
        analytic.unwrap_or_else(|| nearest::crossing(self, a, b, level))
    }
}
