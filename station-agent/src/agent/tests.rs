mod depleted;
mod spares;
mod telling;

use std::sync::Arc;

use energy::gauge::Kind;
use proto::{Command, CommandId};

use super::*;
use crate::source::{PackReading, Swapped};

/// A station agent, its clock and what its body shows.
struct Bench {
    agent: Agent,
    now: Timestamp,
    commands: u32,
    shown: Observation,
}

fn robot(name: &str) -> RobotId {
    RobotId::new(name).unwrap()
}

fn bay(number: u32) -> BayId {
    BayId::new(format!("bay-{number}")).unwrap()
}

fn pack(number: u32) -> PackId {
    PackId::new(format!("pack-{number}")).unwrap()
}

fn charged(number: u32) -> SpareState {
    SpareState { spare: spare(number), soc: proto::Estimate::new(0.98, 0.01), ready: true, battery: None }
}

fn spare(number: u32) -> SpareId {
    SpareId::new(format!("spare-{number}")).unwrap()
}

fn dock(name: &str, number: u32) -> StationAction {
    StationAction::Dock { robot: robot(name), bay: bay(number) }
}

fn undock(name: &str, number: u32) -> StationAction {
    StationAction::Undock { robot: robot(name), bay: bay(number) }
}

fn swap(name: &str, number: u32) -> StationAction {
    StationAction::SwapPack { robot: robot(name), spare: spare(number) }
}

/// Two bays, two packs, two spares.
fn bench() -> Bench {
    let model = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
    let gauge = || Kind::CoulombCounter.open(Arc::clone(&model), energy::Estimate::new(0.9, 0.01), 25.0);
    let profile = Profile {
        id: StationId::new("mds-1").unwrap(),
        rule: node::UNTIL_EMPTY,
        alone: Alone::default(),
        bays: vec![bay(1), bay(2)],
        spares: [1, 2].map(charged).into(),
        publish: Publish::default(),
        source: "test".to_owned(),
    };
    let sample = Sample { dt_s: 1.0, current_a: 0.5, voltage_v: 12.0, temperature_degc: 25.0 };
    let packs = [1, 2].map(|number| PackReading {
        pack: pack(number),
        sample: Some(sample),
        depleted: false,
        connected: true,
        back: None,
        exchanged: None,
        said_soc: None,
    });
    let shown = Observation {
        packs: packs.into(),
        active_pack: Some(pack(1)),
        powered: true,
        arrives_s: None,
        away_s: Vec::new(),
        lifted: None,
        given_up: None,
        mended: Vec::new(),
        swapped: None,
        called_off: None,
        known: true,
        lift_active: false,
        charged: Vec::new(),
        uncharged: Vec::new(),
        trouble: None,
    };
    let agent = Agent::new(profile, vec![(pack(1), gauge()), (pack(2), gauge())]);
    Bench { agent, now: Timestamp::from_unix_ms(0), commands: 0, shown }
}

impl Bench {
    fn command(&mut self, action: StationAction) -> StationCommand {
        self.commands += 1;
        let id = CommandId::new(format!("c1-{}", self.commands)).unwrap();
        Command { id, epoch: 1, at: self.now, deadline: self.now.plus_s(60.0), action }
    }

    fn drain(&mut self) -> (Vec<Outcome>, Vec<Act>) {
        let (mut replies, mut acts) = (Vec::new(), Vec::new());
        while let Some(output) = self.agent.poll() {
            match output {
                Output::Reply(reply) => replies.push(reply.outcome),
                Output::Act(act) => acts.push(act),
                _ => {}
            }
        }
        (replies, acts)
    }

    fn give(&mut self, command: StationCommand) -> (Outcome, Vec<Act>) {
        self.agent.handle(self.now, Input::Command(command));
        let (mut replies, acts) = self.drain();
        assert_eq!(replies.len(), 1);
        (replies.remove(0), acts)
    }

    fn ask(&mut self, action: StationAction) -> (Outcome, Vec<Act>) {
        let command = self.command(action);
        self.give(command)
    }

    fn observe(&mut self, change: impl FnOnce(&mut Observation)) -> Vec<Act> {
        self.now = self.now.plus_s(1.0);
        let mut observation = self.shown.clone();
        change(&mut observation);
        self.agent.handle(self.now, Input::Observed(observation));
        self.drain().1
    }

    fn lifted(&mut self, name: &str, number: u32, into: bool) -> Vec<Act> {
        self.observe(|observation| observation.lifted = Some(Lifted { robot: robot(name), bay: bay(number), into }))
    }

