//! What can be set about seeds, and what is wrong with a choice.

use crate::foam::{convert::as_f64, ground::Density};
use serde::{Deserialize, Serialize};

/// The fewest cells that can meet three at a corner all over a surface.
pub const FEWEST_CELLS: usize = 3;

/// How seeds are made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeedSettings {
    /// The number of seeds, N.
    pub count: usize,
    /// Where the random numbers start.
    pub seed: u64,
    /// How densely they lie.
    pub density: Density,
    /// The annealing.
    pub anneal: AnnealSettings,
    /// The descent afterwards.
    pub polish: PolishSettings,
    /// Lloyd steps after that.
    pub lloyd_steps: usize,
}

/// How soft discs are annealed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnnealSettings {
    /// Attempts per seed.
    pub sweeps: usize,
    /// The range d of the overlap energy, over the spacing of the hexagonal lattice of the same density.
    ///
    /// Below 1 discs fit without touching and disorder costs nothing; at 1.35 the overlap is so deep that the cooled discs are
    /// less ordered than at 1.15 (|ψ6| 0.34 against 0.75 at N = 256).
    pub diameter: f64,
    /// The temperature at the start, in units of d²: above melting.
    pub hot: f64,
    /// The temperature at the end, in units of d²: below it nothing but vibration is left.
    pub cold: f64,
    /// The factor of ½ Φ², or none for the one that holds seeds to every surface as stiffly as 1 does to the P-surface of
    /// period 1.
    pub surface_stiffness: Option<f64>,
}

/// How annealed seeds are polished.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolishSettings {
    /// At most this many steps.
    pub steps: usize,
    /// The range of the repulsion over the local spacing of seeds. At 2 second neighbours count, which favours hexagons more
    /// than a range of 1.6 does; beyond, the cost grows and the order does not.
    pub range: f64,
    /// The largest force at which the polish ends, in units of the pair energy over the mean spacing.
    pub tolerance: f64,
}

impl SeedSettings {
    /// Good settings for `count` seeds.
    #[must_use]
    pub fn new(count: usize, seed: u64) -> Self {
        Self {
            count,
            seed,
            density: Density::Gap,
            anneal: AnnealSettings::default(),
            polish: PolishSettings::default(),
            lloyd_steps: 0,
        }
    }

    /// Everything that is wrong with these settings.
    #[must_use]
    pub fn faults(&self) -> Vec<SeedFault> {
        let mut faults = Vec::new();
        if self.count < FEWEST_CELLS {
            faults.push(SeedFault::TooFew { count: self.count });
        }
        let AnnealSettings { diameter, hot, cold, surface_stiffness, .. } = self.anneal;
        let PolishSettings { range, tolerance, .. } = self.polish;
        let stiffness = surface_stiffness.unwrap_or(1.0);
        for (name, value, low, high) in [
            ("anneal diameter", diameter, 0.5, 2.5),
            ("hot temperature", hot, 1e-12, 1e3),
            ("cold temperature", cold, 1e-12, 1e3),
            ("surface stiffness", stiffness, 1e-12, 1e12),
            ("polish range", range, 1.1, 4.0),
            ("polish tolerance", tolerance, 1e-12, 1e3),
        ] {
            if !(low..=high).contains(&value) {
                faults.push(SeedFault::OutOfRange { name, value, low, high });
            }
        }
        if hot < cold {
            faults.push(SeedFault::Warming { hot, cold });
        }
        faults
    }
}

impl Default for AnnealSettings {
    fn default() -> Self {
        Self { sweeps: 4000, diameter: 1.15, hot: 0.01, cold: 1e-4, surface_stiffness: None }
    }
}

impl AnnealSettings {
    /// The temperature of a sweep, in units of d²: falling geometrically.
    pub(super) fn temperature(&self, sweep: usize) -> f64 {
        let progress = as_f64(sweep) / as_f64(self.sweeps.max(2) - 1);
        self.hot * (self.cold / self.hot).powf(progress)
    }

    /// Sweeps from one record of the trace to the next.
    pub(super) fn trace_every(&self) -> usize {
        (self.sweeps / TRACE_RECORDS).max(1)
    }
}

/// About how many records a trace has: enough for a smooth curve.
const TRACE_RECORDS: usize = 100;

impl Default for PolishSettings {
    fn default() -> Self {
        Self { steps: 6000, range: 2.0, tolerance: 1e-5 }
    }
}

/// Something wrong with [`SeedSettings`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SeedFault {
    /// Fewer cells than can cover a surface.
    #[error(
        "N = {count}: so few cells cannot cover a surface with three cells at every corner: ask for at least {FEWEST_CELLS}, and on a periodic \
         surface for enough that no cell touches itself"
    )]
    TooFew {
        /// How many were asked for.
        count: usize,
    },
    /// A number outside its range.
    #[error("the {name} is {value}: it must lie between {low} and {high}")]
    OutOfRange {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The least.
        low: f64,
        /// The greatest.
        high: f64,
    },
    /// Annealing that does not cool.
    #[error("the annealing warms up from {hot} to {cold}: the cold temperature must not exceed the hot one")]
    Warming {
        /// At the start.
        hot: f64,
        /// At the end.
        cold: f64,
    },
}

/// Seeds could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SeedError {
    /// The settings make no sense.
    #[error("{}", list(.0))]
    Faults(Vec<SeedFault>),
    /// No point of the surface was met.
    #[error(
        "no place for a seed was found on {surface} in {tries} random draws from its box: the surface is too small for the box, or \
         has no area"
    )]
    NoRoom {
        /// The surface's name.
        surface: &'static str,
        /// How often a place was drawn.
        tries: usize,
    },
    /// The caller asked to stop.
    #[error("stopped while seeds were annealed: {done} of {sweeps} sweeps were done")]
    Interrupted {
        /// Sweeps done.
        done: usize,
        /// Sweeps asked for.
        sweeps: usize,
    },
}

fn list(faults: &[SeedFault]) -> String {
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_have_no_fault() {
        assert_eq!(SeedSettings::new(64, 1).faults(), []);
    }

    #[test]
    fn all_faults_are_found_at_once() {
        let mut settings = SeedSettings::new(1, 1);
        settings.anneal.diameter = f64::NAN;
        settings.anneal.cold = 1.0;
        settings.polish.range = 0.0;
        settings.polish.tolerance = -1.0;
        settings.anneal.surface_stiffness = Some(f64::INFINITY);
        assert_eq!(settings.faults().len(), 6, "{:?}", settings.faults());
    }

    #[test]
    fn cooling_is_geometric_and_ends_where_it_should() {
        let anneal = AnnealSettings { sweeps: 11, hot: 1e-2, cold: 1e-4, ..AnnealSettings::default() };
        // Exact but for the rounding of one power.
        assert!((anneal.temperature(0) / 1e-2 - 1.0).abs() < 1e-12);
        assert!((anneal.temperature(5) / 1e-3 - 1.0).abs() < 1e-12);
        assert!((anneal.temperature(10) / 1e-4 - 1.0).abs() < 1e-12);
    }
}
