//! How many robots are taken in side by side at a station.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::Model;
use energy::units::S_PER_H;
use proto::{BayId, StationId};

use super::Basis;
use crate::scheduler::{Begun, Fed, HORIZON_MAX_S, Point, StationView, WHOLE_FLEET_MAX};

/// Mean powers of unlike robots are told apart by this factor.
const MIXED_STEP: f64 = 1.05;

impl Basis<'_> {
    /// Leaves out the bays that would not be fed: free ones first. Where even more bays are held than are fed, those that are given back
    /// first are left out too: what is in them still counts, and nobody is planned into them after it.
    pub(super) fn leave_unfed(&self, view: &mut StationView) {
        let fed = self.side_by_side(&view.station);
        if fed == self.most_side_by_side(&view.station) {
            return;
        }
        let until_s = |bay: &BayId| {
            let holds = |begun: &&Begun| begun.bay.as_ref() == Some(bay);
            view.begun.iter().filter(holds).map(|begun| begun.until_s).reduce(f64::max)
        };
        let (mut held, free): (Vec<BayId>, Vec<BayId>) = view.bays.iter().cloned().partition(|bay| until_s(bay).is_some());
        held.sort_by(|a, b| until_s(b).unwrap_or(0.0).total_cmp(&until_s(a).unwrap_or(0.0)));
        view.unfed = free.len().saturating_sub(fed.saturating_sub(held.len()));
        let kept: BTreeSet<BayId> = held.into_iter().chain(free).take(fed).collect();
        view.bays.retain(|bay| kept.contains(bay));
    }

    /// How many robots may charge side by side at a station: as many as its converters feed at full current, and so many more as this plan
    /// tries ([`Basis::crowd`]).
    #[must_use]
    pub fn side_by_side(&self, id: &StationId) -> usize {
        let most = self.most_side_by_side(id);
        self.fed(id).map_or(most, |fed| fed.full.saturating_add(self.crowd).min(self.most_in_a_crowd(id, fed)))
    }

    /// The most robots that any station could take in beyond those that its converters feed at full current.
    #[must_use]
    pub fn crowd_max(&self) -> usize {
        let ids = self.models.stations.keys();
        ids.filter_map(|id| self.fed(id).map(|fed| self.most_in_a_crowd(id, fed) - fed.full)).max().unwrap_or(0)
    }

    /// How many robots may be side by side where one more saves somebody from running empty.
    ///
    /// Beyond `gaining` each robot more leaves less for all of them together. A station with time to spare makes that up later, so all its
    /// bays may be taken. One of which robots ask more than it can give at its best never does: there the others would pay for it.
    fn most_in_a_crowd(&self, id: &StationId, fed: Fed) -> usize {
        let levels_soc = self.settings.charge_to_soc - self.settings.serve_below_soc;
        let is_overloaded =
            self.in_reach().get(id).is_some_and(|asked| asked.services(levels_soc) > fed.full as f64 * asked.whole_s() / fed.charge_s);
        if is_overloaded { fed.gaining } else { self.most_side_by_side(id) }
    }

    /// How many robots the converters of a station feed, where that is limited: robots with the battery that most have who can come.
    fn fed(&self, id: &StationId) -> Option<Fed> {
        let models = self.models.stations.get(id).filter(|models| models.converter_w_max.is_finite())?;
        let battery = self.usual_battery(id)?;
        let levels_soc = [self.settings.serve_below_soc, self.settings.charge_to_soc];
        Some(self.tables.fed(models, self.most_side_by_side(id), battery, levels_soc))
    }

    /// As many robots as can be side by side at a station: as many as it has bays, or as can come.
    fn most_side_by_side(&self, id: &StationId) -> usize {
        let bays = self.fleet.stations.get(id).and_then(|station| station.state.as_ref()).map_or(1, |state| state.bays.len());
        bays.min(self.in_reach().get(id).map_or(0, |asked| asked.robots)).max(1)
    }

    /// The battery of the service that a station's capacity is counted in: that which most robots have that can come; where none is known, that
    /// of any robot known, or configured.
    #[must_use]
    pub fn usual_battery(&self, id: &StationId) -> Option<&Arc<Model>> {
        let here = self.in_reach().get(id).and_then(InReach::usual_battery);
        let known = || self.fleet.robots.iter().find_map(|(id, robot)| self.models.battery(id, &robot.state.as_ref()?.battery));
        here.or_else(known).or_else(|| self.models.robots.values().chain(self.models.batteries.values()).next())
    }

    /// What charging draws at a station where robots with unlike batteries come, W in each of so many bays: on the mean over all their services, one
    /// after the other. Who draws far more than that is rarely in a bay, and a plan that lets it in is stepped (`scheduler/cover.rs`); in a fleet
    /// that is too large for that it is what the most demanding draw side by side. None where all have one kind of battery, or can be charged with one.
    pub(super) fn mixed_w(&self, id: &StationId, bays: usize, service: impl Fn(&Arc<Model>) -> Point) -> Option<f64> {
        let batteries = &self.in_reach().get(id)?.batteries;
        let services = batteries.values().map(|(robots, battery)| (*robots, service(battery)));
        // What is never charged to the end is planned for nobody.
        let mut services: Vec<(usize, Point)> =
            services.filter(|(_, service)| service.charge_s < HORIZON_MAX_S && service.stopped.is_none()).collect();
        if batteries.len() < 2 || services.is_empty() {
            return None;
        }
        let each_w = if self.fleet.robots.len() > WHOLE_FLEET_MAX {
            services.sort_by(|(_, a), (_, b)| b.mean_w().total_cmp(&a.mean_w()));
            let side_by_side = services.iter().flat_map(|(robots, service)| std::iter::repeat_n(service.mean_w(), *robots));
            let drawn: Vec<f64> = side_by_side.take(bays.max(1)).collect();
            drawn.iter().sum::<f64>() / drawn.len() as f64
        } else {
            let (wh, time_s) = services.iter().fold((0.0, 0.0), |(wh, time_s), (robots, service)| {
                (wh + *robots as f64 * service.need_wh, time_s + *robots as f64 * service.charge_s)
            });
            wh / time_s.max(1e-6) * S_PER_H
        };
        // Whoever joins or leaves changes the mean a little, and whole discharges are kept for every power.
        Some(MIXED_STEP.powf((each_w.max(1e-6).ln() / MIXED_STEP.ln()).ceil()))
    }

    fn in_reach(&self) -> &BTreeMap<StationId, InReach> {
        self.in_reach.get_or_init(|| {
            let mut all: BTreeMap<StationId, InReach> = BTreeMap::new();
            for (robot, (gauge, state)) in self.fleet.robots.iter().filter_map(|(id, robot)| Some((id, robot.known()?))) {
                let battery = self.models.battery(robot, &state.battery);
                for station in state.travel.keys() {
                    let asked = match all.get_mut(station) {
                        Some(asked) => asked,
                        None => all.entry(station.clone()).or_default(),
                    };
                    asked.robots += 1;
                    asked.lacking += (1.0 - gauge.soc.value).max(0.0) / state.travel.len() as f64;
                    let Some(battery) = battery else { continue };
                    asked.whole_s += battery.battery().stored_wh() * S_PER_H / state.drain_w.value.max(0.0);
                    asked.batteries.entry(battery.name.clone()).or_insert_with(|| (0, Arc::clone(battery))).0 += 1;
                }
            }
            all
        })
    }
}

/// What the robots that can come to a station ask of it.
#[derive(Debug, Default)]
pub struct InReach {
    robots: usize,
    /// Whole charges that they lack; a robot that can come to several stations lacks a part at each.
    lacking: f64,
    /// How long whole charges last, summed over robots, s.
    whole_s: f64,
    /// How many have which battery.
    batteries: BTreeMap<String, (usize, Arc<Model>)>,
}

impl InReach {
    /// Services by so much charge that they need within the time that a whole charge lasts.
    fn services(&self, levels_soc: f64) -> f64 {
        self.lacking / levels_soc
    }

    /// How long a whole charge lasts on the mean, s.
    fn whole_s(&self) -> f64 {
        self.whole_s / self.robots.max(1) as f64
    }

    fn usual_battery(&self) -> Option<&Arc<Model>> {
        self.batteries.values().max_by_key(|(robots, _)| *robots).map(|(_, battery)| battery)
    }
}
