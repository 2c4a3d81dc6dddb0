//! The surface that seeds are put on, with the density that they should have.

use crate::{
    foam::domain::{Axis, Domain},
    surface::{Gap, GapKind, LevelSet, SurfacePoint, SurfaceSamples},
};
use glam::DVec3;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How densely seeds lie on the middle surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Density {
    /// As many seeds on every unit of area: the paper's choice.
    Uniform,
    /// In proportion to the local gap, so that all cells have about the same volume.
    #[default]
    Gap,
}

/// The middle surface of a gap inside a domain, with the weight of each of its points.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    pub(crate) domain: Domain,
    surface: Arc<dyn LevelSet>,
    /// The level difference of the walls, where the density follows a gap that varies.
    step: Option<f64>,
    /// The area of the middle surface inside the domain.
    pub(crate) area: f64,
    /// The mean of the weight over the area.
    mean_weight: f64,
    /// The mean of |∇Φ|² over the area.
    pub(crate) mean_square_slope: f64,
}

/// Lines per axis of the quadrature that measures the ground: good to 1e-4.
const MEASURE_LINES: usize = 40;

/// Density above this multiple of the mean is cut off.
const HIGHEST_WEIGHT: f64 = 3.0;

/// Half the thickness of the shell that random points are drawn from, in mean spacings: thin against the curvature.
const SHELL: f64 = 0.1;

impl Ground {
    /// Draws before giving up: a shell holds more than a ten-thousandth of its box unless the gap fills next to nothing.
    pub(crate) const SAMPLE_TRIES: usize = 4_000_000;

    pub(crate) fn new(gap: &Gap, domain: &Domain, density: Density) -> Self {
        let [lower, upper] = gap.walls();
        let varies = gap.kind() == GapKind::LevelSet && !lower.field.is_distance();
        let step = (varies && density == Density::Gap).then_some(upper.level - lower.level);
        let mut ground = Self {
            domain: *domain,
            surface: Arc::clone(gap.middle()),
            step,
            area: 0.0,
            mean_weight: 1.0,
            mean_square_slope: 1.0,
        };
        ground.measure();
        ground
    }

    fn measure(&mut self) {
        self.area = self.integral(0.0, |_| 1.0);
        self.mean_weight = self.integral(0.0, |point| self.weight(point)) / self.area;
        self.mean_square_slope =
            self.integral(0.0, |point| self.surface.gradient(point).length_squared()) / self.area;
    }

    /// ∫ f dA over the part of `Φ = level` that lies inside the domain.
    fn integral(&self, level: f64, f: impl Fn(DVec3) -> f64) -> f64 {
        let samples = SurfaceSamples::new(self.surface.as_ref(), level, MEASURE_LINES);
        let inside = |point: &SurfacePoint| point.weight * self.copies_inside(point.position);
        samples.points().iter().map(|point| inside(point) * f(point.position)).sum()
    }

    /// How many images of `point` under the surface's own periods lie in the primary box.
    fn copies_inside(&self, point: DVec3) -> f64 {
        let mut copies = 1.0;
        for (index, axis) in self.domain.axes.iter().enumerate() {
            let Some(period) = self.surface.period().0[index] else { continue };
            if matches!(axis, Axis::Open { .. }) {
                continue;
            }
            let below = |end: f64| ((end - point[index]) / period).ceil();
            copies *= below(axis.low() + axis.length()) - below(axis.low());
        }
        copies
    }

    /// The density of seeds at `point`, up to a factor: the local gap to first order, δΦ/|∇Φ|.
    fn weight(&self, point: DVec3) -> f64 {
        self.step.map_or(1.0, |step| step / self.surface.gradient(point).length())
    }

    /// The distance of neighbours in the hexagonal lattice that `count` seeds would form around `point`.
    pub(crate) fn spacing(&self, count: f64, point: DVec3) -> f64 {
        if self.step.is_none() {
            return self.mean_spacing(count);
        }
        // The weight diverges where the gradient vanishes, far off the ground.
        self.mean_spacing(count) * (self.mean_weight / self.weight(point)).max(1.0 / HIGHEST_WEIGHT).sqrt()
    }

    /// How the spacing of [`Self::spacing`] changes with `point`.
    pub(crate) fn spacing_gradient(&self, count: f64, point: DVec3) -> DVec3 {
        if self.step.is_none() {
            return DVec3::ZERO;
        }
        // The spacing goes with √|∇Φ|.
        let gradient = self.surface.gradient(point);
        self.surface.hessian(point)
            * gradient
            * (0.5 * self.spacing(count, point) / gradient.length_squared())
    }

    /// The same for the mean density.
    pub(crate) fn mean_spacing(&self, count: f64) -> f64 {
        (2.0 / 3.0_f64.sqrt() * self.area / count).sqrt()
    }

