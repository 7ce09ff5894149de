//! The golden files are the wire format as bytes: a change here is a change for everyone.

use std::fs;
use std::path::PathBuf;

use proto::{Message, decode, encode, encode_pretty};

use crate::examples::each_message;

/// Set to `write` to let the tests rewrite the golden files from the examples.
const REWRITE: &str = "TENDER_GOLDEN";

pub fn directory() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden")
}

fn check<M: Message + PartialEq + std::fmt::Debug>(name: &str, example: &M) {
    assert_eq!(M::SCHEMA, format!("tender.{name}/1"));
    let path = directory().join(format!("{name}.json"));
    let pretty = encode_pretty(example) + "\n";
    if std::env::var(REWRITE).is_ok_and(|value| value == "write") {
        fs::write(&path, &pretty).unwrap();
    }
    let golden = fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(
        golden,
        pretty,
        "golden/{name}.json differs from what `encode` writes. If the change is meant, \
         consider whether {} needs a new version, then rerun with {REWRITE}=write",
        M::SCHEMA
    );
    assert_eq!(decode::<M>(golden.as_bytes()).as_ref(), Ok(example));

    let compact = encode(example);
    let start = format!("{{\"schema\":\"{}\",", M::SCHEMA);
    assert!(compact.starts_with(start.as_bytes()));
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&compact).unwrap(), serde_json::from_str::<serde_json::Value>(&golden).unwrap());
}

#[test]
fn every_message_encodes_to_its_golden_file_and_decodes_back() {
    macro_rules! run {
        ($name:literal, $example:expr) => {
            check($name, &$example)
        };
    }
    each_message!(run);
}

#[test]
fn there_is_no_golden_file_without_a_message() {
    let mut known = Vec::new();
    macro_rules! run {
        ($name:literal, $example:expr) => {
            known.push(format!("{}.json", $name))
        };
    }
    each_message!(run);
    for entry in fs::read_dir(directory()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(known.contains(&name), "golden/{name} belongs to no message");
    }
}
