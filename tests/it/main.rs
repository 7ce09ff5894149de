//! Whole-system tests: real processes over real Zenoh on loopback.

mod browser;
mod decisions;
mod failures;
mod network;
mod replay;
mod tidy;
