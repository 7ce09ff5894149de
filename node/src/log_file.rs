//! A log's files on a disk that may be full or taken away: whole rows or none.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use anyhow::Context;

/// The rows of a log; its facts lie beside them.
#[derive(Debug, Clone)]
pub(crate) struct LogFile {
    csv: PathBuf,
    /// Bytes of it that are whole rows.
    whole: u64,
}

impl LogFile {
    /// Begins `STEM.csv` and `STEM.toml`, with these facts; or `STEM.N.csv` and its facts, with the first number from `run` on that is
    /// free. Says with which.
    ///
    /// # Errors
    /// When the folder cannot be written to: then nothing was begun.
    pub(crate) fn begin(folder: &Path, stem: &str, run: u32, facts: &str) -> anyhow::Result<(Self, u32)> {
        let mut number = run.max(1);
        loop {
            let name = if number == 1 { stem.to_owned() } else { format!("{stem}.{number}") };
            let (csv, toml) = (folder.join(format!("{name}.csv")), folder.join(format!("{name}.toml")));
            // Facts without a log are somebody else's: a robot's configuration, say.
            let begun = if toml.exists() {
                Err(ErrorKind::AlreadyExists.into())
            } else {
                OpenOptions::new().write(true).create_new(true).open(&csv)
            };
            match begun {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
                Err(error) => return Err(error).with_context(|| format!("cannot write {}", csv.display())),
                Ok(_) => {
                    crate::files::write_text(&toml, facts).inspect_err(|_| drop(std::fs::remove_file(&csv)))?;
                    return Ok((Self { csv, whole: 0 }, number));
                }
            }
        }
    }

    /// Adds whole rows, all of them or none.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn add(&mut self, rows: &str) -> anyhow::Result<()> {
        let add = || -> std::io::Result<u64> {
            let mut file = OpenOptions::new().append(true).open(&self.csv)?;
            // What was written of rows that did not fit, and could not be cut off then.
            let whole = self.whole.min(file.metadata()?.len());
            file.set_len(whole)?;
            file.write_all(rows.as_bytes()).inspect_err(|_| drop(file.set_len(whole)))?;
            Ok(whole + rows.len() as u64)
        };
        self.whole = add().with_context(|| format!("cannot write {}", self.csv.display()))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_row_is_cut_off_before_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let (mut file, _) = LogFile::begin(folder.path(), "r1", 0, "").unwrap();
        file.add("time_s,x\n0,1\n").unwrap();
        // What a full disk leaves of a write.
        let csv = folder.path().join("r1.csv");
        OpenOptions::new().append(true).open(&csv).unwrap().write_all(b"1,").unwrap();
        file.add("1,2\n").unwrap();
        assert_eq!(std::fs::read_to_string(&csv).unwrap(), "time_s,x\n0,1\n1,2\n");
    }

    #[test]
    fn nothing_is_written_over_and_nothing_begun_without_its_facts() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("r1.toml"), "id = \"r1\"").unwrap();
        let (_, number) = LogFile::begin(folder.path(), "r1", 0, "facts").unwrap();
        assert_eq!((number, std::fs::read_to_string(folder.path().join("r1.toml")).unwrap().as_str()), (2, "id = \"r1\""));
        assert!(LogFile::begin(&folder.path().join("none"), "r1", 0, "").is_err());
    }
}
