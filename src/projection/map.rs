//! A photograph's pattern on the wall that it shows.

use super::{camera::Camera, cast::Caster};
use crate::{
    index::IndexVec,
    tessellation::{Cell, CellId, CellPattern, CellStatus, CellWall, PatternDefect, Surroundings},
};
use glam::{DVec2, DVec3};

/// A cell seen more obliquely than this (the cosine) is cut: its far walls hide behind its near ones.
const LEAST_FACING: f64 = 0.25;

/// A pattern on a wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// The cells that lie on the wall, in the wall's unit; normals point towards the camera.
    pub pattern: CellPattern,
    /// The cell of the photograph that each one is.
    pub of_photo: IndexVec<CellId, CellId>,
    /// Cells of the photograph whose rays miss the wall.
    pub missed: usize,
}

/// Why a pattern cannot be mapped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    /// It is in no photograph.
    #[error(
        "the pattern's lengths are in '{0}', not in px: only a photograph's pattern can be mapped onto a wall"
    )]
    NotPixels(String),
    /// No ray meets the wall.
    #[error(
        "none of the {0} cells lies on the wall as this camera sees it: check the marked points and the recipe"
    )]
    AllMissed(usize),
    /// The mapped cells make no pattern.
    #[error("the mapped cells make no pattern: {}", .0.first().map(ToString::to_string).unwrap_or_default())]
    Pattern(Vec<PatternDefect>),
}

/// Maps a photograph's pattern onto the wall: places by rays, areas and lengths by the footprint of a pixel, curvature from the
/// wall. The numbers of sides stay as they were read; cells that are seen too obliquely are cut.
///
/// # Errors
/// [`MapError`].
pub fn map_pattern(
    pattern: &CellPattern,
    camera: &Camera,
    caster: &Caster,
    unit: &str,
) -> Result<Mapped, MapError> {
    if pattern.unit != "px" {
        return Err(MapError::NotPixels(pattern.unit.clone()));
    }
    let hit = |cell: &Cell| {
        let (from, along) = camera.ray(cell.position.truncate());
        caster.first_hit(from, along)
    };
    let hits: IndexVec<CellId, Option<DVec3>> = pattern.cells.iter().map(hit).collect();
    let mut ids = IndexVec::from_elem(None, pattern.cells.len());
    let mut of_photo = IndexVec::new();
    for (id, hit) in hits.enumerated() {
        if hit.is_some() {
            ids[id] = Some(of_photo.push(id));
        }
    }
    if of_photo.is_empty() {
        return Err(MapError::AllMissed(pattern.cells.len()));
    }
    let place = Place { pattern, camera, caster, ids: &ids };
    let cells = pattern.cells.enumerated().filter_map(|(id, cell)| Some(place.cell(cell, hits[id]?)));
    let cells: IndexVec<CellId, Cell> = cells.collect();
    let missed = pattern.cells.len() - cells.len();
    let pattern = CellPattern::new(unit, Surroundings::Open, cells).map_err(MapError::Pattern)?;
    Ok(Mapped { pattern, of_photo, missed })
}

struct Place<'a> {
    pattern: &'a CellPattern,
    camera: &'a Camera,
    caster: &'a Caster,
    ids: &'a IndexVec<CellId, Option<CellId>>,
}

impl Place<'_> {
    fn cell(&self, cell: &Cell, at: DVec3) -> Cell {
        let wall = self.caster.wall();
        let towards = self.camera.towards(at);
        let outward = wall.field.normal(at);
        let normal = if outward.dot(towards) < 0.0 { -outward } else { outward };
        let facing = normal.dot(towards);
        let pixel = cell.position.truncate();
        let step = self.camera.footprint(pixel, at, normal);
        let status = if facing < LEAST_FACING { CellStatus::Cut } else { cell.status };
        // A photograph's ring runs with y downward, which is clockwise seen from the camera.
        let walls = cell.walls.iter().rev().map(|wall| self.wall(pixel, wall, step));
        Cell {
            position: at,
            normal,
            sides: cell.sides,
            status,
            confidence: cell.confidence,
            area: cell.area * step[0].cross(step[1]).length(),
            gauss_curvature: Some(wall.field.curvature(at).gauss),
            walls: walls.collect(),
        }
    }

    fn wall(&self, pixel: DVec2, wall: &CellWall, step: [DVec3; 2]) -> CellWall {
        let behind = wall.neighbour.map(|other| self.pattern.cells[other].position.truncate() - pixel);
        // A wall runs across the line to its neighbour.
        let along = behind.and_then(|d| d.perp().try_normalize()).unwrap_or(DVec2::X);
        CellWall {
            neighbour: wall.neighbour.and_then(|other| self.ids[other]),
            shift: wall.shift,
            length: wall.length * (step[0] * along.x + step[1] * along.y).length(),
        }
    }
}

