//! Progress on a terminal; silence elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use std::{collections::BTreeMap, io::IsTerminal, time::Duration, time::Instant};

/// The stages of a run: a bar on stderr if that is a terminal, and how long each stage took.
#[derive(Debug)]
pub(super) struct Stages {
    bar: ProgressBar,
    current: Option<(&'static str, Instant)>,
    seconds: BTreeMap<&'static str, f64>,
}

impl Stages {
    /// A run of `count` stages.
    pub(super) fn new(count: u64) -> Self {
        Self { bar: steps(count), current: None, seconds: BTreeMap::new() }
    }

    /// Ends the stage before and begins the stage `name`.
    pub(super) fn begin(&mut self, name: &'static str) {
        self.end();
        self.current = Some((name, Instant::now()));
        self.bar.set_message(name);
    }

    fn end(&mut self) {
        if let Some((name, started)) = self.current.take() {
            self.seconds.insert(name, started.elapsed().as_secs_f64());
            self.bar.inc(1);
        }
    }

    /// Ends the last stage, removes the bar and gives the seconds of each stage.
    pub(super) fn finish(mut self) -> BTreeMap<&'static str, f64> {
        self.end();
        self.bar.finish_and_clear();
        self.seconds
    }
}

/// A bar over `steps` named steps on stderr. Hidden when stderr is no terminal.
pub(super) fn steps(steps: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template("{bar:24.yellow} {pos}/{len}  {msg}  {elapsed}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
