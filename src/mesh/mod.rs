//! Triangle meshes.
//!
//! **Enters** a level set and a grid, or outlines of a plate. **Leaves** meshes that are proved to bound solids, measured
//! and written.
//!
//! | step | file |
//! |---|---|
//! | mesh, closed mesh | `tri_mesh.rs` |
//! | what keeps a mesh from being closed | `check.rs` |
//! | the 256 cases of a cube, derived | `cube_cases.rs` |
//! | marching cubes over one level, slab by slab | `grid.rs`, `slab.rs`, `march.rs` |
//! | the solid between two copies of an open sheet | `sheet.rs` |
//! | nearest points, overlapping pairs | `bvh.rs` |
//! | where a mesh intersects itself | `intersect.rs` |
//! | STL, 3MF, PLY, OBJ, GLB | `format/` |
//! | a plate with pockets and holes | `plate.rs` |
//! | the lines in which a plane cuts a mesh | `section.rs` |
//! | volume, area, Euler number, pieces, overhang | `measure.rs` |
//!
//! Not promised: that a closed mesh does not intersect itself; [`self_intersections`] tells.

mod bvh;
mod check;
mod cube_cases;
mod format;
mod grid;
mod intersect;
mod march;
pub mod measure;
pub mod plate;
mod section;
mod sheet;
mod slab;
mod tri_mesh;

pub use bvh::{Bvh, Closest};
pub use check::MeshDefect;
pub use format::{
    GltfError, GltfFile, Part, WriteError, write_3mf, write_glb, write_obj, write_ply, write_stl,
};
pub use grid::Grid;
pub use intersect::self_intersections;
pub use march::march;
pub use measure::euler_number;
pub use section::{CutPlane, SectionLine, section};
pub use sheet::{Legs, Sheet};
pub use tri_mesh::{ClosedMesh, MeshDefects, TriMesh, VertexId};
