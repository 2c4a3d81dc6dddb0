//! Walls moved apart in stages, with changes of topology on the way.
//!
//! Each stage starts from the balance of the one before: every node goes along the normals of the level sets, at its part of
//! the way from wall to wall, so that walls stay walls and films stay between them. Where a film's edge on one wall vanishes,
//! cells change neighbours on that wall only, and a film grows from there down to a corner inside the gap.

use super::{
    Division, FreeFilms, FreeFoam, FreeSettings, Unlawful,
    division::CornerImage,
    even::films_even,
    extruded::taken_over,
    relax::{Begin, relaxed_from},
    turn::{Slide, slide, turned},
};
use crate::{
    foam::{
        relax::{DescentStep, Ending, State},
        solve::FactorError,
    },
    surface::Gap,
};
use glam::DVec3;
use std::ops::ControlFlow;

/// What is in the way of wider walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Obstacle {
    /// A change of topology would break a law.
    Law(Unlawful),
    /// A border vanishes and no change of topology there leads to a balance.
    Border {
        /// The cells at it.
        cells: [usize; 2],
        /// Its length, in cell spacings.
        length: f64,
        /// Where.
        place: DVec3,
    },
    /// A film has slid round a corner between two planes that cut the gap off.
    Slid {
        /// Cells at it.
        cells: [usize; 2],
        /// Where.
        place: DVec3,
    },
    /// Films are in balance on unevenly spread nodes only.
    Uneven,
    /// Newton steps do not come to a balance.
    Unsettled {
        /// The largest force left, in units of tension × spacing.
        force: f64,
    },
    /// The caller asked to stop.
    Interrupted,
}

/// A foam between walls that were moved apart.
#[derive(Clone, Debug)]
pub struct Widened {
    /// The foam, in the part of the gap that was reached.
    pub foam: FreeFoam,
    /// That part: the walls' levels are multiplied by it.
    pub part: f64,
    /// What is in the way of the whole gap; none if it was reached.
    pub obstacle: Option<Obstacle>,
    /// Newton steps and changes of topology in all stages.
    pub steps: usize,
    /// Changes of topology in all stages.
    pub flips: usize,
}

/// What is told after each step.
#[derive(Clone, Copy, Debug)]
pub struct WideningStep<'a> {
    /// The part of the gap.
    pub part: f64,
    /// Changes of topology before this stage.
    pub flips: usize,
    /// The step.
    pub step: &'a DescentStep<'a>,
}

/// The walls' distance grows by this factor from stage to stage at first; half as much in the logarithm after each stage that
/// failed, and again by more after each that settled.
const GROWTH: f64 = 1.1;
/// A stage that widens by less is not tried.
const LEAST_GROWTH: f64 = 1.005;
/// Newton steps of a stage: those that settle take three to a hundred.
const STAGE_STEPS: usize = 150;
/// Steps times cells of stages in vain, after which no wider gap is tried: a few minutes' work.
const MOST_LOST: usize = 150_000;
/// A stage of however many cells has so many steps: those without changes of topology settle in fewer.
const LEAST_STEPS: usize = 30;
/// Steps of which less than this part could be taken are held up; after so many of them a stage is given up.
const HELD_UP: f64 = 0.05;
const MOST_HELD_UP: usize = 20;
/// The fineness of stages: the network's own films are as fine. On coarser ones long and thin films fold.
const FINENESS: usize = 1;
/// Foams that are tried on the final films, the widest first, until one settles.
const MOST_WIDEST: usize = 4;
/// The force at which a stage ends: topology has settled by then.
const STAGE_TOLERANCE: f64 = 1e-3;
/// Films that turn round corners in one stage before that no longer counts as progress.
const MOST_TURNS: usize = 10;

