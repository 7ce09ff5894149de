//! What people and Prometheus see of a coordinator.
//!
//! ```text
//!   pure    past.rs     what was shown so far: charge over time, services that ended, events
//!           number.rs   a number, its sigma, its text
//!           view.rs     core + past -> everything the page shows
//!           metrics.rs  core + past -> the text that Prometheus reads
//!           desk.rs     questions and their answers
//!   shells  server.rs   routes, live pages, the token
//!           report.rs   the same page as one file
//!           assets.rs   page, style and scripts, in the program itself
//! ```

mod assets;
mod desk;
pub mod metrics;
pub mod number;
mod past;
pub mod report;
mod server;
pub mod view;

use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use desk::{Answer, Asked, Books, Desk, NOTHING_IS_KEPT, NoAnswer, Question, desk};
pub use past::{Past, Series};
pub use server::{bind, serve};

/// `[web]` in a configuration: the dashboard, its API and the metrics.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WebConfig {
    /// Whether there is one.
    pub enabled: bool,
    /// Address to listen on: by default only this machine is served.
    pub address: IpAddr,
    /// Port to listen on; 0 for any that is free.
    pub port: u16,
    /// Who knows this may change something; without it nobody may.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
    /// What `lab discover --format json` printed last, beside this file: shown with the models.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub discovery: Option<PathBuf>,
}

impl WebConfig {
    /// The port when nothing is said.
    pub const PORT: u16 = 7480;
    /// Shortest token.
    const TOKEN_MIN: usize = 16;

    /// Checks what types cannot.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        if let Some(token) = &self.token {
            let plain = token.bytes().all(|byte| byte.is_ascii_graphic());
            anyhow::ensure!(
                plain && token.len() >= Self::TOKEN_MIN,
                "web.token: must be at least {} printable characters without blanks",
                Self::TOKEN_MIN
            );
        }
        Ok(())
    }

    /// The ladder of the lab's last search, or why it cannot be read; none when none is configured.
    pub fn ladder(&self, config: Option<&Path>) -> Option<Result<view::Ladder, String>> {
        let path = self.discovery.as_ref()?;
        let path = config.and_then(Path::parent).map_or_else(|| path.clone(), |folder| folder.join(path));
        let read = node::files::read_text(&path).map_err(|error| format!("web.discovery: {error:#}"));
        Some(read.and_then(|text| view::Ladder::parse(&path.display().to_string(), &text)))
    }
}

impl Default for WebConfig {
    fn default() -> Self {
        Self { enabled: true, address: IpAddr::V4(Ipv4Addr::LOCALHOST), port: Self::PORT, token: None, discovery: None }
    }
}
