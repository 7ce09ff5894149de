//! `coordinator replay`: the journal told to a core again.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;

use super::Format;
use crate::config::Config;
use crate::core::{Core, Numbering};
use crate::replay::{Inputs, Replay};
use crate::store::{Reader, Store, shown};

/// Tells a core what the coordinators of a store were told, and checks that it decides the same.
#[derive(clap::Args)]
pub struct Args {
    /// The store: a file, or postgres://...
    store: PathBuf,
    /// Configuration with which the coordinators ran.
    #[arg(long, value_name = "FILE", default_value = "coordinator.toml")]
    config: PathBuf,
    /// Only this start of a coordinator, counted from 1.
    #[arg(long, value_name = "NUMBER")]
    epoch: Option<u64>,
    /// How to print.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What came of one start.
#[derive(Default, serde::Serialize)]
struct Told {
    epoch: u64,
    inputs: u64,
    same_decisions: usize,
    difference: Option<String>,
    /// Why it could not be told again.
    unanswered: Option<String>,
}

/// Lines that are read at a time.
const LINES: usize = 10_000;

/// Runs the command. Exit 0: everything that could be told again was decided the same; 1: something was not; 2: nothing
/// could be told again.
///
/// # Errors
/// When store or configuration cannot be read.
pub async fn execute(args: &Args) -> anyhow::Result<ExitCode> {
    let reader = Store::open_read_only(&args.store).await?;
    let starts = reader.starts().await?;
    anyhow::ensure!(!starts.is_empty(), "store {}: no start of a coordinator is in it", shown(reader.path()).display());
    let config = Config::read(&args.config)?;
    let mut told = Vec::new();
    for (index, start) in starts.iter().enumerate().filter(|(_, start)| args.epoch.is_none_or(|epoch| start.epoch == epoch)) {
        let next = starts.get(index + 1).copied();
        let unanswered = lacks(&reader, start.epoch).await?;
        told.push(match unanswered {
            Some(_) => Told { epoch: start.epoch, unanswered, ..Told::default() },
            None => replayed(&reader, &config, &args.config, *start, next).await?,
        });
    }
    anyhow::ensure!(
        !told.is_empty(),
        "--epoch {}: store {} holds the starts {} to {}",
        args.epoch.unwrap_or_default(),
        shown(reader.path()).display(),
        starts[0].epoch,
        starts[starts.len() - 1].epoch
    );
    let code = match () {
        () if told.iter().any(|told| told.difference.is_some()) => 1,
        () if told.iter().all(|told| told.unanswered.is_some()) => 2,
        () => 0,
    };
    match args.format {
        Format::Json => say!("{}", serde_json::to_string_pretty(&told)?),
        Format::Table => told.iter().for_each(say_told),
    }
    Ok(ExitCode::from(code))
}

fn say_told(told: &Told) {
    let Told { epoch, inputs, same_decisions, difference, unanswered } = told;
    match (difference, unanswered) {
        (_, Some(why)) => say!("start {epoch}: cannot be answered: {why}"),
        (None, None) => say!("start {epoch}: {inputs} inputs, {same_decisions} decisions, all the same"),
        (Some(difference), None) => {
            say!("start {epoch}: {inputs} inputs; not the same (was the configuration another one then?): {difference}");
        }
    }
}

/// What a start lacks to be told again from its beginning: inputs are kept for `telemetry.fine_days` only.
async fn lacks(reader: &Reader, epoch: u64) -> anyhow::Result<Option<String>> {
    Ok(match reader.heard_first(epoch).await? {
        Some((1, _)) => None,
        Some((_, at)) => Some(format!("the inputs before {at} are no longer kept")),
        None => Some("it was told nothing, or nothing of that is kept".to_owned()),
    })
}

async fn replayed(reader: &Reader, config: &Config, path: &Path, start: Numbering, next: Option<Numbering>) -> anyhow::Result<Told> {
    let (settings, models) = config.load(Some(path))?;
    let mut replay = Replay::new(Core::new(settings, models, start), start.epoch);
    let mut difference = None;
    // A coordinator that still writes may keep decisions between two of these reads: those read are at least the ones
    // that followed the inputs counted before, and at most those that followed the inputs read after.
    let whole = reader.heard_last(start.epoch).await?;
    let kept = reader.decisions(start, next).await.context("the decisions to compare with")?;
    'lines: loop {
        let lines = reader.heard(start.epoch, replay.told(), LINES).await?;
        for heard in &lines {
            let mut inputs = Inputs::of(&reader.message_of(heard).await?);
            if let Err(missing) = inputs.input(heard).and_then(|input| replay.tell(heard, input)) {
                difference = Some(missing);
                break 'lines;
            }
        }
        if lines.len() < LINES {
            break;
        }
    }
    let compared = replay.compare(&kept, whole);
    let same_decisions = *compared.as_ref().unwrap_or(&0);
    let difference = difference.or(compared.err());
    Ok(Told { epoch: start.epoch, inputs: replay.told(), same_decisions, difference, unanswered: None })
}

