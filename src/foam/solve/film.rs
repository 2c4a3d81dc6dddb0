//! One film's share of Newton's system, with its inner nodes condensed out.

use super::{
    layout::FilmLayout,
    motion::{Frames, Motions, tangent_projection, wall_curvature},
};
use crate::foam::{
    complex::{Complex, Film, Motion, Node, NodeId, Places, RegionId},
    energy::{Blocks, FilmLoads, add_element},
    volume::{Reference, StripLoads, WallEdge},
};
use crate::index::IndexVec;
use faer::{
    Accum, Mat, MatMut, MatRef, Par, Side, Spec,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch},
        matmul::matmul,
        solvers::Lblt,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
    prelude::{Reborrow, ReborrowMut, Solve},
};
use glam::{DMat3, DVec3};

/// The state that a film is assembled at.
pub(super) struct At<'a> {
    pub(super) complex: &'a Complex,
    pub(super) places: &'a Places,
    pub(super) reference: &'a Reference,
    pub(super) pressures: &'a IndexVec<RegionId, f64>,
    pub(super) motions: &'a Motions,
    pub(super) frames: &'a Frames,
}

/// A film's share before condensation, over its freedoms and then the motions of its inner nodes along their normals.
pub(super) struct FilmHessian {
    hessian: Mat<f64>,
    /// The derivatives of minus the volumes of back and front.
    volumes: [Vec<f64>; 2],
    /// The gradient of the Lagrangian.
    pub(super) gradient: Vec<f64>,
    /// The gradient by the places of the bounding nodes, with what slaved nodes pass on.
    pub(super) forces: Vec<(NodeId, DVec3)>,
}

/// A film's condensed share.
pub(super) struct FilmSystem {
    /// Over the film's unknowns (freedoms, then the two pressures): the condensed matrix.
    pub(super) matrix: Mat<f64>,
    /// The negative eigenvalues of the inner block. A film that bends by more than half a turn has one between fixed borders
    /// at fixed pressures; the inertia of the whole system is that of the inner blocks and of what is left when they are
    /// condensed (E. V. Haynsworth, "Determination of the inertia of a partitioned Hermitian matrix", 1968).
    pub(super) negative: usize,
    factor: Option<Factor>,
    /// Inner rows of the matrix before condensation.
    coupling: Mat<f64>,
    /// The inverse inner block times `coupling`.
    answer: Mat<f64>,
}

