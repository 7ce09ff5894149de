//! What is judged: the rows of every target of every log, alone or in means.

use std::sync::Arc;

use energy::{Channel, EffectSpec, Model, Parameter, Sensor, System, catalogue};

use super::course::Course;
use super::judges::Judge;
pub use super::segment::Segment;
use super::steady::{HOLDS, Steady};
use crate::measurement::usual_step_s;
use crate::prepare::Prepared;
use crate::rounding::{floor_between, seen, step_of, worth};

/// The logs, and what of them is judged.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// The logs.
    pub logs: Arc<Vec<Prepared>>,
    /// What is judged.
    pub segments: Vec<Segment>,
    /// White noise of one row by channel: the known floor of its sensor or, where a model states none, the noise that the
    /// measurements themselves show from row to row; and what the noise of measured inputs adds.
    pub floors: Vec<(Channel, f64)>,
    /// The same without what the inputs add.
    pub(super) own_floors: Vec<(Channel, f64)>,
    /// How a model walks each log to show what is judged.
    pub(super) courses: Vec<Course>,
    /// The same with a step for every row.
    pub(super) fine: Vec<Course>,
    /// The parameters of the model that the logs are held against, as they were given.
    pub(super) given: Vec<Parameter>,
    /// The same evidence row by row, where `segments` hold means of rows.
    pub whole: Option<Arc<Evidence>>,
    /// The same evidence in fewer means, walked in fewer steps: to find the way, not to judge.
    pub(super) coarse: Option<Arc<Evidence>>,
    /// Whether it is such evidence.
    pub(super) shows_the_way: bool,
    /// Logs by which what is found here is judged; see [`super::judges`].
    pub(super) judges: Arc<Vec<Judge>>,
}

/// How many rows go into a mean, and into a step of a walk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grain {
    /// Rows of a mean, as a share of those since an input jumped.
    share: f64,
    /// Rows that a mean takes at most.
    most: usize,
    /// Whether the last row before a jump is a mean of its own: a late reading shows there what comes.
    sees_ahead: bool,
    /// Steps that a mean takes at least, where it has as many rows.
    pub(super) steps: usize,
}

/// What is judged: a quarter of the rows since the jump are a mean.
const FINE: Grain = Grain { share: 0.25, most: 12, sees_ahead: true, steps: 2 };
/// Judged rows up to which there is nothing to be saved, and means of more rows would leave too few to see by.
const FEW: usize = 500;
/// What shows the way: twice as many rows as have passed since the jump, so that each mean reaches three times as far as the one before,
/// and two steps, on a parabola. On straight lines between the ends of steps the right effect looks worse than one that bends
/// where they do not.
const COARSE: Grain = Grain { share: 2.0, most: 48, sees_ahead: false, steps: 2 };
/// Change of an input, as a share of its range, after which means begin small again.
const JUMP: f64 = 0.02;

