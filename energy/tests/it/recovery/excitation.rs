//! Logs in which every effect shows: what a careful experimenter would run.

use energy::{Channel, Real, Run, Start, System, effect::Lane};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// One row: a step and the inputs that hold over it.
pub struct Row {
    /// Length of the step, s.
    pub dt_s: f64,
    /// Inputs.
    pub inputs: Vec<(Channel, f64)>,
}

impl Row {
    /// Sets the inputs and steps.
    pub fn apply<S: Lane + Real>(&self, run: &mut Run<S>) {
        for &(channel, value) in &self.inputs {
            run.channels[channel] = S::from(value);
        }
        run.step(self.dt_s);
    }
}

/// One log.
pub struct Log {
    /// How it begins.
    pub start: Start,
    /// Its rows.
    pub rows: Vec<Row>,
}

/// The logs of a system.
pub fn logs(system: System) -> Vec<Log> {
    match system {
        System::Battery => packs(),
        System::Robot | System::Station => drives(system),
    }
}

/// Charge of the pack that the currents below are meant for, Ah.
const PACK_AH: f64 = 1.32;

/// A pack at four temperatures of the surroundings, four ages and five counts of cycles, each from
/// nearly full through pulses and rests to nearly empty and up again; one of them lies on a shelf.
fn packs() -> Vec<Log> {
    let conditions = [
        // ambient, later ambient, cycles, days, start SoC
        (25.0, 25.0, 0.0, 5.0, 0.97),
        (8.0, 22.0, 150.0, 60.0, 0.95),
        (40.0, 25.0, 420.0, 200.0, 0.96),
        (25.0, 8.0, 700.0, 500.0, 0.9),
        (15.0, 32.0, 1100.0, 900.0, 0.85),
        (32.0, 12.0, 1100.0, 30.0, 0.8),
    ];
    let mut random = Pcg64Mcg::seed_from_u64(20);
    let log = |(index, &(ambient_degc, later_degc, cycle_count, age_days, soc)): (usize, &(f64, f64, f64, f64, f64))| {
        let start = Start { soc, temperature_degc: ambient_degc, cycle_count, age_days, history: 0.0, clock_s: 0.0 };
        let mut rows = Vec::new();
        let mut hold = |seconds: f64, dt_s: f64, rate: f64, ambient_degc: f64| {
            for _ in 0..(seconds / dt_s).round() as usize {
                let inputs = vec![
                    (Channel::CurrentA, rate * PACK_AH),
                    (Channel::AmbientDegc, ambient_degc),
                    (Channel::CycleCount, cycle_count),
                    (Channel::AgeDays, age_days),
                ];
                rows.push(Row { dt_s, inputs });
            }
        };
        hold(300.0, 10.0, 0.0, ambient_degc);
        // Pulses of both signs, each followed by a rest: down to about a tenth.
        let mut left = soc * (1.0 - 2e-4 * cycle_count);
        let mut ambient = ambient_degc;
        let mut pulse = 0;
        // The new pack goes to the knee near empty; the others keep clear of it, whatever they lost with age.
        while left > if index == 0 { 0.07 } else { 0.16 } {
            let rate: f64 = [0.5, 1.0, 1.5, 2.0, 0.25][(pulse + index) % 5] * random.random_range(0.9..1.1);
            let seconds = (0.07 / rate * 3600.0).min(600.0);
            hold(40.0, 2.0, rate, ambient);
            hold(seconds, 10.0, rate, ambient);
            hold(20.0, 1.0, 0.0, ambient);
            hold(if pulse % 4 == 3 { 1500.0 } else { 200.0 }, 20.0, 0.0, ambient);
            hold(60.0, 5.0, -0.7, ambient);
            hold(60.0, 5.0, 0.0, ambient);
            left -= (rate * (seconds + 40.0) - 0.7 * 60.0) / 3600.0;
            pulse += 1;
            if left < 0.5 {
                ambient = later_degc;
            }
        }
        hold(1800.0, 30.0, 0.0, ambient);
        if index % 3 == 1 {
            // Three weeks on the shelf.
            hold(21.0 * 86_400.0, 7200.0, 0.0, ambient);
        }
        // Up again, and pulses where the cell was before, reached from below.
        for _ in 0..6 {
            hold(600.0, 20.0, -0.6, ambient);
            hold(600.0, 20.0, 0.0, ambient);
            hold(60.0, 5.0, 1.2, ambient);
            hold(60.0, 5.0, 0.0, ambient);
        }
        hold(2400.0, 20.0, 0.4, ambient);
        hold(1200.0, 20.0, 0.0, ambient);
        Log { start, rows }
    };
    conditions.iter().enumerate().map(log).collect()
}

