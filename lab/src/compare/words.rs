//! A comparison in words: the answer, where the error lies, what the residual looks like.

use super::{ChannelError, Verdict, Worst};
use crate::floor::FloorOpinion;
use crate::report::quantity::{digits, quantity};

/// All sentences, the answer first.
pub(super) fn words(verdict: Verdict, errors: &[ChannelError], worst: &[Worst]) -> Vec<String> {
    let mut words = vec![answer(verdict, errors)];
    if worst.is_empty() && verdict != Verdict::WithinFloor {
        words.push("No regime stands out: the squared error is spread about as the rows are.".to_owned());
    }
    words.extend(worst.iter().map(place));
    words.extend(errors.iter().filter_map(period));
    words.extend(colour(errors));
    words.extend(errors.iter().filter_map(offset));
    words.extend(of_inputs(errors));
    words.extend(errors.iter().filter_map(doubt));
    words
}

fn percent(share: f64) -> String {
    format!("{:.0} %", share * 100.0)
}

fn place(worst: &Worst) -> String {
    let found = &worst.concentration;
    let mut words = format!(
        "{} of the squared error of {} lies {}, in {} of the rows.",
        percent(found.share),
        worst.channel,
        found.words(),
        percent(found.share_of_rows)
    );
    if let Some(rest) = &worst.of_the_rest {
        words += &format!(" Of the rest, {} lies {}, in {} of its rows.", percent(rest.share), rest.words(), percent(rest.share_of_rows));
    }
    words
}

fn period(error: &ChannelError) -> Option<String> {
    let period = error.whiteness.as_ref()?.period?;
    let (share, seconds) = (percent(period.share), digits(period.period_s));
    Some(format!("{share} of the variance of {} in {} repeats every {seconds} s.", error.channel, error.log))
}

/// Which residuals are white, in one sentence for all.
fn colour(errors: &[ChannelError]) -> Option<String> {
    let known: Vec<bool> = errors.iter().filter_map(|error| Some(error.whiteness.as_ref()?.is_white())).collect();
    // A correlation that never falls below 1/e lasts longer than the log can tell.
    let coloured = errors.iter().filter_map(|error| error.whiteness.as_ref()).filter(|whiteness| !whiteness.is_white());
    let lasts = coloured.map(|whiteness| whiteness.correlation_time_s.unwrap_or(f64::INFINITY));
    let slowest = lasts.fold(0.0, f64::max);
    let lasting = |known: &str| if slowest.is_finite() { format!("{known} {} s", digits(slowest)) } else { "most of the log".to_owned() };
    let white = known.iter().filter(|white| **white).count();
    Some(match (known.len(), white) {
        (0, _) => return None,
        (1, 1) => "The residual is white about its mean: nothing in its order in time is left to explain.".to_owned(),
        (all, white) if all == white => {
            "All residuals are white about their means: nothing in their order in time is left to explain.".to_owned()
        }
        (1, _) => format!("The residual is not white: it keeps its sign for {}.", lasting("about")),
        (_, 0) => format!("No residual is white: they keep their sign for {}.", lasting("up to")),
        (all, white) => format!("{} of {all} residuals are not white: they keep their sign for {}.", all - white, lasting("up to")),
    })
}

/// Standard deviations of its mean by which a white residual must be off.
const SURELY_OFF: f64 = 4.0;
/// Share of the floor below which an offset is not worth a sentence.
const WORTH_SAYING: f64 = 0.25;

/// A mean that a white residual does not have by chance. Where the residual is not white, a mean
/// says little, and the regimes show where it comes from.
fn offset(error: &ChannelError) -> Option<String> {
    let (white, floor, size) = (error.whiteness.as_ref()?, error.floor?, error.size);
    let deviation = (size.rms.powi(2) - size.mean.powi(2)).max(0.0).sqrt() / (size.rows as f64).sqrt();
    let off = white.is_white() && size.mean.abs() > SURELY_OFF * deviation && size.mean.abs() > WORTH_SAYING * floor;
    let (channel, log, mean) = (error.channel, &error.log, quantity(size.mean, error.unit));
    off.then(|| format!("{channel} in {log} is off by {mean} on average, which its noise does not explain."))
}

/// Share of a floor's square from which on it is worth a sentence that inputs make it.
const WORTH_TELLING: f64 = 0.1;

