//! A relaxed foam for other programs: VTK's XML poly data for ParaView, binary glTF for viewers.

use super::{
    foam_surface::{CellFigures, Piece, PieceKind},
    palette::{self, Colour},
};
use crate::{
    index::{Id, checked_u32},
    mesh::GltfFile,
    surface::WallSide,
};
use glam::DVec3;
use gltf::json::{
    Material,
    material::{AlphaMode, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor},
    validation::Checked,
};
use std::{
    collections::BTreeMap,
    fmt::Display,
    io::{self, Write},
};

/// Writes all pieces as VTK poly data (`.vtp`, XML, plain text) with these figures per polygon: `kind` (0 film, 1 lower wall,
/// 2 upper wall), `cell`, `neighbour` (−1 at a wall), and of the cell its `sides` (0 for one that is cut), `volume`, `pressure` and
/// `gauss_curvature`.
///
/// # Errors
/// What the writer says.
pub fn write_vtp(writer: &mut impl Write, pieces: &[Piece], figures: &CellFigures) -> io::Result<()> {
    let points: Vec<DVec3> = pieces.iter().flat_map(|piece| &piece.points).copied().collect();
    let mut corners = Vec::new();
    let mut ends = Vec::new();
    let mut first = 0;
    for piece in pieces {
        for polygon in &piece.polygons {
            corners.extend(polygon.iter().map(|corner| first + corner));
            ends.push(corners.len());
        }
        first += piece.points.len();
    }
    writeln!(writer, "<?xml version=\"1.0\"?>")?;
    writeln!(writer, "<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n<PolyData>")?;
    writeln!(writer, "<Piece NumberOfPoints=\"{}\" NumberOfPolys=\"{}\">", points.len(), ends.len())?;
    writeln!(writer, "<Points>")?;
    let coordinates = points.iter().flat_map(|point| point.to_array());
    array(writer, "Float64\" NumberOfComponents=\"3", "points", coordinates)?;
    writeln!(writer, "</Points>\n<Polys>")?;
    array(writer, "Int64", "connectivity", corners.iter())?;
    array(writer, "Int64", "offsets", ends.iter())?;
    writeln!(writer, "</Polys>\n<CellData Scalars=\"sides\">")?;
    array(writer, "Int32", "kind", per_polygon(pieces, |piece| kind(piece.kind)))?;
    array(writer, "Int32", "cell", per_polygon(pieces, |piece| piece.cell.index()))?;
    array(writer, "Int32", "neighbour", per_polygon(pieces, |piece| neighbour(piece.kind)))?;
    array(writer, "Int32", "sides", per_polygon(pieces, |piece| figures.of(piece.cell).0))?;
    array(writer, "Float64", "volume", per_polygon(pieces, |piece| figures.of(piece.cell).1))?;
    array(writer, "Float64", "pressure", per_polygon(pieces, |piece| figures.of(piece.cell).2))?;
    array(writer, "Float64", "gauss_curvature", per_polygon(pieces, |piece| figures.of(piece.cell).3))?;
    writeln!(writer, "</CellData>\n</Piece>\n</PolyData>\n</VTKFile>")
}

fn kind(kind: PieceKind) -> i32 {
    match kind {
        PieceKind::Film { .. } => 0,
        PieceKind::Wall(WallSide::Lower) => 1,
        PieceKind::Wall(WallSide::Upper) => 2,
    }
}

fn neighbour(kind: PieceKind) -> i64 {
    match kind {
        PieceKind::Film { neighbour } => i64::try_from(neighbour.index()).unwrap_or(-1),
        PieceKind::Wall(_) => -1,
    }
}

fn per_polygon<'a, T: Copy + 'a>(
    pieces: &'a [Piece],
    figure: impl Fn(&Piece) -> T + 'a,
) -> impl Iterator<Item = T> + 'a {
    pieces.iter().flat_map(move |piece| std::iter::repeat_n(figure(piece), piece.polygons.len()))
}

pub(super) fn array<T: Display>(
    writer: &mut impl Write,
    kind: &str,
    name: &str,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    writeln!(writer, "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">")?;
    for value in values {
        write!(writer, "{value} ")?;
    }
    writeln!(writer, "\n</DataArray>")
}

/// Writes films and lower wall as binary glTF: one mesh per colour, films translucent, the wall coloured by sides.
///
/// # Errors
/// What the writer says, or that the foam is too large for the format.
pub fn write_glb(writer: &mut impl Write, pieces: &[Piece], figures: &CellFigures) -> io::Result<()> {
    let mut groups: BTreeMap<Option<u32>, Vec<&Piece>> = BTreeMap::new();
    for piece in pieces {
        match piece.kind {
            PieceKind::Film { .. } => groups.entry(None).or_default().push(piece),
            PieceKind::Wall(WallSide::Lower) => {
                groups.entry(Some(figures.of(piece.cell).0)).or_default().push(piece);
            }
            PieceKind::Wall(WallSide::Upper) => {}
        }
    }
    let mut file = GltfFile::with_capacity(0);
    for (sides, group) in groups {
        add_group(&mut file, sides, &group);
    }
    writer.write_all(&file.finished().map_err(io::Error::other)?)
}

/// Films in glTF are the colour of wax and let this much light through.
const FILM: (Colour, f32) = (Colour([0xd8, 0xc6, 0x9a]), 0.6);

/// One mesh of one colour: films (`None`), or floors of cells with so many sides.
fn add_group(file: &mut GltfFile, sides: Option<u32>, group: &[&Piece]) {
    let (mut places, mut corners) = (Vec::new(), Vec::new());
    for piece in group {
        let first = checked_u32(places.len());
        // glTF has y up.
        places.extend(piece.points.iter().map(|p| DVec3::new(p.x, p.z, -p.y).as_vec3().to_array()));
        for polygon in &piece.polygons {
            for at in 1..polygon.len() - 1 {
                corners.extend([0, at, at + 1].map(|at| first + checked_u32(polygon[at])));
            }
        }
    }
    let name = match sides {
        None => "films".to_owned(),
        Some(0) => "cut cells".to_owned(),
        Some(sides) => format!("cells with {sides} sides"),
    };
    let material = file.add_material(material(sides, &name));
    file.add_mesh(&name, &places, corners.into_iter(), Some(material), None);
}

fn material(sides: Option<u32>, name: &str) -> Material {
    let (colour, alpha) = match sides {
        None => FILM,
        Some(0) => (palette::GREY, 1.0),
        Some(sides) => (palette::of_sides(sides), 1.0),
    };
    // glTF wants linear light; the square is near enough to the sRGB curve.
    let [r, g, b] = colour.0.map(|byte| (f32::from(byte) / 255.0).powi(2));
    Material {
        name: Some(name.to_owned()),
        alpha_mode: Checked::Valid(if sides.is_some() { AlphaMode::Opaque } else { AlphaMode::Blend }),
        double_sided: true,
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, alpha]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.7),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
}
