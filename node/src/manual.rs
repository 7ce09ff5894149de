//! A program's command line, written down by the program itself: pages of a manual, and scripts with which shells complete it.

use std::io::{ErrorKind, Write as _};
use std::path::Path;

use anyhow::Context as _;
pub use clap_complete::Shell;

/// Writes a page of the manual for a program and for each of its commands.
///
/// # Errors
/// When the folder cannot be written to.
pub fn write_manual(program: clap::Command, dir: &Path) -> anyhow::Result<()> {
    let written = std::fs::create_dir_all(dir).and_then(|()| clap_mangen::generate_to(program, dir));
    written.with_context(|| format!("cannot write manual pages into {}", dir.display()))
}

/// Prints a script with which a shell completes a program's commands.
///
/// # Errors
/// When it cannot be printed. Whoever reads may have had enough (`| head`): that is none.
pub fn write_completions(mut program: clap::Command, shell: Shell) -> anyhow::Result<()> {
    let (mut script, name) = (Vec::new(), program.get_name().to_owned());
    // Into memory first: the generator panics where it cannot write.
    clap_complete::generate(shell, &mut program, name, &mut script);
    let mut out = std::io::stdout();
    match out.write_all(&script).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error).context("cannot print the completions"),
        _ => Ok(()),
    }
}
