//! Binary PLY, little endian.

use super::{WriteError, rounded};
use crate::{
    index::{Id, checked_u32},
    mesh::ClosedMesh,
};
use std::io::{BufWriter, Write};

/// Writes binary PLY: single precision, vertices once.
///
/// # Errors
/// [`WriteError`] if the writer fails, or before the first byte if rounding breaks the mesh.
pub fn write_ply(mesh: &ClosedMesh, writer: &mut impl Write) -> Result<(), WriteError> {
    let mesh = mesh.mesh();
    let places = rounded(mesh, |p| p)?;
    let mut writer = BufWriter::new(writer);
    write!(
        writer,
        "ply\nformat binary_little_endian 1.0\ncomment lengths in mm\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        places.len(),
        mesh.triangles.len()
    )?;
    for x in places.as_flattened() {
        writer.write_all(&x.to_le_bytes())?;
    }
    for triangle in &mesh.triangles {
        writer.write_all(&[3])?;
        for vertex in triangle {
            writer.write_all(&checked_u32(vertex.index()).to_le_bytes())?;
        }
    }
    Ok(writer.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::format::tests::torus;

    #[test]
    fn ply_holds_every_vertex_and_triangle_at_its_place() -> Result<(), WriteError> {
        let torus = torus();
        let mesh = torus.mesh();
        let mut bytes = Vec::new();
        write_ply(&torus, &mut bytes)?;
        let end = b"end_header\n";
        let Some(start) = bytes.windows(end.len()).position(|w| w == end) else { panic!("no end of header") };
        let header = String::from_utf8_lossy(&bytes[..start]);
        assert!(header.contains(&format!("element vertex {}\n", mesh.positions.len())), "{header}");
        assert!(header.contains(&format!("element face {}\n", mesh.triangles.len())), "{header}");
        let body = &bytes[start + end.len()..];
        assert_eq!(body.len(), 12 * mesh.positions.len() + 13 * mesh.triangles.len());
        let y = f32::from_le_bytes([body[16], body[17], body[18], body[19]]);
        // Half a step of single precision below 8.
        assert!((f64::from(y) - mesh.positions.as_slice()[1].y).abs() < 4e-7);
        let last = &body[body.len() - 13..];
        let corner = u32::from_le_bytes([last[9], last[10], last[11], last[12]]);
        assert_eq!((last[0], Some(corner as usize)), (3, mesh.triangles.last().map(|t| t[2].index())));
        Ok(())
    }
}
