//! The softest mode: the lowest eigenvalue of the Hessian on the constraints, by inverse iteration on the factored system.

use super::{Direction, FactorError, Step, System, film::At, motion::Motions};
use crate::{
    foam::{
        complex::{Complex, Places, RegionId},
        solve::Residuals,
        volume::Reference,
    },
    index::IndexVec,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The softest way in which the films can move at constant volumes.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// The eigenvalue, in units of the tension: the second derivative of the energy along the mode, whose freedoms have the
    /// Euclidean norm 1. Its sign is that of the softest curvature; its size depends on the mesh and, where rigid motions
    /// exist, on the freedoms that hold them.
    pub eigenvalue: f64,
    /// The mode.
    pub direction: Direction,
}

/// The most inverse iterations: neighbouring eigenvalues of a foam differ by some percent, and each gains their ratio.
const ITERATIONS: usize = 60;
/// The relative change of the eigenvalue that ends the iterations.
const SETTLED: f64 = 1e-4;

impl System {
    /// The softest mode at a balance.
    ///
    /// # Errors
    /// [`FactorError`] as for a step.
    pub fn lowest_mode(
        &self,
        complex: &Complex,
        places: &Places,
        reference: &Reference,
        pressures: &IndexVec<RegionId, f64>,
    ) -> Result<Mode, FactorError> {
        let motions = Motions::new(complex, places, &self.layout, &self.frames);
        let at = At { complex, places, reference, pressures, motions: &motions, frames: &self.frames };
        let assembled = self.assemble(&at);
        let walls = self.wall_entries(&at, &assembled);
        let mut mode = self.start_of_iteration();
        let mut reciprocal: f64 = 0.0;
        let (_, shift) = self.stiffened(&assembled, &walls, 0.0, |factored, films| {
            for _ in 0..ITERATIONS {
                let Ok(mut answer) = self.solve(factored, films, &mode) else { return false };
                answer.pressures.iter_mut().for_each(|p| *p = 0.0);
                let next = mode.dot(&answer);
                let size = answer.dot(&answer).sqrt();
                answer.scale(1.0 / size);
                mode = answer;
                let settled = (next - reciprocal).abs() <= SETTLED * next.abs();
                reciprocal = next;
                if settled {
                    break;
                }
            }
            reciprocal.is_finite()
        })?;
        Ok(Mode { eigenvalue: 1.0 / reciprocal - shift, direction: mode })
    }

    /// A step along a direction, as large as it is.
    #[must_use]
    pub fn along(&self, complex: &Complex, places: &Places, direction: Direction) -> Step {
        let motions = Motions::new(complex, places, &self.layout, &self.frames);
        let own_displacements = self.own_displacements(complex, &motions, &direction);
        let displacements = self.displacements(complex, places, &own_displacements);
        let residuals = Residuals { force: 0.0, volume: 0.0 };
        let balance = direction.pressures.clone();
        Step { direction, balance, displacements, own_displacements, residuals, unstable: 0, shift: 0.0 }
    }

    /// A direction with a part along every mode, always the same.
    fn start_of_iteration(&self) -> Direction {
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let mut noise = || random.random_range(-1.0..1.0);
        let layout = &self.layout;
        let mut start = Direction {
            freedoms: layout.of_freedom.iter().map(|free| free.map_or(0.0, |_| noise())).collect(),
            inner: Vec::new(),
            pressures: IndexVec::from_elem(0.0, layout.of_pressure.len()),
        };
        start.inner = layout.films.iter().map(|film| film.inner.iter().map(|_| noise()).collect()).collect();
        let size = start.dot(&start).sqrt();
        start.scale(1.0 / size);
        start
    }
}

impl Direction {
    /// The scalar product of the motions; pressures do not count.
    fn dot(&self, other: &Self) -> f64 {
        let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        of(&self.freedoms, &other.freedoms)
            + self.inner.iter().zip(&other.inner).map(|(a, b)| of(a, b)).sum::<f64>()
    }

    fn scale(&mut self, factor: f64) {
        self.freedoms.iter_mut().chain(self.inner.iter_mut().flatten()).for_each(|x| *x *= factor);
    }
}
