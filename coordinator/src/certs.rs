//! A site's own certificate authority: who shows a certificate of it belongs to the site, and the
//! certificate's name says who it is.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use node::access;
use proto::{RobotId, SiteId, StationId};
use rcgen::{BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose};

/// Whom a certificate is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Holder {
    /// The coordinator.
    Coordinator,
    /// A robot's agent.
    Robot(RobotId),
    /// A station's agent.
    Station(StationId),
    /// Who only looks: a dashboard, `coordinator schedule`.
    Viewer(String),
    /// A router between the others.
    Router,
}

/// Files of a certificate and its key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// The certificate.
    pub certificate: PathBuf,
    /// Its private key, readable by its owner alone.
    pub key: PathBuf,
}

/// A day of validity, counted from 1970-01-01.
pub type Day = i64;
/// Seconds in such a day.
pub const S_PER_DAY: i64 = energy::units::S_PER_DAY as i64;
/// Milliseconds in such a day.
pub const MS_PER_DAY: i64 = 1000 * S_PER_DAY;

/// Name of the authority's files in its folder.
const CA: &str = "ca";
/// The names and addresses in a certificate for which none are given. Only who is connected to needs its own there: whoever connects
/// compares them with the address that it has called. These do where all processes stand on one machine.
const HOSTS: [&str; 2] = ["localhost", "127.0.0.1"];

impl Holder {
    /// The certificate's common name, by which routers know what its holder may say.
    #[must_use]
    pub fn name(&self, site: &SiteId) -> String {
        match self {
            Holder::Coordinator => access::coordinator_name(site),
            Holder::Robot(robot) => access::robot_name(robot),
            Holder::Station(station) => access::station_name(station),
            Holder::Viewer(viewer) => access::viewer_name(viewer),
            Holder::Router => format!("router.{site}"),
        }
    }
}

/// Makes an authority for a site in a folder, which is made where there is none. An authority that is
/// there already is left as it is: without its key nobody could be let in any more.
///
/// # Errors
/// When there is one, or the folder cannot be written.
pub fn init(folder: &Path, site: &SiteId, valid: std::ops::Range<Day>) -> anyhow::Result<Files> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let files = files(folder, CA);
    for path in [&files.certificate, &files.key] {
        ensure!(!path.exists(), "{} is there already: an authority is made once; choose another folder", path.display());
    }
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, authority_name(site));
    params.distinguished_name.push(DnType::OrganizationName, site.to_string());
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    validity(&mut params, &valid)?;
    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?;
    write(&files, &certificate.pem(), &key)?;
    Ok(files)
}

/// Issues a certificate from the authority in `folder` into `out`. `hosts` are the names and addresses
/// at which others reach its holder.
///
/// # Errors
/// When there is no authority, its key is open to others, or a file is there already.
pub fn issue(
    folder: &Path,
    site: &SiteId,
    holder: &Holder,
    hosts: &[String],
    valid: std::ops::Range<Day>,
    out: &Path,
) -> anyhow::Result<Files> {
    let ca = files(folder, CA);
    let missing = || format!("no authority in {}: make one with `coordinator certs init`", folder.display());
    let (certificate, key) =
        (std::fs::read_to_string(&ca.certificate).with_context(missing)?, std::fs::read_to_string(&ca.key).with_context(missing)?);
    node::files::only_its_owners(&ca.key)?;
    let (authority, ends) = known(&certificate).with_context(|| format!("{} is not a certificate", ca.certificate.display()))?;
    ensure!(authority == authority_name(site), "{} is {authority}: it issues for no other site than its own", ca.certificate.display());
    ensure!(
        valid.end <= ends,
        "{} ends {} days before the certificate would: issue it for fewer days",
        ca.certificate.display(),
        valid.end - ends
    );
    let issuer = Issuer::from_ca_cert_pem(&certificate, KeyPair::from_pem(&key)?)?;
    let name = holder.name(site);
    let files = files(out, &name);
    for path in [&files.certificate, &files.key] {
        ensure!(!path.exists(), "{} is there already: remove it, or name another folder", path.display());
    }
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let hosts: Vec<String> = if hosts.is_empty() { HOSTS.map(str::to_owned).to_vec() } else { hosts.to_vec() };
    let mut params = CertificateParams::new(hosts)?;
    params.distinguished_name.push(DnType::CommonName, name);
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
    validity(&mut params, &valid)?;
    let key = KeyPair::generate()?;
    let certificate = params.signed_by(&key, &issuer)?;
    write(&files, &certificate.pem(), &key)?;
    Ok(files)
}

fn authority_name(site: &SiteId) -> String {
    format!("authority.{site}")
}

/// Whose a certificate is, and the day on which it ends.
fn known(certificate: &str) -> Option<(String, Day)> {
    let (_, pem) = x509_parser::pem::parse_x509_pem(certificate.as_bytes()).ok()?;
    let certificate = pem.parse_x509().ok()?;
    let name = certificate.subject().iter_common_name().next()?.as_str().ok()?.to_owned();
    Some((name, certificate.validity().not_after.timestamp().div_euclid(S_PER_DAY)))
}

fn files(folder: &Path, name: &str) -> Files {
    Files { certificate: folder.join(format!("{name}.pem")), key: folder.join(format!("{name}.key")) }
}

fn validity(params: &mut CertificateParams, valid: &std::ops::Range<Day>) -> anyhow::Result<()> {
    ensure!(valid.start < valid.end, "a certificate must be valid for a day at least");
    let date = |day: Day| -> anyhow::Result<_> {
        let date = jiff::civil::date(1970, 1, 1).checked_add(jiff::Span::new().try_days(day)?)?;
        Ok(rcgen::date_time_ymd(i32::from(date.year()), date.month().unsigned_abs(), date.day().unsigned_abs()))
    };
    (params.not_before, params.not_after) = (date(valid.start)?, date(valid.end)?);
    Ok(())
}

/// The key first, and never for a moment open to others.
fn write(files: &Files, certificate: &str, key: &KeyPair) -> anyhow::Result<()> {
    use std::io::Write as _;
    use std::os::unix::fs::OpenOptionsExt as _;
    let mut options = std::fs::OpenOptions::new();
    let mut file = options
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&files.key)
        .with_context(|| format!("cannot write {}", files.key.display()))?;
    file.write_all(key.serialize_pem().as_bytes())
        .and_then(|()| file.sync_all())
        .with_context(|| format!("cannot write {}", files.key.display()))?;
    node::files::write_text(&files.certificate, certificate)
}
