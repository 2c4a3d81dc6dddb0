//! Two walls of one level set and the gap between them.

use super::{GapError, LevelSet, NoFoot, SignedDistance, SurfaceSamples, reach};
use crate::units::LevelOffset;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::{fmt, sync::Arc};

/// Which of the two walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WallSide {
    /// The wall at the lower level; the gap lies on the side its normal `∇Φ` points to.
    Lower,
    /// The wall at the upper level.
    Upper,
}

impl WallSide {
    /// Both sides, the lower first.
    pub const BOTH: [Self; 2] = [Self::Lower, Self::Upper];

    /// The other one.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Lower => Self::Upper,
            Self::Upper => Self::Lower,
        }
    }
}

/// One wall: a level of a level set.
#[derive(Clone, Debug)]
pub struct Wall {
    /// The level function. For parallel walls this is a signed distance.
    pub field: Arc<dyn LevelSet>,
    /// The wall is `field = level`.
    pub level: f64,
}

impl Wall {
    /// `Φ(p) − level`: zero on the wall.
    #[must_use]
    pub fn value(&self, p: DVec3) -> f64 {
        self.field.value(p) - self.level
    }

    /// A point of the wall near `p`, along the gradient.
    ///
    /// # Errors
    /// As [`LevelSet::project`].
    pub fn project(&self, p: DVec3) -> Result<DVec3, NoFoot> {
        self.field.project(p, self.level)
    }
}

/// How the walls of a gap follow from its middle surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GapKind {
    /// Two levels of the level function itself; the gap varies over the surface unless `Φ` is a distance.
    LevelSet,
    /// Two true offsets of the middle surface; the gap is the same everywhere.
    Parallel,
}

/// Which figure of a gap that varies over the surface is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NamedGap {
    /// The least distance between the walls.
    Min,
    /// The mean over the wall's area.
    Mean,
    /// The largest distance from a point of a wall to the other wall.
    Max,
}

impl fmt::Display for NamedGap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Min => "min",
            Self::Mean => "mean",
            Self::Max => "max",
        })
    }
}

/// The gap over the whole surface: nearest distances from points of one wall to the other, in the surface's units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GapRange {
    /// The least.
    pub min: f64,
    /// The mean over the wall's area.
    pub mean: f64,
    /// The largest.
    pub max: f64,
}

/// Two walls of one level set, with the space between them.
#[derive(Clone, Debug)]
pub struct Gap {
    middle: Arc<dyn LevelSet>,
    walls: [Wall; 2],
    kind: GapKind,
}

/// Lines per axis when a gap is measured: the mean is then good to 1e-3, the extremes to rounding.
const MEASURE_LINES: usize = 40;

/// Levels are sought up to this fraction of the critical one, where the walls still have a shape.
const NEARLY_CRITICAL: f64 = 1.0 - 1e-6;

impl Gap {
    /// Level-set walls `Φ = ±δ`.
    ///
    /// # Errors
    /// [`GapError`] if `δ` is not positive or reaches a critical level.
    pub fn level_set(surface: Arc<dyn LevelSet>, delta: LevelOffset) -> Result<Self, GapError> {
        positive("level offset", delta.0)?;
        Self::between(surface, [-delta.0, delta.0])
    }

    /// Level-set walls at two levels of a surface, such as two concentric spheres.
    ///
    /// # Errors
    /// [`GapError`] if the levels are not in order or one is at or beyond a critical level.
    pub fn between(surface: Arc<dyn LevelSet>, levels: [f64; 2]) -> Result<Self, GapError> {
        let [lower, upper] = levels;
        if lower.partial_cmp(&upper) != Some(std::cmp::Ordering::Less) {
            return Err(GapError::Order { lower, upper });
        }
        let (low, high) = surface.level_limits();
        if let Some(&level) = levels.iter().find(|&&level| !(level > low && level < high)) {
            return Err(GapError::Level { surface: surface.name(), level, low, high });
        }
        let walls = levels.map(|level| Wall { field: surface.clone(), level });
        Ok(Self { middle: surface, walls, kind: GapKind::LevelSet })
    }