/// Of cells that several photographs show, only the one seen most squarely counts: in each pattern, cells that another camera
/// looks at more squarely become cut. Patterns and cameras go in pairs; `hidden` says whether the wall hides a point from a
/// camera.
pub fn keep_squarest(views: &mut [(CellPattern, Camera)], hidden: impl Fn(DVec3, &Camera) -> bool) {
    let cameras: Vec<Camera> = views.iter().map(|(_, camera)| *camera).collect();
    for (index, (pattern, camera)) in views.iter_mut().enumerate() {
        for cell in pattern.cells.iter_mut() {
            let facing = |camera: &Camera| cell.normal.dot(camera.towards(cell.position));
            let own = facing(camera);
            let beaten = cameras.iter().enumerate().any(|(other, camera)| {
                let better = facing(camera);
                let first = (better - own).abs() < 1e-12 && other < index;
                other != index && (better > own || first) && !hidden(cell.position, camera)
            });
            if beaten {
                cell.status = CellStatus::Cut;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        projection::Extent,
        surface::{Sphere, Wall, WallSide},
        tessellation::flipped_hexagons,
    };
    use std::sync::Arc;

    /// Hexagons in pixels about the middle of a picture of 400 pixels.
    fn flat() -> Result<CellPattern, String> {
        let mut pattern = flipped_hexagons(6, 6, 0, 1).map_err(|d| format!("{d:?}"))?;
        for cell in pattern.cells.iter_mut() {
            cell.position = DVec3::new(130.0 + 24.0 * cell.position.x, 140.0 + 24.0 * cell.position.y, 0.0);
            cell.area *= 24.0 * 24.0;
        }
        pattern.unit = "px".to_owned();
        Ok(pattern)
    }

    #[test]
    fn cells_come_to_lie_on_the_sphere_with_its_curvature_and_area() -> Result<(), Box<dyn std::error::Error>>
    {
        let wall = Wall { field: Arc::new(Sphere { radius: 50.0 }), level: 0.0 };
        let extent = Extent { low: DVec3::splat(-60.0), high: DVec3::splat(60.0) };
        let caster = Caster::new(wall, WallSide::Lower, extent);
        let camera = Camera::top(DVec3::ZERO, 4.0, DVec2::splat(400.0));
        let photo = flat()?;
        let mapped = map_pattern(&photo, &camera, &caster, "mm")?;
        assert_eq!(mapped.missed, 0);
        for (id, cell) in mapped.pattern.cells.enumerated() {
            let seen = &photo.cells[mapped.of_photo[id]];
            assert!((cell.position.length() - 50.0).abs() < 1e-6);
            assert!(cell.normal.distance(cell.position / 50.0) < 1e-6);
            assert!(cell.gauss_curvature.is_some_and(|k| (k - 4e-4).abs() < 1e-9));
            // A pixel is a quarter of a millimetre, seen at an angle.
            let area = seen.area / 16.0 / cell.normal.z;
            assert!((cell.area / area - 1.0).abs() < 1e-9);
            assert_eq!(cell.sides, seen.sides);
        }
        let mut wrong = flat()?;
        wrong.unit = "mm".to_owned();
        assert!(matches!(map_pattern(&wrong, &camera, &caster, "mm"), Err(MapError::NotPixels(_))));
        let aside = Camera::top(DVec3::splat(500.0), 4.0, DVec2::splat(400.0));
        assert!(matches!(map_pattern(&photo, &aside, &caster, "mm"), Err(MapError::AllMissed(36))));
        Ok(())
    }

    #[test]
    fn a_cell_in_two_photographs_counts_once() -> Result<(), Box<dyn std::error::Error>> {
        let wall = Wall { field: Arc::new(Sphere { radius: 50.0 }), level: 0.0 };
        let extent = Extent { low: DVec3::splat(-60.0), high: DVec3::splat(60.0) };
        let caster = Caster::new(wall, WallSide::Lower, extent);
        let size = DVec2::splat(400.0);
        let view = |x: f64| -> Result<(CellPattern, Camera), Box<dyn std::error::Error>> {
            let camera = Camera::looking_at(DVec3::new(x, 0.0, 400.0), DVec3::ZERO, DVec3::Y, 1600.0, size);
            Ok((map_pattern(&flat()?, &camera, &caster, "mm")?.pattern, camera))
        };
        let mut views = [view(-100.0)?, view(100.0)?];
        keep_squarest(&mut views, |_, _| false);
        let counted: Vec<usize> = views.iter().map(|(pattern, _)| pattern.complete().count()).collect();
        assert!(counted.iter().all(|count| (1..36).contains(count)), "{counted:?}");
        for (side, (pattern, _)) in [-1.0, 1.0].into_iter().zip(&views) {
            assert!(pattern.complete().all(|(_, cell)| cell.position.x * side >= -1e-9));
        }
        Ok(())
    }
}
