//! The state of a relaxation: what a checkpoint holds.

use crate::{
    foam::{
        complex::{NoExtrusion, Places, RegionId, Strips},
        network::{CellId, EdgeId, Network, VertexId},
        relax::Descent,
        solve::FactorError,
    },
    index::{Id, IndexVec},
    surface::Gap,
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The name and version of the state's JSON form.
pub const STATE_SCHEMA: &str = "combwright.foam-state/1";

/// A foam on its way to equilibrium, complete enough to go on from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    pub(crate) schema: String,
    /// Who touches whom.
    pub network: Network,
    /// How finely the films are meshed.
    pub strips: Strips,
    /// Where the nodes are.
    pub places: Places,
    /// The pressures of the cells, up to a common constant.
    pub pressures: IndexVec<RegionId, f64>,
    /// Each cell's share of the gap's volume; they sum to 1.
    pub shares: IndexVec<CellId, f64>,
    /// Newton steps so far.
    pub steps: usize,
    /// T1s so far.
    pub flips: usize,
    /// How often each edge has flipped: its threshold falls with each time, so that no edge flips back and forth for ever.
    pub flips_of_edge: IndexVec<EdgeId, u32>,
    /// The part of the gap that the films fill so far, about its middle surface: the walls' levels are multiplied by it.
    /// Below 1 while a steep gap is widened, and at the end where it cannot be.
    #[serde(default = "whole")]
    pub part: f64,
}

/// The part that is filled where nothing is said.
const fn whole() -> f64 {
    1.0
}

impl State {
    /// A first state: films extruded through the network's edges.
    ///
    /// # Errors
    /// [`NoExtrusion`].
    pub(crate) fn new(
        network: Network,
        gap: &Gap,
        strips: Strips,
        shares: IndexVec<CellId, f64>,
    ) -> Result<Self, NoExtrusion> {
        let places = strips.first_places(&network, gap)?;
        let pressures = IndexVec::from_elem(0.0, network.cells().len());
        let flips_of_edge = IndexVec::from_elem(0, network.edges().len());
        let schema = STATE_SCHEMA.to_owned();
        Ok(Self {
            schema,
            network,
            strips,
            places,
            pressures,
            shares,
            steps: 0,
            flips: 0,
            flips_of_edge,
            part: whole(),
        })
    }

    /// The descent from the present places, with wall patches good to 1e-5 of a cell's volume: they are integrated anew where
    /// volumes count.
    pub(crate) fn descent(&self, gap: &Gap) -> Result<Descent, FactorError> {
        let complex = self.strips.complex(&self.network, gap);
        let mut places = self.places.clone();
        // A node that finds no wall stays where it is; the descent's residuals tell.
        let _ = complex.retract(&mut places);
        let shares = self.shares.iter().copied().collect();
        Descent::rough(complex, shares, places, self.pressures.clone())
    }

    /// Takes over one step of a descent.
    pub(crate) fn follow(&mut self, descent: &Descent) {
        self.places.clone_from(descent.places());
        self.pressures.clone_from(descent.pressures());
        self.steps += 1;
    }

    /// The chord of an edge between the middles of its two borders, in the frame of its first half-edge's origin: start and
    /// end.
    pub(crate) fn chord(&self, edge: EdgeId) -> (DVec3, DVec3) {
        let side = edge.half_edges()[0];
        let far = self.network.period().translation(self.network.target_shift(side));
        let middle = |vertex| self.places[self.middle_node(vertex)];
        (middle(self.network.origin(side)), middle(self.network.target(side)) + far)
    }

    /// The node in the middle of a border.
    pub(crate) fn middle_node(&self, vertex: VertexId) -> crate::foam::complex::NodeId {
        self.strips.border_node(vertex, self.strips.rows() / 2)
    }

    /// The width of a cell: the root of the area of a regular hexagon with the mean edge.
    pub(crate) fn cell_width(&self) -> f64 {
        let chords = self.network.films().map(|edge| {
            let (a, b) = self.chord(edge);
            a.distance(b)
        });
        let (total, count) = chords.fold((0.0, 0.0), |(total, count), chord| (total + chord, count + 1.0));
        // A regular hexagon of area 1 has sides of √(2/(3√3)).
        let side = (2.0 / (3.0 * 3.0_f64.sqrt())).sqrt();
        total / count / side
    }

    /// Moves the network's vertices and centres to where the films are now.
    pub(crate) fn follow_films(&mut self) {
        for vertex in self.network.vertices() {
            let place = self.places[self.middle_node(vertex)];
            self.network.set_position(vertex, place);
        }
        for cell in self.network.cells() {
            let outline = self.network.outline(cell);
            let count = f64::from(crate::index::checked_u32(outline.len()));
            self.network.set_centre(cell, outline.iter().sum::<DVec3>() / count);
        }
    }

    /// Lays the lines of the rim where the films end now. A line that finds no wall stays where it was.
    pub(crate) fn lay_rim(&mut self, gap: &Gap) {
        for edge in self.network.rim() {
            let _ = self.strips.lay_film(&self.network, gap, edge, &mut self.places);
        }
    }

    /// Meshes the same films anew.
    pub(crate) fn refine(&mut self, strips: Strips) {
        self.places = self.strips.refined(&self.network, &self.places, strips);
        self.strips = strips;
    }

    /// The region of a cell.
    #[must_use]
    pub fn region(cell: CellId) -> RegionId {
        RegionId::from_index(cell.index())
    }
}
