//! What was promised stays promised.

use super::*;

/// Services that come later miss less work and take more energy. What was promised must not pay for that.
#[test]
fn as_long_as_all_goes_as_foreseen_no_promise_is_broken_by_planning_again() {
    // From enough for one to enough for all four.
    for usable_wh in (30..120).step_by(5).map(f64::from) {
        let mut before = Plan::default();
        for minute in 0..90 {
            let passed_h = f64::from(minute) / 60.0;
            let held = |name: &str| before.planned.iter().any(|planned| planned.robot.as_str() == name);
            let there = |name: &&str| RobotView { held: held(name), ..robot(name, 0.5 - 0.3 * passed_h, &[(0, 60.0)]) };
            let robots: Vec<RobotView> = ["a", "b", "c", "d"].iter().map(there).collect();
            let mut view = view(robots, vec![station("s", 2, &[usable_wh - 6.0 * passed_h], &[])]);
            view.now = view.now.plus_s(passed_h * HOUR);
            let plan = solve(view.clone(), &settings(), &before, Effort::Whole).plan;
            let broken = before.planned.iter().find(|old| plan.planned.iter().all(|new| new.robot != old.robot));
            assert!(broken.is_none(), "{usable_wh} Wh, minute {minute}: {broken:?}, {:?}", plan.rejected);
            if plan.planned.iter().any(|planned| planned.leave < view.now.plus_s(60.0)) {
                break;
            }
            before = plan;
        }
    }
}
