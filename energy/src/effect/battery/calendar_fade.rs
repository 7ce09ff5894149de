//! Calendar fade: capacity that is lost with age, whether or not the battery is used.
//!
//! `Q = Q_max (1 - k sqrt(t))`, t in days since the battery was made, k as a share of Q_max per
//! root of a day. The root follows from a film on the anode (SEI) that slows its own growth.
//! k holds for one storage temperature and state of charge: what a pack went through before its
//! log begins is not in the log, so the stress is part of the parameter, not a second one.
//!
//! Absence: an old pack with few cycles empties early.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CalendarFade;

/// Beyond its range of validity the fade would take more than there is: this much stays.
const KEPT_MIN: f64 = 0.05;

static SPEC: EffectSpec = EffectSpec {
    id: "calendar_fade",
    title: "Calendar fade",
    system: System::Battery,
    phase: Phase::Capacity,
    channel: Channel::CapacityAh,
    needs: &[Channel::AgeDays],
    equation: "Q = Q_max (1 - k sqrt(age))",
    source: "parabolic growth of the SEI: Ploehn et al. 2004, doi 10.1149/1.1644601",
    validity: "one storage temperature and state of charge; until half of the capacity is left",
    signature: "full discharges end early in old packs, however few cycles they have seen",
    matters: 1e-2,
    confused_with: &[("capacity_fade", "packs of one age and different cycle counts")],
    parameters: &[ParameterSpec {
        name: "fade_per_root_day",
        meaning: "share of capacity lost in the first day; in t days, sqrt(t) times that",
        default: 2.1e-3,
        null: Some(0.0),
        min: 0.0,
        max: 0.03,
        source: "4 % in the first year at 25 degC and 40 % charge, 25 % at 60 degC (storage table of makers' data, Battery University BU-702)",
    }],
    states: &[],
};

impl Physics for CalendarFade {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let age_days = channels[Channel::AgeDays];
        // Age is a fact, not a fitted number: no derivative runs through it, and its root has none at zero.
        let lost = own.parameters[0] * age_days.re().max(0.0).sqrt();
        let kept = if lost.re() > 1.0 - KEPT_MIN { S::from(KEPT_MIN) } else { -lost + 1.0 };
        channels[Channel::CapacityAh] *= kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn capacity_ah(fade: f64, age_days: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CapacityAh] = 2.0;
        channels[Channel::AgeDays] = age_days;
        step_once(&CalendarFade, &Facts::robot(), 1.0, &[fade], &mut [], &mut channels);
        channels[Channel::CapacityAh]
    }

    #[test]
    fn four_times_the_age_loses_twice_the_share_and_never_all() {
        assert_eq!(capacity_ah(0.01, 0.0), 2.0);
        assert!((capacity_ah(0.01, 100.0) - 1.8).abs() < 1e-12);
        assert!((capacity_ah(0.01, 400.0) - 1.6).abs() < 1e-12);
        assert!((capacity_ah(0.03, 1e6) - 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_year_on_the_shelf_leaves_what_makers_state() {
        // Recoverable capacity after one year at 40 % charge: 96 % at 25 degC, 75 % at 60 degC (BU-702).
        let p = &SPEC.parameters[0];
        assert!((capacity_ah(p.default, 365.0) / 2.0 - 0.96).abs() < 5e-3);
        assert!(capacity_ah(p.max, 365.0) / 2.0 < 0.75);
    }
}
