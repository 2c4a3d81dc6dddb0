//! Foams of two layers: a sheet of cells on each wall, meeting at a middle network, as in the comb of bees.
//!
//! **Enters** a [`crate::surface::Gap`] and the number of cells on each wall. **Leaves** cells and films in two layers, which
//! [`super::free`] relaxes: walls between cells of one layer, and the films in the middle that close the cells' ends.
//!
//! | step | file |
//! |---|---|
//! | two sheets of seeds: rhombic, Tóth's, or annealed on both sides | `arrangement.rs` |
//! | annealed sheets settle together: plane films between power cells, of least area at equal volumes | `settle.rs`, `plane_films.rs` |
//! | their power cells, cut off by the walls; corners, polygons | `division.rs` |
//! | ends with plane films: energies by formula | `ends.rs` |
//! | side counts | `figures.rs` |
//! | how the defects of the two layers sit to each other | `companions.rs` |
//!
//! Each layer fills its side of the gap up to the middle surface, in equal cells. Annealed layers that are less high than half
//! a cell's width are refused: there films between the layers reach the walls, and the foam of least energy is no foam of two
//! layers. Deep ones have a limit, too: the pressure in a cell of five sides or fewer squeezes its cross section the more the
//! smaller that is, and only the slope of its sides holds against it, as surface tension fails to hold a long jet together
//! (J. Plateau; Lord Rayleigh, 1878). Between planes cells of five sides stay on their walls at 1.5 widths of depth and are squeezed
//! off at 1.9. Annealed patterns with such cells that are far deeper are refused before they are settled; nearer to the limit
//! the foam ends where a cell leaves its wall, and says so.
//!
//! Only annealed layers, which are no arrangement that has a name, change their topology.
//!
//! Sources: L. Fejes Tóth, "What the bees know and what they do not know", Bull. Amer. Math. Soc. 70 (1964); D. Weaire and
//! R. Phelan, "Optimal design of honeycombs", Nature 367 (1994), who made both arrangements in foam between glass plates.

mod arrangement;
mod companions;
mod division;
mod ends;
mod figures;
mod plane_films;
mod settle;

pub use arrangement::{Arrangement, Sheets, sheets};
pub use companions::{Chance, Charged, Companions, Compared, charged, companions};
pub use division::divided;
pub use ends::{PlaneEnd, plane_end};
pub use figures::{LayerFigures, layer_figures};

use crate::foam::{seeds::SeedError, setup::FoamSpace};
use glam::DVec3;

fn best_rows(rows: usize, columns: usize, stretch: f64) -> String {
    match rows {
        0 => "their number is odd, and every other row is shifted".to_owned(),
        _ => format!("the best, {rows} rows of {columns}, would be stretched by {stretch:.1} %"),
    }
}

/// Why there is no two-layer foam.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoLayers {
    /// The number of cells does not make rows on the periods.
    #[error(
        "{cells} cells a layer make no rows of regular hexagons on the periods {periods:?}: {}; change the periods or the number of cells",
        best_rows(*.rows, *.columns, *.stretch)
    )]
    Rows {
        /// Cells asked for.
        cells: usize,
        /// The periods.
        periods: [f64; 2],
        /// Rows of the best fit.
        rows: usize,
        /// Columns of the best fit.
        columns: usize,
        /// Its distortion, in per cent.
        stretch: f64,
    },
    /// A pattern of flat comb was asked for on a curved surface.
    #[error("the {pattern} arrangement is one of plane walls, but the surface is {surface}: use annealed")]
    Curved {
        /// The arrangement.
        pattern: &'static str,
        /// The surface.
        surface: &'static str,
    },
    /// The space ends at plane walls.
    #[error(
        "two layers are made on whole surfaces and periods, but {space} ends at plane walls: give the surface itself, such as --surface schwarz-p with its period and walls"
    )]
    Walled {
        /// The space.
        space: FoamSpace,
    },
    /// Seeds coincide.
    #[error("cells too close to each other at {place}: no polyhedron is left between them")]
    Seeds {
        /// Where.
        place: DVec3,
    },
    /// Cells reach from wall to wall, or miss their own.
    #[error(
        "of the cells settled between plane films, {reaching} reach the other wall and {missing} miss their own: the layers do not fit the gap. Cells that reach the other wall ask for a wider gap or for more cells, cells that miss their own for a narrower gap or for fewer"
    )]
    Through {
        /// How many reach the other wall.
        reaching: usize,
        /// How many miss their own.
        missing: usize,
    },
    /// The layers are too flat.
    #[error(
        "the layers are too flat: where the gap is narrowest a cell would be {flattest:.2} of its width high, and films between the layers would reach the walls; ask for {needed:.0} cells on each wall or more (2000 at most), or widen the gap"
    )]
    Flat {
        /// The least height of a cell over its width.
        flattest: f64,
        /// Cells on each wall that would do.
        needed: f64,
    },
    /// Cells of few sides are too deep.
    #[error(
        "the layers are too deep: cells of five sides or fewer would be up to {deepest:.1} times as deep as they are wide at their wall, and from about 1.7 times on their pressure squeezes such cells off it; ask for about {fitting:.0} cells on each wall, where the gap is nowhere too flat for so few, or for a narrower or more even gap"
    )]
    Deep {
        /// The greatest depth of a cell over its width.
        deepest: f64,
        /// Cells on each wall that would do.
        fitting: f64,
    },
    /// More cells than can be relaxed.
    #[error(
        "{cells} cells on each wall are too many: Newton's matrix for two layers takes half a minute a step and gigabytes of memory from {most} cells on; ask for at most so many, or for cells at least {width:.4} wide, in the surface's units"
    )]
    Many {
        /// Asked for.
        cells: usize,
        /// The most.
        most: usize,
        /// The width of so many cells.
        width: f64,
    },
    /// The cells on a wall do not cover it once.
    #[error(
        "the cells on a wall have Euler's number {found}, the wall has {expected}: too few cells for this gap"
    )]
    Euler {
        /// Of the cells.
        found: i64,
        /// Of the wall.
        expected: i64,
    },
    /// No seeds.
    #[error(transparent)]
    Sown(#[from] SeedError),
    /// The seeds left the gap.
    #[error("no point of a layer's middle is found from the seed {place}")]
    Lost {
        /// From where.
        place: DVec3,
    },
}
