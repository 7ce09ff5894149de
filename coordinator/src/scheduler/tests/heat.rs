//! Batteries that heat or cold keeps from being charged.

use energy::protection::Trip;

use super::*;

/// `one` with a battery whose charge never ends, and goes as far as that.
fn stopped(one: RobotView, why: Trip, reaches_soc: f64) -> RobotView {
    let point = |point: &Point| Point { stopped: (point.charge_s > 0.0).then_some(why), ..*point };
    let ways = one.ways.iter().map(|way| {
        let points = way.table.points.iter().map(point).collect();
        WayView { table: Arc::new(Table { points, reaches_soc, ..Table::clone(&way.table) }), ..way.clone() }
    });
    let degc = if why.is_lower() { -5.2 } else { 41.3 };
    RobotView { temperature_degc: degc, charge_degc: degc.round(), ways: ways.collect(), ..one }
}

#[test]
fn who_is_too_cold_to_be_charged_gets_a_spare_or_hears_why_not() {
    let cold = |name: &str, soc: f64| stopped(robot(name, soc, &[(0, 60.0)]), Trip::UnderTemperatureCharge, 0.0);
    let with = |spares: &[f64]| {
        let robots = vec![cold("a", 0.15), cold("b", 0.2), robot("c", 0.2, &[(0, 60.0)])];
        solved(robots, vec![station("s", 3, &[80.0], spares)]).plan
    };
    let plan = with(&[]);
    assert_eq!(names(&plan), ["c"]);
    let why = "s: its battery is too cold to charge: it is at -5.2 °C, and takes none below 0 °C";
    assert_eq!(plan.rejected.iter().map(|rejected| rejected.reasons.join(";")).collect::<Vec<_>>(), [why, why]);
    let plan = with(&[0.97]);
    assert_eq!(names(&plan), ["a", "c"]);
    assert!(plan.planned[0].spare.is_some() && plan.planned[1].bay.is_some());
    let told = &plan.rejected[0].reasons[0];
    assert!(told.contains("no charged spare is left") && told.ends_with(&why[3..]), "{told}");
}

#[test]
fn who_would_get_too_hot_is_charged_as_far_as_it_goes_where_it_would_be_empty_without_it() {
    // Levels are 50, 66, 82 and 98 %.
    let told = |reaches_soc: f64| {
        let robots = vec![stopped(robot("a", 0.15, &[(0, 60.0)]), Trip::OverTemperatureCharge, reaches_soc)];
        solved(robots, vec![station("s", 3, &[80.0], &[])]).plan
    };
    let plan = told(0.51);
    let planned = &plan.planned[0];
    assert_eq!(planned.to_soc, 0.5);
    // From 15 % on, an hour for 98 %.
    let charge_s = planned.end.seconds_since(planned.start) - 70.0;
    assert!((charge_s - (0.5 - 0.145) / 0.98 * HOUR).abs() < 40.0, "{charge_s}");
    let why = "s: its battery would get too hot to charge: it is at 41.3 ± 1.0 °C, passes 45 °C while it is charged, and takes none again above 40 °C";
    assert_eq!(told(0.49).rejected[0].reasons, [why]);
}
