//! The film complex: curved films in space, with the regions on their two sides and the walls that their nodes lie on.
//!
//! Energy, volumes and the solver know only this. A one-layer foam makes it from its network (`strips.rs`); other builders
//! may use any mixture of element shapes (`shape.rs`), any number of regions and of films along a border. What lies on a
//! wall has no element: a wall's share of a volume is integrated on the wall itself (`volume`).

mod rim;
mod shape;
mod strips;

pub use shape::Shape;
pub(crate) use shape::{CurvePoint, MOST_NODES, ShapePoint, curve_points, gauss, quadratic};
pub(in crate::foam) use strips::coons;
pub use strips::{NoExtrusion, Strips};

use crate::{
    index::{Id, IndexVec},
    surface::{Period, Wall},
};
use glam::{DVec3, IVec3};
use serde::{Deserialize, Serialize};

crate::define_id!(
    /// A node of a [`Complex`].
    NodeId
);
crate::define_id!(
    /// A film of a [`Complex`]: a piece between two regions.
    FilmId
);
crate::define_id!(
    /// A region of a [`Complex`]: a cell, or the open air.
    RegionId
);
crate::define_id!(
    /// A wall of a [`Complex`].
    WallId
);

/// One image of a node: its stored place plus `shift` periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct NodeImage {
    /// The node.
    pub node: NodeId,
    /// Which image, in periods.
    pub shift: IVec3,
}

/// One image of a region, seen from a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionImage {
    /// The region.
    pub region: RegionId,
    /// Which image, in periods.
    pub shift: IVec3,
}

/// How a node may move besides staying on its walls. The motion along a film or border changes only the mesh, so it is
/// slaved to other nodes: without that, discrete energies have spurious unstable modes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// In every direction.
    Free,
    /// A node of a border: moves with its masters, by weights, and on its own across the border's tangent.
    Border(Vec<(NodeId, f64)>),
    /// A node inside a film: moves with its masters, by weights, and on its own along the film's normal. Masters are free
    /// nodes, border nodes, or inner nodes of the same film that do not follow this one; the weights sum to 1.
    Inner(Vec<(NodeId, f64)>),
}

/// A node: the walls that it lies on and how it may move. Its place is kept apart, in a plain vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// At most two walls.
    pub walls: Vec<WallId>,
    /// Its freedom.
    pub motion: Motion,
}

impl Node {
    /// Whether it lies inside a film, neither on its borders nor on a wall.
    pub(crate) fn is_within_film(&self) -> bool {
        matches!(self.motion, Motion::Inner(_)) && self.walls.is_empty()
    }
}

/// A curved element of a film.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Element {
    /// Its shape, which says how many nodes it has and in which order.
    pub shape: Shape,
    /// Its nodes. Its normal `∂x/∂u × ∂x/∂v` points from the film's back to its front.
    pub nodes: Vec<NodeImage>,
}

/// A piece of film between two regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Film {
    /// The region that the normals point into.
    pub front: RegionImage,
    /// The region on the other side.
    pub back: RegionImage,
    /// Energy per area, γ.
    pub tension: f64,
    /// Its elements.
    pub elements: Vec<Element>,
}

/// What a region is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum RegionKind {
    /// A cell, with a pressure that follows from its volume.
    Cell,
    /// The open air: pressure 0, any volume.
    Open,
}

/// A region: a cell or the open air.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// What it is.
    pub kind: RegionKind,
    /// A place in its midst, unwrapped; wall patches are integrated outward from its feet on the walls.
    pub anchor: DVec3,
}

/// A film complex, without the places of its nodes.
#[derive(Clone, Debug)]
pub struct Complex {
    /// The lattice.
    pub period: Period,
    /// The walls.
    pub walls: IndexVec<WallId, Wall>,
    /// The regions.
    pub regions: IndexVec<RegionId, Region>,
    /// The nodes.
    pub nodes: IndexVec<NodeId, Node>,
    /// The films.
    pub films: IndexVec<FilmId, Film>,
}

/// The places of the nodes, unwrapped.
pub type Places = IndexVec<NodeId, DVec3>;

impl Complex {
    /// The place of an image of a node.
    #[must_use]
    pub fn place(&self, places: &Places, image: NodeImage) -> DVec3 {
        places[image.node] + self.period.translation(image.shift)
    }

