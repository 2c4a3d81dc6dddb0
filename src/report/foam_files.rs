//! A foam's tables and meshes.

use super::{
    foam_surface::CellFigures,
    folder::{OutputError, OutputFolder},
};
use crate::{
    foam::{
        checkpoint::StepRecord,
        free::FreeFoam,
        partition::{Beyond, CellMesh, Partition},
        seeds::Seeds,
    },
    index::Id,
    surface::Gap,
    tessellation::{CellId, CellPattern, CellStatus},
};
use serde::Serialize;
use std::io::{self, Write};

/// The name and version of the partition's JSON form.
pub const PARTITION_SCHEMA: &str = "combwright.partition/1";

/// One row of `cells.csv`.
#[derive(Clone, Debug, Serialize)]
struct CellRow {
    id: usize,
    x: f64,
    y: f64,
    z: f64,
    sides: Option<u32>,
    status: CellStatus,
    volume: f64,
    pressure: Option<f64>,
    gauss_curvature: Option<f64>,
}

/// Writes `cells.csv`: centres in the unit of the surface, sides, status, volume, pressure (empty before relaxation), Gaussian
/// curvature. `volumes` and `pressures` follow the order of the pattern's cells.
///
/// # Errors
/// [`OutputError`] if the file cannot be written.
pub fn write_cells(
    folder: &mut OutputFolder,
    pattern: &CellPattern,
    volumes: &[f64],
    pressures: Option<&[f64]>,
) -> Result<(), OutputError> {
    folder.write("cells.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        for (id, cell) in pattern.cells.enumerated() {
            let index = id.index();
            let [x, y, z] = cell.position.to_array();
            table.serialize(CellRow {
                id: index,
                x,
                y,
                z,
                sides: cell.sides,
                status: cell.status,
                volume: volumes.get(index).copied().unwrap_or(f64::NAN),
                pressure: pressures.and_then(|all| all.get(index).copied()),
                gauss_curvature: cell.gauss_curvature,
            })?;
        }
        table.flush()
    })
}

/// One row of `cells.csv` of a foam of free topology.
#[derive(Clone, Debug, Serialize)]
struct FreeCellRow {
    id: usize,
    x: f64,
    y: f64,
    z: f64,
    sides_lower: Option<u32>,
    sides_upper: Option<u32>,
    films: usize,
    status: CellStatus,
    volume: f64,
    pressure: f64,
    gauss_curvature: f64,
}

/// Writes `cells.csv` of a foam of free topology: centres in the unit of the surface, sides on the lower and on the upper wall,
/// films, status, volume, pressure less the mean, Gaussian curvature of the middle surface. `patterns` are those of the walls. A
/// cell that ends at a plane anywhere is cut; it has a number of sides on a wall where it does not, none where it does, nor on
/// a wall that it does not touch.
///
/// # Errors
/// [`OutputError`] if the file cannot be written.
pub fn write_free_cells(
    folder: &mut OutputFolder,
    foam: &FreeFoam,
    patterns: &[CellPattern; 2],
    figures: &CellFigures,
) -> Result<(), OutputError> {
    let cut = foam.division.cut();
    let mut films = vec![0; foam.division.seeds.len()];
    for film in &foam.division.polygons {
        films[film.cell] += 1;
        films[film.neighbour] += 1;
    }
    folder.write("cells.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        for (index, &films) in films.iter().enumerate() {
            let [lower, upper] = patterns.each_ref().map(|pattern| &pattern.cells[CellId::from_index(index)]);
            let [x, y, z] = lower.position.midpoint(upper.position).to_array();
            table.serialize(FreeCellRow {
                id: index,
                x,
                y,
                z,
                sides_lower: lower.sides,
                sides_upper: upper.sides,
                films,
                status: if cut[index] { CellStatus::Cut } else { CellStatus::Complete },
                volume: figures.volumes[index],
                pressure: figures.pressures[index],
                gauss_curvature: figures.gauss_curvature[index],
            })?;
        }
        table.flush()
    })
}

