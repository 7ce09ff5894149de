//! What works a real station: a program of the user's, started anew for every act.
//!
//! | arguments | done when |
//! | --- | --- |
//! | `load ROBOT BAY` | the robot is in its bay |
//! | `unload ROBOT BAY` | it is out |
//! | `swap ROBOT SPARE` | the robot has the spare, and its own pack lies in its place |
//! | `select PACK` | the pack feeds the station |
//! | `check BAY` | a bay that was out of order can be used again |
//!
//! Exit status 0: done. [`NOTHING_MOVED`] of `swap`: it cannot be done, and the robot has its own pack still; it is called off. Anything else, or no end within `operate_max_s`: it is tried again, later each time, and said in the station's note meanwhile. A lift that
//! fails for the last of [`LIFT_TRIES`] times puts its bay out of order: from then on `check`, or `unload` where a robot is still in
//! it, is asked every [`CHECK_S`] seconds. Lift movements and checks come one after the other; an exchange or a change of packs may
//! go on beside them. After a restart an act may be asked for again that was done: it ends with 0 then.

use std::collections::VecDeque;

use device::program::retry_s;
use device::{Program, UNKNOWN_SOC};
use energy::Estimate;
use proto::{BayId, PackId, RobotId, SpareId};
use tracing::{info, warn};

use crate::source::{Act, Lifted, Swapped};

/// The key of the configuration that names the program.
pub const KEY: &str = "source.operate";

/// Exit status of a `swap` that has moved nothing: EX_TEMPFAIL of sysexits.h.
const NOTHING_MOVED: i32 = 75;
/// Lift movements are given up after so many failures: others want the lift.
const LIFT_TRIES: u32 = 3;
/// A step that is longer is one through which the machine has slept, s.
pub(super) const SLEPT_S: f64 = 60.0;
/// Time between two checks of a bay that is out of order, s.
const CHECK_S: f64 = 60.0;

/// What was done in the last step.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Done {
    pub(super) lifted: Option<Lifted>,
    pub(super) given_up: Option<Lifted>,
    pub(super) mended: Vec<BayId>,
    pub(super) swapped: Option<Swapped>,
    pub(super) called_off: Option<(RobotId, SpareId)>,
    pub(super) selected: Option<PackId>,
}

/// The program, once for the lift, for exchanges and for the selector.
#[derive(Debug)]
pub struct Hands {
    lift: Duty,
    swap: Duty,
    select: Duty,
    /// Movements that were given up, and the time until each is looked at again, s.
    broken: VecDeque<(Lifted, f64)>,
    /// Whether the lift is at the first of these.
    mending: bool,
    /// A movement that is asked for while a bay is checked.
    next: Option<Act>,
    /// The last exchange, where nothing came of it, in words.
    called_off: Option<String>,
    /// How far a charge may be off that the program says without a sigma.
    soc_sigma: f64,
}

impl Hands {
    /// Hands that use this program, which may take `max_s` (s) for an act and tells charges to `soc_sigma` where it says nothing else; with an empty one, whatever is asked is taken as done by others.
    #[must_use]
    pub fn new(operate: Vec<String>, max_s: f64, soc_sigma: f64) -> Self {
        let duty = || Duty { program: Program::new(KEY, operate.clone()), max_s, task: None };
        let (lift, swap, select) = (duty(), duty(), duty());
        lift.program.look_for();
        if !lift.program.is_set() {
            info!("no {KEY}: robots are taken to get into and out of bays by themselves, as soon as they are asked to");
        }
        Self { lift, swap, select, broken: VecDeque::new(), mending: false, next: None, called_off: None, soc_sigma }
    }

    /// Begins an act.
    pub(super) fn begin(&mut self, act: &Act) {
        match act {
            Act::Lift(_) if self.mending => self.next = Some(act.clone()),
            Act::Lift(_) => self.lift.begin(act),
            Act::Swap { .. } => {
                self.called_off = None;
                self.swap.begin(act);
            }
            // Asked for again as long as it is wanted.
            Act::Select { .. } if self.select.is_at(act) => {}
            Act::Select { .. } => self.select.begin(act),
        }
    }

