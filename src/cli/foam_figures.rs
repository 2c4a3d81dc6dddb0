//! The figures of a foam, and how it ended, for people and for `summary.json`.

use super::foam_run::{self, Line};
use crate::{
    foam::{
        audit::Audit,
        relax::{Extrapolated, Pinch, Stop},
    },
    index::Id,
    surface::WallSide,
};
use serde::Serialize;

/// The figures of a foam: `summary.json`.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Figures {
    pub(super) schema: &'static str,
    pub(super) cells: usize,
    pub(super) space: String,
    /// Films' area times their tension, 1.
    pub(super) energy: f64,
    /// That of the flat hexagonal foam of the same cells.
    pub(super) flat_hexagonal_energy: f64,
    pub(super) energy_over_flat: f64,
    /// How many cells have 0, 1, 2 … sides.
    pub(super) side_counts: Vec<usize>,
    /// How many cells end at planes that cut the gap off; they have no number of sides.
    pub(super) cut_cells: usize,
    /// Σ (6 − n) over the cells that are not cut.
    pub(super) charge: i64,
    pub(super) gap_volume: f64,
    /// The largest relative deviation of a cell's volume from its target.
    pub(super) volume_error: f64,
    /// Pressures relative to their mean.
    pub(super) pressure_min: f64,
    pub(super) pressure_max: f64,
    /// T1s on the way.
    pub(super) t1_count: usize,
    pub(super) newton_steps: usize,
    /// The largest force left, in units of tension × cell width.
    pub(super) residual: f64,
    /// Directions of negative curvature: 0 at a minimum.
    pub(super) unstable_directions: usize,
    /// The lowest eigenvalue of the Hessian at constant volumes.
    pub(super) lowest_eigenvalue: Option<f64>,
    /// Pressures against sides and curvature, cell by cell.
    pub(super) audit: Audit,
    pub(super) psi6_of_seeds: f64,
    /// What annealing did.
    pub(super) annealing: Option<AnnealingFigures>,
    /// The energy on a finer mesh, and without a mesh.
    pub(super) extrapolated: Option<Extrapolated>,
    #[serde(flatten)]
    pub(super) ended: Stop,
}

/// What annealing did.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct AnnealingFigures {
    pub(super) cycles: usize,
    /// Disturbances that settled.
    pub(super) settled: usize,
    /// Disturbances that lowered the energy.
    pub(super) kept: usize,
    pub(super) energy_before: f64,
}

/// How a relaxation ended, for people.
pub(super) fn in_words(stop: Stop) -> String {
    match stop {
        Stop::Converged { steps } => format!("converged in {steps} steps"),
        Stop::StepLimit { residual } => {
            format!("not converged: the steps ran out at a force of {residual:.1e}")
        }
        Stop::Stalled { steps, residual } => {
            format!("not converged: stalled after {steps} steps at a force of {residual:.1e}")
        }
        Stop::Interrupted { steps } => format!("interrupted after {steps} steps"),
        Stop::TooWide { part, pinch, .. } => too_wide(part, pinch),
    }
}

fn too_wide(part: f64, pinch: Option<Pinch>) -> String {
    let widest = format!(
        "no foam of one layer in so wide a gap: walls {:.0} % as far from the middle surface are the widest reached",
        100.0 * part
    );
    let Some(Pinch { cells: [a, b], wall, short, long, place }) = pinch else { return widest };
    let wall = match wall {
        WallSide::Lower => "lower",
        WallSide::Upper => "upper",
    };
    format!(
        "{widest}. There the film between cells {} and {} is {short:.2} cell widths long on the {wall} wall, near ({:.3}, {:.3}, {:.3}), and {long:.2} on the other: beyond, cells touch other neighbours on one wall than on the other, and no film reaches from wall to wall",
        a.index(),
        b.index(),
        place.x,
        place.y,
        place.z
    )
}

/// The audit in one line: how well pressures agree with sides and curvature.
fn audit_in_words(audit: &Audit) -> String {
    match audit.correlation {
        Some(correlation) => format!(
            "correlation {correlation:.6} (rms difference {:.1e} of {:.1e})",
            audit.rms_difference, audit.rms_signal
        ),
        None => format!("all cells alike, rms difference {:.1e}", audit.rms_difference),
    }
}

/// How many cells have how many sides, and how many are cut.
fn sides_in_words(figures: &Figures) -> String {
    let complete = foam_run::by_sides(&figures.side_counts);
    if figures.cut_cells == 0 { complete } else { format!("{complete}, cut: {}", figures.cut_cells) }
}

/// The figures in words.
pub(super) fn table(figures: &Figures) -> Vec<Line> {
    let mut lines = vec![
        ("space", figures.space.clone()),
        ("cells", figures.cells.to_string()),
        ("ended", in_words(figures.ended)),
        ("energy", format!("{:.10}", figures.energy)),
        ("over flat foam", format!("{:.6}", figures.energy_over_flat)),
        ("cells by sides", sides_in_words(figures)),
        ("charge Σ(6−n)", figures.charge.to_string()),
        ("pressures", format!("{:.4} to {:.4}, mean 0", figures.pressure_min, figures.pressure_max)),
        ("volume of the gap", format!("{:.12}", figures.gap_volume)),
        ("volume error", format!("{:.1e}", figures.volume_error)),
        ("T1s", figures.t1_count.to_string()),
        ("residual", format!("{:.1e}", figures.residual)),
        ("unstable directions", figures.unstable_directions.to_string()),
        (
            "lowest eigenvalue",
            figures.lowest_eigenvalue.map_or("-".to_owned(), |value| format!("{value:.2e}")),
        ),
        ("law of the thin limit", audit_in_words(&figures.audit)),
    ];
    lines.extend(figures.extra_lines());
    lines
}

impl Figures {
    /// What was asked for beside the foam itself: annealing, extrapolation.
    pub(super) fn extra_lines(&self) -> Vec<Line> {
        let mut lines = Vec::new();
        if let Some(AnnealingFigures { cycles, settled, kept, energy_before }) = self.annealing {
            let fall = 100.0 * (1.0 - self.energy / energy_before);
            lines.push((
                "annealing",
                format!(
                    "energy {energy_before:.10} before, {fall:.4} % less now; {kept} of {cycles} disturbances kept, {settled} settled"
                ),
            ));
        }
        lines.extend(self.extrapolated.iter().flat_map(extrapolation));
        lines
    }
}

/// The energies on a finer mesh and without one, for people.
pub(super) fn extrapolation(Extrapolated { finer, limit, .. }: &Extrapolated) -> [Line; 2] {
    [("on a finer mesh", format!("{finer:.10}")), ("without a mesh", format!("{limit:.10}"))]
}

/// What stands in their place where neighbours on a finer mesh are others.
pub(super) fn no_extrapolation() -> Line {
    ("on a finer mesh", "no balance with the same neighbours: ask for finer --elements".to_owned())
}

/// What is said of a foam that is in balance on unevenly spread nodes only.
pub(super) fn uneven() -> Line {
    ("nodes", "uneven: no balance was found on even ones; ask for finer --elements".to_owned())
}
