//! Packs that gave out, over a restart.

use super::*;

/// The newest memory that an agent asks to be kept when it sees this.
fn kept(bench: &mut Bench, change: impl FnOnce(&mut Observation)) -> Option<Memory> {
    let mut observation = bench.shown.clone();
    change(&mut observation);
    bench.agent.handle(bench.now, Input::Observed(observation));
    let outputs: Vec<Output> = std::iter::from_fn(|| bench.agent.poll()).collect();
    outputs.into_iter().find_map(|output| if let Output::Keep(memory) = output { Some(*memory) } else { None })
}

#[test]
fn a_pack_that_gave_out_is_kept_with_its_charge_until_it_is_charged() {
    let mut before = bench();
    let said = energy::Estimate::new(0.02, 0.05);
    before.observe(|_| {});
    let gave_out = kept(&mut before, |seen| (seen.packs[1].depleted, seen.packs[1].said_soc) = (true, Some(said))).unwrap();
    assert_eq!(gave_out.depleted(), [(pack(2), Some(said))]);
    assert_eq!(kept(&mut before, |_| {}).unwrap().depleted(), [], "it was charged");
    let mut after = bench();
    after.agent.restore(gave_out.clone());
    assert_eq!(kept(&mut after, |seen| seen.packs[1].depleted = true), None, "nothing is new");
    // As memories were before they said it.
    let mut older = serde_json::to_value(&gave_out).unwrap();
    assert_eq!(serde_json::from_value::<Memory>(older.clone()).unwrap(), gave_out);
    assert!(older.as_object_mut().unwrap().remove("depleted").is_some());
    assert_eq!(serde_json::from_value::<Memory>(older).unwrap().depleted(), []);
}
