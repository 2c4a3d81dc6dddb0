//! Enclosures for bees between two curved walls, the ideal foam in the same gap, and the comb read from photographs.
//!
//! Three jobs share one geometry. [`surface::Gap`] is the gap between two walls of a level set; the enclosure prints it and
//! the foam fills it. [`tessellation::CellPattern`] is a page of cells and who touches whom; the foam makes one, a photograph
//! of comb gives one, and the two are compared without knowing where they came from.
//!
//! Rooms, each with a page of its own; imports point downward only:
//!
//! | room | job |
//! |---|---|
//! | [`units`], [`index`] | lengths with their unit; indices that know what they index |
//! | [`surface`] | level sets, curvature, nearest points, the gap |
//! | [`foam`] | the ideal foam between two walls: seeds, partition, relaxed films |
//! | [`tessellation`] | who touches whom, sides, defects, distributions |
//! | [`compare`] | comb against foam, with its uncertainty |
//! | [`projection`] | between a flat photograph and the curved wall that it shows |
//! | [`report`] | tables, figures, files |
//!
//! The library prints nothing. The program `combwright` is built with the feature `cli`.

pub mod comb;
pub mod compare;
pub mod enclosure;
pub mod evolver;
pub mod foam;
pub mod index;
pub mod mesh;
pub mod projection;
pub mod report;
pub mod surface;
pub mod tessellation;
pub mod units;

#[cfg(feature = "cli")]
pub mod cli;
