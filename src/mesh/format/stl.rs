//! Binary STL.

use super::{WriteError, rounded};
use crate::{
    index::{Id, checked_u32},
    mesh::{ClosedMesh, VertexId},
};
use glam::DVec3;
use rayon::prelude::*;
use std::{io::Write, sync::mpsc::sync_channel, thread};
use stl_io::{Normal, Triangle, Vertex};

/// Triangles that are packed by one thread in a row; what is packed and not yet written is bounded by a few times 50 bytes
/// of each.
const CHUNK: usize = 1 << 15;

/// Chunks packed before they are written.
const CHUNKS_AT_A_TIME: usize = 8;

/// The header that `stl_io` writes, with the number of triangles.
const HEADER_BYTES: usize = 84;

/// Writes binary STL: single precision, normals from the corners, nothing in the header.
///
/// # Errors
/// [`WriteError`] if the writer fails, or before the first byte if rounding breaks the mesh.
pub fn write_stl(mesh: &ClosedMesh, writer: &mut impl Write) -> Result<(), WriteError> {
    let mesh = mesh.mesh();
    let places = rounded(mesh, |p| p)?;
    let count = checked_u32(mesh.triangles.len());
    let mut header = [0; HEADER_BYTES];
    header[HEADER_BYTES - 4..].copy_from_slice(&count.to_le_bytes());
    writer.write_all(&header)?;
    thread::scope(|scope| {
        // What is packed waits in a short queue while the writer, which may be slow, takes the bytes before it.
        let (ready, packages) = sync_channel(1);
        scope.spawn(move || {
            for chunks in mesh.triangles.chunks(CHUNK * CHUNKS_AT_A_TIME) {
                let packed: Result<Vec<Vec<u8>>, WriteError> =
                    chunks.par_chunks(CHUNK).map(|chunk| packed(&places, chunk)).collect();
                if ready.send(packed).is_err() {
                    return;
                }
            }
        });
        for package in packages {
            for bytes in package? {
                writer.write_all(&bytes[HEADER_BYTES..])?;
            }
        }
        Ok(())
    })
}

/// Some triangles as a whole STL file of their own.
fn packed(places: &[[f32; 3]], triangles: &[[VertexId; 3]]) -> Result<Vec<u8>, WriteError> {
    let mut bytes = Vec::with_capacity(HEADER_BYTES + 50 * triangles.len());
    let triangles = triangles.iter().map(|triangle| {
        let corners = triangle.map(|v| places[v.index()]);
        let [a, b, c] = corners.map(|p| DVec3::from_array(p.map(f64::from)));
        let normal = super::single((b - a).cross(c - a).normalize_or_zero());
        Triangle { normal: Normal::new(normal), vertices: corners.map(Vertex::new) }
    });
    stl_io::write_stl(&mut bytes, triangles)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        index::Id,
        mesh::{TriMesh, VertexId, euler_number, format::tests::torus, measure},
    };

    #[test]
    fn stl_comes_back_closed_with_the_same_volume() -> Result<(), WriteError> {
        let torus = torus();
        let mut bytes = Vec::new();
        write_stl(&torus, &mut bytes)?;
        assert_eq!(bytes.len(), 84 + 50 * torus.mesh().triangles.len());
        let read = stl_io::read_stl(&mut std::io::Cursor::new(&bytes))?;
        assert!(read.validate().is_ok());
        let positions: Vec<DVec3> =
            read.vertices.iter().map(|v| DVec3::from_array(v.0.map(f64::from))).collect();
        let triangles = read.faces.iter().map(|f| f.vertices.map(VertexId::from_index)).collect();
        let mesh = TriMesh { positions: positions.into(), triangles };
        assert_eq!((mesh.positions.len(), euler_number(&mesh)), (torus.mesh().positions.len(), 0));
        // Single precision: 2^-24 of coordinates up to 6, in each of three factors.
        let ratio = measure::volume(&mesh) / measure::volume(torus.mesh());
        assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
        for face in &read.faces {
            let [a, b, c] = face.vertices.map(|v| DVec3::from_array(read.vertices[v].0.map(f64::from)));
            let normal = DVec3::from_array(face.normal.0.map(f64::from));
            assert!(normal.distance((b - a).cross(c - a).normalize()) < 1e-6);
        }
        assert!(ClosedMesh::new(mesh).is_ok());
        Ok(())
    }
}
