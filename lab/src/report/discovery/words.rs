//! What a search found, in sentences.

use crate::infer::answer::{Discovery, Rung, Verdict};
use crate::infer::candidate::Untested;
use crate::infer::judge::Refusal;
use crate::infer::judges::Unjudged;
use crate::infer::other_numbers::OtherNumber;
use crate::infer::other_starts::OtherStart;
use crate::infer::stated::Roughly;
use crate::report::quantity::{digits, quantity, unit_of, with_sigma};

use super::Reach;

/// That other starts of the logs would explain them as well; nothing where they would not.
#[must_use]
pub fn other_starts(starts: &[OtherStart]) -> Option<String> {
    let fact = starts.first()?.fact;
    let (what, places, more) = match fact {
        "ambient_degc" => ("surroundings of another temperature explain", 1, " (ambient_sigma_k says how far it may be off)"),
        _ => ("another charge at the start explains", 3, ""),
    };
    let one = |start: &OtherStart| format!("{:.places$} in place of {:.places$} in {}", start.found, start.stated, start.log);
    let all: Vec<String> = starts.iter().map(one).collect();
    Some(format!("Without any effect, {what} these logs as well ({}): is {fact} right?{more}", all.join(", ")))
}

/// Numbers told one by one; of more there is no telling which.
const NUMBERS_TOLD: usize = 4;

/// That another number of the model would explain the logs as well; nothing where none would.
#[must_use]
pub fn other_numbers(numbers: &[OtherNumber]) -> Option<String> {
    numbers.first()?;
    let one = |number: &OtherNumber| {
        // A gain that goes together with what the model leaves free is no number of its own: a thousand says enough.
        let found = match number.sigma < 0.5 * number.found.abs() {
            true => with_sigma(number.found, Some(number.sigma), ""),
            false => format!("about {}", digits(number.found)),
        };
        let share = (100.0 * number.explained).floor();
        format!("{} = {found} in place of {} ({share} %)", number.numbers.join(" and "), digits(number.stated))
    };
    let told: Vec<String> = numbers.iter().take(NUMBERS_TOLD).map(one).collect();
    let more = numbers.len().saturating_sub(NUMBERS_TOLD);
    let more = if more > 0 { format!(", or one of {more} more") } else { String::new() };
    let which = if numbers.len() > 1 { "is one of them the right one?" } else { "is it right?" };
    Some(format!(
        "Without any effect, another number explains as much of the squared error beyond the noise: {}{more}; {which}",
        told.join(", or ")
    ))
}

/// That what the model states only roughly would explain the logs as well; nothing where it would not.
#[must_use]
pub fn within_stated(numbers: &[Roughly]) -> Option<String> {
    numbers.first()?;
    let one = |number: &Roughly| {
        let (found, stated) = (with_sigma(number.found, Some(number.sigma), ""), with_sigma(number.stated, Some(number.stated_sigma), ""));
        format!("{} = {found} in place of {stated}", number.number)
    };
    let all: Vec<String> = numbers.iter().map(one).collect();
    Some(format!(
        "Without any effect, what the model states explains as much within its own deviations ({}): a number without `free = true` was taken as exact.",
        all.join(", ")
    ))
}

/// The verdict in a sentence.
#[must_use]
pub fn headline(found: &Discovery, reach: Reach) -> String {
    let selected = effects(&found.selected);
    match (found.verdict, reach, found.selected.is_empty()) {
        (Verdict::Complete, ..) => "complete. The model explains these logs.".to_owned(),
        (Verdict::Missing, Reach::OneLook, _) => {
            format!("missing: {selected}. It explains {}; `lab discover` says whether more is missing.", explained(found))
        }
        (Verdict::Missing, Reach::Whole, _) => {
            let with = if found.selected.len() > 1 { "them" } else { "it" };
            format!("missing: {selected}. With {with} the model explains {}.", explained(found))
        }
        (Verdict::Ambiguous, ..) => {
            let others = told(found);
            let others = if others.is_empty() { String::new() } else { format!("missing: {}, and ", effects(&others)) };
            let (sets, them) = (sets(found, ", nor between "), if found.equivalent_sets.len() > 1 { "each of these" } else { "them" });
            format!("{others}cannot tell between {sets}: the logs show that one of {them} is missing, and not which.")
        }
        (Verdict::Unknown, _, is_first) => {
            let begin = match is_first {
                true => "none of these. Something is missing".to_owned(),
                false => format!("missing: {}. Something is left beyond that", named(found)),
            };
            let further = if is_first { "no" } else { "no further" };
            match unasked(&found.untested) {
                None => format!("{begin}, and {further} effect of the catalogue explains it: {PROPOSE}."),
                Some(unasked) => format!(
                    "{begin}, and {further} effect that was asked explains it ({unasked}): ask again with that column, or without those logs, before {PROPOSE}."
                ),
            }
        }
    }
}

