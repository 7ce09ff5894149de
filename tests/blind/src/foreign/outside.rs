//! Things that the catalogue knows nothing of: the right answer is to say so.

use std::f64::consts::TAU;

use energy::{Channel, System};

use super::{Stranger, on_current, on_target};
use crate::random::Stream;
use crate::world::{Adds, MakeForeign};

const ROBOT: &[&str] = &["idle", "rolling", "slope", "acceleration", "payload"];
const STATION: &[&str] = &["robot_own_load", "charger_efficiency", "converter_efficiency", "hotel", "lift"];

/// A switch that is on for a share of its period; every log finds it at another phase.
fn periodic(random: &mut Stream, low_s: f64, high_s: f64) -> impl Fn(usize, f64) -> f64 + Clone + Send + Sync + 'static {
    let (period_s, share) = (random.log_between(low_s, high_s), random.between(0.25, 0.5));
    let phases: Vec<f64> = (0..8).map(|_| random.between(0.0, 1.0)).collect();
    move |log, time_s| f64::from(u8::from((time_s / period_s + phases[log % 8]).fract() < share))
}

/// A switch that changes at random, with mean times off and on, s.
fn random_switch(seed: u64, off_s: f64, on_s: f64) -> impl FnMut(f64) -> bool {
    let (mut random, mut on) = (Stream::new(seed, "switch"), false);
    move |dt_s| {
        if random.chance((dt_s / if on { on_s } else { off_s }).min(1.0)) {
            on = !on;
        }
        on
    }
}

/// A number that makes the switches of a case unlike those of others.
fn seed(random: &mut Stream) -> u64 {
    random.between(0.0, 1e15) as u64
}

fn hiccups(random: &mut Stream) -> MakeForeign {
    let (seed, off_s, on_s) = (seed(random), random.between(900.0, 1800.0), random.between(120.0, 300.0));
    on_target(move |size, log| -> Adds {
        let mut switch = random_switch(seed + log as u64, off_s, on_s);
        Box::new(move |now| if switch(now.dt_s) { -size * 0.3 * now.channels[Channel::ChargePowerW] } else { 0.0 })
    })
}

/// Of these no formula over channels and time can say when they come: they do at random.
pub const AT_RANDOM: &[&str] = &["intermittent-contact", "voltage-glitches", "dragging-wheel", "updates", "hiccuping-charger"];

/// Everything outside the catalogue.
pub const OUTSIDE: &[Stranger] = &[
    Stranger {
        name: "periodic-load",
        system: System::Battery,
        story: "a load beside the gauge that switches on and off with a period",
        any: &[],
        // Its mean is a leak past the gauge, and the catalogue knows such; that it switches, it does not.
        may: &["parasitic_load", "current_offset"],
        base: &["ohmic"],
        make: |random| {
            let switch = periodic(random, 240.0, 900.0);
            on_current(move |size, log| -> Adds {
                let switch = switch.clone();
                Box::new(move |now| size * 0.1 * switch(log, now.time_s))
            })
        },
    },
    Stranger {
        name: "intermittent-contact",
        system: System::Battery,
        story: "a contact that jumps to a higher resistance and back at random",
        any: &[],
        may: &[],
        base: &["ohmic", "rc1"],
        make: |random| {
            let (seed, off_s, on_s) = (seed(random), random.between(600.0, 1500.0), random.between(100.0, 300.0));
            on_target(move |size, log| -> Adds {
                let mut switch = random_switch(seed + log as u64, off_s, on_s);
                Box::new(move |now| if switch(now.dt_s) { -size * 0.02 * now.channels[Channel::CurrentA] } else { 0.0 })
            })
        },
    },
    Stranger {
        name: "voltage-glitches",
        system: System::Battery,
        story: "single readings of the voltage that are far too low",
        any: &[],
        may: &[],
        base: &["ohmic", "rc1"],
        make: |random| {
            let (seed, share) = (seed(random), random.between(0.01, 0.03));
            on_target(move |size, log| -> Adds {
                let mut random = Stream::new(seed + log as u64, "glitch");
                Box::new(move |_| if random.chance(share) { -size * random.between(0.02, 0.06) } else { 0.0 })
            })
        },
    },
    Stranger {
        name: "mains-ripple",
        system: System::Battery,
        story: "a slow sine on the voltage reading, of a period of minutes",
        any: &[],
        may: &[],
        base: &["ohmic"],
        make: |random| {
            let period_s = random.log_between(150.0, 600.0);
            let phases: Vec<f64> = (0..8).map(|_| random.between(0.0, TAU)).collect();
            on_target(move |size, log| -> Adds {
                let phase = phases[log % 8];
                Box::new(move |now| size * 0.005 * (TAU * now.time_s / period_s + phase).sin())
            })
        },
    },
    Stranger {
        name: "thermostat-fan",
        system: System::Robot,
        story: "a fan that a thermostat switches with a period that no channel shows",
        any: &[],
        may: &[],
        base: ROBOT,
        make: |random| {
            let switch = periodic(random, 80.0, 400.0);
            on_target(move |size, log| -> Adds {
                let switch = switch.clone();
                Box::new(move |now| size * 0.2 * switch(log, now.time_s))
            })
        },
    },
    Stranger {
        name: "dragging-wheel",
        system: System::Robot,
        story: "a wheel that drags for a minute now and then",
        any: &[],
        may: &[],
        base: ROBOT,
        make: |random| {
            let seed = seed(random);
            on_target(move |size, log| -> Adds {
                let mut switch = random_switch(seed + log as u64, 240.0, 60.0);
                Box::new(move |now| if switch(now.dt_s) { size * now.channels[Channel::SpeedMps] } else { 0.0 })
            })
        },
    },
    Stranger {
        name: "updates",
        system: System::Robot,
        story: "a program that wakes at random, works and sleeps again, in no channel",
        any: &[],
        may: &[],
        base: ROBOT,
        make: |random| {
            let seed = seed(random);
            on_target(move |size, log| -> Adds {
                let mut switch = random_switch(seed + log as u64, 200.0, 40.0);
                Box::new(move |now| if switch(now.dt_s) { size * 0.3 } else { 0.0 })
            })
        },
    },
    Stranger {
        name: "hiccuping-charger",
        system: System::Station,
        story: "a charger that drops a third of its power for minutes while its channel says otherwise",
        any: &[],
        may: &[],
        base: STATION,
        make: hiccups,
    },
    Stranger {
        name: "thermostat-heater",
        system: System::Station,
        story: "a heater that a thermostat switches with a period that no channel shows",
        any: &[],
        may: &[],
        base: STATION,
        make: |random| {
            let switch = periodic(random, 600.0, 2400.0);
            on_target(move |size, log| -> Adds {
                let switch = switch.clone();
                Box::new(move |now| size * switch(log, now.time_s))
            })
        },
    },
];
