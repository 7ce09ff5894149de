//! Are promises kept as often as they say? Worlds are drawn from the sigmas that the coordinator's models
//! state: every parameter of every model, the packs' capacity, and the charge that everybody begins
//! with. Then robots come to one pack, and what was promised at which probability is compared with
//! what was kept; so is what the pack was said to be enough for, before anybody came. A promise is kept by a service, and kept in full
//! by one that charges as far as was promised: where energy turns out to be short, a robot is let go with less rather than not served.
//!
//! A few worlds run always; `TENDER_CALIBRATION=1000` runs as many and prints the table. Judged is only
//! that of the promises at 99 % and more nine in ten are kept: a few worlds do not tell more.

use std::fmt::Write as _;
use std::path::Path;

use coordinator::models::Kept;
use coordinator::scenario::{RunEntry, Scenario};
use coordinator::sim;
use coordinator::store::Record;
use lab::model_edit::{Change, edit};
use node::files::ModelRef;
use proto::EventKind;
use statrs::distribution::{ContinuousCDF, Normal};

use super::scenario_folder;

/// A stream of numbers for one world (splitmix64).
struct Draw(u64);

impl Draw {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        Normal::standard().inverse_cdf(self.uniform().clamp(1e-9, 1.0 - 1e-9))
    }
}

/// A model like the built-in one, with every parameter and the capacity drawn from its sigma, as a file.
fn drawn(name: &str, folder: &Path, draw: &mut Draw) -> ModelRef {
    let (text, model) = (energy::built_in(name).expect("built in"), lab::load_model(name).expect("built in").model);
    let mut text = text.to_owned();
    if model.system == energy::System::Battery {
        let (capacity_ah, sigma) = (model.battery().capacity_ah, model.uncertainty.capacity_relative_sigma);
        let (was, is) =
            (format!("capacity_ah = {capacity_ah}\n"), format!("capacity_ah = {}\n", capacity_ah * (1.0 + sigma * draw.normal())));
        assert!(text.contains(&was), "{name}: {was}");
        text = text.replace(&was, &is);
    }
    let change = |parameter: &energy::Parameter| Change {
        effect: parameter.effect.to_owned(),
        parameter: parameter.name.to_owned(),
        value: (parameter.value + parameter.sigma * draw.normal()).clamp(parameter.min, parameter.max),
        sigma: parameter.sigma,
        range: (parameter.min, parameter.max),
        source: "drawn".to_owned(),
        free: false,
    };
    let changes: Vec<Change> = model.parameters().iter().filter(|parameter| parameter.sigma > 0.0).map(change).collect();
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, edit(&text, &changes, None).unwrap()).unwrap();
    ModelRef::Name(path.to_string_lossy().into_owned())
}

/// What came of a promise.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Came {
    /// No service.
    Broken,
    /// One to less than was promised.
    Less,
    /// What was promised.
    Full,
}

/// What one world said and did.
struct World {
    /// Stated probability of each promised service, and what came of it.
    promises: Vec<(f64, Came)>,
    /// Stated probability that the station's energy is enough for as many services as were planned, and what came of the least of them.
    enough: Option<(f64, Came)>,
    /// Robots of which the first plan said that they would be served.
    safe: usize,
    /// How many of them stranded before that.
    stranded: usize,
}

/// One station, one pack, and robots that want a service each.
struct Setting {
    /// Charge of the station's pack.
    pack_soc: f64,
    /// Of each robot.
    robot_socs: Vec<f64>,
    /// What the station has for them.
    place: &'static str,
    /// How long it runs, s.
    duration_s: u32,
}

impl Setting {
    /// Three robots and a pack that is just enough for one, two or three of them, give or take two of its sigmas, so that the last
    /// promise is a matter of chance (29, 53 and 78 Wh; 25 Wh at 35 %, 86 Wh more for all the rest).
    fn of_bays(draw: &mut Draw) -> Self {
        let need_wh = [29.0, 53.5, 78.0][(3.0 * draw.uniform()) as usize];
        let pack_soc = (0.35 + (need_wh + 1.3 * (3.5 * draw.uniform() - 1.0) - 25.0) / 86.3).min(1.0);
        let robot_socs = [0.105, 0.115, 0.125].map(|soc| soc + 0.003 * draw.normal()).to_vec();
        Self { pack_soc, robot_socs, place: "bays = 3", duration_s: 5400 }
    }

