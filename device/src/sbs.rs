//! A Smart Battery on an SMBus or I2C bus (Smart Battery Data Specification 1.1): the gauge chip inside
//! the pack, as the robots of Kottas' thesis have it. Words are little-endian; a current into the
//! battery is positive there.

mod bus;

use std::path::PathBuf;

use anyhow::{Context, anyhow, ensure};
use crc::{CRC_8_SMBUS, Crc};
use embedded_hal::i2c::I2c;
use energy::units::KELVIN_AT_0_DEGC;
use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use self::bus::LinuxBus;
use crate::report::{Device, Report, Supply};

/// `[source] kind = "sbs"`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The bus, such as /dev/i2c-1.
    pub bus: PathBuf,
    /// The battery's 7-bit address.
    #[serde(default = "default_address")]
    pub address: u8,
}

/// Address of a Smart Battery (System Management Bus, 0x16 with the read bit).
fn default_address() -> u8 {
    0x0b
}

impl Config {
    /// The battery of that bus at its usual address.
    #[must_use]
    pub fn on(bus: PathBuf) -> Self {
        Self { bus, address: default_address() }
    }

    /// Checks the address.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!((0x08..=0x77).contains(&self.address), "address = {}: must be between 8 (0x08) and 119 (0x77)", self.address);
        Ok(())
    }

    /// Opens the bus and asks the battery what it is. One that may be away need not answer, and is asked again with every reading.
    ///
    /// # Errors
    /// When the bus cannot be opened; when nobody answers there who may not be away.
    pub fn open(&self, may_be_away: bool) -> anyhow::Result<Box<dyn Device>> {
        let bus = self.bus.display();
        let i2c = LinuxBus::open(&self.bus).with_context(|| format!("bus: cannot open {bus}"))?;
        let mut battery = SmartBattery::new(i2c, self.address, format!("sbs {bus}"));
        match battery.greet().with_context(|| format!("no Smart Battery answers at {bus}, address {:#04x}", self.address)) {
            Err(error) if may_be_away => warn!("{error:#}: taken to be away"),
            greeted => drop(greeted?),
        }
        Ok(Box::new(battery))
    }
}

/// Commands of the specification, by their codes.
mod command {
    pub(super) const BATTERY_MODE: u8 = 0x03;
    pub(super) const TEMPERATURE: u8 = 0x08;
    pub(super) const VOLTAGE: u8 = 0x09;
    pub(super) const CURRENT: u8 = 0x0a;
    pub(super) const MAX_ERROR: u8 = 0x0c;
    pub(super) const RELATIVE_STATE_OF_CHARGE: u8 = 0x0d;
    pub(super) const REMAINING_CAPACITY: u8 = 0x0f;
    pub(super) const FULL_CHARGE_CAPACITY: u8 = 0x10;
    pub(super) const BATTERY_STATUS: u8 = 0x16;
    pub(super) const SPECIFICATION_INFO: u8 = 0x1a;
}

/// BatteryMode: capacities are in 10 mWh, not in mAh.
const CAPACITY_MODE: u16 = 1 << 15;
/// BatteryStatus: the battery is not being charged.
const DISCHARGING: u16 = 1 << 6;
/// BatteryStatus: the gauge has been set up.
const INITIALIZED: u16 = 1 << 7;
/// Times that a word is asked for whose check byte is wrong.
const TRIES: usize = 3;

/// What SpecificationInfo says.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Specification {
    /// Factor of voltages.
    voltage_scale: f64,
    /// Factor of currents and capacities.
    current_scale: f64,
    /// Whether words come with a check byte.
    checked: bool,
}

impl Specification {
    fn of(word: u16) -> Self {
        let nibble = |shift: u16| i32::from(word >> shift & 0xf);
        Self { voltage_scale: 10_f64.powi(nibble(8)), current_scale: 10_f64.powi(nibble(12)), checked: nibble(4) == 3 }
    }
}

/// A Smart Battery on a bus.
struct SmartBattery<B> {
    bus: B,
    address: u8,
    name: String,
    /// Read anew whenever the battery was silent: it may be another one.
    specification: Option<Specification>,
}

impl<B: I2c + Send> SmartBattery<B> {
    fn new(bus: B, address: u8, name: String) -> Self {
        Self { bus, address, name, specification: None }
    }

