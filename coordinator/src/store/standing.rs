//! Whether what happens is kept: what an operator must hear of a disk that is full or a server that is gone.

use proto::Timestamp;

/// How the store of a running coordinator stands.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Standing {
    /// Why nothing can be written; none where it can.
    pub failing: Option<Failing>,
    /// Records that wait to be written.
    pub waiting: usize,
    /// Records that were never written since the coordinator started: telemetry that had to make room, and what a store will not take.
    pub dropped: u64,
}

/// A store that cannot be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failing {
    /// Since when.
    pub since: Timestamp,
    /// What it says.
    pub why: String,
}

impl Standing {
    /// One line for people, where something is wrong.
    #[must_use]
    pub fn complaint(&self) -> Option<String> {
        let Failing { since, why } = self.failing.as_ref()?;
        Some(format!(
            "since {since}: {why}; the fleet is served on, {} records wait in memory, {} were dropped",
            self.waiting, self.dropped
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_fails_is_complained_of() {
        let fine = Standing { failing: None, waiting: 12, dropped: 3 };
        assert_eq!(fine.complaint(), None);
        let failing = Failing { since: Timestamp::from_unix_ms(1_767_225_600_000), why: "tender.db: the disk is full".to_owned() };
        let complaint = Standing { failing: Some(failing), ..fine }.complaint().unwrap();
        let expected = "since 2026-01-01T00:00:00.000Z: tender.db: the disk is full; the fleet is served on, 12 records wait in memory, 3 were dropped";
        assert_eq!(complaint, expected);
    }
}
