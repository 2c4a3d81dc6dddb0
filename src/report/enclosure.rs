//! The enclosure's table and pictures.

use crate::{
    enclosure::{Enclosure, GapSample, Inspection, PrintPart, Spread},
    index::Id,
    mesh::{ClosedMesh, TriMesh},
    report::{
        figure::{Anchor, Drawing, Figure, FigureError},
        folder::{OutputError, OutputFolder},
        palette::{Colour, GREY, INK, ORANGE, SKY},
        render::{Camera, Canvas, Corner},
    },
};
use glam::DVec3;
use std::{fmt::Write as _, io::Write as _};

/// The short table that a run prints.
#[must_use]
pub fn table(inspection: &Inspection) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(text, "{:<14} {:>9} {:>9} {:>9}", "mm", "min", "mean", "max");
    for (name, Spread { min, mean, max }) in [
        ("gap", inspection.gap_mm),
        ("inner wall", inspection.inner_wall_mm),
        ("outer wall", inspection.outer_wall_mm),
    ] {
        let _ = writeln!(text, "{name:<14} {min:>9.3} {mean:>9.3} {max:>9.3}");
    }
    let _ = writeln!(
        text,
        "\n{:<14} {:>22} {:>11} {:>8} {:>10} {:>6} {:>6}",
        "part", "size mm", "volume cm³", "mass g", "triangles", "genus", "bed"
    );
    for part in &inspection.parts {
        let [x, y, z] = part.size_mm;
        let _ = writeln!(
            text,
            "{:<14} {:>22} {:>11.1} {:>8.1} {:>10} {:>6} {:>6}",
            part.name,
            format!("{x:.1} × {y:.1} × {z:.1}"),
            part.volume_cm3,
            part.mass_g,
            part.triangles,
            part.genus,
            if part.fits_bed { "fits" } else { "NO" }
        );
    }
    let crossing: usize = inspection.parts.iter().map(|part| part.self_intersections).sum();
    let _ = writeln!(
        text,
        "\n{}: closed, oriented, {} crossing triangles, genus as expected: {}",
        if inspection.sound { "sound" } else { "NOT SOUND" },
        crossing,
        if inspection.parts.iter().all(|p| p.genus == p.expected_genus) { "yes" } else { "no" }
    );
    for warning in &inspection.warnings {
        let _ = writeln!(text, "note: {warning}");
    }
    text
}

/// Writes `gap.csv`: the gap sampled over the outer shell's front.
///
/// # Errors
/// [`OutputError`] if it cannot be written.
pub fn write_gap(folder: &mut OutputFolder, samples: &[GapSample]) -> Result<(), OutputError> {
    folder.write("gap.csv", |writer| {
        writeln!(writer, "x_mm,y_mm,z_mm,gap_mm")?;
        samples.iter().try_for_each(|sample| {
            let GapSample { position: p, gap } = sample;
            writeln!(writer, "{:.3},{:.3},{:.3},{gap:.4}", p.x, p.y, p.z)
        })
    })
}

/// The colour of a part in all pictures.
fn colour_of(name: &str) -> Colour {
    match name {
        "inner-shell" => ORANGE,
        "outer-shell" => SKY,
        _ => Colour([0xb8, 0xb2, 0xa6]),
    }
}

/// The direction from which the pictures are taken: from the front, a little from the left and from above.
const EYE: DVec3 = DVec3::new(-0.9, -2.0, 1.15);

/// All parts, shaded: beside each other as they are printed, and put together with a quarter cut away.
///
/// # Errors
/// [`FigureError`] if the picture cannot be made.
pub fn preview(enclosure: &Enclosure, inspection: &Inspection) -> Result<Figure, FigureError> {
    let mut drawing = Drawing::new(1500.0, 1180.0);
    let recipe = &enclosure.design.recipe;
    let Spread { min, max, .. } = inspection.gap_mm;
    let gap = if max - min < 0.1 { format!("{max:.1}") } else { format!("{min:.1} to {max:.1}") };
    let title = format!(
        "{}: L = {} mm, gap {gap} mm, walls {} mm",
        recipe.name, recipe.cell.period, recipe.wall.thickness
    );
    drawing.text([30.0, 44.0], 26.0, Anchor::Start, INK, &title);
    let panel = 480;
    for (place, part) in [0.0, 1.0, 2.0].into_iter().zip(&enclosure.parts) {
        let at = [30.0 + 490.0 * place, 70.0];
        let picture = picture_of(&[(part, DVec3::ZERO)], (panel, 360), |_| true);
        drawing.picture(at, [f64::from(panel), 360.0], &picture)?;
        let [x, y, z] = inspection
            .parts
            .iter()
            .find(|measured| measured.name == part.name)
            .map_or([f64::NAN; 3], |measured| measured.size_mm);
        let label = format!("{}  {x:.0} × {y:.0} × {z:.0} mm", part.name.replace('-', " "));
        drawing.text([at[0] + 240.0, 452.0], 18.0, Anchor::Middle, INK, &label);
    }
    let placed: Vec<_> = enclosure.parts.iter().map(|part| (part, enclosure.assembled(part))).collect();
    let middle = 0.5 * enclosure.design.region.size() * enclosure.design.period.0;
    // The quarter towards the eye is left out of the shells; the base stays whole.
    let cut = |p: DVec3| p.x > middle.x || p.y > middle.y;
    let picture = picture_of(&placed, (1180, 640), cut);
    drawing.picture([160.0, 480.0], [1180.0, 640.0], &picture)?;
    let label = "put together, with the quarter towards the eye cut away";
    drawing.text([750.0, 1150.0], 18.0, Anchor::Middle, INK, label);
    Ok(drawing.finish())
}

/// The cosine up to which a vertex counts as smooth: neighbouring faces of a shell differ by a few degrees, a vertex at a
/// rim by tens.
const SMOOTH: f64 = 0.985;

/// A shaded picture of parts, each moved to its place; of the shells only triangles whose middle is `kept`.
fn picture_of(
    placed: &[(&PrintPart, DVec3)],
    (width, height): (u32, u32),
    kept: impl Fn(DVec3) -> bool,
) -> image::RgbImage {
    let all = placed.iter().flat_map(|(part, by)| part.solid.mesh().positions.iter().map(move |&p| p + *by));
    let camera = Camera::fit(all, EYE, DVec3::Z, f64::from(width) / f64::from(height));
    let mut canvas = Canvas::new(width, height, camera);
    for (part, by) in placed {
        let mesh = part.solid.mesh();
        let normals = smooth_normals(&part.solid);
        for &triangle in &mesh.triangles {
            let corners = mesh.corners(triangle);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            if part.name == "base" || kept(middle) {
                let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
                let shaded = [0, 1, 2].map(|i| {
                    let smooth = normals[triangle[i].index()];
                    // At sharp edges the face's own normal; elsewhere the smooth one.
                    let rounded = part.name != "base" && smooth.dot(face) > SMOOTH;
                    let normal = if rounded { smooth } else { face };
                    Corner { position: corners[i] + *by, normal }
                });
                canvas.triangle(shaded, colour_of(part.name), 1.0);
            }
        }
    }
    canvas.finish()
}

/// Area-weighted vertex normals.
fn smooth_normals(solid: &ClosedMesh) -> Vec<DVec3> {
    let mesh: &TriMesh = solid.mesh();
    let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
    for &triangle in &mesh.triangles {
        let [a, b, c] = mesh.corners(triangle);
        let doubled = (b - a).cross(c - a);
        for vertex in triangle {
            normals[vertex.index()] += doubled;
        }
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// The grey of a cut through plastic.
pub(super) const CUT: Colour = GREY;