#[cfg(test)]
mod tests {
    use proto::Timestamp;

    use super::*;
    use crate::core::{Input, Numbering};
    use crate::outbox::Outbox;
    use crate::store::{Record, Retention, Sweep};

    const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/live/coordinator.toml");

    /// `after_s` seconds into 2026.
    fn at(after_s: f64) -> Timestamp {
        Timestamp::from_unix_ms(1_767_225_600_000).plus_s(after_s)
    }

    /// A coordinator that hears of nobody for a minute, and an event that nobody decided, if that is wanted.
    async fn starts(store: &Path, begin_s: f64, forged: Option<Record>) -> Store {
        let store = Store::open(store).await.unwrap();
        let numbering =
            Numbering { epoch: store.epoch(), event: store.next_event_seq().await.unwrap(), plan: store.next_plan().await.unwrap() };
        let (settings, models) = Config::read(Path::new(CONFIG)).unwrap().load(Some(Path::new(CONFIG))).unwrap();
        let (mut core, mut outbox) = (Core::new(settings, models, numbering), Outbox::new(numbering.epoch));
        (0..60).for_each(|second| outbox.handle(&mut core, at(begin_s + f64::from(second)), Input::Tick));
        let mut records = outbox.take_records();
        records.extend(forged);
        store.append(&records).await.unwrap();
        store
    }

    #[tokio::test]
    async fn a_start_whose_first_inputs_are_deleted_is_no_difference_but_no_answer_either() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("journal.db");
        let replayed = async |epoch| {
            let args = Args { store: path.clone(), config: CONFIG.into(), epoch, format: Format::Table };
            execute(&args).await.unwrap()
        };
        let [same, other, unanswered] = [0, 1, 2].map(ExitCode::from);
        starts(&path, 0.0, None).await.close().await;
        assert_eq!(replayed(None).await, same);
        let store = starts(&path, 3_600.0, None).await;
        let sweep = async |until_s: f64| {
            let retention = Retention { fine: at(until_s), coarse_s: 60.0, keep: at(-1e6) };
            store.retire(&retention, &mut Sweep::default(), || false).await.unwrap();
        };
        assert_eq!(replayed(Some(1)).await, same);
        sweep(30.0).await;
        assert_eq!(lacks(&store, 1).await.unwrap().unwrap(), "the inputs before 2026-01-01T00:00:30.000Z are no longer kept");
        assert_eq!((replayed(Some(1)).await, replayed(Some(2)).await, replayed(None).await), (unanswered, same, same));
        sweep(600.0).await;
        assert_eq!(lacks(&store, 1).await.unwrap().unwrap(), "it was told nothing, or nothing of that is kept");
        assert_eq!((replayed(Some(1)).await, replayed(None).await), (unanswered, same));
        sweep(7_200.0).await;
        assert_eq!(replayed(None).await, unanswered, "nothing is left to be told");
        // What was decided otherwise is told as that.
        store.close().await;
        let event = Record::Event(crate::store::tests::event(999, "r1 joined"));
        starts(&path, 10_000.0, Some(event)).await.close().await;
        assert_eq!(replayed(None).await, other);
    }
}
