//! From photograph to cells: the steps in order.

use super::{
    CorrectionError, Settings, ellipse,
    evidence::{self, Evidence, Rasters},
    kinds::{self, Kind, median},
    lattice::Site,
    openings,
    photo::Part,
    pitch::PitchEstimate,
    plane::{Plane, pixel},
    raster::Pyramid,
    sides::{self, Cells, Count},
    smooth,
    survey::{Survey, survey},
    walls::{self, Region, Wall},
    watershed::{self, Marker, Segmentation},
};
use glam::{DMat2, DVec2};
use std::{collections::BTreeMap, ops::RangeInclusive};

/// Pixels per pitch that the reading works at: larger photographs are reduced to it. At 36 a wall of a tenth of the pitch
/// is 3 to 4 pixels long, which is enough to see it; more costs time and shows more of the wax's grain.
const WORK_PITCH: f64 = 36.0;
/// Smaller photographs are enlarged to this, so that a wall is more than one pixel wide.
const LEAST_WORK_PITCH: f64 = 24.0;
/// Below this many pixels per cell the photograph is refused: walls are no longer resolved.
pub const LEAST_PITCH: f64 = 11.0;
/// Above this many a pitch is not looked for.
pub const GREATEST_PITCH: f64 = 640.0;
/// Share of the photograph that must look like comb.
pub(crate) const LEAST_COVERAGE: f64 = 0.012;
/// Pixels of the working raster, along each axis, per pixel of the first flood.
const COARSE: usize = 2;
/// Smoothing of the relief, in pitches.
const RELIEF_BLUR: f64 = 0.03;

/// Two halves of one wide cell: no wall of more than this share of the usual rise between them, together no larger than
/// this many cells, and nearer than this many pitches. Two cells are 2 in area and 1 in distance.
const HALVES_RISE: f64 = 0.55;
const HALVES_AREA: f64 = 1.65;
const HALVES_DISTANCE: f64 = 0.78;
/// An inferred place is a corner of another one's cell behind no more than a sunken wall: less than this share of a cell,
/// together with the other about one cell, and a wall of no more than this share of the usual rise.
const CORNER_AREA: f64 = 0.45;
const CORNER_TOTAL: RangeInclusive<f64> = 0.8..=1.4;
const CORNER_RISE: f64 = 0.8;

/// A cell is cut if along more than this share of its outline, two thirds of a side, only the inner half of its wall lies in the
/// photograph.
const AT_BORDER: f64 = 0.11;
/// A cell that the border cuts is a sliver if less than this share of its outline is seen.
const HALF_SEEN: f64 = 0.5;
/// Seen cells below which there is no comb.
pub(crate) const LEAST_CELLS: usize = 7;

/// The reading of a photograph at working scale; all lists are indexed by the places of the lattice.
pub(crate) struct Reading {
    /// Pixels of the working raster per pixel of the photograph.
    pub(crate) scale: f64,
    /// Centres of the cells.
    pub(crate) centres: Vec<DVec2>,
    /// What the segmentation gave each.
    pub(crate) regions: Vec<Region>,
    /// Walls between two of them, lower index first.
    pub(crate) walls: BTreeMap<(usize, usize), Wall>,
    /// What the photograph shows of each.
    pub(crate) evidence: Vec<Evidence>,
    /// Seen, hidden or beyond the comb.
    pub(crate) kinds: Vec<Kind>,
    /// Whether the border, a mask or nothing cuts the cell.
    pub(crate) cut: Vec<bool>,
    /// Whether so little of the cell is seen that its centre is a guess.
    pub(crate) slivers: Vec<bool>,
    /// Neighbours and doubts.
    pub(crate) counts: Vec<Count>,
    /// Local pitch.
    pub(crate) pitches: Vec<f64>,
    /// Size of the working raster.
    pub(crate) size: DVec2,
}

impl Reading {
    /// The number of cells that are seen.
    pub(crate) fn seen(&self) -> usize {
        self.kinds.iter().filter(|k| **k == Kind::Seen).count()
    }

