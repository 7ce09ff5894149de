//! Tender's coordinator.
//!
//! ```text
//!   pure    intake.rs       what waits for the core: the newest of each sender, every change
//!           core.rs         handle(now, Input) / poll() -> Output: beliefs, plans, commands
//!             core/           hearing, planning, serving, asking
//!             fleet.rs        the newest word of each robot and station
//!             trust.rs        whether gauges can be believed; clocks.rs whose clock is off
//!             refusals.rs     who has refused a service, and until when it is not tried again
//!             models.rs       the coordinator's own models and settings
//!             forecast.rs     what a service takes
//!             watch/          whether models still explain what is measured
//!             view.rs         beliefs and models as one planning problem
//!             scheduler/      beliefs -> planner's problem -> services, capacity, words
//!             service_run.rs  a service that has begun, and the commands that carry it on
//!             outbox.rs       records before commands; replay.rs the journal told to a core again
//!             when.rs         times in words
//!             answers.rs      schedule, capacity, explanations for the wire
//!   files   config.rs       the live coordinator's configuration
//!           certs.rs        a site's certificates
//!           rmf/            fleets of Open-RMF as scenarios
//!           scenario/       scenario file -> configurations of coordinator, agents and worlds
//!   shells  service.rs      the core on tokio and Zenoh
//!           store/          what happened, in SQLite or PostgreSQL
//!           sim/            the same core and the same agents on simulated time
//!           web/            dashboard, JSON and metrics over HTTP
//!           cmd/            one file per command
//! ```

pub mod answers;
pub mod certs;
mod clocks;
pub mod cmd;
pub mod config;
pub mod core;
mod counted;
pub mod fleet;
pub mod forecast;
mod intake;
pub mod models;
pub mod outbox;
pub mod refusals;
pub mod replay;
pub mod rmf;
pub mod scenario;
pub mod scheduler;
pub mod service;
pub mod service_run;
pub mod sim;
pub mod store;
mod trust;
pub mod view;
mod watch;
pub mod web;
mod when;

pub use crate::config::Config;
pub use crate::core::{Core, Input, Numbering, Output};
