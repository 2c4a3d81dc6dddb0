//! An output folder that appears whole or not at all.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// Why an output could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {act} {path}: {source}", path = path.display())]
pub struct OutputError {
    act: &'static str,
    path: PathBuf,
    #[source]
    source: io::Error,
}

impl OutputError {
    /// An error of doing `act` (an infinitive, such as "write") to `path`.
    pub fn new(act: &'static str, path: impl Into<PathBuf>, source: io::Error) -> Self {
        Self { act, path: path.into(), source }
    }

    /// What the system said.
    #[must_use]
    pub fn kind(&self) -> io::ErrorKind {
        self.source.kind()
    }
}

/// Files on their way into a folder.
///
/// They are written under temporary names beside it and moved in by [`OutputFolder::commit`]. Dropped before that, they
/// are removed, and what the folder held is untouched.
#[derive(Debug)]
pub struct OutputFolder {
    target: PathBuf,
    staging: tempfile::TempDir,
    names: Vec<String>,
    prefix: String,
}

impl OutputFolder {
    /// Prepares to write into `target`, which need not exist yet. Missing parents are made.
    ///
    /// # Errors
    /// [`OutputError`] if the folder cannot be written to: found out now rather than after an hour's work.
    pub fn begin(target: impl Into<PathBuf>) -> Result<Self, OutputError> {
        let target = target.into();
        if target.exists() && !target.is_dir() {
            let source = io::Error::new(io::ErrorKind::NotADirectory, "a file of that name exists");
            return Err(OutputError::new("make the folder", target, source));
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        fs::create_dir_all(&parent).map_err(|e| OutputError::new("make the folder", &parent, e))?;
        // Within the target where it exists, so that a read-only folder is found out at once.
        let home = if target.is_dir() { &target } else { &parent };
        let staging = tempfile::Builder::new()
            .prefix(".combwright-")
            .tempdir_in(home)
            .map_err(|e| OutputError::new("write to the folder", home, e))?;
        Ok(Self { target, staging, names: Vec::new(), prefix: String::new() })
    }

    /// What is written from now on lies in this sub-folder; an empty name means the folder itself.
    pub fn enter(&mut self, sub_folder: &str) {
        self.prefix = if sub_folder.is_empty() { String::new() } else { format!("{sub_folder}/") };
    }

    /// Writes one file through a buffered writer; `name` may hold sub-folders.
    ///
    /// # Errors
    /// [`OutputError`] if it cannot be made or written.
    pub fn write(
        &mut self,
        name: impl Into<String>,
        content: impl FnOnce(&mut io::BufWriter<fs::File>) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let name = format!("{}{}", self.prefix, name.into());
        let path = self.staging.path().join(&name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| OutputError::new("make the folder", parent, e))?;
        }
        let fail = |e| OutputError::new("write", self.target.join(&name), e);
        let mut writer = io::BufWriter::with_capacity(1 << 20, fs::File::create(&path).map_err(fail)?);
        content(&mut writer).map_err(fail)?;
        io::Write::flush(&mut writer).map_err(fail)?;
        self.names.push(name);
        Ok(())
    }

    /// Writes one file from bytes.
    ///
    /// # Errors
    /// As [`OutputFolder::write`].
    pub fn write_bytes(&mut self, name: impl Into<String>, bytes: &[u8]) -> Result<(), OutputError> {
        self.write(name, |writer| io::Write::write_all(writer, bytes))
    }

    /// Writes a value as indented JSON with a final newline.
    ///
    /// # Errors
    /// As [`OutputFolder::write`].
    pub fn write_json(
        &mut self,
        name: impl Into<String>,
        value: &impl serde::Serialize,
    ) -> Result<(), OutputError> {
        self.write(name, |writer| {
            serde_json::to_writer_pretty(&mut *writer, value)?;
            io::Write::write_all(writer, b"\n")
        })
    }

    /// The names written so far.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The CRC-32 of a file that was written.
    ///
    /// # Errors
    /// [`OutputError`] if it cannot be read back.
    pub fn checksum(&self, name: &str) -> Result<u32, OutputError> {
        Ok(crc32fast::hash(&read(&self.staging.path().join(name))?))
    }

