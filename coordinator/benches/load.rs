//! One coordinator process under load: what it takes in, how soon it decides, and whether it grows.
//!
//! ```console
//! $ cargo bench -p coordinator --bench load
//! $ TENDER_LOAD_S=300 cargo bench -p coordinator --bench load      # a soak: 15 million messages
//! ```
//!
//! `TENDER_LOAD_ROBOTS` (1000) robots and 50 stations tell their states once a second, over Zenoh on loopback.
//! First their gauges do the same: newcomers join and speak on, and counted is the time from a newcomer's first gauge to
//! the plan that tells of it. Then all gauges together speak `TENDER_LOAD_RATE` (50000) times a second. Each
//! lasts `TENDER_LOAD_S` (30) seconds.

#![allow(clippy::disallowed_methods, reason = "a bench measures time")]

mod fleet;

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::anyhow;
use fleet::{NEWCOMER_SOC, id, pack, soc_of};
use node::{Link, NetworkConfig};
use proto::{Gauge, Key, RobotId, RobotState, Schedule, SiteId, StationId, Timestamp};

/// Newcomers in a second.
const NEWCOMERS_HZ: f64 = 0.8;
/// Longest that a plan about a newcomer is waited for.
const PATIENCE: Duration = Duration::from_secs(5);
/// Until the coordinator listens for certain.
const LISTENING: Duration = Duration::from_secs(3);
/// Until a first plan, or a whole one, is made.
const SETTLED: Duration = Duration::from_secs(8);
/// Longest that a plan of everybody is waited for.
const SETTLING_MAX: Duration = Duration::from_secs(120);

fn main() -> anyhow::Result<()> {
    let setting = |name: &str, usual: f64| std::env::var(name).map_or(usual, |text| text.parse().expect("a number"));
    let robots = setting("TENDER_LOAD_ROBOTS", 1000.0) as usize;
    let rate_hz = setting("TENDER_LOAD_RATE", 50_000.0);
    let seconds = setting("TENDER_LOAD_S", 30.0);
    let folder = tempfile::tempdir()?;
    let port = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    let mut coordinator = start(folder.path(), port)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let result = runtime.block_on(load(&coordinator, port, robots, rate_hz, seconds));
    let _ = coordinator.kill();
    let _ = coordinator.wait();
    let size = |name: &str| std::fs::metadata(folder.path().join(name)).map_or(0, |file| file.len()) as f64 / 1e6;
    println!("store          {:.1} MB, {:.1} MB of log", size("tender.db"), size("tender.db-wal"));
    let log = std::fs::read_to_string(folder.path().join("log"))?;
    log.lines().filter(|line| line.contains("WARN") || line.contains("ERROR")).take(5).for_each(|line| println!("{line}"));
    result
}

fn start(folder: &Path, port: u16) -> anyhow::Result<Child> {
    let config = fleet::config(&format!("[web]\nenabled = false\n[network]\nlisten = [\"tcp/127.0.0.1:{port}\"]\n"));
    let path = folder.join("coordinator.toml");
    std::fs::write(&path, config)?;
    let log = std::fs::File::create(folder.join("log"))?;
    let mut command = Command::new(env!("CARGO_BIN_EXE_coordinator"));
    // As the unit in packaging/systemd has it.
    if std::env::var_os("MIMALLOC_PURGE_DELAY").is_none() {
        command.env("MIMALLOC_PURGE_DELAY", "10000");
    }
    Ok(command.args(["run", "--config"]).arg(path).stderr(log).stdout(Stdio::null()).spawn()?)
}

