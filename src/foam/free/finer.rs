//! Films on finer elements, laid on the coarser ones.

use super::{
    Division, FreeFilms, FreeFoam, FreeSettings,
    even::spread_within,
    films::films_refined,
    relax::{Begin, relaxed_from},
};
use crate::{
    foam::{
        complex::{Element, FilmId, NodeImage},
        convert::as_f64,
        relax::{DescentStep, Ending, Extrapolated},
        solve::FactorError,
    },
    surface::Gap,
};
use glam::DVec3;
use std::ops::ControlFlow;

/// Relaxes a foam in balance on elements of half the size and extrapolates. `None` if it comes to no balance there with the
/// same neighbours: then they depend on the mesh.
///
/// # Errors
/// [`FactorError`] if Newton's system cannot be solved.
pub fn extrapolate(
    foam: &FreeFoam,
    gap: &Gap,
    settings: &FreeSettings,
    progress: &mut dyn FnMut(&DescentStep<'_>) -> ControlFlow<()>,
) -> Result<Option<Extrapolated>, FactorError> {
    let fineness = 2 * foam.fineness.max(1);
    let films = films_finer(&foam.division, gap, fineness, (&foam.films, foam.fineness));
    let begin = Begin { division: foam.division.clone(), films, fineness, pressures: foam.pressures.clone() };
    let settings = FreeSettings { fineness, changes_topology: false, ..*settings };
    let finer = relaxed_from(begin, gap, &settings, progress)?;
    let is_balanced = finer.descended.ending == Ending::Converged;
    Ok(is_balanced.then(|| Extrapolated::of(foam.energy, finer.energy)))
}

/// Builds the complex of `division` with `fineness` elements on each half side, at least one, where films of another fineness
/// lie.
pub(super) fn films_finer(
    division: &Division,
    gap: &Gap,
    fineness: usize,
    (before, coarser): (&FreeFilms, usize),
) -> FreeFilms {
    let mut films = films_refined(division, gap, fineness, before);
    laid_within(&mut films, fineness, |film, quad, u, v| {
        let elements = &before.complex.films[film].elements;
        Surface { elements, fineness: coarser, films: before }.at(quad, u, v)
    });
    if coarser == 0 {
        // Where a side is short, its triangle is thin, and so are the parts of quadrilaterals on it.
        spread_within(&mut films);
    }
    films
}

/// Lays the nodes inside films of `fineness` elements on each half side, at least one, where `place` says for a film, one of its
/// quadrilaterals and the parts of the ways along the half side that follows its corner and back along the one before it.
pub(super) fn laid_within(
    films: &mut FreeFilms,
    fineness: usize,
    place: impl Fn(FilmId, usize, f64, f64) -> DVec3,
) {
    let FreeFilms { complex, places, .. } = films;
    for (id, film) in complex.films.enumerated() {
        for (at, element) in film.elements.iter().enumerate() {
            let (quad, at) = (at / fineness.pow(2), at % fineness.pow(2));
            let (i, j) = (at % fineness, at / fineness);
            for (node, image) in element.nodes.iter().enumerate() {
                if complex.nodes[image.node].is_within_film() {
                    let part = |element, node| as_f64(2 * element + node) / as_f64(2 * fineness);
                    places[image.node] = place(id, quad, part(i, node % 3), part(j, node / 3));
                }
            }
        }
    }
}

/// The film of a polygon.
struct Surface<'a> {
    elements: &'a [Element],
    /// Elements on each half side; 0 for triangles round the middle.
    fineness: usize,
    films: &'a FreeFilms,
}

impl Surface<'_> {
    /// The place in the quadrilateral at a corner, at parts of the ways along the half side that follows the corner, `u`, and
    /// back along the one before it, `v`.
    fn at(&self, quad: usize, u: f64, v: f64) -> DVec3 {
        match self.fineness {
            0 => self.in_triangles(quad, u, v),
            _ => self.in_quadrilaterals(quad, u, v),
        }
    }

    fn in_quadrilaterals(&self, quad: usize, u: f64, v: f64) -> DVec3 {
        let ((i, u), (j, v)) = (piece(u, self.fineness), piece(v, self.fineness));
        self.place(quad * self.fineness.pow(2) + j * self.fineness + i, u, v)
    }

    /// The diagonal from the corner to the middle parts the triangle of the side that follows the corner from the one before.
    fn in_triangles(&self, quad: usize, u: f64, v: f64) -> DVec3 {
        if u >= v {
            return self.place(quad, 0.5 * (u - v), v);
        }
        let count = self.elements.len();
        self.place((quad + count - 1) % count, 1.0 - v + 0.5 * (v - u), u)
    }

    fn place(&self, element: usize, u: f64, v: f64) -> DVec3 {
        let Element { shape, nodes } = &self.elements[element];
        let point = shape.at(u, v, 1.0);
        let place = |&image: &NodeImage| self.films.complex.place(&self.films.places, image);
        nodes.iter().zip(point.value).map(|(image, weight)| weight * place(image)).sum()
    }
}

/// Which of `pieces` equal pieces a part of the way lies in, and the part of it.
pub(super) fn piece(part: f64, pieces: usize) -> (usize, f64) {
    let along = part * as_f64(pieces);
    let piece = (0..pieces).rfind(|&piece| as_f64(piece) <= along).unwrap_or(0);
    (piece, along - as_f64(piece))
}
