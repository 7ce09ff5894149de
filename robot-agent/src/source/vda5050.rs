//! A vehicle that speaks VDA 5050 over MQTT: its `state` messages of 2.x (`batteryState`) and 3.x
//! (`powerSupply`) come in, `startCharging` and `stopCharging` go out as instant actions. Orders stay
//! with the fleet's own control: Tender drives no vehicle through it (see `[body] drive`).

mod message;
mod mqtt;

use anyhow::{anyhow, bail, ensure};
use device::program::retry_s;
use device::{Device, Report};
use proto::RobotId;
use serde::{Deserialize, Serialize};
use tracing::warn;

use self::message::{Action, Header, InstantActions, State};
use self::mqtt::Broker;

/// `[source] kind = "vda5050"`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The MQTT broker, such as mqtt://127.0.0.1:1883.
    pub broker: String,
    /// Version of the protocol that the vehicle speaks.
    #[serde(default = "default_version")]
    pub version: String,
    /// First level of its topics; left out: what the version's text proposes, `uagv` or `vda5050`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interface: Option<String>,
    /// The vehicle's manufacturer, as in its topics.
    pub manufacturer: String,
    /// The vehicle's serial number, as in its topics.
    pub serial_number: String,
    /// User at the broker.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub username: Option<String>,
    /// The user's password; the environment's TENDER_SET_SOURCE__PASSWORD keeps it out of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub password: Option<String>,
}

fn default_version() -> String {
    "2.1.0".to_owned()
}

/// The two actions.
const START: &str = "startCharging";
const STOP: &str = "stopCharging";
/// Looks at the vehicle after which an instant action is sent again that no state message mentions.
const RESEND_LOOKS: u32 = 5;
/// Times that an instant action is sent before somebody is told that the vehicle does not answer.
const SENDS: u32 = 4;
/// Looks after which it is sent again from then on: vehicles out of the network's reach come back.
const RESEND_LATER_LOOKS: u32 = 30;

impl Config {
    /// The vehicle whose topics begin so: `mqtt://HOST:PORT/INTERFACE/vN/MANUFACTURER/SERIAL`.
    ///
    /// # Errors
    /// Says how it is written.
    pub fn of(text: &str) -> anyhow::Result<Self> {
        let parts: Vec<&str> = text.strip_prefix("mqtt://").map(|rest| rest.split('/').collect()).unwrap_or_default();
        let [address, interface, major, manufacturer, serial_number] = parts.as_slice() else {
            bail!("`{text}`: write mqtt://HOST:PORT/INTERFACE/vN/MANUFACTURER/SERIAL, such as mqtt://127.0.0.1:1883/uagv/v2/KIT/0001")
        };
        let version = match *major {
            "v2" => "2.1.0",
            "v3" => "3.0.0",
            other => bail!("`{text}`: {other} is no version that is spoken here: v2 or v3"),
        };
        let config = Self {
            broker: format!("mqtt://{address}"),
            version: version.to_owned(),
            interface: Some((*interface).to_owned()),
            manufacturer: (*manufacturer).to_owned(),
            serial_number: (*serial_number).to_owned(),
            username: None,
            password: None,
        };
        config.check()?;
        Ok(config)
    }

    /// Checks what types cannot.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        mqtt::address(&self.broker)?;
        self.major()?;
        // '/' parts the levels of a topic; '+', '#' and '$' mean something to brokers.
        for (key, level) in [
            ("interface", self.interface.as_deref().unwrap_or("uagv")),
            ("manufacturer", &self.manufacturer),
            ("serial_number", &self.serial_number),
        ] {
            ensure!(!level.is_empty() && !level.contains(['/', '+', '#', '$']), "source.{key} = \"{level}\": must be without / + # $");
        }
        ensure!(self.password.is_none() || self.username.is_some(), "source.password: goes with source.username");
        Ok(())
    }

    /// The major version: 2 or 3.
    fn major(&self) -> anyhow::Result<u32> {
        let numbers: Vec<u32> = self.version.split('.').map(str::parse).collect::<Result<_, _>>().unwrap_or_default();
        match numbers.as_slice() {
            [major @ (2 | 3), _, _] => Ok(*major),
            _ => bail!("source.version = \"{}\": must be one of 2 or 3, such as 2.1.0 or 3.0.0", self.version),
        }
    }

    fn topic(&self, name: &str) -> anyhow::Result<String> {
        let major = self.major()?;
        let interface = self.interface.as_deref().unwrap_or(if major == 2 { "uagv" } else { "vda5050" });
        Ok(format!("{interface}/v{major}/{}/{}/{name}", self.manufacturer, self.serial_number))
    }

    /// Connects to the broker, and goes on trying. Needs a runtime around it.
    ///
    /// # Errors
    /// When the configuration is not good.
    pub fn open(&self, robot: &RobotId) -> anyhow::Result<Box<dyn Device>> {
        self.check()?;
        let broker = Broker::connect(self, &format!("tender-{robot}"))?;
        Ok(Box::new(Vehicle::new(self.clone(), broker)))
    }
}