    /// What was done in the last `dt_s` seconds.
    pub(super) fn advance(&mut self, dt_s: f64) -> Done {
        let mut done = Done::default();
        self.work_lift(dt_s, &mut done);
        match self.swap.advance(dt_s) {
            Some(Outcome::Done(Act::Swap { robot, spare }, printed)) => {
                let given_soc = soc_in(&printed, self.soc_sigma).unwrap_or(UNKNOWN_SOC);
                done.swapped = Some(Swapped { robot, spare, given_soc });
            }
            Some(Outcome::Failed(Act::Swap { robot, spare }, _, Some(NOTHING_MOVED))) => {
                self.swap.task = None;
                warn!("the exchange of {robot} with {spare} is called off: nothing was moved");
                self.called_off = Some(format!("the exchange of {robot} with {spare} was called off"));
                done.called_off = Some((robot, spare));
            }
            _ => {}
        }
        if let Some(Outcome::Done(Act::Select { pack }, _)) = self.select.advance(dt_s) {
            // Where nobody can change packs, what gives current is what feeds the station.
            done.selected = self.select.program.is_set().then_some(pack);
        }
        done
    }

    fn work_lift(&mut self, dt_s: f64, done: &mut Done) {
        self.broken.iter_mut().for_each(|(_, wait_s)| *wait_s -= dt_s);
        match self.lift.advance(dt_s) {
            Some(Outcome::Done(Act::Lift(moved), _)) if self.mending => {
                self.mending = false;
                self.broken.pop_front();
                if moved.into {
                    done.mended.push(moved.bay);
                } else {
                    done.lifted = Some(moved);
                }
            }
            Some(Outcome::Failed(Act::Lift(moved), ..)) if self.mending => {
                self.mending = false;
                self.lift.task = None;
                self.broken.pop_front();
                self.broken.push_back((moved, CHECK_S));
            }
            Some(Outcome::Done(Act::Lift(moved), _)) => done.lifted = Some(moved),
            Some(Outcome::Failed(Act::Lift(moved), LIFT_TRIES, _)) => {
                self.lift.task = None;
                warn!("bay {} is out of order", moved.bay);
                self.broken.push_back((moved.clone(), CHECK_S));
                done.given_up = Some(moved);
            }
            _ => {}
        }
        if self.lift.task.is_some() {
            return;
        }
        if let Some(act) = self.next.take() {
            self.lift.begin(&act);
        } else if let Some(due) = self.broken.iter().position(|(_, wait_s)| *wait_s <= 0.0) {
            self.broken.swap(0, due);
            let (moved, _) = &self.broken[0];
            let words = if moved.into { vec!["check".to_owned(), moved.bay.to_string()] } else { words(&Act::Lift(moved.clone())) };
            self.mending = true;
            self.lift.begin_with(Act::Lift(moved.clone()), words);
        }
    }

    /// Whether anything is under way that the agent asked for.
    pub(super) fn are_busy(&self) -> bool {
        self.lift.task.is_some() && !self.mending || self.next.is_some() || self.swap.task.is_some()
    }

    /// Whether a spare is being handed out.
    pub(super) fn is_exchanging(&self, spare: &SpareId) -> bool {
        self.swap.task.as_ref().is_some_and(|task| matches!(&task.act, Act::Swap { spare: own, .. } if own == spare))
    }

    /// What went wrong and is tried again.
    pub(super) fn trouble(&self) -> Option<String> {
        let out = self.broken.iter().map(|(moved, _)| format!("bay {} is out of order", moved.bay));
        let tried = [&self.lift, &self.swap, &self.select].into_iter().filter(|_| !self.mending);
        let failing = tried.filter_map(|duty| duty.task.as_ref()?.failed.clone());
        let all: Vec<String> = out.chain(failing).chain(self.called_off.clone()).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }
}

