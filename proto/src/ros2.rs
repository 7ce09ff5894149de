//! `sensor_msgs/msg/BatteryState` of ROS 2: its CDR bytes, and the key under which `rmw_zenoh`
//! publishes it. Robots' recordings and live robots are read by this one decoder.

use byteorder::{BigEndian, LittleEndian};
use serde::Deserialize;

/// Type of the messages that are read.
pub const TYPE: &str = "sensor_msgs/msg/BatteryState";

/// The type as a chunk of an `rmw_zenoh` key.
const KEY_TYPE: &str = "sensor_msgs::msg::dds_::BatteryState_";

/// Hash of the definition that is decoded here (REP 2011), the same from Iron to Kilted.
const HASH: &str = "RIHS01_4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741";

/// What stands in the place of the hash where ROS has none: Humble.
const NO_HASH: &str = "TypeHashNotSupported";

/// Under which keys a topic's messages come over `rmw_zenoh`, whatever the hash of their type:
/// `DOMAIN/TOPIC/TYPE/HASH`.
///
/// # Errors
/// Says what a topic's name may hold.
pub fn key_expression(domain: u32, topic: &str) -> Result<String, String> {
    let name = topic.trim_matches('/');
    let good = |chunk: &str| !chunk.is_empty() && chunk.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    if !name.split('/').all(good) {
        return Err(format!("topic `{topic}`: letters, digits and _, in parts between single slashes, such as /robot_1/battery_state"));
    }
    Ok(format!("{domain}/{name}/{KEY_TYPE}/*"))
}

/// Checks the hash that ends a message's key: another definition would be read as something else.
///
/// # Errors
/// Says which hash there is and which is known.
pub fn check_key(key: &str) -> Result<(), String> {
    match key.rsplit('/').next() {
        Some(HASH | NO_HASH) => Ok(()),
        other => Err(format!("its {TYPE} is another version: type hash {}, known is {HASH}", other.unwrap_or_default())),
    }
}

/// Charging status of a battery (`POWER_SUPPLY_STATUS_...`), as in Linux.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Not known, or a number that has no meaning.
    Unknown,
    /// It is charged.
    Charging,
    /// It is discharged.
    Discharging,
    /// A supply is there, but it is not charged.
    NotCharging,
    /// A supply is there, and it is full.
    Full,
}

impl Status {
    /// The status with that number.
    #[must_use]
    pub const fn of(number: u8) -> Self {
        match number {
            1 => Self::Charging,
            2 => Self::Discharging,
            3 => Self::NotCharging,
            4 => Self::Full,
            _ => Self::Unknown,
        }
    }
}

/// The fields of interest, in the order of the message; what follows is not read.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct BatteryState {
    /// When it was measured.
    pub header: Header,
    /// V.
    pub voltage: f32,
    /// °C; NaN when not measured, like all that follow.
    pub temperature: f32,
    /// A; ROS counts discharge negative.
    pub current: f32,
    /// Ah.
    pub charge: f32,
    /// Ah, last full.
    pub capacity: f32,
    /// Ah, when new.
    pub design_capacity: f32,
    /// State of charge, 0..1.
    pub percentage: f32,
    /// See [`Status`].
    pub power_supply_status: u8,
    /// `POWER_SUPPLY_HEALTH_...`.
    pub power_supply_health: u8,
    /// `POWER_SUPPLY_TECHNOLOGY_...`.
    pub power_supply_technology: u8,
    /// Whether there is a battery at all.
    pub present: bool,
    /// V, of every cell.
    pub cell_voltage: Vec<f32>,
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Header {
    /// When, by the sender's clock.
    pub stamp: Stamp,
    /// Where, in the robot's frames.
    pub frame_id: String,
}

/// `builtin_interfaces/msg/Time`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Stamp {
    /// Seconds since 1970, or since a simulation began.
    pub sec: i32,
    /// Nanoseconds beyond them.
    pub nanosec: u32,
}

impl Stamp {
    /// Nanoseconds since 1970; none when the sender did not fill it in.
    #[must_use]
    pub fn unix_ns(&self) -> Option<i64> {
        let ns = i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec);
        (ns != 0).then_some(ns)
    }
}

