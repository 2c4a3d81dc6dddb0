//! The sections of elements: one element a line.

use super::{Attributes, BodyLine, EdgeLine, FaceLine, Reader, VertexLine};
use crate::evolver::{
    error::EvolverError,
    language::{TokenKind, expression::ElementKind},
};

/// Colours by name; their places are Surface Evolver's numbers.
pub(crate) const COLORS: [&str; 16] = [
    "black",
    "blue",
    "green",
    "cyan",
    "red",
    "magenta",
    "brown",
    "lightgray",
    "darkgray",
    "lightblue",
    "lightgreen",
    "lightcyan",
    "lightred",
    "lightmagenta",
    "yellow",
    "white",
];

/// More elements than this are refused before they exhaust the memory.
const ELEMENT_LIMIT: usize = 20_000_000;

impl Reader {
    /// Whether another element's line begins here.
    fn another(&mut self) -> Result<bool, EvolverError> {
        let count =
            self.data.vertices.len() + self.data.edges.len() + self.data.faces.len() + self.data.bodies.len();
        if count > ELEMENT_LIMIT {
            return self
                .cursor
                .invalid(self.cursor.position(), format!("more than {ELEMENT_LIMIT} elements"));
        }
        Ok(matches!(self.cursor.kind(), TokenKind::Number(_, true)))
    }

    fn section(&mut self) {
        self.cursor.bump();
        self.cursor.accept(":");
    }

    pub(super) fn vertices(&mut self) -> Result<(), EvolverError> {
        self.section();
        while self.another()? {
            let position = self.cursor.position();
            let id = self.cursor.integer()?;
            let mut numbers = Vec::new();
            while !self.cursor.token().first_on_line
                && !self.cursor.at_end()
                && !self.at_attribute(ElementKind::Vertex)
            {
                numbers.push(self.number()?);
                self.cursor.accept(",");
            }
            let attributes = self.attributes(ElementKind::Vertex)?;
            if attributes.boundary.is_none() && numbers.len() != self.data.dimension {
                let message = format!(
                    "vertex {id} has {} coordinates, {} are needed",
                    numbers.len(),
                    self.data.dimension
                );
                return self.cursor.invalid(position, message);
            }
            self.data.vertices.push(VertexLine { id, position, numbers, attributes });
        }
        Ok(())
    }

    pub(super) fn edges(&mut self) -> Result<(), EvolverError> {
        self.section();
        while self.another()? {
            let position = self.cursor.position();
            let id = self.cursor.integer()?;
            let ends = [self.cursor.integer()?, self.cursor.integer()?];
            let here = !self.cursor.token().first_on_line;
            let middle = if here && matches!(self.cursor.kind(), TokenKind::Number(_, true)) {
                Some(self.cursor.integer()?)
            } else {
                None
            };
            let wrap = self.wrap()?;
            let attributes = self.attributes(ElementKind::Edge)?;
            self.data.edges.push(EdgeLine { id, position, ends, middle, wrap, attributes });
        }
        Ok(())
    }

    /// The wrap symbols `+`, `-`, `*` of an edge in a torus; also `++`, `--` for two periods.
    fn wrap(&mut self) -> Result<[i32; 3], EvolverError> {
        let mut wrap = [0; 3];
        let dimension = self.data.dimension;
        let mut axis = 0;
        while !self.cursor.token().first_on_line {
            let value = match self.cursor.kind() {
                TokenKind::Symbol("+") => 1,
                TokenKind::Symbol("-") => -1,
                TokenKind::Symbol("*") => 0,
                // Two stars that touch are two symbols.
                TokenKind::Symbol("**") => {
                    axis += 1;
                    0
                }
                _ => break,
            };
            if axis >= dimension {
                return self.cursor.expected("an attribute: there are as many wrap symbols as dimensions");
            }
            wrap[axis] = value;
            self.cursor.bump();
            axis += 1;
        }
        if axis > 0 && axis != dimension {
            return self.cursor.expected(&format!("{dimension} wrap symbols, each «+», «-» or «*»"));
        }
        if axis > 0 && self.data.periods.is_none() {
            let message = "an edge with wrap symbols needs TORUS or TORUS_FILLED at the head of the file";
            return self.cursor.invalid(self.cursor.position(), message);
        }
        Ok(wrap)
    }

    pub(super) fn faces(&mut self) -> Result<(), EvolverError> {
        self.section();
        while self.another()? {
            let position = self.cursor.position();
            let id = self.cursor.integer()?;
            let edges = self.signed_list()?;
            let attributes = self.attributes(ElementKind::Facet)?;
            self.data.faces.push(FaceLine { id, position, edges, attributes });
        }
        Ok(())
    }

