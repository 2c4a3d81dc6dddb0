//! A datafile as a whole: its text read, its surface built, its commands parsed, its faults found.

use super::{
    command::{Statement, statements},
    datafile::Datafile,
    error::EvolverError,
    language::Cursor,
    source::Source,
    surface::{Fault, Surface, check},
};
use std::{fs, io::Read, path::Path, sync::Arc};

/// The largest datafile that is read: a hundred times the largest that are in use.
pub const FILE_LIMIT: u64 = 256 * 1024 * 1024;

/// A datafile that was read.
#[derive(Debug)]
pub struct Document {
    /// What it says.
    pub data: Datafile,
    /// The surface that it describes.
    pub surface: Surface,
    /// What its definitions ask for, and its `read` section.
    pub commands: Vec<Statement>,
    /// What is wrong with the surface.
    pub faults: Vec<Fault>,
}

impl Document {
    /// Reads a datafile's text.
    ///
    /// # Errors
    /// [`EvolverError`] with the place of what is wrong or not supported.
    pub fn new(source: &Arc<Source>) -> Result<Self, EvolverError> {
        let (mut data, mut cursor) = Datafile::read(source)?;
        let surface = Surface::new(&data)?;
        let mut commands = std::mem::take(&mut data.prelude);
        commands.extend(statements(&mut cursor)?);
        let faults = check(&data, &surface);
        Ok(Self { data, surface, commands, faults })
    }

    /// Turns the faces round that point the wrong way in their bodies; what was turned: body and face.
    ///
    /// # Errors
    /// [`EvolverError`] if the surface cannot be built anew.
    pub fn turn_faces(&mut self) -> Result<Vec<(i64, i64)>, EvolverError> {
        let mut turned = Vec::new();
        for fault in &self.faults {
            let Fault::Misoriented { body, faces, .. } = fault else { continue };
            let Some(line) = self.data.bodies.iter_mut().find(|line| line.id == *body) else { continue };
            for number in &mut line.faces {
                if faces.contains(&number.abs()) {
                    *number = -*number;
                    turned.push((*body, number.abs()));
                }
            }
        }
        self.surface = Surface::new(&self.data)?;
        self.faults = check(&self.data, &self.surface);
        Ok(turned)
    }
}

/// Commands from a text, such as a line that was typed.
///
/// # Errors
/// [`EvolverError`] with the place of what is wrong or not supported.
pub fn parse_commands(source: &Arc<Source>) -> Result<Vec<Statement>, EvolverError> {
    statements(&mut Cursor::new(source)?)
}

/// Reads a file of up to [`FILE_LIMIT`] bytes; bytes that are no text are replaced.
///
/// # Errors
/// [`EvolverError::TooLarge`], [`EvolverError::File`].
pub fn open(path: &Path) -> Result<Arc<Source>, EvolverError> {
    let name = path.display().to_string();
    let failed = |error| EvolverError::File { name: name.clone(), error };
    let file = fs::File::open(path).map_err(failed)?;
    let bytes = file.metadata().map_err(failed)?.len();
    if bytes > FILE_LIMIT {
        return Err(EvolverError::TooLarge { name, bytes, limit: FILE_LIMIT });
    }
    let mut text = Vec::new();
    // A device or a pipe may say that it is empty and never end.
    file.take(FILE_LIMIT + 1).read_to_end(&mut text).map_err(failed)?;
    if text.len() as u64 > FILE_LIMIT {
        return Err(EvolverError::TooLarge { name, bytes: text.len() as u64, limit: FILE_LIMIT });
    }
    Ok(Source::new(name, String::from_utf8_lossy(&text)))
}
