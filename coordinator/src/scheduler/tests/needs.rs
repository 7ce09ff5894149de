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
