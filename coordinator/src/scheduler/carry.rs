//! How much more than a load a station's packs could carry: their models, one after the other, stepped along it.

use energy::load::Terminals as _;
use energy::pack::Battery as _;
use energy::units::{S_PER_DAY, S_PER_H};
use energy::{Channel, Estimate, Pack, Start};

use super::problem::{HANDOVER_S, PackState, StationView};
use super::refill::Refill;

/// Margins of more standard deviations than this are as good as certain, whatever the load looks like.
pub(super) const SIGMAS_MAX: f64 = 6.0;
/// Longest step of a pack along the load, s. A step holds the current that its end needs: at two minutes that is a
/// thousandth too much for a pack that lasts two hours, whose voltage falls by a quarter.
const STEP_MAX_S: f64 = 120.0;
/// Shortest, where a pack gives out, s.
const STEP_MIN_S: f64 = 4.0;
/// The margin is found to this part of its standard deviation: off by half of it is a probability off by 1 % at most.
const PRECISION: f64 = 0.05;
/// The load is scaled up by no more than this.
const SCALE_MAX: f64 = 1.3;

/// A pack that has given out is not turned to again before it has rested for so long, s: it would give out at once.
const RESTS_MIN_S: f64 = 5.0 * HANDOVER_S;

/// Packs are drained to their end in stretches of this, and for no longer than a week, s.
const TAIL_S: f64 = S_PER_H;
const TAIL_MAX_S: f64 = 7.0 * S_PER_DAY;

/// A part of the load: from when until when (s from now), and how much (W).
pub type Part = (f64, f64, f64);

/// Packs in the order in which they are drained: from when each is there (s from now), and how it stands.
pub(super) type Packs<'a> = [(f64, &'a PackState)];

/// What is asked of packs until some time.
pub(super) struct Load<'a> {
    /// What services draw, in any order.
    pub(super) parts: &'a [Part],
    /// What the station takes beside them, W.
    pub(super) overhead_w: f64,
    /// From when that is for these packs, s from now.
    pub(super) overhead_from_s: f64,
    /// Until then, s from now.
    pub(super) until_s: f64,
}

impl Load<'_> {
    /// How much more than this load the packs could carry, Wh, below 0 if they cannot carry it; no further from nothing
    /// than [`SIGMAS_MAX`] of the given deviations, Wh. While no service draws, the station may go dark.
    pub(super) fn spare_wh(&self, packs: &Packs<'_>, sigma_wh: f64) -> f64 {
        let steps = self.steps(packs);
        let energy_wh = steps.iter().map(|step| step.dt_s * step.power_w / S_PER_H).sum::<f64>().max(1e-9);
        let lasts = |scale: f64| {
            let mut bank = Bank::new(packs);
            steps.iter().all(|step| bank.gives(step.power_w * scale, step.dt_s) || !step.serves)
        };
        let reach = SIGMAS_MAX * sigma_wh / energy_wh;
        let (mut low, mut high) = (1.0 - reach.min(1.0), 1.0 + reach.min(SCALE_MAX - 1.0));
        // Which side it is on mostly says that it is far on that side.
        if lasts(1.0) {
            low = 1.0;
        } else {
            high = 1.0;
        }
        if low == 1.0 && lasts(high) {
            let scaled_wh = (high - 1.0) * energy_wh;
            // One scaled up further would be another load: what is left after this one says how much more there is.
            return if reach > SCALE_MAX - 1.0 { scaled_wh.max(self.given_wh(packs) - energy_wh) } else { scaled_wh };
        }
        if high == 1.0 && !lasts(low) {
            return (low - 1.0) * energy_wh;
        }
        while (high - low) * energy_wh > 2.0 * PRECISION * sigma_wh {
            let middle = f64::midpoint(low, high);
            if lasts(middle) { low = middle } else { high = middle }
        }
        (f64::midpoint(low, high) - 1.0) * energy_wh
    }

    /// What the packs give to this load, and then to one of its mean power until they give out, Wh.
    pub(super) fn given_wh(&self, packs: &Packs<'_>) -> f64 {
        let steps = self.steps(packs);
        let mut bank = Bank::new(packs);
        let carries = steps.iter().all(|step| bank.gives(step.power_w, step.dt_s) || !step.serves);
        // Where nothing is planned yet, what the station takes by itself is all that is known.
        let energy_ws: f64 = steps.iter().map(|step| step.dt_s * step.power_w).sum();
        let mean_w = if self.until_s > 0.0 { energy_ws / self.until_s } else { self.overhead_w };
        // What would come after that is not what they hold.
        bank.refills = false;
        if carries && mean_w > 0.0 {
            while bank.at_s < self.until_s + TAIL_MAX_S && bank.gives(mean_w, TAIL_S) {}
        }
        bank.given_wh
    }

    /// The load as stretches of constant power, which also end where a pack comes.
    fn steps(&self, packs: &Packs<'_>) -> Vec<Step> {
        // When, by how much the load rises then, and how many services more draw.
        let mut changes: Vec<(f64, f64, i32)> = Vec::with_capacity(2 * self.parts.len() + packs.len());
        for &(from_s, to_s, power_w) in self.parts.iter().filter(|(from_s, to_s, _)| to_s > from_s) {
            changes.extend([(from_s.max(0.0), power_w, 1), (to_s.max(0.0), -power_w, -1)]);
        }
        let comes = packs.iter().map(|&(from_s, _)| from_s).chain([self.overhead_from_s]);
        changes.extend(comes.map(|from_s| (from_s.max(0.0), 0.0, 0)));
        changes.sort_by(|a, b| a.0.total_cmp(&b.0));
        changes.retain(|change| change.0 < self.until_s);
        changes.push((self.until_s, 0.0, 0));
        let (mut steps, mut from_s, mut drawn_w, mut drawing) = (Vec::new(), 0.0, 0.0, 0);
        for (at_s, more_w, more) in changes {
            if at_s - from_s > 1e-6 {
                let overhead_w = if from_s + 1e-6 < self.overhead_from_s { 0.0 } else { self.overhead_w };
                steps.push(Step { dt_s: at_s - from_s, power_w: overhead_w + drawn_w, serves: drawing > 0 });
                from_s = at_s;
            }
            drawing += more;
            // What is nothing is exactly nothing.
            drawn_w = if drawing > 0 { drawn_w + more_w } else { 0.0 };
        }
        steps
    }
}