    pub(super) fn bodies(&mut self) -> Result<(), EvolverError> {
        self.section();
        while self.another()? {
            let position = self.cursor.position();
            let id = self.cursor.integer()?;
            let faces = self.signed_list()?;
            let attributes = self.attributes(ElementKind::Body)?;
            self.data.bodies.push(BodyLine { id, position, faces, attributes });
        }
        Ok(())
    }

    /// Whether a word that is an attribute of elements of this kind stands here.
    fn at_attribute(&self, kind: ElementKind) -> bool {
        let Some(word) = self.cursor.word() else { return false };
        ATTRIBUTES.contains(&word.as_str())
            || self.data.extra_attributes.iter().any(|extra| extra.kind == kind && *extra.name == *word)
            || self.is_quantity(&word)
    }

    fn is_quantity(&self, word: &str) -> bool {
        self.instances.contains_key(word) || self.data.quantities.iter().any(|q| *q.name == *word)
    }

    fn attributes(&mut self, kind: ElementKind) -> Result<Attributes, EvolverError> {
        let mut out = Attributes::default();
        while !self.cursor.token().first_on_line && !self.cursor.at_end() {
            if self.cursor.accept(",") {
                continue;
            }
            let position = self.cursor.position();
            let Some(word) = self.cursor.word() else {
                return self
                    .cursor
                    .expected(&format!("an attribute of the {}, or the next line", kind.name()));
            };
            self.cursor.bump();
            match word.as_str() {
                "fixed" => out.fixed = true,
                "constraint" | "constraints" => self.labels(&mut out.constraints)?,
                "boundary" => out.boundary = Some((self.label()?, position)),
                "tension" => out.tension = Some(self.number()?),
                "density" if kind == ElementKind::Body => out.density = Some(self.number()?),
                "density" => out.tension = Some(self.number()?),
                "color" | "frontcolor" => out.color = Some(self.color()?),
                "backcolor" => {
                    self.color()?;
                }
                "original" => out.original = Some(self.cursor.integer()?),
                "no_refine" => out.no_refine = true,
                "noncontent" => out.noncontent = true,
                "volume" => out.volume = Some(self.number()?),
                "volconst" => out.volconst = Some(self.number()?),
                "pressure" => out.pressure = Some(self.number()?),
                "lagrange_multiplier" | "actual_volume" | "opacity" => {
                    self.number()?;
                }
                "bare" | "no_display" | "nodisplay" | "no_transform" | "centerofmass" | "hit_partner" => {}
                "orientation" => {
                    self.number()?;
                }
                "wrap" | "phase" | "vertex_constraint" | "axial_point" | "value" => {
                    return self.cursor.unsupported(position, &format!("the attribute {word}"), "");
                }
                _ => self.other_attribute(&word, kind, &mut out)?,
            }
        }
        Ok(out)
    }

    fn other_attribute(
        &mut self,
        word: &str,
        kind: ElementKind,
        out: &mut Attributes,
    ) -> Result<(), EvolverError> {
        let extra =
            self.data.extra_attributes.iter().find(|extra| extra.kind == kind && *extra.name == *word);
        if let Some(extra) = extra.cloned() {
            let braces = self.cursor.accept("{");
            let mut values = Vec::with_capacity(extra.length);
            for _ in 0..extra.length {
                values.push(self.number()?);
                self.cursor.accept(",");
            }
            if braces {
                self.cursor.expect("}")?;
            }
            out.extra.push((extra.name, values));
            return Ok(());
        }
        if self.is_quantity(word) {
            out.quantities.push(word.into());
            return Ok(());
        }
        let at = self.cursor.mark();
        self.cursor.rewind(at - 1);
        self.cursor.expected(&format!("an attribute of the {}, or the next line", kind.name()))
    }

    fn color(&mut self) -> Result<i32, EvolverError> {
        if let Some(word) = self.cursor.word() {
            if let Some(number) = COLORS.iter().position(|color| *color == word) {
                self.cursor.bump();
                return Ok(i32::try_from(number).unwrap_or(0));
            }
            if word == "clear" {
                self.cursor.bump();
                return Ok(-1);
            }
        }
        let value = self.number()?;
        #[expect(clippy::cast_possible_truncation, reason = "colours are small numbers; others are clamped")]
        let color = value as i32;
        Ok(color)
    }
}

/// Words that begin an attribute in the line of a vertex.
const ATTRIBUTES: [&str; 27] = [
    "fixed",
    "constraint",
    "constraints",
    "boundary",
    "tension",
    "density",
    "color",
    "frontcolor",
    "backcolor",
    "original",
    "no_refine",
    "noncontent",
    "volume",
    "volconst",
    "pressure",
    "lagrange_multiplier",
    "actual_volume",
    "opacity",
    "bare",
    "no_display",
    "nodisplay",
    "no_transform",
    "centerofmass",
    "orientation",
    "wrap",
    "axial_point",
    "hit_partner",
];
