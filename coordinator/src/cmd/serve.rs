//! A simulation on the dashboard: as fast as was asked for, and its end for as long as somebody looks.

use std::net::{IpAddr, Ipv4Addr};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use tokio::runtime::Runtime;
use tokio::sync::mpsc::Receiver;

use crate::sim::{Outcome, Step};
use crate::web::report::Ended;
use crate::web::{self, Asked, Books, Past, WebConfig};

/// Fastest that can be shown.
const SPEED_MAX: f64 = 100_000.0;
/// How long the simulation waits at a time while it is ahead of what is to be shown.
const NAP: Duration = Duration::from_millis(5);

/// Where a simulation is shown.
pub(super) struct Stage {
    runtime: Runtime,
    asked: Receiver<Asked>,
    speed: f64,
    begun: Instant,
}

impl Stage {
    /// Serves the dashboard on this machine.
    ///
    /// # Errors
    /// When the speed is out of range or the port is taken.
    pub(super) fn open(port: u16, speed: f64) -> anyhow::Result<Self> {
        ensure!(speed > 0.0 && speed <= SPEED_MAX, "--speed {speed}: must be above 0 and at most {SPEED_MAX}");
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let config = WebConfig { address: IpAddr::V4(Ipv4Addr::LOCALHOST), port, ..WebConfig::default() };
        let (desk, asked) = web::desk();
        let listener = runtime.block_on(web::bind(&config)).context("--port")?;
        eprintln!("dashboard at http://{}/", listener.local_addr()?);
        runtime.spawn(async move { web::serve(listener, &config, desk).await });
        Ok(Self { runtime, asked, speed, begun: now() })
    }

    /// A run begins.
    pub(super) fn begin(&mut self) {
        self.begun = now();
    }

    /// A step is done: answers until it is time for the next one.
    pub(super) fn step(&mut self, step: Step<'_>, books: Books<'_>) {
        let due = Duration::from_secs_f64(step.elapsed_s / self.speed);
        loop {
            while let Ok(asked) = self.asked.try_recv() {
                let _ = asked.answer(step.now, step.core, books.clone());
            }
            let ahead = due.saturating_sub(self.begun.elapsed());
            if ahead.is_zero() {
                break;
            }
            std::thread::sleep(ahead.min(NAP));
        }
    }

    /// Shows the end until Ctrl-C.
    pub(super) fn stay(self, outcome: &mut Outcome, past: &Past, title: &str, ended: &Ended) {
        let Self { runtime, mut asked, .. } = self;
        let site = outcome.site.clone();
        runtime.block_on(async {
            let mut stop = std::pin::pin!(node::told_to_stop());
            eprintln!("the run has ended; its end is shown until Ctrl-C");
            loop {
                tokio::select! {
                    Some(asked) = asked.recv() => {
                        let books = Books { site: &site, title, ended: Some(ended), past, store: None, ladder: None };
                        let _ = asked.answer(outcome.end, &mut outcome.core, books);
                    }
                    () = &mut stop => break,
                }
            }
        });
    }
}

#[allow(clippy::disallowed_methods, reason = "what is shown keeps step with real time")]
fn now() -> Instant {
    Instant::now()
}
