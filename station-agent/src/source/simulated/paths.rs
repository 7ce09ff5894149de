//! What docked robots take beside their batteries, and what the other power path would make of it.

use std::sync::Arc;

use energy::charger::PowerPath;
use energy::service::{power_path, with_other_path};
use energy::units::S_PER_H;
use energy::{Channel, Model, Run, Start};
use proto::SimDraw;

/// Inputs of a station's model that both paths share.
const INPUTS: [Channel; 7] = [
    Channel::ChargePowerW,
    Channel::RobotsDocked,
    Channel::RobotsCharging,
    Channel::BaySquaredCurrentA2,
    Channel::LiftActive,
    Channel::PackVoltageV,
    Channel::SelectorEvents,
];

/// The own loads of docked robots, and the station's load on the other power path.
pub(super) struct Paths {
    /// Place and value of the model's parameter for the own load of one robot, W.
    own: Option<(usize, f64)>,
    /// The same station on the other path, and whether the true one is the direct connection.
    other: Option<(Run<f64>, bool)>,
    other_own: Option<usize>,
    /// Energy drawn more on the direct path than on the selected one, Wh.
    saved_wh: f64,
}

fn own_load(model: &Model) -> Option<usize> {
    model.parameters().iter().position(|parameter| parameter.name == "own_load_w")
}

impl Paths {
    pub(super) fn new(load: &Arc<Model>) -> Self {
        let own = own_load(load).map(|index| (index, load.values()[index]));
        let direct = power_path(load) == Some(PowerPath::Direct);
        let other = with_other_path(load);
        let other_own = other.as_ref().and_then(own_load);
        Self { own, other: other.map(|model| (Run::new(Arc::new(model), Start::at_soc(0.0)), direct)), other_own, saved_wh: 0.0 }
    }

    /// Robots whose bodies say what they take beside their batteries take that, the others what the
    /// model says.
    pub(super) fn fed<'a>(&mut self, load: &mut Run<f64>, docked: impl Iterator<Item = &'a Option<SimDraw>>) {
        let Some((index, modelled_w)) = self.own else { return };
        let (mut robots, mut told, mut sum_w) = (0, 0, 0.0);
        for draw in docked {
            let own_w = draw.as_ref().and_then(|draw| draw.own_load_w);
            robots += 1;
            told += u32::from(own_w.is_some());
            sum_w += own_w.unwrap_or(modelled_w);
        }
        let mean_w = if told > 0 { sum_w / f64::from(robots) } else { modelled_w };
        let place = |run: &mut Run<f64>, index: usize| {
            let mut values = run.model().values();
            values[index] = mean_w;
            run.set_parameters(&values);
        };
        place(load, index);
        if let (Some((other, _)), Some(index)) = (&mut self.other, self.other_own) {
            place(other, index);
        }
    }

    /// Counts a step of the load on both paths.
    pub(super) fn count(&mut self, load: &Run<f64>, dt_s: f64) {
        let Some((other, direct)) = &mut self.other else { return };
        if load.channels[Channel::RobotsDocked] <= 0.0 {
            return;
        }
        INPUTS.iter().for_each(|&channel| other.channels[channel] = load.channels[channel]);
        other.step(dt_s);
        let more_w = load.channels[Channel::PackPowerW] - other.channels[Channel::PackPowerW];
        self.saved_wh += if *direct { more_w } else { -more_w } * dt_s / S_PER_H;
    }

    pub(super) fn saved_wh(&self) -> f64 {
        self.saved_wh
    }
}
