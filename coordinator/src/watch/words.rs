//! What is said of a doubt, and what to run to find out what the model lacks.

use std::sync::Arc;

use energy::Model;
use proto::{Doubt, NamedModel, Timestamp};

use super::Subject;
use super::cusum::{Raised, TOLD_MAX};
use crate::fleet::Fleet;
use crate::models::{Kept, Models};
use crate::when::minute_from;

/// What comes before the command in the text of a doubt: what comes after depends on where this process runs.
pub(crate) const BEFORE_COMMAND: &str = "run `";
/// Where logs would be that nobody has kept.
const NO_FOLDER: &str = "logs";

/// The doubt in a model, in words that are told at `now`.
pub(super) fn doubt(now: Timestamp, subject: &Subject, raised: Raised, fleet: &Fleet, models: &Models) -> Doubt {
    let Raised { since, z } = raised;
    let command = command(subject, raised, fleet, models);
    let began = minute_from(now, since);
    let z_text = if z.abs() < TOLD_MAX { format!("= {z:.1}") } else { format!("{} {z:.1}", if z > 0.0 { ">=" } else { "<=" }) };
    let first = match (&models.kept, subject) {
        (Kept::Nowhere, _) => format!("simulate it again with --telemetry {NO_FOLDER}, and "),
        (Kept::Store(_), Subject::RobotWork(_) | Subject::RobotWay(_)) => "with its own log, which an agent keeps with --log, ".to_owned(),
        _ => String::new(),
    };
    let text = format!("{subject} no longer explains its data since {began} (residual z {z_text}): {first}{BEFORE_COMMAND}{command}`");
    let (robot, station, pack) = subject.ids();
    Doubt { robot: robot.cloned(), station: station.cloned(), pack: pack.cloned(), since, z, text, command }
}

/// What finds out what the model lacks.
fn command(subject: &Subject, raised: Raised, fleet: &Fleet, models: &Models) -> String {
    let (model, whose, log) = match subject {
        Subject::RobotBattery(id) => {
            let name = fleet.robots.get(id).and_then(|robot| robot.state.as_ref()).map_or("", |state| &state.battery);
            (battery(models.battery(id, name), name, models), format!("--robot {id}"), id.to_string())
        }
        // What a robot does is in its own logs: its messages do not tell.
        Subject::RobotWork(id) | Subject::RobotWay(id) => {
            let load = fleet.robots.get(id).and_then(|robot| robot.state.as_ref()).and_then(|state| state.load.clone());
            (load, String::new(), format!("{id}-load"))
        }
        Subject::Pack(id, pack) => {
            let model = models.stations.get(id).and_then(|station| station.packs.get(pack));
            (battery(model, "", models), format!("--station {id} --pack {pack}"), format!("{id}-{pack}"))
        }
        Subject::Station(id) => {
            let load = models.stations.get(id).map(|station| models.name_of(&station.load));
            (load, format!("--station {id}"), id.to_string())
        }
    };
    let model = model.map_or_else(|| "LOAD.toml".to_owned(), |model| arguments(&model));
    let of = match &models.kept {
        Kept::Store(store) if !whose.is_empty() => {
            format!("--store {} {whose} --from {}", quoted(store), raised.since)
        }
        Kept::Logs(folder) => format!("--log {}", quoted(&format!("{folder}/{log}.csv"))),
        Kept::Nowhere => format!("--log {NO_FOLDER}/{log}.csv"),
        Kept::Store(_) => format!("--log {log}.csv"),
    };
    format!("lab discover --model {model} {of}")
}

fn battery(model: Option<&Arc<Model>>, name: &str, models: &Models) -> Option<NamedModel> {
    Some(model.map_or_else(|| NamedModel { model: name.to_owned(), without: Vec::new() }, |model| models.name_of(model)))
}

