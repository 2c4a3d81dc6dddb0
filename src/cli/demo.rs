//! `combwright demo`: from nothing to the page, with what the program has on board.

use super::{
    CliError,
    demo_comb::{self, View},
    foam_relax::{self, Begin, Job, Keeper, Made},
    foam_run,
    foam_settings::{FoamSettings, Stage, space_of},
    interrupt, progress,
};
use crate::{
    compare::{self, Comparison, Sample},
    enclosure::{Design, Enclosure, Inspection, Recipe},
    foam::{
        relax::{RelaxSettings, Stop},
        seeds::SeedSettings,
    },
    mesh,
    report::{
        Scene, comb as comb_output, compare_files,
        figure::png,
        foam_surface::pieces,
        folder::OutputFolder,
        page::{PAGE_NAME, Page},
        page_photo, write_comb_vtp,
    },
    surface::Gap,
};
use anyhow::anyhow;
use glam::DVec3;
use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::{
    io,
    path::PathBuf,
    time::{Duration, Instant},
};

/// The demo's enclosure.
const RECIPE: &str = include_str!("demo.toml");

/// What `README.txt` says.
const README: &str = include_str!("demo_readme.txt");

/// The most cells: beyond this it is no demo.
const MOST_CELLS: usize = 2000;

/// An enclosure, the foam in its gap, a synthetic comb on its wall, photographs, their reading, the comparison, and one page.
///
/// Takes about half a minute. The page needs no server and no network: open it, or run combwright view.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  combwright demo -o out\n  combwright view out")]
pub(super) struct DemoArguments {
    /// Cells of the foam, and of the comb
    #[arg(short = 'n', long, value_name = "N", default_value_t = 256)]
    cells: usize,
    /// Where the random numbers start
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Threads; the results do not depend on it [default: all]
    #[arg(short = 'j', long, value_name = "J")]
    jobs: Option<usize>,
    /// The folder for the results
    #[arg(short, long, value_name = "FOLDER", default_value = "demo-out")]
    output: PathBuf,
}

/// Runs the command.
pub(super) fn run(arguments: &DemoArguments) -> Result<(), CliError> {
    if !(64..=MOST_CELLS).contains(&arguments.cells) {
        return Err(CliError::mistake(anyhow!(
            "--cells {} is out of range: 64 to {MOST_CELLS}; with fewer the photographs show too few complete cells",
            arguments.cells
        )));
    }
    let threads = rayon::ThreadPoolBuilder::new().num_threads(arguments.jobs.unwrap_or(0)).build();
    threads.map_err(CliError::failure)?.install(|| Demo::new(arguments)?.run())
}

struct Demo<'a> {
    arguments: &'a DemoArguments,
    folder: OutputFolder,
    design: Design,
    gap: Gap,
    seconds: Vec<(&'static str, f64)>,
}

impl<'a> Demo<'a> {
    fn new(arguments: &'a DemoArguments) -> Result<Self, CliError> {
        let folder = OutputFolder::begin(&arguments.output)?;
        interrupt::remove_on_interrupt(folder.staging());
        let recipe = Recipe::parse(RECIPE).map_err(CliError::failure)?;
        let design = Design::new(&recipe).map_err(CliError::failure)?;
        let gap = space_of(&design).gap().map_err(CliError::failure)?;
        Ok(Self { arguments, folder, design, gap, seconds: Vec::new() })
    }

    fn run(mut self) -> Result<(), CliError> {
        let enclosure = self.enclosure()?;
        let (job, made) = self.foam()?;
        let views = self.photographs()?;
        let (comparison, samples) = self.comparison(&made, &views)?;
        self.page(&enclosure, &job, &made, &views, &comparison)?;
        self.write_comparison(&comparison, &samples)?;
        self.folder.enter("");
        self.folder.write_bytes("README.txt", README.as_bytes())?;
        let total: f64 = self.seconds.iter().map(|(_, seconds)| seconds).sum();
        let run = json!({
            "schema": "combwright.run/1",
            "command": "demo",
            "version": env!("CARGO_PKG_VERSION"),
            "settings": { "cells": self.arguments.cells, "seed": self.arguments.seed },
            "seconds": self.seconds,
            "ended": comparison.verdict.finding,
        });
        self.folder.write_json("run.json", &run)?;
        let files = self.folder.commit()?;
        println!("\n{}\n", comparison.verdict.sentence);
        println!("{} files in {} after {total:.1} s", files.len(), self.arguments.output.display());
        println!(
            "open {}, or: combwright view {}",
            self.arguments.output.join(PAGE_NAME).display(),
            self.arguments.output.display()
        );
        Ok(())
    }

