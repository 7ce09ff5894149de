//! Whether a refitted effect is accepted, and whether a model explains its logs.

use std::borrow::Cow;
use std::sync::Arc;

use energy::{Channel, Facts, System, catalogue};

use super::evidence::Evidence;
use super::look::AS_WELL;
use super::state::State;
use super::trial::{Trial, held_out};
use crate::floor::EXPLAINED;
use crate::report::quantity::unit_of;

/// Why a refitted effect is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// The evidence is too weak for the number of effects tried.
    Evidence,
    /// It is smaller than a decision would notice.
    TooSmall,
    /// It hardly lowers the error of the logs that it was fitted to.
    Training,
    /// It does not help on the held-out logs.
    Holdout,
    /// It would have to be larger than it can be.
    Range,
}

/// Fall of the information criterion that an effect must bring, were it the only one tried.
const DELTA_BIC: f64 = 10.0;
/// Share of it that a refit of the base cannot absorb, below which an effect must bring
/// [`STRONG`] times as much: what it does beyond that is small and of no simple form, and a table
/// that errs between its points does the like.
pub(super) const ABSORBED: f64 = 0.1;
pub(super) const STRONG: f64 = 3.0;
/// Share of the squared error beyond the floor that an effect must take away: 5 % of the RMS.
const FALL: f64 = 0.1;
/// Share of what effects found before explain of the squared error, up to which what such an effect explains may be what is wrong with
/// their form: 5 % of the RMS. Straight lines between seven points of a table miss 3 to 4 % of the RMS of a hyperbola or an
/// exponential, and textbook laws are seldom nearer.
const FORM: f64 = 0.05 * 0.05;
/// Deviations of one reading from which on a change of a measured channel is no small one,
/// whatever a decision would notice.
const SEEN: f64 = 2.0;

/// Share of a reading's noise below which a change of the predictions is none.
const HARDLY: f64 = 0.2;

/// The evidence that one of so many effects must bring.
pub(super) fn threshold(tried: usize) -> f64 {
    DELTA_BIC + 2.0 * (tried.max(1) as f64).ln()
}

/// What an effect is judged by.
#[derive(Debug, Clone, Copy)]
pub struct Court<'a> {
    /// Logs that no fit has seen and the base model can predict.
    pub holdout: Option<&'a Arc<Evidence>>,
    /// Number of effects that were tried.
    pub tried: usize,
    /// Squared error of every channel, in floors, before the first effect was found.
    pub begun: &'a [f64],
    /// Whether an effect counts however small it is.
    pub whatever_size: bool,
}