impl Evidence {
    /// Of these logs, prepared for this model, row by row. A battery model that does not say how
    /// its temperature moves is held to say that it is that of the surroundings, where both were
    /// measured.
    #[must_use]
    pub fn row_by_row(model: &Model, logs: Vec<Prepared>) -> Evidence {
        let mut segments = Vec::new();
        for (index, log) in logs.iter().enumerate() {
            let asked = model.system == System::Battery && !model.predicts_temperature();
            let wanted = log.only.is_empty() || log.only.contains(&Channel::TemperatureDegc);
            let unpredicted = if asked && wanted { both_temperatures(log) } else { None };
            let known = log.targets.iter().map(|target| (target.channel, target.observed.as_slice(), target.used.as_slice()));
            let all = vec![true; log.time_s.len()];
            for (channel, observed, used) in known.chain(unpredicted.map(|values| (Channel::TemperatureDegc, values, all.as_slice()))) {
                let rows: Vec<usize> = (1..log.time_s.len()).filter(|&row| used[row]).collect();
                let time_s: Vec<f64> = rows.iter().map(|&row| log.time_s[row]).collect();
                let observed = rows.iter().map(|&row| observed[row]).collect();
                let count = rows.len();
                segments.push(Segment {
                    log: index,
                    channel,
                    block_of: (0..count).collect(),
                    counts: vec![1.0; count],
                    worth: vec![1.0; count],
                    rows,
                    time_s,
                    observed,
                    begin: 0,
                });
            }
        }
        place(&mut segments);
        let mut own_floors: Vec<(Channel, f64)> = Vec::new();
        for segment in &segments {
            if !own_floors.iter().any(|(channel, _)| *channel == segment.channel) {
                let of_channel = segments.iter().filter(|other| other.channel == segment.channel);
                let known = model.sensor(segment.channel).floor();
                let white = if known > 0.0 { known } else { roughness(of_channel) };
                own_floors.push((segment.channel, white));
            }
        }
        for segment in &mut segments {
            let floor = own_floors.iter().find(|(channel, _)| *channel == segment.channel).map_or(0.0, |(_, floor)| *floor);
            segment.worth = worth_of_rounded(model.sensor(segment.channel), floor, &segment.observed);
        }
        let courses = || logs.iter().enumerate().map(|(index, log)| Course::row_by_row(index, log, &segments)).collect();
        let (courses, fine) = (courses(), courses());
        let mut evidence = Evidence {
            logs: Arc::new(logs),
            segments,
            floors: own_floors.clone(),
            own_floors,
            courses,
            fine,
            given: model.parameters().to_vec(),
            whole: None,
            coarse: None,
            shows_the_way: false,
            judges: Arc::default(),
        };
        evidence.floors = evidence.floors_of(&Arc::new(model.clone()), &model.values());
        evidence
    }

    /// The same evidence with other floors, all that is made of it with it.
    #[must_use]
    pub(super) fn with_floors(&self, floors: &[(Channel, f64)]) -> Evidence {
        let with = |evidence: &Option<Arc<Evidence>>| evidence.as_ref().map(|evidence| Arc::new(evidence.with_floors(floors)));
        Evidence { floors: floors.to_vec(), whole: with(&self.whole), coarse: with(&self.coarse), ..self.clone() }
    }

    /// The same rows, walked with other inputs: those of the same logs otherwise disturbed.
    #[must_use]
    pub(super) fn with_inputs_of(&self, logs: Vec<Prepared>) -> Evidence {
        let walked = |courses: &[Course]| courses.iter().zip(&logs).map(|(course, log)| course.with_inputs_of(log)).collect();
        let (courses, fine) = (walked(&self.courses), walked(&self.fine));
        Evidence { logs: Arc::new(logs), courses, fine, whole: None, coarse: None, ..self.clone() }
    }

    /// Of these logs, prepared for this model, in means of rows: of few after a jump of an input,
    /// when much happens, and of up to a dozen later; for a model that forgets at once of up to a dozen over which the inputs hold. A mean of measurements is compared with
    /// the mean of predictions, which are walked in few steps ([`super::course`]); what a row says alone is lost.
    #[must_use]
    pub fn new(model: &Model, logs: Vec<Prepared>) -> Evidence {
        let whole = Arc::new(Evidence::row_by_row(model, logs));
        if stands_still(model) {
            // Spells over which the inputs hold are as few as they can be.
            let spells = Evidence::in_means(model, &whole, FINE, true);
            return Evidence { whole: Some(whole), ..spells };
        }
        Evidence::of_whole(model, whole)
    }

    /// The longest time that goes into a mean, s.
    pub(super) fn longest_mean_s(&self) -> f64 {
        let of = |segment: &Segment| {
            let most = segment.counts.iter().fold(0.0, |most: f64, count| most.max(*count));
            if most > 1.0 { most * usual_step_s(&self.logs[segment.log].time_s) } else { 0.0 }
        };
        self.segments.iter().map(of).fold(0.0, f64::max)
    }

    /// The same evidence for a model that will be given formulas, which may remember.
    #[must_use]
    pub(super) fn for_formulas(self: &Arc<Self>, model: &Model) -> Arc<Evidence> {
        match &self.whole {
            Some(whole) if stands_still(model) => Arc::new(Evidence::of_whole(model, Arc::clone(whole))),
            _ => Arc::clone(self),
        }
    }

