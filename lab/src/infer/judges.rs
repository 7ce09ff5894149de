//! Which held-out logs can judge what: those that hold every input that a model needs.
//!
//! An effect may need a column that some of the held-out logs lack. The others judge it, and the model without it by the same
//! logs. Where none of them has the column, nobody could say whether it helps: then it is not asked.

use std::sync::Arc;

use energy::{Channel, Model};

use super::course::Course;
use super::evidence::Evidence;
use super::segment::Segment;
use crate::prepare::{Prepared, needed_inputs};
use crate::report::discovery::effects as names;

/// A log by which what is found is judged.
#[derive(Debug, Clone)]
pub(super) struct Judge {
    name: String,
    inputs: Vec<Channel>,
}

/// What keeps an effect from being asked: the column that it needs, and the held-out logs that lack it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Unjudged {
    /// The column.
    pub column: &'static str,
    /// The logs.
    pub logs: Vec<String>,
}

impl Unjudged {
    /// Which held-out logs lack the column, as the end of a sentence.
    #[must_use]
    pub fn who_lacks(&self) -> String {
        let lack = if self.logs.len() == 1 { "lacks" } else { "lack" };
        format!("held-out {} {lack}", names(&self.logs.iter().map(String::as_str).collect::<Vec<_>>()))
    }
}

/// A held-out log that a model cannot predict.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Unpredicted {
    /// The log.
    pub log: String,
    /// The column that it lacks.
    pub column: &'static str,
    /// Who needs that.
    pub needed_by: String,
}

impl Unpredicted {
    /// Why a log that is ready for another model is not predicted by this one; nothing where it is.
    #[must_use]
    pub fn of(model: &Model, log: &Prepared) -> Option<Unpredicted> {
        let has = inputs(log);
        let (column, needed_by) = needed_inputs(model).into_iter().find(|(channel, _)| !has.contains(channel))?;
        Some(Unpredicted { log: log.name.clone(), column: column.name(), needed_by })
    }

    /// The same as a sentence.
    #[must_use]
    pub fn words(&self) -> String {
        let Unpredicted { log, column, needed_by } = self;
        format!(
            "Held-out {log} lacks {column}, which {needed_by} needs: the model with it does not predict that log, and is judged by the others."
        )
    }
}

/// The inputs that a log holds.
fn inputs(log: &Prepared) -> Vec<Channel> {
    log.inputs.iter().map(|(channel, _)| *channel).collect()
}

/// The first input that a model needs and a log lacks.
fn lacked(model: &Model, inputs: &[Channel]) -> Option<Channel> {
    needed_inputs(model).into_iter().map(|(channel, _)| channel).find(|channel| !inputs.contains(channel))
}

impl Evidence {
    /// The same evidence where what is found is also judged by other logs.
    #[must_use]
    pub fn judged_by(self, held: &Evidence) -> Evidence {
        let judges = held.logs.iter().map(|log| Judge { name: log.name.clone(), inputs: inputs(log) }).collect();
        self.with_judges(&Arc::new(judges))
    }

    fn with_judges(self, judges: &Arc<Vec<Judge>>) -> Evidence {
        let with = |evidence: Option<Arc<Evidence>>| evidence.map(|evidence| Arc::new(Evidence::clone(&evidence).with_judges(judges)));
        Evidence { judges: Arc::clone(judges), whole: with(self.whole), coarse: with(self.coarse), ..self }
    }

    /// Why no held-out log can judge a model with one effect more than the base has; nothing where one can, or there are none.
    pub(super) fn unjudged(&self, base: &Model, with: &Model) -> Option<Unjudged> {
        let able: Vec<&Judge> = self.judges.iter().filter(|judge| lacked(base, &judge.inputs).is_none()).collect();
        let column = able.iter().map(|judge| lacked(with, &judge.inputs)).collect::<Option<Vec<Channel>>>()?.first().copied()?;
        let lack = able.iter().filter(|judge| !judge.inputs.contains(&column)).map(|judge| judge.name.clone());
        Some(Unjudged { column: column.name(), logs: lack.collect() })
    }

    /// Whether a log to judge by lacks this input.
    pub(super) fn some_judge_lacks(&self, channel: Channel) -> bool {
        self.judges.iter().any(|judge| !judge.inputs.contains(&channel))
    }

    /// Of the evidence by which a model is judged, what that model can predict: all of it as it is where that is all, none where
    /// it is nothing.
    #[must_use]
    pub fn that_judges(self: &Arc<Self>, model: &Model) -> Option<Arc<Evidence>> {
        let able: Vec<bool> = self.logs.iter().map(|log| lacked(model, &inputs(log)).is_none()).collect();
        match able.iter().filter(|able| **able).count() {
            0 => None,
            all if all == able.len() => Some(Arc::clone(self)),
            _ => Some(Arc::new(self.of_logs(&able))),
        }
    }

