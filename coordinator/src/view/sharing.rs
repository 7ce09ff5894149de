//! How long charges still take whose robots share what a station's converters give.

use std::collections::BTreeSet;
use std::sync::Arc;

use energy::Model;
use proto::{RobotId, RobotPhase, StationId};

use super::Basis;
use super::begun::warmed_degc;
use crate::fleet::Robot;
use crate::service_run::{How, ServiceRun, Stage};

/// A charge that goes on.
struct Going {
    robot: RobotId,
    battery: Arc<Model>,
    temperature_degc: f64,
    soc: f64,
    to_soc: f64,
}

impl Basis<'_> {
    /// How long the charge of a robot that is in its bay still takes, s: as long as more are in the bays than are taken in side by side, all share
    /// what there is. None where its gauge does not say that it charges.
    pub(super) fn charges_for_s(&self, run: &ServiceRun) -> Option<f64> {
        let models = self.models.stations.get(&run.station)?;
        let mut going: Vec<Going> =
            self.running.values().filter(|other| other.station == run.station).filter_map(|other| self.going(other)).collect();
        let (mut in_bays, most) = (self.in_bays(&run.station), self.side_by_side(&run.station));
        let mut passed_s = 0.0;
        loop {
            let at_once = in_bays.max(most);
            let table = |one: &Going| self.table_beside(at_once, &run.station, models, &one.battery, one.temperature_degc);
            let left_s = |one: &Going| table(one).between(one.soc, one.to_soc).charge_s;
            let own_s = left_s(going.iter().find(|one| one.robot == run.robot)?);
            let (first, first_s) = going.iter().map(left_s).enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b))?;
            if in_bays <= most || own_s <= first_s {
                return Some(passed_s + own_s);
            }
            let reached: Vec<f64> = going.iter().map(|one| table(one).reached(one.soc, first_s)).collect();
            going.iter_mut().zip(reached).for_each(|(one, soc)| one.soc = soc);
            going.remove(first);
            (in_bays, passed_s) = (in_bays - 1, passed_s + first_s);
        }
    }

    /// The charge of a robot that is in its bay, if its gauge says that it charges.
    fn going(&self, run: &ServiceRun) -> Option<Going> {
        let to_soc = run.how.to_soc()?;
        let (gauge, state) = self.fleet.robots.get(&run.robot).and_then(Robot::known)?;
        let charges = matches!(run.stage, Stage::Charging | Stage::ChargingItself) && state.phase == RobotPhase::Charging;
        let battery = self.battery(&run.robot, gauge, state).filter(|_| charges)?;
        let (robot, temperature_degc) = (run.robot.clone(), warmed_degc(&battery, gauge.temperature_degc));
        Some(Going { robot, battery, temperature_degc, soc: gauge.soc.value, to_soc })
    }

    /// Among how many a charge at a station is counted to share what its converters give: those that are in its bays or on their way into them, and
    /// as many as are taken in.
    pub(super) fn sharing(&self, id: &StationId) -> usize {
        self.in_bays(id).max(self.side_by_side(id))
    }

    /// Bays of a station that robots are in, or are on their way into.
    fn in_bays(&self, id: &StationId) -> usize {
        let here = self.running.values().filter(|run| run.station == *id && run.stage != Stage::LetOut);
        here.filter_map(|run| if let How::Recharge { bay, .. } = &run.how { Some(bay) } else { None }).collect::<BTreeSet<_>>().len()
    }
}
