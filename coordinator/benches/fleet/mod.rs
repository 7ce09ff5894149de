//! The fleet of the benches: what its robots and stations say, and the configuration of who hears it.

use std::fmt::Write as _;

use proto::{
    BayId, BayPhase, BayState, Estimate, Gauge, Mission, PackId, PackState, RobotPhase, RobotState, StationId, StationState, Timestamp,
    Travel,
};

/// Stations of the site, bays and packs of each: enough for everybody.
pub const STATIONS: usize = 50;
pub const BAYS: usize = 6;
pub const PACKS: usize = 12;
/// Charge with which newcomers come: enough that nobody has to leave at once, which nobody here would do.
pub const NEWCOMER_SOC: f64 = 0.3;
const BATTERY: &str = "explorer-3s1p-1320mah";
/// What a battery holds, Wh, and what a robot draws, W.
const FULL_WH: f64 = 14.6;
const DRAIN_W: f64 = 4.3;

/// The configuration of a coordinator for this site; `more` is the rest of its policy, and its other tables.
pub fn config(more: &str) -> String {
    let mut config = format!("schema = 1\nsite = \"site\"\n[policy]\npatience_s = 5\n{more}\n");
    for n in 0..STATIONS {
        let packs: Vec<String> = (0..PACKS).map(|n| format!("p{n:02} = \"mds-3s4p-7600mah\"")).collect();
        write!(
            config,
            "[stations.s{n}]\nload = \"mds-station\"\nload_s = 30\nunload_s = 30\nswap_s = 60\npacks = {{ {} }}\n",
            packs.join(", ")
        )
        .expect("a string");
    }
    config
}

pub fn id<T: std::str::FromStr<Err: std::fmt::Debug>>(text: &str) -> T {
    text.parse().expect("an id")
}

pub fn stations() -> Vec<StationId> {
    (0..STATIONS).map(|n| id(&format!("s{n}"))).collect()
}

pub fn pack(n: usize) -> PackId {
    id(&format!("p{n:02}"))
}

/// Charges from 25 % up: some want a service soon, most do not.
pub fn soc_of(n: usize, robots: usize) -> f64 {
    0.25 + 0.7 * n as f64 / robots as f64
}

/// The gauge of a robot that had this charge some time ago, and has worked since.
pub fn gauge(at: Timestamp, seq: u64, soc: f64, since_s: f64) -> Gauge {
    let soc = soc - since_s / 3600.0 * DRAIN_W / FULL_WH;
    Gauge {
        at,
        seq,
        soc: Estimate::new(soc, 0.01),
        remaining_wh: Estimate::new(soc * FULL_WH, 0.15),
        full_wh: Estimate::new(FULL_WH, 0.15),
        time_to_empty_s: Some(Estimate::new(soc * FULL_WH / DRAIN_W * 3600.0, 120.0)),
        time_to_full_s: None,
        soh: Estimate::new(1.0, 0.02),
        cycles: None,
        voltage_v: 10.5 + 1.8 * soc,
        current_a: DRAIN_W / 11.1,
        temperature_degc: 25.0,
        power_w: DRAIN_W,
        cells_series: 3,
        source: "bench".to_owned(),
    }
}

pub fn pack_gauge(at: Timestamp, seq: u64) -> Gauge {
    let full = Estimate::new(84.0, 0.8);
    Gauge { soc: Estimate::new(1.0, 0.01), remaining_wh: full, full_wh: full, ..gauge(at, seq, 1.0, 0.0) }
}

pub fn state(at: Timestamp, seq: u64, n: usize, stations: &[StationId]) -> RobotState {
    let travel = |k: usize, time_s: f64| (stations[k % stations.len()].clone(), Travel { time_s, energy_wh: Estimate::new(0.1, 0.01) });
    RobotState {
        at,
        seq,
        phase: RobotPhase::Working,
        station: None,
        bay: None,
        drain_w: Estimate::new(DRAIN_W, 0.1),
        travel: [travel(n, 120.0), travel(n + 1, 300.0), travel(n + 7, 900.0)].into(),
        mission: Mission { weight: 1.0, until: None },
        battery: BATTERY.to_owned(),
        load: None,
        last_command: None,
        note: None,
    }
}

pub fn station_state(at: Timestamp, seq: u64) -> StationState {
    let bay = |n: usize| BayState { bay: id::<BayId>(&format!("bay-{n}")), phase: BayPhase::Free, robot: None };
    StationState {
        at,
        seq,
        bays: (1..=BAYS).map(bay).collect(),
        lift_busy: false,
        swapping: None,
        packs: (0..PACKS).map(|n| PackState { pack: pack(n), connected: true, depleted: false, back: None }).collect(),
        active_pack: Some(pack(0)),
        powered: true,
        pack_power_w: 6.0,
        arrives: None,
        away: Vec::new(),
        spares: Vec::new(),
        last_command: None,
        note: None,
    }
}