    /// Runs a stage with its bar, and says what came of it.
    fn stage<T>(
        &mut self,
        name: &'static str,
        length: u64,
        work: impl FnOnce(&mut Self, &ProgressBar) -> Result<(T, String), CliError>,
    ) -> Result<T, CliError> {
        let began = Instant::now();
        let bar = progress::steps(length);
        bar.set_message(name);
        let done = work(self, &bar);
        bar.finish_and_clear();
        let (result, said) = done?;
        let seconds = began.elapsed();
        self.seconds.push((name, seconds.as_secs_f64()));
        println!("{name:<14}{:>7}  {said}", in_seconds(seconds));
        Ok(result)
    }

    fn enclosure(&mut self) -> Result<Enclosure, CliError> {
        self.stage("enclosure", 3, |demo, bar| {
            let enclosure = Enclosure::build(demo.design.clone()).map_err(CliError::failure)?;
            bar.inc(1);
            let (inspection, _) = Inspection::new(&enclosure);
            bar.inc(1);
            demo.folder.enter("enclosure");
            demo.folder.write_json("check.json", &inspection)?;
            demo.folder.write_bytes("recipe.toml", RECIPE.as_bytes())?;
            let placed = enclosure.parts.iter().map(|part| mesh::Part {
                name: part.name,
                mesh: &part.solid,
                placement: enclosure.assembled(part),
            });
            let placed: Vec<mesh::Part<'_>> = placed.collect();
            demo.folder.write("enclosure.glb", |w| mesh::write_glb(&placed, w).map_err(io::Error::other))?;
            let gap = inspection.gap_mm;
            let said = format!(
                "{} parts, {}, gap {:.1} to {:.1} mm",
                enclosure.parts.len(),
                if inspection.sound { "sound" } else { "not sound" },
                gap.min,
                gap.max
            );
            Ok((enclosure, said))
        })
    }

    fn foam(&mut self) -> Result<(Job, Made), CliError> {
        let settings = self.foam_settings();
        self.stage("foam", 1000, |demo, bar| {
            let start = foam_run::started(&settings, &demo.gap, bar)?;
            let network =
                start.network.ok_or_else(|| CliError::failure(anyhow!("the partition gave no network")))?;
            let job = Job::new(&settings, start.seeds.psi6);
            let mut keeper = Keeper::new(&job, bar, None, Vec::new());
            let relaxed = keeper.relax(Begin::Network(network), &demo.gap)?;
            let made = Made::new(&job, &demo.gap, relaxed, keeper.record)?;
            demo.folder.enter("foam");
            foam_relax::write_all(
                &mut demo.folder,
                &job,
                &settings,
                &demo.gap,
                &made,
                Some(&start.seeds),
                Vec::new(),
            )?;
            let sides = foam_run::by_sides(&made.figures.side_counts);
            let said = format!(
                "{} cells ({sides}), {}",
                made.figures.cells,
                foam_relax::in_words(made.figures.ended)
            );
            match made.figures.ended {
                Stop::Converged { .. } => Ok(((job, made), said)),
                stop => Err(CliError::failure(anyhow!(
                    "the demo's foam is {}; try another --seed",
                    foam_relax::in_words(stop)
                ))),
            }
        })
    }

    fn foam_settings(&self) -> FoamSettings {
        FoamSettings {
            space: space_of(&self.design),
            seeds: SeedSettings::new(self.arguments.cells, self.arguments.seed),
            relax: RelaxSettings::default(),
            last_stage: Stage::Foam,
            runs: 1,
            anneal: 0,
            extrapolate: false,
            jobs: None,
            write_fe: None,
            output: PathBuf::new(),
        }
    }

    fn photographs(&mut self) -> Result<Vec<View>, CliError> {
        self.stage("photographs", 9, |demo, bar| {
            let seeds = demo_comb::comb_seeds(demo.arguments.cells, demo.arguments.seed);
            let domain = space_of(&demo.design).domain().map_err(CliError::failure)?;
            let comb = demo_comb::comb_on_wall(&demo.gap, &domain, &seeds, demo.design.period.0)?;
            bar.inc(1);
            let views = demo_comb::photograph(&comb, &demo.gap, &demo.design, demo.arguments.seed, bar)?;
            for view in &views {
                demo.write_view(view)?;
            }
            let read: usize = views.iter().map(|view| view.comb.pattern.complete().count()).sum();
            let counted: usize = views.iter().map(|view| view.on_wall.complete().count()).sum();
            let said = format!(
                "{} views, {read} complete cells read, {counted} after each is counted once",
                views.len()
            );
            Ok((views, said))
        })
    }

    fn write_view(&mut self, view: &View) -> Result<(), CliError> {
        let folder = &mut self.folder;
        folder.enter(&format!("comb/{}", view.name));
        folder.write_bytes("photo.png", &png(&view.picture)?)?;
        let summary = comb_output::summary(&view.name, &view.comb, None);
        comb_output::write(folder, &view.comb, &view.photo, &summary).map_err(CliError::failure)?;
        folder.write_json("camera.json", &view.camera)?;
        folder.write_json("pattern-on-wall.json", &view.on_wall)?;
        folder.write("cells-on-wall.vtp", |writer| write_comb_vtp(writer, &view.on_wall, &view.outlines))?;
        Ok(())
    }