/// How a station's packs stand when the services that have begun are over; none where it is not known how they stand now.
#[must_use]
pub fn packs_after_begun(station: &StationView) -> Option<Vec<PackState>> {
    let now: Option<Vec<_>> = station.packs.iter().map(|pack| Some((pack.available_s, pack.state.as_ref()?.now()))).collect();
    let now = now?;
    let packs: Vec<_> = now.iter().map(|(from_s, state)| (*from_s, state)).collect();
    let load = Load {
        parts: &station.begun_parts(),
        overhead_w: station.overhead_per_h.mean_wh,
        overhead_from_s: 0.0,
        until_s: station.committed_until_s,
    };
    let mut bank = Bank::new(&packs);
    for step in load.steps(&packs) {
        bank.gives(step.power_w, step.dt_s);
    }
    let state = |(&(_, before), Turn { pack, .. }): (&(f64, &PackState), &Turn<'_>)| PackState {
        model: before.model.clone(),
        soc: Estimate::new(pack.channels()[Channel::Soc], before.soc.sigma),
        temperature_degc: pack.channels()[Channel::CellDegc],
        refill: Refill::default(),
    };
    Some(packs.iter().zip(&bank.turns).map(state).collect())
}

/// A stretch of constant power.
struct Step {
    /// How long, s.
    dt_s: f64,
    /// How much, W.
    power_w: f64,
    /// Whether some service draws.
    serves: bool,
}

/// Packs that are drained one after the other; one that is charged while it rests is turned to again when all others have given out.
struct Bank<'a> {
    turns: Vec<Turn<'a>>,
    /// Which is being drained.
    active: usize,
    /// How late it is, s.
    at_s: f64,
    /// What was drawn so far, Wh.
    given_wh: f64,
    /// Whether packs that rest are charged.
    refills: bool,
}

/// A pack when its turn comes.
struct Turn<'a> {
    /// From when it is there, s.
    from_s: f64,
    state: &'a PackState,
    /// Since when it rests, s, and the state of charge that it had then.
    rests: (f64, f64),
    pack: Pack,
    /// Whether that was its turn already.
    is_used: bool,
}

