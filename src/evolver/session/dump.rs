//! The surface as a datafile.

use super::{Session, evaluate::Element, format::significant};
use crate::{
    evolver::{
        datafile::{Model, Purpose, Representation},
        error::EvolverError,
        language::expression::ElementKind,
        physics::FunctionalId,
        surface::{BodyId, Common, EdgeId, FacetId, VertexId},
    },
    index::Id,
};
use glam::IVec3;
use std::fmt::Write as _;

/// The digits that bring a number back as it was.
const DIGITS: usize = 17;

fn exact(value: f64) -> String {
    significant(value, DIGITS)
}

impl Session {
    /// The present surface as a datafile: the head of the one that was read, with the present values of the parameters, and
    /// the elements as they are.
    ///
    /// # Errors
    /// [`EvolverError`] if the surface makes no sense.
    pub fn datafile(&mut self) -> Result<String, EvolverError> {
        let energy = self.values()?.energy;
        let mut text = format!(
            "// Written by combwright {} from {}.\n// Total energy: {}\n\n",
            env!("CARGO_PKG_VERSION"),
            self.data.source.name.replace('\n', " "),
            exact(energy)
        );
        text.push_str(&self.head());
        text.push_str("\nvertices\n");
        for index in 0..self.surface.vertices.len() {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{}", self.element_line(Element { kind: ElementKind::Vertex, index }));
        }
        for (title, kind) in
            [("edges", ElementKind::Edge), ("faces", ElementKind::Facet), ("bodies", ElementKind::Body)]
        {
            if self.count(kind) == 0 {
                continue;
            }
            let _ = writeln!(text, "\n{title}");
            for index in 0..self.count(kind) {
                let _ = writeln!(text, "{}", self.element_line(Element { kind, index }));
            }
        }
        let tail = self.read_section();
        if !tail.is_empty() {
            let _ = write!(text, "\nread\n{tail}");
        }
        Ok(text)
    }

    /// The text of the datafile up to its vertices, with the present model, parameters and switches.
    fn head(&self) -> String {
        let mut out = String::new();
        let source = &self.data.source.text;
        let end = self.data.vertices_at.map_or(0, |position| offset(source, position));
        for line in source[..end].lines() {
            let word = line.split_whitespace().next().unwrap_or_default().to_lowercase();
            let word = word.trim_end_matches(':');
            let dropped = matches!(
                word,
                "linear" | "quadratic" | "scale" | "total_time" | "gravity_constant" | "gravity"
            ) || word.ends_with("_predicted")
                || line.starts_with("// Written by combwright")
                || line.starts_with("// Total energy:");
            if dropped {
                continue;
            }
            match self.parameter_line(line, word) {
                Some(changed) => out.push_str(&changed),
                None => out.push_str(line),
            }
            out.push('\n');
        }
        let model = if self.surface.model == Model::Quadratic { "QUADRATIC" } else { "LINEAR" };
        // Writing to a string does not fail.
        let _ = writeln!(out, "{model}");
        let _ = writeln!(out, "GRAVITY_CONSTANT: {}", exact(self.gravity()));
        out
    }

    /// A parameter's line with its present value, if that has changed.
    fn parameter_line(&self, line: &str, word: &str) -> Option<String> {
        if word != "parameter" {
            return None;
        }
        let rest = line.trim_start().get(word.len()..)?.trim_start();
        let name = rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()?;
        let key = name.to_lowercase();
        let now = self.variables.get(&key)?;
        let was = self.data.variables.get(&key)?;
        ((now - was).abs() > 0.0).then(|| format!("PARAMETER {name} = {}", exact(now)))
    }

    fn read_section(&self) -> String {
        let source = &self.data.source.text;
        let text = self.data.read_at.map_or("", |position| &source[offset(source, position)..]);
        let body = text.trim_start();
        let body =
            if body.get(..4).is_some_and(|word| word.eq_ignore_ascii_case("read")) { &body[4..] } else { "" };
        let mut out = body.trim_start_matches([' ', '\t', '\r', '\n']).trim_end().to_owned();
        if !out.is_empty() {
            out.push('\n');
        }
        out
    }

    /// One element as a datafile's line.
    pub(super) fn element_line(&self, element: Element) -> String {
        match element.kind {
            ElementKind::Vertex => self.vertex_line(VertexId::from_index(element.index)),
            ElementKind::Edge => self.edge_line(EdgeId::from_index(element.index)),
            ElementKind::Facet => self.facet_line(FacetId::from_index(element.index)),
            ElementKind::Body => self.body_line(BodyId::from_index(element.index)),
        }
    }

    fn common_text(&self, common: &Common, kind: ElementKind) -> String {
        let mut out = String::new();
        if common.fixed {
            out.push_str("  fixed");
        }
        let local: Vec<&str> = common
            .constraints
            .iter()
            .map(|id| &self.data.constraints[id.index()])
            .filter(|constraint| !constraint.global)
            .map(|constraint| &*constraint.name)
            .collect();
        if !local.is_empty() {
            out.push_str(if local.len() > 1 { "  constraints " } else { "  constraint " });
            out.push_str(&local.join(", "));
        }
        if let Some(boundary) = common.boundary {
            out.push_str("  boundary ");
            out.push_str(&self.data.boundaries[boundary.index()].name);
        }
        if common.color != 15 && kind != ElementKind::Vertex {
            let _ = write!(out, "  color {}", common.color);
        }
        for &quantity in &common.quantities {
            let _ = write!(out, "  {}", self.data.quantities[quantity as usize].name);
        }
        self.extra_text(&common.extra, kind, &mut out);
        out
    }

