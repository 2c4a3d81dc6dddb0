//! Which blobs are cells: those that continue a hexagonal lattice.
//!
//! Seeds are blobs in a regular hexagonal neighbourhood. From them the lattice grows: every open edge of a good triangle
//! predicts the cell beyond it, by reflection. A blob near that place is taken as seen; where there is none, the cell is
//! inferred, so that growth crosses what hides the comb (caps, bees, glare) and reaches blobs beyond. Clear blobs amid the
//! comb, as open cells among caps are, need no prediction. Blobs that no lattice reaches (leaves, texture of wood) are dropped.

use super::{
    grid::Grid,
    peaks::Peak,
    plane::{Plane, narrow, pixel},
    triangulation::{Delaunay, Edge},
};
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Greatest deviation of a seed's six neighbour distances from their mean.
const DISTANCE_SPREAD: f64 = 0.25;
/// Least |ψ6| of a seed's neighbourhood: 1 for a perfect hexagon, about 0.4 for random points.
const SEED_ORDER: f64 = 0.75;
/// Neighbours are looked for within this many pitches.
const NEIGHBOURHOOD: f64 = 1.8;
/// A seed's mean neighbour distance lies within this factor of the pitch.
const PITCH_FACTOR: f64 = 1.4;
/// Points that are not worth sharing among threads.
const POINTS_PER_TASK: usize = 256;
/// Width over which the local pitch is a mean, in pitches, and the weight of the overall pitch, in cells.
const FIELD_SPREAD: f64 = 2.0;
const FIELD_PRIOR: f64 = 0.2;
/// Edges of a good triangle, in pitches.
const GOOD_EDGE: (f64, f64) = (0.55, 1.55);
/// A blob this near to its predicted place (in pitches) is the predicted cell.
const SNAP: f64 = 0.38;
/// Two cells are never nearer than this (in pitches).
const CLOSEST: f64 = 0.58;
/// A clear blob is a cell if places of the lattice lie within this many pitches in five of six directions.
const AMID_REACH: f64 = 7.0;
/// Cells this near to an inferred one (in pitches) settle which are its neighbours: twice the longest good edge.
const AROUND: f64 = 2.0 * GOOD_EDGE.1;
/// How often inferred cells are triangulated to be moved, and moved each time.
const TRIANGULATIONS: usize = 2;
const MOVES: usize = 5;
/// Layers of inferred cells that may follow one another: half the width of the widest cap that is bridged.
const INFERRED_LAYERS: usize = 7;

/// The neighbourhood of a point that sits in a hexagonal lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neighbourhood {
    /// Mean distance of its six neighbours.
    pub(crate) distance: f64,
}

/// For each point, its neighbourhood if that is hexagonal at about the given pitch.
pub(crate) fn hexagonal_neighbourhoods(points: &[DVec2], pitch: f64) -> Vec<Option<Neighbourhood>> {
    let grid = Grid::of(points, pitch);
    points
        .par_iter()
        .with_min_len(POINTS_PER_TASK)
        .map(|point| {
            // The six nearest, in order.
            let mut near = [(f64::INFINITY, usize::MAX); 6];
            for (index, squared) in grid.within(*point, NEIGHBOURHOOD * pitch) {
                let mut here = (squared, index);
                for place in near.iter_mut().filter(|_| squared > 0.0) {
                    if here < *place {
                        std::mem::swap(&mut here, place);
                    }
                }
            }
            let found = near.iter().all(|(squared, _)| squared.is_finite());
            found
                .then(|| near.map(|(_, index)| points[index] - *point))
                .and_then(|steps| hexagonal(&steps, pitch))
        })
        .collect()
}

fn hexagonal(steps: &[DVec2; 6], pitch: f64) -> Option<Neighbourhood> {
    let distance = steps.iter().map(|s| s.length()).sum::<f64>() / 6.0;
    let sixfold: DVec2 = steps.iter().map(|s| sixth_power(s.normalize_or_zero())).sum();
    let even = steps.iter().all(|s| (s.length() / distance - 1.0).abs() < DISTANCE_SPREAD);
    let sized = distance < pitch * PITCH_FACTOR && distance * PITCH_FACTOR > pitch;
    (even && sized && sixfold.length() / 6.0 > SEED_ORDER).then_some(Neighbourhood { distance })
}

/// The direction at six times the angle.
fn sixth_power(direction: DVec2) -> DVec2 {
    let square = direction.rotate(direction);
    square.rotate(square).rotate(square)
}

