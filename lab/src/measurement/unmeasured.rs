//! Times over which nothing says what flowed: a logger that stopped, or a current that was not read.
//!
//! The row after such a gap knows its own interval. What passed before it is only as well known as the current of this log is
//! at any time, and what a battery shows afterwards tells more of it: its charge, and by the slow part of its voltage when it
//! flowed. So a gap is cut into pieces, the shorter the nearer to its end, each with a mean current of its own.

use super::times::{GAP, accidents, after_gaps, usual_step_s};

/// Steps of more than so many usual ones tell too little of a current that changes: a cell that answers within as long shows it.
const SHORT: f64 = 3.0;
/// A current that is another after such a step than before has changed by this share of its range.
const CHANGED: f64 = 0.02;
/// Most pieces that a log's gaps are cut into: each is one more number to ask for. Where they are more, all gaps are cut into fewer, and
/// the longest come first.
const PIECES_MAX: usize = 96;
/// Most pieces of one gap: of six halvings the last is 3 % of it.
const HALVINGS: usize = 6;

/// A piece of a gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unmeasured {
    /// Where it begins, s.
    pub from_s: f64,
    /// Where it ends, s.
    pub to_s: f64,
    /// Which of the log's gaps it is of.
    pub gap: usize,
    /// Deviation of its mean current from what the row after the gap says, A: that of the log's current from it at all times, RMS.
    pub current_sigma_a: f64,
}

/// The pieces of the gaps of a log's current, in order, and of how many gaps; `unknown` says that what is long is a gap, however often it comes.
#[must_use]
pub(super) fn unmeasured(time_s: &[f64], current_a: &[f64], unknown: bool) -> (Vec<Unmeasured>, usize) {
    let known: Vec<usize> = (0..time_s.len()).filter(|&row| row == 0 || !current_a[row].is_nan()).collect();
    let known_s: Vec<f64> = known.iter().map(|&row| time_s[row]).collect();
    let usual_s = usual_step_s(&known_s);
    let gaps = gaps(&known, &known_s, current_a, unknown);
    let cut = |halvings: usize| -> Vec<(usize, Vec<f64>)> {
        gaps.iter().map(|&place| (place, cuts(known_s[place - 1], known_s[place] - usual_s, usual_s, halvings))).collect()
    };
    let pieces = |cut: &[(usize, Vec<f64>)]| cut.iter().map(|(_, cuts)| cuts.len() - 1).sum::<usize>();
    let mut cut = (1..=HALVINGS).rev().map(cut).find(|cut| pieces(cut) <= PIECES_MAX).unwrap_or_else(|| {
        let mut longest_first = cut(1);
        let length_s = |cuts: &[f64]| cuts[cuts.len() - 1] - cuts[0];
        longest_first.sort_by(|(_, a), (_, b)| length_s(b).total_cmp(&length_s(a)));
        longest_first.truncate(PIECES_MAX);
        longest_first
    });
    cut.sort_by_key(|(place, _)| *place);
    let of_gap = |(gap, (place, cuts)): (usize, (usize, Vec<f64>))| {
        let current_sigma_a = apart(&known, &known_s, current_a, &gaps, current_a[known[place]]);
        cuts.windows(2).map(|pair| Unmeasured { from_s: pair[0], to_s: pair[1], gap, current_sigma_a }).collect::<Vec<_>>()
    };
    (cut.into_iter().enumerate().flat_map(of_gap).collect(), gaps.len())
}

/// Places among the known rows that end a gap, ascending: long steps that are accidents, or are said to be, and shorter ones over which the current changed.
fn gaps(known: &[usize], known_s: &[f64], current_a: &[f64], unknown: bool) -> Vec<usize> {
    let long = if unknown { after_gaps(known_s, GAP) } else { accidents(known_s, GAP) };
    let current = |place: usize| current_a[known[place]];
    let (low, high) = (1..known.len()).map(current).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), a| (low.min(a), high.max(a)));
    let changes = |place: &usize| (current(*place) - current(place - 1)).abs() > CHANGED * (high - low);
    let short = accidents(known_s, SHORT).into_iter().filter(|place| long.binary_search(place).is_err() && changes(place));
    let mut all: Vec<usize> = long.iter().copied().chain(short).collect();
    all.sort_unstable();
    all
}

/// What is to be said about them.
pub(super) fn asked_for(pieces: &[Unmeasured], gaps: usize) -> Option<String> {
    let asked = pieces.last()?.gap + 1;
    let [of, them] = if asked == 1 { ["a gap", "it"] } else { ["gaps", "them"] };
    let others = if asked < gaps {
        format!("; of {gaps} gaps these are the longest {asked}, the others go by the row after them")
    } else {
        String::new()
    };
    Some(format!(
        "diagnose, discover and add ask the voltage after {of} of current_a what flowed in {them}{others}; compare and fit go by the row after {them}, \
         and ocv counts nothing across {them}. \
         Where that row tells of all of {of}, as of a battery that was stored, say gap_current = \"stated\" beside the log, or --gap-current"
    ))
}

/// What is to be said about long steps that come so often that they are taken for the logger's way.
pub(super) fn could_be_asked_for(time_s: &[f64]) -> Option<String> {
    let habit = accidents(time_s, GAP).is_empty() && !after_gaps(time_s, GAP).is_empty();
    habit.then(|| {
        "where nobody knows what flowed over the long steps, say gap_current = \"unknown\" beside the log, or --gap-current: then the voltage \
         after them is asked"
            .to_owned()
    })
}