/// Why a refitted effect is not accepted, `before` being the base model's error on the court's held-out logs; empty when it is.
#[must_use]
pub fn refusals(base: &State, trial: &Trial, before: &[(Channel, f64)], court: Court<'_>) -> Vec<Refusal> {
    let tried = court.tried;
    // Both are judged by the logs that the model with the effect can predict.
    let holdout = trial.held.as_ref();
    let before = &*before_on(base, court.holdout, before, holdout);
    let mut all = Vec::new();
    let strong = trial.delta_bic > STRONG * threshold(tried);
    let relieves = strain(base) - strain(&trial.state) > threshold(tried);
    let evidence = &base.frame.evidence;
    // What is wrong with a form is seldom made up for altogether: where nothing is left, it was an effect.
    let of_form = is_of_form(court.begun, &squared(base), &squared(&trial.state)) && !at_floor(evidence, &trial.state.told().rms());
    if trial.delta_bic < threshold(tried) || trial.uniqueness < ABSORBED && !relieves && (of_form || !strong) {
        all.push(Refusal::Evidence);
    }
    let unit = |channel: Channel| unit_of(channel.name());
    let mut alike = evidence.floors.iter().filter(|(channel, _)| unit(*channel) == unit(trial.spec.channel));
    let unseen = trial.change < trial.spec.matters && alike.all(|(_, floor)| trial.change < SEEN * floor);
    if !court.whatever_size && (unseen || !relieves && hardly_moves(base, &trial.state)) {
        all.push(Refusal::TooSmall);
    }
    // As large as it can be it may just be enough.
    if trial.is_beyond_its_range() && !at_floor(evidence, &trial.state.told().rms()) {
        all.push(Refusal::Range);
    }
    if !all.is_empty() {
        return all;
    }
    let most = explains_most(base, &trial.state);
    // What only roughly known numbers do for the base, far from where they should be, an effect need not do better.
    let helps = |held: &Evidence, before: &[(Channel, f64)], after: &[(Channel, f64)]| {
        let does_as_well = strong && at_floor(held, before) && at_floor(held, after);
        falls(held, most, before, after) || does_as_well || relieves && squares(held, after) <= (1.0 + AS_WELL) * squares(held, before)
    };
    let trains = |base: &State, state: &State| {
        let (before, after) = (base.rms(), state.rms());
        falls(evidence, most, &before, &after) || relieves && squares(evidence, &after) <= (1.0 + AS_WELL) * squares(evidence, &before)
    };
    let holds = |before: &[(Channel, f64)], after: &[(Channel, f64)]| holdout.is_none_or(|held| helps(held, before, after));
    // Slow noise that excuses an error keeps the most likely numbers from lowering it, and the least squares are
    // bent by what else is missing: one of them must be better off for the effect.
    // The numbers told must not be worse off for it on logs that no fit has seen.
    let worse = || {
        holdout.is_some_and(|held| {
            let rises =
                |before: &[(Channel, f64)], after: &[(Channel, f64)]| squares(held, after) > (1.0 + AS_WELL) * squares(held, before);
            let after = &trial.holdout;
            rises(before, after) && (!others_stay(most, before, after) || rises(&only(most, before), &only(most, after)))
        })
    };
    let likely = || {
        let of = |state: &State| holdout.map_or_else(Vec::new, |held| held_out(state, held));
        !worse() && trains(base, &trial.state) && holds(&of(base), &of(&trial.state))
    };
    let (trains, holds) = (trains(base.told(), trial.state.told()), holds(before, &trial.holdout));
    if trains && holds && (strong || explained(base)) || likely() {
        if trial.state.is_made_of_counts(trial.spec, threshold(tried)) {
            all.push(Refusal::Evidence);
        }
        return all;
    }
    if !trains {
        all.push(Refusal::Training);
    }
    if !holds {
        all.push(Refusal::Holdout);
    }
    if all.is_empty() {
        all.push(Refusal::Evidence);
    }
    all
}

/// The error of a model on held-out logs, where that on others that it can predict is known.
pub(super) fn before_on<'a>(
    base: &State,
    of: Option<&Arc<Evidence>>,
    known: &'a [(Channel, f64)],
    wanted: Option<&Arc<Evidence>>,
) -> Cow<'a, [(Channel, f64)]> {
    match (of, wanted) {
        (Some(of), Some(wanted)) if !Arc::ptr_eq(of, wanted) => Cow::Owned(held_out(base.told(), wanted)),
        _ => Cow::Borrowed(known),
    }
}

/// Squared errors of two effects, in floors, on the held-out logs that both can predict; alike where there are none.
pub(super) fn on_the_same_logs(one: &Trial, other: &Trial) -> (f64, f64) {
    let (Some(of_one), Some(of_other)) = (&one.held, &other.held) else { return (1.0, 1.0) };
    if of_one.is_of_the_logs_of(of_other) {
        return (squares(of_one, &one.holdout), squares(of_other, &other.holdout));
    }
    let of = |trial: &Trial, held: &Arc<Evidence>| squares(held, &held_out(trial.state.told(), held));
    of_one.that_judges(&other.state.frame.model).map_or((1.0, 1.0), |both| (of(one, &both), of(other, &both)))
}

/// Whether no prediction of a measured channel moves by a fifth of what one reading can show, over all
/// rows: so little is left by tables that are straight between their points, by means of rows and by the
/// noise of inputs.
pub(super) fn hardly_moves(base: &State, other: &State) -> bool {
    let evidence = &base.frame.evidence;
    evidence.floors.iter().all(|&(channel, floor)| {
        let (mut squares, mut count) = (0.0, 0.0);
        for segment in evidence.segments.iter().filter(|segment| segment.channel == channel) {
            for (row, rows) in segment.range().zip(&segment.counts) {
                squares += rows * (base.residual[row] - other.residual[row]).powi(2);
                count += rows;
            }
        }
        squares < (HARDLY * floor).powi(2) * count
    })
}

