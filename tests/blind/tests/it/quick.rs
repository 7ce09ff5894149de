//! A few cases, put to the lab: what must hold of every answer whatever its merit. Batteries take
//! the lab longest, so most cases here are of robots and stations. How good it is, the bench says.

use blind::plan::DEVELOPMENT_SEED;
use blind::{Choice, Kind, ask, run, table, tally};
use energy::System;

use crate::names::asked;

#[test]
fn the_lab_answers_in_the_form_of_its_contract() {
    let of_loads = Kind::ALL.iter().filter(|&&kind| kind != Kind::Electrochemical);
    let loads = of_loads.flat_map(|&kind| [(kind, System::Robot), (kind, System::Station)]);
    for (kind, system) in loads.chain([(Kind::Null, System::Battery)]) {
        let choice = Choice { seed_from: DEVELOPMENT_SEED, cases: Some(1), kind: Some(kind), system: Some(system), ..Choice::default() };
        let outcomes = run(&choice, &ask, &|| 0.0, &|_| {});
        assert_eq!(outcomes.len(), 1, "{} {}", kind.name(), system.name());
        for outcome in &outcomes {
            let (name, answer) = (&outcome.case.name, &outcome.answer);
            assert!(["complete", "missing", "ambiguous", "unknown"].contains(&answer.verdict.as_str()), "{name}: {answer:?}");
            assert!(outcome.mark.holdout_over_floor.is_finite(), "{name}: {answer:?}");
            let known = |id: &String| energy::find(outcome.case.system, id).is_some() || id == "expression";
            assert!(answer.selected.iter().chain(&answer.equivalent).all(known), "{name}: {answer:?}");
        }
        let marks: Vec<_> = outcomes.into_iter().map(|outcome| outcome.mark).collect();
        assert!(table::markdown(&tally(&marks)).lines().count() > 3);
    }
}

/// Cases in which the obvious answer is a stand-in: a slow polarisation for readings that come late and
/// for a weak cell, a moved curve for a table that errs beyond full, near empty.
#[test]
fn a_stand_in_does_not_stay() {
    for (only, hidden) in [
        ("single/battery/current_skew/large", "current_skew"),
        ("single/battery/weak_cell/middle", "weak_cell"),
        ("single/battery/resistance_growth/small", "resistance_growth"),
    ] {
        let choice = Choice { seed_from: DEVELOPMENT_SEED, only: Some(only.to_owned()), ..Choice::default() };
        let outcomes = run(&choice, &ask, &|| 0.0, &|_| {});
        assert_eq!(outcomes.len(), 1, "{only}");
        let answer = &outcomes[0].answer;
        assert_eq!(answer.selected, [hidden], "{only}: {answer:?}");
        assert!(answer.verdict == "missing" || answer.verdict == "ambiguous", "{only}: {answer:?}");
    }
}

/// Cases whose way from the base alone ends in a valley that is not the truth's: the weak cell's deficit taken over by charges and gains
/// of the logs, a month's loss excused as slow noise, and one that is found, explains the logs and is small.
#[test]
fn a_wrong_valley_is_left() {
    for (seed, only, hidden) in [
        (9_200_051, "single/battery/weak_cell/small", "weak_cell"),
        (9_600_357, "single/battery/self_discharge/large", "self_discharge"),
        (9_600_488, "single/battery/rc1/small", "rc1"),
    ] {
        let (answer, mark) = asked(only, seed);
        assert!(answer.verdict == "missing" || answer.verdict == "ambiguous", "{only}: {answer:?}");
        assert!(answer.selected.iter().chain(&answer.equivalent).any(|id| id == hidden), "{only}: {answer:?}");
        // Before: unknown, with 1.7, 57 and 1.7 x the floor.
        assert!(mark.right && mark.holdout_over_floor < 3.0, "{only}: {mark:?}");
    }
}