/// Effects that were not asked since no held-out log could judge them; nothing where all were asked that the logs to learn from allow.
fn unasked(untested: &[Untested]) -> Option<String> {
    let mut all: Vec<(&Unjudged, Vec<&str>)> = Vec::new();
    for (effect, unjudged) in untested.iter().filter_map(|one| Some((one.effect, one.unjudged.as_ref()?))) {
        match all.iter_mut().find(|(known, _)| *known == unjudged) {
            Some((_, ids)) => ids.push(effect),
            None => all.push((unjudged, vec![effect])),
        }
    }
    let words = |(unjudged, ids): &(&Unjudged, Vec<&str>)| {
        let was = if ids.len() == 1 { "was" } else { "were" };
        format!("{} {was} not asked: {} {}", effects(ids), unjudged.who_lacks(), unjudged.column)
    };
    let all: Vec<String> = all.iter().map(words).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// Effects of which the logs tell which it is.
fn told(found: &Discovery) -> Vec<&'static str> {
    found.selected.iter().copied().filter(|id| !found.equivalent.contains(id)).collect()
}

/// All that was found, with what the logs cannot tell as one of several.
fn named(found: &Discovery) -> String {
    let open = format!("one of {}", sets(found, ", one of "));
    let open = (!found.equivalent.is_empty()).then_some(open.as_str());
    effects(&told(found).into_iter().chain(open).collect::<Vec<_>>())
}

/// What the logs cannot tell apart, set by set.
fn sets(found: &Discovery, between: &str) -> String {
    let sets: Vec<String> = found.equivalent_sets.iter().map(|set| format!("{{{}}}", set.join(", "))).collect();
    sets.join(between)
}

/// What the logs cannot tell apart, a line for each set.
#[must_use]
pub fn alike(found: &Discovery) -> String {
    found.equivalent_sets.iter().map(|set| format!("These logs cannot tell apart: {}.\n", effects(set))).collect()
}

/// What to do when no effect explains what is left.
const PROPOSE: &str = "`lab propose` looks for a formula";

/// RMS over floor up to which nothing is left to explain.
const AT_FLOOR: f64 = 1.05;

/// How much of the error is explained at the end.
fn explained(found: &Discovery) -> String {
    if found.residual.values().all(|left| left.rms <= AT_FLOOR * left.floor) {
        let stated = found.residual.values().all(|left| !left.floor_from_rows);
        return format!("these logs down to {}", if stated { "the noise of their sensors" } else { "their noise from row to row" });
    }
    let [first, .., last] = &found.ladder[..] else { return "these logs".to_owned() };
    let beyond = |rung: &Rung, channel: &str| {
        let of_channel = rung.train_rms.get(channel).zip(rung.floor.get(channel));
        of_channel.map_or(0.0, |(rms, floor)| ((rms / floor).powi(2) - 1.0).max(0.0))
    };
    // Of another channel something else may be missing.
    let gains = first.train_rms.keys().map(|channel| (beyond(first, channel) - beyond(last, channel), channel));
    let most = gains.filter(|(gain, _)| *gain > 0.0).max_by(|(a, _), (b, _)| a.total_cmp(b));
    most.map_or_else(
        || "these logs".to_owned(),
        |(_, channel)| {
            let share = 100.0 * (1.0 - beyond(last, channel) / beyond(first, channel));
            let of = if first.train_rms.len() > 1 { format!(" of {channel}") } else { String::new() };
            format!("{share:.0} % of the squared error{of} beyond the noise of the sensors")
        },
    )
}

/// Names in a sentence.
#[must_use]
pub fn effects(ids: &[&str]) -> String {
    match ids {
        [] => "nothing".to_owned(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Why an effect is not accepted, in words.
#[must_use]
pub fn refusal(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::Evidence => "evidence too weak",
        Refusal::TooSmall => "too small to matter",
        Refusal::Training => "error hardly falls",
        Refusal::Holdout => "no help on held-out logs",
        Refusal::Range => "beyond its range",
    }
}

/// What is left of every channel, one line each.
#[must_use]
pub fn left(found: &Discovery) -> String {
    let line = |(channel, left): (&&str, &crate::infer::answer::Left)| {
        let unit = unit_of(channel);
        let (rms, floor) = (quantity(left.rms, unit), quantity(left.floor, unit));
        // Slow noise far below the sensor's own is none.
        let slow = if left.slow > 0.2 * left.floor {
            format!("; {} of it is slow, it lasts about {} s", quantity(left.slow, unit), digits(left.tau_s))
        } else {
            String::new()
        };
        let floor = match left.floor_from_rows {
            true => format!("its noise from row to row is {floor}, since the model states no sensor floor"),
            false => format!("the sensor floor is {floor}"),
        };
        format!("{channel}: {rms} RMS, {floor}{slow}\n")
    };
    found.residual.iter().map(line).collect()
}

/// Effects that these logs say nothing about, one line for each reason.
#[must_use]
pub fn untested(untested: &[Untested]) -> String {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for one in untested {
        match reasons.iter_mut().find(|(reason, _)| *reason == one.reason) {
            Some((_, ids)) => ids.push(one.effect),
            None => reasons.push((&one.reason, vec![one.effect])),
        }
    }
    let line = |(reason, ids): &(&str, Vec<&str>)| {
        let reason = if ids.len() > 1 {
            reason.replacen("needs", "need", 1).replacen("is a part of", "are parts of", 1)
        } else {
            (*reason).to_owned()
        };
        format!("{}: {reason}\n", ids.join(", "))
    };
    reasons.iter().map(line).collect()
}
