//! Whole-system tests: real processes over real Zenoh on loopback.

mod browser;
mod decisions;
mod doubts;
mod failures;
mod kills;
mod network;
mod operations;
mod pages;
mod python;
mod reference;
mod replay;
mod secured;
mod security;
mod sources;
mod stations;
mod tidy;