    pub(crate) fn surface_name(&self) -> &'static str {
        self.surface.name()
    }

    /// The level function, zero on the ground.
    pub(crate) fn value(&self, point: DVec3) -> f64 {
        self.surface.value(point)
    }

    /// The unit normal of the level set through `point`.
    pub(crate) fn normal(&self, point: DVec3) -> DVec3 {
        self.surface.gradient(point).normalize_or(DVec3::Z)
    }

    /// `point` moved onto the ground along the gradient, and back into the primary box.
    pub(crate) fn project(&self, point: DVec3) -> Option<DVec3> {
        let projected = self.surface.project(point, 0.0).ok()?;
        let (inside, _) = self.domain.wrap(projected);
        self.domain.is_inside_walls(inside).then_some(inside)
    }

    /// A random point of the ground with the wanted density, from a thin shell around it.
    pub(crate) fn sample(&self, count: f64, rng: &mut impl Rng) -> Option<DVec3> {
        let shell = SHELL * self.mean_spacing(count);
        for _ in 0..Self::SAMPLE_TRIES {
            let [x, y, z] = [rng.random(), rng.random(), rng.random()];
            let point = self.domain.low() + self.domain.extent() * DVec3::new(x, y, z);
            let gradient = self.surface.gradient(point).length();
            if !gradient.is_normal() || self.value(point).abs() > shell * gradient {
                continue;
            }
            let keep: f64 = rng.random();
            if keep * HIGHEST_WEIGHT < self.weight(point) / self.mean_weight
                && let Some(point) = self.project(point)
            {
                return Some(point);
            }
        }
        None
    }
}

/// The volume of a gap inside a domain, by quadrature: good to about 1e-4, and to 1e-3 where plane walls cut it.
///
/// Walls at distances a and b from a surface with mean curvature H and Gaussian curvature K enclose
/// ∫ (b − a) + H (b² − a²) + K (b³ − a³)/3 dA (Steiner's formula); level-set walls ∫∫ dA/|∇Φ| dΦ (the coarea formula).
#[must_use]
pub fn gap_volume(gap: &Gap, domain: &Domain) -> f64 {
    let ground = Ground::new(gap, domain, Density::Uniform);
    let [lower, upper] = gap.walls();
    let (a, b) = (lower.level, upper.level);
    if lower.field.is_distance() {
        let surface = gap.middle();
        return ground.integral(0.0, |point| {
            let curvature = surface.curvature(point);
            (b - a) + curvature.mean * (b * b - a * a) + curvature.gauss * (b.powi(3) - a.powi(3)) / 3.0
        });
    }
    let density = |level: f64| ground.integral(level, |point| 1.0 / lower.field.gradient(point).length());
    // Gauss's rule with three points, exact to the fifth power of the level.
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let outer = half * 0.6_f64.sqrt();
    half / 9.0 * (5.0 * (density(middle - outer) + density(middle + outer)) + 8.0 * density(middle))
}

/// The energy of a flat hexagonal foam with the same cells: `cells` equal volumes, each a hexagonal prism as high as the
/// gap is where it stands, E = √(2√3 N / V) ∫ h^{3/2} dA with the local gap h to first order. Film tension 1.
///
/// For walls at a constant distance h it is N h √(2√3 A) with A the mean area of a cell.
#[must_use]
pub fn flat_hexagonal_energy(gap: &Gap, domain: &Domain, cells: usize) -> f64 {
    let ground = Ground::new(gap, domain, Density::Gap);
    let [lower, upper] = gap.walls();
    let step = upper.level - lower.level;
    let height = |point: DVec3| ground.step.map_or(step, |_| ground.weight(point));
    let weighted = ground.integral(0.0, |point| height(point).powf(1.5));
    let count = crate::foam::convert::as_f64(cells);
    (2.0 * 3.0_f64.sqrt() * count / gap_volume(gap, domain)).sqrt() * weighted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        surface::{GapError, Plane, SchwarzP},
        units::LevelOffset,
    };

    #[test]
    fn the_flat_foam_is_the_leading_term_of_the_reference() -> Result<(), GapError> {
        let gap = Gap::level_set(Arc::new(SchwarzP { period: 1.0 }), LevelOffset(0.2))?;
        let domain = Domain::of_surface(gap.middle().as_ref());
        let energy = flat_hexagonal_energy(&gap, &domain, 64);
        // Given to nine digits; the quadrature is good to 1e-4.
        assert!((energy / 1.116_081_35 - 1.0).abs() < 1e-4, "{energy}");
        assert!((gap_volume(&gap, &domain) / 0.114_158_996_552_87 - 1.0).abs() < 1e-4);
        Ok(())
    }

    #[test]
    fn on_a_plane_it_is_the_hexagonal_foam() -> Result<(), GapError> {
        let gap = Gap::between(Arc::new(Plane { periods: [8.0, 4.0] }), [-0.25, 0.25])?;
        let domain = Domain::of_surface(gap.middle().as_ref());
        // 1.861209718 d √A per cell, with 32 cells of area 1.
        let energy = flat_hexagonal_energy(&gap, &domain, 32);
        assert!((energy - 32.0 * 0.5 * 1.861_209_718).abs() < 1e-6, "{energy}");
        Ok(())
    }
}