    /// Whether a point lies on the raster.
    pub(crate) fn holds(&self, point: DVec2) -> bool {
        point.cmpge(DVec2::ZERO).all() && point.cmplt(self.size).all()
    }

    /// Length of the wall between two cells in pixels of the raster; 0 where the segmentation has none.
    pub(crate) fn wall_length(&self, a: usize, b: usize) -> f64 {
        self.walls.get(&(a.min(b), a.max(b))).map_or(0.0, |w| w.length)
    }
}

/// Factor from the photograph to the working raster.
fn scale_for(pitch: f64) -> f64 {
    if pitch > WORK_PITCH {
        WORK_PITCH / pitch
    } else if pitch < LEAST_WORK_PITCH {
        LEAST_WORK_PITCH / pitch
    } else {
        1.0
    }
}

/// Reads the cells of a part of a photograph, whose pitch is known.
pub(crate) fn read(
    pyramid: &Pyramid<'_>,
    estimate: PitchEstimate,
    settings: &Settings,
) -> Result<Reading, CorrectionError> {
    let scale = scale_for(estimate.pitch);
    let pitch = estimate.pitch * scale;
    let part = pyramid.part();
    let mut survey = survey(pyramid, estimate.polarity, scale, pitch);
    let relief = survey.relief.blurred(RELIEF_BLUR * pitch);
    let coarse = coarse(&relief);
    add_missed(&mut survey, &coarse);
    let origin = DVec2::new(part.left as f64, part.top as f64);
    let to_raster = |point: DVec2| (point - origin) * scale;
    settings.corrections.place(&mut survey.sites, to_raster, pitch)?;
    let hidden = hidden(settings, &survey.relief, part, scale);
    if let Some(hidden) = &hidden {
        let width = survey.relief.width();
        let at = |p: DVec2| pixel(p.y, survey.relief.height()) * width + pixel(p.x, width);
        survey.sites.retain(|site| !hidden[at(site.position)]);
    }
    let joined = settings.corrections.joined(&survey.sites, to_raster, pitch)?;
    let segmented = segment(&survey, [relief, coarse], hidden.as_deref(), &joined);
    Ok(count(&survey, segmented, scale))
}

/// Adds the cells that the lattice missed because they are seen obliquely. Half the resolution is enough to find them.
fn add_missed(survey: &mut Survey, coarse: &Plane) {
    let unit = COARSE as f64;
    let positions: Vec<DVec2> = survey.sites.iter().map(|site| site.position / unit).collect();
    let local = |place: DVec2| survey.field.at(place * unit) / unit;
    let missed = openings::missed(coarse, &survey.sites, &positions, local);
    for site in missed.replaced.into_iter().rev() {
        survey.sites.remove(site);
    }
    let cells = missed.cells.into_iter();
    survey.sites.extend(cells.map(|(place, width)| Site { width, ..Site::new(place * unit, 0) }));
}

fn coarse(relief: &Plane) -> Plane {
    let fill = |y: usize, row: &mut [f32]| row.copy_from_slice(relief.row(y));
    smooth::reduced(relief.width(), relief.height(), COARSE, fill)
}

/// Which pixels of the raster the mask or a correction hides.
fn hidden(settings: &Settings, raster: &Plane, part: Part, scale: f64) -> Option<Vec<bool>> {
    if settings.mask.is_none() && !settings.corrections.masks() {
        return None;
    }
    let hides = |x: usize, y: usize| {
        let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / scale;
        let (u, v) = (part.left + pixel(place.x, part.width), part.top + pixel(place.y, part.height));
        let point = place + DVec2::new(part.left as f64, part.top as f64);
        settings.mask.as_ref().is_some_and(|m| m.hides(u, v)) || settings.corrections.hides(point)
    };
    let width = raster.width();
    Some((0..width * raster.height()).map(|i| hides(i % width, i / width)).collect())
}

struct Segmented {
    segmentation: Segmentation,
    relief: Plane,
    centres: Vec<DVec2>,
    markers: Vec<DVec2>,
    by_hand: Vec<bool>,
    clear: Vec<bool>,
    pitches: Vec<f64>,
    regions: Vec<Region>,
    walls: BTreeMap<(usize, usize), Wall>,
}

