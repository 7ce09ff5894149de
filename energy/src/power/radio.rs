//! Radios: power in dBm, Friis link budget, antenna mismatch and its cure, supply power by duty.
//!
//! What a radio radiates is a small part of what it takes: `P_dBm = 30 + 10 log10(P_W)` (Kottas,
//! Eq. 4.11) tells the first, the duty of its states the second.

use std::f64::consts::PI;

use crate::Real;
use crate::units::LIGHT_MPS;

/// Power in dBm of a power in W, > 0 (Kottas, Eq. 4.11).
#[must_use]
pub fn dbm(power_w: f64) -> f64 {
    30.0 + 10.0 * power_w.log10()
}

/// Power in W of a power in dBm.
#[must_use]
pub fn watts<S: Real>(power_dbm: S) -> S {
    ((power_dbm - 30.0) * (std::f64::consts::LN_10 / 10.0)).exp()
}

/// A radio link in free space, in the far field and without obstacles.
///
/// `P_RX = G_RX G_TX P_TX (lambda / (4 pi d))^2` (Kottas, Eq. A.4; Friis 1946). Reflections and
/// ground waves, which a robot near the ground has too, are not in it: there power falls faster
/// than with d².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Carrier frequency, Hz, > 0.
    pub frequency_hz: f64,
    /// Transmitted power, dBm.
    pub transmit_dbm: f64,
    /// Gain of the transmitter's antenna over an isotropic one, dB.
    pub transmit_gain_db: f64,
    /// Gain of the receiver's antenna over an isotropic one, dB.
    pub receive_gain_db: f64,
    /// Everything else lost on the way (mismatch, cables, fading margin), dB, >= 0.
    pub loss_db: f64,
    /// Least power that the receiver understands, dBm.
    pub sensitivity_dbm: f64,
}

impl Link {
    /// Wavelength, m.
    #[must_use]
    pub fn wavelength_m(&self) -> f64 {
        LIGHT_MPS / self.frequency_hz
    }

    /// Power at the receiver over a distance (m, > 0), dBm.
    #[must_use]
    pub fn received_dbm(&self, distance_m: f64) -> f64 {
        self.budget_dbm() + 20.0 * (self.wavelength_m() / (4.0 * PI * distance_m)).log10()
    }

    /// What is left above the receiver's sensitivity over a distance (m, > 0), dB; negative when
    /// the link does not hold.
    #[must_use]
    pub fn margin_db(&self, distance_m: f64) -> f64 {
        self.received_dbm(distance_m) - self.sensitivity_dbm
    }

    /// Distance at which the received power meets the sensitivity, m.
    #[must_use]
    pub fn range_m(&self) -> f64 {
        self.wavelength_m() / (4.0 * PI) * 10.0_f64.powf((self.budget_dbm() - self.sensitivity_dbm) / 20.0)
    }

    fn budget_dbm(&self) -> f64 {
        self.transmit_dbm + self.transmit_gain_db + self.receive_gain_db - self.loss_db
    }
}

/// An impedance R + jX, ohm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impedance {
    /// Resistance, ohm, > 0.
    pub resistance_ohm: f64,
    /// Reactance, ohm: positive when inductive.
    pub reactance_ohm: f64,
}

impl Impedance {
    /// Magnitude of the reflection coefficient against a real line impedance (ohm):
    /// `|Gamma| = |Z - Z_0| / |Z + Z_0|`.
    #[must_use]
    pub fn reflection(&self, line_ohm: f64) -> f64 {
        let Self { resistance_ohm: r, reactance_ohm: x } = *self;
        (r - line_ohm).hypot(x) / (r + line_ohm).hypot(x)
    }

    /// Power lost to the reflection, dB, >= 0: `-10 log10(1 - |Gamma|^2)`.
    #[must_use]
    pub fn mismatch_loss_db(&self, line_ohm: f64) -> f64 {
        -10.0 * (1.0 - self.reflection(line_ohm).powi(2)).log10()
    }
}

/// A lossless L-section between an antenna and a line: a reactance in series with the antenna,
/// then a susceptance across the line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LcMatch {
    /// Reactance in series with the antenna, ohm: an inductor when positive, a capacitor when negative.
    pub series_ohm: f64,
    /// Susceptance across the line, S: a capacitor when positive.
    pub shunt_s: f64,
}

impl LcMatch {
    /// The section that makes an antenna look like the line; none when its resistance is not
    /// below the line's (then the susceptance belongs across the antenna).
    #[must_use]
    pub fn for_antenna(antenna: Impedance, line_ohm: f64) -> Option<Self> {
        let Impedance { resistance_ohm: r, reactance_ohm: x } = antenna;
        (r > 0.0 && r < line_ohm).then(|| {
            let total_ohm = (r * (line_ohm - r)).sqrt();
            // 1 / (R + jX_t) = (R - jX_t) / (R Z_0): the conductance is 1 / Z_0, the rest is cancelled.
            Self { series_ohm: total_ohm - x, shunt_s: total_ohm / (r * line_ohm) }
        })
    }

    /// What the line sees of an antenna behind this section.
    #[must_use]
    pub fn seen(&self, antenna: Impedance) -> Impedance {
        let (r, x) = (antenna.resistance_ohm, antenna.reactance_ohm + self.series_ohm);
        let squared = r * r + x * x;
        let (g, b) = (r / squared, -x / squared + self.shunt_s);
        let squared = g * g + b * b;
        Impedance { resistance_ohm: g / squared, reactance_ohm: -b / squared }
    }
}

