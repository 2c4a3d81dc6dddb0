//! From photographs of comb to cells and their numbers of sides.
//!
//! **Enters** a photograph of built comb, of any size, light and wall colour, at 12 to 640 pixels per cell. **Leaves**
//! [`Comb`]: the [`CellPattern`] in pixels, each cell with its number of sides, status and confidence, and its outline.
//! Nothing is tuned per photograph.
//!
//! | step | file |
//! |---|---|
//! | read the file, bring it to another scale | `photo.rs`, `raster.rs`, `plane.rs` |
//! | find the pitch: the scale at which most of the photograph is a hexagonal lattice | `pitch.rs`, `peaks.rs` |
//! | level the light; learn the colour of walls against that of cells | `light.rs`, `smooth.rs` |
//! | find the cells: blobs that continue a lattice, clear ones amid it, hidden cells inferred between them | `survey.rs`, `lattice.rs`, `grid.rs` |
//! | find cells that are seen obliquely, and so are narrower than the lattice allows | `openings.rs`, `ellipse.rs` |
//! | share the pixels among the cells: watershed on the walls | `watershed.rs`, `terrain.rs` |
//! | measure each cell and each wall; seen, hidden, or beyond the comb | `walls.rs`, `evidence.rs`, `kinds.rs` |
//! | count sides by walls and by Delaunay neighbours, decide, say how sure | `sides.rs`, `triangulation.rs`, `cell_status.rs` |
//! | all of this in order; the result in pixels of the photograph | `read.rs`, `comb_pattern.rs` |
//! | a person's corrections; the table `cells.csv` | `corrections.rs`, `table.rs` |
//! | synthetic photographs with exact truth | `synthetic/` |
//! | a reading against a truth | `score.rs` |
//!
//! A cell is *complete* if its whole outline is seen. At the border of the photograph its neighbours may be cut, and even a
//! neighbour of which nothing is seen counts as one side, since the wall towards it is seen; at the edge of the comb and
//! beside caps a cell is *cut*, except that a single hidden neighbour, enclosed by cells that are seen, counts as one side.
//! This is what keeps false fives and sevens away from the edges. Where comb turns away from the camera by more than 56 degrees
//! cells hide behind one another, and counts are uncertain.
//!
//! Not promised: cells smaller than 11 pixels are refused; caps are not told from other covers; nothing is measured in
//! depth; contents of cells are not recognised.
//!
//! Sources: S. Gharooni-Fard et al., "Crystallography of honeycomb formation under geometric frustration", PNAS 119 (2022),
//! for the question; F. Meyer, "Topographic distance and watershed lines", Signal Processing 38 (1994), for flooding;
//! R. Fisher, "The use of multiple measurements in taxonomic problems", Ann. Eugenics 7 (1936), for the wall colour.

mod cell_status;
mod comb_pattern;
mod corrections;
mod ellipse;
mod evidence;
mod grid;
mod kinds;
mod lattice;
mod light;
mod openings;
mod peaks;
mod photo;
mod pitch;
mod plane;
mod raster;
mod read;
mod score;
mod sides;
mod smooth;
mod survey;
pub mod synthetic;
mod table;
mod terrain;
mod triangulation;
mod walls;
mod watershed;

use crate::{
    index::IndexVec,
    tessellation::{CellId, CellPattern, PatternDefect},
};
use glam::DVec2;
use raster::Pyramid;

pub use comb_pattern::CellDetail;
pub use corrections::{Correction, CorrectionError, Corrections};
pub use photo::{MAX_PIXELS, Part, Photo, PhotoError};
pub use pitch::Polarity;
pub use read::{GREATEST_PITCH, LEAST_PITCH};
pub use score::{Score, Truth, TruthCell, TruthError, Wrong, score};
pub use table::{CellRow, TableError, read_cells, write_cells};

/// What may be said beforehand; nothing needs to be.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// The pitch in pixels, where the search for it should be confined to within 10 % of a value.
    pub pitch: Option<f64>,
    /// The part of the photograph to read; all of it if none.
    pub part: Option<Part>,
    /// What hides the comb.
    pub mask: Option<Mask>,
    /// What a person says of the cells.
    pub corrections: Corrections,
}

/// Pixels of a photograph that are to be ignored.
#[derive(Clone, Debug)]
pub struct Mask {
    width: usize,
    height: usize,
    hidden: Vec<bool>,
}

impl Mask {
    /// Hides every pixel of `picture` that is brighter than half.
    #[must_use]
    pub fn from_picture(picture: &Photo) -> Self {
        let bright = |pixel: &image::Rgb<u8>| pixel.0.iter().map(|v| u32::from(*v)).sum::<u32>() > 3 * 127;
        Self {
            width: picture.width(),
            height: picture.height(),
            hidden: picture.to_rgb8().pixels().map(bright).collect(),
        }
    }

    /// Whether the pixel is to be ignored.
    #[must_use]
    pub fn hides(&self, x: usize, y: usize) -> bool {
        self.hidden[y * self.width + x]
    }
}

