//! A robot of ROS 2 that publishes `sensor_msgs/msg/BatteryState` through `rmw_zenoh`: read off the wire,
//! without ROS on this side. ROS counts a current that leaves the battery negative, a percentage from 0
//! to 1, and writes NaN for what is not measured.

use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{anyhow, bail, ensure};
use node::{Link, NetworkConfig};
use proto::SiteId;
use proto::ros2::{self, BatteryState, Status, decimal};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;
use tracing::{info, warn};
use zenoh::sample::Sample;

use crate::report::{Device, Report, Supply};

/// `[source] kind = "ros2"`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The topic, such as /battery_state.
    pub topic: String,
    /// `ROS_DOMAIN_ID` of the robot.
    #[serde(default)]
    pub domain: u32,
    /// Addresses of the robot's Zenoh router (`rmw_zenohd`); left out where it is the one of
    /// `[network]`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub connect: Vec<String>,
    /// For a driver that counts discharge positive, against the definition.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub invert_current: bool,
}

/// Messages that wait for the next look at them; more are dropped.
const QUEUE: usize = 1024;
/// More percentage than this is one from 0 to 100: a gauge may overshoot, but not so far. From then on no percentage of that driver is
/// believed: its 1 % would pass for full.
const PERCENTAGE_MAX: f64 = 1.05;

impl Config {
    /// Checks topic and addresses.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        ros2::key_expression(self.domain, &self.topic).map_err(|error| anyhow!("topic: {error}"))?;
        ensure!(self.domain <= 232, "domain = {}: must be between 0 and 232", self.domain);
        Ok(())
    }

    /// Listens to the topic; `network` is Tender's own. Needs a runtime around it.
    ///
    /// # Errors
    /// When the topic is no topic.
    pub fn open(&self, network: &NetworkConfig, site: &SiteId) -> anyhow::Result<Box<dyn Device>> {
        let key = ros2::key_expression(self.domain, &self.topic).map_err(|error| anyhow!("topic: {error}"))?;
        let (messages_in, messages) = mpsc::channel(QUEUE);
        let network = if self.connect.is_empty() {
            // A second session beside the agent's own: that one may be a robot's only link.
            NetworkConfig { listen: Vec::new(), ..network.clone() }
        } else {
            NetworkConfig { connect: self.connect.clone(), ..NetworkConfig::agent() }
        };
        ensure!(!network.connect.is_empty(), "connect: the address of the robot's Zenoh router is needed");
        let status = Arc::new(Mutex::new(format!("nobody answers at {} yet", network.connect.join(", "))));
        tokio::spawn(listen(network, site.clone(), key, messages_in, Arc::clone(&status)));
        Ok(Box::new(Topic { config: self.clone(), messages, status, told: Told::default() }))
    }
}

/// Brings a topic's messages into a queue, until nobody takes them out of it.
async fn listen(network: NetworkConfig, site: SiteId, key: String, queue: mpsc::Sender<Sample>, status: Arc<Mutex<String>>) {
    let say = |what: String| *status.lock().unwrap_or_else(PoisonError::into_inner) = what;
    let link = match Link::open(&network, site).await {
        Ok(link) => link,
        Err(error) => return say(format!("{error:#}")),
    };
    let into = queue.clone();
    let subscriber = link.session.declare_subscriber(&key).callback(move |sample| {
        let _ = into.try_send(sample);
    });
    match subscriber.await {
        Ok(_subscriber) => {
            info!("listening to {key} at {}", network.connect.join(", "));
            say(format!("no message under {key}"));
            queue.closed().await;
        }
        Err(error) => say(error.to_string()),
    }
}

/// A topic of battery messages.
struct Topic {
    config: Config,
    messages: mpsc::Receiver<Sample>,
    status: Arc<Mutex<String>>,
    told: Told,
}

/// What was said of the messages already.
#[derive(Debug, Default)]
struct Told {
    percentage: bool,
    /// The driver counts percentage from 0 to 100.
    hundredfold: bool,
    sign: bool,
}

impl Device for Topic {
    fn name(&self) -> String {
        format!("ros2 {}", self.config.topic)
    }

    fn read(&mut self, _dt_s: f64) -> anyhow::Result<Vec<Report>> {
        let (mut reports, mut wrong, mut any) = (Vec::new(), None, false);
        while let Ok(sample) = self.messages.try_recv() {
            any = true;
            let decoded = ros2::check_key(sample.key_expr()).and_then(|()| ros2::decode(&sample.payload().to_bytes()));
            match decoded {
                Ok(message) => match report(&message, self.config.invert_current, &mut self.told) {
                    Ok(report) => reports.push(report),
                    Err(error) => wrong = Some(error),
                },
                Err(error) => wrong = Some(anyhow!(error)),
            }
        }
        match wrong {
            Some(error) if reports.is_empty() => Err(error),
            None if !any => bail!("{}", self.status.lock().unwrap_or_else(PoisonError::into_inner)),
            _ => Ok(reports),
        }
    }
}

