//! What waits for the core: of each sender the newest word, and every word that changes something.
//!
//! ```text
//!   a gauge ──────────────> the sender's slot, unread: the newest takes the place of the one before, and is
//!   a state like the last ─> due, and only then read, `every` after the last that was taken
//!   a state that differs, a refusal ─────> the sender's own queue: all, in order
//!
//!   next: by turns from those who have changes and from those who are due, each sender one in its turn
//! ```
//!
//! So a flood costs what its senders are worth, and neither memory nor the store grow with it; it takes nobody else's
//! place and nobody else's turn. Answers to commands and signs of life do not come through here: none of them may ever be
//! dropped.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use proto::{Key, Message, RobotState, StationState, decode, plain};

use crate::core::Input;

/// Most senders that are kept apart; what others say is dropped.
const SENDERS_MAX: usize = 200_000;
/// Most changes of one sender that wait; beyond this its oldest are dropped. Each takes a few in a service.
const CHANGES_OF_ONE: usize = 64;
/// Most changes of all that wait; beyond this whoever has one already drops its oldest for the next.
const CHANGES_MAX: usize = 65_536;
/// Most refusals of keys that wait under which nobody is known; beyond this the oldest are dropped.
const STRANGERS_MAX: usize = 256;

/// Bytes that wait unread at most; what is longer is no gauge of ours, and is read, or refused, at once.
const UNREAD_MAX: usize = 2048;

/// Said and not taken yet.
#[derive(Debug)]
enum Waiting {
    Nothing,
    /// As it came: most of what comes in a flood is never read.
    Unread,
    Read(Box<Input>),
}

/// What one sender says under one key.
#[derive(Debug)]
struct Slot {
    name: Arc<str>,
    key: Key,
    /// Changes of state, and a refusal, in order; the newest word comes after them.
    changes: VecDeque<Input>,
    waiting: Waiting,
    /// The bytes of what is unread.
    payload: Vec<u8>,
    /// When one may be taken again.
    due: Duration,
    /// The last state that was passed on as a change.
    told: Option<Input>,
    /// Whether it stands among those who are due, and among those who rest: once at most, whatever it says.
    is_ready: bool,
    rests: bool,
}

impl Slot {
    /// Whether a change of state waits, which is older than its newest word. A refusal keeps nobody waiting, and is one at most.
    fn has_changed(&self) -> bool {
        self.changes.iter().take(2).any(|input| !is_refusal(input))
    }
}

fn is_refusal(input: &Input) -> bool {
    matches!(input, Input::Refused(_))
}

/// Whose turn it is to tell a change or a refusal.
#[derive(Debug, Clone, Copy)]
enum Turn {
    Strangers,
    Sender(usize),
}

/// The queue before the core. Times are of any clock that only goes forward.
#[derive(Debug)]
pub struct Intake {
    every: Duration,
    places: BTreeMap<Arc<str>, usize>,
    slots: Vec<Slot>,
    /// Refusals of keys under which nobody is known.
    strangers: VecDeque<Input>,
    /// Changes that wait in all slots.
    changes: usize,
    /// Those who have changes, each once, in the order of their turns.
    changed: VecDeque<Turn>,
    /// Those whose newest word is due, likewise.
    ready: VecDeque<usize>,
    /// Those that wait until they are due.
    resting: BTreeSet<(Duration, usize)>,
    /// Whether the last turn was that of a change.
    was_change: bool,
    lost: u64,
}

impl Intake {
    /// Takes of each sender one message in `every`; 0 for as many as the core takes in.
    #[must_use]
    pub fn new(every: Duration) -> Self {
        Self {
            every,
            places: BTreeMap::new(),
            slots: Vec::new(),
            strangers: VecDeque::new(),
            changes: 0,
            changed: VecDeque::new(),
            ready: VecDeque::new(),
            resting: BTreeSet::new(),
            was_change: false,
            lost: 0,
        }
    }

