//! What goes wrong in a fleet, and what users are told then.

use std::time::Duration;

use anyhow::Context as _;
use node::Link;
use node::session::Answer;
use proto::{CommandReply, EventKind, Key, Pattern, RobotAction, RobotCommand, RobotId, RobotPhase, RobotState};
use sqlx::Connection as _;
use sqlx::sqlite::SqliteConnectOptions;
use tests::{Fleet, program, workspace};

fn fleet() -> anyhow::Result<Fleet> {
    Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 50.0)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_second_coordinator_on_the_same_store_is_refused() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let _first = fleet.coordinator()?;
    fleet_up(&fleet)?;
    let second = program("coordinator").args(["run", "--config"]).arg(fleet.path("coordinator.toml")).output()?;
    assert_eq!(second.status.code(), Some(2));
    assert!(text(&second.stderr).contains("is in use by process"), "{}", text(&second.stderr));
    Ok(())
}

#[test]
fn a_second_coordinator_of_the_same_site_is_refused_whatever_its_store() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let _first = fleet.coordinator()?;
    // It answers questions once it has announced itself.
    let answers = || fleet.schedule(&["show"]).is_ok_and(|show| show.status.success() && show.stderr.is_empty());
    anyhow::ensure!(tests::patiently(Duration::from_secs(30), answers), "the first coordinator does not answer");
    let mut second = program("coordinator");
    second.args(["run", "--config"]).arg(fleet.path("coordinator.toml")).arg("--store").arg(fleet.path("other.db"));
    second.args(["--connect", &fleet.network().connect[0]]).stderr(std::process::Stdio::piped());
    let mut second = second.spawn()?;
    let ended = tests::patiently(Duration::from_secs(20), || second.try_wait().is_ok_and(|status| status.is_some()));
    let _ = second.kill();
    let second = second.wait_with_output()?;
    assert!(ended && second.status.code() == Some(2), "{}", text(&second.stderr));
    assert!(text(&second.stderr).contains("another coordinator serves site test already"), "{}", text(&second.stderr));
    Ok(())
}

#[test]
fn a_port_in_use_is_named_and_nothing_is_left_behind() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let address = fleet.deployment.coordinator.network.listen[0].clone();
    let _taken = std::net::TcpListener::bind(address.trim_start_matches("tcp/"))?;
    let refused = program("coordinator").args(["run", "--config"]).arg(fleet.path("coordinator.toml")).output()?;
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains(&format!("cannot listen on {address}")), "{}", text(&refused.stderr));
    Ok(())
}

#[test]
fn without_a_coordinator_the_schedule_comes_from_the_store_or_says_that_there_is_none() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let nothing = fleet.schedule(&["show"])?;
    assert_eq!(nothing.status.code(), Some(2));
    assert!(text(&nothing.stderr).contains("there is no store at"), "{}", text(&nothing.stderr));

    let mut coordinator = fleet.coordinator()?;
    let _agents = fleet.agents()?;
    fleet.wait_for("plan", Duration::from_secs(60), |event| event.kind == EventKind::PlanMade)?;
    coordinator.kill();
    let stored = fleet.schedule(&["show"])?;
    assert!(stored.status.success(), "{}", text(&stored.stderr));
    assert!(text(&stored.stderr).contains("no coordinator of site test answers"), "{}", text(&stored.stderr));
    assert!(text(&stored.stdout).contains("explorer-1"), "{}", text(&stored.stdout));
    let explained = fleet.schedule(&["explain", "explorer-1"])?;
    assert!(explained.status.success(), "{}", text(&explained.stderr));
    Ok(())
}

#[test]
fn a_restarted_coordinator_carries_on_the_service_that_was_begun() -> anyhow::Result<()> {
    let fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 100.0)?;
    let mut first = fleet.coordinator()?;
    let _agents = fleet.agents()?;
    let charging = |event: &proto::Event| event.kind == EventKind::PhaseChanged && event.text.contains("docked -> charging");
    fleet.wait_for("charging robot", Duration::from_secs(60), charging)?;
    first.kill();
    let _second = fleet.coordinator()?;
    let taken_over = |event: &proto::Event| event.kind == EventKind::ServiceStarted && event.text.contains("is taken over");
    fleet.wait_for("service taken over", Duration::from_secs(60), taken_over)?;
    let done = |event: &proto::Event| event.kind == EventKind::ServiceDone && event.text.starts_with("explorer-1");
    fleet.wait_for("end of the service", Duration::from_secs(60), done)?;
    // Numbers go on where the first one stopped, and its commands are overruled.
    let events = fleet.events()?;
    assert!(events.windows(2).all(|pair| pair[1].seq == pair[0].seq + 1));
    assert!(events.iter().any(|event| event.text.starts_with("c2-")), "commands of the second epoch");
    Ok(())
}

