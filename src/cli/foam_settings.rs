//! From what was typed about a foam to what is meant, with all faults at once.

use super::foam::{DensityName, FoamArguments, OpenFacesName, SpaceArguments, StageName, SurfaceName};
use crate::foam::{
    complex::Strips,
    relax::RelaxSettings,
    seeds::{Density, SeedSettings},
    setup::{FoamSpace, OpenFaces, PeriodicSurface, PeriodicWalls},
};
use crate::{
    enclosure::{Design, Recipe},
    surface::{Gap, GapKind, SurfaceSamples},
    units::Mm,
};
use serde::Serialize;
use std::{
    fmt, fs,
    path::{Path, PathBuf},
};

/// The number of cells where none is given.
const DEFAULT_CELLS: usize = 64;

/// Lines per axis when the middle surface's area is measured: good to 1e-4.
const AREA_LINES: usize = 40;

/// The most cells of one foam. The memory of the sparse factors grows like N^1.3: beyond this no desktop holds them.
const MOST_CELLS: usize = 20_000;

/// The most cells of a partition alone.
const MOST_PARTITION_CELLS: usize = 200_000;

/// The most runs of a batch.
const MOST_RUNS: u64 = 100_000;

/// The most Lloyd steps.
const MOST_LLOYD: usize = 1000;

/// The most threads.
const MOST_JOBS: usize = 1024;

/// The last step of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Stage {
    Seeds,
    Partition,
    Foam,
}

/// What a run of `combwright foam` shall do.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FoamSettings {
    pub(super) space: FoamSpace,
    pub(super) seeds: SeedSettings,
    pub(super) relax: RelaxSettings,
    pub(super) last_stage: Stage,
    pub(super) runs: u64,
    /// Disturbances after the relaxation.
    pub(super) anneal: usize,
    /// Whether a finer mesh is relaxed, too, for the energy without a mesh.
    pub(super) extrapolate: bool,
    #[serde(skip)]
    pub(super) jobs: Option<usize>,
    #[serde(skip)]
    pub(super) write_fe: Option<String>,
    #[serde(skip)]
    pub(super) output: PathBuf,
}

/// Everything that is wrong with what was typed.
#[derive(Debug)]
pub(super) struct Faults(pub(super) Vec<String>);

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0[..] {
            [only] => f.write_str(only),
            all => {
                write!(f, "{} faults in the arguments:", all.len())?;
                all.iter().try_for_each(|fault| write!(f, "\n  - {fault}"))
            }
        }
    }
}

impl std::error::Error for Faults {}

impl FoamSettings {
    /// The settings that the arguments mean.
    pub(super) fn from_arguments(arguments: &FoamArguments) -> Result<Self, Faults> {
        let mut faults = unused(&arguments.space);
        let open_faces = arguments.open_faces.map(|name| match name {
            OpenFacesName::Walls => OpenFaces::Walls,
            OpenFacesName::Periodic => OpenFaces::Periodic,
        });
        let space = match &arguments.recipe {
            Some(file) => {
                recipe_space(file, open_faces, arguments.layers).map_err(|fault| Faults(vec![fault]))?
            }
            None => ended(space(&arguments.space, &mut faults), open_faces, &mut faults),
        };
        if arguments.layers == 2 && matches!(space, FoamSpace::Piece { .. } | FoamSpace::Box { .. }) {
            faults.push(
                "two layers of cells need a period: plane walls are for one layer; leave --open-faces out"
                    .to_owned(),
            );
        }
        let mut cells = arguments.cells.unwrap_or(DEFAULT_CELLS);
        match space.gap() {
            Ok(gap) => {
                if let Some(width) = arguments.cell_width {
                    cells = cells_of_width(&space, &gap, width, &mut faults);
                }
            }
            Err(error) if faults.is_empty() => faults.push(error.to_string()),
            Err(_) => {}
        }
        let seeds = seeds(arguments, cells);
        match few_on_a_sphere(&space, cells) {
            Some(exact) if arguments.stop_after.is_none() => faults.push(exact),
            _ => faults.extend(seeds.faults().iter().map(ToString::to_string)),
        }
        let last_stage = match arguments.stop_after {
            Some(StageName::Seeds) => Stage::Seeds,
            Some(StageName::Partition) => Stage::Partition,
            None => Stage::Foam,
        };
        let relax = relax(arguments, &mut faults);
        faults.extend(too_much(arguments, cells));
        faults.extend(idle(arguments));
        faults.extend(arguments.write_fe.as_deref().and_then(unfit_name));
        if !faults.is_empty() {
            return Err(Faults(faults));
        }
        Ok(Self {
            space,
            seeds,
            relax,
            last_stage,
            runs: arguments.runs,
            anneal: arguments.anneal,
            extrapolate: arguments.extrapolate,
            jobs: arguments.jobs,
            write_fe: arguments.write_fe.clone(),
            output: arguments.output.clone(),
        })
    }

