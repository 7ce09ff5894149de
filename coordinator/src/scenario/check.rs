//! What must hold of a scenario beyond its types.

use std::collections::BTreeSet;
use std::ops::Range;

use energy::DocumentError;
use energy::document::Document;
use energy::units::S_PER_DAY;
use toml::Spanned;

use super::expect;
use super::file::{Named, OneOrEach, PackEntry, RobotEntry, Scenario, StationEntry};
use super::places::named_by;

/// The only version of the file so far.
const SCHEMA: u32 = 1;
/// Longest run, s: a year.
const DURATION_MAX_S: f64 = 365.0 * S_PER_DAY;
/// Most bays or robots in one entry.
const COUNT_MAX: u32 = 100_000;

impl Scenario {
    /// Checks what types cannot.
    ///
    /// # Errors
    /// Names the line, the key and what is allowed.
    pub(super) fn check(&self, document: &Document<'_>) -> Result<(), DocumentError> {
        if *self.schema.get_ref() != SCHEMA {
            let message = format!("schema = {}: this program reads schema = {SCHEMA}", self.schema.get_ref());
            return Err(document.error_at(self.schema.span(), message));
        }
        let duration_s = *self.duration_s.get_ref();
        if !(duration_s > 0.0 && duration_s <= DURATION_MAX_S) {
            let message = format!("duration_s = {duration_s}: must be above 0 and at most {DURATION_MAX_S}");
            return Err(document.error_at(self.duration_s.span(), message));
        }
        if !(-60.0..=100.0).contains(&self.temperature_degc) {
            return Err(document.error(format!("temperature_degc = {}: must be between -60 and 100", self.temperature_degc)));
        }
        self.publish.check().map_err(|error| document.error(error.to_string()))?;
        if let Some(policy) = &self.policy {
            policy.get_ref().settings().map_err(|error| document.error_at(policy.span(), format!("{error:#}")))?;
        }
        let mut ids = BTreeSet::new();
        let place =
            |message: &str, list: &str, index: usize, entry: Range<usize>| named_by(message, document.text, list, index).unwrap_or(entry);
        for (index, station) in self.station.iter().enumerate() {
            let at = |message: String| document.error_at(place(&message, "station", index, station.span()), message);
            check_station(station.get_ref()).map_err(at)?;
            let in_it = |message: String| at(format!("station {}: {message}", station.get_ref().id));
            station.get_ref().models().try_for_each(|named| check_model(&named)).map_err(in_it)?;
            if !ids.insert(station.get_ref().id.to_string()) {
                return Err(at(format!("station {} appears twice", station.get_ref().id)));
            }
        }
        let stations: Vec<&str> = self.station.iter().map(|station| station.get_ref().id.as_ref()).collect();
        let mut ids = BTreeSet::new();
        for (index, robot) in self.robot.iter().enumerate() {
            let at = |message: String| document.error_at(place(&message, "robot", index, robot.span()), message);
            check_robot(robot.get_ref(), &stations).map_err(at)?;
            let in_it = |message: String| at(format!("robot {}: {message}", robot.get_ref().id));
            robot.get_ref().models().try_for_each(|named| check_model(&named)).map_err(in_it)?;
            for index in 0..robot.get_ref().len() {
                let id = robot.get_ref().robot(index).map_err(|error| at(error.to_string()))?;
                if !ids.insert(id.clone()) {
                    return Err(at(format!("robot {id} appears twice")));
                }
            }
        }
        let alone = self.station.len() == 1;
        let name =
            |station: &StationEntry, pack: &PackEntry| if alone { pack.id.to_string() } else { format!("{}.{}", station.id, pack.id) };
        let stations = self.station.iter().map(Spanned::get_ref);
        let packs: Vec<String> = stations.flat_map(|station| station.packs.iter().map(move |pack| name(station, pack))).collect();
        let packs: Vec<&str> = packs.iter().map(String::as_str).collect();
        let mut folders = BTreeSet::new();
        for run in &self.run {
            let (name, folder) = (&run.get_ref().name, run.get_ref().folder());
            if folder.is_empty() || !folders.insert(folder) {
                let message = format!("run \"{name}\": a run needs a name that differs from the others' in letters and digits");
                return Err(document.error_at(run.span(), message));
            }
        }
        for expected in self.run.iter().map(|run| &run.get_ref().expect).chain([&self.expect]) {
            for (metric, expectation) in expected {
                let at = |message: String| document.error_at(metric.span(), message);
                expect::check(metric.get_ref(), expectation, &packs).map_err(at)?;
            }
        }
        Ok(())
    }
}