    /// Something came under a key. What cannot be read becomes a refusal that names it.
    pub fn hear(&mut self, now: Duration, key: &str, payload: &[u8]) {
        let place = match self.places.get(key) {
            Some(place) => *place,
            None => match self.new_place(key) {
                Ok(Some(place)) => place,
                Ok(None) => return self.lost += 1,
                Err(why) => return self.refuse_stranger(plain(&format!("{key}: {why}")).into_owned()),
            },
        };
        let slot = &mut self.slots[place];
        let is_gauge = matches!(slot.key, Key::RobotGauge(_) | Key::PackGauge(..));
        slot.waiting = if is_gauge && payload.len() <= UNREAD_MAX {
            slot.payload.clear();
            slot.payload.extend_from_slice(payload);
            Waiting::Unread
        } else {
            match read(&slot.key, payload) {
                Err(why) => return self.change(place, Input::Refused(format!("{key}: {why}"))),
                Ok(state) if !is_gauge && !slot.told.as_ref().is_some_and(|told| alike(told, &state)) => {
                    // What waited is older than the change.
                    slot.waiting = Waiting::Nothing;
                    slot.told = Some(state.clone());
                    return self.change(place, state);
                }
                Ok(word) => Waiting::Read(Box::new(word)),
            }
        };
        self.queue(now, place);
    }

    /// A place for who was not heard before, unless there are too many.
    fn new_place(&mut self, key: &str) -> Result<Option<usize>, String> {
        let (_, parsed) = Key::parse(key).map_err(|error| error.to_string())?;
        if !matches!(parsed, Key::RobotGauge(_) | Key::PackGauge(..) | Key::RobotState(_) | Key::StationState(_)) {
            return Err("nothing is expected under this key".to_owned());
        }
        if self.slots.len() >= SENDERS_MAX {
            return Ok(None);
        }
        let name: Arc<str> = key.into();
        self.places.insert(Arc::clone(&name), self.slots.len());
        self.slots.push(Slot {
            name,
            key: parsed,
            changes: VecDeque::new(),
            waiting: Waiting::Nothing,
            payload: Vec::new(),
            due: Duration::ZERO,
            told: None,
            is_ready: false,
            rests: false,
        });
        Ok(Some(self.slots.len() - 1))
    }

    fn refuse_stranger(&mut self, why: String) {
        if self.strangers.is_empty() {
            self.changed.push_back(Turn::Strangers);
        } else if self.strangers.len() >= STRANGERS_MAX {
            self.strangers.pop_front();
            self.lost += 1;
        }
        self.strangers.push_back(Input::Refused(why));
    }

    /// A change of a sender, or a refusal: of these the newest waits. Where there is no room its own oldest makes some, so
    /// that the last word of each always has a place.
    fn change(&mut self, place: usize, input: Input) {
        let changes = &mut self.slots[place].changes;
        if is_refusal(&input)
            && let Some(before) = changes.iter().position(is_refusal)
        {
            changes[before] = input;
            return;
        }
        if changes.is_empty() {
            self.changed.push_back(Turn::Sender(place));
        } else if changes.len() >= CHANGES_OF_ONE || self.changes >= CHANGES_MAX {
            changes.pop_front();
            self.changes -= 1;
            self.lost += 1;
        }
        changes.push_back(input);
        self.changes += 1;
    }

    /// Who says this is gone: what waits of it is dropped, since it would be thought to be there again with that. What was refused stays.
    pub fn withdraw(&mut self, key: &str) {
        let Some(&place) = self.places.get(key) else { return };
        let slot = &mut self.slots[place];
        (slot.waiting, slot.payload, slot.told) = (Waiting::Nothing, Vec::new(), None);
        let waited = slot.changes.len();
        slot.changes.retain(is_refusal);
        self.changes -= waited - slot.changes.len();
        if slot.changes.is_empty() {
            self.changed.retain(|turn| !matches!(turn, Turn::Sender(of) if *of == place));
        }
    }

    /// Sees to it that a sender whose newest word waits has its turn, once its changes are told.
    fn queue(&mut self, now: Duration, place: usize) {
        let slot = &mut self.slots[place];
        if slot.is_ready || slot.has_changed() || matches!(slot.waiting, Waiting::Nothing) {
            return;
        }
        if slot.due <= now {
            slot.is_ready = true;
            self.ready.push_back(place);
        } else if !slot.rests {
            slot.rests = true;
            self.resting.insert((slot.due, place));
        }
    }

