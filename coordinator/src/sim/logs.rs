//! What a simulated fleet writes into its logs.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use energy::{Channel, Estimate};
use node::{LOAD_INPUTS, STATION_INPUTS, Telemetry, load_columns};
use proto::{PackId, RobotId, StationId};
use robot_agent::source::{Place, RobotBody};
use station_agent::source::StationBody;

/// The first pack in a place has the place's name, the others are counted from 2.
fn battery_stem(place: &str, exchanges: u32) -> String {
    if exchanges == 0 { place.to_owned() } else { format!("{place}-pack-{}", exchanges + 1) }
}

fn pack_stem(station: &StationId, pack: &PackId, exchanges: u32) -> String {
    battery_stem(&format!("{station}-{pack}"), exchanges)
}

/// Opens the logs of a robot whose gauge starts from `soc`.
pub(super) fn open_robot(telemetry: &mut Telemetry, id: &RobotId, soc: Estimate, ambient_degc: f64) {
    telemetry.battery(id.as_ref(), 0.0, soc, ambient_degc);
    telemetry.table(&format!("{id}-load"), &load_columns());
}

/// A step's rows of a robot that was given `exchanges` packs so far.
pub(super) fn robot_rows(
    telemetry: &mut Telemetry,
    id: &RobotId,
    body: &RobotBody,
    exchanges: u32,
    seen: &robot_agent::source::Observation,
    time_s: f64,
    ambient_degc: f64,
) {
    let stem = battery_stem(id.as_ref(), exchanges);
    let Some(sample) = &seen.sample else { return };
    if let Some(soc) = seen.exchanged {
        telemetry.battery(&stem, time_s - sample.dt_s, soc, ambient_degc);
    }
    telemetry.battery_row(&stem, time_s, sample, ambient_degc);
    if seen.place != Place::InBay && !seen.depleted {
        let inputs = body.inputs(LOAD_INPUTS).map(|value| value.to_string()).join(",");
        let power_w = sample.current_a * sample.voltage_v;
        telemetry.row(&format!("{id}-load"), format_args!("{time_s},{power_w:.4},{inputs}"));
    }
}

/// The logs of one station: which pack each place has.
#[derive(Debug, Clone, Default)]
pub(super) struct StationLogs {
    exchanges: BTreeMap<PackId, u32>,
}

impl StationLogs {
    /// How many packs were exchanged.
    pub(super) fn exchanges(&self) -> u32 {
        self.exchanges.values().sum()
    }

    /// Opens the logs of the station, of its packs, and of its drive.
    pub(super) fn open(&self, telemetry: &mut Telemetry, id: &StationId, agent: &station_agent::Agent, bays: usize, ambient_degc: f64) {
        for (pack, soc) in agent.socs() {
            telemetry.battery(&pack_stem(id, pack, 0), 0.0, soc, ambient_degc);
        }
        let bays: String = (1..=bays).map(|n| format!(",bay_{n}_robot,bay_{n}_current_a,bay_{n}_voltage_v")).collect();
        let columns = STATION_INPUTS.map(Channel::name).join(",") + ",pack_current_a,pack_voltage_v,pack_power_w";
        telemetry.table(id.as_ref(), &format!("{columns}{bays}"));
    }

    /// A step's rows.
    #[allow(clippy::too_many_arguments, reason = "one step as it was seen, from every side")]
    pub(super) fn rows(
        &mut self,
        telemetry: Option<&mut Telemetry>,
        id: &StationId,
        agent: &station_agent::Agent,
        body: &StationBody,
        seen: &station_agent::source::Observation,
        time_s: f64,
        ambient_degc: f64,
    ) {
        for reading in seen.packs.iter().filter(|reading| reading.exchanged.is_some()) {
            *self.exchanges.entry(reading.pack.clone()).or_insert(0) += 1;
        }
        let Some(telemetry) = telemetry else { return };
        for reading in seen.packs.iter().filter(|reading| reading.connected) {
            let Some(sample) = &reading.sample else { continue };
            let stem = pack_stem(id, &reading.pack, self.exchanges.get(&reading.pack).copied().unwrap_or(0));
            if let Some(soc) = reading.exchanged {
                telemetry.battery(&stem, time_s - sample.dt_s, soc, ambient_degc);
            }
            telemetry.battery_row(&stem, time_s, sample, ambient_degc);
        }
        let active = seen.packs.iter().find(|reading| seen.active_pack.as_ref() == Some(&reading.pack));
        let Some(sample) = active.and_then(|reading| reading.sample).filter(|_| seen.powered) else { return };
        let (current_a, voltage_v) = (sample.current_a, sample.voltage_v);
        let power_w = current_a * voltage_v;
        if body.driving_w().is_some() {
            // The station's model does not know of driving: these rows go into a log of their own, where
            // the drive's model says all of the power as long as nobody is aboard.
            let stem = format!("{id}-drive");
            telemetry.table_once(&stem, &load_columns());
            let mut inputs = body.drive_inputs(LOAD_INPUTS);
            inputs[0] = voltage_v;
            if body.draws().next().is_none() {
                telemetry.row(&stem, format_args!("{time_s},{power_w:.4},{}", inputs.map(|value| value.to_string()).join(",")));
            }
            return;
        }
        let [charge_w, docked, charging, squared_a2, events, lift] = STATION_INPUTS.map(|channel| body.truth(channel));
        // An empty sum is -0.
        let charge_w = charge_w + 0.0;
        let mut row = format!(
            "{time_s},{charge_w:.4},{docked},{charging},{squared_a2:.5},{events},{lift},{current_a:.4},{voltage_v:.4},{power_w:.4}"
        );
        for bay in agent.bays() {
            let draw = bay.and_then(|robot| body.draws().find(|(id, _)| *id == robot).and_then(|(_, draw)| draw));
            let (current_a, voltage_v) = draw.map_or((0.0, 0.0), |draw| (draw.charge_current_a, draw.voltage_v));
            write!(row, ",{},{current_a:.4},{voltage_v:.4}", bay.map_or("", AsRef::as_ref)).expect("a text can be written to");
        }
        telemetry.row(id.as_ref(), format_args!("{row}"));
    }
}
