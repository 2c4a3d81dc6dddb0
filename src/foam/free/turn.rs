//! Films that slide round a corner between two open faces: they end on the other face then.

use super::{Division, FreeFoam, films::films_refined, laws::unlawful, relax::Begin};
use crate::surface::{Gap, LevelSet};
use glam::DVec3;

/// A film whose end on one plane lies beyond another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slide {
    /// The film.
    pub(super) polygon: usize,
    /// The plane on which it ends, and that beyond which it does.
    pub(super) planes: [usize; 2],
    /// Where.
    pub(super) place: DVec3,
}

/// A film's end that lies beyond a plane by more than this part of the spacing has slid round a corner.
const SLID: f64 = 0.01;
/// Ends farther from the corner than this part of the spacing do not turn with the one that has slid.
const NEAR: f64 = 0.5;
/// How far from the corner a turned film ends, in spacings.
const NEW_DISTANCE: f64 = 0.06;

/// The first film that has slid round a corner.
pub(super) fn slide(division: &Division, spacing: f64) -> Option<Slide> {
    division.polygons.iter().enumerate().find_map(|(polygon, film)| {
        film.corners.iter().find_map(|image| {
            let corner = division.corners[image.corner];
            let own = corner.plane?;
            let beyond = |plane: &usize| {
                *plane != own && division.planes[*plane].value(corner.place) < -SLID * spacing
            };
            let other = (0..division.planes.len()).find(beyond)?;
            Some(Slide { polygon, planes: [own, other], place: corner.place })
        })
    })
}

/// The foam with a film that has slid round a corner on the other plane. Nothing if none has, or if its end is more than one line
/// from wall to wall beside the corner.
pub(super) fn turned(foam: &FreeFoam, gap: &Gap, spacing: f64) -> Option<Begin> {
    let division = turned_division(&foam.division, gap, spacing)?;
    let films = films_refined(&division, gap, foam.fineness, &foam.films);
    Some(Begin { division, films, fineness: foam.fineness, pressures: foam.pressures.clone() })
}

fn turned_division(division: &Division, gap: &Gap, spacing: f64) -> Option<Division> {
    let Slide { polygon, planes: [own, other], .. } = slide(division, spacing)?;
    let mut turned = division.clone();
    let on_plane = |&corner: &usize| division.corners[corner].plane == Some(own);
    let ends: Vec<usize> =
        division.polygons[polygon].corners.iter().map(|image| image.corner).filter(on_plane).collect();
    if ends.len() != 2 || ends.iter().any(|&end| division.corners[end].wall.is_none()) {
        return None;
    }
    let [own, next] = [own, other].map(|plane| division.planes[plane]);
    for end in ends {
        let corner = &mut turned.corners[end];
        if next.value(corner.place) > NEAR * spacing {
            return None;
        }
        let beside = next.nearest_to(corner.place) + NEW_DISTANCE * spacing * own.inward();
        corner.plane = Some(other);
        corner.place = division.retracted(gap, corner.wall, corner.plane, beside);
    }
    unlawful(&turned).is_empty().then_some(turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        free::{FreeSettings, extruded::taken_over},
        relax::{RelaxSettings, relax},
        seeds::SeedSettings,
        setup::FoamSpace,
        start::start,
    };
    use std::{error::Error, ops::ControlFlow};

    #[test]
    fn a_film_beyond_a_corner_ends_on_the_other_plane() -> Result<(), Box<dyn Error>> {
        let space = FoamSpace::Box { sides: [4.0, 3.0], height: 0.6 };
        let (gap, domain) = (space.gap()?, space.domain()?);
        let started = start(&gap, &domain, &SeedSettings::new(14, 3), &mut |_| ControlFlow::Continue(()))?;
        let settings = RelaxSettings::default();
        let relaxed = relax(started.network, &gap, &settings, &mut |_| ControlFlow::Continue(()))?;
        let spacing = FreeSettings::of(&relaxed.state).spacing;
        let (mut division, _) = taken_over(&relaxed.state, &gap, 1);
        assert!(slide(&division, spacing).is_none() && unlawful(&division).is_empty());

        // The film whose end is next to a corner is pushed past it.
        let (own, other) =
            (0, (1..4).find(|&at| division.planes[0].inward().dot(division.planes[at].inward()).abs() < 0.5));
        let next = division.planes[other.ok_or("no plane across")?];
        let ends: Vec<usize> =
            (0..division.corners.len()).filter(|&c| division.corners[c].plane == Some(own)).collect();
        let nearest =
            ends.iter().map(|&c| next.value(division.corners[c].place)).fold(f64::INFINITY, f64::min);
        let moved: Vec<usize> =
            ends.into_iter().filter(|&c| next.value(division.corners[c].place) < nearest + 1e-6).collect();
        assert_eq!(moved.len(), 2);
        for &corner in &moved {
            division.corners[corner].place -= (nearest + 0.05 * spacing) * next.inward();
        }
        let turned = turned_division(&division, &gap, spacing).ok_or("the film stays")?;
        assert_eq!(slide(&turned, spacing), None);
        for &corner in &moved {
            assert_eq!(turned.corners[corner].plane, other);
            assert!(next.value(turned.corners[corner].place).abs() < 1e-12);
            assert!(division.planes[own].value(turned.corners[corner].place) > 0.0);
        }
        assert_eq!(turned.cut(), division.cut());
        Ok(())
    }
}
