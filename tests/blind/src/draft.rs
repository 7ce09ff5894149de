//! Models under construction: a world and the base model of a case are written as the same kind
//! of file that a user writes.

use std::fmt::Write as _;
use std::sync::Arc;

use energy::{Channel, Model, OcvTable, Sensor, System, Uncertainty, find};

/// A parameter of a draft.
#[derive(Debug, Clone)]
pub struct Value {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its stated deviation.
    pub sigma: f64,
    /// Whether the lab may fit it.
    pub free: bool,
}

/// An effect of a draft; parameters that are not listed stand at the catalogue's defaults.
#[derive(Debug, Clone)]
pub struct Part {
    /// The effect.
    pub id: &'static str,
    /// Its parameters.
    pub values: Vec<Value>,
}

/// Fixed facts of a pack.
#[derive(Debug, Clone)]
pub struct PackFacts {
    /// Cells in series.
    pub series: u32,
    /// Charge of a full pack, Ah.
    pub capacity_ah: f64,
    /// Voltage of a full cell, V.
    pub full_v_per_cell: f64,
    /// Voltage of an empty cell, V.
    pub eod_v_per_cell: f64,
    /// Open-circuit voltage of a cell.
    pub ocv: OcvTable,
}

/// A model as a list of what stands in its file.
#[derive(Debug, Clone)]
pub struct Draft {
    /// The system.
    pub system: System,
    /// Its name.
    pub name: String,
    /// A pack's facts; none for the other systems.
    pub pack: Option<PackFacts>,
    /// Known sensors.
    pub sensors: Vec<(Channel, Sensor)>,
    /// What is only roughly known.
    pub uncertainty: Uncertainty,
    /// Its effects.
    pub parts: Vec<Part>,
}

impl Draft {
    /// The file.
    #[must_use]
    pub fn toml(&self) -> String {
        let mut text = format!("schema = 1\nsystem = \"{}\"\nname = \"{}\"\n", self.system.name(), self.name);
        if let Some(pack) = &self.pack {
            let (soc, voltage_v) = pack.ocv.points();
            let list = |values: &[f64]| values.iter().map(|value| format!("{value:.6}")).collect::<Vec<_>>().join(", ");
            let _ = write!(
                text,
                "\n[battery]\nseries = {}\nparallel = 1\ncapacity_ah = {:.5}\nfull_v_per_cell = {}\neod_v_per_cell = {}\n\
                 charge_current_a = {:.5}\ncharge_cutoff_a = {:.5}\nocv = {{ soc = [{}], voltage_v = [{}] }}\n",
                pack.series,
                pack.capacity_ah,
                pack.full_v_per_cell,
                pack.eod_v_per_cell,
                pack.capacity_ah,
                pack.capacity_ah / 20.0,
                list(soc),
                list(voltage_v)
            );
        }
        for (channel, sensor) in &self.sensors {
            let _ = write!(
                text,
                "\n[sensor.{}]\nsigma = {}\nquantum = {}\noffset_sigma = {}\ngain_sigma = {}\n",
                channel.name(),
                sensor.sigma,
                sensor.quantum,
                sensor.offset_sigma,
                sensor.gain_sigma
            );
        }
        let known = self.uncertainty;
        let _ = write!(text, "\n[uncertainty]\nocv_sigma_v = {}\nsoc_initial_sigma = {}\n", known.ocv_sigma_v, known.soc_initial_sigma);
        for part in &self.parts {
            let _ = write!(text, "\n[[effect]]\nid = \"{}\"\n", part.id);
            for Value { name, value, sigma, free } in &part.values {
                let _ = writeln!(text, "{name} = {{ value = {value}, sigma = {sigma}, source = \"benchmark\", free = {free} }}");
            }
        }
        text
    }

    /// The model of that file.
    ///
    /// # Panics
    /// When it is no valid model: a mistake of this benchmark.
    #[must_use]
    pub fn model(&self) -> Arc<Model> {
        let text = self.toml();
        let refuse = |_: &str| Err("a draft names no files".to_owned());
        Arc::new(Model::parse(&self.name, &text, &refuse).unwrap_or_else(|error| panic!("{error}\n{text}")))
    }

    /// The same with one more effect, of which all parameters are given and free.
    #[must_use]
    pub fn with(&self, id: &'static str, parameters: &[(&'static str, f64)]) -> Draft {
        let mut draft = self.clone();
        let value = |&(name, value): &(&'static str, f64)| Value { name, value, sigma: 0.0, free: true };
        draft.parts.retain(|part| part.id != id);
        draft.parts.push(Part { id, values: parameters.iter().map(value).collect() });
        draft
    }

    /// Whether it has that effect.
    #[must_use]
    pub fn has(&self, id: &str) -> bool {
        self.parts.iter().any(|part| part.id == id)
    }
}

/// A part whose listed parameters are free or known; the value must lie in the catalogue's range.
///
/// # Panics
/// When the system has no such effect or parameter.
#[must_use]
pub fn part(system: System, id: &'static str, free: bool, values: &[(&'static str, f64)]) -> Part {
    let (_, effect) = find(system, id).unwrap_or_else(|| panic!("no effect {id}"));
    let value = |&(name, value): &(&'static str, f64)| {
        let spec = effect.spec().parameters.iter().find(|spec| spec.name == name).unwrap_or_else(|| panic!("{id} has no {name}"));
        Value { name, value: value.clamp(spec.min, spec.max), sigma: 0.2 * value.abs(), free }
    };
    Part { id, values: values.iter().map(value).collect() }
}
