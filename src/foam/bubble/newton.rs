//! Newton steps for one bubble: least film area at its volume, held at its place.
//!
//! Unknowns: for every node the way that it goes along its direction, then the pressure, then the multipliers of the two
//! moments (`balance.rs`). A film of this size has a few hundred nodes, so the bordered system is dense and factored with
//! pivoting, which a bubble that slides freely (a singular Hessian) needs. Volume patches on the walls are integrated anew
//! at each step, so that the end does not depend on the way there.

use super::{Annulus, Chart, NoBubble, balance};
use crate::foam::{
    complex::{Complex, Element, Node, Places, RegionId},
    convert::as_f64,
    energy::{Blocks, FilmLoads, add_element},
    solve::negative_eigenvalues,
    volume::{Reference, StripLoads, WallEdge, volumes},
};
use crate::index::{Id, IndexVec};
use faer::{Mat, Side, linalg::solvers::Lblt, prelude::Solve};
use glam::DVec3;
use rayon::prelude::*;

/// Constraints: the volume and two moments.
const CONSTRAINTS: usize = 3;
/// No step moves a node farther than this part of the bubble's radius.
const LONGEST: f64 = 0.2;
/// Steps before giving up. Equilibria near the round start take five or six.
const STEPS: usize = 60;
/// Steps shorter than this part of the radius have converged: places are then rounded, and the energy, flat there, has
/// twice as many digits.
const SHORTEST: f64 = 1e-13;
/// Below this, steps that no longer shrink have met rounding.
const ROUNDED: f64 = 1e-7;

/// A bubble on one mesh.
pub(super) struct Sheet<'a> {
    pub(super) chart: &'a Chart<'a>,
    pub(super) complex: Complex,
    pub(super) places: Places,
    directions: Places,
    radius: f64,
    volume: f64,
}

/// The end of the descent.
#[derive(Clone, Debug)]
pub(super) struct Equilibrium {
    pub(super) energy: f64,
    pub(super) pressure: f64,
    /// The gradient of the energy of the held bubble along the chart's axes.
    pub(super) slope: [f64; 2],
    /// The largest force that is left on a node.
    pub(super) residual: f64,
    pub(super) places: Places,
    /// Directions of negative curvature with the bubble held.
    pub(super) unstable: usize,
    multipliers: [f64; CONSTRAINTS],
}

/// The system at one state, without the borders' signs.
struct Assembled {
    energy: f64,
    gradient: Vec<f64>,
    hessian: Mat<f64>,
    /// Gradients of the volume and the moments.
    borders: [Vec<f64>; CONSTRAINTS],
    /// How much is missing to the volume and the moments.
    missing: [f64; CONSTRAINTS],
    /// The area that each node stands for, seen along its direction.
    mass: Vec<f64>,
}

/// The share of one element.
struct Share {
    energy: f64,
    moments: [f64; 2],
    gradient: [DVec3; 9],
    volume: [DVec3; 9],
    balance: [[DVec3; 9]; 2],
    area: [DVec3; 9],
    hessian: Blocks,
}

impl<'a> Sheet<'a> {
    /// A round bubble of this radius, to be brought to `volume`.
    pub(super) fn round(
        chart: &'a Chart<'a>,
        mesh: Annulus,
        radius: f64,
        volume: f64,
    ) -> Result<Self, NoBubble> {
        let complex = mesh.complex(chart.gap(), chart.place());
        let (mut places, directions) = mesh.round(chart, radius)?;
        complex.retract(&mut places).map_err(|node| NoBubble::Wide { place: places[node] })?;
        Ok(Self { chart, complex, places, directions, radius, volume })
    }

    /// The volume at `places`.
    pub(super) fn volume_at(&self, places: &Places) -> f64 {
        let reference = Reference::new(&self.complex, places);
        volumes(&self.complex, places, &reference)[RegionId::from_index(0)]
    }

    /// The direction of a node within its walls, of unit length.
    fn direction(&self, node: &Node, at: DVec3, d: DVec3) -> DVec3 {
        let Some(&wall) = node.walls.first() else { return d };
        let normal = self.complex.walls[wall].field.normal(at);
        (d - d.dot(normal) * normal).normalize()
    }

    fn present_directions(&self, places: &Places) -> IndexVec<crate::foam::complex::NodeId, DVec3> {
        let nodes = self.complex.nodes.enumerated();
        nodes.map(|(id, node)| self.direction(node, places[id], self.directions[id])).collect()
    }

