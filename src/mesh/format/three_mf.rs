//! 3MF (core specification 1.3).

use super::{Part, WriteError, check_names, rounded};
use crate::index::Id;
use glam::DVec3;
use std::io::{Cursor, Write};
use threemf2::{
    model::{
        builder::{ModelBuilder, ObjectType, Unit},
        domain::model::Model,
    },
    package::ThreemfPackageBuilder,
};

/// Writes a 3MF package in millimetres: each part a named object and a build item moved to its place.
///
/// Coordinates are written to 10⁻⁶ mm: that is finer than single precision, in which slicers read them, from 8 mm on.
///
/// # Errors
/// [`WriteError`] if the writer fails, or before the first byte if a name is bad, rounding breaks a mesh or there is no
/// part.
pub fn write_3mf(parts: &[Part], writer: &mut impl Write) -> Result<(), WriteError> {
    check_names(parts)?;
    let mut package = ThreemfPackageBuilder::new();
    package.set_root_model(model_of(parts)?);
    let package = package.build().map_err(failed)?;
    // Through memory: the package needs a writer that seeks, and the writer's own errors stay what they are.
    let mut bytes = Cursor::new(Vec::new());
    package.write(&mut bytes).map_err(failed)?;
    Ok(writer.write_all(bytes.get_ref())?)
}

/// The objects and their places.
fn model_of(parts: &[Part]) -> Result<Model, WriteError> {
    let mut model = ModelBuilder::new(Unit::Millimeter, true);
    model.add_build(None).map_err(failed)?;
    for part in parts {
        let mesh = part.mesh.mesh();
        rounded(mesh, to_nanometre)?;
        let object = model
            .add_mesh_object(|object| {
                object.object_type(ObjectType::Model).name(part.name);
                for &place in &mesh.positions {
                    object.add_vertex(&to_nanometre(place).to_array());
                }
                for triangle in &mesh.triangles {
                    object.add_triangle(&triangle.map(Id::index));
                }
                Ok(())
            })
            .map_err(failed)?;
        let DVec3 { x, y, z } = to_nanometre(part.placement);
        // By rows, the translation in the last column.
        let transform = [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0];
        model
            .add_build_item_advanced(object, |item| {
                item.transform(&transform);
            })
            .map_err(failed)?;
    }
    model.build().map_err(failed)
}

/// A place rounded to 10⁻⁶ mm, without negative zeros.
fn to_nanometre(p: DVec3) -> DVec3 {
    (p * 1e6).round() / 1e6 + DVec3::ZERO
}

fn failed(error: impl std::error::Error + Send + Sync + 'static) -> WriteError {
    WriteError::ThreeMf(Box::new(error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::format::tests::{ball, parts, torus};
    use threemf2::{model::domain::object::ObjectKind, package::ThreemfPackage};

    #[test]
    fn three_mf_comes_back_with_names_places_and_millimetres() -> Result<(), WriteError> {
        let (torus, ball) = (torus(), ball());
        let parts = parts(&torus, &ball);
        let mut bytes = [Vec::new(), Vec::new()];
        write_3mf(&parts, &mut bytes[0])?;
        write_3mf(&parts, &mut bytes[1])?;
        assert!(bytes[0] == bytes[1], "not the same bytes twice");
        let package =
            ThreemfPackage::from_reader_with_memory_optimized_deserializer(Cursor::new(&bytes[0]), true);
        let model = package.map_err(failed)?.root;
        assert_eq!(model.unit, Some(Unit::Millimeter));
        assert_eq!((model.resources.object.len(), model.build.item.len()), (2, 2));
        for ((object, item), part) in model.resources.object.iter().zip(&model.build.item).zip(&parts) {
            assert_eq!(object.name.as_deref(), Some(part.name));
            assert_eq!(item.objectid, object.id);
            let Some(transform) = &item.transform else { panic!("no transform") };
            assert_eq!(transform.0[..9], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
            assert_eq!(transform.0[9..], part.placement.to_array());
            let Some(ObjectKind::Mesh(mesh)) = &object.kind else { panic!("no mesh") };
            assert_eq!(mesh.triangles.triangle.len(), part.mesh.mesh().triangles.len());
            for (vertex, place) in mesh.vertices.vertex.iter().zip(&part.mesh.mesh().positions) {
                let read = DVec3::new(vertex.x.value(), vertex.y.value(), vertex.z.value());
                // Half a unit of the last decimal written.
                assert!((read - place).abs().max_element() < 0.5001e-6);
            }
        }
        Ok(())
    }
}
