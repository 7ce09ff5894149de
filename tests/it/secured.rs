//! A whole fleet with certificates and a token: it serves, and its secrets stay where they are.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use anyhow::{Context as _, ensure};
use coordinator::certs::{self, Day, Holder};
use node::Tls;
use proto::EventKind;
use tests::{Fleet, free_port, patiently, program, start, workspace};

/// Days from 1970 around the present.
const NOW: std::ops::Range<Day> = 20_000..40_000;
const TOKEN: &str = "what-nobody-else-may-know";

/// A fleet whose processes show certificates, and whose pages ask for a token.
fn secured() -> anyhow::Result<Fleet> {
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 50.0)?;
    let site = fleet.deployment.coordinator.site.clone();
    let (folder, ca) = (fleet.folder.path().to_owned(), fleet.path("ca"));
    certs::init(&ca, &site, NOW)?;
    let issue = |holder: Holder| -> anyhow::Result<Tls> {
        let files = certs::issue(&ca, &site, &holder, &[], NOW, &folder)?;
        Ok(Tls { ca: ca.join("ca.pem"), certificate: files.certificate, key: files.key })
    };
    let address = fleet.deployment.coordinator.network.listen[0].replace("tcp/127.0.0.1", "tls/localhost");
    let deployment = &mut fleet.deployment;
    deployment.coordinator.network.tls = Some(issue(Holder::Coordinator)?);
    deployment.coordinator.network.listen = vec![address.clone()];
    deployment.coordinator.web.token = Some(TOKEN.to_owned());
    deployment.coordinator.web.port = free_port()?;
    for station in &mut deployment.stations {
        station.network.tls = Some(issue(Holder::Station(station.id.clone()))?);
        station.network.connect = vec![address.clone()];
    }
    for robot in &mut deployment.robots {
        robot.network.tls = Some(issue(Holder::Robot(robot.id.clone()))?);
        robot.network.connect = vec![address.clone()];
    }
    fleet.write()?;
    Ok(fleet)
}

/// Status line of a request that would change something, `POST /api/v1/replan` for one.
fn change(what: &str, port: u16, host: &str, token: Option<&str>) -> anyhow::Result<String> {
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", port))?;
    let authorization = token.map(|token| format!("Authorization: Bearer {token}\r\n")).unwrap_or_default();
    write!(stream, "{what} HTTP/1.1\r\nHost: {host}\r\n{authorization}Content-Length: 0\r\nConnection: close\r\n\r\n")?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    ensure!(!answer.contains(TOKEN), "the answer holds the token: {answer}");
    Ok(answer.lines().next().unwrap_or_default().to_owned())
}

/// Every file below a folder.
fn files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() { found.extend(files(&path)?) } else { found.push(path) }
    }
    Ok(found)
}

#[test]
fn a_fleet_with_certificates_is_served_and_keeps_its_secrets() -> anyhow::Result<()> {
    let fleet = secured()?;
    let said = std::fs::File::create(fleet.path("said"))?;
    let mut command = program("coordinator");
    command.args(["run", "--config"]).arg(fleet.path("coordinator.toml")).env("RUST_LOG", "debug").stderr(said);
    let mut coordinator = start(command)?;
    let agents = fleet.agents()?;
    fleet.wait_for("service that is done", Duration::from_secs(120), |event| event.kind == EventKind::ServiceDone)?;

    // Two with one certificate, and so with one id: the later one is refused as it is without TLS.
    let mut second = program("robot-agent");
    let says = fleet.path("second-said");
    second.args(["run", "--config"]).arg(fleet.path("explorer-1.toml")).stdout(Stdio::null()).stderr(std::fs::File::create(&says)?);
    let mut second = start(second)?;
    ensure!(patiently(Duration::from_secs(60), || second.ended()), "nobody refuses it; does the coordinator still run?");
    let second_said = std::fs::read_to_string(&says)?;
    ensure!(second_said.contains("another process speaks as robot explorer-1 already"), "{second_said}");

    let port = fleet.deployment.coordinator.web.port;
    let here = format!("127.0.0.1:{port}");
    for (host, token, status) in [
        (here.as_str(), None, "401"),
        (here.as_str(), Some("what-nobody-else-may-guess"), "401"),
        ("tender.example", Some(TOKEN), "403"),
        (here.as_str(), Some(TOKEN), "200"),
    ] {
        let line = change("POST /api/v1/replan", port, host, token)?;
        ensure!(line.contains(status), "{host}, {token:?}: {line}");
    }

    // One thread at a time is in a TLS connection: the one that writes reads as well.
    for threads in agents.iter().chain([&coordinator]).filter_map(tests::Running::threads) {
        let has = |begin: &str| threads.iter().any(|name| name.starts_with(begin));
        ensure!(has("tx-") && !has("rx-"), "threads: {threads:?}");
    }

    // Who is heard is not forgotten; who has left is, once.
    let forget = || change("DELETE /api/v1/robot/explorer-1", port, &here, Some(TOKEN));
    let line = forget()?;
    ensure!(line.contains("409"), "{line}");
    drop(agents);
    ensure!(patiently(Duration::from_secs(30), || forget().is_ok_and(|line| line.contains("200"))), "it is not forgotten");
    let line = forget()?;
    ensure!(line.contains("404"), "{line}");
    coordinator.stop(Duration::from_secs(30)).context("it does not stop")?;
    // The token stands in the file that gives it, and nowhere else: neither in the store nor in what was said.
    let told = files(fleet.folder.path())?;
    ensure!(told.iter().any(|path| path.ends_with("tender.db")) && std::fs::metadata(fleet.path("said"))?.len() > 0);
    for path in told.iter().filter(|path| !path.ends_with("coordinator.toml")) {
        let bytes = std::fs::read(path)?;
        let holds = |secret: &[u8]| bytes.windows(secret.len()).any(|window| window == secret);
        ensure!(!holds(TOKEN.as_bytes()), "{} holds the token", path.display());
        let key = path.extension().is_some_and(|extension| extension == "key");
        ensure!(key || !holds(b"PRIVATE KEY"), "{} holds a private key", path.display());
    }
    Ok(())
}
