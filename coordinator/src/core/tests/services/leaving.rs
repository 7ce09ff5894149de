//! Services at a station that leaves.

use super::*;
use crate::models::ShortEnergy;
use crate::trust::{Owner, Trust};

#[test]
fn whoever_charges_is_let_out_before_the_station_leaves() {
    let mut core = begun(How::Recharge { bay: id("bay-1"), to_soc: 0.98 }, Stage::Charging);
    says(&mut core, 110.0, "r0", RobotPhase::Charging);
    let leaves = StationState {
        at: at(110.0),
        seq: 110_002,
        bays: vec![BayState { bay: id("bay-1"), phase: BayPhase::Occupied, robot: Some(id("r0")) }],
        away: vec![proto::Absence { leaves: at(1_000.0), returns: None }],
        ..core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap()
    };
    core.handle(at(110.0), Input::StationState(id("s"), leaves));
    let asked = |core: &mut Core, time_s: f64| {
        core.handle(at(time_s), Input::Tick);
        let undocks = |output: &Output| matches!(output, Output::ToRobot(_, command) if command.action == proto::RobotAction::Undock);
        std::iter::from_fn(|| core.poll()).filter(undocks).count()
    };
    // The lift takes its time, and the robot may have to be asked twice.
    let takes_s = core.models.stations[&id::<StationId>("s")].handling.unload_s + core.settings.deadline_s;
    assert_eq!(asked(&mut core, 1_000.0 - takes_s - 1.0), 0);
    assert_eq!(asked(&mut core, 1_000.0 - takes_s + 1.0), 1);
    let run = &core.running[&id::<RobotId>("r0")];
    assert_eq!(run.cut_short.as_deref(), Some("s leaves at 00:16"));
}

#[test]
fn who_comes_before_its_station_leaves_is_called_back_once_and_who_comes_when_it_is_back_goes_on() {
    // Robots on their way at 10 s, to begin at 100 s; what takes a lift in and out takes a minute or so.
    for (leaves_s, returns_s, goes_on) in [
        (5_000.0, None, true),
        (110.0, None, false),
        (110.0, Some(400.0), false),
        (50.0, Some(90.0), true),
        (50.0, Some(200.0), true),
        (50.0, None, false),
    ] {
        let mut core = begun(recharge(), Stage::Travelling);
        says(&mut core, 9.0, "r0", RobotPhase::Travelling);
        let away = vec![proto::Absence { leaves: at(leaves_s), returns: returns_s.map(at) }];
        let state = core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap();
        core.handle(at(10.0), Input::StationState(id("s"), StationState { at: at(10.0), seq: 10_002, away, ..state }));
        // It has not heard yet that it is called back.
        (11..15).for_each(|time_s| core.handle(at(f64::from(time_s)), Input::Tick));
        let failed = noted(&mut core).into_iter().filter(|kind| *kind == EventKind::ServiceFailed).count();
        assert_eq!(
            (failed, core.running.contains_key(&id::<RobotId>("r0"))),
            (usize::from(!goes_on), goes_on),
            "{leaves_s}, {returns_s:?}"
        );
    }
}

