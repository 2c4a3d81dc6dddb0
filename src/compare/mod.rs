//! Do bees build what the foam builds?
//!
//! **Enters** [`Sample`]s, patterns of comb and patterns of foam. **Leaves** [`Comparison`]: the figures of both with their
//! uncertainty, a test of the numbers of sides, tests of what follows from them, and a sentence of verdict.
//!
//! | step | file |
//! |---|---|
//! | what is additive over cells: sides, pairs, chains, charge times curvature | `tally.rs` |
//! | units that may be exchanged: whole patterns, or patches of neighbouring cells | `patches.rs` |
//! | what links cells of different patches, and how much shuffling loses by it | `links.rs` |
//! | the permutation test | `permutation.rs` |
//! | intervals by resampling units | `bootstrap.rs`, `quantile.rs` |
//! | all of this in order; tests of one figure each | `study.rs` |
//! | what it means in words, and how many cells would make it surer | `verdict.rs` |
//!
//! **What is tested.** The null hypothesis is that comb and foam come from one process. Cells are not independent: a five
//! brings a seven beside it, defects line up in chains, and Euler's relation fixes the mean number of sides of a closed
//! pattern. A test that shuffles single cells, or a multinomial one, takes each defect of a pair for a new piece of evidence
//! and rejects a true null several times too often. Here cells are shuffled in groups that keep their neighbours: whole
//! patterns where there are four or more of each kind, else compact patches of about equal numbers of cells, the same number
//! in comb and foam. What holds within a patch stays as it is. What links two patches is lost, which would make the shuffled
//! differences too small: they are widened by what the covariances of neighbouring cells say was lost (`links.rs`), and so
//! are the intervals. The test is exact if units are exchangeable, as whole patterns are; with patches it holds its level as
//! `benches/compare.rs` measures it and `tests/compare.rs` demands: from 100 cells of each upwards 3.5 to 6.5 % of true nulls
//! are rejected at 5 %, of independent cells and of 5–7 pairs, with patterns of one size or of two. With fewer cells, or with
//! a handful of defects, differences come in few steps, and fewer are rejected.
//!
//! **Which curvature.** Charge is set against plain ∫K dA. Where the cells' density ρ varies, an ordered arrangement follows
//! K − ½∇² ln ρ instead (A. Mughal and D. Weaire, Proc. R. Soc. A 465, 2009, for conformal patterns), and a foam of film height h balances
//! pressures on K − ∇² ln h (`foam::audit`). Neither is subtracted: ρ would have to be measured from the areas of cells, but a seven
//! is larger than a five, so that the charge would be set against itself; and cells of equal volume, foam's, crowd where the gap is
//! wide while bees' keep their width, which is one of the differences that are looked for. Between parallel walls h is constant and
//! both terms vanish; over a closed surface they integrate to zero, so that the total charge is 6χ in any gap. Between level sets
//! the slope of a foam is therefore not 1, and only foam and comb in the same gap may be compared by it.
//!
//! Not promised: with patches, a difference between one comb and one foam is found, not between bees and foams at large; what
//! several combs or foams differ by among themselves counts only when whole patterns are shuffled. Comb and foam of different
//! cell size on one curved surface differ in their mean number of sides by 6χ/N, whoever builds.
//!
//! Sources: R. Fisher, "The Design of Experiments" (1935), and P. Good, "Permutation, Parametric and Bootstrap Tests of
//! Hypotheses" (2005), for tests by permutation; B. Phipson and G. Smyth, Stat. Appl. Genet. Mol. Biol. 9 (2010), for
//! p-values of random permutations; B. Efron and R. Tibshirani, "An Introduction to the Bootstrap" (1993); T. Hesterberg,
//! Am. Stat. 69 (2015), for intervals from few units; T. Conley, J. Econometrics 92 (1999), for variances of sums over
//! neighbours; S. Holm, Scand. J. Stat. 6 (1979), for several tests at once.

mod bootstrap;
mod links;
mod patches;
mod permutation;
mod quantile;
mod study;
mod tally;
mod verdict;

use crate::tessellation::{CellPattern, PatternStatistics};
use serde::{Deserialize, Serialize};

pub use study::compare;
pub use tally::Figure;
pub use verdict::{Finding, Verdict};

/// The name and version of the comparison's JSON form.
pub const COMPARISON_SCHEMA: &str = "combwright.comparison/1";

/// A pattern with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// What it is called in tables.
    pub name: String,
    /// The pattern.
    pub pattern: CellPattern,
}

/// What is shuffled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Units {
    /// Whole patterns where there are at least four of each kind, else patches.
    #[default]
    Auto,
    /// Patches of neighbouring cells.
    Patches,
    /// Whole patterns.
    Patterns,
}

