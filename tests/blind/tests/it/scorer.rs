//! The scorer, tried with labs of known merit: one that knows the truth, one that never finds
//! anything, one that names at random, one that always abstains, one that names too much.

use std::sync::OnceLock;

use blind::plan::DEVELOPMENT_SEED;
use blind::random::Stream;
use blind::run::chosen;
use blind::tally::{Figure, Line};
use blind::{Answer, Bin, Case, Choice, Kind, Mark, Right, judge, make, tally};
use energy::catalogue;
use rayon::prelude::*;
use serde_json::{Value, json};

/// A spread of cases, made once.
fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| {
        let of = |kind: Kind| {
            let cases = Some(if kind == Kind::Single { 14 } else { 5 });
            chosen(&Choice { seed_from: DEVELOPMENT_SEED, cases, kind: Some(kind), ..Choice::default() })
        };
        let entries: Vec<_> = Kind::ALL.iter().flat_map(|&kind| of(kind)).collect();
        entries.into_par_iter().map(|(entry, seed)| make(&entry, seed)).collect()
    })
}

fn marks(lab: impl Fn(&Case) -> Value) -> Vec<Mark> {
    cases().iter().map(|case| judge(case, &Answer::read(&lab(case)), 0.01)).collect()
}

fn share(lines: &[Line], name: &str) -> f64 {
    let line = lines.iter().find(|line| line.name.starts_with(name)).unwrap_or_else(|| panic!("no line {name}"));
    let Figure::Rate(rate) = &line.figure else { panic!("{name} is no rate") };
    rate.share()
}

/// Every share that should be high, by the first words of its line.
const GOOD: &[&str] = &[
    "single, right class, clear",
    "pair of unlike effects, both classes, clear",
    "another form",
    "electrochemical",
    "outside",
    "collinear",
];

/// What a lab says that knows the truth.
fn oracle(case: &Case) -> Value {
    match &case.truth.right {
        Right::Complete => json!({ "verdict": "complete", "selected": [] }),
        Right::Unknown { .. } => json!({ "verdict": "unknown", "selected": [] }),
        Right::Set { must, .. } => {
            json!({ "verdict": "ambiguous", "equivalent": must, "selected": [], "experiment": "measure elsewhere" })
        }
        Right::AnyOf { any, .. } => json!({ "verdict": "missing", "selected": [any[0]] }),
        Right::Effects(hidden) => {
            let estimate =
                |(name, value): &(&str, f64)| ((*name).to_owned(), json!({ "value": value, "sigma": 1e-6 + value.abs() * 0.01 }));
            let own = |h: &blind::Hidden| (h.id.to_owned(), Value::Object(h.parameters.iter().map(estimate).collect()));
            let ids: Vec<&str> = hidden.iter().map(|hidden| hidden.id).collect();
            json!({ "verdict": "complete", "selected": ids, "parameters": Value::Object(hidden.iter().map(own).collect()) })
        }
    }
}

#[test]
fn a_lab_that_knows_the_truth_reaches_everything() {
    let lines = tally(&marks(oracle));
    for name in GOOD {
        assert_eq!(share(&lines, name), 1.0, "{name}");
    }
    assert_eq!(share(&lines, "wrong names"), 0.0);
    assert_eq!(share(&lines, "false alarms on nulls"), 0.0);
    assert_eq!(share(&lines, "90 % intervals"), 1.0);
}

#[test]
fn a_lab_that_never_finds_anything_is_right_on_nulls_only() {
    let lines = tally(&marks(|_| json!({ "verdict": "complete", "selected": [] })));
    for name in GOOD {
        assert_eq!(share(&lines, name), 0.0, "{name}");
    }
    assert_eq!(share(&lines, "wrong names"), 0.0);
    assert_eq!(share(&lines, "false alarms on nulls"), 0.0);
}

#[test]
fn a_lab_that_names_at_random_is_found_out() {
    let lines = tally(&marks(|case| {
        let known: Vec<&str> = catalogue().iter().map(|effect| effect.spec()).filter(|s| s.system == case.system).map(|s| s.id).collect();
        json!({ "verdict": "missing", "selected": [Stream::new(case.seed, "random lab").pick(&known)] })
    }));
    assert!(share(&lines, "single, right class, clear") < 0.3);
    assert!(share(&lines, "wrong names") > 0.6);
    assert_eq!(share(&lines, "false alarms on nulls"), 1.0);
    assert_eq!(share(&lines, "outside"), 0.0);
    assert_eq!(share(&lines, "collinear"), 0.0);
}