/// Goes on from a network's foam in a part of `gap` until it is filled.
///
/// # Errors
/// [`FactorError`] if Newton's system cannot be solved in the part that the network fills.
pub fn widened(
    state: &State,
    gap: &Gap,
    settings: &FreeSettings,
    progress: &mut dyn FnMut(&WideningStep<'_>) -> ControlFlow<()>,
) -> Result<Widened, FactorError> {
    let narrow = gap.narrowed(state.part);
    let (division, films) = taken_over(state, &narrow, FINENESS);
    let begin = Begin { division, films, fineness: FINENESS, pressures: state.pressures.clone() };
    let mut stages = Stages { gap, settings, steps: 0, flips: 0, progress };
    let (first, mut obstacle) = stages.coarse(begin, state.part)?;
    stages.flips += first.flips;
    let mut settled = vec![Settled { foam: first, part: state.part, flips: stages.flips }];
    if obstacle.is_some() {
        return widest(stages, settled, obstacle);
    }
    let (mut growth, mut lost) = (GROWTH, 0);
    while let Some(Settled { foam, part, .. }) = settled.last()
        && *part < 1.0
        && obstacle != Some(Obstacle::Interrupted)
    {
        if growth < LEAST_GROWTH || lost > MOST_LOST {
            break;
        }
        let before = stages.steps;
        let (part, wider) = (*part, (part * growth).min(1.0));
        let tried = moved_apart(foam, &gap.narrowed(part), &gap.narrowed(wider))
            .and_then(|begin| stages.coarse(begin, wider).ok());
        match tried {
            Some((foam, None)) => {
                stages.flips += foam.flips;
                growth = (growth * growth).min(GROWTH);
                settled.push(Settled { foam, part: wider, flips: stages.flips });
                obstacle = None;
            }
            Some((_, found)) => (obstacle, growth) = (found, growth.sqrt()),
            None => growth = growth.sqrt(),
        }
        if obstacle.is_some() {
            lost += (stages.steps - before) * state.shares.len();
        }
    }
    widest(stages, settled, obstacle)
}

/// A foam that has settled on coarse films in a part of the gap, after so many changes of topology.
struct Settled {
    foam: FreeFoam,
    part: f64,
    flips: usize,
}

/// The foam in the widest part of the gap that comes to balance on the films that were asked for; in the widest of all if none
/// of the last ones does.
fn widest(
    mut stages: Stages<'_>,
    mut settled: Vec<Settled>,
    mut obstacle: Option<Obstacle>,
) -> Result<Widened, FactorError> {
    let mut first = None;
    for _ in 0..MOST_WIDEST {
        let Some(Settled { foam, part, flips }) = settled.pop() else { break };
        let FreeFoam { fineness, division, films, pressures, .. } = foam;
        stages.flips = flips;
        let begin = Begin { division, films, fineness, pressures };
        let foam = stages.relaxed(begin, part, stages.settings, usize::MAX)?.0;
        let is_uneven = stages.settings.spreads_evenly && !foam.is_even;
        let found =
            self::obstacle(&foam, stages.settings.spacing).or_else(|| is_uneven.then_some(Obstacle::Uneven));
        let flips = flips + foam.flips;
        let ends = found.is_none() || found == Some(Obstacle::Interrupted);
        // What stopped a wider foam stands in the way of the whole gap.
        obstacle =
            if part >= 1.0 || found == Some(Obstacle::Interrupted) { found } else { obstacle.or(found) };
        if part < 1.0 && obstacle.is_none() {
            obstacle = Some(Obstacle::Unsettled { force: foam.descended.residuals.force });
        }
        let widened = Widened { foam, part, obstacle, steps: stages.steps, flips };
        if ends {
            return Ok(widened);
        }
        first.get_or_insert(widened);
    }
    let Some(first) = first else { unreachable!("the foam that the stages start from is among them") };
    Ok(Widened { steps: stages.steps, ..first })
}

/// Stages on their way.
struct Stages<'a> {
    gap: &'a Gap,
    settings: &'a FreeSettings,
    steps: usize,
    flips: usize,
    progress: &'a mut dyn FnMut(&WideningStep<'_>) -> ControlFlow<()>,
}

