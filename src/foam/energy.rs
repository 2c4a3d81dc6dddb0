//! The energy of films and its exact derivatives.
//!
//! The energy of an element is `γ ∫|a × b| du dv` with `a = ∂x/∂u` and `b = ∂x/∂v`, by quadrature; gradient and Hessian are
//! those of the quadrature itself, so that Newton steps see the discrete energy and nothing else. The films' share of the
//! volumes is polynomial and has the same structure, so both are assembled at once, as the Lagrangian
//! `E − p_b V_b − p_f V_f` of a film between the regions *b* (back) and *f* (front):
//! `∫ γ|N| − r·N` with `N = a × b` and `r = (p_b − p_f)(x)/3 − (p_b o_b − p_f o_f)/3`, where `o` are the regions' origins.

use super::complex::{Complex, Film, MOST_NODES, Places, Shape, ShapePoint};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// The matrix of `x ↦ v × x`.
pub(crate) fn cross_matrix(v: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, v.z, -v.y), DVec3::new(-v.z, 0.0, v.x), DVec3::new(v.y, -v.x, 0.0))
}

/// The matrix `a bᵀ`.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// A square matrix of 3 × 3 blocks, column by column.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    size: usize,
    values: Vec<f64>,
}

impl Blocks {
    pub(crate) fn zero(nodes: usize) -> Self {
        Self { size: 3 * nodes, values: vec![0.0; 9 * nodes * nodes] }
    }

    /// Makes it zero, for an element of so many nodes.
    pub(crate) fn restart(&mut self, nodes: usize) {
        self.size = 3 * nodes;
        self.values.clear();
        self.values.resize(9 * nodes * nodes, 0.0);
    }

    /// The block of a row and a column of nodes.
    pub(crate) fn block(&self, row: usize, column: usize) -> DMat3 {
        let start = |c: usize| (3 * column + c) * self.size + 3 * row;
        let own = |c: usize| DVec3::from_slice(&self.values[start(c)..start(c) + 3]);
        DMat3::from_cols(own(0), own(1), own(2))
    }

    pub(crate) fn add(&mut self, row: usize, column: usize, block: DMat3) {
        for (c, values) in [block.x_axis, block.y_axis, block.z_axis].into_iter().enumerate() {
            let at = (3 * column + c) * self.size + 3 * row;
            self.values[at] += values.x;
            self.values[at + 1] += values.y;
            self.values[at + 2] += values.z;
        }
    }

    pub(crate) fn as_mat(&self) -> faer::MatRef<'_, f64> {
        faer::MatRef::from_column_major_slice(&self.values, self.size, self.size)
    }
}

/// How a film enters the Lagrangian.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilmLoads {
    /// γ.
    pub(crate) tension: f64,
    /// `p_b − p_f`.
    pub(crate) difference: f64,
    /// `(p_b o_b − p_f o_f) / 3`.
    pub(crate) moment: DVec3,
}

/// Place and tangents of an element at a quadrature point.
pub(crate) fn jet(point: &ShapePoint, nodes: &[DVec3]) -> (DVec3, DVec3, DVec3) {
    let (mut x, mut a, mut b) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for (i, &node) in nodes.iter().enumerate() {
        x += point.value[i] * node;
        a += point.du[i] * node;
        b += point.dv[i] * node;
    }
    (x, a, b)
}

/// The normal of an element at one of its nodes, as long as the element is large.
pub(crate) fn node_normal(shape: Shape, node: usize, nodes: &[DVec3]) -> DVec3 {
    let (u, v) = shape.node_at(node);
    let (_, a, b) = jet(&shape.at(u, v, 1.0), nodes);
    a.cross(b)
}

/// The area of an element.
#[must_use]
pub(crate) fn element_area(shape: Shape, nodes: &[DVec3]) -> f64 {
    shape
        .points()
        .iter()
        .map(|point| {
            let (_, a, b) = jet(point, nodes);
            point.weight * a.cross(b).length()
        })
        .sum()
}