/// What a message says, in our units and signs.
fn report(message: &BatteryState, invert_current: bool, told: &mut Told) -> anyhow::Result<Report> {
    ensure!(message.present, "the robot says that no battery is present (present = false)");
    let measured = |value: f32| Some(decimal(value)).filter(|value| value.is_finite());
    let status = Status::of(message.power_supply_status);
    let sign = if invert_current { 1.0 } else { -1.0 };
    let current_a = measured(message.current).map(|shown_a| 0.0 + sign * shown_a);
    if status == Status::Discharging && current_a.is_some_and(|drawn_a| drawn_a < 0.0) && !std::mem::replace(&mut told.sign, true) {
        warn!(
            "the robot says that it discharges, with a current of {} A that charges: its driver counts the other way; \
             set invert_current = {}",
            message.current, !invert_current
        );
    }
    let soc = measured(message.percentage).filter(|share| {
        if *share > PERCENTAGE_MAX && !std::mem::replace(&mut told.hundredfold, true) {
            warn!("percentage = {share} is more than 1: the driver counts from 0 to 100, and none of its percentages is believed");
        }
        let sane = (0.0..=PERCENTAGE_MAX).contains(share);
        if !sane && !told.hundredfold && !std::mem::replace(&mut told.percentage, true) {
            warn!("percentage = {share} is not between 0 and 1: taken as not measured");
        }
        sane && !told.hundredfold
    });
    let by_charge =
        || measured(message.charge).zip(measured(message.capacity)).filter(|(_, full)| *full > 0.0).map(|(now, full)| now / full);
    Ok(Report {
        at_s: Some(message.header.stamp)
            .filter(|stamp| stamp.unix_ns().is_some())
            .map(|stamp| f64::from(stamp.sec) + f64::from(stamp.nanosec) / 1e9),
        voltage_v: measured(message.voltage).filter(|volts| *volts > 0.0),
        current_a,
        temperature_degc: measured(message.temperature),
        soc: soc.or_else(by_charge).map(|soc| soc.clamp(0.0, 1.0)),
        soc_sigma: None,
        supply: match status {
            Status::Charging => Supply::Connected,
            Status::Discharging => Supply::Absent,
            // "Not charging" and "full" say little of what is connected: drivers differ.
            Status::NotCharging | Status::Full | Status::Unknown => Supply::Unknown,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes made by another program: `tests/data/battery_state_cdr.py` says how.
    fn fixture(name: &str) -> BatteryState {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
        ros2::decode(&std::fs::read(path).unwrap()).unwrap()
    }

    #[test]
    fn what_rosbags_wrote_is_read_in_our_units_and_signs() {
        let seen = report(&fixture("discharging.cdr"), false, &mut Told::default()).unwrap();
        let wanted = Report {
            at_s: Some(1_767_225_600.25),
            voltage_v: Some(24.6),
            current_a: Some(3.2),
            temperature_degc: Some(31.5),
            soc: Some(0.625),
            soc_sigma: None,
            supply: Supply::Absent,
        };
        assert_eq!(seen, wanted);
        let seen = report(&fixture("charging-big-endian.cdr"), false, &mut Told::default()).unwrap();
        assert_eq!((seen.current_a, seen.supply, seen.at_s), (Some(-1.5), Supply::Connected, None));
    }

    #[test]
    fn nan_is_not_measured() {
        let seen = report(&fixture("voltage-only.cdr"), false, &mut Told::default()).unwrap();
        assert_eq!(seen, Report { voltage_v: Some(12.1), ..Report::default() });
    }

    #[test]
    fn a_driver_that_counts_its_own_way_is_told_and_can_be_turned() {
        let mut message = fixture("discharging.cdr");
        message.current = 3.2;
        let mut told = Told::default();
        assert_eq!(report(&message, false, &mut told).unwrap().current_a, Some(-3.2));
        assert!(told.sign);
        assert_eq!(report(&message, true, &mut Told::default()).unwrap().current_a, Some(3.2));
        (message.percentage, message.charge, message.capacity) = (62.5, 25.0, 40.0);
        let mut told = Told::default();
        assert_eq!(report(&message, false, &mut told).unwrap().soc, Some(0.625));
        assert!(told.hundredfold);
        message.present = false;
        assert!(report(&message, false, &mut told).unwrap_err().to_string().contains("present = false"));
    }

    #[test]
    fn one_percent_of_a_driver_that_counts_to_a_hundred_is_not_taken_for_full() {
        let mut message = fixture("discharging.cdr");
        (message.charge, message.capacity) = (f32::NAN, f32::NAN);
        let mut told = Told::default();
        let mut soc = |percentage: f32| {
            message.percentage = percentage;
            report(&message, false, &mut told).unwrap().soc
        };
        // What no gauge says by mistake, such as -1, speaks against itself alone.
        assert_eq!([-1.0, 0.5, 1.02].map(&mut soc), [None, Some(0.5), Some(1.0)]);
        assert_eq!([3.0, 2.0, 1.0, 0.5].map(&mut soc), [None; 4]);
    }

    #[test]
    fn a_topic_is_checked() {
        let config = |topic: &str, domain| Config { topic: topic.to_owned(), domain, connect: Vec::new(), invert_current: false };
        config("/battery_state", 0).check().unwrap();
        assert!(config("/battery-state", 0).check().unwrap_err().to_string().starts_with("topic: topic `/battery-state`"));
        assert!(config("/b", 233).check().unwrap_err().to_string().contains("between 0 and 232"));
    }
}
