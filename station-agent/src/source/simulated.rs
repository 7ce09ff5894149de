//! A simulated docking station: packs behind a selector, bays, one lift, a swap place.

mod recharge;

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::charger::{fair_level, share_fairly};
use energy::service::{Situation, charge_w_within};
use energy::{Channel, Estimate, Model, Run, Start};
use node::body::{PackBody, Task};
use node::{Age, SelectorConfig};
use proto::{PackId, RobotId, SimDraw, SimSupply, SpareId, Timestamp};

use self::recharge::{PackCharger, Shelf, label};
use super::{Act, Lifted, Observation, PackReading, Source, Swapped};

/// What is true of a simulated station, whatever its agent believes.
#[derive(Debug, Clone)]
pub struct World {
    /// Its load on the active pack.
    pub load: Arc<Model>,
    /// Its packs, in the selector's order.
    pub packs: Vec<WorldPack>,
    /// Spare packs for robots and their state of charge.
    pub spares: BTreeMap<SpareId, f64>,
    /// Time to lift a robot into a bay, s.
    pub load_s: f64,
    /// Time to lift a robot out of a bay, s.
    pub unload_s: f64,
    /// Time to exchange a robot's pack, s.
    pub swap_s: f64,
    /// Most power that the converters give to all bays together, W; infinite for none.
    pub converter_w_max: f64,
    /// Power that an external supply puts into packs that do not feed the station, W; 0 for none.
    pub recharge_w: f64,
    /// What packs of robots are, where they are charged and become spares; none where they are put
    /// aside.
    pub spare_battery: Option<Arc<Model>>,
    /// What happens while it changes packs; none for changes that nobody notices.
    pub selector: Option<SelectorConfig>,
    /// Temperature of packs and surroundings, °C.
    pub temperature_degc: f64,
    /// Chooses the gauge ICs' specimens and noise.
    pub seed: u64,
}

/// One true pack.
#[derive(Debug, Clone)]
pub struct WorldPack {
    /// Which.
    pub pack: PackId,
    /// What it is.
    pub battery: Arc<Model>,
    /// True state of charge at the start.
    pub soc: f64,
    /// What it has lived through.
    pub age: Age,
}

struct Pack {
    id: PackId,
    body: PackBody,
    charger: PackCharger,
    depleted: bool,
}

/// A pack that gave out counts again when its charger has brought it back to this state of charge.
const RELEASE_SOC: f64 = 0.1;
/// A robot that takes at least this share of its limit might take more.
const AT_LIMIT: f64 = 0.98;

/// A station's body.
pub struct StationBody {
    load: Run<f64>,
    packs: Vec<Pack>,
    active: usize,
    spares: BTreeMap<SpareId, f64>,
    times_s: [f64; 3],
    lift: Option<(Lifted, f64)>,
    swap: Option<(RobotId, SpareId, f64)>,
    docked: BTreeMap<RobotId, Option<SimDraw>>,
    supplies: Vec<(RobotId, SimSupply)>,
    powered: bool,
    converter_w_max: f64,
    /// What each robot may put into its battery at most, W.
    bay_w_max: f64,
    recharge_w: f64,
    shelf: Shelf,
    /// Packs that robots left and that are spares again since the last observation.
    charged: Vec<(SpareId, Estimate)>,
    selector: Option<SelectorConfig>,
    /// Changes of the active pack since the last step.
    switched: u32,
    /// Time until it has started again, s.
    down_s: f64,
    now_s: f64,
}

impl StationBody {
    /// A station that runs on its first pack.
    #[must_use]
    pub fn new(world: World) -> Self {
        let pack = |(index, pack): (usize, WorldPack)| Pack {
            id: pack.pack,
            charger: PackCharger::new(&pack.battery),
            body: PackBody::new(
                pack.battery,
                pack.age.start(pack.soc, world.temperature_degc),
                world.seed.wrapping_add(index as u64 * 7919),
            ),
            depleted: false,
        };
        Self {
            load: Run::new(world.load, Start::at_soc(0.0)),
            packs: world.packs.into_iter().enumerate().map(pack).collect(),
            active: 0,
            spares: world.spares,
            times_s: [world.load_s, world.unload_s, world.swap_s],
            lift: None,
            swap: None,
            docked: BTreeMap::new(),
            supplies: Vec::new(),
            powered: true,
            converter_w_max: world.converter_w_max,
            bay_w_max: f64::INFINITY,
            recharge_w: world.recharge_w,
            shelf: Shelf::new(world.spare_battery, world.temperature_degc, world.seed),
            charged: Vec::new(),
            selector: world.selector,
            switched: 0,
            down_s: 0.0,
            now_s: 0.0,
        }
    }

    /// What gauges that watched the packs before would start from, in the station's order.
    pub fn remembered_socs(&mut self) -> Vec<Estimate> {
        self.packs.iter_mut().map(|pack| pack.body.remembered_soc()).collect()
    }

    /// True state of charge of every pack.
    pub fn true_socs(&self) -> impl Iterator<Item = (&PackId, f64)> {
        self.packs.iter().map(|pack| (&pack.id, pack.body.truth(Channel::Soc)))
    }

