//! A recipe as it is written: TOML, with defaults for every line.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The commented recipe of the defaults: what `--init` writes, and what is built when nothing is said.
pub const DEFAULT_RECIPE: &str = include_str!("default.toml");

/// What to print. Lengths in mm; see [`DEFAULT_RECIPE`] for each line's meaning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct Recipe {
    pub name: String,
    pub cell: CellSection,
    pub gap: GapSection,
    pub wall: WallSection,
    pub base: BaseSection,
    pub mesh: MeshSection,
    pub print: PrintSection,
}

/// The section `[cell]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct CellSection {
    pub period: f64,
    pub part: Part,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub block: Option<[f64; 3]>,
}

/// Which part of the periodic surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// The unit cell cut by the mirror plane through its centre.
    Half,
    /// The unit cell.
    Whole,
    /// An eighth of the unit cell, between mirror planes.
    Octant,
    /// `block` cells.
    Block,
}

/// The section `[gap]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct GapSection {
    pub shape: GapShape,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cell_depth: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bee_space: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub is: Option<crate::surface::NamedGap>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delta: Option<f64>,
}

/// How the walls follow from the middle surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GapShape {
    /// True offsets: the same gap everywhere.
    #[default]
    Parallel,
    /// Levels of the surface's function: the gap varies.
    LevelSet,
}

/// The section `[wall]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct WallSection {
    pub thickness: f64,
}

/// The section `[base]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct BaseSection {
    pub include: bool,
    pub thickness: f64,
    pub groove: f64,
    pub clearance: f64,
    pub margin: f64,
    pub entrances: u32,
    pub entrance_diameter: f64,
    pub screws: u32,
    pub screw_diameter: f64,
    pub window: bool,
}

/// The section `[mesh]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct MeshSection {
    pub samples: u32,
}

/// The section `[print]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(
    missing_docs,
    reason = "each field is explained in DEFAULT_RECIPE, which the program writes for its user"
)]
pub struct PrintSection {
    pub bed: [f64; 3],
    pub density: f64,
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            name: "enclosure".to_owned(),
            cell: CellSection::default(),
            gap: GapSection::default(),
            wall: WallSection::default(),
            base: BaseSection::default(),
            mesh: MeshSection::default(),
            print: PrintSection::default(),
        }
    }
}

impl Default for CellSection {
    fn default() -> Self {
        Self { period: 200.0, part: Part::Half, block: None }
    }
}

impl Default for WallSection {
    fn default() -> Self {
        Self { thickness: 2.0 }
    }
}

impl Default for BaseSection {
    fn default() -> Self {
        Self {
            include: true,
            thickness: 5.0,
            groove: 3.0,
            clearance: 0.2,
            margin: 4.0,
            entrances: 8,
            entrance_diameter: 8.0,
            screws: 4,
            screw_diameter: 4.5,
            window: true,
        }
    }
}

impl Default for MeshSection {
    fn default() -> Self {
        Self { samples: 192 }
    }
}

impl Default for PrintSection {
    fn default() -> Self {
        Self { bed: [256.0; 3], density: 1.24 }
    }
}

/// A recipe that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct RecipeError {
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1.
    pub column: usize,
    /// What is wrong there, and what would be right.
    pub message: String,
}

impl Recipe {
    /// Reads a recipe.
    ///
    /// # Errors
    /// [`RecipeError`] at the first place that is no TOML, an unknown key or a value of the wrong kind.
    pub fn parse(text: &str) -> Result<Self, RecipeError> {
        toml::from_str(text).map_err(|error| {
            let (line, column) = place(text, error.span().unwrap_or(0..0));
            let said = error.message().trim().replace('\n', "; ");
            let source = text.lines().nth(line - 1).unwrap_or_default().trim();
            RecipeError { line, column, message: format!("{said}, in '{source}'") }
        })
    }

    /// The line of `field`, such as `gap.width`, in the text that the recipe was read from.
    #[must_use]
    pub fn line_of(text: &str, field: &str) -> Option<usize> {
        let document = toml::de::DeTable::parse(text).ok()?;
        let mut table = document.get_ref();
        let mut names = field.split('.').peekable();
        while let Some(name) = names.next() {
            let (key, value) = table.iter().find(|(key, _)| key.get_ref().as_ref() == name)?;
            if names.peek().is_none() {
                return Some(place(text, key.span()).0);
            }
            table = value.get_ref().as_table()?;
        }
        None
    }
}

/// Line and column, from 1, of the start of a span.
fn place(text: &str, span: Range<usize>) -> (usize, usize) {
    let before = &text[..span.start.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
    (line, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_written_defaults_are_the_defaults() {
        let Ok(read) = Recipe::parse(DEFAULT_RECIPE) else { panic!("the default recipe is not read") };
        let gap = GapSection { cell_depth: Some(11.5), bee_space: Some(9.0), ..GapSection::default() };
        let expected = Recipe { name: "default".to_owned(), gap, ..Recipe::default() };
        assert_eq!(read, expected);
    }

    #[test]
    fn errors_name_the_place() {
        let Err(unknown) = Recipe::parse("[wall]\nthicknes = 2.0\n") else { panic!("accepted") };
        assert_eq!(unknown.line, 2);
        assert!(unknown.message.contains("thicknes") && unknown.message.contains("thickness"), "{unknown}");
        let Err(kind) = Recipe::parse("[cell]\nperiod = 200.0\npart = \"third\"\n") else {
            panic!("accepted")
        };
        assert_eq!((kind.line, kind.column), (3, 8), "{kind}");
        assert!(Recipe::parse("[cell\n").is_err_and(|e| e.line == 1));
    }

    #[test]
    fn the_line_of_a_field_is_found() {
        let text = "name = 'x'\n[gap]\nshape = 'parallel'\nwidth = -3.0\n";
        assert_eq!(Recipe::line_of(text, "gap.width"), Some(4));
        assert_eq!(Recipe::line_of(text, "gap.delta"), None);
        assert_eq!(Recipe::line_of(text, "name"), Some(1));
    }
}
