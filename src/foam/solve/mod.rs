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
mod fronts;
mod layout;
mod mode;
mod motion;
mod rigid;
mod sparse;
mod supernodes;
pub(crate) mod symmetric;

pub use mode::Mode;
pub use sparse::FactorError;

use super::{
    complex::{Complex, Motion, Node, NodeId, Places, RegionId},
    volume::{Reference, volumes},
};
use crate::index::IndexVec;
pub(in crate::foam) use film::negative_eigenvalues;
use film::{At, FilmHessian, FilmSystem, Scratch};
use glam::DVec3;
use layout::{Layout, lower_pairs};
use motion::{Frames, Motions};
use rayon::prelude::*;
use sparse::{Factored, Symbolic};
use std::sync::atomic::{AtomicI32, Ordering};

/// The system of one complex: everything that changes only with its topology.
#[derive(Debug)]
pub struct System {
    layout: Layout,
    symbolic: Symbolic,
    frames: Frames,
    /// How far the last Hessian that was not positive had to be stiffened: the next one's search starts there. Where it starts
    /// has no part in what it finds.
    last_stage: AtomicI32,
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
    /// The change of pressures that balances the forces best where the films are now, whatever the volumes: far from the
    /// wanted volumes those of `direction` are what it takes to get there, and bend the Hessian of the next step.
    pub balance: IndexVec<RegionId, f64>,
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

/// What a step is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Demand<'a> {
    /// The volumes that the cells have too much.
    pub excess: &'a IndexVec<RegionId, f64>,
    /// The least that is added to the Hessian's diagonal.
    pub damping: f64,
    /// Whether [`Step::balance`] is wanted: it takes a solution of its own. Otherwise it is the change of pressures of the step.
    pub balances: bool,
}

/// The stiffening starts at this part of the tension and grows fourfold: film Hessians have diagonals of the order of γ. A step
/// grows along a falling direction by about its curvature over what is left of the stiffening: one far too stiff creeps.
const FIRST_SHIFT: f64 = 1e-3;
const SHIFT_GROWTH: f64 = 4.0;
/// A Hessian that is just positive gives steps as wild as one that is not: so much more is added then.
const MARGIN: f64 = 2.0;
/// The part of a cell's compliance that is taken off its pressure's diagonal. With 1e-5 refinement is slow; below 1e-12 the
/// factors are too large for it to help.
const SOFTENING: f64 = 1e-9;
/// Stiffenings before giving up: at 10⁵ γ a step is no longer a step.
const SHIFTS: i32 = 14;

impl System {
    /// The system of `complex` with frames taken at `places`.
    ///
    /// # Errors
    /// [`FactorError::Memory`].
    pub fn new(complex: &Complex, places: &Places) -> Result<Self, FactorError> {
        let layout = Layout::new(complex, places);
        let symbolic = Symbolic::new(&layout)?;
        Ok(Self { layout, symbolic, frames: Frames::new(complex, places), last_stage: AtomicI32::new(0) })
    }

    /// Takes the frames anew at `places`.
    pub fn reframe(&mut self, complex: &Complex, places: &Places) {
        self.frames = Frames::new(complex, places);
    }

    /// The cells of each part of the foam that walls close on all sides: they fix the sum of the part's volumes.
    #[must_use]
    pub fn closed_parts(&self) -> &[Vec<RegionId>] {
        &self.layout.closed_parts
    }

