//! How the defects of one layer sit to those of the other, and what chance would give.
//!
//! Every cell is put on the middle surface, over the midst of its opening, with its charge 6 − n. Two figures:
//!
//! * **nearest**: the mean distance from a cell that is no hexagon to the nearest of the other layer, over both layers;
//! * **correlation**: Pearson's, over all cells of both layers, of a cell's charge with the mean charge of the other layer
//!   round it, weighted by `exp(−d²/2s²)` with `s` half a spacing: positive if fives sit over fives, negative over sevens.
//!
//! Each is compared with two kinds of chance. *Dealt*: the upper layer's charges are dealt anew among its cells. *Moved*:
//! the upper layer as it is, moved by an isometry of the surface that leaves each wall in its place (a shift of the plane, a
//! turn of the sphere or torus, one of the point group of a triply periodic surface). Moving keeps each layer's own order and its
//! place on necks and flat points, so that what both owe to the curvature is not taken for an interaction; dealing does not.
//!
//! Source of the tests: B. Phipson and G. K. Smyth, "Permutation p-values should never be zero", Stat. Appl. Genet. Mol.
//! Biol. 9 (2010), for `(1 + extreme)/(1 + trials)`.

use crate::foam::{
    bubble::Symmetry,
    convert::as_f64,
    free::{CornerImage, Division},
};
use crate::surface::{Gap, LevelSet, Period};
use glam::{DMat3, DQuat, DVec3, IVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::f64::consts::TAU;

/// How the defects of the two layers sit to each other. Lengths are straight, in units of the spacing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Companions {
    /// Cells that are no hexagons, in the lower and the upper layer.
    pub defects: [usize; 2],
    /// The correlation, over pairs of touching cells of the two layers, of their charges.
    pub contact_correlation: f64,
    /// The correlation of charges that lie over each other.
    pub correlation: Compared,
    /// The distance to the nearest defect of the other layer; not a number without defects.
    pub nearest: Compared,
}

/// A figure and what chance makes of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// As it is.
    pub found: f64,
    /// With the upper layer's charges dealt anew.
    pub dealt: Chance,
    /// With the upper layer moved.
    pub moved: Chance,
}

/// A figure under chance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Chance {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub deviation: f64,
    /// The probability of a figure at least as far from the mean: two-sided.
    pub p: f64,
    /// All trials, in order.
    #[serde(skip)]
    pub trials: Vec<f64>,
}

/// Cells on the middle surface with their charges.
#[derive(Clone, Debug, PartialEq)]
pub struct Charged {
    /// Where they are.
    pub places: Vec<DVec3>,
    /// 6 − n.
    pub charges: Vec<f64>,
}

/// Trials of each kind of chance; a finite group of isometries gives as many as it has.
const TRIALS: usize = 999;
/// The width of the weights, in spacings.
const WIDTH: f64 = 0.5;

/// The cells of both layers on the middle surface; `sides` are the numbers of sides of all cells.
#[must_use]
pub fn charged(division: &Division, gap: &Gap, sides: &[usize]) -> [Charged; 2] {
    let cells = division.seeds.len();
    let mut sums = vec![(DVec3::ZERO, 0.0); cells];
    for polygon in &division.polygons {
        let far = division.period.translation(polygon.shift);
        for &image in polygon.corners.iter().filter(|image| on_wall(division, **image)) {
            let place = division.place(image);
            for (cell, place) in [(polygon.cell, place), (polygon.neighbour, place - far)] {
                sums[cell].0 += place;
                sums[cell].1 += 1.0;
            }
        }
    }
    let place = |cell: usize| {
        let (sum, count) = sums[cell];
        let midst = if count > 0.0 { sum / count } else { division.seeds[cell] };
        gap.middle().project(midst, 0.0).unwrap_or(midst)
    };
    [0..division.lower(), division.lower()..cells].map(|layer| Charged {
        places: layer.clone().map(place).collect(),
        charges: layer.map(|cell| 6.0 - as_f64(sides[cell])).collect(),
    })
}

fn on_wall(division: &Division, image: CornerImage) -> bool {
    division.corners[image.corner].wall.is_some()
}