/// Decodes one message, its encapsulation header included. No length that it claims is trusted: the
/// decoder reads element by element and stops where the bytes do.
///
/// # Errors
/// Says what is wrong with the bytes.
pub fn decode(bytes: &[u8]) -> Result<BatteryState, String> {
    let Some((header, body)) = bytes.split_at_checked(4) else {
        return Err(format!("{} bytes are too few for a message", bytes.len()));
    };
    let decoded = match header[..2] {
        [0, 0] => cdr_encoding::from_bytes::<BatteryState, BigEndian>(body),
        [0, 1] => cdr_encoding::from_bytes::<BatteryState, LittleEndian>(body),
        _ => return Err(format!("representation {:02x}{:02x} is not plain CDR", header[0], header[1])),
    };
    decoded.map(|(message, _)| message).map_err(|error| error.to_string())
}

/// Fields that a definition must begin with; older ones lack the temperature, and their bytes
/// would be read as something else.
const FIELDS: &str = "header voltage temperature current charge capacity design_capacity percentage \
                      power_supply_status power_supply_health power_supply_technology present cell_voltage";

/// Checks the definition that a recording brings along; one that says nothing is believed.
///
/// # Errors
/// Names the fields that it has instead.
pub fn check_definition(text: &str) -> Result<(), String> {
    let own = text.lines().take_while(|line| !line.starts_with("==="));
    let field = |line: &str| {
        let line = line.split('#').next().unwrap_or_default();
        // Constants are not sent.
        let field = !line.contains('=');
        field.then(|| line.split_whitespace().nth(1).map(str::to_owned)).flatten()
    };
    let found: Vec<String> = own.filter_map(field).collect();
    let expected: Vec<&str> = FIELDS.split_whitespace().collect();
    if found.is_empty() || found.iter().map(String::as_str).take(expected.len()).eq(expected) {
        return Ok(());
    }
    Err(format!("its {TYPE} is another version: it has the fields {}", found.join(", ")))
}

/// The shortest decimal number that a single-precision one stands for: 12.3, not 12.300000190734863;
/// NaN for what is not measured.
#[must_use]
pub fn decimal(value: f32) -> f64 {
    if value.is_finite() { value.to_string().parse().unwrap_or(f64::NAN) } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_topic_is_a_key_as_rmw_zenoh_makes_it() {
        // The example of rmw_zenoh's own design document, with our type.
        let key = key_expression(0, "/robot_1/battery_state").unwrap();
        assert_eq!(key, "0/robot_1/battery_state/sensor_msgs::msg::dds_::BatteryState_/*");
        assert_eq!(check_key(&key.replace('*', HASH)), Ok(()));
        assert_eq!(check_key(&key.replace('*', "TypeHashNotSupported")), Ok(()));
        assert!(check_key(&key.replace('*', "RIHS01_00")).unwrap_err().contains("type hash RIHS01_00"));
        for wrong in ["", "/", "a//b", "battery*", "**", "a b", "battery-state"] {
            assert!(key_expression(0, wrong).unwrap_err().contains("/robot_1/battery_state"), "{wrong}");
        }
    }

    #[test]
    fn an_old_definition_is_refused() {
        let now =
            format!("# comment\nuint8 UNKNOWN=0\n{}", FIELDS.split_whitespace().map(|f| format!("float32 {f}  # x\n")).collect::<String>());
        assert_eq!(check_definition(&now), Ok(()));
        assert_eq!(check_definition(""), Ok(()));
        let error = check_definition("std_msgs/Header header\nfloat32 voltage\nfloat32 current\n===\nMSG: x\n").unwrap_err();
        assert!(error.contains("header, voltage, current"), "{error}");
    }

    #[test]
    fn other_encodings_and_claimed_lengths_are_refused() {
        assert!(decode(b"\0\x07\0\0").unwrap_err().contains("not plain CDR"));
        assert!(decode(b"\0").unwrap_err().contains("too few"));
        // A frame_id of 4 GiB.
        assert!(decode(b"\0\x01\0\0\0\0\0\0\0\0\0\0\xff\xff\xff\xff").is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_make_the_decoder_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), little in any::<bool>()) {
            let _ = decode(&bytes);
            let mut framed = vec![0, u8::from(little), 0, 0];
            framed.extend([0; 12]);
            framed.extend(bytes);
            if let Ok(message) = decode(&framed) {
                prop_assert!(message.cell_voltage.len() <= framed.len());
            }
        }
    }
}
