//! Marching cubes over one level of a level set, streaming through the grid.
//!
//! Only the signs of two planes of samples are held. Vertices are exact crossings of grid edges, not linear interpolates.
//! Where the surface passes within [`SNAP`] of a grid node, all crossings next to that node become one vertex, the node's
//! projection, so that no sliver is left; nodes on the surface itself, which a grid aligned with mirror planes has many of,
//! need no other care. Slabs of a fixed number of layers are meshed in parallel and joined in order: the result does not
//! depend on the number of threads.

use super::{
    Grid, TriMesh, VertexId,
    slab::{FOREIGN, Field, Key, ON_SURFACE, Slab, Workspace},
};
use crate::{
    index::Id,
    surface::{LevelSet, NoFoot, SurfaceSamples},
};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Layers of one slab. Fewer cost repeated planes, more leave threads idle.
const SLAB_LAYERS: usize = 16;

/// Distance from a node, in parts of the spacing, within which crossings are joined to it. Below 0.02 triangles get angles
/// that single precision spoils; above 0.3 neighbouring nodes begin to compete and sheets can pinch.
const SNAP: f64 = 0.12;

/// The surface `surface = level` within the grid's box, as triangles whose normals point along `∇Φ`.
///
/// The mesh has a border where the surface leaves the box; its vertices there lie exactly on the box's faces if those are
/// mirror planes of the surface.
///
/// # Errors
/// [`NoFoot`] if a node next to the surface cannot be projected onto it.
///
/// # Panics
/// If the grid has no cells along an axis.
pub fn march(surface: &dyn LevelSet, level: f64, grid: &Grid) -> Result<TriMesh, NoFoot> {
    assert!(grid.cells.iter().all(|&n| n > 0), "a grid has cells along each axis");
    let axes = grid.axes();
    let sampler = surface.sampler(axes.each_ref().map(Vec::as_slice));
    let field = Field {
        surface,
        level,
        axes: &axes,
        sampler: sampler.as_ref(),
        near: near_value(surface, level, grid),
    };
    let layers = grid.cells[2];
    let slabs: Vec<Slab> = (0..layers.div_ceil(SLAB_LAYERS))
        .into_par_iter()
        .map_init(
            || Workspace::new(&field),
            |workspace, slab| {
                let first = slab * SLAB_LAYERS;
                Slab::mesh(&field, workspace, first, (first + SLAB_LAYERS).min(layers))
            },
        )
        .collect::<Result<_, _>>()?;
    Ok(join(&slabs))
}

/// `|Φ − level|` at a node that counts as next to the surface.
fn near_value(surface: &dyn LevelSet, level: f64, grid: &Grid) -> f64 {
    const LINES: usize = 12;
    let samples = SurfaceSamples::new(surface, level, LINES);
    let slope = samples.integrate(|p| surface.gradient(p).length()) / samples.area();
    // A level that is not met at all has no crossings either.
    if slope.is_finite() { (SNAP * grid.spacing() * slope).max(2.0 * ON_SURFACE) } else { 2.0 * ON_SURFACE }
}

