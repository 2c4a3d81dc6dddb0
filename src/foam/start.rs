//! From nothing to a network: seeds, their partition, and new seeds where that is not sound; in deep gaps the partition of
//! their midst.

use super::{
    convert::as_f64,
    domain::Domain,
    ground::{Density, Ground, gap_volume},
    network::Network,
    partition::{Partition, PartitionDefect},
    seeds::{Progress, SeedError, SeedSettings, Seeds, sow},
};
use crate::surface::Gap;

/// Draws of seeds before giving up: what fails this often has too few cells or too wide a gap.
pub const ATTEMPTS: u64 = 5;

/// Cells deeper than this many of their widths are first tried in narrower gaps, not with other seeds: few draws of many deep
/// cells are without one that meets a wall in two patches.
const DEEP: f64 = 2.0;

/// The parts of a gap that are tried where cells are not sound in the whole.
const PARTS: [f64; 5] = [0.5, 0.25, 0.125, 0.0625, 0.03125];

/// Narrower gaps in which cells are deeper than this many of their widths are not tried: of the enclosure's 1934 cells, sound
/// at 3.6 widths, Newton steps brought to a balance only those that were shallower.
const SHALLOW: f64 = 1.2;

/// Where a foam starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// The seeds.
    pub seeds: Seeds,
    /// Their cells.
    pub partition: Partition,
    /// The network of the cells on the middle surface.
    pub network: Network,
    /// The part of the gap that the partition fills: the walls' levels are multiplied by it. 1 unless a narrower one was
    /// allowed.
    pub part: f64,
    /// What was wrong with each earlier draw of seeds.
    pub rejected: Vec<Vec<PartitionDefect>>,
}

/// No start was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StartError {
    /// No seeds.
    #[error(transparent)]
    Seeds(#[from] SeedError),
    /// No draw of seeds gave a sound partition.
    #[error("none of {attempts} draws of {cells} seeds gave a sound partition of the gap; in the last: {}", list(.defects))]
    Unsound {
        /// How many draws.
        attempts: u64,
        /// How many cells.
        cells: usize,
        /// What was wrong with the last.
        defects: Vec<PartitionDefect>,
    },
}

/// Draws seeds and partitions the gap, up to [`ATTEMPTS`] times with independent random numbers of the same seed.
///
/// # Errors
/// [`StartError`].
pub fn start(
    gap: &Gap,
    domain: &Domain,
    settings: &SeedSettings,
    progress: &mut Progress<'_>,
) -> Result<Start, StartError> {
    drawn(gap, domain, settings, ATTEMPTS, progress).map_err(|failure| failure.error)
}

/// As [`start`]; where cells are sound on the middle surface and too deep for the whole gap, the partition is that of the
/// widest of some narrower gaps in its midst.
///
/// # Errors
/// [`StartError`].
pub fn start_in_part(
    gap: &Gap,
    domain: &Domain,
    settings: &SeedSettings,
    progress: &mut Progress<'_>,
) -> Result<Start, StartError> {
    let depth = depth(gap, domain, settings.count);
    let attempts = if depth > DEEP { 1 } else { ATTEMPTS };
    let Failure { error, first, rejected } = match drawn(gap, domain, settings, attempts, progress) {
        Ok(start) => return Ok(start),
        Err(failure) => *failure,
    };
    let Some(seeds) = first.filter(|_| rejected[0].iter().all(PartitionDefect::is_of_depth)) else {
        return Err(error);
    };
    PARTS
        .into_iter()
        .filter(|part| part * depth < SHALLOW)
        .find_map(|part| {
            let (seeds, partition, network) =
                divided(&gap.narrowed(part), domain, settings, seeds.clone()).ok()?;
            Some(Start { seeds, partition, network, part, rejected: rejected.clone() })
        })
        .ok_or(error)
}

/// The mean distance of the walls, in mean widths of the cells.
fn depth(gap: &Gap, domain: &Domain, cells: usize) -> f64 {
    let ground = Ground::new(gap, domain, Density::Uniform);
    gap_volume(gap, domain) / ground.area / ground.mean_spacing(as_f64(cells))
}

/// No draw was sound.
struct Failure {
    error: StartError,
    /// The first seeds.
    first: Option<Seeds>,
    /// What was wrong with each draw.
    rejected: Vec<Vec<PartitionDefect>>,
}

fn drawn(
    gap: &Gap,
    domain: &Domain,
    settings: &SeedSettings,
    attempts: u64,
    progress: &mut Progress<'_>,
) -> Result<Start, Box<Failure>> {
    let mut rejected = Vec::new();
    let mut first = None;
    for attempt in 0..attempts {
        let seeds = sow(gap, domain, settings, attempt, progress).map_err(|error| Failure {
            error: error.into(),
            first: None,
            rejected: Vec::new(),
        })?;
        match divided(gap, domain, settings, seeds.clone()) {
            Ok((seeds, partition, network)) => {
                return Ok(Start { seeds, partition, network, part: 1.0, rejected });
            }
            Err(defects) => rejected.push(defects),
        }
        first.get_or_insert(seeds);
    }
    let defects = rejected.last().cloned().unwrap_or_default();
    let error = StartError::Unsound { attempts, cells: settings.count, defects };
    Err(Box::new(Failure { error, first, rejected }))
}

type Divided = (Seeds, Partition, Network);

/// The partition after the Lloyd steps, and its network.
fn divided(
    gap: &Gap,
    domain: &Domain,
    settings: &SeedSettings,
    mut seeds: Seeds,
) -> Result<Divided, Vec<PartitionDefect>> {
    let mut partition = Partition::new(gap, domain, &seeds.points)?;
    for _ in 0..settings.lloyd_steps {
        seeds.points = partition.centred_seeds(gap);
        partition = Partition::new(gap, domain, &seeds.points)?;
    }
    let network = partition.network()?;
    Ok((seeds, partition, network))
}

/// Defects named in a message before the rest is only counted.
const NAMED: usize = 3;

fn list(defects: &[PartitionDefect]) -> String {
    let named: Vec<String> = defects.iter().take(NAMED).map(ToString::to_string).collect();
    let rest = defects.len().saturating_sub(NAMED);
    if rest == 0 { named.join("; ") } else { format!("{}; and {rest} more", named.join("; ")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::setup::{FoamSpace, PeriodicSurface, PeriodicWalls};
    use std::{error::Error, ops::ControlFlow};

    #[test]
    fn deep_cells_start_in_the_midst_of_the_gap() -> Result<(), Box<dyn Error>> {
        let walls = PeriodicWalls::LevelSet { delta: 0.9 };
        let space = FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 1.0, walls };
        let (gap, domain) = (space.gap()?, space.domain()?);
        let settings = SeedSettings::new(300, 1);
        let found = start_in_part(&gap, &domain, &settings, &mut |_| ControlFlow::Continue(()))?;
        assert!((found.part - 0.5).abs() < 1e-12, "{}", found.part);
        // One draw showed that the whole gap is too deep.
        assert!(matches!(&found.rejected[..], [defects] if !defects.is_empty()));
        let midst = gap_volume(&gap.narrowed(found.part), &domain);
        // The quadrature that measures the ground is good to 1e-4.
        assert!((found.partition.volume() / midst - 1.0).abs() < 1e-4);
        assert_eq!(found.network.cells().len(), 300);
        Ok(())
    }
}
