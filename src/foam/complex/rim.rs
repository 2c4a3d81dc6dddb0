//! The lines in which cells end on the planes that cut the gap off. They carry no film and weigh nothing: they follow the
//! films that end there, and close the outlines of cells for pictures and lengths.

use super::{
    Motion, NoExtrusion, Places,
    strips::{Strips, real},
};
use crate::{
    foam::network::{EdgeId, Network},
    surface::{CutPlane, Gap},
};
use glam::DVec3;

impl Strips {
    /// The nodes of a line keep their place between the two films that end there.
    pub(super) fn rim_motion(self, network: &Network, edge: EdgeId, column: usize, row: usize) -> Motion {
        let last = self.columns() - 1;
        let part = real(column) / real(last);
        let node = |column| self.film_node(network, edge, column, row).node;
        Motion::Inner(vec![(node(0), 1.0 - part), (node(last), part)])
    }

    /// Lays the line of a rim edge from film to film, round the corner if they end on two planes.
    pub(super) fn lay_rim(
        self,
        network: &Network,
        gap: &Gap,
        edge: EdgeId,
        places: &mut Places,
    ) -> Result<(), NoExtrusion> {
        let side = edge.half_edges()[0];
        let ends = [network.origin(side), network.target(side)];
        let plane = |end| network.plane_of(end).map(|place| network.planes()[place]);
        let [Some(first), Some(second)] = ends.map(plane) else { return Ok(()) };
        let far = network.period().translation(network.target_shift(side));
        let middle_row = self.rows() / 2;
        let start = places[self.border_node(ends[0], middle_row)];
        let end = places[self.border_node(ends[1], middle_row)] + far;
        let level = 0.5 * (gap.middle().value(start) + gap.middle().value(end));
        let on = |p: DVec3, planes: &[CutPlane]| {
            let onto_planes = |p: DVec3| planes.iter().fold(p, |p, plane| plane.nearest_to(p));
            gap.middle().project(onto_planes(p), level).map(onto_planes).map_err(|_| NoExtrusion { place: p })
        };
        let corner = if first == second { None } else { Some(on(0.5 * (start + end), &[first, second])?) };
        let last = self.columns() - 1;
        for column in 1..last {
            let part = real(column) / real(last);
            let (from, to, part, plane) = match corner {
                None => (start, end, part, first),
                Some(corner) if part <= 0.5 => (start, corner, 2.0 * part, first),
                Some(corner) => (corner, end, 2.0 * part - 1.0, second),
            };
            let through = self.straight_column(gap, on(from.lerp(to, part), &[plane])?)?;
            for (row, place) in through.into_iter().enumerate() {
                places[self.film_node(network, edge, column, row).node] = plane.nearest_to(place);
            }
        }
        Ok(())
    }
}
