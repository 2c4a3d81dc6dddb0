//! Lines where more than three films meet: they part into lines where three meet, with a new film between them.
//!
//! | step | function |
//! |---|---|
//! | the line, as far as nothing holds it and the same films meet | `whole_line` |
//! | the two films with the smallest angle between them, followed along the line | `closest_pair`, `sheet` |
//! | a second line for these two, and the film between the lines | `part` |

use super::{BodyId, Common, Directed, EdgeId, Facet, FacetId, Neighbours, Surface, VertexId};
use crate::evolver::language::expression::ElementKind;
use glam::{DVec3, IVec3};

/// How far the second line is pulled off, as a part of the length of its edges: as Surface Evolver.
const PULL: f64 = 0.01;

/// A line of edges, one behind the other, with its vertices between them.
struct Line {
    edges: Vec<Directed>,
    /// For each vertex between two edges, the facets of each of two films there, from one edge to the next.
    sheets: Vec<[Vec<FacetId>; 2]>,
}

/// Two films at an edge; the second is the next one counter-clockwise about the edge's direction.
type Pair = [FacetId; 2];

impl Surface {
    /// Parts the line through an edge at which more than three films meet. False where there is nothing to part, or what holds
    /// the line forbids it.
    pub(crate) fn pop_line(&mut self, id: EdgeId) -> bool {
        let around = self.neighbours();
        if !self.has_many_films(id, &around) {
            return false;
        }
        let line = self.whole_line(id, &around);
        if line.edges.len() > 1 {
            return self.part(&line, &around);
        }
        // Both ends stay where they are: a vertex between them lets the line part.
        let halves = self.refine_edge(id, &around.facets[id]);
        let around = self.neighbours();
        let line = self.whole_line(halves[0], &around);
        line.edges.len() > 1 && self.part(&line, &around)
    }

    /// Whether more than three films meet at an edge that nothing holds.
    pub(crate) fn has_many_films(&self, id: EdgeId, around: &Neighbours) -> bool {
        around.facets[id].len() > 3 && is_free(&self.edges[id].common)
    }

    /// The line through an edge, as far as it can part.
    fn whole_line(&self, id: EdgeId, around: &Neighbours) -> Line {
        let start = Directed { edge: id, reversed: false };
        let mut line = Line { edges: vec![start], sheets: Vec::new() };
        let Some(first) = self.closest_pair(start, around) else { return line };
        self.lengthen(&mut line, first, around);
        // The other way round: the line and its films turned about.
        line.edges.reverse();
        line.edges.iter_mut().for_each(|edge| *edge = edge.turned());
        line.sheets.reverse();
        for sheets in &mut line.sheets {
            sheets.iter_mut().for_each(|sheet| sheet.reverse());
            sheets.swap(0, 1);
        }
        self.lengthen(&mut line, [first[1], first[0]], around);
        line
    }

    /// Follows the line at its far end as long as the same films go on.
    fn lengthen(&self, line: &mut Line, pair: Pair, around: &Neighbours) {
        let Some(&(mut edge)) = line.edges.last() else { return };
        let mut pair = pair;
        loop {
            let vertex = self.head(edge);
            let lines: Vec<EdgeId> =
                around.edges[vertex].iter().copied().filter(|&e| around.facets[e].len() != 2).collect();
            let [one, other] = lines[..] else { return };
            let next = if one == edge.edge { other } else { one };
            let same = around.facets[next].len() == around.facets[edge.edge].len();
            if !is_free(&self.vertices[vertex].common)
                || !self.has_many_films(next, around)
                || !same
                || line.edges.iter().any(|known| known.edge == next)
            {
                return;
            }
            let sheets = pair.map(|facet| self.sheet(vertex, edge.edge, facet, around));
            let [Some(left), Some(right)] = sheets else { return };
            let (Some(&a), Some(&b)) = (left.last(), right.last()) else { return };
            pair = [a, b];
            line.sheets.push([left, right]);
            edge = Directed { edge: next, reversed: self.edges[next].ends[0] != vertex };
            line.edges.push(edge);
        }
    }

