//! The order in which a station's packs are drained, what each gives in it, and what comes into those that rest.

use std::collections::BTreeMap;

use energy::units::S_PER_H;
use proto::{Gauge, PackId, StationState};

use crate::fleet::Station;
use crate::models::StationModels;
use crate::scheduler::{HANDOVER_S, PackView};

/// A pack that rests is charged from outside where so much of an equal share of the supply goes into it by its gauge: less is noise, or the end
/// of a charge. A guess; a charger's current falls to a tenth or a twentieth before it ends.
const IS_CHARGING: f64 = 0.05;
/// Power into a pack is counted in such parts of its share, rounded up: a gauge's noise must not move what is promised.
const PARTS: f64 = 20.0;

/// What goes from an outside supply into each pack that rests and is charged, W: an equal share, or less if its gauge shows less. Nothing is known where
/// no pack is said to feed the station.
pub(super) fn charged_from_outside(
    models: &StationModels,
    station: &Station,
    state: &StationState,
    is_doubted: impl Fn(&PackId) -> bool,
) -> BTreeMap<PackId, f64> {
    let Some(active) = state.active_pack.as_ref().filter(|_| models.recharge_w > 0.0) else { return BTreeMap::new() };
    let resting = state.packs.iter().map(|pack| (pack.connected, &pack.pack)).filter(|(here, pack)| *here && *pack != active);
    let left = if models.spare_battery.is_some() { state.spares.iter().filter(|spare| !spare.ready).count() } else { 0 };
    let least_w = IS_CHARGING * models.recharge_w / (resting.clone().count() + left).max(1) as f64;
    // One that still shows as much going out has not spoken since it fed the station.
    let has_just_fed = |gauge: &Gauge| gauge.power_w >= least_w && gauge.at < state.at;
    let shown_w = |(_, pack): (bool, &PackId)| {
        let gauge = station.packs.get(pack).filter(|_| !is_doubted(pack))?;
        let shown_w = if has_just_fed(gauge) { models.recharge_w } else { -gauge.power_w };
        (shown_w >= least_w).then(|| (pack.clone(), shown_w))
    };
    let charged: BTreeMap<PackId, f64> = resting.filter_map(shown_w).collect();
    let share_w = models.recharge_w / (charged.len() + left).max(1) as f64;
    let counted_w = |shown_w: f64| share_w * ((shown_w / share_w * PARTS).ceil() / PARTS).min(1.0);
    charged.into_iter().map(|(pack, shown_w)| (pack, counted_w(shown_w))).collect()
}

/// Packs in the order in which they are drained at this power: the active one first, the fullest last, those that are still to come
/// after all. Only the last one sees the end of the last charge. The others are left a little before they give out, and none that
/// holds hardly more than that is turned to (`answers::next_pack`): it would only be counted as the one after.
pub(super) fn in_order(mut packs: Vec<PackView>, active: Option<&PackId>, power_w: f64) -> Vec<PackView> {
    let is_active = |pack: &PackId| active == Some(pack);
    packs.sort_by(|a, b| {
        let key = |pack: &PackView| (!is_active(&pack.pack), [pack.available_s, pack.usable_wh.value]);
        let ((a_is, [a_s, a_wh]), (b_is, [b_s, b_wh])) = (key(a), key(b));
        a_is.cmp(&b_is).then(a_s.total_cmp(&b_s)).then(a_wh.total_cmp(&b_wh)).then_with(|| a.pack.cmp(&b.pack))
    });
    let left_wh = HANDOVER_S / S_PER_H * power_w;
    packs.retain(|pack| is_active(&pack.pack) || pack.before_wh(f64::INFINITY) > 2.0 * left_wh);
    if let Some((last, before)) = packs.split_last_mut() {
        last.usable_wh.value += std::mem::take(&mut last.gain_wh);
        for pack in before {
            let left_wh = left_wh.min(pack.usable_wh.value);
            pack.usable_wh.value -= left_wh;
            pack.gain_wh += left_wh;
        }
    }
    packs
}

#[cfg(test)]
mod tests {
    use energy::Estimate;

    use super::*;

    #[test]
    fn a_pack_that_holds_no_more_than_is_left_in_it_counts_for_nothing_unless_it_is_the_active_one() {
        // A minute at 60 W is 1 Wh.
        let pack = |name: &str, wh: f64, available_s: f64| PackView {
            pack: PackId::new(name).unwrap(),
            usable_wh: Estimate::exact(wh),
            gain_wh: 0.5,
            uncounted_wh: 0.0,
            state: None,
            available_s,
        };
        let told = |active: &str| {
            let packs = vec![pack("late", 30.0, 900.0), pack("full", 50.0, 0.0), pack("low", 20.0, 0.0), pack("empty", 1.5, 0.0)];
            let active = PackId::new(active).unwrap();
            let packs = in_order(packs, Some(&active), 60.0).into_iter();
            packs.map(|pack| (pack.pack.to_string(), pack.usable_wh.value)).collect::<Vec<_>>()
        };
        let named = |packs: &[(&str, f64)]| packs.iter().map(|(name, wh)| ((*name).to_owned(), *wh)).collect::<Vec<_>>();
        assert_eq!(told("full"), named(&[("full", 49.0), ("low", 19.0), ("late", 30.5)]));
        assert_eq!(told("empty"), named(&[("empty", 0.5), ("low", 19.0), ("full", 49.0), ("late", 30.5)]));
    }
}