impl Stages<'_> {
    /// A foam in a part of the gap to the stages' tolerance, on films as fine as they are, and what is in its way.
    fn coarse(&mut self, begin: Begin, part: f64) -> Result<(FreeFoam, Option<Obstacle>), FactorError> {
        let settings = FreeSettings {
            fineness: begin.fineness,
            tolerance: STAGE_TOLERANCE,
            step_limit: STAGE_STEPS.min(MOST_LOST / begin.division.seeds.len()).max(LEAST_STEPS),
            spreads_evenly: false,
            ..*self.settings
        };
        let (mut foam, mut held_up) = self.relaxed(begin, part, &settings, MOST_HELD_UP)?;
        for _ in 0..MOST_TURNS {
            let Some(begin) = turned(&foam, &self.gap.narrowed(part), settings.spacing) else { break };
            let flips = foam.flips;
            (foam, held_up) = self.relaxed(begin, part, &settings, MOST_HELD_UP)?;
            foam.flips += flips;
        }
        let force = foam.descended.residuals.force;
        let obstacle = obstacle(&foam, settings.spacing).map(|found| match found {
            Obstacle::Interrupted if held_up => Obstacle::Unsettled { force },
            other => other,
        });
        Ok((foam, obstacle))
    }

    /// A foam in a part of the gap, and whether it was given up because more than so many of its steps were held up.
    fn relaxed(
        &mut self,
        begin: Begin,
        part: f64,
        settings: &FreeSettings,
        most_held_up: usize,
    ) -> Result<(FreeFoam, bool), FactorError> {
        let Self { gap, flips, progress, .. } = self;
        let mut held_up = 0;
        let foam = relaxed_from(begin, &gap.narrowed(part), settings, &mut |step| {
            held_up += usize::from(step.fraction < HELD_UP);
            match progress(&WideningStep { part, flips: *flips, step }) {
                ControlFlow::Continue(()) if held_up > most_held_up => ControlFlow::Break(()),
                flow => flow,
            }
        })?;
        self.steps += foam.descended.steps;
        Ok((foam, held_up > most_held_up))
    }
}

/// The foam with its nodes at the same part of the way between other walls, and spread evenly; `None` if a node finds no place.
fn moved_apart(foam: &FreeFoam, from: &Gap, to: &Gap) -> Option<Begin> {
    let walls = |gap: &Gap| gap.walls().each_ref().map(|wall| wall.level);
    let ([low, high], [wider_low, wider_high]) = (walls(from), walls(to));
    let field = &from.walls()[0].field;
    let moved = |place: DVec3| {
        let part = (field.value(place) - low) / (high - low);
        field.project(place, wider_low + part * (wider_high - wider_low)).ok()
    };
    let (mut films, mut division): (FreeFilms, Division) = (foam.films.clone(), foam.division.clone());
    for place in films.places.iter_mut() {
        *place = moved(*place)?;
    }
    films.complex.walls = foam.division.walls(to).into();
    for corner in &mut division.corners {
        corner.place = moved(corner.place)?;
    }
    let films = films_even(&division, to, foam.fineness, &films);
    Some(Begin { division, films, fineness: foam.fineness, pressures: foam.pressures.clone() })
}

/// What keeps a foam from balance; nothing if it is in balance.
fn obstacle(foam: &FreeFoam, spacing: f64) -> Option<Obstacle> {
    if let Some(Slide { polygon, place, .. }) = slide(&foam.division, spacing) {
        let film = &foam.division.polygons[polygon];
        return Some(Obstacle::Slid { cells: [film.cell, film.neighbour], place });
    }
    match foam.descended.ending {
        Ending::Converged => return None,
        Ending::Halted if foam.vanishing.is_empty() && foam.unlawful.is_empty() => {
            return Some(Obstacle::Interrupted);
        }
        _ => {}
    }
    if let Some(&law) = foam.unlawful.first() {
        return Some(Obstacle::Law(law));
    }
    let border = foam.vanishing.iter().min_by(|a, b| a.1.total_cmp(&b.1)).and_then(|&(side, length)| {
        let [start, end] = [(side.0, [0; 3]), (side.1, side.2)]
            .map(|(corner, shift)| foam.division.place(CornerImage { corner, shift }));
        let at = |corner| move |image: &CornerImage| image.corner == corner;
        let film = foam
            .division
            .polygons
            .iter()
            .find(|film| film.corners.iter().any(at(side.0)) && film.corners.iter().any(at(side.1)))?;
        let (cells, place) = ([film.cell, film.neighbour], 0.5 * (start + end));
        Some(Obstacle::Border { cells, length: length / spacing, place })
    });
    let force = foam.descended.residuals.force;
    border.or(Some(Obstacle::Unsettled { force }))
}