    /// Saves the target's own file of this name unless it has the checksum given or is the same as the one that will replace
    /// it, so that what a person wrote into it is not lost; the name of the copy.
    ///
    /// # Errors
    /// [`OutputError`] if it cannot be read or copied.
    pub fn keep_other(&self, name: &str, checksum: Option<u32>) -> Result<Option<String>, OutputError> {
        let there = self.target.join(name);
        if !there.is_file() {
            return Ok(None);
        }
        let old = read(&there)?;
        if checksum == Some(crc32fast::hash(&old)) || old == read(&self.staging.path().join(name))? {
            return Ok(None);
        }
        let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
        let mut number = 1;
        loop {
            let copy = format!("{stem}.before-{number}.{extension}");
            let path = self.target.join(&copy);
            if !path.exists() {
                write_whole(&path, |file| io::Write::write_all(file, &old))?;
                return Ok(Some(copy));
            }
            if read(&path)? == old {
                return Ok(Some(copy));
            }
            number += 1;
        }
    }

    /// Where the files will be.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Where the files are until then.
    #[must_use]
    pub fn staging(&self) -> &Path {
        self.staging.path()
    }

    /// Moves all files into the folder; files of other names that it holds stay. Gives the paths.
    ///
    /// # Errors
    /// [`OutputError`] if the folder cannot be made or a file cannot be moved.
    pub fn commit(self) -> Result<Vec<PathBuf>, OutputError> {
        fs::create_dir_all(&self.target).map_err(|e| OutputError::new("make the folder", &self.target, e))?;
        let mut paths = Vec::new();
        for name in &self.names {
            let to = self.target.join(name);
            if let Some(parent) = to.parent() {
                fs::create_dir_all(parent).map_err(|e| OutputError::new("make the folder", parent, e))?;
            }
            fs::rename(self.staging.path().join(name), &to).map_err(|e| OutputError::new("write", &to, e))?;
            paths.push(to);
        }
        Ok(paths)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, OutputError> {
    fs::read(path).map_err(|e| OutputError::new("read", path, e))
}

/// Writes one file whole or not at all: under a temporary name beside `path`, then renamed.
///
/// # Errors
/// [`OutputError`] if it cannot be made, written or renamed.
pub fn write_whole(
    path: &Path,
    content: impl FnOnce(&mut io::BufWriter<&mut fs::File>) -> io::Result<()>,
) -> Result<(), OutputError> {
    let fail = |e| OutputError::new("write", path, e);
    let parent = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut file = tempfile::NamedTempFile::new_in(parent).map_err(fail)?;
    let mut writer = io::BufWriter::new(file.as_file_mut());
    content(&mut writer).map_err(fail)?;
    io::Write::flush(&mut writer).map_err(fail)?;
    drop(writer);
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_appears_before_the_commit_and_nothing_is_lost() -> Result<(), Box<dyn std::error::Error>> {
        let home = tempfile::tempdir()?;
        let out = home.path().join("a/b");
        fs::create_dir_all(&out)?;
        fs::write(out.join("kept.txt"), "old")?;
        let mut folder = OutputFolder::begin(&out)?;
        folder.write_bytes("kept.txt", b"new")?;
        drop(folder);
        assert_eq!(fs::read_to_string(out.join("kept.txt"))?, "old");
        let mut folder = OutputFolder::begin(&out)?;
        folder.write_bytes("sub/new.txt", b"new")?;
        folder.commit()?;
        let mut left: Vec<_> =
            fs::read_dir(&out)?.map(|e| e.map(|e| e.file_name())).collect::<Result<_, _>>()?;
        left.sort();
        assert_eq!(left, ["kept.txt", "sub"]);
        Ok(())
    }

    #[test]
    fn a_file_in_the_way_is_refused_at_once() -> Result<(), Box<dyn std::error::Error>> {
        let home = tempfile::tempdir()?;
        let path = home.path().join("file");
        fs::write(&path, "x")?;
        assert!(OutputFolder::begin(&path).is_err_and(|e| e.kind() == io::ErrorKind::NotADirectory));
        Ok(())
    }
}
