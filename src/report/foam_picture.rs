//! The foam's picture: an open comb, its cells coloured by sides.
//!
//! The lower wall is opaque and coloured by the number of sides of each cell, the films stand on it, the upper wall is left
//! out, so that one looks into the cells as into comb. Cells that are not hexagons carry their number where they are seen.

use super::{
    figure::{Anchor, Drawing, Figure, FigureError},
    foam_surface::{CellFigures, Piece, PieceKind},
    palette::{self, Colour, INK},
    render::{Camera, Canvas, Corner},
};
use crate::{
    foam::partition::{Beyond, CellFace, Partition},
    index::Id,
    surface::{Gap, WallSide},
};
use glam::{DVec2, DVec3};

/// One cell to be drawn.
#[derive(Clone, Debug)]
pub struct DrawnCell {
    /// The number of sides; none for a cell that is cut.
    pub sides: Option<u32>,
    /// A place on its floor.
    pub middle: DVec3,
    /// The unit normal there, into the cell.
    pub normal: DVec3,
    /// The triangles of its floor.
    pub floor: Vec<[Corner; 3]>,
    /// The triangles of its films.
    pub films: Vec<[Corner; 3]>,
    /// The edge of its floor, in order.
    pub edge: Vec<DVec3>,
}

impl DrawnCell {
    fn empty(sides: Option<u32>) -> Self {
        let (floor, films, edge) = (Vec::new(), Vec::new(), Vec::new());
        Self { sides, middle: DVec3::ZERO, normal: DVec3::Z, floor, films, edge }
    }
}

/// What is drawn, and from where.
#[derive(Clone, Debug)]
pub struct FoamScene {
    /// The cells.
    pub cells: Vec<DrawnCell>,
    /// From the scene to the eye.
    pub towards_eye: DVec3,
    /// One line above the picture.
    pub title: String,
}

/// The size of the sheet, in its units; a unit is a pixel at scale 1.
const SHEET: [f64; 2] = [1400.0, 1160.0];

/// Pixels of the rendered part to a unit of the sheet.
const FINENESS: u32 = 1;

/// Space for the title and for the legend.
const HEAD: f64 = 60.0;
const FOOT: f64 = 70.0;

/// Films are drawn in the colour of wax, darker than a hexagon's floor.
const FILM: Colour = Colour([0xd8, 0xc6, 0x9a]);

/// The width of the dark seams, over the size of a cell.
const SEAM: f64 = 0.025;

/// A number is shown where the floor faces the eye at least this much (the cosine of the angle).
const FACING: f64 = 0.2;

impl FoamScene {
    /// The scene of a partition.
    #[must_use]
    pub fn of_partition(partition: &Partition, gap: &Gap, title: String) -> Self {
        let floor = gap.wall(WallSide::Lower);
        let normal = |point: DVec3| floor.field.gradient(point).normalize_or(DVec3::Z);
        let cells = partition.cells().iter().map(|cell| {
            let mesh = cell.mesh(gap);
            let cut = cell.faces.iter().any(|face| matches!(face.beyond, Beyond::Plane { .. }));
            let sides = u32::try_from(cell.sections.first().map_or(0, Vec::len)).ok();
            let middle = floor.project(cell.seed).unwrap_or(cell.seed);
            let mut drawn = DrawnCell::empty(sides.filter(|_| !cut));
            drawn.middle = middle;
            drawn.normal = normal(middle);
            let on_floor = |face: &&CellFace| face.beyond == Beyond::Wall(WallSide::Lower);
            drawn.edge.extend(cell.faces.iter().find(on_floor).into_iter().flat_map(|face| &face.outline));
            for (beyond, corners) in &mesh.loops {
                let points: Vec<DVec3> = corners.iter().map(|&index| mesh.vertices[index]).collect();
                match beyond {
                    Beyond::Wall(WallSide::Lower) => {
                        drawn.floor.extend(fan(&points, normal));
                    }
                    Beyond::Wall(WallSide::Upper) => {}
                    Beyond::Cell(..) | Beyond::Plane { .. } => {
                        let flat = (points[1] - points[0]).cross(points[2] - points[0]).normalize_or_zero();
                        drawn.films.extend(fan(&points, |_| flat));
                    }
                }
            }
            drawn
        });
        Self { cells: cells.collect(), towards_eye: towards_eye(gap), title }
    }