fn segment(
    survey: &Survey,
    [relief, coarse]: [Plane; 2],
    hidden: Option<&[bool]>,
    joined: &[(usize, usize)],
) -> Segmented {
    let mut centres: Vec<DVec2> = survey.sites.iter().map(|s| s.position).collect();
    let pitches: Vec<f64> =
        survey.sites.iter().map(|site| site.width * survey.field.at(site.position)).collect();
    centre(&mut centres, survey, [&relief, &coarse], &pitches, hidden);
    let mut segmentation = watershed::flood(&relief, &marked(&centres, &pitches, &survey.sites), hidden);
    let regions = walls::regions(&segmentation, &relief, &centres, &pitches);
    let walls = walls::walls(&segmentation, &relief, &regions);
    let mut into = halves(&survey.sites, &regions, &walls, &pitches);
    for (a, b) in joined {
        into[*b] = into[*a];
    }
    let kept: Vec<usize> = (0..into.len()).filter(|i| into[*i] == *i && !survey.sites[*i].removed).collect();
    let mut place = vec![None; into.len()];
    for (new, old) in kept.iter().enumerate() {
        place[*old] = Some(new);
    }
    segmentation.relabel(&into.iter().map(|i| place[*i]).collect::<Vec<Option<usize>>>());
    let pitches: Vec<f64> = kept.iter().map(|i| pitches[*i]).collect();
    let markers: Vec<DVec2> = kept.iter().map(|i| centres[*i]).collect();
    let by_hand =
        kept.iter().map(|i| survey.sites[*i].by_hand || joined.iter().any(|(a, _)| a == i)).collect();
    let clear = kept.iter().map(|i| survey.sites[*i].clear).collect();
    let regions = walls::regions(&segmentation, &relief, &markers, &pitches);
    let walls = walls::walls(&segmentation, &relief, &regions);
    let centres = regions
        .iter()
        .zip(&markers)
        .map(|(r, m)| if r.area > 0.0 && !r.on_border { r.centroid } else { *m })
        .collect();
    Segmented { segmentation, relief, centres, markers, by_hand, clear, pitches, regions, walls }
}

fn marked(centres: &[DVec2], pitches: &[f64], sites: &[Site]) -> Vec<Marker> {
    let places = centres.iter().zip(pitches).zip(sites);
    places
        .map(|((centre, pitch), site)| Marker { centre: *centre, pitch: *pitch, by_hand: site.by_hand })
        .collect()
}

/// Moves the cells that were found to the middle of what a first flood gives them. Half the resolution is enough for that.
fn centre(
    centres: &mut [DVec2],
    survey: &Survey,
    [relief, coarse]: [&Plane; 2],
    pitches: &[f64],
    hidden: Option<&[bool]>,
) {
    let hidden: Option<Vec<bool>> = hidden.map(|hidden| {
        let at = |i: usize| COARSE * (i / coarse.width() * relief.width() + i % coarse.width());
        (0..coarse.width() * coarse.height()).map(|i| hidden[at(i)]).collect()
    });
    let unit = COARSE as f64;
    let markers: Vec<DVec2> = centres.iter().map(|c| *c / unit).collect();
    let pitches: Vec<f64> = pitches.iter().map(|p| p / unit).collect();
    let first = watershed::flood(coarse, &marked(&markers, &pitches, &survey.sites), hidden.as_deref());
    let regions = walls::regions(&first, coarse, &markers, &pitches);
    for ((centre, region), site) in centres.iter_mut().zip(regions).zip(&survey.sites) {
        if site.depth == 0 && region.area > 0.0 && !region.on_border {
            *centre = region.centroid * unit;
        }
    }
}

