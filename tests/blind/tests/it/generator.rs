//! Cases: well formed, reproducible, of the size that was asked for, and silent about the truth.

use std::collections::BTreeSet;
use std::sync::Arc;

use blind::plan::{DEVELOPMENT_SEED as SEED, plan};
use blind::{Case, Entry, Kind, Right, make};
use energy::{Model, catalogue};
use lab::prepare;
use rayon::prelude::*;

/// One case in so many of the plan: all kinds and systems, quick to make.
fn some(step: usize) -> Vec<(Entry, Case)> {
    let entries: Vec<(usize, Entry)> = plan().into_iter().enumerate().step_by(step).collect();
    entries.into_par_iter().map(|(index, entry)| (entry.clone(), make(&entry, SEED + index as u64))).collect()
}

#[test]
fn the_plan_has_every_kind_and_every_effect_at_three_sizes() {
    let plan = plan();
    assert!(plan.len() >= 400, "{}", plan.len());
    for &kind in Kind::ALL {
        assert!(plan.iter().any(|entry| entry.kind == kind), "{}", kind.name());
    }
    for effect in catalogue() {
        let spec = effect.spec();
        let begins = format!("single/{}/{}/", spec.system.name(), spec.id);
        // What sums up effects of cycles and days is asked about only where nothing tells these.
        let times = if effect.told_by().is_empty() { 3 } else { 0 };
        assert_eq!(plan.iter().filter(|entry| entry.name.starts_with(&begins)).count(), times, "{begins}");
    }
    // Any hundred cases in a row have all kinds.
    for stretch in plan.chunks_exact(100) {
        assert_eq!(stretch.iter().map(|entry| entry.kind).collect::<BTreeSet<_>>().len(), Kind::ALL.len());
    }
}

#[test]
fn the_lab_accepts_every_base_model_with_every_log() {
    for (entry, case) in some(29) {
        let refuse = |_: &str| Err("no files".to_owned());
        let model = Model::parse("base.toml", &case.base_model_toml, &refuse).unwrap_or_else(|error| panic!("{}: {error}", entry.name));
        let model = Arc::new(model);
        assert!(case.train.len() >= 4 && case.holdout.len() >= 2, "{}", entry.name);
        for log in case.train.iter().chain(&case.holdout) {
            let prepared = prepare(&model, &log.log()).unwrap_or_else(|error| panic!("{}: {error}", entry.name));
            assert!(!prepared.targets.is_empty(), "{}", entry.name);
        }
    }
}

#[test]
fn a_seed_gives_the_same_case_and_another_seed_another() {
    let plan = plan();
    let text = |seed| {
        let case = make(&plan[0], seed);
        case.base_model_toml.clone() + &case.train[0].csv()
    };
    assert_eq!(text(5), text(5));
    assert_ne!(text(5), text(6));
}

#[test]
fn hidden_effects_leave_what_was_asked_for_or_what_their_range_allows() {
    let mut small = 0;
    for (entry, case) in some(31).iter().filter(|(entry, _)| entry.kind == Kind::Single) {
        let (low, high) = entry.strength;
        let strength = case.truth.leaves().strength;
        assert!(strength < 1.6 * high, "{}: leaves {strength}", entry.name);
        small += usize::from(strength < 0.6 * low);
    }
    // A few effects cannot leave more: their ranges end, or a refit swallows them.
    assert!(small <= 2, "{small} effects leave less than asked for");
}

#[test]
fn nothing_is_left_of_nothing() {
    for (entry, case) in some(11).iter().filter(|(entry, _)| entry.kind == Kind::Null) {
        assert!(matches!(case.truth.right, Right::Complete), "{}", entry.name);
        assert_eq!(case.truth.leaves().strength, 0.0);
    }
}
