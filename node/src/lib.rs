//! What every Tender process needs beside its own core.
//!
//! ```text
//!   pure    ledger.rs   which commands were answered, and how
//!           body.rs     a simulated pack behind a simulated gauge IC
//!           wire.rs     estimates on the wire
//!   shell   clock.rs    real or accelerated time
//!           session.rs  a Zenoh session from a [network] table; publish, serve, watch
//!           files.rs    texts and models from disk, and logging to stderr
//! ```
//!
//! Robot agent, station agent and coordinator use it; nothing here knows which of them it serves.

pub mod body;
pub mod clock;
pub mod files;
pub mod ledger;
pub mod session;
mod wire;

pub use clock::{Clock, ClockConfig};
pub use ledger::Ledger;
pub use session::{Link, NetworkConfig};
pub use wire::wire;