    /// The number of unknowns of the condensed system.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.layout.unknowns
    }

    fn assemble(&self, at: &At<'_>) -> Vec<FilmHessian> {
        at.complex
            .films
            .as_slice()
            .par_iter()
            .zip(&self.layout.films)
            .map_init(Scratch::new, |scratch, (film, layout)| film::assemble(at, film, layout, scratch))
            .collect()
    }

    fn condense(&self, films: &[FilmHessian], shift: f64) -> Vec<FilmSystem> {
        films
            .par_iter()
            .zip(&self.layout.films)
            .map(|(film, layout)| film::condense(layout, film, shift))
            .collect()
    }

    /// The share of the walls' curvature under the bounding nodes: the own block of each, in the layout's order.
    fn wall_entries(&self, at: &At<'_>, films: &[FilmHessian]) -> Vec<f64> {
        let mut forces: Places = Places::from_elem(DVec3::ZERO, at.complex.nodes.len());
        for &(node, force) in films.iter().flat_map(|film| &film.forces) {
            forces[node] += force;
        }
        pass_to_masters(at.complex, &mut forces);
        let mut entries = Vec::new();
        for (id, node) in at.complex.nodes.enumerated() {
            let (first, own) = self.layout.freedoms[id];
            if own == 0 {
                continue;
            }
            let curvature = motion::wall_curvature(at.complex, node, at.places[id], forces[id]);
            let columns = &at.motions.columns[id];
            entries.extend(lower_pairs(&self.layout.of_freedom[first..first + own]).map(|(i, j, _, _)| {
                if node.walls.is_empty() { 0.0 } else { columns[i].1.dot(curvature * columns[j].1) }
            }));
        }
        entries
    }

    /// The values of the matrix in the order of the layout's pattern.
    fn entries(&self, films: &[FilmSystem], walls: &[f64], shift: f64) -> Vec<f64> {
        let layout = &self.layout;
        let mut entries = Vec::with_capacity(walls.len() + layout.unknowns + 200 * films.len());
        for (film, places) in films.iter().zip(&layout.films) {
            entries.extend(lower_pairs(&places.unknowns).map(|(i, j, _, _)| film.matrix[(i, j)]));
        }
        entries.extend_from_slice(walls);
        let freedoms = layout.unknowns - layout.pressures;
        entries.extend((0..layout.unknowns).map(|unknown| if unknown < freedoms { shift } else { 0.0 }));
        entries
    }

    /// What is taken off each unknown's diagonal for the factorization: for a pressure a small part of what its cell's
    /// compliance is about, the squares of its volume's derivatives over a film's stiffness γ.
    fn softening(&self, films: &[FilmSystem]) -> Vec<f64> {
        let layout = &self.layout;
        let mut softening = vec![0.0; layout.unknowns];
        for (film, places) in films.iter().zip(&layout.films) {
            let outer = places.freedoms.len();
            for row in [outer, outer + 1] {
                if let Some(unknown) = places.unknowns[row] {
                    softening[unknown] +=
                        SOFTENING * (0..outer).map(|j| film.matrix[(row, j)].powi(2)).sum::<f64>();
                }
            }
        }
        softening
    }

    /// One Newton step towards least energy at the volumes `targets`, with at least `damping` added to the Hessian's diagonal.
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
        damping: f64,
    ) -> Result<Step, FactorError> {
        let now = volumes(complex, places, reference);
        let excess = now.iter().zip(targets).map(|(now, target)| now - target).collect();
        let demand = Demand { excess: &excess, damping, balances: true };
        self.step_by(complex, places, reference, pressures, &demand)
    }

    /// As [`System::step`], for what is asked.
    ///
    /// # Errors
    /// As [`System::step`].
    pub fn step_by(
        &self,
        complex: &Complex,
        places: &Places,
        reference: &Reference,
        pressures: &IndexVec<RegionId, f64>,
        demand: &Demand<'_>,
    ) -> Result<Step, FactorError> {
        let &Demand { excess, damping, balances } = demand;
        let motions = Motions::new(complex, places, &self.layout, &self.frames);
        let at = At { complex, places, reference, pressures, motions: &motions, frames: &self.frames };
        let assembled = self.assemble(&at);
        let walls = self.wall_entries(&at, &assembled);
        let gradients: Vec<&[f64]> = assembled.iter().map(|film| &film.gradient[..]).collect();
        let (rhs, residuals) = self.loads(complex, &gradients, excess);
        let mut forces = rhs.clone();
        forces.pressures.iter_mut().for_each(|missing| *missing = 0.0);
        let mut solution = None;
        let (unstable, shift) = self.stiffened(&assembled, &walls, damping, |factored, films| {
            let balance = |direction: &Direction| match balances {
                true => self.solve(factored, films, &forces).map(|balance| balance.pressures),
                false => Ok(direction.pressures.clone()),
            };
            solution = self
                .solve(factored, films, &rhs)
                .and_then(|direction| balance(&direction).map(|balance| (direction, balance)))
                .ok()
                .filter(|(direction, _)| direction.freedoms.iter().all(|x| x.is_finite()));
            solution.is_some()
        })?;
        let Some((direction, balance)) = solution else {
            return Err(FactorError::Singular { unknowns: self.layout.unknowns });
        };
        let own_displacements = self.own_displacements(complex, &motions, &direction);
        let displacements = self.displacements(complex, places, &own_displacements);
        Ok(Step { direction, balance, displacements, own_displacements, residuals, unstable, shift })
    }

    /// Stiffens the Hessian from `damping` on, as little as the growth allows, until it is positive on the constraints and
    /// `accept` takes its factors. Gives the directions of negative curvature of the Hessian as it is, and the stiffening.
    fn stiffened(
        &self,
        assembled: &[FilmHessian],
        walls: &[f64],
        damping: f64,
        mut accept: impl FnMut(&Factored<'_>, &[FilmSystem]) -> bool,
    ) -> Result<(usize, f64), FactorError> {
        let mut accepted = |shift: f64| {
            self.factored(assembled, walls, shift, |factored, films, negative| {
                (negative == 0 && factored.is_some_and(|factored| accept(factored, films)), negative)
            })
        };
        let (taken, unstable) = accepted(damping);
        if taken {
            return Ok((unstable, damping));
        }
        let first = (SHIFT_GROWTH * damping).max(FIRST_SHIFT);
        let stage = |at: i32| first * SHIFT_GROWTH.powi(at);
        let mut least = 0;
        if unstable > 0 {
            // Whatever is added makes it the more positive, so that the least stage is found from any start.
            let is_positive =
                |at: i32| self.factored(assembled, walls, stage(at), |_, _, negative| negative == 0);
            least = self.last_stage.load(Ordering::Relaxed);
            if is_positive(least) {
                while least > 0 && is_positive(least - 1) {
                    least -= 1;
                }
            } else {
                least = (least + 1..SHIFTS).find(|&at| is_positive(at)).unwrap_or(SHIFTS);
            }
            self.last_stage.store(least.min(SHIFTS - 1), Ordering::Relaxed);
        }
        (least..SHIFTS)
            .map(|at| MARGIN * stage(at))
            .find(|&shift| accepted(shift).0)
            .map(|shift| (unstable, shift))
            .ok_or(FactorError::Singular { unknowns: self.layout.unknowns })
    }

    /// What `look` makes of the Hessian stiffened by `shift`: its factors, if there are any, the condensed films, and the
    /// directions of negative curvature, one if it has no factors.
    fn factored<T>(
        &self,
        assembled: &[FilmHessian],
        walls: &[f64],
        shift: f64,
        look: impl FnOnce(Option<&Factored<'_>>, &[FilmSystem], usize) -> T,
    ) -> T {
        let films = self.condense(assembled, shift);
        let softening = self.softening(&films);
        let entries = self.entries(&films, walls, shift);
        let factored = Factored::new(&self.symbolic, entries, &softening).ok();
        let inner: usize = films.iter().map(|film| film.negative).sum();
        let negative = |found: &Factored<'_>| (found.negative + inner).saturating_sub(self.layout.pressures);
        let extra = factored.as_ref().map_or(1, negative);
        look(factored.as_ref(), &films, extra)
    }

    /// How far a state is from equilibrium, from the gradients alone: a small part of the work of a step.
    #[must_use]
    pub fn residuals(
        &self,
        complex: &Complex,
        places: &Places,
        reference: &Reference,
        pressures: &IndexVec<RegionId, f64>,
        excess: &IndexVec<RegionId, f64>,
    ) -> Residuals {
        let motions = Motions::new(complex, places, &self.layout, &self.frames);
        let at = At { complex, places, reference, pressures, motions: &motions, frames: &self.frames };
        let films = complex.films.as_slice().par_iter().zip(&self.layout.films);
        let gradients: Vec<Vec<f64>> = films
            .map_init(Scratch::new, |scratch, (film, layout)| film::gradient(&at, film, layout, scratch))
            .collect();
        let gradients: Vec<&[f64]> = gradients.iter().map(|film| &film[..]).collect();
        self.loads(complex, &gradients, excess).1
    }

    /// Minus the gradient of the Lagrangian and the volumes that are missing; and how large they are.
    fn loads(
        &self,
        complex: &Complex,
        gradients: &[&[f64]],
        excess: &IndexVec<RegionId, f64>,
    ) -> (Direction, Residuals) {
        let mut freedoms = vec![0.0; self.layout.of_freedom.len()];
        for (film, layout) in gradients.iter().zip(&self.layout.films) {
            for (&freedom, value) in layout.freedoms.iter().zip(*film) {
                freedoms[freedom] -= value;
            }
        }
        let inner: Vec<Vec<f64>> = gradients
            .iter()
            .zip(&self.layout.films)
            .map(|(film, layout)| film[layout.freedoms.len()..].iter().map(|value| -value).collect())
            .collect();
        // Held freedoms carry no load: by symmetry it vanishes at equilibrium up to the error of the mesh.
        for (value, unknown) in freedoms.iter_mut().zip(&self.layout.of_freedom) {
            *value = unknown.map_or(0.0, |_| *value);
        }
        let pressures: IndexVec<RegionId, f64> = complex
            .regions
            .ids()
            .map(|id| if self.is_cell(complex, id) { excess[id] } else { 0.0 })
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
        let solution = factored.solve(&loads)?;
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
        for &id in &self.layout.order_of_motion {
            let node = &complex.nodes[id];
            let carried: DVec3 =
                masters(node).iter().map(|&(master, weight)| weight * (moved[master] - places[master])).sum();
            // Within the tangents first: then the return to the walls is of second order and purely normal.
            let own = fraction * step.own_displacements[id];
            let step = motion::tangent_projection(complex, node, places[id]) * (carried + own);
            moved[id] = complex.retracted(node, places[id] + step)?;
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
    fn displacements(&self, complex: &Complex, places: &Places, own: &Places) -> Places {
        let mut moved = own.clone();
        for &id in &self.layout.order_of_motion {
            let node = &complex.nodes[id];
            let carried: DVec3 = masters(node).iter().map(|&(master, weight)| weight * moved[master]).sum();
            moved[id] = motion::tangent_projection(complex, node, places[id]) * (carried + own[id]);
        }
        moved
    }
}

/// The nodes that a node follows, with their weights.
fn masters(node: &Node) -> &[(NodeId, f64)] {
    match &node.motion {
        Motion::Free => &[],
        Motion::Border(masters) | Motion::Inner(masters) => masters,
    }
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
