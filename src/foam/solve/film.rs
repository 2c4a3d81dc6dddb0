//! One film's share of Newton's system, with its inner nodes condensed out.

use super::{
    layout::FilmLayout,
    motion::{Frames, Motions, tangent_projection, wall_curvature},
};
use crate::foam::{
    complex::{Complex, Film, Motion, NodeId, Places, RegionId},
    energy::{Blocks, FilmLoads, add_element},
    volume::{Reference, StripLoads, WallEdge},
};
use crate::index::IndexVec;
use faer::{Accum, Mat, Par, Side, linalg::matmul::matmul, linalg::solvers::Llt, prelude::Solve};
use glam::{DMat3, DVec3};

/// The state that a film is assembled at.
pub(super) struct At<'a> {
    pub(super) complex: &'a Complex,
    pub(super) places: &'a Places,
    pub(super) reference: &'a Reference,
    pub(super) pressures: &'a IndexVec<RegionId, f64>,
    pub(super) motions: &'a Motions,
    pub(super) frames: &'a Frames,
    /// Added to the diagonal of the Hessian.
    pub(super) shift: f64,
}

/// A film's condensed share.
pub(super) struct FilmSystem {
    /// Over the film's unknowns (freedoms, then the two pressures): the condensed matrix.
    pub(super) matrix: Mat<f64>,
    /// The gradient of the Lagrangian by the film's freedoms.
    pub(super) gradient: Vec<f64>,
    /// The same by the motions of its inner nodes along their normals.
    pub(super) inner_gradient: Vec<f64>,
    /// The gradient by the places of the bounding nodes, with what slaved nodes pass on.
    pub(super) forces: Vec<(NodeId, DVec3)>,
    /// Whether the inner block had to be stiffened to be positive definite.
    pub(super) stiffened: bool,
    factor: Option<Llt<f64>>,
    /// Inner rows of the matrix before condensation.
    coupling: Mat<f64>,
    /// The inverse inner block times `coupling`.
    answer: Mat<f64>,
}

impl FilmSystem {
    /// The motions of the inner nodes that `load` on them causes with all other unknowns held.
    pub(super) fn inner_answer(&self, load: &[f64]) -> Vec<f64> {
        let Some(factor) = &self.factor else { return Vec::new() };
        let mut x = Mat::from_fn(load.len(), 1, |i, _| load[i]);
        factor.solve_in_place(x.as_mut());
        (0..load.len()).map(|i| x[(i, 0)]).collect()
    }

    /// What inner motions pass on to the film's unknowns.
    pub(super) fn passed_on(&self, inner: &[f64]) -> Vec<f64> {
        (0..self.coupling.ncols())
            .map(|j| inner.iter().enumerate().map(|(i, x)| self.coupling[(i, j)] * x).sum())
            .collect()
    }

    /// The inner motions that follow from the film's unknowns.
    pub(super) fn followed(&self, unknowns: &[f64], free: &mut [f64]) {
        for (i, value) in free.iter_mut().enumerate() {
            *value -= unknowns.iter().enumerate().map(|(j, u)| self.answer[(i, j)] * u).sum::<f64>();
        }
    }
}

/// Gradients by the places of the film's nodes: of the Lagrangian, and of minus the volumes of back and front.
struct NodeShares {
    lagrangian: Vec<DVec3>,
    back: Vec<DVec3>,
    front: Vec<DVec3>,
    hessian: Blocks,
}

