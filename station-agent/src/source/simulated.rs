//! A simulated docking station: packs behind a selector, bays, one lift, a swap place.

mod depot;
mod drive;
mod feed;
mod paths;
mod recharge;

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::{Channel, Estimate, Model, Run, Start};
use node::body::PackBody;
use node::{Age, Depot, Part, SelectorConfig};
use proto::{PackId, RobotId, SimDraw, SimSupply, SpareId, Timestamp};

use self::drive::Drive;
use self::paths::Paths;
use self::recharge::{PackCharger, Shelf};
use super::{Act, Lifted, Observation, Source, Swapped, label};

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
    /// State of charge from which on they are spares again, 0..1; none for when their charger has ended.
    pub spare_ready_soc: Option<f64>,
    /// The same of spares that are of another kind.
    pub spare_batteries: BTreeMap<SpareId, Arc<Model>>,
    /// What happens while it changes packs; none for changes that nobody notices.
    pub selector: Option<SelectorConfig>,
    /// Where packs are exchanged; none where they stay.
    pub depot: Option<Depot>,
    /// What drives it, what it does, and the mass of a robot aboard, kg; none for one that stands.
    pub vehicle: Option<(Arc<Model>, Vec<Part>, f64)>,
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
    /// Time until it comes back from the depot, s.
    away_s: Option<f64>,
    /// Another pack is in its place since the last observation.
    exchanged: Option<Estimate>,
}

impl Pack {
    fn usable(&self) -> bool {
        !self.depleted && self.away_s.is_none()
    }
}

/// A station's body.
pub struct StationBody {
    load: Run<f64>,
    paths: Paths,
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
    depot: Option<Depot>,
    drive: Option<Drive>,
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
            away_s: None,
            exchanged: None,
        };
        Self {
            paths: Paths::new(&world.load),
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
            shelf: Shelf::new((world.spare_battery, world.spare_batteries), world.spare_ready_soc, world.temperature_degc, world.seed),
            charged: Vec::new(),
            selector: world.selector,
            depot: world.depot,
            drive: world.vehicle.map(|(load, parts, robot_kg)| Drive::new(load, parts, robot_kg)),
            switched: 0,
            down_s: 0.0,
            now_s: 0.0,
        }
    }

    /// What gauges that watched the packs before would start from, in the station's order.
    pub fn remembered_socs(&mut self) -> Vec<Estimate> {
        self.packs.iter_mut().map(|pack| pack.body.remembered_soc()).collect()
    }

    /// Every pack and the true value of a channel of it at the end of the last step.
    pub fn packs_truth(&self, channel: Channel) -> impl Iterator<Item = (&PackId, f64)> {
        self.packs.iter().map(move |pack| (&pack.id, pack.body.truth(channel)))
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

    /// Power that driving takes beside the station's load, W, when it drives.
    #[must_use]
    pub fn driving_w(&self) -> Option<f64> {
        self.drive.as_ref().and_then(Drive::power_w)
    }

    /// Inputs of its drive in the last step; 0 without one.
    #[must_use]
    pub fn drive_inputs<const N: usize>(&self, channels: [Channel; N]) -> [f64; N] {
        self.drive.as_ref().map_or([0.0; N], |drive| drive.inputs(channels))
    }

    /// Energy that its packs were or would be spared by robots that select their power path, over
    /// those that are connected directly, Wh so far; 0 when its model knows of no own load.
    #[must_use]
    pub fn path_selection_saves_wh(&self) -> f64 {
        self.paths.saved_wh()
    }

    /// Robots that its lift cannot let out of their bays, since it has no power.
    #[must_use]
    pub fn shut_in(&self) -> usize {
        if self.powered { 0 } else { self.docked.len() }
    }

    /// What each docked robot takes.
    pub fn draws(&self) -> impl Iterator<Item = (&RobotId, Option<&SimDraw>)> {
        self.docked.iter().map(|(robot, draw)| (robot, draw.as_ref()))
    }

    /// Moves the lift on; it stands still without power.
    fn lift(&mut self, dt_s: f64) -> Option<Lifted> {
        let moves = self.powered && self.driving_w().is_none();
        let (_, left_s) = self.lift.as_mut().filter(|_| moves)?;
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
        let moves = self.powered && self.driving_w().is_none();
        let (_, _, left_s) = self.swap.as_mut().filter(|_| moves)?;
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
        let exchanged = exchanged.map(|soc| node::wire(label(soc)));
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
                // What is not there, or can give nothing, is not taken.
                if let Some(index) = self.packs.iter().position(|known| known.id == *pack && known.usable()) {
                    let before = std::mem::replace(&mut self.active, index);
                    let power_w = self.load.channels[Channel::PackPowerW];
                    self.changed(before, power_w);
                }
            }
        }
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        self.now_s += dt_s;
        self.exchange_packs(dt_s);
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
            arrives_s: self.drive.as_ref().and_then(Drive::arrives_s),
            away_s: self.drive.as_ref().map_or_else(Vec::new, Drive::away_s),
            lifted,
            given_up: None,
            mended: Vec::new(),
            swapped,
            called_off: None,
            known: true,
            lift_active,
            charged: std::mem::take(&mut self.charged),
            uncharged: Vec::new(),
            trouble: None,
        })
    }

    fn load_inputs(&self, channels: &[Channel]) -> Option<Vec<f64>> {
        // While it drives, the station's model does not say all that its pack gives.
        self.driving_w().is_none().then(|| channels.iter().map(|&channel| self.load.channels[channel]).collect())
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
