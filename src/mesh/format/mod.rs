//! Mesh files.
//!
//! **Enters** closed meshes in millimetres. **Leaves** bytes; the same for the same meshes, without dates or random names.
//!
//! | format | file | holds |
//! |---|---|---|
//! | STL, binary | `stl.rs` | one mesh, without a unit |
//! | 3MF | `three_mf.rs` | named parts, placed, in mm |
//! | PLY, binary | `ply.rs` | one mesh, without a unit |
//! | OBJ, text | `obj.rs` | named parts, placed by their coordinates |
//! | GLB (binary glTF 2.0) | `glb.rs`, `gltf_file.rs` | named parts, placed, in m with y up |
//!
//! All of them are read as single precision by some or all programs, and STL readers even find common corners by equal
//! places. So every writer first rounds the places ([`rounded`]) and refuses a mesh that would then no longer be closed; the
//! writers of several parts do so before the first byte.
//!
//! Not promised: that the rounded mesh is free of self-intersections; walls thinner than the rounding (10⁻⁵ mm at 100 mm)
//! can cross.

mod glb;
mod gltf_file;
mod obj;
mod ply;
mod stl;
mod three_mf;

pub use glb::write_glb;
pub use gltf_file::{GltfError, GltfFile};
pub use obj::write_obj;
pub use ply::write_ply;
pub use stl::write_stl;
pub use three_mf::write_3mf;

use super::{ClosedMesh, TriMesh, VertexId};
use crate::index::{Id, checked_u32};
use glam::DVec3;
use rayon::prelude::*;
use std::io;

/// A named mesh and where it goes.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    /// The name: not empty, without control characters and without `< > & " '`.
    pub name: &'a str,
    /// The mesh in its own coordinates, in mm.
    pub mesh: &'a ClosedMesh,
    /// What is added to its coordinates to put it in place, in mm.
    pub placement: DVec3,
}

/// Why a mesh was not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The writer failed.
    #[error("cannot write the mesh: {0}")]
    Io(#[from] io::Error),
    /// A coordinate that single precision does not hold.
    #[error(
        "vertex {vertex} at {place} mm is too far out for a mesh file (single precision ends at 3.4e38); use a smaller scale"
    )]
    OutOfRange {
        /// The vertex.
        vertex: VertexId,
        /// Its place.
        place: DVec3,
    },
    /// A triangle that has no area once its corners are rounded.
    #[error(
        "triangle {triangle} with the corners {}, {}, {} mm has no area in the single precision of mesh files; use fewer cells or place the part nearer to the origin",
        .corners[0], .corners[1], .corners[2]
    )]
    Collapsed {
        /// The triangle.
        triangle: usize,
        /// Its corners before rounding.
        corners: [DVec3; 3],
    },
    /// Two vertices that are at one place once they are rounded.
    #[error(
        "the vertices {} and {} at {} and {} mm fall together in the single precision of mesh files; use fewer cells or place the part nearer to the origin",
        .vertices[0], .vertices[1], .places[0], .places[1]
    )]
    Merged {
        /// The vertices.
        vertices: [usize; 2],
        /// Their places before rounding.
        places: [DVec3; 2],
    },
    /// A part's name that some format cannot hold.
    #[error("the part name {0:?} is empty or holds a control character or one of < > & \" '; choose another")]
    Name(String),
    /// The 3MF package could not be made.
    #[error("cannot write 3MF: {0}")]
    ThreeMf(Box<dyn std::error::Error + Send + Sync>),
    /// The glTF description could not be made.
    #[error("cannot write GLB: {0}")]
    Gltf(#[from] GltfError),
}

/// Refuses names that some format cannot hold.
fn check_names(parts: &[Part]) -> Result<(), WriteError> {
    let bad = |name: &str| {
        name.trim().is_empty() || name.contains(|c: char| c.is_control() || "<>&\"'".contains(c))
    };
    match parts.iter().find(|part| bad(part.name)) {
        Some(part) => Err(WriteError::Name(part.name.to_owned())),
        None => Ok(()),
    }
}

/// The vertices of `mesh` in single precision, moved by `place` first and without negative zeros.
///
/// # Errors
/// [`WriteError::OutOfRange`], [`WriteError::Collapsed`] or [`WriteError::Merged`] if the rounded mesh is not closed as
/// readers see it.
fn rounded(mesh: &TriMesh, place: impl Fn(DVec3) -> DVec3 + Sync) -> Result<Vec<[f32; 3]>, WriteError> {
    let positions = mesh.positions.as_slice();
    let rounded: Vec<[f32; 3]> = positions.par_iter().map(|&p| single(place(p))).collect();
    if let Some(at) = rounded.par_iter().position_first(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(WriteError::OutOfRange { vertex: VertexId::from_index(at), place: positions[at] });
    }
    let collapsed = mesh.triangles.par_iter().position_first(|triangle| {
        let [a, b, c] = triangle.map(|v| DVec3::from_array(rounded[v.index()].map(f64::from)));
        (b - a).cross(c - a) == DVec3::ZERO
    });
    if let Some(triangle) = collapsed {
        return Err(WriteError::Collapsed { triangle, corners: mesh.corners(mesh.triangles[triangle]) });
    }
    match merged(&rounded) {
        Some(vertices) => Err(WriteError::Merged { vertices, places: vertices.map(|v| positions[v]) }),
        None => Ok(rounded),
    }
}

