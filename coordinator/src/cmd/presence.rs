//! Who is there, and who of the configuration is not.

use std::collections::BTreeSet;
use std::time::Duration;

use node::Link;
use proto::{Key, Pattern, RobotId, StationId};

use crate::config::Config;

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(2);

/// Robots and stations whose agents are on the network.
#[derive(Debug, Default)]
pub(super) struct Present {
    pub(super) robots: BTreeSet<RobotId>,
    pub(super) stations: BTreeSet<StationId>,
}

impl Present {
    pub(super) async fn look(link: &Link) -> Self {
        let mut present = Self::default();
        let Ok(tokens) = link.session.liveliness().get(Pattern::AllAlive.build(&link.site)).timeout(PATIENCE).await else { return present };
        while let Ok(reply) = tokens.recv_async().await {
            match reply.result().map(|sample| Key::parse(sample.key_expr().as_str())) {
                Ok(Ok((_, Key::RobotAlive(id)))) => drop(present.robots.insert(id)),
                Ok(Ok((_, Key::StationAlive(id)))) => drop(present.stations.insert(id)),
                _ => {}
            }
        }
        present
    }

    /// Who is configured and not there: stations first, for without them nobody is serviced.
    pub(super) fn absent(&self, config: &Config) -> Vec<String> {
        let stations = config.stations.keys().filter(|id| !self.stations.contains(*id)).map(ToString::to_string);
        let robots = config.robots.keys().filter(|id| !self.robots.contains(*id)).map(ToString::to_string);
        stations.chain(robots).collect()
    }

    /// Stations that are there and not configured: nobody is sent to them. Robots need not be listed.
    pub(super) fn strange(&self, config: &Config) -> Vec<&StationId> {
        self.stations.iter().filter(|id| !config.stations.contains_key(*id)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_missing_and_who_is_not_configured_are_told_apart() {
        let text = "schema = 1\nsite = \"s\"\n[robots]\nr-1 = \"b\"\nr-2 = \"b\"\n\
                    [stations.mds]\nload = \"l\"\nload_s = 1\nunload_s = 1\npacks = { p = \"b\" }\n";
        let config: Config = toml::from_str(text).unwrap();
        let present = Present { robots: ["r-2", "r-9"].map(|id| id.parse().unwrap()).into(), stations: ["swap".parse().unwrap()].into() };
        assert_eq!(present.absent(&config), ["mds", "r-1"]);
        assert_eq!(present.strange(&config).iter().map(|id| id.as_str()).collect::<Vec<_>>(), ["swap"]);
    }
}
