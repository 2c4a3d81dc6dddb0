//! Runs of datafiles for tests.

use combwright::evolver::{
    Document, EvolverError, parse_commands,
    session::{Flow, Host, Session},
    source::Source,
};
use std::{collections::BTreeMap, path::Path};

/// Collects what commands print and write.
#[derive(Default)]
pub(crate) struct Paper {
    pub(crate) text: String,
    pub(crate) files: BTreeMap<String, String>,
}

impl Host for Paper {
    fn print(&mut self, text: &str) {
        self.text.push_str(text);
    }

    fn write(&mut self, name: &str, text: &str, append: bool) -> Result<(), std::io::Error> {
        let file = self.files.entry(name.to_owned()).or_default();
        if !append {
            file.clear();
        }
        file.push_str(text);
        Ok(())
    }

    fn interrupted(&self) -> bool {
        false
    }
}

/// Reads a datafile, runs its read section and then the commands.
pub(crate) fn run(text: &str, commands: &str) -> Result<(Session, Paper), EvolverError> {
    let source = Source::new("test.fe", text);
    let mut document = Document::new(&source)?;
    let read_section = std::mem::take(&mut document.commands);
    let mut session = Session::new(document)?;
    let mut paper = Paper::default();
    session.run(&source, &read_section, &mut paper)?;
    let source = Source::new("commands", commands);
    let flow = session.run(&source, &parse_commands(&source)?, &mut paper)?;
    assert!(matches!(flow, Flow::Next | Flow::Quit));
    Ok((session, paper))
}

pub(crate) fn energy(text: &str, commands: &str) -> f64 {
    match run(text, commands) {
        Ok((mut session, _)) => session.values().unwrap().energy,
        Err(error) => panic!("{error}"),
    }
}

/// A datafile that lies beside the repository; `None`, and a note, where it does not.
pub(crate) fn shared(name: &str) -> Option<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/fe").join(name);
    let text = std::fs::read_to_string(&path).ok();
    if text.is_none() {
        println!("skipped: {} is not here", path.display());
    }
    text
}