/// How far everything that is only roughly known is from what is known of it: squares of deviations.
fn strain(state: &State) -> f64 {
    let (known, free) = (&state.frame.known, state.frame.free.len());
    known.iter().zip(&state.x[free..]).map(|(known, error)| (error / known.sigma).powi(2)).sum()
}

/// Whether every channel is at its floor.
fn at_floor(evidence: &Evidence, rms: &[(Channel, f64)]) -> bool {
    rms.iter().all(|&(channel, rms)| rms <= EXPLAINED * evidence.floor(channel))
}

/// Whether the squared error, in floors, falls by a share of what lies beyond the floors: over all channels, or that of the one that the
/// effect explains most of where no other is worse off. What else is missing from another channel, however far beyond its floor that is, says
/// nothing of the effect.
pub(super) fn falls(evidence: &Evidence, most: Option<Channel>, before: &[(Channel, f64)], after: &[(Channel, f64)]) -> bool {
    let fall = |before: &[(Channel, f64)], after: &[(Channel, f64)]| {
        let floor: f64 = before.iter().map(|&(channel, _)| rows(evidence, channel)).sum();
        let (before, after) = (squares(evidence, before), squares(evidence, after));
        before - after > (FALL * (before - floor)).max(0.0)
    };
    fall(before, after) || others_stay(most, before, after) && fall(&only(most, before), &only(most, after))
}

fn only(channel: Option<Channel>, all: &[(Channel, f64)]) -> Vec<(Channel, f64)> {
    all.iter().copied().filter(|(own, _)| Some(*own) == channel).collect()
}

/// Whether no channel but that one has an RMS that rises by more than hardly anything.
fn others_stay(most: Option<Channel>, before: &[(Channel, f64)], after: &[(Channel, f64)]) -> bool {
    let mut others = before.iter().zip(after).filter(|((channel, _), _)| Some(*channel) != most);
    others.all(|((_, before), (_, after))| *after <= (1.0 + AS_WELL) * before)
}

/// The channel of which a model explains most that another did not, in floors; none where it explains nothing.
pub(super) fn explains_most(base: &State, state: &State) -> Option<Channel> {
    let evidence = &base.frame.evidence;
    let (before, after) = (base.told().rms(), state.told().rms());
    let gains = before.iter().zip(&after).map(|(before, after)| (squares(evidence, &[*before]) - squares(evidence, &[*after]), before.0));
    gains.filter(|(gain, _)| *gain > 0.0).max_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, channel)| channel)
}

/// Squared error over all rows, in floors.
pub(super) fn squares(evidence: &Evidence, rms: &[(Channel, f64)]) -> f64 {
    rms.iter().map(|&(channel, rms)| rows(evidence, channel) * (rms / evidence.floor(channel)).powi(2)).sum()
}

/// Squared error of every channel of the logs that were fitted, in floors.
pub(super) fn squared(state: &State) -> Vec<f64> {
    let evidence = &state.frame.evidence;
    state.told().rms().iter().map(|&of_channel| squares(evidence, &[of_channel])).collect()
}

/// Whether what an effect explains, from `before` to `after`, may be what is wrong with the form of those found since `begun`, all squared errors of
/// every channel: by the channel that it explains most of. What these explain of another channel says nothing of it.
fn is_of_form(begun: &[f64], before: &[f64], after: &[f64]) -> bool {
    let of_channels = begun.iter().zip(before.iter().zip(after)).map(|(begun, (before, after))| (before - after, begun - before));
    of_channels.max_by(|(one, _), (other, _)| one.total_cmp(other)).is_some_and(|(gain, explained)| gain < FORM * explained)
}

