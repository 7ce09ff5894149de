//! Whole-system tests: real processes over real Zenoh on loopback.

mod decisions;
mod failures;
mod kills;
mod network;
mod replay;
mod security;
mod tidy;
