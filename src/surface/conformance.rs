//! One test that every level set passes.

use super::{
    CutPlane, Diamond, Gyroid, LevelSet, Plane, SchwarzP, SignedDistance, Sphere, SurfaceSamples, Torus,
};
use glam::{DMat3, DVec3, IVec3};
use std::{
    f64::consts::{PI, TAU},
    sync::Arc,
};

fn all() -> Vec<Box<dyn LevelSet>> {
    vec![
        Box::new(Sphere { radius: 1.5 }),
        Box::new(Torus { ring: 3.0, tube: 0.8 }),
        Box::new(Plane { periods: [2.0, 3.0] }),
        Box::new(CutPlane { axis: 1, at: 0.4, keeps_above: false }),
        Box::new(SchwarzP { period: 1.0 }),
        Box::new(SchwarzP { period: 2.5 }),
        Box::new(Gyroid { period: 1.0 }),
        Box::new(Diamond { period: 2.0 }),
        Box::new(SignedDistance::new(Arc::new(SchwarzP { period: 1.0 }))),
        Box::new(SignedDistance::new(Arc::new(Torus { ring: 3.0, tube: 0.8 }))),
    ]
}

/// Points near the surface, but not on it: samples moved along the normal by a small part of the reach.
fn near(surface: &dyn LevelSet) -> Vec<DVec3> {
    let samples = SurfaceSamples::new(surface, 0.0, 5);
    let reach = super::reach(surface, 0.0).min(1.0);
    assert!(samples.points().len() > 10, "{surface:?} is met too rarely");
    let along = [-0.2, 0.1, 0.25, -0.05];
    samples
        .points()
        .iter()
        .enumerate()
        .map(|(i, s)| s.position + along[i % 4] * reach * surface.normal(s.position))
        .collect()
}

#[test]
fn gradients_and_hessians_agree_with_differences() {
    for surface in all() {
        // Central differences of step 1e-5: truncation 1e-10 times a third derivative of some 10³, rounding 1e-11.
        let step = 1e-5;
        for p in near(surface.as_ref()) {
            let jet = surface.jet(p);
            let mut gradient = DVec3::ZERO;
            let mut hessian = DMat3::ZERO;
            for axis in 0..3 {
                let d = step * DVec3::AXES[axis];
                gradient[axis] = (surface.value(p + d) - surface.value(p - d)) / (2.0 * step);
                *hessian.col_mut(axis) = (surface.gradient(p + d) - surface.gradient(p - d)) / (2.0 * step);
            }
            assert!((gradient - jet.gradient).length() < 1e-6 * (1.0 + gradient.length()), "{surface:?} {p}");
            assert!(
                hessian.abs_diff_eq(jet.hessian, 1e-5 * (1.0 + hessian.x_axis.length())),
                "{surface:?} {p}"
            );
            assert!(jet.hessian.abs_diff_eq(jet.hessian.transpose(), 1e-9), "{surface:?} {p}");
            let single = (surface.value(p), surface.gradient(p), surface.hessian(p));
            let (value, gradient) = surface.value_and_gradient(p);
            assert!(
                (value - single.0).abs() < 1e-14 && (gradient - single.1).length() < 1e-12,
                "{surface:?} {p}"
            );
            assert!((jet.value - single.0).abs() < 1e-14, "{surface:?} {p}");
            assert!((jet.gradient - single.1).length() < 1e-12, "{surface:?} {p}");
            assert!(jet.hessian.abs_diff_eq(single.2, 1e-12), "{surface:?} {p}");
        }
    }
}

#[test]
fn a_period_changes_nothing() {
    for surface in all() {
        for p in near(surface.as_ref()) {
            for shift in [IVec3::X, IVec3::new(-1, 2, 0), IVec3::new(3, 0, -2)] {
                let q = p + surface.period().translation(shift);
                assert!((surface.value(p) - surface.value(q)).abs() < 1e-12, "{surface:?} {p}");
                assert!((surface.gradient(p) - surface.gradient(q)).length() < 1e-10, "{surface:?} {p}");
            }
        }
    }
}

#[test]
fn projections_and_feet_lie_on_the_surface() {
    for surface in all() {
        let scale = super::reach(surface.as_ref(), 0.0).min(1.0);
        for p in near(surface.as_ref()) {
            for level in [0.0, 0.1 * scale] {
                let (Ok(projected), Ok(foot)) = (surface.project(p, level), surface.nearest(p, level)) else {
                    panic!("{surface:?} lost {p}");
                };
                assert!((surface.value(projected) - level).abs() < 1e-12, "{surface:?} {p}");
                assert!((surface.value(foot) - level).abs() < 1e-12, "{surface:?} {p}");
                // The foot's law: what is left is along the normal. Flat distances leave half the digits of the angle.
                let across = p - foot;
                let sideways = across - across.dot(surface.normal(foot)) * surface.normal(foot);
                assert!(sideways.length() < 1e-9, "{surface:?} {p}: {sideways}");
                assert!(across.length() <= (p - projected).length() + 1e-12, "{surface:?} {p}");
            }
        }
    }
}

