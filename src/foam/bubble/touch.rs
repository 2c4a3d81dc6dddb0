//! A bubble that meets itself: round the period, round a neck, or at its antipode.

use super::{Annulus, NoBubble};
use crate::foam::complex::{Complex, Places};
use glam::{DVec3, IVec3};

/// Refuses a bubble whose film comes nearer to itself than its columns lie apart, or that is as wide as a period.
pub(super) fn refuse(
    complex: &Complex,
    places: &Places,
    mesh: Annulus,
    centre: DVec3,
) -> Result<(), NoBubble> {
    let waist: Vec<DVec3> = mesh.waist().map(|node| places[node]).collect();
    let count = waist.len();
    let spacing = (0..count).map(|i| waist[i].distance(waist[(i + 1) % count])).fold(0.0, f64::max);
    for shift in neighbours() {
        let period = complex.period.translation(shift);
        if shift != IVec3::ZERO && period == DVec3::ZERO {
            continue;
        }
        for (i, &p) in waist.iter().enumerate() {
            for (j, &q) in waist.iter().enumerate() {
                let far_round = i.abs_diff(j).min(count - i.abs_diff(j)) > count / 4;
                // On the bubble itself the way through it separates opposite columns; images must not overlap at all.
                let apart = shift != IVec3::ZERO || far_round;
                if apart && (p - q - period).length() < 0.75 * spacing {
                    return Err(NoBubble::Touches { place: centre });
                }
            }
        }
        let direction = period.normalize_or_zero();
        let along = waist.iter().map(|p| p.dot(direction));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if shift != IVec3::ZERO && high - low >= period.length() {
            return Err(NoBubble::Touches { place: centre });
        }
    }
    Ok(())
}

fn neighbours() -> impl Iterator<Item = IVec3> {
    (0..27).map(|i| IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1))
}
