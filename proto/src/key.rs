//! Every key expression of Tender, built and parsed here and nowhere else.

use std::fmt;

use crate::id::{IdError, PackId, RobotId, SiteId, StationId};

/// Version of the key layout, the third chunk of every key.
pub const VERSION: &str = "v1";

/// First chunk of every key.
pub(crate) const ROOT: &str = "tender";

/// What one key of a site stands for. The layouts are listed in `WIRE.md`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Key {
    /// Fuel gauge of a robot's battery ([`Gauge`](crate::Gauge)).
    RobotGauge(RobotId),
    /// Where a robot is in its work ([`RobotState`](crate::RobotState)).
    RobotState(RobotId),
    /// Liveliness token of a robot's agent.
    RobotAlive(RobotId),
    /// Query that carries a [`RobotCommand`](crate::RobotCommand).
    RobotCommand(RobotId),
    /// Bays, packs and spares of a station ([`StationState`](crate::StationState)).
    StationState(StationId),
    /// Fuel gauge of one pack of a station ([`Gauge`](crate::Gauge)).
    PackGauge(StationId, PackId),
    /// Liveliness token of a station's agent.
    StationAlive(StationId),
    /// Query that carries a [`StationCommand`](crate::StationCommand).
    StationCommand(StationId),
    /// Liveliness token of the coordinator.
    CoordinatorAlive,
    /// The plan in force ([`Schedule`](crate::Schedule)).
    Schedule,
    /// How many more robots the packs can service ([`Capacity`](crate::Capacity)).
    Capacity,
    /// Why a robot is scheduled as it is ([`Explanation`](crate::Explanation)).
    Explain(RobotId),
    /// What a simulated station feeds to a simulated robot ([`SimSupply`](crate::SimSupply)).
    SimSupply(StationId, RobotId),
    /// What a simulated robot draws from a simulated station ([`SimDraw`](crate::SimDraw)).
    SimDraw(StationId, RobotId),
}

impl Key {
    /// The key expression of this key at `site`.
    pub fn build(&self, site: &SiteId) -> String {
        let key = |tail: fmt::Arguments<'_>| format!("{ROOT}/{site}/{VERSION}/{tail}");
        match self {
            Self::RobotGauge(id) => key(format_args!("robot/{id}/gauge")),
            Self::RobotState(id) => key(format_args!("robot/{id}/state")),
            Self::RobotAlive(id) => key(format_args!("robot/{id}/alive")),
            Self::RobotCommand(id) => key(format_args!("robot/{id}/command")),
            Self::StationState(id) => key(format_args!("station/{id}/state")),
            Self::PackGauge(id, pack) => key(format_args!("station/{id}/pack/{pack}/gauge")),
            Self::StationAlive(id) => key(format_args!("station/{id}/alive")),
            Self::StationCommand(id) => key(format_args!("station/{id}/command")),
            Self::CoordinatorAlive => key(format_args!("coordinator/alive")),
            Self::Schedule => key(format_args!("coordinator/schedule")),
            Self::Capacity => key(format_args!("coordinator/capacity")),
            Self::Explain(id) => key(format_args!("coordinator/explain/{id}")),
            Self::SimSupply(at, id) => key(format_args!("sim/station/{at}/robot/{id}/supply")),
            Self::SimDraw(at, id) => key(format_args!("sim/station/{at}/robot/{id}/draw")),
        }
    }

    /// Reads a concrete key expression back: the inverse of [`Key::build`].
    pub fn parse(text: &str) -> Result<(SiteId, Self), KeyError> {
        let chunks: Vec<&str> = text.split('/').collect();
        let [ROOT, site, version, tail @ ..] = chunks.as_slice() else {
            return Err(match chunks[0] {
                ROOT => KeyError::UnknownShape(text.to_owned()),
                _ => KeyError::NotOurs(text.to_owned()),
            });
        };
        if *version != VERSION {
            return Err(match is_version(version) {
                true => KeyError::OtherVersion { key: text.to_owned(), found: (*version).to_owned() },
                false => KeyError::UnknownShape(text.to_owned()),
            });
        }
        let site = SiteId::new(*site);
        let robot = |id: &str| RobotId::new(id);
        let station = |id: &str| StationId::new(id);
        let key = match *tail {
            ["robot", id, "gauge"] => robot(id).map(Self::RobotGauge),
            ["robot", id, "state"] => robot(id).map(Self::RobotState),
            ["robot", id, "alive"] => robot(id).map(Self::RobotAlive),
            ["robot", id, "command"] => robot(id).map(Self::RobotCommand),
            ["station", id, "state"] => station(id).map(Self::StationState),
            ["station", id, "pack", pack, "gauge"] => station(id).and_then(|id| Ok(Self::PackGauge(id, PackId::new(pack)?))),
            ["station", id, "alive"] => station(id).map(Self::StationAlive),
            ["station", id, "command"] => station(id).map(Self::StationCommand),
            ["coordinator", "alive"] => Ok(Self::CoordinatorAlive),
            ["coordinator", "schedule"] => Ok(Self::Schedule),
            ["coordinator", "capacity"] => Ok(Self::Capacity),
            ["coordinator", "explain", id] => robot(id).map(Self::Explain),
            ["sim", "station", at, "robot", id, "supply"] => station(at).and_then(|at| Ok(Self::SimSupply(at, robot(id)?))),
            ["sim", "station", at, "robot", id, "draw"] => station(at).and_then(|at| Ok(Self::SimDraw(at, robot(id)?))),
            _ => return Err(KeyError::UnknownShape(text.to_owned())),
        };
        match (site, key) {
            (Ok(site), Ok(key)) => Ok((site, key)),
            (Err(source), _) | (_, Err(source)) => Err(KeyError::BadId { key: text.to_owned(), source }),
        }
    }
}

fn is_version(chunk: &str) -> bool {
    chunk.strip_prefix('v').is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
}

/// Why a key expression could not be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// The key belongs to some other program.
    #[error("`{0}` is not a key of Tender: those start with `tender/`")]
    NotOurs(String),
    /// The key belongs to another version of Tender.
    #[error("`{key}` has key layout {found}; this program speaks {VERSION}")]
    OtherVersion {
        /// The whole key.
        key: String,
        /// The version chunk in it.
        found: String,
    },
    /// The key starts like one of ours, but no key has this shape.
    #[error("`{0}` has none of the shapes of the keys of Tender (listed in WIRE.md)")]
    UnknownShape(String),
    /// A chunk that has to be an id is not one.
    #[error("in key `{key}`: {source}")]
    BadId {
        /// The whole key.
        key: String,
        /// Which id, and what is wrong with it.
        source: IdError,
    },
}
