//! Ports, router, who is there, and whether their clocks agree with this one.

use std::collections::BTreeMap;
use std::time::Duration;

use node::{Link, NetworkConfig};
use proto::{Key, Pattern, RobotId};
use tokio::net::{TcpListener, TcpStream};

use super::super::presence::Present;
use super::{Finding, fleet};
use crate::config::Config;
use crate::counted::counted;

/// Longest wait for a connection.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long messages of agents are listened for.
const LISTEN: Duration = Duration::from_secs(3);
/// Clocks that differ by more than this disturb the order of messages, s.
const SKEW_S: f64 = 2.0;

/// What the network showed.
pub(super) struct Seen {
    pub(super) findings: Vec<Finding>,
    /// Whether a coordinator of this site is at work.
    pub(super) running: bool,
}

pub(super) async fn check(config: &Config) -> Seen {
    let mut findings = Vec::new();
    let mut busy = Vec::new();
    for endpoint in &config.network.listen {
        match socket(endpoint) {
            None => findings.push(Finding::fail("listen", endpoint.clone(), "an address looks like tcp/127.0.0.1:7447")),
            Some(address) => match TcpListener::bind(address).await {
                Ok(_) => findings.push(Finding::ok("listen", format!("{endpoint} is free"))),
                Err(error) => busy.push((endpoint.clone(), error)),
            },
        }
    }
    for endpoint in &config.network.connect {
        findings.push(router(endpoint).await);
    }
    let mut reached = busy.iter().map(|(endpoint, _)| endpoint.clone()).collect::<Vec<_>>();
    reached.extend(config.network.connect.iter().cloned());
    let network = NetworkConfig { connect: reached, listen: Vec::new(), ..config.network.clone() };
    let link = match network.connect.is_empty() {
        true => None,
        false => tokio::time::timeout(PATIENCE, Link::try_open(&network, config.site.clone())).await.ok().and_then(Result::ok),
    };
    let running = match &link {
        Some(link) => link.alive(&Key::CoordinatorAlive).await,
        None => false,
    };
    for (endpoint, error) in busy {
        findings.push(match running {
            true => Finding::ok("listen", format!("{endpoint} is held by the coordinator of site {}", config.site)),
            false => {
                Finding::fail("listen", format!("{endpoint}: {error}"), "another program has this address: stop it, or set network.listen")
            }
        });
    }
    let state = if running { "is at work" } else { "is not running" };
    findings.push(Finding::ok("coordinator", format!("the one of site {} {state}", config.site)));
    if let Some(link) = link {
        findings.extend(agents(config, &link).await);
        if running {
            findings.push(fleet::plan(&link).await);
        }
        let _ = link.session.close().await;
    }
    Seen { findings, running }
}

async fn router(endpoint: &str) -> Finding {
    let Some(address) = socket(endpoint) else {
        return Finding::fail("router", endpoint.to_owned(), "an address looks like tcp/router.example:7447");
    };
    match tokio::time::timeout(PATIENCE, TcpStream::connect(address)).await {
        Ok(Ok(_)) => Finding::ok("router", format!("{endpoint} answers")),
        Ok(Err(error)) => {
            Finding::fail("router", format!("{endpoint}: {error}"), "start the Zenoh router there, or correct network.connect")
        }
        Err(_) => Finding::fail(
            "router",
            format!("{endpoint} does not answer"),
            "is it the right address, and does a firewall let this machine through?",
        ),
    }
}

/// `tcp/127.0.0.1:7447` without its protocol.
fn socket(endpoint: &str) -> Option<&str> {
    let (_, address) = endpoint.split_once('/')?;
    let address = address.split(['?', '#']).next().unwrap_or(address);
    address.rsplit_once(':').filter(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok()).map(|_| address)
}

/// Who is configured and not there, who is there and not configured, and whose clock differs.
async fn agents(config: &Config, link: &Link) -> Vec<Finding> {
    let present = Present::look(link).await;
    let (absent, strange) = (present.absent(config), present.strange(config));
    let strange: Vec<&str> = strange.iter().map(|id| id.as_str()).collect();
    let found = format!("there: {} and {}", counted(present.robots.len(), "robot"), counted(present.stations.len(), "station"));
    let mut findings = Vec::new();
    if !absent.is_empty() {
        let advice = format!("configured, but not there: {}; start their agents, or see what they log", absent.join(", "));
        findings.push(Finding::note("agents", found.clone(), advice));
    }
    if !strange.is_empty() {
        let advice = format!("nobody is sent to {}: add a table [stations.{}] to the configuration", strange.join(", "), strange[0]);
        findings.push(Finding::note("agents", format!("{found}, not configured: {}", strange.join(", ")), advice));
    }
    if findings.is_empty() {
        findings.push(Finding::ok("agents", found));
    }
    // On faster time, clocks are not this machine's.
    if config.clock.is_none() && !present.robots.is_empty() {
        findings.extend(clocks(link).await);
    }
    findings
}

async fn clocks(link: &Link) -> Option<Finding> {
    let (heard, mut gauges) = tokio::sync::mpsc::unbounded_channel();
    let callback = move |sample: zenoh::sample::Sample| {
        if let (Ok((_, Key::RobotGauge(id))), Ok(gauge)) =
            (Key::parse(sample.key_expr().as_str()), node::session::decoded::<proto::Gauge>(sample.payload()))
        {
            let _ = heard.send((id, (node::clock::unix_ms() - gauge.at.unix_ms()) as f64 / 1000.0));
        }
    };
    let _subscriber = link.listen(&Pattern::AllRobotGauges, callback).await.ok()?;
    let mut behind_s: BTreeMap<RobotId, f64> = BTreeMap::new();
    let _ = tokio::time::timeout(LISTEN, async {
        while let Some((id, skew_s)) = gauges.recv().await {
            behind_s.insert(id, skew_s);
        }
    })
    .await;
    let off = |id: &RobotId, skew_s: f64| format!("{id} is {:.1} s {}", skew_s.abs(), if skew_s > 0.0 { "behind" } else { "ahead" });
    let off: Vec<String> = behind_s.iter().filter(|(_, skew_s)| skew_s.abs() > SKEW_S).map(|(id, skew_s)| off(id, *skew_s)).collect();
    let found = format!("{} heard within {} s", counted(behind_s.len(), "robot"), LISTEN.as_secs());
    Some(match off.is_empty() {
        true => Finding::ok("agents' clocks", found),
        false => Finding::note("agents' clocks", found, format!("beside this machine's: {}; synchronise them by NTP", off.join(", "))),
    })
}

#[cfg(test)]
mod tests {
    use super::socket;

    #[test]
    fn an_endpoint_holds_a_protocol_a_host_and_a_port() {
        assert_eq!(socket("tcp/127.0.0.1:7447"), Some("127.0.0.1:7447"));
        assert_eq!(socket("tls/[::1]:7447?rel=1"), Some("[::1]:7447"));
        for wrong in ["127.0.0.1:7447", "tcp/localhost", "tcp/:7447", "tcp/host:99999"] {
            assert_eq!(socket(wrong), None, "{wrong}");
        }
    }
}
