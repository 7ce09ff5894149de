mod alone;
mod exchange;
mod host;
mod restart;

use std::sync::Arc;

use self::host::says;

use energy::gauge::Kind;
use proto::{Command, CommandId, SpareId};

use super::*;

const SECOND: f64 = 1.0;

/// An agent, its clock and where its body is.
struct Bench {
    agent: Agent,
    now: Timestamp,
    commands: u32,
    place: Place,
}

fn station(name: &str) -> StationId {
    StationId::new(name).unwrap()
}

fn bay() -> Option<BayId> {
    Some(BayId::new("bay-1").unwrap())
}

fn dock() -> RobotAction {
    RobotAction::Dock { station: station("mds-1"), bay: bay() }
}

fn swap() -> RobotAction {
    RobotAction::SwapPack { station: station("mds-1"), spare: SpareId::new("spare-1").unwrap() }
}

/// An Explorer at 50 % charge that knows the way to mds-1.
fn bench() -> Bench {
    bench_at(0.5)
}

/// The same at another charge.
fn bench_at(soc: f64) -> Bench {
    let model = Arc::new(energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap());
    let travel = Travel { time_s: 60.0, energy_wh: Estimate::new(0.07, 0.01) };
    let profile = Profile {
        id: RobotId::new("explorer-1").unwrap(),
        battery: model.name.clone(),
        load: None,
        cells_series: 3,
        charge_cutoff_a: 0.066,
        drain_w: Estimate::new(4.4, 0.3),
        measure_drain: false,
        travel: BTreeMap::from([(station("mds-1"), travel)]),
        mission: Mission { weight: 1.0, until: None },
        publish: Publish::default(),
        alone: Alone::default(),
        source: "test".to_owned(),
    };
    let gauge = Kind::CoulombCounter.open(model, energy::Estimate::new(soc, 0.01), 25.0);
    Bench { agent: Agent::new(profile, gauge), now: Timestamp::from_unix_ms(0), commands: 0, place: Place::Mission }
}

impl Bench {
    fn command(&mut self, action: RobotAction) -> RobotCommand {
        self.commands += 1;
        let id = CommandId::new(format!("c1-{}", self.commands)).unwrap();
        Command { id, epoch: 1, at: self.now, deadline: self.now.plus_s(60.0), action }
    }

    fn give(&mut self, command: RobotCommand) -> (Outcome, Vec<Act>) {
        self.agent.handle(self.now, Input::Command(command));
        let (mut reply, mut acts) = (None, Vec::new());
        while let Some(output) = self.agent.poll() {
            match output {
                Output::Reply(given) => assert!(reply.replace(given.outcome).is_none(), "two replies"),
                Output::Act(act) => acts.push(act),
                _ => {}
            }
        }
        (reply.expect("a reply"), acts)
    }

    fn ask(&mut self, action: RobotAction) -> (Outcome, Vec<Act>) {
        let command = self.command(action);
        self.give(command)
    }

    /// A second passes in which the pack gives or takes this current.
    fn observe(&mut self, change: impl FnOnce(&mut Observation)) -> Vec<Act> {
        self.now = self.now.plus_s(SECOND);
        let sample = Some(Sample { dt_s: SECOND, current_a: 0.4, voltage_v: 11.4, temperature_degc: 25.0 });
        let mut observation =
            Observation { sample, place: self.place, powered: false, exchanged: None, said_soc: None, depleted: false, why_down: None };
        change(&mut observation);
        self.place = observation.place;
        self.agent.handle(self.now, Input::Observed(observation));
        std::iter::from_fn(|| self.agent.poll()).filter_map(|output| if let Output::Act(act) = output { Some(act) } else { None }).collect()
    }

    fn arrive(&mut self) {
        assert_eq!(self.ask(dock()).0, Outcome::Accepted);
        self.observe(|observation| observation.place = Place::AtStation);
        assert_eq!(self.agent.phase, RobotPhase::Waiting);
    }

