//! Slivers of a division opened before its films are laid.
//!
//! Power cells meet in sides of any length, down to nothing, and a step of the descent may shorten a side by a part of its
//! length only: one sliver would hold up all others. Corners are pushed apart until sides have a length and triangles a height;
//! the descent then tells which of them grow, and which shrink again and change the topology. Pushes are those of
//! position-based dynamics (M. Müller et al., J. Vis. Commun. Image R. 18 (2007)).

use super::{Division, Side, division::CornerImage, films::side_between};
use crate::surface::Gap;
use glam::DVec3;
use std::collections::BTreeMap;

/// The height of a triangle, as a part of the least length of sides.
const LEAST_HEIGHT: f64 = 0.5;
/// Rounds of pushes: slivers touch few others, so that some rounds open them all.
const ROUNDS: usize = 30;
/// A push goes this much beyond what is asked, so that the next round finds it done.
const BEYOND: f64 = 1e-6;

/// Pushes corners apart until sides are at least `least` long, as far as the rounds bring them.
pub(super) fn open(division: &mut Division, gap: &Gap, least: f64) {
    let sides = sides(division);
    for _ in 0..ROUNDS {
        let mut quiet = true;
        for &(first, second, shift) in sides.keys() {
            let ends =
                [(first, [0; 3]), (second, shift)].map(|(corner, shift)| CornerImage { corner, shift });
            let [start, end] = ends.map(|image| division.place(image));
            let length = start.distance(end);
            if length < least {
                let push = 0.5 * ((1.0 + BEYOND) * least - length) * (end - start).normalize_or_zero();
                push_corner(division, gap, ends[0], -push);
                push_corner(division, gap, ends[1], push);
                quiet = false;
            }
        }
        for at in 0..division.polygons.len() {
            let Ok(corners) = <[CornerImage; 3]>::try_from(division.polygons[at].corners.clone()) else {
                continue;
            };
            for turn in 0..3 {
                let [top, a, b] = [0, 1, 2].map(|corner| corners[(corner + turn) % 3]);
                quiet &= !raise(division, gap, top, [a, b], LEAST_HEIGHT * least);
            }
        }
        if quiet {
            return;
        }
    }
}

/// Moves the top of a triangle away from its base if it is not `least` high. Gives whether it was not.
fn raise(division: &mut Division, gap: &Gap, top: CornerImage, base: [CornerImage; 2], least: f64) -> bool {
    let [from, to] = base.map(|image| division.place(image));
    let along = (to - from).normalize_or_zero();
    let arm = division.place(top) - from;
    let up = arm - arm.dot(along) * along;
    let height = up.length();
    if height >= least {
        return false;
    }
    let push = ((1.0 + BEYOND) * least - height) * up.normalize_or_zero();
    push_corner(division, gap, top, 2.0 / 3.0 * push);
    for image in base {
        push_corner(division, gap, image, -push / 3.0);
    }
    true
}

fn push_corner(division: &mut Division, gap: &Gap, image: CornerImage, by: DVec3) {
    let corner = division.corners[image.corner];
    let place = division.retracted(gap, corner.wall, corner.plane, corner.place + by);
    division.corners[image.corner].place = place;
}

/// All borders and edges on walls, with the number of their films.
pub(super) fn sides(division: &Division) -> BTreeMap<Side, usize> {
    let mut sides = BTreeMap::new();
    for polygon in &division.polygons {
        for (at, &to) in polygon.corners.iter().enumerate() {
            let from = polygon.corners[(at + polygon.corners.len() - 1) % polygon.corners.len()];
            *sides.entry(side_between(from, to).0).or_insert(0) += 1;
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        layers::{Arrangement, divided, sheets},
        setup::{FoamSpace, SpaceError},
    };
    use std::ops::ControlFlow;

    #[test]
    fn sides_are_opened_and_corners_stay_on_their_walls() -> Result<(), SpaceError> {
        let space = FoamSpace::Sphere { radii: [1.0, 4.0] };
        let (gap, domain) = (space.gap()?, space.domain()?);
        let goes_on = &mut |_| ControlFlow::Continue(());
        let sown = sheets(&space, &gap, Arrangement::Annealed, 24, 1, goes_on).unwrap();
        let mut division = divided(&gap, &domain, &sown).unwrap();
        let shortest = |division: &Division| {
            let length = |&(first, second, shift): &Side| {
                let end = CornerImage { corner: second, shift };
                division.corners[first].place.distance(division.place(end))
            };
            sides(division).keys().map(length).fold(f64::INFINITY, f64::min) / sown.spacing
        };
        // Of some 230 sides about half a spacing long, the shortest is some thousandths long.
        assert!(shortest(&division) < 0.01, "{}", shortest(&division));
        let before = division.clone();
        open(&mut division, &gap, 0.03 * sown.spacing);
        assert!(shortest(&division) >= 0.03, "{}", shortest(&division));
        for (corner, old) in division.corners.iter().zip(&before.corners) {
            assert!(corner.place.distance(old.place) < 0.1 * sown.spacing);
            if let Some(side) = corner.wall {
                // Projection ends at rounding.
                assert!(gap.wall(side).value(corner.place).abs() < 1e-12 * sown.spacing);
            }
        }
        Ok(())
    }
}
