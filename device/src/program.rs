//! A program of the user's that acts for an agent. It is started anew for every act, with the act as its last arguments,
//! and ends when that is done, with exit status 0; what it prints may say more.

use std::io::Read as _;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::ensure;
use rustix::process::{Pid, Signal, kill_process_group, test_kill_process_group};
use tracing::{info, warn};

/// What is kept of what a program prints: the end of it matters.
const PRINTED_MAX: usize = 4096;
/// What has been asked to end for so long without ending is ended.
const GRACE: Duration = Duration::from_secs(10);
/// Time between two looks at whether it has.
const LOOK: Duration = Duration::from_millis(100);

/// A program and its first arguments, and what it is doing.
#[derive(Debug)]
pub struct Program {
    key: &'static str,
    command: Vec<String>,
    running: Option<Doing>,
    /// Waits for what was asked to end.
    ending: Option<JoinHandle<()>>,
}

/// An act under way.
#[derive(Debug)]
struct Doing {
    said: String,
    child: Child,
    printed: String,
}

/// An act that has ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// What it was asked to do.
    pub said: String,
    /// The end of what it printed.
    pub printed: String,
    /// Or what went wrong.
    pub result: Result<(), String>,
    /// Its exit status, where it has one.
    pub code: Option<i32>,
}

/// Time before an act that failed is begun again, s; twice as long after each failure. A guess: what was in the way is gone after
/// seconds, or somebody has to see to it.
const RETRY_S: f64 = 10.0;
/// No longer than this, s.
const RETRY_MAX_S: f64 = 300.0;

/// Time before an act that has failed so many times in a row is begun again, s.
#[must_use]
pub fn retry_s(failures: u32) -> f64 {
    (RETRY_S * f64::from(failures.saturating_sub(1)).exp2()).min(RETRY_MAX_S)
}

impl Program {
    /// A program that the configuration names under `key`; an empty `command` does nothing.
    #[must_use]
    pub fn new(key: &'static str, command: Vec<String>) -> Self {
        Self { key, command, running: None, ending: None }
    }

    /// Warns where the program is not there.
    pub fn look_for(&self) {
        if let Some(name) = self.command.first().filter(|name| !is_found(name)) {
            warn!("{}: there is no program {name}: nothing that is asked of it will be done", self.key);
        }
    }

    /// Checks that there is a program where there is something.
    ///
    /// # Errors
    /// Names the key.
    pub fn check(key: &str, command: &[String]) -> anyhow::Result<()> {
        ensure!(command.first().is_none_or(|program| !program.is_empty()), "{key}: its first entry is a program");
        Ok(())
    }

    /// Whether there is one.
    #[must_use]
    pub fn is_set(&self) -> bool {
        !self.command.is_empty()
    }

    /// Begins an act, in place of the one under way.
    ///
    /// # Errors
    /// Why it cannot be started.
    pub fn begin(&mut self, arguments: &[String]) -> Result<(), String> {
        self.stop();
        let said = arguments.join(" ");
        let Some((program, first)) = self.command.split_first() else {
            info!("asked to {said}: no {} is set, so nobody does it", self.key);
            return Ok(());
        };
        let mut command = Command::new(program);
        command.args(first).args(arguments).stdin(Stdio::null()).stdout(Stdio::piped());
        // A group of its own, so that what it has started ends with it.
        let child = command.process_group(0).spawn();
        let child = child.map_err(|error| format!("{}: {program} {said}: {error}", self.key))?;
        if let Some(stdout) = &child.stdout {
            let _ = rustix::io::ioctl_fionbio(stdout, true);
        }
        self.running = Some(Doing { said, child, printed: String::new() });
        Ok(())
    }

    /// Whether an act is under way.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// The act, when it has ended since this was asked before.
    pub fn ended(&mut self) -> Option<Ended> {
        let doing = self.running.as_mut()?;
        let ended = doing.child.try_wait();
        doing.hear();
        if matches!(ended, Ok(None)) {
            return None;
        }
        let Doing { said, printed, .. } = self.running.take()?;
        let code = ended.as_ref().ok().and_then(|status| status.as_ref()?.code());
        let result = match ended {
            Ok(Some(status)) if !status.success() => Err(format!("{}: `{said}` failed: {status}", self.key)),
            Err(error) => Err(format!("{}: `{said}`: {error}", self.key)),
            Ok(_) => Ok(()),
        };
        Some(Ended { said, printed, result, code })
    }

    /// Asks it and what it has started to end, and waits for it no longer than it needs.
    pub fn stop(&mut self) {
        let Some(Doing { said, mut child, .. }) = self.running.take() else { return };
        info!("`{said}` is not waited for any longer");
        let Some(group) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) else { return };
        let _ = kill_process_group(group, Signal::TERM);
        // Apart, so that nobody waits for a program that does not listen.
        self.ending = Some(std::thread::spawn(move || {
            for _ in 0..GRACE.as_millis() / LOOK.as_millis() {
                let _ = child.try_wait();
                // What it has started may need longer than itself.
                if test_kill_process_group(group).is_err() {
                    return;
                }
                std::thread::sleep(LOOK);
            }
            warn!("`{said}` does not end when it is asked to: it is ended");
            let _ = kill_process_group(group, Signal::KILL);
            let _ = child.wait();
        }));
    }

    /// Whether what was asked to end still goes on.
    #[must_use]
    pub fn is_ending(&self) -> bool {
        self.ending.as_ref().is_some_and(|ending| !ending.is_finished())
    }
}

impl Doing {
    /// Takes what has been printed by now.
    fn hear(&mut self) {
        let Some(stdout) = &mut self.child.stdout else { return };
        let mut bytes = [0; PRINTED_MAX];
        // It does not wait: `begin` has said so, and what the program has started may hold the pipe.
        while let Ok(read @ 1..) = stdout.read(&mut bytes) {
            self.printed.push_str(&String::from_utf8_lossy(&bytes[..read]));
            let beyond = self.printed.len().saturating_sub(PRINTED_MAX);
            self.printed.drain(..self.printed.ceil_char_boundary(beyond));
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Whether a program is there, by its path or in the folders of PATH.
fn is_found(name: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    name.contains('/') && Path::new(name).is_file()
        || !name.contains('/') && std::env::split_paths(&folders).any(|at| at.join(name).is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fails_is_begun_again_later_each_time_and_never_later_than_after_five_minutes() {
        assert_eq!([1, 2, 3, 5, 6, 7, u32::MAX].map(retry_s), [10.0, 20.0, 40.0, 160.0, 300.0, 300.0, 300.0]);
    }
}
