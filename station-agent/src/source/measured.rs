//! A real station: a device beside each of its packs, and a program that works lift, exchange and selector.

mod hands;
mod place;

use device::{Device, Reader, Reading, UNKNOWN_SOC};
use energy::gauge::Sample;
use energy::protection::Trip;
use energy::{BatteryFacts, Estimate};
use node::Stride;
use proto::{PackId, SpareId};
use tracing::warn;

pub use self::hands::{Hands, KEY};
pub use self::place::Place;
use self::place::Stand;
use super::{Act, Observation, PackReading, Source};

/// Noise of a spare's charge that is allowed for at most: a guess, five of the hundred steps in which most gauges count.
const NOISE_SOC: f64 = 0.05;
/// Charges of a spare that differ by less are not told anew.
const SOC_STEP: f64 = 0.01;
/// Of a spare whose device has said nothing for longer than this, s, nothing is known: somebody may have taken it away. The same time
/// as for a pack.
const SILENT_S: f64 = 60.0;
/// A spare whose exchange was called off is not handed out for so long, s, unless its device falls silent before, as of one that is taken out:
/// half an hour is not long for somebody to come and look. A guess.
const JAMMED_S: f64 = 1800.0;
/// What is put in for a pack that gave out has more charge than that one by at least this, and by so many deviations of both: what has risen by
/// less may be the same pack that rests. A guess, as for robots.
const RISE_SOC: f64 = 0.05;
/// See [`RISE_SOC`].
const RISE_SIGMAS: f64 = 2.0;
/// A third of a charge is a rise whatever the gauges say of their errors, which are told as up to all of it.
const RISE_SOC_MAX: f64 = 0.3;

/// A station whose packs devices measure, in the selector's order.
pub struct MeasuredStation {
    packs: Vec<MeasuredPack>,
    spares: Vec<MeasuredSpare>,
    hands: Hands,
    /// Where it is, of one that drives.
    place: Option<Place>,
    active: Option<PackId>,
    /// For how long it has been looked at, s.
    seen_s: f64,
}

/// One of its packs.
pub struct MeasuredPack {
    id: PackId,
    reader: Reader,
    eod_v: f64,
    /// For how long it must lie below that without a break, s.
    hold_s: f64,
    /// For how long it did from one reading to the next, s; none where the last one lay above.
    below_s: Option<f64>,
    /// What was shown last; none before the first report, and after a silence.
    last: Option<Sample>,
    /// It gave out and was not charged since.
    depleted: bool,
    /// What its device said last of its charge; of a pack that gave out, what it said then.
    said: Option<Estimate>,
    /// Why nothing has been heard of it for long.
    silent: Option<String>,
}

impl MeasuredPack {
    /// A pack that gives out below its end of discharge. It has to lie there for as long as its protection lets it before it opens
    /// ([`energy::protection`]): a lift that starts draws the voltage down for a moment, and leaves the charge as it is.
    #[must_use]
    pub fn new(id: PackId, reader: Reader, facts: &BatteryFacts) -> Self {
        let hold_s = facts.protection.get(Trip::UnderVoltage).delay_s;
        Self { id, reader, eod_v: facts.eod_v(), hold_s, below_s: None, last: None, depleted: false, said: None, silent: None }
    }

    /// Whether what a gauge begins anew with is another pack. Gauges begin anew when their agent is restarted, or heard nothing for a while,
    /// too. Where nothing is known of the charge before, it is taken for another.
    fn is_another(&self, is: Estimate) -> bool {
        self.said.is_none_or(|was| has_risen(was, is))
    }

    fn advance(&mut self, dt_s: f64) -> PackReading {
        let Reading { sample, exchanged, said_soc, silent, .. } = self.reader.advance(dt_s);
        // A pack that gave out recovers some volts at once, and no charge: one that has risen clearly was charged unseen, or is another.
        let is_another = exchanged.is_some_and(|is| self.is_another(is));
        let has_risen = self.said.zip(said_soc).is_some_and(|(was, is)| has_risen(was, is));
        self.depleted &= !(is_another || has_risen);
        if let Some(sample) = sample {
            let below = sample.voltage_v < self.eod_v;
            // One reading says nothing of the time before it, however long that was.
            self.below_s = below.then(|| self.below_s.map_or(0.0, |below_s| below_s + sample.dt_s));
            let charged = !below && sample.current_a < -self.reader.least_a();
            self.depleted = self.below_s.is_some_and(|below_s| below_s >= self.hold_s) || self.depleted && !charged;
            self.last = Some(sample);
        }
        if !self.depleted || self.said.is_none() {
            self.said = said_soc.or(self.said);
        }
        self.silent = silent;
        if self.silent.is_some() {
            self.last = None;
        }
        let connected = self.last.is_some();
        PackReading { pack: self.id.clone(), sample, depleted: self.depleted, connected, back: None, exchanged, said_soc }
    }