async fn load(coordinator: &Child, port: u16, robots: usize, rate_hz: f64, seconds: f64) -> anyhow::Result<()> {
    let link = connect(port).await?;
    let seq = Arc::new(AtomicU64::new(1));
    let names: Vec<RobotId> = (0..robots).map(|n| id(&format!("r{n}"))).collect();
    let stations = fleet::stations();
    // Newcomers speak for themselves: in one session with all others, what they say may be dropped in a burst.
    let own = connect(port).await?;
    let plans = plans(&link).await?;
    let stop = Arc::new(AtomicBool::new(false));
    let joined = Arc::new(AtomicUsize::new(0));
    let states =
        tokio::spawn(say_states(link.clone(), names.clone(), stations.clone(), Arc::clone(&seq), Arc::clone(&joined), Arc::clone(&stop)));
    tokio::time::sleep(LISTENING).await;
    settle(&link, &names, &plans, &seq).await?;

    println!("machine        {} cores, {}", std::thread::available_parallelism()?, processor());
    for (what, rate_hz) in [("calm", robots as f64), ("flood", rate_hz)] {
        let pid = coordinator.id();
        let (cpu_begin_s, rss_begin_mb, begin) = (cpu_s(pid), memory_mb(pid, "VmRSS:"), Instant::now());
        let flood = tokio::spawn(flood(connect(port).await?, names.clone(), rate_hz, seconds, Arc::clone(&seq)));
        let waits_ms = newcomers(&own, &stations, &plans, seconds, &seq, &joined).await?;
        let sent = flood.await??;
        let passed_s = begin.elapsed().as_secs_f64();
        let (cpu, rss_end_mb) = ((cpu_s(pid) - cpu_begin_s) / passed_s, memory_mb(pid, "VmRSS:"));
        println!("{what}");
        println!("  messages     {sent} gauges of {robots} robots in {passed_s:.1} s: {:.0} per second", sent as f64 / passed_s);
        println!("  processor    {cpu:.2} cores, {:.1} us per message", cpu * passed_s / sent as f64 * 1e6);
        let most_mb = memory_mb(pid, "VmHWM:");
        println!("  memory       {rss_begin_mb:.0} MB at the beginning, {rss_end_mb:.0} MB at the end, {most_mb:.0} MB at most so far");
        let at = |share: f64| waits_ms.get(((waits_ms.len() as f64 * share) as usize).min(waits_ms.len().saturating_sub(1)));
        let [median, most, nearly_all] = [0.5, 0.9, 0.99].map(|share| at(share).copied().unwrap_or(f64::NAN));
        println!("  decisions    {} newcomers: p50 {median:.0} ms, p90 {most:.0} ms, p99 {nearly_all:.0} ms", waits_ms.len());
    }
    stop.store(true, Ordering::Relaxed);
    states.await??;
    Ok(())
}

/// Makes everybody known, and waits for a plan that tells of all. What is said in one burst may be dropped, so who is in
/// no plan says it again.
async fn settle(link: &Link, names: &[RobotId], plans: &Plans, seq: &AtomicU64) -> anyhow::Result<()> {
    let mut known: BTreeSet<RobotId> = BTreeSet::new();
    let begin = Instant::now();
    while known.len() < names.len() {
        anyhow::ensure!(begin.elapsed() < SETTLING_MAX, "of {} robots a plan tells of {} only", names.len(), known.len());
        for (n, robot) in names.iter().enumerate().filter(|(_, robot)| !known.contains(*robot)) {
            link.publish(&Key::RobotGauge(robot.clone()), &gauge(seq, soc_of(n, names.len()))).await?;
        }
        tokio::time::sleep(SETTLED).await;
        if let Some((_, schedule)) = std::mem::take(&mut *plans.lock().await).pop() {
            known = told(&schedule).cloned().collect();
        }
    }
    tokio::time::sleep(SETTLED).await;
    plans.lock().await.clear();
    Ok(())
}

/// Everybody that a plan tells of.
fn told(schedule: &Schedule) -> impl Iterator<Item = &RobotId> {
    schedule.services.iter().map(|service| &service.robot).chain(schedule.unserved.iter().map(|one| &one.robot))
}

async fn connect(port: u16) -> anyhow::Result<Link> {
    Link::open(&NetworkConfig::to(&format!("tcp/127.0.0.1:{port}")), SiteId::new("site")?).await
}

type Plans = Arc<tokio::sync::Mutex<Vec<(Instant, Schedule)>>>;

/// Every plan, and when it came.
async fn plans(link: &Link) -> anyhow::Result<Plans> {
    let plans = Plans::default();
    let (kept, (told, mut telling)) = (Arc::clone(&plans), tokio::sync::mpsc::unbounded_channel());
    let subscriber = link.session.declare_subscriber(Key::Schedule.build(&link.site));
    let subscriber = subscriber.callback(move |sample| drop(told.send((Instant::now(), sample.payload().to_bytes().into_owned()))));
    let subscriber = subscriber.await.map_err(|error| anyhow!("{error}"))?;
    tokio::spawn(async move {
        let _subscriber = subscriber;
        while let Some((at, bytes)) = telling.recv().await {
            if let Ok(schedule) = proto::decode::<Schedule>(&bytes) {
                kept.lock().await.push((at, schedule));
            }
        }
    });
    Ok(plans)
}

