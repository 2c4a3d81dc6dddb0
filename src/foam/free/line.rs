//! Lines of quadratic pieces: places along them by their nodes or by their length.

use super::finer::piece;
use crate::foam::complex::{gauss, quadratic};
use glam::DVec3;

/// Gauss points of a piece's length: its speed is nearly even.
const POINTS: usize = 4;
/// Newton steps to a length along a piece.
const STEPS: usize = 8;

/// Quadratic pieces on end.
pub(super) struct Line<'a> {
    /// The ends and middles of the pieces.
    places: &'a [DVec3],
    points: Vec<(f64, f64)>,
}

/// A piece, and a parameter within it from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    piece: usize,
    part: f64,
}

impl<'a> Line<'a> {
    /// The line through ends and middles of pieces.
    pub(super) fn new(places: &'a [DVec3]) -> Self {
        Self { places, points: gauss(POINTS) }
    }

    const fn pieces(&self) -> usize {
        (self.places.len() - 1) / 2
    }

    /// The place there.
    pub(super) fn at(&self, Along { piece, part }: Along) -> DVec3 {
        let (weights, _) = quadratic(part);
        (0..3).map(|at| weights[at] * self.places[2 * piece + at]).sum()
    }

    /// Where a part of the nodes lies behind.
    pub(super) fn at_node(&self, part: f64) -> Along {
        let (piece, part) = piece(part, self.pieces());
        Along { piece, part }
    }

    /// Where a part of the length lies behind.
    pub(super) fn at_length(&self, part: f64) -> Along {
        let lengths: Vec<f64> =
            (0..self.pieces()).map(|piece| self.length(Along { piece, part: 1.0 })).collect();
        let mut rest = part * lengths.iter().sum::<f64>();
        let mut piece = 0;
        while piece + 1 < lengths.len() && rest > lengths[piece] {
            rest -= lengths[piece];
            piece += 1;
        }
        let mut along = Along { piece, part: rest / lengths[piece] };
        for _ in 0..STEPS {
            along.part += (rest - self.length(along)) / self.speed(along);
        }
        along
    }

    fn speed(&self, Along { piece, part }: Along) -> f64 {
        let (_, slopes) = quadratic(part);
        (0..3).map(|at| slopes[at] * self.places[2 * piece + at]).sum::<DVec3>().length()
    }

    /// The length of a piece up to a part of it.
    fn length(&self, Along { piece, part }: Along) -> f64 {
        let speed = |point: f64| self.speed(Along { piece, part: part * point });
        self.points.iter().map(|&(point, weight)| part * weight * speed(point)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_line_have_their_lengths() {
        // Two pieces on the x axis, the first with its middle node off the middle: x = 0.4 t + 0.6 t², then 1 + 2t.
        let places = [0.0, 0.35, 1.0, 2.0, 3.0].map(|x| DVec3::new(x, 0.0, 0.0));
        let line = Line::new(&places);
        for part in [0.0, 0.1, 1.0 / 3.0, 0.5, 0.9, 1.0] {
            let x = line.at(line.at_length(part)).x;
            // Newton's steps are exact to rounding here.
            assert!((x - 3.0 * part).abs() < 1e-14, "{part}: {x}");
        }
        assert!((line.at(line.at_node(0.25)).x - 0.35).abs() < 1e-15);
        assert!((line.at(line.at_node(1.0)).x - 3.0).abs() < 1e-15);
    }
}
