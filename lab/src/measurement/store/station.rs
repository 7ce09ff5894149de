//! What a station told of itself, with the power that flowed into the robots it charged.

use std::collections::BTreeMap;

use proto::{BayPhase, StationState, Timestamp, decode};
use sqlx::{FromRow, query_as};

use super::{PAGE, Source, count_row, seconds};
use crate::measurement::{LogError, Table};

const STATES: &str = "SELECT at_ms, seq, body FROM station_states WHERE station = $1 AND at_ms BETWEEN $2 AND $3 \
                      AND (at_ms, seq) > ($4, $5) ORDER BY at_ms, seq LIMIT $6";
/// In the order in which pages of states are gone through.
const POWERS: &str = "SELECT robot, at_ms, voltage_v, current_a FROM robot_gauges WHERE at_ms > $1 AND at_ms <= $2 ORDER BY at_ms";
const NAMES: &str = "SELECT DISTINCT station FROM station_states ORDER BY station";
const ENDS: &str = "SELECT min(at_ms), max(at_ms) FROM station_states WHERE station = $1";

/// Gauges report less often than stations do: the last report of a robot stands for this long, ms.
const STANDS_MS: i64 = 30_000;

#[derive(FromRow)]
struct State {
    at_ms: i64,
    seq: i64,
    body: String,
}

const COLUMNS: [&str; 6] = ["time_s", "pack_power_w", "charge_power_w", "robots_docked", "robots_charging", "lift_active"];

/// What robots last told: when, and the power into their battery, W.
type Powers = BTreeMap<String, (i64, f64)>;

impl Source {
    /// The log of one station, and its first instant.
    pub(super) async fn station(&mut self, name: &str, (from_ms, to_ms): (i64, i64)) -> Result<(Table, Timestamp), LogError> {
        let mut table = Table::of(COLUMNS.iter().map(|&name| name.to_owned()).collect(), "rows");
        let mut begin_ms = None;
        let mut after = (i64::MIN, i64::MIN);
        let mut powers = Powers::new();
        loop {
            let page = query_as::<_, State>(STATES).bind(name).bind(from_ms).bind(to_ms).bind(after.0).bind(after.1).bind(PAGE / 10);
            let page = page.fetch_all(&mut self.connection).await.map_err(|error| self.failed(&error))?;
            let (Some(first), Some(last)) = (page.first(), page.last()) else { break };
            let told_from_ms = if after.0 == i64::MIN { first.at_ms.saturating_sub(STANDS_MS) } else { after.0 };
            let told = query_as::<_, (String, i64, f64, f64)>(POWERS).bind(told_from_ms).bind(last.at_ms);
            let told = told.fetch_all(&mut self.connection).await.map_err(|error| self.failed(&error))?;
            let mut told = told.into_iter().peekable();
            after = (last.at_ms, last.seq);
            for state in &page {
                while let Some((robot, at_ms, voltage_v, current_a)) = told.next_if(|(_, at_ms, ..)| *at_ms <= state.at_ms) {
                    powers.insert(robot, (at_ms, -voltage_v * current_a));
                }
                let begin_ms = *begin_ms.get_or_insert(state.at_ms);
                let cells = self.cells(begin_ms, state, &powers, table.lines.len() as u64 + 1)?;
                table.columns.iter_mut().zip(cells).for_each(|(column, value)| column.push(value));
                count_row(&self.file, &mut table)?;
            }
        }
        match begin_ms {
            Some(begin_ms) => Ok((table, Timestamp::from_unix_ms(begin_ms))),
            None => Err(self.no_rows("station", name, NAMES, ENDS).await),
        }
    }

    fn cells(&self, begin_ms: i64, row: &State, powers: &Powers, number: u64) -> Result<[f64; COLUMNS.len()], LogError> {
        let state: StationState = decode(row.body.as_bytes()).map_err(|error| LogError::Row {
            file: self.file.clone(),
            line: number,
            message: format!("station_states: {error}"),
        })?;
        let (mut docked, mut charging, mut into_w) = (0.0, 0.0, 0.0);
        let occupied = state.bays.iter().filter(|bay| bay.phase == BayPhase::Occupied);
        for robot in occupied.filter_map(|bay| bay.robot.as_ref()) {
            docked += 1.0;
            match powers.get(robot.as_str()) {
                Some((at_ms, power_w)) if row.at_ms.saturating_sub(*at_ms) <= STANDS_MS => {
                    into_w += power_w.max(0.0);
                    charging += f64::from(u8::from(*power_w > 0.0));
                }
                // A robot that says nothing may charge all the same.
                _ => into_w = f64::NAN,
            }
        }
        let time_s = seconds(begin_ms, row.at_ms);
        Ok([time_s, state.pack_power_w, into_w, if state.powered { docked } else { 0.0 }, charging, f64::from(u8::from(state.lift_busy))])
    }
}
