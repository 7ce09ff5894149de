//! One move: a robot is given a way, whoever stands in it is released, and these are found new places.

use std::cell::Cell;

use rand::{Rng, RngExt};

use crate::draft::{NONE, Score};
use crate::guide::{Guide, Spot};
use crate::search::Search;

/// Robots that one move may release for the sake of others.
const RELEASED_MAX: usize = 8;
/// Robots that one move may force in after the first, for the sake of not being stranded.
const FORCED_MAX: usize = 2;
/// How often it does, rather than leave the robot stranded.
const FORCED_SHARE: f32 = 0.3;
/// The same when the move is for somebody who is stranded.
const RESCUE_SHARE: f32 = 0.75;
/// One wish of so many is for any way at all, in a small and in a large fleet: lists by price forget what rarely pays, but what they
/// name first is soon what matters among 1,000 robots. With 64 in place of 16 their gap was 0.2 points less (eight fleets).
const ANY_OF: [u32; 2] = [16, 64];
/// How often a place is the first free one by prices, and not the cheapest. More often in a large fleet: where half of the places were
/// the cheapest, and wishes were spread as in a small one, the gap was 0.3 points more (twelve fleets).
const BY_PRICE_SHARE: [f32; 2] = [0.5, 0.95];
/// So few ways are looked at one by one, which finds the same: a tenth to a sixth of the time of 1,000 robots that have 96 each.
const SCANNED_MAX: usize = 160;

/// What a plan may come to that is accepted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Most {
    pub(super) stranded: i64,
    /// As long as no fewer are stranded.
    pub(super) cost: i64,
}

impl Most {
    fn is_exceeded(self, stranded: i64, cost: i64) -> bool {
        stranded > self.stranded || (stranded == self.stranded && cost > self.cost)
    }
}

impl Search<'_, '_> {
    /// Gives a robot one of its promising ways and finds new places for those in the way.
    pub(super) fn force(&mut self, guide: &Guide, rng: &mut impl Rng, before: Score, margin: i64) -> bool {
        let first = self.pick(guide, rng);
        self.give(guide, rng, Most { stranded: before.stranded, cost: before.cost + margin }, first, None)
    }

    /// Gives a robot this way, or one of its promising ones, and finds new places for those in the way.
    pub(super) fn give(&mut self, guide: &Guide, rng: &mut impl Rng, most: Most, first: usize, way: Option<u32>) -> bool {
        let (mut queue, mut settled) = (std::mem::take(&mut self.queue), std::mem::take(&mut self.settled));
        queue.clear();
        settled.clear();
        queue.push(first);
        let done = self.place_all(guide, rng, most, way, [&mut queue, &mut settled]);
        (self.queue, self.settled) = (queue, settled);
        done
    }

    /// Gives the one robot that waits another way, and places to all who then wait.
    fn place_all(
        &mut self,
        guide: &Guide,
        rng: &mut impl Rng,
        most: Most,
        asked: Option<u32>,
        [queue, settled]: [&mut Vec<usize>; 2],
    ) -> bool {
        let first = queue[0];
        // For somebody who would be stranded more is turned upside down.
        let forced_share = if self.draft.is_stranded(first) { RESCUE_SHARE } else { FORCED_SHARE };
        let (mut released, mut forced) = (0, 0);
        while let Some(robot) = queue.pop() {
            // Whoever still waits may at best get its cheapest way; what is too dear even then is given up.
            let (hope, rescued) = self.hopes(queue);
            let room = most.cost - (self.draft.score.cost - hope);
            let stranded = self.draft.score.stranded - rescued - i64::from(self.draft.is_stranded(robot));
            if most.is_exceeded(stranded, self.draft.score.cost - hope - self.hope(robot)) {
                return false;
            }
            let must = robot == first && settled.is_empty();
            let found = if must {
                None
            } else {
                let limit = if stranded < most.stranded { i64::MAX } else { room.saturating_add(self.draft.cost_of(robot)).max(0) };
                self.place(guide, rng, robot, limit)
            };
            if let Some(way) = found {
                self.draft.serve(robot, way);
            } else if must || (self.draft.ways.of(robot).strands && forced < FORCED_MAX && rng.random::<f32>() < forced_share) {
                forced += usize::from(!must);
                let Some(way) = asked.filter(|_| must).or_else(|| self.wish(guide, rng, robot)) else { return false };
                if self.draft.chosen[robot] != NONE {
                    self.draft.release(robot);
                }
                if !self.clear(rng, most, (robot, way), [queue, settled], &mut released) {
                    return false;
                }
                self.draft.serve(robot, way);
            }
            settled.push(robot);
        }
        true
    }

    /// How far the cost, and the number of stranded robots, can fall at most if all of these are served.
    fn hopes(&self, robots: &[usize]) -> (i64, i64) {
        let hope = robots.iter().map(|&robot| self.hope(robot)).sum();
        (hope, robots.iter().filter(|&&robot| self.draft.is_stranded(robot)).count() as i64)
    }

