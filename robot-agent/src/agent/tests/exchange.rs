//! What shows that another pack was put in, where agent and gauge stay powered.

use super::*;

/// A second in which the device says that of its charge, and an absurd current for what it has leapt by.
fn shows(bench: &mut Bench, soc: f64, current_a: f64) -> Vec<Act> {
    bench.observe(|observation| {
        observation.said_soc = Some(energy::Estimate::new(soc, 0.05));
        observation.sample.as_mut().unwrap().current_a = current_a;
    })
}

#[test]
fn a_pack_that_is_put_in_while_the_agent_stays_powered_is_noticed_by_its_charge() {
    let mut bench = bench();
    bench.arrive();
    assert_eq!(shows(&mut bench, 0.2, 0.4), []);
    assert_eq!(bench.ask(swap()).0, Outcome::Accepted);
    // It rests, the gauge loses its pack, finds the same one, and then another.
    for soc in [0.2, 0.23, 0.0, 0.2] {
        assert_eq!((shows(&mut bench, soc, 0.4), bench.agent.phase), (vec![], RobotPhase::Swapping));
    }
    assert_eq!((shows(&mut bench, 0.95, -3000.0), bench.agent.phase), (vec![], RobotPhase::Swapping));
    assert_eq!((bench.hears(&says(None, false)), bench.agent.phase), (vec![Act::Resume], RobotPhase::Working));
    assert!((bench.agent.soc().value - 0.95).abs() < 1e-3, "{:?}", bench.agent.soc());
    assert_eq!(bench.agent.last.unwrap().current_a, 0.4, "no such current has flowed");
}

#[test]
fn a_charge_that_leaps_while_nothing_is_exchanged_is_no_other_pack() {
    let mut bench = bench();
    bench.arrive();
    let counted = bench.agent.soc().value;
    for soc in [0.2, 0.95] {
        assert_eq!(shows(&mut bench, soc, 0.0), []);
    }
    assert!(bench.agent.phase == RobotPhase::Waiting && (bench.agent.soc().value - counted).abs() < 1e-3);
    // What was said before the exchange counts, however it came to be.
    assert_eq!(bench.ask(swap()).0, Outcome::Accepted);
    assert_eq!((shows(&mut bench, 0.95, 0.0), bench.agent.phase), (vec![], RobotPhase::Swapping));
}