/// Where a floor is not what the model states for the channel's sensor.
fn of_inputs(errors: &[ChannelError]) -> Option<String> {
    let most = errors.iter().max_by(|a, b| a.floor_of_inputs.total_cmp(&b.floor_of_inputs))?;
    let (floor, share) = (most.floor?, most.floor_of_inputs);
    let [own, added] = [1.0 - share, share].map(|share| quantity(floor * share.sqrt(), most.unit));
    let (channel, log, floor) = (most.channel, &most.log, quantity(floor, most.unit));
    (share > WORTH_TELLING).then(|| {
        format!(
            "The floor of {floor} of {channel} in {log} is its sensor's, {own}, with what the noise of the measured inputs adds, {added}."
        )
    })
}

/// Channels of which neighbouring rows scatter by more than the sensor floor that is stated, in sentences.
#[must_use]
pub fn floors_too_small(errors: &[ChannelError]) -> Vec<String> {
    let too_small = |error: &&ChannelError| error.floor_check.as_ref().is_some_and(|check| check.opinion == FloorOpinion::FloorTooSmall);
    errors.iter().filter(too_small).filter_map(doubt).collect()
}

/// What to doubt about a floor.
fn doubt(error: &ChannelError) -> Option<String> {
    let (check, floor) = (error.floor_check.as_ref()?, error.floor?);
    let (channel, log, floor) = (error.channel, &error.log, quantity(floor, error.unit));
    match check.opinion {
        FloorOpinion::AboveFloor | FloorOpinion::AtFloor => None,
        FloorOpinion::FloorTooLarge => Some(format!(
            "The sensor floor of {floor} stated for {channel} is too large: the whole error in {log} is {:.2} to {:.2} of it.",
            check.ratio_low, check.ratio_high
        )),
        FloorOpinion::FloorTooSmall => {
            let seen = quantity(check.noise_seen?, error.unit);
            Some(format!(
                "Neighbouring rows of {channel} in {log} scatter by {seen}: a sensor floor of {floor} looks too small, or a fast effect is missing."
            ))
        }
    }
}

fn answer(verdict: Verdict, errors: &[ChannelError]) -> String {
    let by_ratio = |a: &&ChannelError, b: &&ChannelError| a.ratio.unwrap_or(0.0).total_cmp(&b.ratio.unwrap_or(0.0));
    let describe = |error: &ChannelError| {
        let rms = quantity(error.size.rms, error.unit);
        match (error.floor, error.ratio) {
            (Some(floor), Some(ratio)) => {
                let floor = quantity(floor, error.unit);
                format!("{rms} RMS of {} in {}, {ratio:.1} x the sensor floor of {floor}", error.channel, error.log)
            }
            _ => format!("{rms} RMS of {} in {}", error.channel, error.log),
        }
    };
    match (verdict, errors.iter().max_by(by_ratio)) {
        (Verdict::WithinFloor, Some(error)) => format!("The model explains the logs: at most {}.", describe(error)),
        (Verdict::LeavesError, Some(error)) => format!("The model leaves {}.", describe(error)),
        (Verdict::FloorUnknown, _) => {
            let unknown = errors.iter().find(|error| error.ratio.is_none()).map_or("", |error| error.channel);
            format!("No verdict: the model states no sensor floor for {unknown}; add [sensor.{unknown}] sigma = ... to it.")
        }
        (_, None) => "Nothing was compared.".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::Size;
    use crate::whiteness::Whiteness;
    use crate::whiteness::tests::{seconds, uniform};

    fn error(offset: f64) -> ChannelError {
        let values: Vec<f64> = uniform(1000).into_iter().map(|noise| noise + offset).collect();
        ChannelError {
            log: "run".to_owned(),
            channel: "power_w",
            unit: "W",
            size: Size::of(values.iter().copied()),
            floor: Some(0.3),
            floor_of_inputs: 0.0,
            ratio: None,
            floor_check: None,
            whiteness: Whiteness::of(&seconds(1000), &values),
        }
    }

    #[test]
    fn an_offset_of_a_white_residual_is_said() {
        let words = words(Verdict::WithinFloor, &[error(0.2)], &[]).join(" ");
        assert!(words.contains("white about its mean") && words.contains("power_w in run is off by"), "{words}");
        assert_eq!(offset(&error(0.0)), None);
    }
}
