//! Every effect there is, in order of evaluation within a phase.
//!
//! A new effect is a file in the folder of its system and a line here: the line declares the file,
//! registers the effect and fixes when it acts among those of its phase.

use super::Effect;
use crate::System;

macro_rules! catalogue {
    ($($folder:ident { $($file:ident :: $effect:ident,)* })*) => {
        $(mod $folder { $(pub(crate) mod $file;)* })*

        static CATALOGUE: &[&dyn Effect] = &[$($(&$folder::$file::$effect,)*)*];
    };
}

catalogue! {
    battery {
        capacity_fade::CapacityFade,
        calendar_fade::CalendarFade,
        capacity_health::CapacityHealth,
        rate_capacity::RateCapacity,
        self_discharge::SelfDischarge,
        parasitic_load::ParasiticLoad,
        coulombic_loss::CoulombicLoss,
        electrode_balance::ElectrodeBalance,
        entropic::Entropic,
        ohmic::Ohmic,
        ohmic_soc::OhmicSoc,
        charge_asymmetry::ChargeAsymmetry,
        resistance_growth::AT_ONCE,
        calendar_resistance::CalendarResistance,
        resistance_health::AT_ONCE,
        arrhenius::Arrhenius,
        super_arrhenius::SuperArrhenius,
        butler_volmer::ButlerVolmer,
        relaxation_arrhenius::RelaxationArrhenius,
        rc::FIRST,
        rc2::SECOND,
        rc_ladder::RcLadder,
        warburg::Warburg,
        surface_diffusion::SurfaceDiffusion,
        polarisation_growth::SLOW,
        polarisation_health::SLOW,
        polarisation_soc::PolarisationSoc,
        polarisation_arrhenius::PolarisationArrhenius,
        hysteresis::Hysteresis,
        thermal::LumpedThermal,
        weak_cell::WeakCell,
        contact_resistance::ContactResistance,
        core_lag::CoreLag,
    }
    sensor {
        current_dead_band::CurrentDeadBand,
        current_offset::CurrentOffset,
        current_gain::CurrentGain,
        current_skew::CurrentSkew,
        voltage_gain::VoltageGain,
        voltage_offset::VoltageOffset,
        temperature_bias::TemperatureBias,
    }
    robot {
        idle::Idle,
        cpu::Cpu,
        radio::Radio,
        gps::RECEIVER,
        camera::Camera,
        sensors::Sensors,
        encoders::ENCODERS,
        ldo::LinearRegulator,
        converter::Converter,
        converter_quadratic::ConverterQuadratic,
        input_voltage_loss::InputVoltageLoss,
        motion::Motion,
        rolling::Rolling,
        dry_friction::DryFriction,
        viscous_friction::ViscousFriction,
        floor::Floor,
        slope::Slope,
        acceleration::Acceleration,
        payload::Payload,
        regeneration::Regeneration,
        gear_loss::GearLoss,
        slip::Slip,
        motor_copper::MotorCopper,
        copper_temperature::CopperTemperature,
        h_bridge::HBridge,
        scrub::Scrub,
        no_load_current::NoLoadCurrent,
        caster_hold::CasterHold,
    }
    station {
        own_load::DIRECT,
        charger::Charger,
        charger_curve::ChargerCurve,
        path_selection::PATH_SELECTION,
        bay_contact::BayContact,
        converter::Converter,
        converter_curve::ConverterCurve,
        hotel::Hotel,
        lift::Lift,
        selector_switch::SelectorSwitch,
        pack_wiring::PackWiring,
    }
}

/// Every known effect, in order of evaluation within a phase.
#[must_use]
pub fn catalogue() -> &'static [&'static dyn Effect] {
    CATALOGUE
}

/// The effect of that id in that system, with its place in the catalogue.
#[must_use]
pub fn find(system: System, id: &str) -> Option<(usize, &'static dyn Effect)> {
    CATALOGUE.iter().copied().enumerate().find(|(_, effect)| effect.spec().system == system && effect.spec().id == id)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::effect::{Own, Steps};
    use crate::{Channel, Channels, Facts};

    #[test]
    fn the_catalogue_is_consistent() {
        let mut ids = BTreeSet::new();
        for effect in catalogue() {
            let spec = effect.spec();
            assert!(ids.insert((spec.system, spec.id)), "{} appears twice", spec.id);
            assert!(!spec.parameters.is_empty(), "{} has no parameter", spec.id);
            assert!(spec.parameters.iter().any(|p| p.null.is_some()), "{} cannot vanish", spec.id);
            for p in spec.parameters {
                assert!(p.min < p.max && (p.min..=p.max).contains(&p.default), "{}.{}", spec.id, p.name);
                assert!(p.null.is_none_or(|null| (p.min..=p.max).contains(&null)), "{}.{}", spec.id, p.name);
            }
            assert!(spec.system.phases().contains(&spec.phase), "{} acts in a phase that its system lacks", spec.id);
            for (other, _) in spec.confused_with {
                assert!(find(spec.system, other).is_some(), "{} names the unknown effect {other}", spec.id);
            }
        }
    }

    #[test]
    fn what_is_prepared_for_another_length_is_what_is_prepared_for_it_alone() {
        let facts = crate::effect::cell(1, &[], crate::Start::at_soc(1.0)).model().facts.clone();
        for effect in catalogue() {
            let facts = if effect.spec().system == System::Battery { facts.clone() } else { Facts::robot() };
            let parameters: Vec<f64> = effect.spec().parameters.iter().map(|p| 0.5 * (p.min.max(-1.0) + p.max.min(10.0))).collect();
            let (mut alone, mut after) = (vec![0.0; effect.prepared_len()], vec![0.0; effect.prepared_len()]);
            Steps::<f64>::prepare(*effect, &facts, 20.0, &parameters, &mut alone);
            Steps::<f64>::prepare(*effect, &facts, 0.1, &parameters, &mut after);
            Steps::<f64>::prepare_length(*effect, &facts, 20.0, &parameters, &mut after);
            assert_eq!(alone, after, "{}", effect.spec().id);
        }
    }

    /// What one force takes hangs on the others: downhill it may be nothing.
    #[test]
    fn every_effect_that_pushes_says_that_only_the_sum_of_the_forces_counts() {
        let mut pushing = Vec::new();
        for effect in catalogue().iter().filter(|effect| effect.spec().system == System::Robot) {
            let spec = effect.spec();
            let parameters: Vec<f64> = spec.parameters.iter().map(|p| p.default).collect();
            let (mut prepared, mut states) = (vec![0.0; effect.prepared_len()], vec![0.0; spec.states.len()]);
            let mut channels = Channels::filled(1.0_f64);
            Steps::<f64>::prepare(*effect, &Facts::robot(), 1.0, &parameters, &mut prepared);
            let own = Own { parameters: &parameters, prepared: &prepared, states: &mut states };
            Steps::<f64>::step(*effect, &Facts::robot(), 1.0, own, &mut channels);
            if channels[Channel::TractionN] != 1.0 {
                assert!(spec.equation.contains("max(0, v sum of all F)"), "{}: {}", spec.id, spec.equation);
                pushing.push(spec.id);
            }
        }
        assert!(pushing.len() >= 8 && pushing.contains(&"motion") && pushing.contains(&"slope"), "{pushing:?}");
    }
}
