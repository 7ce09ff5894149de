//! How a large fleet is searched: in two halves of its stations, and among few ways of each robot.

use super::{Run, heat};
use crate::draft::NONE;
use crate::guide::Guide;
use crate::halves::Halves;
use crate::prices::Prices;
use crate::search::Search;

/// Share of the budget in which nothing counts but how few are stranded, where every robot has had so many moves by then: the search
/// that follows strands fewer too. With 1,000 robots the gap is then 0.17 points less and one more is stranded (24 fleets, as many moves),
/// which a hotter beginning makes good; 10,000 need more.
pub(super) const STRAND_SHARE: f64 = 0.15;
/// See [`STRAND_SHARE`].
pub(super) const STRAND_MOVES: u64 = 160;
/// Moves for each robot in a half of a large fleet, until it is halved otherwise. One, two and four led to the same gap; with four
/// threads wait for each other least often.
const MOVES_IN_HALF: u64 = 4;
/// So often a large fleet is halved for each round of prices while prices do not guide. Where they do, every halving has its round: with one
/// of two the gap was 0.1 points higher after nearly the same time (four fleets), with one of three 0.4 (five fleets).
const UNPRICED: u64 = 2;
/// So many ways of each robot are searched. What plans end with costs at most some 16 units more at the prices than what a robot would
/// rather have, and so do some 80 ways of each of 400 robots. Those few lie together in memory, which 400 of each do not.
const FEW: usize = 96;
/// So often a large fleet is halved until the few are others.
const HALVED: u64 = 20;

impl<'w, 'p> Run<'w, 'p, '_> {
    /// Searches both halves of the stations, and betters prices now and then: their bound soon rises slowly.
    pub(super) fn search_halves(&mut self, search: &mut Search<'_, '_>, guide: &Guide, heat: f64, prices: &mut Prices<'w, 'p>, aim: i64) {
        self.halve(search, guide, heat);
        if self.rounds.is_multiple_of(UNPRICED) {
            prices.improve(aim);
        }
    }

    /// Searches among the ways that are most promising at the prices, each robot's own and that of the best plan among them.
    pub(super) fn search_few(&mut self, search: &mut Search<'w, 'p>, prices: &mut Prices<'w, 'p>, heats: [f64; 2], start: f64) {
        let mut kept = prices.promising(FEW);
        for (robot, kept) in kept.iter_mut().enumerate() {
            kept.extend([search.draft.chosen[robot], search.best[robot]].into_iter().filter(|&way| way != NONE));
            kept.sort_unstable();
            kept.dedup();
        }
        let few = self.ways.only(|robot| kept[robot].clone());
        let mut among = search.among_few(&few, &kept);
        let mut guide = prices.guide_among(&few);
        for _ in 0..HALVED {
            let at = self.used();
            if at >= 1.0 {
                break;
            }
            self.halve(&mut among, &guide, heat(heats, (at - start) / (1.0 - start)));
            prices.cap_stranded(among.best_score.stranded);
            prices.improve(among.best_score.cost);
            guide = prices.guide_among(&few);
        }
        search.go_on_with(&among, &kept);
    }

    fn halve(&mut self, search: &mut Search<'_, '_>, guide: &Guide, heat: f64) {
        let moves = self.ways.problem().robots.len() as u64 * MOVES_IN_HALF;
        self.halves.get_or_init(|| Halves::new(self.ways)).run(search, guide, &mut self.rng, moves, heat);
        self.rounds += 1;
        self.clock.moves += 2 * moves;
    }
}