    /// What the core is to be given next.
    pub fn next(&mut self, now: Duration) -> Option<Input> {
        while let Some(&(due, place)) = self.resting.first()
            && due <= now
        {
            self.resting.pop_first();
            self.slots[place].rests = false;
            self.queue(now, place);
        }
        // Neither who changes its state all the time nor who has many gauges keeps the others waiting.
        self.was_change = !self.was_change;
        if self.was_change {
            self.next_change(now).or_else(|| self.next_word(now))
        } else {
            self.next_word(now).or_else(|| self.next_change(now))
        }
    }

    /// The next change, or refusal, of whose turn it is.
    fn next_change(&mut self, now: Duration) -> Option<Input> {
        let turn = self.changed.pop_front()?;
        let changes = match turn {
            Turn::Strangers => &mut self.strangers,
            Turn::Sender(place) => &mut self.slots[place].changes,
        };
        let change = changes.pop_front();
        if !changes.is_empty() {
            self.changed.push_back(turn);
        } else {
            // What was kept for them is given back.
            *changes = VecDeque::new();
        }
        if let Turn::Sender(place) = turn {
            self.changes -= 1;
            self.queue(now, place);
        }
        change
    }

    /// The newest word of who is due next.
    fn next_word(&mut self, now: Duration) -> Option<Input> {
        while let Some(place) = self.ready.pop_front() {
            let slot = &mut self.slots[place];
            slot.is_ready = false;
            // What changed is older: it goes first, and this has its turn after that.
            if slot.has_changed() {
                continue;
            }
            let input = match std::mem::replace(&mut slot.waiting, Waiting::Nothing) {
                Waiting::Nothing => continue,
                Waiting::Read(input) => *input,
                // What was kept for it is given back: of many senders little is unread at any time.
                Waiting::Unread => read(&slot.key, &std::mem::take(&mut slot.payload))
                    .unwrap_or_else(|why| Input::Refused(format!("{}: {why}", slot.name))),
            };
            slot.due = now + self.every;
            return Some(input);
        }
        None
    }

    /// When there is something to be given, if anything waits; a time that has passed for now.
    #[must_use]
    pub fn ready_at(&self) -> Option<Duration> {
        if !self.changed.is_empty() || !self.ready.is_empty() {
            return Some(Duration::ZERO);
        }
        self.resting.first().map(|(due, _)| *due)
    }

    /// Changes and senders that found no place since this was last asked.
    pub fn take_lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }
}

/// What is said under a key.
fn read(key: &Key, payload: &[u8]) -> Result<Input, String> {
    fn message<M: Message>(payload: &[u8]) -> Result<M, String> {
        decode(payload).map_err(|error| error.to_string())
    }
    Ok(match key {
        Key::RobotGauge(robot) => Input::RobotGauge(robot.clone(), message(payload)?),
        Key::RobotState(robot) => Input::RobotState(robot.clone(), message(payload)?),
        Key::StationState(station) => Input::StationState(station.clone(), message(payload)?),
        Key::PackGauge(station, pack) => Input::PackGauge(station.clone(), pack.clone(), message(payload)?),
        _ => return Err("nothing is expected under this key".to_owned()),
    })
}

/// Whether a state says nothing that must not wait: figures may differ, what robot and station do may not.
fn alike(told: &Input, new: &Input) -> bool {
    match (told, new) {
        (Input::RobotState(_, told), Input::RobotState(_, new)) => robot_alike(told, new),
        (Input::StationState(_, told), Input::StationState(_, new)) => station_alike(told, new),
        _ => false,
    }
}

fn robot_alike(told: &RobotState, new: &RobotState) -> bool {
    let place = |state: &RobotState| (state.phase, state.station.clone(), state.bay.clone());
    let words = |state: &RobotState| (state.mission, state.battery.clone(), state.last_command.clone(), state.note.clone());
    place(told) == place(new) && words(told) == words(new) && told.travel.keys().eq(new.travel.keys())
}

fn station_alike(told: &StationState, new: &StationState) -> bool {
    let spares = |state: &StationState| state.spares.iter().map(|spare| (spare.spare.clone(), spare.ready)).collect::<Vec<_>>();
    let figures = StationState { at: told.at, seq: told.seq, pack_power_w: told.pack_power_w, spares: told.spares.clone(), ..new.clone() };
    *told == figures && spares(told) == spares(new)
}

#[cfg(test)]
mod tests;
