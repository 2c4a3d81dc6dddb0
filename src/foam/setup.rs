//! What a foam is made in: a surface, its two walls and how space ends, as plain numbers that a file can keep.

use super::domain::{Axis, Domain};
use crate::{
    surface::{Diamond, Gap, GapError, Gyroid, LevelSet, Plane, SchwarzP, Sphere, Torus},
    units::LevelOffset,
};
use serde::{Deserialize, Serialize};
use std::{fmt, sync::Arc};

/// The triply periodic surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PeriodicSurface {
    /// Schwarz' P, nodal.
    SchwarzP,
    /// Schoen's gyroid, nodal.
    Gyroid,
    /// Schwarz' D, nodal.
    Diamond,
}

/// The walls of a gap round a triply periodic surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PeriodicWalls {
    /// Φ = ±δ.
    LevelSet {
        /// δ.
        delta: f64,
    },
    /// True offsets to both sides.
    Parallel {
        /// Their distance from each other, in the unit of the period.
        gap: f64,
    },
}

/// How a foam ends at the open faces of an enclosure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OpenFaces {
    /// At frictionless plane walls: films meet them at a right angle.
    Walls,
    /// Where two faces are whole periods apart, it goes on periodically; at frictionless walls elsewhere.
    Periodic,
}

/// The space that a foam fills.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "surface", rename_all = "kebab-case")]
pub enum FoamSpace {
    /// One period of the gap round a triply periodic surface, with periodic boundaries.
    Periodic {
        /// Which.
        kind: PeriodicSurface,
        /// The period; lengths of the foam are in its unit.
        period: f64,
        /// The walls.
        walls: PeriodicWalls,
    },
    /// The shell between two concentric spheres.
    Sphere {
        /// The radii, the smaller first.
        radii: [f64; 2],
    },
    /// The shell between two tori of one centre circle.
    Torus {
        /// The radius of the centre circle.
        ring: f64,
        /// The radii of the tubes, the smaller first.
        tubes: [f64; 2],
    },
    /// The slab between two planes, periodic along x and y.
    Plane {
        /// The periods.
        periods: [f64; 2],
        /// The distance of the planes.
        height: f64,
    },
    /// A box of half periods of the gap round Schwarz' P, cut off by planes of mirror symmetry, as an enclosure is printed.
    Piece {
        /// The period; lengths of the foam are in its unit.
        period: f64,
        /// The walls.
        walls: PeriodicWalls,
        /// The lower corner of the box, in half periods.
        low: [i32; 3],
        /// Its upper corner.
        high: [i32; 3],
        /// What the foam meets at its faces.
        open_faces: OpenFaces,
    },
    /// The slab between two planes in a box with frictionless plane walls.
    Box {
        /// The box's sides along x and y.
        sides: [f64; 2],
        /// The distance of the planes.
        height: f64,
    },
}

/// Why a space is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpaceError {
    /// A length that is none.
    #[error("the {what} is {value}: it must be a positive number")]
    NotPositive {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Two radii the wrong way round, or equal.
    #[error("the {what} are {inner} and {outer}: the second must be larger than the first")]
    Order {
        /// Which.
        what: &'static str,
        /// The first.
        inner: f64,
        /// The second.
        outer: f64,
    },
    /// The outer tube reaches the axis.
    #[error(
        "the outer tube {outer} is not smaller than the ring {ring}: the torus would meet itself on its axis"
    )]
    Ring {
        /// The radius of the outer tube.
        outer: f64,
        /// The radius of the centre circle.
        ring: f64,
    },
    /// A box without room.
    #[error(
        "the piece from {low:?} to {high:?} half periods has no room: each upper end must exceed the lower"
    )]
    NoRoom {
        /// The lower corner.
        low: [i32; 3],
        /// The upper corner.
        high: [i32; 3],
    },
    /// The walls do not exist.
    #[error(transparent)]
    Gap(#[from] GapError),
}

