//! What whole ticks must not change.

use super::*;
use crate::scheduler::translate::Offer;

fn task(robots: Vec<RobotView>, stations: Vec<StationView>) -> Task {
    Task::new(view(robots, stations), &settings(), &[], Offer::Usual)
}

/// A robot that lasts so long, s, and wants a service a tenth before that.
fn lasting(name: &str, empty_s: f64) -> RobotView {
    let mut robot = robot(name, 0.3, &[(0, 60.0)]);
    for lasts in [&mut robot.lasts, &mut robot.ways[0].lasts] {
        (lasts.empty_s, lasts.surely_s) = (empty_s, empty_s);
    }
    robot.wanted_s = 0.9 * empty_s;
    robot
}

#[test]
fn a_mission_ends_when_it_ends_wherever_in_a_tick_it_is_planned() {
    for seconds in 0..10_u8 {
        // At the end of a tick.
        let until_s = 0.5 * HOUR - f64::from(seconds);
        let worker = RobotView { until_s: Some(until_s), ..robot("r", 0.3, &[(0, 60.0)]) };
        let mut view = view(vec![worker], vec![station("s", 1, &[80.0], &[])]);
        view.now = Timestamp::from_unix_ms(1_767_225_600_000 + 1000 * i64::from(seconds));
        let task = Task::new(view, &settings(), &[], Offer::Usual);
        let ends = task.grid.time(task.problem.robots[0].mission_end as u32);
        assert_eq!(ends.seconds_since(task.view.now), until_s, "{seconds} s into a tick of {} s", task.grid.tick_s);
    }
}

#[test]
fn a_service_is_on_offer_where_no_tick_lies_between_wanting_it_and_having_to_have_it() {
    // One that lasts for long makes ticks of minutes; the other has a tenth of ten between wanting and needing a service.
    let stays = RobotView { wanted_s: 40.0 * HOUR, ..robot("stays", 0.9, &[(0, 60.0)]) };
    let stations: Vec<StationView> = (0..10).map(|n| station(&format!("s{n}"), 1, &[80.0], &[])).collect();
    for minutes in 5..15 {
        let task = task(vec![lasting("hurried", 60.0 * f64::from(minutes)), stays.clone()], stations.clone());
        assert!(task.grid.tick_s >= 60, "{}", task.grid.tick_s);
        let hurried = &task.problem.robots[0];
        let last = hurried.last_start(&hurried.travel[0], task.problem.batteries[hurried.battery].floor);
        assert!(i64::from(hurried.not_before) <= last, "{minutes} min: from {} to {last}", hurried.not_before);
    }
}

#[test]
fn the_distance_that_is_told_is_the_distance() {
    // In ticks of minutes, two minutes are a whole one and what has gone of this one.
    let stays = RobotView { wanted_s: 40.0 * HOUR, ..robot("stays", 0.9, &[(0, 60.0)]) };
    let mut low = lasting("low", 100.0);
    low.ways[0].time_s = 120.0;
    for lasts in [&mut low.lasts, &mut low.ways[0].lasts] {
        lasts.expected_s = Estimate::new(101.0, 1.0);
    }
    let stations: Vec<StationView> = (0..20).map(|n| station(&format!("s{n}"), 1, &[80.0], &[])).collect();
    let plan = solved(vec![low, stays], stations).plan;
    let why = &plan.rejected[0].reasons[0];
    assert!(why.contains("it is 2 min away, where") || why.contains("it is 2 min away, and"), "{why}");
}

#[test]
fn a_spare_that_is_ready_goes_before_a_fuller_one_that_will_be_within_the_tick() {
    let given = |ready_s: f64| {
        let mut rack = station("rack", 0, &[80.0], &[0.97, 0.99]);
        rack.spares[1].ready_s = ready_s;
        let found = solved(vec![robot("a", 0.12, &[(0, 60.0)])], vec![rack]);
        let start_s = found.plan.planned[0].start.seconds_since(found.task.view.now);
        (found.plan.planned[0].spare.as_ref().unwrap().to_string(), start_s, f64::from(found.task.grid.tick_s))
    };
    let (_, start_s, tick_s) = given(0.0);
    assert_eq!(given(start_s - 1.0).0, "spare-1");
    assert_eq!(given(start_s + tick_s / 2.0).0, "spare-0");
}
