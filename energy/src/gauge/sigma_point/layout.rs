//! Where each part of the filter's state lies, and what is known of it at the start.

use crate::ocv_error::KNOTS;
use crate::{Channel, Model};

/// Where each part of the state begins.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Places of the uncertain parameters in [`Model::parameters`]; they follow the run's states.
    pub(super) parameters: Vec<usize>,
    pub(super) first_parameter: usize,
    pub(super) capacity: usize,
    pub(super) current_offset: usize,
    pub(super) current_gain: usize,
    pub(super) resistance: usize,
    pub(super) voltage_offset: usize,
    pub(super) fine: usize,
    /// The OCV table's knots.
    pub(super) ocv: usize,
    pub(super) len: usize,
}

impl Layout {
    pub(super) fn of(model: &Model) -> Self {
        let parameters: Vec<usize> = (0..model.parameters().len()).filter(|&index| model.parameters()[index].sigma > 0.0).collect();
        let first_parameter = model.state_count();
        let capacity = first_parameter + parameters.len();
        let ocv = capacity + 6;
        Self {
            parameters,
            first_parameter,
            capacity,
            current_offset: capacity + 1,
            current_gain: capacity + 2,
            resistance: capacity + 3,
            voltage_offset: capacity + 4,
            fine: capacity + 5,
            ocv,
            len: ocv + KNOTS,
        }
    }

    /// How many of the states need runs.
    pub(super) fn followed(&self) -> usize {
        self.resistance
    }
}

/// What is not known of a run's state at the start of a pack that has rested, by its unit.
pub(super) fn start_sigma(name: &str, model: &Model) -> f64 {
    match name.rsplit('_').next() {
        Some("degc") => {
            let sensor = model.sensor(Channel::TemperatureDegc);
            sensor.floor().hypot(sensor.offset_sigma).max(0.1)
        }
        Some("v") => 2e-3,
        // Most packs come from one of its branches, whose places are 1 and -1.
        _ if name == "hysteresis" => 1.0,
        _ => 1e-2,
    }
}
