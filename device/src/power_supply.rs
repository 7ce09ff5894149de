//! A battery as the Linux kernel shows it: `/sys/class/power_supply/NAME/` (Documentation/ABI/testing/
//! sysfs-class-power). Files hold uV, uA, uAh, uWh, tenths of a degree Celsius and percent; which of
//! them there are depends on the driver.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use energy::document::hint;
use serde::{Deserialize, Serialize};
use tracing::{info, warn};

use crate::report::{Device, Report, Supply};

/// A battery that the kernel shows: `kind = "power_supply"`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Which battery, such as BAT0; left out where there is only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// Where the kernel shows its power supplies.
    #[serde(default = "default_root")]
    pub root: PathBuf,
}

fn default_root() -> PathBuf {
    "/sys/class/power_supply".into()
}

impl Default for Config {
    fn default() -> Self {
        Self { device: None, root: default_root() }
    }
}

/// Files of a battery that are read where they are there.
const READ: [&str; 10] =
    ["present", "status", "voltage_now", "current_now", "power_now", "temp", "capacity", "charge_now", "charge_full", "energy_now"];

impl Config {
    /// Finds the battery. One that may be away need not be there, where it is named.
    ///
    /// # Errors
    /// Says which batteries there are.
    pub fn open(&self, may_be_away: bool) -> anyhow::Result<Box<dyn Device>> {
        let supplies = supplies(&self.root)?;
        let batteries: Vec<&str> = supplies.iter().filter(|name| is_battery(&self.root.join(name))).map(String::as_str).collect();
        let root = self.root.display();
        let listed = |names: &[&str]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let name = match (&self.device, batteries.as_slice()) {
            (Some(device), known) => {
                let near = hint(device, known.iter().copied());
                let missing = format!("device = \"{device}\": no such battery{near} In {root}: {}", listed(known));
                match known.contains(&device.as_str()) {
                    true => {}
                    false if may_be_away => warn!("{missing}: taken to be away"),
                    false => bail!("{missing}"),
                }
                device.as_str()
            }
            (None, [only]) => only,
            (None, []) => {
                let supplies: Vec<&str> = supplies.iter().map(String::as_str).collect();
                bail!("{root} shows no battery. Power supplies there: {}", listed(&supplies))
            }
            (None, several) => bail!("{root} shows several batteries; choose one with device: {}", several.join(", ")),
        };
        let folder = self.root.join(name);
        let (found, missing): (Vec<&str>, Vec<&str>) = READ.iter().partition(|file| folder.join(file).exists());
        info!("power_supply {name} shows {}; not there: {}", found.join(", "), missing.join(", "));
        Ok(Box::new(Battery { name: name.to_owned(), folder, root: self.root.clone(), unread: BTreeSet::new() }))
    }
}

/// A battery of the kernel's.
struct Battery {
    name: String,
    folder: PathBuf,
    root: PathBuf,
    /// What cannot be read, and was said to be so.
    unread: BTreeSet<String>,
}

impl Device for Battery {
    fn name(&self) -> String {
        format!("power_supply {}", self.name)
    }

    fn read(&mut self, _dt_s: f64) -> anyhow::Result<Vec<Report>> {
        ensure!(self.folder.exists(), "{} is gone", self.folder.display());
        if self.number("present")? == Some(0.0) {
            bail!("no battery is present");
        }
        let status = text(&self.folder.join("status"));
        let status = self.or_none(status).unwrap_or_default();
        // Drivers that cannot measure the voltage of a pack of many cells say 0.
        let voltage_v = self.number("voltage_now")?.map(|uv| uv / 1e6).filter(|v| *v > 0.0);
        let by_current = self.number("current_now")?.map(|ua| ua / 1e6);
        let by_power = self.number("power_now")?.zip(voltage_v).map(|(uw, volts)| uw / 1e6 / volts);
        let current_a = by_current.or(by_power).map(|shown_a| drawn(shown_a, &status));
        let soc = self.share("charge_now", "charge_full");
        let soc = soc.or_else(|| self.number_or_none("capacity").map(|percent| percent / 100.0));
        let soc = soc.or_else(|| self.share("energy_now", "energy_full"));
        let temperature_degc = self.number_or_none("temp").map(|tenths| tenths / 10.0);
        let supply = self.supply(&status);
        let soc = soc.map(|soc| soc.clamp(0.0, 1.0));
        Ok(vec![Report { at_s: None, voltage_v, current_a, temperature_degc, soc, soc_sigma: None, supply }])
    }
}

impl Battery {
    fn number(&self, file: &str) -> anyhow::Result<Option<f64>> {
        let path = self.folder.join(file);
        let Some(text) = text(&path)? else { return Ok(None) };
        let number: f64 = text.parse().with_context(|| format!("{}: `{text}` is not a number", path.display()))?;
        ensure!(number.is_finite(), "{}: {text} is no reading", path.display());
        Ok(Some(number))
    }

