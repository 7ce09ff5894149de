//! What a robot makes of its station's words.

use proto::{BayPhase, BayState};

use super::*;
use crate::source::Held;

/// The station's word at the bench's next moment: what bay-1 does with the robot, and whether its pack is being exchanged.
pub(super) fn says(bay: Option<BayPhase>, swaps: bool) -> StationState {
    let robot = RobotId::new("explorer-1").unwrap();
    let holds = |phase| BayState { bay: BayId::new("bay-1").unwrap(), phase, robot: Some(robot.clone()) };
    StationState {
        at: Timestamp::from_unix_ms(0),
        seq: 0,
        bays: bay.map(holds).into_iter().collect(),
        lift_busy: false,
        swapping: swaps.then(|| robot.clone()),
        packs: Vec::new(),
        active_pack: None,
        powered: true,
        pack_power_w: 10.0,
        arrives: None,
        away: Vec::new(),
        spares: Vec::new(),
        last_command: None,
        note: None,
    }
}

impl Bench {
    /// Half a second later the robot hears that.
    pub(super) fn hears(&mut self, state: &StationState) -> Vec<Act> {
        self.now = self.now.plus_s(SECOND / 2.0);
        let seq = if state.seq == 0 { u64::try_from(self.now.unix_ms()).unwrap() } else { state.seq };
        self.agent.handle(self.now, Input::Station(station("mds-1"), StationState { at: self.now, seq, ..state.clone() }));
        std::iter::from_fn(|| self.agent.poll()).filter_map(|output| if let Output::Act(act) = output { Some(act) } else { None }).collect()
    }
}

#[test]
fn a_robot_stands_still_until_its_station_has_taken_its_hands_off() {
    let mut bench = bench();
    bench.arrive();
    bench.hears(&says(None, false));
    assert_eq!(bench.ask(swap()).0, Outcome::Accepted);
    bench.hears(&says(None, true));
    let puts_in = |observation: &mut Observation| observation.exchanged = Some(energy::Estimate::new(0.97, 0.01));
    // What was said before the pack was in says nothing of what is done after it.
    assert_eq!((bench.observe(puts_in), bench.agent.phase), (vec![], RobotPhase::Swapping));
    assert!((bench.agent.soc().value - 0.97).abs() < 1e-3, "its gauge is of the new pack at once");
    for _ in 0..20 {
        assert_eq!((bench.hears(&says(None, true)), bench.observe(|_| {})), (vec![], vec![]));
    }
    assert_eq!((bench.hears(&says(None, false)), bench.agent.phase), (vec![Act::Resume], RobotPhase::Working));
}

#[test]
fn where_no_station_is_heard_an_exchange_is_over_after_a_while_whatever_the_clock_is_set_to() {
    let mut bench = bench();
    bench.arrive();
    bench.ask(swap());
    bench.hears(&says(None, true));
    bench.observe(|observation| observation.exchanged = Some(energy::Estimate::new(0.97, 0.01)));
    // The agent's board had lost its clock, and is set right.
    bench.now = bench.now.plus_s(3600.0);
    let gone_on = (1..100).find(|_| bench.observe(|_| {}) == [Act::Resume]);
    // The leap counts for as long as a look may take.
    assert!(gone_on.is_some_and(|seconds| (75..=90).contains(&seconds)), "{gone_on:?}");
}

#[test]
fn a_word_that_was_overtaken_is_not_believed() {
    let mut bench = bench();
    bench.enter_bay();
    bench.hears(&says(Some(BayPhase::Occupied), false));
    assert_eq!(bench.agent.held(), Held::InBay);
    let late = StationState { at: bench.now.plus_s(-5.0), ..says(None, false) };
    bench.agent.handle(bench.now, Input::Station(station("mds-1"), late));
    assert_eq!(bench.agent.held(), Held::InBay);
    // Nor is that of a station where it is not.
    bench.agent.handle(bench.now, Input::Station(station("mds-2"), StationState { at: bench.now, ..says(None, false) }));
    assert_eq!(bench.agent.held(), Held::InBay);
    (0..91).for_each(|_| drop(bench.observe(|_| {})));
    assert_eq!(bench.agent.held(), Held::Unheard);
    bench.hears(&says(Some(BayPhase::Unloading), false));
    assert_eq!(bench.agent.held(), Held::LetsOut);
    bench.hears(&says(None, false));
    assert_eq!(bench.agent.held(), Held::Out);
    bench.hears(&says(None, false));
    assert_eq!(bench.agent.held(), Held::Out, "and stays so");
}

#[test]
fn a_station_that_is_restarted_without_its_robot_has_not_let_it_out() {
    let mut bench = bench();
    bench.enter_bay();
    bench.hears(&StationState { seq: 700, ..says(Some(BayPhase::Failed), false) });
    bench.hears(&StationState { seq: 1, ..says(None, false) });
    assert_eq!(bench.agent.held(), Held::No);
}

#[test]
fn what_a_station_said_at_the_last_visit_says_nothing_of_this_one() {
    let mut bench = bench();
    for _ in 0..3 {
        bench.arrive();
        assert_eq!(bench.agent.held(), Held::Unheard);
        bench.hears(&says(Some(BayPhase::Occupied), false));
        assert_eq!(bench.agent.held(), Held::InBay);
        // It falls silent: a minute and a half later it is not heard, at the third visit as at the first.
        (0..91).for_each(|_| drop(bench.observe(|_| {})));
        assert_eq!(bench.agent.held(), Held::Unheard);
        assert_eq!(bench.ask(RobotAction::Undock).0, Outcome::Accepted);
        bench.place = Place::Mission;
        (0..7200).for_each(|_| drop(bench.observe(|_| {})));
    }
}

