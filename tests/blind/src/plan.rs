//! The list of cases: which things are hidden, how often and how large. A case's seed only draws
//! the numbers.

use energy::{EffectSpec, System, catalogue};

use crate::case::Kind;
use crate::electrochemical::CELLS;
use crate::foreign::{OTHER_FORMS, OUTSIDE, Stranger};
use crate::setting::Poor;

/// Seeds for development begin here: tune on these as much as you like.
pub const DEVELOPMENT_SEED: u64 = 1;
/// Seeds of the published table begin here: never tune on them, and never look at single cases.
pub const PUBLISHED_SEED: u64 = 7_000_000;

/// What a case is about.
#[derive(Debug, Clone)]
pub enum Subject {
    /// Effects of the catalogue are hidden.
    Effects {
        /// Which.
        ids: Vec<&'static str>,
        /// They are hard to tell from each other.
        confusable: bool,
    },
    /// Nothing is hidden.
    Nothing {
        /// The lab's OCV table is wrong.
        wrong_ocv: bool,
    },
    /// Something foreign is in the world.
    Stranger(&'static Stranger),
    /// Effects that the logs cannot tell.
    Collinear(&'static Ambiguity),
    /// An electrochemical cell with that base.
    Cell {
        /// Place in the list of cells.
        cell: usize,
        /// Effects of the base.
        base: &'static [&'static str],
    },
}

/// Effects that logs of this kind cannot tell from each other, by construction.
#[derive(Debug)]
pub struct Ambiguity {
    /// Name of its case.
    pub name: &'static str,
    /// The system.
    pub system: System,
    /// One of these is hidden.
    pub hidden: &'static [&'static str],
    /// All of these must be named.
    pub must: &'static [&'static str],
    /// These may be named.
    pub may: &'static [&'static str],
    /// Effects of the base.
    pub base: &'static [&'static str],
    /// The base's parameters are known.
    pub all_known: bool,
    /// What the logs lack.
    pub poor: Poor,
}

/// One place of the list.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Its kind.
    pub kind: Kind,
    /// Its system.
    pub system: System,
    /// Its name.
    pub name: String,
    /// What is hidden.
    pub subject: Subject,
    /// Bounds of what it leaves, as strengths: 1 is 1 mV per cell or 2 sensor floors.
    pub strength: (f64, f64),
}

/// Three sizes of every single effect: 0.25 to 20 mV per cell, 0.5 to 40 sensor floors.
const SIZES: [(f64, f64); 3] = [(0.25, 1.0), (1.0, 4.5), (4.5, 20.0)];
/// What each effect of a pair leaves.
const OF_A_PAIR: (f64, f64) = (1.2, 6.0);
/// What foreign things leave.
const FOREIGN: (f64, f64) = (1.5, 12.0);
/// How often other forms and outsiders are repeated with other numbers.
const REPEATS: usize = 3;
const REPEATS_OUTSIDE: usize = 4;
/// Nulls per system.
const NULLS: [(System, usize); 3] = [(System::Battery, 40), (System::Robot, 16), (System::Station, 16)];

const NO_POOR: Poor = Poor { one_age: false, age_follows_cycles: false, one_temperature: false, together: false };