    /// How much the cost can fall at most by giving a robot its cheapest way.
    fn hope(&self, robot: usize) -> i64 {
        let choices = self.draft.ways.of(robot);
        choices.ways.first().map_or(0, |way| (self.draft.cost_of(robot) - i64::from(way.cost)).max(0))
    }

    /// One of a robot's promising ways that it does not have.
    fn wish(&self, guide: &Guide, rng: &mut impl Rng, robot: usize) -> Option<u32> {
        let listed = &guide.listed[robot];
        if listed.is_empty() {
            return None;
        }
        if rng.random_range(0..ANY_OF[self.size()]) == 0 {
            let way = rng.random_range(0..self.draft.ways.of(robot).ways.len()) as u32;
            return self.may_have(robot, way).then_some(way);
        }
        // Mostly from the top of the list: the square of a uniform number is small more often, and the cube even more.
        let place = rng.random::<f32>().powi(2 + self.size() as i32);
        let way = listed[((place * listed.len() as f32) as usize).min(listed.len() - 1)];
        self.may_have(robot, way).then_some(way)
    }

    /// Whether a robot does not have a way, and its station is open.
    pub(super) fn may_have(&self, robot: usize, way: u32) -> bool {
        let station = self.draft.ways.of(robot).ways[way as usize].station;
        way != self.draft.chosen[robot] && !self.draft.books[usize::from(station)].is_closed()
    }

    /// A free place: the cheapest for the robot, or the first by prices.
    fn place(&self, guide: &Guide, rng: &mut impl Rng, robot: usize, limit: i64) -> Option<u32> {
        let choices = self.draft.ways.of(robot);
        let limit = if choices.strands { limit } else { limit.min(i64::from(choices.unserved_cost) - 1) };
        if rng.random::<f32>() < BY_PRICE_SHARE[self.size()] {
            if let Some(spots) = guide.spots(robot) {
                let fits = |spot: &&Spot| {
                    let book = &self.draft.books[usize::from(spot.station)];
                    i64::from(spot.cost) <= limit
                        && book.has_place(choices, spot)
                        && book.feeds_in_place(choices, &choices.ways[spot.way as usize])
                };
                return spots.iter().find(fits).map(|spot| spot.way);
            }
            let fits = |&way: &u32| {
                let way = &choices.ways[way as usize];
                i64::from(way.cost) <= limit && self.draft.books[usize::from(way.station)].fits(choices, way)
            };
            if let Some(place) = guide.listed[robot].iter().copied().find(fits) {
                return Some(place);
            }
        }
        if choices.ways.len() <= SCANNED_MAX {
            return self.draft.cheapest(robot, limit.saturating_add(1));
        }
        // Ways stand by cost, so the least place of those that fit is the cheapest.
        let starts = choices.starts(self.draft.problem().horizon);
        let (least, mut limit) = (Cell::new(NONE), limit);
        for at in starts.at() {
            if i64::from(at.least) > limit {
                break;
            }
            let book = &self.draft.books[usize::from(at.station)];
            book.tell_places(starts, at, limit, &mut |place| {
                if place < least.get() && book.feeds_in_place(choices, &choices.ways[place as usize]) {
                    least.set(place);
                }
            });
            if let Some(way) = choices.ways.get(least.get() as usize) {
                limit = i64::from(way.cost);
            }
        }
        Some(least.get()).filter(|&place| place != NONE)
    }

    /// Releases robots until a way is free.
    fn clear(
        &mut self,
        rng: &mut impl Rng,
        most: Most,
        (robot, way): (usize, u32),
        [queue, settled]: [&mut Vec<usize>; 2],
        released: &mut usize,
    ) -> bool {
        let choices = self.draft.ways.of(robot);
        let way = &choices.ways[way as usize];
        let station = usize::from(way.station);
        while let Some(clash) = self.draft.books[station].clash(choices, way) {
            let book = &self.draft.books[station];
            let mut victim = None;
            let mut seen = 0;
            for (&other, taken) in book.robots.iter().zip(&book.taken) {
                let other = other as usize;
                if book.takes_part(clash, taken) && !settled.contains(&other) {
                    seen += 1;
                    if rng.random_range(0..seen) == 0 {
                        victim = Some(other);
                    }
                }
            }
            let Some(victim) = victim else { return false };
            *released += 1;
            if *released > RELEASED_MAX {
                return false;
            }
            self.draft.release(victim);
            queue.push(victim);
        }
        // The others will be asked for their hopes when their turn comes; what cannot come to anything is not even booked.
        let (hope, rescued) = self.hopes(queue);
        let (saved, served) = (self.draft.cost_of(robot) - i64::from(way.cost), i64::from(self.draft.is_stranded(robot)));
        !most.is_exceeded(self.draft.score.stranded - rescued - served, self.draft.score.cost - hope - saved)
    }
}
