//! A step allocates nothing, whatever the effects: fleets are stepped a million times a second.

use allocation_counter::measure;
use energy::effect::Lane;
use energy::{Batch, Channel, Dual, Run, Start};

use crate::{built_in, everything};

/// Allocations of a hundred steps of one length, the first of which was made before.
fn of_steps<S: Lane>(run: &mut Run<S>, input: Channel, value: f64) -> u64 {
    run.channels[input] = S::from(value);
    run.step(1.0);
    measure(|| (0..100).for_each(|_| run.step(1.0))).count_total
}

#[test]
fn a_step_allocates_nothing() {
    let (battery, start) = (everything(), Start::at_soc(0.8));
    assert_eq!(of_steps(&mut Run::new(battery.clone(), start), Channel::CurrentA, 1.0), 0);
    let duals = battery.values().into_iter().map(Dual::from).collect();
    assert_eq!(of_steps(&mut Run::<Dual>::with_parameters(battery, duals, start.lifted()), Channel::CurrentA, 1.0), 0);
    for robot in ["explorer-robot", "aquapod-robot", "roomba-robot"] {
        assert_eq!(of_steps(&mut Run::new(built_in(robot), start), Channel::SpeedMps, 0.1), 0, "{robot}");
    }
    assert_eq!(of_steps(&mut Run::new(built_in("mds-station"), start), Channel::ChargePowerW, 20.0), 0);
}

#[test]
fn neither_does_one_of_many_runs_together() {
    let mut batch = Batch::new(built_in("mds-3s4p-7600mah"), &[Start::at_soc(0.8); 100]);
    batch.step(1.0);
    assert_eq!(measure(|| (0..100).for_each(|_| batch.step(1.0))).count_total, 0);
}
