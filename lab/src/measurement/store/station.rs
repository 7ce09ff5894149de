//! What a station told of itself, with the power that flowed into the robots it charged.

use std::collections::BTreeMap;

use proto::{BayPhase, BayState, PackId, StationState, Timestamp, decode};
use sqlx::{FromRow, query_as};

use super::{PAGE, Source, count_row, seconds};
use crate::measurement::{LogError, Table};

const STATES: &str = "SELECT at_ms, seq, body FROM station_states WHERE station = $1 AND at_ms BETWEEN $2 AND $3 \
                      AND (at_ms, seq) > ($4, $5) ORDER BY at_ms, seq LIMIT $6";
/// In the order in which pages of states are gone through.
const POWERS: &str = "SELECT robot, at_ms, voltage_v, current_a FROM robot_gauges WHERE at_ms > $1 AND at_ms <= $2 ORDER BY at_ms";
const VOLTAGES: &str = "SELECT pack, at_ms, voltage_v FROM pack_gauges WHERE station = $1 AND at_ms > $2 AND at_ms <= $3 ORDER BY at_ms";
const NAMES: &str = "SELECT DISTINCT station FROM station_states ORDER BY station";
const ENDS: &str = "SELECT min(at_ms), max(at_ms) FROM station_states WHERE station = $1";

/// After a change in its bays a station's messages and those of its robots disagree for a while: its power is then not compared, ms. As long as
/// the coordinator's own watch leaves out.
const SETTLES_MS: i64 = 5_000;
/// Gauges report less often than stations do: the last report of a robot stands for this long, ms.
const STANDS_MS: i64 = 30_000;

#[derive(FromRow)]
struct State {
    at_ms: i64,
    seq: i64,
    body: String,
}

const COLUMNS: [&str; 8] = [
    "time_s",
    "pack_power_w",
    "charge_power_w",
    "robots_docked",
    "robots_charging",
    "bay_squared_current_a2",
    "lift_active",
    "pack_voltage_v",
];

/// What gauges last told.
#[derive(Default)]
struct Told {
    /// Of robots: when, voltage, V, and the current into their battery, A.
    robots: BTreeMap<String, (i64, f64, f64)>,
    /// Of the station's packs: when, and voltage, V.
    packs: BTreeMap<String, (i64, f64)>,
}

/// What of a station's state moves its power at once, and since when that is as it is.
#[derive(Default)]
struct Settled {
    told: Option<(Vec<BayState>, [bool; 3], Option<PackId>)>,
    from_ms: i64,
}

impl Settled {
    /// Whether a state's power is that of what it tells.
    fn holds(&mut self, at_ms: i64, state: &StationState) -> bool {
        let told = (state.bays.clone(), [state.lift_busy, state.swapping.is_some(), state.powered], state.active_pack.clone());
        if self.told.as_ref().is_some_and(|before| *before != told) {
            self.from_ms = at_ms.saturating_add(SETTLES_MS);
        }
        self.told = Some(told);
        at_ms >= self.from_ms
    }
}