/// A program, and the one act that it is to do until it is done.
#[derive(Debug)]
struct Duty {
    program: Program,
    /// Longest time that an act may take, s.
    max_s: f64,
    task: Option<Task>,
}

#[derive(Debug)]
struct Task {
    act: Act,
    words: Vec<String>,
    tries: u32,
    wait_s: f64,
    /// For how long the program has been at it, s.
    at_it_s: f64,
    failed: Option<String>,
}

enum Outcome {
    /// What was done, and what the program printed.
    Done(Act, String),
    /// What failed, for how many times, and the exit status.
    Failed(Act, u32, Option<i32>),
}

impl Duty {
    fn is_at(&self, act: &Act) -> bool {
        self.task.as_ref().is_some_and(|task| task.act == *act)
    }

    fn begin(&mut self, act: &Act) {
        self.begin_with(act.clone(), words(act));
    }

    fn begin_with(&mut self, act: Act, words: Vec<String>) {
        self.program.stop();
        self.task = Some(Task { act, words, tries: 0, wait_s: 0.0, at_it_s: 0.0, failed: None });
    }

    fn advance(&mut self, dt_s: f64) -> Option<Outcome> {
        let task = self.task.as_mut()?;
        let mut code = None;
        let ended = if self.program.is_running() {
            // What the machine slept through, the program did too.
            task.at_it_s += if dt_s > SLEPT_S { 0.0 } else { dt_s };
            match self.program.ended() {
                Some(ended) => {
                    code = ended.code;
                    ended.result.map(|()| ended.printed)
                }
                None if task.at_it_s <= self.max_s => return None,
                None => {
                    self.program.stop();
                    Err(format!("{KEY}: `{}` has not ended in {:.0} s and was stopped", task.words.join(" "), self.max_s))
                }
            }
        } else {
            task.wait_s -= dt_s;
            // Two of them would be at one lift.
            if task.wait_s > 0.0 || self.program.is_ending() {
                return None;
            }
            task.at_it_s = 0.0;
            match self.program.begin(&task.words) {
                Ok(()) if self.program.is_set() => return None,
                begun => begun.map(|()| String::new()),
            }
        };
        match ended {
            Ok(printed) => self.task.take().map(|task| Outcome::Done(task.act, printed)),
            Err(what) => {
                task.tries += 1;
                task.wait_s = retry_s(task.tries);
                warn!("{what}; tried again in {:.0} s", task.wait_s);
                task.failed = Some(what);
                Some(Outcome::Failed(task.act.clone(), task.tries, code))
            }
        }
    }
}

/// An act in the words of the program.
fn words(act: &Act) -> Vec<String> {
    match act {
        Act::Lift(Lifted { robot, bay, into }) => {
            let verb = if *into { "load" } else { "unload" };
            vec![verb.to_owned(), robot.to_string(), bay.to_string()]
        }
        Act::Swap { robot, spare } => vec!["swap".to_owned(), robot.to_string(), spare.to_string()],
        Act::Select { pack } => vec!["select".to_owned(), pack.to_string()],
    }
}

/// State of charge of the pack that a robot gave: the last line that says `soc VALUE` or `soc VALUE SIGMA`, 0..1.
fn soc_in(printed: &str, soc_sigma: f64) -> Option<Estimate> {
    let said = printed.lines().rev().find_map(|line| line.trim().strip_prefix("soc "))?;
    let numbers: Option<Vec<f64>> = said.split_whitespace().map(|word| word.parse().ok()).collect();
    let estimate = match numbers.as_deref() {
        Some([soc]) => Estimate::new(*soc, soc_sigma),
        Some([soc, sigma]) => Estimate::new(*soc, *sigma),
        _ => Estimate::new(f64::NAN, f64::NAN),
    };
    let is_sane = (0.0..=1.0).contains(&estimate.value) && (0.0..=0.5).contains(&estimate.sigma);
    if !is_sane {
        warn!("{KEY}: `soc {said}` is no state of charge between 0 and 1: taken as not known");
    }
    is_sane.then_some(estimate)
}
