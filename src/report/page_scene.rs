//! What the page shows in three dimensions: layers of triangles, some of them coloured by cell.

use super::{
    foam_surface::{CellFigures, Piece, PieceKind},
    palette::{Colour, GREY, ORANGE, SKY},
};
use crate::{
    enclosure::Enclosure,
    index::{Id, checked_u32},
    mesh::TriMesh,
    surface::WallSide,
    tessellation::{CellPattern, CellStatus, defects},
};
use glam::DVec3;
use serde_json::{Value, json};
use std::{collections::BTreeMap, io::Write as _};

/// A scene with its layers.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What it shows.
    pub caption: String,
    /// Its layers.
    pub layers: Vec<Layer>,
}

/// Triangles that are shown or hidden together.
#[derive(Clone, Debug)]
pub struct Layer {
    /// What the control is called.
    pub name: String,
    /// The colour, where there are no cells.
    pub colour: Colour,
    /// 1, or less for a translucent layer.
    pub opacity: f64,
    /// Whether it is shown at first.
    pub shown: bool,
    /// Corners.
    pub positions: Vec<DVec3>,
    /// Triangles, as places in `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// Dark lines, as pairs of ends.
    pub lines: Vec<[DVec3; 2]>,
    /// Lines between the cells of 5–7 pairs.
    pub pairs: Vec<[DVec3; 2]>,
    /// Cells, where triangles belong to cells.
    pub cells: Option<LayerCells>,
}

/// Which cell a corner belongs to, and what is known of cells.
#[derive(Clone, Debug)]
pub struct LayerCells {
    /// Of each corner, its cell.
    pub of_corner: Vec<u16>,
    /// Of each cell, its sides; none where it does not count.
    pub sides: Vec<Option<u32>>,
    /// Other figures of each cell by name: `curvature`, `area`, `volume`, `pressure`.
    pub figures: BTreeMap<&'static str, Vec<f64>>,
}

impl Layer {
    fn new(name: &str, colour: Colour) -> Self {
        Self {
            name: name.to_owned(),
            colour,
            opacity: 1.0,
            shown: true,
            positions: Vec::new(),
            triangles: Vec::new(),
            lines: Vec::new(),
            pairs: Vec::new(),
            cells: None,
        }
    }

    /// Adds polygons over new corners.
    fn add(&mut self, points: &[DVec3], polygons: &[Vec<usize>]) {
        let first = self.positions.len();
        self.positions.extend(points);
        for polygon in polygons {
            for at in 1..polygon.len().saturating_sub(1) {
                let corner = |of: usize| checked_u32(first + polygon[of]);
                self.triangles.push([corner(0), corner(at), corner(at + 1)]);
            }
        }
    }

    fn add_mesh(&mut self, mesh: &TriMesh, moved: DVec3) {
        let first = checked_u32(self.positions.len());
        self.positions.extend(mesh.positions.iter().map(|p| *p + moved));
        let corners = |t: &[crate::mesh::VertexId; 3]| t.map(|id| first + checked_u32(id.index()));
        self.triangles.extend(mesh.triangles.iter().map(corners));
    }