    fn of_whole(model: &Model, whole: Arc<Evidence>) -> Evidence {
        let fine = Evidence::in_means(model, &whole, FINE, false);
        // Long means say nothing of delays.
        let coarse = (fine.rows() > FEW && is_prompt(model)).then(|| Evidence {
            fine: Vec::new(),
            shows_the_way: true,
            ..Evidence::in_means(model, &whole, COARSE, false)
        });
        Evidence { whole: Some(whole), coarse: coarse.map(Arc::new), ..fine }
    }

    fn in_means(model: &Model, of: &Evidence, grain: Grain, still: bool) -> Evidence {
        let logs = || of.logs.iter().enumerate();
        let steady: Vec<Steady<'_>> = of.logs.iter().map(|log| Steady::of(log, |channel| model.sensor(channel))).collect();
        let mut segments: Vec<Segment> = if still {
            of.segments.iter().map(|segment| in_spells(segment, &steady[segment.log], grain.most)).collect()
        } else {
            let jumps: Vec<Vec<bool>> = of.logs.iter().map(|log| jumps(log, model)).collect();
            of.segments.iter().map(|segment| in_means(segment, &jumps[segment.log], grain)).collect()
        };
        place(&mut segments);
        let course = |((index, log), steady): ((usize, &Prepared), &Steady<'_>)| match still {
            true => Course::in_spells(index, log, &segments, steady),
            false => Course::in_means(index, log, &segments, grain.steps, steady),
        };
        let courses = logs().zip(&steady).map(course).collect();
        let fine = logs().map(|(index, log)| Course::row_by_row(index, log, &segments)).collect();
        let (whole, coarse, shows_the_way) = (None, None, false);
        Evidence { segments, courses, fine, whole, coarse, shows_the_way, ..of.clone() }
    }

    /// A parameter of a model as it was given; none where it was not there.
    pub(crate) fn given(&self, parameter: &Parameter) -> Option<&Parameter> {
        self.given.iter().find(|known| known.effect == parameter.effect && known.name == parameter.name)
    }

    /// Judged rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.segments.last().map_or(0, |segment| segment.range().end)
    }

    /// Time between two readings of a channel, on average over all logs, s.
    pub(super) fn step_s(&self, channel: Channel) -> f64 {
        let segments = || self.segments.iter().filter(|segment| segment.channel == channel);
        let length = |segment: &Segment| segment.time_s.last().zip(segment.time_s.first()).map_or(0.0, |(last, first)| last - first);
        let readings: f64 = segments().flat_map(|segment| &segment.counts).sum();
        segments().map(length).sum::<f64>() / readings.max(1.0)
    }

    /// Whether the noise of inputs counts in any floor.
    pub(super) fn noise_of_inputs_counts(&self) -> bool {
        self.floors.iter().zip(&self.own_floors).any(|((_, floor), (_, own))| floor > own)
    }

    /// White noise of a channel, in its unit.
    #[must_use]
    pub fn floor(&self, channel: Channel) -> f64 {
        self.floors.iter().find(|(known, _)| *known == channel).map_or(1.0, |(_, floor)| *floor)
    }
}

fn place(segments: &mut [Segment]) {
    let mut begin = 0;
    for segment in segments {
        segment.begin = begin;
        begin += segment.counts.len();
    }
}

/// Rows at which an input jumps: by a share of its range, and by more than its sensor's noise.
fn jumps(log: &Prepared, model: &Model) -> Vec<bool> {
    let mut jumps = vec![false; log.time_s.len()];
    // What happened in a gap ends with it.
    for piece in &log.unmeasured {
        jumps[log.time_s.partition_point(|&time_s| time_s <= piece.to_s).min(log.time_s.len() - 1)] = true;
    }
    for (channel, values) in &log.inputs {
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
        let least = (JUMP * (high - low)).max(HOLDS * model.sensor(*channel).floor());
        for row in 1..values.len() {
            jumps[row] |= (values[row] - values[row - 1]).abs() > least;
        }
    }
    jumps
}

/// Whether no sensor may be late or early.
fn is_prompt(model: &Model) -> bool {
    model.sensors.values().all(|sensor| sensor.lag_sigma_s == 0.0)
}

