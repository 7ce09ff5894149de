//! The store, the dashboard's port, this machine's clock.

use std::io::{ErrorKind, Write as _};
use std::path::Path;

use tokio::net::TcpListener;

use super::{Finding, fleet};
use crate::config::Config;
use crate::store::{Store, StoreError, shown};

pub(super) async fn store(config: &Config, path: &Path, running: bool) -> Finding {
    let place = config.store_path(Some(path));
    let name = shown(&place).display().to_string();
    match Store::open_read_only(&place).await {
        Ok(reader) => match reader.latest_schedule().await {
            Ok(schedule) => {
                let last = schedule.map_or_else(|| "no plan yet".to_owned(), |plan| format!("last plan {} of {}", plan.plan, plan.at));
                let complaint = if running { fleet::complaint(config).await } else { None };
                match complaint.or_else(|| no_room(&place)) {
                    Some(why) => Finding::fail("store", format!("{name}, {last}: {why}"), UNWRITABLE),
                    None => Finding::ok("store", format!("{name}, {last}")),
                }
            }
            Err(error @ StoreError::Busy { .. }) => Finding::fail("store", error.to_string(), "see the message"),
            Err(error) => Finding::fail("store", error.to_string(), "move the file away: a new one is made at the next start"),
        },
        Err(StoreError::Missing { .. }) if !running => missing(&place),
        Err(error) => Finding::fail("store", error.to_string(), "see the message; `store` in the configuration names another place"),
    }
}

/// What to do about a store that takes nothing.
const UNWRITABLE: &str = "free space on its disk, or see to its server or permissions; until then what happens is kept in memory alone";

/// Why a file beside the store could not be written, if the disk is full. Who asks need not be who may write there.
fn no_room(place: &Path) -> Option<String> {
    if place.to_str().is_some_and(|text| text.contains("://")) {
        return None;
    }
    match probe(folder_of(place)) {
        Err(error) if matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => {
            Some(format!("its disk is full: {error}"))
        }
        _ => None,
    }
}

fn folder_of(place: &Path) -> &Path {
    place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A store that is not there yet is made by the first start, if its folder can be written to.
fn missing(place: &Path) -> Finding {
    let folder = folder_of(place);
    let found = format!("{} is not there yet; the first start makes it", place.display());
    // Metadata do not tell who may write: a file does.
    match probe(folder) {
        Ok(()) => Finding::ok("store", found),
        Err(error) => Finding::fail(
            "store",
            format!("{} cannot be written to: {error}", folder.display()),
            "make the folder, give it to the user that runs the coordinator, or set `store`",
        ),
    }
}

/// What one page of a store takes, bytes: an empty file finds room on a full disk.
const PAGE: usize = 4096;

fn probe(folder: &Path) -> std::io::Result<()> {
    let file = folder.join(format!(".tender-doctor-{}", std::process::id()));
    let written = std::fs::File::create(&file).and_then(|mut open| open.write_all(&[1; PAGE]).and_then(|()| open.sync_all()));
    // One that could not be made is not there.
    let _ = std::fs::remove_file(&file);
    written
}

pub(super) async fn web(config: &Config, running: bool) -> Finding {
    let web = &config.web;
    if !web.enabled {
        return Finding::ok("dashboard", "switched off (web.enabled)");
    }
    let address = std::net::SocketAddr::new(web.address, web.port);
    match TcpListener::bind(address).await {
        Ok(_) if running && web.port != 0 => Finding::note(
            "dashboard",
            format!("nobody serves http://{address}/"),
            "the running coordinator has another port, or no dashboard",
        ),
        Ok(_) if !web.address.is_loopback() => Finding::note(
            "dashboard",
            format!("http://{address}/ is free"),
            "whoever reaches this address sees the whole fleet: put it behind a proxy that asks who they are",
        ),
        Ok(_) => Finding::ok("dashboard", format!("http://{address}/ is free")),
        Err(_) if running => Finding::ok("dashboard", format!("served at http://{address}/")),
        Err(error) => Finding::fail(
            "dashboard",
            format!("{address}: {error}"),
            "set web.port to one that is free, or web.enabled = false; `ss -ltnp` shows who has it",
        ),
    }
}

/// Before this nobody can have built this program: 2026-01-01.
const BUILT_AFTER_UNIX_MS: i64 = 1_767_225_600_000;

pub(super) fn clock() -> Finding {
    let now_ms = node::clock::unix_ms();
    let told = proto::Timestamp::from_unix_ms(now_ms);
    if now_ms < BUILT_AFTER_UNIX_MS {
        return Finding::fail("clock", format!("{told} lies in the past"), "set this machine's clock: messages are ordered by it");
    }
    let asked = std::process::Command::new("timedatectl").args(["show", "--property=NTPSynchronized", "--value"]).output();
    let said = asked.ok().filter(|output| output.status.success()).map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    match said.as_deref() {
        Some("yes") => Finding::ok("clock", format!("{told}, synchronised")),
        Some("no") => {
            Finding::note("clock", format!("{told}, not synchronised"), "run an NTP client: agents' messages are ordered by their clocks")
        }
        _ => Finding::note(
            "clock",
            format!("{told}; nothing here tells whether it is synchronised"),
            "see that an NTP client runs: agents' messages are ordered by their clocks",
        ),
    }
}
