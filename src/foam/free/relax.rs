//! The descent of a foam of free topology, which changes where a border vanishes on the way.

use super::{
    Division, FreeFilms, Unlawful,
    division::spacing,
    even::films_even,
    films::{Side, films_after, films_refined, side_between},
    finer::films_finer,
    flip::{Cluster, Moves},
    free_films,
    laws::unlawful,
    open::open,
};
use crate::foam::{
    complex::{NodeId, NodeImage, Places, RegionId},
    convert::as_f64,
    energy::energy,
    relax::{Descended, Descent, DescentSettings, DescentStep, Ending, State},
    solve::FactorError,
};
use crate::{
    index::{Id, IndexVec},
    surface::{Gap, WallSide},
};
use glam::{DVec3, IVec3};
use std::{
    collections::{BTreeMap, BTreeSet},
    ops::ControlFlow,
};

/// A foam of free topology.
#[derive(Clone, Debug)]
pub struct FreeFoam {
    /// Cells, corners and polygons at the end; corners where they ended.
    pub division: Division,
    /// The films where they ended.
    pub films: FreeFilms,
    /// Their elements on each half side, as in [`FreeSettings::fineness`]; 0 for the coarsest.
    pub fineness: usize,
    /// The energy of the films that the descent started from: plane ones of power cells, with slivers opened where topology
    /// may change, or those of the network.
    pub first_energy: f64,
    /// The energy at the end.
    pub energy: f64,
    /// The pressures.
    pub pressures: IndexVec<RegionId, f64>,
    /// The volumes.
    pub volumes: IndexVec<RegionId, f64>,
    /// How the descent ended; its steps are those of all descents between changes of topology.
    pub descended: Descended,
    /// Changes of topology.
    pub flips: usize,
    /// Borders that are shorter than a twentieth of the spacing although the descent has not converged, and their lengths.
    pub vanishing: Vec<(Side, f64)>,
    /// The laws that the last change of topology would have broken; it was not made.
    pub unlawful: Vec<Unlawful>,
    /// Cells that were squeezed off a wall of theirs, where the descent ended: there is no foam nearby in which all keep theirs.
    pub leaving: Vec<(usize, WallSide)>,
    /// Whether nodes were found to lie evenly in balance, so that the energy is that of the foam and its mesh, whatever way led
    /// there. A foam that is in balance on uneven nodes only may owe it to them.
    pub is_even: bool,
}

/// How a foam of free topology is relaxed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeSettings {
    /// Elements on each half side of a film.
    pub fineness: usize,
    /// The size of a cell: the unit of forces and of the lengths at which topology changes.
    pub spacing: f64,
    /// The largest force at the end, in units of tension × spacing.
    pub tolerance: f64,
    /// The most Newton steps in all.
    pub step_limit: usize,
    /// Whether vanishing borders change the topology; otherwise the foam ends where they vanish, so that an arrangement stays
    /// what it is.
    pub changes_topology: bool,
    /// Whether nodes are spread evenly along borders and within films at the end, which makes the energy's last digits those
    /// of the foam, whatever way led to it.
    pub spreads_evenly: bool,
}

impl FreeSettings {
    /// Those for going on from a network's foam.
    #[must_use]
    pub fn of(state: &State) -> Self {
        Self::new(spacing(state.cell_width().powi(2), 1))
    }

    /// The coarsest films, to a force of 1e-10, with changes of topology.
    #[must_use]
    pub const fn new(spacing: f64) -> Self {
        Self {
            fineness: 1,
            spacing,
            tolerance: 1e-10,
            step_limit: 600,
            changes_topology: true,
            spreads_evenly: true,
        }
    }
}

