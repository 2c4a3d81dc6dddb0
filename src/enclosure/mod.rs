//! From a recipe to printable parts that were inspected.
//!
//! **Enters** a recipe (TOML). **Leaves** [`Enclosure`]: two shells and a base as closed meshes in mm, standing as they are
//! printed, and [`Inspection`], what was measured on them.
//!
//! | step | file |
//! |---|---|
//! | the recipe as it is written, with defaults | `recipe.rs`, `default.toml` |
//! | every number checked, the gap solved for | `design.rs` |
//! | which box of the periodic surface, and the topology to expect | `region.rs` |
//! | the shells: copies of a marched sheet, moved | `shells.rs` |
//! | the base: grooves, entrances, screw holes | `base.rs` |
//! | what the finished meshes measure | `inspect.rs` |
//!
//! All faces of the box are mirror planes of the surface, so walls meet them at right angles: the caps are flat, the edges
//! sharp, and the legs that stand in the base's grooves continue the walls smoothly. Nothing stands between the shells.
//!
//! Not promised: supports, slicing, and that a printer holds its tolerances.

mod base;
mod design;
mod inspect;
mod recipe;
mod region;
mod shells;

pub use design::{Design, Fault, Faults};
pub use inspect::{GapSample, Inspection, PartInspection, Spread};
pub use recipe::{
    BaseSection, CellSection, DEFAULT_RECIPE, GapSection, GapShape, MeshSection, Part, PrintSection, Recipe,
    RecipeError, WallSection,
};
pub use region::Region;
pub use shells::{Move, Shell, shell_from_level, shells};

use crate::{
    mesh::{
        ClosedMesh, Legs, MeshDefects, TriMesh,
        plate::{Plate, PlateError},
    },
    surface::{NoFoot, WallSide},
    units::Mm,
};
use glam::DVec3;

/// Between parts on one sheet, in mm: a slicer takes them for separate objects.
pub const SPACING_MM: f64 = 10.0;

/// Why an enclosure cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The recipe asks for something that does not fit.
    #[error("{0}")]
    Recipe(Fault),
    /// The surface was lost while it was meshed.
    #[error("the surface could not be meshed: {0}; use more samples")]
    Surface(#[from] NoFoot),
    /// The marched sheet is no manifold.
    #[error("the sheet is too coarse to be a surface: {0}; use more samples")]
    Sheet(#[source] MeshDefects),
    /// A shell has collapsed triangles.
    #[error("a shell has collapsed triangles: {0}; use more samples, or a smaller gap")]
    Shell(#[source] MeshDefects),
    /// The base cannot be made.
    #[error("the base: {0}")]
    Base(#[from] PlateError),
}

/// One part, standing as it is printed: its lowest plane is `z = 0`.
#[derive(Clone, Debug)]
pub struct PrintPart {
    /// Its name: `inner-shell`, `outer-shell` or `base`.
    pub name: &'static str,
    /// The solid, in mm.
    pub solid: ClosedMesh,
    /// The genus that it must have.
    pub expected_genus: i64,
}

/// The parts of an enclosure.
#[derive(Clone, Debug)]
pub struct Enclosure {
    /// What was built.
    pub design: Design,
    /// The parts: inner shell, outer shell, and the base if there is one.
    pub parts: Vec<PrintPart>,
    /// The base's outlines, if there is a base.
    pub plate: Option<Plate>,
    /// The fronts of the shells (the walls of the gap) in mm, in the frame of the shells: inner, outer.
    pub fronts: [TriMesh; 2],
    /// The backs of the shells, likewise.
    pub backs: [TriMesh; 2],
}

impl Enclosure {
    /// Builds all parts of a design.
    ///
    /// # Errors
    /// [`BuildError`] if the mesh is too coarse or the base has no room.
    pub fn build(design: Design) -> Result<Self, BuildError> {
        let shells = shells(&design)?;
        let plate = design.recipe.base.include.then(|| base::base(&design, &shells)).transpose()?;
        let depth = if plate.is_some() { design.recipe.base.groove } else { 0.0 };
        let depth = Mm(depth).in_units_of(design.period);
        let frame = Frame { low: design.region.low() - depth * DVec3::Z, period: design.period };
        let fronts = shells.each_ref().map(|shell| frame.sheet(shell, shell.front()));
        let backs = shells.each_ref().map(|shell| frame.sheet(shell, shell.back()));
        let genus = 1 - design.region.sheet_euler_number();
        let legs = (depth > 0.0).then(|| Legs { height: design.region.low().z, depth });
        let mut parts = Vec::new();
        for shell in shells {
            let name = if shell.side == WallSide::Lower { "inner-shell" } else { "outer-shell" };
            let solid = shell.solid(legs)?.scaled_and_moved(design.period.0, frame.origin());
            parts.push(PrintPart { name, solid, expected_genus: genus });
        }
        if let Some(plate) = &plate {
            let expected_genus = i64::try_from(plate.holes.len()).unwrap_or(i64::MAX);
            parts.push(PrintPart { name: "base", solid: plate.solid()?, expected_genus });
        }
        Ok(Self { design, parts, plate, fronts, backs })
    }

    /// Where each part stands on a sheet of all parts in a row, [`SPACING_MM`] apart.
    #[must_use]
    pub fn beside_each_other(&self) -> Vec<DVec3> {
        let mut x = 0.0;
        self.parts
            .iter()
            .map(|part| {
                let (low, high) = part.solid.mesh().bounds();
                let place = DVec3::new(x - low.x, -low.y, 0.0);
                x += high.x - low.x + SPACING_MM;
                place
            })
            .collect()
    }

    /// Where each part stands when the enclosure is put together: the base on `z = 0`, the shells in its grooves.
    #[must_use]
    pub fn assembled(&self, part: &PrintPart) -> DVec3 {
        let base = &self.design.recipe.base;
        if part.name == "base" || !base.include {
            DVec3::ZERO
        } else {
            (base.thickness - base.groove) * DVec3::Z
        }
    }
}

/// From units of the period to the shells' frame in mm: the box's lower corner over the origin, the legs' ends on `z = 0`.
struct Frame {
    /// What comes to lie on the origin, in units of the period.
    low: DVec3,
    period: Mm,
}

impl Frame {
    fn origin(&self) -> DVec3 {
        -(self.low * self.period.0)
    }

    fn sheet(&self, shell: &Shell, copy: &crate::index::IndexVec<crate::mesh::VertexId, DVec3>) -> TriMesh {
        let positions = copy.iter().map(|&p| p * self.period.0 + self.origin()).collect();
        TriMesh { positions, triangles: shell.sheet.mesh().triangles.clone() }
    }
}