/// Whether the normals of an element differ from their mean by more than a right angle: it is turned over somewhere, and its
/// quadrature means nothing.
#[must_use]
pub(crate) fn is_folded(shape: Shape, nodes: &[DVec3]) -> bool {
    let normals = shape.points().iter().map(|point| {
        let (_, a, b) = jet(point, nodes);
        a.cross(b)
    });
    let mean: DVec3 = normals.clone().sum();
    !normals.into_iter().all(|normal| normal.dot(mean) > 0.0)
}

/// The energy of all films: tension times area.
#[must_use]
pub fn energy(complex: &Complex, places: &Places) -> f64 {
    let of_film = |film: &Film| {
        let mut nodes = [DVec3::ZERO; MOST_NODES];
        let area: f64 = film
            .elements
            .iter()
            .map(|element| {
                let nodes = &mut nodes[..element.nodes.len()];
                nodes
                    .iter_mut()
                    .zip(&element.nodes)
                    .for_each(|(node, &image)| *node = complex.place(places, image));
                element_area(element.shape, nodes)
            })
            .sum();
        film.tension * area
    };
    // Summed in the films' order, whoever computed them.
    let energies: Vec<f64> =
        complex.films.as_slice().par_iter().with_min_len(LEAST_SHARE).map(of_film).collect();
    energies.iter().sum()
}

/// Films that are worth a thread's while.
const LEAST_SHARE: usize = 32;

/// Adds the gradients of an element's Lagrangians at several loads, and the Hessian of the first; `local` are the rows of its
/// nodes. Gives its energy at the first.
pub(crate) fn add_element(
    shape: Shape,
    nodes: &[DVec3],
    local: &[usize],
    loads: &[FilmLoads],
    gradients: &mut [&mut [DVec3]],
    hessian: Option<&mut Blocks>,
) -> f64 {
    let mut energy = 0.0;
    let mut lower = [[[0.0; 9]; MOST_NODES]; MOST_NODES];
    let Some(first) = loads.first() else { return energy };
    for point in shape.points() {
        let (x, a, b) = jet(point, nodes);
        let normal = a.cross(b);
        let length = normal.length();
        let unit = normal / length;
        energy += point.weight * first.tension * length;
        for (load, gradient) in loads.iter().zip(gradients.iter_mut()) {
            let m = load.along(x, unit);
            let (gx, ga, gb) = (-load.difference / 3.0 * normal, b.cross(m), m.cross(a));
            for (i, &row) in local.iter().enumerate() {
                gradient[row] += point.weight * (point.value[i] * gx + point.du[i] * ga + point.dv[i] * gb);
            }
        }
        if hessian.is_none() {
            continue;
        }
        let (na, nb) = (-cross_matrix(b), cross_matrix(a));
        let flat = (first.tension / length) * (DMat3::IDENTITY - outer(unit, unit));
        let (ta, tb) = (na.transpose() * flat, nb.transpose() * flat);
        let third = first.difference / 3.0;
        let second = Second {
            aa: ta * na,
            ab: ta * nb - cross_matrix(first.along(x, unit)),
            bb: tb * nb,
            xa: -third * na,
            xb: -third * nb,
        };
        second.scatter(point, nodes.len(), &mut lower);
    }
    if let Some(hessian) = hessian {
        for (j, &column) in local.iter().enumerate() {
            let block = |i: usize| DMat3::from_cols_array(&lower[j][i]);
            hessian.add(column, column, block(j));
            for (i, &row) in local.iter().enumerate().skip(j + 1) {
                hessian.add(row, column, block(i));
                hessian.add(column, row, block(i).transpose());
            }
        }
    }
    energy
}

impl FilmLoads {
    /// `γ n − r`: what the Lagrangian changes by with the area vector.
    fn along(&self, x: DVec3, unit: DVec3) -> DVec3 {
        self.tension * unit - (self.difference / 3.0 * x - self.moment)
    }
}