    fn enter_bay(&mut self) {
        self.arrive();
        self.observe(|observation| (observation.place, observation.powered) = (Place::InBay, true));
        assert_eq!(self.agent.phase, RobotPhase::Docked);
    }
}

fn reason(outcome: &Outcome) -> (Rejection, &str) {
    match outcome {
        Outcome::Rejected { reason, detail } => (*reason, detail),
        Outcome::Accepted => panic!("accepted"),
    }
}

#[test]
fn a_service_goes_from_work_to_the_bay_and_back_to_work() {
    let mut bench = bench();
    let (outcome, acts) = bench.ask(dock());
    assert_eq!((outcome, acts), (Outcome::Accepted, vec![Act::TravelTo { station: station("mds-1"), bay: bay() }]));
    bench.observe(|observation| observation.place = Place::Underway);
    assert_eq!(bench.agent.phase, RobotPhase::Travelling);
    bench.observe(|observation| observation.place = Place::AtStation);
    bench.observe(|observation| (observation.place, observation.powered) = (Place::InBay, true));
    assert_eq!(bench.ask(RobotAction::ChargeTo { soc: 0.6 }), (Outcome::Accepted, vec![Act::Charge]));
    // 0.1 x 1.32 Ah at 1.32 A take six minutes.
    let seconds = (1..=400).find(|_| {
        let charging = |observation: &mut Observation| {
            observation.powered = true;
            observation.sample = Some(Sample { dt_s: SECOND, current_a: -1.32, voltage_v: 12.0, temperature_degc: 25.0 });
        };
        bench.observe(charging) == [Act::StopCharging]
    });
    assert!((360..=370).contains(&seconds.unwrap()), "{seconds:?}");
    assert_eq!(bench.agent.phase, RobotPhase::Charged);
    // The charger is off before the lift moves.
    assert_eq!(bench.ask(RobotAction::Undock).1, [Act::StopCharging]);
    assert_eq!(bench.observe(|observation| observation.place = Place::AtStation), [Act::Resume]);
    assert_eq!((bench.agent.phase, &bench.agent.station, &bench.agent.bay), (RobotPhase::Working, &None, &None));
}

#[test]
fn undock_on_the_way_returns_to_work() {
    let mut underway = bench();
    underway.ask(dock());
    assert_eq!(underway.ask(RobotAction::Undock), (Outcome::Accepted, vec![Act::Resume]));
    assert_eq!(underway.agent.phase, RobotPhase::Working);
    let mut waiting = bench();
    waiting.arrive();
    assert_eq!(waiting.ask(RobotAction::Undock), (Outcome::Accepted, vec![Act::Resume]));
    assert_eq!(waiting.agent.phase, RobotPhase::Working);
}

#[test]
fn commands_that_do_not_go_with_the_phase_are_refused_with_a_reason() {
    let mut bench = bench();
    for (action, phase) in [(RobotAction::ChargeTo { soc: 0.9 }, "working"), (swap(), "working"), (RobotAction::Undock, "working")] {
        let (outcome, acts) = bench.ask(action);
        let (why, detail) = reason(&outcome);
        assert_eq!((why, acts), (Rejection::Busy, vec![]));
        assert!(detail.ends_with(&format!("does not go with phase {phase}")), "{detail}");
    }
    bench.enter_bay();
    let (outcome, acts) = bench.ask(dock());
    assert_eq!((reason(&outcome).0, acts), (Rejection::Busy, vec![]));
    assert!(reason(&outcome).1.ends_with("phase docked"));
    assert_eq!(bench.agent.phase, RobotPhase::Docked);
}

#[test]
fn a_station_to_which_no_way_is_known_is_refused() {
    let mut bench = bench();
    let (outcome, acts) = bench.ask(RobotAction::Dock { station: station("mds-9"), bay: None });
    assert_eq!(reason(&outcome), (Rejection::UnknownTarget, "no way to station mds-9 is known"));
    assert_eq!((acts, bench.agent.phase), (vec![], RobotPhase::Working));
}

