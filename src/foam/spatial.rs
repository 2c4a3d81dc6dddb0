//! Points in bins: all images of all points within a radius, at a cost that does not depend on their number.
//!
//! Linked cell lists (Allen and Tildesley, *Computer Simulation of Liquids*, §5.3): the primary box is cut into bins, each
//! bin holds a linked list. [`NearList`] is a Verlet list made from them (ibid., §5.3.1): the neighbours of every point out
//! to a margin, good until a point has moved by a share of it, so that most steps of a moving system search nothing.

use super::{
    convert::whole,
    domain::{Axis, Domain, Image},
};
use crate::index::checked_u32;
use glam::DVec3;
use std::collections::BTreeMap;

const NONE: u32 = u32::MAX;

/// At most this many bins along an axis, so that a sparse set of points in a large box costs no memory.
const MOST_BINS: f64 = 160.0;

/// Points of a [`Domain`] in bins.
#[derive(Clone, Debug)]
pub struct Bins {
    domain: Domain,
    counts: [i32; 3],
    size: DVec3,
    first: Vec<u32>,
    next: Vec<u32>,
    points: Vec<DVec3>,
}

impl Bins {
    /// Puts `points` (inside the primary box) into bins about `width` wide: best the usual radius of a query.
    #[must_use]
    pub fn new(domain: &Domain, width: f64, points: &[DVec3]) -> Self {
        let extent = domain.extent();
        let counts = extent.to_array().map(|length| whole((length / width).floor().clamp(1.0, MOST_BINS)));
        let size = extent / DVec3::new(counts[0].into(), counts[1].into(), counts[2].into());
        let total = counts.iter().map(|&count| usize::try_from(count).unwrap_or(1)).product();
        let mut bins = Self {
            domain: *domain,
            counts,
            size,
            first: vec![NONE; total],
            next: vec![NONE; points.len()],
            points: points.to_vec(),
        };
        for index in 0..points.len() {
            bins.link(index);
        }
        bins
    }

    /// The points, inside the primary box.
    #[must_use]
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Calls `visit` with the index, image and place of every image of every point within `radius` of `centre`.
    ///
    /// `centre` lies inside the primary box. Reflections are included up to one per wall axis and end, which reaches as
    /// far as the walls are apart; translations have no limit.
    pub fn for_each_near(&self, centre: DVec3, radius: f64, mut visit: impl FnMut(usize, Image, DVec3)) {
        self.translated(centre, centre, radius, Image::IDENTITY, &mut visit);
        if self.domain.has_walls() {
            for mirror in self.mirrors_near(centre, radius) {
                // A point q near the mirrored centre has its image under the same mirror near the centre.
                self.translated(centre, self.domain.apply(mirror, centre), radius, mirror, &mut visit);
            }
        }
    }

    /// All combinations of one wall per axis that lies within `radius` of `centre`, without the empty one.
    fn mirrors_near(&self, centre: DVec3, radius: f64) -> Vec<Image> {
        let mut mirrors = vec![Image::IDENTITY];
        for (axis, kind) in self.domain.axes.iter().enumerate() {
            let Axis::Walls { low, high } = *kind else { continue };
            let ends = [(0, centre[axis] - low), (1, high - centre[axis])];
            for index in 0..mirrors.len() {
                for (shift, _) in ends.iter().filter(|(_, distance)| *distance <= radius) {
                    let mut mirror = mirrors[index];
                    mirror.mirrored[axis] = true;
                    mirror.shift[axis] = *shift;
                    mirrors.push(mirror);
                }
            }
        }
        mirrors.swap_remove(0);
        mirrors
    }

    /// Visits the points within `radius` of `query`; what is reported is their image under `mirror`, near `centre`.
    fn translated(
        &self,
        centre: DVec3,
        query: DVec3,
        radius: f64,
        mirror: Image,
        visit: &mut impl FnMut(usize, Image, DVec3),
    ) {
        let reach = DVec3::splat(radius);
        let (low, high) = (self.coordinates(query - reach), self.coordinates(query + reach));
        let limit = radius * radius;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let (bin, translation) = self.wrapped([x, y, z]);
                    let offset = self.domain.translation(translation);
                    let mut current = self.first[bin];
                    while current != NONE {
                        let index = current as usize;
                        let near_query = self.points[index] + offset;
                        if near_query.distance_squared(query) <= limit {
                            let image = mirror.after(translation);
                            let place = if mirror == Image::IDENTITY {
                                near_query
                            } else {
                                self.domain.apply(image, self.points[index])
                            };
                            debug_assert!(place.distance(centre) <= radius * (1.0 + 1e-9));
                            visit(index, image, place);
                        }
                        current = self.next[index];
                    }
                }
            }
        }
    }

    /// The bin coordinates of `point`: unbounded along periodic axes, clamped along the others.
    fn coordinates(&self, point: DVec3) -> [i32; 3] {
        let scaled = ((point - self.domain.low()) / self.size).floor();
        let mut result = [whole(scaled.x), whole(scaled.y), whole(scaled.z)];
        for ((coordinate, count), axis) in result.iter_mut().zip(self.counts).zip(&self.domain.axes) {
            if !matches!(axis, Axis::Periodic { .. }) {
                *coordinate = (*coordinate).clamp(0, count - 1);
            }
        }
        result
    }

    /// The bin at unbounded `coordinates`, and the translation that takes it there.
    fn wrapped(&self, coordinates: [i32; 3]) -> (usize, Image) {
        let mut translation = Image::IDENTITY;
        let mut inside = coordinates;
        for axis in 0..3 {
            translation.shift[axis] = coordinates[axis].div_euclid(self.counts[axis]);
            inside[axis] = coordinates[axis].rem_euclid(self.counts[axis]);
        }
        (self.bin(inside), translation)
    }

    fn bin(&self, [x, y, z]: [i32; 3]) -> usize {
        let [nx, ny, _] = self.counts;
        // A point on the upper end of a periodic axis may round into the bin behind the last.
        let clamped = [x, y, z].map(|value| value.max(0));
        let [x, y, z] = [clamped[0].min(nx - 1), clamped[1].min(ny - 1), clamped[2].min(self.counts[2] - 1)];
        usize::try_from((z * ny + y) * nx + x).unwrap_or(0)
    }

    fn link(&mut self, index: usize) {
        let bin = self.bin(self.coordinates(self.points[index]));
        self.next[index] = self.first[bin];
        self.first[bin] = checked_u32(index);
    }
}

