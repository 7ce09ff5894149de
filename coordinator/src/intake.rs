//! What waits for the core: of each sender the newest word, and every word that changes something.
//!
//! ```text
//!   a gauge, a state like the last one ──> the sender's slot: the newest takes the place of the one before,
//!                                          and is due `every` after the last that was taken
//!   a state that differs, a refusal ─────> all, in order
//! ```
//!
//! So a flood costs what its senders are worth, and neither memory nor the store grow with it. Answers to
//! commands and signs of life do not come through here: none of them may ever be dropped.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use proto::{PackId, RobotId, RobotState, StationId, StationState};

use crate::core::Input;

/// Most senders that are kept apart; what others say is dropped.
const SENDERS_MAX: usize = 200_000;
/// Most changes that wait; beyond this the oldest are dropped.
const CHANGES_MAX: usize = 65_536;

/// Who says it, and in which kind of message.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Sender {
    RobotGauge(RobotId),
    RobotState(RobotId),
    PackGauge(StationId, PackId),
    StationState(StationId),
}

impl Sender {
    fn of(input: &Input) -> Option<Self> {
        match input {
            Input::RobotGauge(robot, _) => Some(Self::RobotGauge(robot.clone())),
            Input::RobotState(robot, _) => Some(Self::RobotState(robot.clone())),
            Input::PackGauge(station, pack, _) => Some(Self::PackGauge(station.clone(), pack.clone())),
            Input::StationState(station, _) => Some(Self::StationState(station.clone())),
            _ => None,
        }
    }
}

#[derive(Debug, Default)]
struct Slot {
    /// Said and not taken yet.
    waiting: Option<Input>,
    /// When one may be taken again.
    due: Duration,
    /// The last state that was passed on as a change.
    told: Option<Input>,
}

/// The queue before the core. Times are of any clock that only goes forward.
#[derive(Debug)]
pub struct Intake {
    every: Duration,
    slots: BTreeMap<Sender, Slot>,
    changes: VecDeque<Input>,
    ready: VecDeque<Sender>,
    /// Those that wait until they are due, in this order.
    resting: VecDeque<(Duration, Sender)>,
    lost: u64,
}

impl Intake {
    /// Takes of each sender one message in `every`; 0 for as many as the core takes in.
    #[must_use]
    pub fn new(every: Duration) -> Self {
        Self { every, slots: BTreeMap::new(), changes: VecDeque::new(), ready: VecDeque::new(), resting: VecDeque::new(), lost: 0 }
    }

    /// Something came.
    pub fn offer(&mut self, now: Duration, input: Input) {
        let Some(sender) = Sender::of(&input) else { return self.change(input) };
        if !self.slots.contains_key(&sender) && self.slots.len() >= SENDERS_MAX {
            self.lost += 1;
            return;
        }
        let slot = self.slots.entry(sender.clone()).or_default();
        let is_state = matches!(input, Input::RobotState(..) | Input::StationState(..));
        if is_state && !slot.told.as_ref().is_some_and(|told| alike(told, &input)) {
            // What waited is older than the change.
            slot.waiting = None;
            slot.told = Some(input.clone());
            return self.change(input);
        }
        // Who waits already has its place in a queue.
        if slot.waiting.replace(input).is_none() {
            if slot.due <= now {
                self.ready.push_back(sender);
            } else {
                self.resting.push_back((slot.due, sender));
            }
        }
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
        while let Some((_, sender)) = self.resting.pop_front_if(|(due, _)| *due <= now) {
            self.ready.push_back(sender);
        }
        while let Some(sender) = self.ready.pop_front() {
            let slot = self.slots.get_mut(&sender).expect("who is ready has a slot");
            if let Some(input) = slot.waiting.take() {
                slot.due = now + self.every;
                return Some(input);
            }
        }
        None
    }

    /// Whether there is something to be given now.
    #[must_use]
    pub fn is_ready(&self, now: Duration) -> bool {
        !self.changes.is_empty() || !self.ready.is_empty() || self.resting.front().is_some_and(|(due, _)| *due <= now)
    }

    /// Changes and senders that found no place since this was last asked.
    pub fn take_lost(&mut self) -> u64 {
        std::mem::take(&mut self.lost)
    }
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
    use proto::{Estimate, Gauge, Mission, RobotPhase, Timestamp};

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
            last_command: None,
            note: None,
        };
        Input::RobotState(robot(0), state)
    }

    fn drained(intake: &mut Intake, now: Duration) -> Vec<Input> {
        std::iter::from_fn(|| intake.next(now)).collect()
    }

    #[test]
    fn of_a_flood_each_sender_has_its_newest_word() {
        let mut intake = Intake::new(EVERY);
        (0..10_000).for_each(|seq| (0..3).for_each(|n| intake.offer(ms(1), gauge(n, seq))));
        assert_eq!(drained(&mut intake, ms(2)), [gauge(0, 9_999), gauge(1, 9_999), gauge(2, 9_999)]);
        // What comes too soon waits, and the last of it is not lost.
        (0..100).for_each(|seq| intake.offer(ms(3), gauge(1, 10_000 + seq)));
        assert!(!intake.is_ready(ms(501)) && drained(&mut intake, ms(501)).is_empty());
        assert!(intake.is_ready(ms(502)));
        assert_eq!(drained(&mut intake, ms(502)), [gauge(1, 10_099)]);
    }

    #[test]
    fn at_its_usual_pace_every_message_is_taken_at_once() {
        let mut intake = Intake::new(EVERY);
        for second in 0..100 {
            intake.offer(ms(1000 * second), gauge(0, second));
            assert_eq!(drained(&mut intake, ms(1000 * second)), [gauge(0, second)]);
        }
    }

    #[test]
    fn every_change_of_state_comes_through_in_order_whatever_the_flood() {
        let mut intake = Intake::new(EVERY);
        let phases = [RobotPhase::Working, RobotPhase::Travelling, RobotPhase::Waiting, RobotPhase::Docked];
        for (n, phase) in (0..).zip(phases) {
            (0..1_000).for_each(|seq| intake.offer(ms(n), state(phase, 1_000 * n + seq)));
        }
        let told = drained(&mut intake, ms(4));
        let changes = (0..).zip(phases).map(|(n, phase)| state(phase, 1_000 * n));
        assert_eq!(told[..4], changes.collect::<Vec<_>>());
        // And the figures of the last one.
        assert_eq!(told[4..], [state(RobotPhase::Docked, 3_999)]);
        assert_eq!(intake.take_lost(), 0);
    }

    #[test]
    fn memory_is_bounded_by_senders_and_changes() {
        let mut intake = Intake::new(EVERY);
        (0..SENDERS_MAX + 5).for_each(|n| intake.offer(ms(0), gauge(n, 0)));
        (0..CHANGES_MAX + 7).for_each(|n| intake.offer(ms(0), Input::Refused(n.to_string())));
        assert_eq!((intake.slots.len(), intake.changes.len(), intake.take_lost()), (SENDERS_MAX, CHANGES_MAX, 12));
    }
}