#[test]
fn a_killed_robot_is_noticed_and_an_unknown_one_is_named() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let _coordinator = fleet.coordinator()?;
    let mut agents = fleet.agents()?;
    fleet.wait_for("plan", Duration::from_secs(60), |event| event.kind == EventKind::PlanMade)?;
    agents.last_mut().expect("three robots").kill();
    fleet.wait_for("loss", Duration::from_secs(30), |event| event.kind == EventKind::Lost && event.text.contains("explorer-3"))?;
    let unknown = fleet.schedule(&["explain", "explorer-9"])?;
    assert_eq!(unknown.status.code(), Some(2));
    let message = text(&unknown.stderr);
    assert!(message.contains("robot explorer-9 is not known") && message.contains("did you mean `explorer-"), "{message}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn messages_of_another_version_and_garbage_are_refused_by_name() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let _coordinator = fleet.coordinator()?;
    let site = fleet.deployment.coordinator.site.clone();
    let link = Link::open(&fleet.network(), site.clone()).await?;
    let key = Key::RobotGauge(RobotId::new("explorer-1")?).build(&site);
    for (key, payload, part) in [
        (key.clone(), r#"{"schema":"tender.gauge/2"}"#, "tender.gauge/2"),
        (key.clone(), r#"{"schema":"tender.gauge/1","soc":"#, "JSON"),
        (Key::RobotState(RobotId::new("stranger")?).build(&site), include_str!("../../proto/golden/robot-state.json"), "is not configured"),
    ] {
        // A client's first messages may find no route yet: say it until it is heard.
        let mut heard = false;
        for _ in 0..100 {
            link.session.put(key.clone(), payload).await.map_err(|error| anyhow::anyhow!("{error}"))?;
            tokio::time::sleep(Duration::from_millis(300)).await;
            let events = tokio::task::block_in_place(|| fleet.events()).unwrap_or_default();
            heard = events.iter().any(|event| event.kind == EventKind::InputRefused && event.text.contains(part));
            if heard {
                break;
            }
        }
        anyhow::ensure!(heard, "{part} was not refused; {:?}", tokio::task::block_in_place(|| fleet.events()));
    }
    Ok(())
}

/// A listener of everything that never comes back from the first message, and a page's reader that never reads.
#[tokio::test(flavor = "multi_thread")]
async fn who_listens_too_slowly_holds_up_nobody() -> anyhow::Result<()> {
    use std::io::{Read as _, Write as _};
    let mut fleet = Fleet::new(&workspace().join("tests/fixtures/short-fleet.toml"), 100.0)?;
    fleet.deployment.coordinator.web.port = tests::free_port()?;
    fleet.write()?;
    let _coordinator = fleet.coordinator()?;
    fleet_up(&fleet)?;
    let link = Link::open(&fleet.network(), fleet.deployment.coordinator.site.clone()).await?;
    let (let_go, held) = std::sync::mpsc::channel::<()>();
    let held = std::sync::Mutex::new(held);
    let stuck = move |_| drop(held.lock().map(|held| held.recv()));
    let listening = link.session.declare_subscriber("tender/**").callback(stuck);
    let listening = listening.await.map_err(|error| anyhow::anyhow!("{error}"))?;
    // More than all buffers on the way to it hold.
    let talker = Link::open(&fleet.network(), link.site.clone()).await?;
    for _ in 0..1000 {
        talker.session.put("tender/noise", vec![0_u8; 65_536]).await.map_err(|error| anyhow::anyhow!("{error}"))?;
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    let web = &fleet.deployment.coordinator.web;
    let up = || std::net::TcpStream::connect((web.address, web.port)).is_ok();
    anyhow::ensure!(tests::patiently(Duration::from_secs(30), up), "no dashboard");
    let mut reader = std::net::TcpStream::connect((web.address, web.port))?;
    reader.write_all(b"GET /api/v1/live HTTP/1.1\r\nHost: localhost\r\nAccept: text/event-stream\r\n\r\n")?;
    let mut first = [0; 15];
    reader.read_exact(&mut first)?;
    assert_eq!(&first, b"HTTP/1.1 200 OK");

    let _agents = fleet.agents()?;
    let done = |event: &proto::Event| event.kind == EventKind::ServiceDone;
    tokio::task::block_in_place(|| fleet.wait_for("end of a service", Duration::from_secs(120), done))?;
    drop(let_go);
    drop((listening, reader));
    Ok(())
}

/// Two with one name: who comes later is refused, and where both are there already neither obeys.
#[tokio::test(flavor = "multi_thread")]
async fn two_agents_with_one_id_do_not_both_obey() -> anyhow::Result<()> {
    let fleet = fleet()?;
    let site = fleet.deployment.coordinator.site.clone();
    let _coordinator = fleet.coordinator()?;
    let link = Link::open(&fleet.network(), site.clone()).await?;
    let robot = RobotId::new("explorer-1")?;
    let own = || program("robot-agent").args(["run", "--config"]).arg(fleet.path("explorer-1.toml")).output();

    let states = Pattern::AllRobotStates;
    let (told, mut telling) = tokio::sync::mpsc::unbounded_channel();
    let heard = move |sample: zenoh::sample::Sample| drop(told.send(node::session::decoded::<RobotState>(sample.payload())));
    let listening = link.listen(&states, heard).await?;
    let mut one = program("robot-agent");
    one.args(["run", "--config"]).arg(fleet.path("explorer-1.toml"));
    let _one = tests::start(one)?;
    let state = tokio::time::timeout(Duration::from_secs(30), telling.recv()).await?.context("a state")??;
    let second = tokio::task::block_in_place(own)?;
    assert_eq!(second.status.code(), Some(2));
    assert!(text(&second.stderr).contains("another process speaks as robot explorer-1 already"), "{}", text(&second.stderr));

    // Another host that met the first one only later speaks under the same key.
    drop(listening);
    let command = RobotCommand { id: "c9-1".parse()?, at: state.at, deadline: state.at.plus_s(1e6), epoch: 9, action: RobotAction::Undock };
    let mut answers = Vec::new();
    for _ in 0..100 {
        link.publish(&Key::RobotState(robot.clone()), &state).await?;
        tokio::time::sleep(Duration::from_millis(100)).await;
        let answer = link.ask::<_, CommandReply>(&Key::RobotCommand(robot.clone()), Some(&command), Duration::from_secs(2)).await;
        if let Answer::Refused(why) = &answer
            && why.contains("another process speaks as robot explorer-1 too")
        {
            return Ok(());
        }
        answers.push(answer);
    }
    anyhow::bail!("it obeyed: {answers:?}")
}

/// Somebody else writes into the store and does not end: commands leave all the same, nothing is lost by it, and whoever looks is told.
#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_does_not_answer_stops_nobody() -> anyhow::Result<()> {
    let mut fleet = fleet()?;
    let page = tests::free_port()?;
    fleet.deployment.coordinator.web.port = page;
    fleet.write()?;
    let says = |route: &str, what: &str| {
        let shown = || tests::read(page, route).is_some_and(|answer| answer.contains(what));
        let said = tokio::task::block_in_place(|| tests::patiently(Duration::from_secs(20), shown));
        anyhow::ensure!(said, "{route} does not say {what}: {:?}", tests::read(page, route));
        Ok(())
    };
    let mut coordinator = fleet.coordinator()?;
    let link = Link::open(&fleet.network(), fleet.deployment.coordinator.site.clone()).await?;
    let (told, mut telling) = tokio::sync::mpsc::unbounded_channel();
    let heard = move |sample: zenoh::sample::Sample| drop(told.send(node::session::decoded::<RobotState>(sample.payload())));
    let _states = link.listen(&Pattern::AllRobotStates, heard).await?;
    let _agents = fleet.agents()?;
    tokio::task::block_in_place(|| fleet.wait_for("plan", Duration::from_secs(60), |event| event.kind == EventKind::PlanMade))?;

    let mut holder = sqlx::SqliteConnection::connect_with(&SqliteConnectOptions::new().filename(fleet.path("tender.db"))).await?;
    sqlx::query("BEGIN IMMEDIATE").execute(&mut holder).await?;
    let before = tokio::task::block_in_place(|| fleet.events())?.len();
    let charging = async {
        while let Some(state) = telling.recv().await {
            if state.is_ok_and(|state| state.phase == RobotPhase::Charging) {
                break;
            }
        }
    };
    tokio::time::timeout(Duration::from_secs(60), charging).await.context("nobody was let in while the store was held")?;
    assert_eq!(tokio::task::block_in_place(|| fleet.events())?.len(), before, "nothing can have been written");
    says("/metrics", "\ntender_store_writable 0\n")?;
    says("/healthz", "nothing is kept since")?;
    sqlx::query("ROLLBACK").execute(&mut holder).await?;
    says("/metrics", "\ntender_store_writable 1\n")?;

    let done = |event: &proto::Event| event.kind == EventKind::ServiceDone;
    tokio::task::block_in_place(|| fleet.wait_for("end of a service", Duration::from_secs(120), done))?;
    let events = tokio::task::block_in_place(|| fleet.events())?;
    assert!(events.windows(2).all(|pair| pair[1].seq == pair[0].seq + 1));
    assert!(events.iter().any(|event| event.kind == EventKind::CommandSent), "what was commanded meanwhile is told");

    // Telemetry always waits for something. Who stops without having kept it says so.
    sqlx::query("BEGIN IMMEDIATE").execute(&mut holder).await?;
    tokio::time::sleep(Duration::from_secs(3)).await;
    let code = tokio::task::block_in_place(|| coordinator.stop(Duration::from_secs(40)));
    assert_eq!(code, Some(2), "what waited cannot have been kept");
    Ok(())
}

/// Waits until the coordinator has made its store.
fn fleet_up(fleet: &Fleet) -> anyhow::Result<()> {
    let up = tests::patiently(Duration::from_secs(30), || fleet.events().is_ok());
    anyhow::ensure!(up, "the coordinator did not come up");
    Ok(())
}