    /// The same with another seed of the random numbers.
    pub(super) fn with_seed(&self, seed: u64) -> Self {
        Self { seeds: SeedSettings { seed, ..self.seeds }, ..self.clone() }
    }
}

/// The most elements along a film or through it: the error falls with the fourth power of their number.
const MOST_ELEMENTS: usize = 16;

fn relax(arguments: &FoamArguments, faults: &mut Vec<String>) -> RelaxSettings {
    let mut relax = RelaxSettings::default();
    match arguments.elements.as_deref() {
        None => {}
        Some(&[along, through])
            if (1..=MOST_ELEMENTS).contains(&along) && (1..=MOST_ELEMENTS).contains(&through) =>
        {
            relax.strips = Strips { along, through };
        }
        Some(_) => {
            faults.push(format!("--elements takes two numbers between 1 and {MOST_ELEMENTS}, as in 2,2"))
        }
    }
    if let Some(tolerance) = arguments.tolerance {
        if !(1e-13..=1e-2).contains(&tolerance) {
            faults.push(format!("--tolerance {tolerance} must lie between 1e-13 and 0.01"));
        }
        relax.tolerance = tolerance;
    }
    relax
}

fn seeds(arguments: &FoamArguments, cells: usize) -> SeedSettings {
    let mut seeds = SeedSettings::new(cells, arguments.seed);
    seeds.density = match arguments.density {
        DensityName::Gap => Density::Gap,
        DensityName::Uniform => Density::Uniform,
    };
    seeds.lloyd_steps = arguments.lloyd;
    let anneal = &mut seeds.anneal;
    anneal.sweeps = arguments.sweeps.unwrap_or(anneal.sweeps);
    anneal.diameter = arguments.disc.unwrap_or(anneal.diameter);
    anneal.hot = arguments.hot.unwrap_or(anneal.hot);
    anneal.cold = arguments.cold.unwrap_or(anneal.cold);
    seeds
}

/// Foams between spheres that are known exactly and have no network of cells with three corners or more.
fn few_on_a_sphere(space: &FoamSpace, cells: usize) -> Option<String> {
    let FoamSpace::Sphere { radii: [inner, outer] } = *space else { return None };
    let half_disc = 0.5 * std::f64::consts::PI * (outer * outer - inner * inner);
    let (films, why) = match cells {
        2 => (2.0, "one plane film that closes on itself parts the shell, without Plateau borders"),
        3 => (3.0, "three half planes part the shell, and meet in two Plateau borders on one axis"),
        _ => return None,
    };
    Some(format!(
        "N = {cells} between spheres needs no relaxation: {why}; the energy is exactly {:.10}. Networks here have cells of three sides or more: ask for at least 4 cells",
        films * half_disc
    ))
}

/// A space of periods, ended as was asked: planes in a box, one cell of Schwarz' P closed by its mirror planes.
fn ended(space: FoamSpace, open_faces: Option<OpenFaces>, faults: &mut Vec<String>) -> FoamSpace {
    match (space, open_faces) {
        (FoamSpace::Plane { periods, height }, Some(OpenFaces::Walls)) => {
            FoamSpace::Box { sides: periods, height }
        }
        (
            FoamSpace::Periodic { kind: PeriodicSurface::SchwarzP, period, walls },
            Some(open_faces @ OpenFaces::Walls),
        ) => FoamSpace::Piece { period, walls, low: [0; 3], high: [2; 3], open_faces },
        (FoamSpace::Plane { .. } | FoamSpace::Periodic { .. }, None | Some(OpenFaces::Periodic))
        | (_, None) => space,
        (_, Some(_)) => {
            faults.push("--open-faces is for Schwarz' P, for planes and for recipes: this surface has no planes of mirror symmetry to end at, or no open faces".to_owned());
            space
        }
    }
}

