//! A surface carried along its walls as a whole.

use super::{
    Places,
    freedom::State,
    gradient::Gradients,
    problem::{FunctionalId, Problem},
};
use crate::{
    evolver::{
        error::EvolverError,
        surface::{ConstraintId, VertexId},
    },
    index::{Id, IndexVec},
};
use glam::{DMat3, DVec3};

/// The part of a translation that walls must leave over for it to count as a direction along them.
const ALONG: f64 = 0.25;

/// A direction along the walls, and by how much the energy changes along it.
#[derive(Clone, Debug)]
pub(crate) struct Carrier {
    /// The velocity of each vertex; its root mean square is 1.
    pub(crate) velocity: IndexVec<VertexId, DVec3>,
    /// The change of the Lagrangian for a unit of way, at most zero.
    pub(crate) slope: f64,
}

impl Problem {
    /// The translation along the walls that lowers the Lagrangian most. `None` where something holds the surface: a fixed
    /// vertex, a boundary, walls on all sides, or no wall at all, which leaves nothing to gain.
    ///
    /// # Errors
    /// [`EvolverError::Numerical`] if a vertex lies where its wall has no normal.
    pub(crate) fn carrier(
        &self,
        state: &State,
        multipliers: &IndexVec<FunctionalId, f64>,
    ) -> Result<Option<Carrier>, EvolverError> {
        let walls = self.touched_walls();
        if walls.is_empty() || self.holds_something() {
            return Ok(None);
        }
        let tangents = self.tangents(state, &walls);
        if !tangents.iter().all(|tangent| tangent.is_finite()) {
            let message = "a vertex lies where its wall has no normal; the surface cannot be slid".to_owned();
            return Err(EvolverError::Numerical(message));
        }
        let gradients = self.gradients(&state.places, self.slots());
        let forces = self.lagrangian_gradient(&gradients, multipliers);
        // For the translation t the velocities are Tᵢ t with projections Tᵢ: slope Σ Tᵢ gᵢ, mean square t·(Σ Tᵢ / n) t.
        let (mut slope, mut mean) = (DVec3::ZERO, DMat3::ZERO);
        for (tangent, force) in tangents.iter().zip(forces.iter()) {
            slope += *tangent * *force;
            mean += *tangent;
        }
        #[expect(clippy::cast_precision_loss, reason = "a count of vertices")]
        let mean = mean * (1.0 / tangents.len() as f64);
        let Some(translation) = steepest(mean, slope) else { return Ok(None) };
        let velocity = tangents.iter().map(|tangent| *tangent * translation).collect();
        Ok(Some(Carrier { velocity, slope: slope.dot(translation) }))
    }

    /// The constraints that vertices lie on.
    fn touched_walls(&self) -> Vec<ConstraintId> {
        let mut walls: Vec<ConstraintId> =
            self.holds.iter().flat_map(|hold| hold.constraints().iter().copied()).collect();
        walls.sort_unstable_by_key(|id| id.index());
        walls.dedup();
        walls
    }

    fn holds_something(&self) -> bool {
        use super::freedom::Hold;
        self.holds.iter().any(|hold| matches!(hold, Hold::Fixed(_) | Hold::Boundary(_)))
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

    /// The gradient of the Lagrangian with these multipliers; the energy's has couplings in it.
    fn lagrangian_gradient(
        &self,
        gradients: &Gradients,
        multipliers: &IndexVec<FunctionalId, f64>,
    ) -> Places {
        self.holds
            .ids()
            .map(|vertex| {
                let held: DVec3 =
                    gradients.functionals.at(vertex).map(|(id, gradient)| multipliers[id] * gradient).sum();
                gradients.energy[vertex] - held
            })
            .collect()
    }
}

/// The translation `t` with `t·Mt = 1` of the steepest descent, among the directions that the walls leave over.
fn steepest(mean: DMat3, slope: DVec3) -> Option<DVec3> {
    let matrix = faer::Mat::from_fn(3, 3, |i, j| mean.col(j)[i]);
    let eigen = matrix.self_adjoint_eigen(faer::Side::Lower).ok()?;
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    let mut translation = DVec3::ZERO;
    for k in 0..3 {
        if values[k] > ALONG {
            let direction = DVec3::new(vectors[(0, k)], vectors[(1, k)], vectors[(2, k)]);
            translation -= slope.dot(direction) / values[k] * direction;
        }
    }
    let size = translation.dot(mean * translation).sqrt();
    (size > 0.0).then(|| translation / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steepest_translation_leaves_out_what_walls_forbid() {
        // Walls across z; the slope is steepest there, and down along −x.
        let mean = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.01));
        let found = steepest(mean, DVec3::new(2.0, 0.0, 9.0)).unwrap();
        assert!((found - DVec3::NEG_X).length() < 1e-14, "{found}");
        assert!(steepest(DMat3::ZERO, DVec3::X).is_none());
    }
}