    /// The true value of a channel of the station's load, such as the power into its robots.
    #[must_use]
    pub fn truth(&self, channel: Channel) -> f64 {
        self.load.channels[channel]
    }

    /// What each docked robot takes.
    pub fn draws(&self) -> impl Iterator<Item = (&RobotId, Option<&SimDraw>)> {
        self.docked.iter().map(|(robot, draw)| (robot, draw.as_ref()))
    }

    /// What goes on in the bays: what robots drew in the step before, and what packs that robots
    /// left take where no supply charges them.
    fn situation(&self) -> Situation {
        let mut now = Situation {
            docked: self.docked.len() as f64,
            lift: if self.powered { f64::from(u8::from(self.lift.is_some()) + u8::from(self.swap.is_some())) } else { 0.0 },
            pack_v: self.packs.get(self.active).map_or(0.0, |pack| pack.body.truth(Channel::TerminalVoltageV)),
            ..Situation::default()
        };
        let robots = self.docked.values().flatten().map(|draw| (draw.charge_power_w, draw.charge_current_a));
        let left = self.shelf.draws().filter(|_| self.recharge_w <= 0.0);
        for (charge_w, current_a) in robots.chain(left).filter(|(charge_w, _)| self.powered && *charge_w > 0.0) {
            now.charge_w += charge_w;
            now.charging += 1.0;
            now.squared_a2 += current_a.powi(2);
        }
        now
    }

    /// Shares what the converters have left for batteries: each gets what it takes, up to a common
    /// level. Who takes as much as it may is taken to want more.
    fn share_converters(&mut self, now: &Situation) {
        if self.converter_w_max.is_infinite() {
            return;
        }
        let per_w2 = if now.charge_w > 0.0 { now.squared_a2 / now.charge_w.powi(2) } else { 0.0 };
        let at = |charge_w: f64| Situation { charge_w, squared_a2: per_w2 * charge_w.powi(2), ..*now };
        let limit_w = charge_w_within(&mut self.load, self.converter_w_max, at);
        let before_w = self.bay_w_max;
        let wants_w = |drawn_w: f64| if drawn_w >= AT_LIMIT * before_w { f64::INFINITY } else { drawn_w };
        let robots = self.docked.values().map(|draw| draw.as_ref().map_or(f64::INFINITY, |draw| wants_w(draw.charge_power_w)));
        let left = self.shelf.draws().filter(|_| self.recharge_w <= 0.0).map(|(charge_w, _)| wants_w(charge_w));
        self.bay_w_max = fair_level(limit_w, &robots.chain(left).collect::<Vec<f64>>());
    }

    /// Steps the active pack under the station's load; when it gives out, the selector hands the
    /// load to the next, as an uninterruptible supply does (Kottas, section B.2.2), unless the
    /// selector's gap is too long for its capacitor.
    fn feed(&mut self, dt_s: f64) -> Vec<PackReading> {
        let now = self.situation();
        self.share_converters(&now);
        now.set(&mut self.load);
        self.load.channels[Channel::SelectorEvents] = f64::from(std::mem::take(&mut self.switched));
        self.load.step(dt_s);
        let power_w = self.load.channels[Channel::PackPowerW];
        let mut samples: Vec<_> = self.packs.iter().map(|_| None).collect();
        let before = self.active;
        self.powered = false;
        self.down_s = (self.down_s - dt_s).max(0.0);
        let up = self.down_s <= 0.0;
        for index in (self.active..self.packs.len()).chain(0..self.active).filter(|_| up) {
            let pack = &mut self.packs[index];
            if pack.depleted {
                continue;
            }
            match pack.body.step(dt_s, Task::Power(power_w)) {
                Ok(sample) => {
                    samples[index] = Some(sample);
                    (self.active, self.powered) = (index, true);
                    break;
                }
                Err(_) => {
                    pack.depleted = true;
                    samples[index] = Some(pack.body.sample(dt_s));
                }
            }
        }
        self.changed(before, power_w);
        self.recharge(&mut samples, dt_s);
        let rest = |(pack, sample): (&mut Pack, Option<_>)| PackReading {
            pack: pack.id.clone(),
            sample: sample.unwrap_or_else(|| match pack.body.step(dt_s, Task::Rest) {
                Ok(sample) => sample,
                Err(_) => pack.body.sample(dt_s),
            }),
            depleted: pack.depleted,
        };
        self.packs.iter_mut().zip(samples).map(rest).collect()
    }

    /// A change of packs has happened: the station lives through it, or starts again.
    fn changed(&mut self, before: usize, power_w: f64) {
        if self.active == before {
            return;
        }
        self.switched += 1;
        let Some(selector) = self.selector else { return };
        let [from_v, to_v] = [before, self.active].map(|index| self.packs[index].body.truth(Channel::TerminalVoltageV));
        if !selector.device().transition(from_v, to_v, power_w).survives {
            self.down_s = selector.restart_s;
        }
    }