    /// The layer as the page's script reads it: points as fractions of the box from `low` to `high`, in 16 bits each, which is
    /// a few thousandths of a millimetre; corners of triangles in 16 bits where that is enough.
    fn data(&self, [low, high]: [DVec3; 2]) -> Value {
        let corners = || self.triangles.iter().flatten();
        let narrow: Option<Vec<u16>> = corners().map(|i| u16::try_from(*i).ok()).collect();
        let triangles: Vec<u8> = match &narrow {
            Some(narrow) => narrow.iter().flat_map(|i| i.to_le_bytes()).collect(),
            None => corners().flat_map(|i| i.to_le_bytes()).collect(),
        };
        let points = |points: &mut dyn Iterator<Item = DVec3>| encoded(&fractions(points, low, high));
        let mut data = json!({
            "name": self.name,
            "colour": self.colour.hex(),
            "opacity": self.opacity,
            "shown": self.shown,
            "positions": points(&mut self.positions.iter().copied()),
            "triangles": encoded(&triangles),
            "bits": if narrow.is_some() { 16 } else { 32 },
        });
        if !self.lines.is_empty() {
            data["lines"] = json!(points(&mut self.lines.iter().flatten().copied()));
        }
        if !self.pairs.is_empty() {
            let ends: Vec<[f32; 3]> = self.pairs.iter().flatten().map(|p| p.as_vec3().to_array()).collect();
            data["pairs"] = json!(ends);
        }
        if let Some(cells) = &self.cells {
            let of_corner: Vec<u8> = cells.of_corner.iter().flat_map(|cell| cell.to_le_bytes()).collect();
            data["cell_of_vertex"] = json!(encoded(&of_corner));
            let mut figures = json!({ "sides": cells.sides });
            for (name, values) in &cells.figures {
                // Six digits are more than a colour shows.
                let short: Vec<Value> =
                    values.iter().map(|v| json!(format!("{v:.6e}").parse::<f64>().ok())).collect();
                figures[*name] = json!(short);
            }
            data["cells"] = figures;
        }
        data
    }
}

impl Scene {
    /// The scene as the page's script reads it.
    #[must_use]
    pub fn data(&self) -> Value {
        let places = || self.layers.iter().flat_map(|layer| &layer.positions).copied();
        let low = places().reduce(DVec3::min).unwrap_or(DVec3::ZERO);
        let high = places().reduce(DVec3::max).unwrap_or(DVec3::ONE);
        json!({
            "low": low.to_array(),
            "high": high.to_array(),
            "layers": self.layers.iter().map(|layer| layer.data([low, high])).collect::<Vec<_>>(),
        })
    }

    /// An enclosure put together.
    #[must_use]
    pub fn enclosure(enclosure: &Enclosure, caption: String) -> Self {
        let layers = enclosure.parts.iter().map(|part| {
            let (colour, opacity) = match part.name {
                "inner-shell" => (ORANGE, 1.0),
                "outer-shell" => (SKY, 0.45),
                _ => (Colour([0xb8, 0xb2, 0xa6]), 1.0),
            };
            let mut layer = Layer::new(&part.name.replace('-', " "), colour);
            layer.opacity = opacity;
            layer.add_mesh(part.solid.mesh(), enclosure.assembled(part));
            layer
        });
        // Translucent layers come last, or they would hide what lies behind them.
        let (clear, glassy): (Vec<Layer>, Vec<Layer>) = layers.partition(|layer| layer.opacity >= 1.0);
        Self { caption, layers: [clear, glassy].concat() }
    }

    /// A relaxed foam: its films and the lower wall with its cells.
    #[must_use]
    pub fn foam(pieces: &[Piece], figures: &CellFigures, pattern: &CellPattern, caption: String) -> Self {
        let mut films = Layer::new("films", Colour([0xd8, 0xc6, 0x9a]));
        films.opacity = 0.55;
        let mut cells = Layer::new("cells", GREY);
        let mut of_corner = Vec::new();
        for piece in pieces {
            match piece.kind {
                PieceKind::Film { .. } => films.add(&piece.points, &piece.polygons),
                PieceKind::Wall(WallSide::Lower) => {
                    cells.add(&piece.points, &piece.polygons);
                    let cell = u16::try_from(piece.cell.index()).unwrap_or(u16::MAX);
                    of_corner.resize(cells.positions.len(), cell);
                    cells.lines.extend(ring(&piece.points[..piece.outline]));
                }
                PieceKind::Wall(WallSide::Upper) => {}
            }
        }
        let known = |value: fn(&crate::tessellation::Cell) -> f64| pattern.cells.iter().map(value).collect();
        cells.cells = Some(LayerCells {
            of_corner,
            sides: pattern.cells.iter().map(|cell| cell.sides).collect(),
            figures: BTreeMap::from([
                ("volume", figures.volumes.clone()),
                ("pressure", figures.pressures.clone()),
                ("area", known(|cell| cell.area)),
                ("curvature", known(|cell| cell.gauss_curvature.unwrap_or(f64::NAN))),
            ]),
        });
        cells.pairs = pair_lines(pattern);
        Self { caption, layers: vec![cells, films] }
    }

