//! The walls and the middle surface as three levels of one function, and where straight lines and planes meet them.

use crate::surface::{Gap, GapKind, Jet, LevelSet, SurfaceSamples, WallSide};
use glam::DVec3;

/// One of the three surfaces that cells are cut by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Level {
    Lower,
    Middle,
    Upper,
}

impl Level {
    pub(super) const ALL: [Self; 3] = [Self::Lower, Self::Middle, Self::Upper];

    pub(super) const fn of_wall(side: WallSide) -> Self {
        match side {
            WallSide::Lower => Self::Lower,
            WallSide::Upper => Self::Upper,
        }
    }
}

/// Where a line crosses a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// The level.
    pub(super) level: Level,
    /// Along the line from 0 to 1.
    pub(super) parameter: f64,
    /// Whether the function rises through the level along the line.
    pub(super) rises: bool,
    /// Where.
    pub(super) point: DVec3,
}

/// The function and its three levels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Levels<'a> {
    gap: &'a Gap,
    /// Where the middle surface's own function exceeds this, a signed distance lies outside the gap; it need not be
    /// evaluated there, where its nearest points jump.
    far: f64,
}

/// Lines per axis of the search for the steepest place of the middle surface.
const STEEPEST_LINES: usize = 16;

/// What [`Levels::far`] is enlarged by, since the function may be steeper inside the gap than on its middle.
const FAR_MARGIN: f64 = 1.3;

/// Newton steps in a bracket: bisection alone would take 52.
const ROOT_STEPS: usize = 80;

/// Newton steps in a plane: they start within a few hundredths of the answer.
const PLANE_STEPS: usize = 30;

/// Steps this small, relative to the coordinates, are rounding.
const ROUNDING: f64 = 1e-13;

/// An arc is halved until its tangent turns by less than this (in radians), so that each piece is nearly straight.
const PIECE_TURN: f64 = 0.2;

/// Halvings of an arc before it is given up.
const ARC_DEPTH: usize = 8;

impl<'a> Levels<'a> {
    pub(super) fn new(gap: &'a Gap) -> Self {
        let middle = gap.middle().as_ref();
        let far = if gap.kind() == GapKind::Parallel && !middle.is_distance() {
            let samples = SurfaceSamples::new(middle, 0.0, STEEPEST_LINES);
            let slopes = samples.points().iter().map(|point| middle.gradient(point.position).length());
            let deepest = gap.walls().iter().map(|wall| wall.level.abs()).fold(0.0, f64::max);
            FAR_MARGIN * deepest * slopes.fold(0.0, f64::max)
        } else {
            f64::INFINITY
        };
        Self { gap, far }
    }

    fn field(&self) -> &'a dyn LevelSet {
        self.gap.wall(WallSide::Lower).field.as_ref()
    }

    pub(super) fn offset(&self, level: Level) -> f64 {
        match level {
            Level::Lower => self.gap.wall(WallSide::Lower).level,
            Level::Middle => 0.0,
            Level::Upper => self.gap.wall(WallSide::Upper).level,
        }
    }

    /// The function; far from the gap only its sign is right.
    pub(super) fn value(&self, point: DVec3) -> f64 {
        if self.far.is_infinite() {
            return self.field().value(point);
        }
        let side = self.gap.middle().value(point);
        let value = if side.abs() > self.far { f64::MAX } else { self.field().value(point) };
        if value.is_nan() { f64::MAX.copysign(side) } else { value.abs().copysign(side) }
    }

    pub(super) fn gradient(&self, point: DVec3) -> DVec3 {
        self.field().gradient(point)
    }

    /// Value and gradient near the gap, where a signed distance finds both with one search.
    fn slope(&self, point: DVec3) -> (f64, DVec3) {
        if self.far.is_infinite() {
            return (self.field().value(point), self.field().gradient(point));
        }
        let Jet { value, gradient, .. } = self.field().jet(point);
        (value, gradient)
    }

    pub(super) fn mean_curvature(&self, point: DVec3) -> f64 {
        self.field().curvature(point).mean
    }

    /// Where the line from `a` to `b` crosses the levels, in order; crossings in pairs nearer than `step` may be missed.
    pub(super) fn crossings(&self, a: DVec3, b: DVec3, step: f64) -> Vec<Crossing> {
        let pieces = (a.distance(b) / step).ceil().clamp(1.0, 256.0);
        let mut found = Vec::new();
        let mut previous = (0.0, self.value(a));
        for piece in 1..=crate::foam::convert::whole(pieces) {
            let parameter = f64::from(piece) / pieces;
            let current = (parameter, self.value(a.lerp(b, parameter)));
            let first = found.len();
            for level in Level::ALL {
                let offset = self.offset(level);
                let rises = current.1 > offset;
                if rises != (previous.1 > offset) {
                    let parameter = self.root(a, b, level, previous.0, current.0, rises);
                    found.push(Crossing { level, parameter, rises, point: a.lerp(b, parameter) });
                }
            }
            found[first..].sort_by(|x, y| x.parameter.total_cmp(&y.parameter));
            previous = current;
        }
        found
    }

    /// The crossing between two parameters with values on either side: Newton steps, bisection where they leave the bracket.
    fn root(&self, a: DVec3, b: DVec3, level: Level, low: f64, high: f64, rises: bool) -> f64 {
        let offset = self.offset(level);
        let (mut low, mut high) = (low, high);
        let mut parameter = 0.5 * (low + high);
        for _ in 0..ROOT_STEPS {
            let point = a.lerp(b, parameter);
            let height = self.value(point) - offset;
            if (height > 0.0) == rises {
                high = parameter;
            } else {
                low = parameter;
            }
            let newton = parameter - height / self.gradient(point).dot(b - a);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - parameter).abs() <= f64::EPSILON {
                return next;
            }
            parameter = next;
        }
        parameter
    }

    /// The curve from `a` to `b` where `level` meets the plane through them with `normal`, as points dense enough that the
    /// tangent turns little from one to the next. Seen from the tip of `normal`, the function is lower on
    /// the left of the curve.
    pub(super) fn arc(&self, a: DVec3, b: DVec3, normal: DVec3, level: Level) -> Option<Vec<DVec3>> {
        let plane = Plane { levels: self, normal, level };
        let mut points = vec![a];
        plane.refine(a, b, ARC_DEPTH, &mut points)?;
        Some(points)
    }

    /// Moves `point` along `direction` onto `level`.
    pub(super) fn along(&self, point: DVec3, direction: DVec3, level: Level) -> Option<DVec3> {
        let offset = self.offset(level);
        settled(point, |place| {
            let (value, gradient) = self.slope(place);
            direction * ((value - offset) / gradient.dot(direction))
        })
    }
}