    /// The facets of one film round a vertex, from the one at an edge of the line to the one at the line's next edge.
    fn sheet(
        &self,
        vertex: VertexId,
        from: EdgeId,
        facet: FacetId,
        around: &Neighbours,
    ) -> Option<Vec<FacetId>> {
        let (mut edge, mut facet) = (from, facet);
        let mut sheet = Vec::new();
        for _ in 0..around.edges[vertex].len() + 1 {
            sheet.push(facet);
            let mut ahead = self.facets[facet]
                .edges
                .iter()
                .map(|directed| directed.edge)
                .filter(|&other| other != edge && self.edges[other].ends.contains(&vertex));
            edge = ahead.next()?;
            match around.facets[edge][..] {
                [(one, _), (other, _)] => facet = if one == facet { other } else { one },
                _ => return (edge != from).then_some(sheet),
            }
        }
        None
    }

    /// The two films at an edge with the smallest angle between them.
    fn closest_pair(&self, edge: Directed, around: &Neighbours) -> Option<Pair> {
        let films: Vec<(FacetId, DVec3)> =
            around.facets[edge.edge].iter().map(|&(facet, at)| (facet, self.inward(facet, at))).collect();
        let mut best: Option<(f64, Pair)> = None;
        for (at, (one, a)) in films.iter().enumerate() {
            for (other, b) in &films[at + 1..] {
                let cosine = a.dot(*b);
                if best.is_none_or(|(most, _)| cosine > most) {
                    let turns = a.cross(*b).dot(self.side(edge)) > 0.0;
                    best = Some((cosine, if turns { [*one, *other] } else { [*other, *one] }));
                }
            }
        }
        best.map(|(_, pair)| pair)
    }

    /// The unit vector from an edge into a facet.
    fn inward(&self, facet: FacetId, at: usize) -> DVec3 {
        let edges = &self.facets[facet].edges;
        self.area_vector(facet).cross(self.side(edges[at])).normalize_or_zero()
    }

    /// Gives two films of a line a line of their own, and puts a film between both lines.
    fn part(&mut self, line: &Line, around: &Neighbours) -> bool {
        let Some([first, last]) = line.sheets.first().map(|sheets| [sheets[0][0], sheets[1][0]]) else {
            return false;
        };
        let film = self.film_between(line.edges[0], [first, last]);
        let shifts: Vec<DVec3> = line
            .sheets
            .iter()
            .enumerate()
            .map(|(at, sheets)| self.shift([line.edges[at], line.edges[at + 1]], sheets, around))
            .collect();
        let old: Vec<VertexId> = line.edges[1..].iter().map(|&edge| self.tail(edge)).collect();
        let new: Vec<VertexId> = old
            .iter()
            .zip(&shifts)
            .map(|(&vertex, &shift)| self.free_vertex(self.vertices[vertex].position + shift, false))
            .collect();
        let seconds = self.second_line(line, &new);
        for (at, sheets) in line.sheets.iter().enumerate() {
            let steps = [(line.edges[at], seconds[at]), (line.edges[at + 1], seconds[at + 1])];
            sheets.iter().for_each(|sheet| self.move_sheet(sheet, (old[at], new[at]), steps));
        }
        self.fill(line, &seconds, (&old, &new), &film);
        true
    }

    /// A facet of the film between the lines, without its edges: the bodies on its sides are those on the far sides of the
    /// two films.
    fn film_between(&self, edge: Directed, [first, second]: Pair) -> Facet {
        let sides = |facet: FacetId| -> [Option<BodyId>; 2] {
            let data = &self.facets[facet];
            let same = data.edges.contains(&edge);
            if same { data.bodies } else { [data.bodies[1], data.bodies[0]] }
        };
        self.free_facet(first, [sides(first)[0], sides(second)[1]])
    }