#[test]
fn a_robot_is_not_called_away_from_under_its_stations_hands() {
    let mut bench = bench();
    bench.arrive();
    bench.ask(swap());
    bench.hears(&says(None, true));
    assert_eq!(reason(&bench.ask(RobotAction::Undock).0).0, Rejection::Busy);
    bench.hears(&says(None, false));
    assert_eq!(bench.ask(RobotAction::Undock), (Outcome::Accepted, vec![Act::Resume]));
}

#[test]
fn who_was_given_no_bay_learns_from_its_station_in_which_one_it_is() {
    let mut bench = bench();
    assert_eq!(bench.ask(RobotAction::Dock { station: station("mds-1"), bay: None }).0, Outcome::Accepted);
    bench.observe(|observation| observation.place = Place::AtStation);
    // Where no lift moves it, it has to go there.
    let goes = vec![Act::GoOnTo { station: station("mds-1"), bay: bay() }];
    assert_eq!(bench.hears(&says(Some(BayPhase::Failed), false)), []);
    assert_eq!(bench.hears(&says(Some(BayPhase::Loading), false)), goes);
    assert_eq!(bench.hears(&says(Some(BayPhase::Occupied), false)), []);
    bench.observe(|observation| observation.place = Place::InBay);
    assert_eq!((bench.agent.phase, bench.agent.bay.clone()), (RobotPhase::Docked, bay()));
}

#[test]
fn without_a_coordinator_a_charger_that_gives_only_when_asked_is_asked() {
    for (bay, acts_alone, phase) in [(bay(), vec![Act::Charge], RobotPhase::Charging), (None, vec![], RobotPhase::Waiting)] {
        let mut bench = bench();
        bench.ask(RobotAction::Dock { station: station("mds-1"), bay });
        bench.observe(|observation| observation.place = Place::AtStation);
        bench.agent.handle(bench.now, Input::Coordinator(false));
        bench.place = Place::InBay;
        let acts: Vec<Act> = (0..70).flat_map(|_| bench.observe(|_| {})).collect();
        assert_eq!((acts, bench.agent.phase), (acts_alone, phase), "who comes for an exchange has no bay");
    }
}

#[test]
fn a_charge_whose_end_nobody_saw_has_ended_where_the_robot_runs_on_its_battery_and_its_station_is_not_dark() {
    for (ends, is_dark) in [(true, false), (false, true)] {
        let mut bench = bench_at(0.9);
        bench.enter_bay();
        bench.ask(RobotAction::ChargeTo { soc: 1.0 });
        let flows = |current_a: f64, powered: bool| {
            move |observation: &mut Observation| {
                observation.powered = powered;
                observation.sample = Some(Sample { dt_s: SECOND, current_a, voltage_v: 12.5, temperature_degc: 25.0 });
            }
        };
        for current_a in [-1.3, -0.6, -0.15] {
            assert_eq!(bench.observe(flows(current_a, true)), []);
        }
        let acts: Vec<Act> = (0..60)
            .flat_map(|_| {
                bench.hears(&StationState { powered: !is_dark, ..says(Some(BayPhase::Occupied), false) });
                bench.observe(flows(0.3, false))
            })
            .collect();
        assert_eq!(acts, if ends { vec![Act::StopCharging] } else { vec![] });
        assert_eq!(bench.agent.phase, if ends { RobotPhase::Charged } else { RobotPhase::Charging });
    }
}

#[test]
fn a_charger_that_gives_only_when_asked_is_asked_again_once_its_station_has_power_again() {
    let mut bench = bench_at(0.4);
    bench.enter_bay();
    bench.ask(RobotAction::ChargeTo { soc: 0.9 });
    let after = |bench: &mut Bench, powered: bool, seconds: usize| -> Vec<Act> {
        let second = |_| {
            bench.hears(&StationState { powered, ..says(Some(BayPhase::Occupied), false) });
            bench.observe(|observation| observation.powered = false)
        };
        (0..seconds).flat_map(second).collect()
    };
    assert_eq!(after(&mut bench, false, 600), []);
    assert_eq!(after(&mut bench, true, 10), [Act::Charge]);
    assert_eq!(after(&mut bench, true, 300), [Act::Charge], "five minutes later");
    assert_eq!(bench.agent.phase, RobotPhase::Charging);
}

#[test]
fn a_charger_that_heat_stopped_is_asked_again_when_the_battery_has_cooled() {
    let mut bench = bench_at(0.4);
    bench.enter_bay();
    bench.ask(RobotAction::ChargeTo { soc: 0.9 });
    let second = |bench: &mut Bench, powered: bool, temperature_degc: f64| {
        bench.hears(&says(Some(BayPhase::Occupied), false));
        bench.observe(|observation| {
            observation.powered = powered;
            observation.sample = Some(Sample { dt_s: SECOND, current_a: 0.1, voltage_v: 12.0, temperature_degc });
        })
    };
    assert_eq!(second(&mut bench, true, 46.0), []);
    let hot: Vec<Act> = (0..300).flat_map(|_| second(&mut bench, false, 44.0)).collect();
    let cool: Vec<Act> = (0..10).flat_map(|_| second(&mut bench, false, 30.0)).collect();
    assert_eq!((hot, cool), (vec![], vec![Act::Charge]));
}