/// Whether a model of that name is built in and of the right system, or it is a path to one: a misspelt name is none.
fn check_model(named: &Named<'_>) -> Result<(), String> {
    let Named { key, model, of } = named;
    if energy::built_in_names().any(|known| known == *model) {
        let built_in =
            energy::load_model(model, &|_| Err("built-in models name no files".to_owned())).map_err(|error| error.to_string())?;
        let (system, wanted) = (built_in.system.name(), of.name());
        return if built_in.system == *of {
            Ok(())
        } else {
            Err(format!("{key} = \"{model}\": it is the model of a {system}, not of a {wanted}"))
        };
    }
    if model.contains(['.', '/']) {
        return Ok(());
    }
    let hint = energy::document::hint(model, energy::built_in_names());
    let known: Vec<&str> = energy::built_in_names().collect();
    Err(format!("{key}: no model `{model}`: neither built in nor a path{hint} Built in: {}", known.join(", ")))
}

fn fraction(key: &str, value: f64) -> Result<(), String> {
    if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(format!("{key} = {value}: must be between 0 and 1")) }
}

fn not_negative(key: &str, value: f64) -> Result<(), String> {
    if (0.0..=DURATION_MAX_S).contains(&value) { Ok(()) } else { Err(format!("{key} = {value}: must be between 0 and {DURATION_MAX_S}")) }
}

fn check_station(station: &StationEntry) -> Result<(), String> {
    let id = &station.id;
    if station.bays > COUNT_MAX {
        return Err(format!("station {id}: bays = {}: at most {COUNT_MAX}", station.bays));
    }
    for (key, value) in [("load_s", station.load_s), ("unload_s", station.unload_s), ("swap_s", station.swap_s)] {
        not_negative(&format!("station {id}: {key}"), value)?;
    }
    station.charging.check().map_err(|error| format!("station {id}: {error}"))?;
    station.selector.map_or(Ok(()), |selector| selector.check()).map_err(|error| format!("station {id}: {error}"))?;
    station.depot.map_or(Ok(()), |depot| depot.check()).map_err(|error| format!("station {id}: {error}"))?;
    station.vehicle.as_ref().map_or(Ok(()), |vehicle| vehicle.parts().map(|_| ())).map_err(|error| format!("station {id}: {error}"))?;
    if station.packs.is_empty() {
        return Err(format!("station {id}: packs: at least one is needed"));
    }
    let mut ids = BTreeSet::new();
    for pack in &station.packs {
        fraction(&format!("station {id}: pack {}: soc", pack.id), pack.soc)?;
        pack.age.check().map_err(|error| format!("station {id}: pack {}: {error}", pack.id))?;
        if !ids.insert(&pack.id) {
            return Err(format!("station {id}: pack {} appears twice", pack.id));
        }
    }
    let mut ids = BTreeSet::new();
    for spare in &station.spares {
        fraction(&format!("station {id}: spare {}: soc", spare.id), spare.soc)?;
        if !ids.insert(&spare.id) {
            return Err(format!("station {id}: spare {} appears twice", spare.id));
        }
    }
    Ok(())
}

fn known(stations: &[&str], key: &str, station: &str) -> Result<(), String> {
    if stations.contains(&station) {
        return Ok(());
    }
    let hint = energy::document::hint(station, stations.iter().copied());
    Err(format!("{key} names the unknown station {station}{hint} Known: {}", stations.join(", ")))
}

fn check_robot(robot: &RobotEntry, stations: &[&str]) -> Result<(), String> {
    let id = &robot.id;
    if robot.count.is_some_and(|count| count == 0 || count > COUNT_MAX) {
        return Err(format!("robot {id}: count = {}: must be between 1 and {COUNT_MAX}", robot.len()));
    }
    let each = |key: &str, values: &OneOrEach| match values {
        OneOrEach::Each(values) if values.len() != robot.len() => {
            Err(format!("robot {id}: {key} has {} numbers for {} robots", values.len(), robot.len()))
        }
        _ => Ok(()),
    };
    each("soc", &robot.soc)?;
    for &soc in robot.soc.all() {
        fraction(&format!("robot {id}: soc"), soc)?;
    }
    for (station, values) in &robot.travel_s {
        known(stations, &format!("robot {id}: travel_s"), station.as_ref())?;
        each(&format!("travel_s.{station}"), values)?;
        for &value in values.all() {
            not_negative(&format!("robot {id}: travel_s.{station}"), value)?;
        }
    }
    let named = |error: anyhow::Error| format!("robot {id}: {error}");
    robot.age.check().map_err(named)?;
    robot.charger.map_or(Ok(()), |charger| charger.check()).map_err(named)?;
    robot.radio.map_or(Ok(()), |radio| radio.check()).map_err(named)?;
    robot.way.as_ref().map_or(Ok(()), robot_agent::Ways::check).map_err(named)?;
    for station in robot.way.iter().flat_map(|way| way.to.keys()) {
        known(stations, &format!("robot {id}: way.to"), station.as_ref())?;
        if robot.travel_s.contains_key(station) {
            return Err(format!("robot {id}: way.to.{station}: travel_s.{station} is given too; one of them says how long it takes"));
        }
    }
    robot.mission.check().map_err(named)
}
