//! Sharing robots out to few packs: as many as there is any way to, by trying all of them within a limit.

use crate::capacity::Need;

/// Ways that are looked at, at most: some 10 ms.
const LOOKS: u32 = 300_000;

/// More robots than `place` puts into bins `(station, pack, energy)`, where a search of [`LOOKS`] finds a way to; never more than `most`.
/// `at` names the bins of every station.
pub(crate) fn share_more(
    needs: &[Vec<Need>],
    bins: &[(usize, usize, i64)],
    at: &[Vec<usize>],
    place: Vec<Option<usize>>,
    most: usize,
) -> Vec<Option<usize>> {
    let least = |robot: &usize| needs[*robot].iter().map(|need| need.energy).min().unwrap_or(0);
    let mut order: Vec<usize> = (0..needs.len()).filter(|&robot| !needs[robot].is_empty()).collect();
    // Who needs most has the fewest places left at the end.
    order.sort_by_key(|robot| (std::cmp::Reverse(least(robot)), *robot));
    let least_after = (0..=order.len()).map(|from| {
        let mut rest: Vec<i64> = order[from..].iter().map(least).collect();
        rest.sort_unstable();
        rest.iter()
            .scan(0, |sum, need| {
                *sum += need;
                Some(*sum)
            })
            .collect()
    });
    let mut search = Search {
        needs,
        at,
        least_after: least_after.collect(),
        left: bins.iter().map(|&(_, _, energy)| energy).collect(),
        place: vec![None; needs.len()],
        served: place.iter().flatten().count(),
        best: place,
        order,
        most,
        looks: 0,
    };
    search.from(0, 0);
    search.best
}

struct Search<'a> {
    needs: &'a [Vec<Need>],
    at: &'a [Vec<usize>],
    order: Vec<usize>,
    /// From each place of the order on: the least energy that one, two, ... of the rest take.
    least_after: Vec<Vec<i64>>,
    left: Vec<i64>,
    place: Vec<Option<usize>>,
    /// The most that were served, and how.
    served: usize,
    best: Vec<Option<usize>>,
    most: usize,
    looks: u32,
}

impl Search<'_> {
    /// Places the robots of the order from here on, `served` having a place.
    fn from(&mut self, next: usize, served: usize) {
        if served > self.served {
            self.served = served;
            self.best.clone_from(&self.place);
        }
        self.looks += 1;
        let energy: i64 = self.left.iter().sum();
        let more = self.least_after[next].partition_point(|&sum| sum <= energy);
        if next == self.order.len() || served + more <= self.served || self.served >= self.most || self.looks > LOOKS {
            return;
        }
        let robot = self.order[next];
        let own = self.needs[robot].iter().flat_map(|need| self.at[need.station].iter().map(move |&bin| (need, bin)));
        let fits = own.filter(|&(need, bin)| self.left[bin] >= need.energy);
        let mut ways: Vec<(i64, i64, usize, usize)> =
            fits.map(|(need, bin)| (self.left[bin] - need.energy, need.energy, need.station, bin)).collect();
        // The fullest first; of bins of one station that hold as much, one will do.
        ways.sort_unstable();
        ways.dedup_by_key(|&mut (rest, energy, station, _)| (rest, energy, station));
        for (_, energy, _, bin) in ways {
            self.left[bin] -= energy;
            self.place[robot] = Some(bin);
            self.from(next + 1, served + 1);
            self.left[bin] += energy;
            self.place[robot] = None;
        }
        self.from(next + 1, served);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three packs of 30, each exactly what two robots take; greedy by size puts 10, 11 and 9 together and leaves three halves over.
    #[test]
    fn packs_that_hold_exactly_what_their_robots_take_serve_all_of_them() {
        let needs: Vec<Vec<Need>> = [21, 9, 19, 11, 20, 10].iter().map(|&energy| vec![Need { station: 0, energy }]).collect();
        let bins: Vec<(usize, usize, i64)> = (0..3).map(|pack| (0, pack, 30)).collect();
        let place = share_more(&needs, &bins, &[vec![0, 1, 2]], vec![None; 6], 6);
        let held = |bin: usize| -> i64 { (0..6).filter(|&robot| place[robot] == Some(bin)).map(|robot| needs[robot][0].energy).sum() };
        assert_eq!([0, 1, 2].map(held), [30, 30, 30]);
    }

    /// Packs of two stations that hold as much are not the same pack: who can go to one station alone needs it.
    #[test]
    fn packs_of_two_stations_that_hold_as_much_are_both_tried() {
        let of = |needs: &[(usize, i64)]| needs.iter().map(|&(station, energy)| Need { station, energy }).collect::<Vec<_>>();
        let needs = vec![of(&[(0, 6)]), of(&[(0, 5), (1, 5)]), of(&[(0, 5), (1, 5)]), of(&[(0, 9)]), of(&[(0, 7), (1, 7)])];
        let (bins, at) = ([(0, 0, 12), (0, 1, 10), (1, 0, 12)], [vec![0, 1], vec![2]]);
        // By hand: 6 and 5 of the first, 9 of the second, 7 and 5 of the other station's.
        assert_eq!(share_more(&needs, &bins, &at, vec![None; 5], 5).iter().flatten().count(), 5);
    }

    /// Nobody is put where it cannot go, and no bin gives more than it holds.
    #[test]
    fn a_robot_goes_only_to_a_station_that_it_reaches() {
        let needs =
            vec![vec![Need { station: 1, energy: 5 }], vec![Need { station: 0, energy: 6 }, Need { station: 1, energy: 4 }], vec![]];
        let bins = [(0, 0, 6), (1, 0, 5)];
        let at = [vec![0], vec![1]];
        assert_eq!(share_more(&needs, &bins, &at, vec![None; 3], 2), [Some(1), Some(0), None]);
        assert_eq!(share_more(&needs, &[(0, 0, 5), (1, 0, 5)], &at, vec![None; 3], 2).iter().flatten().count(), 1);
    }
}
