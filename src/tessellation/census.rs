//! Defects by kind, and everything that is known of one pattern.

use super::{
    charge::{ChargeBalance, RegionCharges, charge_against_curvature, charge_balance},
    defects::{Chain, Defects, defects},
    neighbours::{AboavWeaire, DistanceCorrelation, Lewis, aboav_weaire, lewis, side_correlations},
    pattern::CellPattern,
    statistics::{SideStatistics, side_statistics},
};
use serde::{Deserialize, Serialize};

/// How far apart cells are still correlated, in walls: beyond this there is only scatter.
const CORRELATION_REACH: usize = 5;

/// The largest regions for charge against curvature, in walls.
const REGION_REACH: usize = 5;

/// Groups of touching defects by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DefectCensus {
    /// Single cells that touch no other defect.
    pub isolated_disclinations: usize,
    /// A cell of fewer and one of more sides that touch no other defect, of charge 0 together.
    pub isolated_dislocations: usize,
    /// Longer groups of charge 0: grain boundaries and pleats.
    pub neutral_chains: usize,
    /// Longer groups, and pairs, with a charge: scars.
    pub charged_chains: usize,
}

impl DefectCensus {
    /// Sorts chains into kinds.
    #[must_use]
    pub fn of(chains: &[Chain]) -> Self {
        let mut census = Self::default();
        for chain in chains {
            let kind = match (chain.cells.len(), chain.charge) {
                (1, _) => &mut census.isolated_disclinations,
                (2, 0) => &mut census.isolated_dislocations,
                (_, 0) => &mut census.neutral_chains,
                _ => &mut census.charged_chains,
            };
            *kind += 1;
        }
        census
    }
}

/// Everything that is known of one pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatternStatistics {
    /// Sides, moments, hexatic order.
    pub sides: SideStatistics,
    /// The charge against what it must be.
    pub charge: ChargeBalance,
    /// 5–7 pairs, each cell in one at most.
    pub pairs: usize,
    /// Defects by kind.
    pub census: DefectCensus,
    /// Cells and charge of each group of touching defects, largest first.
    pub chains: Vec<(usize, i64)>,
    /// Neighbours' sides.
    pub aboav_weaire: AboavWeaire,
    /// Sizes.
    pub lewis: Lewis,
    /// Sides against sides at a distance.
    pub correlations: Vec<DistanceCorrelation>,
    /// Charge against curvature, where the surface is known.
    pub curvature: Option<Vec<RegionCharges>>,
}

/// Measures a pattern.
#[must_use]
pub fn pattern_statistics(pattern: &CellPattern) -> PatternStatistics {
    let Defects { pairs, chains } = defects(pattern);
    PatternStatistics {
        sides: side_statistics(pattern),
        charge: charge_balance(pattern),
        pairs: pairs.len(),
        census: DefectCensus::of(&chains),
        chains: chains.iter().map(|chain| (chain.cells.len(), chain.charge)).collect(),
        aboav_weaire: aboav_weaire(pattern),
        lewis: lewis(pattern),
        correlations: side_correlations(pattern, CORRELATION_REACH),
        curvature: charge_against_curvature(pattern, REGION_REACH),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellation::testing::flipped_torus;

    #[test]
    fn one_flip_is_a_neutral_chain_of_four() {
        let statistics = pattern_statistics(&flipped_torus(9, 10, 1, 1));
        assert_eq!(statistics.chains, [(4, 0)]);
        assert_eq!(statistics.pairs, 2);
        assert_eq!(statistics.census, DefectCensus { neutral_chains: 1, ..DefectCensus::default() });
        assert_eq!(statistics.charge.unexplained(), 0);
    }
}