impl FoamSpace {
    /// The gap between the walls. The middle surface lies half-way.
    ///
    /// # Errors
    /// [`SpaceError`] if a number makes no sense or the walls do not exist.
    pub fn gap(&self) -> Result<Gap, SpaceError> {
        match *self {
            Self::Periodic { kind, period, walls } => {
                positive("period", period)?;
                Ok(match walls {
                    PeriodicWalls::LevelSet { delta } => {
                        Gap::level_set(kind.level_set(period), LevelOffset(delta))?
                    }
                    PeriodicWalls::Parallel { gap } => Gap::parallel(kind.level_set(period), gap, 0.0)?,
                })
            }
            Self::Sphere { radii } => {
                let (radius, half) = halfway("radii of the spheres", radii)?;
                Ok(Gap::between(Arc::new(Sphere { radius }), [-half, half])?)
            }
            Self::Torus { ring, tubes } => {
                positive("ring", ring)?;
                let (tube, half) = halfway("radii of the tubes", tubes)?;
                if tubes[1] >= ring {
                    return Err(SpaceError::Ring { outer: tubes[1], ring });
                }
                Ok(Gap::between(Arc::new(Torus { ring, tube }), [-half, half])?)
            }
            Self::Plane { periods, height } => {
                positive("first period", periods[0])?;
                positive("second period", periods[1])?;
                positive("height", height)?;
                Ok(Gap::between(Arc::new(Plane { periods }), [-0.5 * height, 0.5 * height])?)
            }
            Self::Box { sides, height } => Self::Plane { periods: sides, height }.gap(),
            Self::Piece { period, walls, low, high, .. } => {
                if (0..3).any(|axis| low[axis] >= high[axis]) {
                    return Err(SpaceError::NoRoom { low, high });
                }
                Self::Periodic { kind: PeriodicSurface::SchwarzP, period, walls }.gap()
            }
        }
    }

    /// The same space between walls nearer to the middle surface, as [`Gap::narrowed`].
    #[must_use]
    pub fn narrowed(self, part: f64) -> Self {
        let radii = |[inner, outer]: [f64; 2]| {
            let (mean, half) = (0.5 * (inner + outer), 0.5 * part * (outer - inner));
            [mean - half, mean + half]
        };
        match self {
            // Exactly as it was typed, without the rounding of means.
            whole if part >= 1.0 => whole,
            Self::Periodic { kind, period, walls } => {
                Self::Periodic { kind, period, walls: walls.narrowed(part) }
            }
            Self::Piece { period, walls, low, high, open_faces } => {
                Self::Piece { period, walls: walls.narrowed(part), low, high, open_faces }
            }
            Self::Box { sides, height } => Self::Box { sides, height: part * height },
            Self::Sphere { radii: both } => Self::Sphere { radii: radii(both) },
            Self::Torus { ring, tubes } => Self::Torus { ring, tubes: radii(tubes) },
            Self::Plane { periods, height } => Self::Plane { periods, height: part * height },
        }
    }

    /// How space ends: one period, a box of plane walls, or open round a bounded gap.
    ///
    /// # Errors
    /// As [`FoamSpace::gap`].
    pub fn domain(&self) -> Result<Domain, SpaceError> {
        let mut domain = Domain::of_surface(self.gap()?.middle().as_ref());
        match *self {
            Self::Box { sides: [x, y], .. } => {
                domain.axes[0] = Axis::Walls { low: 0.0, high: x };
                domain.axes[1] = Axis::Walls { low: 0.0, high: y };
            }
            Self::Piece { period, low, high, open_faces, .. } => {
                for (index, axis) in domain.axes.iter_mut().enumerate() {
                    let [low, high] = [low[index], high[index]];
                    let at = |halves: i32| 0.5 * period * f64::from(halves);
                    *axis = if open_faces == OpenFaces::Periodic && (high - low) % 2 == 0 {
                        Axis::Periodic { low: at(low), length: at(high - low) }
                    } else {
                        Axis::Walls { low: at(low), high: at(high) }
                    };
                }
            }
            _ => {}
        }
        Ok(domain)
    }
}