    /// The scene of a relaxed foam.
    #[must_use]
    pub fn of_foam(pieces: &[Piece], figures: &CellFigures, gap: &Gap, title: String) -> Self {
        let floor = gap.wall(WallSide::Lower);
        let normal = |point: DVec3| floor.field.gradient(point).normalize_or(DVec3::Z);
        let mut cells: Vec<DrawnCell> =
            figures.sides.iter().map(|&sides| DrawnCell::empty(Some(sides).filter(|&n| n > 0))).collect();
        for piece in pieces {
            let drawn = &mut cells[piece.cell.index()];
            let polygons = piece.polygons.iter().map(|polygon| -> Vec<DVec3> {
                polygon.iter().map(|&corner| piece.points[corner]).collect()
            });
            match piece.kind {
                PieceKind::Film { .. } => drawn.films.extend(polygons.flat_map(|points| {
                    let around = (1..points.len() - 1)
                        .map(|at| (points[at] - points[0]).cross(points[at + 1] - points[0]));
                    let flat = around.sum::<DVec3>().normalize_or_zero();
                    fan(&points, |_| flat)
                })),
                PieceKind::Wall(WallSide::Lower) => {
                    drawn.floor.extend(polygons.flat_map(|points| fan(&points, normal)));
                    drawn.middle = piece.points.last().copied().unwrap_or_default();
                    drawn.normal = normal(drawn.middle);
                    drawn.edge.extend(&piece.points[..piece.outline]);
                }
                PieceKind::Wall(WallSide::Upper) => {}
            }
        }
        Self { cells, towards_eye: towards_eye(gap), title }
    }

    /// The picture with its legend.
    ///
    /// # Errors
    /// [`FigureError`] if the picture cannot be encoded.
    pub fn draw(&self) -> Result<Figure, FigureError> {
        let size = DVec2::new(SHEET[0], SHEET[1] - HEAD - FOOT);
        let (width, height) = (FINENESS * whole(size.x), FINENESS * whole(size.y));
        let corners = self.cells.iter().flat_map(|cell| cell.films.iter().chain(&cell.floor).flatten());
        let places = corners.map(|corner| corner.position);
        let camera = Camera::fit(places, self.towards_eye, DVec3::Z, size.x / size.y);
        let mut canvas = Canvas::new(width, height, camera);
        for cell in &self.cells {
            for &triangle in &cell.floor {
                canvas.triangle(triangle, colour_of(cell.sides), 1.0);
            }
            for &triangle in &cell.films {
                canvas.triangle(triangle, FILM, 1.0);
            }
            for triangle in seam(cell, SEAM * self.radius(cell)) {
                canvas.triangle(triangle, INK, 1.0);
            }
        }
        let mut sheet = Drawing::new(SHEET[0], SHEET[1]);
        sheet.text([SHEET[0] / 2.0, 36.0], 22.0, Anchor::Middle, INK, &self.title);
        sheet.picture([0.0, HEAD], size.to_array(), &canvas.finish())?;
        self.number(&mut sheet, &canvas);
        self.legend(&mut sheet);
        Ok(sheet.finish())
    }

    /// Writes the number of sides into the cells that are not hexagons.
    fn number(&self, sheet: &mut Drawing, canvas: &Canvas) {
        let eye = self.towards_eye.normalize();
        for cell in &self.cells {
            let Some(sides) = cell.sides.filter(|&sides| sides != 6) else { continue };
            let radius = self.radius(cell);
            if cell.normal.dot(eye).abs() < FACING || !canvas.sees(cell.middle, 0.1 * radius) {
                continue;
            }
            let at = canvas.pixel_of(cell.middle) / f64::from(FINENESS) + DVec2::new(0.0, HEAD);
            let across =
                0.5 * canvas.pixel_of(cell.middle + radius * DVec3::Z).distance(canvas.pixel_of(cell.middle));
            let size = (0.9 * across).clamp(9.0, 30.0);
            let text = sides.to_string();
            let place = at + DVec2::new(0.0, 0.35 * size);
            // A rim of the other ink keeps the number legible where the cell lies in shade.
            let [ink, rim] = inks_on(colour_of(cell.sides));
            for offset in RIM {
                let moved = place + 0.06 * size * DVec2::from_array(offset);
                sheet.text(moved.to_array(), size, Anchor::Middle, rim, &text);
            }
            sheet.text(place.to_array(), size, Anchor::Middle, ink, &text);
        }
    }

