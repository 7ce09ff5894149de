//! What every Tender process needs beside its own core.
//!
//! ```text
//!   pure    ledger.rs   which commands were answered, and how
//!           body.rs     a simulated pack behind a simulated gauge IC
//!           publish.rs  how often an agent speaks
//!           selector.rs what happens while a simulated station changes packs
//!           charging.rs what a station can charge, and with how much
//!           wire.rs     estimates and readings on the wire
//!   shell   clock.rs    real or accelerated time
//!           session.rs  a Zenoh session from a [network] table; publish, serve, watch
//!           files.rs    texts and models from disk, and logging to stderr
//!           stop.rs     when to end
//! ```
//!
//! Robot agent, station agent and coordinator use it; nothing here knows which of them it serves.

mod age;
pub mod body;
mod charging;
pub mod clock;
pub mod files;
pub mod ledger;
mod publish;
mod selector;
pub mod session;
mod stop;
mod wire;

pub use age::Age;
pub use charging::Charging;
pub use clock::{Clock, ClockConfig};
pub use ledger::{Ledger, refused};
pub use publish::{Due, Publish};
pub use selector::SelectorConfig;
pub use session::{Link, NetworkConfig};
pub use stop::told_to_stop;
pub use wire::{gauge_message, wire};