impl PeriodicWalls {
    /// The same walls nearer to the middle surface.
    fn narrowed(self, part: f64) -> Self {
        match self {
            Self::LevelSet { delta } => Self::LevelSet { delta: part * delta },
            Self::Parallel { gap } => Self::Parallel { gap: part * gap },
        }
    }
}

impl fmt::Display for PeriodicWalls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::LevelSet { delta } => write!(f, "walls Φ = ±{}", short(delta)),
            Self::Parallel { gap } => write!(f, "parallel walls, gap {}", short(gap)),
        }
    }
}

impl PeriodicSurface {
    fn level_set(self, period: f64) -> Arc<dyn LevelSet> {
        match self {
            Self::SchwarzP => Arc::new(SchwarzP { period }),
            Self::Gyroid => Arc::new(Gyroid { period }),
            Self::Diamond => Arc::new(Diamond { period }),
        }
    }
}

impl fmt::Display for FoamSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Periodic { kind, period, walls } => {
                let name = match kind {
                    PeriodicSurface::SchwarzP => "Schwarz P",
                    PeriodicSurface::Gyroid => "gyroid",
                    PeriodicSurface::Diamond => "diamond",
                };
                write!(f, "{name}, period {}, {walls}", short(period))
            }
            Self::Piece { period, walls, low, high, open_faces } => {
                let [x, y, z] = [0, 1, 2].map(|axis| 0.5 * f64::from(high[axis] - low[axis]));
                let faces = match open_faces {
                    OpenFaces::Walls => "closed by plane walls",
                    OpenFaces::Periodic => "periodic where it can be",
                };
                write!(f, "Schwarz P, {x} × {y} × {z} periods of {}, {faces}; {walls}", short(period))
            }
            Self::Box { sides, height } => {
                let ([x, y], height) = (sides.map(short), short(height));
                write!(f, "planes {height} apart in a box of {x} × {y}")
            }
            Self::Sphere { radii } => {
                let [inner, outer] = radii.map(short);
                write!(f, "spheres of radius {inner} and {outer}")
            }
            Self::Torus { ring, tubes } => {
                let [ring, inner, outer] = [ring, tubes[0], tubes[1]].map(short);
                write!(f, "tori of ring {ring}, tubes {inner} and {outer}")
            }
            Self::Plane { periods, height } => {
                let ([x, y], height) = (periods.map(short), short(height));
                write!(f, "planes {height} apart, periods {x} and {y}")
            }
        }
    }
}

/// A length to seven digits, for people: parts of gaps have all that a double can hold.
fn short(length: f64) -> f64 {
    format!("{length:.6e}").parse().unwrap_or(length)
}

fn positive(what: &'static str, value: f64) -> Result<(), SpaceError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(SpaceError::NotPositive { what, value }) }
}

