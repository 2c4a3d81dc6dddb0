//! The volumes of bodies closed on their walls: the same films as a complex of the foam, whose kernels integrate the walls
//! between the films' edges themselves. Independent of content integrals, so that the two can be held against each other.

use super::{Places, problem::Problem};
use crate::{
    evolver::{
        datafile::{Model, Representation, Side},
        language::formula::Bound,
        surface::{BodyId, Directed, FacetId, Surface, VertexId, body_images},
    },
    foam::{
        complex::{
            Complex, Element, Film, Motion, Node, NodeId, NodeImage, Region, RegionId, RegionImage,
            RegionKind, Shape, WallId,
        },
        volume::{Reference, volumes},
    },
    index::{Id, IndexVec},
    surface::{LevelSet, Period, Wall},
};
use glam::{DMat3, DVec3, IVec3};
use std::{collections::BTreeMap, sync::Arc};

/// A formula as a level set.
#[derive(Debug)]
struct FormulaSurface {
    formula: Bound,
    extent: (DVec3, DVec3),
}

impl LevelSet for FormulaSurface {
    fn name(&self) -> &'static str {
        "constraint"
    }

    fn value(&self, p: DVec3) -> f64 {
        self.formula.value(p)
    }

    fn gradient(&self, p: DVec3) -> DVec3 {
        self.formula.jet(p).gradient
    }

    fn hessian(&self, p: DVec3) -> DMat3 {
        self.formula.jet(p).hessian
    }

    fn value_and_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let jet = self.formula.jet(p);
        (jet.value, jet.gradient)
    }

    fn period(&self) -> Period {
        Period::NONE
    }

    fn domain(&self) -> (DVec3, DVec3) {
        self.extent
    }

    fn euler_characteristic(&self) -> i32 {
        0
    }

    fn level_limits(&self) -> (f64, f64) {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
}

/// The volume of each body whose surface consists of films and of patches of constraints; `None` for a body that cannot be
/// closed so, as where films end on a boundary.
#[must_use]
pub(crate) fn closed_volumes(
    problem: &Problem,
    surface: &Surface,
    places: &Places,
) -> IndexVec<BodyId, Option<f64>> {
    let none = IndexVec::from_elem(None, surface.bodies.len());
    if surface.representation != Representation::Soapfilm {
        return none;
    }
    let Some(complex) = complex(problem, surface, places) else { return none };
    let nodes = places.iter().copied().collect();
    let reference = Reference::new(&complex, &nodes);
    let all = volumes(&complex, &nodes, &reference);
    let closable = closable_bodies(surface);
    surface
        .bodies
        .ids()
        .map(|body| {
            let volume = all[RegionId::from_index(body.index() + 1)];
            // A patch is taken as a disc round the body's foot on the wall: a body that goes round the outside of its contact
            // line comes out inside out, and cannot be judged this way.
            (closable[body.index()] && volume > 0.0).then_some(volume)
        })
        .collect()
}

/// Bodies whose free edges all lie on constraints, each of them a film's: a line in which a body ends on two constraints at once
/// bounds no film, and its patches there are not closed by the films' edges.
fn closable_bodies(surface: &Surface) -> Vec<bool> {
    let neighbours = surface.neighbours();
    let mut closable = vec![true; surface.bodies.len()];
    for (id, edge) in surface.edges.enumerated() {
        let mut uses: BTreeMap<BodyId, [usize; 2]> = BTreeMap::new();
        for &(facet, _) in &neighbours.facets[id] {
            let on_wall = usize::from(lies_on_wall(surface, facet));
            for body in surface.facets[facet].bodies.into_iter().flatten() {
                uses.entry(body).or_default()[on_wall] += 1;
            }
        }
        let constraints = edge.common.constraints.len();
        for (body, [films, patches]) in uses {
            let is_open = films + patches == 1 && constraints == 0;
            let has_no_film = films == 0 && constraints > 1;
            if is_open || has_no_film {
                closable[body.index()] = false;
            }
        }
    }
    closable
}

/// Whether a facet lies on a wall: it is then part of the wall's patch, which is integrated on the wall itself.
fn lies_on_wall(surface: &Surface, id: FacetId) -> bool {
    let facet = &surface.facets[id];
    let shared = |d: &Directed| {
        facet.common.constraints.iter().any(|c| surface.edges[d.edge].common.constraints.contains(c))
    };
    !facet.common.constraints.is_empty() && facet.edges.iter().all(shared)
}

/// The films as a complex: region 0 is the open air, then the bodies.
fn complex(problem: &Problem, surface: &Surface, places: &Places) -> Option<Complex> {
    let images = body_images(surface, &surface.neighbours()).ok()?;
    let period = match surface.periods {
        None => Period::NONE,
        Some(periods) => {
            let diagonal =
                DMat3::from_diagonal(DVec3::new(periods.x_axis.x, periods.y_axis.y, periods.z_axis.z));
            // The foam knows periods along the axes only.
            if periods != diagonal {
                return None;
            }
            Period([Some(periods.x_axis.x), Some(periods.y_axis.y), Some(periods.z_axis.z)])
        }
    };
    let low = places.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = (high - low).max_element();
    let extent = (low - DVec3::splat(size), high + DVec3::splat(size));
    let walls: IndexVec<WallId, Wall> = problem
        .walls
        .iter()
        .map(|wall| Wall {
            field: Arc::new(FormulaSurface { formula: wall.formula.clone(), extent }),
            level: 0.0,
        })
        .collect();
    let nodes: IndexVec<NodeId, Node> = surface
        .vertices
        .iter()
        .map(|vertex| Node {
            walls: vertex
                .common
                .constraints
                .iter()
                .filter(|id| problem.walls[**id].side == Side::On || vertex.hit.contains(id))
                .map(|id| WallId::from_index(id.index()))
                .collect(),
            motion: Motion::Free,
        })
        .collect();
    let mut regions = IndexVec::new();
    regions.push(Region { kind: RegionKind::Open, anchor: DVec3::ZERO });
    for _ in &surface.bodies {
        regions.push(Region { kind: RegionKind::Cell, anchor: DVec3::ZERO });
    }
    let shape = if surface.model == Model::Quadratic { Shape::Tri6 } else { Shape::Tri3 };
    let films = surface.facets.ids().filter_map(|id| film(surface, id, &images[id.index()], shape)).collect();
    Some(Complex { period, walls, regions, nodes, films })
}

fn film(surface: &Surface, id: FacetId, images: &[IVec3; 2], shape: Shape) -> Option<Film> {
    let facet = &surface.facets[id];
    if facet.bodies == [None, None] || facet.noncontent {
        return None;
    }
    if lies_on_wall(surface, id) {
        return None;
    }
    let side = |at: usize| match facet.bodies[at] {
        // The body's image of the facet is moved by the periods: seen from the facet the body is moved back.
        Some(body) => RegionImage { region: RegionId::from_index(body.index() + 1), shift: -images[at] },
        None => RegionImage { region: RegionId::from_index(0), shift: IVec3::ZERO },
    };
    let nodes = surface
        .corners(id)
        .into_iter()
        .map(|(vertex, shift): (VertexId, IVec3)| NodeImage {
            node: NodeId::from_index(vertex.index()),
            shift,
        })
        .collect();
    Some(Film {
        back: side(0),
        front: side(1),
        tension: facet.tension,
        elements: vec![Element { shape, nodes }],
    })
}