/// Second derivatives by place and tangents at one point.
struct Second {
    aa: DMat3,
    ab: DMat3,
    bb: DMat3,
    xa: DMat3,
    xb: DMat3,
}

impl Second {
    /// Adds the blocks on and below the diagonal, column by column; the entries of a block lie side by side, for the compiler
    /// to make vectors of.
    fn scatter(&self, point: &ShapePoint, count: usize, lower: &mut [[[f64; 9]; MOST_NODES]; MOST_NODES]) {
        let (ba, ax, bx) = (self.ab.transpose(), self.xa.transpose(), self.xb.transpose());
        for (j, column) in lower.iter_mut().enumerate().take(count) {
            let (n, u, v) =
                (point.weight * point.value[j], point.weight * point.du[j], point.weight * point.dv[j]);
            let x = (u * self.xa + v * self.xb).to_cols_array();
            let a = (n * ax + u * self.aa + v * self.ab).to_cols_array();
            let b = (n * bx + u * ba + v * self.bb).to_cols_array();
            for (i, block) in column.iter_mut().enumerate().take(count).skip(j) {
                let (n, u, v) = (point.value[i], point.du[i], point.dv[i]);
                for (at, entry) in block.iter_mut().enumerate() {
                    *entry += n * x[at] + u * a[at] + v * b[at];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::complex::Shape;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn crooked(shape: Shape, seed: u64) -> Vec<DVec3> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let flat: Vec<DVec3> = match shape {
            Shape::Quad9 => (0..9).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3), 0.0)).collect(),
            _ => [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)][..shape.nodes()]
                .iter()
                .map(|&(x, y)| DVec3::new(x, y, 0.0))
                .collect(),
        };
        let mut noise = || random.random_range(-0.2..0.2);
        flat.into_iter().map(|p| p + DVec3::new(noise(), noise(), noise())).collect()
    }

    const LOADS: FilmLoads = FilmLoads { tension: 1.3, difference: 0.7, moment: DVec3::new(0.1, -0.4, 0.25) };

    fn lagrangian(shape: Shape, nodes: &[DVec3]) -> f64 {
        shape
            .points()
            .iter()
            .map(|point| {
                let (x, a, b) = jet(point, nodes);
                let normal = a.cross(b);
                let r = LOADS.difference / 3.0 * x - LOADS.moment;
                point.weight * (LOADS.tension * normal.length() - r.dot(normal))
            })
            .sum()
    }

    #[test]
    fn gradient_and_hessian_are_the_differences_of_the_value() {
        for shape in [Shape::Quad9, Shape::Tri6, Shape::Tri3] {
            let nodes = crooked(shape, 5);
            let count = shape.nodes();
            let local: Vec<usize> = (0..count).collect();
            let mut hessian = Blocks::zero(count);
            let mut gradient = vec![DVec3::ZERO; count];
            add_element(shape, &nodes, &local, &[LOADS], &mut [&mut gradient], Some(&mut hessian));
            let step = 1e-5;
            for column in 0..3 * count {
                let moved = |sign: f64| {
                    let mut nodes = nodes.clone();
                    nodes[column / 3][column % 3] += sign * step;
                    let mut g = vec![DVec3::ZERO; count];
                    add_element(shape, &nodes, &local, &[LOADS], &mut [&mut g], None);
                    (lagrangian(shape, &nodes), g)
                };
                let ((up, gu), (down, gd)) = (moved(1.0), moved(-1.0));
                // Central differences err by step² and by rounding over the step: 1e-9 holds both.
                let slope = (up - down) / (2.0 * step);
                assert!((gradient[column / 3][column % 3] - slope).abs() < 1e-9, "{shape:?} {column}");
                for row in 0..3 * count {
                    let second = (gu[row / 3][row % 3] - gd[row / 3][row % 3]) / (2.0 * step);
                    assert!(
                        (hessian.as_mat()[(row, column)] - second).abs() < 1e-8,
                        "{shape:?} {row} {column}"
                    );
                }
            }
        }
    }
}