/// How a comparison is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// What is shuffled.
    pub units: Units,
    /// Random permutations, where not all can be tried.
    pub permutations: usize,
    /// Resamples for the intervals.
    pub resamples: usize,
    /// Where the random numbers start.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { units: Units::Auto, permutations: 9999, resamples: 4000, seed: 1 }
    }
}

/// The significance level of every test.
pub const LEVEL: f64 = 0.05;

/// Why there is no comparison.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    /// No pattern of one kind.
    #[error("there is no pattern of {0}; give at least one")]
    NoPattern(&'static str),
    /// A pattern without cells.
    #[error("{name}: the pattern is empty; a pattern needs at least one cell")]
    Empty {
        /// Which.
        name: String,
    },
    /// No complete cell among all patterns of one kind.
    #[error(
        "the {kind} has no complete cell: all {cells} are cut or uncertain, so nothing can be counted; \
         take a photograph that shows more of it, or correct the reading"
    )]
    NothingComplete {
        /// Comb or foam.
        kind: &'static str,
        /// How many cells there are.
        cells: usize,
    },
    /// Whole patterns shall be shuffled, but there are too few.
    #[error(
        "to shuffle whole patterns at least {least} of comb and {least} of foam are needed, not {comb} and {foam}; \
         give more, or shuffle patches"
    )]
    FewPatterns {
        /// How many are needed.
        least: usize,
        /// Patterns of comb.
        comb: usize,
        /// Patterns of foam.
        foam: usize,
    },
    /// No permutations or no resamples.
    #[error("{what} is {value}: at least {least} are needed")]
    TooFewDraws {
        /// Permutations or resamples.
        what: &'static str,
        /// How many were asked for.
        value: usize,
        /// How many are needed.
        least: usize,
    },
}

/// A figure with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The figure.
    pub value: f64,
    /// The interval, from resampled units; `None` with fewer than two units.
    pub interval: Option<[f64; 2]>,
}

/// One pattern of a group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatternFigures {
    /// Its name.
    pub name: String,
    /// The unit of its lengths.
    pub unit: String,
    /// What is known of it.
    pub statistics: PatternStatistics,
}

/// All patterns of comb, or all of foam.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// `comb` or `foam`.
    pub kind: &'static str,
    /// Each pattern.
    pub patterns: Vec<PatternFigures>,
    /// Complete cells of all.
    pub cells: usize,
    /// How many units they were divided into.
    pub units: usize,
    /// The mean number of cells in a unit.
    pub cells_per_unit: f64,
    /// How many times the variance of the share of hexagons exceeds that of independent cells.
    pub design_effect: Option<f64>,
}

/// Cells with one number of sides, in comb and foam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SideClass {
    /// The number of sides; the last class holds all with more.
    pub sides: usize,
    /// Cells of comb and of foam.
    pub cells: [usize; 2],
    /// Their share among the complete cells: comb, foam.
    pub share: [Estimate; 2],
    /// Share in the comb less that in the foam.
    pub difference: Estimate,
}

/// The test of the distributions of sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SidesTest {
    /// Each number of sides that occurs.
    pub classes: Vec<SideClass>,
    /// The chi-square distance of the two pooled distributions, rare numbers of sides taken together.
    pub chi_square: f64,
    /// The share of permutations that are at least as unlike.
    pub p: f64,
    /// How many permutations there were.
    pub permutations: usize,
    /// Whether these were all that there are.
    pub exhaustive: bool,
    /// ½ Σ |p_comb(n) − p_foam(n)|: the share of cells that would have to change.
    pub total_variation: f64,
    /// Its mean over the permutations: what chance alone makes of it.
    pub total_variation_by_chance: f64,
    /// Cohen's w, √(χ²/N).
    pub cohens_w: f64,
}

/// The test of one figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FigureTest {
    /// Which figure.
    pub figure: Figure,
    /// In the comb and in the foam.
    pub value: [Estimate; 2],
    /// Comb less foam.
    pub difference: Estimate,
    /// The share of permutations with at least this difference, either way.
    pub p: f64,
    /// The same, corrected for the number of these tests (Holm).
    pub p_holm: f64,
}

/// A statistic that could not be had.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Which.
    pub what: String,
    /// Why.
    pub why: String,
}

/// Comb against foam.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Form and version.
    pub schema: &'static str,
    /// How it was made; `units` says what was shuffled.
    pub settings: Settings,
    /// The comb.
    pub comb: Group,
    /// The foam.
    pub foam: Group,
    /// The test of the numbers of sides: the one that the verdict rests on.
    pub sides: SidesTest,
    /// Tests of single figures.
    pub figures: Vec<FigureTest>,
    /// What is missing and why.
    pub left_out: Vec<LeftOut>,
    /// What a reader should know before believing it.
    pub notes: Vec<String>,
    /// The answer.
    pub verdict: Verdict,
}