    /// Goes to equilibrium.
    pub(super) fn settle(&self) -> Result<Equilibrium, NoBubble> {
        let mut places = self.places.clone();
        let mut multipliers = [1.0 / self.radius, 0.0, 0.0];
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let directions = self.present_directions(&places);
            let assembled = self.assemble(&places, &directions, multipliers);
            let (step, _) = self.solve(&assembled);
            let count = directions.len();
            let size = step[..count]
                .iter()
                .fold(0.0, |m: f64, x| if x.is_nan() { f64::NAN } else { m.max(x.abs()) });
            if !size.is_finite() {
                return Err(NoBubble::Unsolved { place: self.chart.place(), residual: f64::NAN });
            }
            let fraction = (LONGEST * self.radius / size).min(1.0);
            for (id, node) in self.complex.nodes.enumerated() {
                let p = places[id] + fraction * step[id.index()] * directions[id];
                places[id] = self.complex.retracted(node, p).ok_or(NoBubble::Wide { place: p })?;
            }
            for (multiplier, change) in multipliers.iter_mut().zip(&step[count..]) {
                *multiplier += fraction * change;
            }
            let part = size / self.radius;
            if part < SHORTEST || (part < ROUNDED && part > 0.5 * last) {
                return self.report(places, multipliers);
            }
            last = part;
        }
        Err(NoBubble::Unsolved { place: self.chart.place(), residual: last })
    }

    fn report(&self, places: Places, multipliers: [f64; CONSTRAINTS]) -> Result<Equilibrium, NoBubble> {
        let assembled = self.assemble(&places, &self.present_directions(&places), multipliers);
        let (_, negative) = self.solve(&assembled);
        let mut slope = [0.0; 2];
        for element in self.complex.films.iter().flat_map(|film| &film.elements) {
            let slopes = balance::by_place(element.shape, &self.local(element, &places), self.chart);
            for (row, multiplier) in slopes.iter().zip(&multipliers[1..]) {
                slope.iter_mut().zip(row).for_each(|(sum, value)| *sum -= multiplier * value);
            }
        }
        Ok(Equilibrium {
            energy: assembled.energy,
            pressure: multipliers[0],
            slope,
            residual: assembled.gradient.iter().fold(0.0, |m, g| m.max(g.abs())),
            places,
            unstable: negative.saturating_sub(CONSTRAINTS),
            multipliers,
        })
    }

    /// The lowest eigenvalues of the second variation of the energy at fixed volume with the bubble held: the change of the
    /// energy per squared normal displacement, integrated over the film. In units of tension over length².
    pub(super) fn spectrum(&self, at: &Equilibrium, count: usize) -> Vec<f64> {
        let assembled = self.assemble(&at.places, &self.present_directions(&at.places), at.multipliers);
        let n = assembled.gradient.len();
        let scale: Vec<f64> = assembled.mass.iter().map(|m| 1.0 / m.sqrt()).collect();
        let borders = Mat::from_fn(n, CONSTRAINTS, |i, j| scale[i] * assembled.borders[j][i]);
        let basis = borders.qr().compute_thin_Q();
        let scaled = Mat::from_fn(n, n, |i, j| scale[i] * assembled.hessian[(i, j)] * scale[j]);
        // (I − QQᵀ) A (I − QQᵀ), with the constrained directions moved beyond the rest of the spectrum.
        let across = &scaled * &basis;
        let corner = basis.transpose() * &across;
        let (back, far) = (&basis * across.transpose(), scaled.norm_max() * as_f64(n));
        let forth = &across * basis.transpose();
        let both = &basis * (corner * basis.transpose());
        let ridge = &basis * basis.transpose();
        let projected = Mat::from_fn(n, n, |i, j| {
            scaled[(i, j)] - back[(i, j)] - forth[(i, j)] + both[(i, j)] + far * ridge[(i, j)]
        });
        let mut values = projected.self_adjoint_eigenvalues(Side::Lower).unwrap_or_default();
        values.sort_by(f64::total_cmp);
        values.truncate(count);
        values
    }

    fn local(&self, element: &Element, places: &Places) -> Vec<DVec3> {
        element.nodes.iter().map(|&image| places[image.node] - self.chart.place()).collect()
    }

    fn assemble(&self, places: &Places, directions: &Places, multipliers: [f64; CONSTRAINTS]) -> Assembled {
        let reference = Reference::new(&self.complex, places);
        let film = &self.complex.films[crate::foam::complex::FilmId::from_index(0)];
        let shares: Vec<Share> = film
            .elements
            .par_iter()
            .map(|element| self.share(element, places, &reference, multipliers))
            .collect();
        let n = places.len();
        let mut assembled = Assembled {
            energy: 0.0,
            gradient: vec![0.0; n],
            hessian: Mat::zeros(n, n),
            borders: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
            missing: [
                self.volume - volumes(&self.complex, places, &reference)[RegionId::from_index(0)],
                0.0,
                0.0,
            ],
            mass: vec![0.0; n],
        };
        let mut forces = Places::from_elem(DVec3::ZERO, n);
        for (element, share) in film.elements.iter().zip(&shares) {
            assembled.energy += share.energy;
            assembled.missing[1] -= share.moments[0];
            assembled.missing[2] -= share.moments[1];
            let matrix = share.hessian.as_mat();
            for (j, column) in element.nodes.iter().map(|image| image.node).enumerate() {
                forces[column] += share.gradient[j];
                let (d, at) = (directions[column], column.index());
                assembled.gradient[at] += share.gradient[j].dot(d);
                assembled.borders[0][at] += share.volume[j].dot(d);
                assembled.borders[1][at] += share.balance[0][j].dot(d);
                assembled.borders[2][at] += share.balance[1][j].dot(d);
                assembled.mass[at] += share.area[j].dot(d).abs();
                for (i, row) in element.nodes.iter().map(|image| image.node).enumerate() {
                    let e = directions[row];
                    let block = |a: usize, b: usize| e[a] * matrix[(3 * i + a, 3 * j + b)] * d[b];
                    let value: f64 = (0..9).map(|ab| block(ab / 3, ab % 3)).sum();
                    assembled.hessian[(row.index(), at)] += value;
                }
            }
        }
        self.bend_with_walls(places, directions, &forces, &mut assembled.hessian);
        assembled
    }

    /// A node on a wall moves along the wall, which bends away under the force that holds it there.
    fn bend_with_walls(&self, places: &Places, directions: &Places, forces: &Places, hessian: &mut Mat<f64>) {
        for (id, node) in self.complex.nodes.enumerated() {
            let Some(&wall) = node.walls.first() else { continue };
            let field = &self.complex.walls[wall].field;
            let (gradient, d) = (field.gradient(places[id]), directions[id]);
            let held = forces[id].dot(gradient) / gradient.length_squared();
            hessian[(id.index(), id.index())] -= held * d.dot(field.hessian(places[id]) * d);
        }
    }

    fn share(
        &self,
        element: &Element,
        places: &Places,
        reference: &Reference,
        multipliers: [f64; CONSTRAINTS],
    ) -> Share {
        let film = &self.complex.films[crate::foam::complex::FilmId::from_index(0)];
        let base = self.chart.place();
        let y = self.local(element, places);
        let absolute: Vec<DVec3> = element.nodes.iter().map(|&image| places[image.node]).collect();
        let [origin, _] = reference.origins(&self.complex, film).map(|origin| origin - base);
        let loads = |tension: f64, pressure: f64| FilmLoads {
            tension,
            difference: pressure,
            moment: pressure * origin / 3.0,
        };
        let both = [loads(film.tension, multipliers[0]), loads(0.0, -1.0)];
        let strips = both.map(|load| StripLoads { difference: load.difference, moment: load.moment });
        let zero = [DVec3::ZERO; 9];
        let mut share = Share {
            energy: 0.0,
            moments: [0.0; 2],
            gradient: zero,
            volume: zero,
            balance: [zero; 2],
            area: zero,
            hessian: Blocks::zero(9),
        };
        const ROWS: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];
        let hessian = &mut share.hessian;
        let targets = &mut [&mut share.gradient[..], &mut share.volume[..]];
        share.energy = add_element(element.shape, &y, &ROWS, &both, targets, Some(hessian));
        for (wall, edge) in self.complex.wall_edges(element) {
            let strip = WallEdge::new(&self.complex, reference, element, &absolute, wall, edge);
            strip.add(&strips, base, edge, targets, Some(hessian));
        }
        for (at, &multiplier) in multipliers[1..].iter().enumerate() {
            let tangent = self.chart.axes()[at];
            share.moments[at] =
                balance::add_moment(element.shape, &y, tangent, 1.0, &mut share.balance[at], None);
            balance::add_moment(element.shape, &y, tangent, -multiplier, &mut share.gradient, Some(hessian));
        }
        for point in element.shape.points() {
            let (_, a, b) = crate::foam::energy::jet(point, &y);
            for (sum, value) in share.area.iter_mut().zip(point.value) {
                *sum += point.weight * value * a.cross(b);
            }
        }
        share
    }

    /// The Newton step over nodes and multipliers, and the number of negative eigenvalues of the bordered matrix.
    fn solve(&self, assembled: &Assembled) -> (Vec<f64>, usize) {
        let n = assembled.gradient.len();
        let border = |i: usize, j: usize| match (i.checked_sub(n), j.checked_sub(n)) {
            (None, None) => assembled.hessian[(i, j)],
            (Some(c), None) => -assembled.borders[c][j],
            (None, Some(c)) => -assembled.borders[c][i],
            (Some(_), Some(_)) => 0.0,
        };
        // Lengths of one size: the radius scales the borders, whose entries are areas and volumes.
        let scale = [1.0 / self.radius, self.radius.powi(-2), self.radius.powi(-2)];
        let weight = |i: usize| i.checked_sub(n).map_or(1.0, |c| scale[c]);
        let matrix =
            Mat::from_fn(n + CONSTRAINTS, n + CONSTRAINTS, |i, j| weight(i) * weight(j) * border(i, j));
        let factor = Lblt::new(matrix.as_ref(), Side::Lower);
        let mut step = Mat::from_fn(n + CONSTRAINTS, 1, |i, _| {
            weight(i) * i.checked_sub(n).map_or_else(|| -assembled.gradient[i], |c| -assembled.missing[c])
        });
        factor.solve_in_place(step.as_mut());
        let step = (0..n + CONSTRAINTS).map(|i| weight(i) * step[(i, 0)]).collect();
        (step, negative_eigenvalues(&factor))
    }
}