/// A vehicle behind a broker.
struct Vehicle {
    config: Config,
    broker: Broker,
    /// Instant-action messages so far.
    headers: u32,
    pending: Option<Pending>,
    /// What it last said of its connection.
    connection: Option<String>,
    /// States that have come since it said that it is not there.
    states_away: u32,
    /// Whether it has spoken at all.
    any: bool,
}

/// An instant action that the vehicle has not answered yet.
struct Pending {
    action: Action,
    looks: u32,
    sends: u32,
    /// Why it could not be done; told until it is, or something else is asked.
    failed: Option<String>,
    /// How often that was so.
    failures: u32,
    /// Time until it is asked for anew, s; none while it is not answered.
    again_in_s: Option<f64>,
}

impl Pending {
    fn new(action_type: &str) -> Self {
        Self { action: named(action_type), looks: 0, sends: 0, failed: None, failures: 0, again_in_s: None }
    }

    /// What somebody should know of it.
    fn trouble(&self) -> Option<String> {
        let unanswered = || format!("the vehicle does not answer {}, which was sent {} times", self.action.action_type, self.sends);
        let is_unanswered = self.sends > SENDS || self.sends == SENDS && self.looks >= RESEND_LOOKS;
        self.failed.clone().or_else(|| is_unanswered.then(unanswered))
    }
}

/// An action that the vehicle has not heard of.
fn named(action_type: &str) -> Action {
    Action::new(action_type, format!("{action_type}-{}", node::clock::unix_ms()))
}

/// So many states of a vehicle that is said not to be there show that it is.
const THERE: u32 = 2;

impl Device for Vehicle {
    fn name(&self) -> String {
        format!("vda5050 {}/{}", self.config.manufacturer, self.config.serial_number)
    }

    fn read(&mut self, dt_s: f64) -> anyhow::Result<Vec<Report>> {
        let (mut reports, mut wrong) = (Vec::new(), None);
        while let Some((topic, bytes)) = self.broker.next() {
            match self.hear(&topic, &bytes) {
                Ok(report) => reports.extend(report),
                Err(error) => wrong = Some(error),
            }
        }
        self.any |= !reports.is_empty();
        self.press(dt_s);
        match wrong {
            Some(error) if reports.is_empty() => Err(error),
            None if reports.is_empty() => match self.away() {
                Some(how) if self.broker.is_connected() => Err(anyhow!("the vehicle's connection is {how}")),
                // State messages are up to 30 s apart.
                _ if self.any && self.broker.is_connected() => Ok(reports),
                _ => Err(anyhow!("{}", self.broker.status())),
            },
            _ => Ok(reports),
        }
    }

    fn charge(&mut self, on: bool) {
        let action_type = if on { START } else { STOP };
        if on && self.pending.as_ref().is_some_and(|pending| pending.action.action_type == START) {
            return;
        }
        self.pending = Some(Pending::new(action_type));
        self.send();
    }

    fn leave(&mut self) {
        self.pending = self.pending.take().filter(|pending| pending.action.action_type == STOP);
    }

    fn trouble(&self) -> Option<String> {
        self.pending.as_ref().and_then(Pending::trouble)
    }
}

impl Vehicle {
    fn new(config: Config, broker: Broker) -> Self {
        Self { config, broker, headers: 0, pending: None, connection: None, states_away: 0, any: false }
    }

    /// Takes in a message; a report where it says how the battery is. Of a vehicle that is known to be away none is one of now.
    fn hear(&mut self, topic: &str, bytes: &[u8]) -> anyhow::Result<Option<Report>> {
        if topic.ends_with("/connection") {
            self.connection = serde_json::from_slice::<message::Connection>(bytes).ok().map(|said| said.connection_state);
            self.states_away = 0;
            return Ok(None);
        }
        let state = State::parse(bytes)?;
        if self.away().is_some() {
            self.states_away += 1;
            if self.states_away < THERE {
                return Ok(None);
            }
            // It speaks, whatever was said of it: a last will may come late, and a word of its return be lost.
            self.connection = None;
        }
        let report = state.report()?;
        self.answered(&state);
        Ok(Some(report))
    }

    /// What it says of its connection, where that is not that it is there.
    fn away(&self) -> Option<&str> {
        self.connection.as_deref().filter(|connection| *connection != "ONLINE")
    }

    /// Sends the action that is pending, with its own id each time: the vehicle knows a copy. Without the broker it waits.
    fn send(&mut self) {
        let Some(pending) = self.pending.as_mut().filter(|_| self.broker.is_connected()) else { return };
        (pending.looks, pending.sends) = (0, pending.sends + 1);
        let header = Header {
            header_id: self.headers,
            timestamp: proto::Timestamp::from_unix_ms(node::clock::unix_ms()).to_string(),
            version: self.config.version.clone(),
            manufacturer: self.config.manufacturer.clone(),
            serial_number: self.config.serial_number.clone(),
        };
        self.headers = self.headers.wrapping_add(1);
        let message = InstantActions { header, actions: vec![pending.action.clone()] };
        match self.config.topic("instantActions").and_then(|topic| self.broker.publish(&topic, &message)) {
            Ok(()) => {}
            Err(error) => warn!("{} was not sent: {error:#}", pending.action.action_type),
        }
    }

