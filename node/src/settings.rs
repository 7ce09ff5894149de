//! One precedence for every program: a flag of its own, then `--set`, then the environment, then the
//! file, then what the program says by itself.

use anyhow::{Context, anyhow, bail, ensure};
use energy::document::Document;
use serde::de::DeserializeOwned;
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Environment variables with this prefix set keys: `TENDER_SET_POLICY__CONFIDENCE=0.9` is
/// `policy.confidence = 0.9`.
pub const PREFIX: &str = "TENDER_SET_";

/// A key that is laid over a file: what set it, its name and its value.
type Change = (String, String, String);

/// A configuration of that file's text with the environment's and the command line's keys laid over it.
/// `sets` are `KEY=VALUE` as `--set` takes them; values are TOML, or plain text. `check` says what is wrong with a
/// configuration whose types are right.
///
/// # Errors
/// When it cannot be read: names the line of the file, or the variable or flag that is at fault.
pub fn read<T: DeserializeOwned>(file: &str, text: &str, sets: &[String], check: impl Fn(&T) -> anyhow::Result<()>) -> anyhow::Result<T> {
    let environment = std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    read_over(file, text, &changes(environment, sets)?, check)
}

fn read_over<T: DeserializeOwned>(
    file: &str,
    text: &str,
    changes: &[Change],
    check: impl Fn(&T) -> anyhow::Result<()>,
) -> anyhow::Result<T> {
    // What is wrong, as the file's fault and as a key's.
    let read = |text: &str| {
        let read = Document { file, text }.parse::<T>().map_err(|error| (error.clone().into(), error.message));
        read.and_then(|config| match check(&config) {
            Ok(()) => Ok(config),
            Err(error) => {
                let why = format!("{error:#}");
                Err((error.context(file.to_owned()), why))
            }
        })
    };
    read(&overlay(text, changes)?).map_err(|(error, why): (anyhow::Error, String)| {
        // Who reads well without a key, and not with it, has that key to blame.
        let first_bad = || (1..=changes.len()).find(|&count| overlay(text, &changes[..count]).is_ok_and(|text| read(&text).is_err()));
        let bad = read(text).is_ok().then(first_bad).flatten();
        bad.map_or_else(|| error, |count| anyhow!("{}: {why}", changes[count - 1].0))
    })
}

fn changes(environment: impl Iterator<Item = (String, String)>, sets: &[String]) -> anyhow::Result<Vec<Change>> {
    let mut from_environment: Vec<Change> = environment
        .filter_map(|(name, value)| {
            let key = name.strip_prefix(PREFIX)?.to_lowercase().replace("__", ".");
            Some((name, key, value))
        })
        .collect();
    from_environment.sort();
    let from_flags = sets.iter().map(|set| {
        let (key, value) = set.split_once('=').with_context(|| format!("--set {set}: must be KEY=VALUE, such as policy.confidence=0.9"))?;
        Ok((format!("--set {set}"), key.trim().to_owned(), value.trim().to_owned()))
    });
    from_environment.into_iter().map(Ok).chain(from_flags).collect()
}

fn overlay(text: &str, changes: &[Change]) -> anyhow::Result<String> {
    if changes.is_empty() {
        return Ok(text.to_owned());
    }
    // What is wrong with the file itself is told by whoever reads it, with its line.
    let Ok(mut document) = text.parse::<DocumentMut>() else { return Ok(text.to_owned()) };
    for (origin, key, value) in changes {
        set(document.as_table_mut(), key, value).with_context(|| origin.clone())?;
    }
    Ok(document.to_string())
}

