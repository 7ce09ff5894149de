use super::*;

/// A 1320 mAh pack of 4.2 V cells that is charged at 1.32 A.
fn limits() -> Limits {
    Limits::of(4.2, 3.0, 1.32, 1.32)
}

const FINE: Measured = Measured { cell_min_v: 3.7, cell_max_v: 3.71, current_a: 0.4, temperature_degc: 25.0 };

const OPEN: Allowed = Allowed { charge: Ok(()), discharge: Ok(()) };

fn run(protection: &mut Protection, seconds: u32, measured: &Measured) -> Allowed {
    (0..seconds).map(|_| protection.step(1.0, measured)).last().unwrap()
}

#[test]
fn an_ordinary_day_trips_nothing() {
    let mut protection = Protection::new(&limits());
    for current_a in [0.0, 1.3, -1.32] {
        for volts in [3.0, 3.7, 4.2] {
            for temperature_degc in [1.0, 25.0, 44.0] {
                let measured = Measured { cell_min_v: volts, cell_max_v: volts, current_a, temperature_degc };
                assert_eq!(run(&mut protection, 100, &measured), OPEN, "{measured:?}");
            }
        }
    }
}

#[test]
fn a_high_cell_stops_charge_after_its_delay_and_until_it_has_come_down() {
    let mut protection = Protection::new(&limits());
    let high = Measured { cell_max_v: 4.31, current_a: -1.0, ..FINE };
    assert_eq!(protection.step(1.9, &high), OPEN);
    // A break in between begins the delay anew.
    assert_eq!(protection.step(0.1, &FINE), OPEN);
    assert_eq!(protection.step(1.9, &high), OPEN);
    let stopped = Allowed { charge: Err(Trip::OverVoltage), discharge: Ok(()) };
    assert_eq!(protection.step(0.2, &high), stopped);
    // Below the threshold and above the release nothing changes.
    assert_eq!(run(&mut protection, 1000, &Measured { cell_max_v: 4.2, current_a: 0.0, ..FINE }), stopped);
    assert_eq!(run(&mut protection, 1, &Measured { cell_max_v: 4.09, ..FINE }), OPEN);
}

#[test]
fn the_weakest_cell_stops_discharge_and_a_charge_may_bring_it_back() {
    let mut protection = Protection::new(&limits());
    let low = Measured { cell_min_v: 2.69, cell_max_v: 3.4, ..FINE };
    let stopped = Allowed { charge: Ok(()), discharge: Err(Trip::UnderVoltage) };
    assert_eq!(run(&mut protection, 2, &low), stopped);
    assert_eq!(run(&mut protection, 100, &Measured { cell_min_v: 2.95, current_a: -1.0, ..FINE }), stopped);
    assert_eq!(run(&mut protection, 1, &Measured { cell_min_v: 3.0, current_a: -1.0, ..FINE }), OPEN);
}

#[test]
fn a_short_opens_both_at_once_and_an_overload_waits() {
    let mut protection = Protection::new(&limits());
    let short = Measured { current_a: 20.0, ..FINE };
    let allowed = protection.step(1e-3, &short);
    assert_eq!(allowed, Allowed { charge: Err(Trip::ShortCircuit), discharge: Err(Trip::ShortCircuit) });
    // The current is gone since the switches opened; they close after five quiet seconds.
    let quiet = Measured { current_a: 0.0, ..FINE };
    assert_eq!(run(&mut protection, 4, &quiet), allowed);
    assert_eq!(run(&mut protection, 1, &quiet), OPEN);

    // bq28z610 presets: an overload of discharge must last six seconds.
    let overload = Measured { current_a: 6.0, ..FINE };
    assert_eq!(run(&mut protection, 5, &overload), OPEN);
    assert_eq!(run(&mut protection, 1, &overload), Allowed { charge: Ok(()), discharge: Err(Trip::OverCurrentDischarge) });
}

#[test]
fn charge_and_discharge_have_their_own_overcurrents() {
    let mut protection = Protection::new(&limits());
    let into = Measured { current_a: -2.0, ..FINE };
    assert_eq!(run(&mut protection, 2, &into), Allowed { charge: Err(Trip::OverCurrentCharge), discharge: Ok(()) });
    assert_eq!(run(&mut Protection::new(&limits()), 100, &Measured { current_a: 2.0, ..FINE }), OPEN);
}

#[test]
fn below_freezing_there_is_no_charge_and_still_a_discharge() {
    // JEITA: no charge below 0 degC. Makers of LiCoO2 pouch cells: discharge from -20 degC on.
    let at = |temperature_degc: f64| run(&mut Protection::new(&limits()), 3, &Measured { temperature_degc, ..FINE });
    assert_eq!(at(-1.0), Allowed { charge: Err(Trip::UnderTemperatureCharge), discharge: Ok(()) });
    assert_eq!(at(-25.0), Allowed { charge: Err(Trip::UnderTemperatureCharge), discharge: Err(Trip::UnderTemperatureDischarge) });
    assert_eq!(at(50.0), Allowed { charge: Err(Trip::OverTemperatureCharge), discharge: Ok(()) });
    assert_eq!(at(61.0), Allowed { charge: Err(Trip::OverTemperatureCharge), discharge: Err(Trip::OverTemperatureDischarge) });
}

#[test]
fn what_is_not_a_number_is_beyond_every_limit_and_releases_none() {
    let broken = Measured { cell_min_v: f64::NAN, cell_max_v: f64::NAN, current_a: f64::NAN, temperature_degc: f64::NAN };
    let mut protection = Protection::new(&limits());
    run(&mut protection, 10, &broken);
    assert_eq!(protection.tripped().collect::<Vec<_>>(), Trip::ALL);
    run(&mut protection, 100, &broken);
    assert_eq!(protection.tripped().count(), Trip::ALL.len());
    assert_eq!(run(&mut protection, 6, &Measured { current_a: 0.0, ..FINE }), OPEN);
}

#[test]
fn the_length_of_steps_does_not_move_a_trip_in_time() {
    for steps in [1, 4, 64] {
        let mut protection = Protection::new(&limits());
        let high = Measured { cell_max_v: 4.4, ..FINE };
        let last = (0..steps).map(|_| protection.step(2.0 / f64::from(steps), &high)).last().unwrap();
        assert_eq!(last.charge, Err(Trip::OverVoltage), "{steps}");
        let before = (1..steps).fold(Protection::new(&limits()), |mut protection, _| {
            protection.step(2.0 / f64::from(steps), &high);
            protection
        });
        assert_eq!(before.allowed(), OPEN);
    }
}

#[test]
fn every_reason_has_its_place_in_the_list_and_opens_a_switch() {
    for (index, trip) in Trip::ALL.into_iter().enumerate() {
        assert_eq!(trip as usize, index);
        assert!(trip.stops_charge() || trip.stops_discharge());
        let limit = *limits().get(trip);
        assert!(if trip.is_lower() { limit.release >= limit.trip } else { limit.release <= limit.trip }, "{trip}");
    }
}