/// The pitch as it varies over the photograph.
#[derive(Clone, Debug)]
pub(crate) struct PitchField {
    bin: f64,
    columns: usize,
    rows: usize,
    pitches: Vec<f64>,
}

impl PitchField {
    /// From distances measured at points: Gaussian means over about two pitches, the overall pitch far from any.
    pub(crate) fn new(size: DVec2, overall: f64, measured: &[(DVec2, f64)]) -> Self {
        let bin = overall;
        let cells = |length: f64| super::plane::pixels((length / bin).ceil()).max(1);
        let (columns, rows) = (cells(size.x), cells(size.y));
        let mut sums = vec![[0.0; 2]; columns * rows];
        for (point, distance) in measured {
            let [column, row] = [(point.x, columns), (point.y, rows)].map(|(v, count)| pixel(v / bin, count));
            let [count, sum] = &mut sums[row * columns + column];
            *count += 1.0;
            *sum += distance;
        }
        let mean = |part: usize| {
            Plane::from_fn(columns, rows, |x, y| narrow(sums[y * columns + x][part])).blurred(FIELD_SPREAD)
        };
        let (counts, distances) = (mean(0), mean(1));
        let around = TAU * FIELD_SPREAD * FIELD_SPREAD;
        let pitch = |(count, distance): (&f32, &f32)| {
            (around * f64::from(*distance) + FIELD_PRIOR * overall)
                / (around * f64::from(*count) + FIELD_PRIOR)
        };
        let pitches = counts.data().iter().zip(distances.data()).map(pitch).collect();
        Self { bin, columns, rows, pitches }
    }

    /// The same field in a raster of `factor` times as many pixels along each axis.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        self.bin *= factor;
        self.pitches.iter_mut().for_each(|p| *p *= factor);
        self
    }

    /// The pitch at a point.
    pub(crate) fn at(&self, point: DVec2) -> f64 {
        let column = pixel(point.x / self.bin, self.columns);
        let row = pixel(point.y / self.bin, self.rows);
        self.pitches[row * self.columns + column]
    }
}

/// A place of the lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    /// Centre.
    pub(crate) position: DVec2,
    /// 0 where a blob was seen, else how many inferred layers lie between this place and a seen one.
    pub(crate) depth: usize,
    /// Whether the blob stands out as an open cell among caps does.
    pub(crate) clear: bool,
    /// Whether a person says that there is a cell.
    pub(crate) by_hand: bool,
    /// Its least width over that of a cell of the local pitch: less than 1 where it is seen obliquely.
    pub(crate) width: f64,
    /// Whether a person says that there is none: its pixels are then taken from all cells.
    pub(crate) removed: bool,
}

impl Site {
    pub(crate) const fn new(position: DVec2, depth: usize) -> Self {
        Self { position, depth, clear: false, by_hand: false, width: 1.0, removed: false }
    }

    /// A cell that a person has added.
    pub(crate) const fn by_hand(position: DVec2) -> Self {
        Self { position, depth: 0, clear: false, by_hand: true, width: 1.0, removed: false }
    }

    /// Whether a blob was seen here, and no person says otherwise.
    pub(crate) const fn is_seen(&self) -> bool {
        self.depth == 0 && !self.by_hand && !self.removed
    }
}

/// Grows the lattice from the regular ones of `peaks`; `size` is that of the raster.
pub(crate) fn grow(
    peaks: &[Peak],
    pitch: &PitchField,
    seeds: &[bool],
    size: DVec2,
    layers: Layers,
) -> Vec<Site> {
    let mut growth = Growth::new(peaks, pitch, seeds, size);
    while growth.accept_seen() {}
    while growth.accept_clear() {}
    if layers == Layers::Inferred {
        for layer in 1..=INFERRED_LAYERS {
            if !growth.infer_layer(layer) {
                break;
            }
            while growth.accept_seen() {}
        }
        growth.relax();
    }
    growth.sites
}

/// Whether growth crosses what hides the comb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layers {
    /// Only blobs that are seen.
    Seen,
    /// Inferred cells too.
    Inferred,
}

struct Growth<'a> {
    peaks: &'a [Peak],
    peak_grid: Grid,
    pitch: &'a PitchField,
    size: DVec2,
    sites: Vec<Site>,
    taken: Vec<bool>,
    site_grid: Grid,
    triangles: Delaunay,
}

/// A place predicted beyond an open edge of a good triangle.
struct Prediction {
    position: DVec2,
    depth: usize,
    /// The edge's ends.
    edge: (usize, usize),
}