/// The curve of one level in one plane.
struct Plane<'a> {
    levels: &'a Levels<'a>,
    normal: DVec3,
    level: Level,
}

impl Plane<'_> {
    /// A gradient's part within the plane.
    fn in_plane(&self, gradient: DVec3) -> DVec3 {
        gradient - self.normal * self.normal.dot(gradient)
    }

    fn tangent(&self, point: DVec3) -> DVec3 {
        self.normal.cross(self.in_plane(self.levels.gradient(point))).normalize_or_zero()
    }

    /// Adds the points after `a` up to `b`.
    fn refine(&self, a: DVec3, b: DVec3, depth: usize, points: &mut Vec<DVec3>) -> Option<()> {
        let (start, end) = (self.tangent(a), self.tangent(b));
        let chord = (b - a).normalize_or_zero();
        let straight = start.dot(chord).min(end.dot(chord));
        if straight > (0.5 * PIECE_TURN).cos() || chord == DVec3::ZERO {
            points.push(b);
            return Some(());
        }
        let depth = depth.checked_sub(1)?;
        // The middle of the cubic with these end tangents, moved onto the curve.
        let guess = 0.5 * (a + b) + 0.125 * hermite_length(a, b, start, end) * (start - end);
        let middle = self.settle(guess)?;
        self.refine(a, middle, depth, points)?;
        self.refine(middle, b, depth, points)
    }

    /// Newton steps along the gradient within the plane.
    fn settle(&self, guess: DVec3) -> Option<DVec3> {
        let offset = self.levels.offset(self.level);
        settled(guess, |point| {
            let (value, gradient) = self.levels.slope(point);
            let slope = self.in_plane(gradient);
            slope * ((value - offset) / slope.length_squared())
        })
    }
}

/// Takes steps from `start` until they are rounding.
fn settled(start: DVec3, step: impl Fn(DVec3) -> DVec3) -> Option<DVec3> {
    let mut point = start;
    let mut last = f64::INFINITY;
    for _ in 0..PLANE_STEPS {
        let move_by = step(point);
        if !move_by.is_finite() {
            return None;
        }
        point -= move_by;
        last = move_by.length() / (point.abs().max_element() + f64::MIN_POSITIVE);
        if last <= 4.0 * f64::EPSILON {
            return Some(point);
        }
    }
    // The function's own rounding can keep the steps above that of the coordinates.
    (last < ROUNDING).then_some(point)
}

/// The end speed of the cubic whose middle is that of the circular arc with the given ends and end tangents: with half turn
/// `h` the arc's sagitta is chord (1 − cos h) / (2 sin h), the cubic's speed (2 sin h) / 8.
fn hermite_length(a: DVec3, b: DVec3, start: DVec3, end: DVec3) -> f64 {
    let half = 0.5 * start.dot(end).clamp(-1.0, 1.0).acos();
    2.0 * a.distance(b) / (1.0 + half.cos())
}
