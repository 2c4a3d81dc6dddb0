//! What cells cover of the walls: the lines round each patch.

use super::{
    FreeFoam, Stacking,
    division::{CornerImage, Rim, open_ends},
    films::side_between,
};
use crate::{
    foam::{complex::NodeImage, convert::as_f64},
    surface::{Gap, WallSide},
};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// A film's edge on a wall, seen from one of its cells, or the line in which a cell ends on a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct WallLine {
    /// The cell behind it; none at a plane.
    pub neighbour: Option<usize>,
    /// Which image of that cell, in periods.
    pub shift: IVec3,
    /// The nodes' places from its start to its end, both included, in the frame of the cell.
    pub points: Vec<DVec3>,
}

/// Pieces of a line in which a cell ends on a plane.
const CUT_PIECES: usize = 4;

impl FreeFoam {
    /// The lines round what each cell covers of a wall, in their order: counter-clockwise seen against the wall's normal
    /// `∇Φ`. Empty for a cell that does not touch it.
    #[must_use]
    pub fn outlines(&self, gap: &Gap, wall: WallSide) -> Vec<Vec<WallLine>> {
        self.division.rims(wall).iter().map(|rim| self.outline(gap, wall, rim)).collect()
    }

    fn outline(&self, gap: &Gap, wall: WallSide, rim: &[Rim]) -> Vec<WallLine> {
        let from: BTreeMap<CornerImage, &Rim> = rim.iter().map(|edge| (edge.from, edge)).collect();
        let mut lines = Vec::with_capacity(rim.len() + 1);
        let ends = open_ends(rim);
        let mut next = ends.map_or(rim.first(), |[start, _]| from.get(&start).copied());
        while let Some(edge) = next.filter(|_| lines.len() < rim.len()) {
            let Rim { neighbour, shift, .. } = *edge;
            let points = self.line(edge.from, edge.to);
            lines.push(WallLine { neighbour: Some(neighbour), shift, points });
            next = from.get(&edge.to).copied();
        }
        if let Some([start, end]) = ends {
            let points = self.cut_line(gap, wall, end, start);
            lines.push(WallLine { neighbour: None, shift: IVec3::ZERO, points });
        }
        lines
    }

    /// The line on a wall in which a cell ends on a plane, or on two and their corner.
    fn cut_line(&self, gap: &Gap, wall: WallSide, from: CornerImage, to: CornerImage) -> Vec<DVec3> {
        let division = &self.division;
        let [a, b] = [from, to].map(|image| (division.place(image), division.corners[image.corner].plane));
        let on = |plane, place| division.retracted(gap, Some(wall), plane, place);
        let straight = |from: DVec3, to: DVec3, plane| {
            (0..=CUT_PIECES).map(move |at| on(plane, from.lerp(to, as_f64(at) / as_f64(CUT_PIECES))))
        };
        if a.1 == b.1 {
            return straight(a.0, b.0, a.1).collect();
        }
        let midst = a.0.midpoint(b.0);
        let corner = on(b.1, a.1.map_or(midst, |plane| division.planes[plane].nearest_to(midst)));
        straight(a.0, corner, a.1).chain(straight(corner, b.0, b.1).skip(1)).collect()
    }

    /// The places along an edge on a wall.
    fn line(&self, from: CornerImage, to: CornerImage) -> Vec<DVec3> {
        let (side, forward) = side_between(from, to);
        let frame = IVec3::from_array(if forward { from.shift } else { to.shift });
        let nodes = self.films.wall_edges.get(&side);
        let place =
            |image: &NodeImage| self.place(NodeImage { node: image.node, shift: image.shift + frame });
        let mut points: Vec<DVec3> = nodes.into_iter().flatten().map(place).collect();
        if !forward {
            points.reverse();
        }
        points
    }

    /// How many cells touch other cells on one wall than on the other; of two layers none are counted.
    #[must_use]
    pub fn twisted_cells(&self) -> usize {
        if self.division.stacking != Stacking::One {
            return 0;
        }
        let around = |rim: &[Rim]| {
            let mut around: Vec<(usize, [i32; 3])> =
                rim.iter().map(|edge| (edge.neighbour, edge.shift.to_array())).collect();
            around.sort_unstable();
            around
        };
        let [lower, upper] = WallSide::BOTH.map(|wall| self.division.rims(wall));
        lower.iter().zip(&upper).filter(|(low, high)| around(low) != around(high)).count()
    }
}
