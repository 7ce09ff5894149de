//! Who may say what: rules for the process that carries traffic between coordinator and agents, made
//! from the names in certificates.
//!
//! An agent speaks under its own id only, only the coordinator commands, and what is not allowed here
//! is refused. A certificate's common name says who its holder is: `robot.ID`, `station.ID`,
//! `viewer.ID`, `coordinator.SITE`.

use proto::{RobotId, SiteId, StationId};
use serde_json::{Value, json};

/// The agents that belong to a site.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Members {
    /// Its robots.
    pub robots: Vec<RobotId>,
    /// Its stations.
    pub stations: Vec<StationId>,
    /// Those who may ask and listen, but not speak.
    pub viewers: Vec<String>,
}

/// The common name of a robot's certificate.
#[must_use]
pub fn robot_name(robot: &RobotId) -> String {
    format!("robot.{robot}")
}

/// The common name of a station's certificate.
#[must_use]
pub fn station_name(station: &StationId) -> String {
    format!("station.{station}")
}

/// The common name of a coordinator's certificate.
#[must_use]
pub fn coordinator_name(site: &SiteId) -> String {
    format!("coordinator.{site}")
}

/// The common name of a certificate for who only looks.
#[must_use]
pub fn viewer_name(viewer: &str) -> String {
    format!("viewer.{viewer}")
}

