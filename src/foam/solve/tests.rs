use super::*;
use crate::{
    foam::{complex::Strips, energy::energy, network::tests::hexagons},
    surface::{Gap, LevelSet, Period},
};
use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// A periodic sheet with bumps, so that walls are curved and the gap varies.
#[derive(Debug)]
pub(crate) struct Wavy {
    pub(crate) periods: [f64; 2],
    pub(crate) height: f64,
}

impl Wavy {
    fn wave_numbers(&self) -> [f64; 2] {
        self.periods.map(|period| std::f64::consts::TAU / period)
    }
}

impl LevelSet for Wavy {
    fn name(&self) -> &'static str {
        "wavy"
    }
    fn value(&self, p: DVec3) -> f64 {
        let [a, b] = self.wave_numbers();
        p.z * (1.0 + 0.3 * (a * p.x).cos()) - self.height * (a * p.x).sin() * (b * p.y).cos()
    }
    fn gradient(&self, p: DVec3) -> DVec3 {
        let [a, b] = self.wave_numbers();
        let ((sx, cx), (sy, cy)) = ((a * p.x).sin_cos(), (b * p.y).sin_cos());
        let h = self.height;
        DVec3::new(-0.3 * a * p.z * sx - h * a * cx * cy, h * b * sx * sy, 1.0 + 0.3 * cx)
    }
    fn hessian(&self, p: DVec3) -> DMat3 {
        let [a, b] = self.wave_numbers();
        let ((sx, cx), (sy, cy)) = ((a * p.x).sin_cos(), (b * p.y).sin_cos());
        let h = self.height;
        let (xx, xy, xz) =
            (-0.3 * a * a * p.z * cx + h * a * a * sx * cy, h * a * b * cx * sy, -0.3 * a * sx);
        let yy = h * b * b * sx * cy;
        DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, 0.0), DVec3::new(xz, 0.0, 0.0))
    }
    fn period(&self) -> Period {
        Period([Some(self.periods[0]), Some(self.periods[1]), None])
    }
    fn domain(&self) -> (DVec3, DVec3) {
        (DVec3::new(0.0, 0.0, -1.0), DVec3::new(self.periods[0], self.periods[1], 1.0))
    }
    fn euler_characteristic(&self) -> i32 {
        0
    }
    fn level_limits(&self) -> (f64, f64) {
        (-1.0, 1.0)
    }
}

