//! Nodes of a foam in balance spread evenly: where they lie along borders and within films is then the foam's own, not that of
//! the way that led to it.
//!
//! Newton steps move borders and films across themselves only; where nodes lie along them comes from the changes of topology
//! and the gaps passed through, and crowded nodes make for large errors.

use super::{Division, FreeFilms, films::films_evened};
use crate::{
    foam::{
        complex::{NodeId, NodeImage},
        convert::as_f64,
        energy::node_normal,
    },
    surface::Gap,
};
use glam::{DVec3, IVec3};
use std::collections::{BTreeMap, BTreeSet};

/// The same films with their nodes spread evenly along their borders and within them.
pub(super) fn films_even(division: &Division, gap: &Gap, fineness: usize, before: &FreeFilms) -> FreeFilms {
    let mut films = films_evened(division, gap, fineness, before);
    spread_within(&mut films);
    films
}

/// A node beside another, in the frame of the latter.
type Beside = (NodeId, [i32; 3]);

/// Sweeps over the nodes of all films.
const SWEEPS: usize = 200;

/// Spreads the nodes within each film: each comes to the middle of those beside it, as far as that lies along the film.
pub(super) fn spread_within(films: &mut FreeFilms) {
    let FreeFilms { complex, places, .. } = films;
    let mut beside: BTreeMap<NodeId, BTreeSet<Beside>> = BTreeMap::new();
    let mut normals: BTreeMap<NodeId, DVec3> = BTreeMap::new();
    for element in complex.films.iter().flat_map(|film| &film.elements) {
        let nodes: Vec<DVec3> = element.nodes.iter().map(|&image| complex.place(places, image)).collect();
        for (at, image) in element.nodes.iter().enumerate() {
            *normals.entry(image.node).or_default() += node_normal(element.shape, at, &nodes);
        }
        for &[a, b] in element.shape.pairs() {
            let [a, b] = [a, b].map(|at| element.nodes[at]);
            for (one, other) in [(a, b), (b, a)] {
                let apart = (other.shift - one.shift).to_array();
                beside.entry(one.node).or_default().insert((other.node, apart));
            }
        }
    }
    beside.retain(|&node, _| complex.nodes[node].is_within_film());
    for _ in 0..SWEEPS {
        for (&node, others) in &beside {
            let place = |&(node, shift): &Beside| {
                complex.place(places, NodeImage { node, shift: IVec3::from_array(shift) })
            };
            let way = others.iter().map(place).sum::<DVec3>() / as_f64(others.len()) - places[node];
            let normal = normals[&node].normalize_or_zero();
            places[node] += way - way.dot(normal) * normal;
        }
    }
}
