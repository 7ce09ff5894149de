//! Builds a plan robot by robot: each gets the slot with the earliest end that is still free.

use super::feasible::{Book, Refusal, Slot};
use super::plan::{Plan, Planned, Rejected};
use super::policy::Policy;
use super::problem::{OptionView, Problem, RobotView, Way};

/// A plan for every robot of the problem, in the order that the policy ranks them.
#[must_use]
pub fn construct(problem: &Problem, policy: &dyn Policy) -> Plan {
    let mut books: Vec<Book> = problem.stations.iter().map(Book::new).collect();
    let mut plan = Plan::default();
    // Promises that were given come first, so that a newcomer cannot take what was promised.
    let mut order = policy.rank(problem);
    order.sort_by_key(|&index| !problem.robots[index].promised);
    for (place, index) in order.into_iter().enumerate() {
        let robot = &problem.robots[index];
        let tried: Vec<(&OptionView, Result<Slot, Refusal>)> =
            robot.options.iter().map(|option| (option, books[option.station].slot(problem, robot, option))).collect();
        let best = tried.iter().filter_map(|(_, slot)| slot.as_ref().ok()).min_by(|a, b| a.end_s.total_cmp(&b.end_s));
        match best {
            Some(slot) => {
                books[slot.station].take(&problem.stations[slot.station], slot);
                plan.planned.push(Planned {
                    robot: robot.robot.clone(),
                    slot: slot.clone(),
                    why: why(problem, policy, place, robot, slot, &tried),
                });
            }
            None => plan.rejected.push(Rejected { robot: robot.robot.clone(), reasons: why_not(problem, &tried) }),
        }
    }
    plan.planned.sort_by(|a, b| a.slot.start_s.total_cmp(&b.slot.start_s).then_with(|| a.robot.cmp(&b.robot)));
    plan
}

fn describe(problem: &Problem, option: &OptionView) -> String {
    let how = match option.way {
        Way::Recharge { .. } => "recharge",
        Way::Swap { .. } => "exchange",
    };
    format!("{how} at {}", problem.stations[option.station].station)
}

fn why(
    problem: &Problem,
    policy: &dyn Policy,
    place: usize,
    robot: &RobotView,
    best: &Slot,
    tried: &[(&OptionView, Result<Slot, Refusal>)],
) -> Vec<String> {
    let mut why = vec![
        format!("number {} of {} by {} ({})", place + 1, problem.robots.len(), policy.name(), policy.reason(robot)),
        format!(
            "takes {:.1} Wh from {}; the packs hold it with probability {:.1} %",
            best.need.mean_wh,
            names(&best.packs),
            best.probability * 100.0
        ),
    ];
    for (option, slot) in tried {
        match slot {
            Ok(slot) if slot == best => {}
            Ok(slot) => why.push(format!("not {}: ends {:.0} min later", describe(problem, option), (slot.end_s - best.end_s) / 60.0)),
            Err(refusal) => why.push(format!("not {}: {refusal}", describe(problem, option))),
        }
    }
    why
}

fn why_not(problem: &Problem, tried: &[(&OptionView, Result<Slot, Refusal>)]) -> Vec<String> {
    if tried.is_empty() {
        return vec!["no station is in reach".to_owned()];
    }
    let refused = tried.iter().filter_map(|(option, slot)| slot.as_ref().err().map(|refusal| (option, refusal)));
    refused.map(|(option, refusal)| format!("{}: {refusal}", describe(problem, option))).collect()
}

fn names(packs: &[proto::PackId]) -> String {
    if packs.is_empty() { "no pack".to_owned() } else { packs.iter().map(ToString::to_string).collect::<Vec<_>>().join(" and ") }
}