    /// Current that it gives, A; none where none is seen.
    fn gives_a(&self) -> Option<f64> {
        self.last.map(|sample| sample.current_a).filter(|current_a| *current_a > self.reader.least_a())
    }
}

/// Whether a charge is clearly more than it was, however little is known of either.
fn has_risen(was: Estimate, is: Estimate) -> bool {
    is.value - was.value > (RISE_SIGMAS * was.sigma.hypot(is.sigma)).clamp(RISE_SOC, RISE_SOC_MAX)
}

/// A spare whose charge a device tells.
pub struct MeasuredSpare {
    id: SpareId,
    device: Box<dyn Device>,
    /// It counts as charged from here on, 0..1; see [`Self::is_charged`].
    ready_soc: f64,
    /// How far the device may be off where it does not say.
    soc_sigma: f64,
    /// What was told last: its charge, and whether it can be handed out.
    told: Option<(f64, bool)>,
    /// For how long the device has said nothing, s.
    silent_s: f64,
    /// Time until it is handed out again after an exchange that could not be done, s.
    jammed_s: f64,
    trouble: Option<String>,
}

impl MeasuredSpare {
    /// A spare that can be handed out from a state of charge of `ready_soc`, 0..1, on.
    #[must_use]
    pub fn new(id: SpareId, device: Box<dyn Device>, ready_soc: f64, soc_sigma: f64) -> Self {
        Self { id, device, ready_soc, soc_sigma, told: None, silent_s: 0.0, jammed_s: 0.0, trouble: None }
    }

    /// Its charge and whether it can be handed out, when that is new.
    fn advance(&mut self, dt_s: f64) -> Option<(Estimate, bool)> {
        self.jammed_s -= dt_s;
        let read = self.device.read(dt_s).and_then(|reports| match reports.last() {
            Some(report) => {
                report.soc.map(|soc| Some((soc, report.soc_sigma))).ok_or_else(|| anyhow::anyhow!("it tells no state of charge"))
            }
            None => Ok(None),
        });
        match read {
            Ok(Some((soc, sigma))) => {
                (self.trouble, self.silent_s) = (None, 0.0);
                let soc = Estimate::new(soc, sigma.unwrap_or(self.soc_sigma));
                self.news(soc, self.is_charged(soc))
            }
            Ok(None) => self.silent(dt_s),
            Err(error) => {
                let trouble = format!("{error:#}");
                if self.trouble.as_ref() != Some(&trouble) {
                    warn!("spare {}: {}: {trouble}", self.id, self.device.name());
                    self.trouble = Some(trouble);
                }
                self.silent(dt_s)
            }
        }
    }

    /// Whether it can be handed out: from `ready_soc` on, and then until a reading is clearly below that. Without that the noise of a charge
    /// near `ready_soc` would take the spare away and give it back with every reading, and plans would follow. Nobody states that noise: it is
    /// taken to be at most what the device may be off by, between two readings, and no more than [`NOISE_SOC`].
    fn is_charged(&self, soc: Estimate) -> bool {
        let was_charged = self.told.is_some_and(|(_, ready)| ready);
        if self.jammed_s > 0.0 {
            return false;
        }
        let doubt_soc = if was_charged { soc.sigma.hypot(soc.sigma).min(NOISE_SOC) } else { 0.0 };
        soc.value >= self.ready_soc - doubt_soc
    }

    fn silent(&mut self, dt_s: f64) -> Option<(Estimate, bool)> {
        self.silent_s += dt_s;
        if self.silent_s > SILENT_S {
            self.jammed_s = 0.0;
        }
        if self.silent_s > SILENT_S { self.news(UNKNOWN_SOC, false) } else { None }
    }