/// Comb that was read from a photograph.
#[derive(Clone, Debug)]
pub struct Comb {
    /// The cells, in pixels of the photograph; x points right and y down.
    pub pattern: CellPattern,
    /// What the photograph tells of each cell beyond the pattern.
    pub details: IndexVec<CellId, CellDetail>,
    /// The median distance of neighbouring cells, in pixels.
    pub pitch: f64,
    /// Whether cells are darker or brighter than their walls.
    pub polarity: Polarity,
    /// Width of the photograph in pixels.
    pub width: usize,
    /// Height of the photograph in pixels.
    pub height: usize,
}

/// Why a photograph gives no comb.
#[derive(Debug, thiserror::Error)]
pub enum CombError {
    /// Nothing in it looks like comb.
    #[error(
        "no comb found: nothing in the photograph looks like a hexagonal lattice of {LEAST_PITCH} to {GREATEST_PITCH} px \
         pitch; if there is comb in it, say where by --roi or how large its cells are by --pitch"
    )]
    NoComb,
    /// The cells are too small.
    #[error(
        "the cells are {pitch:.1} px wide, too small to count their sides; at least {LEAST_PITCH} px are needed, \
         25 px or more are better: photograph from nearer or at a higher resolution"
    )]
    TooFine {
        /// Their pitch in pixels.
        pitch: f64,
    },
    /// The part to read is not within the photograph.
    #[error(
        "the region {left},{top},{width},{height} does not lie within the photograph of {photo_width} x {photo_height} px"
    )]
    Region {
        /// Left edge.
        left: usize,
        /// Upper edge.
        top: usize,
        /// Width.
        width: usize,
        /// Height.
        height: usize,
        /// The photograph's width.
        photo_width: usize,
        /// The photograph's height.
        photo_height: usize,
    },
    /// The mask is of another size than the photograph.
    #[error(
        "the mask is {mask_width} x {mask_height} px but the photograph is {width} x {height} px; make them the same size"
    )]
    MaskSize {
        /// The mask's width.
        mask_width: usize,
        /// The mask's height.
        mask_height: usize,
        /// The photograph's width.
        width: usize,
        /// The photograph's height.
        height: usize,
    },
    /// The pitch asked for makes no sense.
    #[error("a pitch of {pitch} px is not between {LEAST_PITCH} and {GREATEST_PITCH} px")]
    Pitch {
        /// What was asked for.
        pitch: f64,
    },
    /// A correction does not fit.
    #[error(transparent)]
    Correction(#[from] CorrectionError),
    /// The cells do not make a pattern.
    #[error("the cells read do not make a pattern: {}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Pattern(Vec<PatternDefect>),
}

/// Reads the comb in a photograph.
///
/// # Errors
/// [`CombError`] where there is none, it is too small, or the settings do not fit the photograph.
pub fn read(photo: &Photo, settings: &Settings) -> Result<Comb, CombError> {
    let part = part_of(photo, settings)?;
    check_mask(photo, settings)?;
    if let Some(pitch) = settings.pitch.filter(|p| !(LEAST_PITCH..=GREATEST_PITCH).contains(p)) {
        return Err(CombError::Pitch { pitch });
    }
    let pyramid = Pyramid::of(photo, part);
    let estimate = pitch::find(&pyramid, settings.pitch).ok_or(CombError::NoComb)?;
    if estimate.coverage < read::LEAST_COVERAGE {
        return Err(CombError::NoComb);
    }
    if estimate.pitch < LEAST_PITCH {
        return Err(CombError::TooFine { pitch: estimate.pitch });
    }
    let size = DVec2::new(photo.width() as f64, photo.height() as f64);
    settings.corrections.check(size, estimate.pitch)?;
    let reading = read::read(&pyramid, estimate, settings)?;
    if reading.seen() < read::LEAST_CELLS {
        return Err(CombError::NoComb);
    }
    let origin = DVec2::new(part.left as f64, part.top as f64);
    let (pattern, details) = comb_pattern::assemble(&reading, origin).map_err(CombError::Pattern)?;
    let mut comb = Comb {
        pattern,
        details,
        pitch: estimate.pitch,
        polarity: estimate.polarity,
        width: photo.width(),
        height: photo.height(),
    };
    settings.corrections.decide(&mut comb)?;
    Ok(comb)
}

fn part_of(photo: &Photo, settings: &Settings) -> Result<Part, CombError> {
    let whole = Part { left: 0, top: 0, width: photo.width(), height: photo.height() };
    let part = settings.part.unwrap_or(whole);
    let fits = |start: usize, length: usize, size: usize| {
        length > 0 && start.checked_add(length).is_some_and(|end| end <= size)
    };
    if fits(part.left, part.width, whole.width) && fits(part.top, part.height, whole.height) {
        return Ok(part);
    }
    Err(CombError::Region {
        left: part.left,
        top: part.top,
        width: part.width,
        height: part.height,
        photo_width: whole.width,
        photo_height: whole.height,
    })
}

fn check_mask(photo: &Photo, settings: &Settings) -> Result<(), CombError> {
    match &settings.mask {
        Some(mask) if (mask.width, mask.height) != (photo.width(), photo.height()) => {
            Err(CombError::MaskSize {
                mask_width: mask.width,
                mask_height: mask.height,
                width: photo.width(),
                height: photo.height(),
            })
        }
        _ => Ok(()),
    }
}