/// The mean of two radii and half their difference.
fn halfway(what: &'static str, [inner, outer]: [f64; 2]) -> Result<(f64, f64), SpaceError> {
    positive(what, inner)?;
    positive(what, outer)?;
    if outer <= inner {
        return Err(SpaceError::Order { what, inner, outer });
    }
    Ok((0.5 * (inner + outer), 0.5 * (outer - inner)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::WallSide;
    use glam::DVec3;

    #[test]
    fn a_space_is_told_in_few_digits() {
        let walls = PeriodicWalls::LevelSet { delta: 0.858454 };
        let space = FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 200.0, walls };
        assert_eq!(space.to_string(), "Schwarz P, period 200, walls Φ = ±0.858454");
        assert_eq!(space.narrowed(1.0 / 3.0).to_string(), "Schwarz P, period 200, walls Φ = ±0.2861513");
    }

    #[test]
    fn walls_lie_where_they_were_asked_for() -> Result<(), SpaceError> {
        let gap = FoamSpace::Sphere { radii: [1.0, 1.2] }.gap()?;
        assert!(gap.wall(WallSide::Upper).value(DVec3::new(0.0, 1.2, 0.0)).abs() < 1e-15);
        let gap = FoamSpace::Torus { ring: 5.0, tubes: [0.9, 1.0] }.gap()?;
        assert!(gap.wall(WallSide::Lower).value(DVec3::new(5.9, 0.0, 0.0)).abs() < 1e-15);
        let gap = FoamSpace::Plane { periods: [3.0, 4.0], height: 0.5 }.gap()?;
        assert!(gap.wall(WallSide::Lower).value(DVec3::new(1.0, 1.0, -0.25)).abs() < 1e-15);
        Ok(())
    }

    #[test]
    fn spaces_that_are_none_are_refused() {
        let kind = PeriodicSurface::SchwarzP;
        for space in [
            FoamSpace::Sphere { radii: [1.0, 1.0] },
            FoamSpace::Sphere { radii: [-1.0, 1.0] },
            FoamSpace::Sphere { radii: [f64::NAN, 1.0] },
            FoamSpace::Torus { ring: 1.0, tubes: [0.9, 1.0] },
            FoamSpace::Torus { ring: 0.0, tubes: [0.9, 1.0] },
            FoamSpace::Plane { periods: [0.0, 1.0], height: 0.5 },
            FoamSpace::Plane { periods: [1.0, 1.0], height: f64::INFINITY },
            FoamSpace::Periodic { kind, period: 1.0, walls: PeriodicWalls::LevelSet { delta: 1.0 } },
            FoamSpace::Periodic { kind, period: -1.0, walls: PeriodicWalls::LevelSet { delta: 0.2 } },
            FoamSpace::Periodic { kind, period: 1.0, walls: PeriodicWalls::Parallel { gap: 0.5 } },
            FoamSpace::Box { sides: [1.0, -1.0], height: 0.5 },
            FoamSpace::Piece {
                period: 1.0,
                walls: PeriodicWalls::LevelSet { delta: 0.2 },
                low: [0, 0, 2],
                high: [2, 2, 2],
                open_faces: OpenFaces::Walls,
            },
        ] {
            assert!(space.gap().is_err(), "{space}");
        }
    }

    #[test]
    fn a_narrowed_space_has_the_narrowed_gap() -> Result<(), SpaceError> {
        let kind = PeriodicSurface::SchwarzP;
        for space in [
            FoamSpace::Sphere { radii: [1.0, 1.2] },
            FoamSpace::Torus { ring: 5.0, tubes: [0.9, 1.0] },
            FoamSpace::Plane { periods: [3.0, 4.0], height: 0.5 },
            FoamSpace::Periodic { kind, period: 2.0, walls: PeriodicWalls::LevelSet { delta: 0.4 } },
            FoamSpace::Periodic { kind, period: 2.0, walls: PeriodicWalls::Parallel { gap: 0.1 } },
        ] {
            let (one, other) = (space.narrowed(0.3).gap()?, space.gap()?.narrowed(0.3));
            for (a, b) in one.walls().iter().zip(other.walls()) {
                // Means and halves of numbers of the order of 1: a few roundings.
                assert!((a.level - b.level).abs() < 1e-15, "{space}: {} {}", a.level, b.level);
            }
        }
        Ok(())
    }

    #[test]
    fn a_file_keeps_a_space() -> Result<(), serde_json::Error> {
        let walls = PeriodicWalls::LevelSet { delta: 0.2 };
        let space = FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period: 1.0, walls };
        let text = serde_json::to_string(&space)?;
        assert_eq!(serde_json::from_str::<FoamSpace>(&text)?, space);
        Ok(())
    }
}
