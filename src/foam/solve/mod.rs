//! Newton steps on the constrained system: least energy at given volumes with nodes on walls.
//!
//! Unknowns are freedoms of nodes (`motion.rs`): tangents of their walls, so that walls need no multipliers and their
//! curvature enters the Hessian through the force that holds a node (`wall_curvature`); normals of films; normal planes of
//! borders. Each film's inner nodes are condensed out in parallel (`film.rs`); freedoms of borders and pressures are left and
//! solved as one sparse symmetric system (`layout.rs`, `sparse.rs`), in which rigid motions are held (`rigid.rs`) and one
//! pressure of a closed foam is the gauge, for the walls fix the sum of the volumes.
//!
//! At a minimum the matrix has exactly one negative pivot for each volume constraint; more of them mean a saddle, and the
//! Hessian is stiffened until the step goes downhill on the constraints.

mod film;
mod layout;
mod motion;
mod rigid;
mod sparse;
pub(crate) mod symmetric;

pub use sparse::FactorError;

use super::{
    complex::{Complex, Motion, Places, RegionId},
    volume::{Reference, volumes},
};
use crate::index::IndexVec;
use film::{At, FilmSystem};
use glam::DVec3;
use layout::{Layout, lower_pairs};
use motion::{Frames, Motions};
use rayon::prelude::*;
use sparse::{Factored, Symbolic};

/// The system of one complex: everything that changes only with its topology.
#[derive(Debug)]
pub struct System {
    layout: Layout,
    symbolic: Symbolic,
    frames: Frames,
}

/// How far a state is from equilibrium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// The largest force on a freedom, in units of tension × length.
    pub force: f64,
    /// The largest volume error, in units of volume.
    pub volume: f64,
}

/// A vector over all freedoms, inner motions and pressures.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// By bounding freedom.
    pub freedoms: Vec<f64>,
    /// By film, by inner node.
    pub inner: Vec<Vec<f64>>,
    /// By region.
    pub pressures: IndexVec<RegionId, f64>,
}

/// A Newton step and what was learned on the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Where to go.
    pub direction: Direction,
    /// Displacements of all nodes for the full step, before the return to the walls.
    pub displacements: Places,
    /// The part of them that belongs to each node's own freedoms.
    pub own_displacements: Places,
    /// The residuals before the step.
    pub residuals: Residuals,
    /// How many directions of negative curvature the constrained Hessian has, before any stiffening.
    pub unstable: usize,
    /// What was added to the Hessian's diagonal for a downhill step.
    pub shift: f64,
}

/// The stiffening starts at this part of the tension and grows tenfold: film Hessians have diagonals of the order of γ.
const FIRST_SHIFT: f64 = 1e-3;
/// Stiffenings before giving up: at 10⁵ γ a step is no longer a step.
const SHIFTS: i32 = 9;

