//! Over TLS, one thread both reads and writes.
//!
//! zenoh 1.10 lets the thread that reads and the one that writes into a TLS connection at the same
//! time, and its state is not made for that (zenoh #2557): under full traffic a process dies within
//! seconds. Which threads zenoh has, it reads from the environment and nowhere else, and what is set
//! there by a program that has threads already may be read half-written. So a program that is going to
//! speak TLS begins anew, in the same process, with the variable set.

use crate::NetworkConfig;

/// The variable that zenoh reads.
const VARIABLE: &str = "ZENOH_RUNTIME";
/// What reads is done by the one thread that writes.
const ONE_THREAD: &str = "(rx: (handover: tx))";

/// Begins this program anew with one thread for reading and writing, where it is going to speak TLS and
/// its environment says nothing of zenoh's threads. To be called before anything is opened.
///
/// # Errors
/// When the program cannot be begun anew: names the variable that whoever starts it may set instead.
pub fn begin_with_one_thread(network: &NetworkConfig) -> anyhow::Result<()> {
    if network.tls.is_none() || std::env::var_os(VARIABLE).is_some() {
        return Ok(());
    }
    Err(begin_anew()).map_err(|why| anyhow::anyhow!("over TLS this program needs {VARIABLE}='{ONE_THREAD}' in its environment ({why})"))
}

/// Returns only when it fails.
#[cfg(unix)]
fn begin_anew() -> std::io::Error {
    use std::os::unix::process::CommandExt as _;
    let mut words = std::env::args_os();
    match std::env::current_exe() {
        Ok(program) => {
            let mut anew = std::process::Command::new(program);
            if let Some(name) = words.next() {
                anew.arg0(name);
            }
            anew.args(words).env(VARIABLE, ONE_THREAD).exec()
        }
        Err(error) => error,
    }
}

/// Elsewhere a program has no way to begin anew in the same process.
#[cfg(not(unix))]
fn begin_anew() -> std::io::Error {
    std::io::Error::from(std::io::ErrorKind::Unsupported)
}