#[test]
fn a_lab_that_always_says_unknown_is_right_on_outsiders_only() {
    let lines = tally(&marks(|_| json!({ "verdict": "unknown", "selected": [] })));
    assert_eq!(share(&lines, "outside"), 1.0);
    assert_eq!(share(&lines, "single, right class, clear"), 0.0);
    assert_eq!(share(&lines, "false alarms on nulls"), 1.0);
}

#[test]
fn a_lab_that_leaves_everything_open_gets_nothing_for_it() {
    let lines = tally(&marks(|case| {
        let all: Vec<&str> = catalogue().iter().map(|effect| effect.spec()).filter(|s| s.system == case.system).map(|s| s.id).collect();
        json!({ "verdict": "ambiguous", "selected": [], "equivalent": all, "experiment": "measure more" })
    }));
    for name in GOOD {
        assert_eq!(share(&lines, name), 0.0, "{name}");
    }
    assert_eq!(share(&lines, "false alarms on nulls"), 1.0);
}

#[test]
fn a_lab_that_names_the_truth_and_one_more_names_wrongly() {
    let lines = tally(&marks(|case| {
        let mut answer = oracle(case);
        let more = match case.system {
            energy::System::Battery => "temperature_bias",
            energy::System::Robot => "regeneration",
            energy::System::Station => "selector_switch",
        };
        answer["selected"].as_array_mut().expect("a list").push(json!(more));
        answer
    }));
    assert_eq!(share(&lines, "single, right class, clear"), 1.0);
    assert!(share(&lines, "wrong names") > 0.9);
    assert_eq!(share(&lines, "false alarms on nulls"), 1.0);
}

/// One of a set stands for it in `selected`: that says no more than the set, unless the verdict says so.
#[test]
fn a_lab_that_lets_another_stand_for_the_truth_in_a_set_names_nothing_wrongly() {
    let with = |verdict: &'static str| {
        tally(&marks(|case| {
            let mut answer = oracle(case);
            let Right::Effects(_) = &case.truth.right else { return answer };
            answer["equivalent"] = answer["selected"].clone();
            let other = match case.system {
                energy::System::Battery => "temperature_bias",
                energy::System::Robot => "regeneration",
                energy::System::Station => "selector_switch",
            };
            answer["equivalent"].as_array_mut().expect("a list").push(json!(other));
            answer["selected"] = json!([other]);
            answer["verdict"] = json!(verdict);
            answer
        }))
    };
    assert_eq!(share(&with("ambiguous"), "wrong names"), 0.0);
    assert!(share(&with("missing"), "wrong names") > 0.5);
}

#[test]
fn no_answer_is_no_hit_anywhere() {
    let lines = tally(&marks(|_| json!({ "verdict": "error" })));
    for name in GOOD {
        assert_eq!(share(&lines, name), 0.0, "{name}");
    }
    assert_eq!(share(&lines, "false alarms on nulls"), 1.0, "a null is passed by saying `complete`, not by failing");
}

#[test]
fn a_set_must_be_the_right_one_and_name_an_experiment() {
    let clear = |case: &&Case| case.kind == Kind::Collinear && case.truth.leaves().bin() != Bin::Below;
    let case = cases().iter().find(clear).expect("some are clear");
    let Right::Set { must, .. } = &case.truth.right else { panic!("a collinear case asks for a set") };
    let right = |answer: Value| judge(case, &Answer::read(&answer), 0.0).right;
    let set =
        |ids: &[&str], experiment: &str| json!({ "verdict": "ambiguous", "equivalent": ids, "selected": [], "experiment": experiment });
    assert!(right(set(must, "a second ammeter")));
    assert!(!right(set(must, "")), "no experiment");
    assert!(!right(set(&must[1..], "x")), "one is missing");
    assert!(!right(set(&[must, &["expression"][..]].concat(), "x")), "one too many");
    assert!(!right(json!({ "verdict": "missing", "selected": [must[0]] })), "a single name");
}

#[test]
fn intervals_that_are_too_narrow_are_seen() {
    let marks = marks(|case| {
        let mut answer = oracle(case);
        for own in answer["parameters"].as_object_mut().into_iter().flat_map(|all| all.values_mut()) {
            for estimate in own.as_object_mut().expect("a table").values_mut() {
                // Two of the stated deviations beside the truth.
                let (value, sigma) = (estimate["value"].as_f64().expect("a number"), estimate["sigma"].as_f64().expect("a number"));
                *estimate = json!({ "value": value + 2.0 * sigma, "sigma": sigma });
            }
        }
        answer
    });
    assert_eq!(share(&tally(&marks), "90 % intervals"), 0.0);
}
