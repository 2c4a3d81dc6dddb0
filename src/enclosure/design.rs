//! A recipe made definite: every number checked, the gap solved for.

use super::{
    recipe::{GapShape, Recipe},
    region::Region,
};
use crate::{
    surface::{Gap, GapError, LevelSet, NamedGap, SchwarzP, WallSide, reach},
    units::{LevelOffset, Mm},
};
use std::{fmt, sync::Arc};

/// A recipe that can be built. The gap and everything geometric is in units of the period.
#[derive(Clone, Debug)]
pub struct Design {
    /// The recipe.
    pub recipe: Recipe,
    /// The period `L`.
    pub period: Mm,
    /// The piece that is printed.
    pub region: Region,
    /// The gap between the shells.
    pub gap: Gap,
}

/// One thing in a recipe that cannot be built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The field, such as `gap.width`.
    pub field: &'static str,
    /// What is wrong, why, and what would do.
    pub message: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.message)
    }
}

/// Everything in a recipe that cannot be built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Faults(pub Vec<Fault>);

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

impl std::error::Error for Faults {}

/// The most memory a mesh may take: half of a small computer's.
const MEMORY_LIMIT_BYTES: f64 = 4e9;

/// Copies of the sheet held at once while an enclosure is built and inspected: two shells of two sides each, their rounded
/// places and triangles in files, and the trees that search them. The peak of the whole program is that many estimates
/// within a sixth, measured at 384 and 640 samples (311 and 899 MB); pictures add 0.1 GB that smaller meshes do not hide.
const COPIES_HELD: f64 = 14.0;

impl Design {
    /// Checks a recipe and solves for its gap.
    ///
    /// # Errors
    /// All [`Faults`] at once.
    pub fn new(recipe: &Recipe) -> Result<Self, Faults> {
        let mut faults = number_faults(recipe);
        let region = Region::new(&recipe.cell)
            .map_err(|message| faults.push(Fault { field: "cell.block", message }))
            .ok();
        let width = gap_width(recipe, &mut faults);
        if let Some(region) = &region
            && faults.is_empty()
        {
            faults.extend(memory_fault(recipe, region));
        }
        // The gap is solved for only with sound numbers.
        let (Some(region), true) = (region, faults.is_empty()) else { return Err(Faults(faults)) };
        let period = Mm(recipe.cell.period);
        let gap = gap(recipe, width, period).map_err(|fault| Faults(vec![fault]))?;
        Ok(Self { recipe: recipe.clone(), period, region, gap })
    }

    /// The level function of the middle surface, in units of the period.
    #[must_use]
    pub fn surface(&self) -> &Arc<dyn LevelSet> {
        self.gap.middle()
    }

    /// The walls' thickness in units of the period.
    #[must_use]
    pub fn wall(&self) -> f64 {
        Mm(self.recipe.wall.thickness).in_units_of(self.period)
    }
}

/// Numbers out of their range.
fn number_faults(recipe: &Recipe) -> Vec<Fault> {
    let (base, print) = (&recipe.base, &recipe.print);
    let mut ranges: Vec<(&'static str, f64, f64, f64, &str)> = vec![
        ("cell.period", recipe.cell.period, 10.0, 5000.0, "mm"),
        ("wall.thickness", recipe.wall.thickness, 0.4, 50.0, "mm"),
        ("mesh.samples", f64::from(recipe.mesh.samples), 16.0, 4096.0, "cells per period"),
        ("print.bed", print.bed.iter().copied().fold(f64::NAN, f64::min), 20.0, 10_000.0, "mm"),
        ("print.density", print.density, 0.1, 25.0, "g/cm³"),
    ];
    for (field, value) in [
        ("gap.width", recipe.gap.width),
        ("gap.cell_depth", recipe.gap.cell_depth),
        ("gap.bee_space", recipe.gap.bee_space),
    ] {
        ranges.extend(value.map(|value| (field, value, 0.1, 1000.0, "mm")));
    }
    ranges.extend(recipe.gap.delta.map(|delta| ("gap.delta", delta, 1e-3, 0.999, "(Φ has no unit)")));
    if base.include {
        ranges.extend([
            ("base.thickness", base.thickness, 1.0, 100.0, "mm"),
            (
                "base.groove",
                base.groove,
                0.5,
                (base.thickness - 0.8).max(0.5),
                "mm (0.8 mm of floor must stay)",
            ),
            ("base.clearance", base.clearance, 0.0, 1.0, "mm"),
            (
                "base.margin",
                base.margin,
                base.clearance + 1.2,
                200.0,
                "mm (the groove needs a wall of 1.2 mm)",
            ),
            ("base.entrances", f64::from(base.entrances), 0.0, 200.0, "holes"),
            ("base.entrance_diameter", base.entrance_diameter, 5.5, 50.0, "mm (a worker bee needs 5.5)"),
            ("base.screw_diameter", base.screw_diameter, 1.0, 12.0, "mm"),
        ]);
    }
    let mut faults: Vec<Fault> = ranges
        .into_iter()
        // Written so that a value that is not a number is out of range.
        .filter(|(_, value, low, high, _)| !(value >= low && value <= high))
        .map(|(field, value, low, high, unit)| Fault {
            field,
            message: format!("{value} is out of range: {low} to {high} {unit}"),
        })
        .collect();
    if base.include && base.screws != 0 && base.screws != 4 {
        let message = format!("{} screw holes: there can be 0, or 4, one in each corner", base.screws);
        faults.push(Fault { field: "base.screws", message });
    }
    faults
}

