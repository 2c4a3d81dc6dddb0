//! The pattern of cells: the one page between foam, comb and comparison.

use crate::index::{Id, IndexVec};
use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

crate::define_id!(
    /// A cell of a [`CellPattern`].
    CellId
);

/// The name and version of the pattern's JSON form.
pub const PATTERN_SCHEMA: &str = "combwright.pattern/1";

/// Whether a cell counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CellStatus {
    /// All its walls were seen: it counts.
    Complete,
    /// It meets the edge of the comb, of the photograph, of the domain or of something that hides it.
    Cut,
    /// Seen, but not well enough to be sure of its sides.
    Uncertain,
}

/// One wall of a cell, in the cell's ring.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellWall {
    /// The cell behind the wall; `None` for the outside, such as the edge of the comb.
    pub neighbour: Option<CellId>,
    /// How many periods the neighbour that is touched lies away from the one in the list; zero without periods.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub shift: IVec3,
    /// The wall's length, in the pattern's unit.
    pub length: f64,
}

fn is_zero(shift: &IVec3) -> bool {
    *shift == IVec3::ZERO
}

/// One cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Its centre, in the pattern's unit. In a photograph x points right, y down, and z is 0.
    pub position: DVec3,
    /// The unit normal of the surface that it lies on; seen from its tip the ring of walls runs counter-clockwise.
    pub normal: DVec3,
    /// The number of sides, as decided; a cell that is not complete may have none.
    pub sides: Option<u32>,
    /// Whether it counts.
    pub status: CellStatus,
    /// The probability that `sides` is right, between 0 and 1; 1 for a foam.
    pub confidence: f64,
    /// Its area, in the square of the pattern's unit.
    pub area: f64,
    /// The Gaussian curvature of the surface at the cell, in 1/unit², where the surface is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gauss_curvature: Option<f64>,
    /// Its walls in cyclic order.
    pub walls: Vec<CellWall>,
}

/// What the pattern lies on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Surroundings {
    /// A piece with an edge: its outermost cells are cut.
    Open,
    /// A closed surface, or one period of a periodic one, with its Euler characteristic.
    Closed {
        /// The Euler characteristic.
        euler_characteristic: i32,
    },
}

/// Cells and who touches whom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellPattern {
    schema: String,
    /// The unit of lengths: `px`, `mm`, or `L` for the period or unit of the surface.
    pub unit: String,
    /// What the pattern lies on.
    pub surroundings: Surroundings,
    /// The cells.
    pub cells: IndexVec<CellId, Cell>,
}

/// A way in which a list of cells is no pattern.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatternDefect {
    /// The JSON form is of another kind or version.
    #[error("the pattern's schema is '{found}'; this program reads '{PATTERN_SCHEMA}'")]
    Schema {
        /// What was found.
        found: String,
    },
    /// A number that is not finite, or a confidence outside 0 to 1, or a negative length.
    #[error("cell {cell}: the {what} is {value}")]
    Number {
        /// The cell.
        cell: CellId,
        /// Which number.
        what: &'static str,
        /// What it is.
        value: f64,
    },
    /// A neighbour that does not exist.
    #[error("cell {cell} names the neighbour {neighbour}, but there are only {cells} cells")]
    NoSuchCell {
        /// The cell.
        cell: CellId,
        /// The neighbour named.
        neighbour: CellId,
        /// How many cells there are.
        cells: usize,
    },
    /// A wall that is not seen from the other side.
    #[error("cell {cell} touches {neighbour} across {times} walls, but {neighbour} touches it across {back}")]
    OneSided {
        /// The cell.
        cell: CellId,
        /// Its neighbour.
        neighbour: CellId,
        /// How often the cell lists the neighbour at this shift.
        times: usize,
        /// How often the neighbour lists the cell at the opposite shift.
        back: usize,
    },
    /// A complete cell without a number of sides, or with one that differs from its walls while it claims certainty.
    #[error("cell {cell} is complete, but its number of sides is missing")]
    NoSides {
        /// The cell.
        cell: CellId,
    },
}

impl CellPattern {
    /// A pattern of `cells`, checked.
    ///
    /// # Errors
    /// Every [`PatternDefect`] found.
    pub fn new(
        unit: impl Into<String>,
        surroundings: Surroundings,
        cells: IndexVec<CellId, Cell>,
    ) -> Result<Self, Vec<PatternDefect>> {
        let pattern = Self { schema: PATTERN_SCHEMA.to_owned(), unit: unit.into(), surroundings, cells };
        let defects = pattern.defects();
        if defects.is_empty() { Ok(pattern) } else { Err(defects) }
    }

    /// Every way in which this is no pattern: after reading it from a file, for one.
    #[must_use]
    pub fn defects(&self) -> Vec<PatternDefect> {
        let mut found = Vec::new();
        if self.schema != PATTERN_SCHEMA {
            found.push(PatternDefect::Schema { found: self.schema.clone() });
        }
        for (id, cell) in self.cells.enumerated() {
            self.check_numbers(id, cell, &mut found);
            self.check_walls(id, cell, &mut found);
            if cell.status == CellStatus::Complete && cell.sides.is_none() {
                found.push(PatternDefect::NoSides { cell: id });
            }
        }
        found
    }

