//! A binary glTF 2.0 file while it is being put together.

use crate::index::checked_u32;
use gltf::{
    Glb,
    binary::Header,
    json::{
        Accessor, Asset, Buffer, Index, Material, Mesh, Node, Root, Scene,
        accessor::{ComponentType, GenericComponentType, Type},
        buffer::{Target, View},
        mesh::{Mode, Primitive, Semantic},
        validation::{Checked, USize64},
    },
};
use serde_json::json;
use std::collections::BTreeMap;

/// Why a glTF file could not be put together.
#[derive(Debug, thiserror::Error)]
pub enum GltfError {
    /// More data than the format can hold.
    #[error("this needs {0} bytes and a GLB file ends at 4 GiB; use fewer cells or another format")]
    TooLarge(usize),
    /// The description could not be made.
    #[error("cannot describe the scene: {0}")]
    Json(#[from] serde_json::Error),
    /// The container could not be made.
    #[error("cannot make the container: {0}")]
    Container(#[from] gltf::Error),
}

/// The description of a scene and the data that it speaks of.
pub struct GltfFile {
    root: Root,
    bytes: Vec<u8>,
    buffer: Index<Buffer>,
}

impl GltfFile {
    /// An empty file that will hold about `size` bytes of data.
    #[must_use]
    pub fn with_capacity(size: usize) -> Self {
        let asset = Asset { generator: Some("combwright".to_owned()), ..Asset::default() };
        let root = Root { asset, ..Root::default() };
        Self { root, bytes: Vec::with_capacity(size), buffer: Index::new(0) }
    }

    /// Adds a material.
    pub fn add_material(&mut self, material: Material) -> Index<Material> {
        self.root.push(material)
    }

    /// Adds a mesh of triangles, three of `corners` each, and a node of the same name that shows it, moved by `translation`.
    pub fn add_mesh(
        &mut self,
        name: &str,
        places: &[[f32; 3]],
        corners: impl ExactSizeIterator<Item = u32>,
        material: Option<Index<Material>>,
        translation: Option<[f32; 3]>,
    ) {
        let positions = self.add_positions(places);
        let indices = self.add_corners(corners);
        let primitive = Primitive {
            attributes: BTreeMap::from([(Checked::Valid(Semantic::Positions), positions)]),
            indices: Some(indices),
            mode: Checked::Valid(Mode::Triangles),
            material,
            extensions: None,
            extras: Default::default(),
            targets: None,
        };
        let mesh = Mesh {
            name: Some(name.to_owned()),
            primitives: vec![primitive],
            extensions: None,
            extras: Default::default(),
            weights: None,
        };
        let mesh = Some(self.root.push(mesh));
        self.root.push(Node { name: Some(name.to_owned()), mesh, translation, ..Node::default() });
    }

    /// Hangs all nodes so far below this one.
    pub fn gather(&mut self, node: Node) {
        let children = (0..self.root.nodes.len()).map(|node| Index::new(checked_u32(node))).collect();
        let whole = self.root.push(Node { children: Some(children), ..node });
        self.show(vec![whole]);
    }

    /// The finished file; it shows the node that gathers all, or else every node.
    ///
    /// # Errors
    /// [`GltfError`], above all if the data exceed what the format holds.
    pub fn finished(mut self) -> Result<Vec<u8>, GltfError> {
        if self.root.scene.is_none() {
            self.show((0..self.root.nodes.len()).map(|node| Index::new(checked_u32(node))).collect());
        }
        let Self { mut root, bytes, .. } = self;
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
        let header_length = u32::try_from(length).map_err(|_| GltfError::TooLarge(length))?;
        let header = Header { magic: *b"glTF", version: 2, length: header_length };
        Ok(Glb { header, json: json.into(), bin: Some(bytes.into()) }.to_vec()?)
    }

    fn show(&mut self, nodes: Vec<Index<Node>>) {
        let scene = Scene { nodes, name: None, extensions: None, extras: Default::default() };
        self.root.scene = Some(self.root.push(scene));
    }

    fn add_positions(&mut self, places: &[[f32; 3]]) -> Index<Accessor> {
        let mut range = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for place in places {
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
        self.root.push(positions)
    }

    fn add_corners(&mut self, corners: impl ExactSizeIterator<Item = u32>) -> Index<Accessor> {
        let start = self.bytes.len();
        let count = corners.len();
        self.bytes.extend(corners.flat_map(u32::to_le_bytes));
        let view = self.view(start, Target::ElementArrayBuffer);
        self.root.push(accessor(view, count, ComponentType::U32, Type::Scalar))
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