/// The width asked for, in mm; `None` if `delta` is given instead, or if it is not clear.
fn gap_width(recipe: &Recipe, faults: &mut Vec<Fault>) -> Option<f64> {
    let gap = &recipe.gap;
    let mut fault = |field, message: &str| faults.push(Fault { field, message: message.to_owned() });
    let by_bees = gap.cell_depth.is_some() || gap.bee_space.is_some();
    let ways = [gap.width.is_some(), gap.delta.is_some(), by_bees];
    if ways.iter().filter(|&&way| way).count() > 1 {
        fault("gap", "give either width, or cell_depth and bee_space, or delta");
    }
    if gap.shape == GapShape::Parallel && gap.delta.is_some() {
        fault("gap.delta", "parallel walls are no levels of Φ; give a width, or shape = \"level-set\"");
    }
    if gap.shape == GapShape::Parallel && gap.is.is_some_and(|is| is != NamedGap::Min) {
        fault("gap.is", "the gap of parallel walls is the same everywhere; leave this out");
    }
    if gap.delta.is_some() && gap.is.is_some() {
        fault("gap.is", "delta says it all; leave this out");
    }
    let by_bees = 2.0 * gap.cell_depth.unwrap_or(11.5) + gap.bee_space.unwrap_or(9.0);
    gap.delta.is_none().then(|| gap.width.unwrap_or(by_bees))
}

/// A mesh that would take too much memory.
fn memory_fault(recipe: &Recipe, region: &Region) -> Option<Fault> {
    let bytes = COPIES_HELD * region.grid(recipe.mesh.samples).memory_estimate(1.0);
    (bytes > MEMORY_LIMIT_BYTES).then(|| Fault {
        field: "mesh.samples",
        message: format!(
            "{} samples per period would take about {:.1} GB of memory; the limit is {:.0} GB: use about {:.0}",
            recipe.mesh.samples,
            bytes / 1e9,
            MEMORY_LIMIT_BYTES / 1e9,
            // Memory grows with the square of the samples.
            f64::from(recipe.mesh.samples) * (MEMORY_LIMIT_BYTES / bytes).sqrt()
        ),
    })
}

/// The gap in units of the period.
fn gap(recipe: &Recipe, width: Option<f64>, period: Mm) -> Result<Gap, Fault> {
    let surface: Arc<dyn LevelSet> = Arc::new(SchwarzP { period: 1.0 });
    let wall = Mm(recipe.wall.thickness).in_units_of(period);
    let made = match (recipe.gap.shape, width) {
        (GapShape::Parallel, width) => {
            Gap::parallel(surface, Mm(width.unwrap_or(f64::NAN)).in_units_of(period), wall)
        }
        (GapShape::LevelSet, Some(width)) => {
            let named = recipe.gap.is.unwrap_or(NamedGap::Min);
            Gap::with_named(surface, named, Mm(width).in_units_of(period))
        }
        (GapShape::LevelSet, None) => {
            Gap::level_set(surface, LevelOffset(recipe.gap.delta.unwrap_or(f64::NAN)))
        }
    };
    let gap = made.map_err(|error| gap_fault(error, period))?;
    if recipe.gap.shape == GapShape::LevelSet {
        wall_fits(&gap, wall, period)?;
    }
    Ok(gap)
}

