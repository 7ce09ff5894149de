//! What an operator uses: settings, doctor, manual pages, units, metrics.

use std::process::{Command, Output};

use tests::{program, workspace};

fn run(name: &'static str, arguments: &[&str]) -> Output {
    program(name).args(arguments).current_dir(workspace()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const LIVE: &str = "scenarios/live/coordinator.toml";

#[test]
fn a_flag_comes_before_the_environment_and_that_before_the_file() {
    // What is refused tells which value was read.
    let doctor = |environment: Option<&str>, flag: Option<&str>| {
        let mut command = program("coordinator");
        command.args(["doctor", "--config", LIVE]).current_dir(workspace());
        if let Some(value) = environment {
            command.env("TENDER_SET_POLICY__CONFIDENCE", value);
        }
        if let Some(value) = flag {
            command.args(["--set", &format!("policy.confidence={value}")]);
        }
        text(&command.output().unwrap().stdout)
    };
    assert!(doctor(None, None).contains("at 95 %"), "{}", doctor(None, None));
    assert!(doctor(Some("0.9"), None).contains("at 90 %"));
    assert!(doctor(Some("0.9"), Some("0.8")).contains("at 80 %"));
    assert!(doctor(None, Some("2")).contains("policy.confidence = 2"));
}

#[test]
fn doctor_says_what_is_wrong_and_what_to_do() {
    let missing = run("coordinator", &["doctor", "--config", "nowhere.toml", "--format", "json"]);
    assert_eq!(missing.status.code(), Some(1));
    let findings: serde_json::Value = serde_json::from_slice(&missing.stdout).unwrap();
    assert_eq!(findings[0]["verdict"], "fail");
    assert!(findings[0]["advice"].as_str().unwrap().contains("scenarios/live/coordinator.toml"));

    let policy = run("coordinator", &["doctor", "--config", LIVE, "--set", "policy.confidence=7"]);
    assert!(text(&policy.stdout).contains("policy.confidence = 7"), "{}", text(&policy.stdout));
    assert!(text(&policy.stdout).contains("✗ policy: set it to what is allowed"), "{}", text(&policy.stdout));
    let times = run("coordinator", &["doctor", "--config", LIVE, "--set", "policy.resend_s=60"]);
    assert!(text(&times.stdout).contains("policy.resend_s = 60 must lie below policy.deadline_s = 60"), "{}", text(&times.stdout));
    let unknown = run("coordinator", &["doctor", "--config", LIVE, "--set", "policy.confidnce=0.9"]);
    assert!(text(&unknown.stdout).contains("--set policy.confidnce=0.9: unknown field"), "{}", text(&unknown.stdout));

    // Somebody else has both ports.
    let taken = ["127.0.0.1:0"; 2].map(|any| std::net::TcpListener::bind(any).unwrap());
    let [wire, web] = taken.each_ref().map(|listener| listener.local_addr().unwrap().port());
    let (listen, port) = (format!("network.listen=[\"tcp/127.0.0.1:{wire}\"]"), format!("web.port={web}"));
    let found = run("coordinator", &["doctor", "--config", LIVE, "--set", &listen, "--set", &port]);
    let said = text(&found.stdout);
    assert_eq!(found.status.code(), Some(1), "{said}");
    assert!(said.contains("✗ listen: another program has this address"), "{said}");
    assert!(said.contains("✗ dashboard: set web.port"), "{said}");
}

#[test]
fn a_model_of_another_kind_is_refused_by_name() {
    let log = "scenarios/measured/enertech-lco-2280mah/discharge-1c.csv";
    let robot = run("robot-agent", &["run", "--id", "r1", "--battery", "explorer-robot", "--source", "replay", log]);
    assert_eq!(robot.status.code(), Some(2), "{}", text(&robot.stderr));
    assert!(text(&robot.stderr).contains("battery: `explorer-robot` is the model of a robot, not of a battery"), "{}", text(&robot.stderr));
    let folder = tempfile::tempdir().unwrap();
    for (agent, file, of) in [("robot-agent", "robot-explorer-1.toml", "a robot"), ("station-agent", "station-mds-1.toml", "a station")] {
        let live = std::fs::read_to_string(workspace().join("scenarios/live").join(file)).unwrap();
        let wrong = live.lines().map(|line| if line.starts_with("load = ") { "load = \"mds-3s4p-7600mah\"" } else { line });
        let path = folder.path().join(file);
        std::fs::write(&path, wrong.collect::<Vec<_>>().join("\n")).unwrap();
        let refused = run(agent, &["run", "--config", path.to_str().unwrap()]);
        let said = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("source.load: `mds-3s4p-7600mah` is the model of a battery, not of {of}")), "{said}");
    }
}

#[test]
fn doctor_says_who_else_can_read_a_token() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("coordinator.toml");
    let doctor = |mode: u32, environment: Option<&str>| {
        std::fs::set_permissions(&config, std::fs::Permissions::from_mode(mode)).unwrap();
        let mut command = program("coordinator");
        command.args(["doctor", "--config", "coordinator.toml"]).current_dir(folder.path());
        if let Some(token) = environment {
            command.env("TENDER_SET_WEB__TOKEN", token);
        }
        text(&command.output().unwrap().stdout)
    };
    const TOKEN: &str = "only-the-desk-knows-this";
    std::fs::write(&config, format!("schema = 1\nsite = \"here\"\n[web]\nport = 0\ntoken = \"{TOKEN}\"\n")).unwrap();
    let open = doctor(0o644, None);
    assert!(open.contains("coordinator.toml can be read by others (mode 644): chmod 600"), "{open}");
    assert!(doctor(0o600, None).contains("coordinator.toml, its owner's alone"));
    // A token from elsewhere does not make the file a secret.
    std::fs::write(&config, "schema = 1\nsite = \"here\"\n[web]\nport = 0\n").unwrap();
    let elsewhere = doctor(0o644, Some(TOKEN));
    assert!(!elsewhere.contains("read by others") && !open.contains(TOKEN) && !elsewhere.contains(TOKEN), "{elsewhere}");
}