/// Borders below this part of the spacing that go on shrinking change the topology. Beyond it borders that would stay are
/// flipped, below it elements beside them become slivers first.
const VANISHING: f64 = 0.05;
/// A given arrangement ends where a border is below this part of the spacing, shrinking or not: its Newton steps are then held
/// up by slivers. It lies far below the shortest borders of arrangements that settle.
const VANISHED: f64 = 0.004;
/// A triangle beside such a border becomes a border if all its sides are below this part: longer ones first shrink.
const SMALL_FILM: f64 = 0.15;
/// Steps of which less than this part could be taken are held up by slivers: then these go, shrinking or not, and sides of
/// triple [`VANISHING`] that shrink.
const HELD_UP: f64 = 0.05;
const HELD_UP_BY: f64 = 3.0;
/// Sides below this part of the spacing are slivers: they are opened to that length before films are laid anew, and go if
/// steps are held up. It lies below [`VANISHING`], so that what goes on shrinking changes the topology in the next steps.
const SLIVER: f64 = 0.03;
/// A cell that has to keep its wall and whose patch there has a rim shorter than this part of the spacing leaves it: patches of
/// foams in balance have rims of a spacing and more, and one as small is squeezed by its own cell's pressure, the more the
/// smaller it is.
const SQUEEZED_OFF: f64 = 0.2;
/// So many such steps on end, with nothing to go, and the films are laid anew; at most so often.
const MOST_HELD_UP: usize = 4;
const MOST_SPREADS: usize = 12;
/// Nodes of a foam in balance are spread evenly until that changes its energy by less than this, relative, which is not
/// printed; each time leaves less than a tenth of what there was to even out, if no topology changes.
const EVEN: f64 = 1e-12;
const MOST_EVENED: usize = 8;
/// By how much each flip of the same bodies lowers their threshold, so that none flips back and forth for ever.
const WEARINESS: f64 = 0.6;

/// The largest volume error at the end, relative to the mean volume: rounding leaves 9e-11 among two thousand cells.
const VOLUME_TOLERANCE: f64 = 1e-10;

/// The coarsest films.
const FIRST_FINENESS: usize = 0;
/// The force at which the first descent, on the coarsest films, ends: topology has settled by then.
const FIRST_TOLERANCE: f64 = 1e-3;

