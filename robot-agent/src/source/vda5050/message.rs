//! The messages of VDA 5050 that matter here, as its JSON schemas have them.

use anyhow::{Context, ensure};
use proto::Timestamp;
use serde::{Deserialize, Serialize};

use device::{Report, Supply};

/// The fields of `state` that are read; all others are left alone.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct State {
    timestamp: String,
    /// 2.x.
    battery_state: Option<BatteryState>,
    /// 3.x.
    power_supply: Option<PowerSupply>,
    #[serde(default)]
    action_states: Vec<ActionState>,
    /// 3.x: instant actions have a list of their own.
    #[serde(default)]
    instant_action_states: Vec<ActionState>,
}

/// `batteryState` of 2.x.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct BatteryState {
    /// %.
    battery_charge: f64,
    /// V.
    battery_voltage: Option<f64>,
    charging: bool,
}

/// `powerSupply` of 3.x.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct PowerSupply {
    /// %.
    state_of_charge: f64,
    /// V.
    battery_voltage: Option<f64>,
    /// A; the text does not say which way is positive.
    battery_current: Option<f64>,
    charging: bool,
}

/// What became of an action.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ActionState {
    action_id: String,
    /// WAITING, INITIALIZING, RUNNING, PAUSED, RETRIABLE (3.x), FINISHED or FAILED.
    pub action_status: String,
    /// 2.x.
    result_description: Option<String>,
    /// 3.x.
    action_result: Option<String>,
}

impl ActionState {
    pub(super) fn result(&self) -> Option<&str> {
        self.result_description.as_deref().or(self.action_result.as_deref()).filter(|text| !text.is_empty())
    }
}

/// `connection`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Connection {
    /// ONLINE, OFFLINE, CONNECTIONBROKEN (3.x: CONNECTION_BROKEN) or HIBERNATING (3.x).
    pub connection_state: String,
}

/// What every message begins with.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Header {
    /// Counts messages of the topic.
    pub header_id: u32,
    /// ISO 8601, UTC, with milliseconds.
    pub timestamp: String,
    /// Of the protocol.
    pub version: String,
    pub manufacturer: String,
    pub serial_number: String,
}

/// `instantActions`.
#[derive(Debug, Clone, Serialize)]
pub(super) struct InstantActions {
    #[serde(flatten)]
    pub header: Header,
    pub actions: Vec<Action>,
}

/// An instant action.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Action {
    pub action_type: String,
    pub action_id: String,
    blocking_type: &'static str,
    action_parameters: [(); 0],
}

impl Action {
    /// An action that hinders no other: 3.x allows no other blocking type in instant actions.
    pub(super) fn new(action_type: &str, action_id: String) -> Self {
        Self { action_type: action_type.to_owned(), action_id, blocking_type: "NONE", action_parameters: [] }
    }
}

impl State {
    pub(super) fn parse(bytes: &[u8]) -> anyhow::Result<Self> {
        serde_json::from_slice(bytes).context("a state message that cannot be read")
    }

    /// Whether it says that it is being charged.
    pub(super) fn is_charging(&self) -> bool {
        self.power_supply.as_ref().map(|now| now.charging).or(self.battery_state.as_ref().map(|now| now.charging)).unwrap_or(false)
    }

    /// What became of an action, wherever the version puts it.
    pub(super) fn action(&self, id: &str) -> Option<&ActionState> {
        self.instant_action_states.iter().chain(&self.action_states).find(|state| state.action_id == id)
    }

