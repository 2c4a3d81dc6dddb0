//! A relaxed foam for other programs: VTK's XML poly data for ParaView, binary glTF for viewers.

use super::{
    foam_surface::{CellFigures, Piece, PieceKind},
    palette::{self, Colour},
};
use crate::{
    index::{Id, checked_u32},
    surface::WallSide,
};
use glam::DVec3;
use gltf::{
    Glb,
    binary::Header,
    json::{
        Accessor, Asset, Buffer, Index, Mesh, Node, Root, Scene,
        accessor::{ComponentType, GenericComponentType, Type},
        buffer::{Target, View},
        material::{AlphaMode, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor},
        mesh::{Mode, Primitive, Semantic},
        validation::{Checked, USize64},
    },
};
use std::{
    collections::BTreeMap,
    fmt::Display,
    io::{self, Write},
};

/// Writes all pieces as VTK poly data (`.vtp`, XML, plain text) with these figures per polygon: `kind` (0 film, 1 lower wall,
/// 2 upper wall), `cell`, `neighbour` (−1 at a wall), and of the cell its `sides`, `volume`, `pressure` and
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
    let mut file = Gltf { root: Root::default(), bytes: Vec::new(), buffer: Index::new(0) };
    for (sides, group) in groups {
        file.add(sides, &group);
    }
    writer.write_all(&file.finished()?)
}

/// Films in glTF are the colour of wax and let this much light through.
const FILM: (Colour, f32) = (Colour([0xd8, 0xc6, 0x9a]), 0.6);

struct Gltf {
    root: Root,
    bytes: Vec<u8>,
    buffer: Index<Buffer>,
}

impl Gltf {
    /// One mesh of one colour: films (`None`), or floors of cells with so many sides.
    fn add(&mut self, sides: Option<u32>, group: &[&Piece]) {
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
        let start = self.bytes.len();
        self.bytes.extend(places.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        let view = self.view(start, Target::ArrayBuffer);
        let mut positions = accessor(view, places.len(), ComponentType::F32, Type::Vec3);
        let fold = |pick: fn(f32, f32) -> f32, start: f32| {
            places.iter().fold([start; 3], |all, p| std::array::from_fn(|axis| pick(all[axis], p[axis])))
        };
        positions.min = Some(serde_json::json!(fold(f32::min, f32::INFINITY)));
        positions.max = Some(serde_json::json!(fold(f32::max, f32::NEG_INFINITY)));
        let positions = self.root.push(positions);
        let start = self.bytes.len();
        self.bytes.extend(corners.iter().flat_map(|corner: &u32| corner.to_le_bytes()));
        let view = self.view(start, Target::ElementArrayBuffer);
        let indices = self.root.push(accessor(view, corners.len(), ComponentType::U32, Type::Scalar));
        let name = sides.map_or_else(|| "films".to_owned(), |sides| format!("cells with {sides} sides"));
        let material = self.root.push(material(sides, &name));
        let primitive = Primitive {
            attributes: BTreeMap::from([(Checked::Valid(Semantic::Positions), positions)]),
            indices: Some(indices),
            mode: Checked::Valid(Mode::Triangles),
            material: Some(material),
            extensions: None,
            extras: Default::default(),
            targets: None,
        };
        let mesh = Mesh {
            name: Some(name.clone()),
            primitives: vec![primitive],
            extensions: None,
            extras: Default::default(),
            weights: None,
        };
        let mesh = Some(self.root.push(mesh));
        self.root.push(Node { name: Some(name), mesh, ..Node::default() });
    }

    /// The data from `start` on.
    fn view(&mut self, start: usize, target: Target) -> Index<View> {
        self.root.push(View {
            buffer: self.buffer,
            byte_offset: Some(USize64::from(start)),
            byte_length: USize64::from(self.bytes.len() - start),
            byte_stride: None,
            name: None,
            target: Some(Checked::Valid(target)),
            extensions: None,
            extras: Default::default(),
        })
    }

    fn finished(self) -> io::Result<Vec<u8>> {
        let Self { mut root, bytes, .. } = self;
        root.asset = Asset { generator: Some("combwright".to_owned()), ..Asset::default() };
        let nodes = (0..root.nodes.len()).map(|index| Index::new(checked_u32(index))).collect();
        let scene = root.push(Scene { nodes, name: None, extensions: None, extras: Default::default() });
        root.scene = Some(scene);
        root.push(Buffer {
            byte_length: USize64::from(bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let json = gltf::json::serialize::to_vec(&root)?;
        // The container's header and those of its two chunks, and the padding of both.
        let length = 12 + 8 + json.len().next_multiple_of(4) + 8 + bytes.len().next_multiple_of(4);
        let length = u32::try_from(length).map_err(io::Error::other)?;
        let header = Header { magic: *b"glTF", version: 2, length };
        Glb { header, json: json.into(), bin: Some(bytes.into()) }.to_vec().map_err(io::Error::other)
    }
}

fn accessor(view: Index<View>, count: usize, component: ComponentType, shape: Type) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64::from(count),
        component_type: Checked::Valid(GenericComponentType(component)),
        type_: Checked::Valid(shape),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
        extensions: None,
        extras: Default::default(),
    }
}

fn material(sides: Option<u32>, name: &str) -> gltf::json::Material {
    let (colour, alpha) = sides.map_or(FILM, |sides| (palette::of_sides(sides), 1.0));
    // glTF wants linear light; the square is near enough to the sRGB curve.
    let [r, g, b] = colour.0.map(|byte| (f32::from(byte) / 255.0).powi(2));
    gltf::json::Material {
        name: Some(name.to_owned()),
        alpha_mode: Checked::Valid(if sides.is_some() { AlphaMode::Opaque } else { AlphaMode::Blend }),
        double_sided: true,
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, alpha]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.7),
            ..PbrMetallicRoughness::default()
        },
        ..gltf::json::Material::default()
    }
}
