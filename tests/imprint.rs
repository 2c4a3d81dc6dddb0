//! The whole chain on itself: a relaxed foam leaves its imprint, a photograph of the imprint is read, and the comparison must find
//! that foam and imprint are the same.

use combwright::{
    comb::{self, Comb, Photo},
    compare::{Finding, Sample, Settings, compare},
    foam::{
        pattern::{PatternPlace, pattern_of_state},
        relax::{RelaxSettings, State, Stop, relax},
        seeds::SeedSettings,
        setup::FoamSpace,
        start::start,
    },
    tessellation::{CellPattern, flipped_hexagons},
};
use glam::DVec2;
use image::{Rgb, RgbImage};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::{collections::BTreeMap, error::Error, ops::ControlFlow};

type Tried<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// Cells of the foam, and the edge of its square box, so that a cell is as large as a hexagon of width 1.
const CELLS: usize = 196;
const BOX: f64 = 13.028;

/// Pixels per cell width in the photograph, which shows a little more than one box.
const PITCH: f64 = 40.0;
const SHOWN: f64 = BOX + 3.0;

/// Grey values of wax and of the bottom of a cell, and half the width of a wall.
const GREYS: [f64; 2] = [0.78, 0.14];
const WALL: f64 = 0.05;

/// A dry foam between two plates, relaxed from seeds that were hardly annealed, so that it has defects.
fn foam() -> Tried<(State, CellPattern)> {
    let space = FoamSpace::Plane { periods: [BOX, BOX], height: 0.5 };
    let (gap, domain) = (space.gap()?, space.domain()?);
    let mut settings = SeedSettings::new(CELLS, 3);
    settings.anneal.sweeps = 200;
    settings.polish.steps = 40;
    let begun = start(&gap, &domain, &settings, &mut |_| ControlFlow::Continue(()))?;
    let relaxed = relax(begun.network, &gap, &RelaxSettings::default(), &mut |_| ControlFlow::Continue(()))?;
    assert!(matches!(relaxed.stop, Stop::Converged { .. }), "{:?}", relaxed.stop);
    let pattern =
        pattern_of_state(&relaxed.state, &gap, PatternPlace::Middle).map_err(|d| format!("{d:?}"))?;
    Ok((relaxed.state, pattern))
}

/// The films' lines on the lower plate, in bins of a cell's width, with their copies around the box.
fn films(state: &State) -> BTreeMap<[i64; 2], Vec<[DVec2; 2]>> {
    let mut bins: BTreeMap<[i64; 2], Vec<[DVec2; 2]>> = BTreeMap::new();
    for cell in state.network.cells() {
        let outline: Vec<DVec2> = state.outline_at(cell, 0).iter().map(|p| p.truncate()).collect();
        for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            for copy in 0..25_i32 {
                let shift = BOX * DVec2::new(f64::from(copy % 5 - 2), f64::from(copy / 5 - 2));
                bins.entry(bin((*a + *b) / 2.0 + shift)).or_default().push([*a + shift, *b + shift]);
            }
        }
    }
    bins
}

#[expect(clippy::cast_possible_truncation, reason = "a few cells' widths")]
fn bin(point: DVec2) -> [i64; 2] {
    [point.x.floor() as i64, point.y.floor() as i64]
}

/// The films as a photograph shows them: bright along the lines, dark away from them, noise of 0.03.
fn photograph(state: &State) -> RgbImage {
    let films = films(state);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut grey = |x: u32, y: u32| {
        let point = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) / PITCH;
        let [i, j] = bin(point);
        let around = (0..9).filter_map(|k| films.get(&[i + k % 3 - 1, j + k / 3 - 1])).flatten();
        let distance = around.map(|film| to_segment(point, *film)).fold(1.0, f64::min);
        let wax = 1.0 / (1.0 + (60.0 * (distance - WALL)).exp()) + 0.3 * (-7.0 * distance).exp();
        let noise: f64 = (0..4).map(|_| random.random::<f64>() - 0.5).sum();
        GREYS[1] + (GREYS[0] - GREYS[1]) * wax.min(1.0) + 0.052 * noise
    };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
    let (size, byte) = ((SHOWN * PITCH) as u32, |value: f64| (255.0 * value.clamp(0.0, 1.0)).round() as u8);
    RgbImage::from_fn(size, size, |x, y| Rgb([byte(grey(x, y)); 3]))
}

fn to_segment(point: DVec2, [a, b]: [DVec2; 2]) -> f64 {
    let along = b - a;
    let at = ((point - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    point.distance(a + at * along)
}

/// Complete cells of the imprint whose sides are not those of the foam's cell at their place.
fn misread(comb: &Comb, foam: &CellPattern) -> Vec<(DVec2, String)> {
    let mut wrong = Vec::new();
    for (_, cell) in comb.pattern.complete() {
        let at = cell.position.truncate() / PITCH;
        let apart = |other: &combwright::tessellation::Cell| {
            let step = (at - other.position.truncate()) / BOX;
            BOX * (step - step.round()).length()
        };
        let Some(own) = foam.cells.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))) else { continue };
        if cell.sides != own.sides || apart(own) > 0.2 {
            wrong.push((at, format!("{:?} for {:?}, {:.2} apart", cell.sides, own.sides, apart(own))));
        }
    }
    wrong
}

#[test]
fn a_foams_imprint_read_from_a_photograph_is_that_foam() -> Tried<()> {
    let (state, foam) = foam()?;
    let defects = foam.cells.iter().filter(|cell| cell.sides != Some(6)).count();
    assert!(defects >= 8, "{defects} defects say little");
    let picture = photograph(&state);
    let comb = comb::read(&Photo::from_picture(picture.into()), &comb::Settings::default())?;
    let complete = comb.pattern.complete().count();
    assert!(complete >= 150, "{complete} complete cells");
    // At the border a wall between two neighbours beyond it cannot be seen to end; such cells claim 97 %.
    let wrong = misread(&comb, &foam);
    let inside = |(at, _): &&(DVec2, String)| at.min_element() > 1.0 && at.max_element() < SHOWN - 1.0;
    assert!(!wrong.iter().any(|w| inside(&w)), "of {complete}: {wrong:?}");
    assert!(wrong.len() <= 3, "of {complete}: {wrong:?}");
    let sample = |name: &str, pattern: CellPattern| [Sample { name: name.to_owned(), pattern }];
    let settings = Settings::default();
    let same = compare(&sample("imprint", comb.pattern.clone()), &sample("foam", foam.clone()), &settings)?;
    assert_eq!(same.verdict.finding, Finding::NoDifference, "{}", same.verdict.sentence);
    assert!(same.sides.p > 0.2, "{}", same.sides.p);
    // The test is no formality: hexagons in place of the foam are told from its imprint.
    let hexagons = flipped_hexagons(14, 14, 0, 1).map_err(|d| format!("{d:?}"))?;
    let other = compare(&sample("imprint", comb.pattern), &sample("hexagons", hexagons), &settings)?;
    assert_eq!(other.verdict.finding, Finding::Different, "{}", other.verdict.sentence);
    Ok(())
}