    fn news(&mut self, soc: Estimate, ready: bool) -> Option<(Estimate, bool)> {
        let as_told = |(told_soc, told_ready): (f64, bool)| told_ready == ready && (told_soc - soc.value).abs() < SOC_STEP;
        if self.told.is_some_and(as_told) {
            return None;
        }
        self.told = Some((soc.value, ready));
        Some((soc, ready))
    }
}

impl MeasuredStation {
    /// A station of these packs and spares, worked by `hands`, that stands where it is.
    #[must_use]
    pub fn new(packs: Vec<MeasuredPack>, spares: Vec<MeasuredSpare>, hands: Hands) -> Self {
        Self { packs, spares, hands, place: None, active: None, seen_s: 0.0 }
    }

    /// The same as one that drives.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place = Some(place);
        self
    }

    /// The pack that feeds the station: the one that gives current; where none is seen to, the one that was so before.
    fn find_active(&mut self, selected: Option<PackId>) {
        if selected.is_some() {
            self.active = selected;
        }
        let giving = || self.packs.iter().filter_map(|pack| Some((pack, pack.gives_a()?)));
        let goes_on = giving().any(|(pack, _)| Some(&pack.id) == self.active.as_ref());
        let most = giving().max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(pack, _)| pack.id.clone());
        let there = |id: &PackId| self.packs.iter().any(|pack| pack.id == *id && pack.last.is_some());
        match most {
            Some(most) if !goes_on => self.active = Some(most),
            _ if self.active.as_ref().is_some_and(there) => {}
            _ => self.active = self.packs.iter().find(|pack| pack.last.is_some()).map(|pack| pack.id.clone()),
        }
    }

    /// What a person should look after.
    fn trouble(&self) -> Option<String> {
        let silent = self.packs.iter().filter_map(|pack| Some(format!("{}: {}", pack.id, pack.silent.as_ref()?)));
        let place = self.place.as_ref().and_then(Place::trouble);
        let all: Vec<String> = silent.chain(self.hands.trouble()).chain(place).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }
}

impl Source for MeasuredStation {
    fn act(&mut self, act: &Act) {
        self.hands.begin(act);
    }

    fn stride(&self) -> Stride {
        Stride::AtOnce
    }

    fn gave_out(&mut self, depleted: &[(PackId, Option<Estimate>)]) {
        for pack in &mut self.packs {
            if let Some((_, said)) = depleted.iter().find(|(id, _)| *id == pack.id) {
                (pack.depleted, pack.said) = (true, *said);
            }
        }
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        let packs = self.packs.iter_mut().map(|pack| pack.advance(dt_s)).collect();
        let done = self.hands.advance(dt_s);
        let Stand { arrives_s, away_s } = self.place.as_mut().map(|place| place.advance(dt_s)).unwrap_or_default();
        self.find_active(done.selected);
        self.seen_s += dt_s;
        let known = self.seen_s > SILENT_S || self.packs.iter().all(|pack| pack.last.is_some());
        let (mut charged, mut uncharged) = (Vec::new(), Vec::new());
        for spare in &mut self.spares {
            if done.called_off.as_ref().is_some_and(|(_, jammed)| *jammed == spare.id) {
                spare.jammed_s = JAMMED_S;
            }
            let news = spare.advance(dt_s);
            // What lies in the place of a spare that is being exchanged is nobody's yet: it is told afterwards.
            if self.hands.is_exchanging(&spare.id) {
                spare.told = None;
            } else if let Some((soc, ready)) = news {
                if ready { &mut charged } else { &mut uncharged }.push((spare.id.clone(), soc));
            }
        }
        Some(Observation {
            packs,
            charged,
            uncharged,
            active_pack: self.active.clone(),
            powered: self.packs.iter().any(|pack| pack.last.is_some() && !pack.depleted),
            known,
            arrives_s,
            away_s,
            lifted: done.lifted,
            given_up: done.given_up,
            mended: done.mended,
            swapped: done.swapped,
            called_off: done.called_off,
            lift_active: self.hands.are_busy(),
            trouble: self.trouble(),
        })
    }
}

#[cfg(test)]
mod tests;