    fn phases(&self) -> Vec<BayPhase> {
        self.agent.bays.iter().map(|bay| bay.phase).collect()
    }
}

fn lift(name: &str, number: u32, into: bool) -> Act {
    Act::Lift(Lifted { robot: robot(name), bay: bay(number), into })
}

fn reason(outcome: &Outcome) -> (Rejection, &str) {
    match outcome {
        Outcome::Rejected { reason, detail } => (*reason, detail),
        Outcome::Accepted => panic!("accepted"),
    }
}

/// What a robot at this station says.
fn says(bench: &mut Bench, name: &str, phase: RobotPhase) {
    let state = RobotState {
        at: bench.now,
        seq: 1,
        phase,
        station: Some(bench.agent.profile.id.clone()),
        bay: None,
        drain_w: proto::Estimate::new(4.0, 0.1),
        travel: BTreeMap::new(),
        mission: proto::Mission { weight: 1.0, until: None },
        battery: "explorer".to_owned(),
        load: None,
        last_command: None,
        note: None,
    };
    bench.agent.handle(bench.now, Input::Robot(robot(name), state));
}

#[test]
fn a_bay_that_is_taken_is_refused_from_the_moment_it_is_promised() {
    let mut bench = bench();
    assert_eq!(bench.ask(dock("a", 1)), (Outcome::Accepted, vec![lift("a", 1, true)]));
    let (outcome, acts) = bench.ask(dock("b", 1));
    assert_eq!((reason(&outcome), acts), ((Rejection::Busy, "bay bay-1 is loading by a"), vec![]));
    bench.lifted("a", 1, true);
    assert_eq!(reason(&bench.ask(dock("b", 1)).0), (Rejection::Busy, "bay bay-1 is occupied by a"));
    assert_eq!(reason(&bench.ask(dock("b", 9)).0), (Rejection::UnknownTarget, "there is no bay bay-9"));
}

#[test]
fn nothing_is_in_two_places() {
    let mut bench = bench();
    bench.ask(dock("a", 1));
    assert_eq!(bench.ask(dock("a", 2)), (refused(Rejection::Busy, "a has bay bay-1"), vec![]));
    assert_eq!(bench.ask(swap("a", 1)), (refused(Rejection::Busy, "a has bay bay-1"), vec![]));
    bench.ask(swap("b", 1));
    assert_eq!(bench.ask(dock("b", 2)), (refused(Rejection::Busy, "the pack of b is being exchanged"), vec![]));
    assert_eq!(bench.phases(), [BayPhase::Loading, BayPhase::Free]);
}

#[test]
fn the_lift_moves_one_robot_at_a_time_in_the_order_of_the_commands() {
    let mut bench = bench();
    assert_eq!(bench.ask(dock("a", 1)).1, [lift("a", 1, true)]);
    // It is accepted, and waits.
    assert_eq!(bench.ask(dock("b", 2)), (Outcome::Accepted, vec![]));
    assert_eq!(bench.observe(|_| {}), []);
    assert_eq!(bench.lifted("a", 1, true), [lift("b", 2, true)]);
    assert_eq!(bench.phases(), [BayPhase::Occupied, BayPhase::Loading]);
    // Out again while the other is still on its way in.
    assert_eq!(bench.ask(undock("a", 1)), (Outcome::Accepted, vec![]));
    assert_eq!(bench.phases(), [BayPhase::Unloading, BayPhase::Loading]);
    assert_eq!(bench.lifted("b", 2, true), [lift("a", 1, false)]);
    assert_eq!(bench.lifted("a", 1, false), []);
    assert_eq!(bench.phases(), [BayPhase::Free, BayPhase::Occupied]);
}

#[test]
fn only_the_robot_that_is_in_a_bay_can_be_let_out_of_it() {
    let mut bench = bench();
    assert_eq!(reason(&bench.ask(undock("a", 1)).0), (Rejection::NotPossible, "a is not in bay bay-1"));
    bench.ask(dock("a", 1));
    assert_eq!(reason(&bench.ask(undock("a", 1)).0).0, Rejection::NotPossible, "it is still on the lift");
    bench.lifted("a", 1, true);
    assert_eq!(reason(&bench.ask(undock("b", 1)).0), (Rejection::NotPossible, "b is not in bay bay-1"));
    assert_eq!(bench.ask(undock("a", 1)).0, Outcome::Accepted);
    assert_eq!(reason(&bench.ask(undock("a", 1)).0).0, Rejection::NotPossible, "it is on its way out");
}

