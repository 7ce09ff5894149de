//! Real certificates over real links: who is let in, and what they may say there.

use std::path::{Path, PathBuf};
use std::time::Duration;

use coordinator::certs::{self, Day, Holder};
use node::access::Members;
use node::session::QUESTIONS;
use node::{Link, NetworkConfig, Tls};
use proto::{Key, RobotId, SiteId, StationId};
use tokio::sync::mpsc;

/// Days from 1970 that lie around the present for a long time, and two long past.
const NOW: std::ops::Range<Day> = 20_000..40_000;
const PAST: std::ops::Range<Day> = 18_000..18_100;

fn site() -> SiteId {
    SiteId::new("plant").expect("an id")
}

fn robot(name: &str) -> RobotId {
    RobotId::new(name).expect("an id")
}

/// A folder with an authority, and what it issues.
struct Office {
    folder: tempfile::TempDir,
}

impl Office {
    fn new() -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        certs::init(&folder.path().join("ca"), &site(), NOW)?;
        Ok(Self { folder })
    }

    fn ca(&self) -> PathBuf {
        self.folder.path().join("ca")
    }

    fn issue(&self, holder: &Holder, valid: std::ops::Range<Day>, out: &str) -> anyhow::Result<Tls> {
        let files = certs::issue(&self.ca(), &site(), holder, &[], valid, &self.folder.path().join(out))?;
        Ok(Tls { ca: self.ca().join("ca.pem"), certificate: files.certificate, key: files.key })
    }
}

/// What a coordinator that carries the traffic hears under its site's keys.
struct Desk {
    address: String,
    link: Link,
    heard: mpsc::UnboundedReceiver<(String, Vec<u8>)>,
    _subscriber: Box<dyn std::any::Any>,
}

impl Desk {
    async fn open(office: &Office, port: u16) -> anyhow::Result<Self> {
        let members =
            Members { robots: vec![robot("r-1"), robot("r-2")], stations: vec![StationId::new("s-1")?], viewers: vec!["wall".to_owned()] };
        let address = format!("tls/localhost:{port}");
        let network = NetworkConfig {
            tls: Some(office.issue(&Holder::Coordinator, NOW, "desk")?),
            members: Some(members),
            ..NetworkConfig::on(&address)
        };
        let link = Link::open(&network, site()).await?;
        let (sender, heard) = mpsc::unbounded_channel();
        let subscriber = link.session.declare_subscriber("tender/plant/**").callback(move |sample| {
            let _ = sender.send((sample.key_expr().to_string(), sample.payload().to_bytes().into_owned()));
        });
        let subscriber = Box::new(subscriber.await.map_err(|error| anyhow::anyhow!("{error}"))?);
        Ok(Self { address, link, heard, _subscriber: subscriber })
    }

    /// Keys of everything heard until nothing more comes for a while.
    async fn heard(&mut self) -> Vec<String> {
        let mut keys = Vec::new();
        while let Ok(Some((key, _))) = tokio::time::timeout(Duration::from_millis(700), self.heard.recv()).await {
            keys.push(key);
        }
        keys
    }
}

async fn client(address: &str, tls: Option<Tls>) -> anyhow::Result<Link> {
    let network = NetworkConfig { tls, ..NetworkConfig::to(address) };
    match tokio::time::timeout(Duration::from_secs(5), Link::try_open(&network, site())).await {
        Ok(link) => link,
        Err(_) => anyhow::bail!("no session within five seconds"),
    }
}

