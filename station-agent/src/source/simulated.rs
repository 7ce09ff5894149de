//! A simulated docking station: packs behind a selector, bays, one lift, a swap place.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::{Channel, Estimate, Model, Run, Start};
use node::body::{PackBody, Task};
use proto::{PackId, RobotId, SimDraw, SimSupply, SpareId, Timestamp};

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
}

struct Pack {
    id: PackId,
    body: PackBody,
    depleted: bool,
}

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
    now_s: f64,
}

impl StationBody {
    /// A station that runs on its first pack.
    #[must_use]
    pub fn new(world: World) -> Self {
        let pack = |(index, pack): (usize, WorldPack)| Pack {
            id: pack.pack,
            body: PackBody::new(pack.battery, pack.soc, world.temperature_degc, world.seed.wrapping_add(index as u64 * 7919)),
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

    /// Steps the active pack under the station's load; when it gives out, the selector hands the
    /// load to the next without a gap, as an uninterruptible supply does (Kottas, section B.2.2).
    fn feed(&mut self, dt_s: f64) -> Vec<PackReading> {
        let charge_w: f64 = if self.powered { self.docked.values().flatten().map(|draw| draw.charge_power_w).sum() } else { 0.0 };
        self.load.channels[Channel::ChargePowerW] = charge_w;
        self.load.channels[Channel::RobotsDocked] = self.docked.len() as f64;
        self.load.channels[Channel::LiftActive] = f64::from(u8::from(self.lift.is_some() && self.powered));
        self.load.step(dt_s);
        let power_w = self.load.channels[Channel::PackPowerW];
        let mut samples: Vec<_> = self.packs.iter().map(|_| None).collect();
        self.powered = false;
        for index in (self.active..self.packs.len()).chain(0..self.active) {
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
        // Nobody has measured the pack that was taken out; it is put aside as empty.
        Some(Swapped { robot, spare, given_soc: Estimate::new(0.0, 0.2) })
    }

    fn give(&mut self, robot: RobotId, docked: bool, exchanged: Option<f64>) {
        let at = Timestamp::from_unix_ms((self.now_s * 1000.0) as i64);
        // The label on a charged spare is as good as the gauge that watched it being charged.
        let exchanged = exchanged.map(|soc| proto::Estimate::new(soc, 0.01));
        self.supplies.push((robot, SimSupply { at, powered: docked && self.powered, exchanged, docked }));
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
                    self.active = index;
                }
            }
        }
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        self.now_s += dt_s;
        let lift_active = self.lift.is_some() && self.powered;
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
        })
    }

    fn draw(&mut self, robot: &RobotId, draw: &SimDraw) {
        if let Some(known) = self.docked.get_mut(robot) {
            *known = Some(draw.clone());
        }
    }

    fn supplies(&mut self) -> Vec<(RobotId, SimSupply)> {
        std::mem::take(&mut self.supplies)
    }
}