/// Joins the slabs: a vertex of a slab's last plane is the next slab's vertex of that name, if it has one.
fn join(slabs: &[Slab]) -> TriMesh {
    let mut offsets = Vec::with_capacity(slabs.len() + 1);
    let mut count = 0;
    for slab in slabs {
        offsets.push(count);
        count += slab.positions.len();
    }
    let mut positions: Vec<DVec3> = Vec::with_capacity(count);
    slabs.iter().for_each(|slab| positions.extend(&slab.positions));
    let mut triangles = Vec::with_capacity(slabs.iter().map(|slab| slab.triangles.len()).sum());
    for (index, slab) in slabs.iter().enumerate() {
        let above: BTreeMap<Key, u32> =
            slabs.get(index + 1).map(|next| next.bottom.iter().copied().collect()).unwrap_or_default();
        let foreign: Vec<usize> = slab
            .top
            .iter()
            .map(|(key, place)| match above.get(key) {
                Some(&id) => offsets[index + 1] + id as usize,
                None => {
                    positions.push(*place);
                    positions.len() - 1
                }
            })
            .collect();
        let global = |id: u32| {
            VertexId::from_index(if id >= FOREIGN {
                foreign[(id - FOREIGN) as usize]
            } else {
                offsets[index] + id as usize
            })
        };
        triangles.extend(slab.triangles.iter().map(|triangle| triangle.map(global)));
    }
    TriMesh { positions: positions.into(), triangles }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::{ClosedMesh, Sheet, euler_number, measure},
        surface::{Diamond, Gyroid, SchwarzP, Sphere, Torus},
    };
    use std::f64::consts::{PI, TAU};

    fn cube(low: f64, high: f64, cells: usize) -> Grid {
        Grid { low: DVec3::splat(low), high: DVec3::splat(high), cells: [cells; 3] }
    }

    #[test]
    fn spheres_are_closed_and_approach_their_volume_from_below_by_the_square_of_the_spacing()
    -> Result<(), NoFoot> {
        let sphere = Sphere { radius: 1.0 };
        let volume = |cells| -> Result<f64, NoFoot> {
            let mesh = march(&sphere, 0.0, &cube(-1.25, 1.25, cells))?;
            assert!(mesh.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-12));
            assert_eq!(euler_number(&mesh), 2);
            let Ok(closed) = ClosedMesh::new(mesh) else { panic!("{cells} cells: not closed") };
            Ok(measure::volume(closed.mesh()))
        };
        let error = [16, 32, 64].map(|cells| volume(cells).map(|v| 4.0 * PI / 3.0 - v));
        let [coarse, middle, fine] = error;
        let (coarse, middle, fine) = (coarse?, middle?, fine?);
        // Inscribed: less than the ball. A second-order error falls to a quarter; 3.3 leaves room for the grid's phase.
        assert!(fine > 0.0 && coarse / middle > 3.3 && middle / fine > 3.3, "{coarse} {middle} {fine}");
        Ok(())
    }

    #[test]
    fn whole_periods_have_the_euler_number_of_their_sheet() -> Result<(), NoFoot> {
        // One cell of P: a sphere with six holes.
        for cells in [8, 12, 17, 32, 48] {
            let mesh = march(&SchwarzP { period: 1.0 }, 0.0, &cube(0.0, 1.0, cells))?;
            assert_eq!(euler_number(&mesh), -4, "{cells}");
            assert!(Sheet::new(mesh).is_ok(), "{cells}");
        }
        let torus = march(&Torus { ring: 2.0, tube: 0.7 }, 0.1, &cube(-3.1, 3.1, 40))?;
        assert_eq!(euler_number(&torus), 0);
        assert!((measure::volume(&torus) / (TAU * 2.0 * PI * 0.64) - 1.0).abs() < 0.01);
        assert!(ClosedMesh::new(torus).is_ok());
        Ok(())
    }

    #[test]
    fn sheets_of_every_surface_are_manifold_on_coarse_and_fine_grids() -> Result<(), NoFoot> {
        let surfaces: [Box<dyn LevelSet>; 3] = [
            Box::new(SchwarzP { period: 1.0 }),
            Box::new(Gyroid { period: 1.0 }),
            Box::new(Diamond { period: 1.0 }),
        ];
        for surface in &surfaces {
            for cells in [16, 20, 27, 32, 50, 64] {
                for level in [-0.6, -0.2, 0.0, 0.3] {
                    // Off the planes that touch the diamond surface along its straight lines: there the box itself would
                    // cut the sheet into touching pieces.
                    let mesh = march(surface.as_ref(), level, &cube(0.013, 1.013, cells))?;
                    assert!(mesh.positions.iter().all(|&p| (surface.value(p) - level).abs() < 1e-9));
                    if let Err(defects) = Sheet::new(mesh) {
                        panic!("{surface:?} at {level}, {cells} cells: {defects}");
                    }
                }
            }
        }
        Ok(())
    }

    #[test]
    fn the_same_bytes_for_one_and_two_threads() {
        let grid = Grid { low: DVec3::ZERO, high: DVec3::new(1.0, 1.0, 0.5), cells: [64, 64, 40] };
        let meshes = [1, 2].map(|threads| {
            let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else {
                panic!("no pool")
            };
            pool.install(|| march(&SchwarzP { period: 1.0 }, 0.2, &grid))
        });
        assert!(meshes[0].is_ok() && meshes[0] == meshes[1]);
    }
}
