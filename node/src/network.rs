//! The `[network]` table: where the others are, and how one knows that it is they.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, ensure};
use proto::SiteId;
use serde::{Deserialize, Serialize};

use crate::access::Members;

/// `[network]` in a configuration.
///
/// By default the coordinator listens on loopback and agents connect to it, so no router process
/// is needed. To use a router, set `connect` to its address in every configuration and leave
/// `listen` empty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Addresses to connect to, such as `tcp/127.0.0.1:7447`.
    #[serde(default)]
    pub connect: Vec<String>,
    /// Addresses to listen on; empty for none.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Seconds without a sign of life after which others take this process for dead.
    #[serde(default = "NetworkConfig::default_lease_s")]
    pub lease_s: f64,
    /// Certificates for addresses that begin with `tls/`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tls: Option<Tls>,
    /// Who may say what, where this process carries traffic between others over TLS.
    #[serde(skip)]
    pub members: Option<Members>,
}

/// `[network.tls]`: both sides of a link show a certificate of the site's authority.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tls {
    /// The authority's certificate; relative to the configuration.
    pub ca: PathBuf,
    /// This process' certificate.
    pub certificate: PathBuf,
    /// Its private key, which nobody but its owner may read.
    pub key: PathBuf,
}

/// Sessions that one who listens takes in: twice the robots and stations of the largest fleets that are planned.
const SESSIONS_MAX: usize = 20_000;

impl NetworkConfig {
    /// Where coordinator and agents meet when nothing is said: the port of a Zenoh router.
    pub const DEFAULT_ENDPOINT: &'static str = "tcp/127.0.0.1:7447";

    fn default_lease_s() -> f64 {
        10.0
    }

    /// Connects to this address.
    #[must_use]
    pub fn to(endpoint: &str) -> Self {
        Self { connect: vec![endpoint.to_owned()], listen: Vec::new(), lease_s: Self::default_lease_s(), tls: None, members: None }
    }

    /// Listens on this address.
    #[must_use]
    pub fn on(endpoint: &str) -> Self {
        Self { connect: Vec::new(), listen: vec![endpoint.to_owned()], ..Self::to(endpoint) }
    }

    /// Connects to the default endpoint.
    #[must_use]
    pub fn agent() -> Self {
        Self::to(Self::DEFAULT_ENDPOINT)
    }

    /// Listens on the default endpoint.
    #[must_use]
    pub fn coordinator() -> Self {
        Self::on(Self::DEFAULT_ENDPOINT)
    }

    /// The same with paths as seen from the configuration that states them.
    pub fn beside(&mut self, config: &Path) {
        let folder = config.parent().unwrap_or(Path::new(""));
        if let Some(tls) = &mut self.tls {
            for path in [&mut tls.ca, &mut tls.certificate, &mut tls.key] {
                *path = folder.join(&*path);
            }
        }
    }

    /// Checks what types cannot.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!((0.1..=3600.0).contains(&self.lease_s), "network.lease_s = {}: must be between 0.1 and 3600", self.lease_s);
        ensure!(!(self.listen.is_empty() && self.connect.is_empty()), "network: needs an address in listen or connect");
        for address in self.listen.iter().chain(&self.connect) {
            let is_one = address.parse::<zenoh::config::EndPoint>().is_ok();
            ensure!(is_one && names_its_port(address), "network: `{address}` is not an address such as {}", Self::DEFAULT_ENDPOINT);
        }
        let secret = |address: &&String| address.starts_with("tls/");
        let plain = self.listen.iter().chain(&self.connect).find(|address| !secret(address));
        if let (Some(_), Some(plain)) = (&self.tls, plain) {
            anyhow::bail!("network: {plain} is not encrypted, but [network.tls] asks for it: write tls/HOST:PORT, or leave the table out");
        }
        if let (None, Some(address)) = (&self.tls, self.listen.iter().chain(&self.connect).find(secret)) {
            anyhow::bail!("network: {address} needs the table [network.tls] with ca, certificate and key");
        }
        Ok(())
    }

    pub(crate) fn zenoh_config(&self, site: &SiteId) -> anyhow::Result<zenoh::Config> {
        // Who listens carries traffic between the others, as a router does.
        let mode = if self.listen.is_empty() { "client" } else { "router" };
        let mut config = zenoh::Config::default();
        let mut set = |key: &str, value: serde_json::Value| {
            let refused = |_| anyhow!("[network] {key} = {value}: not an address such as {}", Self::DEFAULT_ENDPOINT);
            config.insert_json5(key, &value.to_string()).map_err(refused)
        };
        set("mode", mode.into())?;
        set("listen/endpoints", self.listen.clone().into())?;
        set("connect/endpoints", self.connect.clone().into())?;
        set("scouting/multicast/enabled", false.into())?;
        set("scouting/gossip/enabled", false.into())?;
        // The library's own limit is 1,000, and whoever comes after that is turned away without a word. Memory is taken by who is there.
        set("transport/unicast/max_sessions", SESSIONS_MAX.into())?;
        set("transport/link/tx/lease", ((self.lease_s * 1000.0) as u64).into())?;
        if let Some(tls) = &self.tls {
            tls.check()?;
            set("transport/link/tls", tls.zenoh())?;
            if let Some(members) = self.members.as_ref().filter(|_| !self.listen.is_empty()) {
                set("access_control", members.rules(site))?;
            }
        }
        Ok(config)
    }
}