    /// Whether both are of the same logs.
    pub(super) fn is_of_the_logs_of(&self, other: &Evidence) -> bool {
        self.logs.iter().map(|log| &log.name).eq(other.logs.iter().map(|log| &log.name))
    }

    /// The same evidence of some of its logs. Floors stay: they are of the sensors.
    fn of_logs(&self, kept: &[bool]) -> Evidence {
        let with = |evidence: &Option<Arc<Evidence>>| evidence.as_ref().map(|evidence| Arc::new(evidence.of_logs(kept)));
        let place_of_log: Vec<usize> =
            kept.iter().scan(0, |next, kept| Some(std::mem::replace(next, *next + usize::from(*kept)))).collect();
        let (mut segments, mut moved) = (Vec::new(), Vec::new());
        let mut begin = 0;
        for segment in &self.segments {
            moved.push((segments.len(), segment.begin, begin));
            if kept[segment.log] {
                segments.push(Segment { log: place_of_log[segment.log], begin, ..segment.clone() });
                begin += segment.counts.len();
            }
        }
        let some = |courses: &[Course]| {
            courses.iter().zip(kept).filter(|(_, kept)| **kept).map(|(course, _)| course.with_segments_at(&moved)).collect()
        };
        Evidence {
            logs: Arc::new(self.logs.iter().zip(kept).filter(|(_, kept)| **kept).map(|(log, _)| log.clone()).collect()),
            segments,
            courses: some(&self.courses),
            fine: some(&self.fine),
            whole: with(&self.whole),
            coarse: with(&self.coarse),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::frame::Frame;
    use crate::measurement::{LogFacts, read_log};
    use crate::{load_model, prepare};

    /// A log of a pulsed discharge, with the temperature of its surroundings or not.
    fn log(model: &Model, name: &str, with_surroundings: bool) -> Prepared {
        let row = |row: u32| {
            let more = if with_surroundings { ",25" } else { "" };
            format!("{},{},{}{more}\n", 10 * row, f64::from(row / 7 % 3), 4.1 - 1e-3 * f64::from(row + row % 5))
        };
        let head = if with_surroundings { "time_s,current_a,voltage_v,ambient_degc\n" } else { "time_s,current_a,voltage_v\n" };
        let text = (0..240).map(row).fold(head.to_owned(), |text, row| text + &row);
        let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
        prepare(model, &read_log(&format!("{name}.csv"), text.as_bytes(), facts).unwrap()).unwrap()
    }

    #[test]
    fn a_model_is_judged_by_the_logs_that_have_its_columns_row_for_row_as_if_there_were_no_others() {
        let base = load_model("enertech-lco-2280mah").unwrap().model;
        let warm = base.with("thermal").unwrap();
        let evidence =
            |logs: &[(&str, bool)]| Arc::new(Evidence::new(&base, logs.iter().map(|(name, with)| log(&base, name, *with)).collect()));
        let all = evidence(&[("a", true), ("b", false), ("c", true)]);
        assert!(Arc::ptr_eq(&all.that_judges(&base).unwrap(), &all), "the model as given predicts all of them");
        let (some, alone) = (all.that_judges(&warm).unwrap(), evidence(&[("a", true), ("c", true)]));
        assert!(some.is_of_the_logs_of(&alone) && !some.is_of_the_logs_of(&all));
        let predicted = |evidence: &Arc<Evidence>| {
            let frame = Frame::new(Arc::clone(&base), Arc::clone(evidence));
            frame.predict(&frame.start())
        };
        assert_eq!(predicted(&some), predicted(&alone));
        let whole = |evidence: &Arc<Evidence>| predicted(evidence.whole.as_ref().unwrap());
        assert_eq!(whole(&some), whole(&alone));
        assert!(evidence(&[("b", false)]).that_judges(&warm).is_none());
    }

    #[test]
    fn an_effect_that_no_held_out_log_can_judge_is_named_with_what_they_lack() {
        let base = load_model("enertech-lco-2280mah").unwrap().model;
        let warm = base.with("thermal").unwrap();
        let evidence = |logs: &[(&str, bool)]| Evidence::new(&base, logs.iter().map(|(name, with)| log(&base, name, *with)).collect());
        let seen = |held: &[(&str, bool)]| evidence(&[("a", true)]).judged_by(&evidence(held)).unjudged(&base, &warm);
        assert_eq!(seen(&[("b", false), ("c", true)]), None);
        let none = Unjudged { column: "ambient_degc", logs: vec!["b".to_owned(), "c".to_owned()] };
        assert_eq!(seen(&[("b", false), ("c", false)]), Some(none));
        assert_eq!(evidence(&[("a", true)]).unjudged(&base, &warm), None, "nothing is held out");
    }
}
