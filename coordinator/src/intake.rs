//! What waits for the core: of each sender the newest word, and every word that changes something.
//!
//! ```text
//!   a gauge ──────────────> the sender's slot, unread: the newest takes the place of the one before, and is
//!   a state like the last ─> due, and only then read, `every` after the last that was taken
//!   a state that differs, a refusal ─────> all, in order
//! ```
//!
//! So a flood costs what its senders are worth, and neither memory nor the store grow with it. Answers to
//! commands and signs of life do not come through here: none of them may ever be dropped.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use proto::{Key, Message, RobotState, StationState, decode, plain};

use crate::core::Input;

/// Most senders that are kept apart; what others say is dropped.
const SENDERS_MAX: usize = 200_000;
/// Most changes that wait; beyond this the oldest are dropped.
const CHANGES_MAX: usize = 65_536;

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
    waiting: Waiting,
    /// The bytes of what is unread.
    payload: Vec<u8>,
    /// When one may be taken again.
    due: Duration,
    /// The last state that was passed on as a change.
    told: Option<Input>,
}

/// The queue before the core. Times are of any clock that only goes forward.
#[derive(Debug)]
pub struct Intake {
    every: Duration,
    places: BTreeMap<Arc<str>, usize>,
    slots: Vec<Slot>,
    changes: VecDeque<Input>,
    ready: VecDeque<usize>,
    /// Those that wait until they are due, in this order.
    resting: VecDeque<(Duration, usize)>,
    lost: u64,
}

impl Intake {
    /// Takes of each sender one message in `every`; 0 for as many as the core takes in.
    #[must_use]
    pub fn new(every: Duration) -> Self {
        let (ready, resting) = (VecDeque::new(), VecDeque::new());
        Self { every, places: BTreeMap::new(), slots: Vec::new(), changes: VecDeque::new(), ready, resting, lost: 0 }
    }

    /// Something came under a key. What cannot be read becomes a refusal that names it.
    pub fn hear(&mut self, now: Duration, key: &str, payload: &[u8]) {
        let place = match self.places.get(key) {
            Some(place) => *place,
            None => match self.new_place(key) {
                Ok(Some(place)) => place,
                Ok(None) => return self.lost += 1,
                Err(why) => return self.change(Input::Refused(plain(&format!("{key}: {why}")).into_owned())),
            },
        };
        let slot = &mut self.slots[place];
        let is_gauge = matches!(slot.key, Key::RobotGauge(_) | Key::PackGauge(..));
        let word = if is_gauge && payload.len() <= UNREAD_MAX {
            slot.payload.clear();
            slot.payload.extend_from_slice(payload);
            Waiting::Unread
        } else {
            match read(&slot.key, payload) {
                Err(why) => return self.change(Input::Refused(format!("{key}: {why}"))),
                Ok(state) if !is_gauge && !slot.told.as_ref().is_some_and(|told| alike(told, &state)) => {
                    // What waited is older than the change.
                    slot.waiting = Waiting::Nothing;
                    slot.told = Some(state.clone());
                    return self.change(state);
                }
                Ok(word) => Waiting::Read(Box::new(word)),
            }
        };
        // Who waits already has its place in a queue.
        if matches!(std::mem::replace(&mut slot.waiting, word), Waiting::Nothing) {
            if slot.due <= now {
                self.ready.push_back(place);
            } else {
                self.resting.push_back((slot.due, place));
            }
        }
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
        self.slots.push(Slot { name, key: parsed, waiting: Waiting::Nothing, payload: Vec::new(), due: Duration::ZERO, told: None });
        Ok(Some(self.slots.len() - 1))
    }

    fn change(&mut self, input: Input) {
        if self.changes.len() >= CHANGES_MAX {
            self.changes.pop_front();
            self.lost += 1;
        }
        self.changes.push_back(input);
    }