    /// Level-set walls `Φ = ±δ` whose `named` gap is `width`; `δ` is solved for from true nearest distances.
    ///
    /// # Errors
    /// [`GapError`] if the width is not positive or no `δ` reaches it.
    pub fn with_named(surface: Arc<dyn LevelSet>, named: NamedGap, width: f64) -> Result<Self, GapError> {
        positive("gap", width)?;
        let (low, high) = surface.level_limits();
        let limit = NEARLY_CRITICAL * high.min(-low);
        if surface.is_distance() {
            return Self::level_set(surface, LevelOffset(0.5 * width));
        }
        let measure = |delta: f64| -> Result<f64, GapError> {
            Ok(Self::level_set(surface.clone(), LevelOffset(delta))?.figure(named))
        };
        let largest = measure(limit)?;
        if width > largest {
            return Err(GapError::Unreachable { surface: surface.name(), named, width, largest });
        }
        let delta = solve_increasing(measure, width, limit, largest)?;
        Self::level_set(surface, LevelOffset(delta))
    }

    /// Parallel walls: the true offsets of `surface = 0` by half of `width` to both sides.
    ///
    /// `margin` is what lies behind the gap on each side and must not fold either, such as a wall's thickness.
    ///
    /// # Errors
    /// [`GapError`] if a number is not positive or an offset would fold.
    pub fn parallel(surface: Arc<dyn LevelSet>, width: f64, margin: f64) -> Result<Self, GapError> {
        positive("gap", width)?;
        if !(margin >= 0.0 && margin.is_finite()) {
            return Err(GapError::NotPositive { what: "thickness behind the gap", value: margin });
        }
        let reach = reach(surface.as_ref(), 0.0);
        if width / 2.0 + margin >= reach {
            return Err(GapError::Folds { surface: surface.name(), width, margin, reach });
        }
        let field: Arc<dyn LevelSet> = if surface.is_distance() {
            surface.clone()
        } else {
            Arc::new(SignedDistance::new(surface.clone()))
        };
        let walls = [-0.5 * width, 0.5 * width].map(|level| Wall { field: field.clone(), level });
        Ok(Self { middle: surface, walls, kind: GapKind::Parallel })
    }

    /// The same gap between walls nearer to the middle surface: both levels are multiplied by `part`.
    #[must_use]
    pub fn narrowed(&self, part: f64) -> Self {
        let walls = self.walls.clone().map(|wall| Wall { level: part * wall.level, ..wall });
        Self { middle: self.middle.clone(), walls, kind: self.kind }
    }

    /// The two halves of the gap: from the lower wall to the middle surface, and from there to the upper wall.
    #[must_use]
    pub fn halves(&self) -> [Self; 2] {
        let [lower, upper] = self.walls.clone();
        let middle = Wall { field: lower.field.clone(), level: 0.0 };
        [[lower, middle.clone()], [middle, upper]].map(|walls| Self {
            middle: self.middle.clone(),
            walls,
            kind: self.kind,
        })
    }

    /// The middle surface: level 0 of this.
    #[must_use]
    pub fn middle(&self) -> &Arc<dyn LevelSet> {
        &self.middle
    }

    /// The walls, the lower first.
    #[must_use]
    pub fn walls(&self) -> &[Wall; 2] {
        &self.walls
    }

    /// One wall.
    #[must_use]
    pub fn wall(&self, side: WallSide) -> &Wall {
        &self.walls[side as usize]
    }

    /// How the walls follow from the middle surface.
    #[must_use]
    pub fn kind(&self) -> GapKind {
        self.kind
    }