/// Everything that logs cannot tell.
pub const COLLINEAR: &[Ambiguity] = &[
    Ambiguity {
        name: "gain-or-fade",
        system: System::Battery,
        hidden: &["capacity_fade", "calendar_fade"],
        must: &["current_gain", "capacity_fade", "calendar_fade"],
        may: &[],
        base: &["ohmic"],
        all_known: false,
        poor: Poor { one_age: true, ..NO_POOR },
    },
    Ambiguity {
        name: "leak-or-offset",
        system: System::Battery,
        hidden: &["parasitic_load"],
        must: &["parasitic_load", "current_offset"],
        may: &["self_discharge", "current_dead_band"],
        base: &["ohmic"],
        all_known: false,
        poor: NO_POOR,
    },
    Ambiguity {
        name: "connector-or-cell",
        system: System::Battery,
        hidden: &["ohmic", "contact_resistance"],
        must: &["ohmic", "contact_resistance"],
        may: &["weak_cell", "ohmic_soc"],
        base: &["rc1"],
        all_known: false,
        poor: NO_POOR,
    },
    Ambiguity {
        name: "cold-or-aged",
        system: System::Battery,
        hidden: &["arrhenius", "resistance_growth", "calendar_resistance"],
        must: &["arrhenius", "resistance_growth", "calendar_resistance", "contact_resistance"],
        // Charge transfer far below its exchange current and a relaxation faster than the rows are resistances, too.
        may: &["super_arrhenius", "ohmic_soc", "weak_cell", "butler_volmer", "rc1"],
        base: &["ohmic"],
        all_known: true,
        poor: Poor { one_age: true, one_temperature: true, ..NO_POOR },
    },
    Ambiguity {
        name: "cycles-or-years",
        system: System::Battery,
        hidden: &["capacity_fade", "calendar_fade"],
        must: &["capacity_fade", "calendar_fade"],
        may: &[],
        base: &["ohmic"],
        all_known: false,
        poor: Poor { age_follows_cycles: true, ..NO_POOR },
    },
    Ambiguity {
        name: "growth-or-years",
        system: System::Battery,
        hidden: &["resistance_growth", "calendar_resistance"],
        must: &["resistance_growth", "calendar_resistance"],
        may: &[],
        base: &["ohmic"],
        all_known: false,
        poor: Poor { age_follows_cycles: true, ..NO_POOR },
    },
    Ambiguity {
        name: "camera-or-radio",
        system: System::Robot,
        hidden: &["camera"],
        must: &["camera", "radio"],
        may: &[],
        base: &["idle", "rolling", "slope", "acceleration", "payload"],
        all_known: false,
        poor: Poor { together: true, ..NO_POOR },
    },
    Ambiguity {
        name: "standby-or-hotel",
        system: System::Station,
        hidden: &["hotel", "robot_own_load"],
        must: &["hotel", "robot_own_load"],
        may: &["path_selection", "charger_curve", "converter_curve"],
        base: &["charger_efficiency", "converter_efficiency"],
        all_known: false,
        poor: Poor { together: true, ..NO_POOR },
    },
];

/// Pairs that are easily taken for one another or for one effect.
const CONFUSABLE: &[(System, &str, &str)] = &[
    (System::Battery, "arrhenius", "resistance_growth"),
    (System::Battery, "hysteresis", "charge_asymmetry"),
    (System::Battery, "capacity_fade", "current_gain"),
    (System::Battery, "rate_capacity", "coulombic_loss"),
    (System::Battery, "butler_volmer", "arrhenius"),
    (System::Battery, "entropic", "voltage_offset"),
    (System::Battery, "surface_diffusion", "ohmic_soc"),
    (System::Battery, "rc1", "current_skew"),
    (System::Battery, "weak_cell", "capacity_fade"),
    (System::Battery, "capacity_fade", "calendar_fade"),
    (System::Battery, "resistance_growth", "calendar_resistance"),
    (System::Battery, "arrhenius", "polarisation_arrhenius"),
    (System::Battery, "polarisation_arrhenius", "relaxation_arrhenius"),
    (System::Battery, "ohmic_soc", "polarisation_soc"),
    (System::Battery, "hysteresis", "warburg"),
    (System::Battery, "current_dead_band", "current_offset"),
    (System::Robot, "rolling", "no_load_current"),
    (System::Robot, "slip", "motor_copper"),
    (System::Robot, "dry_friction", "viscous_friction"),
    (System::Robot, "scrub", "h_bridge"),
    (System::Robot, "gear_loss", "slip"),
    (System::Robot, "floor", "dry_friction"),
    (System::Station, "robot_own_load", "hotel"),
    (System::Station, "bay_contact", "charger_curve"),
    (System::Station, "lift", "selector_switch"),
    (System::Station, "pack_wiring", "charger_efficiency"),
];

/// Pairs of unlike effects.
const UNLIKE: &[(System, &str, &str)] = &[
    (System::Battery, "rc1", "entropic"),
    (System::Battery, "arrhenius", "hysteresis"),
    (System::Battery, "arrhenius", "capacity_fade"),
    (System::Battery, "ohmic_soc", "rc1"),
    (System::Battery, "charge_asymmetry", "capacity_fade"),
    (System::Battery, "rc2", "resistance_growth"),
    (System::Battery, "hysteresis", "ohmic_soc"),
    (System::Battery, "butler_volmer", "rc2"),
    (System::Battery, "current_gain", "arrhenius"),
    (System::Battery, "rc_ladder", "calendar_fade"),
    (System::Battery, "warburg", "entropic"),
    (System::Battery, "parasitic_load", "ohmic_soc"),
    (System::Battery, "weak_cell", "arrhenius"),
    (System::Battery, "coulombic_loss", "rc1"),
    (System::Battery, "relaxation_arrhenius", "capacity_fade"),
    (System::Battery, "polarisation_soc", "entropic"),
    (System::Robot, "camera", "slope"),
    (System::Robot, "cpu", "scrub"),
    (System::Robot, "radio", "floor"),
    (System::Robot, "caster_hold", "motor_copper"),
    (System::Robot, "ldo", "viscous_friction"),
    (System::Robot, "regeneration", "camera"),
    (System::Station, "hotel", "lift"),
    (System::Station, "robot_own_load", "bay_contact"),
    (System::Station, "charger_efficiency", "selector_switch"),
    (System::Station, "lift", "converter_curve"),
];

