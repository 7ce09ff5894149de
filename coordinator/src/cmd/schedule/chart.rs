//! Who is where when, as a Gantt chart: in the terminal or as SVG. A row per bay and place for exchanges.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use proto::{Mode, Schedule, Service, Timestamp};

use super::tell::{begin, finish};
use crate::when::second_from;

/// Columns of the chart in the terminal.
const COLUMNS: usize = 96;
/// Size of the drawing, px: its width, that of the names, the height of a row.
const WIDTH: f64 = 1000.0;
const NAMES: f64 = 160.0;
const ROW: f64 = 28.0;

/// Services by the place where they happen, and from when to when that is.
struct Chart<'a> {
    rows: BTreeMap<String, Vec<&'a Service>>,
    from: Timestamp,
    to: Timestamp,
    /// When the plan was made.
    seen: Timestamp,
}

impl<'a> Chart<'a> {
    fn new(schedule: &'a Schedule) -> Option<Self> {
        let mut rows: BTreeMap<String, Vec<&Service>> = BTreeMap::new();
        for service in &schedule.services {
            let place = match (&service.mode, &service.bay) {
                (Mode::Swap { .. }, _) | (_, None) => format!("{} exchange", service.station),
                (_, Some(bay)) => format!("{} {bay}", service.station),
            };
            rows.entry(place).or_default().push(service);
        }
        let from = schedule.services.iter().map(leaves).min()?.min(schedule.at);
        let to = schedule.services.iter().map(|service| service.end).max()?;
        Some(Self { rows, from, to: to.max(from.plus_s(60.0)), seen: schedule.at })
    }

    /// Where a time lies, from 0 to 1.
    fn share(&self, at: Timestamp) -> f64 {
        (at.seconds_since(self.from) / self.to.seconds_since(self.from)).clamp(0.0, 1.0)
    }
}

/// When a robot leaves its work. Who is said to do so only after its begin is drawn without a way.
fn leaves(service: &Service) -> Timestamp {
    service.leave.min(service.start)
}

/// Prints the chart.
pub(super) fn show(schedule: &Schedule) {
    if !begin(schedule) {
        return;
    }
    match Chart::new(schedule) {
        Some(chart) => crate::cmd::say_text(&terminal(&chart)),
        None => say!("no service is planned"),
    }
    finish(schedule);
}

fn terminal(chart: &Chart<'_>) -> String {
    let names = chart.rows.keys().map(|name| name.chars().count()).max().unwrap_or(0);
    let column = |at: Timestamp| (chart.share(at) * (COLUMNS - 1) as f64).round() as usize;
    let (from, to) = (second_from(chart.seen, chart.from), second_from(chart.seen, chart.to));
    let mut text = format!("{:names$}  {from}{:>width$}\n", "", to, width = COLUMNS - from.len());
    for (place, services) in &chart.rows {
        let mut line = vec!['·'; COLUMNS];
        for service in services {
            let [leave, start, end] = [leaves(service), service.start, service.end].map(column);
            line[leave..start].fill('-');
            line[start..=end].fill('█');
            // The name stands in the bar, and beyond it where nothing else stands.
            for (cell, letter) in line[start + 1..].iter_mut().zip(service.robot.to_string().chars()) {
                if *cell == '·' || *cell == '█' {
                    *cell = letter;
                }
            }
        }
        let line: String = line.into_iter().collect();
        let _ = writeln!(text, "{place:names$}  {line}");
    }
    text
}

