//! Spares of several kinds in one rack.

use super::*;

/// Who is given which spare.
fn given(plan: &Plan) -> BTreeSet<(String, String)> {
    plan.planned.iter().map(|one| (one.robot.to_string(), one.spare.as_ref().unwrap().to_string())).collect()
}

#[test]
fn nobody_gets_a_spare_of_a_kind_that_does_not_fit() {
    // Two kinds of spares, the fuller of the wrong kind for both robots; one of theirs is left for one of them.
    let mut rack = station("rack", 0, &[80.0], &[0.99, 0.97, 0.98]);
    (rack.spares[0].kind, rack.spares[2].kind) = (1, 1);
    let explorer = |name: &str, soc: f64| RobotView { unfit: vec![(0, 1)], ..robot(name, soc, &[(0, 60.0)]) };
    let found = solved(vec![explorer("a", 0.11), explorer("b", 0.12)], vec![rack.clone()]);
    let [planned] = &found.plan.planned[..] else { panic!("{:?}", found.plan) };
    assert_eq!(planned.spare.as_ref().map(AsRef::as_ref), Some("spare-1"));
    assert_eq!(found.plan.rejected[0].reasons, ["rack: no charged spare that fits it is left at 00:04"]);
    // Who can take the other kind has it.
    let other = RobotView { unfit: vec![(0, 0)], ..robot("c", 0.12, &[(0, 60.0)]) };
    let found = solved(vec![explorer("a", 0.11), other], vec![rack]);
    assert_eq!(given(&found.plan), [("a", "spare-1"), ("c", "spare-0")].map(|(robot, spare)| (robot.to_owned(), spare.to_owned())).into());
}

#[test]
fn a_robot_waits_for_a_spare_of_its_own_kind_whatever_others_there_are() {
    // What fits is far less full than what does not, and the second of it is being charged.
    let mut rack = station("rack", 0, &[80.0], &[0.99, 0.85, 0.85, 0.99]);
    (rack.spares[0].kind, rack.spares[3].kind) = (1, 1);
    rack.spares[2].ready_s = 900.0;
    let explorer = |name: &str| RobotView { unfit: vec![(0, 1)], ..robot(name, 0.12, &[(0, 60.0)]) };
    let found = solved(vec![explorer("a"), explorer("b")], vec![rack.clone()]);
    let starts_s = |spare: &str| {
        let has = |one: &&Planned| one.spare.as_ref().is_some_and(|given| given.as_ref() == spare);
        found.plan.planned.iter().find(has).map(|one| one.start.seconds_since(found.task.view.now))
    };
    let (now_s, then_s) = (starts_s("spare-1").expect("the first is there"), starts_s("spare-2").expect("the second is waited for"));
    assert!(now_s < 900.0 && then_s >= 890.0, "{now_s} {then_s}");
    assert_eq!(found.plan.quality.stranded_bound, 0);
    // Who is empty before that is told what it waits for.
    let mut hasty = explorer("b");
    [&mut hasty.lasts, &mut hasty.ways[0].lasts].into_iter().for_each(|lasts| (lasts.empty_s, lasts.surely_s) = (800.0, 800.0));
    let found = solved(vec![explorer("a"), hasty, explorer("c")], vec![rack]);
    assert_eq!((found.plan.planned.len(), found.plan.rejected.len()), (2, 1));
    assert!(found.plan.rejected[0].reasons[0].contains("no charged spare that fits it is left"), "{:?}", found.plan.rejected);
}

#[test]
fn a_spare_that_is_ready_is_not_hidden_by_a_fuller_one_that_is_not() {
    let mut rack = station("rack", 0, &[80.0], &[0.85, 0.98]);
    rack.spares[1].ready_s = 3600.0;
    let found = solved(vec![robot("a", 0.12, &[(0, 60.0)])], vec![rack.clone()]);
    assert_eq!(given(&found.plan), [("a".to_owned(), "spare-0".to_owned())].into());
    // Where the fuller one is ready, too, it goes first.
    rack.spares[1].ready_s = 0.0;
    let found = solved(vec![robot("a", 0.12, &[(0, 60.0)])], vec![rack]);
    assert_eq!(given(&found.plan), [("a".to_owned(), "spare-1".to_owned())].into());
}

#[test]
fn who_can_have_two_kinds_leaves_the_one_that_others_need() {
    // The first goes into both, and is the fullest.
    let mut rack = station("rack", 0, &[80.0], &[0.99, 0.97]);
    rack.spares[1].kind = 1;
    let roomba = RobotView { unfit: vec![(0, 1)], ..robot("r", 0.12, &[(0, 60.0)]) };
    let found = solved(vec![robot("e", 0.11, &[(0, 60.0)]), roomba], vec![rack]);
    let wanted = [("e", "spare-1"), ("r", "spare-0")].map(|(robot, spare)| (robot.to_owned(), spare.to_owned()));
    assert_eq!(given(&found.plan), wanted.into());
}

/// Where packs are handed out again from 80 % on, one of these counts although another spare is full.
#[test]
fn a_spare_as_full_as_those_that_are_charged_again_counts_beside_a_fuller_one() {
    let both = |ready_soc: f64| {
        let rack = StationView { ready_soc, ..station("rack", 0, &[80.0], &[0.8, 0.98]) };
        given(&solved(vec![robot("a", 0.12, &[(0, 60.0)]), robot("b", 0.13, &[(0, 60.0)])], vec![rack]).plan)
    };
    let wanted = [("a", "spare-1"), ("b", "spare-0")].map(|(robot, spare)| (robot.to_owned(), spare.to_owned()));
    assert_eq!(both(0.8), wanted.into());
    assert_eq!(both(0.98).len(), 1, "it waits for its turn");
}

#[test]
fn that_nothing_fits_one_robot_says_nothing_of_others_of_its_model() {
    let pack = battery();
    let of = |name: &str, unfit: Vec<(usize, usize)>| RobotView { battery: Arc::clone(&pack), unfit, ..robot(name, 0.12, &[(0, 60.0)]) };
    let rack = station("rack", 0, &[80.0], &[0.97, 0.97]);
    let found = solved(vec![of("a", vec![(0, 0)]), of("b", vec![]), of("c", vec![])], vec![rack]);
    assert_eq!(names(&found.plan).into_iter().collect::<BTreeSet<_>>(), ["b", "c"].into());
}

#[test]
fn who_can_have_two_kinds_gets_the_second_where_the_first_is_gone() {
    let pack = battery();
    let of = |name: &str, unfit: Vec<(usize, usize)>| RobotView { battery: Arc::clone(&pack), unfit, ..robot(name, 0.12, &[(0, 60.0)]) };
    // One of the first kind, into which fewer robots go; the second is far less full.
    let mut rack = station("rack", 0, &[80.0], &[0.97, 0.6, 0.6]);
    (rack.spares[1].kind, rack.spares[2].kind) = (1, 1);
    let found = solved(vec![of("a", vec![]), of("b", vec![]), of("c", vec![(0, 0)])], vec![rack]);
    assert_eq!(found.plan.planned.len(), 3, "{:?}", found.plan.rejected);
    let quality = found.plan.quality;
    assert!(quality.stranded == 0 && quality.missed_bound_s <= quality.missed_s, "{quality:?}");
}