/// Compares the two layers. The random numbers of the trials start from `seed`.
#[must_use]
pub fn companions(division: &Division, gap: &Gap, sides: &[usize], spacing: f64, seed: u64) -> Companions {
    let [lower, upper] = charged(division, gap, sides);
    let period = division.period;
    let figures = |upper: &Charged| {
        let field = Field { lower: &lower, upper, period, spacing };
        [field.correlation(), field.nearest()]
    };
    let found = figures(&upper);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let dealt: Vec<[f64; 2]> = (0..TRIALS)
        .map(|_| {
            figures(&Charged { charges: shuffled(&upper.charges, &mut rng), places: upper.places.clone() })
        })
        .collect();
    let moved: Vec<[f64; 2]> = motions(gap.middle().as_ref(), &mut rng)
        .iter()
        .map(|motion| {
            let places = upper.places.iter().map(|&place| motion.apply(place)).collect();
            figures(&Charged { places, charges: upper.charges.clone() })
        })
        .collect();
    let compared = |at: usize| Compared {
        found: found[at],
        dealt: Chance::new(found[at], dealt.iter().map(|trial| trial[at]).collect()),
        moved: Chance::new(found[at], moved.iter().map(|trial| trial[at]).collect()),
    };
    let charge = |cell: usize| 6.0 - as_f64(sides[cell]);
    let touching: Vec<(f64, f64)> = division
        .polygons
        .iter()
        .filter(|film| division.is_lower(film.cell) != division.is_lower(film.neighbour))
        .map(|film| {
            let (a, b) = (charge(film.cell), charge(film.neighbour));
            if division.is_lower(film.cell) { (a, b) } else { (b, a) }
        })
        .collect();
    Companions {
        defects: [&lower, &upper].map(|layer| layer.defects().count()),
        contact_correlation: correlation(&touching),
        correlation: compared(0),
        nearest: compared(1),
    }
}

impl Charged {
    /// The places of the cells that are no hexagons.
    pub fn defects(&self) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        self.places.iter().zip(&self.charges).filter(|(_, q)| q.abs() > 0.5).map(|(&p, &q)| (p, q))
    }
}

/// Two layers to compare.
struct Field<'a> {
    lower: &'a Charged,
    upper: &'a Charged,
    period: Period,
    spacing: f64,
}

impl Field<'_> {
    fn distance(&self, p: DVec3, q: DVec3) -> f64 {
        self.period.nearest_image(p - q).length() / self.spacing
    }

    fn both_ways(&self) -> [(&Charged, &Charged); 2] {
        [(self.lower, self.upper), (self.upper, self.lower)]
    }

    fn correlation(&self) -> f64 {
        let mut pairs = Vec::with_capacity(self.lower.places.len() + self.upper.places.len());
        for (here, there) in self.both_ways() {
            for (&place, &charge) in here.places.iter().zip(&here.charges) {
                let (mut sum, mut weights) = (0.0, 0.0);
                for (&other, &far) in there.places.iter().zip(&there.charges) {
                    let weight = (-0.5 * (self.distance(place, other) / WIDTH).powi(2)).exp();
                    sum += weight * far;
                    weights += weight;
                }
                pairs.push((charge, sum / weights));
            }
        }
        correlation(&pairs)
    }

    fn nearest(&self) -> f64 {
        let distances = self.both_ways().into_iter().flat_map(|(here, there)| {
            here.defects().map(|(place, _)| {
                there.defects().map(|(other, _)| self.distance(place, other)).fold(f64::NAN, f64::min)
            })
        });
        mean(distances)
    }
}

impl Chance {
    fn new(found: f64, trials: Vec<f64>) -> Self {
        let mean = mean(trials.iter().copied());
        let count = as_f64(trials.len());
        let deviation = (trials.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
        let off = (found - mean).abs() * (1.0 - 1e-12);
        let extreme = as_f64(trials.iter().filter(|x| (**x - mean).abs() >= off).count());
        let p = if mean.is_nan() || found.is_nan() { f64::NAN } else { (1.0 + extreme) / (1.0 + count) };
        Self { mean, deviation, p, trials }
    }
}

/// An isometry of a surface.
enum Motion {
    Rigid(DMat3, DVec3),
    Symmetry(Symmetry),
}

impl Motion {
    fn apply(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Rigid(turn, shift) => *turn * p + *shift,
            Self::Symmetry(symmetry) => symmetry.apply(p),
        }
    }
}

