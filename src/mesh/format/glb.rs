//! Binary glTF 2.0.

use super::{Part, WriteError, check_names, rounded};
use crate::index::{Id, checked_u32};
use gltf::{
    Glb,
    binary::Header,
    json::{
        Accessor, Asset, Buffer, Index, Mesh, Node, Root, Scene,
        accessor::{ComponentType, GenericComponentType, Type},
        buffer::{Target, View},
        mesh::{Mode, Primitive, Semantic},
        scene::UnitQuaternion,
        validation::{Checked, USize64},
    },
};
use serde_json::json;
use std::{collections::BTreeMap, f32::consts::FRAC_1_SQRT_2, io::Write};

/// Writes binary glTF: each part a node with its name and place, below a node that turns millimetres with z up into glTF's
/// metres with y up. Faces are flat: without normals a viewer takes them from the triangles.
///
/// # Errors
/// [`WriteError`] if the writer fails, or before the first byte if a name is bad, rounding breaks a mesh or the parts need
/// more than 4 GiB.
pub fn write_glb(parts: &[Part], writer: &mut impl Write) -> Result<(), WriteError> {
    check_names(parts)?;
    let size = 24 * parts.iter().map(|part| part.mesh.mesh().positions.len()).sum::<usize>();
    let mut file = File { root: Root::default(), bytes: Vec::with_capacity(size), buffer: Index::new(0) };
    for part in parts {
        file.add_part(part)?;
    }
    let File { mut root, bytes, .. } = file;
    root.asset = Asset { generator: Some("combwright".to_owned()), ..Asset::default() };
    finish_scene(&mut root);
    root.push(Buffer {
        byte_length: USize64::from(bytes.len()),
        name: None,
        uri: None,
        extensions: None,
        extras: Default::default(),
    });
    let json = gltf::json::serialize::to_vec(&root).map_err(failed)?;
    // The container's header and those of its two chunks, and the padding of both.
    let length = 12 + 8 + json.len().next_multiple_of(4) + 8 + bytes.len().next_multiple_of(4);
    let Ok(header_length) = u32::try_from(length) else {
        return Err(WriteError::TooLarge { format: "GLB", bytes: length });
    };
    let header = Header { magic: *b"glTF", version: 2, length: header_length };
    let bytes = Glb { header, json: json.into(), bin: Some(bytes.into()) }.to_vec().map_err(failed)?;
    Ok(writer.write_all(&bytes)?)
}

/// The description and the data it speaks of.
struct File {
    root: Root,
    bytes: Vec<u8>,
    buffer: Index<Buffer>,
}

impl File {
    fn add_part(&mut self, part: &Part) -> Result<(), WriteError> {
        let mesh = part.mesh.mesh();
        let places = rounded(mesh, |p| p)?;
        let mut range = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for place in &places {
            for (axis, &x) in place.iter().enumerate() {
                range[0][axis] = range[0][axis].min(x);
                range[1][axis] = range[1][axis].max(x);
            }
        }
        let start = self.bytes.len();
        self.bytes.extend(places.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        let view = self.view(start, Target::ArrayBuffer);
        let mut positions = accessor(view, places.len(), ComponentType::F32, Type::Vec3);
        [positions.min, positions.max] = range.map(|corner| Some(json!(corner)));
        let positions = self.root.push(positions);

        let start = self.bytes.len();
        let corners = mesh.triangles.iter().flatten();
        self.bytes.extend(corners.flat_map(|v| checked_u32(v.index()).to_le_bytes()));
        let view = self.view(start, Target::ElementArrayBuffer);
        let indices = accessor(view, 3 * mesh.triangles.len(), ComponentType::U32, Type::Scalar);
        let indices = self.root.push(indices);

        let primitive = Primitive {
            attributes: BTreeMap::from([(Checked::Valid(Semantic::Positions), positions)]),
            indices: Some(indices),
            mode: Checked::Valid(Mode::Triangles),
            extensions: None,
            extras: Default::default(),
            material: None,
            targets: None,
        };
        let name = Some(part.name.to_owned());
        let mesh = Mesh {
            name: name.clone(),
            primitives: vec![primitive],
            extensions: None,
            extras: Default::default(),
            weights: None,
        };
        let mesh = Some(self.root.push(mesh));
        self.root.push(Node {
            name,
            mesh,
            translation: Some(super::single(part.placement)),
            ..Node::default()
        });
        Ok(())
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

/// Hangs the parts' nodes below one that turns z up into y up (−90° about x) and mm into m, and shows that.
fn finish_scene(root: &mut Root) {
    let children = (0..root.nodes.len()).map(|node| Index::new(checked_u32(node))).collect();
    let whole = root.push(Node {
        name: Some("combwright".to_owned()),
        children: Some(children),
        rotation: Some(UnitQuaternion([-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2])),
        scale: Some([1e-3; 3]),
        ..Node::default()
    });
    root.scene = Some(root.push(Scene {
        nodes: vec![whole],
        name: None,
        extensions: None,
        extras: Default::default(),
    }));
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> WriteError {
    WriteError::Gltf(Box::new(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::format::tests::{ball, parts, torus};

    #[test]
    fn glb_is_valid_and_holds_the_parts() -> Result<(), WriteError> {
        let (torus, ball) = (torus(), ball());
        let parts = parts(&torus, &ball);
        let mut bytes = Vec::new();
        write_glb(&parts, &mut bytes)?;
        // This checks the description against the specification's rules.
        let read = gltf::Gltf::from_slice(&bytes).map_err(failed)?;
        let Some(blob) = read.blob.as_deref() else { panic!("no data") };
        let nodes: Vec<_> = read.nodes().filter(|node| node.mesh().is_some()).collect();
        assert_eq!(nodes.len(), 2);
        for (node, part) in nodes.iter().zip(&parts) {
            assert_eq!(node.name(), Some(part.name));
            let (translation, ..) = node.transform().decomposed();
            assert_eq!(translation.map(f32::to_bits), super::super::single(part.placement).map(f32::to_bits));
            let Some(primitive) = node.mesh().and_then(|mesh| mesh.primitives().next()) else {
                panic!("no mesh")
            };
            let Some(positions) = primitive.get(&Semantic::Positions) else { panic!("no positions") };
            let mesh = part.mesh.mesh();
            assert_eq!(positions.count(), mesh.positions.len());
            assert_eq!(primitive.indices().map(|i| i.count()), Some(3 * mesh.triangles.len()));
            let start = positions.view().map_or(0, |view| view.offset());
            let x = f32::from_le_bytes([blob[start], blob[start + 1], blob[start + 2], blob[start + 3]]);
            // Half a step of single precision below 8.
            assert!((f64::from(x) - mesh.positions.as_slice()[0].x).abs() < 4e-7);
        }
        Ok(())
    }
}
