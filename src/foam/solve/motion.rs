//! How freedoms move nodes: bases of the walls' tangents, frames of borders and films, and the first-order map from freedoms
//! to displacements.

use super::layout::Layout;
use crate::{
    foam::{
        complex::{Complex, Motion, Node, NodeId, Places},
        energy::{node_normal, outer},
    },
    index::IndexVec,
};
use glam::{DMat3, DVec3};

/// Orthonormal directions in which a free node may move: those that keep it on its walls.
pub(super) fn tangent_basis(complex: &Complex, node: &Node, p: DVec3) -> Vec<DVec3> {
    match node.walls[..] {
        [] => vec![DVec3::X, DVec3::Y, DVec3::Z],
        [wall] => {
            let (u, v) = complex.walls[wall].field.normal(p).any_orthonormal_pair();
            vec![u, v]
        }
        [a, b] => {
            vec![complex.walls[a].field.normal(p).cross(complex.walls[b].field.normal(p)).normalize_or_zero()]
        }
        _ => Vec::new(),
    }
}

/// Orthonormal directions in which a border's node moves on its own: across the border's tangent, and on its wall if it has
/// one, as where a film ends on a plane that cuts the gap off.
fn across_border(complex: &Complex, node: &Node, p: DVec3, along: DVec3) -> Vec<DVec3> {
    match node.walls[..] {
        [] => {
            let (u, v) = along.any_orthonormal_pair();
            vec![u, v]
        }
        [wall] => {
            let normal = complex.walls[wall].field.normal(p);
            vec![normal.cross(along).normalize_or(normal.any_orthonormal_vector())]
        }
        _ => Vec::new(),
    }
}

/// The projection onto the tangents of a node's walls.
pub(super) fn tangent_projection(complex: &Complex, node: &Node, p: DVec3) -> DMat3 {
    match node.walls[..] {
        [] => DMat3::IDENTITY,
        [wall] => {
            let normal = complex.walls[wall].field.normal(p);
            DMat3::IDENTITY - outer(normal, normal)
        }
        _ => tangent_basis(complex, node, p).into_iter().map(|t| outer(t, t)).fold(DMat3::ZERO, |a, b| a + b),
    }
}

/// The second-order part of the return to the walls: `−Σ λ Φ''` with the multipliers of the walls that hold the node against
/// `force`, the gradient there. This is how a wall's curvature enters the Hessian.
pub(super) fn wall_curvature(complex: &Complex, node: &Node, p: DVec3, force: DVec3) -> DMat3 {
    let jet = |wall| {
        let field = &complex.walls[wall].field;
        (field.gradient(p), field.hessian(p))
    };
    match node.walls[..] {
        [] => DMat3::ZERO,
        [wall] => {
            let (gradient, hessian) = jet(wall);
            -(force.dot(gradient) / gradient.length_squared()) * hessian
        }
        [a, b, ..] => {
            let ((ga, ha), (gb, hb)) = (jet(a), jet(b));
            let (aa, ab, bb) = (ga.dot(ga), ga.dot(gb), gb.dot(gb));
            let (fa, fb) = (force.dot(ga), force.dot(gb));
            let determinant = aa * bb - ab * ab;
            -((bb * fa - ab * fb) / determinant) * ha - ((aa * fb - ab * fa) / determinant) * hb
        }
    }
}

/// Own directions of border and inner nodes. They are kept while Newton steps go on, so that all steps see one and the same
/// function of the freedoms.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    /// For a border node its tangent, for an inner node its film's normal; unit vectors.
    axes: IndexVec<NodeId, DVec3>,
}

impl Frames {
    pub(super) fn new(complex: &Complex, places: &Places) -> Self {
        let mut axes: IndexVec<NodeId, DVec3> = IndexVec::from_elem(DVec3::ZERO, complex.nodes.len());
        let mut nodes = Vec::with_capacity(9);
        for element in complex.films.iter().flat_map(|film| &film.elements) {
            nodes.clear();
            nodes.extend(element.nodes.iter().map(|&image| complex.place(places, image)));
            for (at, image) in element.nodes.iter().enumerate() {
                if matches!(complex.nodes[image.node].motion, Motion::Inner(_)) {
                    axes[image.node] += node_normal(element.shape, at, &nodes);
                }
            }
            for edge in element.shape.edges() {
                let bounding =
                    |&at: &usize| !matches!(complex.nodes[element.nodes[at].node].motion, Motion::Inner(_));
                if !edge.iter().all(bounding) {
                    continue;
                }
                let along = nodes[edge[edge.len() - 1]] - nodes[edge[0]];
                for &at in *edge {
                    let axis = &mut axes[element.nodes[at].node];
                    *axis += if axis.dot(along) < 0.0 { -along } else { along };
                }
            }
        }
        axes.iter_mut().for_each(|axis| *axis = axis.normalize_or(DVec3::Z));
        Self { axes }
    }

    pub(super) fn axis(&self, node: NodeId) -> DVec3 {
        self.axes[node]
    }
}

/// For every bounding node, the freedoms that move it and the displacement for a unit of each.
#[derive(Clone, Debug)]
pub(super) struct Motions {
    pub(super) columns: IndexVec<NodeId, Vec<(usize, DVec3)>>,
}

impl Motions {
    pub(super) fn new(complex: &Complex, places: &Places, layout: &Layout, frames: &Frames) -> Self {
        let mut columns: IndexVec<NodeId, Vec<(usize, DVec3)>> = complex
            .nodes
            .enumerated()
            .map(|(id, node)| {
                let first = layout.freedoms[id].0;
                let own = match node.motion {
                    Motion::Free => tangent_basis(complex, node, places[id]),
                    Motion::Border(_) => across_border(complex, node, places[id], frames.axis(id)),
                    Motion::Inner(_) => Vec::new(),
                };
                own.into_iter().enumerate().map(|(at, direction)| (first + at, direction)).collect()
            })
            .collect();
        for (id, node) in complex.nodes.enumerated() {
            let Motion::Border(masters) = &node.motion else { continue };
            let carried: Vec<(usize, DVec3)> = masters
                .iter()
                .flat_map(|&(master, weight)| {
                    columns[master].iter().map(move |&(freedom, d)| (freedom, weight * d)).collect::<Vec<_>>()
                })
                .collect();
            columns[id].extend(carried);
        }
        Self { columns }
    }
}