fn rows(evidence: &Evidence, channel: Channel) -> f64 {
    evidence.segments.iter().filter(|segment| segment.channel == channel).map(|segment| segment.rows.len()).sum::<usize>() as f64
}

/// Whether what is left of every channel is the sensors' noise, or less beyond it than the
/// smallest effect on such a channel that matters.
#[must_use]
pub fn explained(state: &State) -> bool {
    at_most(state, |_| 1.0)
}

/// The same, where what is left of a pack's voltage counts by the cell: what matters does so in every one. A search goes on as long as there
/// is anything to be found; at its end so little is no sign that something is missing.
#[must_use]
pub fn leaves_little(state: &State) -> bool {
    let model = &state.frame.model;
    at_most(state, |channel| match (&model.facts, channel) {
        (Facts::Battery(battery), Channel::VoltageV) => f64::from(battery.series),
        _ => 1.0,
    })
}

/// How many independent readings of a channel there are.
fn readings(evidence: &Evidence, channel: Channel) -> f64 {
    let own = evidence.segments.iter().filter(|segment| segment.channel == channel);
    own.flat_map(|segment| &segment.worth).sum::<f64>().max(1.0)
}

/// Deviations of chance by which an RMS may be above the floor of the right model.
const CHANCE: f64 = 2.0;

/// Whether every channel is at its floor, or leaves less beyond it than so many times what matters.
fn at_most(state: &State, times: impl Fn(Channel) -> f64) -> bool {
    state.rms().iter().all(|&(channel, rms)| {
        let floor = state.frame.evidence.floor(channel);
        let beyond = (rms * rms - floor * floor).max(0.0).sqrt();
        // The RMS of n readings is off by 1 / sqrt(2 n) of itself by chance: of rounded ones that stay for long there are few.
        let chance = 1.0 + CHANCE / (2.0 * readings(&state.frame.evidence, channel)).sqrt();
        rms <= EXPLAINED.max(chance) * floor || beyond < times(channel) * matters(state.frame.model.system, channel)
    })
}

/// Half of the smallest effect that matters on channels of this one's unit.
fn matters(system: System, channel: Channel) -> f64 {
    let specs = catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == system);
    let alike = specs.filter(|spec| unit_of(spec.channel.name()) == unit_of(channel.name()));
    0.5 * alike.map(|spec| spec.matters).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_else_is_missing_from_another_channel_says_nothing_of_an_effect() {
        let (volts, degc) = (Channel::VoltageV, Channel::TemperatureDegc);
        let stays = |most, before: [f64; 2], after: [f64; 2]| {
            let both = |rms: [f64; 2]| [(volts, rms[0]), (degc, rms[1])];
            others_stay(most, &both(before), &both(after))
        };
        // The temperature is 55 floors off, and by hardly anything more.
        assert!(stays(Some(volts), [3.4e-3, 2.74], [1.0e-3, 2.76]));
        assert!(!stays(Some(volts), [3.4e-3, 2.74], [1.0e-3, 2.80]) && !stays(Some(degc), [3.4e-3, 2.74], [3.6e-3, 1.0]));
        assert!(!stays(None, [3.4e-3, 2.74], [3.6e-3, 2.74]));
    }

    #[test]
    fn what_is_wrong_with_a_form_is_small_beside_what_was_explained_of_the_same_channel() {
        // Of one channel: up to a four hundredth.
        assert!(is_of_form(&[1e6], &[5e4], &[4.8e4]) && !is_of_form(&[1e6], &[5e4], &[4.7e4]));
        // A temperature that nothing followed was explained to a five hundredth, and the voltage to a half: two fifths of what is left of that are no
        // matter of form, though they are small beside what was explained of the temperature.
        let (begun, before) = ([2.4e7, 1e5], [5e4, 5e4]);
        assert!(!is_of_form(&begun, &before, &[5e4, 3e4]));
        assert!(is_of_form(&begun, &before, &[3e4, 5e4]), "of the temperature itself they are");
        // Nothing was found yet.
        assert!(!is_of_form(&before, &before, &[5e4, 4.99e4]) && !is_of_form(&[], &before, &[5e4, 3e4]));
    }
}