    /// The edges of an element that lie on a wall of the gap: the wall, and the edge's nodes in the element's numbering,
    /// counter-clockwise round the element's normal. Planes that cut the gap off are left out: see [`region_anchors`].
    pub fn wall_edges<'a>(
        &'a self,
        element: &'a Element,
    ) -> impl Iterator<Item = (WallId, &'static [usize])> + 'a {
        self.edges_on_walls(element).filter(|&(wall, _)| !self.walls[wall].field.cuts_off())
    }

    /// As [`Complex::wall_edges`], with the edges on planes that cut the gap off.
    pub(crate) fn edges_on_walls<'a>(
        &'a self,
        element: &'a Element,
    ) -> impl Iterator<Item = (WallId, &'static [usize])> + 'a {
        element.shape.edges().iter().flat_map(move |&edge| {
            let first = element.nodes[edge[0]].node;
            self.nodes[first]
                .walls
                .iter()
                .filter(move |wall| {
                    edge.iter().all(|&at| self.nodes[element.nodes[at].node].walls.contains(wall))
                })
                .map(move |&wall| (wall, edge))
        })
    }

    /// The nodes that are shared by several films, in order: borders and their ends.
    #[must_use]
    pub fn bounding_nodes(&self) -> Vec<NodeId> {
        self.nodes
            .enumerated()
            .filter(|(_, node)| !matches!(node.motion, Motion::Inner(_)))
            .map(|(id, _)| id)
            .collect()
    }

    /// Brings every wall node onto its walls.
    ///
    /// # Errors
    /// The first node that cannot be brought there.
    pub fn retract(&self, places: &mut Places) -> Result<(), NodeId> {
        for (id, node) in self.nodes.enumerated() {
            if let Some(on_walls) = self.retracted(node, places[id]) {
                places[id] = on_walls;
            } else {
                return Err(id);
            }
        }
        Ok(())
    }

    /// `p` moved onto the walls of `node` along their normals; `None` if that does not settle.
    #[must_use]
    pub fn retracted(&self, node: &Node, p: DVec3) -> Option<DVec3> {
        match node.walls[..] {
            [] => Some(p),
            [wall] => self.walls[wall].project(p).ok(),
            [first, second, ..] => {
                let mut q = p;
                for _ in 0..RETRACT_STEPS {
                    let before = q;
                    q = self.walls[first].project(q).ok()?;
                    q = intersection_step(&self.walls[first], &self.walls[second], q)?;
                    if q.distance(before) <= 4.0 * f64::EPSILON * (1.0 + q.length()) {
                        break;
                    }
                }
                Some(q)
            }
        }
    }
}

/// Newton steps onto the line where two walls meet settle in fewer than ten.
const RETRACT_STEPS: usize = 30;

/// One Newton step onto both walls, within the plane of their normals.
fn intersection_step(a: &Wall, b: &Wall, p: DVec3) -> Option<DVec3> {
    let (ga, gb) = (a.field.gradient(p), b.field.gradient(p));
    let (va, vb) = (a.value(p), b.value(p));
    let (aa, ab, bb) = (ga.dot(ga), ga.dot(gb), gb.dot(gb));
    let determinant = aa * bb - ab * ab;
    if determinant <= 1e-12 * aa * bb {
        return None;
    }
    let (x, y) = ((bb * va - ab * vb) / determinant, (aa * vb - ab * va) / determinant);
    Some(p - x * ga - y * gb)
}

/// The mean place of a region's nodes, in the frame of its anchor; one for every region.
#[must_use]
pub fn region_means(complex: &Complex, places: &Places) -> IndexVec<RegionId, DVec3> {
    let mut sums: IndexVec<RegionId, (DVec3, f64)> =
        IndexVec::from_elem((DVec3::ZERO, 0.0), complex.regions.len());
    for film in &complex.films {
        for side in [film.front, film.back] {
            let frame = complex.period.translation(side.shift);
            for image in film.elements.iter().flat_map(|element| &element.nodes) {
                let sum = &mut sums[side.region];
                sum.0 += complex.place(places, *image) - frame;
                sum.1 += 1.0;
            }
        }
    }
    sums.enumerated()
        .map(|(id, &(sum, count))| if count > 0.0 { sum / count } else { complex.regions[id].anchor })
        .collect()
}

/// The places that the regions' volumes are measured from, in the frames of their stored anchors: in the midst of each, and
/// on the planes that cut it off. A cone over a part of a plane from a point of the plane is empty, so such planes add
/// nothing to a volume; and as they are mirrors, a patch of a wall that is drawn from such a point ends on them by itself.
#[must_use]
pub fn region_anchors(complex: &Complex, places: &Places) -> IndexVec<RegionId, DVec3> {
    let mut anchors = region_means(complex, places);
    let cuts: Vec<WallId> =
        complex.walls.enumerated().filter(|(_, wall)| wall.field.cuts_off()).map(|(id, _)| id).collect();
    if cuts.is_empty() {
        return anchors;
    }
    for film in &complex.films {
        for image in film.elements.iter().flat_map(|element| &element.nodes) {
            for &wall in complex.nodes[image.node].walls.iter().filter(|wall| cuts.contains(wall)) {
                for side in [film.front, film.back] {
                    // Planes lie across axes without a period.
                    let anchor = &mut anchors[side.region];
                    *anchor = complex.walls[wall].project(*anchor).unwrap_or(*anchor);
                }
            }
        }
    }
    anchors
}

impl RegionImage {
    /// Whether this is a cell of `complex` and not the open air.
    #[must_use]
    pub fn is_cell(&self, complex: &Complex) -> bool {
        self.region.index() < complex.regions.len() && complex.regions[self.region].kind == RegionKind::Cell
    }
}
