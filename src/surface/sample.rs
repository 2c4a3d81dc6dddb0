//! Points with area weights on a level set.

use super::LevelSet;
use glam::DVec3;
use rayon::prelude::*;

/// A point of a level set with the area that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where it is.
    pub position: DVec3,
    /// Its share of the surface's area.
    pub weight: f64,
}

/// Points spread over one period of a level set (or over all of a closed one), with weights that integrate over its area.
///
/// The surface is met with lines along the three axes. A hit stands for `dA = dy dz / |n_x|`; the three families are
/// blended by `w_i = |n_i|⁶ / Σ|n_j|⁶`, so that a line that grazes the surface, where hits appear and vanish, counts for
/// nothing there. The sum converges faster than the second power of the line spacing.
#[derive(Clone, Debug)]
pub struct SurfaceSamples {
    points: Vec<SurfacePoint>,
    level: f64,
    spacing: f64,
}

/// The power that blends the families: the integrand then vanishes like the 5/2th power of the distance from a grazing
/// line. A lower power converges slower, a higher one wastes points.
const BLEND_POWER: i32 = 6;

/// The compass search stops at this fraction of the line spacing; the extreme is then flat to its square.
const COMPASS_LEAST: f64 = 1e-7;

impl SurfaceSamples {
    /// Meets `surface = level` with `lines × lines` lines along each axis of its domain.
    ///
    /// # Panics
    /// If `lines` is 0.
    #[must_use]
    pub fn new(surface: &dyn LevelSet, level: f64, lines: usize) -> Self {
        assert!(lines > 0, "at least one line");
        let (low, high) = surface.domain();
        let points = (0..3 * lines)
            .into_par_iter()
            .flat_map_iter(|row| row_hits(surface, level, lines, row / lines, row % lines))
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "a few thousand lines at the most")]
        let spacing = (high - low).max_element() / lines as f64;
        Self { points, level, spacing }
    }

    /// The points with their weights.
    #[must_use]
    pub fn points(&self) -> &[SurfacePoint] {
        &self.points
    }

    /// The area: the sum of the weights.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.points.iter().map(|p| p.weight).sum()
    }

    /// `∫ f dA`.
    pub fn integrate(&self, f: impl Fn(DVec3) -> f64 + Sync) -> f64 {
        // Values in parallel, the sum in order: the same bits for any number of threads.
        let values: Vec<f64> = self.points.par_iter().map(|p| p.weight * f(p.position)).collect();
        values.iter().sum()
    }

    /// Where on the level set `f` is largest, and its value there: a compass search from the best sample.
    pub fn maximise(&self, surface: &dyn LevelSet, f: impl Fn(DVec3) -> f64 + Sync) -> (DVec3, f64) {
        let values: Vec<f64> = self.points.par_iter().map(|p| f(p.position)).collect();
        let best = values.iter().enumerate().filter(|(_, v)| !v.is_nan()).max_by(|a, b| a.1.total_cmp(b.1));
        let Some((index, &value)) = best else {
            return (DVec3::NAN, f64::NAN);
        };
        climb(surface, self.level, self.spacing, (self.points[index].position, value), f)
    }

    /// Where on the level set `f` is least, and its value there.
    pub fn minimise(&self, surface: &dyn LevelSet, f: impl Fn(DVec3) -> f64 + Sync) -> (DVec3, f64) {
        let (place, most) = self.maximise(surface, |p| -f(p));
        (place, -most)
    }
}

