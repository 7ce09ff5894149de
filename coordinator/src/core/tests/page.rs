//! What the page and explanations tell of robots.

use super::*;
use crate::web::report::{Ended, Measured};
use crate::web::view::{View, Wanted};
use crate::web::{Books, Past};

/// Robot r0 in this phase, in a bay where it charges.
fn core_with(phase: RobotPhase) -> Core {
    let mut core = core();
    station_joins(&mut core, 0.0);
    let in_a_bay = phase == RobotPhase::Charging;
    let (station, bay) = (in_a_bay.then(|| id("s")), in_a_bay.then(|| id("bay-1")));
    core.handle(at(0.0), Input::RobotState(id("r0"), RobotState { phase, station, bay, ..working(0.0, &["s"]) }));
    let full = Gauge { time_to_full_s: Some(Estimate::new(900.0, 60.0)), ..gauge(0.0, 0.7, 14.6) };
    core.handle(at(0.0), Input::RobotGauge(id("r0"), full));
    core.handle(at(2.0), Input::Tick);
    core
}

fn view(core: &Core, title: &str, ended: Option<&Ended>) -> View {
    let (site, past) = (id("test"), Past::default());
    View::new(at(3.0), core, Books { site: &site, title, ended, past: &past, store: None, ladder: None }, &Wanted::default())
}

#[test]
fn a_time_to_full_is_told_of_who_charges_only() {
    let told = |phase: RobotPhase| {
        let core = core_with(phase);
        let detail = View::robot(at(3.0), &core, &Past::default(), &id("r0")).unwrap();
        let row = view(&core, "", None).fleet.rows.remove(0);
        (row.filling, row.time.is_some(), detail.facts.iter().any(|fact| fact.label == "Time to full"))
    };
    assert_eq!(told(RobotPhase::Charging), (true, true, true));
    // Its gauge still says what it said in the bay.
    assert_eq!(told(RobotPhase::Working), (false, false, false));
}

#[test]
fn that_a_robot_is_stranded_is_told_once() {
    let explanation = core_with(RobotPhase::Stranded).explain(at(3.0), &id("r0")).unwrap();
    let told: Vec<&String> = explanation.reasons.iter().filter(|reason| reason.contains("stranded")).collect();
    assert!(told.len() == 1 && told[0].starts_with("stranded at 70.0"), "{told:?}");
}

#[test]
fn a_page_knows_a_simulation_and_its_end() {
    let core = core_with(RobotPhase::Working);
    let live = view(&core, "", None);
    assert!(!live.simulated && live.ended.is_none());
    assert!(view(&core, "a scenario", None).simulated);
    let ended = Ended { note: "what it shows".to_owned(), runs: vec![Measured { name: "plain".to_owned(), metrics: Vec::new() }] };
    let shown = serde_json::to_value(view(&core, "a scenario", Some(&ended))).unwrap();
    assert_eq!((&shown["ended"]["note"], &shown["ended"]["runs"][0]["name"]), (&"what it shows".into(), &"plain".into()));
}
