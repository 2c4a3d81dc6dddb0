//! Many foams of one kind with different seeds.

use super::{CliError, foam_settings::FoamSettings};

pub(super) fn run(settings: &FoamSettings) -> Result<(), CliError> {
    super::foam_run::run(&settings.with_seed(settings.seeds.seed))
}
