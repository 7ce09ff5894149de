//! What every Tender process needs beside its own core.
//!
//! ```text
//!   pure    ledger.rs   which commands were answered, and how
//!           body.rs     a simulated pack behind a simulated gauge IC
//!           publish.rs  how often an agent speaks; silence.rs how long no coordinator was heard
//!           selector.rs when a station changes packs, and what happens meanwhile
//!           mission.rs  what a robot or vehicle does, leg by leg; vehicle.rs a station that drives
//!           depot.rs    when a simulated station's packs are exchanged elsewhere
//!           charging.rs what a station can charge, and with how much
//!           wire.rs     estimates and readings on the wire
//!   shell   clock.rs    real or accelerated time; pace.rs how far a source has to go on
//!           network.rs  the [network] table; access.rs who may say what
//!           one_thread.rs over TLS, one thread both reads and writes
//!           session.rs  a Zenoh session: publish, ask, serve, watch; sole.rs nobody else speaks as this agent
//!           newest.rs   the newest word of each who speaks, until somebody looks
//!           files.rs    texts and models from disk
//!           settings.rs keys from flags and environment over those of the file
//!           log.rs      what this program says of itself, on stderr; diary.rs what agents say there
//!           telemetry.rs logs that the lab reads; live_log.rs those of a running agent, log_file.rs on a disk that may be full
//!           memory.rs   what a restarted agent must not have forgotten
//!           stop.rs     when to end
//!           manual.rs   manual pages and completions of a command line
//! ```
//!
//! Robot agent, station agent and coordinator use it; nothing here knows which of them it serves.

pub mod access;
mod age;
pub mod body;
mod charging;
pub mod clock;
mod depot;
mod diary;
pub mod files;
pub mod ledger;
mod live_log;
pub mod log;
mod log_file;
pub mod manual;
mod memory;
pub mod mission;
mod network;
mod newest;
mod one_thread;
mod pace;
mod publish;
mod selector;
pub mod session;
pub mod settings;
mod silence;
mod sole;
mod stop;
mod telemetry;
mod vehicle;
mod wire;

pub use age::Age;
pub use charging::Charging;
pub use clock::{Clock, ClockConfig};
pub use depot::Depot;
pub use diary::Diary;
pub use ledger::{Ledger, refused};
pub use live_log::LiveLog;
pub use memory::MemoryFile;
pub use network::{NetworkConfig, Tls};
pub use newest::Newest;
pub use one_thread::begin_with_one_thread;
pub use pace::{LOOK_S, Pace, Step, Stride};
pub use publish::{Due, Publish};
pub use selector::{ChangeKind, SelectorConfig, UNTIL_EMPTY, check_rule};
pub use session::Link;
pub use silence::{LOOK_MAX_S, Silence};
pub use sole::Sole;
pub use stop::told_to_stop;
pub use telemetry::{LOAD_INPUTS, STATION_INPUTS, Telemetry, load_columns};
pub use vehicle::{Part, Vehicle, VehicleLeg};
pub use wire::{gauge_message, why_senseless, wire};
