//! Exact Euclidean distance to the nearest pixel of a set.
//!
//! The lower envelope of parabolas along columns, then along rows (Felzenszwalb and Huttenlocher, "Distance transforms of
//! sampled functions", Theory of Computing 8, 2012).

use super::plane::{Plane, narrow};
use rayon::prelude::*;

/// Distance of every pixel to the nearest pixel where `inside` holds; the raster's diagonal where there is none.
pub(crate) fn to_nearest(plane: &Plane, inside: impl Fn(f32) -> bool + Sync) -> Plane {
    let (width, height) = (plane.width(), plane.height());
    let far = (width * width + height * height) as f64;
    let columns: Vec<Vec<f64>> = (0..width)
        .into_par_iter()
        .map(|x| {
            let start: Vec<f64> =
                (0..height).map(|y| if inside(plane.at(x, y)) { 0.0 } else { far }).collect();
            envelope(&start)
        })
        .collect();
    let rows: Vec<Vec<f64>> = (0..height)
        .into_par_iter()
        .map(|y| envelope(&columns.iter().map(|column| column[y]).collect::<Vec<f64>>()))
        .collect();
    Plane::from_fn(width, height, |x, y| narrow(rows[y][x].min(far).sqrt()))
}

/// For each place, the least of `values[k] + (place − k)²`.
fn envelope(values: &[f64]) -> Vec<f64> {
    let meet = |a: usize, b: usize| {
        let (p, q) = (a as f64, b as f64);
        ((values[b] + q * q) - (values[a] + p * p)) / (2.0 * (q - p))
    };
    let mut lowest: Vec<(usize, f64)> = Vec::with_capacity(values.len());
    for place in 0..values.len() {
        while let Some((last, from)) = lowest.last()
            && meet(*last, place) <= *from
        {
            lowest.pop();
        }
        let from = lowest.last().map_or(f64::NEG_INFINITY, |(last, _)| meet(*last, place));
        lowest.push((place, from));
    }
    let mut current = 0;
    (0..values.len())
        .map(|place| {
            let here = place as f64;
            while current + 1 < lowest.len() && lowest[current + 1].1 < here {
                current += 1;
            }
            let parabola = lowest[current].0;
            values[parabola] + (here - parabola as f64).powi(2)
        })
        .collect()
}