    /// Comb mapped onto a wall: the wall, and on it the outlines of the cells. `outlines` go with the cells of all patterns, one
    /// after the other; `lift` keeps them off the wall.
    #[must_use]
    pub fn comb(
        wall: &TriMesh,
        patterns: &[(&CellPattern, Vec<Vec<DVec3>>)],
        lift: f64,
        caption: String,
    ) -> Self {
        let mut bare = Layer::new("wall", Colour([0xe4, 0xe0, 0xd6]));
        bare.add_mesh(wall, DVec3::ZERO);
        let mut cells = Layer::new("cells", GREY);
        let mut known = LayerCells { of_corner: Vec::new(), sides: Vec::new(), figures: BTreeMap::new() };
        for (pattern, outlines) in patterns {
            for ((_, cell), outline) in pattern.cells.enumerated().zip(outlines) {
                if cell.status != CellStatus::Complete || outline.len() < 3 {
                    continue;
                }
                let raised = |p: &DVec3| *p + lift * cell.normal;
                let edge: Vec<DVec3> = outline.iter().map(raised).collect();
                cells.lines.extend(ring(&edge));
                let count = edge.len();
                let fan: Vec<Vec<usize>> = (0..count).map(|i| vec![i, (i + 1) % count, count]).collect();
                let points: Vec<DVec3> = edge.into_iter().chain([raised(&cell.position)]).collect();
                cells.add(&points, &fan);
                let number = u16::try_from(known.sides.len()).unwrap_or(u16::MAX);
                known.of_corner.resize(cells.positions.len(), number);
                known.sides.push(cell.sides);
                known.figures.entry("area").or_default().push(cell.area);
                known.figures.entry("curvature").or_default().push(cell.gauss_curvature.unwrap_or(f64::NAN));
            }
            let raised = pair_lines(pattern);
            cells.pairs.extend(raised);
        }
        cells.cells = Some(known);
        Self { caption, layers: vec![bare, cells] }
    }
}

/// The sides of a closed ring.
fn ring(points: &[DVec3]) -> impl Iterator<Item = [DVec3; 2]> {
    points.iter().zip(points.iter().cycle().skip(1)).map(|(a, b)| [*a, *b])
}

/// Lines between the cells of 5–7 pairs, off the surface by a tenth of a cell; pairs across a period have none.
fn pair_lines(pattern: &CellPattern) -> Vec<[DVec3; 2]> {
    let raised = |id| {
        let cell: &crate::tessellation::Cell = &pattern.cells[id];
        cell.position + 0.12 * cell.area.sqrt() * cell.normal
    };
    let near = |pair: &crate::tessellation::Pair| {
        let [few, many] = [pair.few, pair.many].map(|id| &pattern.cells[id]);
        few.position.distance(many.position) < 3.0 * few.area.max(many.area).sqrt()
    };
    defects(pattern)
        .pairs
        .iter()
        .filter(|pair| near(pair))
        .map(|pair| [raised(pair.few), raised(pair.many)])
        .collect()
}

/// Points as fractions of a box, three little-endian numbers of 16 bits each.
fn fractions(points: impl Iterator<Item = DVec3>, low: DVec3, high: DVec3) -> Vec<u8> {
    let size = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
    let fraction = |share: f64| (share.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16;
    points
        .flat_map(|p| ((p - low) / size).to_array())
        .flat_map(|share| fraction(share).to_le_bytes())
        .collect()
}

/// Base 64.
pub(super) fn encoded(bytes: &[u8]) -> String {
    let mut encoder = base64::write::EncoderStringWriter::new(&base64::engine::general_purpose::STANDARD);
    // Writing to a string does not fail.
    let _: std::io::Result<()> = encoder.write_all(bytes);
    encoder.into_inner()
}
