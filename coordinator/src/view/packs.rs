//! The order in which a station's packs are drained, what each gives in it, and what comes into those that rest.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::Estimate;
use energy::selector::RELEASED_SOC;
use energy::units::{REFERENCE_DEGC, S_PER_H};
use proto::{PackId, StationId, StationState, Timestamp};

use super::{Basis, wider};
use crate::fleet::Station;
use crate::forecast;
use crate::models::{StationModels, from_wire};
use crate::scheduler::{HANDOVER_S, PackState, PackView, Refill, steps_s};
use crate::trust::Owner;
use crate::watch::Subject;

/// A pack that rests is charged from outside where so much of an equal share of the supply goes into it by its gauge: less is noise, or the end
/// of a charge. A guess; a charger's current falls to a tenth or a twentieth before it ends.
const IS_CHARGING: f64 = 0.05;
/// A pack from which another has just taken over rests, and is charged from now on. Its gauge shows that only after a moment, so it counts
/// as charged without for so long, s: plans had counted on it before, and what they promised must not vanish for that moment.
const JUST_FED_S: f64 = 60.0;
/// Power into a pack is counted in such parts of its share, rounded up: a gauge's noise must not move what is promised.
const PARTS: f64 = 20.0;

/// What goes from an outside supply into each pack that rests and is charged, W: an equal share, or less if its gauge shows less. Nothing is known where
/// no pack is said to feed the station.
pub(super) fn charged_from_outside(
    models: &StationModels,
    station: &Station,
    state: &StationState,
    now: Timestamp,
    is_doubted: impl Fn(&PackId) -> bool,
) -> BTreeMap<PackId, f64> {
    let Some(active) = state.active_pack.as_ref().filter(|_| models.recharge_w > 0.0) else { return BTreeMap::new() };
    let resting = state.packs.iter().map(|pack| (pack.connected, &pack.pack)).filter(|(here, pack)| *here && *pack != active);
    let left = if models.spare_battery.is_some() { state.spares.iter().filter(|spare| !spare.ready).count() } else { 0 };
    let least_w = IS_CHARGING * models.recharge_w / (resting.clone().count() + left).max(1) as f64;
    let has_just_fed = |pack: &PackId| {
        station.relieved.as_ref().is_some_and(|(relieved, at)| relieved == pack && (0.0..JUST_FED_S).contains(&now.seconds_since(*at)))
    };
    // The current of now: what a gauge calls its power may be a mean over the last minutes.
    let shown_w = |(_, pack): (bool, &PackId)| {
        let gauge = station.packs.get(pack).filter(|_| !is_doubted(pack))?;
        let shown_w = if has_just_fed(pack) { models.recharge_w } else { -gauge.current_a * gauge.voltage_v };
        (shown_w >= least_w).then(|| (pack.clone(), shown_w))
    };
    let charged: BTreeMap<PackId, f64> = resting.filter_map(shown_w).collect();
    let share_w = models.recharge_w / (charged.len() + left).max(1) as f64;
    let counted_w = |shown_w: f64| share_w * ((shown_w / share_w * PARTS).ceil() / PARTS).min(1.0);
    charged.into_iter().map(|(pack, shown_w)| (pack, counted_w(shown_w))).collect()
}

impl Basis<'_> {
    /// Whether an outside supply charges some pack that rests.
    pub(crate) fn is_charged_from_outside(&self, id: &StationId, models: &StationModels, station: &Station, state: &StationState) -> bool {
        let is_doubted = |pack: &PackId| self.trust.fault(self.now, &Owner::Pack(id.clone(), pack.clone())).is_some();
        !charged_from_outside(models, station, state, self.now, is_doubted).is_empty()
    }

    /// What the packs that can feed a station hold by their voltages, Wh, without end where that is not asked of one: its model is not doubted.
    pub(crate) fn shown_wh(&self, id: &StationId, models: &StationModels, station: &Station, state: &StationState) -> f64 {
        let power_w = self.working_draw(id, models, self.side_by_side(id)).power_w;
        let of_pack = |pack: &proto::PackState| {
            let (model, gauge) = (models.packs.get(&pack.pack)?, station.packs.get(&pack.pack)?);
            let soc = Estimate::exact(self.watch.shown_soc(id, &pack.pack)?);
            Some(self.tables.usable.wh(model, soc, gauge.temperature_degc, power_w).value.max(0.0))
        };
        let here = state.packs.iter().filter(|pack| pack.connected && !pack.depleted);
        here.map(|pack| of_pack(pack).unwrap_or(f64::INFINITY)).sum()
    }

    /// Packs that hold something, in the order in which they are drained: the active one, then
    /// the fullest last, so that full packs stay full. Those that are still to come, last.
    pub(crate) fn packs(&self, id: &StationId, models: &StationModels, station: &Station, state: &StationState) -> Vec<PackView> {
        let bays = if state.bays.is_empty() { 0 } else { self.side_by_side(id) };
        let draw = self.working_draw(id, models, bays);
        let is_doubted = |pack: &PackId| self.trust.fault(self.now, &Owner::Pack(id.clone(), pack.clone())).is_some();
        let charged = charged_from_outside(models, station, state, self.now, is_doubted);
        let packs = state.packs.iter().filter_map(|pack| {
            let gauge = station.packs.get(&pack.pack);
            let temperature_degc = gauge.map_or(REFERENCE_DEGC, |gauge| gauge.temperature_degc);
            let model = models.packs.get(&pack.pack)?;
            let owner = Owner::Pack(id.clone(), pack.pack.clone());
            let model = &gauge.filter(|_| pack.connected).map_or_else(|| Arc::clone(model), |gauge| self.worn(&owner, model, gauge));
            let (soc, available_s) = match pack.back {
                _ if pack.connected && (!pack.depleted || charged.contains_key(&pack.pack)) => {
                    (self.believed(id, &pack.pack, gauge?, model), 0.0)
                }
                _ if pack.connected => return None,
                back => (from_wire(back?.soc), self.comes_s(back?.at)),
            };
            // What gave out gives nothing before its charger has brought it back.
            let gives = |soc: Estimate| {
                if pack.depleted && soc.value < RELEASED_SOC {
                    Estimate::exact(0.0)
                } else {
                    self.tables.usable.wh(model, soc, temperature_degc, draw.power_w)
                }
            };
            let usable_wh = gives(soc);
            let gain_wh = self.tables.gain_wh(models, bays, model, temperature_degc, &draw);
            let gain_wh = forecast::ending_gain_wh(usable_wh.value, &draw, gain_wh);
            let factor = self.watch.wider(&Subject::Pack(id.clone(), pack.pack.clone()));
            let course = |power_w: f64| self.tables.refills.course(model, power_w, temperature_degc);
            let refill = match (charged.get(&pack.pack), charged.values().next()) {
                (Some(&power_w), _) => {
                    let steps_s = steps_s(model, power_w, self.now);
                    Refill::along(course(power_w), soc.value, steps_s, |soc| gives(Estimate::exact(soc)).value)
                }
                (None, Some(&power_w)) if state.active_pack.as_ref() == Some(&pack.pack) => Refill::later(course(power_w)),
                _ => Refill::NOTHING,
            };
            let state = Some(PackState { model: Arc::clone(model), soc: wider(soc, factor), temperature_degc, refill });
            Some(PackView { pack: pack.pack.clone(), usable_wh: wider(usable_wh, factor), gain_wh, uncounted_wh: 0.0, state, available_s })
        });
        in_order(packs.collect(), state.active_pack.as_ref(), draw.power_w)
    }
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