impl FilmSystem {
    /// The motions of the inner nodes that `load` on them causes with all other unknowns held.
    pub(super) fn inner_answer(&self, load: &[f64]) -> Vec<f64> {
        let Some(factor) = &self.factor else { return Vec::new() };
        let mut x = load.to_vec();
        factor.solve_in_place(MatMut::from_column_major_slice_mut(&mut x, load.len(), 1));
        x
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

/// Memory for one film after another.
pub(super) struct Scratch {
    /// The Hessian by the places of the nodes.
    hessian: Blocks,
    /// The displacements of the nodes for units of freedoms and inner motions, by columns; and the Hessian times these.
    map: Vec<f64>,
    moved: Vec<f64>,
}

impl Scratch {
    pub(super) fn new() -> Self {
        Self { hessian: Blocks::zero(0), map: Vec::new(), moved: Vec::new() }
    }

    /// Makes the maps of a film zero; gives their rows and columns.
    fn restart(&mut self, layout: &FilmLayout) -> (usize, usize) {
        let (rows, columns) = (3 * layout.nodes.len(), layout.freedoms.len() + layout.inner.len());
        for memory in [&mut self.map, &mut self.moved] {
            memory.clear();
            memory.resize(rows * columns, 0.0);
        }
        (rows, columns)
    }
}

/// Gradients by the places of the film's nodes: of the Lagrangian, and of minus the volumes of back and front.
struct NodeShares {
    lagrangian: Vec<DVec3>,
    back: Vec<DVec3>,
    front: Vec<DVec3>,
}

/// The gradients, and the Hessian into `hessian` if that is asked for.
fn node_shares(
    at: &At<'_>,
    film: &Film,
    layout: &FilmLayout,
    mut hessian: Option<&mut Blocks>,
) -> NodeShares {
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
    };
    if let Some(hessian) = hessian.as_deref_mut() {
        hessian.restart(count);
    }
    let mut absolute = Vec::with_capacity(9);
    let mut local = Vec::with_capacity(9);
    for (element, rows) in film.elements.iter().zip(&layout.rows) {
        absolute.clear();
        absolute.extend(element.nodes.iter().map(|&image| at.complex.place(at.places, image)));
        local.clear();
        local.extend(absolute.iter().map(|&p| p - base));
        let NodeShares { lagrangian, back, front } = &mut shares;
        let targets = &mut [&mut lagrangian[..], &mut back[..], &mut front[..]];
        add_element(element.shape, &local, rows, &all, targets, hessian.as_deref_mut());
        for (wall, edge) in at.complex.wall_edges(element) {
            let strip = WallEdge::new(at.complex, at.reference, element, &absolute, wall, edge);
            let edge_rows: Vec<usize> = edge.iter().map(|&node| rows[node]).collect();
            strip.add(&strips, base, &edge_rows, targets, hessian.as_deref_mut());
        }
    }
    shares
}

/// The displacements of the film's nodes for units of its freedoms and of its inner motions, into `map`; gives the wall
/// projections of the inner nodes.
fn displacements(at: &At<'_>, layout: &FilmLayout, mut map: MatMut<'_, f64>) -> Vec<DMat3> {
    let outer = layout.freedoms.len();
    let add = |map: &mut MatMut<'_, f64>, row: usize, column: usize, d: DVec3| {
        for axis in 0..3 {
            map[(3 * row + axis, column)] += d[axis];
        }
    };
    // A film's freedoms are sorted, and those of a node are consecutive.
    let column_of = |freedom: usize| layout.freedoms.partition_point(|&f| f < freedom);
    for (row, image) in layout.nodes.iter().enumerate() {
        if !matches!(at.complex.nodes[image.node].motion, Motion::Inner(_)) {
            for &(freedom, d) in &at.motions.columns[image.node] {
                add(&mut map, row, column_of(freedom), d);
            }
        }
    }
    let mut projections = Vec::with_capacity(layout.inner.len());
    for (own, (&row, inner_masters)) in layout.inner.iter().zip(&layout.inner_masters).enumerate() {
        let image = layout.nodes[row];
        let node = &at.complex.nodes[image.node];
        let projection = tangent_projection(at.complex, node, at.places[image.node]);
        for &(master, weight) in bounding_masters(at.complex, node) {
            for &(freedom, d) in &at.motions.columns[master] {
                add(&mut map, row, column_of(freedom), weight * (projection * d));
            }
        }
        for &(master, weight) in inner_masters {
            let from = 3 * layout.inner[master];
            for column in (0..outer).chain(outer..outer + own) {
                let d = DVec3::new(map[(from, column)], map[(from + 1, column)], map[(from + 2, column)]);
                add(&mut map, row, column, weight * (projection * d));
            }
        }
        add(&mut map, row, outer + own, projection * at.frames.axis(image.node));
        projections.push(projection);
    }
    projections
}

/// The masters of an inner node that bound films.
fn bounding_masters<'a>(complex: &'a Complex, node: &'a Node) -> impl Iterator<Item = &'a (NodeId, f64)> {
    let masters: &[_] = match &node.motion {
        Motion::Inner(masters) => masters,
        _ => &[],
    };
    masters.iter().filter(|&&(master, _)| !matches!(complex.nodes[master].motion, Motion::Inner(_)))
}

