//! The film of a lone bubble: one strip from wall to wall, closed round a place.

use super::{Chart, NoBubble};
use crate::{
    foam::{
        complex::{
            Complex, Element, Film, Motion, Node, NodeId, NodeImage, Places, Region, RegionId, RegionImage,
            RegionKind, Shape, WallId,
        },
        convert::as_f64,
    },
    index::{Id, IndexVec},
    surface::Gap,
};
use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How finely the film is meshed, in biquadratic elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Annulus {
    /// Elements round the bubble.
    pub around: usize,
    /// Elements from wall to wall.
    pub through: usize,
}

/// The region of the bubble.
const INSIDE: usize = 0;

impl Annulus {
    fn rows(self) -> usize {
        2 * self.through + 1
    }

    fn columns(self) -> usize {
        2 * self.around
    }

    /// The node of a column (in anticlockwise order seen from the upper wall) and a row (0 on the lower wall).
    #[must_use]
    pub fn node(self, column: usize, row: usize) -> NodeId {
        NodeId::from_index(column % self.columns() * self.rows() + row)
    }

    /// The nodes in mid-gap, in order.
    pub fn waist(self) -> impl Iterator<Item = NodeId> {
        (0..self.columns()).map(move |column| self.node(column, self.through))
    }

    /// The complex: region 0 is the bubble, region 1 the open air. No node bounds several films, so each moves along the
    /// film's normal only.
    #[must_use]
    pub fn complex(self, gap: &Gap, anchor: DVec3) -> Complex {
        let rows = self.rows();
        let walls: IndexVec<WallId, _> = gap.walls().to_vec().into();
        let nodes = (0..self.columns() * rows)
            .map(|at| Node { walls: self.walls_of(at % rows), motion: Motion::Inner(Vec::new()) })
            .collect();
        let image = |node| NodeImage { node, shift: IVec3::ZERO };
        let element = |i: usize, j: usize| Element {
            shape: Shape::Quad9,
            nodes: (0..9).map(|at| image(self.node(2 * i + at % 3, 2 * j + at / 3))).collect(),
        };
        let elements = (0..self.through).flat_map(|j| (0..self.around).map(move |i| element(i, j))).collect();
        let side = |index| RegionImage { region: RegionId::from_index(index), shift: IVec3::ZERO };
        let film = Film { front: side(1), back: side(INSIDE), tension: 1.0, elements };
        let region = |kind| Region { kind, anchor };
        Complex {
            period: gap.middle().period(),
            walls,
            regions: vec![region(RegionKind::Cell), region(RegionKind::Open)].into(),
            nodes,
            films: vec![film].into(),
        }
    }

    fn walls_of(self, row: usize) -> Vec<WallId> {
        match row {
            0 => vec![WallId::from_index(0)],
            row if row + 1 == self.rows() => vec![WallId::from_index(1)],
            _ => Vec::new(),
        }
    }

    /// A round bubble: straight columns at the distance `radius` along the surface, and the directions across the film in
    /// which the nodes move.
    ///
    /// # Errors
    /// [`NoBubble::Wide`] where a wall is lost.
    pub fn round(self, chart: &Chart<'_>, radius: f64) -> Result<(Places, Places), NoBubble> {
        let mut places = Places::from_elem(DVec3::ZERO, self.columns() * self.rows());
        let mut directions = places.clone();
        for column in 0..self.columns() {
            let angle = TAU * as_f64(column) / as_f64(self.columns());
            let (foot, heading) = chart.walk(angle, radius)?;
            let [low, high] = chart.column(foot)?;
            let up = (high - low).normalize();
            let outward = (heading - heading.dot(up) * up).normalize();
            for row in 0..self.rows() {
                let node = self.node(column, row);
                places[node] = low.lerp(high, as_f64(row) / as_f64(self.rows() - 1));
                directions[node] = outward;
            }
        }
        Ok((places, directions))
    }
}