    /// Two robots and one spare. An hour and a quarter passes until the second gets the pack of the first: 20 Wh for its charge and
    /// 7 Wh that the station takes are just there, give or take as much (28 Wh at 35 %, 81 Wh more for all the rest).
    fn of_exchanges(draw: &mut Draw) -> Self {
        let pack_soc = 0.35 + (27.0 + 1.3 * (3.5 * draw.uniform() - 1.0) - 28.0) / 81.0;
        let robot_socs = [0.105, 0.46].map(|soc| soc + 0.003 * draw.normal()).to_vec();
        let place = r#"bays = 0
swap_s = 60
spares = [{ id = "spare-1", soc = 0.98 }]
charging = { spare_battery = "explorer-3s1p-1320mah" }"#;
        Self { pack_soc, robot_socs, place, duration_s: 7200 }
    }
}

fn world(seed: u64, setting: fn(&mut Draw) -> Setting) -> World {
    let folder = tempfile::tempdir().unwrap();
    let table = "enertech-lco-2280mah-ocv.csv";
    std::fs::write(folder.path().join(table), energy::built_in(table).unwrap()).unwrap();
    let mut draw = Draw(seed);
    let file = scenario_folder().join("calibration.toml");
    let Setting { pack_soc, robot_socs, place, duration_s } = setting(&mut draw);
    let (count, ways) = (robot_socs.len(), &[60, 120, 180][..robot_socs.len()]);
    let text = format!(
        r#"schema = 1
name = "drawn"
duration_s = {duration_s}
[policy]
confidence = 0.5
serve_below_soc = 0.10
[[station]]
id = "mds-1"
load = "mds-station"
{place}
load_s = 30
unload_s = 30
packs = [{{ id = "pack-1", battery = "mds-3s4p-7600mah", soc = {pack_soc} }}]
[[robot]]
id = "explorer"
count = {count}
battery = "explorer-3s1p-1320mah"
load = "explorer-robot"
soc = {robot_socs:?}
travel_s.mds-1 = {ways:?}
mission.inputs = {{ speed_mps = 0.1 }}
"#
    );
    let scenario = Scenario::parse(&file, &text).unwrap_or_else(|error| panic!("{error}"));
    let mut deployment = scenario.deploy(&RunEntry::default(), seed).unwrap();
    // Packs of a kind differ among each other; the three robots' loads and the station are one each.
    for config in &mut deployment.robots {
        let own = folder.path().join(config.id.as_str());
        std::fs::create_dir(&own).unwrap();
        std::fs::write(own.join(table), energy::built_in(table).unwrap()).unwrap();
        let robot_agent::SourceConfig::Sim { battery, load, .. } = &mut config.source else { panic!("simulated") };
        *battery = drawn(battery.name(), &own, &mut draw);
        *load = drawn(load.name(), &own, &mut draw);
    }
    let station_agent::SourceConfig::Sim { load, packs, .. } = &mut deployment.stations[0].source else { panic!("simulated") };
    *load = drawn(load.name(), folder.path(), &mut draw);
    for pack in packs.values_mut() {
        pack.battery = drawn(pack.battery.name(), folder.path(), &mut draw);
    }
    let outcome =
        sim::simulate(&deployment, *scenario.duration_s.get_ref(), scenario.temperature_degc, Kept::Nowhere, &mut |_| {}).unwrap();
    let first = outcome.measured.first_plan.as_ref().expect("a plan");
    let came = |service: &proto::Service| {
        let mut events = outcome.events.iter();
        let done = events.find(|event| event.kind == EventKind::ServiceDone && event.robot.as_ref() == Some(&service.robot));
        let Some(done) = done else { return Came::Broken };
        let gauged = outcome.records.iter().rev().find_map(|record| match record {
            Record::RobotGauge { robot, gauge } if *robot == service.robot && gauge.at <= done.at => Some(gauge.soc.value),
            _ => None,
        });
        match service.mode {
            // As the coordinator judges it: two gauges may disagree about the last percent.
            proto::Mode::Recharge { to_soc } if gauged.expect("it has spoken") < to_soc - 0.03 => Came::Less,
            _ => Came::Full,
        }
    };
    let dry = |robot: &proto::RobotId| {
        let its = |event: &&proto::Event| event.robot.as_ref() == Some(robot);
        let mut events =
            outcome.events.iter().filter(its).filter(|event| matches!(event.kind, EventKind::ServiceDone | EventKind::RobotStranded));
        events.next().is_some_and(|event| event.kind == EventKind::RobotStranded)
    };
    let told = &outcome.measured.first_capacity.as_ref().expect("counted").stations[0].promises;
    let last = first.services.len().checked_sub(1).and_then(|last| told.get(last));
    let certain = first.services.iter().filter(|service| service.probability.is_some_and(|p| p >= 0.95));
    World {
        promises: first.services.iter().map(|service| (service.probability.expect("planned"), came(service))).collect(),
        enough: last.map(|last| (last.probability, first.services.iter().map(came).min().expect("as many as there are"))),
        safe: certain.clone().count(),
        stranded: certain.filter(|service| dry(&service.robot)).count(),
    }
}