/// The chart as SVG.
pub(super) fn svg(schedule: &Schedule) -> String {
    let rows = Chart::new(schedule);
    let count = rows.as_ref().map_or(0, |chart| chart.rows.len());
    let height = ROW * (count as f64 + 2.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n\
         <text x=\"8\" y=\"18\" fill=\"#333333\">plan {} by {} at {}</text>\n",
        schedule.plan, schedule.policy, schedule.at
    );
    let Some(chart) = rows else { return svg + "</svg>\n" };
    let x = |at: Timestamp| NAMES + chart.share(at) * (WIDTH - NAMES - 16.0);
    for (place, services) in &chart.rows {
        let row = chart.rows.keys().take_while(|name| *name != place).count();
        let top = ROW * (row as f64 + 1.0);
        let base = top + ROW * 0.62;
        let _ = writeln!(svg, "<text x=\"8\" y=\"{base:.1}\" fill=\"#333333\">{place}</text>");
        let line = top + ROW - 2.0;
        let _ = writeln!(svg, "<line x1=\"{NAMES}\" x2=\"{WIDTH}\" y1=\"{line:.1}\" y2=\"{line:.1}\" stroke=\"#dddddd\"/>");
        for service in services {
            let [leave, start, end] = [leaves(service), service.start, service.end].map(x);
            let colour = if matches!(service.mode, Mode::Swap { .. }) { "#f4a582" } else { "#92c5de" };
            let (y, tall, middle) = (top + 4.0, ROW - 10.0, top + ROW / 2.0 - 1.0);
            let _ = writeln!(
                svg,
                "<line x1=\"{leave:.1}\" x2=\"{start:.1}\" y1=\"{middle:.1}\" y2=\"{middle:.1}\" stroke=\"#888888\" stroke-dasharray=\"3 3\"/>\n\
                 <rect x=\"{start:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{tall:.1}\" fill=\"{colour}\" stroke=\"#4393c3\">\
                 <title>{}: {} to {}</title></rect>\n\
                 <text x=\"{:.1}\" y=\"{base:.1}\" fill=\"#111111\">{}</text>",
                (end - start).max(2.0),
                service.robot,
                second_from(chart.seen, service.start),
                second_from(chart.seen, service.end),
                start + 4.0,
                service.robot
            );
        }
    }
    let y = ROW * (count as f64 + 1.6);
    let _ = writeln!(svg, "<text x=\"{NAMES}\" y=\"{y:.1}\" fill=\"#666666\">{}</text>", second_from(chart.seen, chart.from));
    let end = WIDTH - 16.0;
    let _ =
        writeln!(svg, "<text x=\"{end}\" y=\"{y:.1}\" text-anchor=\"end\" fill=\"#666666\">{}</text>", second_from(chart.seen, chart.to));
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use proto::{Estimate, ServiceStatus};

    use super::*;
    use crate::store::tests::schedule;

    /// A service that says when it leaves, starts and ends, s after the plan was made.
    fn service([leave_s, start_s, end_s]: [f64; 3]) -> Schedule {
        let plan = schedule(1);
        let at = |after_s: f64| plan.at.plus_s(after_s);
        let service = Service {
            robot: "r1".parse().unwrap(),
            station: "north".parse().unwrap(),
            mode: Mode::Recharge { to_soc: 1.0 },
            bay: Some("b1".parse().unwrap()),
            packs: Vec::new(),
            leave: at(leave_s),
            start: at(start_s),
            end: at(end_s),
            pack_energy_wh: Estimate::new(20.0, 1.0),
            probability: None,
            status: ServiceStatus::Planned,
            why: Vec::new().into(),
        };
        Schedule { services: vec![service], ..plan }
    }

    #[test]
    fn a_way_leads_up_to_the_bar_and_one_that_begins_after_it_is_left_out() {
        let bars = |times: [f64; 3]| terminal(&Chart::new(&service(times)).unwrap()).lines().nth(1).unwrap().replace('·', " ");
        let told = bars([475.0, 950.0, 1900.0]);
        assert!(told.contains("-----█r1████") && !told.contains("█-"), "{told}");
        let (late, early) = (service([1_500.0, 950.0, 1_900.0]), bars([1_500.0, 950.0, 1_900.0]));
        assert!(early.contains("  █r1████") && !early.contains('-'), "{early}");
        let drawing = svg(&late);
        let line = drawing.lines().find(|line| line.contains("stroke-dasharray")).unwrap();
        let x = |name: &str| line.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().to_owned();
        assert_eq!(x("x1"), x("x2"), "{line}");
    }
}