fn node_shares(at: &At<'_>, film: &Film, layout: &FilmLayout) -> NodeShares {
    let count = layout.nodes.len();
    let base = at.complex.place(at.places, layout.nodes[0]);
    let [back, front] = at.reference.origins(at.complex, film).map(|origin| origin - base);
    let [pb, pf] = [film.back, film.front].map(|side| at.pressures[side.region]);
    let loads = |tension: f64, pb: f64, pf: f64| FilmLoads {
        tension,
        difference: pb - pf,
        moment: (pb * back - pf * front) / 3.0,
    };
    let all = [loads(film.tension, pb, pf), loads(0.0, 1.0, 0.0), loads(0.0, 0.0, 1.0)];
    let strips = all.map(|load| StripLoads { difference: load.difference, moment: load.moment });
    let mut shares = NodeShares {
        lagrangian: vec![DVec3::ZERO; count],
        back: vec![DVec3::ZERO; count],
        front: vec![DVec3::ZERO; count],
        hessian: Blocks::zero(count),
    };
    let mut absolute = Vec::with_capacity(9);
    let mut local = Vec::with_capacity(9);
    for (element, rows) in film.elements.iter().zip(&layout.rows) {
        absolute.clear();
        absolute.extend(element.nodes.iter().map(|&image| at.complex.place(at.places, image)));
        local.clear();
        local.extend(absolute.iter().map(|&p| p - base));
        let NodeShares { lagrangian, back, front, hessian } = &mut shares;
        add_element(element.shape, &local, rows, &all[0], lagrangian, Some(hessian));
        add_element(element.shape, &local, rows, &all[1], back, None);
        add_element(element.shape, &local, rows, &all[2], front, None);
        for (wall, edge) in at.complex.wall_edges(element) {
            let strip = WallEdge::new(at.complex, at.reference, element, &absolute, wall, edge);
            let edge_rows: Vec<usize> = edge.iter().map(|&node| rows[node]).collect();
            let targets = &mut [&mut lagrangian[..], &mut back[..], &mut front[..]];
            strip.add(&strips, base, &edge_rows, targets, Some(hessian));
        }
    }
    shares
}

/// The displacements of the film's nodes for units of its freedoms and of its inner motions, and the wall projections of the
/// inner nodes.
fn displacements(at: &At<'_>, layout: &FilmLayout) -> (Mat<f64>, Vec<DMat3>) {
    let outer = layout.freedoms.len();
    let mut map = Mat::<f64>::zeros(3 * layout.nodes.len(), outer + layout.inner.len());
    let mut add = |row: usize, column: usize, d: DVec3| {
        for axis in 0..3 {
            map[(3 * row + axis, column)] += d[axis];
        }
    };
    // A film's freedoms are sorted, and those of a node are consecutive.
    let column_of = |freedom: usize| layout.freedoms.partition_point(|&f| f < freedom);
    let mut projections = Vec::with_capacity(layout.inner.len());
    for (row, image) in layout.nodes.iter().enumerate() {
        let node = &at.complex.nodes[image.node];
        let Motion::Inner(masters) = &node.motion else {
            for &(freedom, d) in &at.motions.columns[image.node] {
                add(row, column_of(freedom), d);
            }
            continue;
        };
        let projection = tangent_projection(at.complex, node, at.places[image.node]);
        for &(master, weight) in masters {
            for &(freedom, d) in &at.motions.columns[master] {
                add(row, column_of(freedom), weight * (projection * d));
            }
        }
        add(row, outer + projections.len(), projection * at.frames.axis(image.node));
        projections.push(projection);
    }
    (map, projections)
}

