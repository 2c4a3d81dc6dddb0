//! The film between an edge and the wall that its ends lie on.
//!
//! A film whose edge cuts short across a curved wall has less area than one that ends on it, the more so the farther apart the
//! edge's nodes lie and the less evenly: the least energy is that of a distorted contact line. With the area of the sliver
//! (`sliver.rs`), less that of a film that reaches beyond its wall, the energy is that of films which end on the wall, and
//! cannot fall below the true minimum.

use super::sliver::{Foot, FootSlopes, Reach, across};
use crate::foam::energy::Blocks;
use glam::DVec3;

/// The area by which films on one side of a wall are short of it.
#[derive(Clone, Debug)]
pub(super) struct Rim {
    reach: Reach,
    /// 1 where the films lie on the side of the wall's negative values, −1 on the other.
    side: f64,
}

impl Rim {
    /// For films on the side of the wall's negative values, or of the positive ones.
    pub(super) fn new(reach: Reach, negative: bool) -> Self {
        Self { reach, side: if negative { 1.0 } else { -1.0 } }
    }

    /// The area of the film that is missing; negative where it reaches beyond the wall.
    pub(super) fn value(&self, nodes: &[DVec3]) -> f64 {
        let [area] = self.reach.sum(nodes, |foot| {
            [across().map(|(s, weight)| weight * foot.z * foot.d.cross(foot.at(s).1).length()).sum()]
        });
        self.side * area
    }

    /// Adds `factor` times the gradient, and the Hessian where it is asked for.
    pub(super) fn add(
        &self,
        factor: f64,
        nodes: &[DVec3],
        gradient: &mut [DVec3],
        hessian: Option<&mut Blocks>,
    ) {
        self.reach.add(self.side * factor, nodes, gradient, hessian, slopes);
    }
}

/// The slopes of the area over one foot.
fn slopes(foot: &Foot<'_>) -> FootSlopes {
    let (d, z) = (foot.d, foot.z);
    let mut by = FootSlopes::default();
    for (s, weight) in across() {
        let m = foot.at(s).1;
        let normal = d.cross(m);
        let length = normal.length();
        let u = normal / length;
        by.z += weight * (length + s * z * u.dot(d.cross(foot.turn)));
        by.d += weight * z * m.cross(u);
        by.along += weight * z * u.cross(d);
        by.turn += weight * s * z * z * u.cross(d);
    }
    by
}

#[cfg(test)]
mod tests {
    use super::{super::facet::tests::check_derivatives, *};
    use crate::evolver::{Document, source::Source};

    /// The sphere of radius 2, with the films inside or outside.
    fn rim(inside: bool) -> Rim {
        let text = "constraint 1\nformula: x^2 + y^2 + z^2 = 4\nvertices\n1 0 0 0\n";
        let document = Document::new(&Source::new("wall.fe", text)).unwrap();
        let constraint = document.data.constraints.first().unwrap();
        Rim::new(Reach::new(constraint.formula.bind(&document.data.variables)), inside)
    }

    fn on(angle: f64, height: f64) -> DVec3 {
        let ring = (4.0 - height * height).sqrt();
        DVec3::new(ring * angle.cos(), ring * angle.sin(), height)
    }

    #[test]
    fn gradients_and_hessians_are_the_differences_of_the_values() {
        for inside in [true, false] {
            let rim = rim(inside);
            for nodes in [vec![on(0.3, -0.2), on(0.7, 0.1)], vec![on(0.3, -0.2), on(0.45, 0.0), on(0.7, 0.1)]]
            {
                check_derivatives(&nodes, |n| rim.value(n), |n, g, h| rim.add(1.0, n, g, h));
            }
        }
    }

    #[test]
    fn a_polygon_and_its_rim_are_the_disc() {
        // The disc stands at a right angle on the sphere: rim and disc lie in one plane. Corners at uneven angles.
        let rim = rim(true);
        let angle = |at: u32| std::f64::consts::TAU * (f64::from(at) + 0.3 * f64::from(at % 2)) / 12.0;
        let area: f64 = (0..12)
            .map(|at| {
                let nodes = [on(angle(at), 0.0), on(angle(at + 1), 0.0)];
                0.5 * nodes[0].cross(nodes[1]).length() + rim.value(&nodes)
            })
            .sum();
        // The polygon alone is too small by a twentieth; four Gauss points along chords of 39 degrees leave 1e-6 of it.
        assert!((area / (4.0 * std::f64::consts::PI) - 1.0).abs() < 2e-6, "{area}");
    }
}
