//! Marker-controlled watershed: every pixel goes to the cell whose marker's flood reaches it first, walls being high.
//!
//! After Meyer's flooding: pixels are visited in order of the height at which the flood reaches them, first come first
//! served among equals, so that a flat top is shared in the middle. Heights are quantised, which makes the queue a row of
//! buckets and the result independent of anything but the input.

use super::plane::{Plane, pixel};
use glam::DVec2;
use std::collections::VecDeque;

/// Heights that are told apart.
const LEVELS: usize = 512;
/// Radius of a marker, in pitches: inside any cell, and wide enough to cover a glint at its centre.
const MARKER_RADIUS: f64 = 0.16;
/// A cell ends this far from its marker, in pitches: corners of a regular cell are at 0.58.
const REACH: f64 = 0.95;

/// Which cell each pixel belongs to.
#[derive(Clone, Debug)]
pub(crate) struct Segmentation {
    /// Width in pixels.
    pub(crate) width: usize,
    /// Height in pixels.
    pub(crate) height: usize,
    /// Index of the marker, or [`Segmentation::NONE`].
    pub(crate) labels: Vec<u32>,
}

impl Segmentation {
    /// The label of pixels that belong to no cell.
    pub(crate) const NONE: u32 = u32::MAX;

    /// Whether a point lies on the raster.
    pub(crate) fn holds(&self, point: DVec2) -> bool {
        let size = DVec2::new(self.width as f64, self.height as f64);
        point.cmpge(DVec2::ZERO).all() && point.cmplt(size).all()
    }

    /// The cell that owns the pixel at a point, if any.
    pub(crate) fn at_point(&self, point: DVec2) -> Option<usize> {
        if !self.holds(point) {
            return None;
        }
        let label = self.at(pixel(point.x, self.width), pixel(point.y, self.height));
        (label != Self::NONE).then_some(label as usize)
    }

    /// Gives every pixel of cell `i` to cell `into[i]`.
    pub(crate) fn relabel(&mut self, into: &[usize]) {
        for label in self.labels.iter_mut().filter(|l| **l != Self::NONE) {
            *label = crate::index::checked_u32(into[*label as usize]);
        }
    }

    /// The label of a pixel.
    pub(crate) fn at(&self, x: usize, y: usize) -> u32 {
        self.labels[y * self.width + x]
    }
}

/// Floods `relief` from discs around the markers; `pitches` are the local pitches of the markers;
/// where `hidden` holds, nothing floods.
pub(crate) fn flood(
    relief: &Plane,
    markers: &[DVec2],
    pitches: &[f64],
    hidden: Option<&[bool]>,
) -> Segmentation {
    let (width, height) = (relief.width(), relief.height());
    let levels = quantised(relief);
    let is_hidden = |index: usize| hidden.is_some_and(|h| h[index]);
    let mut labels = vec![Segmentation::NONE; width * height];
    let mut buckets: Vec<VecDeque<usize>> = vec![VecDeque::new(); LEVELS];
    for (label, (centre, pitch)) in markers.iter().zip(pitches).enumerate() {
        for index in disc(*centre, MARKER_RADIUS * pitch, width, height) {
            if labels[index] == Segmentation::NONE && !is_hidden(index) {
                labels[index] = crate::index::checked_u32(label);
                buckets[0].push_back(index);
            }
        }
    }
    let mut level = 0;
    while level < LEVELS {
        let Some(index) = buckets[level].pop_front() else {
            level += 1;
            continue;
        };
        let label = labels[index];
        let centre = markers[label as usize];
        let reach = REACH * pitches[label as usize];
        for next in beside(index, width, height) {
            let place = DVec2::new((next % width) as f64 + 0.5, (next / width) as f64 + 0.5);
            let free = labels[next] == Segmentation::NONE && !is_hidden(next);
            if free && place.distance_squared(centre) < reach * reach {
                labels[next] = label;
                buckets[usize::from(levels[next]).max(level)].push_back(next);
            }
        }
    }
    Segmentation { width, height, labels }
}

fn quantised(relief: &Plane) -> Vec<u16> {
    let (low, high) = relief
        .data()
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    let range = f64::from(high - low).max(1e-12);
    let top = (LEVELS - 1) as f64;
    let level = |v: &f32| u16::try_from(pixel(f64::from(v - low) / range * top, LEVELS)).unwrap_or(0);
    relief.data().iter().map(level).collect()
}

/// Pixels within `radius` of `centre`; of a centre outside the raster, those that are inside.
pub(crate) fn disc(centre: DVec2, radius: f64, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let rows = pixel(centre.y - radius, height)..=pixel(centre.y + radius, height);
    rows.flat_map(move |y| {
        (pixel(centre.x - radius, width)..=pixel(centre.x + radius, width)).filter_map(move |x| {
            let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            (place.distance_squared(centre) <= radius * radius).then_some(y * width + x)
        })
    })
}

/// The four pixels beside a pixel.
fn beside(index: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (index % width, index / width);
    let left = (x > 0).then(|| index - 1);
    let right = (x + 1 < width).then(|| index + 1);
    let up = (y > 0).then(|| index - width);
    let down = (y + 1 < height).then(|| index + width);
    [up, left, right, down].into_iter().flatten()
}
