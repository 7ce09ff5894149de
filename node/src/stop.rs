//! When a process is told to end.

use tokio::signal::unix::{Signal, SignalKind, signal};

/// Waits for Ctrl-C, for the signal by which service managers end a process, or for the terminal's end. A configuration is
/// read at the start alone, so that there is nothing else to do at a hang-up.
pub async fn told_to_stop() {
    let ignored = hang_up_is_ignored();
    let hung_up = async {
        match ignored {
            true => std::future::pending().await,
            false => one(signal(SignalKind::hangup())).await,
        }
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        () = one(signal(SignalKind::terminate())) => {}
        () = hung_up => {}
    }
}

/// Whether who started the process wants it to outlive its terminal (`nohup`): bit 0 of the signals that the kernel says it ignores.
fn hang_up_is_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 != 0)
}

/// Waits for a signal; for ever where nobody can listen for it.
async fn one(signal: std::io::Result<Signal>) {
    match signal {
        Ok(mut signal) => drop(signal.recv().await),
        Err(_) => std::future::pending().await,
    }
}
