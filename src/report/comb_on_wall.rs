//! Comb mapped onto its wall, for ParaView.

use super::foam_export::array;
use crate::{
    index::Id,
    tessellation::{Cell, CellPattern, CellStatus},
};
use glam::DVec3;
use std::io::{self, Write};

/// Writes the cells' outlines as VTK poly data (`.vtp`, XML, plain text) with these figures per cell: `cell`, `sides` (−1 where
/// none was decided), `status` (0 complete, 1 cut, 2 uncertain), `area` and `gauss_curvature` in the pattern's unit.
/// `outlines` follow the order of the cells; one of fewer than three corners is left out.
///
/// # Errors
/// What the writer says.
pub fn write_comb_vtp(
    writer: &mut impl Write,
    pattern: &CellPattern,
    outlines: &[Vec<DVec3>],
) -> io::Result<()> {
    let drawn = || pattern.cells.enumerated().zip(outlines).filter(|(_, outline)| outline.len() > 2);
    let corners: usize = drawn().map(|(_, outline)| outline.len()).sum();
    let ends = drawn().scan(0, |end, (_, outline)| {
        *end += outline.len();
        Some(*end)
    });
    let cells = || drawn().map(|((_, cell), _)| cell);
    writeln!(writer, "<?xml version=\"1.0\"?>")?;
    writeln!(writer, "<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n<PolyData>")?;
    writeln!(writer, "<Piece NumberOfPoints=\"{corners}\" NumberOfPolys=\"{}\">", drawn().count())?;
    writeln!(writer, "<Points>")?;
    let coordinates = drawn().flat_map(|(_, outline)| outline).flat_map(|point| point.to_array());
    array(writer, "Float64\" NumberOfComponents=\"3", "points", coordinates)?;
    writeln!(writer, "</Points>\n<Polys>")?;
    array(writer, "Int64", "connectivity", 0..corners)?;
    array(writer, "Int64", "offsets", ends)?;
    writeln!(writer, "</Polys>\n<CellData Scalars=\"sides\">")?;
    array(writer, "Int32", "cell", drawn().map(|((id, _), _)| id.index()))?;
    array(writer, "Int32", "sides", cells().map(|cell| cell.sides.map_or(-1, i64::from)))?;
    array(writer, "Int32", "status", cells().map(status))?;
    array(writer, "Float64", "area", cells().map(|cell| cell.area))?;
    array(writer, "Float64", "gauss_curvature", cells().map(|cell| cell.gauss_curvature.unwrap_or(0.0)))?;
    writeln!(writer, "</CellData>\n</Piece>\n</PolyData>\n</VTKFile>")
}

const fn status(cell: &Cell) -> i32 {
    match cell.status {
        CellStatus::Complete => 0,
        CellStatus::Cut => 1,
        CellStatus::Uncertain => 2,
    }
}
