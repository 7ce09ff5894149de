//! Classes: effects that these logs cannot, or a decision need not, tell from each other.
//!
//! An effect that stands in no row is a class of its own. Rows are narrow on purpose: each
//! states why its members are one physics to anybody who has only these logs.

use energy::System;

/// A class: its name, its members, and why they are one.
#[derive(Debug)]
pub struct Class {
    /// The system.
    pub system: System,
    /// Name in tables.
    pub name: &'static str,
    /// Ids of its effects.
    pub members: &'static [&'static str],
    /// Why nobody can or need tell them from each other.
    pub reason: &'static str,
}

/// Every class of more than one effect.
pub const CLASSES: &[Class] = &[
    Class {
        system: System::Battery,
        name: "slow polarisation",
        members: &["rc1", "rc2", "rc_ladder", "warburg", "surface_diffusion"],
        reason: "sums of exponentials over 15 s to 2000 s; which sum it is changes no forecast, and rests of one hour do not tell",
    },
    Class {
        system: System::Battery,
        name: "series resistance",
        members: &["ohmic", "contact_resistance"],
        reason: "one voltage channel: both are R times I",
    },
    Class {
        system: System::Battery,
        name: "series resistance over temperature",
        members: &["arrhenius", "super_arrhenius"],
        reason: "one law, as a line over 1/T and with its bend",
    },
    Class {
        system: System::Battery,
        name: "leak past the gauge",
        members: &["current_offset", "parasitic_load"],
        reason: "the same constant current, seen from two sides of the ammeter",
    },
    Class {
        system: System::Battery,
        name: "voltage sensor",
        members: &["voltage_offset", "voltage_gain"],
        reason: "over the 1.2 V of a cell, with an OCV table known to 3 mV, a gain is an offset",
    },
    Class { system: System::Robot, name: "constant load", members: &["idle", "gps", "encoders"], reason: "a constant is a constant" },
    Class {
        system: System::Robot,
        name: "load that follows the supply voltage",
        members: &["ldo", "sensors", "input_voltage_loss"],
        reason: "over 9.5 V to 12.6 V a square deviates from a line by a thirtieth; the constant part goes into idle",
    },
    Class {
        system: System::Robot,
        name: "conversion loss",
        members: &["converter", "converter_quadratic"],
        reason: "one loss, as a line and with its square",
    },
    Class {
        system: System::Robot,
        name: "friction of the drive",
        members: &["rolling", "dry_friction"],
        reason: "a force against the motion, times speed; payload changes one of them by its small share",
    },
    Class {
        system: System::Robot,
        name: "load per time that the wheels turn",
        members: &["no_load_current", "h_bridge"],
        reason: "a constant while moving; the pack's voltage varies by a tenth while it drives",
    },
    Class {
        system: System::Station,
        name: "conversion loss",
        members: &["charger_efficiency", "converter_efficiency", "charger_curve", "converter_curve"],
        reason: "charger and converter lie in a row and only their product is measured",
    },
    Class {
        system: System::Station,
        name: "own load of docked robots",
        members: &["robot_own_load", "path_selection"],
        reason: "the same load before and behind a charger of known efficiency",
    },
];

/// Effects that are no wrong name beside, or instead of, a hidden one, though they miss it: system,
/// hidden, named, reason. They count as neither hit nor wrong.
const EXCUSED: &[(System, &str, &str, &str)] = &[
    (System::Battery, "self_discharge", "current_offset", "a leak of charge, without its small voltage drop"),
    (System::Battery, "self_discharge", "parasitic_load", "a leak of charge, without its small voltage drop"),
    (System::Battery, "self_discharge", "current_dead_band", "a leak that rests show"),
    (System::Battery, "current_dead_band", "parasitic_load", "a leak that rests show most"),
    (System::Battery, "current_dead_band", "current_offset", "a leak that rests show most"),
    (System::Battery, "ohmic_soc", "surface_diffusion", "depletion near empty acts as resistance does there"),
    (System::Robot, "dry_friction", "no_load_current", "its step is a load per time that the wheels turn"),
    (System::Robot, "dry_friction", "h_bridge", "its step is a load per time that the wheels turn"),
    (System::Robot, "no_load_current", "dry_friction", "the step of dry friction is this load"),
    (System::Robot, "h_bridge", "dry_friction", "the step of dry friction is its switching loss"),
    (System::Robot, "motion", "slope", "a part of the hidden whole"),
    (System::Robot, "motion", "acceleration", "a part of the hidden whole"),
    (System::Robot, "motion", "payload", "a part of the hidden whole"),
    (System::Robot, "motion", "rolling", "a part of the hidden whole"),
    (System::Robot, "motion", "gear_loss", "its efficiency"),
    (System::Robot, "motion", "dry_friction", "its rolling force"),
    (System::Robot, "gear_loss", "viscous_friction", "at one slope the same force"),
    (System::Robot, "converter_quadratic", "idle", "its fixed loss"),
    (System::Station, "pack_wiring", "converter_curve", "the square of the same current, one converter apart"),
    (System::Station, "converter_curve", "pack_wiring", "the square of the same current, one converter apart"),
];

/// The name of the class of an effect: its own id when it is alone.
#[must_use]
pub fn class_of(system: System, id: &str) -> &str {
    CLASSES.iter().find(|class| class.system == system && class.members.contains(&id)).map_or(id, |class| class.name)
}

/// Whether two effects are of one class.
#[must_use]
pub fn same_class(system: System, a: &str, b: &str) -> bool {
    class_of(system, a) == class_of(system, b)
}

/// Whether naming that effect is no mistake when this one is hidden.
#[must_use]
pub fn excused(system: System, hidden: &str, named: &str) -> bool {
    EXCUSED.iter().any(|&(s, h, n, _)| (s, h, n) == (system, hidden, named))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_in_the_tables_exists_and_stands_in_one_class() {
        for class in CLASSES {
            for id in class.members {
                assert!(energy::find(class.system, id).is_some(), "{id}");
                let classes = CLASSES.iter().filter(|other| other.system == class.system && other.members.contains(id));
                assert_eq!(classes.count(), 1, "{id}");
            }
            assert!(class.reason.len() > 15);
        }
        for (system, hidden, named, _) in EXCUSED {
            assert!(energy::find(*system, hidden).is_some() && energy::find(*system, named).is_some(), "{hidden} {named}");
            assert!(!same_class(*system, hidden, named), "{hidden} {named}: one class needs no excuse");
        }
    }
}