impl Tls {
    /// Both sides show certificates, names are checked, and a link ends with the certificate that it
    /// rests on.
    fn zenoh(&self) -> serde_json::Value {
        serde_json::json!({
            "root_ca_certificate": self.ca, "enable_mtls": true, "verify_name_on_connect": true, "close_link_on_expiration": true,
            "listen_certificate": self.certificate, "listen_private_key": self.key,
            "connect_certificate": self.certificate, "connect_private_key": self.key,
        })
    }

    /// Whether the files are there, and the key is its owner's alone. The network library would say
    /// neither which file is wrong nor that others can read it.
    fn check(&self) -> anyhow::Result<()> {
        for (name, path) in [("ca", &self.ca), ("certificate", &self.certificate), ("key", &self.key)] {
            let facts = std::fs::metadata(path).with_context(|| format!("network.tls.{name}: cannot read {}", path.display()))?;
            ensure!(facts.is_file(), "network.tls.{name}: {} is not a file", path.display());
        }
        crate::files::only_its_owners(&self.key).context("network.tls.key")
    }
}

/// Whether an address over IP has a port: without one nobody would ever answer.
fn names_its_port(address: &str) -> bool {
    let Some((protocol, place)) = address.split_once('/') else { return false };
    let place = place.split(['?', '#']).next().unwrap_or_default();
    // An address of IPv6 stands in brackets, or its end would pass for a port.
    let is_one = |(host, port): (&str, &str)| port.parse::<u16>().is_ok() && (!host.contains(':') || host.starts_with('['));
    !["tcp", "udp", "tls", "quic", "ws"].contains(&protocol) || place.rsplit_once(':').is_some_and(is_one)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_and_encrypted_addresses_are_not_mixed_and_the_words_say_what_to_do() {
        let tls = Tls { ca: "ca.pem".into(), certificate: "c.pem".into(), key: "c.key".into() };
        let plain = NetworkConfig { tls: Some(tls.clone()), ..NetworkConfig::agent() };
        assert!(plain.check().unwrap_err().to_string().contains("write tls/HOST:PORT"));
        let bare = NetworkConfig::to("tls/localhost:7447");
        assert!(bare.check().unwrap_err().to_string().contains("[network.tls]"));
        assert!(NetworkConfig { tls: Some(tls), ..bare }.check().is_ok());
    }

    /// The library's own limit is 1,000.
    #[test]
    fn who_listens_takes_in_the_largest_fleets() {
        let config = NetworkConfig { listen: vec!["tcp/0.0.0.0:7447".to_owned()], ..NetworkConfig::to("tcp/127.0.0.1:7448") };
        let zenoh = config.zenoh_config(&"site".parse().unwrap()).unwrap();
        assert_eq!(zenoh.get_json("transport/unicast/max_sessions").unwrap(), SESSIONS_MAX.to_string());
    }

    #[test]
    fn an_address_without_a_port_is_refused() {
        for (address, is_one) in [
            ("tcp/127.0.0.1", false),
            ("tcp/[::1]", false),
            ("tcp/::1", false),
            ("udp/10.0.0.1:port", false),
            ("tcp/[::]:0", true),
            ("tcp/robot.local:7447#iface=lo", true),
            ("unixsock-stream//run/tender", true),
        ] {
            assert_eq!(NetworkConfig::to(address).check().is_ok(), is_one, "{address}");
        }
    }

    #[test]
    fn a_key_that_others_can_read_is_refused() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, mode: u32| {
            let path = folder.path().join(name);
            std::fs::write(&path, "x").unwrap();
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
            path
        };
        let mut tls = Tls { ca: file("ca.pem", 0o644), certificate: file("c.pem", 0o644), key: file("c.key", 0o600) };
        tls.check().unwrap();
        tls.key = file("open.key", 0o640);
        let error = format!("{:#}", tls.check().unwrap_err());
        assert!(error.contains("open.key") && error.contains("chmod 600"), "{error}");
        tls.ca = folder.path().join("missing.pem");
        assert!(format!("{:#}", tls.check().unwrap_err()).contains("missing.pem"));
    }
}