    fn check_numbers(&self, id: CellId, cell: &Cell, found: &mut Vec<PatternDefect>) {
        let mut check = |what, value: f64, ok: bool| {
            if !ok {
                found.push(PatternDefect::Number { cell: id, what, value });
            }
        };
        for axis in 0..3 {
            check("position", cell.position[axis], cell.position[axis].is_finite());
            check("normal", cell.normal[axis], cell.normal[axis].is_finite());
        }
        check("confidence", cell.confidence, (0.0..=1.0).contains(&cell.confidence));
        check("area", cell.area, cell.area >= 0.0 && cell.area.is_finite());
        for wall in &cell.walls {
            check("wall length", wall.length, wall.length >= 0.0 && wall.length.is_finite());
        }
    }

    fn check_walls(&self, id: CellId, cell: &Cell, found: &mut Vec<PatternDefect>) {
        let count = |of: &Cell, neighbour: CellId, shift: IVec3| {
            of.walls.iter().filter(|w| w.neighbour == Some(neighbour) && w.shift == shift).count()
        };
        for wall in &cell.walls {
            let Some(neighbour) = wall.neighbour else { continue };
            let Some(other) = self.cells.get(neighbour) else {
                found.push(PatternDefect::NoSuchCell { cell: id, neighbour, cells: self.cells.len() });
                continue;
            };
            let (times, back) = (count(cell, neighbour, wall.shift), count(other, id, -wall.shift));
            if times != back {
                found.push(PatternDefect::OneSided { cell: id, neighbour, times, back });
            }
        }
    }

    /// Σ(6 − n) over the complete cells: the topological charge. On a closed, three-valent pattern it is 6χ.
    #[must_use]
    pub fn charge(&self) -> i64 {
        self.complete().filter_map(|(_, cell)| cell.sides).map(|sides| 6 - i64::from(sides)).sum()
    }

    /// The complete cells.
    pub fn complete(&self) -> impl Iterator<Item = (CellId, &Cell)> {
        self.cells.enumerated().filter(|(_, cell)| cell.status == CellStatus::Complete)
    }

    /// How many complete cells have 0, 1, 2 … sides.
    #[must_use]
    pub fn side_counts(&self) -> Vec<usize> {
        let mut counts = Vec::new();
        for sides in self.complete().filter_map(|(_, cell)| cell.sides) {
            let index = sides as usize;
            if counts.len() <= index {
                counts.resize(index + 1, 0);
            }
            counts[index] += 1;
        }
        counts
    }

    /// The position of a cell in the list: what `id` is called in tables.
    #[must_use]
    pub fn number(id: CellId) -> usize {
        id.index()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed pattern: the twelve pentagons of a dodecahedron, from the vertices of the icosahedron.
    pub(crate) fn dodecahedron() -> IndexVec<CellId, Cell> {
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let mut corners = Vec::new();
        for (a, b) in [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)] {
            corners.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
        }
        let ring = |centre: DVec3| {
            let (u, v) = centre.normalize().any_orthonormal_pair();
            let mut near: Vec<(f64, usize)> = corners
                .iter()
                .enumerate()
                .filter(|(_, c)| (c.distance(centre) - 2.0).abs() < 1e-9)
                .map(|(i, c)| (c.dot(v).atan2(c.dot(u)), i))
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            near.into_iter().map(|(_, i)| i).collect::<Vec<_>>()
        };
        corners
            .iter()
            .map(|&centre| Cell {
                position: centre,
                normal: centre.normalize(),
                sides: Some(5),
                status: CellStatus::Complete,
                confidence: 1.0,
                area: 1.0,
                gauss_curvature: None,
                walls: ring(centre)
                    .into_iter()
                    .map(|i| CellWall {
                        neighbour: Some(CellId::from_index(i)),
                        shift: IVec3::ZERO,
                        length: 1.0,
                    })
                    .collect(),
            })
            .collect()
    }

    #[test]
    fn twelve_pentagons_close_a_sphere() {
        let surroundings = Surroundings::Closed { euler_characteristic: 2 };
        let Ok(pattern) = CellPattern::new("L", surroundings, dodecahedron()) else {
            panic!("refused");
        };
        assert_eq!(pattern.charge(), 12);
        assert_eq!(pattern.side_counts(), [0, 0, 0, 0, 0, 12]);
    }

    #[test]
    fn every_defect_is_reported() {
        let mut cells = dodecahedron();
        let first = CellId::from_index(0);
        cells[first].walls.pop();
        cells[first].sides = None;
        cells[first].confidence = 1.5;
        cells[first].walls[0].neighbour = Some(CellId::from_index(99));
        let Err(defects) = CellPattern::new("L", Surroundings::Open, cells) else { panic!("accepted") };
        assert!(defects.iter().any(|d| matches!(d, PatternDefect::NoSides { .. })));
        assert!(defects.iter().any(|d| matches!(d, PatternDefect::Number { what: "confidence", .. })));
        assert!(defects.iter().any(|d| matches!(d, PatternDefect::NoSuchCell { .. })));
        assert_eq!(defects.iter().filter(|d| matches!(d, PatternDefect::OneSided { .. })).count(), 2);
    }

    #[test]
    fn json_and_back_is_the_identity() -> Result<(), Box<dyn std::error::Error>> {
        let Ok(pattern) = CellPattern::new("px", Surroundings::Open, dodecahedron()) else {
            panic!("refused")
        };
        let text = serde_json::to_string(&pattern)?;
        let back: CellPattern = serde_json::from_str(&text)?;
        assert_eq!(pattern, back);
        let other: CellPattern = serde_json::from_str(&text.replace("pattern/1", "pattern/9"))?;
        assert!(matches!(other.defects()[..], [PatternDefect::Schema { .. }]));
        Ok(())
    }
}