/// Isometries that leave the walls where they are, the identity left out.
fn motions(surface: &dyn LevelSet, rng: &mut ChaCha8Rng) -> Vec<Motion> {
    match surface.period().0 {
        [Some(_), Some(_), Some(_)] => {
            // Symmetries that swap the sides would take one layer to the other wall.
            let probe = DVec3::new(0.137, 0.291, 0.423);
            let keeps_sides = |g: &Symmetry| surface.value(g.apply(probe)) * surface.value(probe) > 0.0;
            let all = Symmetry::all_of(surface).into_iter().filter(keeps_sides);
            let is_identity =
                |g: &Symmetry| surface.period().nearest_image(g.apply(probe) - probe).length() < 1e-9;
            all.filter(|g| !is_identity(g)).map(Motion::Symmetry).collect()
        }
        [None, None, None] => {
            let about_axis = surface.name() == "torus";
            (0..TRIALS).map(|_| Motion::Rigid(turn(about_axis, rng), DVec3::ZERO)).collect()
        }
        _ => (0..TRIALS)
            .map(|_| {
                let part = DVec3::new(rng.random(), rng.random(), 0.0);
                let shift = part * surface.period().translation(IVec3::ONE);
                Motion::Rigid(DMat3::IDENTITY, shift)
            })
            .collect(),
    }
}

/// A turn about the z axis, or any turn, with equal chances (K. Shoemake, "Uniform random rotations", Graphics Gems III, 1992).
fn turn(about_axis: bool, rng: &mut ChaCha8Rng) -> DMat3 {
    let [a, b, c]: [f64; 3] = [rng.random(), rng.random(), rng.random()];
    if about_axis {
        return DMat3::from_rotation_z(TAU * a);
    }
    let (near, far) = ((1.0 - a).sqrt(), a.sqrt());
    let ((s, t), (u, v)) = ((TAU * b).sin_cos(), (TAU * c).sin_cos());
    DMat3::from_quat(DQuat::from_xyzw(near * s, near * t, far * u, far * v))
}

/// Fisher and Yates' shuffle.
fn shuffled(values: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut values = values.to_vec();
    for at in (1..values.len()).rev() {
        values.swap(at, rng.random_range(0..=at));
    }
    values
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let (a, b) = (mean(pairs.iter().map(|p| p.0)), mean(pairs.iter().map(|p| p.1)));
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
    sum(&|p| (p.0 - a) * (p.1 - b)) / (sum(&|p| (p.0 - a).powi(2)) * sum(&|p| (p.1 - b).powi(2))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SchwarzP, Sphere};

    /// A square sheet of hexagons' stand-ins with a five and a seven here and there.
    fn sheet(seed: u64) -> Charged {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let places = (0..400).map(|at| {
            DVec3::new(f64::from(at % 20), f64::from(at / 20), 0.0)
                + 0.3 * DVec3::new(rng.random(), rng.random(), 0.0)
        });
        let places = places.collect();
        let charges = (0..400)
            .map(|_| if rng.random::<f64>() < 0.1 { [1.0, -1.0][rng.random_range(0..2)] } else { 0.0 });
        Charged { places, charges: charges.collect() }
    }

    fn field<'a>(lower: &'a Charged, upper: &'a Charged) -> Field<'a> {
        Field { lower, upper, period: Period([Some(20.0), Some(20.0), None]), spacing: 1.0 }
    }

    #[test]
    fn layers_that_copy_each_other_are_correlated_and_strangers_are_not() {
        let (lower, stranger) = (sheet(1), sheet(2));
        let opposite = Charged { charges: lower.charges.iter().map(|q| -q).collect(), ..lower.clone() };
        assert!(field(&lower, &lower).correlation() > 0.8);
        assert!(field(&lower, &opposite).correlation() < -0.8);
        // Of 400 independent pairs the correlation is 0.05 wide; smoothing makes neighbours dependent.
        assert!(field(&lower, &stranger).correlation().abs() < 0.2);
        assert!(field(&lower, &lower).nearest() < 1e-12);
        assert!(field(&lower, &stranger).nearest() > 0.5);
    }

    #[test]
    fn chance_has_the_level_that_it_says() {
        // Under chance every rank of the found figure is as likely: the largest of 1 + 19 has p = 0.05.
        let trials: Vec<f64> = (0..19).map(f64::from).collect();
        assert!((Chance::new(60.0, trials.clone()).p - 0.05).abs() < 1e-12);
        assert!((Chance::new(9.0, trials).p - 1.0).abs() < 1e-12);
    }

    #[test]
    fn motions_keep_surfaces_and_their_sides() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let surface = SchwarzP { period: 1.0 };
        let all = motions(&surface, &mut rng);
        // The point group m-3m of each side, less the identity.
        assert_eq!(all.len(), 47);
        let p = DVec3::new(0.31, 0.12, 0.77);
        for motion in &all {
            assert!((surface.value(motion.apply(p)) - surface.value(p)).abs() < 1e-12);
        }
        let sphere = Sphere { radius: 2.0 };
        for motion in motions(&sphere, &mut rng) {
            assert!((sphere.value(motion.apply(p)) - sphere.value(p)).abs() < 1e-12);
        }
    }
}