impl<'a> Bank<'a> {
    fn new(packs: &Packs<'a>) -> Self {
        let turn = |&(from_s, state): &(f64, &'a PackState)| Turn {
            from_s,
            state,
            rests: (0.0, state.soc.value),
            pack: pack(state, state.soc.value),
            is_used: false,
        };
        Self { turns: packs.iter().map(turn).collect(), active: 0, at_s: 0.0, given_wh: 0.0, refills: true }
    }

    /// Draws this power for so long; whether it was there all the time.
    fn gives(&mut self, power_w: f64, dt_s: f64) -> bool {
        let end_s = self.at_s + dt_s;
        let (mut longest_s, mut is_there) = (STEP_MAX_S, true);
        while self.at_s < end_s - 1e-9 {
            let from_s = self.turns.get(self.active).map_or(f64::INFINITY, |turn| turn.from_s);
            if from_s > self.at_s + 1e-6 {
                (self.at_s, is_there) = (from_s.min(end_s), false);
                continue;
            }
            let step_s = longest_s.min(end_s - self.at_s);
            let pack = self.turn_to();
            if pack.step_power(power_w, step_s).is_ok() && !pack.is_empty() {
                self.at_s += step_s;
                self.given_wh += power_w * step_s / S_PER_H;
            } else if step_s > STEP_MIN_S {
                // It gives out within this step: up to there by halves.
                pack.restore();
                longest_s = step_s / 2.0;
            } else {
                pack.restore();
                self.is_left();
                (self.active, longest_s) = (self.active + 1, STEP_MAX_S);
                self.hand_over(power_w);
            }
        }
        is_there
    }

    /// The active pack has given out: it rests until its turn comes again.
    fn is_left(&mut self) {
        let Turn { state, pack: left, .. } = &self.turns[self.active];
        if self.refills && state.refill != Refill::NOTHING {
            let (state, soc) = (*state, left.channels()[Channel::Soc]);
            self.turns.push(Turn {
                from_s: self.at_s + RESTS_MIN_S,
                state,
                rests: (self.at_s, soc),
                pack: pack(state, soc),
                is_used: false,
            });
        }
    }

    /// The pack whose turn it is; it has been charged as long as it rested.
    fn turn_to(&mut self) -> &mut Pack {
        let (at_s, refills) = (self.at_s, self.refills);
        let turn = &mut self.turns[self.active];
        let (since_s, soc) = turn.rests;
        if !std::mem::replace(&mut turn.is_used, true)
            && refills
            && let Some(soc) = turn.state.refill.rested(soc, at_s - since_s)
        {
            turn.pack = pack(turn.state, soc);
        }
        &mut turn.pack
    }

    /// The pack before was left a little earlier than it gave out, where the next one is there: that one has carried the load since then.
    fn hand_over(&mut self, power_w: f64) {
        if self.turns.get(self.active).is_none_or(|turn| turn.from_s > self.at_s) {
            return;
        }
        let next = self.turn_to();
        if next.step_power(power_w, HANDOVER_S).is_err() {
            next.restore();
        }
    }
}