    /// What the battery says of itself.
    fn greet(&mut self) -> anyhow::Result<Specification> {
        if let Some(specification) = self.specification {
            return Ok(specification);
        }
        let specification = Specification::of(self.plain_word(command::SPECIFICATION_INFO)?);
        let status = self.plain_word(command::BATTERY_STATUS)?;
        if status & INITIALIZED == 0 {
            warn!("{}: its gauge says that it is not initialized: its state of charge may be wrong", self.name);
        }
        info!("{}: {specification:?}", self.name);
        self.specification = Some(specification);
        Ok(specification)
    }

    fn plain_word(&mut self, command: u8) -> anyhow::Result<u16> {
        let mut bytes = [0; 2];
        self.ask(command, &mut bytes)?;
        Ok(u16::from_le_bytes(bytes))
    }

    /// A word with the check byte that covers the whole exchange on the bus (SMBus PEC).
    fn checked_word(&mut self, command: u8) -> anyhow::Result<u16> {
        let crc = Crc::<u8>::new(&CRC_8_SMBUS);
        for _ in 0..TRIES {
            let mut bytes = [0; 3];
            self.ask(command, &mut bytes)?;
            let [low, high, check] = bytes;
            let (write, read) = (self.address << 1, self.address << 1 | 1);
            if crc.checksum(&[write, command, read, low, high]) == check {
                return Ok(u16::from_le_bytes([low, high]));
            }
        }
        Err(anyhow!("command {command:#04x}: its check byte (PEC) was wrong {TRIES} times"))
    }

    fn word(&mut self, command: u8) -> anyhow::Result<u16> {
        if self.greet()?.checked { self.checked_word(command) } else { self.plain_word(command) }
    }

    fn ask(&mut self, command: u8, bytes: &mut [u8]) -> anyhow::Result<()> {
        self.bus.write_read(self.address, &[command], bytes).map_err(|error| anyhow!("command {command:#04x}: {error:?}"))
    }

    fn report(&mut self) -> anyhow::Result<Report> {
        let Specification { voltage_scale, current_scale, .. } = self.greet()?;
        let voltage_v = f64::from(self.word(command::VOLTAGE)?) / 1e3 * voltage_scale;
        let into_a = f64::from(self.word(command::CURRENT)?.cast_signed()) / 1e3 * current_scale;
        let temperature_degc = f64::from(self.word(command::TEMPERATURE)?) / 10.0 - KELVIN_AT_0_DEGC;
        let soc = self.state_of_charge()?;
        // Percent: a step of one is the least that it may be off by.
        let max_error = f64::from(self.word(command::MAX_ERROR)?) / 100.0;
        let charging = self.word(command::BATTERY_STATUS)? & DISCHARGING == 0;
        Ok(Report {
            at_s: None,
            voltage_v: Some(voltage_v).filter(|volts| *volts > 0.0),
            current_a: Some(0.0 - into_a),
            temperature_degc: Some(temperature_degc),
            soc: Some(soc.clamp(0.0, 1.0)),
            soc_sigma: Some(max_error.clamp(0.01 / 12_f64.sqrt(), 0.5)),
            supply: if charging { Supply::Connected } else { Supply::Unknown },
        })
    }

    /// By the charge where capacities are charges, else in whole percent.
    fn state_of_charge(&mut self) -> anyhow::Result<f64> {
        if self.word(command::BATTERY_MODE)? & CAPACITY_MODE == 0 {
            let full = f64::from(self.word(command::FULL_CHARGE_CAPACITY)?);
            if full > 0.0 {
                return Ok(f64::from(self.word(command::REMAINING_CAPACITY)?) / full);
            }
        }
        Ok(f64::from(self.word(command::RELATIVE_STATE_OF_CHARGE)?) / 100.0)
    }
}

impl<B: I2c + Send> Device for SmartBattery<B> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn read(&mut self, _dt_s: f64) -> anyhow::Result<Vec<Report>> {
        let report = self.report();
        if report.is_err() {
            self.specification = None;
        }
        Ok(vec![report?])
    }
}

#[cfg(test)]
mod tests {
    use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
    use embedded_hal_mock::eh1::i2c::{Mock, Transaction};

    use super::*;

    const ADDRESS: u8 = 0x0b;

    fn word(command: u8, value: u16) -> Transaction {
        Transaction::write_read(ADDRESS, vec![command], value.to_le_bytes().to_vec())
    }

