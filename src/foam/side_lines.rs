//! The lines that a relaxed film draws on the walls and between them, as a cell sees them.

use super::{
    network::{CellId, HalfEdgeId},
    relax::State,
};
use glam::DVec3;

/// Points of a line from one node of its quadratic elements to the next but one.
const PER_ELEMENT: u32 = 4;

impl State {
    /// The number of node rows from wall to wall, the lower wall's first.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.strips.rows()
    }

    /// A side of a cell at one height: row 0 lies on the lower wall. Counter-clockwise round the cell as seen from the upper
    /// wall, at the cell's stored place, on the curve of the quadratic elements; the end, which is the next side's start, is
    /// left out.
    #[must_use]
    pub fn side_line(&self, side: HalfEdgeId, row: usize) -> Vec<DVec3> {
        let nodes = self.side_nodes(side, row);
        let mut line = Vec::new();
        for element in nodes.windows(3).step_by(2) {
            for step in 0..PER_ELEMENT {
                let t = f64::from(step) / f64::from(PER_ELEMENT);
                // Lagrange's parabola through nodes at 0, ½ and 1.
                let weights = [(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)];
                line.push(weights.iter().zip(element).map(|(weight, &node)| *weight * node).sum());
            }
        }
        line
    }

    /// The outline of a cell at one height, at the cell's stored place, counter-clockwise as seen from the upper wall.
    #[must_use]
    pub fn outline_at(&self, cell: CellId, row: usize) -> Vec<DVec3> {
        self.network.ring(cell).flat_map(|side| self.side_line(side, row)).collect()
    }

    /// The nodes of a side from its origin to its target, both included, at the stored place of the cell on its left.
    fn side_nodes(&self, side: HalfEdgeId, row: usize) -> Vec<DVec3> {
        let network = &self.network;
        let edge = side.edge();
        let period = network.period();
        let mut nodes: Vec<DVec3> = (0..self.strips.columns())
            .map(|column| {
                let image = self.strips.film_node(network, edge, column, row);
                self.places[image.node] + period.translation(image.shift)
            })
            .collect();
        let [first, _] = edge.half_edges();
        // Nodes are given in the frame of the first half-edge's origin.
        let mut origin_shift = network.cell_shift(side);
        if side != first {
            nodes.reverse();
            origin_shift += network.target_shift(first);
        }
        let offset = period.translation(origin_shift);
        nodes.into_iter().map(|node| node - offset).collect()
    }
}
