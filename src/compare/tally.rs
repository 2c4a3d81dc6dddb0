//! What is counted in a unit, and the figures that follow from counts.

use super::links::Links;
use crate::tessellation::{CellId, CellPattern, Defects};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Numbers of sides that are told apart: 0 to 12, and more.
pub(super) const CLASSES: usize = 14;

/// Counts over some cells. Tallies of disjoint units add up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tally {
    /// Complete cells by sides.
    pub(super) by_sides: [f64; CLASSES],
    /// 5–7 pairs; a pair belongs to the unit of its cell of fewer sides.
    pub(super) pairs: f64,
    /// Groups of touching defects; a group belongs to the unit of its first cell, with all its cells.
    pub(super) chains: f64,
    /// Cells in those groups.
    pub(super) chain_cells: f64,
    /// Σ charge × ∫K dA over cells whose curvature is known.
    pub(super) charge_curvature: f64,
    /// Σ (∫K dA)².
    pub(super) curvature_square: f64,
}

impl Tally {
    /// The sum of tallies.
    pub(super) fn sum<'a>(tallies: impl IntoIterator<Item = &'a Self>) -> Self {
        tallies.into_iter().fold(Self::default(), |sum, other| sum.plus(other))
    }

    pub(super) fn plus(mut self, other: &Self) -> Self {
        for (sum, count) in self.by_sides.iter_mut().zip(other.by_sides) {
            *sum += count;
        }
        self.pairs += other.pairs;
        self.chains += other.chains;
        self.chain_cells += other.chain_cells;
        self.charge_curvature += other.charge_curvature;
        self.curvature_square += other.curvature_square;
        self
    }

    /// What is left of a tally without a part of it.
    pub(super) fn minus(&self, part: &Self) -> Self {
        let mut rest = *self;
        for (left, count) in rest.by_sides.iter_mut().zip(part.by_sides) {
            *left -= count;
        }
        rest.pairs -= part.pairs;
        rest.chains -= part.chains;
        rest.chain_cells -= part.chain_cells;
        rest.charge_curvature -= part.charge_curvature;
        rest.curvature_square -= part.curvature_square;
        rest
    }

    /// How many cells.
    pub(super) fn cells(&self) -> f64 {
        self.by_sides.iter().sum()
    }

    /// The share of cells of a class.
    pub(super) fn share(&self, class: usize) -> Option<f64> {
        let cells = self.cells();
        (cells > 0.0).then(|| self.by_sides[class] / cells)
    }

    /// Mean and second moment of the sides.
    fn moments(&self) -> Option<(f64, f64)> {
        let cells = self.cells();
        if cells <= 0.0 {
            return None;
        }
        let mean = |f: &dyn Fn(f64) -> f64| {
            self.by_sides.iter().enumerate().map(|(n, count)| f(n as f64) * count).sum::<f64>() / cells
        };
        let first = mean(&|n| n);
        Some((first, mean(&|n| (n - first) * (n - first))))
    }
}

/// A figure of comb or foam that is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Figure {
    /// Cells that are not hexagons, per cell.
    DefectDensity,
    /// 5–7 pairs, per cell.
    PairDensity,
    /// ⟨n⟩.
    MeanSides,
    /// μ₂ = ⟨(n − ⟨n⟩)²⟩.
    SecondMoment,
    /// Cells in a group of touching defects, in the mean over groups.
    ChainLength,
    /// The slope of (6 − n)·π/3 against ∫K dA over single cells.
    ChargeOverCurvature,
}

impl Figure {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::DefectDensity,
        Self::PairDensity,
        Self::MeanSides,
        Self::SecondMoment,
        Self::ChainLength,
        Self::ChargeOverCurvature,
    ];

    /// What it is called in tables, with its unit.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::DefectDensity => "defects per cell",
            Self::PairDensity => "5-7 pairs per cell",
            Self::MeanSides => "mean sides",
            Self::SecondMoment => "second moment μ₂",
            Self::ChainLength => "cells per chain",
            Self::ChargeOverCurvature => "charge / curvature",
        }
    }

    /// Its value, if there is what it needs.
    pub(super) fn of(self, tally: &Tally) -> Option<f64> {
        let per_cell = |count: f64| Some(count / tally.cells()).filter(|value| value.is_finite());
        match self {
            Self::DefectDensity => per_cell(tally.cells() - tally.by_sides[6]),
            Self::PairDensity => per_cell(tally.pairs),
            Self::MeanSides => tally.moments().map(|(mean, _)| mean),
            Self::SecondMoment => tally.moments().map(|(_, second)| second),
            Self::ChainLength => (tally.chains > 0.0).then(|| tally.chain_cells / tally.chains),
            Self::ChargeOverCurvature => {
                (tally.curvature_square > 0.0).then(|| tally.charge_curvature / tally.curvature_square)
            }
        }
    }

    /// By which factor its differences between shuffled units are widened for the links that units lose. A chain is never
    /// divided; of the charges over curvature no covariance is taken.
    pub(super) fn widening(self, links: &Links) -> f64 {
        let if_so = |so: bool| f64::from(u8::from(so));
        match self {
            Self::DefectDensity => links.widening(|cell| if_so(cell.class != 6)),
            Self::PairDensity => links.widening(|cell| if_so(cell.leads_pair)),
            Self::MeanSides => links.widening(|cell| cell.class as f64),
            Self::SecondMoment => links.widening(|cell| (cell.class as f64 - 6.0).powi(2)),
            Self::ChainLength | Self::ChargeOverCurvature => 1.0,
        }
    }
}

/// The tally of each unit of a pattern; `unit_of` says which unit each complete cell belongs to.
pub(super) fn tallies(
    pattern: &CellPattern,
    found: &Defects,
    unit_of: &BTreeMap<CellId, usize>,
    units: usize,
) -> Vec<Tally> {
    let mut tallies = vec![Tally::default(); units];
    for (id, cell) in pattern.complete() {
        let (Some(sides), Some(unit)) = (cell.sides, unit_of.get(&id)) else { continue };
        let tally = &mut tallies[*unit];
        tally.by_sides[(sides as usize).min(CLASSES - 1)] += 1.0;
        if let Some(curvature) = cell.gauss_curvature {
            let integral = curvature * cell.area;
            tally.charge_curvature += (6.0 - f64::from(sides)) * PI / 3.0 * integral;
            tally.curvature_square += integral * integral;
        }
    }
    for pair in &found.pairs {
        if let Some(unit) = unit_of.get(&pair.few) {
            tallies[*unit].pairs += 1.0;
        }
    }
    for chain in &found.chains {
        if let Some(unit) = chain.cells.first().and_then(|id| unit_of.get(id)) {
            tallies[*unit].chains += 1.0;
            tallies[*unit].chain_cells += chain.cells.len() as f64;
        }
    }
    tallies
}