#[test]
fn of_several_the_last_to_be_charged_is_let_out_last() {
    let mut core = begun(How::Recharge { bay: id("bay-1"), to_soc: 0.98 }, Stage::Charging);
    joins(&mut core, 0.0, 1);
    let soon = How::Recharge { bay: id("bay-2"), to_soc: 0.5 };
    core.running.insert(id("r1"), ServiceRun { how: soon, stage: Stage::Charging, end: at(690.0), ..waits(1, 100.0) });
    says(&mut core, 110.0, "r0", RobotPhase::Charging);
    says(&mut core, 110.0, "r1", RobotPhase::Charging);
    let state = core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap();
    let bay = |bay: &str, robot: &str| BayState { bay: id(bay), phase: BayPhase::Occupied, robot: Some(id(robot)) };
    let away = vec![proto::Absence { leaves: at(600.0), returns: Some(at(900.0)) }];
    let bays = vec![bay("bay-1", "r0"), bay("bay-2", "r1")];
    core.handle(at(110.0), Input::StationState(id("s"), StationState { at: at(110.0), seq: 110_002, bays, away, ..state }));
    let (lift_s, deadline_s) = (core.models.stations[&id::<StationId>("s")].handling.unload_s, core.settings.deadline_s);
    let cut = |core: &mut Core, time_s: f64| {
        core.handle(at(time_s), Input::Tick);
        ["r0", "r1"].map(|robot| core.running[&id::<RobotId>(robot)].cut_short.is_some())
    };
    assert!(lift_s > 2.0);
    assert_eq!(cut(&mut core, 600.0 - deadline_s - 2.0 * lift_s - 1.0), [false, false]);
    assert_eq!(cut(&mut core, 600.0 - deadline_s - 2.0 * lift_s + 1.0), [false, true]);
    assert_eq!(cut(&mut core, 600.0 - deadline_s - lift_s + 1.0), [true, true]);
}

#[test]
fn whoever_charges_is_let_out_before_the_packs_give_out_unless_something_comes() {
    // At 60 W, by hand: half a minute for the lift and one for what nobody knows, of which 30 s are 0.5 Wh. A pack of 84 Wh at 80 % lasts for an hour,
    // one at 1 % for less than a minute at this power.
    let told = |soc: f64, remaining_wh: f64, back: Option<f64>, is_believed: bool| {
        let mut core = begun(How::Recharge { bay: id("bay-1"), to_soc: 0.98 }, Stage::Charging);
        says(&mut core, 110.0, "r0", RobotPhase::Charging);
        holds(&mut core, 110.0, BayPhase::Occupied, Some("r0"));
        if is_believed {
            core.trust.forget(&Owner::Pack(id("s"), id("p")));
        }
        let left = Gauge { remaining_wh: Estimate::new(remaining_wh, 0.1), ..gauge(111.0, soc, 84.0) };
        core.handle(at(111.0), Input::PackGauge(id("s"), id("p"), left));
        let mut state =
            StationState { at: at(112.0), seq: 112_002, pack_power_w: 60.0, ..core.fleet.stations[&id("s")].state.clone().unwrap() };
        let back = back.map(|at_s| proto::PackReturn { at: at(at_s), soc: Estimate::new(1.0, 0.01) });
        state.packs.extend(back.map(|back| PackState { pack: id("q"), connected: false, depleted: false, back: Some(back) }));
        core.handle(at(112.0), Input::StationState(id("s"), state));
        core.running[&id::<RobotId>("r0")].cut_short.clone()
    };
    let let_go = |soc: f64, remaining_wh: f64, back: Option<f64>| told(soc, remaining_wh, back, true);
    let why = Some("the packs of s hold no more than lets everybody out".to_owned());
    assert_eq!(let_go(0.8, 60.0, None), None);
    assert_eq!(let_go(0.8, 1.2, None), why, "its gauge is nearer to it");
    assert_eq!(let_go(0.012, 3.0, None), why, "what it says lasts for no service");
    assert_eq!(let_go(0.1, 7.0, None), None);
    assert_eq!(told(0.1, 7.0, None, false), why, "its gauge was at 100 % a moment ago: nothing is there for certain");
    // 1.6 Wh are surely 1.44, or 86 s, of which 60 are for what nobody knows.
    assert_eq!(let_go(0.1, 1.6, Some(130.0)), None, "another one comes in time");
    assert_eq!([let_go(0.012, 1.0, Some(500.0)), let_go(0.012, 1.0, Some(30.0))], [why.clone(), why], "too late, or overdue");
}