    /// The distance from a point `p` of the wall `from` to the nearest point of the other wall; not a number where none is
    /// found.
    #[must_use]
    pub fn distance_across(&self, from: WallSide, p: DVec3) -> f64 {
        let other = self.wall(from.other());
        if other.field.is_distance() {
            return (other.field.value(p) - other.level).abs();
        }
        let direct = other.field.project(p, other.level).unwrap_or(p);
        // The nearest sheet is not always the one along the gradient: near a neck two feet compete. Starts spread over about
        // one gap round the first foot find both.
        let spread = direct.distance(p);
        let (u, v) = other.field.normal(p).any_orthonormal_pair();
        [direct, p + spread * u, p - spread * u, p + spread * v, p - spread * v]
            .into_iter()
            .filter_map(|start| other.field.nearest_from(p, other.level, start).ok())
            .map(|foot| foot.distance(p))
            .fold(f64::NAN, f64::min)
    }

    /// The local gap at a point `p` of the middle surface: the sum of its nearest distances to both walls.
    #[must_use]
    pub fn local_gap(&self, p: DVec3) -> f64 {
        self.walls
            .iter()
            .map(|wall| {
                if wall.field.is_distance() {
                    (wall.field.value(p) - wall.level).abs()
                } else {
                    wall.field.nearest(p, wall.level).map_or(f64::NAN, |foot| foot.distance(p))
                }
            })
            .sum()
    }

    /// The gap's least, mean and largest width, measured by nearest distances from the lower wall.
    #[must_use]
    pub fn range(&self) -> GapRange {
        GapRange {
            min: self.figure(NamedGap::Min),
            mean: self.figure(NamedGap::Mean),
            max: self.figure(NamedGap::Max),
        }
    }

    /// One figure of the gap.
    #[must_use]
    pub fn figure(&self, named: NamedGap) -> f64 {
        let [lower, upper] = &self.walls;
        if lower.field.is_distance() {
            return upper.level - lower.level;
        }
        let field = lower.field.as_ref();
        let samples = SurfaceSamples::new(field, lower.level, MEASURE_LINES);
        let across = |p| self.distance_across(WallSide::Lower, p);
        match named {
            NamedGap::Min => samples.minimise(field, across).1,
            NamedGap::Mean => samples.integrate(across) / samples.area(),
            NamedGap::Max => samples.maximise(field, across).1,
        }
    }
}

/// The `x` in `(0, limit]` with `f(x) = target`, for an increasing `f` with `f(0) = 0` and `f(limit) = at_limit ≥ target`,
/// by the Illinois form of the regula falsi.
fn solve_increasing(
    f: impl Fn(f64) -> Result<f64, GapError>,
    target: f64,
    limit: f64,
    at_limit: f64,
) -> Result<f64, GapError> {
    let (mut low, mut high) = (0.0, limit);
    let (mut at_low, mut at_high) = (-target, at_limit - target);
    let mut last_side = 0;
    for _ in 0..60 {
        let x = (low * at_high - high * at_low) / (at_high - at_low);
        let here = f(x)? - target;
        if here.abs() <= 1e-12 * target || high - low <= 1e-14 * limit {
            return Ok(x);
        }
        if here < 0.0 {
            (low, at_low) = (x, here);
            at_high *= if last_side == -1 { 0.5 } else { 1.0 };
            last_side = -1;
        } else {
            (high, at_high) = (x, here);
            at_low *= if last_side == 1 { 0.5 } else { 1.0 };
            last_side = 1;
        }
    }
    Ok(0.5 * (low + high))
}