/// What somebody may do: kinds of messages on keys below the site's, from them (`ingress`) or to them.
type Grant = (&'static str, &'static [&'static str], Vec<String>);

/// What passes from the network to everybody: who listens where, and who is there.
const DECLARED: &[&str] = &["declare_subscriber", "declare_queryable", "declare_liveliness_subscriber", "liveliness_token"];
/// What a speaker under a key sends.
const SPEAKS: &[&str] = &["put"];
/// What a listener under a key sends.
const LISTENS: &[&str] = &["declare_subscriber"];
/// What somebody who answers under a key sends.
const ANSWERS: &[&str] = &["declare_queryable", "reply"];
/// What somebody sends who wants to know who is there.
const WATCHES: &[&str] = &["declare_liveliness_subscriber", "liveliness_query"];

fn robot(id: &RobotId) -> Vec<Grant> {
    let own = |tail: &str| format!("robot/{id}/{tail}");
    let sim = |tail: &str| format!("sim/station/*/robot/{id}/{tail}");
    vec![
        ("ingress", SPEAKS, vec![own("gauge"), own("state"), sim("draw")]),
        ("ingress", &["liveliness_token"], vec![own("alive")]),
        ("ingress", ANSWERS, vec![own("command")]),
        // Under its own keys it listens for another that has its name. Its station says whether it holds it.
        ("ingress", LISTENS, vec![sim("supply"), own("state"), "station/*/state".to_owned()]),
        ("ingress", WATCHES, vec!["coordinator/alive".to_owned(), own("alive")]),
        ("egress", &["query"], vec![own("command")]),
        ("egress", SPEAKS, vec![sim("supply"), own("state"), "station/*/state".to_owned()]),
    ]
}

fn station(id: &StationId) -> Vec<Grant> {
    let own = |tail: &str| format!("station/{id}/{tail}");
    let sim = |tail: &str| format!("sim/station/{id}/robot/*/{tail}");
    vec![
        ("ingress", SPEAKS, vec![own("state"), own("pack/*/gauge"), sim("supply")]),
        ("ingress", &["liveliness_token"], vec![own("alive")]),
        ("ingress", ANSWERS, vec![own("command")]),
        ("ingress", LISTENS, vec![sim("draw"), "robot/*/state".to_owned(), own("state")]),
        ("ingress", WATCHES, vec!["coordinator/alive".to_owned(), own("alive")]),
        ("egress", &["query"], vec![own("command")]),
        ("egress", SPEAKS, vec![sim("draw"), "robot/*/state".to_owned(), own("state")]),
    ]
}

fn viewer() -> Vec<Grant> {
    let told = || ["schedule", "capacity", "explain/*"].map(|tail| format!("coordinator/{tail}")).to_vec();
    vec![
        ("ingress", &["query", "declare_subscriber"], told()),
        ("ingress", WATCHES, vec!["**".to_owned()]),
        ("egress", &["put", "reply"], told()),
    ]
}

/// Everything below the site's key.
fn coordinator() -> Vec<Grant> {
    const ALL: &[&str] = &[
        "put",
        "delete",
        "declare_subscriber",
        "query",
        "declare_queryable",
        "reply",
        "liveliness_token",
        "declare_liveliness_subscriber",
        "liveliness_query",
    ];
    vec![("ingress", ALL, vec!["**".to_owned()]), ("egress", ALL, vec!["**".to_owned()])]
}

impl Members {
    /// The rules, as the router's `access_control`.
    #[must_use]
    pub fn rules(&self, site: &SiteId) -> Value {
        let robots = self.robots.iter().map(|id| (robot_name(id), robot(id)));
        let stations = self.stations.iter().map(|id| (station_name(id), station(id)));
        let viewers = self.viewers.iter().map(|id| (viewer_name(id), viewer()));
        let coordinators = std::iter::once((coordinator_name(site), coordinator()));
        let (mut rules, mut subjects, mut policies) = (Vec::new(), Vec::new(), Vec::new());
        for (name, mut grants) in robots.chain(stations).chain(viewers).chain(coordinators) {
            grants.push(("egress", DECLARED, vec!["**".to_owned()]));
            let mut ids = Vec::new();
            for (number, (flow, messages, keys)) in grants.into_iter().enumerate() {
                let id = format!("{name}.{number}");
                let keys: Vec<String> = keys.iter().map(|key| format!("tender/{site}/v1/{key}")).collect();
                rules.push(json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys }));
                ids.push(id);
            }
            subjects.push(json!({ "id": name, "cert_common_names": [name] }));
            policies.push(json!({ "rules": ids, "subjects": [name] }));
        }
        json!({ "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::Key;

    /// Every rule that lets somebody send `message` under a key.
    fn may(rules: &Value, who: &str, flow: &str, message: &str, key: &str) -> bool {
        let wanted = zenoh::key_expr::KeyExpr::try_from(key).unwrap();
        rules["rules"].as_array().unwrap().iter().any(|rule| {
            rule["id"].as_str().unwrap().rsplit_once('.').unwrap().0 == who
                && rule["flows"][0] == flow
                && rule["messages"].as_array().unwrap().iter().any(|known| known == message)
                && rule["key_exprs"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .any(|known| zenoh::key_expr::KeyExpr::try_from(known.as_str().unwrap().to_owned()).unwrap().includes(&wanted))
        })
    }

    #[test]
    fn an_agent_speaks_for_itself_and_only_the_coordinator_commands() {
        let site = SiteId::new("site").unwrap();
        let [one, two] = ["r-1", "r-2"].map(|id| RobotId::new(id).unwrap());
        let at = StationId::new("s-1").unwrap();
        let members = Members { robots: vec![one.clone(), two.clone()], stations: vec![at.clone()], viewers: vec!["wall".to_owned()] };
        let rules = members.rules(&site);
        let key = |key: Key| key.build(&site);
        let puts = |who: &str, to: Key| may(&rules, who, "ingress", "put", &key(to));
        assert!(puts("robot.r-1", Key::RobotGauge(one.clone())) && !puts("robot.r-1", Key::RobotGauge(two.clone())));
        assert!(puts("station.s-1", Key::StationState(at.clone())) && !puts("robot.r-1", Key::StationState(at.clone())));
        let commands = |who: &str| may(&rules, who, "ingress", "query", &key(Key::RobotCommand(two.clone())));
        assert!(commands("coordinator.site"));
        for who in ["robot.r-1", "robot.r-2", "station.s-1", "viewer.wall"] {
            assert!(!commands(who), "{who}");
            assert!(!puts(who, Key::Schedule), "{who}");
        }
        // Robots hear how stations stand; who only looks does not.
        let hears = |who: &str| may(&rules, who, "egress", "put", &key(Key::StationState(at.clone())));
        assert!(hears("robot.r-1") && hears("station.s-1") && !hears("viewer.wall"));
        // Nobody but the robot hears its commands, or may answer them.
        let answers = |who: &str| may(&rules, who, "ingress", "reply", &key(Key::RobotCommand(two.clone())));
        assert!(answers("robot.r-2") && !answers("robot.r-1"));
        assert!(may(&rules, "viewer.wall", "ingress", "query", &key(Key::Explain(one))));
        assert_eq!(rules["default_permission"], "deny");
    }
}