#[test]
fn doctor_knows_whose_a_certificate_is_and_until_when() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let certs = |arguments: &[&str]| {
        let made =
            program("coordinator").arg("certs").args(arguments).args(["--site", "site"]).current_dir(folder.path()).output().unwrap();
        assert!(made.status.success(), "{}", text(&made.stderr));
    };
    certs(&["init"]);
    certs(&["init", "--dir", "other-ca"]);
    certs(&["issue", "coordinator", "--out", "good"]);
    certs(&["issue", "coordinator", "--out", "soon", "--days", "10"]);
    certs(&["issue", "robot", "r-1", "--out", "robot"]);
    certs(&["issue", "coordinator", "--out", "foreign", "--dir", "other-ca"]);
    let doctor = |certificate: &str| {
        let files: Vec<_> = std::fs::read_dir(at(certificate)).unwrap().map(|file| file.unwrap().path()).collect();
        let by =
            |ending: &str| files.iter().find(|file| file.extension().is_some_and(|found| found == ending)).unwrap().display().to_string();
        let (ca, certificate, key) = (at("site-ca/ca.pem").display().to_string(), by("pem"), by("key"));
        let tls = format!("network.tls={{ ca = \"{ca}\", certificate = \"{certificate}\", key = \"{key}\" }}");
        let listen = "network.listen=[\"tls/127.0.0.1:0\"]";
        text(&run("coordinator", &["doctor", "--config", LIVE, "--set", listen, "--set", &tls]).stdout)
    };
    let good = doctor("good");
    assert!(good.contains("for coordinator.site, until ") && good.contains("its owner's alone"), "{good}");
    assert!(!good.contains("✗ certificate"), "{good}");
    assert!(doctor("soon").contains("! certificate: issue it anew"), "{}", doctor("soon"));
    assert!(doctor("robot").contains("for robot.r-1, not for coordinator.site"), "{}", doctor("robot"));
    assert!(doctor("foreign").contains("was not issued by"), "{}", doctor("foreign"));
    let key =
        std::fs::read_dir(at("good")).unwrap().map(|file| file.unwrap().path()).find(|file| file.extension().unwrap() == "key").unwrap();
    std::fs::set_permissions(&key, std::os::unix::fs::PermissionsExt::from_mode(0o644)).unwrap();
    assert!(doctor("good").contains("✗ key: chmod 600 it"), "{}", doctor("good"));
}

#[test]
fn every_program_has_completions_and_manual_pages() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().to_string_lossy().into_owned();
    for name in ["coordinator", "robot-agent", "station-agent"] {
        for shell in ["bash", "zsh", "fish"] {
            let script = run(name, &["completions", shell]);
            assert!(script.status.success() && text(&script.stdout).contains(name), "{name} {shell}");
        }
        assert!(run(name, &["man", &dir]).status.success());
        let page = std::fs::read_to_string(folder.path().join(format!("{name}.1"))).unwrap();
        assert!(page.contains(".TH ") && page.contains("NAME"), "{name}");
    }
    for name in ["coordinator", "robot-agent", "station-agent"] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let told = program(name).args(["completions", "bash"]).stdout(full).output().unwrap();
        assert_eq!(told.status.code(), Some(2), "{name} {}", text(&told.stderr));
        assert!(text(&told.stderr).starts_with(&format!("{name}: cannot print ")), "{}", text(&told.stderr));
    }
    let bash = run("coordinator", &["completions", "bash"]);
    let script = folder.path().join("coordinator.bash");
    std::fs::write(&script, &bash.stdout).unwrap();
    let checked = Command::new("bash").arg("-n").arg(&script).status().unwrap();
    assert!(checked.success(), "bash does not read the completions");
}

#[test]
fn json_logs_are_one_object_a_line() {
    let missing = run("coordinator", &["--log-format", "yaml", "doctor"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(text(&missing.stderr).contains("must be text or json"));
    let folder = tempfile::tempdir().unwrap();
    let store = folder.path().join("tender.db");
    let mut command = program("coordinator");
    command.args(["--log-format", "json", "run", "--config", LIVE, "--listen", "tcp/127.0.0.1:0", "--web-port", "0", "--store"]).arg(store);
    let mut child = command.current_dir(workspace()).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().unwrap()));
    // It says where its dashboard is, last of what it says at the start.
    let dashboard = lines.by_ref().map(|line| serde_json::from_str::<serde_json::Value>(&line.unwrap()).unwrap()).find_map(|line| {
        let message = line["message"].as_str()?.to_owned();
        assert!(line["timestamp"].is_string() && line["level"].is_string(), "{line}");
        message.strip_prefix("dashboard at ").map(str::to_owned)
    });
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(dashboard.is_some_and(|address| address.starts_with("http://127.0.0.1:")));
}

/// systemd reads the units; that the programs are not installed here is all it may say.
#[test]
fn the_units_are_units() {
    let units: Vec<_> = std::fs::read_dir(workspace().join("packaging/systemd")).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(units.len(), 3);
    let Ok(verified) = Command::new("systemd-analyze").args(["verify", "--man=no"]).args(&units).output() else {
        eprintln!("skipped: systemd-analyze is not installed");
        return;
    };
    let said = text(&verified.stderr);
    let wrong: Vec<&str> = said.lines().filter(|line| line.contains("tender") && !line.contains("is not executable")).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}
