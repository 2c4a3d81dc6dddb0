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
        surface::{Surface, VertexId},
    },
    foam::energy::cross_matrix,
    index::IndexVec,
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

    /// Motions along the walls as nearly rigid as they allow, of root mean square 1. None where something holds the
    /// surface (a fixed vertex, a boundary, walls on all sides), and none without walls, where nothing is to gain.
    ///
    /// # Errors
    /// [`EvolverError::Numerical`] if a vertex lies where its wall has no normal.
    pub(crate) fn carriers(&self, state: &State) -> Result<Vec<Velocity>, EvolverError> {
        let walls = self.holds.iter().any(|hold| !hold.constraints().is_empty());
        let held = self.holds.iter().any(|hold| matches!(hold, Hold::Fixed(_) | Hold::Boundary(_)));
        if !walls || held {
            return Ok(Vec::new());
        }
        let turns = self.rigid(state);
        if !turns.iter().all(|turn| turn.is_finite()) {
            let message = "a vertex lies where its wall has no normal; the surface cannot be slid".to_owned();
            return Err(EvolverError::Numerical(message));
        }
        let mean = |walls: bool| {
            let chosen = |vertex: &VertexId| !walls || !self.holds[*vertex].constraints().is_empty();
            let squares =
                turns.enumerated().filter(|(vertex, _)| chosen(vertex)).map(|(_, v)| v.transpose() * *v);
            let (sum, count) =
                squares.fold((DMat3::ZERO, 0.0), |(sum, count), square| (sum + square, count + 1.0));
            sum * (1.0 / count)
        };
        let (on_walls, everywhere) = (mean(true), mean(false));
        let field = |translation: DVec3| {
            let size = translation.dot(everywhere * translation).sqrt();
            turns.iter().map(|turn| *turn * translation / size).collect()
        };
        Ok(left_over(on_walls).into_iter().map(field).collect())
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

    /// The velocity of each vertex for a unit translation of the whole: the translation with that turn about the middle which
    /// leaves the least motion against the walls, less what motion is left.
    fn rigid(&self, state: &State) -> IndexVec<VertexId, DMat3> {
        #[expect(clippy::cast_precision_loss, reason = "a count of vertices")]
        let count = state.places.len().max(1) as f64;
        let middle = state.places.iter().sum::<DVec3>() / count;
        let along: IndexVec<VertexId, DMat3> = self
            .holds
            .ids()
            .map(|vertex| {
                let axes = DVec3::AXES.map(|axis| self.projected(state, vertex, axis));
                DMat3::from_cols(axes[0], axes[1], axes[2])
            })
            .collect();
        // t − Rω with R the matrix of the arm has the part N(t − Rω) against the walls: (Σ RᵀNR) ω = Σ RᵀN t.
        let (mut matrix, mut sides) = (DMat3::ZERO, DMat3::ZERO);
        for (vertex, along) in along.enumerated() {
            let arm = cross_matrix(state.places[vertex] - middle);
            let against = arm.transpose() * (DMat3::IDENTITY - *along);
            matrix += against * arm;
            sides += against;
        }
        let size = matrix.col(0).x + matrix.col(1).y + matrix.col(2).z;
        let turn = (matrix + DMat3::from_diagonal(DVec3::splat(UNTURNED * size))).inverse() * sides;
        let turn = if turn.is_finite() { turn } else { DMat3::ZERO };
        along
            .enumerated()
            .map(|(vertex, along)| {
                *along * (DMat3::IDENTITY - cross_matrix(state.places[vertex] - middle) * turn)
            })
            .collect()
    }
}

/// Turns that cost less than this part of the others, as about the normal of round walls, are left out.
const UNTURNED: f64 = 1e-6;

/// The directions of translation that walls leave over, by the mean squares of the velocities on them.
fn left_over(mean: DMat3) -> Vec<DVec3> {
    let matrix = faer::Mat::from_fn(3, 3, |i, j| mean.col(j)[i]);
    let Ok(eigen) = matrix.self_adjoint_eigen(faer::Side::Lower) else { return Vec::new() };
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    (0..3)
        .filter(|&k| values[k] > ALONG)
        .map(|k| DVec3::new(vectors[(0, k)], vectors[(1, k)], vectors[(2, k)]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_walls_forbid_are_left_out() {
        // Walls across z.
        let found = left_over(DMat3::from_diagonal(DVec3::new(1.0, 0.9, 0.01)));
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|t| t.z.abs() < 1e-14 && (t.length() - 1.0).abs() < 1e-14), "{found:?}");
        assert!(left_over(DMat3::ZERO).is_empty());
    }
}