/// Compass search: eight directions in the tangent plane, halving the step where none is better.
fn climb(
    surface: &dyn LevelSet,
    level: f64,
    spacing: f64,
    start: (DVec3, f64),
    f: impl Fn(DVec3) -> f64,
) -> (DVec3, f64) {
    let (mut place, mut value) = start;
    let mut step = 0.5 * spacing;
    while step > COMPASS_LEAST * spacing {
        let (u, v) = surface.normal(place).any_orthonormal_pair();
        let better = [u, -u, v, -v, u + v, u - v, v - u, -u - v].into_iter().find_map(|direction| {
            let candidate = surface.project(place + step * direction, level).ok()?;
            let candidate_value = f(candidate);
            (candidate_value > value).then_some((candidate, candidate_value))
        });
        match better {
            Some(found) => (place, value) = found,
            None => step *= 0.5,
        }
    }
    (place, value)
}

/// The hits of one row of lines along `axis`.
#[expect(clippy::cast_precision_loss, reason = "a few thousand lines at the most")]
fn row_hits(
    surface: &dyn LevelSet,
    level: f64,
    lines: usize,
    axis: usize,
    row: usize,
) -> impl Iterator<Item = SurfacePoint> {
    let (low, high) = surface.domain();
    let step = (high - low) / lines as f64;
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    (0..lines).flat_map(move |column| {
        let mut foot = low;
        foot[b] += (row as f64 + 0.5) * step[b];
        foot[c] += (column as f64 + 0.5) * step[c];
        let at = move |t: usize| {
            let mut p = foot;
            p[axis] += t as f64 * step[axis];
            p
        };
        let values: Vec<f64> = (0..=lines).map(|t| surface.value(at(t)) - level).collect();
        (0..lines).filter(move |&t| (values[t] < 0.0) != (values[t + 1] < 0.0)).map(move |t| {
            let position = surface.crossing(at(t), at(t + 1), level);
            let normal = surface.normal(position).abs();
            let blend = normal[axis].powi(BLEND_POWER - 1)
                / (normal.x.powi(BLEND_POWER) + normal.y.powi(BLEND_POWER) + normal.z.powi(BLEND_POWER));
            SurfacePoint { position, weight: step[b] * step[c] * blend }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SchwarzP, Sphere, Torus};
    use std::f64::consts::{PI, TAU};

    #[test]
    fn areas_and_total_curvatures_are_exact_ones() {
        // The error falls faster than the square of 1/64; the bound is 1/64² of the value.
        let sphere = Sphere { radius: 1.3 };
        let samples = SurfaceSamples::new(&sphere, 0.0, 64);
        assert!((samples.area() / (4.0 * PI * 1.69) - 1.0).abs() < 2.5e-4, "{}", samples.area());
        let torus = Torus { ring: 2.0, tube: 0.5 };
        let samples = SurfaceSamples::new(&torus, 0.1, 64);
        assert!((samples.area() / (TAU * 2.0 * TAU * 0.6) - 1.0).abs() < 2.5e-4, "{}", samples.area());
        let total = samples.integrate(|p| torus.curvature(p).gauss);
        assert!(total.abs() < 1e-2, "{total}");
    }

    #[test]
    fn the_schwarz_p_surface_has_its_area_and_its_euler_number() {
        let surface = SchwarzP { period: 1.0 };
        let error = |lines| {
            let samples = SurfaceSamples::new(&surface, 0.0, lines);
            let total = samples.integrate(|p| surface.curvature(p).gauss);
            ((samples.area() - 2.352_566_800_109_08).abs(), (total / TAU + 4.0).abs())
        };
        let (coarse, fine) = (error(16), error(64));
        assert!(fine.0 < 1e-5 && fine.1 < 1e-4, "{fine:?}");
        assert!(coarse.0 > 16.0 * fine.0, "order below two: {coarse:?} {fine:?}");
    }

    #[test]
    fn extremes_are_found_beyond_the_samples() {
        let torus = Torus { ring: 3.0, tube: 1.0 };
        let samples = SurfaceSamples::new(&torus, 0.0, 9);
        let (place, top) = samples.maximise(&torus, |p| p.z);
        assert!((top - 1.0).abs() < 1e-12 && (place.x.hypot(place.y) - 3.0).abs() < 1e-6, "{place} {top}");
    }
}