/// Writes `seeds.csv`, the places of the seeds, and `anneal.csv`, the record of the annealing.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write_seeds(folder: &mut OutputFolder, seeds: &Seeds) -> Result<(), OutputError> {
    folder.write("seeds.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        table.write_record(["id", "x", "y", "z"])?;
        for (index, point) in seeds.points.iter().enumerate() {
            table.serialize((index, point.x, point.y, point.z))?;
        }
        table.flush()
    })?;
    folder.write("anneal.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        for record in &seeds.trace {
            table.serialize(record)?;
        }
        table.flush()
    })
}

/// Writes `energy.csv`, the record of the relaxation.
///
/// # Errors
/// [`OutputError`] if the file cannot be written.
pub fn write_steps(folder: &mut OutputFolder, record: &[StepRecord]) -> Result<(), OutputError> {
    folder.write("energy.csv", |writer| {
        let mut table = csv::Writer::from_writer(writer);
        for step in record {
            table.serialize(step)?;
        }
        table.flush()
    })
}

/// One cell of `partition.json`.
#[derive(Serialize)]
struct JsonCell {
    id: usize,
    seed: glam::DVec3,
    volume: f64,
    vertices: Vec<glam::DVec3>,
    loops: Vec<JsonLoop>,
}

/// One loop of a cell: what lies behind it, and its corners, counter-clockwise seen from outside.
#[derive(Serialize)]
struct JsonLoop {
    beyond: Beyond,
    corners: Vec<usize>,
}

#[derive(Serialize)]
struct JsonPartition {
    schema: &'static str,
    unit: &'static str,
    gap_volume: f64,
    cells: Vec<JsonCell>,
}

/// Writes `partition.json` and `partition.obj`: every cell as a closed surface of polygons that point outward.
///
/// # Errors
/// [`OutputError`] if a file cannot be written.
pub fn write_partition(
    folder: &mut OutputFolder,
    partition: &Partition,
    gap: &Gap,
) -> Result<(), OutputError> {
    let meshes: Vec<CellMesh> = partition.cells().iter().map(|cell| cell.mesh(gap)).collect();
    folder.write("partition.obj", |writer| obj(writer, &meshes))?;
    let cells = partition.cells().enumerated().zip(meshes).map(|((id, cell), mesh)| JsonCell {
        id: id.index(),
        seed: cell.seed,
        volume: cell.volume,
        vertices: mesh.vertices,
        loops: mesh.loops.into_iter().map(|(beyond, corners)| JsonLoop { beyond, corners }).collect(),
    });
    let document = JsonPartition {
        schema: PARTITION_SCHEMA,
        unit: "L",
        gap_volume: partition.volume(),
        cells: cells.collect(),
    };
    folder.write("partition.json", |writer| {
        serde_json::to_writer(&mut *writer, &document)?;
        writer.write_all(b"\n")
    })
}

/// One object per cell; within it a group for the films and one for the patches on the walls.
fn obj(writer: &mut impl Write, meshes: &[CellMesh]) -> io::Result<()> {
    writeln!(writer, "# Cells of a foam; every face is counter-clockwise seen from outside its cell.")?;
    let mut before = 1;
    for (index, mesh) in meshes.iter().enumerate() {
        writeln!(writer, "o cell_{index}")?;
        for vertex in &mesh.vertices {
            writeln!(writer, "v {} {} {}", vertex.x, vertex.y, vertex.z)?;
        }
        let is_film = |beyond: &Beyond| !matches!(beyond, Beyond::Wall(_));
        for (group, films) in [("films", true), ("walls", false)] {
            writeln!(writer, "g cell_{index}_{group}")?;
            for (_, corners) in mesh.loops.iter().filter(|(beyond, _)| is_film(beyond) == films) {
                write!(writer, "f")?;
                for corner in corners {
                    write!(writer, " {}", corner + before)?;
                }
                writeln!(writer)?;
            }
        }
        before += mesh.vertices.len();
    }
    Ok(())
}
