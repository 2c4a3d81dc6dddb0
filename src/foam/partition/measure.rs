//! The volume of a clipped cell and the area of its section, by Gauss quadrature on the true walls.
//!
//! V = ⅓ ∮ x·n dA with x from the seed. A plane film contributes its distance times its area, by Green's theorem round its
//! loop. A wall's patch is a fan of curved triangles over its arcs, each mapped onto the wall along rays.

use super::{
    clip::{Clipped, Loop, Piece},
    levels::{Level, Levels},
    polyhedron::Polyhedron,
};
use crate::surface::WallSide;
use glam::DVec3;

/// Nodes and weights of the Gauss–Legendre rule with eight points on [0, 1] (Abramowitz and Stegun, table 25.4).
const GAUSS: [(f64, f64); 8] = [
    (0.019_855_071_751_231_884, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

/// Rays meet in a centre of curvature nearer than this many patch radii, and are parallel otherwise.
const FAR_CENTRE: f64 = 20.0;

/// A point of a curve with its derivative times the quadrature weight.
struct Sample {
    point: DVec3,
    step: DVec3,
}

/// The volume of a cell around `seed`; not a number if a patch is too strongly curved for its rays.
pub(super) fn volume(cell: &Clipped, body: &Polyhedron, seed: DVec3, levels: &Levels<'_>) -> f64 {
    let films = cell.films.iter().map(|(face, film)| {
        let normal = body.faces[*face].half_space.normal;
        let distance = film.first().map_or(0.0, |piece| (piece.points[0] - seed).dot(normal));
        distance * plane_area(film, seed, normal, levels)
    });
    let films: f64 = films.sum();
    let mut patches = 0.0;
    for side in WallSide::BOTH {
        for patch in &cell.patches[side as usize] {
            patches += flux(patch, seed, Level::of_wall(side), body, levels);
        }
    }
    (films + patches) / 3.0
}

/// The area of a plane loop.
fn plane_area(film: &Loop, seed: DVec3, normal: DVec3, levels: &Levels<'_>) -> f64 {
    let round: DVec3 = film.iter().map(|piece| moment(piece, seed, normal, levels)).sum();
    0.5 * round.dot(normal)
}

/// ∫ (x − seed) × dx along a piece in the plane with `normal`.
fn moment(piece: &Piece, seed: DVec3, normal: DVec3, levels: &Levels<'_>) -> DVec3 {
    match piece.level {
        None => (piece.points[0] - seed).cross(piece.points[1] - seed),
        Some(level) => samples(&piece.points, normal, level, levels)
            .map(|sample| (sample.point - seed).cross(sample.step))
            .sum(),
    }
}

/// Quadrature points along an arc. Each piece is a chord lifted onto the level within its plane.
fn samples<'a>(
    points: &'a [DVec3],
    normal: DVec3,
    level: Level,
    levels: &'a Levels<'_>,
) -> impl Iterator<Item = Sample> + 'a {
    // Nodes can coincide where four films nearly meet.
    points.windows(2).filter(|ends| ends[0] != ends[1]).flat_map(move |ends| {
        let chord = ends[1] - ends[0];
        let lift = normal.cross(chord);
        GAUSS.iter().map(move |&(parameter, weight)| {
            let start = ends[0] + parameter * chord;
            let point = levels.along(start, lift, level).unwrap_or(DVec3::NAN);
            let gradient = levels.gradient(point);
            let step = chord - lift * (gradient.dot(chord) / gradient.dot(lift));
            Sample { point, step: weight * step }
        })
    })
}

/// The rays that map a flat fan onto a wall: towards a centre, or parallel.
struct Rays {
    axis: DVec3,
    centre: Option<DVec3>,
}

impl Rays {
    /// Rays for the patch round `middle` on the wall: they meet in the centre of mean curvature, if that is near, as the
    /// normals of a sphere do.
    fn new(middle: DVec3, radius: f64, levels: &Levels<'_>, mean_curvature: f64) -> Self {
        let axis = levels.gradient(middle).normalize_or(DVec3::Z);
        let near = mean_curvature.abs() * radius * FAR_CENTRE > 1.0;
        Self { axis, centre: near.then(|| middle - axis / mean_curvature) }
    }

    fn direction(&self, point: DVec3) -> DVec3 {
        self.centre.map_or(self.axis, |centre| (point - centre).normalize_or(self.axis))
    }

    /// How the image of `point` at `image` moves when `point` moves by `step`, given the wall's gradient there.
    fn push(&self, point: DVec3, image: DVec3, gradient: DVec3, step: DVec3) -> DVec3 {
        let direction = self.direction(point);
        let stretch = self.centre.map_or(1.0, |centre| {
            let (far, near) = ((image - centre).dot(direction), (point - centre).length());
            far / near
        });
        let moved = stretch * step;
        moved - direction * (gradient.dot(moved) / gradient.dot(direction))
    }
}

/// ∫ (x − seed)·n dA over a patch, n pointing out of the gap.
fn flux(patch: &Loop, seed: DVec3, level: Level, body: &Polyhedron, levels: &Levels<'_>) -> f64 {
    let corners: Vec<DVec3> = patch.iter().flat_map(|arc| arc.points[1..].iter().copied()).collect();
    let mean = corners.iter().sum::<DVec3>() / crate::foam::convert::as_f64(corners.len());
    let direction = levels.gradient(mean).normalize_or(DVec3::Z);
    let Some(middle) = levels.along(mean, direction, level) else { return f64::NAN };
    let radius = corners.iter().map(|corner| corner.distance(middle)).fold(0.0, f64::max);
    let rays = Rays::new(middle, radius, levels, levels.mean_curvature(middle));
    let mut total = 0.0;
    for arc in patch {
        let normal = body.faces[arc.face].half_space.normal;
        for edge in samples(&arc.points, normal, level, levels) {
            let spoke = edge.point - middle;
            for &(share, weight) in &GAUSS {
                let start = middle + share * spoke;
                let Some(point) = levels.along(start, rays.direction(start), level) else { return f64::NAN };
                let gradient = levels.gradient(point);
                let outward = rays.push(start, point, gradient, spoke);
                let along = rays.push(start, point, gradient, share * edge.step);
                total += weight * (point - seed).dot(outward.cross(along));
            }
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::GAUSS;

    #[test]
    fn the_rule_is_exact_to_the_fifteenth_power() {
        for power in 0..16 {
            let sum: f64 = GAUSS.iter().map(|(x, weight)| weight * x.powi(power)).sum();
            // Sixteen digits are given.
            assert!((sum * f64::from(power + 1) - 1.0).abs() < 1e-14, "power {power}: {sum}");
        }
        let sum: f64 = GAUSS.iter().map(|(x, weight)| weight * x.powi(16)).sum();
        assert!((sum * 17.0 - 1.0).abs() > 1e-10, "no rule of eight points is exact to the sixteenth");
    }
}
