//! Refinement: edges are divided in their middles, facets into four; linear elements become quadratic and back.

use super::{Common, Directed, Edge, EdgeId, Facet, FacetId, Neighbours, Surface, Vertex, VertexId};
use crate::{
    evolver::{
        datafile::{Model, Representation},
        language::expression::ElementKind,
    },
    index::{Id, IndexVec},
};
use glam::{DVec3, IVec3};

/// How a new vertex on a boundary gets its parameters.
fn between(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    std::array::from_fn(|axis| {
        // An angle may pass its end: the shorter way round is meant.
        let mut step = b[axis] - a[axis];
        if step.abs() > std::f64::consts::PI {
            step -= step.signum() * std::f64::consts::TAU;
        }
        a[axis] + 0.5 * step
    })
}

impl Surface {
    /// A new vertex with the attributes of what it lies in.
    fn vertex_within(&mut self, position: DVec3, common: &Common, middle: bool) -> VertexId {
        let common = Common {
            extra: vec![0.0; self.extra_length(ElementKind::Vertex)],
            quantities: Vec::new(),
            original: 0,
            ..common.clone()
        };
        self.vertices.push(Vertex { position, parameters: [0.0; 2], middle, hit: Vec::new(), common })
    }

    /// Places along an edge in its tail's frame: `t` in quarters.
    fn along(&self, edge: EdgeId, t: f64) -> DVec3 {
        let whole = Directed { edge, reversed: false };
        let tail = self.vertices[self.tail(whole)].position;
        let head = tail + self.side(whole);
        match self.edges[edge].middle {
            Some(middle) => {
                let middle = self.vertices[middle].position;
                (1.0 - t) * (1.0 - 2.0 * t) * tail + 4.0 * t * (1.0 - t) * middle + t * (2.0 * t - 1.0) * head
            }
            None => tail.lerp(head, t),
        }
    }

    /// Divides an edge in its middle: the new vertex and the half towards the head. The edge keeps the half at its tail.
    fn halve(&mut self, id: EdgeId) -> (VertexId, EdgeId) {
        let edge = self.edges[id].clone();
        let (quarter, three) = (self.along(id, 0.25), self.along(id, 0.75));
        let middle = match edge.middle {
            Some(middle) => {
                self.vertices[middle].middle = false;
                middle
            }
            None => {
                let middle = self.vertex_within(self.along(id, 0.5), &edge.common, false);
                if edge.common.boundary.is_some() {
                    let [a, b] = edge.ends.map(|end| self.vertices[end].parameters);
                    self.vertices[middle].parameters = between(a, b);
                }
                middle
            }
        };
        let mut middles = [None, None];
        if self.model == Model::Quadratic {
            middles = [quarter, three].map(|place| Some(self.vertex_within(place, &edge.common, true)));
            if edge.common.boundary.is_some() {
                let at = |vertex: VertexId| self.vertices[vertex].parameters;
                let new = [between(at(edge.ends[0]), at(middle)), between(at(middle), at(edge.ends[1]))];
                for (vertex, parameters) in middles.iter().flatten().zip(new) {
                    self.vertices[*vertex].parameters = parameters;
                }
            }
        }
        let far = Edge { ends: [middle, edge.ends[1]], middle: middles[1], ..edge.clone() };
        let far = self.edges.push(far);
        let near = &mut self.edges[id];
        near.ends[1] = middle;
        near.wrap = IVec3::ZERO;
        near.middle = middles[0];
        (middle, far)
    }

    /// A new edge inside a facet between two wrapped vertices, straight or with a middle on the facet.
    fn chord_within(
        &mut self,
        facet: &Facet,
        (from, from_wrap): (VertexId, IVec3),
        (to, to_wrap): (VertexId, IVec3),
        place: Option<DVec3>,
    ) -> EdgeId {
        let common = Common {
            extra: vec![0.0; self.extra_length(ElementKind::Edge)],
            quantities: Vec::new(),
            original: 0,
            ..facet.common.clone()
        };
        let middle = (self.model == Model::Quadratic).then(|| {
            // The place is given in the facet's frame, the middle is kept in that of its edge's tail.
            let own = self.place((from, IVec3::ZERO)).lerp(self.place((to, to_wrap - from_wrap)), 0.5);
            let position = place.map_or(own, |place| place - self.translation(from_wrap));
            self.vertex_within(position, &facet.common, true)
        });
        self.edges.push(Edge {
            ends: [from, to],
            middle,
            wrap: to_wrap - from_wrap,
            tension: 0.0,
            no_refine: false,
            noncontent: false,
            common,
        })
    }