    /// A facet without edges that nothing holds, with the tension and colour of another.
    pub(super) fn free_facet(&self, like: FacetId, bodies: [Option<BodyId>; 2]) -> Facet {
        let data = &self.facets[like];
        let extra = vec![0.0; self.extra_length(ElementKind::Facet)];
        let common = Common { color: data.common.color, extra, ..Common::default() };
        let tension = data.tension;
        Facet { edges: Vec::new(), bodies, tension, no_refine: false, noncontent: false, common }
    }

    /// How far a vertex of the second line lies from its own on the first.
    fn shift(&self, edges: [Directed; 2], sheets: &[Vec<FacetId>; 2], around: &Neighbours) -> DVec3 {
        let at_edge = |edge: EdgeId, facet: Option<&FacetId>| {
            let found = around.facets[edge].iter().find(|(id, _)| Some(id) == facet);
            found.map_or(DVec3::ZERO, |&(facet, at)| self.inward(facet, at))
        };
        let way: DVec3 = sheets
            .iter()
            .map(|sheet| at_edge(edges[0].edge, sheet.first()) + at_edge(edges[1].edge, sheet.last()))
            .sum();
        let length = edges.map(|edge| self.chord(edge.edge));
        0.5 * PULL * length[0].min(length[1]) * way
    }

    /// The edges of the second line, with the direction of the first.
    fn second_line(&mut self, line: &Line, new: &[VertexId]) -> Vec<Directed> {
        let count = line.edges.len();
        (0..count)
            .map(|at| {
                let own = line.edges[at];
                let tail = if at == 0 { self.tail(own) } else { new[at - 1] };
                let head = if at + 1 == count { self.head(own) } else { new[at] };
                let wrap = self.wrap(own);
                let tension = self.edges[own.edge].tension;
                Directed { edge: self.free_edge([tail, head], wrap, tension), reversed: false }
            })
            .collect()
    }

    /// Moves a film's facets at a vertex from the first line to the second; `steps` are the edges of both lines there.
    fn move_sheet(
        &mut self,
        sheet: &[FacetId],
        (old, new): (VertexId, VertexId),
        steps: [(Directed, Directed); 2],
    ) {
        for &facet in sheet {
            for at in 0..self.facets[facet].edges.len() {
                let directed = self.facets[facet].edges[at];
                if let Some((from, to)) = steps.iter().find(|(from, _)| from.edge == directed.edge) {
                    let reversed = directed.reversed != from.reversed;
                    self.facets[facet].edges[at] = Directed { edge: to.edge, reversed };
                } else if self.edges[directed.edge].ends.contains(&old) {
                    self.reattach(directed.edge, old, new, IVec3::ZERO);
                }
            }
        }
    }

    /// Fills the strip between the lines: a triangle at each end, two in each quadrilateral between.
    fn fill(
        &mut self,
        line: &Line,
        seconds: &[Directed],
        (old, new): (&[VertexId], &[VertexId]),
        film: &Facet,
    ) {
        let rungs: Vec<Directed> = old
            .iter()
            .zip(new)
            .map(|(&from, &to)| Directed {
                edge: self.free_edge([from, to], IVec3::ZERO, 0.0),
                reversed: false,
            })
            .collect();
        let count = line.edges.len();
        for at in 0..count {
            let (own, second) = (line.edges[at], seconds[at]);
            if at == 0 {
                self.facets.push(Facet { edges: vec![own, rungs[0], second.turned()], ..film.clone() });
            } else if at + 1 == count {
                let edges = vec![own, second.turned(), rungs[at - 1].turned()];
                self.facets.push(Facet { edges, ..film.clone() });
            } else {
                let diagonal = self.free_edge([old[at - 1], new[at]], self.wrap(own), 0.0);
                let diagonal = Directed { edge: diagonal, reversed: false };
                let lower = vec![own, rungs[at], diagonal.turned()];
                let upper = vec![diagonal, second.turned(), rungs[at - 1].turned()];
                self.facets.push(Facet { edges: lower, ..film.clone() });
                self.facets.push(Facet { edges: upper, ..film.clone() });
            }
        }
    }
}

/// Whether nothing holds an element.
pub(super) fn is_free(common: &Common) -> bool {
    !common.fixed && common.constraints.is_empty() && common.boundary.is_none()
}