/// Assembles a film.
pub(super) fn assemble(at: &At<'_>, film: &Film, layout: &FilmLayout, scratch: &mut Scratch) -> FilmHessian {
    let (rows, columns) = scratch.restart(layout);
    let Scratch { hessian, map, moved } = scratch;
    let shares = node_shares(at, film, layout, Some(hessian));
    let projections = displacements(at, layout, MatMut::from_column_major_slice_mut(map, rows, columns));
    let forces = forces(at, layout, &projections, &shares.lagrangian, hessian);
    let pull = |nodes: &[DVec3]| pulled(map, nodes);
    let gradient = pull(&shares.lagrangian);
    let volumes = [pull(&shares.back), pull(&shares.front)];
    let map = MatRef::from_column_major_slice(map, rows, columns);
    let mut moved = MatMut::from_column_major_slice_mut(moved, rows, columns);
    matmul(moved.rb_mut(), Accum::Replace, hessian.as_mat(), map, 1.0, Par::Seq);
    let mut own = Mat::zeros(columns, columns);
    matmul(own.as_mut(), Accum::Replace, map.transpose(), moved.rb(), 1.0, Par::Seq);
    FilmHessian { hessian: own, volumes, gradient, forces }
}

/// The gradient of the Lagrangian over a film's freedoms and inner motions alone.
pub(super) fn gradient(at: &At<'_>, film: &Film, layout: &FilmLayout, scratch: &mut Scratch) -> Vec<f64> {
    let (rows, columns) = scratch.restart(layout);
    displacements(at, layout, MatMut::from_column_major_slice_mut(&mut scratch.map, rows, columns));
    pulled(&scratch.map, &node_shares(at, film, layout, None).lagrangian)
}

/// A gradient by the places of nodes as one by the columns of a map to their displacements.
fn pulled(map: &[f64], nodes: &[DVec3]) -> Vec<f64> {
    let along = |column: &[f64]| {
        nodes.iter().zip(column.chunks_exact(3)).map(|(n, d)| n.dot(DVec3::from_slice(d))).sum()
    };
    map.chunks_exact(3 * nodes.len()).map(along).collect()
}

/// The forces on bounding nodes, with what the inner nodes pass on to them; the walls' curvature under the inner nodes goes
/// into the Hessian on the way.
fn forces(
    at: &At<'_>,
    layout: &FilmLayout,
    projections: &[DMat3],
    lagrangian: &[DVec3],
    hessian: &mut Blocks,
) -> Vec<(NodeId, DVec3)> {
    let is_inner = |node: NodeId| matches!(at.complex.nodes[node].motion, Motion::Inner(_));
    let mut forces: Vec<(NodeId, DVec3)> = layout
        .nodes
        .iter()
        .zip(lagrangian)
        .filter(|(image, _)| !is_inner(image.node))
        .map(|(image, &force)| (image.node, force))
        .collect();
    let mut on_inner: Vec<DVec3> = layout.inner.iter().map(|&row| lagrangian[row]).collect();
    // Slaves before their masters: what they pass on presses the masters against their walls, too.
    for (own, &row) in layout.inner.iter().enumerate().rev() {
        let image = layout.nodes[row];
        let node = &at.complex.nodes[image.node];
        let force = on_inner[own];
        if !node.walls.is_empty() {
            let curvature = wall_curvature(at.complex, node, at.places[image.node], force);
            hessian.add(row, row, curvature);
        }
        let passed = projections[own] * force;
        forces.extend(bounding_masters(at.complex, node).map(|&(master, weight)| (master, weight * passed)));
        for &(master, weight) in &layout.inner_masters[own] {
            on_inner[master] += weight * passed;
        }
    }
    forces
}