    fn comparison(
        &mut self,
        made: &Made,
        views: &[View],
    ) -> Result<(Comparison, [Vec<Sample>; 2]), CliError> {
        self.stage("comparison", 1, |demo, _| {
            let comb = views
                .iter()
                .map(|view| Sample { name: view.name.clone(), pattern: view.on_wall.clone() })
                .collect();
            let foam = vec![Sample { name: "foam".to_owned(), pattern: made.pattern.clone() }];
            let settings = compare::Settings { seed: demo.arguments.seed, ..compare::Settings::default() };
            let samples: [Vec<Sample>; 2] = [comb, foam];
            let comparison =
                compare::compare(&samples[0], &samples[1], &settings).map_err(CliError::failure)?;
            let said = format!(
                "p = {:.4}, {} cells against {}",
                comparison.sides.p, comparison.comb.cells, comparison.foam.cells
            );
            Ok(((comparison, samples), said))
        })
    }

    fn write_comparison(
        &mut self,
        comparison: &Comparison,
        samples: &[Vec<Sample>; 2],
    ) -> Result<(), CliError> {
        self.stage("figures", 1, |demo, _| {
            demo.folder.enter("compare");
            let samples = [samples[0].as_slice(), samples[1].as_slice()];
            compare_files::write(&mut demo.folder, comparison, samples).map_err(CliError::failure)?;
            Ok(((), "tables, charts".to_owned()))
        })
    }

    fn page(
        &mut self,
        enclosure: &Enclosure,
        job: &Job,
        made: &Made,
        views: &[View],
        comparison: &Comparison,
    ) -> Result<(), CliError> {
        self.stage("page", 1, |demo, _| {
            let photos = views.iter().map(|view| {
                let complete = view.comb.pattern.complete().count();
                page_photo(&view.comb, &view.photo, format!("{}: {complete} complete cells", view.name))
            });
            let page = Page {
                title: "Comb against foam between two walls".to_owned(),
                subtitle: format!(
                    "A demonstration: the foam is real, the comb is drawn. {} cells each on the walls Φ = ±{} of a P-surface of \
                     period {} mm; comb photographed from eight corners and read by combwright.",
                    demo.arguments.cells,
                    demo.design.recipe.gap.delta.unwrap_or(0.0),
                    demo.design.period.0
                ),
                comparison,
                scenes: demo.scenes(enclosure, made, views),
                photos: photos.collect::<Result<_, _>>()?,
                unit: "mm".to_owned(),
                settings: demo.settings(job, views, comparison),
            };
            let html = page.html().map_err(CliError::failure)?;
            demo.folder.enter("");
            demo.folder.write_bytes(PAGE_NAME, html.as_bytes())?;
            Ok(((), format!("{PAGE_NAME}, {:.1} MB", 1e-6 * length(&html))))
        })
    }

    fn scenes(&self, enclosure: &Enclosure, made: &Made, views: &[View]) -> Vec<Scene> {
        let surface = pieces(&made.relaxed.state, &self.gap);
        let patterns: Vec<_> = views.iter().map(|view| (&view.on_wall, view.outlines.clone())).collect();
        // The shells' frame has the box's corner over the origin and the legs' ends on z = 0.
        let depth = self.design.recipe.base.groove * DVec3::Z;
        let back = self.design.period.0 * self.design.region.low() - depth;
        let [inner, _] = &enclosure.fronts;
        let wall = inner.clone().map(|p| p + back);
        vec![
            Scene::foam(
                &surface,
                &made.cells,
                &made.pattern,
                "The foam, relaxed: films between the walls, cells on the inner one.".to_owned(),
            ),
            Scene::comb(
                &wall,
                &patterns,
                0.002 * self.design.period.0,
                "The comb, as read from the photographs and mapped onto the inner shell.".to_owned(),
            ),
            Scene::enclosure(enclosure, "The enclosure: inner and outer shell on their base.".to_owned()),
        ]
    }

    /// Everything that the page follows from, without times.
    fn settings(&self, job: &Job, views: &[View], comparison: &Comparison) -> Value {
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "seed": self.arguments.seed,
            "enclosure": self.design.recipe,
            "foam": { "space": job.space, "seeds": job.seeds, "relaxation": job.relax },
            "comb": demo_comb::comb_seeds(self.arguments.cells, self.arguments.seed),
            "cameras": views.iter().map(|view| json!({ "name": view.name, "eye_mm": view.camera.centre, "focal_px": view.camera.focal })).collect::<Vec<_>>(),
            "comparison": comparison.settings,
        })
    }
}

fn in_seconds(time: Duration) -> String {
    format!("{:.1} s", time.as_secs_f64())
}

#[expect(clippy::cast_precision_loss, reason = "a page has less than 2^53 bytes")]
fn length(text: &str) -> f64 {
    text.len() as f64
}