    /// Charges what does not feed the station: from the supply its own packs and those that robots
    /// left; without a supply these alone, through the station's converters.
    fn recharge(&mut self, samples: &mut [Option<energy::gauge::Sample>], dt_s: f64) {
        let mut asked_w = self.shelf.asks_w();
        if self.recharge_w > 0.0 {
            let left = asked_w.len();
            let resting = |(pack, sample): (&mut Pack, &Option<_>)| if sample.is_none() { pack.charger.asks_w(&pack.body) } else { 0.0 };
            asked_w.extend(self.packs.iter_mut().zip(samples.iter()).map(resting));
            let mut given_w = vec![0.0; asked_w.len()];
            share_fairly(self.recharge_w, &asked_w, &mut given_w);
            self.shelf.step(&given_w[..left], dt_s);
            for ((pack, sample), &given_w) in self.packs.iter_mut().zip(samples.iter_mut()).zip(&given_w[left..]) {
                if sample.is_none() {
                    *sample = Some(pack.charger.step(&mut pack.body, given_w, dt_s));
                    pack.depleted &= pack.body.truth(Channel::Soc) < RELEASE_SOC;
                }
            }
        } else {
            let given_w = if self.powered { self.bay_w_max } else { 0.0 };
            self.shelf.step(&vec![given_w; asked_w.len()], dt_s);
        }
        for (spare, soc) in self.shelf.full() {
            self.charged.push((spare.clone(), label(soc)));
            self.spares.insert(spare, soc);
        }
    }

    /// Moves the lift on; it stands still without power.
    fn lift(&mut self, dt_s: f64) -> Option<Lifted> {
        let (_, left_s) = self.lift.as_mut().filter(|_| self.powered)?;
        *left_s -= dt_s;
        if *left_s > 0.0 {
            return None;
        }
        let (lifted, _) = self.lift.take()?;
        if lifted.into {
            self.docked.insert(lifted.robot.clone(), None);
        } else {
            self.docked.remove(&lifted.robot);
            self.give(lifted.robot.clone(), false, None);
        }
        Some(lifted)
    }

    fn swap(&mut self, dt_s: f64) -> Option<Swapped> {
        let (_, _, left_s) = self.swap.as_mut().filter(|_| self.powered)?;
        *left_s -= dt_s;
        if *left_s > 0.0 {
            return None;
        }
        let (robot, spare, _) = self.swap.take()?;
        let soc = self.spares.remove(&spare).unwrap_or(0.0);
        self.give(robot.clone(), false, Some(soc));
        self.shelf.awaits(robot.clone(), spare.clone());
        // Nobody has measured the pack that was taken out; it is put aside as empty.
        Some(Swapped { robot, spare, given_soc: Estimate::new(0.0, 0.2) })
    }

    fn give(&mut self, robot: RobotId, docked: bool, exchanged: Option<f64>) {
        let at = Timestamp::from_unix_ms((self.now_s * 1000.0) as i64);
        // The label on a charged spare is as good as the gauge that watched it being charged.
        let exchanged = exchanged.map(|soc| proto::Estimate::new(soc, 0.01));
        let charge_w_max = Some(self.bay_w_max).filter(|limit_w| docked && limit_w.is_finite());
        self.supplies.push((robot, SimSupply { at, powered: docked && self.powered, exchanged, docked, charge_w_max }));
    }
}

impl Source for StationBody {
    fn act(&mut self, act: &Act) {
        match act {
            Act::Lift(lifted) => {
                let [load_s, unload_s, _] = self.times_s;
                self.lift = Some((lifted.clone(), if lifted.into { load_s } else { unload_s }));
            }
            Act::Swap { robot, spare } => self.swap = Some((robot.clone(), spare.clone(), self.times_s[2])),
            Act::Select { pack } => {
                if let Some(index) = self.packs.iter().position(|known| known.id == *pack) {
                    let before = std::mem::replace(&mut self.active, index);
                    let power_w = self.load.channels[Channel::PackPowerW];
                    self.changed(before, power_w);
                }
            }
        }
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        self.now_s += dt_s;
        let lift_active = (self.lift.is_some() || self.swap.is_some()) && self.powered;
        let packs = self.feed(dt_s);
        let (lifted, swapped) = (self.lift(dt_s), self.swap(dt_s));
        for robot in self.docked.keys().cloned().collect::<Vec<_>>() {
            self.give(robot, true, None);
        }
        Some(Observation {
            packs,
            active_pack: self.packs.get(self.active).map(|pack| pack.id.clone()),
            powered: self.powered,
            lifted,
            swapped,
            lift_active,
            charged: std::mem::take(&mut self.charged),
        })
    }

    fn draw(&mut self, robot: &RobotId, draw: &SimDraw) {
        if let Some(soc) = draw.left_soc {
            self.shelf.arrived(robot, soc);
        }
        if let Some(known) = self.docked.get_mut(robot) {
            *known = Some(draw.clone());
        }
    }

    fn supplies(&mut self) -> Vec<(RobotId, SimSupply)> {
        std::mem::take(&mut self.supplies)
    }
}

#[cfg(test)]
mod tests;