#[test]
fn the_same_command_id_acts_once_and_is_answered_twice() {
    let mut bench = bench();
    let command = bench.command(dock());
    let (first, acts) = bench.give(command.clone());
    assert_eq!(acts.len(), 1);
    let (second, acts) = bench.give(command);
    assert_eq!((first, acts), (second, vec![]));
    // Not even when the robot has long gone on.
    let undock = bench.command(RobotAction::Undock);
    bench.give(undock.clone());
    bench.ask(dock());
    assert_eq!(bench.give(undock).1, []);
    assert_eq!(bench.agent.phase, RobotPhase::Travelling);
}

#[test]
fn an_exchange_needs_the_robot_to_wait_at_that_station_and_restarts_its_gauge() {
    let mut bench = bench();
    bench.arrive();
    let elsewhere = RobotAction::SwapPack { station: station("mds-2"), spare: SpareId::new("spare-1").unwrap() };
    assert_eq!(reason(&bench.ask(elsewhere).0).0, Rejection::Busy);
    assert_eq!(bench.ask(swap()).0, Outcome::Accepted);
    assert_eq!(bench.agent.phase, RobotPhase::Swapping);
    let acts = bench.observe(|observation| observation.exchanged = Some(energy::Estimate::new(0.97, 0.01)));
    assert_eq!((acts, bench.agent.phase), (vec![], RobotPhase::Swapping));
    assert_eq!((bench.hears(&says(None, false)), bench.agent.phase), (vec![Act::Resume], RobotPhase::Working));
    assert!((bench.agent.soc().value - 0.97).abs() < 1e-3 && bench.agent.soc().sigma < 0.011, "{:?}", bench.agent.soc());
}

#[test]
fn a_robot_that_ran_empty_outside_a_bay_is_stranded_and_takes_no_command() {
    let mut outside = bench();
    outside.observe(|observation| observation.depleted = true);
    assert_eq!(outside.agent.phase, RobotPhase::Stranded);
    assert_eq!(reason(&outside.ask(dock()).0), (Rejection::NotPossible, "the robot is stranded"));
    let mut inside = bench();
    inside.enter_bay();
    inside.observe(|observation| (observation.depleted, observation.powered) = (true, true));
    assert_eq!(inside.agent.phase, RobotPhase::Docked);
}

#[test]
fn a_bay_without_power_is_reported_and_does_not_count_as_charged() {
    let mut bench = bench();
    bench.enter_bay();
    bench.ask(RobotAction::ChargeTo { soc: 0.2 });
    // Above the target, but nothing flows: the station is dark.
    for _ in 0..30 {
        assert_eq!((bench.observe(|observation| observation.powered = false), bench.agent.note.as_deref()), (vec![], None));
    }
    assert_eq!(bench.observe(|observation| observation.powered = false), []);
    assert_eq!((bench.agent.phase, bench.agent.note.as_deref()), (RobotPhase::Charging, Some("the bay has no power")));
}

#[test]
fn who_comes_for_an_exchange_waits_even_if_it_says_that_it_stands_in_a_bay() {
    let mut bench = bench();
    assert_eq!(bench.ask(RobotAction::Dock { station: station("mds-1"), bay: None }).0, Outcome::Accepted);
    bench.observe(|observation| observation.place = Place::InBay);
    bench.observe(|_| ());
    assert_eq!(bench.agent.phase, RobotPhase::Waiting);
    assert_eq!(bench.ask(swap()).0, Outcome::Accepted);
}

#[test]
fn who_drives_out_to_its_work_when_its_charge_ends_is_at_work() {
    for place in [Place::Mission, Place::Underway, Place::AtStation] {
        let mut bench = bench();
        bench.enter_bay();
        assert_eq!(bench.ask(RobotAction::ChargeTo { soc: 0.9 }).0, Outcome::Accepted);
        assert_eq!(bench.ask(RobotAction::Undock).0, Outcome::Accepted);
        bench.place = place;
        assert_eq!((bench.observe(|_| ()), bench.agent.phase), (vec![Act::Resume], RobotPhase::Working), "{place:?}");
    }
}