/// Condenses a film, with `shift` added to the diagonal of its inner block.
pub(super) fn condense(layout: &FilmLayout, film: &FilmHessian, shift: f64) -> FilmSystem {
    let (outer, inner) = (layout.freedoms.len(), layout.inner.len());
    let hessian = film.hessian.as_ref();
    let mut matrix = Mat::<f64>::zeros(outer + 2, outer + 2);
    matrix.as_mut().submatrix_mut(0, 0, outer, outer).copy_from(hessian.submatrix(0, 0, outer, outer));
    let mut coupling = Mat::<f64>::zeros(inner, outer + 2);
    coupling.as_mut().submatrix_mut(0, 0, inner, outer).copy_from(hessian.submatrix(outer, 0, inner, outer));
    for (side, volume) in film.volumes.iter().enumerate() {
        for j in 0..outer {
            matrix[(outer + side, j)] = volume[j];
            matrix[(j, outer + side)] = volume[j];
        }
        for i in 0..inner {
            coupling[(i, outer + side)] = volume[outer + i];
        }
    }
    let mut block = hessian.submatrix(outer, outer, inner, inner).to_owned();
    for i in 0..inner {
        block[(i, i)] += shift;
    }
    let mut answer = coupling.clone();
    let (factor, negative) = match Factor::new(&block) {
        Some((factor, negative)) if inner > 0 => (Some(factor), negative),
        Some(_) => (None, 0),
        None => (None, inner),
    };
    if let Some(factor) = &factor {
        factor.solve_in_place(answer.as_mut());
        matmul(matrix.as_mut(), Accum::Add, coupling.transpose(), answer.as_ref(), -1.0, Par::Seq);
    }
    FilmSystem { matrix, negative, factor, coupling, answer }
}

/// A dense factor. Films are many and small: threads work on films, never within one.
enum Factor {
    /// Of a positive definite matrix: Cholesky's, its upper triangle undefined.
    Positive(Mat<f64>),
    /// Of any other: with pivots.
    Pivoted(Lblt<f64>),
}

impl Factor {
    /// The factor, and how many negative eigenvalues the matrix has; nothing for a matrix that is not one of numbers.
    fn new(matrix: &Mat<f64>) -> Option<(Self, usize)> {
        let size = matrix.nrows();
        let mut memory =
            MemBuffer::try_new(cholesky_in_place_scratch::<f64>(size, Par::Seq, Spec::default())).ok()?;
        let stack = MemStack::new(&mut memory);
        let mut positive = matrix.clone();
        if cholesky_in_place(positive.as_mut(), Default::default(), Par::Seq, stack, Spec::default()).is_ok()
        {
            return Some((Self::Positive(positive), 0));
        }
        if (0..size).any(|i| (0..size).any(|j| !matrix[(i, j)].is_finite())) {
            return None;
        }
        let pivoted = Lblt::new(matrix.as_ref(), Side::Lower);
        let negative = negative_eigenvalues(&pivoted);
        Some((Self::Pivoted(pivoted), negative))
    }

    fn solve_in_place(&self, mut rhs: MatMut<'_, f64>) {
        match self {
            Self::Positive(factor) => {
                solve_lower_triangular_in_place(factor.as_ref(), rhs.as_mut(), Par::Seq);
                solve_upper_triangular_in_place(factor.transpose(), rhs, Par::Seq);
            }
            Self::Pivoted(factor) => factor.solve_in_place(rhs),
        }
    }
}

/// The negative eigenvalues of a matrix: by Sylvester's law as many as its block-diagonal factor has.
pub(in crate::foam) fn negative_eigenvalues(factor: &Lblt<f64>) -> usize {
    let (diagonal, below) = (factor.B_diag().column_vector(), factor.B_subdiag().column_vector());
    let mut count = 0;
    let mut at = 0;
    while at < diagonal.nrows() {
        if at + 1 < diagonal.nrows() && below[at].abs() > 0.0 {
            let (sum, product) =
                (diagonal[at] + diagonal[at + 1], diagonal[at] * diagonal[at + 1] - below[at] * below[at]);
            count += if product < 0.0 { 1 } else { 2 * usize::from(sum < 0.0) };
            at += 2;
        } else {
            count += usize::from(diagonal[at] < 0.0);
            at += 1;
        }
    }
    count
}
