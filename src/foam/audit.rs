//! The audit of a relaxed one-layer foam against the law of its thin limit, cell by cell.
//!
//! In a thin gap of local height h a foam is a pattern on the middle surface with density h: its edges obey
//! `κ_g + ∂_n ln h = Δp` and meet at 120°. Summed round a cell with n sides, the Gauss–Bonnet theorem gives
//! `Σ_j (p_i − p_j) L_ij = (6 − n_i) π/3 − ∫ (K − ∇² ln h) dA`.
//! Nothing in the solver knows this law; it holds to the order of h against the curvature. The Laplacian is integrated as the
//! flux of `∇ ln h` through the cell's outline (divergence theorem).

use super::{
    network::{CellId, HalfEdgeId},
    relax::State,
};
use crate::surface::Gap;
use glam::DVec3;
use serde::Serialize;

/// How well a foam obeys the law of its thin limit, over all cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Audit {
    /// Pearson's correlation of both sides; none where all cells are alike and there is nothing to correlate.
    pub correlation: Option<f64>,
    /// The slope of the pressures' side over the curvature's, through the origin.
    pub slope: Option<f64>,
    /// The root mean square of the difference of both sides, in radians.
    pub rms_difference: f64,
    /// The root mean square of the curvature's side, in radians.
    pub rms_signal: f64,
}

/// Bands from the middle of a cell to its outline when K is integrated: good to 1e-3 of a right angle.
const BANDS: u32 = 4;

/// Below this signal, in radians, cells count as alike.
const ALIKE: f64 = 1e-6;

/// The audit of a foam between the walls of `gap`. Cells that planes cut off are left out: the law needs all their sides.
#[must_use]
pub fn audit(state: &State, gap: &Gap) -> Audit {
    let pairs: Vec<(f64, f64)> = state
        .network
        .cells()
        .filter(|&cell| !state.network.is_cut(cell))
        .map(|cell| (curvature_side(state, gap, cell), pressure_side(state, cell)))
        .collect();
    let count = f64::from(crate::index::checked_u32(pairs.len().max(1)));
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / count;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let (xx, yy) = (mean(&|p| (p.0 - mx).powi(2)), mean(&|p| (p.1 - my).powi(2)));
    let xy = mean(&|p| (p.0 - mx) * (p.1 - my));
    let rms_signal = mean(&|p| p.0 * p.0).sqrt();
    let varied = xx.sqrt() > ALIKE && yy.sqrt() > ALIKE;
    Audit {
        correlation: varied.then(|| xy / (xx * yy).sqrt()),
        slope: varied.then(|| mean(&|p| p.0 * p.1) / mean(&|p| p.0 * p.0)),
        rms_difference: mean(&|p| (p.1 - p.0).powi(2)).sqrt(),
        rms_signal,
    }
}

/// `Σ_j (p_i − p_j) L_ij` with the films' lengths on the middle surface.
fn pressure_side(state: &State, cell: CellId) -> f64 {
    let network = &state.network;
    let own = state.pressures[State::region(cell)];
    let side = |side: HalfEdgeId| {
        let line = closed_line(state, side);
        let length: f64 = line.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
        (own - state.pressures[State::region(network.neighbour(side))]) * length
    };
    network.ring(cell).map(side).sum()
}

/// `(6 − n) π/3 − ∫ (K − ∇² ln h) dA`.
fn curvature_side(state: &State, gap: &Gap, cell: CellId) -> f64 {
    let network = &state.network;
    let middle = gap.middle();
    let sides = f64::from(crate::index::checked_u32(network.sides(cell)));
    let centre = network.centre(cell);
    let centre = middle.project(centre, 0.0).unwrap_or(centre);
    let mut total = (6.0 - sides) * std::f64::consts::FRAC_PI_3;
    for side in network.ring(cell) {
        for ends in closed_line(state, side).windows(2) {
            total -= sector_curvature(gap, centre, ends[0], ends[1]);
            let between = 0.5 * (ends[0] + ends[1]);
            let outward = (ends[1] - ends[0]).cross(middle.normal(between));
            total += height_slope(gap, between).dot(outward);
        }
    }
    total
}

/// `∫ K dA` over the sector of the middle surface between a cell's centre and a piece of its outline.
fn sector_curvature(gap: &Gap, centre: DVec3, start: DVec3, end: DVec3) -> f64 {
    let middle = gap.middle();
    let on = |p: DVec3| middle.project(p, 0.0).unwrap_or(p);
    let mut total = 0.0;
    let (mut a, mut b) = (centre, centre);
    for band in 1..=BANDS {
        let part = f64::from(band) / f64::from(BANDS);
        let (c, d) = (on(centre.lerp(start, part)), on(centre.lerp(end, part)));
        let area = 0.5 * (d - a).cross(c - b).length();
        total += middle.curvature(on(0.25 * (a + b + c + d))).gauss * area;
        (a, b) = (c, d);
    }
    total
}

/// `∇ ln h` at a point of the middle surface, with h to first order: 1/|∇Φ| between level sets.
fn height_slope(gap: &Gap, p: DVec3) -> DVec3 {
    if gap.walls()[0].field.is_distance() {
        return DVec3::ZERO;
    }
    let jet = gap.middle().jet(p);
    -(jet.hessian * jet.gradient) / jet.gradient.length_squared()
}

/// A side of a cell on the middle surface, with its end.
fn closed_line(state: &State, side: HalfEdgeId) -> Vec<DVec3> {
    let row = state.rows() / 2;
    let mut line = state.side_line(side, row);
    line.extend(state.side_line(state.network.next(side), row).first());
    line
}
