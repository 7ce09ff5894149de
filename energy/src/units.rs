//! Conversion constants: a file that converts units takes them from here, so that each is written, and can be wrong, once.
//!
//! Not here: minutes (60), percent and thousandths (ms, mV), which are plain where they stand; limits of a configuration, which stand
//! as their messages tell them; and tests, which count by hand.

/// Seconds in an hour.
pub const S_PER_H: f64 = 3600.0;
/// Hours in a second: a step multiplies by it, since a division would take longer.
pub const H_PER_S: f64 = 1.0 / S_PER_H;
/// Kelvin at 0 °C.
pub const KELVIN_AT_0_DEGC: f64 = 273.15;
/// Standard gravity, m/s² (3rd CGPM, 1901).
pub const GRAVITY_MPS2: f64 = 9.806_65;
/// Temperature at which parameters are stated when nothing else is said, °C.
pub const REFERENCE_DEGC: f64 = 25.0;
/// Days in the month in which self-discharge is stated.
pub const DAYS_PER_MONTH: f64 = 30.0;
/// Seconds in a day.
pub const S_PER_DAY: f64 = 86_400.0;
/// Molar gas constant, J/(mol K) (CODATA 2018, exact since the SI of 2019).
pub const GAS_CONSTANT_J_PER_MOL_K: f64 = 8.314_462_618;
/// Faraday constant, C/mol (CODATA 2018, exact since the SI of 2019).
pub const FARADAY_C_PER_MOL: f64 = 96_485.332_12;
/// Joules in a kilojoule.
pub const J_PER_KJ: f64 = 1000.0;
/// Speed of light in vacuum, m/s (exact, SI).
pub const LIGHT_MPS: f64 = 299_792_458.0;
/// Siemens in one nF MHz: switched capacitance times frequency is a conductance.
pub const S_PER_NF_MHZ: f64 = 1e-3;