    /// What it says of the battery, in our units and signs.
    pub(super) fn report(&self) -> anyhow::Result<Report> {
        let (percent, voltage_v, shown_a, charging) = match (&self.power_supply, &self.battery_state) {
            (Some(now), _) => (now.state_of_charge, now.battery_voltage, now.battery_current, now.charging),
            (None, Some(now)) => (now.battery_charge, now.battery_voltage, None, now.charging),
            (None, None) => anyhow::bail!("a state message with neither batteryState (2.x) nor powerSupply (3.x)"),
        };
        ensure!((0.0..=100.0).contains(&percent), "a state of charge of {percent} %: must be between 0 and 100");
        let at = self.timestamp.parse::<Timestamp>().ok();
        Ok(Report {
            at_s: at.map(|at| at.unix_ms() as f64 / 1000.0),
            voltage_v: voltage_v.filter(|volts| *volts > 0.0),
            // Vehicles differ in the sign; which way it flows is said by `charging`.
            current_a: shown_a.map(|shown_a| if charging { 0.0 - shown_a.abs() } else { shown_a.abs() }),
            temperature_degc: None,
            soc: Some(percent / 100.0),
            soc_sigma: None,
            supply: if charging { Supply::Connected } else { Supply::Absent },
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    /// A whole state message with what its version requires (schema of 2.1.0 and of 3.0.0).
    fn state(version: &str, battery: (&str, Value)) -> State {
        let mut message = json!({
            "headerId": 7, "timestamp": "2026-04-15T11:40:03.120Z", "version": version, "manufacturer": "KIT", "serialNumber": "0001",
            "orderId": "", "orderUpdateId": 0, "lastNodeId": "n1", "lastNodeSequenceId": 0, "nodeStates": [], "edgeStates": [],
            "driving": false, "operatingMode": "AUTOMATIC", "errors": [],
            "actionStates": [{ "actionId": "a", "actionStatus": "RUNNING" }],
        });
        let fields = message.as_object_mut().unwrap();
        fields.insert(battery.0.to_owned(), battery.1);
        if version.starts_with('3') {
            fields.insert(
                "instantActionStates".to_owned(),
                json!([{ "actionId": "b", "actionStatus": "FAILED", "actionResult": "no contact" }]),
            );
            fields.insert("safetyState".to_owned(), json!({ "activeEmergencyStop": "NONE", "fieldViolation": false }));
        } else {
            fields.insert("safetyState".to_owned(), json!({ "eStop": "NONE", "fieldViolation": false }));
        }
        State::parse(message.to_string().as_bytes()).unwrap()
    }

    #[test]
    fn the_battery_state_of_2_1_is_read() {
        let battery = json!({ "batteryCharge": 62.5, "batteryVoltage": 24.6, "batteryHealth": 98, "charging": false, "reach": 5400 });
        let state = state("2.1.0", ("batteryState", battery));
        let wanted =
            Report { at_s: Some(1_776_253_203.12), voltage_v: Some(24.6), soc: Some(0.625), supply: Supply::Absent, ..Report::default() };
        assert_eq!(state.report().unwrap(), wanted);
        assert_eq!(state.action("a").unwrap().action_status, "RUNNING");
        assert!(state.action("b").is_none());
    }

    #[test]
    fn the_power_supply_of_3_0_is_read_and_its_current_is_signed_by_the_charging() {
        let battery = |current: f64, charging: bool| json!({ "stateOfCharge": 40, "batteryVoltage": 48.1, "batteryCurrent": current, "batteryHealth": 97.5, "charging": charging, "range": 900 });
        let current = |current, charging| state("3.0.0", ("powerSupply", battery(current, charging))).report().unwrap().current_a;
        assert_eq!([current(12.5, false), current(-12.5, false)], [Some(12.5); 2]);
        assert_eq!([current(12.5, true), current(-12.5, true)], [Some(-12.5); 2]);
        let state = state("3.0.0", ("powerSupply", battery(1.0, true)));
        assert_eq!((state.report().unwrap().soc, state.report().unwrap().supply), (Some(0.4), Supply::Connected));
        assert_eq!(state.action("b").unwrap().result(), Some("no contact"));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refused = |battery: (&str, Value)| state("2.1.0", battery).report().unwrap_err().to_string();
        assert!(
            refused(("batteryState", json!({ "batteryCharge": 162.5, "charging": false }))).contains("162.5 %: must be between 0 and 100")
        );
        assert!(refused(("other", json!(1))).contains("neither batteryState (2.x) nor powerSupply (3.x)"));
        assert!(State::parse(b"{}").unwrap_err().to_string().contains("cannot be read"));
    }

    #[test]
    fn an_instant_action_has_what_the_schema_requires() {
        let header = Header {
            header_id: 3,
            timestamp: "2026-04-15T11:40:03.120Z".to_owned(),
            version: "3.0.0".to_owned(),
            manufacturer: "KIT".to_owned(),
            serial_number: "0001".to_owned(),
        };
        let message = InstantActions { header, actions: vec![Action::new("startCharging", "x-1".to_owned())] };
        let wanted = json!({
            "headerId": 3, "timestamp": "2026-04-15T11:40:03.120Z", "version": "3.0.0", "manufacturer": "KIT", "serialNumber": "0001",
            "actions": [{ "actionType": "startCharging", "actionId": "x-1", "blockingType": "NONE", "actionParameters": [] }],
        });
        assert_eq!(serde_json::to_value(&message).unwrap(), wanted);
    }
}