    /// What a gauge can do without; nothing where it cannot be read, which is said once.
    fn or_none<T>(&mut self, read: anyhow::Result<Option<T>>) -> Option<T> {
        read.unwrap_or_else(|error| {
            let what = format!("{error:#}");
            if self.unread.insert(what.clone()) {
                warn!("power_supply {}: {what}; going on without", self.name);
            }
            None
        })
    }

    fn number_or_none(&mut self, file: &str) -> Option<f64> {
        let read = self.number(file);
        self.or_none(read)
    }

    fn share(&mut self, now: &str, full: &str) -> Option<f64> {
        let (now, full) = self.number_or_none(now).zip(self.number_or_none(full))?;
        (full > 0.0).then(|| now / full)
    }

    /// By the battery's own status, and by chargers that the kernel shows beside it.
    fn supply(&mut self, status: &str) -> Supply {
        let mut chargers = Vec::new();
        let all = supplies(&self.root).map(Some);
        for name in self.or_none(all).unwrap_or_default() {
            let folder = self.root.join(name);
            let kind = text(&folder.join("type"));
            if self.or_none(kind).is_some_and(|kind| kind != "Battery") {
                let online = text(&folder.join("online"));
                chargers.extend(self.or_none(online));
            }
        }
        let online = chargers.iter().any(|online| online != "0");
        match status {
            "Charging" | "Not charging" => Supply::Connected,
            _ if online => Supply::Connected,
            "Discharging" => Supply::Absent,
            // A full battery stays full for a while after it was unplugged.
            "Full" if !chargers.is_empty() => Supply::Absent,
            _ => Supply::Unknown,
        }
    }
}

/// Drawn current from what a driver shows. The kernel counts discharge negative, but there are
/// drivers that show sizes only: the status tells.
fn drawn(shown_a: f64, status: &str) -> f64 {
    match status {
        "Discharging" => shown_a.abs(),
        "Charging" => 0.0 - shown_a.abs(),
        _ => 0.0 - shown_a,
    }
}

/// Names of the power supplies, sorted.
fn supplies(root: &Path) -> anyhow::Result<Vec<String>> {
    let entries = std::fs::read_dir(root).with_context(|| format!("cannot read {}", root.display()))?;
    let mut names: Vec<String> = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    Ok(names)
}

/// A battery that feeds the machine, not one of a mouse.
fn is_battery(folder: &Path) -> bool {
    let says = |file: &str, what: &str| text(&folder.join(file)).ok().flatten().is_some_and(|said| said == what);
    says("type", "Battery") && !says("scope", "Device")
}

