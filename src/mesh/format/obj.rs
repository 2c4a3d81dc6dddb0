//! Wavefront OBJ.

use super::{Part, WriteError, check_names, rounded};
use crate::index::Id;
use std::io::{BufWriter, Write};

/// Writes OBJ text: each part an object of its name (blanks become `_`), its vertices in place, single precision.
///
/// # Errors
/// [`WriteError`] if the writer fails, or before the first byte if a name is bad or rounding breaks a mesh.
pub fn write_obj(parts: &[Part], writer: &mut impl Write) -> Result<(), WriteError> {
    check_names(parts)?;
    let places: Vec<_> = parts
        .iter()
        .map(|part| rounded(part.mesh.mesh(), |p| p + part.placement))
        .collect::<Result<_, _>>()?;
    let mut writer = BufWriter::new(writer);
    writeln!(writer, "# lengths in mm")?;
    // Vertices are numbered from 1 through all parts.
    let mut first = 1;
    for (part, places) in parts.iter().zip(&places) {
        writeln!(writer, "o {}", part.name.replace(char::is_whitespace, "_"))?;
        for [x, y, z] in places {
            writeln!(writer, "v {x} {y} {z}")?;
        }
        for triangle in &part.mesh.mesh().triangles {
            let [a, b, c] = triangle.map(|v| v.index() + first);
            writeln!(writer, "f {a} {b} {c}")?;
        }
        first += places.len();
    }
    Ok(writer.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::format::tests::{ball, parts, torus};

    #[test]
    fn obj_numbers_its_vertices_through_all_parts() -> Result<(), WriteError> {
        let (torus, ball) = (torus(), ball());
        let mut bytes = Vec::new();
        write_obj(&parts(&torus, &ball), &mut bytes)?;
        let text = String::from_utf8_lossy(&bytes);
        let lines = |start: &str| text.lines().filter(|l| l.starts_with(start)).collect::<Vec<_>>();
        let counts = [&torus, &ball].map(|m| (m.mesh().positions.len(), m.mesh().triangles.len()));
        assert_eq!(lines("o "), ["o the_ring", "o ball"]);
        assert_eq!(lines("v ").len(), counts[0].0 + counts[1].0);
        assert_eq!(lines("f ").len(), counts[0].1 + counts[1].1);
        let numbers =
            |line: &str| line.split(' ').skip(1).filter_map(|n| n.parse().ok()).collect::<Vec<usize>>();
        assert_eq!(lines("f ").iter().flat_map(|l| numbers(l)).max(), Some(counts[0].0 + counts[1].0));
        let of_ball = &lines("f ")[counts[0].1..];
        assert_eq!(of_ball.iter().flat_map(|l| numbers(l)).min(), Some(counts[0].0 + 1));
        Ok(())
    }
}
