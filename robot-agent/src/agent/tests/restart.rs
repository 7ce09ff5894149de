//! An agent that is restarted, or whose gauge begins anew.

use super::*;

/// The newest memory that an agent asked to be kept.
fn kept(bench: &mut Bench, input: Input) -> Memory {
    bench.agent.handle(bench.now, input);
    let outputs: Vec<Output> = std::iter::from_fn(|| bench.agent.poll()).collect();
    // It stands before everything that rests on it.
    let Some(Output::Keep(memory)) = outputs.into_iter().next() else { panic!("nothing is kept") };
    *memory
}

#[test]
fn a_restarted_agent_answers_from_memory_and_does_again_what_was_not_done() {
    let mut before = bench();
    let command = before.command(dock());
    let memory = kept(&mut before, Input::Command(command.clone()));
    let mut after = bench();
    after.agent.restore(memory);
    // The robot never heard that it should leave: the kill came in between.
    assert_eq!(after.observe(|_| {}), [Act::TravelTo { station: station("mds-1"), bay: bay() }]);
    let (outcome, acts) = after.give(command.clone());
    assert_eq!((outcome, acts), (Outcome::Accepted, Vec::new()), "a copy acts no second time");
    let stale = RobotCommand { id: CommandId::new("c0-1").unwrap(), epoch: 0, ..command };
    assert!(matches!(after.give(stale).0, Outcome::Rejected { reason: Rejection::StaleEpoch, .. }));
}

#[test]
fn who_was_on_its_way_back_to_work_when_its_agent_ended_is_sent_there_once_more() {
    let mut before = bench();
    before.arrive();
    let command = before.command(RobotAction::Undock);
    let memory = kept(&mut before, Input::Command(command));
    let acts = |change: fn(usize, &mut Observation)| {
        let mut after = bench();
        after.agent.restore(memory.clone());
        let acts: Vec<Act> = (0..90).flat_map(|second| after.observe(|observation| change(second, observation))).collect();
        (acts, after.agent.phase)
    };
    assert_eq!(acts(|_, _| {}), (vec![Act::Resume], RobotPhase::Working));
    // Who was plugged in meanwhile stays, and so does who is not heard.
    let plugged_in = |second: usize, observation: &mut Observation| {
        observation.powered = second > 0;
        observation.place = if second < 10 { Place::Mission } else { Place::InBay };
    };
    assert!(!acts(plugged_in).0.contains(&Act::Resume));
    assert_eq!(acts(|_, observation| observation.sample = None).0, []);
}

#[test]
fn who_is_restarted_during_an_exchange_waits_for_its_pack() {
    let mut before = bench();
    before.arrive();
    let command = before.command(swap());
    let memory = kept(&mut before, Input::Command(command));
    assert_eq!(memory.place(), Some(Place::AtStation));
    let mut after = bench();
    after.place = memory.place().unwrap();
    after.agent.restore(memory);
    assert_eq!((after.observe(|_| {}), after.agent.phase), (vec![], RobotPhase::Swapping));
    after.observe(|observation| observation.exchanged = Some(energy::Estimate::new(0.97, 0.01)));
    assert_eq!((after.hears(&says(None, false)), after.agent.phase), (vec![Act::Resume], RobotPhase::Working));
}

#[test]
fn a_gauge_that_begins_anew_with_the_old_pack_is_no_other_pack() {
    let shows = |bench: &mut Bench, soc: f64| {
        bench.observe(|observation| {
            let soc = energy::Estimate::new(soc, 0.05);
            (observation.exchanged, observation.said_soc) = (Some(soc), Some(soc));
        })
    };
    let mut before = bench();
    before.arrive();
    before.observe(|observation| observation.said_soc = Some(energy::Estimate::new(0.2, 0.05)));
    let command = before.command(swap());
    let memory = kept(&mut before, Input::Command(command));
    let mut after = bench();
    after.place = memory.place().unwrap();
    after.agent.restore(memory);
    // The agent was restarted while the old pack was still in; then the network was away for a minute.
    for _ in 0..2 {
        assert_eq!((shows(&mut after, 0.21), after.agent.phase), (vec![], RobotPhase::Swapping));
        assert_eq!((after.hears(&says(None, true)), after.agent.phase), (vec![], RobotPhase::Swapping));
        assert!((after.agent.soc().value - 0.21).abs() < 1e-3, "the gauge goes on from what the device says");
    }
    assert_eq!((shows(&mut after, 0.97), after.agent.phase), (vec![], RobotPhase::Swapping));
    assert_eq!((after.hears(&says(None, false)), after.agent.phase), (vec![Act::Resume], RobotPhase::Working));
}
