//! Numbers with units, for people. The unit of a number is the suffix of its name.

/// Suffixes of names and the units that they stand for, longest first where one ends in another.
const UNITS: &[(&str, &str)] = &[
    ("_ohm_per_sqrt_s", "ohm/sqrt(s)"),
    ("_w_per_k", "W/K"),
    ("_j_per_k", "J/K"),
    ("_j_per_m", "J/m"),
    ("_j_per_mol", "J/mol"),
    ("_kj_per_mol_k", "kJ/(mol K)"),
    ("_kj_per_mol", "kJ/mol"),
    ("_v_per_k", "V/K"),
    ("_v_per_n", "V/N"),
    ("_w_per_n2", "W/N^2"),
    ("_w_per_v2", "W/V^2"),
    ("_n_s_per_m", "N s/m"),
    ("_per_root_day", "1/sqrt(day)"),
    ("_per_sqrt_day", "1/sqrt(day)"),
    ("per_kelvin", "1/K"),
    ("_per_w", "1/W"),
    ("_per_n", "1/N"),
    ("_per_month", "1/month"),
    ("_per_cycle_after_knee", "1/cycle"),
    ("_per_cycle", "1/cycle"),
    ("_per_k", "1/K"),
    ("_per_s", "1/s"),
    ("_cycles", "cycles"),
    ("_count", ""),
    ("_radps", "rad/s"),
    ("_rad", "rad"),
    ("_mps2", "m/s2"),
    ("_mps", "m/s"),
    ("_degc", "degC"),
    ("_ohm", "ohm"),
    ("_kg", "kg"),
    ("_ah", "Ah"),
    ("_wh", "Wh"),
    ("_hz", "Hz"),
    ("_w", "W"),
    ("_v", "V"),
    ("_a", "A"),
    ("_s", "s"),
    ("_k", "K"),
    ("_n", "N"),
    ("_m", "m"),
];

/// The unit of what has this name; empty for a pure number.
#[must_use]
pub fn unit_of(name: &str) -> &'static str {
    UNITS.iter().find(|(suffix, _)| name.ends_with(suffix)).map_or("", |(_, unit)| unit)
}

/// Units that are read more easily with a prefix when the number is small.
const SCALABLE: &[&str] = &["V", "A", "ohm", "ohm/sqrt(s)", "W", "Ah"];

/// A number with its unit: `25.7 mV`, `1.50 degC`, `0.880`.
#[must_use]
pub fn quantity(value: f64, unit: &str) -> String {
    let small = value != 0.0 && value.abs() < 0.999_5 && SCALABLE.contains(&unit);
    let (value, prefix) = if small { (value * 1e3, "m") } else { (value, "") };
    let space = if unit.is_empty() { "" } else { " " };
    format!("{}{space}{prefix}{unit}", digits(value))
}

/// Three significant digits; an exponent only where the plain form would be long.
#[must_use]
pub fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "-".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    format!("{value:.0$}", (2.0 - magnitude).max(0.0) as usize)
}

/// A value with its sigma in the value's unit: `67.9 +- 3.2 mohm`.
#[must_use]
pub fn with_sigma(value: f64, sigma: Option<f64>, unit: &str) -> String {
    let Some(sigma) = sigma.filter(|sigma| sigma.is_finite() && *sigma > 0.0) else {
        return format!("{} +- ?", quantity(value, unit));
    };
    let small = value.abs().max(sigma) < 0.999_5 && SCALABLE.contains(&unit);
    let (scale, prefix) = if small { (1e3, "m") } else { (1.0, "") };
    // Two digits of sigma, and the value to the same place.
    let places = (1.0 - (sigma * scale).log10().floor()).clamp(0.0, 9.0) as usize;
    let space = if unit.is_empty() { "" } else { " " };
    let shown = format!("{:.places$}", value * scale);
    // Nothing has no sign.
    let shown = if shown.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { shown.trim_start_matches('-') } else { &shown };
    format!("{shown} +- {:.places$}{space}{prefix}{unit}", sigma * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_come_from_names() {
        assert_eq!(unit_of("resistance_soc_005_ohm"), "ohm");
        assert_eq!(unit_of("conductance_w_per_k"), "W/K");
        assert_eq!(unit_of("tau_s"), "s");
        assert_eq!(unit_of("z0_ohm_per_sqrt_s"), "ohm/sqrt(s)");
        assert_eq!(unit_of("square_loss_per_w"), "1/W");
        assert_eq!(unit_of("heat_loss_w"), "W");
        assert_eq!(unit_of("efficiency"), "");
    }

    /// Whatever is told per something has a unit of its own, not that of its name's end.
    #[test]
    fn every_parameter_per_something_has_a_unit_that_says_so() {
        let parameters = energy::catalogue().iter().flat_map(|effect| effect.spec().parameters);
        for name in parameters.map(|parameter| parameter.name).filter(|name| name.contains("_per_") || name.starts_with("per_")) {
            assert!(unit_of(name).contains('/') || name == "supply_per_radiated", "{name} is in `{}`", unit_of(name));
        }
    }

    #[test]
    fn numbers_are_short_and_keep_their_meaning() {
        assert_eq!(quantity(0.025_69, "V"), "25.7 mV");
        assert_eq!(quantity(12.345, "V"), "12.3 V");
        assert_eq!(quantity(0.88, ""), "0.880");
        assert_eq!(quantity(-0.000_2, "V"), "-0.200 mV");
        assert_eq!(quantity(123_456.0, "s"), "123456 s");
        assert_eq!(quantity(1e-6, "K"), "1.00e-6 K");
        assert_eq!(with_sigma(0.067_89, Some(0.003_21), "ohm"), "67.9 +- 3.2 mohm");
        assert_eq!(with_sigma(50.0, None, "s"), "50.0 s +- ?");
        assert_eq!(with_sigma(-0.000_1, Some(0.010), "ohm"), "0 +- 10 mohm");
    }
}