/// A model as `lab` takes it.
fn arguments(model: &NamedModel) -> String {
    let without = model.without.iter().map(|effect| format!(" --without {}", quoted(effect)));
    std::iter::once(quoted(&model.model)).chain(without).collect()
}

/// One word of a command, whatever is in it.
fn quoted(word: &str) -> String {
    shlex::try_quote(word).map_or_else(|_| "?".to_owned(), std::borrow::Cow::into_owned)
}

#[cfg(test)]
mod tests {
    use proto::{RobotId, RobotState, StationId, Timestamp};

    use super::*;
    use crate::fleet::Robot;

    const SINCE: &str = "2026-01-01T14:05:00.000Z";

    fn told(subject: &Subject, z: f64, models: &Models) -> Doubt {
        let state = RobotState {
            load: Some(NamedModel { model: "bot's load.toml".to_owned(), without: vec!["radio".to_owned(), "gps".to_owned()] }),
            ..crate::watch::power::tests::state(0, proto::RobotPhase::Working)
        };
        let mut fleet = Fleet::default();
        let robot = Robot { state: Some(state), ..Robot::default() };
        fleet.robots.insert("r".parse().unwrap(), robot);
        let since: Timestamp = SINCE.parse().unwrap();
        doubt(since, subject, Raised { since, z }, &fleet, models)
    }

    fn kept(kept: Kept) -> Models {
        let battery = Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap());
        let named = NamedModel { model: "models/own pack.toml".to_owned(), without: vec!["*".to_owned()] };
        let robot: RobotId = "r".parse().unwrap();
        Models { robots: [(robot, Arc::clone(&battery))].into(), named: vec![(battery, named)], kept, ..Models::default() }
    }

    #[test]
    fn a_command_names_the_model_as_it_was_given_and_where_its_measurements_are() {
        let battery = Subject::RobotBattery("r".parse().unwrap());
        let model = "lab discover --model 'models/own pack.toml' --without '*'";
        let store = told(&battery, 6.1, &kept(Kept::Store("my store.db".to_owned())));
        assert_eq!(store.command, format!("{model} --store 'my store.db' --robot r --from {SINCE}"));
        let head = "the battery model of r no longer explains its data since 14:05 (residual z = 6.1)";
        assert_eq!(store.text, format!("{head}: run `{}`", store.command));
        let logs = told(&battery, 6.1, &kept(Kept::Logs("run 1".to_owned())));
        assert_eq!(logs.command, format!("{model} --log 'run 1/r.csv'"));
        let nowhere = told(&battery, 6.1, &kept(Kept::Nowhere));
        assert_eq!(nowhere.text, format!("{head}: simulate it again with --telemetry logs, and run `{model} --log logs/r.csv`"));
    }

    #[test]
    fn what_a_robot_does_is_in_its_own_log_and_its_model_is_the_one_that_it_names() {
        let work = Subject::RobotWork("r".parse().unwrap());
        let doubt = told(&work, -99.9, &kept(Kept::Store("site.db".to_owned())));
        assert_eq!(doubt.command, "lab discover --model \"bot's load.toml\" --without radio --without gps --log r-load.csv");
        assert!(
            doubt.text.contains("(residual z <= -99.9): with its own log, which an agent keeps with --log, run `lab"),
            "{}",
            doubt.text
        );
        // A robot whose drain is measured names none.
        let other = Subject::RobotWay("other".parse().unwrap());
        assert!(told(&other, 9.0, &kept(Kept::Logs("logs".to_owned()))).command.contains("--model LOAD.toml --log logs/other-load.csv"));
    }

    #[test]
    fn a_station_that_nobody_configured_has_no_model_to_name() {
        let id: StationId = "mds".parse().unwrap();
        let doubt = told(&Subject::Station(id), 9.0, &kept(Kept::Store("site.db".to_owned())));
        assert_eq!(doubt.command, format!("lab discover --model LOAD.toml --store site.db --station mds --from {SINCE}"));
    }
}
