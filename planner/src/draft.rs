//! A plan in the making: one way, or none, for each robot, the books that follow from it, and a
//! log by which a change that led nowhere is taken back.

use crate::book::Book;
use crate::problem::{Problem, Tick};
use crate::way::Ways;

/// For a robot without a service.
pub const NONE: u32 = u32::MAX;

/// What a plan is judged by, in this order; less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Score {
    /// Robots that run empty.
    pub stranded: i64,
    /// Worth of missed work.
    pub cost: i64,
    /// Energy that services take from packs, mWh.
    pub energy: i64,
}

/// A plan in the making.
#[derive(Debug, Clone)]
pub struct Draft<'w, 'p> {
    /// What there is to choose from.
    pub ways: &'w Ways<'p>,
    /// One for each station.
    pub books: Vec<Book<'p>>,
    /// Index of each robot's way, or [`NONE`].
    pub chosen: Vec<u32>,
    /// What the choice amounts to.
    pub score: Score,
    /// Robots that run empty as things stand.
    pub lost: Vec<u32>,
    /// Where in `lost` each robot stands, if it does.
    lost_at: Vec<u32>,
    log: Vec<(u32, u32)>,
}

impl<'w, 'p> Draft<'w, 'p> {
    /// Nobody is serviced.
    #[must_use]
    pub fn new(ways: &'w Ways<'p>) -> Self {
        let problem = ways.problem();
        let mut score = Score::default();
        for (index, robot) in problem.robots.iter().enumerate() {
            score.stranded += i64::from(problem.strands(index));
            score.cost += robot.missed_unserved(problem.battery(index).floor);
        }
        let books = problem.stations.iter().map(|station| Book::new(problem, station)).collect();
        let mut lost_at = vec![NONE; problem.robots.len()];
        let lost: Vec<u32> = (0..problem.robots.len()).filter(|&robot| problem.strands(robot)).map(|robot| robot as u32).collect();
        lost.iter().zip(0..).for_each(|(&robot, place)| lost_at[robot as usize] = place);
        Self { ways, books, chosen: vec![NONE; problem.robots.len()], score, lost, lost_at, log: Vec::new() }
    }