    fn extra_text(&self, extra: &[f64], kind: ElementKind, out: &mut String) {
        let mut at = 0;
        for attribute in self.surface.attributes.iter().filter(|attribute| attribute.kind == kind) {
            let values: Vec<String> =
                (0..attribute.length).map(|i| exact(extra.get(at + i).copied().unwrap_or(0.0))).collect();
            at += attribute.length;
            let _ = write!(out, "  {} {}", attribute.name, values.join(" "));
        }
    }

    fn vertex_line(&self, id: VertexId) -> String {
        let vertex = &self.surface.vertices[id];
        let mut out = format!("{}", id.index() + 1);
        let numbers: Vec<f64> = match vertex.common.boundary {
            Some(boundary) => vertex.parameters[..self.data.boundaries[boundary.index()].parameters].to_vec(),
            None => vertex.position.to_array()[..self.surface.dimension].to_vec(),
        };
        for number in numbers {
            let _ = write!(out, "  {}", exact(number));
        }
        out + &self.common_text(&vertex.common, ElementKind::Vertex)
    }

    fn wrap_text(&self, wrap: IVec3) -> String {
        if self.surface.periods.is_none() {
            return String::new();
        }
        let symbol = |n: i32| match n {
            0 => "*",
            n if n > 0 => "+",
            _ => "-",
        };
        let symbols: Vec<&str> =
            wrap.to_array()[..self.surface.dimension].iter().map(|&n| symbol(n)).collect();
        format!("  {}", symbols.join(" "))
    }

    fn edge_line(&self, id: EdgeId) -> String {
        let edge = &self.surface.edges[id];
        let mut out =
            format!("{}  {}  {}", id.index() + 1, edge.ends[0].index() + 1, edge.ends[1].index() + 1);
        if let Some(middle) = edge.middle {
            let _ = write!(out, "  {}", middle.index() + 1);
        }
        out.push_str(&self.wrap_text(edge.wrap));
        let usual = if self.surface.representation == Representation::String { 1.0 } else { 0.0 };
        if (edge.tension - usual).abs() > 0.0 {
            let _ = write!(out, "  density {}", exact(edge.tension));
        }
        for (on, word) in [(edge.no_refine, "no_refine"), (edge.noncontent, "noncontent")] {
            if on {
                let _ = write!(out, "  {word}");
            }
        }
        out + &self.common_text(&edge.common, ElementKind::Edge)
    }

    fn facet_line(&self, id: FacetId) -> String {
        let facet = &self.surface.facets[id];
        let mut out = format!("{} ", id.index() + 1);
        for directed in &facet.edges {
            let sign = if directed.reversed { "-" } else { "" };
            let _ = write!(out, " {sign}{}", directed.edge.index() + 1);
        }
        let usual = if self.surface.representation == Representation::String { 0.0 } else { 1.0 };
        if (facet.tension - usual).abs() > 0.0 {
            let _ = write!(out, "  density {}", exact(facet.tension));
        }
        for (on, word) in [(facet.no_refine, "no_refine"), (facet.noncontent, "noncontent")] {
            if on {
                let _ = write!(out, "  {word}");
            }
        }
        out + &self.common_text(&facet.common, ElementKind::Facet)
    }

    fn body_line(&self, id: BodyId) -> String {
        let body = &self.surface.bodies[id];
        let mut out = format!("{} ", body.id);
        for (facet, data) in self.surface.facets.enumerated() {
            for (side, sign) in ["", "-"].into_iter().enumerate() {
                if data.bodies[side] == Some(id) {
                    let _ = write!(out, " {sign}{}", facet.index() + 1);
                }
            }
        }
        if let Some(target) = body.target {
            let _ = write!(out, "  volume {}", exact(target));
            let multiplier = self.multipliers[FunctionalId::from_index(id.index())];
            let _ = write!(out, "  lagrange_multiplier {}", exact(multiplier));
        }
        if body.prescribed {
            let _ = write!(out, "  pressure {}", exact(body.pressure));
        }
        for (value, word) in [(body.volconst, "volconst"), (body.density, "density")] {
            if value.abs() > 0.0 {
                let _ = write!(out, "  {word} {}", exact(value));
            }
        }
        self.extra_text(&body.extra, ElementKind::Body, &mut out);
        out
    }

    /// What a quantity is held at, for callers that write tables.
    #[must_use]
    pub fn quantity_target(&self, name: &str) -> Option<f64> {
        let at = self.data.quantities.iter().position(|q| *q.name == *name)?;
        match self.quantities[at].purpose {
            Purpose::Fixed(target) => Some(target),
            _ => None,
        }
    }
}

/// Where a position lies in a text, in bytes.
fn offset(text: &str, position: crate::evolver::source::Position) -> usize {
    let mut start = 0;
    for (at, line) in text.split_inclusive('\n').enumerate() {
        if at + 1 == position.line as usize {
            let column = (position.column as usize).saturating_sub(1);
            return start + line.char_indices().nth(column).map_or(line.len(), |(byte, _)| byte);
        }
        start += line.len();
    }
    text.len()
}