/// The first two vertices at one place.
fn merged(places: &[[f32; 3]]) -> Option<[usize; 2]> {
    // Equal places have equal keys, and few others do: only a repeated key is worth the sort of whole places.
    let mut keys: Vec<u64> = places.par_iter().map(key).collect();
    keys.par_sort_unstable();
    if keys.par_windows(2).all(|pair| pair[0] != pair[1]) {
        return None;
    }
    let mut keyed: Vec<([u32; 3], u32)> =
        places.par_iter().enumerate().map(|(index, p)| (p.map(f32::to_bits), checked_u32(index))).collect();
    keyed.par_sort_unstable();
    let pairs = keyed.par_windows(2).filter(|pair| pair[0].0 == pair[1].0);
    pairs.map(|pair| [pair[0].1 as usize, pair[1].1 as usize]).min()
}

/// A number that tells places apart, up to chance: their bits, spread by odd multipliers.
fn key(place: &[f32; 3]) -> u64 {
    place.iter().fold(0_u64, |key, x| {
        (key ^ u64::from(x.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    })
}

/// A place in single precision, without negative zeros: readers that join equal places tell the two zeros apart.
#[expect(clippy::cast_possible_truncation, reason = "the rounding is the purpose")]
fn single(p: DVec3) -> [f32; 3] {
    p.to_array().map(|x| x as f32 + 0.0)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{
        mesh::{Grid, march},
        surface::{Sphere, Torus},
    };

    /// A closed torus with its middle at (3, 0, 0), not symmetric to the coordinate planes.
    pub(in crate::mesh) fn torus() -> ClosedMesh {
        let grid =
            Grid { low: DVec3::new(-3.2, -3.1, -1.3), high: DVec3::new(3.3, 3.4, 1.4), cells: [23, 22, 11] };
        let Ok(mesh) = march(&Torus { ring: 2.0, tube: 0.8 }, 0.0, &grid) else { panic!("no torus") };
        let Ok(mesh) = ClosedMesh::new(mesh.map(|p| p + 3.0 * DVec3::X)) else { panic!("not closed") };
        mesh
    }

    /// A closed ball.
    pub(in crate::mesh) fn ball() -> ClosedMesh {
        let grid = Grid { low: DVec3::splat(-1.3), high: DVec3::splat(1.2), cells: [9; 3] };
        let Ok(mesh) = march(&Sphere { radius: 1.0 }, 0.0, &grid) else { panic!("no ball") };
        let Ok(mesh) = ClosedMesh::new(mesh) else { panic!("not closed") };
        mesh
    }

    /// Two named parts.
    pub(in crate::mesh) fn parts<'a>(torus: &'a ClosedMesh, ball: &'a ClosedMesh) -> [Part<'a>; 2] {
        [
            Part { name: "the ring", mesh: torus, placement: DVec3::ZERO },
            Part { name: "ball", mesh: ball, placement: DVec3::new(10.0, -2.5, 0.25) },
        ]
    }

    #[test]
    fn meshes_that_single_precision_breaks_are_refused() {
        let moved = |far: f64| rounded(ball().mesh(), |p| p + DVec3::splat(far));
        assert!(moved(1e4).is_ok());
        // Single precision has steps of 64 at 1e9: the ball becomes a point.
        assert!(matches!(moved(1e9), Err(WriteError::Collapsed { triangle: 0, .. })), "{:?}", moved(1e9));
        assert!(matches!(moved(1e39), Err(WriteError::OutOfRange { .. })));
        let mut two = ball().mesh().clone();
        two.append(&ball().mesh().clone().map(|p| p + DVec3::new(1e-9, 0.0, 0.0)));
        let count = two.positions.len() / 2;
        let Err(WriteError::Merged { vertices: [one, other], .. }) = rounded(&two, |p| p) else {
            panic!("accepted")
        };
        assert_eq!(other, one + count);
    }

    #[test]
    fn names_that_would_break_a_file_are_refused() {
        let mesh = ball();
        for name in ["", " ", "a<b", "tab\t", "\"", "R&D"] {
            let part = Part { name, mesh: &mesh, placement: DVec3::ZERO };
            assert!(matches!(check_names(&[part]), Err(WriteError::Name(n)) if n == name));
        }
    }
}