/// One entry of a [`NearList`]: a point, in one of its images.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Which point.
    pub index: u32,
    image: u32,
}

/// An image as a map: mirror signs, then an offset.
#[derive(Clone, Copy, Debug)]
struct Affine {
    sign: DVec3,
    offset: DVec3,
}

/// The neighbours of every point, out to a radius of its own.
#[derive(Clone, Debug)]
pub struct NearList {
    starts: Vec<usize>,
    entries: Vec<Near>,
    images: Vec<Affine>,
}

impl NearList {
    /// Lists for each of `points` (inside the primary box) all images of points within `radius(i, j)` of it, except itself.
    ///
    /// `farthest` bounds every radius.
    #[must_use]
    pub fn new(
        domain: &Domain,
        points: &[DVec3],
        farthest: f64,
        radius: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let bins = Bins::new(domain, 0.5 * farthest, points);
        let mut known: BTreeMap<Image, u32> = BTreeMap::new();
        let mut list =
            Self { starts: vec![0], entries: Vec::with_capacity(16 * points.len()), images: Vec::new() };
        for (index, &point) in points.iter().enumerate() {
            bins.for_each_near(point, farthest, |other, image, place| {
                let itself = other == index && image == Image::IDENTITY;
                if itself || place.distance_squared(point) > radius(index, other).powi(2) {
                    return;
                }
                let image = *known.entry(image).or_insert_with(|| {
                    let sign =
                        DVec3::from_array(image.mirrored.map(|mirrored| if mirrored { -1.0 } else { 1.0 }));
                    list.images.push(Affine { sign, offset: domain.apply(image, DVec3::ZERO) });
                    checked_u32(list.images.len() - 1)
                });
                list.entries.push(Near { index: checked_u32(other), image });
            });
            list.starts.push(list.entries.len());
        }
        list
    }

    /// The neighbours of the `index`-th point.
    #[must_use]
    pub fn of(&self, index: usize) -> &[Near] {
        &self.entries[self.starts[index]..self.starts[index + 1]]
    }

    /// Where the image `near` of the point at `point` lies.
    #[must_use]
    pub fn place(&self, near: Near, point: DVec3) -> DVec3 {
        let Affine { sign, offset } = self.images[near.image as usize];
        sign * point + offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use std::collections::BTreeSet;

    fn random_points(domain: &Domain, count: usize) -> Vec<DVec3> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        (0..count)
            .map(|_| domain.low() + domain.extent() * DVec3::new(rng.random(), rng.random(), rng.random()))
            .collect()
    }

    /// Every image of every point, by trying all of them.
    fn by_force(domain: &Domain, points: &[DVec3], centre: DVec3, radius: f64) -> BTreeSet<(usize, Image)> {
        let mut found = BTreeSet::new();
        for (index, &point) in points.iter().enumerate() {
            for code in 0..(7 * 7 * 7 * 8) {
                let shift = [code / 8 % 7 - 3, code / 56 % 7 - 3, code / 392 - 3];
                let mirrored = [code & 1 > 0, code & 2 > 0, code & 4 > 0];
                let allowed = (0..3).all(|axis| match domain.axes[axis] {
                    Axis::Open { .. } => shift[axis] == 0 && !mirrored[axis],
                    Axis::Periodic { .. } => !mirrored[axis],
                    Axis::Walls { .. } => true,
                });
                let image = Image { shift, mirrored };
                if allowed && domain.apply(image, point).distance(centre) <= radius {
                    found.insert((index, image));
                }
            }
        }
        found
    }

    #[test]
    fn finds_what_an_exhaustive_search_finds() {
        let periodic = |length| Axis::Periodic { low: 0.0, length };
        let domains = [
            Domain { axes: [periodic(1.0), periodic(0.8), periodic(1.0)] },
            Domain {
                axes: [
                    periodic(1.0),
                    Axis::Walls { low: 0.1, high: 0.9 },
                    Axis::Walls { low: 0.0, high: 0.5 },
                ],
            },
            Domain {
                axes: [
                    Axis::Open { low: -1.0, high: 0.0 },
                    periodic(1.0),
                    Axis::Open { low: 0.0, high: 1.0 },
                ],
            },
        ];
        for domain in domains {
            let points = random_points(&domain, 40);
            // The last radius exceeds half a period: a point is then found in several images.
            for radius in [0.1, 0.3, 0.45] {
                let bins = Bins::new(&domain, radius, &points);
                for &centre in &points[..10] {
                    let mut found = BTreeSet::new();
                    bins.for_each_near(centre, radius, |index, image, place| {
                        assert!(domain.apply(image, points[index]).distance(place) < 1e-12);
                        assert!(found.insert((index, image)), "an image was visited twice");
                    });
                    assert_eq!(found, by_force(&domain, &points, centre, radius), "radius {radius}");
                }
            }
        }
    }
}
