//! Times over which nothing says what flowed: a logger that stopped, or a current that was not read.
//!
//! The row after such a gap knows its own interval. What passed before it is only as well known as the current of this log is
//! at any time, and what a battery shows afterwards tells more of it: its charge, and by the slow part of its voltage when it
//! flowed. So a gap is cut into pieces, the shorter the nearer to its end, each with a mean current of its own.

use super::times::{GAP, accidents, usual_step_s};

/// Most pieces that a log's gaps are cut into; the longest gaps come first.
const PIECES_MAX: usize = 24;
/// Most pieces of one gap: of six halvings the last is 2 % of it.
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

/// The pieces of all gaps of a log's current, in order.
#[must_use]
pub(super) fn unmeasured(time_s: &[f64], current_a: &[f64]) -> Vec<Unmeasured> {
    let known: Vec<usize> = (0..time_s.len()).filter(|&row| row == 0 || !current_a[row].is_nan()).collect();
    let known_s: Vec<f64> = known.iter().map(|&row| time_s[row]).collect();
    let usual_s = usual_step_s(&known_s);
    let gaps = accidents(&known_s);
    let mut longest_first: Vec<(usize, Vec<f64>)> =
        gaps.iter().map(|&place| (place, cuts(known_s[place - 1], known_s[place] - usual_s, usual_s))).collect();
    let length_s = |cuts: &[f64]| cuts[cuts.len() - 1] - cuts[0];
    longest_first.sort_by(|(_, a), (_, b)| length_s(b).total_cmp(&length_s(a)));
    let mut pieces = 0;
    let fits = |(_, cuts): &(usize, Vec<f64>)| {
        pieces += cuts.len() - 1;
        pieces <= PIECES_MAX
    };
    let mut cut: Vec<(usize, Vec<f64>)> = longest_first.into_iter().take_while(fits).collect();
    cut.sort_by_key(|(place, _)| *place);
    let of_gap = |(gap, (place, cuts)): (usize, (usize, Vec<f64>))| {
        let current_sigma_a = apart(&known, &known_s, current_a, &gaps, current_a[known[place]]);
        cuts.windows(2).map(|pair| Unmeasured { from_s: pair[0], to_s: pair[1], gap, current_sigma_a }).collect::<Vec<_>>()
    };
    cut.into_iter().enumerate().flat_map(of_gap).collect()
}

/// What is to be said about them.
pub(super) fn asked_for(pieces: &[Unmeasured]) -> Option<String> {
    let gaps = pieces.last()?.gap + 1;
    let [of, them] = if gaps == 1 { ["a gap", "it"] } else { ["gaps", "them"] };
    Some(format!(
        "what flowed in {of} of current_a is asked of the voltage after {them} where effects are looked for; compare and fit go by the row after {them}. \
         Where that row tells of all of {of}, as of a battery that was stored, say gap_current = \"stated\" beside the log, or --gap-current"
    ))
}

/// Where the pieces of a gap begin and end: half of what is left each time, until that is short.
fn cuts(from_s: f64, to_s: f64, usual_s: f64) -> Vec<f64> {
    let mut cuts = vec![from_s];
    let mut at_s = from_s;
    while cuts.len() < HALVINGS && to_s - at_s > GAP * usual_s {
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
        let pieces = unmeasured(&time_s, &current_a);
        let bounds: Vec<(f64, f64)> = pieces.iter().map(|piece| (piece.from_s, piece.to_s)).collect();
        assert_eq!(bounds, [(99.0, 139.0), (139.0, 159.0), (159.0, 169.0), (169.0, 179.0)]);
        // 99 s at 2 A from what follows, 99 s at none.
        assert!(pieces.iter().all(|piece| piece.gap == 0 && (piece.current_sigma_a - 2.0_f64.sqrt()).abs() < 1e-12), "{pieces:?}");
    }

    #[test]
    fn a_current_that_was_not_read_is_a_gap_as_well() {
        let time_s: Vec<f64> = (0..200).map(f64::from).collect();
        let hole = |from: usize, to: usize| (0..200).map(move |row| if (from..to).contains(&row) { f64::NAN } else { row as f64 });
        let pieces = unmeasured(&time_s, &hole(100, 120).collect::<Vec<_>>());
        assert_eq!((pieces[0].from_s, pieces[pieces.len() - 1].to_s), (99.0, 119.0));
        assert_eq!(unmeasured(&time_s, &hole(100, 105).collect::<Vec<_>>()), []);
    }

    #[test]
    fn of_many_gaps_the_longest_count() {
        let mut time_s = vec![0.0];
        for row in 1..5000 {
            time_s.push(time_s[row - 1] + if row % 200 == 0 { 20.0 + row as f64 } else { 1.0 });
        }
        let pieces = unmeasured(&time_s, &vec![1.0; time_s.len()]);
        assert!(pieces.len() <= PIECES_MAX && pieces[0].from_s > time_s[2000], "{pieces:?}");
        assert_eq!(pieces.iter().map(|piece| piece.gap).max(), Some(pieces.len() / HALVINGS - 1));
        assert!(pieces.windows(2).all(|pair| pair[0].to_s <= pair[1].from_s));
    }
}