/// Says in mm why there is no such gap, and which period would have it.
fn gap_fault(error: GapError, period: Mm) -> Fault {
    let longer = match &error {
        GapError::Folds { width, margin, reach, .. } => Some((width / 2.0 + margin) / reach),
        GapError::Unreachable { width, largest, .. } => Some(width / largest),
        _ => None,
    };
    let advice = longer.map_or_else(String::new, |factor| {
        // A hair more than the bound, which itself is out of reach.
        format!(" (in mm); or take a period above {:.1} mm", 1.0001 * factor * period.0)
    });
    Fault { field: "gap", message: format!("{}{advice}", error.scaled(period.0)) }
}

/// Level-set walls: the wall's back is a true offset of its front and must not fold.
fn wall_fits(gap: &Gap, wall: f64, period: Mm) -> Result<(), Fault> {
    let least = WallSide::BOTH
        .into_iter()
        .map(|side| gap.wall(side))
        .map(|front| reach(front.field.as_ref(), front.level))
        .fold(f64::INFINITY, f64::min);
    if wall < least {
        return Ok(());
    }
    Err(Fault {
        field: "wall.thickness",
        message: format!(
            "{:.3} mm is thicker than the gap allows: the walls' least radius of curvature is {:.3} mm, and a thicker wall folds",
            wall * period.0,
            least * period.0
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::enclosure::recipe::{DEFAULT_RECIPE, Part};

    fn changed(change: impl FnOnce(&mut Recipe)) -> Result<Design, Faults> {
        let mut recipe = Recipe::parse(DEFAULT_RECIPE).unwrap_or_default();
        change(&mut recipe);
        Design::new(&recipe)
    }

    fn fields(design: Result<Design, Faults>) -> Vec<&'static str> {
        design.map_or_else(|faults| faults.0.iter().map(|f| f.field).collect(), |_| Vec::new())
    }

    #[test]
    fn the_default_gap_is_two_cells_and_a_bee() {
        let Ok(design) = changed(|_| ()) else { panic!("refused") };
        assert!((design.gap.figure(NamedGap::Mean) * 200.0 - 32.0).abs() < 1e-12);
    }

    #[test]
    fn all_faults_are_told_at_once() {
        let found = fields(changed(|r| {
            r.cell.period = -1.0;
            r.wall.thickness = f64::NAN;
            r.gap.bee_space = Some(0.0);
            r.base.screws = 3;
            r.print.bed[1] = 0.0;
            r.cell.part = Part::Block;
        }));
        for field in
            ["cell.period", "wall.thickness", "gap.bee_space", "base.screws", "print.bed", "cell.block"]
        {
            assert!(found.contains(&field), "{field} is missing in {found:?}");
        }
    }

    #[test]
    fn gaps_that_fold_or_that_no_level_reaches_are_refused_with_a_way_out() {
        // The reference: 32 mm and walls of 2 mm need L > 113 mm.
        let Err(folds) = changed(|r| r.cell.period = 113.0) else { panic!("accepted") };
        assert!(folds.to_string().contains("113.1 mm"), "{folds}");
        assert!(changed(|r| r.cell.period = 113.2).is_ok());
        let level_set = |period| {
            changed(|r| {
                r.gap = super::super::recipe::GapSection {
                    shape: GapShape::LevelSet,
                    width: Some(32.0),
                    ..Default::default()
                };
                r.cell.period = period;
            })
        };
        assert_eq!(fields(level_set(160.0)), ["gap"]);
        assert!(level_set(200.0).is_ok());
    }

    #[test]
    fn a_gap_said_twice_or_with_the_wrong_shape_is_refused() {
        assert_eq!(fields(changed(|r| r.gap.width = Some(30.0))), ["gap"]);
        let delta = |r: &mut Recipe| {
            r.gap = Default::default();
            r.gap.delta = Some(0.2);
        };
        assert_eq!(fields(changed(delta)), ["gap.delta"]);
    }

    #[test]
    fn a_huge_grid_is_refused_before_it_is_made() {
        assert_eq!(fields(changed(|r| r.mesh.samples = 4096)), ["mesh.samples"]);
    }
}