/// Share of the time that a radio spends in each state; the rest it sleeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duty {
    /// Transmitting, 0..1.
    pub transmit: f64,
    /// Listening or receiving, 0..1.
    pub listen: f64,
}

/// What a radio module takes from its supply in each state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadioModule {
    /// Asleep, W.
    pub sleep_w: f64,
    /// Listening or receiving, W.
    pub listen_w: f64,
    /// Transmitting, without its power amplifier, W.
    pub transmit_w: f64,
    /// Radiated over supplied power of the power amplifier, 0..1.
    pub amplifier_efficiency: f64,
}

impl RadioModule {
    /// Mean supply power, W, at a duty and a transmitted power (dBm).
    #[must_use]
    pub fn mean_w(&self, duty: Duty, transmit_dbm: f64) -> f64 {
        let transmitting_w = self.transmit_w + watts(transmit_dbm) / self.amplifier_efficiency;
        let asleep = (1.0 - duty.transmit - duty.listen).max(0.0);
        duty.transmit * transmitting_w + duty.listen * self.listen_w + asleep * self.sleep_w
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_dbm_is_a_milliwatt_and_twenty_a_hundred() {
        assert!((watts(0.0_f64) - 1e-3).abs() < 1e-15);
        assert!((watts(20.0_f64) - 0.1).abs() < 1e-12);
        assert!((watts(30.0_f64) - 1.0).abs() < 1e-12);
        assert!((dbm(0.1) - 20.0).abs() < 1e-12);
        assert!((dbm(watts(-87.3_f64)) + 87.3).abs() < 1e-9);
    }

    fn wifi() -> Link {
        Link { frequency_hz: 2.4e9, transmit_dbm: 15.0, transmit_gain_db: 2.0, receive_gain_db: 2.0, loss_db: 0.0, sensitivity_dbm: -85.0 }
    }

    #[test]
    fn free_space_loses_forty_db_over_a_metre_at_2_4_ghz() {
        // Textbook form of the loss: 20 log10(d / km) + 20 log10(f / MHz) + 32.45 dB.
        let textbook_db = 20.0 * 0.001_f64.log10() + 20.0 * 2400.0_f64.log10() + 32.45;
        assert!((15.0 + 4.0 - wifi().received_dbm(1.0) - textbook_db).abs() < 0.01);
        assert!((textbook_db - 40.05).abs() < 0.01);
    }

    #[test]
    fn the_range_is_where_the_margin_ends_and_six_db_double_it() {
        let link = wifi();
        assert!(link.margin_db(link.range_m()).abs() < 1e-9);
        let stronger = Link { transmit_dbm: link.transmit_dbm + 20.0 * 2.0_f64.log10(), ..link };
        assert!((stronger.range_m() / link.range_m() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_matched_antenna_reflects_nothing_and_a_short_everything() {
        let at = |resistance_ohm, reactance_ohm| Impedance { resistance_ohm, reactance_ohm };
        assert_eq!(at(50.0, 0.0).reflection(50.0), 0.0);
        assert!((at(1e-9, 0.0).reflection(50.0) - 1.0).abs() < 1e-9);
        // 100 ohm on 50 ohm: Gamma = 1/3, 1/9 of the power comes back.
        assert!((at(100.0, 0.0).mismatch_loss_db(50.0) - 0.5115).abs() < 1e-4);
    }

    /// Kottas, section A.2: an L-C network between the antenna and the receiver of a robot at
    /// 75.57 MHz nearly doubled its line-of-sight range. In the robot's shell the antenna was
    /// inductive; its impedance is in a figure that is lost, so 12 + j70 ohm here is a guess.
    #[test]
    fn an_lc_match_nearly_doubles_the_range_of_a_short_antenna() {
        let antenna = Impedance { resistance_ohm: 12.0, reactance_ohm: 70.0 };
        let network = LcMatch::for_antenna(antenna, 50.0).unwrap();
        assert!(network.seen(antenna).reflection(50.0) < 1e-12);
        let link = |loss_db| Link { frequency_hz: 75.57e6, transmit_dbm: 20.0, sensitivity_dbm: -100.0, loss_db, ..wifi() };
        assert!((link(0.0).wavelength_m() - 3.967).abs() < 1e-3);
        let longer = link(0.0).range_m() / link(antenna.mismatch_loss_db(50.0)).range_m();
        // By hand: |Gamma|^2 = (38^2 + 70^2) / (62^2 + 70^2) = 0.72553; 1 / sqrt(1 - 0.72553) = 1.9088.
        assert!((longer - 1.9088).abs() < 1e-3, "{longer}");
    }

    #[test]
    fn supply_power_is_the_mean_over_the_states() {
        let module = RadioModule { sleep_w: 0.01, listen_w: 0.6, transmit_w: 0.8, amplifier_efficiency: 0.25 };
        // 10 % transmitting 100 mW (0.8 + 0.4 W), 50 % listening, 40 % asleep: 0.12 + 0.3 + 0.004 W.
        assert!((module.mean_w(Duty { transmit: 0.1, listen: 0.5 }, 20.0) - 0.424).abs() < 1e-9);
        assert!((module.mean_w(Duty { transmit: 0.0, listen: 0.0 }, 20.0) - 0.01).abs() < 1e-12);
    }
}