/// The gap that an enclosure's recipe describes, in mm: as much of it as is printed, closed by plane walls unless said otherwise;
/// for two layers, which know no plane walls, one period of it.
fn recipe_space(file: &Path, open_faces: Option<OpenFaces>, layers: u8) -> Result<FoamSpace, String> {
    let named = |error: &dyn fmt::Display| format!("{}: {error}", file.display());
    let text = fs::read_to_string(file).map_err(|error| named(&error))?;
    let recipe = Recipe::parse(&text).map_err(|error| named(&error))?;
    let design = Design::new(&recipe).map_err(|error| named(&error))?;
    let (low, high) = (design.region.low, design.region.high);
    let one_period = (0..3).all(|axis| high[axis] - low[axis] == 2);
    let periodic = open_faces == Some(OpenFaces::Periodic);
    if periodic && (one_period || layers == 2) || layers == 2 && open_faces.is_none() {
        return Ok(space_of(&design));
    }
    let open_faces = open_faces.unwrap_or(OpenFaces::Walls);
    Ok(FoamSpace::Piece { period: design.period.0, walls: walls_of(&design), low, high, open_faces })
}

/// One whole period of a design's gap, in mm.
pub(super) fn space_of(design: &Design) -> FoamSpace {
    let kind = PeriodicSurface::SchwarzP;
    FoamSpace::Periodic { kind, period: design.period.0, walls: walls_of(design) }
}

/// The walls of a design's gap, in mm.
fn walls_of(design: &Design) -> PeriodicWalls {
    let [lower, upper] = design.gap.walls();
    match design.gap.kind() {
        GapKind::LevelSet => PeriodicWalls::LevelSet { delta: upper.level },
        GapKind::Parallel => PeriodicWalls::Parallel { gap: (upper.level - lower.level) * design.period.0 },
    }
}

/// How many hexagons of this width cover the middle surface.
fn cells_of_width(space: &FoamSpace, gap: &Gap, width: Mm, faults: &mut Vec<String>) -> usize {
    if width.0 <= 0.0 {
        faults.push(format!("--cell-width is {width}: it must be positive"));
        return DEFAULT_CELLS;
    }
    let surface = gap.middle().as_ref();
    // A box of half periods holds as many halves of a period's area.
    let periods = space.domain().map_or(1.0, |domain| domain.periods_of(surface));
    let area = periods * SurfaceSamples::new(surface, 0.0, AREA_LINES).area();
    let hexagon = 0.5 * 3.0_f64.sqrt() * width.0 * width.0;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and too many are refused"
    )]
    let cells = (area / hexagon).round() as usize;
    cells
}

/// The space that was meant; missing and malformed numbers become faults.
pub(super) fn space(arguments: &SpaceArguments, faults: &mut Vec<String>) -> FoamSpace {
    match arguments.surface {
        SurfaceName::SchwarzP => periodic(arguments, PeriodicSurface::SchwarzP),
        SurfaceName::Gyroid => periodic(arguments, PeriodicSurface::Gyroid),
        SurfaceName::Diamond => periodic(arguments, PeriodicSurface::Diamond),
        SurfaceName::Sphere => {
            FoamSpace::Sphere { radii: pair("--radii", arguments.radii.as_deref(), faults) }
        }
        SurfaceName::Torus => FoamSpace::Torus {
            ring: needed("--ring", arguments.ring, faults),
            tubes: pair("--tube", arguments.tube.as_deref(), faults),
        },
        SurfaceName::Plane => FoamSpace::Plane {
            periods: pair("--periods", arguments.periods.as_deref(), faults),
            height: needed("--height", arguments.height, faults),
        },
    }
}

fn periodic(arguments: &SpaceArguments, kind: PeriodicSurface) -> FoamSpace {
    let walls = match arguments.parallel {
        Some(gap) => PeriodicWalls::Parallel { gap },
        None => PeriodicWalls::LevelSet { delta: arguments.delta.unwrap_or(0.2) },
    };
    FoamSpace::Periodic { kind, period: arguments.period.unwrap_or(1.0), walls }
}

fn needed(option: &str, value: Option<f64>, faults: &mut Vec<String>) -> f64 {
    value.unwrap_or_else(|| {
        faults.push(format!("this surface needs {option}"));
        f64::NAN
    })
}

fn pair(option: &str, values: Option<&[f64]>, faults: &mut Vec<String>) -> [f64; 2] {
    match values {
        Some(&[first, second]) => [first, second],
        Some(other) => {
            faults.push(format!("{option} takes two numbers with a comma between them, not {}", other.len()));
            [f64::NAN; 2]
        }
        None => {
            faults.push(format!("this surface needs {option}, two numbers with a comma between them"));
            [f64::NAN; 2]
        }
    }
}