async fn says(link: &Link, key: Key) -> anyhow::Result<()> {
    link.session.put(key.build(&site()), "x").await.map_err(|error| anyhow::anyhow!("{error}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_is_let_in_and_speaks_under_its_own_id_only() -> anyhow::Result<()> {
    let office = Office::new()?;
    let mut desk = Desk::open(&office, tests::free_port()?).await?;
    let one = client(&desk.address, Some(office.issue(&Holder::Robot(robot("r-1")), NOW, "r-1")?)).await?;
    says(&one, Key::RobotGauge(robot("r-1"))).await?;
    assert_eq!(desk.heard().await, ["tender/plant/v1/robot/r-1/gauge"]);
    // For another robot, for a station, for the coordinator, and on another site's keys: nothing arrives.
    says(&one, Key::RobotGauge(robot("r-2"))).await?;
    says(&one, Key::StationState(StationId::new("s-1")?)).await?;
    says(&one, Key::Schedule).await?;
    one.session.put("tender/other/v1/robot/r-1/gauge", "x").await.map_err(|error| anyhow::anyhow!("{error}"))?;
    assert_eq!(desk.heard().await, Vec::<String>::new());
    says(&one, Key::RobotGauge(robot("r-1"))).await?;
    assert_eq!(desk.heard().await.len(), 1, "it is still let in");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn only_the_coordinator_commands() -> anyhow::Result<()> {
    let office = Office::new()?;
    let desk = Desk::open(&office, tests::free_port()?).await?;
    let two = client(&desk.address, Some(office.issue(&Holder::Robot(robot("r-2")), NOW, "r-2")?)).await?;
    let key = Key::RobotCommand(robot("r-2")).build(&site());
    let (asked_in, mut asked) = mpsc::channel(QUESTIONS);
    let _queryable = two.serve(key.clone(), asked_in).await?;
    let one = client(&desk.address, Some(office.issue(&Holder::Robot(robot("r-1")), NOW, "r-1")?)).await?;
    let wall = client(&desk.address, Some(office.issue(&Holder::Viewer("wall".to_owned()), NOW, "wall")?)).await?;
    let ask = |link: Link| {
        let key = key.clone();
        async move { link.session.get(key).timeout(Duration::from_millis(500)).await.map(drop) }
    };
    // The route needs a moment to be known.
    let mut reached = false;
    for _ in 0..40 {
        let _ = ask(desk.link.clone()).await;
        if tokio::time::timeout(Duration::from_millis(250), asked.recv()).await.is_ok() {
            reached = true;
            break;
        }
    }
    assert!(reached, "the coordinator's command reaches the robot");
    while tokio::time::timeout(Duration::from_millis(500), asked.recv()).await.is_ok() {}
    for stranger in [one, wall] {
        let _ = ask(stranger).await;
        assert!(tokio::time::timeout(Duration::from_secs(1), asked.recv()).await.is_err(), "a command from who may not command");
    }
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_a_wrong_authority_and_an_expired_certificate_are_refused() -> anyhow::Result<()> {
    let (office, foreign) = (Office::new()?, Office::new()?);
    let mut desk = Desk::open(&office, tests::free_port()?).await?;
    let holder = Holder::Robot(robot("r-1"));
    let own_ca = office.ca().join("ca.pem");
    let strangers = [
        ("a wrong authority", foreign.issue(&holder, NOW, "r-1")?),
        // It knows our authority, but its certificate is of another one.
        ("another's certificate", Tls { ca: own_ca, ..foreign.issue(&holder, NOW, "again")? }),
        ("an expired certificate", office.issue(&holder, PAST, "old")?),
    ];
    for (what, tls) in strangers {
        if let Ok(link) = client(&desk.address, Some(tls)).await {
            let _ = says(&link, Key::RobotGauge(robot("r-1"))).await;
        }
        assert_eq!(desk.heard().await, Vec::<String>::new(), "{what}");
    }
    // Without any certificate: neither in the clear nor anonymously.
    let port = desk.address.rsplit(':').next().unwrap_or_default().to_owned();
    if let Ok(link) = client(&format!("tcp/localhost:{port}"), None).await {
        let _ = says(&link, Key::RobotGauge(robot("r-1"))).await;
    }
    assert_eq!(desk.heard().await, Vec::<String>::new(), "no certificate");
    // And the same robot with its own certificate is heard.
    let link = client(&desk.address, Some(office.issue(&holder, NOW, "r-1")?)).await?;
    says(&link, Key::RobotGauge(robot("r-1"))).await?;
    assert_eq!(desk.heard().await.len(), 1);
    Ok(())
}

fn mode(path: &Path) -> anyhow::Result<u32> {
    use std::os::unix::fs::PermissionsExt as _;
    Ok(std::fs::metadata(path)?.permissions().mode() & 0o777)
}

#[test]
fn the_command_makes_an_authority_once_and_keys_that_only_their_owner_reads() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let certs = |arguments: &[&str]| {
        let mut command = tests::program("coordinator");
        command.arg("certs").args(arguments).current_dir(folder.path()).output()
    };
    let made = certs(&["init", "--site", "plant"])?;
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(mode(&folder.path().join("site-ca/ca.key"))?, 0o600);
    let again = certs(&["init", "--site", "plant"])?;
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("is there already"));
    let issued = certs(&["issue", "robot", "r-1", "--site", "plant", "--out", "r-1"])?;
    assert!(issued.status.success(), "{}", String::from_utf8_lossy(&issued.stderr));
    assert!(String::from_utf8_lossy(&issued.stdout).contains("certificate = \"r-1/robot.r-1.pem\""));
    assert_eq!(mode(&folder.path().join("r-1/robot.r-1.key"))?, 0o600);
    let nobody = certs(&["issue", "robot", "--site", "plant"])?;
    assert_eq!(nobody.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&nobody.stderr).contains("robot needs an id"), "{}", String::from_utf8_lossy(&nobody.stderr));
    // An authority is that of one site, and nothing outlives it.
    for (arguments, why) in [(["--site", "other", "--days", "9"], "authority.plant"), (["--site", "plant", "--days", "4000"], "fewer days")]
    {
        let refused = certs(&[&["issue", "robot", "r-2"][..], &arguments].concat())?;
        let said = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && said.contains(why), "{said}");
        assert!(!folder.path().join("robot.r-2.key").exists());
    }
    Ok(())
}