    /// The mean distance of the floor's corners from its middle.
    fn radius(&self, cell: &DrawnCell) -> f64 {
        let distances = cell.floor.iter().flatten().map(|corner| corner.position.distance(cell.middle));
        distances.fold(0.0, f64::max)
    }

    /// How many cells of each kind there are.
    fn legend(&self, sheet: &mut Drawing) {
        let mut kinds: Vec<Option<u32>> = self.cells.iter().map(|cell| cell.sides).collect();
        kinds.sort_unstable_by_key(|sides| sides.unwrap_or(u32::MAX));
        kinds.dedup();
        let width = 190.0;
        let count = f64::from(u32::try_from(kinds.len()).unwrap_or(0));
        let mut x = 0.5 * (SHEET[0] - count * width);
        for kind in kinds {
            let cells = self.cells.iter().filter(|cell| cell.sides == kind).count();
            let y = SHEET[1] - 46.0;
            sheet.rectangle([x, y], [24.0, 24.0], INK);
            sheet.rectangle([x + 1.0, y + 1.0], [22.0, 22.0], colour_of(kind));
            let label = match kind {
                Some(sides) => format!("{sides} sides: {cells}"),
                None => format!("cut: {cells}"),
            };
            sheet.text([x + 34.0, y + 18.0], 18.0, Anchor::Start, INK, &label);
            x += width;
        }
    }
}

/// Thin dark ribbons along the edge of a floor: on its back, where no film marks it, and on its front, where films seen along
/// their plane would vanish.
fn seam(cell: &DrawnCell, width: f64) -> Vec<[Corner; 3]> {
    let corner = |point: DVec3, inset: f64, lift: f64| {
        let inward = (cell.middle - point).reject_from(cell.normal).normalize_or_zero();
        Corner { position: point + inset * inward + lift * cell.normal, normal: cell.normal }
    };
    let strip = |a: DVec3, b: DVec3, lift: f64| {
        let [outer, inner] = [0.0, width].map(|inset| [corner(a, inset, lift), corner(b, inset, lift)]);
        [[outer[0], outer[1], inner[1]], [outer[0], inner[1], inner[0]]]
    };
    let sides = cell.edge.iter().zip(cell.edge.iter().cycle().skip(1));
    sides.flat_map(|(&a, &b)| [0.3 * width, -0.3 * width].map(|lift| strip(a, b, lift))).flatten().collect()
}

/// The directions in which a number's rim is laid.
const RIM: [[f64; 2]; 8] =
    [[1.0, 0.0], [0.7, 0.7], [0.0, 1.0], [-0.7, 0.7], [-1.0, 0.0], [-0.7, -0.7], [0.0, -1.0], [0.7, -0.7]];

/// The ink that stands out on a colour, and the other one: by the luma of ITU-R BT.601.
fn inks_on(Colour([red, green, blue]): Colour) -> [Colour; 2] {
    let luma = 0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue);
    let white = Colour([255; 3]);
    if luma < 140.0 { [white, INK] } else { [INK, white] }
}

fn colour_of(sides: Option<u32>) -> Colour {
    sides.map_or(palette::GREY, palette::of_sides)
}

/// A good angle: from above the plane; from obliquely above everything else, off the symmetry axes.
fn towards_eye(gap: &Gap) -> DVec3 {
    match gap.middle().name() {
        "plane" => DVec3::new(0.25, -0.6, 1.0),
        "torus" => DVec3::new(0.0, -1.0, 0.9),
        _ => DVec3::new(0.55, -1.0, 0.45),
    }
}

fn fan(points: &[DVec3], normal: impl Fn(DVec3) -> DVec3) -> Vec<[Corner; 3]> {
    let corner = |position| Corner { position, normal: normal(position) };
    (1..points.len() - 1).map(|i| [points[0], points[i], points[i + 1]].map(corner)).collect()
}

/// A length of the sheet in whole pixels.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the sheet's sizes are whole and small"
)]
const fn whole(length: f64) -> u32 {
    length as u32
}