/// What a file says; none where there is none, or where the driver has no data now.
fn text(path: &Path) -> anyhow::Result<Option<String>> {
    const EAGAIN: i32 = 11;
    const ENODATA: i32 = 61;
    const ENODEV: i32 = 19;
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(Some(text.trim().to_owned())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) if matches!(error.raw_os_error(), Some(EAGAIN | ENODATA | ENODEV)) => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tree as the kernel shows it: supply, file, content.
    fn tree(files: &[(&str, &str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (supply, file, content) in files {
            std::fs::create_dir_all(root.path().join(supply)).unwrap();
            std::fs::write(root.path().join(supply).join(file), format!("{content}\n")).unwrap();
        }
        root
    }

    fn config(root: &tempfile::TempDir, device: Option<&str>) -> Config {
        Config { device: device.map(str::to_owned), root: root.path().to_owned() }
    }

    fn read(root: &tempfile::TempDir) -> Report {
        config(root, Some("BAT0")).open(false).unwrap().read(1.0).unwrap()[0]
    }

    /// What a bq27441 shows, as published by one of its users.
    const BQ27441: [(&str, &str, &str); 8] = [
        ("BAT0", "type", "Battery"),
        ("BAT0", "status", "Discharging"),
        ("BAT0", "voltage_now", "4164000"),
        ("BAT0", "current_now", "-132000"),
        ("BAT0", "charge_now", "1528000"),
        ("BAT0", "charge_full", "1635000"),
        ("BAT0", "capacity", "97"),
        ("BAT0", "temp", "201"),
    ];

    #[test]
    fn what_cannot_be_read_and_is_not_needed_is_left_out() {
        let files = [("BAT0", "type", "Battery"), ("BAT0", "voltage_now", "11400000"), ("BAT0", "current_now", "500000")];
        let root = tree(&[&files[..], &[("BAT0", "status", "Discharging"), ("USB", "type", "USB")]].concat());
        // A folder in the place of a file is as unreadable as a driver that fails.
        for unreadable in ["BAT0/temp", "BAT0/capacity", "USB/online"] {
            std::fs::create_dir(root.path().join(unreadable)).unwrap();
        }
        let mut battery = config(&root, None).open(false).unwrap();
        let report = battery.read(1.0).unwrap()[0];
        assert_eq!((report.voltage_v, report.current_a, report.supply), (Some(11.4), Some(0.5), Supply::Absent));
        assert_eq!((report.temperature_degc, report.soc), (None, None));
        // Without a voltage there is no gauge.
        std::fs::remove_file(root.path().join("BAT0/voltage_now")).unwrap();
        std::fs::create_dir(root.path().join("BAT0/voltage_now")).unwrap();
        assert!(battery.read(1.0).unwrap_err().to_string().contains("voltage_now"));
    }

    #[test]
    fn units_of_the_kernel_become_ours() {
        let report = read(&tree(&BQ27441));
        let wanted = Report {
            voltage_v: Some(4.164),
            current_a: Some(0.132),
            temperature_degc: Some(20.1),
            soc: Some(1528.0 / 1635.0),
            supply: Supply::Absent,
            ..Report::default()
        };
        assert_eq!(report, wanted);
    }

    #[test]
    fn the_status_decides_where_a_driver_shows_sizes_only() {
        let shown = |status: &str, microampere: &str| {
            let mut files = BQ27441.to_vec();
            files.extend([("BAT0", "status", status), ("BAT0", "current_now", microampere)]);
            read(&tree(&files)).current_a.unwrap()
        };
        assert_eq!(shown("Discharging", "1000000"), 1.0);
        assert_eq!(shown("Discharging", "-1000000"), 1.0);
        assert_eq!(shown("Charging", "1000000"), -1.0);
        assert_eq!(shown("Charging", "-1000000"), -1.0);
        assert_eq!(shown("Unknown", "-1000000"), 1.0);
        assert_eq!(shown("Full", "50000"), -0.05);
    }

    #[test]
    fn a_battery_by_energy_and_power_alone_is_read_too() {
        let report = read(&tree(&[
            ("BAT0", "type", "Battery"),
            ("BAT0", "status", "Charging"),
            ("BAT0", "voltage_now", "12000000"),
            ("BAT0", "power_now", "24000000"),
            ("BAT0", "energy_now", "30000000"),
            ("BAT0", "energy_full", "40000000"),
        ]));
        assert_eq!((report.current_a, report.soc, report.temperature_degc), (Some(-2.0), Some(0.75), None));
        assert_eq!(report.supply, Supply::Connected);
    }

    #[test]
    fn what_is_missing_is_none_and_a_voltage_of_nothing_is_missing() {
        let report = read(&tree(&[("BAT0", "type", "Battery"), ("BAT0", "voltage_now", "0"), ("BAT0", "current_now", "-500000")]));
        assert_eq!(report, Report { current_a: Some(0.5), ..Report::default() });
    }

    #[test]
    fn a_charger_beside_it_tells_of_the_bay() {
        let with = |status: &str, online: &str| {
            let mut files = BQ27441.to_vec();
            files.extend([("BAT0", "status", status), ("AC", "type", "Mains"), ("AC", "online", online)]);
            read(&tree(&files)).supply
        };
        assert_eq!(with("Discharging", "1"), Supply::Connected);
        assert_eq!(with("Discharging", "0"), Supply::Absent);
        assert_eq!(with("Full", "1"), Supply::Connected);
        assert_eq!(with("Full", "0"), Supply::Absent);
    }

    #[test]
    fn the_battery_is_found_or_the_choice_is_told() {
        let mouse = [("hid-1", "type", "Battery"), ("hid-1", "scope", "Device"), ("AC", "type", "Mains")];
        let mut files = BQ27441.to_vec();
        files.extend(mouse);
        assert_eq!(config(&tree(&files), None).open(false).unwrap().name(), "power_supply BAT0");
        let refused = |files: &[(&str, &str, &str)], device: Option<&str>| {
            let root = tree(files);
            config(&root, device).open(false).err().unwrap().to_string()
        };
        assert!(refused(&mouse, None).ends_with("shows no battery. Power supplies there: AC, hid-1"));
        files.push(("BAT1", "type", "Battery"));
        assert!(refused(&files, None).ends_with("choose one with device: BAT0, BAT1"));
        let error = refused(&files, Some("BAT"));
        assert!(error.contains("no such battery; did you mean `BAT") && error.ends_with(": BAT0, BAT1"), "{error}");
    }

    #[test]
    fn a_battery_that_is_taken_out_or_shows_no_number_is_told() {
        let root = tree(&BQ27441);
        let mut battery = config(&root, None).open(false).unwrap();
        std::fs::write(root.path().join("BAT0/voltage_now"), "high").unwrap();
        assert!(battery.read(1.0).unwrap_err().to_string().contains("voltage_now: `high` is not a number"));
        std::fs::write(root.path().join("BAT0/present"), "0\n").unwrap();
        assert_eq!(battery.read(1.0).unwrap_err().to_string(), "no battery is present");
        std::fs::remove_dir_all(root.path().join("BAT0")).unwrap();
        assert!(battery.read(1.0).unwrap_err().to_string().ends_with("BAT0 is gone"));
    }
}
