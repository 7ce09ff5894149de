//! Runs the program and keeps what it said.

use std::path::{Path, PathBuf};
use std::process::Command;

/// What a run of the program left.
pub struct Outcome {
    /// Exit status.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Outcome {
    /// The JSON document on standard output.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {}{}", self.stdout, self.stderr))
    }
}

/// Runs `lab` in a directory.
pub fn lab_in(directory: &Path, arguments: &[&str]) -> Outcome {
    let output = Command::new(env!("CARGO_BIN_EXE_lab")).current_dir(directory).args(arguments).output().unwrap();
    Outcome {
        code: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Runs `lab` where the shipped logs are.
pub fn lab(arguments: &[&str]) -> Outcome {
    lab_in(&measured(), arguments)
}

/// The directory of the shipped Enertech logs.
pub fn measured() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/measured/enertech-lco-2280mah")
}
