//! Every decoder takes whatever comes: an answer or an error, never a panic and never more memory than
//! the input's own size explains.
//!
//! Inputs are good texts that are damaged at random: bytes flipped, cut, doubled, spliced with another
//! text, numbers made extreme. `TENDER_FUZZ=1000000` gives each decoder as many.

use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Inputs per decoder in the test command.
const INPUTS: u64 = 2_000;

fn inputs() -> u64 {
    std::env::var("TENDER_FUZZ").map_or(INPUTS, |text| text.parse().expect("TENDER_FUZZ is a number"))
}

fn files(folder: &Path, extension: &str) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> = std::fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let good = paths.iter().filter(|path| path.extension().is_some_and(|found| found == extension));
    let texts: Vec<_> = good.map(|path| std::fs::read(path).expect("a file")).collect();
    assert!(!texts.is_empty(), "no *.{extension} in {}", folder.display());
    texts
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace")
}

/// What stands where a number or word stood: what parsers stumble over.
const NASTY: [&str; 20] = [
    "1e999",
    "-1e999",
    "nan",
    "inf",
    "-0",
    "9223372036854775808",
    "1e-400",
    "null",
    "\"\"",
    "[[[[[[[[",
    "{\"a\":{\"a\":{",
    "\u{0}",
    "\u{feff}",
    "0.1.2",
    "+-1",
    "18446744073709551616",
    "true",
    "'''",
    "\r",
    "\u{10ffff}",
];

/// One damaged text.
fn damaged(good: &[Vec<u8>], rng: &mut Pcg64Mcg) -> Vec<u8> {
    let mut text = good[rng.random_range(0..good.len())].clone();
    for _ in 0..rng.random_range(1..=4) {
        let length = text.len().max(1);
        let at = rng.random_range(0..length).min(text.len());
        let span = rng.random_range(0..=32.min(text.len() - at));
        match rng.random_range(0..7) {
            0 if at < text.len() => text[at] ^= 1 << rng.random_range(0..8),
            1 => text.truncate(at),
            2 => drop(text.splice(at..at + span, [])),
            3 => {
                let again = text[at..at + span].repeat(rng.random_range(1..4));
                text.splice(at..at, again);
            }
            4 => {
                let other = &good[rng.random_range(0..good.len())];
                let from = rng.random_range(0..other.len());
                let piece = other[from..(from + 64).min(other.len())].to_vec();
                text.splice(at..at + span, piece);
            }
            5 => {
                // The value after the next sign that one begins.
                let from = text[at..].iter().position(|byte| b"=:,".contains(byte)).map_or(at, |found| at + found + 1);
                let ends = text[from..].iter().position(|byte| b",\n]}".contains(byte)).map_or(text.len(), |found| from + found);
                text.splice(from..ends, NASTY[rng.random_range(0..NASTY.len())].bytes());
            }
            _ => drop(text.splice(at..at, NASTY[rng.random_range(0..NASTY.len())].bytes())),
        }
    }
    text
}

/// Gives a decoder damaged texts; says how many it took nevertheless.
fn fuzz(name: &str, good: &[Vec<u8>], takes: impl Fn(&[u8]) -> bool) {
    assert!(good.iter().any(|text| takes(text)), "{name}: not even a good text is taken");
    let mut rng = Pcg64Mcg::seed_from_u64(name.len() as u64);
    let mut taken = 0_u64;
    for number in 0..inputs() {
        let text = damaged(good, &mut rng);
        let answer = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| takes(&text)));
        match answer {
            Ok(good) => taken += u64::from(good),
            Err(_) => panic!("{name}: input {number} makes it panic:\n{}", String::from_utf8_lossy(&text)),
        }
    }
    println!("{name}: {} inputs, {taken} taken", inputs());
}

fn as_text(takes: impl Fn(&str) -> bool) -> impl Fn(&[u8]) -> bool {
    move |bytes| std::str::from_utf8(bytes).is_ok_and(&takes)
}

#[test]
fn messages_on_the_wire() {
    use proto::{
        Capacity, CommandReply, Event, Explanation, Gauge, RobotCommand, RobotState, Schedule, SimDraw, SimSupply, StationCommand,
        StationState,
    };
    let good = files(&root().join("proto/golden"), "json");
    fn any<M: proto::Message>(bytes: &[u8]) -> bool {
        // What was taken can be written, and read again.
        proto::decode::<M>(bytes).is_ok_and(|message| proto::decode::<M>(&proto::encode(&message)).is_ok())
    }
    fuzz("wire", &good, |bytes| {
        [
            any::<Gauge>(bytes),
            any::<RobotState>(bytes),
            any::<StationState>(bytes),
            any::<RobotCommand>(bytes),
            any::<StationCommand>(bytes),
            any::<CommandReply>(bytes),
            any::<Schedule>(bytes),
            any::<Capacity>(bytes),
            any::<Explanation>(bytes),
            any::<Event>(bytes),
            any::<SimDraw>(bytes),
            any::<SimSupply>(bytes),
        ]
        .contains(&true)
    });
}

#[test]
fn keys() {
    let good = ["tender/site/v1/robot/r-1/gauge", "tender/site/v1/station/s/pack/p/gauge", "tender/a/v1/sim/station/s/robot/r/draw"];
    let good: Vec<Vec<u8>> = good.iter().map(|key| key.as_bytes().to_vec()).collect();
    fuzz("keys", &good, as_text(|text| proto::Key::parse(text).is_ok_and(|(site, key)| key.build(&site) == text)));
}

#[test]
fn scenarios() {
    let good = files(&root().join("scenarios"), "toml");
    fuzz("scenario", &good, as_text(|text| coordinator::scenario::Scenario::parse(Path::new("fuzz.toml"), text).is_ok()));
}

#[test]
fn models() {
    let good = files(&root().join("energy/params"), "toml");
    let read = |table: &str| energy::built_in(table).map(str::to_owned).ok_or_else(|| "no such table".to_owned());
    fuzz("model", &good, as_text(|text| energy::Model::parse("fuzz", text, &read).is_ok()));
}

#[test]
fn configurations() {
    let mut good = files(&root().join("scenarios/live"), "toml");
    good.sort();
    fuzz(
        "configuration",
        &good,
        as_text(|text| {
            let coordinator = toml::from_str::<coordinator::Config>(text);
            let coordinator = coordinator.is_ok_and(|config| config.network.check().is_ok() && config.policy.settings().is_ok());
            let robot = toml::from_str::<robot_agent::Config>(text).is_ok_and(|config| config.check().is_ok());
            let station = toml::from_str::<station_agent::Config>(text).is_ok_and(|config| config.check().is_ok());
            coordinator || robot || station
        }),
    );
}

#[test]
fn logs() {
    let row = |n: u32| format!("{n},{}.5,11.{n},25.0\n", n % 3);
    let csv = "time_s,current_a,voltage_v,temperature_degc\n".to_owned() + &(0..12).map(row).collect::<String>();
    let good = [csv.clone().into_bytes(), csv.replace(',', ";").into_bytes(), csv.replace('\n', "\r\n").into_bytes()];
    fuzz("log", &good, |bytes| lab::measurement::read_log("fuzz.csv", bytes, lab::LogFacts::default()).is_ok());
}
