//! The configuration and the models that it names.

use std::path::Path;

use super::Finding;
use crate::config::Config;
use crate::counted::counted;

pub(super) fn unreadable(path: &Path, error: &anyhow::Error) -> Finding {
    let advice = if path.exists() {
        "mend what is named there; scenarios/live/coordinator.toml explains every key".to_owned()
    } else {
        "name it by --config; scenarios/live/coordinator.toml is one to begin with".to_owned()
    };
    Finding::fail("configuration", format!("{error:#}"), advice)
}

pub(super) fn check(config: &Config, path: &Path) -> Vec<Finding> {
    let mut findings = vec![Finding::ok("configuration", format!("{}, site {}", path.display(), config.site))];
    findings.push(match config.load(Some(path)) {
        Ok((settings, models)) => {
            let packs: usize = models.stations.values().map(|station| station.packs.len()).sum();
            let found = format!(
                "{}, {}, {}; policy {} at {:.0} %",
                counted(models.robots.len(), "robot"),
                counted(models.stations.len(), "station"),
                counted(packs, "pack"),
                settings.policy.name(),
                100.0 * settings.confidence
            );
            match models.stations.is_empty() {
                true => Finding::fail("models", found, "add a [stations.ID] table: without a station nobody can be serviced"),
                false => Finding::ok("models", found),
            }
        }
        Err(error) if error.to_string().starts_with("policy.") => {
            Finding::fail("policy", format!("{error:#}"), "set it to what is allowed")
        }
        Err(error) => Finding::fail("models", format!("{error:#}"), "mend the model or its name; `lab effects` tells what models may hold"),
    });
    if let Some(Err(why)) = config.web.ladder(Some(path)) {
        findings.push(Finding::note("discovery", why, "run `lab discover ... --format json` into that file, or leave web.discovery out"));
    }
    // A token that came by the environment is not this file's to keep.
    let holds_it = |token: &String| node::files::read_text(path).is_ok_and(|text| text.contains(token));
    if config.web.token.as_ref().is_some_and(holds_it) {
        findings.push(match node::files::only_its_owners(path) {
            Ok(()) => Finding::ok("token", format!("{}, its owner's alone", path.display())),
            Err(why) => Finding::note("token", format!("{why:#}"), "or take web.token out and give it as TENDER_SET_WEB__TOKEN"),
        });
    }
    findings
}
