//! WIRE.md says what the code says.

use std::fs;
use std::path::{Path, PathBuf};

use proto::{Message, Pattern};

use crate::examples::{each_message, id};
use crate::golden;
use crate::keys::every_key;

fn read(path: impl AsRef<Path>) -> String {
    fs::read_to_string(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// A built key with the ids turned into the placeholders of the document.
fn layout(key: &str) -> String {
    let mut key = key.to_owned();
    for name in ["SITE", "ROBOT", "STATION", "PACK"] {
        key = key.replace(name, &format!("{{{}}}", name.to_lowercase()));
    }
    key
}

#[test]
fn every_key_layout_and_pattern_is_documented() {
    let document = read("WIRE.md");
    let site = id("SITE");
    let keys = every_key(&id("ROBOT"), &id("STATION"), &id("PACK"));
    let patterns = [
        Pattern::AllRobotGauges,
        Pattern::AllRobotStates,
        Pattern::AllStationStates,
        Pattern::AllPackGauges,
        Pattern::AllAlive,
        Pattern::AllExplains,
        Pattern::SimSupplyTo(id("ROBOT")),
        Pattern::SimDrawAt(id("STATION")),
    ];
    let keys = keys.iter().map(|key| key.build(&site));
    for key in keys.chain(patterns.iter().map(|pattern| pattern.build(&site))) {
        let layout = layout(&key);
        assert!(document.contains(&format!("`{layout}`")), "WIRE.md lacks `{layout}`");
    }
}

#[test]
fn every_schema_is_documented_and_has_a_golden_file() {
    let document = read("WIRE.md");
    let mut golden = Vec::new();
    macro_rules! run {
        ($name:literal, $example:expr) => {
            golden.push(schema_of(&$example))
        };
    }
    fn schema_of<M: Message>(_: &M) -> &'static str {
        M::SCHEMA
    }
    each_message!(run);

    // Types cannot be enumerated, so the schemas are looked up in the source.
    let messages = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/message");
    let mut found = 0;
    for entry in fs::read_dir(messages).unwrap() {
        let source = fs::read_to_string(entry.unwrap().path()).unwrap();
        for rest in source.split("const SCHEMA: &'static str = \"").skip(1) {
            let schema = &rest[..rest.find('"').unwrap()];
            found += 1;
            assert!(golden.contains(&schema), "{schema} has no golden file");
            let cell = format!("`{schema}`");
            assert!(document.contains(&cell), "WIRE.md lacks {cell}");
        }
    }
    assert_eq!(found, golden.len());
}

/// FNV-1a, 64 bits: enough to notice an unintended change, and needs no dependency.
fn fnv_1a(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[test]
fn the_hash_of_the_golden_files_ends_the_document() {
    let mut paths: Vec<PathBuf> = fs::read_dir(golden::directory()).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let hash = paths.iter().fold(0xcbf2_9ce4_8422_2325, |hash, path| {
        let name = path.file_name().unwrap().to_str().unwrap();
        fnv_1a(fnv_1a(hash, name.as_bytes()), &fs::read(path).unwrap())
    });
    let expected = format!("golden {hash:016x}");
    let document = read("WIRE.md");
    let last = document.lines().last().unwrap_or_default();
    assert_eq!(
        last, expected,
        "the golden files are not those that WIRE.md was written for. Read WIRE.md against \
         them, correct what no longer holds, then make `{expected}` its last line"
    );
}

#[test]
fn fnv_1a_agrees_with_a_published_value() {
    let start = 0xcbf2_9ce4_8422_2325;
    assert_eq!(fnv_1a(start, b""), start);
    assert_eq!(fnv_1a(start, b"foobar"), 0x8594_4171_f739_67e8);
}
