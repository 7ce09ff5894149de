//! Where a log may have begun, looked at one by one: charge and clock have valleys of their own.

use super::frame::Frame;
use super::rough::Rough;
use super::state::{State, filters, likelihood_of_log};

/// Starts of charge that are looked at, each way, and how many of them make a deviation.
const LOOKS: i32 = 12;
const LOOKS_PER_SIGMA: f64 = 4.0;
/// How closely a clock is looked at, s: about what a row lasts.
const EDGE_S: f64 = 1.0;

/// Puts the charge and the clock at the start of every log where the log is explained best, all else being as it is.
pub(super) fn look_for_starts(frame: &Frame, x: &mut [f64]) {
    look_for(frame, x, |what| matches!(what, Rough::SocInitial(_) | Rough::Clock(_)));
}

/// The same for what is asked for of it.
pub(super) fn look_for(frame: &Frame, x: &mut [f64], asked: impl Fn(Rough) -> bool) {
    let filters = filters(frame, &State::white(frame));
    for (place, known) in frame.known.iter().enumerate().filter(|(_, known)| asked(known.what)) {
        let Some(log) = known.log() else { continue };
        let cost = |shift: f64| {
            let mut tried = x.to_vec();
            tried[frame.free.len() + place] = shift * known.sigma;
            shift * shift + likelihood_of_log(frame, &frame.residual_of(log, &tried), &filters, log)
        };
        let look = |shift: f64| (shift, cost(shift));
        let less = |a: &(f64, f64), b: &(f64, f64)| a.1.total_cmp(&b.1);
        let looks = (-LOOKS..=LOOKS).map(|place| look(f64::from(place) / LOOKS_PER_SIGMA));
        let Some(mut best) = looks.min_by(less) else { continue };
        if matches!(known.what, Rough::Clock(_)) {
            // A switch has edges: derivatives see them from a row away only.
            let mut step = LOOKS_PER_SIGMA.recip();
            while step * known.sigma > EDGE_S {
                step /= 2.0;
                best = [best, look(best.0 - step), look(best.0 + step)].into_iter().min_by(less).unwrap_or(best);
            }
        }
        x[frame.free.len() + place] = best.0 * known.sigma;
    }
}