impl<'a> Growth<'a> {
    fn new(peaks: &'a [Peak], pitch: &'a PitchField, seeds: &[bool], size: DVec2) -> Self {
        let positions: Vec<DVec2> = peaks.iter().map(|p| p.position).collect();
        let edge = pitch.at(size / 2.0);
        let mut growth = Self {
            peaks,
            peak_grid: Grid::of(&positions, edge),
            pitch,
            size,
            sites: Vec::new(),
            taken: vec![false; peaks.len()],
            site_grid: Grid::new(edge),
            triangles: Delaunay::default(),
        };
        for index in (0..peaks.len()).filter(|i| seeds[*i]) {
            growth.take(index);
        }
        growth
    }

    fn take(&mut self, peak: usize) {
        self.taken[peak] = true;
        let Peak { position, clear, .. } = self.peaks[peak];
        self.add(Site { clear, ..Site::new(position, 0) });
    }

    fn add(&mut self, site: Site) {
        self.site_grid.insert(site.position, self.sites.len());
        self.triangles.add(site.position);
        self.sites.push(site);
    }

    fn predictions(&self) -> Vec<Prediction> {
        let edges = self.triangles.unsorted_edges();
        let mut found: Vec<Prediction> = edges.filter_map(|edge| self.prediction(&edge)).collect();
        // What was found first has the first word.
        found.sort_unstable_by_key(|prediction| prediction.edge);
        found
    }

    fn prediction(&self, edge: &Edge) -> Option<Prediction> {
        let (a, b) = edge.ends;
        let mut good = edge.across().filter(|c| self.is_good(a, b, *c));
        let (Some(third), None) = (good.next(), good.next()) else { return None };
        let [a, b] = [a, b].map(|end| self.sites[end]);
        let position = a.position + b.position - self.sites[third].position;
        self.is_free(position).then_some(Prediction {
            position,
            depth: a.depth.max(b.depth),
            edge: edge.ends,
        })
    }

    fn is_good(&self, a: usize, b: usize, c: usize) -> bool {
        let [a, b, c] = [a, b, c].map(|i| self.sites[i].position);
        let pitch = self.pitch.at((a + b + c) / 3.0);
        [a.distance(b), b.distance(c), c.distance(a)]
            .iter()
            .all(|d| (GOOD_EDGE.0 * pitch..=GOOD_EDGE.1 * pitch).contains(d))
    }

    fn is_free(&self, position: DVec2) -> bool {
        let pitch = self.pitch.at(position);
        let margin = DVec2::splat(0.6 * pitch);
        let inside = position.cmpge(-margin).all() && position.cmple(self.size + margin).all();
        inside && self.site_grid.nearest(position, CLOSEST * pitch).is_none()
    }

    /// Takes every free blob at a predicted place; whether there was any.
    fn accept_seen(&mut self) -> bool {
        let before = self.sites.len();
        for prediction in self.predictions() {
            let reach = SNAP * self.pitch.at(prediction.position);
            let nearest = self.peak_grid.nearest(prediction.position, reach);
            if let Some((peak, _)) = nearest
                && !self.taken[peak]
                && self.is_free(self.peaks[peak].position)
            {
                self.take(peak);
            }
        }
        self.sites.len() > before
    }

    /// Takes every clear blob amid the comb, wherever the lattice would have it; whether there was any. Among caps the lattice
    /// cannot be followed from one open cell to the next, and what it predicts would keep the cells themselves out.
    fn accept_clear(&mut self) -> bool {
        let before = self.sites.len();
        for (index, peak) in self.peaks.iter().enumerate() {
            let is_new = peak.clear && !self.taken[index] && self.is_free(peak.position);
            if is_new && self.is_amid(peak.position) {
                self.take(index);
            }
        }
        while self.accept_seen() {}
        self.sites.len() > before
    }

    /// Whether places of the lattice lie near in all directions but one, so that no frame, leaf or sky is meant.
    fn is_amid(&self, position: DVec2) -> bool {
        let reach = AMID_REACH * self.pitch.at(position);
        let mut held = [false; 6];
        for (other, _) in self.site_grid.within(position, reach) {
            let angle = (self.sites[other].position - position).to_angle().rem_euclid(TAU);
            held[pixel(angle / TAU * 6.0, 6)] = true;
        }
        held.iter().filter(|held| **held).count() >= 5
    }