/// Cells that were found as two halves, having no wall between them: for each, the one that it joins. Two blobs may be
/// halves, and a blob and an inferred place that got only a corner of the blob's cell.
fn halves(
    sites: &[Site],
    regions: &[Region],
    walls: &BTreeMap<(usize, usize), Wall>,
    pitches: &[f64],
) -> Vec<usize> {
    let found = |i: usize| sites[i].is_seen();
    let is_inferred = |i: usize| sites[i].depth > 0 && !sites[i].by_hand && !sites[i].removed;
    // An inferred place may lie on a cap: only what was found tells how low an opening is.
    let inside = |i: usize| if found(i) { regions[i].inside } else { f64::NEG_INFINITY };
    let rise = |(a, b): (usize, usize), w: &Wall| w.height - inside(a).max(inside(b));
    let seen = |(a, b): (usize, usize)| found(a) && found(b);
    let typical = median(walls.iter().filter(|(p, _)| seen(**p)).map(|(p, w)| rise(*p, w)));
    let mut into: Vec<usize> = (0..sites.len()).collect();
    let mut joined = vec![false; sites.len()];
    for (pair, wall) in walls {
        let (a, b) = *pair;
        let pitch = (pitches[a] + pitches[b]) / 2.0;
        let cell = pitch * pitch * 0.75_f64.sqrt();
        let corner =
            |i: usize| is_inferred(i) && regions[i].area < CORNER_AREA * cell && !regions[i].on_border;
        let halves = match (found(a), found(b)) {
            (true, true) => wall.length > 0.3 * pitch,
            (true, false) => corner(b),
            (false, true) => corner(a),
            (false, false) => false,
        };
        let both = found(a) && found(b);
        let (rise_limit, total) =
            if both { (HALVES_RISE, 0.0..=HALVES_AREA) } else { (CORNER_RISE, CORNER_TOTAL) };
        let open = rise(*pair, wall) < rise_limit * typical;
        let sized = total.contains(&((regions[a].area + regions[b].area) / cell));
        let close = regions[a].centroid.distance(regions[b].centroid) < HALVES_DISTANCE * pitch;
        if halves && open && sized && close && !joined[a] && !joined[b] {
            let (kept, gone) = if found(a) { (a, b) } else { (b, a) };
            into[gone] = kept;
            (joined[a], joined[b]) = (true, true);
        }
    }
    into
}

fn count(survey: &Survey, segmented: Segmented, scale: f64) -> Reading {
    let Segmented { segmentation, relief, mut centres, markers, by_hand, clear, pitches, regions, walls } =
        segmented;
    let rasters = Rasters { relief: &relief, wallness: &survey.wallness, segmentation: &segmentation };
    let insides: Vec<f64> = regions.iter().map(|r| r.inside).collect();
    let evidence = evidence::gather(&rasters, &centres, &insides, &pitches);
    let cut: Vec<bool> = regions
        .iter()
        .zip(&evidence)
        .map(|(r, e)| {
            r.area == 0.0 || e.visible < 1.0 && r.on_border || e.at_border > AT_BORDER || r.on_nothing
        })
        .collect();
    let whole: Vec<bool> = cut.iter().map(|c| !c).collect();
    let mut kinds = kinds::classify(&centres, &pitches, &evidence, &whole, &clear);
    for (kind, by_hand) in kinds.iter_mut().zip(&by_hand) {
        if *by_hand {
            *kind = Kind::Seen;
        }
    }
    for (index, centre) in centres.iter_mut().enumerate().filter(|(i, _)| kinds[*i] != Kind::Seen) {
        *centre = markers[index];
    }
    let slivers: Vec<bool> = evidence.iter().map(|e| e.visible < HALF_SEEN).collect();
    let is_whole = |i: usize| kinds[i] == Kind::Seen && !cut[i];
    let shape = |i: usize| is_whole(i).then(|| ellipse::unit(evidence[i].ellipse)).flatten();
    let shapes: Vec<Option<DMat2>> = (0..centres.len()).map(shape).collect();
    let cells = Cells {
        centres: &centres,
        pitches: &pitches,
        kinds: &kinds,
        cut: &cut,
        slivers: &slivers,
        shapes: &shapes,
    };
    let counts = sides::count(&cells, &walls);
    let size = DVec2::new(relief.width() as f64, relief.height() as f64);
    Reading { scale, centres, regions, walls, evidence, kinds, cut, slivers, counts, pitches, size }
}
