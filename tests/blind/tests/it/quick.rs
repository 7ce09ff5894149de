//! A few cases of every kind, put to the lab: what must hold of every answer whatever its merit.
//! How good the lab is, the bench says.

use blind::plan::DEVELOPMENT_SEED;
use blind::{Choice, Kind, ask, run, table, tally};

#[test]
fn the_lab_answers_in_the_form_of_its_contract() {
    let mut seen = 0;
    for &kind in Kind::ALL {
        let choice = Choice { seed_from: DEVELOPMENT_SEED, cases: Some(2), kind: Some(kind), parallel: true, ..Choice::default() };
        let outcomes = run(&choice, &ask, &|| 0.0, &|_| {});
        assert_eq!(outcomes.len(), 2);
        for outcome in &outcomes {
            let (name, answer) = (&outcome.case.name, &outcome.answer);
            assert!(["complete", "missing", "ambiguous", "unknown"].contains(&answer.verdict.as_str()), "{name}: {answer:?}");
            assert!(outcome.mark.holdout_over_floor.is_finite(), "{name}: {answer:?}");
            let known = |id: &String| energy::find(outcome.case.system, id).is_some() || id == "expression";
            assert!(answer.selected.iter().chain(&answer.equivalent).all(known), "{name}: {answer:?}");
        }
        seen += outcomes.len();
        let marks: Vec<_> = outcomes.into_iter().map(|outcome| outcome.mark).collect();
        assert!(table::markdown(&tally(&marks)).lines().count() > 3);
    }
    assert_eq!(seen, 2 * Kind::ALL.len());
}
