//! The symmetries of a triply periodic gap: motions of the lattice's box that take `Φ` to `±Φ`, and so walls to walls.
//!
//! They are found, not listed: signed permutations of the axes with translations by quarters of the period, each tried at
//! a few generic points. Cubic surfaces are made of nothing else.

use crate::surface::{LevelSet, Period};
use glam::{DVec3, IVec3};

/// A signed permutation of the axes, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetry {
    axes: [usize; 3],
    signs: DVec3,
    translation: DVec3,
}

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Points off every plane and axis of symmetry, in periods.
const PROBES: [DVec3; 4] = [
    DVec3::new(0.137, 0.291, 0.423),
    DVec3::new(0.613, 0.071, 0.883),
    DVec3::new(0.347, 0.769, 0.179),
    DVec3::new(0.919, 0.531, 0.659),
];

impl Symmetry {
    /// Where it takes a point.
    #[must_use]
    pub fn apply(&self, p: DVec3) -> DVec3 {
        self.signs * DVec3::new(p[self.axes[0]], p[self.axes[1]], p[self.axes[2]]) + self.translation
    }

    /// All symmetries of a surface with one period along all three axes, the identity first; the identity alone otherwise.
    #[must_use]
    pub fn all_of(surface: &dyn LevelSet) -> Vec<Self> {
        let identity = Self { axes: ORDERS[0], signs: DVec3::ONE, translation: DVec3::ZERO };
        let Period([Some(period), Some(_), Some(_)]) = surface.period() else { return vec![identity] };
        let mut found = Vec::new();
        for axes in ORDERS {
            for signs in 0..8 {
                for quarters in 0..64 {
                    let candidate = Self {
                        axes,
                        signs: DVec3::from_array(
                            [1, 2, 4].map(|bit| if signs & bit == 0 { 1.0 } else { -1.0 }),
                        ),
                        translation: 0.25
                            * period
                            * IVec3::new(quarters % 4, quarters / 4 % 4, quarters / 16).as_dvec3(),
                    };
                    if candidate.keeps(surface, period) {
                        found.push(candidate);
                    }
                }
            }
        }
        found
    }

    fn keeps(&self, surface: &dyn LevelSet, period: f64) -> bool {
        let mut sign = 0.0;
        PROBES.iter().all(|&probe| {
            let (before, after) = (surface.value(period * probe), surface.value(self.apply(period * probe)));
            if sign == 0.0 {
                sign = if before * after < 0.0 { -1.0 } else { 1.0 };
            }
            (after - sign * before).abs() < 1e-9
        })
    }
}

/// Distances modulo a group of symmetries and a lattice.
#[derive(Clone, Debug)]
pub struct Orbits {
    period: Period,
    symmetries: Vec<Symmetry>,
}

impl Orbits {
    /// Of a surface.
    #[must_use]
    pub fn of(surface: &dyn LevelSet) -> Self {
        Self { period: surface.period(), symmetries: Symmetry::all_of(surface) }
    }

    /// The number of symmetries in one period.
    #[must_use]
    pub fn order(&self) -> usize {
        self.symmetries.len()
    }

    /// The distance from `p` to the nearest image of `q`.
    #[must_use]
    pub fn distance(&self, p: DVec3, q: DVec3) -> f64 {
        self.symmetries
            .iter()
            .map(|g| self.period.nearest_image(p - g.apply(q)).length_squared())
            .fold(f64::INFINITY, f64::min)
            .sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Diamond, Gyroid, Plane, SchwarzP};

    #[test]
    fn cubic_surfaces_have_their_known_groups() {
        // P: Im-3m with sides swapped by the centring, 2 × 48. G: I4₁32 with sides swapped by inversion, 24 × 2 × 2. D in its
        // cubic box: Pn-3m.
        assert_eq!(Symmetry::all_of(&SchwarzP { period: 1.3 }).len(), 96);
        assert_eq!(Symmetry::all_of(&Gyroid { period: 1.3 }).len(), 96);
        assert_eq!(Symmetry::all_of(&Diamond { period: 1.3 }).len() % 48, 0);
        assert_eq!(Symmetry::all_of(&Plane { periods: [1.0, 1.0] }).len(), 1);
    }

    #[test]
    fn distances_do_not_depend_on_the_image() {
        let orbits = Orbits::of(&SchwarzP { period: 1.0 });
        let (p, q) = (DVec3::new(0.1, 0.3, 0.2), DVec3::new(0.7, 0.45, 0.05));
        let moved = DVec3::new(-q.y, q.x, -q.z) + DVec3::new(0.5, 1.5, -0.5);
        assert!((orbits.distance(p, q) - orbits.distance(p, moved)).abs() < 1e-12);
    }
}
