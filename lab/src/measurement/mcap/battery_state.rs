//! `sensor_msgs/msg/BatteryState` of ROS 2, as its CDR bytes.

use byteorder::{BigEndian, LittleEndian};
use serde::Deserialize;

/// Type of the messages that are read.
pub(super) const TYPE: &str = "sensor_msgs/msg/BatteryState";

/// The fields of interest, in the order of the message; what follows is not read.
#[derive(Debug, Deserialize)]
pub(super) struct BatteryState {
    pub header: Header,
    /// V.
    pub voltage: f32,
    /// °C; NaN when not measured, like all that follow.
    pub temperature: f32,
    /// A; ROS counts discharge negative.
    pub current: f32,
    /// Ah.
    pub charge: f32,
    #[serde(rename = "capacity")]
    _capacity: f32,
    #[serde(rename = "design_capacity")]
    _design_capacity: f32,
    /// State of charge, 0..1.
    pub percentage: f32,
    pub power_supply_status: u8,
    #[serde(rename = "power_supply_health")]
    _power_supply_health: u8,
    #[serde(rename = "power_supply_technology")]
    _power_supply_technology: u8,
    /// Whether there is a battery at all.
    pub present: bool,
    /// V, of every cell.
    pub cell_voltage: Vec<f32>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Header {
    pub stamp: Stamp,
    #[serde(rename = "frame_id")]
    _frame_id: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Stamp {
    pub sec: i32,
    pub nanosec: u32,
}

impl Stamp {
    /// Nanoseconds since 1970; none when the sender did not fill it in.
    pub(super) fn unix_ns(&self) -> Option<i64> {
        let ns = i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec);
        (ns != 0).then_some(ns)
    }
}

/// Decodes one message. No length that it claims is trusted: the decoder reads element by
/// element and stops where the bytes do.
pub(super) fn decode(bytes: &[u8]) -> Result<BatteryState, String> {
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

/// Checks the definition that a file brings along; one that says nothing is believed.
pub(super) fn check_definition(text: &str) -> Result<(), String> {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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