/// Every case, in an order in which any stretch of it has many kinds.
#[must_use]
pub fn plan() -> Vec<Entry> {
    let kinds = [singles(), pairs(), nulls(), strangers(), outsiders(), collinear(), electrochemical()];
    // Dealt like cards: every kind spreads over the whole list.
    let mut dealt: Vec<(f64, Entry)> = Vec::new();
    for kind in kinds {
        let count = kind.len() as f64;
        dealt.extend(kind.into_iter().enumerate().map(|(index, entry)| ((index as f64 + 0.5) / count, entry)));
    }
    dealt.sort_by(|a, b| a.0.total_cmp(&b.0));
    dealt.into_iter().map(|(_, entry)| entry).collect()
}

fn entry(kind: Kind, system: System, name: &str, subject: Subject, strength: (f64, f64)) -> Entry {
    Entry { kind, system, name: format!("{}/{}/{name}", kind.name(), system.name()), subject, strength }
}

/// Every effect that the lab is asked about: cases tell cycles and days, so that what sums up their effects is not.
#[must_use]
pub fn effects() -> Vec<&'static EffectSpec> {
    catalogue().iter().filter(|effect| effect.told_by().is_empty()).map(|effect| effect.spec()).collect()
}

fn singles() -> Vec<Entry> {
    let sizes = SIZES.iter().enumerate();
    let of_size = |(size, &strength): (usize, &(f64, f64))| {
        // Each size begins elsewhere in the catalogue, so that a short run meets many effects.
        let (specs, shift) = (effects(), size * 25);
        let specs = (0..specs.len()).map(move |index| specs[(index + shift) % specs.len()]);
        specs.map(move |spec| {
            let subject = Subject::Effects { ids: vec![spec.id], confusable: false };
            entry(Kind::Single, spec.system, &format!("{}/{}", spec.id, ["small", "middle", "large"][size]), subject, strength)
        })
    };
    sizes.flat_map(of_size).collect()
}

fn pairs() -> Vec<Entry> {
    let of = |&(system, a, b): &(System, &'static str, &'static str), confusable| {
        entry(Kind::Pair, system, &format!("{a}+{b}"), Subject::Effects { ids: vec![a, b], confusable }, OF_A_PAIR)
    };
    CONFUSABLE.iter().zip(UNLIKE).flat_map(|(like, unlike)| [of(like, true), of(unlike, false)]).collect()
}

fn nulls() -> Vec<Entry> {
    let of = |&(system, count): &(System, usize)| {
        (0..count).map(move |index| {
            let wrong_ocv = system == System::Battery && index % 2 == 0;
            let name = format!("{}{}", if wrong_ocv { "wrong-ocv-" } else { "" }, index + 1);
            entry(Kind::Null, system, &name, Subject::Nothing { wrong_ocv }, (0.0, 0.0))
        })
    };
    NULLS.iter().flat_map(of).collect()
}

fn strangers() -> Vec<Entry> {
    let of = |stranger: &'static Stranger| entry(Kind::OtherForm, stranger.system, stranger.name, Subject::Stranger(stranger), FOREIGN);
    (0..REPEATS).flat_map(|_| OTHER_FORMS.iter().map(of)).collect()
}

fn outsiders() -> Vec<Entry> {
    let of = |stranger: &'static Stranger| entry(Kind::Outside, stranger.system, stranger.name, Subject::Stranger(stranger), FOREIGN);
    (0..REPEATS_OUTSIDE).flat_map(|_| OUTSIDE.iter().map(of)).collect()
}

fn collinear() -> Vec<Entry> {
    let of = |of: &'static Ambiguity| entry(Kind::Collinear, of.system, of.name, Subject::Collinear(of), (2.0, 10.0));
    (0..REPEATS).flat_map(|_| COLLINEAR.iter().map(of)).collect()
}

fn electrochemical() -> Vec<Entry> {
    let bases: [&'static [&'static str]; 2] = [&["ohmic"], &["ohmic", "rc1"]];
    let of = move |index: usize| {
        let (cell, base) = (index % CELLS.len(), bases[index / CELLS.len() % 2]);
        entry(
            Kind::Electrochemical,
            System::Battery,
            &format!("{}/{}", CELLS[cell].name, base.join("+")),
            Subject::Cell { cell, base },
            (0.0, 0.0),
        )
    };
    (0..12).map(of).collect()
}