    /// Adds a layer of inferred cells around all sites; whether there was any to add.
    fn infer_layer(&mut self, layer: usize) -> bool {
        let predictions = self.predictions();
        let positions: Vec<DVec2> = predictions.iter().map(|p| p.position).collect();
        let grid = Grid::of(&positions, self.pitch.at(self.size / 2.0));
        let mut merged = Vec::new();
        let mut used = vec![false; predictions.len()];
        for (index, prediction) in predictions.iter().enumerate() {
            if used[index] || prediction.depth >= INFERRED_LAYERS {
                continue;
            }
            let reach = CLOSEST * self.pitch.at(prediction.position);
            let mut sum = DVec2::ZERO;
            let mut count = 0.0;
            for (other, _) in grid.within(prediction.position, reach) {
                if !used[other] {
                    used[other] = true;
                    sum += positions[other];
                    count += 1.0;
                }
            }
            merged.push(sum / count);
        }
        let before = self.sites.len();
        for position in merged {
            if self.is_free(position) {
                self.add(Site::new(position, layer));
            }
        }
        self.sites.len() > before
    }

    /// Moves inferred cells towards the mean of their neighbours, so that lattices that grew from two sides meet evenly.
    fn relax(&mut self) {
        let around = self.around_inferred();
        for _ in 0..TRIANGULATIONS {
            let points: Vec<DVec2> = around.iter().map(|site| self.sites[*site].position).collect();
            let neighbours = Delaunay::of(&points).neighbours();
            let inferred: Vec<usize> =
                (0..around.len()).filter(|place| self.sites[around[*place]].depth > 0).collect();
            for _ in 0..MOVES {
                let at = |place: usize| self.sites[around[place]].position;
                let moved: Vec<Option<DVec2>> = inferred
                    .iter()
                    .map(|place| {
                        let reach = GOOD_EDGE.1 * self.pitch.at(at(*place));
                        let near = neighbours[*place].iter().map(|n| at(*n));
                        let near: Vec<DVec2> = near.filter(|p| p.distance(at(*place)) < reach).collect();
                        (near.len() >= 5).then(|| near.iter().sum::<DVec2>() / near.len() as f64)
                    })
                    .collect();
                for (place, position) in inferred.iter().zip(moved) {
                    let site = &mut self.sites[around[*place]];
                    site.position = position.unwrap_or(site.position);
                }
            }
        }
    }

    /// The inferred cells and those so near to one that they may tell its neighbours.
    fn around_inferred(&self) -> Vec<usize> {
        let mut near = vec![false; self.sites.len()];
        for site in self.sites.iter().filter(|site| site.depth > 0) {
            let reach = AROUND * self.pitch.at(site.position);
            self.site_grid.within(site.position, reach).for_each(|(other, _)| near[other] = true);
        }
        (0..near.len()).filter(|site| near[*site]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice with a hole, in which and beyond which a blob lies where no cell of the lattice would be.
    #[test]
    fn a_clear_blob_amid_the_comb_is_a_cell_wherever_it_lies() {
        let pitch = 10.0;
        let place = |column: usize, row: usize| {
            let shift = if row.is_multiple_of(2) { 0.0 } else { 0.5 };
            DVec2::new(column as f64 + shift, row as f64 * 0.75_f64.sqrt()) * pitch + 40.0
        };
        let all = || (0..15).flat_map(|row| (0..15).map(move |column| (column, row)));
        let middle = place(7, 7);
        let lattice = all().map(|(column, row)| place(column, row));
        let open: Vec<DVec2> = lattice.filter(|p| p.distance(middle) > 2.2 * pitch).collect();
        // Half a pitch off the lattice: farther than a prediction reaches.
        let amid = middle + DVec2::new(0.5, 0.3) * pitch;
        let beyond = place(17, 7) + DVec2::new(0.0, 5.0);
        for clear in [true, false] {
            let peak = |position: DVec2, clear| Peak { position, strength: 1.0, clear };
            let mut peaks: Vec<Peak> = open.iter().map(|p| peak(*p, false)).collect();
            peaks.extend([amid, beyond].map(|p| peak(p, clear)));
            let points: Vec<DVec2> = peaks.iter().map(|p| p.position).collect();
            let seeds: Vec<bool> =
                hexagonal_neighbourhoods(&points, pitch).iter().map(Option::is_some).collect();
            let size = DVec2::new(260.0, 220.0);
            let sites = grow(&peaks, &PitchField::new(size, pitch, &[]), &seeds, size, Layers::Inferred);
            let is_seen = |at: DVec2| sites.iter().any(|s| s.is_seen() && s.position.distance(at) < 1e-9);
            assert_eq!(is_seen(amid), clear);
            assert!(!is_seen(beyond));
            assert!(open.iter().all(|p| is_seen(*p)));
        }
    }
}