    /// Divides one edge, and the facets on it in two.
    pub(crate) fn refine_edge(&mut self, id: EdgeId, neighbours: &[(FacetId, usize)]) -> [EdgeId; 2] {
        let (middle, far) = self.halve(id);
        let mut uses: Vec<(FacetId, usize)> = neighbours.to_vec();
        // Later places first, so that those before stay where they are in facets that use the edge twice.
        uses.sort_by_key(|&(facet, at)| (facet, std::cmp::Reverse(at)));
        for (facet, at) in uses {
            let reversed = self.facets[facet].edges[at].reversed;
            let halves = [id, far].map(|edge| Directed { edge, reversed });
            let halves = if reversed { [halves[1], halves[0]] } else { halves };
            if self.representation == Representation::String {
                self.facets[facet].edges.splice(at..=at, halves);
                continue;
            }
            self.cut(facet, at, middle, halves);
        }
        [id, far]
    }

    /// Cuts a triangle from the new vertex on its edge `at` to the far corner.
    fn cut(&mut self, id: FacetId, at: usize, middle: VertexId, halves: [Directed; 2]) {
        let facet = self.facets[id].clone();
        let (next, last) = (facet.edges[(at + 1) % 3], facet.edges[(at + 2) % 3]);
        // In the frame of the tail of the divided edge.
        let to_middle = self.wrap(halves[0]);
        let to_far = to_middle + self.wrap(halves[1]) + self.wrap(next);
        let far = self.head(next);
        let chord = self.chord_within(&facet, (middle, to_middle), (far, to_far), None);
        self.facets[id].edges = vec![halves[0], Directed { edge: chord, reversed: false }, last];
        let second = vec![halves[1], next, Directed { edge: chord, reversed: true }];
        self.facets.push(Facet { edges: second, ..facet });
    }

    /// Divides all edges and all facets, as the command `r`.
    pub(crate) fn refine(&mut self) {
        let mut far: IndexVec<EdgeId, Option<EdgeId>> = IndexVec::from_elem(None, self.edges.len());
        let old_facets: Vec<FacetId> = self.facets.ids().collect();
        // Middles of new inner edges lie on the old, bent facets.
        let inner: Vec<Option<[DVec3; 3]>> = old_facets.iter().map(|&id| self.inner_middles(id)).collect();
        let old_edges: Vec<EdgeId> = self.edges.ids().collect();
        for id in old_edges {
            if !self.edges[id].no_refine {
                far[id] = Some(self.halve(id).1);
            }
        }
        let mut pieces: Vec<Facet> = Vec::new();
        for (id, inner) in old_facets.into_iter().zip(inner) {
            if self.representation == Representation::String {
                let edges = self.facets[id].edges.iter().flat_map(|&d| halves(d, &far)).collect();
                self.facets[id].edges = edges;
                continue;
            }
            let divided: Vec<bool> = self.facets[id].edges.iter().map(|d| far[d.edge].is_some()).collect();
            if divided.iter().all(|&d| d) {
                pieces.extend(self.quarter(id, &far, inner));
            } else {
                pieces.extend(self.cut_partly(id, &far));
            }
        }
        for piece in pieces {
            self.facets.push(piece);
        }
    }

    /// Middles of the three edges that a refined quadratic facet gets inside, opposite to its corners, in its frame.
    fn inner_middles(&self, id: FacetId) -> Option<[DVec3; 3]> {
        if self.model != Model::Quadratic || self.representation == Representation::String {
            return None;
        }
        let nodes: Vec<DVec3> = self.corners(id).into_iter().map(|corner| self.place(corner)).collect();
        let shape = crate::foam::complex::Shape::Tri6;
        Some([(0.25, 0.25), (0.5, 0.25), (0.25, 0.5)].map(|(u, v)| {
            let point = shape.at(u, v, 0.0);
            nodes.iter().enumerate().map(|(i, &node)| point.value[i] * node).sum()
        }))
    }