impl System {
    /// The system of `complex` with frames taken at `places`.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub fn new(complex: &Complex, places: &Places) -> Result<Self, FactorError> {
        let layout = Layout::new(complex, places);
        let symbolic = Symbolic::new(&layout)?;
        Ok(Self { layout, symbolic, frames: Frames::new(complex, places) })
    }

    /// Takes the frames anew at `places`.
    pub fn reframe(&mut self, complex: &Complex, places: &Places) {
        self.frames = Frames::new(complex, places);
    }

    /// The number of unknowns of the condensed system.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.layout.unknowns
    }

    fn assemble(&self, at: &At<'_>) -> Vec<FilmSystem> {
        at.complex
            .films
            .as_slice()
            .par_iter()
            .zip(&self.layout.films)
            .map(|(film, layout)| film::assemble(at, film, layout))
            .collect()
    }

    /// The values of the matrix in the order of the layout's pattern.
    fn entries(&self, at: &At<'_>, films: &[FilmSystem]) -> Vec<f64> {
        let layout = &self.layout;
        let mut entries = Vec::new();
        let mut forces: Places = Places::from_elem(DVec3::ZERO, at.complex.nodes.len());
        for (film, places) in films.iter().zip(&layout.films) {
            entries.extend(lower_pairs(&places.unknowns).map(|(i, j, _, _)| film.matrix[(i, j)]));
            for &(node, force) in &film.forces {
                forces[node] += force;
            }
        }
        pass_to_masters(at.complex, &mut forces);
        for (id, node) in at.complex.nodes.enumerated() {
            let (first, own) = layout.freedoms[id];
            if own == 0 {
                continue;
            }
            let curvature = motion::wall_curvature(at.complex, node, at.places[id], forces[id]);
            let columns = &at.motions.columns[id];
            entries.extend(lower_pairs(&layout.of_freedom[first..first + own]).map(|(i, j, _, _)| {
                if node.walls.is_empty() { 0.0 } else { columns[i].1.dot(curvature * columns[j].1) }
            }));
        }
        let freedoms = layout.unknowns - layout.pressures;
        entries.extend((0..layout.unknowns).map(|at_| if at_ < freedoms { at.shift } else { 0.0 }));
        entries
    }

    /// One Newton step towards least energy at the volumes `targets`.
    ///
    /// # Errors
    /// [`FactorError`] if no stiffening makes the system solvable.
    pub fn step(
        &self,
        complex: &Complex,
        places: &Places,
        reference: &Reference,
        pressures: &IndexVec<RegionId, f64>,
        targets: &IndexVec<RegionId, f64>,
    ) -> Result<Step, FactorError> {
        let now = volumes(complex, places, reference);
        let motions = Motions::new(complex, places, &self.layout, &self.frames);
        let mut shift = 0.0;
        let mut unstable = None;
        let mut stiff = false;
        for attempt in 0..SHIFTS {
            let at =
                At { complex, places, reference, pressures, motions: &motions, frames: &self.frames, shift };
            let films = self.assemble(&at);
            let factored = Factored::new(&self.layout, &self.symbolic, &self.entries(&at, &films));
            let extra = factored.as_ref().map_or(1, |f| f.negative.saturating_sub(self.layout.pressures));
            let stiffened = films.iter().filter(|film| film.stiffened).count();
            unstable.get_or_insert(extra + stiffened);
            // A Hessian that is just positive gives steps as wild as one that is not: one stiffening more.
            let sound = extra == 0 && (shift <= 0.0 || std::mem::replace(&mut stiff, true));
            if let Ok(factored) = factored
                && sound
            {
                let (rhs, residuals) = self.loads(complex, &films, &now, targets);
                let direction = self.solve(&factored, &films, &rhs)?;
                if direction.freedoms.iter().all(|x| x.is_finite()) {
                    let displacements = self.displacements(complex, &motions, &direction);
                    let own_displacements = self.own_displacements(complex, &motions, &direction);
                    let unstable = unstable.unwrap_or(0);
                    return Ok(Step {
                        direction,
                        displacements,
                        own_displacements,
                        residuals,
                        unstable,
                        shift,
                    });
                }
            }
            shift = FIRST_SHIFT * 10_f64.powi(attempt);
        }
        Err(FactorError::Singular { unknowns: self.layout.unknowns })
    }

    /// Minus the gradient of the Lagrangian and the volumes that are missing; and how large they are.
    fn loads(
        &self,
        complex: &Complex,
        films: &[FilmSystem],
        now: &IndexVec<RegionId, f64>,
        targets: &IndexVec<RegionId, f64>,
    ) -> (Direction, Residuals) {
        let mut freedoms = vec![0.0; self.layout.of_freedom.len()];
        for (film, layout) in films.iter().zip(&self.layout.films) {
            for (&freedom, value) in layout.freedoms.iter().zip(&film.gradient) {
                freedoms[freedom] -= value;
            }
        }
        let inner: Vec<Vec<f64>> =
            films.iter().map(|film| film.inner_gradient.iter().map(|value| -value).collect()).collect();
        // Held freedoms carry no load: by symmetry it vanishes at equilibrium up to the error of the mesh.
        for (value, unknown) in freedoms.iter_mut().zip(&self.layout.of_freedom) {
            *value = unknown.map_or(0.0, |_| *value);
        }
        let pressures: IndexVec<RegionId, f64> = complex
            .regions
            .ids()
            .map(|id| if self.is_cell(complex, id) { now[id] - targets[id] } else { 0.0 })
            .collect();
        let most = |values: &[f64]| {
            values.iter().fold(0.0, |most: f64, x| if x.is_nan() { f64::NAN } else { most.max(x.abs()) })
        };
        let force = inner
            .iter()
            .map(|film| most(film))
            .fold(most(&freedoms), |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) });
        let residuals = Residuals { force, volume: most(pressures.as_slice()) };
        (Direction { freedoms, inner, pressures }, residuals)
    }

    fn is_cell(&self, complex: &Complex, id: RegionId) -> bool {
        complex.regions[id].kind == super::complex::RegionKind::Cell
    }

    /// Solves with the loads `rhs`: forces on freedoms and inner motions, volume errors.
    fn solve(
        &self,
        factored: &Factored<'_>,
        films: &[FilmSystem],
        rhs: &Direction,
    ) -> Result<Direction, FactorError> {
        let layout = &self.layout;
        let mut loads = vec![0.0; layout.unknowns];
        for (value, unknown) in rhs.freedoms.iter().zip(&layout.of_freedom) {
            if let Some(unknown) = unknown {
                loads[*unknown] += value;
            }
        }
        for (value, unknown) in rhs.pressures.iter().zip(layout.of_pressure.iter()) {
            if let Some(unknown) = unknown {
                loads[*unknown] += value;
            }
        }
        let mut inner: Vec<Vec<f64>> =
            films.par_iter().zip(&rhs.inner).map(|(film, load)| film.inner_answer(load)).collect();
        for ((film, answer), places) in films.iter().zip(&inner).zip(&layout.films) {
            for (value, unknown) in film.passed_on(answer).into_iter().zip(&places.unknowns) {
                if let Some(unknown) = unknown {
                    loads[*unknown] -= value;
                }
            }
        }
        let (solution, _) = factored.solve(&loads)?;
        let of = |unknown: &Option<usize>| unknown.map_or(0.0, |at| solution[at]);
        inner.par_iter_mut().zip(films).zip(&layout.films).for_each(|((free, film), places)| {
            let unknowns: Vec<f64> = places.unknowns.iter().map(of).collect();
            film.followed(&unknowns, free);
        });
        Ok(Direction {
            freedoms: layout.of_freedom.iter().map(of).collect(),
            inner,
            pressures: layout.of_pressure.iter().map(of).collect(),
        })
    }

    /// The places after `fraction` of a step: bounding nodes return to their walls, and what is slaved to them follows where
    /// they really went, so that places are one smooth function of the freedoms. `None` if a wall is not found.
    #[must_use]
    pub fn moved(&self, complex: &Complex, places: &Places, step: &Step, fraction: f64) -> Option<Places> {
        let mut moved = places.clone();
        let own = &step.own_displacements;
        for stage in [Stage::Free, Stage::Border, Stage::Inner] {
            for (id, node) in complex.nodes.enumerated() {
                let masters: &[_] = match (&node.motion, stage) {
                    (Motion::Free, Stage::Free) => &[],
                    (Motion::Border(masters), Stage::Border) | (Motion::Inner(masters), Stage::Inner) => {
                        masters
                    }
                    _ => continue,
                };
                let carried: DVec3 =
                    masters.iter().map(|&(master, weight)| weight * (moved[master] - places[master])).sum();
                // Within the tangents first: then the return to the walls is of second order and purely normal.
                let step =
                    motion::tangent_projection(complex, node, places[id]) * (carried + fraction * own[id]);
                moved[id] = complex.retracted(node, places[id] + step)?;
            }
        }
        Some(moved)
    }

    /// Each node's displacement by its own freedoms alone.
    fn own_displacements(&self, complex: &Complex, motions: &Motions, direction: &Direction) -> Places {
        let mut own: Places = complex
            .nodes
            .ids()
            .map(|id| {
                let count = self.layout.freedoms[id].1;
                motions.columns[id][..count].iter().map(|&(freedom, d)| direction.freedoms[freedom] * d).sum()
            })
            .collect();
        for (film, amounts) in self.layout.films.iter().zip(&direction.inner) {
            for (&row, amount) in film.inner.iter().zip(amounts) {
                let node = film.nodes[row].node;
                own[node] = *amount * self.frames.axis(node);
            }
        }
        own
    }

    /// The first-order displacements of all nodes.
    fn displacements(&self, complex: &Complex, motions: &Motions, direction: &Direction) -> Places {
        let mut moved: Places = motions
            .columns
            .iter()
            .map(|columns| columns.iter().map(|&(freedom, d)| direction.freedoms[freedom] * d).sum())
            .collect();
        for (film, own) in self.layout.films.iter().zip(&direction.inner) {
            for (&row, amount) in film.inner.iter().zip(own) {
                let node = film.nodes[row].node;
                let Motion::Inner(masters) = &complex.nodes[node].motion else { continue };
                let carried: DVec3 = masters.iter().map(|&(master, weight)| weight * moved[master]).sum();
                moved[node] = carried + *amount * self.frames.axis(node);
            }
        }
        moved
    }
}

/// The order in which nodes move: masters first.
#[derive(Clone, Copy)]
enum Stage {
    Free,
    Border,
    Inner,
}

/// Border nodes pass the forces on them to their masters.
fn pass_to_masters(complex: &Complex, forces: &mut Places) {
    for (id, node) in complex.nodes.enumerated() {
        if let Motion::Border(masters) = &node.motion {
            for &(master, weight) in masters {
                forces[master] = forces[master] + weight * forces[id];
            }
        }
    }
}

#[cfg(test)]
mod tests;
