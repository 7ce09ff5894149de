//! The wire contract of Tender: what robots, stations and the coordinator say to each
//! other, under which key, in which bytes. No clock, no network, no disk in here.
//!
//! ```text
//!            key.rs  tender/{site}/v1/...            codec.rs  {"schema":"tender.gauge/1",...}
//!               |                                       |
//!   robot ------+-- Gauge, RobotState ----------------> |
//!   station ----+-- Gauge (packs), StationState ------> | --> coordinator
//!   robot   <---+-- RobotCommand / CommandReply ------> | <--
//!   station <---+-- StationCommand / CommandReply ----> |
//!   anyone  <---+-- Schedule, Capacity, Explanation --- |
//! ```
//!
//! | file | subject |
//! | --- | --- |
//! | `time` | UTC milliseconds |
//! | `id` | names that are always one safe chunk of a key |
//! | `estimate` | a value with its standard deviation |
//! | `key`, `pattern` | key expressions and subscriptions |
//! | `message/` | one file per subject, and `check` for the allowed ranges |
//! | `order` | which of two messages is the newer one |
//! | `codec` | JSON with the schema name first |
//! | `plain` | texts of others, without what a terminal would obey |
//! | `ros2` | what robots of ROS 2 say of their batteries |
//!
//! `WIRE.md` beside this crate says the same to people who write another implementation;
//! tests keep it in step with the code.

mod codec;
mod estimate;
mod id;
mod key;
mod message;
mod order;
mod pattern;
mod plain;
pub mod ros2;
mod time;

pub use codec::{CodecError, MAX_MESSAGE_BYTES, Message, decode, encode, encode_pretty};
pub use estimate::Estimate;
pub use id::{BayId, CommandId, IdError, PackId, RobotId, SiteId, SpareId, StationId};
pub use key::{Key, KeyError, VERSION};
pub use message::*;
pub use order::newer;
pub use pattern::{Pattern, any_coordinator_alive};
pub use plain::plain;
pub use time::{TimeError, Timestamp};
