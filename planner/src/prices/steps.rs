//! How prices are bettered, step by step.

use super::{Level, Look, Prices, UNIT};
use crate::way::SHARED_MIN;

/// Rounds in which every step looks at all ways.
const PLAIN_ROUNDS: u32 = 5;
/// When steps have become shorter than this part of the gap, they begin anew at a longer one.
const PULL_MIN: f64 = 0.01;
/// See [`PULL_MIN`].
const PULL_AGAIN: f64 = 0.15;
/// So much shorter.
const SHORTER: f64 = 0.7;
/// What of the mean of prices is that of the last step. With 0.05 and 0.1 the bound rose more slowly, and came to the same.
const MEAN_OF_LAST: f64 = 0.2;
/// Longest stretch of steps without a look at all ways.
const PAUSE_MAX: u32 = 16;
/// The price of a stranded robot is far above that of a tick in a bay, so it moves in larger steps.
const STRANDED_SCALE: f64 = 3.0;

impl Prices<'_, '_> {
    /// Takes a round of steps; `aim` is the value of the best plan known. Returns about how many
    /// moves of a search that is worth.
    ///
    /// In the first rounds every step looks at all ways. Later one look at all of them gives a
    /// bound and the lists of promising ways; the other steps of the round look at these alone,
    /// which is nearly the same and much faster. In a large fleet it looks at the mean of the prices of these steps
    /// ([`Self::improve_mean`]).
    pub fn improve(&mut self, aim: i64) -> u64 {
        let mut usage = vec![0.0; self.layout.rows()];
        let robots = self.ways.problem().robots.len();
        let worth = 4 * robots as u64;
        self.rounds += 1;
        if self.rounds <= PLAIN_ROUNDS {
            for _ in 0..8 {
                let look = self.look_at_cheap(&mut usage);
                self.judge(&look, 8);
                self.step(&look, &usage, aim);
            }
            if self.rounds == 1 {
                self.look_at_all(&mut usage);
            }
            self.mean.copy_from_slice(&self.now);
            return worth;
        }
        if robots >= SHARED_MIN {
            // Threads that wait for the next step of a round find it sooner than those that are woken for each.
            rayon::scope(|_| self.improve_mean(&mut usage, aim));
            return worth;
        }
        let look = self.look_at_all(&mut usage);
        self.judge(&look, 2);
        self.step(&look, &usage, aim);
        for _ in 0..self.pause {
            let look = self.look_at_listed(&mut usage);
            self.step(&look, &usage, aim);
        }
        self.pause = (self.pause + 1).min(PAUSE_MAX);
        worth
    }

    /// A round of steps, and then a look at all ways at the mean of their prices. Of 400 robots the bound then is after
    /// 40 rounds what it was after 70, and rises further; small fleets look more often than they step.
    fn improve_mean(&mut self, usage: &mut [f64], aim: i64) {
        for _ in 0..self.pause {
            let look = self.look_at_listed(usage);
            self.step(&look, usage, aim);
            self.mean.iter_mut().zip(&self.now).for_each(|(mean, now)| *mean += MEAN_OF_LAST * (now - *mean));
        }
        self.pause = (self.pause + 1).min(PAUSE_MAX);
        std::mem::swap(&mut self.now, &mut self.mean);
        let look = self.look_at_all(usage);
        let is_better = self.note(&look);
        std::mem::swap(&mut self.now, &mut self.mean);
        // Steps go on from where they are: to return to the best mean was worse.
        if !is_better {
            self.shorten();
        }
    }

    /// Takes shorter steps from now on.
    fn shorten(&mut self) {
        self.pull *= SHORTER;
        if self.pull < PULL_MIN {
            self.pull = PULL_AGAIN;
        }
    }

    /// Keeps the best prices; after some looks without a better bound the steps get shorter.
    fn judge(&mut self, look: &Look, patience: u32) {
        if self.note(look) {
            self.since_better = 0;
            return;
        }
        self.since_better += 1;
        if self.since_better > patience {
            self.since_better = 0;
            self.shorten();
            self.now.copy_from_slice(&self.best);
            self.direction.fill(0.0);
        }
    }

    /// Moves the prices towards what is asked for too much.
    fn step(&mut self, look: &Look, usage: &[f64], aim: i64) {
        const MEMORY: f64 = 0.6;
        let stranded_row = usage.len();
        let over_stranded = match self.level {
            Level::Stranded => 0.0,
            Level::Cost { stranded_max } => (look.stranded - stranded_max) as f64 * STRANDED_SCALE,
        };
        let mut square = 0.0;
        let mut turn = |direction: &mut f64, price: f64, over: f64| {
            *direction = MEMORY * *direction + (1.0 - MEMORY) * over;
            if *direction > 0.0 || price > 0.0 {
                square += *direction * *direction;
            }
        };
        for rows in self.layout.priced() {
            let of_rows = self.direction[rows.clone()].iter_mut().zip(&self.now[rows.clone()]).zip(&usage[rows]);
            of_rows.for_each(|((direction, &price), &over)| turn(direction, price, over));
        }
        turn(&mut self.direction[stranded_row], self.now[stranded_row], over_stranded);
        if square <= 0.0 {
            return;
        }
        let value = look.bound as f64 / UNIT as f64;
        let gap = (aim as f64 - value).max(0.002 * aim.abs() as f64).max(0.05);
        let step = self.pull * gap / square;
        // A direction that has nearly died away makes steps of any length.
        let price_max = self.layout.price_max(UNIT);
        let go = |price: &mut f64, step: f64, direction: f64| *price = (*price + step * direction).clamp(0.0, price_max);
        for rows in self.layout.priced() {
            let of_rows = self.now[rows.clone()].iter_mut().zip(&self.direction[rows]);
            of_rows.for_each(|(price, &direction)| go(price, step, direction));
        }
        go(&mut self.now[stranded_row], step * STRANDED_SCALE, self.direction[stranded_row]);
    }
}
