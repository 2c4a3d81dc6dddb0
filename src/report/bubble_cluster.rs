//! The picture of a pair or a triple of bubbles: their films standing on the lower wall.

use super::{
    figure::{Anchor, Drawing, Figure, FigureError},
    palette::{BLUE, Colour, INK, ORANGE, VERMILION, WAX},
    render::{Camera, Canvas, Corner},
};
use crate::{
    foam::{
        bubble::Cluster,
        complex::{Film, Shape},
    },
    surface::{Gap, WallSide},
};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// The size of the sheet, in its units; a unit is a pixel at scale 1.
const SHEET: [u32; 2] = [1100, 860];
/// Space for the title and for the legend.
const HEAD: u32 = 60;
const FOOT: u32 = 60;
/// The width of the wall that is shown, over that of the cluster.
const GROUND: f64 = 1.5;
/// Pieces of the wall, outward and round.
const RINGS: u32 = 40;
const SPOKES: u32 = 180;
/// Pieces along each side of an element.
const FINE: u32 = 4;

/// The films between bubbles in one colour, those towards the air in another, on a piece of the lower wall; the upper wall is
/// left out.
///
/// # Errors
/// [`FigureError`] if the picture cannot be encoded.
pub fn picture(cluster: &Cluster, gap: &Gap, title: &str) -> Result<Figure, FigureError> {
    let centre = cluster.centre();
    let normal = gap.middle().normal(centre);
    let extent =
        cluster.places.iter().map(|p| (*p - centre).reject_from(normal).length()).fold(0.0, f64::max);
    let ground = ground(gap, centre, normal, GROUND * extent);
    let films: Vec<([Corner; 3], Colour)> =
        cluster.complex.films.iter().flat_map(|film| facets(cluster, film)).collect();
    let (x, y) = normal.any_orthonormal_pair();
    let eye = normal + 0.75 * (0.8 * x + 0.6 * y);
    let (width, height) = (SHEET[0], SHEET[1] - HEAD - FOOT);
    let points = ground.iter().flatten().map(|corner| corner.position);
    let camera = Camera::fit(points, eye, normal, f64::from(width) / f64::from(height));
    let mut canvas = Canvas::new(width, height, camera);
    for corners in ground {
        canvas.triangle(corners, WAX, 1.0);
    }
    for (corners, colour) in films {
        canvas.triangle(corners, colour, 1.0);
    }
    let [sheet_width, sheet_height] = SHEET.map(f64::from);
    let mut sheet = Drawing::new(sheet_width, sheet_height);
    sheet.text([0.5 * sheet_width, 36.0], 20.0, Anchor::Middle, INK, title);
    sheet.picture([0.0, f64::from(HEAD)], [f64::from(width), f64::from(height)], &canvas.finish())?;
    for (at, (colour, label)) in
        (0..).zip([(BLUE, "film to the air"), (ORANGE, "film between bubbles"), (VERMILION, "border")])
    {
        let x = 40.0 + 230.0 * f64::from(at);
        sheet.rectangle([x, sheet_height - 44.0], [22.0, 22.0], colour);
        sheet.text([x + 32.0, sheet_height - 27.0], 17.0, Anchor::Start, INK, label);
    }
    Ok(sheet.finish())
}

/// A round piece of the lower wall, in rings; what cannot be reached from the tangent plane is left out.
fn ground(gap: &Gap, centre: DVec3, normal: DVec3, radius: f64) -> Vec<[Corner; 3]> {
    let wall = gap.wall(WallSide::Lower);
    let (x, y) = normal.any_orthonormal_pair();
    let foot = |(ring, spoke): (u32, u32)| {
        let flat = radius * f64::from(ring) / f64::from(RINGS)
            * DVec2::from_angle(TAU * f64::from(spoke) / f64::from(SPOKES));
        let position = wall.project(centre + flat.x * x + flat.y * y).ok()?;
        Some(Corner { position, normal: wall.field.normal(position) })
    };
    let near = |corners: &[Corner; 3]| {
        let far = 8.0 * radius / f64::from(RINGS);
        (0..3).all(|i| corners[i].position.distance(corners[(i + 1) % 3].position) < far)
    };
    let squares = (0..RINGS).flat_map(|i| (0..SPOKES).map(move |j| (i, j)));
    squares
        .flat_map(|(i, j)| [[(i, j), (i + 1, j), (i + 1, j + 1)], [(i, j), (i + 1, j + 1), (i, j + 1)]])
        .filter_map(|corners| {
            let [a, b, c] = corners.map(foot);
            Some([a?, b?, c?])
        })
        .filter(near)
        .collect()
}

/// The pieces of a film: its elements' parabolas drawn finely, borders as narrow bands.
fn facets(cluster: &Cluster, film: &Film) -> Vec<([Corner; 3], Colour)> {
    let inside = film.front.is_cell(&cluster.complex) && film.back.is_cell(&cluster.complex);
    let colour = if inside { ORANGE } else { BLUE };
    let mut facets = Vec::new();
    for element in film.elements.iter().filter(|element| element.shape == Shape::Quad9) {
        let nodes: Vec<DVec3> = element.nodes.iter().map(|image| cluster.places[image.node]).collect();
        let at = |i: u32, j: u32| {
            let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(FINE));
            let weights = element.shape.at(u, v, 1.0).value;
            nodes.iter().zip(weights).map(|(&node, weight)| weight * node).sum::<DVec3>()
        };
        let is_border = |node: usize| cluster.is_border(element.nodes[node].node);
        for i in 0..FINE {
            let edge = (i == 0 && is_border(3)) || (i + 1 == FINE && is_border(5));
            for j in 0..FINE {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let normal = (c - a).cross(d - b).normalize_or_zero();
                let corner = |position| Corner { position, normal };
                let colour = if edge { VERMILION } else { colour };
                facets.extend([[a, b, c], [a, c, d]].map(|corners| (corners.map(corner), colour)));
            }
        }
    }
    facets
}