    fn battery(transactions: &[Transaction]) -> (SmartBattery<Mock>, Mock) {
        let mock = Mock::new(transactions);
        (SmartBattery::new(mock.clone(), ADDRESS, "sbs test".to_owned()), mock)
    }

    /// A bq20z75-like pack without check bytes: 12.0 V, 1.5 A drawn, 25.05 degC, 2200 of 4400 mAh.
    fn discharging(info: u16) -> Vec<Transaction> {
        vec![
            word(0x1a, info),
            word(0x16, INITIALIZED | DISCHARGING),
            word(0x09, 12_000),
            word(0x0a, (-1_500_i16).cast_unsigned()),
            word(0x08, 2982),
            word(0x03, 0),
            word(0x10, 4400),
            word(0x0f, 2200),
            word(0x0c, 2),
            word(0x16, INITIALIZED | DISCHARGING),
        ]
    }

    #[test]
    fn words_of_the_specification_become_our_units_and_signs() {
        let (mut battery, mut mock) = battery(&discharging(0x0021));
        let report = battery.read(1.0).unwrap()[0];
        assert_eq!((report.voltage_v, report.current_a, report.soc), (Some(12.0), Some(1.5), Some(0.5)));
        assert!((report.temperature_degc.unwrap() - 25.05).abs() < 1e-9);
        assert_eq!((report.soc_sigma, report.supply), (Some(0.02), Supply::Unknown));
        mock.done();
    }

    #[test]
    fn scales_hold_for_voltages_and_for_currents() {
        // IPScale 1, VScale 1, version 1.1, revision 1.
        let (mut battery, mut mock) = battery(&discharging(0x1121));
        let report = battery.read(1.0).unwrap()[0];
        assert_eq!((report.voltage_v, report.current_a, report.soc), (Some(120.0), Some(15.0), Some(0.5)));
        mock.done();
    }

    #[test]
    fn energies_are_no_charges_and_a_charging_battery_has_a_supply() {
        let mut transactions = discharging(0x0021);
        transactions.splice(5..8, [word(0x03, CAPACITY_MODE), word(0x0d, 47)]);
        transactions[3] = word(0x0a, 800);
        *transactions.last_mut().unwrap() = word(0x16, INITIALIZED);
        let (mut battery, mut mock) = battery(&transactions);
        let report = battery.read(1.0).unwrap()[0];
        assert_eq!((report.current_a, report.soc, report.supply), (Some(-0.8), Some(0.47), Supply::Connected));
        mock.done();
    }

    #[test]
    fn a_wrong_check_byte_is_asked_for_again_and_then_told() {
        // By hand with another CRC-8 program (polynomial 07): 16 09 17 e0 2e -> e2.
        let good = Transaction::write_read(ADDRESS, vec![0x09], vec![0xe0, 0x2e, 0xe2]);
        let bad = Transaction::write_read(ADDRESS, vec![0x09], vec![0xe1, 0x2e, 0xe2]);
        let (mut battery, mut mock) = battery(&[bad.clone(), good, bad.clone(), bad.clone(), bad]);
        battery.specification = Some(Specification::of(0x0031));
        assert_eq!(battery.word(0x09).unwrap(), 12_000);
        assert_eq!(battery.word(0x09).unwrap_err().to_string(), "command 0x09: its check byte (PEC) was wrong 3 times");
        mock.done();
    }

    #[test]
    fn a_battery_that_was_taken_out_is_told_and_another_is_asked_what_it_is() {
        let gone = word(0x09, 0).with_error(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));
        let mut transactions = discharging(0x0021);
        transactions.push(gone);
        transactions.extend(discharging(0x0121));
        let (mut battery, mut mock) = battery(&transactions);
        battery.read(1.0).unwrap();
        assert_eq!(battery.read(1.0).unwrap_err().to_string(), "command 0x09: NoAcknowledge(Address)");
        assert_eq!(battery.read(1.0).unwrap()[0].voltage_v, Some(120.0));
        mock.done();
    }

    #[test]
    fn a_bus_that_is_not_there_is_named() {
        let error = format!("{:#}", Config::on("/dev/i2c-none".into()).open(true).err().unwrap());
        assert!(error.starts_with("bus: cannot open /dev/i2c-none: "), "{error}");
        let wrong = Config { address: 0x80, ..Config::on("/dev/i2c-1".into()) };
        assert!(wrong.check().unwrap_err().to_string().contains("between 8 (0x08) and 119 (0x77)"));
    }
}
