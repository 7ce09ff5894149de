//! Regimes: the conditions under which rows were taken, to see where the error lies.
//!
//! A regime is a way to sort rows into bands. It appears when a log holds its channel and rows
//! fall into more than one band; a log without the channel has rows in none. Bands are the same
//! for all logs of a comparison.

mod bands;
mod battery;
mod robot;
mod station;

use energy::{Channel, Model, System};

use crate::predict::Prediction;
use crate::prepare::Prepared;

/// One way to sort rows into bands.
#[derive(Debug, Clone, PartialEq)]
pub struct Dimension {
    /// Name for people and in JSON.
    pub name: &'static str,
    /// Name of each band.
    pub bands: Vec<String>,
    /// Sets of bands that can be said in a few words: the bands and the words.
    pub groups: Vec<(Vec<usize>, String)>,
    /// For each log, band of every row; none when the row lies in no band.
    pub of_row: Vec<Vec<Option<usize>>>,
}

impl Dimension {
    /// Whether rows that count fall into more than one band.
    fn varies(&self, logs: &[Prepared]) -> bool {
        let mut first = None;
        logs.iter().zip(&self.of_row).any(|(log, of_row)| {
            let counts = |row: usize| log.targets.iter().any(|target| target.used[row]);
            let bands = of_row.iter().enumerate().filter(|(row, _)| counts(*row)).filter_map(|(_, band)| *band);
            bands.into_iter().any(|band| *first.get_or_insert(band) != band)
        })
    }
}

/// What regimes are made of: logs and what the model says about them.
pub(crate) struct Seen<'a> {
    model: &'a Model,
    logs: &'a [Prepared],
    predictions: &'a [Prediction],
}

/// One column for each log, none where a log does not have it.
type Columns<'a> = Vec<Option<&'a [f64]>>;

impl<'a> Seen<'a> {
    /// A measured channel, or else a predicted one; none when no log has it.
    fn channel(&self, channel: Channel) -> Option<Columns<'a>> {
        let of = |(log, prediction): (&'a Prepared, &'a Prediction)| {
            let input = log.inputs.iter().find(|(known, _)| *known == channel).map(|(_, values)| values.as_slice());
            input.or_else(|| prediction.of(channel))
        };
        let columns: Columns<'a> = self.logs.iter().zip(self.predictions).map(of).collect();
        columns.iter().any(Option::is_some).then_some(columns)
    }
}

/// Every way to sort the rows of these logs that makes sense for the model's system.
#[must_use]
pub fn dimensions(model: &Model, logs: &[Prepared], predictions: &[Prediction]) -> Vec<Dimension> {
    let seen = Seen { model, logs, predictions };
    let own = match model.system {
        System::Battery => battery::dimensions(&seen),
        System::Robot => robot::dimensions(&seen),
        System::Station => station::dimensions(&seen),
    };
    own.into_iter().chain([by_log(logs)]).filter(|dimension| dimension.varies(logs)).collect()
}

fn by_log(logs: &[Prepared]) -> Dimension {
    let bands: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
    let groups = bands.iter().enumerate().map(|(index, name)| (vec![index], format!("in {name}"))).collect();
    let of_row = logs.iter().enumerate().map(|(index, log)| vec![Some(index); log.time_s.len()]).collect();
    Dimension { name: "log", bands, groups, of_row }
}