/// What an input of a robot or a station does: a few levels, or anything between two values.
enum Moves {
    Levels(&'static [f64]),
    Between(f64, f64),
}

/// Plausible values of each input; an input that is not listed moves between 0 and 1.
fn moves(channel: Channel) -> Moves {
    match channel {
        Channel::VoltageV | Channel::PackVoltageV => Moves::Between(9.3, 12.6),
        Channel::TemperatureDegc | Channel::AmbientDegc => Moves::Between(-5.0, 45.0),
        Channel::CurrentA | Channel::PackCurrentA => Moves::Between(0.0, 5.0),
        Channel::Soc => Moves::Between(0.1, 1.0),
        Channel::CycleCount => Moves::Between(0.0, 1000.0),
        Channel::AgeDays => Moves::Between(0.0, 1000.0),
        Channel::SpeedMps => Moves::Levels(&[0.0, 0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.52]),
        Channel::AccelMps2 => Moves::Levels(&[0.0, 0.0, 0.0, 0.2, 0.5, -0.2, -0.5]),
        Channel::PitchRad => Moves::Levels(&[0.0, 0.0, 0.05, 0.1, 0.2, -0.05, -0.2]),
        Channel::PayloadKg => Moves::Levels(&[0.0, 0.0, 0.2, 0.5]),
        Channel::YawRateRadps => Moves::Levels(&[0.0, 0.0, 0.3, 0.8, 1.5, -0.5, -1.5]),
        Channel::CpuMhz => Moves::Levels(&[104.0, 156.0, 208.0, 312.0, 416.0]),
        Channel::RadioTxDbm => Moves::Levels(&[0.0, 5.0, 10.0, 15.0, 20.0]),
        Channel::CameraOn | Channel::LiftActive | Channel::SelectorEvents => Moves::Levels(&[0.0, 1.0]),
        Channel::TailAngleRad => Moves::Between(-0.6, 0.6),
        Channel::FloorClass => Moves::Levels(&[0.0, 1.0, 2.0, 3.0]),
        Channel::ChargePowerW => Moves::Levels(&[0.0, 0.0, 5.0, 15.0, 30.0, 45.0, 60.0]),
        Channel::RobotsDocked => Moves::Levels(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        Channel::RobotsCharging => Moves::Levels(&[0.0, 1.0, 2.0, 3.0, 4.0]),
        Channel::BaySquaredCurrentA2 => Moves::Levels(&[0.0, 0.5, 1.7, 3.5, 7.0]),
        _ => Moves::Between(0.0, 1.0),
    }
}

/// A robot that tries everything, or a station with every load: all inputs move by themselves,
/// so that no two loads are always on together.
fn drives(system: System) -> Vec<Log> {
    let mut random = Pcg64Mcg::seed_from_u64(21);
    let inputs: Vec<Channel> = Channel::ALL.iter().copied().filter(|channel| !system.computed().contains(channel)).collect();
    let mut log = |dt_s: f64| {
        let mut held: Vec<(Channel, f64)> = inputs.iter().map(|&channel| (channel, 0.0)).collect();
        let mut rows = Vec::new();
        for row in 0..1500 {
            for (channel, value) in &mut held {
                if row == 0 || random.random_bool(0.2) {
                    *value = match moves(*channel) {
                        Moves::Levels(levels) => levels[random.random_range(0..levels.len())],
                        Moves::Between(low, high) => random.random_range(low..high),
                    };
                }
            }
            rows.push(Row { dt_s, inputs: held.clone() });
        }
        Log { start: Start::at_soc(1.0), rows }
    };
    vec![log(1.0), log(1.0), log(5.0), log(20.0)]
}
