//! Between a flat photograph and the curved wall that it shows.
//!
//! **Enters** a wall of a [`crate::surface::Gap`], and a camera: its pose from marked points, or the view from above.
//! **Leaves** a photograph's [`crate::tessellation::CellPattern`] on the wall: places, normals, Gaussian curvature and true
//! areas of its cells; and, the other way, synthetic photographs of comb on a wall.
//!
//! | step | file |
//! |---|---|
//! | a pinhole or parallel camera: points to pixels, pixels to rays | `camera.rs` |
//! | the camera's pose from four marked points or more | `pose.rs` |
//! | where a ray first meets the wall | `cast.rs` |
//! | a pattern in pixels onto the wall | `map.rs` |
//! | comb on the wall as a photograph | `paint.rs` |
//!
//! Cells are taken to end on the wall: their mouths, which a photograph shows, lie a cell's depth nearer to the camera, so that
//! with deep cells seen obliquely places are off by the depth times the tangent of the obliquity.
//!
//! Not promised: lenses without distortion are assumed, square pixels, and an optical axis through the middle of the picture.
//!
//! Sources: R. Hartley and A. Zisserman, "Multiple View Geometry" (2004), for the camera; J. Moré, "The Levenberg–Marquardt
//! algorithm" (1978); J. Hart, "Sphere tracing", The Visual Computer 12 (1996).

mod camera;
mod cast;
mod map;
mod paint;
mod pose;

pub use camera::Camera;
pub use cast::{Caster, Extent};
pub use map::{MapError, Mapped, keep_squarest, map_pattern};
pub use paint::{CombOnWall, paint};
pub use pose::{Mark, Pose, PoseError, pose};