fn set(table: &mut dyn TableLike, key: &str, value: &str) -> anyhow::Result<()> {
    ensure!(!key.is_empty() && key.split('.').all(|part| !part.is_empty()), "`{key}` is no key, such as policy.confidence");
    let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
    let Some(rest) = rest else {
        let parsed: Value = value.parse().unwrap_or_else(|_| Value::from(value));
        table.insert(first, Item::Value(parsed));
        return Ok(());
    };
    let inner = table.entry(first).or_insert_with(toml_edit::table);
    match inner.as_table_like_mut() {
        Some(inner) => set(inner, rest, value),
        None => bail!("`{first}` is a value, not a table: it has no `{rest}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "site = \"a\"\n\n[policy]\nconfidence = 0.95 # as agreed\n";

    fn laid(environment: &[(&str, &str)], sets: &[&str]) -> anyhow::Result<String> {
        let environment = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        overlay(FILE, &changes(environment, &sets.iter().map(|set| (*set).to_owned()).collect::<Vec<_>>())?)
    }

    #[test]
    fn flags_come_before_the_environment_and_that_before_the_file() {
        let text =
            laid(&[("TENDER_SET_POLICY__CONFIDENCE", "0.9"), ("TENDER_SET_SITE", "b"), ("PATH", "/bin")], &["policy.confidence=0.8"])
                .unwrap();
        let told: toml::Table = text.parse().unwrap();
        assert_eq!(told["site"].as_str(), Some("b"));
        assert_eq!(told["policy"]["confidence"].as_float(), Some(0.8));
    }

    #[test]
    fn keys_and_tables_that_the_file_does_not_have_are_made() {
        let text = laid(&[], &["web.port=8080", "network.listen=[\"tcp/127.0.0.1:1\"]", "stations.mds-1.load=mds-station"]).unwrap();
        let told: toml::Table = text.parse().unwrap();
        assert_eq!(told["web"]["port"].as_integer(), Some(8080));
        assert_eq!(told["network"]["listen"][0].as_str(), Some("tcp/127.0.0.1:1"));
        assert_eq!(told["stations"]["mds-1"]["load"].as_str(), Some("mds-station"));
    }

    #[test]
    fn a_key_that_cannot_be_set_is_named_with_where_it_came_from() {
        let refused = |set: &str| format!("{:#}", laid(&[], &[set]).unwrap_err());
        assert_eq!(refused("site.x=1"), "--set site.x=1: `site` is a value, not a table: it has no `x`");
        assert!(refused("policy").starts_with("--set policy: must be KEY=VALUE"));
        assert!(refused("policy..x=1").contains("`policy..x` is no key"));
        assert!(format!("{:#}", laid(&[("TENDER_SET_SITE__X", "1")], &[]).unwrap_err()).starts_with("TENDER_SET_SITE__X: "));
    }

    #[test]
    fn what_cannot_be_read_is_blamed_on_who_set_it() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Config {
            #[serde(rename = "site")]
            _site: String,
            policy: Policy,
        }
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Policy {
            confidence: f64,
        }
        let read = |file: &str, environment: &[(&str, &str)], sets: &[&str]| {
            let environment = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
            let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
            let check = |config: &Config| {
                ensure!(config.policy.confidence < 1.0, "policy.confidence = {}: must be below 1", config.policy.confidence);
                Ok(())
            };
            read_over("c.toml", file, &changes(environment, &sets).unwrap(), check).map_err(|error| format!("{error:#}"))
        };
        assert!(read(FILE, &[("TENDER_SET_SITE", "b")], &["policy.confidence=0.9"]).is_ok());
        let unknown = read(FILE, &[("TENDER_SET_POLICY__CONFIDNCE", "0.9")], &["site=b"]).unwrap_err();
        assert!(unknown.starts_with("TENDER_SET_POLICY__CONFIDNCE: unknown field `confidnce`"), "{unknown}");
        assert!(unknown.contains("did you mean `confidence`?"), "{unknown}");
        let kind = read(FILE, &[], &["site=b", "policy.confidence=abc"]).unwrap_err();
        assert!(kind.starts_with("--set policy.confidence=abc: invalid type"), "{kind}");
        let range = read(FILE, &[], &["site=b", "policy.confidence=2"]).unwrap_err();
        assert_eq!(range, "--set policy.confidence=2: policy.confidence = 2: must be below 1");
        let own = read(&FILE.replace("0.95", "3"), &[], &["site=b"]).unwrap_err();
        assert_eq!(own, "c.toml: policy.confidence = 3: must be below 1");
        let own = read(&FILE.replace("site", "sit"), &[], &["policy.confidence=0.9"]).unwrap_err();
        assert!(own.starts_with("c.toml:1:1: unknown field `sit`"), "{own}");
    }
}