    /// What the core is to be given next.
    pub fn next(&mut self, now: Duration) -> Option<Input> {
        if let Some(change) = self.changes.pop_front() {
            return Some(change);
        }
        while let Some((_, place)) = self.resting.pop_front_if(|(due, _)| *due <= now) {
            self.ready.push_back(place);
        }
        while let Some(place) = self.ready.pop_front() {
            let slot = &mut self.slots[place];
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
        if !self.changes.is_empty() || !self.ready.is_empty() {
            return Some(Duration::ZERO);
        }
        self.resting.front().map(|(due, _)| *due)
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
mod tests {
    use proto::{Estimate, Gauge, Mission, RobotId, RobotPhase, Timestamp, encode};

    use super::*;

    const EVERY: Duration = Duration::from_millis(500);

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn robot(n: usize) -> RobotId {
        RobotId::new(format!("r{n}")).unwrap()
    }

    fn gauge(n: usize, seq: u64) -> Input {
        let one = Estimate::new(1.0, 0.1);
        let gauge = Gauge {
            at: Timestamp::from_unix_ms(seq.cast_signed()),
            seq,
            soc: Estimate::new(0.5, 0.01),
            remaining_wh: one,
            full_wh: one,
            time_to_empty_s: None,
            time_to_full_s: None,
            soh: one,
            cycles: None,
            voltage_v: 11.0,
            current_a: 0.4,
            temperature_degc: 25.0,
            power_w: 4.4,
            cells_series: 3,
            source: "coulomb_counter".to_owned(),
        };
        Input::RobotGauge(robot(n), gauge)
    }

    fn state(phase: RobotPhase, seq: u64) -> Input {
        let state = RobotState {
            at: Timestamp::from_unix_ms(seq.cast_signed()),
            seq,
            phase,
            station: None,
            bay: None,
            drain_w: Estimate::new(4.0 + seq as f64 / 100.0, 0.1),
            travel: BTreeMap::new(),
            mission: Mission { weight: 1.0, until: None },
            battery: "b".to_owned(),
            load: None,
            last_command: None,
            note: None,
        };
        Input::RobotState(robot(0), state)
    }

    /// Says it, as it comes over the network.
    fn offer(intake: &mut Intake, now: Duration, input: &Input) {
        let (key, payload) = match input {
            Input::RobotGauge(robot, gauge) => (Key::RobotGauge(robot.clone()), encode(gauge)),
            Input::RobotState(robot, state) => (Key::RobotState(robot.clone()), encode(state)),
            _ => unreachable!("only these are said here"),
        };
        intake.hear(now, &key.build(&"site".parse().unwrap()), &payload);
    }

    fn is_ready(intake: &Intake, now: Duration) -> bool {
        intake.ready_at().is_some_and(|at| at <= now)
    }

    fn drained(intake: &mut Intake, now: Duration) -> Vec<Input> {
        std::iter::from_fn(|| intake.next(now)).collect()
    }

    #[test]
    fn of_a_flood_each_sender_has_its_newest_word() {
        let mut intake = Intake::new(EVERY);
        (0..10_000).for_each(|seq| (0..3).for_each(|n| offer(&mut intake, ms(1), &gauge(n, seq))));
        assert_eq!(drained(&mut intake, ms(2)), [gauge(0, 9_999), gauge(1, 9_999), gauge(2, 9_999)]);
        // What comes too soon waits, and the last of it is not lost.
        (0..100).for_each(|seq| offer(&mut intake, ms(3), &gauge(1, 10_000 + seq)));
        assert!(!is_ready(&intake, ms(501)) && drained(&mut intake, ms(501)).is_empty());
        assert!(is_ready(&intake, ms(502)));
        assert_eq!(drained(&mut intake, ms(502)), [gauge(1, 10_099)]);
    }

    #[test]
    fn at_its_usual_pace_every_message_is_taken_at_once() {
        let mut intake = Intake::new(EVERY);
        for second in 0..100 {
            offer(&mut intake, ms(1000 * second), &gauge(0, second));
            assert_eq!(drained(&mut intake, ms(1000 * second)), [gauge(0, second)]);
        }
    }

    #[test]
    fn every_change_of_state_comes_through_in_order_whatever_the_flood() {
        let mut intake = Intake::new(EVERY);
        let phases = [RobotPhase::Working, RobotPhase::Travelling, RobotPhase::Waiting, RobotPhase::Docked];
        for (n, phase) in (0..).zip(phases) {
            (0..1_000).for_each(|seq| offer(&mut intake, ms(n), &state(phase, 1_000 * n + seq)));
        }
        let told = drained(&mut intake, ms(4));
        let changes = (0..).zip(phases).map(|(n, phase)| state(phase, 1_000 * n));
        assert_eq!(told[..4], changes.collect::<Vec<_>>());
        // And the figures of the last one.
        assert_eq!(told[4..], [state(RobotPhase::Docked, 3_999)]);
        assert_eq!(intake.take_lost(), 0);
    }

    #[test]
    fn what_cannot_be_read_is_refused_by_its_key_once_for_each_turn() {
        let mut intake = Intake::new(EVERY);
        let key = "tender/site/v1/robot/r0/gauge";
        (0..100).for_each(|_| intake.hear(ms(0), key, b"{}"));
        let [Input::Refused(why)] = &drained(&mut intake, ms(0))[..] else { panic!("one refusal") };
        assert!(why.starts_with("tender/site/v1/robot/r0/gauge: "), "{why}");
        intake.hear(ms(0), "tender/site/v1/robot/r0/state", b"nonsense");
        intake.hear(ms(0), "tender/site/v1/robot/r0/command", b"{}");
        intake.hear(ms(0), key, &vec![b' '; proto::MAX_MESSAGE_BYTES + 1]);
        intake.hear(ms(0), "tender/site/v1/robot/\u{1b}[2J\n/gauge", b"{}");
        let refused = drained(&mut intake, ms(0));
        let of = |n: usize| if let Input::Refused(why) = &refused[n] { why.as_str() } else { "" };
        assert!(of(0).starts_with("tender/site/v1/robot/r0/state: "), "{refused:?}");
        assert!(of(1).ends_with("command: nothing is expected under this key") && of(2).contains("allowed are at most"), "{refused:?}");
        // A terminal shall show a stranger's key, not obey it.
        assert!(of(3).contains("robot/\\u001b[2J\\n/gauge") && !of(3).contains(char::is_control), "{refused:?}");
    }

    #[test]
    fn memory_is_bounded_by_senders_and_changes() {
        let mut intake = Intake::new(EVERY);
        (0..SENDERS_MAX + 5).for_each(|n| intake.hear(ms(0), &format!("tender/site/v1/robot/r{n}/gauge"), b"{}"));
        (0..CHANGES_MAX + 7).for_each(|n| intake.hear(ms(0), &format!("tender/site/v1/{n}"), b"{}"));
        assert_eq!((intake.slots.len(), intake.changes.len(), intake.take_lost()), (SENDERS_MAX, CHANGES_MAX, 12));
    }
}
