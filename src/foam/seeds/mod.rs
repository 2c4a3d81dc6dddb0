//! Seeds: one point per cell on the middle surface, evenly spread.
//!
//! **Enters** a gap, a domain and [`SeedSettings`]. **Leaves** [`Seeds`]: points on the middle surface, inside the primary
//! box, with a record of energy and order along the way. The same settings give the same bytes.
//!
//! | step | file |
//! |---|---|
//! | random points near the surface, with the wanted density | `../ground.rs` |
//! | simulated annealing of soft discs; projection onto the surface | `anneal.rs` |
//! | descent to a minimum of a smooth repulsion | `polish.rs` |
//! | bond-orientational order ψ6 | `order.rs` |
//! | what can be set | `settings.rs` |
//!
//! Annealing is the method of the paper on comb in a P-surface enclosure: N points in the periodic box with the Hookean
//! overlap energy ½ (r − d)² for r ≤ d and ½ Φ² for leaving the surface, cooled by Metropolis' rule (N. Metropolis et al.,
//! J. Chem. Phys. 21, 1953; S. Kirkpatrick, C. Gelatt and M. Vecchi, Science 220, 1983) and projected onto Φ = 0. The
//! paper's density is uniform in area ([`Density::Uniform`]); in proportion to the gap ([`Density::Gap`]) cells have equal
//! volumes to first order. The polish is an addition.
//!
//! Not promised: the best arrangement. Annealing ends in a good one, another with every seed of the random numbers.

mod anneal;
mod order;
mod polish;
mod settings;

pub use super::ground::Density;
pub use polish::PolishStop;
pub use settings::{AnnealSettings, FEWEST_CELLS, PolishSettings, SeedError, SeedFault, SeedSettings};

use super::{convert::as_f64, domain::Domain, ground::Ground};
use crate::surface::Gap;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// One record of the annealing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TracePoint {
    /// Sweeps done.
    pub sweep: usize,
    /// The temperature, in units of d².
    pub temperature: f64,
    /// The energy of all seeds, in units of d².
    pub energy: f64,
    /// The share of accepted moves in this sweep.
    pub acceptance: f64,
    /// The mean of |ψ6|.
    pub psi6: f64,
}

/// Seeds on the middle surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seeds {
    /// Where they lie, inside the primary box.
    pub points: Vec<DVec3>,
    /// The annealing.
    pub trace: Vec<TracePoint>,
    /// How the polish ended.
    pub polish: PolishStop,
    /// The mean of |ψ6| at the end.
    pub psi6: f64,
}

/// Called after every sweep with the share of the annealing that is done; it may ask to stop.
pub type Progress<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Seeds for a foam in `gap`, which lies in `domain`.
///
/// `attempt` selects an independent stream of random numbers of the same seed: the first attempt is 0.
///
/// # Errors
/// [`SeedError`] for settings that make no sense, a surface that is not met, or if `progress` asked to stop.
pub fn sow(
    gap: &Gap,
    domain: &Domain,
    settings: &SeedSettings,
    attempt: u64,
    progress: &mut Progress<'_>,
) -> Result<Seeds, SeedError> {
    let faults = settings.faults();
    if !faults.is_empty() {
        return Err(SeedError::Faults(faults));
    }
    let ground = Ground::new(gap, domain, settings.density);
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    rng.set_stream(attempt);
    let start = random_points(&ground, settings.count, &mut rng)?;
    let (mut points, trace) = anneal::anneal(&ground, &start, &settings.anneal, &mut rng, progress)?;
    let polish = polish::polish(&ground, &mut points, &settings.polish);
    let psi6 = order::psi6(&ground, &points);
    Ok(Seeds { points, trace, polish, psi6 })
}

fn random_points(ground: &Ground, count: usize, rng: &mut ChaCha8Rng) -> Result<Vec<DVec3>, SeedError> {
    let wanted = as_f64(count);
    (0..count)
        .map(|_| ground.sample(wanted, rng))
        .collect::<Option<_>>()
        .ok_or_else(|| SeedError::NoRoom { surface: ground.surface_name(), tries: Ground::SAMPLE_TRIES })
}

#[cfg(test)]
mod tests;