/// Assembles and condenses a film.
pub(super) fn assemble(at: &At<'_>, film: &Film, layout: &FilmLayout) -> FilmSystem {
    let mut shares = node_shares(at, film, layout);
    let (map, projections) = displacements(at, layout);
    let mut forces = Vec::with_capacity(layout.nodes.len());
    let mut inner_at = 0;
    for (row, image) in layout.nodes.iter().enumerate() {
        let node = &at.complex.nodes[image.node];
        let force = shares.lagrangian[row];
        let Motion::Inner(masters) = &node.motion else {
            forces.push((image.node, force));
            continue;
        };
        if !node.walls.is_empty() {
            let curvature = wall_curvature(at.complex, node, at.places[image.node], force);
            shares.hessian.add(row, row, curvature);
        }
        let passed = projections[inner_at] * force;
        forces.extend(masters.iter().map(|&(master, weight)| (master, weight * passed)));
        inner_at += 1;
    }
    let flat = |nodes: &[DVec3]| Mat::from_fn(3 * nodes.len(), 1, |i, _| nodes[i / 3][i % 3]);
    let pull = |nodes: &[DVec3]| times(map.transpose(), flat(nodes).as_ref());
    let (gradient, back, front) = (pull(&shares.lagrangian), pull(&shares.back), pull(&shares.front));
    let moved = times(shares.hessian.as_mat(), map.as_ref());
    let mut hessian = times(map.transpose(), moved.as_ref());
    for i in 0..hessian.nrows() {
        hessian[(i, i)] += if i < layout.freedoms.len() { 0.0 } else { at.shift };
    }
    condense(layout, &hessian, &[back, front], &gradient, forces)
}

fn times(a: faer::MatRef<'_, f64>, b: faer::MatRef<'_, f64>) -> Mat<f64> {
    let mut product = Mat::zeros(a.nrows(), b.ncols());
    matmul(product.as_mut(), Accum::Replace, a, b, 1.0, Par::Seq);
    product
}

fn condense(
    layout: &FilmLayout,
    hessian: &Mat<f64>,
    volumes: &[Mat<f64>; 2],
    gradient: &Mat<f64>,
    forces: Vec<(NodeId, DVec3)>,
) -> FilmSystem {
    let (outer, inner) = (layout.freedoms.len(), layout.inner.len());
    let mut matrix = Mat::<f64>::zeros(outer + 2, outer + 2);
    for j in 0..outer {
        for i in 0..outer {
            matrix[(i, j)] = hessian[(i, j)];
        }
        for (side, volume) in volumes.iter().enumerate() {
            matrix[(outer + side, j)] = volume[(j, 0)];
            matrix[(j, outer + side)] = volume[(j, 0)];
        }
    }
    let mut coupling = Mat::<f64>::zeros(inner, outer + 2);
    for i in 0..inner {
        for j in 0..outer {
            coupling[(i, j)] = hessian[(outer + i, j)];
        }
        for (side, volume) in volumes.iter().enumerate() {
            coupling[(i, outer + side)] = volume[(outer + i, 0)];
        }
    }
    let (factor, stiffened) = positive_factor(hessian, outer, inner);
    let mut answer = coupling.clone();
    if let Some(factor) = &factor {
        factor.solve_in_place(answer.as_mut());
        matmul(matrix.as_mut(), Accum::Add, coupling.transpose(), answer.as_ref(), -1.0, Par::Seq);
    }
    FilmSystem {
        matrix,
        gradient: (0..outer).map(|i| gradient[(i, 0)]).collect(),
        inner_gradient: (0..inner).map(|i| gradient[(outer + i, 0)]).collect(),
        forces,
        stiffened,
        factor,
        coupling,
        answer,
    }
}

/// Tenfold stiffenings tried before a film's inner block counts as hopeless.
const STIFFENINGS: i32 = 12;

/// The Cholesky factor of the inner block, stiffened along its diagonal until it is positive definite.
fn positive_factor(hessian: &Mat<f64>, outer: usize, inner: usize) -> (Option<Llt<f64>>, bool) {
    if inner == 0 {
        return (None, false);
    }
    let scale = (0..inner).map(|i| hessian[(outer + i, outer + i)].abs()).fold(0.0, f64::max);
    for attempt in -1..STIFFENINGS {
        let extra = if attempt < 0 { 0.0 } else { scale * 1e-4 * 10_f64.powi(attempt) };
        let block = Mat::from_fn(inner, inner, |i, j| {
            hessian[(outer + i, outer + j)] + if i == j { extra } else { 0.0 }
        });
        if let Ok(factor) = block.llt(Side::Lower) {
            return (Some(factor), attempt >= 0);
        }
    }
    (None, true)
}
