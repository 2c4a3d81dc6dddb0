//! The two shells: each the solid between two moved copies of a marched sheet.

use super::{BuildError, design::Design, recipe::GapShape};
use crate::{
    index::IndexVec,
    mesh::{ClosedMesh, Legs, Sheet, VertexId, march},
    surface::{LevelSet, NoFoot, WallSide},
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// How a copy of a sheet is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Move {
    /// Along the unit normal by this length: a true offset.
    Offset(f64),
    /// Along the gradient to this level.
    ToLevel(f64),
}

/// A shell's sheet and its two copies, in units of the period.
#[derive(Clone, Debug)]
pub struct Shell {
    /// The sheet that was marched.
    pub sheet: Arc<Sheet>,
    /// The copy on the side of lower `Φ`.
    pub lower: IndexVec<VertexId, DVec3>,
    /// The copy on the side of higher `Φ`.
    pub upper: IndexVec<VertexId, DVec3>,
    /// Which wall of the gap its front is: the lower wall's front is its upper copy.
    pub side: WallSide,
}

impl Shell {
    /// The copy that faces the gap.
    #[must_use]
    pub fn front(&self) -> &IndexVec<VertexId, DVec3> {
        match self.side {
            WallSide::Lower => &self.upper,
            WallSide::Upper => &self.lower,
        }
    }

    /// The copy that faces away from the gap.
    #[must_use]
    pub fn back(&self) -> &IndexVec<VertexId, DVec3> {
        match self.side {
            WallSide::Lower => &self.lower,
            WallSide::Upper => &self.upper,
        }
    }

    /// The solid, in units of the period, with legs below its lower face if wanted. The copies are given up for it.
    ///
    /// # Errors
    /// [`BuildError::Shell`] if a triangle collapsed.
    pub fn solid(self, legs: Option<Legs>) -> Result<ClosedMesh, BuildError> {
        self.sheet.thicken(self.lower, self.upper, legs).map_err(BuildError::Shell)
    }
}

/// Both shells of a design, the one at the lower wall first.
///
/// Parallel walls are offsets of one sheet of the middle surface. A level-set wall is marched at its own level, and its back
/// is an offset of that.
///
/// # Errors
/// [`BuildError`] if the sheet cannot be made.
pub fn shells(design: &Design) -> Result<[Shell; 2], BuildError> {
    let grid = design.region.grid(design.recipe.mesh.samples);
    let (surface, wall) = (design.surface(), design.wall());
    let bounds = (design.region.low(), design.region.high());
    match design.recipe.gap.shape {
        GapShape::Parallel => {
            let sheet =
                Arc::new(Sheet::new(march(surface.as_ref(), 0.0, &grid)?).map_err(BuildError::Sheet)?);
            let front = design.gap.wall(WallSide::Upper).level;
            let moved = |offset| moved(surface.as_ref(), &sheet, Move::Offset(offset), bounds);
            Ok([
                Shell {
                    sheet: sheet.clone(),
                    lower: moved(-front - wall)?,
                    upper: moved(-front)?,
                    side: WallSide::Lower,
                },
                Shell {
                    sheet: sheet.clone(),
                    lower: moved(front)?,
                    upper: moved(front + wall)?,
                    side: WallSide::Upper,
                },
            ])
        }
        GapShape::LevelSet => {
            let shell = |side| {
                let level = design.gap.wall(side).level;
                let back = if side == WallSide::Lower { -wall } else { wall };
                shell_from_level(surface.as_ref(), level, Move::Offset(back), &grid, side)
            };
            let (lower, upper) = rayon::join(|| shell(WallSide::Lower), || shell(WallSide::Upper));
            Ok([lower?, upper?])
        }
    }
}

/// A shell whose front is the level `level`, marched, and whose back is a moved copy of it.
///
/// # Errors
/// [`BuildError`] if the sheet cannot be made.
pub fn shell_from_level(
    surface: &dyn LevelSet,
    level: f64,
    back: Move,
    grid: &crate::mesh::Grid,
    side: WallSide,
) -> Result<Shell, BuildError> {
    let sheet = Arc::new(Sheet::new(march(surface, level, grid)?).map_err(BuildError::Sheet)?);
    let front = sheet.mesh().positions.clone();
    let back = moved(surface, &sheet, back, (grid.low, grid.high))?;
    let (lower, upper) = if side == WallSide::Lower { (back, front) } else { (front, back) };
    Ok(Shell { sheet, lower, upper, side })
}

/// The sheet's vertices, moved. Vertices on a face of the box stay on it exactly: the face is a mirror plane, so the normal
/// there lies in it up to rounding.
fn moved(
    surface: &dyn LevelSet,
    sheet: &Sheet,
    how: Move,
    (low, high): (DVec3, DVec3),
) -> Result<IndexVec<VertexId, DVec3>, NoFoot> {
    let place = |&p: &DVec3| -> Result<DVec3, NoFoot> {
        let mut q = match how {
            Move::Offset(distance) => p + distance * surface.normal(p),
            Move::ToLevel(level) => surface.project(p, level)?,
        };
        for axis in 0..3 {
            if p[axis] <= low[axis] || p[axis] >= high[axis] {
                q[axis] = p[axis];
            }
        }
        Ok(q)
    };
    let places: Result<Vec<DVec3>, NoFoot> =
        sheet.mesh().positions.as_slice().par_iter().map(place).collect();
    Ok(places?.into())
}