fn positive(what: &'static str, value: f64) -> Result<(), GapError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(GapError::NotPositive { what, value }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Plane, SchwarzP, Sphere};

    fn schwarz_p() -> Arc<dyn LevelSet> {
        Arc::new(SchwarzP { period: 1.0 })
    }

    #[test]
    fn concentric_spheres_have_one_gap() -> Result<(), GapError> {
        let gap = Gap::between(Arc::new(Sphere { radius: 2.0 }), [-0.25, 0.5])?;
        let range = gap.range();
        assert!([range.min, range.mean, range.max].iter().all(|w| (w - 0.75).abs() < 1e-15), "{range:?}");
        assert!((gap.local_gap(DVec3::new(0.0, 1.2, 1.6)) - 0.75).abs() < 1e-15);
        Ok(())
    }

    #[test]
    fn level_set_gaps_are_those_of_the_reference() -> Result<(), GapError> {
        // The least gap is across the flat points, along a diagonal, and exact. Mean and max are reference figures of sampled
        // distances; theirs and these sums are good to 2e-3 of the gap.
        for (delta, mean, max) in [
            (0.05, 0.01213, 0.01592),
            (0.2, 0.04855, 0.06409),
            (0.5, 0.12136, 0.16523),
            (0.9, 0.21577, 0.29122),
        ] {
            let range = Gap::level_set(schwarz_p(), LevelOffset(delta))?.range();
            let min = 3.0_f64.sqrt() * (delta / 3.0_f64).asin() / std::f64::consts::PI;
            assert!((range.min - min).abs() < 1e-9, "δ = {delta}: {} is not {min}", range.min);
            for (value, expected) in [(range.mean, mean), (range.max, max)] {
                assert!((value / expected - 1.0).abs() < 2e-3, "δ = {delta}: {value} is not {expected}");
            }
        }
        Ok(())
    }

    #[test]
    fn the_offset_is_solved_from_the_gap_that_was_named() -> Result<(), GapError> {
        for named in [NamedGap::Min, NamedGap::Mean, NamedGap::Max] {
            let gap = Gap::with_named(schwarz_p(), named, 0.12)?;
            assert!((gap.figure(named) - 0.12).abs() < 1e-9, "{named}: {}", gap.figure(named));
        }
        let gap = Gap::with_named(schwarz_p(), NamedGap::Min, 0.16)?;
        assert!((gap.wall(WallSide::Upper).level - 0.858).abs() < 5e-4, "{:?}", gap.walls());
        Ok(())
    }

    #[test]
    fn a_gap_that_no_level_reaches_is_refused_with_the_largest() {
        let Err(GapError::Unreachable { largest, .. }) = Gap::with_named(schwarz_p(), NamedGap::Min, 0.25)
        else {
            panic!("accepted");
        };
        assert!((0.18..0.20).contains(&largest), "{largest}");
    }

    #[test]
    fn parallel_walls_reach_to_the_least_radius_of_curvature() -> Result<(), GapError> {
        let reach = 1.0 / std::f64::consts::TAU;
        let gap = Gap::parallel(schwarz_p(), 2.0 * (reach - 0.0101), 0.01)?;
        assert!((gap.figure(NamedGap::Max) - gap.figure(NamedGap::Min)).abs() < 1e-15);
        let Err(GapError::Folds { reach: found, .. }) =
            Gap::parallel(schwarz_p(), 2.0 * (reach - 0.0099), 0.01)
        else {
            panic!("accepted");
        };
        assert!((found - reach).abs() < 1e-9, "{found}");
        let plane: Arc<dyn LevelSet> = Arc::new(Plane { periods: [1.0, 1.0] });
        assert!(Gap::parallel(plane, 100.0, 1.0).is_ok());
        Ok(())
    }

    #[test]
    fn bad_numbers_are_refused() {
        for width in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Gap::with_named(schwarz_p(), NamedGap::Min, width).is_err());
            assert!(Gap::parallel(schwarz_p(), width, 0.0).is_err());
            assert!(Gap::level_set(schwarz_p(), LevelOffset(width)).is_err());
        }
        assert!(matches!(Gap::level_set(schwarz_p(), LevelOffset(1.0)), Err(GapError::Level { .. })));
        assert!(matches!(Gap::between(schwarz_p(), [0.2, 0.1]), Err(GapError::Order { .. })));
    }
}
