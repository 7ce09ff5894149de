//! What happened last, or the part of it that somebody asks for.

use energy::document::hint;
use proto::{Event, EventKind, RobotId};

use crate::store::Reader;

/// Which events.
#[derive(clap::Args)]
pub(super) struct Args {
    /// How many of them, counted from the last one back.
    #[arg(long, alias = "events", value_name = "N", default_value_t = 40)]
    last: usize,
    /// Only what happened to this robot.
    #[arg(long, value_name = "ID")]
    robot: Option<RobotId>,
    /// Only events of this kind, such as `service_done`.
    #[arg(long, value_name = "KIND", value_parser = kind)]
    kind: Option<EventKind>,
}

/// The kind of that name.
fn kind(name: &str) -> Result<EventKind, String> {
    let known = EventKind::ALL.map(|kind| kind.to_string());
    let found = EventKind::ALL.into_iter().zip(&known).find(|(_, known)| *known == name);
    found.map(|(kind, _)| kind).ok_or_else(|| {
        let near = hint(name, known.iter().map(String::as_str));
        format!("there is no such kind of event{near} Known: {}", known.join(", "))
    })
}

/// Reads them, oldest first.
///
/// # Errors
/// When the store cannot be read, or holds nothing of that robot: with the nearest of which it does.
pub(super) async fn read(store: &Reader, Args { last, robot, kind }: &Args) -> anyhow::Result<Vec<Event>> {
    let events = store.events_of(*last, robot.as_ref(), *kind).await?;
    if let Some(robot) = robot.as_ref().filter(|_| events.is_empty()) {
        let known = store.robots_of_events().await?;
        if !known.iter().any(|known| known == robot.as_ref()) {
            let near = hint(robot.as_ref(), known.iter().map(String::as_str));
            anyhow::bail!("the store holds no event of robot {robot}{near} Known: {}", known.join(", "));
        }
    }
    if events.is_empty() {
        eprintln!("the store holds no such event");
    }
    Ok(events)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{Record, Store};

    fn event(seq: u64, kind: EventKind, robot: &str) -> Record {
        let at = proto::Timestamp::from_unix_ms(1_767_225_600_000);
        Record::Event(Event { at, seq, kind, robot: Some(robot.parse().unwrap()), station: None, pack: None, text: String::new() })
    }

    #[test]
    fn a_misspelt_kind_is_told_the_nearest_one() {
        assert_eq!(kind("promise_broken"), Ok(EventKind::PromiseBroken));
        let refused = kind("promise_brocken").unwrap_err();
        assert!(refused.contains("did you mean `promise_broken`?") && refused.contains("service_done"), "{refused}");
    }

    #[tokio::test]
    async fn history_is_narrowed_before_it_is_cut_short() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tender.db");
        let store = Store::open_for(&path, "site").await.unwrap();
        let (done, lost) = (EventKind::ServiceDone, EventKind::Lost);
        let records =
            [(1, done, "r-1"), (2, lost, "r-1"), (3, done, "r-1"), (4, done, "r-2")].map(|(seq, kind, robot)| event(seq, kind, robot));
        store.append(&records).await.unwrap();
        store.close().await;
        let store = Store::open_read_only(&path).await.unwrap();
        let read = async |last: usize, robot: Option<&str>, kind: Option<EventKind>| {
            let events = read(&store, &Args { last, robot: robot.map(|robot| robot.parse().unwrap()), kind }).await?;
            anyhow::Ok(events.iter().map(|event| event.seq).collect::<Vec<_>>())
        };
        assert_eq!(read(2, None, None).await.unwrap(), [3, 4]);
        assert_eq!(read(2, Some("r-1"), None).await.unwrap(), [2, 3]);
        assert_eq!(read(2, None, Some(done)).await.unwrap(), [3, 4]);
        assert_eq!(read(1, Some("r-1"), Some(done)).await.unwrap(), [3]);
        assert_eq!(read(9, Some("r-2"), Some(lost)).await.unwrap(), [0; 0]);
        let refused = read(9, Some("r-3"), None).await.unwrap_err().to_string();
        assert!(refused.contains("did you mean `r-") && refused.ends_with("Known: r-1, r-2"), "{refused}");
    }
}
