//! How a simulated station is fed: what its load takes, which pack gives it, and what is charged
//! meanwhile.

use energy::Channel;
use energy::charger::{fair_level, share_fairly};
use energy::selector::{Change, PackSeen, RELEASED_SOC};
use energy::service::{Situation, charge_w_within};
use node::UNTIL_EMPTY;
use node::body::Task;

use super::{Pack, StationBody};
use crate::source::{PackReading, label};

/// A robot that takes at least this share of its limit might take more.
const AT_LIMIT: f64 = 0.98;

impl StationBody {
    /// What goes on in the bays: what robots drew in the step before, and what packs that robots
    /// left take where no supply charges them.
    fn situation(&self) -> Situation {
        let mut now = Situation {
            docked: self.docked.len() as f64,
            lift: if self.powered && self.driving_w().is_none() {
                f64::from(u8::from(self.lift.is_some()) + u8::from(self.swap.is_some()))
            } else {
                0.0
            },
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
    pub(super) fn feed(&mut self, dt_s: f64) -> Vec<PackReading> {
        let now = self.situation();
        self.paths.fed(&mut self.load, self.docked.values());
        self.share_converters(&now);
        now.set(&mut self.load);
        self.load.channels[Channel::SelectorEvents] = f64::from(std::mem::take(&mut self.switched));
        self.load.step(dt_s);
        let standing_w = self.load.channels[Channel::PackPowerW];
        let aboard = self.docked.len() as f64;
        let driving_w = self.drive.as_mut().map_or(0.0, |drive| drive.step(aboard, dt_s));
        let power_w = standing_w + driving_w;
        let mut samples: Vec<_> = self.packs.iter().map(|_| None).collect();
        let before = self.active;
        self.powered = false;
        self.down_s = (self.down_s - dt_s).max(0.0);
        while let Some(index) = self.feeding().filter(|_| self.down_s <= 0.0 && !self.powered) {
            let pack = &mut self.packs[index];
            match pack.body.step(dt_s, Task::Power(power_w)) {
                Ok(sample) => {
                    samples[index] = Some(sample);
                    (self.active, self.powered) = (index, true);
                }
                Err(_) => {
                    pack.depleted = true;
                    samples[index] = Some(pack.body.sample(dt_s));
                }
            }
        }
        self.changed(before, power_w);
        if self.powered {
            self.paths.count(&self.load, dt_s);
        }
        self.recharge(&mut samples, dt_s);
        let brought = self.depot.map(|depot| label(depot.soc));
        let rest = |(pack, sample): (&mut Pack, Option<_>)| PackReading {
            pack: pack.id.clone(),
            sample: sample.or_else(|| Some(pack.body.step(dt_s, Task::Rest).unwrap_or_else(|_| pack.body.sample(dt_s)))),
            depleted: pack.depleted,
            connected: pack.away_s.is_none(),
            back: pack.away_s.zip(brought),
            exchanged: pack.exchanged.take(),
            said_soc: None,
        };
        self.packs.iter_mut().zip(samples).map(rest).collect()
    }

    /// The pack that is to feed the station: the active one as long as it can, then the selector's
    /// choice. That it is left for its voltage is for the agent to say, by the same rule.
    fn feeding(&self) -> Option<usize> {
        if self.packs.get(self.active).is_some_and(Pack::usable) {
            return Some(self.active);
        }
        let seen = |pack: &Pack| PackSeen { voltage_v: pack.body.truth(Channel::TerminalVoltageV), usable: pack.usable() };
        let packs: Vec<PackSeen> = self.packs.iter().map(seen).collect();
        self.selector.map_or(UNTIL_EMPTY, |selector| selector.rule()).choose(&packs, self.active, None)
    }

    /// A change of packs has happened: the station lives through it, or starts again.
    pub(super) fn changed(&mut self, before: usize, power_w: f64) {
        if self.active == before {
            return;
        }
        self.switched += 1;
        let Some(selector) = self.selector else { return };
        let [from_v, to_v] = [before, self.active].map(|index| self.packs[index].body.truth(Channel::TerminalVoltageV));
        let transition = selector.device().transition(from_v, to_v, power_w);
        if !transition.survives {
            self.down_s = selector.restart_s;
        }
        if let Change::MakeBeforeBreak { overlap_s, .. } = selector.device().change {
            // The fuller pack feeds the emptier one; their protection watches.
            self.packs[before].body.pulse(-transition.cross_a, overlap_s);
            self.packs[self.active].body.pulse(transition.cross_a, overlap_s);
        }
    }

    /// Charges what does not feed the station: from the supply its own packs and those that robots
    /// left; without a supply these alone, through the station's converters.
    fn recharge(&mut self, samples: &mut [Option<energy::gauge::Sample>], dt_s: f64) {
        let mut asked_w = self.shelf.asks_w();
        if self.recharge_w > 0.0 {
            let left = asked_w.len();
            let here = |pack: &Pack, sample: &Option<_>| sample.is_none() && pack.away_s.is_none();
            let resting = |(pack, sample): (&mut Pack, &Option<_>)| if here(pack, sample) { pack.charger.asks_w(&pack.body) } else { 0.0 };
            asked_w.extend(self.packs.iter_mut().zip(samples.iter()).map(resting));
            let mut given_w = vec![0.0; asked_w.len()];
            share_fairly(self.recharge_w, &asked_w, &mut given_w);
            self.shelf.step(&given_w[..left], dt_s);
            for ((pack, sample), &given_w) in self.packs.iter_mut().zip(samples.iter_mut()).zip(&given_w[left..]) {
                if here(pack, sample) {
                    *sample = Some(pack.charger.step(&mut pack.body, given_w, dt_s));
                    pack.depleted &= pack.body.truth(Channel::Soc) < RELEASED_SOC;
                }
            }
        } else {
            let given_w = if self.powered { self.bay_w_max } else { 0.0 };
            self.shelf.step(&vec![given_w; asked_w.len()], dt_s);
        }
        for (spare, soc) in self.shelf.charged() {
            self.charged.push((spare.clone(), label(soc)));
            self.spares.insert(spare, soc);
        }
    }
}