#[test]
fn a_depleted_pack_cannot_be_selected() {
    let mut bench = bench();
    assert_eq!(bench.ask(StationAction::SelectPack { pack: pack(2) }), (Outcome::Accepted, vec![Act::Select { pack: pack(2) }]));
    bench.observe(|observation| observation.packs[1].depleted = true);
    let (outcome, acts) = bench.ask(StationAction::SelectPack { pack: pack(2) });
    assert_eq!((reason(&outcome), acts), ((Rejection::NotPossible, "pack pack-2 is depleted"), vec![]));
    assert_eq!(reason(&bench.ask(StationAction::SelectPack { pack: pack(9) }).0), (Rejection::UnknownTarget, "there is no pack pack-9"));
}

#[test]
fn a_spare_is_given_once_and_one_exchange_runs_at_a_time() {
    let mut bench = bench();
    assert_eq!(bench.ask(swap("a", 1)), (Outcome::Accepted, vec![Act::Swap { robot: robot("a"), spare: spare(1) }]));
    assert_eq!(reason(&bench.ask(swap("b", 2)).0), (Rejection::Busy, "the pack of a is being exchanged"));
    let given_soc = energy::Estimate::new(0.0, 0.2);
    bench.observe(|observation| observation.swapped = Some(Swapped { robot: robot("a"), spare: spare(1), given_soc }));
    assert_eq!(reason(&bench.ask(swap("b", 1)).0), (Rejection::NotPossible, "spare spare-1 is not ready"));
    assert_eq!(reason(&bench.ask(swap("b", 9)).0), (Rejection::UnknownTarget, "there is no spare spare-9"));
    assert_eq!(bench.ask(swap("b", 2)).0, Outcome::Accepted);
}

#[test]
fn a_station_without_power_refuses_everything() {
    let mut bench = bench();
    bench.observe(|observation| observation.powered = false);
    for action in [dock("a", 1), undock("a", 1), swap("a", 1), StationAction::SelectPack { pack: pack(2) }] {
        let (outcome, acts) = bench.ask(action);
        assert_eq!((reason(&outcome), acts), ((Rejection::NotPossible, "the station has no power"), vec![]));
    }
}

#[test]
fn the_same_command_id_acts_once_and_is_answered_twice() {
    let mut bench = bench();
    let command = bench.command(dock("a", 1));
    let (first, acts) = bench.give(command.clone());
    assert_eq!(acts.len(), 1);
    bench.lifted("a", 1, true);
    bench.ask(undock("a", 1));
    bench.lifted("a", 1, false);
    // A late copy does not load the robot again.
    assert_eq!(bench.give(command), (first, vec![]));
    assert_eq!(bench.phases(), [BayPhase::Free, BayPhase::Free]);
}

#[test]
fn a_low_pack_is_left_for_a_good_one_and_a_request_wins_by_the_same_rule() {
    let mut bench = bench();
    bench.agent.profile.rule = Rule { leave_below_v: 9.6, take_above_v: 10.8 };
    let volts = |shown: &mut Observation, volts: [f64; 2]| {
        shown.packs.iter_mut().zip(volts).for_each(|(pack, voltage_v)| pack.sample.as_mut().unwrap().voltage_v = voltage_v);
    };
    assert_eq!(bench.observe(|shown| volts(shown, [9.7, 12.0])), []);
    assert_eq!(bench.observe(|shown| volts(shown, [9.5, 10.0])), [], "the other is not good: better stay");
    assert_eq!(bench.observe(|shown| volts(shown, [9.5, 12.0])), [Act::Select { pack: pack(2) }]);
    assert_eq!(bench.ask(StationAction::SelectPack { pack: pack(2) }).0, Outcome::Accepted);
}

#[test]
fn a_pack_that_is_away_is_told_of_and_not_selected_and_its_gauge_starts_anew() {
    let mut bench = bench();
    bench.observe(|shown| shown.packs[1].connected = false);
    let (outcome, acts) = bench.ask(StationAction::SelectPack { pack: pack(2) });
    assert!(matches!(&outcome, Outcome::Rejected { detail, .. } if detail == "pack pack-2 is away") && acts.is_empty(), "{outcome:?}");
    let state = bench.agent.state_message(bench.now);
    assert_eq!(state.packs.iter().map(|pack| pack.connected).collect::<Vec<_>>(), [true, false]);
    bench.observe(|shown| shown.packs[1].exchanged = Some(energy::Estimate::new(0.3, 0.01)));
    let soc = bench.agent.socs().nth(1).unwrap().1;
    assert!((soc.value - 0.3).abs() < 0.01, "{soc:?}");
    assert_eq!(bench.ask(StationAction::SelectPack { pack: pack(2) }).0, Outcome::Accepted);
}