#[test]
fn spheres_and_tori_have_their_exact_curvatures() {
    let sphere = Sphere { radius: 1.0 };
    let torus = Torus { ring: 3.0, tube: 0.5 };
    for k in 0..12 {
        let (a, b) = (0.3 + f64::from(k), 0.1 + 0.5 * f64::from(k));
        let p = 1.7 * DVec3::new(a.cos() * b.sin(), a.sin() * b.sin(), b.cos());
        let general = super::Curvature::of_level_set(sphere.gradient(p), &sphere.hessian(p));
        assert!((general.mean - 1.0 / 1.7).abs() < 1e-14 && (general.gauss - 1.0 / 2.89).abs() < 1e-14);
        assert!((sphere.curvature(p).mean - general.mean).abs() < 1e-14);
        let s = 0.8;
        let rho = 3.0 + s * b.cos();
        let q = DVec3::new(rho * a.cos(), rho * a.sin(), s * b.sin());
        let curvature = torus.curvature(q);
        let (round_tube, round_axis) = (1.0 / s, b.cos() / rho);
        assert!((curvature.mean - 0.5 * (round_tube + round_axis)).abs() < 1e-13);
        assert!((curvature.gauss - round_tube * round_axis).abs() < 1e-13);
    }
}

#[test]
fn the_p_surface_has_the_curvatures_of_its_formula() {
    // With a, b, c the three cosines and S the sum of their squares: K = −2π² S/(3−S)², |H| = 3π |abc|/(3−S)^{3/2}.
    let surface = SchwarzP { period: 1.0 };
    for point in SurfaceSamples::new(&surface, 0.0, 8).points() {
        let cosines = (TAU * point.position).to_array().map(f64::cos);
        let s: f64 = cosines.iter().map(|c| c * c).sum();
        let product: f64 = cosines.iter().product();
        let curvature = surface.curvature(point.position);
        assert!((curvature.gauss + 2.0 * PI * PI * s / (3.0 - s).powi(2)).abs() < 1e-10);
        assert!((curvature.mean + 3.0 * PI * product / (3.0 - s).powf(1.5)).abs() < 1e-10);
        assert!((surface.gradient(point.position).length() - TAU * (3.0 - s).sqrt()).abs() < 1e-10);
    }
}

#[test]
fn mirrors_and_inversion_of_the_surfaces() {
    let p = DVec3::new(0.13, 0.31, 0.22);
    let schwarz_p = SchwarzP { period: 1.0 };
    assert!((schwarz_p.value(p) - schwarz_p.value(DVec3::new(p.x, p.y, -p.z))).abs() < 1e-14);
    assert!((schwarz_p.value(p) + schwarz_p.value(p + DVec3::splat(0.5))).abs() < 1e-14);
    let gyroid = Gyroid { period: 1.0 };
    assert!((gyroid.value(p) + gyroid.value(-p)).abs() < 1e-14);
    let diamond = Diamond { period: 1.0 };
    assert!((diamond.value(p) - diamond.value(p + DVec3::new(0.5, 0.5, 0.0))).abs() < 1e-14);
}

#[test]
fn total_curvature_is_the_euler_characteristic() {
    // Gauss–Bonnet; the sampling's error at 48 lines is below 0.01 of 2π for all of them.
    for surface in all() {
        let samples = SurfaceSamples::new(surface.as_ref(), 0.0, 48);
        let total = samples.integrate(|p| surface.curvature(p).gauss) / TAU;
        assert!((total - f64::from(surface.euler_characteristic())).abs() < 0.01, "{surface:?}: {total}");
    }
}

#[test]
fn levels_are_regular_up_to_their_limits() {
    // At the limit of the triply periodic surfaces the gradient vanishes somewhere, below it nowhere.
    for surface in [
        Box::new(SchwarzP { period: 1.0 }) as Box<dyn LevelSet>,
        Box::new(Gyroid { period: 1.0 }),
        Box::new(Diamond { period: 1.0 }),
    ] {
        let least = |level: f64| {
            SurfaceSamples::new(surface.as_ref(), level, 32)
                .minimise(surface.as_ref(), |p| surface.gradient(p).length())
                .1
        };
        let (_, high) = surface.level_limits();
        assert!(least(0.9 * high) > 0.5, "{surface:?} {}", least(0.9 * high));
        assert!(least(0.999_999 * high) < 0.1, "{surface:?} {}", least(0.999_999 * high));
    }
}