/// Whether what the model shows follows from the inputs of the moment alone, with every effect that it may be given, and
/// no sensor reads late.
fn stands_still(model: &Model) -> bool {
    let could_be_added = catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == model.system);
    let remembers = |spec: &EffectSpec| !spec.states.is_empty();
    let all = could_be_added.chain(model.effects().map(|effect| effect.spec()));
    model.system != System::Battery && is_prompt(model) && !all.into_iter().any(remembers)
}

/// Means of rows over which the inputs hold.
fn in_spells(segment: &Segment, steady: &Steady<'_>, most: usize) -> Segment {
    let mut first = None;
    in_blocks(segment, |place| {
        let row = segment.rows[place];
        let goes_on = first.is_some_and(|first: usize| {
            let begun = segment.rows[first];
            segment.rows[place - 1] + 1 == row && place - first < most && steady.even(row) && steady.holds(begun, row)
        });
        if !goes_on {
            first = Some(place);
        }
        !goes_on
    })
}

/// Means of rows that grow with the time since a jump.
fn in_means(segment: &Segment, jumps: &[bool], grain: Grain) -> Segment {
    let (mut since, mut room) = (0, 0);
    in_blocks(segment, |place| {
        let row = segment.rows[place];
        let apart = place == 0 || segment.rows[place - 1] + 1 != row;
        let ends = grain.sees_ahead && jumps.get(row + 1) == Some(&true);
        since = if jumps[row] || apart { 0 } else { since + 1 };
        let begins = room == 0 || since == 0 || ends;
        if begins {
            // One by one at first, then a share of the rows since the jump.
            room = if ends { 1 } else { ((since as f64 * grain.share) as usize).clamp(1, grain.most) };
        }
        room -= 1;
        begins
    })
}

/// A segment in means of rows; told of every row, one after the other, whether a mean begins there.
fn in_blocks(segment: &Segment, mut begins: impl FnMut(usize) -> bool) -> Segment {
    let mut block_of = Vec::new();
    let [mut counts, mut worth, mut time_s, mut observed] = [const { Vec::<f64>::new() }; 4];
    for place in 0..segment.rows.len() {
        if begins(place) {
            counts.push(0.0);
            worth.push(0.0);
            time_s.push(0.0);
            observed.push(0.0);
        }
        let block = counts.len() - 1;
        block_of.push(block);
        counts[block] += 1.0;
        worth[block] += segment.worth[place];
        time_s[block] += (segment.time_s[place] - time_s[block]) / counts[block];
        observed[block] += (segment.observed[place] - observed[block]) / counts[block];
    }
    Segment { block_of, counts, worth, time_s, observed, ..segment.clone() }
}

/// How many independent readings each is worth of a sensor whose noise and rounding come to that floor, by its stated step or the one that its readings
/// show.
fn worth_of_rounded(sensor: Sensor, floor: f64, readings: &[f64]) -> Vec<f64> {
    let step = if sensor.quantum > 0.0 { Some(sensor.quantum) } else { seen(step_of(readings), floor) };
    let noise = |step: f64| (floor.powi(2) - step.powi(2) / 12.0).max(0.0).sqrt();
    step.map_or_else(|| vec![1.0; readings.len()], |step| worth(readings, step, noise(step)))
}

fn both_temperatures(log: &Prepared) -> Option<&[f64]> {
    let input = |wanted| log.inputs.iter().find(|(channel, _)| *channel == wanted).map(|(_, values)| values.as_slice());
    input(Channel::AmbientDegc).and(input(Channel::TemperatureDegc))
}

/// Noise of a channel as its measurements show it from row to row, in the channel's unit, with what is rounded away: the mean
/// of its logs. Never zero, so that a likelihood exists for readings that never change.
fn roughness<'a>(segments: impl Iterator<Item = &'a Segment>) -> f64 {
    let (mut squares, mut rows, mut scale) = (0.0, 0.0, 0.0_f64);
    for segment in segments {
        let count = segment.rows.len() as f64;
        squares += count * floor_between(&segment.rows, &segment.observed).powi(2);
        rows += count;
        scale = segment.observed.iter().fold(scale, |scale, value| scale.max(value.abs()));
    }
    let noise = if rows > 0.0 { (squares / rows).sqrt() } else { 0.0 };
    noise.max(1e-6 * scale).max(f64::MIN_POSITIVE)
}
