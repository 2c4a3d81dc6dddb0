//! Angles at the corners of a foam of free topology.

use super::{Division, FreeFilms, FreeFoam};
use crate::{foam::complex::NodeImage, index::Id};
use glam::DVec3;
use std::collections::BTreeMap;

/// The angle between borders that meet at a corner of a soap foam, acos(−1/3) (J. Plateau, 1873).
#[must_use]
pub fn tetrahedral_angle() -> f64 {
    (-1.0_f64 / 3.0).acos()
}

/// The angles between the borders at every corner inside the gap where four of them meet, six to a corner, in radians.
#[must_use]
pub fn corner_angles(foam: &FreeFoam) -> Vec<f64> {
    angles(&foam.division, &foam.films)
}

fn angles(division: &Division, films: &FreeFilms) -> Vec<f64> {
    let mut ways: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for nodes in films.borders.values() {
        let first = nodes[0].node.index();
        let last = nodes[nodes.len() - 1].node.index();
        ways.entry(first).or_default().push(start_way(films, nodes.iter()));
        ways.entry(last).or_default().push(start_way(films, nodes.iter().rev()));
    }
    // Where a border ends on a plane, four lines meet as well, three of them within the plane.
    ways.iter()
        .filter(|(corner, ways)| division.corners[**corner].is_inside() && ways.len() == 4)
        .flat_map(|(_, ways)| {
            (0..4).flat_map(move |i| (0..i).map(move |j| ways[i].dot(ways[j]).clamp(-1.0, 1.0).acos()))
        })
        .collect()
}

/// The unit tangent at the start of a border: that of its first quadratic piece.
fn start_way<'a>(films: &FreeFilms, mut nodes: impl Iterator<Item = &'a NodeImage>) -> DVec3 {
    let first = nodes.next().copied();
    let place = |image: Option<NodeImage>| {
        image.map_or(DVec3::NAN, |image| films.complex.place(&films.places, image))
    };
    let a = place(first);
    let (b, c) = (place(nodes.next().copied()), place(nodes.next().copied()));
    (4.0 * b - 3.0 * a - c).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foam::{
        free::{Corner, FreeSettings, extruded::taken_over, films::free_films, flip::Moves, open::sides},
        relax::{RelaxSettings, relax},
        seeds::SeedSettings,
        setup::FoamSpace,
        start::start,
    };
    use std::{error::Error, ops::ControlFlow};

    #[test]
    fn corners_on_planes_are_none_of_four_cells() -> Result<(), Box<dyn Error>> {
        let space = FoamSpace::Box { sides: [4.0, 3.0], height: 0.6 };
        let (gap, domain) = (space.gap()?, space.domain()?);
        let started = start(&gap, &domain, &SeedSettings::new(14, 3), &mut |_| ControlFlow::Continue(()))?;
        let settings = RelaxSettings::default();
        let relaxed = relax(started.network, &gap, &settings, &mut |_| ControlFlow::Continue(()))?;
        let spacing = FreeSettings::of(&relaxed.state).spacing;
        let (division, _) = taken_over(&relaxed.state, &gap, 1);
        // A T1 on a wall leaves corners in the midst of the gap: four cells inside, or three cells and a plane.
        let mut found = [0; 2];
        for side in sides(&division).into_keys() {
            let mut moves = Moves::new(&division, &gap, spacing);
            let Some(_) = moves.vanish(side, 0.0) else { continue };
            let (after, _) = moves.finish();
            let on_planes = |corner: &&Corner| corner.wall.is_none() && corner.plane.is_some();
            found[0] += after.inner_corners();
            found[1] += after.corners.iter().filter(on_planes).count();
            assert_eq!(angles(&after, &free_films(&after, &gap, 1)).len(), 6 * after.inner_corners());
        }
        assert!(found[0] > 0 && found[1] > 0, "{found:?}");
        Ok(())
    }
}