#[test]
fn without_a_coordinator_it_takes_in_who_waits_and_lets_out_who_is_charged() {
    let mut bench = bench();
    bench.agent.handle(bench.now, Input::Coordinator(true));
    says(&mut bench, "a", RobotPhase::Waiting);
    (0..120).for_each(|_| assert_eq!(bench.observe(|_| {}), [], "the coordinator decides"));
    bench.agent.handle(bench.now, Input::Coordinator(false));
    (0..59).for_each(|_| assert_eq!(bench.observe(|_| {}), [], "a minute's silence may be a restart"));
    says(&mut bench, "a", RobotPhase::Waiting);
    assert_eq!(bench.observe(|_| {}), [lift("a", 1, true)]);
    bench.lifted("a", 1, true);
    says(&mut bench, "a", RobotPhase::Charging);
    assert_eq!(bench.observe(|_| {}), []);
    says(&mut bench, "a", RobotPhase::Charged);
    assert_eq!(bench.observe(|_| {}), [lift("a", 1, false)]);
    // Who was heard long ago may be anywhere.
    says(&mut bench, "b", RobotPhase::Waiting);
    bench.now = bench.now.plus_s(FRESH_TOO_LONG_S);
    assert_eq!(bench.observe(|_| {}), []);
}

/// Longer than a robot's word counts.
const FRESH_TOO_LONG_S: f64 = 40.0;

#[test]
fn a_restarted_agent_knows_its_bays_and_begins_again_what_had_not_begun() {
    let mut before = bench();
    let command = before.command(dock("a", 1));
    before.agent.handle(before.now, Input::Command(command.clone()));
    let first = before.agent.poll();
    let Some(Output::Keep(memory)) = first else { panic!("kept before anything moves: {first:?}") };
    let mut after = bench();
    after.agent.restore(*memory);
    assert_eq!(after.phases(), [BayPhase::Loading, BayPhase::Free]);
    assert_eq!(after.give(command), (Outcome::Accepted, vec![]), "a copy acts no second time");
    assert_eq!(after.ask(dock("b", 1)).1, [], "the bay is taken");
    // The lift moves: it had begun before the kill.
    assert_eq!(after.observe(|observation| observation.lift_active = true), []);
    // It does not: it had not.
    assert_eq!(after.observe(|_| {}), [lift("a", 1, true)]);
    after.lifted("a", 1, true);
    assert_eq!(after.phases(), [BayPhase::Occupied, BayPhase::Free]);
}

#[test]
fn a_bay_whose_lift_gives_up_is_out_of_order_until_it_is_mended_and_others_go_on() {
    let mut bench = bench();
    bench.ask(dock("a", 1));
    bench.ask(dock("b", 2));
    let given_up = |name: &str, number, into| Some(Lifted { robot: robot(name), bay: bay(number), into });
    assert_eq!(bench.observe(|seen| seen.given_up = given_up("a", 1, true)), [lift("b", 2, true)]);
    assert_eq!(bench.phases(), [BayPhase::Failed, BayPhase::Loading]);
    assert_eq!(reason(&bench.ask(dock("c", 1)).0).0, Rejection::Busy);
    // Whom it did not take in may go elsewhere.
    assert_eq!(bench.agent.whereabouts(&robot("a")), None);
    bench.lifted("b", 2, true);
    bench.observe(|seen| seen.mended = vec![bay(1)]);
    assert_eq!(bench.phases(), [BayPhase::Free, BayPhase::Occupied]);
    // Whom it does not let out it holds, and lets out in the end.
    bench.ask(undock("b", 2));
    bench.observe(|seen| (seen.given_up, seen.trouble) = (given_up("b", 2, false), Some("it jams".to_owned())));
    assert_eq!((bench.phases()[1], bench.agent.whereabouts(&robot("b"))), (BayPhase::Failed, Some("b has bay bay-2".to_owned())));
    let now = bench.now;
    assert_eq!(bench.agent.state_message(now).note.as_deref(), Some("it jams"));
    bench.observe(|seen| seen.mended = vec![bay(2)]);
    assert_eq!(bench.phases()[1], BayPhase::Failed, "a robot is in it");
    bench.lifted("b", 2, false);
    assert_eq!(bench.phases(), [BayPhase::Free, BayPhase::Free]);
}
