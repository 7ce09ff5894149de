//! What services take of the station's packs, with the doubt of it.

use planner::Mode;

use super::*;
use crate::scheduler::translate::Offer;

#[test]
fn the_doubt_of_what_a_robot_has_left_counts_in_full_wherever_its_charge_ends() {
    let mut unsure = robot("r", 0.3, &[(0, 60.0)]);
    unsure.soc.sigma = 0.03;
    let task = Task::new(view(vec![unsure], vec![station("s", 1, &[80.0], &[])]), &settings(), &[], Offer::Usual);
    // 26 Wh for 98 % of charge, so 0.80 Wh for three hundredths; beside it 0.1 Wh that the battery is unsure of, as much of it as is charged.
    let of_soc = (0.03 * 26.0_f64 / 0.98).powi(2);
    for (level, to_soc) in task.levels_soc.iter().enumerate().filter(|(_, to_soc)| **to_soc > 0.3) {
        let own = task.need(0, 0, 0, Mode::Charge(level as u8)).own_variance;
        let share = (to_soc - 0.3) / (0.98 - 0.3);
        assert!((own - of_soc - 0.01 * share * share).abs() < 0.01, "to {to_soc}: {own} of {of_soc}");
    }
    // A pack that is left for a spare takes 19 Wh in place of 26; and the exchange the same, whatever it holds.
    let left = task.need(0, 0, 0, Mode::SwapAndRecharge).own_variance;
    assert!((left / (19.0_f64 / 26.0).powi(2) - of_soc - 0.01).abs() < 0.02, "{left}");
    assert_eq!(task.need(0, 0, 0, Mode::Swap).own_variance, 0.0);
}

#[test]
fn what_a_way_takes_beyond_work_is_charged_there_and_must_be_had_before() {
    let task = |extra_soc: f64| {
        let mut far = robot("r", 0.3, &[(0, 600.0), (1, 600.0)]);
        let lasts = &mut far.ways[0].lasts;
        (lasts.empty_s, lasts.surely_s) =
            (lasts.empty_s - extra_soc / far.drain_soc_per_s, lasts.surely_s - extra_soc / far.drain_soc_per_s);
        far.ways[0].extra_soc = Estimate::exact(extra_soc);
        let stations = ["s", "t"].map(|name| station(name, 1, &[80.0], &[])).to_vec();
        Task::new(view(vec![far], stations), &settings(), &[], Offer::Usual)
    };
    let (plain, steep) = (task(0.0), task(0.05));
    let need_wh = |task: &Task, station: usize| task.need(0, station, 70, task.full_charge()).mean_wh;
    // 26 Wh for 98 % of charge.
    assert!((need_wh(&steep, 0) - need_wh(&plain, 0) - 0.05 * 26.0 / 0.98).abs() < 0.01, "{} {}", need_wh(&steep, 0), need_wh(&plain, 0));
    assert_eq!(need_wh(&steep, 1), need_wh(&plain, 1));
    // Work takes 5 % in 10 min.
    let last_s = |task: &Task, way: usize| {
        let who = &task.problem.robots[0];
        who.last_start(&who.travel[way], 0) as f64 * f64::from(task.grid.tick_s)
    };
    assert!((last_s(&plain, 0) - last_s(&steep, 0) - 600.0).abs() <= f64::from(steep.grid.tick_s));
    assert_eq!([last_s(&plain, 1), last_s(&steep, 1)], [last_s(&plain, 0); 2]);
}

#[test]
fn who_has_less_than_a_tick_to_spare_is_sent_by_what_is_expected() {
    let planned = |surely_s: f64| {
        let mut late = robot("r", 0.3, &[(0, 600.0)]);
        [&mut late.lasts, &mut late.ways[0].lasts].into_iter().for_each(|lasts| (lasts.empty_s, lasts.surely_s) = (surely_s, surely_s));
        let solved = solved(vec![late], vec![station("s", 1, &[80.0], &[])]);
        solved.plan.planned.first().map(|planned| planned.probability)
    };
    // Planning begins 3 s into a tick of 10 s.
    for surely_s in [590.0, 600.0, 602.0, 604.0, 606.0] {
        assert!(planned(surely_s).is_some(), "{surely_s}");
    }
}