/// Robots that join one after the other; how long each waits for a plan that tells of it, ms, in order
/// of size.
async fn newcomers(
    link: &Link,
    stations: &[StationId],
    plans: &Plans,
    seconds: f64,
    seq: &AtomicU64,
    joined: &AtomicUsize,
) -> anyhow::Result<Vec<f64>> {
    let (mut waits_ms, begin) = (Vec::new(), Instant::now());
    while begin.elapsed().as_secs_f64() < seconds {
        let n = joined.load(Ordering::Relaxed);
        let next = Instant::now() + Duration::from_secs_f64(1.0 / NEWCOMERS_HZ + 0.037 * (n % 7) as f64);
        let robot: RobotId = id(&format!("n{n}"));
        link.publish(&Key::RobotState(robot.clone()), &state(n, stations, seq)).await?;
        tokio::time::sleep(Duration::from_millis(20)).await;
        let said = Instant::now();
        link.publish(&Key::RobotGauge(robot.clone()), &gauge(seq, NEWCOMER_SOC)).await?;
        joined.store(n + 1, Ordering::Relaxed);
        while said.elapsed() < PATIENCE {
            let new = std::mem::take(&mut *plans.lock().await);
            if let Some((at, _)) = new.iter().find(|(_, schedule)| told(schedule).any(|told| *told == robot)) {
                waits_ms.push((*at - said).as_secs_f64() * 1e3);
                break;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        tokio::time::sleep_until(next.into()).await;
    }
    waits_ms.sort_by(f64::total_cmp);
    Ok(waits_ms)
}

/// Gauges of all robots in turn, at that rate together.
async fn flood(link: Link, robots: Vec<RobotId>, rate_hz: f64, seconds: f64, seq: Arc<AtomicU64>) -> anyhow::Result<u64> {
    let keys: Vec<String> = robots.iter().map(|robot| Key::RobotGauge(robot.clone()).build(&link.site)).collect();
    let (begin, mut sent) = (Instant::now(), 0_u64);
    while begin.elapsed().as_secs_f64() < seconds {
        let due = (begin.elapsed().as_secs_f64() * rate_hz) as u64;
        while sent < due {
            let n = (sent % keys.len() as u64) as usize;
            let message = proto::encode(&gauge(&seq, soc_of(n, keys.len())));
            link.session.put(keys[n].as_str(), message).await.map_err(|error| anyhow!("{error}"))?;
            sent += 1;
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    Ok(sent)
}

async fn say_states(
    link: Link,
    robots: Vec<RobotId>,
    stations: Vec<StationId>,
    seq: Arc<AtomicU64>,
    joined: Arc<AtomicUsize>,
    stop: Arc<AtomicBool>,
) -> anyhow::Result<()> {
    while !stop.load(Ordering::Relaxed) {
        for station in &stations {
            link.publish(&Key::StationState(station.clone()), &fleet::station_state(now(), next(&seq))).await?;
            for n in 0..fleet::PACKS {
                link.publish(&Key::PackGauge(station.clone(), pack(n)), &fleet::pack_gauge(now(), next(&seq))).await?;
            }
        }
        for (n, robot) in robots.iter().enumerate() {
            link.publish(&Key::RobotState(robot.clone()), &state(n, &stations, &seq)).await?;
        }
        for n in 0..joined.load(Ordering::Relaxed) {
            let robot: RobotId = id(&format!("n{n}"));
            link.publish(&Key::RobotState(robot.clone()), &state(n, &stations, &seq)).await?;
            link.publish(&Key::RobotGauge(robot), &gauge(&seq, NEWCOMER_SOC)).await?;
        }
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
    Ok(())
}

fn now() -> Timestamp {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    Timestamp::from_unix_ms(since.as_millis() as i64)
}

fn next(seq: &AtomicU64) -> u64 {
    seq.fetch_add(1, Ordering::Relaxed)
}

/// The gauge of a robot that had this charge when the bench began, and has worked since.
fn gauge(seq: &AtomicU64, soc: f64) -> Gauge {
    static BEGIN: LazyLock<Instant> = LazyLock::new(Instant::now);
    fleet::gauge(now(), next(seq), soc, BEGIN.elapsed().as_secs_f64())
}

fn state(n: usize, stations: &[StationId], seq: &AtomicU64) -> RobotState {
    fleet::state(now(), next(seq), n, stations)
}

/// Processor time of a process, s.
fn cpu_s(pid: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |n: usize| fields.get(n).and_then(|field| field.parse::<f64>().ok()).unwrap_or(f64::NAN);
    // Fields 14 and 15 of the line, in the kernel's unit of 10 ms.
    (ticks(11) + ticks(12)) / 100.0
}

/// Memory of a process, MB: what it has (VmRSS) or had at most (VmHWM).
fn memory_mb(pid: u32, which: &str) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(which)).unwrap_or_default();
    line.split_whitespace().next().and_then(|kb| kb.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1e3
}

fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or_default();
    line.trim_start_matches([' ', '\t', ':']).to_owned()
}
