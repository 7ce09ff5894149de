//! Steps of a second against brute-force integration in steps of 10 ms.

#[path = "../drive/mod.rs"]
mod drive;

/// The bound is the project's own: 0.1 mV, a tenth of a fuel gauge's step.
#[test]
fn second_steps_agree_with_a_fine_integration_of_the_equations() {
    for (more, amplitude_v) in [("", 0.0), (drive::HYSTERESIS, 0.01)] {
        let (model, profile) = (drive::model(more), drive::profile());
        let [volts, kelvins] =
            drive::greatest_difference(&drive::stepped(&model, &profile), &drive::integrated(&model, &profile, amplitude_v));
        assert!(volts < 1e-4, "{volts} V");
        assert!(kelvins < 0.01, "{kelvins} K");
    }
}
