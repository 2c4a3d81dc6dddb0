//! A surface carried along its walls as a whole.

use super::{
    Places,
    closed::closed_volumes,
    freedom::{Hold, State},
    problem::{FunctionalId, Measured, Problem},
};
use crate::{
    evolver::{
        error::EvolverError,
        surface::{ConstraintId, Surface, VertexId},
    },
    index::{Id, IndexVec},
};
use glam::{DMat3, DVec3};

/// The part of a translation that walls must leave over for it to count as a direction along them.
const ALONG: f64 = 0.25;

/// The velocity of each vertex.
pub(crate) type Velocity = IndexVec<VertexId, DVec3>;

impl Problem {
    /// What the energy would be more if the bodies closed on their walls had the volumes that their integrals give, to first
    /// order. Integrals along chords of a contact line depend on where their gauge vanishes, and would draw the surface away
    /// from there.
    pub(crate) fn discrepancy(
        &self,
        surface: &Surface,
        places: &Places,
        multipliers: &IndexVec<FunctionalId, f64>,
    ) -> f64 {
        let values = self.values(places);
        let closed = closed_volumes(self, surface, places);
        self.functionals
            .enumerated()
            .filter(|(_, functional)| functional.target.is_some())
            .map(|(id, functional)| {
                let Measured::Volume(body) = functional.measured else { return 0.0 };
                closed[body].map_or(0.0, |closed| multipliers[id] * (values.functionals[id] - closed))
            })
            .sum()
    }

    /// Translations along the walls, of root mean square 1 and orthogonal to each other. None where something holds the
    /// surface (a fixed vertex, a boundary, walls on all sides), and none without walls, where nothing is to gain.
    ///
    /// # Errors
    /// [`EvolverError::Numerical`] if a vertex lies where its wall has no normal.
    pub(crate) fn carriers(&self, state: &State) -> Result<Vec<Velocity>, EvolverError> {
        let walls = self.touched_walls();
        let held = self.holds.iter().any(|hold| matches!(hold, Hold::Fixed(_) | Hold::Boundary(_)));
        if walls.is_empty() || held {
            return Ok(Vec::new());
        }
        let tangents = self.tangents(state, &walls);
        if !tangents.iter().all(|tangent| tangent.is_finite()) {
            let message = "a vertex lies where its wall has no normal; the surface cannot be slid".to_owned();
            return Err(EvolverError::Numerical(message));
        }
        // The translation t gives velocities Tᵢ t with projections Tᵢ, of mean square t·(Σ Tᵢ / n) t.
        let mut mean = DMat3::ZERO;
        for tangent in &tangents {
            mean += *tangent;
        }
        #[expect(clippy::cast_precision_loss, reason = "a count of vertices")]
        let mean = mean * (1.0 / tangents.len() as f64);
        let field = |translation: DVec3| tangents.iter().map(|tangent| *tangent * translation).collect();
        Ok(translations(mean).into_iter().map(field).collect())
    }

    /// The change of the Lagrangian, with the [discrepancy](Self::discrepancy), along a velocity; `step` is that of the
    /// discrepancy's differences.
    pub(crate) fn slope(
        &self,
        surface: &Surface,
        state: &State,
        multipliers: &IndexVec<FunctionalId, f64>,
        velocity: &Velocity,
        step: f64,
    ) -> f64 {
        let gradients = self.gradients(&state.places, self.slots());
        let work: f64 = self
            .holds
            .ids()
            .map(|vertex| {
                let held: DVec3 =
                    gradients.functionals.at(vertex).map(|(id, gradient)| multipliers[id] * gradient).sum();
                (gradients.energy[vertex] - held).dot(velocity[vertex])
            })
            .sum();
        let moved = |way: f64| {
            let mut moved = state.clone();
            for (vertex, &velocity) in velocity.enumerated() {
                self.push(&mut moved, vertex, velocity, way);
                self.settle(&mut moved, vertex, false);
            }
            self.discrepancy(surface, &moved.places, multipliers)
        };
        work + (moved(step) - moved(-step)) / (2.0 * step)
    }

    /// The constraints that vertices lie on.
    fn touched_walls(&self) -> Vec<ConstraintId> {
        let mut walls: Vec<ConstraintId> =
            self.holds.iter().flat_map(|hold| hold.constraints().iter().copied()).collect();
        walls.sort_unstable_by_key(|id| id.index());
        walls.dedup();
        walls
    }

    /// The projections onto the directions along the walls: those of a vertex's own, elsewhere along all that are touched,
    /// by the mean of their normals.
    fn tangents(&self, state: &State, walls: &[ConstraintId]) -> IndexVec<VertexId, DMat3> {
        let along_all = |place: DVec3| {
            let mut sum = DVec3::ZERO;
            for &wall in walls {
                let normal = self.walls[wall].formula.jet(place).gradient.normalize();
                sum += if sum.dot(normal) < 0.0 { -normal } else { normal };
            }
            let normal = sum.normalize();
            DMat3::IDENTITY - DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z)
        };
        self.holds
            .enumerated()
            .map(|(vertex, hold)| {
                if hold.constraints().is_empty() {
                    return along_all(state.places[vertex]);
                }
                let axes = DVec3::AXES.map(|axis| self.projected(state, vertex, axis));
                DMat3::from_cols(axes[0], axes[1], axes[2])
            })
            .collect()
    }
}

/// The translations that the walls leave over, each `t` with `t·Mt = 1`.
fn translations(mean: DMat3) -> Vec<DVec3> {
    let matrix = faer::Mat::from_fn(3, 3, |i, j| mean.col(j)[i]);
    let Ok(eigen) = matrix.self_adjoint_eigen(faer::Side::Lower) else { return Vec::new() };
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    (0..3)
        .filter(|&k| values[k] > ALONG)
        .map(|k| DVec3::new(vectors[(0, k)], vectors[(1, k)], vectors[(2, k)]) / values[k].sqrt())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn translations_leave_out_what_walls_forbid() {
        // Walls across z.
        let found = translations(DMat3::from_diagonal(DVec3::new(1.0, 0.25 + 0.75, 0.01)));
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|t| t.z.abs() < 1e-14 && (t.length() - 1.0).abs() < 1e-14), "{found:?}");
        assert!(translations(DMat3::ZERO).is_empty());
    }
}