#[test]
fn the_lagrangian_along_a_step_has_the_slope_and_the_bend_that_the_system_says() {
    let network = hexagons(4, 4);
    let [Some(x), Some(y), None] = network.period().0 else { panic!("a flat torus") };
    let gap = Gap::between(Arc::new(Wavy { periods: [x, y], height: 0.2 }), [-0.2, 0.25]).unwrap();
    let strips = Strips { along: 2, through: 1 };
    let complex = strips.complex(&network, &gap);
    let mut places = strips.first_places(&network, &gap).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for place in places.iter_mut() {
        *place += 0.03 * DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
    }
    complex.retract(&mut places).unwrap();
    let reference = Reference::new(&complex, &places);
    for place in places.iter_mut() {
        *place += 0.01 * DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
    }
    complex.retract(&mut places).unwrap();
    let pressures: IndexVec<RegionId, f64> =
        complex.regions.iter().map(|_| random.random_range(-1.0..1.0)).collect();
    let system = System::new(&complex, &places).unwrap();
    let targets = volumes(&complex, &places, &reference);
    let motions = Motions::new(&complex, &places, &system.layout, &system.frames);
    let at = At {
        complex: &complex,
        places: &places,
        reference: &reference,
        pressures: &pressures,
        motions: &motions,
        frames: &system.frames,
    };
    let assembled = system.assemble(&at);
    let films = system.condense(&assembled, 0.0);
    let softening = system.softening(&films);
    let entries = system.entries(&films, &system.wall_entries(&at, &assembled), 0.0);
    let factored = Factored::new(&system.symbolic, entries, &softening).unwrap();
    assert!(films.iter().all(|film| film.negative == 0));
    let gradients: Vec<&[f64]> = assembled.iter().map(|film| &film.gradient[..]).collect();
    let none = IndexVec::from_elem(0.0, complex.regions.len());
    let (loads, residuals) = system.loads(&complex, &gradients, &none);
    // The same sums without the Hessian.
    assert_eq!(system.residuals(&complex, &places, &reference, &pressures, &none), residuals);
    let mut rhs = loads.clone();
    rhs.freedoms
        .iter_mut()
        .zip(&system.layout.of_freedom)
        .for_each(|(x, unknown)| *x = unknown.map_or(0.0, |_| random.random_range(-1.0..1.0)));
    rhs.inner.iter_mut().flatten().for_each(|x| *x = random.random_range(-1.0..1.0));
    rhs.pressures
        .iter_mut()
        .zip(system.layout.of_pressure.iter())
        .for_each(|(x, unknown)| *x = unknown.map_or(0.0, |_| random.random_range(-0.1..0.1)));
    let direction = system.solve(&factored, &films, &rhs).unwrap();
    let own_displacements = system.own_displacements(&complex, &motions, &direction);
    let step = Step {
        displacements: system.displacements(&complex, &places, &own_displacements),
        own_displacements,
        balance: direction.pressures.clone(),
        direction,
        residuals: Residuals { force: 0.0, volume: 0.0 },
        unstable: 0,
        shift: 0.0,
    };
    let size = step.displacements.iter().map(|d| d.length()).fold(0.0, f64::max);
    let lagrangian = |t: f64| {
        let moved = system.moved(&complex, &places, &step, t).unwrap();
        let now = volumes(&complex, &moved, &reference);
        let work: f64 = complex
            .regions
            .ids()
            .map(|id| (pressures[id] + t * step.direction.pressures[id]) * (now[id] - targets[id]))
            .sum();
        energy(&complex, &moved) - work
    };
    let dot = |a: &Direction, b: &Direction| -> f64 {
        let f: f64 = a.freedoms.iter().zip(&b.freedoms).map(|(x, y)| x * y).sum();
        let i: f64 = a.inner.iter().flatten().zip(b.inner.iter().flatten()).map(|(x, y)| x * y).sum();
        let p: f64 = a.pressures.iter().zip(b.pressures.iter()).map(|(x, y)| x * y).sum();
        f + i + p
    };
    // A step of 2e-4 in space: differences err by its square and by rounding over it.
    let h = 2e-4 / size;
    let slope = (lagrangian(h) - lagrangian(-h)) / (2.0 * h);
    let expected = -dot(&loads, &step.direction);
    assert!((slope - expected).abs() < 1e-4 * expected.abs(), "{slope} {expected}");
    let bend = (lagrangian(h) - 2.0 * lagrangian(0.0) + lagrangian(-h)) / (h * h);
    let expected = dot(&rhs, &step.direction);
    assert!((bend - expected).abs() < 1e-3 * expected.abs(), "{bend} {expected}");
}

#[test]
fn volumes_fill_the_gap_and_do_not_depend_on_the_reference() {
    let network = hexagons(4, 4);
    let [Some(x), Some(y), None] = network.period().0 else { panic!("a flat torus") };
    let gap = Gap::between(Arc::new(Wavy { periods: [x, y], height: 0.2 }), [-0.2, 0.25]).unwrap();
    let strips = Strips { along: 2, through: 1 };
    let complex = strips.complex(&network, &gap);
    let mut places = strips.first_places(&network, &gap).unwrap();
    let first = Reference::new(&complex, &places);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for place in places.iter_mut() {
        *place += 0.02 * DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
    }
    complex.retract(&mut places).unwrap();
    let second = Reference::new(&complex, &places);
    let (a, b) = (volumes(&complex, &places, &first), volumes(&complex, &places, &second));
    // Between the walls ∫dz = (upper − lower) / (1 + 0.3 cos): its mean over a period is 1/√(1 − 0.3²).
    let total = 0.45 * x * y / (1.0 - 0.09_f64).sqrt();
    // The quadrature of the prisms over edges this crooked errs by 2e-9; on relaxed films by far less.
    assert!((b.iter().sum::<f64>() - total).abs() < 1e-8, "{} {total}", b.iter().sum::<f64>());
    for (va, vb) in a.iter().zip(b.iter()) {
        assert!((va - vb).abs() < 1e-7, "{va} {vb}");
    }
}
