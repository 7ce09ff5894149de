//! A large fleet is searched by two threads at a time, each in its own half of the stations.
//!
//! Both halves of a plan are searched as if the other could not change: a station of the other half is closed, and a
//! robot that stands there stays. So what they find can be put together again whatever it is. Where the halves meet
//! nothing is searched, therefore the next halves are others. How much is done in each does not depend on time, so a
//! plan still follows from seed and number of moves.

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::draft::NONE;
use crate::guide::Guide;
use crate::problem::Travel;
use crate::search::Search;
use crate::way::Ways;

/// How much the growth of a half is left to chance: the same start is not to give the same half again.
const CHANCE: f32 = 0.5;

/// Which stations share robots.
#[derive(Debug)]
pub(crate) struct Halves {
    /// For each station those that some of its robots can reach too, and how many of them.
    near: Vec<Vec<(u32, f32)>>,
}

impl Halves {
    pub(crate) fn new(ways: &Ways<'_>) -> Self {
        let problem = ways.problem();
        let mut come: Vec<Vec<&[Travel]>> = vec![Vec::new(); problem.stations.len()];
        for robot in &problem.robots {
            robot.travel.iter().for_each(|travel| come[travel.station].push(&robot.travel));
        }
        let mut robots = vec![0_u32; problem.stations.len()];
        let near = come.iter().enumerate().map(|(from, travels)| {
            travels.iter().copied().flatten().for_each(|travel| robots[travel.station] += 1);
            robots[from] = 0;
            let shared = robots.iter_mut().enumerate().filter(|(_, robots)| **robots > 0);
            shared.map(|(station, robots)| (station as u32, std::mem::take(robots) as f32)).collect()
        });
        Self { near: near.collect() }
    }

    /// Searches both halves of the search's plan with so many moves each.
    pub(crate) fn run(&self, search: &mut Search<'_, '_>, guide: &Guide, rng: &mut Pcg64Mcg, moves: u64, heat: f64) {
        let first = self.split(search, rng);
        let second: Vec<bool> = first.iter().map(|is_first| !is_first).collect();
        let robots = self.deal(search, &first, rng);
        let [ours, theirs] = [Pcg64Mcg::seed_from_u64(rng.random()), Pcg64Mcg::seed_from_u64(rng.random())];
        let half = |open: &[bool], movable: Vec<u32>, mut rng: Pcg64Mcg| {
            let mut half = Search::among(search.draft.with_open(open, &movable), movable);
            half.run(guide, &mut rng, moves, heat);
            half
        };
        let [first_robots, second_robots] = robots;
        let (one, other) = rayon::join(|| half(&first, first_robots, ours), || half(&second, second_robots, theirs));
        search.join([one, other]);
    }

    /// About half of the services, at stations that lie together: true for those of the first half.
    fn split(&self, search: &Search<'_, '_>, rng: &mut impl Rng) -> Vec<bool> {
        let books = &search.draft.books;
        let wanted = books.iter().map(|book| book.robots.len()).sum::<usize>() / 2;
        let mut first = vec![false; books.len()];
        let mut pull = vec![0.0_f32; books.len()];
        let (mut services, mut stations) = (0, 0);
        while services < wanted && stations + 1 < books.len() {
            let next = (0..books.len()).filter(|&station| !first[station]);
            let drawn = next.map(|station| (pull[station] * (1.0 - CHANCE * rng.random::<f32>()) + 1e-3 * rng.random::<f32>(), station));
            let Some((_, next)) = drawn.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            first[next] = true;
            services += books[next].robots.len();
            stations += 1;
            self.near[next].iter().for_each(|&(station, robots)| pull[station as usize] += robots);
        }
        first
    }

    /// The robots with which moves begin in each half: those that stand there, and of the others those that can.
    fn deal(&self, search: &Search<'_, '_>, first: &[bool], rng: &mut impl Rng) -> [Vec<u32>; 2] {
        let mut robots = [Vec::new(), Vec::new()];
        for &robot in search.movable() {
            let choices = search.draft.ways.of(robot as usize);
            let chosen = search.draft.chosen[robot as usize];
            let is_first = if chosen == NONE {
                let way = &choices.ways[rng.random_range(0..choices.ways.len())];
                first[usize::from(way.station)]
            } else {
                first[usize::from(choices.ways[chosen as usize].station)]
            };
            robots[usize::from(!is_first)].push(robot);
        }
        robots
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::construct::{self, Order};
    use crate::draft::Draft;
    use crate::instance::Instance;

    #[test]
    fn stations_are_as_near_as_the_robots_that_reach_both() {
        let instance = Instance::parse(include_str!("../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let reaches = |robot: &crate::problem::Robot, station: usize| robot.travel.iter().any(|travel| travel.station == station);
        let near = Halves::new(&ways).near;
        for (from, near) in near.iter().enumerate() {
            for to in (0..instance.problem.stations.len()).filter(|to| *to != from) {
                let both = instance.problem.robots.iter().filter(|robot| reaches(robot, from) && reaches(robot, to)).count();
                let told = near.iter().find(|(station, _)| *station as usize == to).map_or(0.0, |(_, robots)| *robots);
                assert_eq!(told, both as f32, "{from} and {to}");
            }
            assert!(near.iter().all(|(station, _)| *station as usize != from));
        }
    }

    #[test]
    fn what_both_halves_found_is_one_plan_with_its_score() {
        let instance = Instance::parse(include_str!("../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut draft = Draft::new(&ways);
        construct::greedy(&mut draft, &construct::ranked(&ways, Order::Deadline), 0.0);
        let first = draft.score;
        let mut search = Search::new(draft);
        let (halves, guide) = (Halves::new(&ways), Guide::by_cost(&ways, 0..instance.problem.robots.len()));
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        for _ in 0..20 {
            halves.run(&mut search, &guide, &mut rng, 100, 20.0);
            for (chosen, score) in [(&search.draft.chosen, search.draft.score), (&search.best, search.best_score)] {
                let mut anew = Draft::new(&ways);
                anew.become_choice(chosen);
                assert_eq!(anew.score, score);
            }
        }
        assert!(search.best_score < first);
    }
}
