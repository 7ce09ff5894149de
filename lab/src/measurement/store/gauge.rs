//! What the gauge of one battery told.

use proto::{RobotPhase, Timestamp};
use sqlx::{FromRow, query_as};

use super::{PAGE, Source, count_row, seconds};
use crate::measurement::{GaugeStart, LogError, Table};

/// How the gauges of one kind of battery are asked for. The battery is named by two parts, of
/// which a robot needs only the second.
pub(super) struct Gauges {
    what: &'static str,
    page: &'static str,
    names: &'static str,
    ends: &'static str,
}

pub(super) const OF_ROBOT: Gauges = Gauges {
    what: "robot",
    page: "SELECT g.at_ms, g.seq, g.current_a, g.voltage_v, g.temperature_degc, g.soc, g.soc_sigma, g.power_w, \
           (SELECT s.phase FROM robot_states s WHERE s.robot = g.robot AND s.at_ms <= g.at_ms ORDER BY s.at_ms DESC, s.seq DESC LIMIT 1) AS phase \
           FROM robot_gauges g WHERE $1 = $1 AND g.robot = $2 AND g.at_ms BETWEEN $3 AND $4 AND (g.at_ms, g.seq) > ($5, $6) \
           ORDER BY g.at_ms, g.seq LIMIT $7",
    names: "SELECT DISTINCT robot FROM robot_gauges ORDER BY robot",
    ends: "SELECT min(at_ms), max(at_ms) FROM robot_gauges WHERE robot = $1",
};

pub(super) const OF_PACK: Gauges = Gauges {
    what: "pack",
    page: "SELECT at_ms, seq, current_a, voltage_v, temperature_degc, soc, soc_sigma, power_w, NULL AS phase \
           FROM pack_gauges WHERE station = $1 AND pack = $2 AND at_ms BETWEEN $3 AND $4 AND (at_ms, seq) > ($5, $6) \
           ORDER BY at_ms, seq LIMIT $7",
    names: "SELECT DISTINCT pack FROM pack_gauges ORDER BY pack",
    ends: "SELECT min(at_ms), max(at_ms) FROM pack_gauges WHERE pack = $1",
};

#[derive(FromRow)]
struct Row {
    at_ms: i64,
    seq: i64,
    current_a: f64,
    voltage_v: f64,
    temperature_degc: f64,
    soc: f64,
    soc_sigma: f64,
    power_w: f64,
    phase: Option<String>,
}

/// The power that a gauge tells is a mean over the recent past; that of the row is made of its
/// own voltage and current.
const COLUMNS: [&str; 8] = ["time_s", "current_a", "voltage_v", "temperature_degc", "power_w", "soc", "gauge_mean_power_w", "phase"];

/// What one battery told, without a break by an exchange.
struct Stretch {
    table: Table,
    begin_ms: i64,
    end_ms: i64,
}

impl Stretch {
    fn of(row: &Row, with_phase: bool) -> Stretch {
        let columns = COLUMNS.iter().take(if with_phase { COLUMNS.len() } else { COLUMNS.len() - 1 });
        let mut table = Table::of(columns.map(|&name| name.to_owned()).collect(), "rows");
        table.start = Some(GaugeStart { soc: row.soc, sigma: row.soc_sigma });
        Stretch { table, begin_ms: row.at_ms, end_ms: row.at_ms }
    }

    fn push(&mut self, row: &Row) {
        let (time_s, power_w) = (seconds(self.begin_ms, row.at_ms), row.voltage_v * row.current_a);
        let cells = [time_s, row.current_a, row.voltage_v, row.temperature_degc, power_w, row.soc, row.power_w];
        self.table.columns.iter_mut().zip(cells).for_each(|(column, value)| column.push(value));
        if let Some(column) = self.table.columns.get_mut(COLUMNS.len() - 1) {
            match &row.phase {
                Some(phase) => column.push_text(phase),
                None => column.push(f64::NAN),
            }
        }
        self.end_ms = row.at_ms;
    }

    fn rows(&self) -> usize {
        self.table.lines.len()
    }
}

impl Source {
    /// The log of one battery, and its first instant. Where a robot's was exchanged meanwhile, the longest stretch of one battery.
    pub(super) async fn gauges(
        &mut self,
        gauges: Gauges,
        (station, name): (&str, &str),
        (from_ms, to_ms): (i64, i64),
    ) -> Result<(Table, Timestamp), LogError> {
        let with_phase = gauges.what == "robot";
        let swapping = RobotPhase::Swapping.to_string();
        let (mut longest, mut stretch): (Option<Stretch>, Option<Stretch>) = (None, None);
        let (mut exchanged_ms, mut in_exchange) = (Vec::new(), 0_usize);
        let mut after = (i64::MIN, i64::MIN);
        let longer = |one: Option<Stretch>, other: Option<Stretch>| match (one, other) {
            (Some(one), Some(other)) if other.rows() > one.rows() => Some(other),
            (one, other) => one.or(other),
        };
        loop {
            let page = query_as::<_, Row>(gauges.page).bind(station.to_owned()).bind(name.to_owned()).bind(from_ms).bind(to_ms);
            let page = page.bind(after.0).bind(after.1).bind(PAGE).fetch_all(&mut self.connection).await;
            let page = page.map_err(|error| self.failed(&error))?;
            let Some(last) = page.last() else { break };
            after = (last.at_ms, last.seq);
            for row in &page {
                // Which of the two batteries spoke during an exchange nobody knows.
                if row.phase.as_ref() == Some(&swapping) {
                    in_exchange += 1;
                    if let Some(done) = stretch.take() {
                        exchanged_ms.push(row.at_ms);
                        longest = longer(longest, Some(done));
                    }
                    continue;
                }
                let stretch = stretch.get_or_insert_with(|| Stretch::of(row, with_phase));
                stretch.push(row);
                count_row(&self.file, &mut stretch.table)?;
            }
        }
        let Some(Stretch { mut table, begin_ms, end_ms }) = longer(longest, stretch) else {
            if in_exchange > 0 {
                return Err(self.whole(format!(
                    "all {in_exchange} rows of {} `{name}` between --from and --to are of an exchange, and it is not known of which battery",
                    gauges.what
                )));
            }
            return Err(self.no_rows(gauges.what, name, gauges.names, gauges.ends).await);
        };
        if !exchanged_ms.is_empty() {
            let [begin, end] = [begin_ms, end_ms].map(Timestamp::from_unix_ms);
            let at: Vec<String> = exchanged_ms.iter().take(TOLD).map(|&ms| Timestamp::from_unix_ms(ms).to_string()).collect();
            let more = if exchanged_ms.len() > TOLD { ", ..." } else { "" };
            table.notes.push(format!(
                "the battery was exchanged at {}{more}: these are the rows from {begin} to {end}, the longest stretch of one battery; \
                 --from and --to choose another",
                at.join(", ")
            ));
        }
        Ok((table, Timestamp::from_unix_ms(begin_ms)))
    }
}

/// Exchanges that are told one by one.
const TOLD: usize = 5;
