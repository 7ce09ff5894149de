//! What the running coordinator says of its fleet and of itself.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::time::Duration;

use node::Link;
use node::session::Answer;
use proto::{Key, Schedule};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use super::Finding;
use crate::config::Config;
use crate::web::NOTHING_IS_KEPT;

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest answer that is read, bytes.
const ANSWER_MAX: u64 = 16 * 1024;

/// Whether the plan leaves anybody without energy.
pub(super) async fn plan(link: &Link) -> Finding {
    match link.ask::<Schedule, Schedule>(&Key::Schedule, None, PATIENCE).await {
        Answer::Given(schedule) => of(&schedule),
        Answer::Refused(why) => Finding::note("fleet", why, "see what the coordinator logs"),
        Answer::Nobody => Finding::note("fleet", "the coordinator does not tell its plan", "is it busy? ask again; see what it logs"),
    }
}

fn of(schedule: &Schedule) -> Finding {
    if schedule.plan == 0 {
        let found = format!("no plan has been made yet: {}", schedule.trigger);
        return Finding::note("fleet", found, "the first plan waits for all who are configured, at most for policy.patience_s");
    }
    let empty: Vec<&str> =
        schedule.unserved.iter().filter(|unserved| unserved.runs_empty).map(|unserved| unserved.robot.as_str()).collect();
    let doubts = schedule.doubts.len();
    let found = format!("plan {} of {}: {} services", schedule.plan, schedule.at, schedule.services.len());
    match (empty.is_empty(), doubts) {
        (true, 0) => Finding::ok("fleet", format!("{found}, nobody runs empty")),
        (true, _) => Finding::note("fleet", format!("{found}, {doubts} doubts"), "`coordinator schedule` shows what is doubted"),
        (false, _) => Finding::note(
            "fleet",
            format!("{found}; stranded, or will run empty: {}", empty.join(", ")),
            format!("`coordinator schedule explain {}` says why", empty[0]),
        ),
    }
}

/// What a coordinator at work complains of, where its dashboard can be asked.
pub(super) async fn complaint(config: &Config) -> Option<String> {
    if !config.web.enabled || config.web.port == 0 {
        return None;
    }
    let unspecified = config.web.address.is_unspecified();
    let address = if unspecified { IpAddr::V4(Ipv4Addr::LOCALHOST) } else { config.web.address };
    let answer = tokio::time::timeout(PATIENCE, health(SocketAddr::new(address, config.web.port))).await.ok()?.ok()?;
    let (_, said) = answer.split_once("\r\n\r\n")?;
    said.find(NOTHING_IS_KEPT).map(|from| proto::plain(said[from..].trim_end()).into_owned())
}

async fn health(address: SocketAddr) -> std::io::Result<String> {
    let mut stream = TcpStream::connect(address).await?;
    stream.write_all(format!("GET /healthz HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").as_bytes()).await?;
    let mut answer = Vec::new();
    stream.take(ANSWER_MAX).read_to_end(&mut answer).await?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

#[cfg(test)]
mod tests {
    use proto::{RobotId, Timestamp, Unserved};

    use super::super::Verdict;
    use super::*;

    fn schedule(unserved: Vec<Unserved>) -> Schedule {
        Schedule {
            at: Timestamp::from_unix_ms(0),
            plan: 3,
            policy: "optimise".to_owned(),
            trigger: "a test".to_owned(),
            services: Vec::new(),
            unserved,
            doubts: Vec::new(),
            quality: None,
        }
    }

    #[test]
    fn who_runs_empty_is_named_and_who_waits_is_not() {
        let unserved = |id: &str, runs_empty| Unserved { robot: RobotId::new(id).unwrap(), runs_empty, reasons: vec!["-".to_owned()] };
        let fine = of(&schedule(vec![unserved("r-1", false)]));
        assert_eq!((fine.verdict, fine.advice.as_str()), (Verdict::Ok, ""));
        let stranded = of(&schedule(vec![unserved("r-1", false), unserved("r-2", true), unserved("r-3", true)]));
        assert_eq!(stranded.verdict, Verdict::Note);
        assert!(stranded.found.ends_with("run empty: r-2, r-3"), "{}", stranded.found);
        assert_eq!(of(&Schedule { plan: 0, ..schedule(Vec::new()) }).verdict, Verdict::Note);
    }

    #[tokio::test]
    async fn a_coordinator_that_keeps_nothing_says_so_here_too() {
        let answered = async |body: &'static str| {
            let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
            let mut config: Config = toml::from_str("schema = 1\nsite = \"s\"").unwrap();
            config.web.port = listener.local_addr().unwrap().port();
            let serve = async {
                let (mut stream, _) = listener.accept().await.unwrap();
                let mut asked = [0; 1024];
                let _ = stream.read(&mut asked).await.unwrap();
                stream.write_all(format!("HTTP/1.1 200 OK\r\ncontent-length: {}\r\n\r\n{body}", body.len()).as_bytes()).await.unwrap();
            };
            tokio::join!(complaint(&config), serve).0
        };
        assert_eq!(answered("ok\n").await, None);
        let failing = answered("ok, but nothing is kept since 2026: the disk is full\n").await;
        assert_eq!(failing.as_deref(), Some("nothing is kept since 2026: the disk is full"));
    }
}