    /// The same plan among other ways of the same problem: those who have a way there too keep their places, and
    /// nothing is booked anew.
    #[must_use]
    pub(crate) fn among<'v>(mut self, ways: &'v Ways<'p>) -> Draft<'v, 'p> {
        let served = (0..self.chosen.len()).filter(|&robot| self.chosen[robot] != NONE);
        let found: Vec<(usize, Option<usize>)> = served
            .map(|robot| {
                let way = &self.ways.of(robot).ways[self.chosen[robot] as usize];
                (robot, ways.of(robot).find(usize::from(way.station), Tick::from(way.start), way.mode))
            })
            .collect();
        found.iter().filter(|(_, way)| way.is_none()).for_each(|&(robot, _)| self.strike(robot));
        found.iter().for_each(|&(robot, way)| self.chosen[robot] = way.map_or(NONE, |way| way as u32));
        let Self { books, chosen, score, lost, lost_at, .. } = self;
        let mut draft = Draft { ways, books, chosen, score, lost, lost_at, log: Vec::new() };
        // Ways may be priced otherwise than they were.
        let services = (0..draft.chosen.len()).filter(|&robot| draft.chosen[robot] != NONE);
        let unserved = |robot: usize| {
            let robot = &draft.problem().robots[robot];
            robot.missed_unserved(draft.problem().batteries[robot.battery].floor)
        };
        let all: i64 = (0..draft.chosen.len()).map(unserved).sum();
        let saved: i64 = services.map(|robot| draft.cost_of(robot) - i64::from(ways.of(robot).unserved_cost)).sum();
        draft.score.cost = all + saved;
        draft
    }

    /// The same plan, but nothing can change at stations that are not open, and of the robots that run empty these
    /// alone are looked for a place.
    #[must_use]
    pub(crate) fn with_open(&self, open: &[bool], robots: &[u32]) -> Self {
        let mut draft = self.clone();
        draft.lost = robots.iter().copied().filter(|&robot| self.is_stranded(robot as usize)).collect();
        draft.lost.iter().zip(0..).for_each(|(&robot, place)| draft.lost_at[robot as usize] = place);
        draft.books.iter_mut().zip(open).filter(|(_, open)| !**open).for_each(|(book, _)| book.close());
        draft
    }

    /// The problem.
    #[must_use]
    pub fn problem(&self) -> &'p Problem {
        self.ways.problem()
    }

    /// What a robot's service, or its lack, costs now.
    #[inline]
    #[must_use]
    pub fn cost_of(&self, robot: usize) -> i64 {
        let choices = self.ways.of(robot);
        let cost = if self.chosen[robot] == NONE { choices.unserved_cost } else { choices.ways[self.chosen[robot] as usize].cost };
        i64::from(cost)
    }

    /// Whether a robot runs empty as things stand.
    #[inline]
    #[must_use]
    pub fn is_stranded(&self, robot: usize) -> bool {
        self.chosen[robot] == NONE && self.ways.of(robot).strands
    }

    /// Gives a robot without a service the way of this index; it must fit.
    pub fn serve(&mut self, robot: usize, way: u32) {
        self.log.push((robot as u32, NONE));
        self.enter(robot, way);
    }

    /// Takes a robot's service away.
    pub fn release(&mut self, robot: usize) {
        self.log.push((robot as u32, self.chosen[robot]));
        self.strike(robot);
    }

    /// The cheapest way that fits and costs less than a limit.
    #[must_use]
    pub fn cheapest(&self, robot: usize, below: i64) -> Option<u32> {
        let choices = self.ways.of(robot);
        let cheap = choices.ways.iter().take_while(|way| i64::from(way.cost) < below);
        cheap.into_iter().position(|way| self.books[usize::from(way.station)].fits(choices, way)).map(|way| way as u32)
    }

    /// The first way before the one of this index that fits.
    #[must_use]
    pub fn first_before(&self, robot: usize, way: u32) -> Option<u32> {
        let choices = self.ways.of(robot);
        let better = &choices.ways[..way as usize];
        better.iter().position(|way| self.books[usize::from(way.station)].fits(choices, way)).map(|way| way as u32)
    }

    /// Where the log stands.
    #[must_use]
    pub fn mark(&self) -> usize {
        self.log.len()
    }

    /// Takes back everything since a mark.
    pub fn undo(&mut self, mark: usize) {
        while self.log.len() > mark {
            let Some((robot, before)) = self.log.pop() else { return };
            let robot = robot as usize;
            if before == NONE {
                self.strike(robot);
            } else {
                self.enter(robot, before);
            }
        }
    }

    /// Forgets the log: what was done stays.
    pub fn keep(&mut self) {
        self.log.clear();
    }

    /// Robots that were changed since a mark, some of them more than once.
    pub fn changed(&self, mark: usize) -> impl Iterator<Item = usize> + '_ {
        self.log[mark..].iter().map(|&(robot, _)| robot as usize)
    }

    /// Whether somebody who was promised a service lost it since a mark.
    #[must_use]
    pub fn breaks_promise(&self, mark: usize) -> bool {
        self.log[mark..].iter().any(|&(robot, before)| {
            let robot = robot as usize;
            before != NONE && self.chosen[robot] == NONE && self.ways.of(robot).held
        })
    }

    /// How many robots are without a service that they were promised.
    #[must_use]
    pub fn broken(&self) -> usize {
        broken(self.problem(), &self.chosen)
    }

    /// Makes the choice that of another draft of the same problem.
    pub fn become_choice(&mut self, chosen: &[u32]) {
        for (robot, &way) in chosen.iter().enumerate() {
            if self.chosen[robot] != way && self.chosen[robot] != NONE {
                self.strike(robot);
            }
        }
        for (robot, &way) in chosen.iter().enumerate() {
            if self.chosen[robot] != way {
                self.enter(robot, way);
            }
        }
        self.log.clear();
    }

    fn enter(&mut self, robot: usize, way: u32) {
        let choices = self.ways.of(robot);
        let taken = &choices.ways[way as usize];
        self.books[usize::from(taken.station)].take(robot, choices, taken);
        self.chosen[robot] = way;
        if choices.strands {
            self.score.stranded -= 1;
            let place = self.lost_at[robot];
            self.lost.swap_remove(place as usize);
            if let Some(&other) = self.lost.get(place as usize) {
                self.lost_at[other as usize] = place;
            }
        }
        self.score.cost += i64::from(taken.cost) - i64::from(choices.unserved_cost);
        self.score.energy += taken.energy;
    }

    fn strike(&mut self, robot: usize) {
        let choices = self.ways.of(robot);
        let taken = &choices.ways[self.chosen[robot] as usize];
        self.books[usize::from(taken.station)].give_back(robot, choices, taken);
        self.chosen[robot] = NONE;
        if choices.strands {
            self.score.stranded += 1;
            self.lost_at[robot] = self.lost.len() as u32;
            self.lost.push(robot as u32);
        }
        self.score.cost -= i64::from(taken.cost) - i64::from(choices.unserved_cost);
        self.score.energy -= taken.energy;
    }
}

/// How many robots are without a service that they were promised, by this choice.
pub(crate) fn broken(problem: &Problem, chosen: &[u32]) -> usize {
    (0..chosen.len()).filter(|&robot| problem.robots[robot].held && chosen[robot] == NONE).count()
}
