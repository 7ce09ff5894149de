//! Who is let go where packs hold less than was promised of them.

use super::stepped::station_pack;
use super::*;
use crate::scheduler::shed::{Draw, shed};

/// A station with a pack of 84 Wh at this state of charge, known to 1 Wh, and these services: when they end, s, and what they still take, Wh.
fn goes(soc: f64, services: &[(f64, f64)]) -> Option<usize> {
    let mut with = station("s", 4, &[soc * 84.0], &[]);
    with.overhead_per_h = Need { mean_wh: 6.0, ..Need::default() };
    with.packs[0].usable_wh.sigma = 1.0;
    with.packs[0].state =
        Some(PackState { model: station_pack(), soc: Estimate::exact(soc), temperature_degc: 25.0, refill: Refill::default() });
    let draw = |&(ends_s, mean_wh): &(f64, f64)| Draw { ends_s, need: Need { mean_wh, ..Need::default() }, may_end: true };
    shed(&with, &services.iter().map(draw).collect::<Vec<_>>(), 0.95)
}

#[test]
fn who_takes_most_from_the_others_is_let_go_where_the_packs_do_not_last_for_all() {
    // 20 Wh each within an hour, and 6 for the station: 66 Wh. 80 % are some 65 to 67 Wh, 60 % some 50.
    let three = [(HOUR, 20.0), (HOUR, 20.0), (HOUR, 22.0)];
    assert_eq!(goes(0.95, &three), None, "all get it");
    assert_eq!(goes(0.6, &three), Some(2), "two get it without the third");
    // By the end of the first two it takes 5 Wh, they take 4 and the station 1: 10 of 16.
    assert_eq!(goes(0.2, &[(600.0, 2.0), (0.8 * HOUR, 20.0), (700.0, 2.0)]), None, "these end before it gives out");
    // 25 Wh do for two of 7, and for one of 14 and the half of one of 7.
    assert_eq!(goes(0.3, &[(HOUR, 7.0), (0.3 * HOUR, 14.0), (HOUR, 7.0)]), Some(1));
}

#[test]
fn nobody_is_let_go_where_as_many_would_fail_all_the_same() {
    // One alone gets nothing from it, and of two that each take more than there is, none is helped by the other's end.
    assert_eq!(goes(0.1, &[(HOUR, 20.0)]), None);
    assert_eq!(goes(0.1, &[(HOUR, 40.0), (HOUR, 40.0)]), None);
    // As likely as not to be enough for both: that costs one service on average, and so does letting one go.
    let even = (0..=100).map(|n| 0.3 + 0.004 * f64::from(n)).map(|soc| goes(soc, &[(HOUR, 20.0), (HOUR, 20.0)])).collect::<Vec<_>>();
    // (Where it is not enough for one, none is helped either.)
    let kept = even.iter().rposition(Option::is_some).unwrap() + 1;
    // 46 Wh of 84 are 55 %, and a little more at the end of the discharge.
    assert!((0.52..0.6).contains(&(0.3 + 0.004 * kept as f64)), "{even:?}");
    assert_eq!(even[0], None);
}

#[test]
fn who_cannot_be_let_go_is_not() {
    let mut with = station("s", 4, &[50.0], &[]);
    with.packs[0].state =
        Some(PackState { model: station_pack(), soc: Estimate::exact(0.6), temperature_degc: 25.0, refill: Refill::default() });
    let draw = |may_end: bool, mean_wh: f64| Draw { ends_s: HOUR, need: Need { mean_wh, ..Need::default() }, may_end };
    let draws = [draw(true, 20.0), draw(true, 20.0), draw(false, 22.0)];
    assert_eq!(shed(&with, &draws, 0.95).map(|index| index < 2), Some(true));
    assert_eq!(shed(&with, &draws.clone().map(|draw| Draw { may_end: false, ..draw }), 0.95), None);
    with.packs[0].state = None;
    assert_eq!(shed(&with, &draws, 0.95), None, "nobody knows how the pack stands");
}