#[test]
fn where_packs_hold_less_than_was_promised_the_one_who_takes_most_is_let_go_before_all_lose_it() {
    // Two charge, from 80 % and from 30 %; the station's pack turns out to hold a fifth of what was counted.
    let let_go = |soc: f64, short_energy: ShortEnergy| {
        let mut core = begun(How::Recharge { bay: id("bay-1"), to_soc: 0.98 }, Stage::Charging);
        core.settings.short_energy = short_energy;
        joins(&mut core, 0.0, 1);
        let other = How::Recharge { bay: id("bay-2"), to_soc: 0.98 };
        let runs =
            [core.running.remove(&id::<RobotId>("r0")).unwrap(), ServiceRun { how: other, stage: Stage::Charging, ..waits(1, 100.0) }];
        for (robot, soc) in [("r0", 0.8), ("r1", 0.3)] {
            says(&mut core, 110.0, robot, RobotPhase::Charging);
            core.handle(at(110.0), Input::RobotGauge(id(robot), gauge(110.0, soc, 14.6)));
        }
        let state = core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap();
        let bay = |bay: &str, robot: &str| BayState { bay: id(bay), phase: BayPhase::Occupied, robot: Some(id(robot)) };
        let bays = vec![bay("bay-1", "r0"), bay("bay-2", "r1")];
        core.handle(at(110.0), Input::StationState(id("s"), StationState { at: at(110.0), seq: 110_002, bays, ..state }));
        core.running.extend(runs.map(|run| (run.robot.clone(), run)));
        // (It has not jumped: nobody had heard it before.)
        core.trust = Trust::default();
        core.handle(at(111.0), Input::PackGauge(id("s"), id("p"), gauge(111.0, soc, 84.0)));
        for time_s in (112..160).step_by(4).map(f64::from) {
            for (robot, soc) in [("r0", 0.8), ("r1", 0.3)] {
                let charges = Gauge { power_w: -14.0, current_a: -1.3, ..gauge(time_s, soc, 14.6) };
                core.handle(at(time_s), Input::RobotGauge(id(robot), charges));
                says(&mut core, time_s, robot, RobotPhase::Charging);
            }
            core.handle(at(time_s), Input::Tick);
        }
        ["r0", "r1"].map(|robot| core.running[&id::<RobotId>(robot)].cut_short.is_some())
    };
    assert_eq!(let_go(0.9, ShortEnergy::WholeCharges), [false, false]);
    // By hand: 3 and 10 Wh into the robots are some 6 and 18 Wh of the pack; by the time that the first is charged the second has taken as much.
    // 15 % of 84 Wh are 12.6.
    assert_eq!(let_go(0.15, ShortEnergy::WholeCharges), [false, true]);
    assert_eq!(let_go(0.15, ShortEnergy::MostRobots), [false, false], "there all get something");
}

/// Who stands before a bay is not lifted in where nobody would get out again, nor sent there again at once.
#[test]
fn nobody_is_taken_in_by_a_station_that_is_about_to_give_out() {
    // Half a minute in and half a minute out, one for what nobody knows: 2 min at 60 W are 2 Wh.
    let goes_on = |remaining_wh: f64, stage: Stage| {
        let mut core = begun(recharge(), stage);
        // All is as it is before the service is looked at.
        let run = core.running.remove(&id::<RobotId>("r0")).unwrap();
        let phase = if stage == Stage::Waiting { RobotPhase::Waiting } else { RobotPhase::Travelling };
        says(&mut core, 9.0, "r0", phase);
        let left = Gauge { remaining_wh: Estimate::new(remaining_wh, 0.1), ..gauge(10.0, 0.8, 84.0) };
        core.handle(at(10.0), Input::PackGauge(id("s"), id("p"), left));
        let state = core.fleet.stations[&id::<StationId>("s")].state.clone().unwrap();
        core.handle(at(11.0), Input::StationState(id("s"), StationState { at: at(11.0), seq: 11_002, pack_power_w: 60.0, ..state }));
        core.running.insert(id("r0"), run);
        core.handle(at(12.0), Input::Tick);
        let is_refused = core.refusals.holds(at(13.0), &id("r0"), &id("s")).is_some();
        (core.running.contains_key(&id::<RobotId>("r0")), is_refused)
    };
    assert_eq!(goes_on(30.0, Stage::Waiting), (true, false));
    assert_eq!(goes_on(1.8, Stage::Waiting), (false, true));
    assert_eq!(goes_on(1.8, Stage::Travelling), (true, false), "until it has come others may have left");
}
