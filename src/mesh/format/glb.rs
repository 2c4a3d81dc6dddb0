//! Binary glTF 2.0.

use super::{GltfFile, Part, WriteError, check_names, rounded};
use crate::index::{Id, checked_u32};
use gltf::json::{Node, scene::UnitQuaternion};
use std::{f32::consts::FRAC_1_SQRT_2, io::Write};

/// Writes binary glTF: each part a node with its name and place, below a node that turns millimetres with z up into glTF's
/// metres with y up. Faces are flat: without normals a viewer takes them from the triangles.
///
/// # Errors
/// [`WriteError`] if the writer fails, or before the first byte if a name is bad, rounding breaks a mesh or the parts need
/// more than 4 GiB.
pub fn write_glb(parts: &[Part], writer: &mut impl Write) -> Result<(), WriteError> {
    check_names(parts)?;
    let size = 24 * parts.iter().map(|part| part.mesh.mesh().positions.len()).sum::<usize>();
    let mut file = GltfFile::with_capacity(size);
    for part in parts {
        let mesh = part.mesh.mesh();
        let places = rounded(mesh, |p| p)?;
        let corners = mesh.triangles.as_flattened().iter().map(|v| checked_u32(v.index()));
        file.add_mesh(part.name, &places, corners, None, Some(super::single(part.placement)));
    }
    // z up becomes y up (−90° about x), mm become m.
    file.gather(Node {
        name: Some("combwright".to_owned()),
        rotation: Some(UnitQuaternion([-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2])),
        scale: Some([1e-3; 3]),
        ..Node::default()
    });
    Ok(writer.write_all(&file.finished()?)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::GltfError;
    use crate::mesh::format::tests::{ball, parts, torus};
    use gltf::Semantic;

    #[test]
    fn glb_is_valid_and_holds_the_parts() -> Result<(), WriteError> {
        let (torus, ball) = (torus(), ball());
        let parts = parts(&torus, &ball);
        let mut bytes = Vec::new();
        write_glb(&parts, &mut bytes)?;
        // This checks the description against the specification's rules.
        let read = gltf::Gltf::from_slice(&bytes).map_err(GltfError::from)?;
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