    /// Divides a triangle whose edges are all divided: it keeps the inner triangle, the three at the corners are new.
    fn quarter(
        &mut self,
        id: FacetId,
        far: &IndexVec<EdgeId, Option<EdgeId>>,
        inner: Option<[DVec3; 3]>,
    ) -> Vec<Facet> {
        let facet = self.facets[id].clone();
        let parts: Vec<[Directed; 2]> = facet.edges.iter().map(|&d| two_halves(d, far)).collect();
        let mut wrap = IVec3::ZERO;
        let mut middles = Vec::with_capacity(3);
        for [first, second] in &parts {
            let at = wrap + self.wrap(*first);
            middles.push((self.head(*first), at));
            wrap = at + self.wrap(*second);
        }
        // The chord opposite corner `i` joins the middles of the edges before and behind it.
        let chords: Vec<EdgeId> = (0..3)
            .map(|corner| {
                let place = inner.map(|inner| inner[corner]);
                self.chord_within(&facet, middles[corner], middles[(corner + 2) % 3], place)
            })
            .collect();
        let corners = (0..3).map(|corner| {
            let before = parts[(corner + 2) % 3][1];
            let edges = vec![before, parts[corner][0], Directed { edge: chords[corner], reversed: false }];
            Facet { edges, ..facet.clone() }
        });
        let corners: Vec<Facet> = corners.collect();
        self.facets[id].edges =
            [1, 2, 0].map(|corner| Directed { edge: chords[corner], reversed: true }).to_vec();
        corners
    }

    /// Divides a triangle of which some edges may not be divided: corners between new vertices are cut off first.
    fn cut_partly(&mut self, id: FacetId, far: &IndexVec<EdgeId, Option<EdgeId>>) -> Vec<Facet> {
        let facet = self.facets[id].clone();
        // Each edge, and whether it leads to a new vertex.
        let mut rest: Vec<(Directed, bool)> = Vec::with_capacity(6);
        for &directed in &facet.edges {
            let parts = halves(directed, far);
            let divided = parts.len() == 2;
            rest.extend(parts.into_iter().enumerate().map(|(at, part)| (part, divided && at == 0)));
        }
        let mut pieces = Vec::new();
        while rest.len() > 3 {
            let count = rest.len();
            // The corner at the head of an edge: old itself, with as many new neighbours as there are.
            let new_neighbours = |at: usize| {
                let before = rest[(at + count - 1) % count].1;
                let behind = rest[(at + 1) % count].1;
                if rest[at].1 { 0 } else { 1 + u8::from(before) + u8::from(behind) }
            };
            let at = (0..count).max_by_key(|&at| (new_neighbours(at), std::cmp::Reverse(at))).unwrap_or(0);
            let ((a, _), (b, leads_to_new)) = (rest[at], rest[(at + 1) % count]);
            let start = (self.tail(a), IVec3::ZERO);
            let end = (self.head(b), self.wrap(a) + self.wrap(b));
            let chord = self.chord_within(&facet, start, end, None);
            pieces
                .push(Facet { edges: vec![a, b, Directed { edge: chord, reversed: true }], ..facet.clone() });
            rest[at] = (Directed { edge: chord, reversed: false }, leads_to_new);
            rest.remove((at + 1) % count);
        }
        self.facets[id].edges = rest.into_iter().map(|(directed, _)| directed).collect();
        pieces
    }

    /// Gives every edge a middle, or takes it away.
    pub(crate) fn set_model(&mut self, model: Model) {
        if model == self.model {
            return;
        }
        self.model = model;
        let ids: Vec<EdgeId> = self.edges.ids().collect();
        if model == Model::Quadratic {
            for id in ids {
                let edge = self.edges[id].clone();
                let middle = self.vertex_within(self.along(id, 0.5), &edge.common, true);
                if edge.common.boundary.is_some() {
                    let [a, b] = edge.ends.map(|end| self.vertices[end].parameters);
                    self.vertices[middle].parameters = between(a, b);
                }
                self.edges[id].middle = Some(middle);
            }
        } else {
            for id in ids {
                self.edges[id].middle = None;
            }
            self.pack();
        }
    }

