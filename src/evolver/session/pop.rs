//! Commands that change who meets whom: `t1_edgeswap`, `pop`, `o`, `O`.

use super::{
    Host, Session,
    evaluate::{Element, Scope},
    motion::Done,
};
use crate::{
    evolver::{
        datafile::Model,
        error::EvolverError,
        language::expression::ElementKind,
        source::Position,
        surface::{EdgeId, VertexId},
    },
    index::Id,
};

/// How often one line or vertex may part: each time one film or string fewer meets there.
const PARTS: usize = 100;

impl Session {
    /// `t1_edgeswap` of edges of strings, one after the other. How many were swapped.
    pub(super) fn t1_edges(&mut self, edges: &[Element], scope: &Scope) -> Result<usize, EvolverError> {
        if self.has_films() {
            let hint = "pop edge parts the lines where more than three films meet";
            return scope.unsupported(Position::default(), "t1_edgeswap of films", hint);
        }
        let mut around = self.surface.neighbours();
        let mut count = 0;
        for edge in edges {
            if self.surface.t1(EdgeId::from_index(edge.index), &around) {
                count += 1;
                around = self.surface.neighbours();
            }
        }
        Ok(count)
    }

    /// `pop` of vertices or edges. How many times something parted.
    pub(super) fn pop_elements(
        &mut self,
        elements: &[Element],
        scope: &Scope,
    ) -> Result<usize, EvolverError> {
        let indices = || elements.iter().map(|element| element.index);
        match elements.first().map(|element| element.kind) {
            Some(ElementKind::Edge) => {
                if !self.has_films() {
                    return scope.fail(Position::default(), "edges of strings do not part: pop vertices");
                }
                self.pop_lines(indices().map(EdgeId::from_index).collect(), scope)
            }
            _ => self.pop_points(indices().map(VertexId::from_index).collect(), scope),
        }
    }

    /// `o`: parts all lines and then all points where more films or strings meet than can at rest; `O`: lines of films only.
    pub(super) fn pop(&mut self, points: bool, scope: &Scope, host: &mut dyn Host) -> Done {
        if self.has_films() {
            let lines = self.pop_lines(self.surface.edges.ids().collect(), scope)?;
            self.say(host, &format!("Edges popped: {lines}\n"));
        }
        if points || !self.has_films() {
            let count = self.pop_points(self.surface.vertices.ids().collect(), scope)?;
            self.say(host, &format!("Vertices popped: {count}\n"));
        }
        self.changed();
        self.current()?;
        Ok(())
    }

    fn pop_lines(&mut self, edges: Vec<EdgeId>, scope: &Scope) -> Result<usize, EvolverError> {
        self.needs_straight(scope)?;
        let around = self.surface.neighbours();
        let many: Vec<EdgeId> =
            edges.into_iter().filter(|&edge| self.surface.has_many_films(edge, &around)).collect();
        let mut count = 0;
        for edge in many {
            for _ in 0..PARTS {
                self.spend()?;
                if !self.surface.pop_line(edge) {
                    break;
                }
                count += 1;
            }
        }
        Ok(count)
    }

    fn pop_points(&mut self, mut vertices: Vec<VertexId>, scope: &Scope) -> Result<usize, EvolverError> {
        let films = self.has_films();
        if films {
            self.needs_straight(scope)?;
        }
        let mut around = self.surface.neighbours();
        let mut count = 0;
        // From the last: a point of films that opens moves the numbers of later vertices.
        vertices.sort_unstable_by_key(|vertex| std::cmp::Reverse(vertex.index()));
        for vertex in vertices {
            for _ in 0..PARTS {
                let parted = if films {
                    self.surface.pop_point(vertex, &around)
                } else {
                    self.surface.pop_string(vertex, &around)
                };
                if !parted {
                    break;
                }
                self.spend()?;
                count += 1;
                around = self.surface.neighbours();
                if films {
                    break;
                }
            }
        }
        Ok(count)
    }

    fn needs_straight(&self, scope: &Scope) -> Done {
        if self.surface.model == Model::Quadratic {
            let hint = "change to linear elements first: linear";
            return scope.unsupported(Position::default(), "popping of quadratic films", hint);
        }
        Ok(())
    }
}