/// Relaxes `division` at equal volumes: first on the coarsest films, whose steps are cheap and where most changes of topology
/// happen, then on those that were asked for.
///
/// # Errors
/// [`FactorError`] if the system cannot be solved at all.
pub fn relaxed(
    division: Division,
    gap: &Gap,
    settings: &FreeSettings,
    progress: &mut dyn FnMut(&DescentStep<'_>) -> ControlFlow<()>,
) -> Result<FreeFoam, FactorError> {
    let mut division = division;
    if settings.changes_topology {
        open(&mut division, gap, SLIVER * settings.spacing);
    }
    let films = free_films(&division, gap, FIRST_FINENESS);
    let pressures = IndexVec::from_elem(0.0, division.seeds.len());
    let begin = Begin { division, films, fineness: FIRST_FINENESS, pressures };
    relaxed_from(begin, gap, settings, progress)
}

/// Where a descent begins.
pub(super) struct Begin {
    pub(super) division: Division,
    /// The fineness of its films.
    pub(super) fineness: usize,
    pub(super) films: FreeFilms,
    pub(super) pressures: IndexVec<RegionId, f64>,
}

/// Goes on from films that lie near balance.
///
/// # Errors
/// As [`relaxed`].
pub(super) fn relaxed_from(
    begin: Begin,
    gap: &Gap,
    settings: &FreeSettings,
    progress: &mut dyn FnMut(&DescentStep<'_>) -> ControlFlow<()>,
) -> Result<FreeFoam, FactorError> {
    let Begin { division, films, fineness, mut pressures } = begin;
    let first_energy = energy(&films.complex, &films.places);
    let mut run = Run {
        gap,
        settings,
        fineness,
        division,
        films,
        weary: BTreeMap::new(),
        unlawful: Vec::new(),
        flips: 0,
        spreads: 0,
        balanced: None,
        evened: 0,
    };
    let mut steps = 0;
    loop {
        let mut descent = run.descent(pressures)?;
        let (descended, shrinking) = run.descend(&mut descent, settings.step_limit - steps, progress)?;
        let stuck = shrinking.stuck || descended.ending == Ending::Stalled;
        steps += descended.steps;
        run.keep(&descent);
        pressures = descent.pressures().clone();
        let asked_to_stop =
            descended.ending == Ending::Halted && shrinking.sides.is_empty() && !shrinking.stuck;
        let goes_on = !asked_to_stop && shrinking.leaving.is_empty() && steps < settings.step_limit;
        let vanish = !shrinking.sides.is_empty();
        let flipped = goes_on && vanish && settings.changes_topology && run.flip(&shrinking);
        let spread = goes_on && !flipped && stuck && run.spread();
        let refined = goes_on && !flipped && !spread && run.refine();
        if flipped || spread || refined {
            continue;
        }
        let descended = Descended { steps, ..descended };
        let foam = run.end(&descent, descended, first_energy, shrinking.leaving);
        let is_balanced = descended.ending == Ending::Converged;
        if !(goes_on && is_balanced && run.evens(&foam)) {
            let is_lost = !is_balanced && !asked_to_stop && foam.leaving.is_empty();
            return Ok(run.balanced.filter(|_| is_lost).unwrap_or(foam));
        }
        run.balanced = Some(foam);
    }
}

/// A foam on its way.
struct Run<'a> {
    gap: &'a Gap,
    settings: &'a FreeSettings,
    /// That of the present films.
    fineness: usize,
    division: Division,
    films: FreeFilms,
    /// How often bodies have changed neighbours.
    weary: BTreeMap<Cluster, u32>,
    unlawful: Vec<Unlawful>,
    flips: usize,
    /// How often films were laid anew.
    spreads: usize,
    /// The foam in balance before its nodes were spread evenly, and how often they were.
    balanced: Option<FreeFoam>,
    evened: usize,
}

/// Sides that can change the topology, the shortest first.
#[derive(Default)]
struct Vanishing {
    sides: Vec<Side>,
    /// The longest side of a film that may become a border.
    small: f64,
    /// Whether steps are held up although nothing vanishes.
    stuck: bool,
    /// Cells that are squeezed off a wall.
    leaving: Vec<(usize, WallSide)>,
}

impl Vanishing {
    fn is_none(&self) -> bool {
        self.sides.is_empty() && !self.stuck && self.leaving.is_empty()
    }
}

/// Changes of topology for each cell, after which no more are made: a foam that needs as many goes round in circles.
const MOST_FLIPS: usize = 10;

/// Lengths of all borders and edges on walls.
type Lengths = BTreeMap<Side, f64>;

impl Run<'_> {
    fn descent(&self, pressures: IndexVec<RegionId, f64>) -> Result<Descent, FactorError> {
        let wanted = self.division.volumes.clone().into();
        Descent::new(self.films.complex.clone(), wanted, self.films.places.clone(), pressures)
    }

    /// Descends until the end or until borders vanish that can; these are given, the shortest first.
    fn descend(
        &self,
        descent: &mut Descent,
        step_limit: usize,
        progress: &mut dyn FnMut(&DescentStep<'_>) -> ControlFlow<()>,
    ) -> Result<(Descended, Vanishing), FactorError> {
        let FreeSettings { spacing, tolerance, .. } = *self.settings;
        let tolerance = if self.fineness < self.settings.fineness { FIRST_TOLERANCE } else { tolerance };
        let volume_tolerance = tolerance.max(VOLUME_TOLERANCE);
        let settings = DescentSettings { length: spacing, tolerance, volume_tolerance, step_limit };
        let mut before = self.lengths(descent);
        let mut shrinking = Vanishing::default();
        let mut held_up = 0;
        let descended = descent.descend(&settings, &mut |told: &DescentStep<'_>| {
            let now = self.lengths(told.descent);
            shrinking = self.vanishing(&before, &now, told);
            before = now;
            held_up = if told.fraction < HELD_UP { held_up + 1 } else { 0 };
            shrinking.stuck = held_up >= MOST_HELD_UP && self.spreads < MOST_SPREADS;
            shrinking.leaving = self.leaving(&before);
            let flow = progress(told);
            if shrinking.is_none() { flow } else { ControlFlow::Break(()) }
        })?;
        Ok((descended, shrinking))
    }

    fn lengths(&self, descent: &Descent) -> Lengths {
        let place = |image: &NodeImage| descent.complex().place(descent.places(), *image);
        let sides = self.films.borders.iter().chain(&self.films.wall_edges);
        let lengths = sides.map(|(&side, nodes)| {
            (side, nodes.windows(2).map(|pair| place(&pair[0]).distance(place(&pair[1]))).sum())
        });
        // Lines without a film count by their chords.
        let image = |corner, shift| NodeImage { node: NodeId::from_index(corner), shift };
        let cut = self.division.cut_lines().map(|(a, b, shift)| {
            let ends = [image(a, IVec3::ZERO), image(b, IVec3::from_array(shift))];
            ((a, b, shift), place(&ends[0]).distance(place(&ends[1])))
        });
        lengths.chain(cut).collect()
    }

    /// Sides that are short, grow shorter and can change the topology.
    fn vanishing(&self, before: &Lengths, now: &Lengths, told: &DescentStep<'_>) -> Vanishing {
        let held_up = told.fraction < HELD_UP;
        let factor = if held_up { HELD_UP_BY } else { 1.0 };
        let (limit, small) =
            (factor * VANISHING * self.settings.spacing, factor * SMALL_FILM * self.settings.spacing);
        if !self.settings.changes_topology {
            let gone = |side: &&Side| now[*side] < VANISHED * self.settings.spacing;
            let sides = self.films.borders.keys().filter(gone).copied().collect();
            return Vanishing { sides, small, ..Vanishing::default() };
        }
        let sliver = |length: f64| held_up && length < SLIVER * self.settings.spacing;
        let short = |side: &Side, length: f64| length < limit && (length < before[side] || sliver(length));
        let exhausted = self.flips >= MOST_FLIPS * self.division.seeds.len();
        if exhausted || !now.iter().any(|(side, &length)| short(side, length)) {
            return Vanishing::default();
        }
        let division = self.division.at(told.descent.places());
        let moves = Moves::new(&division, self.gap, self.settings.spacing);
        let mut found: Vec<(f64, Side)> = now
            .iter()
            .filter(|&(side, &length)| short(side, length))
            .filter_map(|(&side, &length)| {
                let times = self.weary.get(&moves.cluster(side)?).copied().unwrap_or(0);
                let relative = length / (limit * WEARINESS.powi(i32::try_from(times).unwrap_or(i32::MAX)));
                (relative < 1.0 && moves.can_vanish(side, small)).then_some((relative, side))
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let sides = found.into_iter().map(|(_, side)| side).collect();
        Vanishing { sides, small, ..Vanishing::default() }
    }

    /// Cells whose patch on a wall that they have to keep has shrunk to next to nothing.
    fn leaving(&self, now: &Lengths) -> Vec<(usize, WallSide)> {
        let mut rims = vec![[0.0; 2]; self.division.seeds.len()];
        for polygon in &self.division.polygons {
            let count = polygon.corners.len();
            for (at, wall) in self.division.wall_sides(polygon) {
                let (side, _) = side_between(polygon.corners[at], polygon.corners[(at + 1) % count]);
                let length = now.get(&side).copied().unwrap_or(f64::INFINITY);
                rims[polygon.cell][wall as usize] += length;
                rims[polygon.neighbour][wall as usize] += length;
            }
        }
        let gone = |&(cell, wall): &(usize, WallSide)| {
            self.division.stacking.walls(cell).is_some_and(|walls| walls[wall as usize])
                && rims[cell][wall as usize] < SQUEEZED_OFF * self.settings.spacing
        };
        let patches = (0..rims.len()).flat_map(|cell| WallSide::BOTH.map(|wall| (cell, wall)));
        patches.filter(gone).collect()
    }

    /// Takes over where a descent has brought the nodes.
    fn keep(&mut self, descent: &Descent) {
        self.films.places = descent.places().clone();
        self.division = self.division.at(descent.places());
    }

    /// Changes the topology at these sides, as far as they do not disturb each other. Gives whether anything changed.
    fn flip(&mut self, vanishing: &Vanishing) -> bool {
        let mut moves = Moves::new(&self.division, self.gap, self.settings.spacing);
        let mut touched: BTreeSet<usize> = BTreeSet::new();
        let mut done = 0;
        for &side in &vanishing.sides {
            let round: BTreeSet<usize> =
                [side.0, side.1].into_iter().flat_map(|corner| moves.neighbourhood(corner)).collect();
            if round.iter().any(|corner| touched.contains(corner)) {
                continue;
            }
            let Some(cluster) = moves.vanish(side, vanishing.small) else { continue };
            *self.weary.entry(cluster).or_default() += 1;
            touched.extend(round);
            done += 1;
        }
        if done > 0 {
            let (division, renumbering) = moves.finish();
            self.unlawful = unlawful(&division);
            if !self.unlawful.is_empty() {
                return false;
            }
            self.films = films_after(&division, self.gap, self.fineness, &self.films, &renumbering);
            self.division = division;
            self.flips += done;
        }
        done > 0
    }

    /// Lays the films anew between their corners, every other time between their borders: elements that are about to fold open,
    /// and so do slivers where topology may change. Gives whether this may help yet.
    fn spread(&mut self) -> bool {
        self.spreads += 1;
        if self.settings.changes_topology {
            open(&mut self.division, self.gap, SLIVER * self.settings.spacing);
        }
        self.films = match self.spreads % 3 {
            1 => films_even(&self.division, self.gap, self.fineness, &self.films),
            2 => free_films(&self.division, self.gap, self.fineness),
            _ => films_refined(&self.division, self.gap, self.fineness, &self.films),
        };
        self.spreads <= MOST_SPREADS
    }

    /// Spreads the nodes of a foam in balance evenly, if they were not before. Gives whether anything changed.
    fn evens(&mut self, foam: &FreeFoam) -> bool {
        if !self.settings.spreads_evenly || foam.is_even || self.evened >= MOST_EVENED {
            return false;
        }
        self.evened += 1;
        self.films = films_even(&self.division, self.gap, self.fineness, &self.films);
        true
    }

    /// Goes on to the films that were asked for. Gives whether there are others to go on to.
    fn refine(&mut self) -> bool {
        let coarser = self.fineness < self.settings.fineness;
        if coarser {
            let before = (&self.films, self.fineness);
            self.films = films_finer(&self.division, self.gap, self.settings.fineness, before);
            self.fineness = self.settings.fineness;
        }
        coarser
    }

    fn end(
        &self,
        descent: &Descent,
        descended: Descended,
        first_energy: f64,
        leaving: Vec<(usize, WallSide)>,
    ) -> FreeFoam {
        let vanishing = if descended.ending == Ending::Converged {
            Vec::new()
        } else {
            let lengths = self.lengths(descent);
            lengths.into_iter().filter(|(_, length)| *length < VANISHING * self.settings.spacing).collect()
        };
        let energy = descent.energy();
        let is_even = descended.ending == Ending::Converged
            && self.balanced.as_ref().is_some_and(|before| (energy / before.energy - 1.0).abs() < EVEN);
        FreeFoam {
            first_energy,
            energy,
            is_even,
            pressures: descent.pressures().clone(),
            volumes: descent.volumes(),
            descended,
            flips: self.flips,
            vanishing,
            leaving,
            division: self.division.clone(),
            films: self.films.clone(),
            unlawful: self.unlawful.clone(),
            fineness: self.fineness,
        }
    }
}

impl FreeFoam {
    /// The place of a node.
    #[must_use]
    pub fn place(&self, image: NodeImage) -> DVec3 {
        self.films.complex.place(&self.films.places, image)
    }

    /// The places of all nodes.
    #[must_use]
    pub fn places(&self) -> &Places {
        &self.films.places
    }

    /// The lowest eigenvalue of the Hessian at constant volumes of a foam in balance; see [`crate::foam::solve::Mode`].
    ///
    /// # Errors
    /// [`FactorError`] if the system cannot be factored.
    pub fn lowest_eigenvalue(&self) -> Result<f64, FactorError> {
        let wanted = self.division.volumes.clone().into();
        let (complex, places) = (self.films.complex.clone(), self.films.places.clone());
        Ok(Descent::new(complex, wanted, places, self.pressures.clone())?.lowest_mode()?.eigenvalue)
    }

    /// The relative spread of the volumes round those that the cells shall have.
    #[must_use]
    pub fn volume_spread(&self) -> f64 {
        let wanted = &self.division.volumes;
        let scale = self.volumes.iter().sum::<f64>() / wanted.iter().sum::<f64>();
        let squares = self.volumes.iter().zip(wanted).map(|(v, w)| (v / (scale * w) - 1.0).powi(2));
        (squares.sum::<f64>() / as_f64(self.volumes.len())).sqrt()
    }
}
