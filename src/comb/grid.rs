//! Points in square bins, for neighbours within a distance.

use glam::DVec2;
use std::collections::BTreeMap;

/// Points in square bins.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    edge: f64,
    bins: BTreeMap<(i64, i64), Vec<(DVec2, usize)>>,
}

impl Grid {
    /// An empty grid whose bins have the given edge; queries cost least when their radius is about that.
    pub(crate) const fn new(edge: f64) -> Self {
        Self { edge, bins: BTreeMap::new() }
    }

    /// A grid of points, each with its place in `points`.
    pub(crate) fn of(points: &[DVec2], edge: f64) -> Self {
        let mut grid = Self::new(edge);
        for (index, point) in points.iter().enumerate() {
            grid.insert(*point, index);
        }
        grid
    }

    pub(crate) fn insert(&mut self, point: DVec2, index: usize) {
        let (column, row) = self.bin(point);
        self.bins.entry((row, column)).or_default().push((point, index));
    }

    /// Indices and squared distances of the points within `radius`.
    pub(crate) fn within(&self, centre: DVec2, radius: f64) -> impl Iterator<Item = (usize, f64)> {
        let low = self.bin(centre - DVec2::splat(radius));
        let high = self.bin(centre + DVec2::splat(radius));
        (low.1..=high.1)
            .flat_map(move |row| self.bins.range((row, low.0)..=(row, high.0)))
            .flat_map(|(_, points)| points)
            .map(move |(point, index)| (*index, point.distance_squared(centre)))
            .filter(move |(_, squared)| *squared <= radius * radius)
    }

    /// The nearest point within `radius`, by index and distance.
    pub(crate) fn nearest(&self, centre: DVec2, radius: f64) -> Option<(usize, f64)> {
        self.within(centre, radius)
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
            .map(|(index, squared)| (index, squared.sqrt()))
    }

    /// Bin of a point as (column, row).
    #[expect(clippy::cast_possible_truncation, reason = "floor of a pixel coordinate in bins")]
    fn bin(&self, point: DVec2) -> (i64, i64) {
        ((point.x / self.edge).floor() as i64, (point.y / self.edge).floor() as i64)
    }
}