    /// Removes vertices, edges and facets that are marked as gone, and middles that no edge has any more. The new ids of the old
    /// edges; those of removed ones mean nothing.
    pub(crate) fn pack(&mut self) -> Vec<EdgeId> {
        let gone = std::mem::take(&mut self.gone);
        let mut used = vec![false; self.vertices.len()];
        for edge in &self.edges {
            for vertex in edge.ends.into_iter().chain(edge.middle) {
                used[vertex.index()] = true;
            }
        }
        let keep_vertex = |id: VertexId, vertex: &Vertex| {
            !gone.vertices.contains(&id) && (used[id.index()] || !vertex.middle)
        };
        let vertices = renumber(&mut self.vertices, keep_vertex);
        let edges = renumber(&mut self.edges, |id, _| gone.edges.binary_search(&id).is_err());
        renumber(&mut self.facets, |id, _| gone.facets.binary_search(&id).is_err());
        for edge in self.edges.as_mut_slice() {
            edge.ends = edge.ends.map(|end| vertices[end.index()]);
            edge.middle = edge.middle.map(|middle| vertices[middle.index()]);
        }
        for facet in self.facets.as_mut_slice() {
            for directed in &mut facet.edges {
                directed.edge = edges[directed.edge.index()];
            }
        }
        edges
    }

    /// Divides a facet into three at its middle.
    pub(crate) fn star(&mut self, id: FacetId) {
        let facet = self.facets[id].clone();
        if facet.edges.len() != 3 {
            return;
        }
        let corners = self.corners(id);
        let place = corners[..3].iter().map(|&corner| self.place(corner)).sum::<DVec3>() / 3.0;
        let middle = self.vertex_within(place, &facet.common, false);
        let spokes: Vec<EdgeId> = corners[..3]
            .iter()
            .map(|&corner| self.chord_within(&facet, (middle, IVec3::ZERO), corner, None))
            .collect();
        for at in 0..3 {
            let edges = vec![
                facet.edges[at],
                Directed { edge: spokes[(at + 1) % 3], reversed: true },
                Directed { edge: spokes[at], reversed: false },
            ];
            if at == 0 {
                self.facets[id].edges = edges;
            } else {
                self.facets.push(Facet { edges, ..facet.clone() });
            }
        }
    }

    /// Makes room for an attribute of `length` numbers behind the first `at` in all elements of a kind.
    pub(crate) fn lengthen_extra(&mut self, kind: ElementKind, at: usize, length: usize) {
        let lengthen = |extra: &mut Vec<f64>| extra.resize(at + length, 0.0);
        match kind {
            ElementKind::Vertex => self.vertices.iter_mut().for_each(|v| lengthen(&mut v.common.extra)),
            ElementKind::Edge => self.edges.iter_mut().for_each(|e| lengthen(&mut e.common.extra)),
            ElementKind::Facet => self.facets.iter_mut().for_each(|f| lengthen(&mut f.common.extra)),
            ElementKind::Body => self.bodies.iter_mut().for_each(|b| lengthen(&mut b.extra)),
        }
    }

    /// The neighbours of all elements.
    #[must_use]
    pub(crate) fn neighbours(&self) -> Neighbours {
        Neighbours::new(self)
    }
}

/// Keeps some items and gives the new id of each old one; that of a removed one means nothing.
fn renumber<I: Id, T>(items: &mut IndexVec<I, T>, keep: impl Fn(I, &T) -> bool) -> Vec<I> {
    let old = std::mem::take(items).into_vec();
    let mut new = Vec::with_capacity(old.len());
    for (index, item) in old.into_iter().enumerate() {
        let id = I::from_index(items.len());
        new.push(id);
        if keep(I::from_index(index), &item) {
            items.push(item);
        }
    }
    new
}

fn two_halves(directed: Directed, far: &IndexVec<EdgeId, Option<EdgeId>>) -> [Directed; 2] {
    let second = far[directed.edge].unwrap_or(directed.edge);
    let parts = [directed, Directed { edge: second, reversed: directed.reversed }];
    if directed.reversed { [parts[1], parts[0]] } else { parts }
}

fn halves(directed: Directed, far: &IndexVec<EdgeId, Option<EdgeId>>) -> Vec<Directed> {
    if far[directed.edge].is_some() { two_halves(directed, far).to_vec() } else { vec![directed] }
}