/// A pack that stands like that, at this state of charge.
fn pack(state: &PackState, soc: f64) -> Pack {
    Pack::new(state.model.clone(), Start { temperature_degc: state.temperature_degc, ..Start::at_soc(soc) })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use energy::Need;
    use proto::{PackId, StationId};

    use super::*;
    use crate::forecast::Handling;
    use crate::scheduler::PackView;

    #[test]
    fn a_pack_that_is_little_known_holds_no_less_for_it() {
        // 84 Wh, of which an hour at 30 W takes 30: it is over 40 Wh more, however little is known of them.
        let model = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let pack = PackState { model, soc: Estimate::exact(1.0), temperature_degc: 25.0, refill: Refill::default() };
        let load = Load { parts: &[(0.0, 3600.0, 25.0)], overhead_w: 5.0, overhead_from_s: 0.0, until_s: 3600.0 };
        let spare_wh = [1.0, 2.0, 17.0].map(|sigma_wh| load.spare_wh(&[(0.0, &pack)], sigma_wh));
        assert!((spare_wh[0] - 6.0).abs() < 1e-9, "no further than six deviations: {spare_wh:?}");
        assert!(spare_wh[1] > 40.0 && (spare_wh[1] - spare_wh[2]).abs() < 1e-9, "{spare_wh:?}");
    }

    #[test]
    fn a_pack_has_when_its_turn_comes_what_it_was_charged_with_until_then() {
        // A tenth of 84 Wh lasts at 20 W for less than half an hour; until then 40 W are charged into the other one: a quarter of it.
        let model = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let state = |refill: Refill| PackState { model: model.clone(), soc: Estimate::exact(0.1), temperature_degc: 25.0, refill };
        let charged = Refill::along(crate::forecast::refill(&model, 40.0, 25.0).into(), 0.1, [60.0, 60.0], |soc| 84.0 * soc);
        let (first, empty, filled) = (state(Refill::default()), state(Refill::default()), state(charged));
        let load = Load { parts: &[(0.0, 3600.0, 20.0)], overhead_w: 0.0, overhead_from_s: 0.0, until_s: 3600.0 };
        let given_wh = [&empty, &filled].map(|second| load.given_wh(&[(0.0, &first), (0.0, second)]));
        let first_h = load.given_wh(&[(0.0, &first)]) / 20.0;
        let more_wh = given_wh[1] - given_wh[0];
        assert!((0.85..1.0).contains(&(more_wh / (40.0 * first_h))), "{more_wh} Wh more after {first_h} h at 40 W");
        // Both charged in turn carry half of what comes for ever, and all of it not for long.
        let both = Refill::later(crate::forecast::refill(&model, 40.0, 25.0).into());
        let (one, other) = (state(both.clone()), state(both));
        let lasts = |power_w: f64| {
            let load = Load { parts: &[(0.0, 36_000.0, power_w)], overhead_w: 0.0, overhead_from_s: 0.0, until_s: 36_000.0 };
            load.spare_wh(&[(0.0, &one), (0.0, &other)], 1.0) > 0.0
        };
        assert_eq!([20.0, 45.0].map(lasts), [true, false]);
    }

    #[test]
    fn packs_stand_after_what_has_begun_as_they_do_when_they_are_drained_by_it() {
        let model = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let pack = |n: usize, soc: f64| PackView {
            pack: PackId::new(format!("p-{n}")).unwrap(),
            usable_wh: Estimate::exact(0.0),
            gain_wh: 0.0,
            uncounted_wh: 0.0,
            state: Some(PackState { model: model.clone(), soc: Estimate::exact(soc), temperature_degc: 25.0, refill: Refill::default() }),
            available_s: 0.0,
        };
        let mut station = StationView {
            station: StationId::new("s").unwrap(),
            out_of_order: None,
            opens_s: 0.0,
            away_s: Vec::new(),
            handling: Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 },
            bays: Vec::new(),
            unfed: 0,
            begun: Vec::new(),
            spares: Vec::new(),
            charges_spares: false,
            ready_soc: 0.98,
            packs: vec![pack(0, 0.2), pack(1, 0.9)],
            committed: Need { mean_wh: 18.0, ..Need::default() },
            committed_until_s: 3600.0,
            recharging: Vec::new(),
            overhead_per_h: Need { mean_wh: 6.0, ..Need::default() },
            shared_per_wh: Vec::new(),
        };
        // By hand, second by second: 24 W for an hour, which the first pack does not last.
        let mut by_hand = [0.2, 0.9].map(|soc| Pack::new(model.clone(), Start { temperature_degc: 25.0, ..Start::at_soc(soc) }));
        let mut seconds = 0;
        let [first, second] = &mut by_hand;
        while first.step_power(24.0, 1.0).is_ok() && !first.is_empty() {
            seconds += 1;
        }
        assert!((600..3000).contains(&seconds), "{seconds}");
        // It is handed over a minute before.
        for _ in seconds - 60..3600 {
            second.step_power(24.0, 1.0).unwrap();
        }
        let after = packs_after_begun(&station).unwrap();
        for (after, by_hand) in after.iter().zip(&by_hand) {
            let by_hand = by_hand.channels()[Channel::Soc];
            assert!((after.soc.value - by_hand).abs() < 0.002, "{} {by_hand}", after.soc.value);
        }
        // Nothing has begun: they stand as they do. One that nothing is known of: neither is of the others.
        station.committed_until_s = 0.0;
        assert_eq!(packs_after_begun(&station).unwrap().iter().map(|pack| pack.soc.value).collect::<Vec<_>>(), [0.2, 0.9]);
        station.packs[1].state = None;
        assert_eq!(packs_after_begun(&station).map(|packs| packs.len()), None);
    }
}