#[test]
fn promises_are_kept_as_often_as_they_say() {
    judge(10_000, Setting::of_bays);
}

#[test]
fn so_are_those_of_exchanges() {
    judge(20_000, Setting::of_exchanges);
}

fn judge(first: u64, setting: fn(&mut Draw) -> Setting) {
    let worlds: u64 = std::env::var("TENDER_CALIBRATION").map_or(4, |number| number.parse().expect("a number of worlds"));
    let next = std::sync::atomic::AtomicU64::new(0);
    let made = std::sync::Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, std::num::NonZero::get) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    if number >= worlds {
                        return;
                    }
                    let world = world(first + number, setting);
                    made.lock().unwrap().push(world);
                }
            });
        }
    });
    let made = made.into_inner().unwrap();
    let all: Vec<(f64, Came)> = made.iter().flat_map(|world| world.promises.iter().copied()).collect();
    let enough: Vec<(f64, Came)> = made.iter().filter_map(|world| world.enough).collect();
    let mut table = format!("services\n{}\nthe station's energy is enough for all that was planned\n{}\n", kept(&all), kept(&enough));
    let (safe, stranded): (usize, usize) = (made.iter().map(|world| world.safe).sum(), made.iter().map(|world| world.stranded).sum());
    writeln!(table, "of {safe} robots promised at 95 % or more {stranded} ran empty before their service").unwrap();
    println!("{worlds} worlds\n{table}");
    for of in [&all, &enough] {
        let sure: Vec<&(f64, Came)> = of.iter().filter(|(stated, _)| *stated >= 0.99).collect();
        let kept = sure.iter().filter(|(_, came)| *came > Came::Broken).count();
        assert!(!sure.is_empty() && kept * 10 >= sure.len() * 9, "{kept} of {} at 99 % and more were kept\n{table}", sure.len());
    }
}

/// How often what was said came true, in bands of what was said.
fn kept(all: &[(f64, Came)]) -> String {
    let mut table = String::from("stated            number   stated, mean   kept     in full\n");
    for (from, to) in [(0.05, 0.5), (0.5, 0.7), (0.7, 0.85), (0.85, 0.93), (0.93, 0.97), (0.97, 0.99), (0.99, 1.1)] {
        let here: Vec<_> = all.iter().filter(|(stated, _)| (from..to).contains(stated)).collect();
        let count = here.len().max(1) as f64;
        let stated = here.iter().map(|(stated, _)| stated).sum::<f64>() / count;
        let [kept, full] =
            [Came::Less, Came::Full].map(|least| here.iter().filter(|(_, came)| *came >= least).count() as f64 / count * 100.0);
        let (from, to) = (from * 100.0, to.min(1.0) * 100.0);
        writeln!(table, "{from:>4.0} to {to:>3.0} %   {:>8}   {:>10.1} %   {kept:>5.1} %   {full:>5.1} %", here.len(), stated * 100.0)
            .unwrap();
    }
    table
}
