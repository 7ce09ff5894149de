//! What a station has to hand out.

use device::UNKNOWN_SOC;

use super::*;

#[test]
fn a_spare_is_ready_as_long_as_what_measures_it_says_that_it_is_charged() {
    let mut bench = bench();
    let lies = |soc: f64| vec![(spare(1), energy::Estimate::new(soc, 0.02))];
    bench.observe(|seen| seen.uncharged = lies(0.9));
    assert_eq!(reason(&bench.ask(swap("a", 1)).0), (Rejection::NotPossible, "spare spare-1 is not ready"));
    let told = bench.agent.state_message(bench.now).spares.remove(0);
    assert_eq!((told.soc, told.ready), (proto::Estimate::new(0.9, 0.02), false));
    bench.observe(|seen| seen.charged = lies(0.97));
    assert_eq!(bench.ask(swap("a", 1)).0, Outcome::Accepted);
    // It is on its way to the robot.
    bench.observe(|seen| seen.charged = lies(0.97));
    assert!(!bench.agent.state_message(bench.now).spares[0].ready);
}

#[test]
fn a_spare_that_is_measured_is_not_ready_after_a_restart_before_its_device_has_spoken() {
    let mut before = bench();
    let command = before.command(dock("a", 1));
    before.agent.handle(before.now, Input::Command(command));
    let Some(Output::Keep(memory)) = before.agent.poll() else { panic!("nothing is kept") };
    let mut after = bench();
    after.agent.spares[0].ready = false;
    after.agent.restore(*memory);
    assert_eq!(after.agent.spares.iter().map(|spare| spare.ready).collect::<Vec<_>>(), [false, true]);
}

#[test]
fn an_exchange_that_is_called_off_leaves_station_and_robot_free_and_its_spare_unknown() {
    let mut bench = bench();
    assert_eq!(bench.ask(swap("a", 1)).0, Outcome::Accepted);
    bench.observe(|seen| seen.called_off = Some((robot("a"), spare(2))));
    assert!(bench.agent.state_message(bench.now).swapping.is_some(), "that is another one");
    bench.observe(|seen| seen.called_off = Some((robot("a"), spare(1))));
    let told = bench.agent.state_message(bench.now);
    assert_eq!((told.swapping, told.spares[0].ready, told.spares[0].soc), (None, false, wire(UNKNOWN_SOC)));
    assert_eq!(bench.ask(swap("a", 2)).0, Outcome::Accepted);
}