    /// Sends again what nobody has answered, and asks anew for what could not be done, later each time.
    fn press(&mut self, dt_s: f64) {
        let Some(pending) = &mut self.pending else { return };
        if let Some(left_s) = &mut pending.again_in_s {
            *left_s -= dt_s;
            if *left_s <= 0.0 {
                (pending.action, pending.again_in_s, pending.sends) = (named(&pending.action.action_type), None, 0);
                self.send();
            }
            return;
        }
        pending.looks += 1;
        if pending.sends == 0 || pending.looks >= if pending.sends < SENDS { RESEND_LOOKS } else { RESEND_LATER_LOOKS } {
            self.send();
        }
    }

    /// Sees in a state message what became of the pending action.
    fn answered(&mut self, state: &State) {
        let Some(pending) = &mut self.pending else { return };
        // It does as it was to, whatever became of the action.
        let is_done = state.is_charging() == (pending.action.action_type == START);
        if is_done && pending.sends > 0 {
            self.pending = None;
            return;
        }
        let Some(answer) = state.action(&pending.action.action_id) else { return };
        match answer.action_status.as_str() {
            "FINISHED" => self.pending = None,
            "FAILED" | "RETRIABLE" => {
                let why = answer.result().map(|why| format!(": {why}")).unwrap_or_default();
                let what = format!("{} is {}{why}", pending.action.action_type, answer.action_status);
                if pending.again_in_s.is_none() {
                    pending.failures += 1;
                    let wait_s = retry_s(pending.failures);
                    warn!("{}/{}: {what}; asked for again in {wait_s:.0} s", self.config.manufacturer, self.config.serial_number);
                    (pending.failed, pending.again_in_s) = (Some(what), Some(wait_s));
                }
            }
            // It is at it: nothing to send again.
            _ => (pending.looks, pending.sends) = (0, 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_those_that_the_texts_propose() {
        let config = Config::of("mqtt://127.0.0.1:1883/uagv/v2/KIT/0001").unwrap();
        assert_eq!(config.topic("state").unwrap(), "uagv/v2/KIT/0001/state");
        let config = Config { version: "3.0.0".to_owned(), interface: None, ..config };
        assert_eq!(config.topic("instantActions").unwrap(), "vda5050/v3/KIT/0001/instantActions");
    }

    #[test]
    fn nothing_is_measured_of_a_vehicle_whose_connection_is_broken_until_it_is_back() {
        let state = br#"{"timestamp": "2026-01-01T00:00:00.00Z",
            "batteryState": {"batteryCharge": 80.0, "batteryVoltage": 25.1, "charging": false}}"#;
        let config = Config::of("mqtt://127.0.0.1:1883/uagv/v2/KIT/0001").unwrap();
        let mut vehicle = Vehicle::new(config, Broker::unreached());
        let mut measured = |connection: Option<&str>| {
            if let Some(connection) = connection {
                let said = format!(r#"{{"connectionState": "{connection}"}}"#);
                assert_eq!(vehicle.hear("uagv/v2/KIT/0001/connection", said.as_bytes()).unwrap(), None);
            }
            vehicle.hear("uagv/v2/KIT/0001/state", state).unwrap().and_then(|report| report.soc)
        };
        assert_eq!(measured(None), Some(0.8), "nothing is known of its connection");
        assert_eq!(measured(Some("CONNECTIONBROKEN")), None);
        assert_eq!([measured(Some("ONLINE")), measured(Some("OFFLINE"))], [Some(0.8), None]);
        // One on its way while the connection broke is not one of now; who goes on speaking is there.
        assert_eq!([measured(None), measured(None)], [Some(0.8); 2]);
    }

    #[test]
    fn what_is_no_vehicle_is_refused() {
        let refused = |text: &str| Config::of(text).unwrap_err().to_string();
        assert!(refused("uagv/v2/KIT/0001").contains("write mqtt://HOST:PORT/INTERFACE/vN/MANUFACTURER/SERIAL"));
        assert!(refused("mqtt://127.0.0.1:1883/uagv/v1/KIT/0001").contains("v1 is no version that is spoken here"));
        assert!(refused("mqtt://127.0.0.1:1883/uagv/v2/KIT/+").contains("source.serial_number = \"+\": must be without / + # $"));
        let config = Config { version: "2".to_owned(), ..Config::of("mqtt://h:1883/uagv/v2/KIT/1").unwrap() };
        assert!(config.check().unwrap_err().to_string().contains("such as 2.1.0 or 3.0.0"));
    }
}