impl Source {
    /// The log of one station, and its first instant.
    pub(super) async fn station(&mut self, name: &str, (from_ms, to_ms): (i64, i64)) -> Result<(Table, Timestamp), LogError> {
        let mut table = Table::of(COLUMNS.iter().map(|&name| name.to_owned()).collect(), "rows");
        let mut begin_ms = None;
        let mut after = (i64::MIN, i64::MIN);
        let (mut last_told, mut settled) = (Told::default(), Settled { told: None, from_ms: i64::MIN });
        loop {
            let page =
                query_as::<_, State>(STATES).bind(name.to_owned()).bind(from_ms).bind(to_ms).bind(after.0).bind(after.1).bind(PAGE / 10);
            let page = page.fetch_all(&mut self.connection).await.map_err(|error| self.failed(&error))?;
            let (Some(first), Some(last)) = (page.first(), page.last()) else { break };
            let told_from_ms = if after.0 == i64::MIN { first.at_ms.saturating_sub(STANDS_MS) } else { after.0 };
            let told = query_as::<_, (String, i64, f64, f64)>(POWERS).bind(told_from_ms).bind(last.at_ms);
            let told = told.fetch_all(&mut self.connection).await.map_err(|error| self.failed(&error))?;
            let mut told = told.into_iter().peekable();
            let voltages = query_as::<_, (String, i64, f64)>(VOLTAGES).bind(name.to_owned()).bind(told_from_ms).bind(last.at_ms);
            let voltages = voltages.fetch_all(&mut self.connection).await.map_err(|error| self.failed(&error))?;
            let mut voltages = voltages.into_iter().peekable();
            after = (last.at_ms, last.seq);
            for state in &page {
                while let Some((robot, at_ms, voltage_v, current_a)) = told.next_if(|(_, at_ms, ..)| *at_ms <= state.at_ms) {
                    last_told.robots.insert(robot, (at_ms, voltage_v, -current_a));
                }
                while let Some((pack, at_ms, voltage_v)) = voltages.next_if(|(_, at_ms, _)| *at_ms <= state.at_ms) {
                    last_told.packs.insert(pack, (at_ms, voltage_v));
                }
                let begin_ms = *begin_ms.get_or_insert(state.at_ms);
                let cells = self.cells(begin_ms, state, (&last_told, &mut settled), table.lines.len() as u64 + 1)?;
                table.columns.iter_mut().zip(cells).for_each(|(column, value)| column.push(value));
                count_row(&self.file, &mut table)?;
            }
        }
        match begin_ms {
            Some(begin_ms) => Ok((table, Timestamp::from_unix_ms(begin_ms))),
            None => Err(self.no_rows("station", name, NAMES, ENDS).await),
        }
    }

    fn cells(
        &self,
        begin_ms: i64,
        row: &State,
        (told, settled): (&Told, &mut Settled),
        number: u64,
    ) -> Result<[f64; COLUMNS.len()], LogError> {
        let state: StationState = decode(row.body.as_bytes()).map_err(|error| LogError::Row {
            file: self.file.clone(),
            line: number,
            message: format!("station_states: {error}"),
        })?;
        let stands = |at_ms: i64| row.at_ms.saturating_sub(at_ms) <= STANDS_MS;
        let (mut docked, mut charging, mut into_w, mut squared_a2) = (0.0, 0.0, 0.0, 0.0);
        // On the lift on its way out it still hangs on the bay.
        let here = state.bays.iter().filter(|bay| matches!(bay.phase, BayPhase::Occupied | BayPhase::Unloading));
        for robot in here.filter_map(|bay| bay.robot.as_ref()) {
            docked += 1.0;
            match told.robots.get(robot.as_str()) {
                Some(&(at_ms, voltage_v, current_a)) if stands(at_ms) => {
                    let current_a = current_a.max(0.0);
                    into_w += voltage_v * current_a;
                    squared_a2 += current_a * current_a;
                    charging += f64::from(u8::from(current_a > 0.0));
                }
                // A robot that says nothing may charge all the same.
                _ => (into_w, squared_a2) = (f64::NAN, f64::NAN),
            }
        }
        // In the dark nothing is drawn, whatever would be; what driving takes is no share of a service.
        let tells = settled.holds(row.at_ms, &state) && state.powered && state.arrives.is_none();
        let power_w = if tells { state.pack_power_w } else { f64::NAN };
        let lift = f64::from(u8::from(state.lift_busy || state.swapping.is_some()));
        let active = state.active_pack.as_ref().and_then(|pack| told.packs.get(pack.as_str()));
        let pack_v = active.filter(|(at_ms, _)| stands(*at_ms)).map_or(f64::NAN, |(_, voltage_v)| *voltage_v);
        Ok([seconds(begin_ms, row.at_ms), power_w, into_w, docked, charging, squared_a2, lift, pack_v])
    }
}