/// Where the pieces of a gap begin and end: half of what is left each time, until that is short.
fn cuts(from_s: f64, to_s: f64, usual_s: f64, halvings: usize) -> Vec<f64> {
    let mut cuts = vec![from_s];
    let mut at_s = from_s;
    while cuts.len() < halvings && to_s - at_s > SHORT * usual_s {
        at_s = at_s.midpoint(to_s);
        cuts.push(at_s);
    }
    cuts.push(to_s);
    cuts
}

/// RMS of a log's current about a value, where it is known, by time; `gaps` are the places that end one, ascending.
fn apart(known: &[usize], known_s: &[f64], current_a: &[f64], gaps: &[usize], about_a: f64) -> f64 {
    let (mut squares, mut whole_s) = (0.0, 0.0);
    for place in (1..known.len()).filter(|place| gaps.binary_search(place).is_err()) {
        let lasts_s = known_s[place] - known_s[place - 1];
        squares += lasts_s * (current_a[known[place]] - about_a).powi(2);
        whole_s += lasts_s;
    }
    if whole_s > 0.0 { (squares / whole_s).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_cut_into_halves_and_ends_where_the_next_row_begins() {
        let time_s: Vec<f64> = (0..100).chain(180..280).map(f64::from).collect();
        let current_a: Vec<f64> = time_s.iter().map(|&at_s| if at_s < 100.0 { 2.0 } else { 0.0 }).collect();
        let (pieces, gaps) = unmeasured(&time_s, &current_a, false);
        assert_eq!(gaps, 1);
        let bounds: Vec<(f64, f64)> = pieces.iter().map(|piece| (piece.from_s, piece.to_s)).collect();
        assert_eq!(bounds, [(99.0, 139.0), (139.0, 159.0), (159.0, 169.0), (169.0, 174.0), (174.0, 176.5), (176.5, 179.0)]);
        // 99 s at 2 A from what follows, 99 s at none.
        assert!(pieces.iter().all(|piece| piece.gap == 0 && (piece.current_sigma_a - 2.0_f64.sqrt()).abs() < 1e-12), "{pieces:?}");
    }

    #[test]
    fn a_current_that_was_not_read_is_a_gap_as_well() {
        let time_s: Vec<f64> = (0..200).map(f64::from).collect();
        let hole = |from: usize, to: usize| (0..200).map(move |row| if (from..to).contains(&row) { f64::NAN } else { row as f64 });
        let (pieces, _) = unmeasured(&time_s, &hole(100, 120).collect::<Vec<_>>(), false);
        assert_eq!((pieces[0].from_s, pieces[pieces.len() - 1].to_s), (99.0, 119.0));
        // This one grows by a two-hundredth of its range each second; a shorter hole counts once it has changed.
        assert_eq!(unmeasured(&time_s, &hole(100, 102).collect::<Vec<_>>(), false).0, []);
        assert_eq!(unmeasured(&time_s, &hole(100, 105).collect::<Vec<_>>(), false).0.len(), 2);
        let steady: Vec<f64> = hole(100, 105).map(|current_a| 0.0 * current_a).collect();
        assert_eq!(unmeasured(&time_s, &steady, false).0, []);
    }

    #[test]
    fn of_many_gaps_each_has_fewer_pieces_and_of_too_many_the_longest_count() {
        let with = |count: usize| {
            let mut time_s = vec![0.0];
            for row in 1..200 * (count + 1) {
                time_s.push(time_s[row - 1] + if row % 200 == 0 { 100.0 + row as f64 / 200.0 } else { 1.0 });
            }
            let (pieces, gaps) = unmeasured(&time_s, &vec![1.0; time_s.len()], false);
            assert!(gaps == count && pieces.len() <= PIECES_MAX && pieces.windows(2).all(|pair| pair[0].to_s <= pair[1].from_s));
            (pieces, gaps)
        };
        for (count, each) in [(4, 6), (16, 6), (17, 5), (40, 2), (96, 1)] {
            let (pieces, _) = with(count);
            assert_eq!(pieces.len(), count * each);
        }
        let (pieces, gaps) = with(200);
        assert!(pieces.len() == PIECES_MAX && pieces.iter().all(|piece| piece.to_s - piece.from_s > 200.0), "{pieces:?}");
        assert!(asked_for(&pieces, gaps).unwrap().contains("of 200 gaps these are the longest 96"));
    }

    /// A logger that often writes late, and says so.
    #[test]
    fn what_is_said_to_be_a_gap_is_one_however_often_it_comes() {
        let time_s: Vec<f64> = (0..400).map(|row| f64::from(row) + 100.0 * f64::from(row / 20)).collect();
        let current_a: Vec<f64> = (0..400).map(|row| f64::from(row % 7)).collect();
        assert_eq!(unmeasured(&time_s, &current_a, false), (Vec::new(), 0));
        assert_eq!(unmeasured(&time_s, &current_a, true).1, 19);
        assert!(could_be_asked_for(&time_s).is_some() && could_be_asked_for(&time_s[..20]).is_none());
    }
}
