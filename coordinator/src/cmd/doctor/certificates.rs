//! The certificates of `[network.tls]`: whether they are there, for whom, until when, and whether the
//! key is its owner's alone.

use std::path::Path;

use anyhow::Context;
use node::Tls;
use node::access::coordinator_name;
use proto::{SiteId, Timestamp};
use x509_parser::prelude::*;

use super::Finding;
use crate::certs::MS_PER_DAY;
use crate::config::Config;

/// Days before its end at which a certificate is told of.
const SOON_DAYS: i64 = 30;

pub(super) fn check(config: &Config) -> Vec<Finding> {
    let network = &config.network;
    let Some(tls) = &network.tls else {
        let local = |address: &String| ["127.0.0.1", "localhost", "[::1]"].iter().any(|host| address.contains(host));
        let open: Vec<&String> = network.listen.iter().chain(&network.connect).filter(|address| !local(address)).collect();
        return match open.first() {
            None => vec![Finding::ok("certificates", "none, and none needed: only this machine is spoken to")],
            Some(address) => vec![Finding::note(
                "certificates",
                format!("{address} is not encrypted: whoever reaches it may command robots"),
                "make certificates with `coordinator certs init` and set [network.tls]: docs/security.md",
            )],
        };
    };
    [authority(tls), own(tls, &config.site), key(tls)].map(|(what, found)| found.unwrap_or_else(|error| unreadable(what, &error))).into()
}

type Checked = (&'static str, anyhow::Result<Finding>);

fn authority(tls: &Tls) -> Checked {
    ("authority", read(&tls.ca, |certificate| lasts("authority", &tls.ca, certificate, None)))
}

/// The coordinator's own: its name is what routers let command.
fn own(tls: &Tls, site: &SiteId) -> Checked {
    let found = read(&tls.certificate, |certificate| {
        let wanted = coordinator_name(site);
        let name = common_name(certificate.subject());
        if name != wanted {
            let advice = format!("issue one: coordinator certs issue coordinator (it must be for {wanted})");
            return Finding::fail("certificate", format!("{} is for {name}, not for {wanted}", tls.certificate.display()), advice);
        }
        let signed = read(&tls.ca, |ca| certificate.verify_signature(Some(ca.public_key())).is_ok());
        if !signed.unwrap_or(true) {
            let found = format!("{} was not issued by {}", tls.certificate.display(), tls.ca.display());
            return Finding::fail("certificate", found, "issue it anew from that authority, or name the authority that issued it");
        }
        lasts("certificate", &tls.certificate, certificate, Some(&name))
    });
    ("certificate", found)
}

fn key(tls: &Tls) -> Checked {
    let found = node::files::only_its_owners(&tls.key).map(|()| Finding::ok("key", format!("{}, its owner's alone", tls.key.display())));
    ("key", found)
}

fn unreadable(what: &'static str, error: &anyhow::Error) -> Finding {
    let advice = if what == "key" {
        "chmod 600 it, and give it to the user that runs the coordinator"
    } else {
        "`coordinator certs init` and `certs issue` make what is missing: docs/security.md"
    };
    Finding::fail(what, format!("{error:#}"), advice)
}

fn read<T>(path: &Path, look: impl Fn(&X509Certificate<'_>) -> T) -> anyhow::Result<T> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let (_, pem) = parse_x509_pem(&bytes).ok().with_context(|| format!("{} is not a certificate (PEM)", path.display()))?;
    let certificate = pem.parse_x509().ok().with_context(|| format!("{} is not a certificate (X.509)", path.display()))?;
    Ok(look(&certificate))
}

fn common_name(name: &X509Name<'_>) -> String {
    name.iter_common_name().next().and_then(|name| name.as_str().ok()).unwrap_or("nobody").to_owned()
}

/// Whether it is valid now, and for how long.
fn lasts(what: &'static str, path: &Path, certificate: &X509Certificate<'_>, holder: Option<&str>) -> Finding {
    let at = |time: ASN1Time| Timestamp::from_unix_ms(time.timestamp().saturating_mul(1000));
    let (from, until) = (at(certificate.validity().not_before), at(certificate.validity().not_after));
    let now = Timestamp::from_unix_ms(node::clock::unix_ms());
    let days = until.unix_ms().saturating_sub(now.unix_ms()) / MS_PER_DAY;
    let name = path.display();
    let holder = holder.map(|holder| format!(" for {holder}")).unwrap_or_default();
    let anew = if what == "authority" {
        "make a new authority and issue all certificates anew: links end with the certificates that they rest on"
    } else {
        "issue it anew (coordinator certs issue): the link ends with it"
    };
    if now < from {
        Finding::fail(what, format!("{name} begins only at {from}"), "set this machine's clock, or wait")
    } else if until < now {
        Finding::fail(what, format!("{name} ended at {until}"), anew)
    } else if days < SOON_DAYS {
        Finding::note(what, format!("{name}{holder} ends in {days} days, at {until}"), anew)
    } else {
        Finding::ok(what, format!("{name}{holder}, until {until}"))
    }
}
