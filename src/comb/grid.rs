//! Points in square bins, for neighbours within a distance.

use glam::{DVec2, I64Vec2};

/// Bins that a grid is widened by on every side when a point lies outside.
const SPARE: i64 = 4;

/// No grid has more bins: a cell at the rim of an unbounded tessellation can lie anywhere.
const MOST_BINS: i64 = 1 << 22;

/// Columns and rows end here, so that sums of them do not overflow.
const FARTHEST: f64 = 1e12;

/// Points in square bins.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    edge: f64,
    /// The first bin's column and row, and how many of each there are.
    low: I64Vec2,
    size: I64Vec2,
    /// Row by row.
    bins: Vec<Vec<(DVec2, usize)>>,
    /// Points too far out for the bins; a query looks at each of them.
    strays: Vec<(DVec2, usize)>,
}

impl Grid {
    /// An empty grid whose bins have the given edge; queries cost least when their radius is about that.
    pub(crate) const fn new(edge: f64) -> Self {
        Self { edge, low: I64Vec2::ZERO, size: I64Vec2::ZERO, bins: Vec::new(), strays: Vec::new() }
    }

    /// A grid of points, each with its place in `points`.
    pub(crate) fn of(points: &[DVec2], edge: f64) -> Self {
        let mut grid = Self::new(edge);
        if let Some([low, high]) = bulk(points) {
            grid.widen(grid.bin(low), grid.bin(high));
        }
        for (index, point) in points.iter().enumerate() {
            grid.insert(*point, index);
        }
        grid
    }

    pub(crate) fn insert(&mut self, point: DVec2, index: usize) {
        let bin = self.bin(point);
        if self.place(bin).is_none() {
            self.widen(bin - SPARE, bin + SPARE);
        }
        match self.place(bin) {
            Some(place) => self.bins[place].push((point, index)),
            None => self.strays.push((point, index)),
        }
    }

    /// Indices and squared distances of the points within `radius`.
    pub(crate) fn within(&self, centre: DVec2, radius: f64) -> impl Iterator<Item = (usize, f64)> {
        let low = self.bin(centre - DVec2::splat(radius)).max(self.low);
        let high = self.bin(centre + DVec2::splat(radius)).min(self.low + self.size - 1);
        (low.y..=high.y)
            .flat_map(move |row| (low.x..=high.x).filter_map(move |x| self.place(I64Vec2::new(x, row))))
            .flat_map(|place| &self.bins[place])
            .chain(&self.strays)
            .map(move |(point, index)| (*index, point.distance_squared(centre)))
            .filter(move |(_, squared)| *squared <= radius * radius)
    }

    /// The nearest point within `radius`, by index and distance.
    pub(crate) fn nearest(&self, centre: DVec2, radius: f64) -> Option<(usize, f64)> {
        self.within(centre, radius)
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
            .map(|(index, squared)| (index, squared.sqrt()))
    }

    /// Column and row of a point's bin; all that lies farther out than [`FARTHEST`] shares its bins.
    fn bin(&self, point: DVec2) -> I64Vec2 {
        let farthest = DVec2::splat(FARTHEST);
        (point / self.edge).floor().clamp(-farthest, farthest).as_i64vec2()
    }

    /// Where a bin is stored.
    fn place(&self, bin: I64Vec2) -> Option<usize> {
        let at = bin - self.low;
        let inside = at.cmpge(I64Vec2::ZERO).all() && at.cmplt(self.size).all();
        inside.then_some(at).and_then(|at| usize::try_from(at.y * self.size.x + at.x).ok())
    }

    /// Makes room for the bins from `low` to `high`, unless these are too many.
    fn widen(&mut self, low: I64Vec2, high: I64Vec2) {
        let (low, end) = if self.bins.is_empty() {
            (low, high + 1)
        } else {
            (low.min(self.low), (high + 1).max(self.low + self.size))
        };
        let count = (end - low).x.saturating_mul((end - low).y);
        let Some(count) = usize::try_from(count).ok().filter(|_| count <= MOST_BINS) else { return };
        let filled = std::mem::take(&mut self.bins);
        (self.low, self.size) = (low, end - low);
        self.bins = vec![Vec::new(); count];
        for (point, index) in filled.into_iter().flatten() {
            if let Some(place) = self.place(self.bin(point)) {
                self.bins[place].push((point, index));
            }
        }
    }
}

/// A box that holds all points but those far from most: its sides reach three times the distance of the quartiles beyond
/// these.
fn bulk(points: &[DVec2]) -> Option<[DVec2; 2]> {
    let side = |axis: fn(&DVec2) -> f64| {
        let mut sorted: Vec<f64> = points.iter().map(axis).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let [first, last] = [*sorted.first()?, *sorted.last()?];
        let [lower, upper] = [sorted[sorted.len() / 4], sorted[3 * sorted.len() / 4]];
        let reach = 3.0 * (upper - lower);
        Some([first.max(lower - reach), last.min(upper + reach)])
    };
    let ([left, right], [top, bottom]) = (side(|p| p.x)?, side(|p| p.y)?);
    Some([DVec2::new(left, top), DVec2::new(right, bottom)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_found_wherever_it_was_put() {
        let spiral = |k: usize| DVec2::from_angle(k as f64) * k as f64 * 0.7;
        let mut points: Vec<DVec2> = (0..60).map(spiral).collect();
        points.push(DVec2::new(-3e9, 2e12));
        let mut grown = Grid::new(3.0);
        points.iter().enumerate().for_each(|(index, point)| grown.insert(*point, index));
        for grid in [grown, Grid::of(&points, 3.0)] {
            for (radius, centre) in [(2.0, DVec2::ZERO), (9.0, spiral(31)), (200.0, DVec2::X)] {
                let mut found: Vec<usize> = grid.within(centre, radius).map(|(index, _)| index).collect();
                found.sort_unstable();
                let near = |k: &usize| points[*k].distance(centre) <= radius;
                assert_eq!(found, (0..61).filter(near).collect::<Vec<usize>>());
            }
            assert_eq!(grid.nearest(spiral(40) + 0.1, 5.0).map(|(index, _)| index), Some(40));
            assert_eq!(grid.nearest(DVec2::splat(1e4), 5.0), None);
            assert_eq!(grid.nearest(DVec2::new(-3e9, 2e12), 5.0), Some((60, 0.0)));
        }
    }
}
