//! From nothing to a network: seeds, their partition, and new seeds where that is not sound.

use super::{
    domain::Domain,
    network::Network,
    partition::{Partition, PartitionDefect},
    seeds::{Progress, SeedError, SeedSettings, Seeds, sow},
};
use crate::surface::Gap;

/// Draws of seeds before giving up: what fails this often has too few cells or too wide a gap.
pub const ATTEMPTS: u64 = 5;

/// Where a foam starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// The seeds.
    pub seeds: Seeds,
    /// Their cells.
    pub partition: Partition,
    /// The network of the cells on the middle surface.
    pub network: Network,
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
    #[error("{attempts} draws of {cells} seeds gave no sound partition of the gap; in the last: {}", list(.defects))]
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
    let mut rejected = Vec::new();
    for attempt in 0..ATTEMPTS {
        let seeds = sow(gap, domain, settings, attempt, progress)?;
        match divided(gap, domain, settings, seeds) {
            Ok((seeds, partition, network)) => return Ok(Start { seeds, partition, network, rejected }),
            Err(defects) => rejected.push(defects),
        }
    }
    let defects = rejected.pop().unwrap_or_default();
    Err(StartError::Unsound { attempts: ATTEMPTS, cells: settings.count, defects })
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