/// Options that the chosen surface does not have: better said than ignored.
pub(super) fn unused(arguments: &SpaceArguments) -> Vec<String> {
    let kind = match arguments.surface {
        SurfaceName::SchwarzP | SurfaceName::Gyroid | SurfaceName::Diamond => "a triply periodic surface",
        SurfaceName::Sphere => "a sphere",
        SurfaceName::Torus => "a torus",
        SurfaceName::Plane => "a plane",
    };
    let given = [
        ("--period", arguments.period.is_some(), "a triply periodic surface"),
        ("--delta", arguments.delta.is_some(), "a triply periodic surface"),
        ("--parallel", arguments.parallel.is_some(), "a triply periodic surface"),
        ("--radii", arguments.radii.is_some(), "a sphere"),
        ("--tube", arguments.tube.is_some(), "a torus"),
        ("--ring", arguments.ring.is_some(), "a torus"),
        ("--periods", arguments.periods.is_some(), "a plane"),
        ("--height", arguments.height.is_some(), "a plane"),
    ];
    given
        .into_iter()
        .filter(|(_, is_given, of)| *is_given && *of != kind)
        .map(|(option, _, of)| format!("{option} belongs to {of}, but the surface is {kind}"))
        .collect()
}

/// Options that would do nothing beside the others.
fn idle(arguments: &FoamArguments) -> Vec<String> {
    let (is_early, two) = (arguments.stop_after.is_some(), arguments.layers == 2);
    let early = "needs a relaxed foam: leave out --stop-after";
    let options = [
        (is_early && arguments.write_fe.is_some(), "--write-fe", early),
        (is_early && arguments.extrapolate, "--extrapolate", early),
        (is_early && arguments.anneal > 0, "--anneal", early),
        (
            two && arguments.write_fe.is_some(),
            "--write-fe",
            "is for one layer of cells: leave out --layers 2",
        ),
        (!two && arguments.pattern.is_some(), "--pattern", "is for two layers of cells: add --layers 2"),
    ];
    options
        .into_iter()
        .filter(|(is_idle, ..)| *is_idle)
        .map(|(_, option, why)| format!("{option} {why}"))
        .collect()
}

/// What is wrong with the name of a datafile; its ending keeps it off the other files of the folder.
fn unfit_name(name: &str) -> Option<String> {
    let path = Path::new(name);
    let is_bare = path.file_name().is_some_and(|bare| bare == name);
    let is_datafile = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("fe"));
    (!(is_bare && is_datafile)).then(|| {
        format!("--write-fe {name:?} must be a plain file name that ends in .fe, as in foam.fe: it is written into the folder of --output")
    })
}

/// Sizes that no machine at hand can do.
fn too_much(arguments: &FoamArguments, cells: usize) -> Vec<String> {
    let mut faults = Vec::new();
    let most = if arguments.stop_after.is_some() { MOST_PARTITION_CELLS } else { MOST_CELLS };
    if cells > most {
        faults.push(format!(
            "{} cells are too many: a foam of them would need about {} of memory and {} on two cores; the most is {most}{}",
            cells,
            memory(cells),
            duration(cells),
            if arguments.stop_after.is_some() { "" } else { " (200000 with --stop-after partition)" },
        ));
    }
    if !(1..=MOST_RUNS).contains(&arguments.runs) {
        faults.push(format!("--runs {} must lie between 1 and {MOST_RUNS}", arguments.runs));
    }
    if arguments.runs > 1 && arguments.stop_after.is_some() {
        faults.push("--runs keeps the foam of least energy, which is known only after relaxation: leave out --stop-after".to_owned());
    }
    if arguments.lloyd > MOST_LLOYD {
        faults.push(format!(
            "--lloyd {} must be at most {MOST_LLOYD}: seeds have settled long before",
            arguments.lloyd
        ));
    }
    if let Some(jobs) = arguments.jobs
        && !(1..=MOST_JOBS).contains(&jobs)
    {
        faults.push(format!("-j {jobs} must lie between 1 and {MOST_JOBS} threads"));
    }
    faults
}

/// About how much memory a foam needs: 4 GB for 4000 cells, growing like N^1.3.
fn memory(cells: usize) -> String {
    format!("{:.0} GB", 4.0 * relative(cells).powf(1.3))
}

/// About how long it takes: 4 minutes for 4000 cells, growing like N^1.3.
fn duration(cells: usize) -> String {
    let hours = 4.0 / 60.0 * relative(cells).powf(1.3);
    if hours < 48.0 { format!("{hours:.0} hours") } else { format!("{:.0} days", hours / 24.0) }
}

#[expect(clippy::cast_precision_loss, reason = "an estimate")]
fn relative(cells: usize) -> f64 {
    cells as f64 / 4000.0
}
