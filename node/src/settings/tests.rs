use super::*;

const FILE: &str = "site = \"a\"\n\n[policy]\nconfidence = 0.95 # as agreed\n";

fn laid(environment: &[(&str, &str)], sets: &[&str]) -> anyhow::Result<String> {
    let environment = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    overlay(FILE, &changes(environment, &sets.iter().map(|set| (*set).to_owned()).collect::<Vec<_>>())?)
}

#[test]
fn flags_come_before_the_environment_and_that_before_the_file() {
    let text =
        laid(&[("TENDER_SET_POLICY__CONFIDENCE", "0.9"), ("TENDER_SET_SITE", "b"), ("PATH", "/bin")], &["policy.confidence=0.8"]).unwrap();
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

/// A source as configurations have it: the kind of error that is far from its key.
#[derive(Debug, PartialEq, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Source {
    Vehicle { username: Option<String>, password: Option<String>, port: u16 },
}

#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Secretive {
    source: Source,
    #[serde(default)]
    token: Option<String>,
}

fn secretive(file: &str, environment: &[(&str, &str)], sets: &[&str]) -> Result<Secretive, String> {
    let environment = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let changes = changes(environment, &sets).map_err(|error| format!("{error:#}"))?;
    read_over("c.toml", file, &changes, |_| Ok(())).map_err(|error| format!("{error:#}"))
}

#[test]
fn a_text_that_looks_like_a_number_is_a_text_where_one_is_wanted() {
    let file = "[source]\nkind = \"vehicle\"\nport = 1\n";
    let told = secretive(
        file,
        &[("TENDER_SET_TOKEN", "1234567890123456"), ("TENDER_SET_SOURCE__PASSWORD", "20"), ("TENDER_SET_SOURCE__PORT", "20")],
        &["source.username=20"],
    );
    let told = told.unwrap();
    assert_eq!(told.token.as_deref(), Some("1234567890123456"));
    assert_eq!(told.source, Source::Vehicle { username: Some("20".to_owned()), password: Some("20".to_owned()), port: 20 });
    for odd in ["true", "1.50", "2026-01-01", "[1]", "0x10"] {
        assert_eq!(secretive(file, &[("TENDER_SET_TOKEN", odd)], &[]).unwrap().token.as_deref(), Some(odd));
    }
    // What is quoted was a text already, and what wants a number does not get a text.
    assert_eq!(secretive(file, &[("TENDER_SET_TOKEN", "\"7\"")], &[]).unwrap().token.as_deref(), Some("7"));
    assert!(secretive(file, &[("TENDER_SET_SOURCE__PORT", "x")], &[]).unwrap_err().starts_with("TENDER_SET_SOURCE__PORT: "));
}

#[test]
fn a_secret_is_not_told_in_what_is_wrong_with_it() {
    let file = "[source]\nkind = \"vehicle\"\nport = 1\n";
    for secret in ["1234567890123456", "12345678.50", "0xBADC0DE"] {
        let read = secret.parse::<f64>().unwrap_or(f64::from(0xBAD_C0DE)).to_string();
        for key in ["token", "source.password"] {
            let text = if key == "token" { format!("token = {secret}\n{file}") } else { format!("{file}password = {secret}\n") };
            let error = secretive(&text, &[], &[]).unwrap_err();
            assert!(error.contains("expected a string") && !error.contains(secret) && !error.contains(&read), "{error}");
        }
    }
    let error = secretive(file, &[], &["token=hunter2", "token.x=hunter2"]).unwrap_err();
    assert_eq!(error, "--set token.x=...: `token` is a value, not a table: it has no `x`");
    let error = secretive(file, &[], &["source.token=hunter2"]).unwrap_err();
    assert!(error.starts_with("--set source.token=...: ") && !error.contains("hunter2"), "{error}");
}
